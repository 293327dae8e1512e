"""Effects on sequences of slices: what they do, and that the truth goes along."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from ml.data.corridor import CORRIDOR
from ml.data.effects import SequenceEffects
from ml.data.effects.base import drop_colors
from ml.data.effects.lighting import _waves, change_intensities, tint_colors
from ml.data.effects.slices import (
    SequenceCrop,
    crop_sides,
    drop_parts,
    mirror,
    mirror_side,
    tilt_and_jitter,
    turn_round,
)
from ml.data.frames import displace_frames, frames_along
from ml.data.samples import LEFT, RIGHT, Stretch
from ml.data.slices import SliceSettings, cut_stretch
from ml.registry import apply_effects
from synthroads_addon.base.errors import InputError
from tests.helpers.roads.analytic_roads import roads

NONE = SequenceEffects(
    mirror=0.0,
    turn_round=0.0,
    crop=SequenceCrop(probability=0.0),
    **dict.fromkeys(("alone", "dropout", "hidden", "empty", "jitter", "tilt"), 0.0),
    **dict.fromkeys(("plain", "contrast", "verge", "paint", "repaint"), 0.0),
    gamma=(1.0, 1.0),
    **dict.fromkeys(("falloff", "speckle", "patches", "stripes", "footprint", "color_drop", "tint"), 0.0),
)
SETTINGS = SliceSettings(points_per_slice=100_000, half_width=18.0)


ALWAYS = SequenceEffects(mirror=1.0, turn_round=1.0, alone=1.0)


def with_crop(crop: SequenceCrop) -> SequenceEffects:
    return NONE.model_copy(update={"crop": crop})


def relight(one: Stretch, effects: SequenceEffects, random: np.random.Generator) -> None:
    for effect in (change_intensities, drop_colors, tint_colors):
        effect(one, effects, random)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def cut(kind: str = "road", which: int = 0, seed: int = 4, spacing: int = 1) -> Stretch:
    """Return ten slices of a road, the same for each call; effects may change them."""
    return deepcopy(_cut(kind, which, seed, spacing))


@cache
def _cut(kind: str, which: int, seed: int, spacing: int) -> Stretch:
    road = roads(kind)[which]  # type: ignore[arg-type]
    assert road.truth is not None
    frames = displace_frames(frames_along(road.truth.axis), rng(seed), 12.0, 2.0, 100.0)
    frames = frames.select(slice(40, 40 + 10 * spacing, spacing))
    return cut_stretch(road, frames, SETTINGS.model_copy(update={"truth": kind}))


def contents(one: Stretch) -> dict[str, np.ndarray]:
    names = ("coord", "number", "strength", "color", "center", "corridor", "lines", "room")
    return {name: getattr(one, name).copy() for name in names}


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    for name, values in one.items():
        np.testing.assert_allclose(values, other[name], atol=1e-9, err_msg=name)


def test_effects_of_no_strength_change_nothing() -> None:
    one = cut()
    before = contents(one)
    for before_thinning in (True, False):
        apply_effects("centerline", one, NONE, rng(), before_thinning=before_thinning)
    # A power of 1 is left, and intensities as a share of the largest.
    after = contents(one)
    np.testing.assert_allclose(after["strength"] * np.max(before["strength"]), before["strength"], rtol=1e-9)
    del before["strength"], after["strength"]
    same(before, after)


@pytest.mark.parametrize("effect", [mirror, turn_round])
def test_mirror_and_turn_are_their_own_inverse(effect: object) -> None:
    one = cut("carriageway")
    before, direction = contents(one), one.frames.direction.copy()
    effect(one, ALWAYS, rng())  # type: ignore[operator]
    assert not np.allclose(one.center, before["center"])
    effect(one, ALWAYS, rng())  # type: ignore[operator]
    after = contents(one)
    np.testing.assert_allclose(np.cos(one.frames.direction - direction), 1.0)
    for name in ("center", "corridor", "lines", "room"):
        np.testing.assert_allclose(after[name], before[name], atol=1e-9)
    order = [np.lexsort((values["coord"][:, 1], values["number"])) for values in (before, after)]
    np.testing.assert_allclose(after["coord"][order[1]], before["coord"][order[0]], atol=1e-9)


def test_edges_stay_left_and_right() -> None:
    left, right = CORRIDOR.index("left_edge"), CORRIDOR.index("right_edge")
    for effect in (mirror, turn_round):
        one = cut()
        width = one.corridor[:, left] - one.corridor[:, right]
        effect(one, ALWAYS, rng())
        turned = one.corridor[:, left] - one.corridor[:, right]
        np.testing.assert_allclose(np.sort(turned), np.sort(width), atol=1e-9)
        paved = one.coord[one.paved, 1]
        number = one.number[one.paved]
        assert (paved <= one.corridor[number, left] + 0.15).all()
        assert (paved >= one.corridor[number, right] - 0.15).all()


def extents(one: Stretch) -> tuple[np.ndarray, np.ndarray]:
    y = one.coord[:, 1] - one.center[one.number]
    left, right = np.zeros(10), np.zeros(10)
    np.maximum.at(left, one.number, y)
    np.maximum.at(right, one.number, -y)
    return left, right


def test_cropped_sides_lie_in_their_limits_about_the_truth() -> None:
    crop = SequenceCrop(probability=1.0, reach=(6.0, 10.0), share=0.5, steady=0.0)
    lefts, rights = [], []
    for seed in range(60):
        one = cut()
        crop_sides(one, with_crop(crop), rng(seed))
        left, right = extents(one)
        assert max(left.max(), right.max()) <= 10.0
        assert min(left.min(), right.min()) > 0.5 * 6.0 - 0.6
        lefts.append(left)
        rights.append(right)
    # Sides by themselves: of the strip as of the slice.
    assert abs(np.corrcoef(np.mean(lefts, axis=1), np.mean(rights, axis=1))[0, 1]) < 0.4
    assert np.std(lefts, axis=1).min() > 0.5
    middle = (np.array(lefts) - np.array(rights)).ravel() / 2.0
    assert middle.std() > 0.8


def test_steady_cuts_are_the_same_in_all_slices() -> None:
    one = cut()
    crop_sides(one, with_crop(SequenceCrop(probability=1.0, reach=(6.0, 10.0), share=0.5, steady=1.0)), rng(1))
    left, right = extents(one)
    assert np.ptp(left) < 0.8
    assert np.ptp(right) < 0.8


def test_a_carriageway_is_cut_outside_its_edge_lines() -> None:
    for share, least in ((0.0, 3.4), (0.75, 0.5)):
        one = cut("carriageway")
        assert np.isfinite(one.lines).all()
        crop_sides(one, with_crop(SequenceCrop(probability=1.0, beyond=(0.0, 3.0), share=share)), rng(2))
        for side, reach in enumerate(extents(one)):
            assert reach.max() <= min(one.lines[0, side] + 3.0, one.room[:, side].max()) + 1e-9
            assert reach.min() > least
    narrow = cut("carriageway")
    narrow.room[:] = 1.5
    crop_sides(narrow, with_crop(SequenceCrop(probability=1.0)), rng(2))
    assert max(reach.max() for reach in extents(narrow)) <= 1.5
    untouched = cut("carriageway")
    crop_sides(untouched, with_crop(SequenceCrop(probability=0.0)), rng(2))
    assert len(untouched.number) == len(cut("carriageway").number)


@pytest.mark.parametrize("number", [0, 1])
def test_a_carriageway_stands_alone(number: int) -> None:
    """Beside its inner edge lies what lies beside the outer one, and at the edges' height."""
    one, plain = (without_shoulders(cut("carriageway", number)) for _ in range(2))
    mirror_side(one, ALWAYS, rng())
    edges = plain.paved_sides()
    inner = int(np.isfinite(plain.room).all(axis=0).argmax())
    sign = 1.0 if inner == 0 else -1.0

    def beyond(stretch: Stretch, side: float, column: int) -> np.ndarray:
        y = stretch.coord[:, 1] - stretch.center[stretch.number]
        return side * y - edges[stretch.number, column]

    assert (np.diff(one.number) >= 0).all()
    assert np.isinf(one.room).all()
    outer = beyond(plain, -sign, 1 - inner)
    kept = beyond(plain, sign, inner) <= 0.0
    assert len(one.number) == kept.sum() + (outer > 0.0).sum()
    np.testing.assert_allclose(
        np.sort(beyond(one, sign, inner)[beyond(one, sign, inner) > 0.0]), np.sort(outer[outer > 0.0]), atol=1e-9
    )
    near = [
        one.coord[(beyond(one, *side) > low) & (beyond(one, *side) <= low + 0.5), 2]
        for side, low in (((sign, inner), -0.5), ((sign, inner), 0.0))
    ]
    assert abs(np.median(near[0]) - np.median(near[1])) < 0.1
    np.testing.assert_array_equal(one.center, plain.center)


