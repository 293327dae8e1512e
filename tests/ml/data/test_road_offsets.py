"""Offsets from roads' axes: of a data set's tiles, and as the truth of clouds without labels."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ml.data.classes import IGNORED, LabelMapping
from ml.data.road_offsets import with_offsets
from ml.data.sources import Source, read_tiles
from ml.segmentation.loading import read_domains
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, toy, write_cloud, write_pointcept

ORIGIN = np.array([4e5, 5.6e6, 100.0])
"""Where `road_block` puts its points."""
PAVED = {
    "axis": "axis.csv",
    "paved": [[-3.0, 2.0]],
    "classes": {"0": "verge", "1": "road"},
    "groups": {"road": ["road", "road_marking"], "verge": ["ground", "vegetation", "road_furniture"]},
}


def write_axis(folder: Path, last: float = 60.0) -> None:
    """Write an axis along x, from the origin of the points to some station."""
    rows = [f"{ORIGIN[0] + station},{ORIGIN[1] + 10.0},{ORIGIN[2]}" for station in np.arange(0.0, last + 0.5)]
    (folder / "axis.csv").write_text("\n".join(["x,y,z", *rows]))


def write_scene(data: Path) -> None:
    """Write a data set of one scene with its axis, 10 m beside the tile's origin."""
    write_pointcept(data, "train", [replace(road_tile(2000, 1, "road"), origin=ORIGIN)])
    scene = data / "scenes" / "road"
    scene.mkdir(parents=True)
    write_cloud(scene / "cloud.laz", road_block(10, 1))
    line = [(ORIGIN + [x, 10.0, 0.0]).tolist() for x in (0.0, 60.0)]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": line}}
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    collection = {"type": "FeatureCollection", "crs": crs, "features": [feature]}
    (scene / "centerline.geojson").write_text(json.dumps(collection))


def test_offsets_are_those_of_the_scenes_axis(tmp_path: Path) -> None:
    write_scene(tmp_path)
    source = Source(path=str(tmp_path), split="train")
    (tile,) = with_offsets(tmp_path, read_tiles(source, class_scheme("5"), None))
    assert tile.offset is not None
    assert np.abs(tile.offset - (tile.coord[:, 1] - 10.0)).max() < 1e-3
    inner_folder = tmp_path / "pointcept" / "classes-5"
    (inner_tile,) = with_offsets(inner_folder, read_tiles(source, class_scheme("5"), None))
    assert np.array_equal(inner_tile.offset, tile.offset)
    (tmp_path / "scenes" / "road" / "centerline.geojson").unlink()
    (bare_tile,) = with_offsets(tmp_path, read_tiles(source, class_scheme("5"), None))
    assert bare_tile.offset is None


@pytest.mark.parametrize("effects", [{}, {"strip": {"probability": 0.5}}, {"stripes": 0.2}])
def test_a_training_reads_axes_where_an_effect_needs_them(tmp_path: Path, effects: dict[str, object]) -> None:
    write_scene(tmp_path / "real")
    domains = read_domains(toy(tmp_path, effects=effects))
    assert {tile.offset is not None for tile in domains["real"]} == {bool(effects)}


def test_offsets_beside_an_axis_are_the_truth_of_a_cloud_without_labels(tmp_path: Path) -> None:
    write_axis(tmp_path, last=40.0)
    cloud = write_cloud(tmp_path / "scan.laz", road_block(3000, 1))
    (tmp_path / "paved.json").write_text(json.dumps(PAVED))
    source = Source(path=str(cloud), mapping=str(tmp_path / "paved.json"), tile=1000.0)
    assert source.targets(class_scheme("5")) == ("road", "verge")
    (tile,) = read_tiles(source, class_scheme("5"), None)
    place = tile.coord + tile.origin - ORIGIN
    offset = place[:, 1] - 10.0
    beside = (place[:, 0] > 0.0) & (place[:, 0] < 40.0)
    clear = beside & (np.abs(offset + 3.0) > 0.01) & (np.abs(offset - 2.0) > 0.01)
    paved = (offset > -3.0) & (offset < 2.0)
    assert (tile.segment[clear & paved] == 0).all()
    assert (tile.segment[clear & ~paved] == 1).all()
    assert (tile.segment[place[:, 0] > 41.5] == IGNORED).all()
    assert (place[:, 0] > 41.5).any()
    assert (clear & paved).any()


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"axis": ""}, "axis and paved must be given together"),
        ({"paved": []}, "axis and paved must be given together"),
        ({"paved": [[2.0, -3.0]]}, "two ascending offsets"),
    ],
)
def test_pavements_need_an_axis_and_ascend(change: dict[str, object], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        LabelMapping.from_dict({**PAVED, **change})
