"""An IFC file as its readers see it: ifcopenshell's geometry, placements and curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.element
import ifcopenshell.util.geolocation
import ifcopenshell.util.placement
import numpy as np

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.twin.ifc.writer import write_ifc

WRAPPER = ifcopenshell.ifcopenshell_wrapper
SETTINGS = ifcopenshell.geom.settings()
SETTINGS.set("use-world-coords", True)


def written(parameters: RoadParameters, folder: Path, tolerance: float = 0.005) -> Any:
    """Write a road and open the file."""
    path = folder / "twin.ifc"
    write_ifc(parameters, path, tolerance)
    return ifcopenshell.open(str(path))


def named(file: Any, name: str, entity: str = "IfcProduct") -> Any:
    """Return the one product of a class and name."""
    (found,) = [item for item in file.by_type(entity) if item.Name == name]
    return found


def said(item: Any, name: str = "SynthRoads") -> dict[str, Any]:
    """Return a property set by its name; empty if there is none."""
    return ifcopenshell.util.element.get_pset(item, name) or {}


def placement(item: Any) -> np.ndarray:
    """Return a product's (4, 4) matrix, as the reader evaluates it."""
    return np.array(ifcopenshell.util.placement.get_local_placement(item.ObjectPlacement))


def fallback(item: Any) -> np.ndarray:
    """Return the (4, 4) matrix that readers without linear placement take."""
    return np.array(ifcopenshell.util.placement.get_axis2placement(item.ObjectPlacement.CartesianPosition))


def along(curve: Any, station: np.ndarray) -> np.ndarray:
    """Return points (N, 3) of an alignment's curve at distances along it (N,)."""
    evaluator = WRAPPER.function_item_evaluator(SETTINGS, WRAPPER.map_shape(SETTINGS, curve))
    return np.array([np.array(evaluator.evaluate(float(s)))[:3, 3] for s in station])


def body(item: Any, exact: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (N, 3) and triangles (M, 3) of a product in the project's coordinates.

    ``exact`` takes the reader's full kernel for a mesh, too.
    """
    tessellated = item.Representation.Representations[0].RepresentationType == "Tessellation"
    # OpenCASCADE, which extrusions need, takes a millisecond for each vertex of a mesh.
    shape = ifcopenshell.geom.create_shape(
        SETTINGS, item, geometry_library="manifold" if tessellated and not exact else "opencascade"
    ).geometry
    return np.array(shape.verts).reshape(-1, 3), np.array(shape.faces).reshape(-1, 3)


def local_body(item: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (N, 3) and triangles (M, 3) of a product in the frame of its placement."""
    (vertices, triangles), frame = body(item), placement(item)
    return (vertices - frame[:3, 3]) @ frame[:3, :3], triangles


def parts(item: Any) -> list[Any]:
    """Return what an element is made of: its parts, and itself if it has a shape of its own or no parts."""
    made_of = [part for rel in item.IsDecomposedBy for part in rel.RelatedObjects]
    return made_of if made_of and not item.Representation else [item, *made_of]


def whole_body(item: Any) -> np.ndarray:
    """Return the vertices (N, 3) of an element and its parts."""
    return np.concatenate([body(part)[0] for part in parts(item)])


def map_coordinates(file: Any, point: np.ndarray) -> np.ndarray:
    """Return the map coordinates of a point, as the file's georeferencing says."""
    matrix = np.eye(4)
    matrix[:3, 3] = point
    return np.array(ifcopenshell.util.geolocation.auto_local2global(file, matrix))[:3, 3]


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Return the volume that a closed mesh encloses; negative if it is inside out."""
    a, b, c = (vertices[triangles[:, i]] - vertices.mean(axis=0) for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def open_edges(vertices: np.ndarray, triangles: np.ndarray) -> int:
    """Return the number of edges that aren't shared by two triangles that run along them in opposite directions."""
    _, index = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    merged = index.reshape(-1)[triangles]
    edges = np.concatenate([merged[:, [0, 1]], merged[:, [1, 2]], merged[:, [2, 0]]])
    forwards, counts = np.unique(edges, axis=0, return_counts=True)
    found = dict(zip(map(tuple, forwards.tolist()), counts.tolist(), strict=True))
    return sum(found.get((b, a), 0) != n for (a, b), n in found.items())
