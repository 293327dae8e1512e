"""Slices as samples: their points, that rotation, shift and mirror of the input carry over, seeds and batches."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from ml.data.corridor import CORRIDOR, Truth
from ml.data.effects import SequenceEffects
from ml.data.effects.slices import mirror, turn_round
from ml.data.frames import Frames, displace_frames, frames_along
from ml.data.points import Points
from ml.data.roads import LearningRoad
from ml.data.samples import Stretch
from ml.data.slices import (
    FEATURE_LIMIT,
    FEATURES,
    FrameSlices,
    IterableSlices,
    Sample,
    SliceDataset,
    SliceSettings,
    collate,
    cut_stretch,
    make_sample,
)
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis
from tests.helpers.roads.analytic_roads import roads

REAL = Path(__file__).resolve().parents[3].parent / "shared" / "real"
ALL_POINTS = SliceSettings(points_per_slice=100_000, half_width=18.0)


def path_of(road: LearningRoad, seed: int = 4) -> Frames:
    assert road.truth is not None
    exact = frames_along(road.truth.axis)
    return displace_frames(exact, np.random.default_rng(seed), 12.0, 2.0, 100.0)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def as_sample(cut: Stretch, settings: SliceSettings = ALL_POINTS) -> Sample:
    return make_sample(cut, settings, rng(), 0, np.arange(len(cut.center)))


def test_slices_hold_the_points_that_lie_in_them() -> None:
    road = roads()[0]
    frames = path_of(road).select(slice(30, 50))
    found = road.slices(frames, 15.0, 1.0)
    xy = road.xyz[:, :2].astype(np.float64)
    for number in range(len(frames)):
        delta, way = xy - frames.position[number], frames.direction[number]
        x = np.cos(way) * delta[:, 0] + np.sin(way) * delta[:, 1]
        y = np.cos(way) * delta[:, 1] - np.sin(way) * delta[:, 0]
        inside = np.flatnonzero((np.abs(x) <= 0.5) & (np.abs(y) <= 15.0))
        mine = found.number == number
        assert found.index[mine].tolist() == inside.tolist()
        np.testing.assert_allclose(found.xy[mine], np.column_stack([x, y])[inside], atol=1e-9)


def test_a_sample_is_what_it_says() -> None:
    road = roads()[0]
    frames = path_of(road).select(slice(40, 50))
    item = as_sample(cut_stretch(road, frames, ALL_POINTS))
    assert item["coord"].dtype == item["feat"].dtype == torch.float32
    assert item["offset"][-1] == len(item["coord"]) == len(item["feat"])
    starts = [0, *item["offset"][:-1].tolist()]
    for number, (start, end) in enumerate(zip(starts, item["offset"].tolist(), strict=True)):
        own = item["coord"][start:end].double().numpy()
        assert np.abs(own[:, 0]).max() <= 0.5
        assert abs(np.median(own[:, 2])) < 1e-6
        # Back to the cloud's coordinates: points of the road lie on its surface.
        x, y, way, z = item["frame"][number].numpy()
        turn = np.array([[np.cos(way), np.sin(way), 0.0], [-np.sin(way), np.cos(way), 0.0], [0.0, 0.0, 1.0]])
        back = own @ turn + [x, y, z]
        nearest = np.linalg.norm(road.xyz[None, :, :] - back[:3, None, :], axis=2).min(axis=1)
        assert nearest.max() < 1e-3
    assert road.truth is not None
    on_axis = frames.at(item["center"].numpy())
    assert np.abs(road.truth.axis.project(on_axis)[1]).max() < 1e-4
    height = item["corridor"][:, CORRIDOR.index("height")].double().numpy() + item["frame"][:, 3].numpy()
    np.testing.assert_allclose(height, road.truth.axis.elevation(road.truth.axis.project(on_axis)[0]), atol=1e-3)


def test_intensities_are_scaled_within_the_sequence() -> None:
    road = roads()[0]
    frames = path_of(road).select(slice(40, 50))
    one = as_sample(cut_stretch(road, frames, ALL_POINTS))["feat"]
    assert abs(float(one[:, 0].median())) < 1e-6
    low, high = np.percentile(one[:, 0], (10, 90))
    assert abs(high - low - 1.0) < 1e-3
    brighter = replace(road, intensity=road.intensity * np.float32(7.0))
    np.testing.assert_allclose(as_sample(cut_stretch(brighter, frames, ALL_POINTS))["feat"], one, atol=1e-4)
    spike = road.intensity.copy()
    spike[::50] = 1000.0
    assert as_sample(cut_stretch(replace(road, intensity=spike), frames, ALL_POINTS))["feat"].max() == FEATURE_LIMIT


def test_missing_features_are_small_noise() -> None:
    road = replace(roads()[0], has_color=False)
    bare = replace(road, intensity=np.zeros_like(road.intensity))
    feat = as_sample(cut_stretch(bare, path_of(road).select(slice(40, 50)), ALL_POINTS))["feat"]
    assert (feat[:, FEATURES.index("has_color")] == 0.0).all()
    assert 0.005 < float(feat[:, : FEATURES.index("has_color")].std()) < 0.02
    flat = replace(road, intensity=np.full_like(road.intensity, 0.25))
    feat = as_sample(cut_stretch(flat, path_of(road).select(slice(40, 50)), ALL_POINTS))["feat"]
    assert (feat[:, :2] == 0.0).all()


def same(one: Sample, other: Sample, atol: float) -> None:
    """Hold two samples equal but for the order of a slice's points and the place of the frames."""
    assert one["offset"].tolist() == other["offset"].tolist()
    starts = [0, *one["offset"][:-1].tolist()]
    for start, end in zip(starts, one["offset"].tolist(), strict=True):
        rows = [torch.cat([item["coord"], item["feat"]], dim=1)[start:end].numpy() for item in (one, other)]
        rows = [part[np.lexsort(np.round(part[:, 1::-1], 2).T)] for part in rows]
        np.testing.assert_allclose(np.sort(rows[0][:, 1]), np.sort(rows[1][:, 1]), atol=atol)
        np.testing.assert_allclose(np.sort(rows[0][:, 2]), np.sort(rows[1][:, 2]), atol=atol)
        np.testing.assert_allclose(np.sort(rows[0][:, 3]), np.sort(rows[1][:, 3]), atol=atol)
    for name in ("center", "corridor"):
        np.testing.assert_allclose(one[name], other[name], atol=atol, err_msg=name)


