"""The road found in a cloud: a path parallel to it, the lines beside it, and the axis that all views agree on."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Bool, Float
from ..base.errors import InputError
from ..base.progress import Progress, silent
from .cloud import PointKind, RoadCloud
from .layout import RoadKind, RoadLayout, axis_guides, find_layout, with_branch
from .lines import find_lines
from .path import CloudPath, first_path, path_through
from .profiles import ACROSS, STRETCH, Profiles, make_profiles, register_path
from .views.fusion import FusedAxis, mean_axis
from .views.look import find_fused_axis
from .views.view import View

Predictor = Callable[[RoadCloud, CloudPath], tuple[Float, Float]]
"""Returns offset and standard deviation (M,) of the axis at each point of a path; NaN where it knows none."""


_HALF_WIDTHS = (12.0, 45.0)
"""Least and largest reach of profiles, m. Chosen: a rural road with its verges, and a motorway of four lanes each
way."""
_MARGIN = 8.0
"""Reach outside of the surface that the first path was made from, m. Chosen: that path may be off by as much."""
_REGISTRATIONS, _PARALLEL = 6, 0.3
"""Times that a path is laid beside lines at most, and distance that it may still move by, m. Chosen: bounds the work;
lines that bend by less are followed."""
_GRIDS = (-0.5, -0.25, 0.25)
"""Shifts of further grids beside the first, bins. Chosen: a fraction of a bin moves points to other bins."""
_PASSES, _STILL = 4, 0.15
"""Times that the axis is looked for at most, and distance that it may still move by, m. Chosen: bounds the work; a
line's width."""


@dataclass(frozen=True)
class Options:
    """Settings of a reconstruction.

    Attributes:
        road: dual or single carriageway, where it is known.
        tolerance: of the alignment's fit to the axis, m (`fit_axis`).
        path: course of the road in local coordinates (K, 2), where the cloud alone doesn't show it.
        predictor: one more view of the axis, beside those that learn nothing.
        snap: take the standard cross-section's widths where the measured ones are near enough.
        title: of the parameter set.
    """

    road: RoadKind | None = None
    tolerance: float = 0.03
    path: Float | None = None
    predictor: Predictor | None = None
    snap: bool = False
    title: str = ""


@dataclass(frozen=True)
class FoundRoad:
    """A road found in a cloud, before anything is fitted to it.

    Attributes:
        cloud: the points that it was found in.
        half: width beside it within which there is something to see, m.
        layout: that profiles along a path parallel to the road show.
        axis: that all views of it agree on.
    """

    cloud: RoadCloud
    half: float
    layout: RoadLayout
    axis: FusedAxis

    @property
    def path(self) -> CloudPath:
        """Return the path parallel to the road."""
        return self.layout.profiles.path

    def layout_along(self, path: CloudPath, kind: RoadKind | None) -> RoadLayout:
        """Return the layout that profiles along another path show; InputError if they show no road of that kind."""
        profiles = make_profiles(self.cloud, path, self.half, exact=True)
        return find_layout(profiles, find_lines(profiles), kind)

    def open_along(self, path: CloudPath, stations: Float) -> Bool:
        """Return a mask (K,) of stations, m, along a path beside which the views of the axis disagree."""
        station, _ = path.project(self.path.place(self.axis.stations, self.axis.offsets))
        return np.interp(stations, station, self.axis.open.astype(np.float64)) > 0.5

    def parted_line(self, path: CloudPath, stations: Float) -> Float | None:
        """Return the offsets (K,), m, from a path of what lies midway between a parted middle line's branches.

        NaN where the middle line isn't seen; None where it doesn't part. Along an axis that goes between the branches
        neither is easily followed, so that they are those that were followed here.

        Args:
            path: near the axis.
            stations: (K,) along it, m.
        """
        branch = self.layout.bands[0].branch
        if branch is None or not np.any(branch):
            return None
        (guide,) = axis_guides(self.layout)
        known = np.isfinite(guide.measured)
        station, offset = path.project(self.path.place(guide.stations[known], guide.measured[known]))
        order = np.argsort(station, kind="stable")
        distance = np.abs(stations[:, None] - station[None]).min(axis=1)
        return np.where(distance <= STRETCH, np.interp(stations, station[order], offset[order]), np.nan)


