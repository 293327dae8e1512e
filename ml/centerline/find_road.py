"""A trained model used on a cloud of which nothing is known, strip by strip."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.maps.crs import system_urn
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from ..data.corridor import CORRIDOR
from ..data.frames import frames_along
from ..data.strips import find_ground, path_through, strips
from ..networks.centerline.models import TARGETS
from .predictor import CenterlinePredictor, Regression

_HEIGHT = TARGETS.index("height")
"""Column of the height among the targets."""


def find_road(
    predictor: CenterlinePredictor, cloud: Path, line: MeasuredAxis | None = None, progress: Progress = silent
) -> Regression:
    """Return centreline and corridor regressed frame by frame along a cloud's road, in map coordinates, bounded memory.

    Args:
        predictor: a trained model.
        cloud: file with the road's points.
        line: line along the road, map coordinates; None if it is found in the cloud, as the middle of its ground.
        progress: called with the share that is done.

    Raises:
        MissingFileError, InputError: the file is missing or damaged, or the cloud holds no ground.
    """
    ground = find_ground(cloud, progress)
    line = line or path_through(ground)
    frames = frames_along(line, predictor.settings.frame_spacing)
    shape = (len(frames), len(TARGETS))
    value, raw_std, std = (np.full(shape, np.nan) for _ in range(3))
    widths = np.full((*shape, 2), np.nan)
    for road, local_frames, rows in strips(cloud, ground, line, frames, progress):
        regression = predictor.regress(road, local_frames)
        # Frames keep their stations, which rise strictly, from strip to strip.
        frame_numbers = np.searchsorted(frames.station, regression.frames.station[rows])
        value[frame_numbers] = regression.value[rows]
        value[frame_numbers, _HEIGHT] += road.origin[2]
        raw_std[frame_numbers], std[frame_numbers], widths[frame_numbers] = (
            regression.raw_std[rows],
            regression.std[rows],
            regression.widths[rows],
        )
        progress("finding the road", float(frame_numbers[-1] + 1) / len(frames) if len(frame_numbers) else 0.0)
    found_span = _found_span(value[:, 0])
    codes = (ground.header.epsg, ground.header.height_epsg)
    return Regression(
        frames.select(found_span), value[found_span], raw_std[found_span], std[found_span], widths[found_span], *codes
    )


def _found_span(center: Float) -> slice:
    """Return the slice from the first to the last frame whose `center` isn't NaN; of all frames if all are NaN."""
    found_frames = np.flatnonzero(np.isfinite(center))
    return slice(int(found_frames[0]), int(found_frames[-1]) + 1) if len(found_frames) else slice(None)


DIGITS = 4
"""Decimals of lengths in files: 0.1 mm."""
UNITS = {"lanes": "1", "heading": "rad"}
"""Units of the corridor's columns that aren't in metres."""


def centerline_geojson(regression: Regression, name: str, spacing: float) -> dict[str, Any]:
    """Return centreline and pavement edges as a GeoJSON FeatureCollection, one LineString per stretch without a gap.

    Each has, per vertex, its station along the path, its standard deviation across the road and the half-widths of the
    intervals that cover 68 % and 95 %, m.

    Args:
        regression: by the model.
        name: name of the collection.
        spacing: distance between frames, m.
    """
    features = []
    for line in ("center", "left_edge", "right_edge"):
        column = TARGETS.index(line)
        points = regression.points(line)
        is_found = np.isfinite(points).all(axis=1)
        after_gap = np.concatenate([[True], np.diff(regression.frames.station) > 1.5 * spacing])
        ends = np.flatnonzero(after_gap | ~is_found | ~np.concatenate([[False], is_found[:-1]]))
        for stretch in np.split(np.arange(len(is_found)), ends):
            part = stretch[is_found[stretch]]
            if len(part) < 2:
                continue
            properties = {
                "feature": "centerline" if line == "center" else line,
                "stations": _as_list(regression.frames.station[part]),
                "std": _as_list(regression.std[part, column]),
                "interval_68": _as_list(regression.widths[part, column, 0]),
                "interval_95": _as_list(regression.widths[part, column, 1]),
            }
            geometry = {"type": "LineString", "coordinates": np.round(points[part], DIGITS).tolist()}
            features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    collection: dict[str, Any] = {"type": "FeatureCollection", "name": name}
    if regression.epsg is not None:
        urn = system_urn(regression.epsg, regression.height_epsg)
        collection["crs"] = {"type": "name", "properties": {"name": urn}}
    return collection | {"features": features}


def corridor_json(regression: Regression, calibration: Mapping[str, Any]) -> dict[str, Any]:
    """Return the corridor as JSON data: per column a list of one number per frame, None where the model found nothing.

    Args:
        regression: by the model.
        calibration: calibration of the deviations, as JSON data.
    """
    frames = regression.frames
    columns: dict[str, Any] = {
        "station": _as_list(frames.station),
        "x": _as_list(frames.position[:, 0]),
        "y": _as_list(frames.position[:, 1]),
        "direction": _as_list(frames.direction, 6),
    }
    for index, name in enumerate(TARGETS):
        digits = 6 if name == "heading" else DIGITS
        columns[name] = _as_list(regression.value[:, index], digits)
        columns[f"{name}_std"] = _as_list(regression.std[:, index], digits)
        columns[f"{name}_68"] = _as_list(regression.widths[:, index, 0], digits)
        columns[f"{name}_95"] = _as_list(regression.widths[:, index, 1], digits)
    return {
        "type": "Corridor",
        "version": "1.0",
        "epsg": regression.epsg,
        **({"height_epsg": regression.height_epsg} if regression.height_epsg else {}),
        "units": {name: UNITS.get(name, "m") for name in ("center", *CORRIDOR)},
        "calibration": dict(calibration),
        "slices": columns,
    }


def _as_list(values: Float, digits: int = DIGITS) -> list[float | None]:
    """Return numbers rounded for JSON, None where they aren't finite; adding 0.0 turns -0.0 into 0.0."""
    return [round(value, digits) + 0.0 if np.isfinite(value) else None for value in values.tolist()]
