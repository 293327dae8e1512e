"""Crops, effects, recipes: what the network gets to see."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from ml.data.classes import IGNORED
from ml.data.crops import (
    COORDINATE_SPAN,
    FEATURES,
    MISSING_SIGMA,
    NO_EFFECTS,
    CropDataset,
    CropSettings,
    CropStream,
    Draw,
    Seeds,
    collate,
    crop_of,
    cut_crop,
)
from ml.data.effects import CropEffects
from ml.data.samples import Crop
from ml.data.tiles import CloudTile, Scaling, scalings
from ml.registry import apply_effects
from ml.segmentation.recipes import (
    SegmentationConfiguration,
    class_shares,
    class_weights,
    map_intensities,
    plan,
)
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.road_tiles import road_tile

SETTINGS = CropSettings(points=900)


def dataset(tiles: list[CloudTile], effects: CropEffects = NO_EFFECTS, seed: int = 1, epoch: int = 0) -> CropDataset:
    """Return two crops of each tile."""
    draws = [Draw(tile, number) for tile in range(len(tiles)) for number in range(2)]
    seeds = Seeds(tiles, 5, balanced=False)
    return CropDataset(tiles, scalings(tiles, "share"), SETTINGS, draws, seeds, effects=effects, seed=seed, epoch=epoch)


def test_items_have_pointcepts_keys_shapes_and_types() -> None:
    item = dataset([road_tile()])[0]
    shapes = {name: (tuple(value.shape), value.dtype) for name, value in item.items()}
    assert shapes == {
        "coord": ((900, 3), torch.float32),
        "grid_coord": ((900, 3), torch.int32),
        "color": ((900, 3), torch.float32),
        "strength": ((900, 1), torch.float32),
        "feat": ((900, len(FEATURES)), torch.float32),
        "segment": ((900,), torch.int64),
        "offset": ((1,), torch.int64),
    }
    assert item["coord"][:, :2].mean(dim=0).abs().max() < 1e-4
    assert item["coord"][:, 2].median().abs() < 1e-4
    assert item["grid_coord"].min() == 0
    expected = torch.cat([item["coord"] / COORDINATE_SPAN, item["color"], item["strength"]], dim=1)
    assert torch.equal(item["feat"], expected)
    assert 0.0 <= item["color"].min() <= item["color"].max() <= 1.0


def test_a_crop_is_the_nearest_points_as_columns() -> None:
    tile = road_tile()
    middle = tile.coord[17]
    crop = cut_crop(tile, middle, 900, Scaling())
    away = np.hypot(*(tile.coord[:, :2] - middle[:2]).T)
    inside = np.hypot(*(crop.coord[:, :2] - middle[:2]).T)
    assert len(crop.coord) == 900
    assert inside.max() <= np.sort(away)[899] + 1e-6
    assert len(cut_crop(tile, middle, 10**6, Scaling()).coord) == len(tile)


def test_items_depend_on_seed_epoch_and_place_alone() -> None:
    tiles = [road_tile(seed=1, scene="a"), road_tile(seed=2, scene="b")]
    some = dataset(tiles, CropEffects())
    again = dataset(tiles, CropEffects())
    for place in (3, 0, 2):  # in another order
        assert all(torch.equal(some[place][name], again[place][name]) for name in some[place])
    loader = DataLoader(again, batch_size=2, num_workers=2, collate_fn=collate)
    batch = next(iter(loader))
    assert torch.equal(batch["feat"], torch.cat([some[0]["feat"], some[1]["feat"]]))
    for other in (dataset(tiles, CropEffects(), epoch=1), dataset(tiles, CropEffects(), seed=2)):
        assert not torch.equal(some[0]["coord"], other[0]["coord"])


def test_batch_says_where_each_crop_ends() -> None:
    tiles = [road_tile(), road_tile(300, 2)]
    batch = collate([dataset(tiles)[place] for place in (0, 2, 1)])
    assert batch["offset"].tolist() == [900, 1200, 2100]
    assert len(batch["coord"]) == len(batch["segment"]) == 2100


def test_missing_features_are_small_noise() -> None:
    bare = replace(road_tile(), color=None, strength=None)
    item = dataset([bare])[0]
    for name in ("color", "strength"):
        assert item[name].std() == pytest.approx(MISSING_SIGMA, rel=0.1)
        assert item[name].mean().abs() < 3 * MISSING_SIGMA / 30
    assert torch.isfinite(item["feat"]).all()


def test_iterable_crops_are_endless_and_reproducible() -> None:
    tiles = [road_tile(seed=1), road_tile(seed=2)]
    effects = CropEffects(dropout=0.5, intensity_gain=0.3)

    def first(count: int, seed: int) -> list[torch.Tensor]:
        stream = CropStream(tiles, scalings(tiles, "share"), SETTINGS, Seeds(tiles, 5, False), effects, seed)
        return [item["feat"] for item, _ in zip(stream, range(count), strict=False)]

    some = first(9, 1)
    assert all(torch.equal(a, b) for a, b in zip(some, first(9, 1), strict=True))
    assert not torch.equal(some[0], first(1, 2)[0])
    assert min(map(len, some)) < 900  # dropout


def effect(crop: Crop, seed: int = 1, **chosen: object) -> Crop:
    """Return a crop after the chosen effects alone."""
    changed = copy(crop)
    options = NO_EFFECTS.model_copy(update=chosen)
    apply_effects("segmentation", changed, options, np.random.default_rng(seed))
    return changed


def test_effects_off_change_nothing() -> None:
    crop = crop_of(road_tile(), Scaling())
    same = effect(crop)
    np.testing.assert_allclose(same.coord, crop.coord, atol=1e-5)
    assert same.color is crop.color
    assert same.strength is crop.strength


def test_rotation_scale_mirror_and_jitter_do_what_they_say() -> None:
    crop = crop_of(replace(road_tile(), strength=None), Scaling())
    middle = crop.coord.mean(axis=0)
    before = np.linalg.norm(crop.coord - middle, axis=1)
    turned = effect(crop, rotation=True)
    np.testing.assert_allclose(np.linalg.norm(turned.coord - middle, axis=1), before, atol=1e-3)
    np.testing.assert_allclose(turned.coord[:, 2], crop.coord[:, 2], atol=1e-4)
    assert np.abs(turned.coord - crop.coord).max() > 1.0
    scaled = [effect(crop, seed, smallest_scale=0.9, largest_scale=1.1) for seed in range(30)]
    factors = np.array([np.linalg.norm(c.coord - middle, axis=1)[0] / before[0] for c in scaled])
    assert 0.9 <= factors.min() < 0.93
    assert 1.07 < factors.max() <= 1.1
    mirrored = [effect(crop, seed, mirror=0.5).coord for seed in range(20)]
    sides = [np.sign(np.cross(c[100, :2] - c[0, :2], c[200, :2] - c[0, :2])) for c in mirrored]
    assert set(sides) == {-1.0, 1.0}
    noise = effect(crop, jitter=0.005, jitter_limit=0.012).coord - crop.coord
    assert noise.std() == pytest.approx(0.005, rel=0.05)
    assert np.abs(noise).max() <= 0.0121


def test_colours_are_dropped_as_often_as_asked() -> None:
    crop = crop_of(road_tile(50), Scaling())
    dropped = [effect(crop, seed, color_drop=0.2).color is None for seed in range(400)]
    assert 0.13 < np.mean(dropped) < 0.27
    assert effect(crop, intensity_drop=1.0).strength is None
    rising = replace(road_tile(50), strength=np.linspace(0.1, 1, 50, dtype=np.float32))
    other = effect(crop_of(rising, Scaling()), intensity_gain=0.4).strength
    assert other is not None
    assert (np.diff(other) > 0).all()  # another scale, the same order


def test_balanced_seeds_find_rare_classes_as_often() -> None:
    plenty, rare = road_tile(seed=1), road_tile(seed=2)
    labels = np.where(plenty.segment == 4, 0, plenty.segment).astype(np.int16)
    tiles = [replace(plenty, segment=labels), rare]  # class 4 in the second tile only

    def found(balanced: bool) -> np.ndarray:
        seeds, random = Seeds(tiles, 5, balanced), np.random.default_rng(1)
        draws = [seeds.draw(k % 2, random) for k in range(1000)]
        return np.bincount([tiles[t].segment[p] for t, p in draws], minlength=5) / 1000

    assert np.abs(found(True) - 0.2).max() < 0.05
    assert found(False)[4] < 0.05


def test_class_weights_are_the_recipes() -> None:
    tile = road_tile()
    shares = class_shares([tile, tile], 6)
    assert shares.sum() == pytest.approx(1.0)
    assert shares[5] == 0.0
    weights = class_weights(shares)
    assert weights.mean() == pytest.approx(1.0)
    assert weights[5] / weights[0] == pytest.approx((shares[0] + 0.02) / 0.02)
    half = class_weights(shares, 0.5)
    assert half[5] / half[0] == pytest.approx(np.sqrt(weights[5] / weights[0]))
    assert class_weights(shares, 0.0).tolist() == [1.0] * 6
    with pytest.raises(InputError, match="label"):
        class_shares([replace(tile, segment=np.full_like(tile.segment, IGNORED))], 5)


def test_mapping_gives_synthetic_intensities_the_real_distribution() -> None:
    synthetic = [road_tile(seed=seed, scene=f"s{seed}", gain=0.2) for seed in (1, 2)]
    real = [road_tile(seed=3, scene="r")]
    mapped = map_intensities(synthetic, real)
    want = np.quantile(real[0].strength, np.linspace(0.05, 0.95, 10))
    have = np.quantile(np.concatenate([tile.strength for tile in mapped]), np.linspace(0.05, 0.95, 10))
    before = np.quantile(np.concatenate([tile.strength for tile in synthetic]), np.linspace(0.05, 0.95, 10))
    np.testing.assert_allclose(have, want, atol=0.002)
    assert np.abs(before - want).max() > 0.1
    level = np.rint(synthetic[0].strength * 65535)  # of one level they are spread, between levels the order stays
    order = np.argsort(level, kind="stable")
    starts = np.flatnonzero(np.diff(level[order], prepend=-1))
    values = mapped[0].strength[order]
    assert (np.maximum.reduceat(values, starts)[:-1] <= np.minimum.reduceat(values, starts)[1:] + 1e-6).all()
    with pytest.raises(InputError, match="intensities"):
        map_intensities([replace(synthetic[0], strength=None)], real)


def test_plan_has_as_many_crops_of_each_domain_as_asked() -> None:
    draws = plan([4, 6], 5, None, seed=1, epoch=0)
    assert sorted((d.tile, d.number) for d in draws) == [(tile, number) for tile in range(10) for number in range(5)]
    shared = plan([4, 6], 5, 0.8, seed=1, epoch=0)
    assert len(shared) == 50
    assert sum(d.tile < 4 for d in shared) == 40
    assert len({(d.tile, d.number) for d in shared}) == 50
    assert shared == plan([4, 6], 5, 0.8, seed=1, epoch=0)
    assert shared != plan([4, 6], 5, 0.8, seed=1, epoch=1)


def test_configuration_is_the_recipe_and_refuses_what_does_not_fit() -> None:
    found = SegmentationConfiguration(task="segmentation")
    schedule, effects = found.schedule, found.effects
    assert (schedule.epochs, schedule.learning_rate, schedule.final_learning_rate) == (50, 0.01, 1e-5)
    assert (schedule.weight_decay, schedule.clip, found.batch) == (1e-4, 10.0, 16)
    assert (found.crop_points, found.crops_per_tile, found.voxel, found.label_smoothing) == (24_000, 30, 0.1, 0.2)
    assert (effects.color_drop, effects.smallest_scale, effects.largest_scale) == (0.2, 0.9, 1.1)
    assert found.fine_tuning.epochs == 30
    with pytest.raises(InputError, match=r"data\.synthetic"):
        found.needed_sources()
    for wrong, told in (
        ({"synthetic_share": 0.5, "set_up": "real"}, "mixed"),
        ({"features": ["x", "x"]}, "twice"),
        ({"voxel": 0.0}, "voxel"),
        ({"data": {"real": [{"path": "a", "splt": "train"}]}}, "split"),
    ):
        with pytest.raises(InputError, match=told):
            SegmentationConfiguration.from_dict({"task": "segmentation", **wrong})