def test_where_the_inner_edge_is_unknown_no_points_are_put_nowhere() -> None:
    one = without_shoulders(cut("carriageway"))
    inner = int(np.isfinite(one.room).all(axis=0).argmax())
    one.corridor[3, (LEFT, RIGHT)[inner]] = np.nan
    mirror_side(one, ALWAYS, rng())
    assert np.isfinite(one.coord).all()
    assert (one.number == 3).sum() > 20


def test_a_slice_without_truth_is_cropped_all_the_same() -> None:
    one = cut()
    one.center[3] = np.nan
    crop_sides(one, with_crop(SequenceCrop(probability=1.0, reach=(5.0, 5.0), share=0.0)), rng())
    assert np.abs(one.coord[one.number == 3, 1]).max() <= 5.0
    assert (one.number == 3).sum() > 20


def test_dropout_holes_and_empty_slices() -> None:
    whole = len(cut().number)
    left = []
    for seed in range(40):
        one = cut()
        drop_parts(one, NONE.model_copy(update={"dropout": 0.5}), rng(seed))
        left.append(len(one.number) / whole)
        assert (np.diff(one.number) >= 0).all()
    assert min(left) > 0.45
    assert max(left) > 0.9
    one = cut()
    drop_parts(one, NONE.model_copy(update={"empty": 1.0}), rng())
    assert len(one.number) == 0
    one = cut()
    drop_parts(one, NONE.model_copy(update={"hidden": 1.0}), rng(3))
    assert 0.5 * whole < len(one.number) < whole - 20


