"""Markings in IFC 4.3: IfcSurfaceFeatures that adhere to their carriageway's pavement, not contained in any part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...road.parameters import Arrow, Carriageway, Hatching, LineMarking, Turnout
from ...road.section import Marking
from ..faces import Faces
from ..surfaces import dash_surfaces, painted_surface
from .entities import Float
from .scene import Scene

_Mesh = tuple[Float, NDArray[np.intp]]


def write_markings(scene: Scene) -> None:
    """Add every line, hatching and arrow with the surface of its film."""
    geometry = scene.geometry
    for name, item in geometry.parameters.objects.items():
        if isinstance(item, LineMarking):
            _, faces, _ = dash_surfaces(geometry, item, scene.stations)
            _write(scene, name, item, "LINEMARKING", faces, item.carriageway)
        elif isinstance(item, Hatching):
            turnout = geometry.parameters.objects[item.turnout]
            assert isinstance(turnout, Turnout)
            faces = painted_surface(geometry, item, scene.stations)
            _write(scene, name, item, "HATCHMARKING", faces, turnout.carriageway)
        elif isinstance(item, Arrow):
            faces = painted_surface(geometry, item, scene.stations)
            _write(scene, name, item, "SYMBOLMARKING", faces, item.carriageway)


def _write(scene: Scene, name: str, item: Marking, kind: str, faces: Faces, carriageway: str) -> None:
    ifc = scene.ifc
    bearer = scene.geometry.parameters.objects[carriageway]
    assert isinstance(bearer, Carriageway)
    mesh = _triangles(faces)
    shape = ifc.shape([ifc.mesh(*mesh, False)], "Tessellation") if mesh else None
    about = str(getattr(item, "kind", "hatching"))
    feature = ifc.product("IfcSurfaceFeature", name, kind, about, Representation=shape)
    ifc.gather("IfcRelAdheresToElement", scene.parts[f"pavement-{bearer.side}"], [feature])
    ifc.made_of(feature, f"paint_{item.color}")
    scene.describe(feature, item)  # type: ignore[arg-type]
    common = {
        "MaterialColour": ifc.add("IfcLabel", item.color),
        "MaterialThickness": ifc.add("IfcPositiveLengthMeasure", item.film_thickness),
    }
    ifc.properties(feature, "Pset_RoadMarkingCommon", common)


def _triangles(faces: Faces) -> _Mesh | None:
    """Return convex polygons as points and triangles."""
    if not len(faces):
        return None
    starts = np.cumsum(faces.sizes) - faces.sizes
    counts = faces.sizes - 2
    first = np.repeat(starts, counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    fans = np.column_stack([first, first + number + 1, first + number + 2])
    return faces.points, faces.corners[fans]
