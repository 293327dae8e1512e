"""3D Tiles: every triangle is in one tile, and lies on the globe where the map says."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj
import pyproj.datadir
import pytest
import rasterio
from pyproj import Transformer
from rasterio.transform import from_origin

from synthroads_addon.base.remarks import collected_remarks
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


GEOID = 46.5
"""Height (m) of the geoid above the ellipsoid in a grid that the test makes: about that of Germany's."""


def geoid_grid(folder: Path) -> None:
    """Write the grid of the German geoid with the same height everywhere, as a GeoTIFF of one band."""
    size = {"width": 11, "height": 9, "count": 1, "dtype": "float32", "crs": "EPSG:4937"}
    transform = from_origin(4.5, 55.5, 1.0, 1.0)
    with rasterio.open(folder / "de_bkg_gcg2016.tif", "w", driver="GTiff", transform=transform, **size) as grid:
        grid.update_tags(TYPE="VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL", AREA_OR_POINT="Point")
        grid.write(np.full((1, 9, 11), GEOID, np.float32))


def height_on_globe(folder: Path, height_epsg: int | None) -> tuple[float, str]:
    """Return the height (m) above the ellipsoid of a scene's first tile's frame less its map height, and the words."""
    scene = replace(labelled_scene(), height_epsg=height_epsg)
    write_tiles(scene, folder / "tiles")
    tileset = json.loads((folder / "tiles" / "tileset.json").read_text())
    child = tileset["root"]["children"][0]
    place = np.array(child["transform"]).reshape(4, 4).T[:3, 3]
    _, _, height = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True).transform(*place)
    content, _ = read_glb(folder / "tiles" / child["content"]["uri"])
    origin = content["scenes"][0]["extras"]["synthroads_origin"]
    return height - origin[2], tileset["asset"]["extras"]["synthroads_heights"]


def test_heights_without_a_system_count_from_the_ellipsoid(tmp_path: Path) -> None:
    above, text = height_on_globe(tmp_path, None)
    assert above == pytest.approx(0.0, abs=1e-4)
    assert text == "taken as above the ellipsoid"


def test_heights_above_the_sea_are_converted_where_proj_has_the_geoid(tmp_path: Path) -> None:
    with collected_remarks() as remarks:
        above, text = height_on_globe(tmp_path, 7837)
    assert above == pytest.approx(0.0, abs=1e-4)
    assert text == "taken as above the ellipsoid: PROJ has no de_bkg_gcg2016.tif for EPSG:7837"
    assert text in " ".join(remarks)

    geoid_grid(tmp_path)
    usual = pyproj.datadir.get_data_dir()
    pyproj.datadir.append_data_dir(str(tmp_path))
    try:
        (tmp_path / "with").mkdir()
        above, text = height_on_globe(tmp_path / "with", 7837)
    finally:
        pyproj.datadir.set_data_dir(usual)
    assert above == pytest.approx(GEOID, abs=1e-3)
    assert text == "above the ellipsoid, by PROJ from EPSG:7837"