@pytest.mark.parametrize("spacing", [1, 4])
def test_a_hole_is_as_long_as_a_vehicle(spacing: int) -> None:
    holes = []
    for seed in range(40):
        one = cut(spacing=spacing)
        x = one.coord[:, 0] + spacing * one.number
        places = {tuple(place) for place in np.column_stack([x, one.coord[:, 1]])}
        drop_parts(one, NONE.model_copy(update={"hidden": 1.0}), rng(seed))
        x = one.coord[:, 0] + spacing * one.number
        gone = np.array(sorted(places - {tuple(place) for place in np.column_stack([x, one.coord[:, 1]])}))
        holes.append(np.ptp(gone, axis=0))
    along_road, across = np.max(holes, axis=0)
    assert 8.0 < along_road <= 12.0
    assert 2.0 < across <= 3.0


@pytest.mark.parametrize("spacing", [1, 4])
def test_patches_go_on_from_slice_to_slice(spacing: int) -> None:
    ahead, later = cut(spacing=spacing), cut(spacing=spacing)
    inside = later.number < 9
    ahead.coord[:, 0] += spacing
    later.number = np.minimum(later.number + 1, 9)
    np.testing.assert_allclose(_waves(ahead, rng(5))[inside], _waves(later, rng(5))[inside], atol=1e-6)


