"""Roads of OpenDRIVE files as models: across the centreline, turned about it, and read back exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from tests.helpers.roads.lane_files import cubic, lane, lanes, road_file, section, taken, width

ROUNDING = 2e-4
TILT = f"<lateralProfile>{cubic('superelevation', 's', 0.0, 0.03, 2e-4)}</lateralProfile>"
LINE = '<roadMark sOffset="0" type="solid" width="0.15"/>'
ROADS = {
    "one direction across the line": TILT
    + lanes(
        cubic("laneOffset", "s", 0.0, 2.0, 0.0, 2e-4, -1e-6),
        section(0.0, "", lane(-1, width(0.0, 3.5) + LINE) + lane(-2, width(0.0, 3.5, 0.003), "shoulder"), LINE),
    ),
    "two directions without a median": TILT
    + lanes(
        cubic("laneOffset", "s", 0.0, -1.5, 0.01),
        section(0.0, lane(1, width(0.0, 3.5) + LINE), lane(-1, width(0.0, 3.25) + LINE), LINE),
    ),
}


@pytest.mark.parametrize("name", list(ROADS))
def test_a_road_of_a_file_is_built_and_read_back(tmp_path: Path, name: str) -> None:
    parameters, geometry, _ = taken(road_file(tmp_path, ROADS[name], length=120.0))
    model = build_road(BuildRequest(parameters, 0.005, parts={"road", "terrain"}))
    mesh = scene_mesh(objects=[model.objects["Road"]])
    road = mesh.class_id == class_id("road")
    vertices = mesh.vertices[np.unique(mesh.triangles[road])].astype(np.float64)
    station, offset = geometry.alignment.project(vertices[:, :2])
    station = np.clip(station, 0.0, geometry.length)
    edges = geometry.offsets(station)
    assert (offset - edges[:, 0]).max() < 0.006
    assert (edges[:, -1] - offset).max() < 0.006
    level = geometry.elevation(station, np.clip(offset, edges[:, -1], edges[:, 0]))
    assert np.abs(vertices[:, 2] - level).max() < 0.005
    painted = mesh.vertices[np.unique(mesh.triangles[mesh.class_id == class_id("road_marking")])].astype(np.float64)
    assert len(painted)
    found = edited_parameters(parameters, model.objects)
    assert found.to_dict() == parameters.to_dict()
