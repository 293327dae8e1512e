"""Roads: reading scenes and real scans, the cache, cropping."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ml.data.effects import SequenceEffects
from ml.data.points import Points
from ml.data.roads import STRIP, crop_road, cut_strip, read_measured, read_scene, scene_folders
from ml.data.slices import SliceDataset, SliceSettings, collate
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.points import PointBlock
from tests.helpers.roads.analytic_roads import parameters, points, roads

REAL = Path(__file__).resolve().parents[3].parent / "shared" / "real"


def test_cropping_a_road_leaves_its_axis_inside_but_not_in_the_middle() -> None:
    road = roads()[0]
    assert road.truth is not None
    cut = crop_road(road, 0.75, seed=1)
    assert len(cut) == len(crop_road(road, 0.75, seed=1))
    assert not np.array_equal(cut.xyz, crop_road(road, 0.75, seed=2).xyz)
    station, offset = road.truth.axis.project(cut.xyz)
    number = np.floor(station).astype(int) - int(np.floor(station.min()))
    high, low = np.full(number.max() + 1, -np.inf), np.full(number.max() + 1, np.inf)
    np.maximum.at(high, number, offset)
    np.minimum.at(low, number, offset)
    inner = slice(2, -2)
    assert (high[inner] > 0.0).all()
    assert (low[inner] < 0.0).all()
    place = (-low / (high - low))[inner]
    assert place.std() > 0.12
    # Both sides by themselves, each slice by itself.
    assert abs(np.corrcoef(high[inner], low[inner])[0, 1]) < 0.3
    assert abs(np.corrcoef(high[inner][1:], high[inner][:-1])[0, 1]) < 0.3
    whole = np.abs(road.truth.axis.project(road.xyz)[1]).max()
    assert 0.2 * whole < high[inner].min() < 0.4 * whole
    long = crop_road(road, 0.75, seed=1, length=20.0)
    assert len(long) != len(cut)
    with pytest.raises(InputError, match="crop"):
        crop_road(replace(road, truth=None), 0.5, 1)


def write_scene(folder: Path) -> Points:
    """Write a scene of a data set without Blender."""
    cloud, road = points(), parameters()
    folder.mkdir(parents=True)
    (folder / "parameters.json").write_text(canonical_json(road.to_dict()))
    zeros = np.zeros(len(cloud))
    block = PointBlock(
        xyz=cloud.xyz + cloud.origin,
        intensity=cloud.intensity.astype(np.float64),
        rgb=(65535.0 * cloud.rgb).astype(np.uint16),
        class_id=cloud.class_id,
        instance_id=zeros.astype(np.uint32),
        return_number=np.ones(len(cloud), dtype=np.uint8),
        number_of_returns=np.ones(len(cloud), dtype=np.uint8),
        gps_time=zeros,
        scan_angle_deg=zeros.astype(np.float32),
        strip=zeros.astype(np.uint16),
        range=zeros + 50.0,
        incidence_deg=zeros.astype(np.float32),
    )
    scheme = class_scheme("5").as_stored()
    with open_writer(folder / "cloud.laz", 25832, cloud.origin, 65535.0, (), scheme) as writer:
        writer.write(block)
    return cloud


def test_a_strip_is_as_wide_as_seed_and_name_say() -> None:
    road = roads()[0]
    truth = road.known_truth
    reaches = []
    for seed in range(8):
        strip = cut_strip(road, seed)
        assert len(cut_strip(road, seed)) == len(strip) <= len(road)
        assert strip.truth is truth
        reaches.append(np.abs(truth.axis.project(strip.xyz)[1]).max())
    assert STRIP[0] - 0.1 < min(reaches) < 0.6 * max(reaches)
    assert max(reaches) <= STRIP[1] + 1e-6


def test_reading_a_scene_with_and_without_cache(tmp_path: Path) -> None:
    scene, cache = tmp_path / "set" / "scenes" / "plain-01", tmp_path / "cache"
    cloud = write_scene(scene)
    (fresh,) = read_scene(scene, "road")
    assert len(fresh) == len(cloud)
    assert (np.diff(fresh.station) >= 0.0).all()
    np.testing.assert_allclose(fresh.reference.project(fresh.xyz[::97])[0], fresh.station[::97], atol=0.01)
    (kept,) = read_scene(scene, "road", cache)
    (mapped_road,) = read_scene(scene, "road", cache)
    assert isinstance(mapped_road.xyz, np.memmap)
    for name in ("xyz", "intensity", "rgb", "class_id", "station"):
        assert np.array_equal(getattr(kept, name), getattr(mapped_road, name))
    assert mapped_road.class_names == fresh.class_names
    assert len(read_scene(scene, "carriageway", cache)) == 2
    one, other = (SliceDataset([road], SliceSettings(), 3, 1)[2] for road in (fresh, mapped_road))
    assert torch.equal(one["coord"], other["coord"])
    assert torch.equal(one["corridor"], other["corridor"])
    # Another cloud under the same name isn't taken for it.
    (scene / "cloud.laz").unlink()
    with pytest.raises(MissingFileError):
        read_scene(scene, "road", cache)


def test_scenes_of_a_split(tmp_path: Path) -> None:
    scene = {"seed": 1, "status": "done", "split": "train"}
    scenes = [
        scene | {"name": "a-01"},
        scene | {"name": "a-02", "split": "test"},
        scene | {"name": "a-03", "status": "failed"},
    ]
    manifest = {"type": "Manifest", "version": "1.0", "title": "t", "generator": "g", "recipe_sha256": "0"}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest | {"complete": False, "scenes": scenes}))
    assert scene_folders(tmp_path, "train") == [tmp_path / "scenes" / "a-01"]
    with pytest.raises(InputError, match="the data set has test, train"):
        scene_folders(tmp_path, "validation")


@pytest.mark.skipif(not REAL.is_dir(), reason="no real scans here")
def test_a_real_road() -> None:
    cloud = REAL / "als_rural2lane_t211-278.laz"
    road = read_measured(cloud, cloud.with_name("als_rural2lane_t211-278_axis.csv"), "carriageway")
    assert road.has_color
    data = SliceDataset([road], SliceSettings(truth="carriageway"), 8, 1, SequenceEffects())
    batch = collate([data[number] for number in range(8)])
    assert torch.isfinite(batch["center"]).all()
    assert torch.isnan(batch["corridor"][..., 0]).all()
    assert torch.isfinite(batch["corridor"][..., 5]).all()
    assert batch["mask"].float().mean() > 0.05