def straighten_path(cloud: RoadCloud, options: Options, progress: Progress = silent) -> tuple[CloudPath, float]:
    """Return a path parallel to the road, and the half width (m) beside it within which there is something to see.

    `progress` is told the share of its passes that are done at most.
    """
    xy = cloud.xyz[cloud.of(PointKind.PAVEMENT, PointKind.MARKING) if cloud.labelled else cloud.surface, :2]
    path = path_through(options.path) if options.path is not None else first_path(xy)
    _, offset = path.project(xy[:: max(1, len(xy) // 200_000)])
    near = np.abs(offset)[np.abs(offset) < _HALF_WIDTHS[1]]
    if not len(near):
        raise InputError("--path", None, "no point of the road lies within 45 m of it")
    half = float(np.clip(np.percentile(near, 99) + _MARGIN, *_HALF_WIDTHS))
    # Until it lies still: where a kink is left in it, the lines beside it bend by more than they can be followed.
    for number in range(_REGISTRATIONS):
        progress("path", number / _REGISTRATIONS)
        before, path = path, register_path(path, make_profiles(cloud, path, half))
        if float(np.abs(before.project(path.points)[1]).max()) <= _PARALLEL:
            break
    return path, half


def find_axis(
    cloud: RoadCloud, path: CloudPath, half: float, options: Options, progress: Progress = silent
) -> FoundRoad:
    """Return profiles along the road, the layout of lines that they show, and the axis that all views agree on.

    Along the path that is given, and again along the axis that was found beside it until it lies still, as a straight
    line is smoothed and followed better than a bent one, and as a path that has slipped by a lane comes back. Where the
    middle line parts in two that path follows one branch; the axis then goes between both. `progress` is told the share
    of its passes that are done at most.
    """
    progress("lines", 0.0)
    road = _look_along(cloud, path, half, options)
    for number in range(1, _PASSES):
        progress("lines", number / _PASSES)
        if number > 1 and float(np.abs(road.axis.offsets).max()) <= _STILL:
            break
        # The next path is the axis itself: lines beside it are then straight, and smoothing bends none of them.
        offsets = np.interp(road.path.stations, road.axis.stations, road.axis.offsets)
        road = _look_along(cloud, road.path.shift_by(offsets), half, options)
    layout = with_branch(road.layout)
    learned = _learned_view(cloud, layout.profiles, options)
    first = find_fused_axis(layout, learned)
    others = [_axis_in_grid(road, learned, share * ACROSS) for share in _GRIDS]
    return replace(road, layout=layout, axis=mean_axis(first, [axis for axis in others if axis is not None]))


def _axis_in_grid(road: FoundRoad, learned: list[View], shift: float) -> FusedAxis | None:
    """Return the axis as another grid of bins shows it, with offsets from the same path; None where it shows no road.

    Args:
        road: along the path.
        learned: views that don't come from a grid.
        shift: m to the left of the path that the grid lies.
    """
    try:
        layout = with_branch(road.layout_along(road.path.beside(shift), road.layout.kind))
        axis = find_fused_axis(layout, [replace(view, offsets=view.offsets - shift) for view in learned])
    except InputError:
        return None
    return replace(axis, offsets=axis.offsets + shift, raw=axis.raw + shift)


def _look_along(cloud: RoadCloud, path: CloudPath, half: float, options: Options) -> FoundRoad:
    """Return what a path shows: profiles, layout, and the axis by the views that learn nothing."""
    profiles = make_profiles(cloud, path, half, exact=True)
    layout = find_layout(profiles, find_lines(profiles), options.road)
    return FoundRoad(cloud, half, layout, find_fused_axis(layout))


def _learned_view(cloud: RoadCloud, profiles: Profiles, options: Options) -> list[View]:
    """Return what the learned predictor says of the axis in the profiles' stretches, as a view; nothing without one.

    Raises:
        InputError: the model tells the axis nowhere in this cloud.
    """
    if options.predictor is None:
        return []
    offset, std = options.predictor(cloud, profiles.path)
    along, known = profiles.path.stations, np.isfinite(offset)
    if not known.any():
        raise InputError("--run", None, "the model tells the axis nowhere in this cloud")
    seen = np.interp(profiles.middles, along, known.astype(np.float64)) > 0.5
    value = np.interp(profiles.middles, along[known], offset[known])
    deviation = np.interp(profiles.middles, along[known], np.maximum(std[known], 0.01))
    return [View("network", np.where(seen, value, np.nan), np.where(seen, deviation, np.inf))]