def line_mapped(axis: MeasuredAxis | None, turn: np.ndarray, by: np.ndarray) -> MeasuredAxis | None:
    return None if axis is None else MeasuredAxis(axis.points @ turn.T + by, axis.joined)


def mapped(road: LearningRoad, turn: np.ndarray, by: np.ndarray) -> LearningRoad:
    """Return a road whose points and truth are turned (or mirrored) and shifted, sorted anew."""
    truth = road.truth
    assert truth is not None
    flipped = np.linalg.det(turn) < 0.0
    left, right = (truth.right, truth.left) if flipped else (truth.left, truth.right)
    axis = line_mapped(truth.axis, turn, by)
    assert axis is not None
    moved = replace(
        truth,
        axis=axis,
        left=line_mapped(left, turn, by),
        right=line_mapped(right, turn, by),
        lines=truth.lines[:, ::-1] if flipped else truth.lines,
        room=truth.room[:, ::-1] if flipped else truth.room,
    )
    cloud = Points(
        origin=road.origin,
        xyz=road.xyz @ turn.T + by,
        intensity=road.intensity,
        rgb=road.rgb.astype(np.float32) / np.float32(255.0),
        class_id=road.class_id,
        class_names=road.class_names,
        has_color=road.has_color,
    )
    reference = line_mapped(road.reference, turn, by)
    assert reference is not None
    return LearningRoad.of_points(road.name, cloud, reference, moved)


@pytest.mark.parametrize("kind", ["road", "carriageway"])
@pytest.mark.parametrize("degrees", [0.0, 37.0, 180.0, -100.0])
def test_rotation_and_shift_of_the_input_change_nothing_in_the_frames(kind: str, degrees: float) -> None:
    angle, by = np.deg2rad(degrees), np.array([310.0, -150.0, 12.0])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    for road in roads(kind):  # type: ignore[arg-type]
        frames = path_of(road).select(slice(40, 50))
        moved = Frames(frames.position @ turn[:2, :2].T + by[:2], frames.direction + angle, frames.station)
        one = as_sample(cut_stretch(road, frames, ALL_POINTS))
        same(one, as_sample(cut_stretch(mapped(road, turn, by), moved, ALL_POINTS)), atol=2e-3)


