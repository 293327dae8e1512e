"""Points along a curve object, in the scene's coordinates: what a road is built along.

A Bezier spline is evaluated here, every few metres whatever its resolution in the view. NURBS are taken as Blender
evaluates them; polylines and hair curves are their points.
"""

from __future__ import annotations

import itertools

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ..model.roads import world_matrix

Float = NDArray[np.float64]

KINDS = ("CURVE", "CURVES")
"""Types of objects that are curves: Blender's splines, and its hair curves."""
_SPACING = 4.0
"""Distance of the points of a Bezier curve, m. Chosen: several in the shortest element of a road."""
_MOST = 5000
"""Points of one piece of a Bezier curve at most."""


def curve_points(item: bpy.types.Object) -> Float:
    """Return points (N, 3) along a curve object, in the scene's coordinates, m, N >= 2.

    Raises:
        InputError: it is no curve, is closed, has several splines, or is a point.
    """
    points = _local_points(item)
    matrix = world_matrix(item)
    points = points @ matrix[:3, :3].T + matrix[:3, 3]
    if len(points) < 2 or np.hypot(*np.diff(points[:, :2], axis=0).T).sum() < 1.0:
        raise InputError("Curve", item.name, "is shorter than 1 m in plan: no road can be built along it")
    return points


def polygon_points(item: bpy.types.Object) -> tuple[Float, list[float]]:
    """Return the points (N, 3) that a curve is set by, in the scene's coordinates, m, and the radii of their roundings.

    The radii are those of the spline's points as Blender has them; 1, its default, and 0 say that none is given.

    Raises:
        InputError: see `curve_points`; or the curve has no points of a spline.
    """
    if item.type != "CURVE":
        raise InputError("Curve", item.name, "has no points at which tangents meet: select a curve object")
    spline = _only_spline(item)
    controls = spline.bezier_points if spline.type == "BEZIER" else spline.points
    local = np.array([list(point.co)[:3] for point in controls], dtype=np.float64)
    matrix = world_matrix(item)
    radii = [0.0 if point.radius == 1.0 else round(float(point.radius), 3) for point in controls]
    return local @ matrix[:3, :3].T + matrix[:3, 3], radii


def _only_spline(item: bpy.types.Object) -> bpy.types.Spline:
    """Return the one spline of a curve; raise InputError for none, several, or a closed one."""
    splines = item.data.splines
    if len(splines) != 1:
        count = f"has {len(splines)} splines" if len(splines) else "is empty"
        raise InputError("Curve", item.name, f"{count}; a road follows one: separate them in Edit Mode (P)")
    if splines[0].use_cyclic_u:
        raise InputError("Curve", item.name, "is closed; a road has two ends: open it (Toggle Cyclic in Edit Mode)")
    return splines[0]


def _local_points(item: bpy.types.Object) -> Float:
    """Return points (N, 3) along a curve in its own coordinates."""
    if item.type == "CURVES":
        return _hair_points(item)
    if item.type != "CURVE":
        raise InputError("Curve", item.name, "must be a curve: select one, or add one (Add > Curve)")
    spline = _only_spline(item)
    if spline.type == "BEZIER":
        return _bezier_points(spline, float(np.abs(np.linalg.det(world_matrix(item)[:3, :3])) ** (1 / 3)))
    if spline.type == "POLY":
        return np.array([list(point.co)[:3] for point in spline.points], dtype=np.float64)
    return _evaluated_points(item)


def _hair_points(item: bpy.types.Object) -> Float:
    if len(item.data.curves) != 1:
        raise InputError("Curve", item.name, f"has {len(item.data.curves)} curves; a road follows one")
    flat = np.empty(3 * len(item.data.points), dtype=np.float32)
    item.data.attributes["position"].data.foreach_get("vector", flat)
    return flat.reshape(-1, 3).astype(np.float64)


def _bezier_points(spline: bpy.types.Spline, scale: float) -> Float:
    """Return points (N, 3) on a Bezier spline, about `_SPACING` apart; `scale` is metres per unit of the curve."""
    controls = [(point.co, point.handle_left, point.handle_right) for point in spline.bezier_points]
    rows = np.array([[list(part) for part in control] for control in controls], dtype=np.float64)
    points = [rows[:1, 0]]
    for before, after in itertools.pairwise(rows):
        corners = np.array([before[0], before[2], after[1], after[0]])
        length = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum() * scale
        count = int(np.clip(np.ceil(length / _SPACING), 2, _MOST))
        share = np.arange(1, count + 1)[:, None] / count
        rest = 1.0 - share
        # Bernstein's polynomials of degree 3
        weights = np.hstack([rest**3, 3.0 * rest**2 * share, 3.0 * rest * share**2, share**3])
        points.append(weights @ corners)
    return np.concatenate(points)


def _evaluated_points(item: bpy.types.Object) -> Float:
    """Return points (N, 3) on a NURBS curve as Blender evaluates it."""
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    try:
        if len(mesh.polygons):
            raise InputError("Curve", item.name, "has a bevel or is filled: set its Bevel Depth and Extrude to 0")
        flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", flat)
    finally:
        evaluated.to_mesh_clear()
    return flat.reshape(-1, 3).astype(np.float64)
