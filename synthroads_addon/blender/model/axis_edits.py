"""A road's axis after edits of its backbone: moved as a whole it is known exactly, moved points are fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...fitting.fit import AxisFit, alignment_object, fit_axis
from ...road.alignment import Alignment
from ...road.geometry import RoadGeometry, alignment_of
from ...road.parameters import AlignmentObject
from ..things.model_builder import SUPPORT
from .edits import attribute_of, mesh_edited, turn_of, vertices_of

Float = NDArray[np.float64]
_STILL = 2e-4
"""Coordinates that differ by less are the same but for rounding, m."""


@dataclass(frozen=True)
class EditedAxis:
    """A road's axis as read from its edited backbone.

    Attributes:
        alignment: it.
        station: from a station of the axis that the road was built along to the one of the same place now.
        fit: how the backbone's points lie to it, where they were moved one by one; None otherwise.
    """

    alignment: AlignmentObject
    station: Callable[[float], float]
    fit: AxisFit | None = None


def edited_axis(geometry: RoadGeometry, backbone: bpy.types.Object, place: Float) -> EditedAxis | None:
    """Return a road's axis read from its backbone: moved exactly or fitted to moved points; None if unedited.

    Args:
        geometry: of what the road was built from.
        backbone: its object.
        place: (4, 4) in the road's frame; upright.

    Raises:
        InputError: no road runs through the backbone's points.
    """
    assert SUPPORT in backbone
    before = geometry.parameters.alignment
    vertices = vertices_of(backbone.data)
    station = attribute_of(backbone.data, "station").astype(np.float64)
    there = np.column_stack([geometry.alignment.position(station), geometry.profile.elevation(station)])
    if not mesh_edited(backbone) and np.abs(vertices - there).max(initial=0.0) < _STILL:
        if np.allclose(place, np.eye(4), atol=1e-6):
            return None
        return EditedAxis(moved_alignment(before, place), lambda station: station)
    points = vertices @ place[:3, :3].T + place[:3, 3]
    order = np.argsort(station, kind="stable")
    points, station, there = points[order], station[order], there[order]
    if len(points) < 2:
        raise InputError("Backbone", len(points), "needs two points at least: undo the edit, or build the road again")
    fit = fit_axis(points)
    alignment = alignment_object(fit).model_copy(
        update={"instance": before.instance, "first_station": before.first_station, "equations": before.equations}
    )
    if np.abs(points[:, :2] - there[:, :2]).max() < _STILL:
        # Only heights were changed: curves stay, exactly.
        kept = {name: getattr(before, name) for name in ("start_x", "start_y", "start_heading_deg", "horizontal")}
        alignment = alignment.model_copy(update=kept)
        return EditedAxis(alignment, lambda at: at, fit)
    now = _project_stations(alignment_of(alignment), points, station)
    return EditedAxis(alignment, lambda at: _map_station(at, station, now), fit)


def moved_alignment(axis: AlignmentObject, place: Float) -> AlignmentObject:
    """Return an alignment transformed by an upright matrix (4, 4): shifted, and turned about the vertical."""
    x, y, _, _ = place @ np.array([axis.start_x, axis.start_y, 0.0, 1.0])
    heading = axis.start_heading_deg + float(np.rad2deg(turn_of(place)))
    rise = float(place[2, 3])
    vertical = [point.model_copy(update={"elevation": round(point.elevation + rise, 9)}) for point in axis.vertical]
    update: dict[str, Any] = {"start_x": round(float(x), 9), "start_y": round(float(y), 9)}
    update |= {"start_heading_deg": round((heading + 180.0) % 360.0 - 180.0, 12), "vertical": tuple(vertical)}
    return axis.model_copy(update=update)


def _project_stations(alignment: Alignment, points: Float, before: Float) -> Float:
    """Return non-decreasing stations (N,), m, of points projected onto an axis near those before."""
    near, _ = alignment.project_near(points[:, :2], before, 0.25 * alignment.length + 100.0)
    return np.maximum.accumulate(near)


def _map_station(station: float, before: Float, now: Float) -> float:
    """Return a station mapped from the axis before to the one now, m; beyond the ends it keeps its distance."""
    if station <= before[0]:
        return float(now[0] + station - before[0])
    if station >= before[-1]:
        return float(now[-1] + station - before[-1])
    return float(np.interp(station, before, now))