@pytest.mark.parametrize("kind", ["road", "carriageway"])
def test_a_mirrored_cloud_gives_the_mirrored_sample(kind: str) -> None:
    turn = np.diag([1.0, -1.0, 1.0])
    for road in roads(kind):  # type: ignore[arg-type]
        frames = path_of(road).select(slice(40, 50))
        flipped = Frames(frames.position * [1.0, -1.0], -frames.direction, frames.station)
        cut = cut_stretch(road, frames, ALL_POINTS)
        mirror(cut, SequenceEffects(mirror=1.0), rng())
        other = cut_stretch(mapped(road, turn, np.zeros(3)), flipped, ALL_POINTS)
        same(as_sample(cut), as_sample(other), atol=1e-3)
        np.testing.assert_allclose(cut.lines, other.lines, atol=1e-6)
        np.testing.assert_allclose(cut.room, other.room, atol=1e-6)


def test_seeing_the_road_against_its_direction() -> None:
    road = roads("carriageway")[0]
    frames = path_of(road).select(slice(40, 50))
    cut = cut_stretch(road, frames, ALL_POINTS)
    turn_round(cut, SequenceEffects(turn_round=1.0), rng())
    assert (np.diff(cut.number) >= 0).all()
    other = cut_stretch(road, frames.reverse(), ALL_POINTS)
    same(as_sample(cut), as_sample(other), atol=1e-4)
    np.testing.assert_allclose(cut.lines, other.lines, atol=1e-6)
    np.testing.assert_allclose(cut.room, other.room, atol=1e-6)


def test_a_slice_has_at_most_its_number_of_points_each_as_likely() -> None:
    road = roads()[0]
    settings = SliceSettings(points_per_slice=50, half_width=18.0)
    frames = path_of(road).select(slice(40, 50))
    item = make_sample(cut_stretch(road, frames, settings), settings, rng(), 0, np.arange(10))
    assert np.diff([0, *item["offset"].tolist()]).tolist() == [50] * 10
    drawn = [
        make_sample(cut_stretch(road, frames, settings), settings, np.random.default_rng(seed), 0, np.arange(10))
        for seed in range(40)
    ]
    y = np.concatenate([item["coord"][:, 1] for item in drawn])
    whole = as_sample(cut_stretch(road, frames, ALL_POINTS))["coord"][:, 1].numpy()
    shares = [np.histogram(values, bins=8, range=(-18, 18))[0] / len(values) for values in (y, whole)]
    np.testing.assert_allclose(shares[0], shares[1], atol=0.01)


def test_a_carriageway_shows_nothing_beyond_the_middle_of_the_median() -> None:
    for road in roads("carriageway"):
        cut = cut_stretch(road, path_of(road).select(slice(40, 50)), ALL_POINTS)
        y = cut.coord[:, 1] - cut.center[cut.number]
        inner = np.where(np.isfinite(cut.room[0]))[0][0]
        reach = (y if inner == 0 else -y).max()
        assert cut.room[0, inner] - 0.3 < reach <= cut.room[:, inner].max()


def dataset(seed: int = 3, samples: int = 20, **changes: object) -> SliceDataset:
    settings = SliceSettings(points_per_slice=64, half_width=15.0).model_copy(update=changes)
    return SliceDataset(
        [*roads(), *roads(section="RQ25", design_class="EKA3")], settings, samples, seed, SequenceEffects()
    )


