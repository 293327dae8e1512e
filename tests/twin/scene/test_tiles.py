"""3D Tiles: every triangle is in one tile, and lies on the globe where the map says."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer

from synthroads_addon.twin.scene.tiles import EDGE, write_tiles
from tests.helpers.scenes.labelled import LARGE, ORIGIN, labelled_scene


def read_glb(path: Path) -> tuple[dict, bytes]:
    data = path.read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def triangles_of(path: Path) -> list[tuple[dict, np.ndarray]]:
    """Return extras and corners (T, 3, 3), z up, of each node's triangles."""
    content, data = read_glb(path)
    result = []
    for node in content["nodes"]:
        if "mesh" not in node:
            continue
        matrix = np.array(node.get("matrix", np.eye(4).ravel())).reshape(4, 4).T
        for primitive in content["meshes"][node["mesh"]]["primitives"]:
            arrays = []
            for accessor in (primitive["attributes"]["POSITION"], primitive["indices"]):
                entry = content["accessors"][accessor]
                view = content["bufferViews"][entry["bufferView"]]
                kind = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[entry["componentType"]]
                raw = data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
                arrays.append(np.frombuffer(raw, kind))
            places = arrays[0].reshape(-1, 3).astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
            result.append((node["extras"], places[arrays[1].reshape(-1, 3).astype(int)]))
    return result


def test_tiles_lie_where_the_map_says(tmp_path: Path) -> None:
    scene = labelled_scene()
    write_tiles(scene, tmp_path / "tiles")
    tileset = json.loads((tmp_path / "tiles" / "tileset.json").read_text())
    children = tileset["root"]["children"]
    assert len(children) == 6  # of 200 m, to both sides of y = 0
    to_globe = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    to_plan = Transformer.from_crs(25832, 4326, always_xy=True)
    count, instances, stations = 0, set(), []
    for child in children:
        matrix = np.array(child["transform"]).reshape(4, 4).T
        box = np.array(child["boundingVolume"]["box"])
        for extras, corners in triangles_of(tmp_path / "tiles" / child["content"]["uri"]):
            count += len(corners)
            instances.add(extras["synthroads_instance"] % 2**32)
            stations += extras["synthroads_station"]
            assert np.all(np.abs(corners - box[:3]) <= box[[3, 7, 11]] + 1e-3)
            if extras["synthroads_class"] == "road_sign":
                globe = corners[0, 0] @ matrix[:3, :3].T + matrix[:3, 3]
                place = scene.meshes[2].matrices[0] @ [*scene.meshes[2].vertices[scene.meshes[2].triangles[0, 0]], 1.0]
                x, y, z = place[:3] + ORIGIN
                longitude, latitude = to_plan.transform(x, y)
                assert np.abs(globe - to_globe.transform(longitude, latitude, z)).max() < 0.002
    assert count == sum(len(mesh.triangles) * len(mesh.matrices) for mesh in scene.meshes)
    assert instances == {1, 2, 31, LARGE, *range(10, 20)}
    assert min(stations) == -0.06
    assert max(stations) == pytest.approx(600.0)
    assert EDGE == 200.0
