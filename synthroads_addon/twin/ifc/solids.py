"""Bodies of products: outlines pushed along an axis as extrusions, others as closed meshes."""

from collections.abc import Sequence

import numpy as np

from ...base.arrays import Float
from ..faces import loft, triangulate
from .entities import Entity, IfcFile, rounded

_FLAT = 1e-9  # m


def assign_bodies(ifc: IfcFile, product: Entity, bodies: Sequence[tuple[Float, str]]) -> None:
    """Set a product's representation and material from bodies, as extrusions if all are prisms, else as meshes.

    Products of the same bodies share them.

    Args:
        ifc: the file.
        product: in whose frame they are.
        bodies: sections (R, K, 3) as in `road.things.body`, and names of materials.
    """
    key = tuple((sections.round(9).tobytes(), sections.shape, material) for sections, material in bodies)
    ifc.assign_material(product, bodies[0][1])
    if ifc.has_shape(key):
        product.Representation = ifc.shape((), "", key)
        return
    extrusions = [_as_extrusion(sections) for sections, _ in bodies]
    if all(extrusion is not None for extrusion in extrusions):
        kind, items = "SweptSolid", [_add_extrusion(ifc, *extrusion) for extrusion in extrusions if extrusion]
    else:
        kind, items = "Tessellation", [_mesh(ifc, sections) for sections, _ in bodies]
    for item, (_, material) in zip(items, bodies, strict=True):
        if item is not None and material != bodies[0][1]:
            ifc.assign_style(item, material)
    product.Representation = ifc.shape(items, kind, key)


def _mesh(ifc: IfcFile, sections: Float) -> Entity | None:
    """Add and return the closed body through cross-sections (R, K, 3) as triangles; None if all are degenerate."""
    faces = loft(sections)
    return ifc.mesh(faces.points, triangulate(faces), True)


def _add_extrusion(ifc: IfcFile, outline: Float, vector: Float) -> Entity | None:
    """Add and return an outline (K, 3) extruded by a vector normal to it; None if it has no extent."""
    depth, first_side = float(np.linalg.norm(vector)), outline[1] - outline[0]
    axis, u = vector / depth, first_side / max(float(np.linalg.norm(first_side)), _FLAT)
    centre = outline.mean(axis=0)
    plane_points = (outline - centre) @ np.stack([u, np.cross(axis, u)], axis=1)
    if min(rounded([depth, *np.ptp(plane_points, axis=0)])) <= 0.0:
        return None
    corners = ifc.add("IfcCartesianPointList2D", rounded([*plane_points, plane_points[0]]))
    curve = ifc.add("IfcIndexedPolyCurve", corners, None, False)
    profile = ifc.add("IfcArbitraryClosedProfileDef", "AREA", None, curve)
    position = ifc.add("IfcAxis2Placement3D", ifc.point(*centre), ifc.direction(*axis), ifc.direction(*u))
    return ifc.add("IfcExtrudedAreaSolid", profile, position, ifc.direction(0.0, 0.0, 1.0), rounded(depth))


def _as_extrusion(sections: Float) -> tuple[Float, Float] | None:
    """Return outline (K, 3) and extrusion vector (3,) of two sections that form a right prism; else None."""
    if len(sections) > 2:
        return None
    vectors = sections[1] - sections[0]
    # A prism: all corners move by the same vector. A right one: the outline lies in a plane normal to that vector.
    depths = np.abs((sections[0] - sections[0][0]) @ vectors[0])
    is_right_prism = max(np.ptp(vectors, axis=0).max(), depths.max()) <= _FLAT and vectors.any()
    return (sections[0], vectors[0]) if is_right_prism else None
