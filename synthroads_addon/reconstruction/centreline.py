"""A road's centreline as it is seen in a cloud, without an alignment fitted to it, and how far it is to be trusted."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.machine import linear_algebra_on_one_thread
from ..base.progress import Progress, part_of, silent
from .axis import Options, find_axis, learned_along, straighten_path
from .cloud import RoadCloud
from .ground.strips import Strip, find_strips
from .judgement import Judgement, judge
from .layout import RoadKind, find_layout
from .lines import find_lines
from .path import CloudPath
from .profiles import STRETCH, Profiles, make_profiles
from .smoothing import difference_figures, fill_gaps, smooth
from .views.fusion import DEFINITION, FusedAxis
from .views.intervals import half_width

INTERVALS = {"interval_68": (0.68, 1.0), "interval_95": (0.95, 1.96)}
"""Intervals' probabilities, and the standard deviations that hold these of a normal distribution."""
_AT_AXIS = 0.5
"""Distance to either side of the axis whose ground gives the height, m. Chosen: as wide as rows of points lie apart."""
_WAVELENGTH = 20.0
"""Wavelength of which half of the ground's height is kept, m. Chosen: shorter waves are noise; vertical curves are
longer."""
_DIGITS = 4
"""Digits of lengths in files. Chosen: a tenth of a millimetre."""


@dataclass(frozen=True)
class Centreline:
    """A centreline with a vertex each metre, in the cloud's local coordinates.

    Attributes:
        kind: dual or single carriageway.
        path: the centreline's M vertices.
        height: (M,) of the ground at each vertex, m.
        std: (M,) standard deviation across the road, m.
        half_widths: by name of `INTERVALS` the half-widths (M,) of the intervals that hold the true centreline, m.
        axis: the fused axis with its views, along the path that was found first.
        judgement: stretches where the line isn't to be trusted; stations are those of the path.
        notes: remarks on what was left out.
        parted: (K,) probability that the road has two carriageways, in each stretch of 5 m from the path's start; None
            if nothing was looked for.
        strips: strips of pavement beside the road, in the same stretches: further carriageways and ramps.
    """

    kind: RoadKind
    path: CloudPath
    height: Float
    std: Float
    half_widths: dict[str, Float]
    axis: FusedAxis
    judgement: Judgement
    notes: tuple[str, ...]
    parted: Float | None = None
    strips: tuple[Strip, ...] = ()


@linear_algebra_on_one_thread(scipy=True)
def find_centreline(cloud: RoadCloud, options: Options | None = None, progress: Progress = silent) -> Centreline:
    """Return the centreline of the road that a cloud shows, by all views of it, with its deviations and doubts.

    Raises:
        InputError: no road can be made out in the cloud.
    """
    options = options or Options()
    path, profile_half_width = straighten_path(cloud, options, part_of(progress, 0.0, 0.4))
    road = find_axis(
        cloud.near(path, profile_half_width), path, profile_half_width, options, part_of(progress, 0.4, 0.8)
    )
    seen_path = _seen_part(road.path, road.axis)
    offsets = np.interp(seen_path.stations, road.axis.stations, road.axis.offsets)
    line = seen_path.shift_by(offsets)
    progress("judging", 0.8)
    profiles = make_profiles(cloud, line, profile_half_width, keep_points=True)
    learned = learned_along(road.learned, profiles)
    layout = find_layout(profiles, find_lines(profiles), options.road, learned=learned)
    cores = [0.5 * (band.low + band.high) for band in layout.bands] if layout.kind == "dual" else [0.0]
    axis_stations, _ = line.project(road.path.place(road.axis.stations, road.axis.offsets))
    rivals = road.open_along(line, profiles.middles)
    # Two independent errors: of the axis, and of where people say that an axis lies.
    std = np.hypot(DEFINITION, np.interp(line.stations, axis_stations, road.axis.std))
    half_widths = {
        name: np.interp(line.stations, axis_stations, half_width(road.axis, share, factor, DEFINITION))
        for name, (share, factor) in INTERVALS.items()
    }
    confirmed = road.confirmed_along(line, profiles.middles)
    judgement = judge(layout, cores, rivals, road.parted_line(line, profiles.middles), confirmed)
    heights, notes = _heights(profiles), layout.notes
    strips = tuple(find_strips(layout.pavement, layout.bands[0].low, layout.bands[-1].high))
    return Centreline(layout.kind, line, heights, std, half_widths, road.axis, judgement, notes, layout.parted, strips)


def _seen_part(path: CloudPath, axis: FusedAxis) -> CloudPath:
    """Return the part of a path from the first to the last stretch in which any view sees the axis."""
    seen_stations = axis.stations[np.isfinite(axis.raw)]
    if not len(seen_stations):
        return path
    # 2.5 m: half of a stretch, to its ends.
    in_part = (path.stations >= seen_stations[0] - 2.5) & (path.stations <= seen_stations[-1] + 2.5)
    first_point = int(np.flatnonzero(in_part)[0])
    return CloudPath(path.points[in_part], path.heading[in_part], path.start + first_point)