@pytest.mark.parametrize("spacing", [1, 4])
def test_tilt_carries_the_height_along(spacing: int) -> None:
    one = cut(spacing=spacing)
    height = CORRIDOR.index("height")
    before = one.corridor[:, height].copy()
    z = one.coord[:, 2].copy()
    tilt_and_jitter(one, NONE.model_copy(update={"tilt": 0.1}), rng(1))
    # The plane that was added, found from the points, says what the centreline's height must be.
    along_road = one.coord[:, 0] + spacing * one.number
    design = np.column_stack([along_road, one.coord[:, 1], np.ones(len(z))])
    grade, cross, zero = np.linalg.lstsq(design, one.coord[:, 2] - z, rcond=None)[0]
    assert abs(grade) > 0.001
    assert abs(cross) > 0.001
    added = grade * spacing * np.arange(10) + cross * one.center + zero
    np.testing.assert_allclose(one.corridor[:, height] - before, added)


def test_jitter() -> None:
    one = cut()
    before = one.coord.copy()
    tilt_and_jitter(one, NONE.model_copy(update={"jitter": 0.05}), rng(1))
    assert 0.001 < (one.coord - before).std() < 0.05


def relit(name: str, strength: object, seed: int) -> tuple[Stretch, np.ndarray]:
    """Return a sequence after one effect on its intensities, and the logarithm of the factors on them."""
    one = cut()
    plain = one.strength.copy()
    relight(one, NONE.model_copy(update={name: strength}), rng(seed))
    assert (one.strength > 0.0).all()
    return one, np.log(one.strength / plain)


def test_a_power_keeps_the_order_of_intensities() -> None:
    spreads = []
    for seed in range(8):
        one, _ = relit("gamma", (0.2, 2.0), seed)
        assert (np.diff(one.strength[np.argsort(cut().strength)]) >= -1e-12).all()
        spreads.append(np.ptp(np.log(one.strength)) / np.ptp(np.log(cut().strength)))
    assert min(spreads) < 0.7
    assert max(spreads) > 1.4


def test_intensities_fall_off_to_the_sides() -> None:
    falls = []
    for seed in range(8):
        one, logs = relit("falloff", 4.0, seed)
        far, near = np.abs(one.coord[:, 1]) > 14.0, np.abs(one.coord[:, 1]) < 3.0
        falls.append(logs[far].mean() - logs[near].mean())
    # The scanner isn't always above the road: seen from beside it, one side may be as near as its middle.
    assert sum(fall < 0.0 for fall in falls) >= 6
    assert np.mean(falls) < -0.2


def test_two_passes_beside_each_other_light_a_place_twice() -> None:
    """Somewhere between two scanners near by, points of one place are bright and dark; from one they are alike."""
    scatter = []
    for seed in range(30):
        one, logs = relit("falloff", 4.0, seed)
        near = np.abs(one.coord[:, 1] - one.coord[0, 1]) < 0.3
        scatter.append(float(np.ptp(logs[near])))
    assert sorted(scatter)[10] < 0.3
    assert max(scatter) > 1.5


def test_a_wide_footprint_smears_lines() -> None:
    """A line gets fainter, and asphalt within half a footprint of it or of the grass brighter."""
    widest, fainter = 0.0, 0.0
    for seed in range(8):
        _, logs = relit("footprint", 2.0, seed)
        plain = cut()
        bare = plain.paved & ~plain.marked
        logs -= np.median(logs[bare])
        assert logs[plain.marked].max() < 0.3
        fainter = min(fainter, float(np.median(logs[plain.marked])))
        brighter = bare & (logs > 0.5)
        for number in range(10):
            line = plain.coord[(plain.marked | ~plain.paved) & (plain.number == number), 1]
            beside = plain.coord[brighter & (plain.number == number), 1]
            apart = np.abs(beside[:, None] - line[None, :]).min(axis=1) if len(beside) and len(line) else np.zeros(1)
            widest = max(widest, float(apart.max()))
    assert 0.3 < widest <= 1.0
    assert fainter < -0.5


