"""Effects on whole tiles: strips along a road's axis, with objects or without, and the ground's brightness."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ml.data.crops import NO_EFFECTS, CropDataset, CropSettings, Draw, Seeds, change_tile
from ml.data.effects import CropEffects
from ml.data.tiles import CloudTile, scalings
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream
from tests.helpers.clouds.segmentation_data import NAMES

GROUND, ROAD, MARKING, VEGETATION, FURNITURE = range(5)
SETTINGS = CropSettings(points=500, intensity="robust", classes=NAMES)
HALF_WIDTH = 40.0


def road_with_verges() -> CloudTile:
    """Return a tile of a straight road along x with two carriageways, 3 to 11 m from its axis, plants over all."""
    random = np.random.default_rng(1)
    coord = np.column_stack([random.uniform(0.0, 60.0, 12_000), random.uniform(-HALF_WIDTH, HALF_WIDTH, 12_000)])
    offset = coord[:, 1].astype(np.float32)
    away = np.abs(offset)
    segment = np.where((away > 3.0) & (away < 11.0), ROAD, GROUND)
    segment[(away > 6.9) & (away < 7.1)] = MARKING
    segment[random.random(12_000) < 0.2] = VEGETATION
    strength = np.choose(segment, [0.4, 0.2, 0.6, 0.5, 0.5]).astype(np.float32)
    xyz = np.column_stack([coord, np.zeros(12_000)]).astype(np.float32)
    return CloudTile("scene", np.zeros(3), xyz, None, strength, segment.astype(np.int16), offset)


def effects(**options: Any) -> CropEffects:
    """Return the options of effects that change nothing else."""
    return CropEffects.from_dict({**NO_EFFECTS.to_dict(), **options})


def cut_tiles(count: int = 60, **options: Any) -> list[CloudTile]:
    """Return a tile after random cuts by options of strips."""
    tile = road_with_verges()
    cut = effects(strip={"probability": 1.0, "carriageway": 0.0, **options})
    return [change_tile(tile, SETTINGS, cut, stream(7, "cut", number)) for number in range(count)]


def test_strips_reach_as_far_as_the_options_say() -> None:
    reaches = np.array([np.abs(tile.offset).max() for tile in cut_tiles(reach=(6.0, 30.0)) if tile.offset is not None])
    assert reaches.min() >= 5.5
    assert reaches.max() <= 30.0
    # Uniform logarithms: half of the strips are narrower than the geometric mean, 13.4 m.
    assert np.mean(reaches < np.sqrt(6.0 * 30.0)) == pytest.approx(0.5, abs=0.2)


def test_the_share_of_strips_without_objects_is_that_of_the_options() -> None:
    for share in (0.0, 0.5, 1.0):
        without = [not (tile.segment == VEGETATION).any() for tile in cut_tiles(ground_only=share)]
        assert np.mean(without) == pytest.approx(share, abs=0.17)
    kept = cut_tiles(1, ground_only=1.0)[0]
    assert set(np.unique(kept.segment)) <= {GROUND, ROAD, MARKING}


def test_strips_of_a_carriageway_lie_about_its_middle() -> None:
    for tile in cut_tiles(20, carriageway=1.0, reach=(8.0, 8.0), ground_only=0.0):
        assert tile.offset is not None
        assert abs(tile.offset.min() + tile.offset.max()) / 2.0 == pytest.approx(7.0, abs=0.3)
        assert np.ptp(tile.offset) == pytest.approx(8.0, abs=0.2)


def test_a_tile_that_hardly_reaches_into_the_strip_stays_as_it_is() -> None:
    """Of a handful of points, dropout may leave none, and an empty crop ends the training."""
    tile = road_with_verges()
    assert tile.offset is not None
    cut = effects(strip={"probability": 1.0, "carriageway": 0.0, "ground_only": 0.0, "reach": (6.0, 6.0)})
    inside, outside = np.flatnonzero(np.abs(tile.offset) <= 6.0), np.flatnonzero(np.abs(tile.offset) > 6.0)
    for count, is_cut in ((1, False), (63, False), (64, True)):
        corner = tile.select(np.concatenate([inside[:count], outside]))
        assert (change_tile(corner, SETTINGS, cut, stream(1, "cut")) is not corner) == is_cut


def test_a_tile_without_axis_and_one_by_chance_stay_as_they_are() -> None:
    tile = replace(road_with_verges(), offset=None)
    assert change_tile(tile, SETTINGS, effects(strip={"probability": 1.0}), stream(1, "cut")) is tile
    tile = road_with_verges()
    assert change_tile(tile, SETTINGS, effects(), stream(1, "cut")) is tile
    kept = sum(
        change_tile(tile, SETTINGS, effects(strip={"probability": 0.5}), stream(1, "cut", number)) is tile
        for number in range(100)
    )
    assert 35 <= kept <= 65


def test_contrast_changes_the_ground_and_never_the_pavement() -> None:
    tile, factors = road_with_verges(), []
    assert tile.strength is not None
    for number in range(60):
        changed = change_tile(tile, SETTINGS, effects(contrast=1.0), stream(3, "contrast", number))
        assert changed.strength is not None
        ratio = changed.strength / tile.strength
        paved = np.isin(tile.segment, (ROAD, MARKING))
        assert np.ptp(ratio[paved]) == 0.0
        assert ratio[paved][0] == 1.0
        assert np.ptp(ratio[~paved]) < 1e-6
        factors.append(float(ratio[~paved][0]))
    logarithms = np.log(factors)
    assert np.abs(logarithms).max() <= 1.0
    assert logarithms.std() == pytest.approx(1.0 / np.sqrt(3.0), abs=0.12)


def test_a_band_beside_the_pavement_is_as_bright_as_something_between_pavement_and_verge() -> None:
    tile, shares = road_with_verges(), []
    assert tile.strength is not None
    assert tile.offset is not None
    pavement, ground = 0.2, 0.4
    distance = np.maximum(np.abs(np.abs(tile.offset) - 7.0) - 4.0, 0.0)
    for number in range(60):
        changed = change_tile(tile, SETTINGS, effects(verge_band=1.0), stream(3, "band", number))
        assert changed.strength is not None
        ratio = changed.strength / tile.strength
        assert np.all(ratio[tile.segment != GROUND] == 1.0)
        assert np.all(ratio[distance > 3.3] == 1.0)
        band = (tile.segment == GROUND) & (distance > 0.0) & (distance < 0.4)
        assert np.ptp(ratio[band]) < 1e-6
        shares.append(np.log(changed.strength[band][0] / pavement) / np.log(ground / pavement))
    assert 0.19 < min(shares) < 0.4
    assert 0.8 < max(shares) <= 1.0 + 1e-6
    tile = replace(tile, offset=None)
    assert change_tile(tile, SETTINGS, effects(verge_band=1.0), stream(3, "band")) is tile


def test_stripes_vary_across_the_road_and_not_along_it() -> None:
    tile = road_with_verges()
    assert tile.strength is not None
    assert tile.offset is not None
    changed = change_tile(tile, SETTINGS, effects(stripes=0.5), stream(5, "stripes"))
    assert changed.strength is not None
    logarithm = np.log(changed.strength / tile.strength)
    cells = np.floor(tile.offset / 0.1).astype(int)
    means = np.array([logarithm[cells == cell].mean() for cell in np.unique(cells)])
    within = np.array([logarithm[cells == cell].std() for cell in np.unique(cells)])
    assert means.std() > 5.0 * within.mean()
    assert 0.0 < means.std() <= 1.0


def test_a_cut_tiles_intensities_are_scaled_by_what_is_left() -> None:
    """In the whole tile the median is the ground's; in a strip within a carriageway it is the road's."""
    tiles = [road_with_verges()]
    for strip, brightness in ((None, 0.0), ({"probability": 1.0, "carriageway": 1.0, "reach": (6.0, 6.0)}, 0.0)):
        options = effects() if strip is None else effects(strip=strip)
        draws = [Draw(0, number) for number in range(4)]
        crops = CropDataset(
            tiles, scalings(tiles, "robust"), SETTINGS, draws, Seeds(tiles, 5, balanced=False), effects=options
        )
        for number in range(4):
            crop, _ = crops.crop(number)
            assert crop.strength is not None
            typical = ROAD if strip else GROUND
            assert np.median(crop.strength[crop.segment == typical]) == pytest.approx(brightness, abs=1e-5)
            assert len(crop) <= SETTINGS.points


def test_limits_of_strips_must_ascend() -> None:
    with pytest.raises(InputError, match="two ascending numbers"):
        effects(strip={"reach": (9.0, 6.0)})