def _heights(profiles: Profiles) -> Float:
    """Return the ground's height (M,), m, along the profiles' path, smoothed and bridged; NaN if none is seen."""
    at_axis = np.abs(profiles.offsets) < _AT_AXIS
    bins = profiles.height[:, at_axis].astype(np.float64)
    has_points = np.isfinite(bins)
    count = has_points.sum(axis=1)
    mean = np.where(count > 0, np.where(has_points, bins, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
    if not np.isfinite(mean).any():
        return np.full(len(profiles.path.points), np.nan)
    smooth_heights = smooth(mean, np.isfinite(mean).astype(np.float64), 1.0, _WAVELENGTH).values
    bridged_heights = fill_gaps(np.where(np.isfinite(mean), smooth_heights, np.nan))
    return np.interp(profiles.path.stations, profiles.stations, bridged_heights)


def centreline_geojson(centreline: Centreline, cloud: RoadCloud, name: str) -> dict[str, Any]:
    """Return a centreline as a GeoJSON FeatureCollection in map coordinates, m.

    Its feature has, per vertex, the station along it, the standard deviation across it and the half-widths of the
    intervals that cover 68 % and 95 %, and the stretches where it isn't to be trusted.
    """
    height = np.where(np.isfinite(centreline.height), centreline.height, 0.0)
    points = np.column_stack([centreline.path.points, height]) + cloud.origin
    properties = {
        "feature": "centerline",
        "stations": _rounded(centreline.path.stations - centreline.path.start),
        "std": _rounded(centreline.std),
        **{name: _rounded(half_width) for name, half_width in centreline.half_widths.items()},
        "doubtful": _from_start(centreline),
    }
    geometry = {"type": "LineString", "coordinates": np.round(points, _DIGITS).tolist()}
    collection: dict[str, Any] = {"type": "FeatureCollection", "name": name}
    if cloud.place.system and cloud.place.system.urn:
        collection["crs"] = {"type": "name", "properties": {"name": cloud.place.system.urn}}
    return collection | {"features": [{"type": "Feature", "properties": properties, "geometry": geometry}]}


def centreline_report(centreline: Centreline, cloud: RoadCloud) -> dict[str, Any]:
    """Return a centreline's report as JSON data: its views with their differences from it, deviations, doubts; m."""
    views = []
    for view in centreline.axis.views:
        member = centreline.axis.members[view.name]
        difference = difference_figures(view.offsets - centreline.axis.offsets, "mean", "rms", "largest")
        used_share = round(float(member.mean()), 4)
        views.append(
            {"name": view.name, "seen": round(view.seen, 4), "used": used_share, "from_centreline": difference}
        )
    return {
        "road": centreline.kind,
        "carriageways": _carriageways(centreline),
        "length": round(centreline.path.length, 2),
        "points": cloud.read,
        "views": views,
        "std": {"mean": round(float(centreline.std.mean()), 4), "largest": round(float(centreline.std.max()), 4)},
        "judgement": centreline.judgement.to_dict() | {"doubtful": _from_start(centreline)},
        "notes": list(centreline.notes),
    }


def _carriageways(centreline: Centreline) -> list[dict[str, Any]]:
    """Return as JSON data the stretches with the same numbers of carriageways and ramps, and their probability, m."""
    if centreline.parted is None:
        return []
    number = 1 + (centreline.parted > 0.5).astype(np.int64)
    ramps = np.zeros(len(number), dtype=np.int64)
    probability = np.maximum(centreline.parted, 1.0 - centreline.parted)
    for strip in centreline.strips:
        is_ramp = strip.ramp > 0.5
        number += ~is_ramp & strip.present
        ramps += is_ramp & strip.present
        probability = np.where(
            strip.present, probability * strip.probability * max(strip.ramp, 1.0 - strip.ramp), probability
        )
    borders = [0, *(np.flatnonzero(np.diff(number) | np.diff(ramps)) + 1).tolist(), len(number)]
    result = []
    for first, end in pairwise(borders):
        stretch = {"start": float(STRETCH * first), "end": min(float(STRETCH * end), round(centreline.path.length, 1))}
        counts = {"number": int(number[first]), "ramps": int(ramps[first])}
        result.append({**stretch, **counts, "probability": round(float(np.mean(probability[first:end])), 4)})
    return result


def _from_start(centreline: Centreline) -> list[dict[str, Any]]:
    """Return the doubtful stretches as JSON data, stations counted from the line's first vertex."""
    start, data = centreline.path.start, centreline.judgement.to_dict()["doubtful"]
    return [
        doubt | {"start": round(doubt["start"] - start, 1), "end": round(doubt["end"] - start, 1)} for doubt in data
    ]


def _rounded(values: Float) -> list[float | None]:
    """Return values (M,) rounded for a JSON file, None where they aren't finite; adding 0.0 turns -0.0 into 0.0."""
    return [round(value, _DIGITS) + 0.0 if np.isfinite(value) else None for value in values.tolist()]
