"""3D Tiles 1.1: a tileset of glTF tiles on the globe, a square of the map each.

Each tile is a scene of its own about its middle, and is placed by a matrix to geocentric coordinates (EPSG:4978), which
follows the map's grid there: its convergence, its scale and the curvature of the Earth. Within a tile the Earth is
flat. Heights of a named vertical system are converted to those above the ellipsoid where PROJ has the grid of its
geoid; else they count as such. Source: OGC 22-025r4, "3D Tiles Specification".
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Float
from ...base.remarks import warn
from .gltf import write_glb
from .labelled import LabelledMesh, LabelledScene

EDGE = 200.0
"""Edge of a tile, m: within it the Earth's curvature makes 1 mm (100^2 / (2 x 6.4e6) m at its edges). Chosen."""
_PROBE = 50.0
"""Distance (m) over which the map's axes are taken on the globe. Chosen."""
_PLAN, _GLOBE, _CENTRE = 4326, 4979, 4978
"""EPSG codes of WGS 84: longitude and latitude, these with heights above the ellipsoid, geocentric."""
_COARSE = 512.0
"""Geometric error (m) of a scene that shows nothing: with Cesium's usual limit of 16 pixels tiles appear from some km.
Chosen."""


def write_tiles(scene: LabelledScene, path: Path) -> None:
    """Write a scene as a tileset into a folder."""
    path.mkdir()
    to_ellipsoid, heights = _to_ellipsoid(scene.epsg, scene.height_epsg)
    children: list[dict[str, Any]] = []
    for key, meshes in sorted(_by_tile(scene).items()):
        middle = np.array([(key[0] + 0.5) * EDGE, (key[1] + 0.5) * EDGE, 0.0])
        low, high = _bounds(meshes)
        middle[2] = np.floor(low[2])
        moved = [replace(mesh, matrices=_moved(mesh.matrices, -middle)) for mesh in meshes]
        tile = replace(
            scene,
            meshes=tuple(moved),
            origin=scene.origin + middle,
            stations=_stations_about(scene, middle[:2]),
        )
        name = f"tile_{key[0]}_{key[1]}.glb"
        write_glb(tile, path / name)
        children.append(
            {
                "boundingVolume": {"box": _box(low - middle, high - middle)},
                "geometricError": 0.0,
                "transform": _to_globe(scene, middle, to_ellipsoid).T.ravel().tolist(),
                "content": {"uri": name},
            }
        )
    content = {
        "asset": {
            "version": "1.1",
            "tilesetVersion": scene.generator,
            "extras": scene.about() | {"synthroads_heights": heights},
        },
        "geometricError": _COARSE,
        "root": {
            "boundingVolume": {"sphere": _sphere(children)},
            "geometricError": _COARSE,
            "refine": "ADD",
            "children": children,
        },
    }
    (path / "tileset.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _stations_about(scene: LabelledScene, middle: Float) -> Callable[[Float], Float] | None:
    """Return the function of the stations of a tile about a middle (2,), m; None without a road."""
    stations = scene.stations
    return None if stations is None else lambda plan: stations(plan + middle)


def _by_tile(scene: LabelledScene) -> dict[tuple[int, int], list[LabelledMesh]]:
    """Return the meshes by tile: small ones where their middles are, large ones triangle by triangle."""
    tiles: dict[tuple[int, int], list[LabelledMesh]] = {}
    for mesh in scene.meshes:
        for row, matrix in enumerate(mesh.matrices):
            at_place = replace(mesh, matrices=matrix[None], numbers=mesh.numbers[row : row + 1])
            for key, piece in _pieces(at_place, matrix):
                tiles.setdefault(key, []).append(piece)
    return tiles


def _pieces(mesh: LabelledMesh, matrix: Float) -> Iterator[tuple[tuple[int, int], LabelledMesh]]:
    """Yield the tiles that a mesh at one place lies in, with its triangles there."""
    plan = mesh.vertices.astype(np.float64) @ matrix[:2, :3].T + matrix[:2, 3]
    low, high = plan.min(axis=0), plan.max(axis=0)
    if np.all(high - low < EDGE / 2.0):
        column, line = np.floor((low + high) / 2.0 / EDGE).astype(int).tolist()
        yield (column, line), mesh
        return
    tile = np.floor(plan[mesh.triangles].mean(axis=1) / EDGE).astype(np.int64)
    keys, index = np.unique(tile, axis=0, return_inverse=True)
    for number, (column, line) in enumerate(keys.tolist()):
        rows = np.flatnonzero(index.ravel() == number)
        used, triangles = np.unique(mesh.triangles[rows], return_inverse=True)
        yield (
            (column, line),
            replace(
                mesh,
                vertices=mesh.vertices[used],
                triangles=triangles.reshape(-1, 3).astype(np.int32),
                material=mesh.material[rows],
                class_id=mesh.class_id[rows],
                instance_id=None if mesh.instance_id is None else mesh.instance_id[rows],
            ),
        )


def _moved(matrices: Float, shift: Float) -> Float:
    """Return matrices (N, 4, 4) moved by a vector (3,), m."""
    moved = matrices.copy()
    moved[:, :3, 3] += shift
    return moved


def _bounds(meshes: list[LabelledMesh]) -> tuple[Float, Float]:
    """Return the smallest and the largest corner (3,) of meshes at their places, m."""
    lows, highs = [], []
    for mesh in meshes:
        for matrix in mesh.matrices:
            places = mesh.vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
            lows.append(places.min(axis=0))
            highs.append(places.max(axis=0))
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _box(low: Float, high: Float) -> list[float]:
    """Return a box as 3D Tiles has it: its middle, then half its three axes."""
    middle, half = (low + high) / 2.0, np.maximum((high - low) / 2.0, 1e-3)
    return [*middle.tolist(), *np.diag(half).ravel().tolist()]


def _to_globe(scene: LabelledScene, place: Float, to_ellipsoid: Callable[[Float], Float]) -> Float:
    """Return the matrix (4, 4) to geocentric coordinates from the frame of a tile about a place (3,) of the scene."""
    from pyproj import Transformer  # takes a fifth of a second, and few roads need it

    probes = np.vstack([np.zeros(3), np.eye(3) * _PROBE, -np.eye(3) * _PROBE]) + place + scene.origin
    to_centre = Transformer.from_crs(_GLOBE, _CENTRE, always_xy=True)
    globe = np.column_stack(to_centre.transform(*to_ellipsoid(probes).T))
    matrix = np.eye(4)
    matrix[:3, :3] = ((globe[1:4] - globe[4:7]) / (2.0 * _PROBE)).T
    matrix[:3, 3] = globe[0]
    return matrix


def _to_ellipsoid(epsg: int, height_epsg: int | None) -> tuple[Callable[[Float], Float], str]:
    """Return what makes longitude, latitude (degrees), height above the ellipsoid (N, 3) of map coordinates (N, 3).

    Returns:
        the function; what it makes of heights, in words for the tileset.
    """
    from pyproj import Transformer  # takes a fifth of a second, and few roads need it
    from pyproj.transformer import TransformerGroup

    reason = ""
    if height_epsg is not None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a grid that isn't here: it is said below
            ways = TransformerGroup(f"EPSG:{epsg}+{height_epsg}", _GLOBE, always_xy=True, allow_ballpark=False)
        if ways.transformers:
            best = ways.transformers[0]
            text = f"above the ellipsoid, by PROJ from EPSG:{height_epsg}"
            return lambda places: np.column_stack(best.transform(*places.T)), text
        grids = {grid.short_name for way in ways.unavailable_operations for grid in way.grids if grid.short_name}
        reason = f": PROJ has no {' or '.join(sorted(grids)) or 'conversion'} for EPSG:{height_epsg}"
        warn("3D Tiles: heights are taken as above the ellipsoid%s", reason)
    to_plan = Transformer.from_crs(epsg, _PLAN, always_xy=True)

    def keep_heights(places: Float) -> Float:
        """Return longitudes and latitudes (degrees), and the heights as they are, of places (N, 3)."""
        return np.column_stack([*to_plan.transform(places[:, 0], places[:, 1]), places[:, 2]])

    return keep_heights, f"taken as above the ellipsoid{reason}"


def _sphere(children: list[dict[str, Any]]) -> list[float]:
    """Return the sphere around all tiles: middle and radius, m, geocentric."""
    if not children:
        return [0.0, 0.0, 0.0, 0.0]
    middles, radii = [], []
    for child in children:
        matrix = np.array(child["transform"]).reshape(4, 4).T
        box = np.array(child["boundingVolume"]["box"])
        middles.append(matrix[:3, :3] @ box[:3] + matrix[:3, 3])
        scale = float(np.linalg.norm(matrix[:3, :3], 2))
        radii.append(scale * float(np.linalg.norm(box[3:].reshape(3, 3).sum(axis=0))))
    middle = np.mean(middles, axis=0)
    radius = max(float(np.linalg.norm(at - middle)) + size for at, size in zip(middles, radii, strict=True))
    return [*middle.tolist(), radius]