def test_tracks_run_along_the_road() -> None:
    one, logs = max((relit("stripes", 1.0, seed) for seed in range(8)), key=lambda found: found[1].std())
    across = one.coord[:, 1] - one.center[one.number]
    cell = np.round(across / 0.1).astype(int) - round(across.min() / 0.1)
    counts = np.bincount(cell)
    means = np.bincount(cell, logs) / np.maximum(counts, 1)
    within = np.sqrt(np.mean((logs - means[cell]) ** 2))
    assert logs.std() > 0.3
    assert within < 0.35 * logs.std()


def test_contrast_of_the_pavement_to_what_lies_beside_it() -> None:
    steps = []
    for seed in range(8):
        one, logs = relit("contrast", 1.0, seed)
        assert np.ptp(logs[one.paved]) < 1e-9
        assert np.ptp(logs[~one.paved]) < 1e-9
        steps.append(logs[~one.paved][0] - logs[one.paved][0])
    assert min(steps) < -0.2
    assert max(steps) > 0.2


def test_worn_markings_are_darker_but_never_than_the_pavement() -> None:
    ratios = []
    for seed in range(8):
        one, _ = relit("paint", 1.0, seed)
        assert one.marked.sum() > 20
        bare = np.median(one.strength[one.paved & ~one.marked])
        ratios.append(np.median(one.strength[one.marked]) / bare)
    assert min(ratios) >= 1.0
    assert min(ratios) < 4.0
    assert max(ratios) > 7.0


def without_shoulders(one: Stretch) -> Stretch:
    """Return a stretch of which it is said that its pavement ends 0.5 m beyond the edge lines."""
    one.corridor = one.corridor.copy()
    one.corridor[:, LEFT] = one.center + one.lines[:, 0] + 0.5
    one.corridor[:, RIGHT] = one.center - one.lines[:, 1] - 0.5
    return one


def test_a_carriageways_lines_are_painted_otherwise() -> None:
    """The lane line comes solid and wide, and goes; edge lines go one by one or both; a road's lines stay."""
    solid, gone, kept = set(), set(), 0
    edges = {0: 0, 1: 0, 2: 0}
    for seed in range(60):
        one, plain = without_shoulders(cut("carriageway")), cut("carriageway")
        relight(one, NONE.model_copy(update={"repaint": 0.4}), rng(seed))
        assert (one.strength > 0.0).all()
        y = plain.coord[:, 1] - plain.center[plain.number]
        bare = np.median(one.strength[plain.paved & ~plain.marked])
        bright = one.strength > 2.0 * bare
        middle = plain.paved & (np.abs(y) < 0.06)
        solid.add(bool(bright[middle].all()))
        places = {"lane": 0.0 * y, "left": plain.lines[plain.number, 0], "right": -plain.lines[plain.number, 1]}
        missing = set()
        for name, place in places.items():
            line = plain.marked & (np.abs(y - place) < 0.3)
            if line.any() and not bright[line].any():
                missing.add(name)
            kept += int(bright[line].any())
        gone |= missing
        edges[len(missing & {"left", "right"})] += 1
    assert solid == {True, False}
    assert gone == {"lane", "left", "right"}
    assert kept > 40
    assert min(edges[1], edges[2]) > 10
    assert edges[0] > 3
    _, logs = relit("repaint", 0.5, 3)
    assert np.ptp(logs) < 1e-9
    with_shoulders, plain = cut("carriageway"), cut("carriageway")
    relight(with_shoulders, NONE.model_copy(update={"repaint": 0.5}), rng(3))
    ratio = with_shoulders.strength / plain.strength
    assert np.ptp(ratio) < 1e-9 * ratio.max()


