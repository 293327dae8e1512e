"""Commands that read clouds and lists of clouds, on files made wrong by chance: done, or one line and nothing left."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.tools.divide import read_polygon
from synthroads_addon.comparison.clouds import find_clouds
from tests.fuzz.test_bytes import ORIGIN, SHORT, foreign
from tests.helpers.clouds.random_points import make_points
from tests.helpers.files.command_runs import IN, OUT, MakeWorkplace, fuzz_commands, wrong_file
from tests.helpers.files.mutations import accepted, damaged, for_all, fuzz, json_files, yaml_files

RING = [[0.0, 0.0], [50.0, 0.0], [50.0, 50.0], [0.0, 0.0]]
POLYGON = {"type": "Polygon", "coordinates": [RING, [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 1.0]]]}
POLYGONS = [
    POLYGON,
    {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": POLYGON}]},
    {"type": "MultiPolygon", "coordinates": [[RING], [RING]]},
]
LIST = {
    "type": "CloudList",
    "version": "1.0",
    "clouds": [
        {"cloud": "a.laz", "class_field": "label", "road": "11", "marking": "64", "decibels": 30.0},
        {"cloud": "b.laz", "axis": "a.csv", "paved": [[-7.0, -1.0]], "lines": [-4.0], "scanner": [0, 0, 10]},
        {"cloud": "c.laz", "scanner": [0.0, 0.0, 2.0], "azimuth_deg": [-90.0, 90.0]},
    ],
}
CLOUD = f"{IN}/cloud.las"
COMMANDS: dict[str, tuple[str, ...]] = {
    "info": ("cloud", "info", CLOUD),
    "subsample": ("cloud", "subsample", CLOUD, "-o", f"{OUT}/a.laz", "--grid", "1"),
    "map-intensity": ("cloud", "map-intensity", CLOUD, "-o", f"{OUT}/a.laz", "--target", CLOUD),
    "convert": ("cloud", "convert", CLOUD, "-o", f"{OUT}/a.ply"),
    "merge": ("cloud", "merge", CLOUD, CLOUD, "-o", f"{OUT}/a.laz"),
    "crop": ("cloud", "crop", CLOUD, "-o", f"{OUT}/a.laz", "--heights", "-1e4", "1e4"),
    "tile": ("cloud", "tile", CLOUD, "-o", OUT, "--size", "20"),
    "preview": ("cloud", "preview", CLOUD, "-o", OUT),
    "compare": ("compare", CLOUD, CLOUD, "-o", OUT),
    "calibrate": ("calibrate", "--real", CLOUD, "--material", "asphalt=road", "--save", f"{OUT}/table.json"),
    "centerline": ("centerline", CLOUD, "--run", "none", "-o", f"{OUT}/a.geojson"),
    "reconstruct": ("reconstruct", CLOUD, "-o", OUT, "--no-picture"),
}


@fuzz_commands(3, 180)
@pytest.mark.parametrize("name", COMMANDS)
def test_commands(name: str, tmp_path: Path, workplace: MakeWorkplace, count: int) -> None:
    own = tmp_path / "own.laz"
    with open_writer(own, 25832, ORIGIN, 65535 * 900.0) as writer:
        writer.write(make_points(2000))
    files = [own.read_bytes(), foreign(tmp_path / "other.las", "1.4", 6).read_bytes()]
    (tmp_path / "in").mkdir()
    place = workplace(tmp_path, f"{COMMANDS[name][0]}: cloud, {name}", writes=name != "info")
    place.run_all(wrong_file(COMMANDS[name], "cloud.las", damaged(files, SHORT, head=900)), count)


@fuzz(20, 1000)
def test_lists_of_clouds(tmp_path: Path, count: int) -> None:
    path = tmp_path / "clouds.yaml"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: find_clouds(path))

    for_all(yaml_files([LIST]), count, body)


@fuzz(20, 1000)
def test_polygons(tmp_path: Path, count: int) -> None:
    path = tmp_path / "polygon.geojson"

    def read() -> Any:
        rings = read_polygon(path)
        assert all(np.isfinite(ring).all() for ring in rings)

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(read)

    assert [len(read_polygon(_written(path, one))) for one in POLYGONS] == [2, 2, 2]
    for_all(json_files(POLYGONS), count, body)


def _written(path: Path, data: object) -> Path:
    path.write_text(json.dumps(data))
    return path