def equal(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return all(torch.equal(torch.nan_to_num(one[key], 9.0), torch.nan_to_num(other[key], 9.0)) for key in one)


def test_samples_depend_on_seed_epoch_and_number_alone() -> None:
    data, again = dataset(), dataset()
    backwards = [again[number] for number in reversed(range(20))][::-1]
    assert all(equal(one, other) for one, other in zip((data[n] for n in range(20)), backwards, strict=True))
    assert not equal({"center": data[0]["center"]}, {"center": data[1]["center"]})
    assert not equal({"center": data[0]["center"]}, {"center": dataset(seed=4)[0]["center"]})
    again.set_epoch(1)
    assert not equal({"center": data[0]["center"]}, {"center": again[0]["center"]})
    assert {int(data[number]["road"]) for number in range(20)} == {0, 1}
    with pytest.raises(IndexError):
        data[20]


def test_workers_give_the_same_samples() -> None:
    data = dataset(samples=6)
    alone = list(DataLoader(data, batch_size=2, collate_fn=collate))
    shared = list(DataLoader(data, batch_size=2, collate_fn=collate, num_workers=2))
    assert all(equal(one, other) for one, other in zip(alone, shared, strict=True))
    endless = IterableSlices(data)
    first = list(islice(iter(endless), 8))
    assert equal(first[5], data[5])
    data.set_epoch(1)
    assert equal(first[6], data[0])
    loader = iter(DataLoader(endless, batch_size=None, num_workers=2))
    assert all(equal(one, other) for one, other in zip(first, islice(loader, 8), strict=False))


def test_the_path_strays_in_the_window_about_the_truth() -> None:
    data = SliceDataset(roads(), SliceSettings(points_per_slice=8), 150, 1)
    items = [data[number] for number in range(150)]
    center = torch.stack([item["center"] for item in items])
    # A turned frame at the road's very end looks past it.
    known = ~torch.isnan(center)
    assert known.float().mean() > 0.99
    assert 5.0 < center[known].abs().max() < 6.3
    assert 3.0 < center[known].std() < 4.0
    angle = np.rad2deg(torch.stack([item["corridor"][:, CORRIDOR.index("heading")] for item in items]))
    assert 1.0 < angle[known].std() < 5.0


def test_batches_are_padded() -> None:
    data = dataset()
    items = [data[number] for number in range(4)]
    batch = collate(items)
    assert batch["coord"].shape[:2] == (4, 10)
    assert batch["coord"].shape[2] <= 64
    assert batch["mask"].sum() == sum(len(item["coord"]) for item in items)
    for number, item in enumerate(items):
        starts = [0, *item["offset"][:-1].tolist()]
        for place, (start, end) in enumerate(zip(starts, item["offset"].tolist(), strict=True)):
            mask = batch["mask"][number, place]
            assert mask[: end - start].all()
            assert not mask[end - start :].any()
            assert torch.equal(batch["coord"][number, place][mask], item["coord"][start:end])
            assert torch.equal(batch["feat"][number, place][mask], item["feat"][start:end])
            assert (batch["coord"][number, place][~mask] == 0.0).all()
    assert torch.equal(batch["frame"][2], items[2]["frame"])
    assert batch["road"].shape == (4,)


def test_a_batch_without_a_point() -> None:
    road = roads()[0]
    frames = path_of(road).select(slice(40, 50))
    away = Frames(frames.position + 500.0, frames.direction, frames.station)
    item = as_sample(cut_stretch(road, away, ALL_POINTS))
    assert item["offset"].tolist() == [0] * 10
    batch = collate([item, item])
    assert batch["coord"].shape == (2, 10, 1, 3)
    assert not batch["mask"].any()


def test_every_frame_of_a_path_is_in_a_sequence() -> None:
    road = roads()[0]
    frames = path_of(road)
    data = FrameSlices(road, frames, SliceSettings(points_per_slice=32))
    numbers = np.concatenate([data[number]["number"].numpy() for number in range(len(data))])
    assert set(numbers) == set(range(len(frames)))
    item = data[3]
    np.testing.assert_allclose(item["station"], frames.station[item["number"].numpy()])
    unknown = FrameSlices(replace(road, truth=None), frames, SliceSettings(points_per_slice=32))[0]
    assert torch.isnan(unknown["center"]).all()
    assert torch.isnan(unknown["corridor"]).all()
    assert equal(data[3], FrameSlices(road, frames, SliceSettings(points_per_slice=32))[3])


def test_roads_that_are_too_short_are_refused() -> None:
    with pytest.raises(InputError, match="known road over 399 m"):
        dataset(slices=400)
    with pytest.raises(InputError, match="at least one road must have a known road"):
        SliceDataset([replace(roads()[0], truth=None)], SliceSettings(), 1, 1)


def test_sequences_never_begin_where_the_truth_ends_in_them() -> None:
    road = roads()[0]
    assert road.truth is not None
    joined = road.truth.axis.joined.copy()
    joined[100:140] = False
    gap = Truth.of_axis(MeasuredAxis(road.truth.axis.points, joined), "road")
    data = SliceDataset([replace(road, truth=gap)], SliceSettings(points_per_slice=8), 60, 2)
    for number in range(60):
        station = data[number]["station"]
        assert gap.axis.inside(station.numpy()).all()
