"""A road's axis after edits of its backbone: exact if it was moved as a whole, fitted if single points were moved."""

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
"""Difference of coordinates, m, below which they are equal but for rounding."""


@dataclass(frozen=True)
class EditedAxis:
    """A road's axis as read from its edited backbone.

    Attributes:
        alignment: the axis.
        station: function from a station (m) of the axis as built to the station of the same place now.
        fit: deviations of the backbone's points from the fitted axis; None if no single points were moved.
    """

    alignment: AlignmentObject
    station: Callable[[float], float]
    fit: AxisFit | None = None


def edited_axis(geometry: RoadGeometry, backbone: bpy.types.Object, place: Float) -> EditedAxis | None:
    """Return a road's axis read from its backbone: moved exactly or fitted to moved points; None if unedited.

    Args:
        geometry: geometry of the road as built.
        backbone: the backbone's object.
        place: (4, 4) matrix of that object in the road's frame; upright.

    Raises:
        InputError: no road runs through the backbone's points.
    """
    assert SUPPORT in backbone
    built_axis = geometry.parameters.alignment
    vertices = vertices_of(backbone.data)
    station = attribute_of(backbone.data, "station").astype(np.float64)
    built_points = np.column_stack([geometry.alignment.position(station), geometry.profile.elevation(station)])
    if not mesh_edited(backbone) and np.abs(vertices - built_points).max(initial=0.0) < _STILL:
        if np.allclose(place, np.eye(4), atol=1e-6):
            return None
        return EditedAxis(moved_alignment(built_axis, place), lambda station: station)
    points = vertices @ place[:3, :3].T + place[:3, 3]
    order = np.argsort(station, kind="stable")
    points, station, built_points = points[order], station[order], built_points[order]
    if len(points) < 2:
        raise InputError("Backbone", len(points), "needs two points at least: undo the edit, or build the road again")
    fit = fit_axis(points)
    alignment = alignment_object(fit).model_copy(
        update={
            "instance": built_axis.instance,
            "first_station": built_axis.first_station,
            "equations": built_axis.equations,
        }
    )
    if np.abs(points[:, :2] - built_points[:, :2]).max() < _STILL:
        # Only heights were changed: curves stay, exactly.
        plan_fields = {
            name: getattr(built_axis, name) for name in ("start_x", "start_y", "start_heading_deg", "horizontal")
        }
        alignment = alignment.model_copy(update=plan_fields)
        return EditedAxis(alignment, lambda built_station: built_station, fit)
    current_stations = _project_stations(alignment_of(alignment), points, station)
    return EditedAxis(alignment, lambda built_station: _map_station(built_station, station, current_stations), fit)


def moved_alignment(axis: AlignmentObject, place: Float) -> AlignmentObject:
    """Return an alignment transformed by an upright matrix (4, 4): shifted, and turned about the vertical."""
    x, y, _, _ = place @ np.array([axis.start_x, axis.start_y, 0.0, 1.0])
    heading = axis.start_heading_deg + float(np.rad2deg(turn_of(place)))
    rise = float(place[2, 3])
    vertical = [point.model_copy(update={"elevation": round(point.elevation + rise, 9)}) for point in axis.vertical]
    update: dict[str, Any] = {"start_x": round(float(x), 9), "start_y": round(float(y), 9)}
    update |= {"start_heading_deg": round((heading + 180.0) % 360.0 - 180.0, 12), "vertical": tuple(vertical)}
    return axis.model_copy(update=update)


def _project_stations(alignment: Alignment, points: Float, built_stations: Float) -> Float:
    """Return non-decreasing stations (N,), m, of points (N, 3) projected onto an axis near their stations as built."""
    # Searched within a quarter of the axis and 100 m around the station as built (chosen).
    stations, _ = alignment.project_near(points[:, :2], built_stations, 0.25 * alignment.length + 100.0)
    return np.maximum.accumulate(stations)


def _map_station(station: float, built_stations: Float, current_stations: Float) -> float:
    """Return a station, m, mapped from the axis as built to the current one; beyond an end it keeps its distance."""
    if station <= built_stations[0]:
        return float(current_stations[0] + station - built_stations[0])
    if station >= built_stations[-1]:
        return float(current_stations[-1] + station - built_stations[-1])
    return float(np.interp(station, built_stations, current_stations))
