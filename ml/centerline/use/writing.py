"""Predictions along a road, as GeoJSON lines and as a table of the corridor, both in map coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.corridor import CORRIDOR
from ..data.frames import Frames
from ..networks.models import TARGETS

Float = NDArray[np.float64]

DIGITS = 4
"""Decimals: 0.1 mm."""
UNITS = {
    "lanes": "1",
    "heading": "rad",
}
"""All other numbers are in metres."""


@dataclass(frozen=True)
class Found:
    """Predictions in M frames of a whole road, map coordinates; T are the `TARGETS`.

    Attributes:
        frames: where.
        value: (M, T), the centre and the edges as y in their frame, the height as elevation; NaN: nothing.
        std: (M, T) calibrated standard deviations.
        widths: (M, T, 2) half-widths of the intervals for 68 % and 95 %.
        epsg: code of the coordinate system, None if it isn't known.
    """

    frames: Frames
    value: Float
    std: Float
    widths: Float
    epsg: int | None

    def points(self, name: str) -> Float:
        """Return the points (M, 3) of one of the lines; z is the centre's elevation."""
        return np.column_stack([self.frames.at(self._column(name)), self._column("height")])

    def _column(self, name: str) -> Float:
        return self.value[:, TARGETS.index(name)]


def geojson(found: Found, name: str, spacing: float) -> dict[str, Any]:
    """Return a FeatureCollection with centreline and edges, one feature per stretch without a gap.

    Each has, per vertex, its station along the path, its standard deviation across the road and the half-widths of the
    intervals that cover 68 % and 95 %, m.

    Args:
        found: by the model.
        name: of the collection.
        spacing: of the frames, m.
    """
    features = []
    for line in ("center", "left_edge", "right_edge"):
        column = TARGETS.index(line)
        points = found.points(line)
        there = np.isfinite(points).all(axis=1)
        far = np.concatenate([[True], np.diff(found.frames.station) > 1.5 * spacing])
        ends = np.flatnonzero(far | ~there | ~np.concatenate([[False], there[:-1]]))
        for stretch in np.split(np.arange(len(there)), ends):
            part = stretch[there[stretch]]
            if len(part) < 2:
                continue
            properties = {
                "feature": "centerline" if line == "center" else line,
                "stations": _as_list(found.frames.station[part]),
                "std": _as_list(found.std[part, column]),
                "interval_68": _as_list(found.widths[part, column, 0]),
                "interval_95": _as_list(found.widths[part, column, 1]),
            }
            geometry = {"type": "LineString", "coordinates": np.round(points[part], DIGITS).tolist()}
            features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    collection: dict[str, Any] = {"type": "FeatureCollection", "name": name}
    if found.epsg is not None:
        collection["crs"] = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{found.epsg}"}}
    return collection | {"features": features}


def corridor_json(found: Found, calibration: Mapping[str, Any]) -> dict[str, Any]:
    """Return the corridor as JSON data: a list of M numbers per column, null where nothing was found.

    Args:
        found: by the model.
        calibration: what is said about how far its deviations can be trusted.
    """
    frames = found.frames
    columns: dict[str, Any] = {
        "station": _as_list(frames.station),
        "x": _as_list(frames.position[:, 0]),
        "y": _as_list(frames.position[:, 1]),
        "direction": _as_list(frames.direction, 6),
    }
    for index, name in enumerate(TARGETS):
        digits = 6 if name == "heading" else DIGITS
        columns[name] = _as_list(found.value[:, index], digits)
        columns[f"{name}_std"] = _as_list(found.std[:, index], digits)
        columns[f"{name}_68"] = _as_list(found.widths[:, index, 0], digits)
        columns[f"{name}_95"] = _as_list(found.widths[:, index, 1], digits)
    return {
        "type": "Corridor",
        "version": "1.0",
        "epsg": found.epsg,
        "units": {name: UNITS.get(name, "m") for name in ("center", *CORRIDOR)},
        "calibration": dict(calibration),
        "slices": columns,
    }


def _as_list(values: Float, digits: int = DIGITS) -> list[float | None]:
    return [round(value, digits) + 0.0 if np.isfinite(value) else None for value in values.tolist()]