def test_verges_of_rural_roads_look_like_asphalt() -> None:
    shares = []
    for seed in range(20):
        one = without_shoulders(cut("carriageway"))
        y = one.coord[:, 1] - one.center[one.number]
        one.paved &= (one.paved_sides()[one.number, 0] >= y) & (-y <= one.paved_sides()[one.number, 1])
        one.strength = np.where(one.paved, one.strength, 0.12)
        beyond = np.maximum(y - one.paved_sides()[one.number, 0], -y - one.paved_sides()[one.number, 1])
        near, far = ~one.paved & (beyond < 1.5), ~one.paved & (beyond > 2.0)
        before = one.strength.copy()
        relight(one, NONE.model_copy(update={"verge": 2.0}), rng(seed))
        bare = np.median(one.strength[one.paved & ~one.marked])
        scale = bare / np.median(before[one.paved & ~one.marked])
        np.testing.assert_allclose(one.strength[far], scale * before[far], rtol=1e-6)
        shares.append(float(np.mean(one.strength[near] < 2.0 * bare)))
    assert min(shares) < 0.6
    assert max(shares) > 0.9


@pytest.mark.parametrize("name", ["speckle", "patches"])
def test_patches_are_smooth_and_speckle_is_not(name: str) -> None:
    one, logs = max((relit(name, 0.5, seed) for seed in range(8)), key=lambda found: found[1].std())
    assert 0.1 < logs.std() < 0.8
    third = one.number == 3
    steps = np.abs(np.diff(logs[third][np.argsort(one.coord[third, 1])])).mean()
    assert steps < 0.7 * logs.std() if name == "patches" else steps > 0.9 * logs.std()


def test_colours() -> None:
    one = cut()
    relight(one, NONE.model_copy(update={"color_drop": 1.0}), rng())
    assert one.color is None
    one = cut()
    before = one.color.copy()
    relight(one, NONE.model_copy(update={"tint": 0.5}), rng(2))
    assert one.color.min() >= 0.0
    assert one.color.max() <= 1.0
    factor = (one.color / before)[one.color.max(axis=1) < 1.0]
    np.testing.assert_allclose(factor.std(axis=0), 0.0, atol=1e-9)
    assert factor.mean(axis=0).std() > 0.01


def test_some_intensities_stay_as_they_are() -> None:
    """A noiseless simulation's clouds are among the training data."""
    plain = cut().strength
    same_as_before = 0
    for seed in range(40):
        one = cut()
        relight(one, SequenceEffects(plain=0.5), rng(seed))
        same_as_before += int(np.array_equal(one.strength, plain))
    assert 10 < same_as_before < 30


def test_points_without_intensity_stay_without() -> None:
    one = cut()
    one.strength[:] = 0.0
    relight(one, SequenceEffects(), rng())
    assert (one.strength == 0.0).all()


def test_a_sequence_without_points_passes_through() -> None:
    one = cut()
    one.keep(np.zeros(len(one.number), dtype=bool))
    for seed in range(5):
        copy = replace(one)
        apply_effects("centerline", copy, SequenceEffects(hidden=1.0), rng(seed), before_thinning=True)
        apply_effects("centerline", copy, SequenceEffects(), rng(seed))
        assert len(copy.coord) == 0


def test_wrong_limits_are_refused() -> None:
    with pytest.raises(InputError, match=r"reach is .*: must be two ascending numbers"):
        SequenceEffects.from_dict({"crop": {"reach": [9.0, 4.0]}}, "effects")
    with pytest.raises(InputError, match=r"gamma is .*: must be two ascending"):
        SequenceEffects.from_dict({"gamma": [1.0, 0.0]}, "effects")
    with pytest.raises(InputError, match="dropout"):
        SequenceEffects.from_dict({"dropout": 1.0}, "effects")
    with pytest.raises(InputError, match="mirrored"):
        SequenceEffects.from_dict({"mirrored": 1.0}, "effects")
