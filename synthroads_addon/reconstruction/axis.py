"""The road found in a cloud: a path parallel to it, the lines beside it, and the axis that all views agree on."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Bool, Float
from ..base.errors import InputError
from ..base.progress import Progress, silent
from .cloud import PointKind, RoadCloud
from .layout import RoadKind, RoadLayout, find_layout, with_branch
from .lines import find_lines
from .path import CloudPath, first_path, path_through
from .profiles import ACROSS, STRETCH, Profiles, make_profiles, register_path
from .views.fusion import FusedAxis, mean_axis
from .views.look import find_fused_axis
from .views.view import View
from .views.vote import axis_guides

Predictor = Callable[[RoadCloud, CloudPath], tuple[Float, Float]]
"""Function that returns the axis' offset and standard deviation (M,), m, at each point of a path; NaN where unknown."""


_HALF_WIDTHS = (12.0, 45.0)
"""Least and largest reach of profiles, m. Chosen: a rural road with its verges, and a motorway of four lanes each
way."""
_MARGIN = 8.0
"""Reach outside of the surface that the first path was made from, m. Chosen: that path may be off by as much."""
_REGISTRATIONS, _PARALLEL = 16, 0.3
"""Times that a path is laid beside lines at most, and distance that it may still move by, m. Chosen: bounds the work;
lines that bend by less are followed."""
_GRIDS = (-0.5, -0.25, 0.25)
"""Shifts of further grids beside the first, bins. Chosen: a fraction of a bin moves points to other bins."""
_CONFIRMED = 0.3
"""Distance from the axis within which lines and a network confirm each other, m. Chosen: two widths of a line."""
_PASSES, _STILL = 4, 0.15
"""Times that the axis is looked for at most, and distance that it may still move by, m. Chosen: bounds the work; a
line's width."""


@dataclass(frozen=True)
class Options:
    """Settings of a reconstruction.

    Attributes:
        road: dual or single carriageway; None if the cloud must tell.
        tolerance: root mean square distance that the alignment may keep from the axis, m (`fit_axis`).
        path: rough course of the road in local coordinates (K, 2), m; None if the cloud must show it.
        predictor: trained network that gives one more view of the axis; None for rule-based views alone.
        snap: whether measured widths near a standard cross-section's are replaced by the standard ones.
        title: title of the parameter set.
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
        half_width: reach of the cross profiles to either side of the path, m.
        layout: carriageways and lines that profiles along a path parallel to the road show.
        axis: offsets of the axis from that path, on which all views agree.
        asked: kind of road that the user gave; None if the cloud had to tell.
        learned: points (N, 2) of the axis that a network sees, m; None without one.
    """

    cloud: RoadCloud
    half_width: float
    layout: RoadLayout
    axis: FusedAxis
    asked: RoadKind | None = None
    learned: Float | None = None

    @property
    def path(self) -> CloudPath:
        """Return the path parallel to the road."""
        return self.layout.profiles.path

    def layout_along(self, path: CloudPath, kind: RoadKind | None) -> RoadLayout:
        """Return the layout that profiles along another path show; InputError if they show no road of that kind."""
        profiles = make_profiles(self.cloud, path, self.half_width, keep_points=True)
        learned = learned_along(self.learned, profiles)
        return find_layout(profiles, find_lines(profiles), kind, asked=self.asked is not None, learned=learned)

    def open_along(self, path: CloudPath, stations: Float) -> Bool:
        """Return at which of the stations (K,), m, along a path the views of the axis disagree, as a mask (K,)."""
        station, _ = path.project(self.path.place(self.axis.stations, self.axis.offsets))
        return np.interp(stations, station, self.axis.open.astype(np.float64)) > 0.5

    def confirmed_along(self, path: CloudPath, stations: Float) -> Bool:
        """Return at which stations (K,), m, along a path lines and a network agree on the axis, as a mask (K,)."""
        station, _ = path.project(self.path.place(self.axis.stations, self.axis.offsets))
        agrees = np.ones(len(station), dtype=bool)
        for name in ("lines", "network"):
            distances = [np.abs(view.offsets - self.axis.offsets) for view in self.axis.views if view.name == name]
            agrees &= distances[0] < _CONFIRMED if distances else False
        return np.interp(stations, station, agrees.astype(np.float64)) > 0.5

    def parted_line(self, path: CloudPath, stations: Float) -> Float | None:
        """Return the offsets (K,), m, from a path of the line midway between both branches of a middle line that parts.

        NaN where the middle line isn't seen; None if it parts nowhere. Along an axis that runs between the branches
        neither can be followed well, so the branches of this road's own path are used.

        Args:
            path: another path near the axis.
            stations: (K,) along that path, m.
        """
        branch = self.layout.bands[0].branch
        if branch is None or not np.any(branch):
            return None
        (guide,) = axis_guides(self.layout)
        seen_mask = np.isfinite(guide.measured)
        station, offset = path.project(self.path.place(guide.stations[seen_mask], guide.measured[seen_mask]))
        order = np.argsort(station, kind="stable")
        distance = np.abs(stations[:, None] - station[None]).min(axis=1)
        return np.where(distance <= STRETCH, np.interp(stations, station[order], offset[order]), np.nan)


def straighten_path(cloud: RoadCloud, options: Options, progress: Progress = silent) -> tuple[CloudPath, float]:
    """Return a path parallel to the road, and the reach of cross profiles to either side of it, m.

    ``progress`` is called before each pass with the share of `_REGISTRATIONS` passes that are done.
    """
    xy = cloud.xyz[cloud.of(PointKind.PAVEMENT, PointKind.MARKING) if cloud.labelled else cloud.surface, :2]
    path = path_through(options.path) if options.path is not None else first_path(xy)
    # Chosen: 200,000 points tell the road's width.
    _, offset = path.project(xy[:: max(1, len(xy) // 200_000)])
    distances = np.abs(offset)[np.abs(offset) < _HALF_WIDTHS[1]]
    if not len(distances):
        raise InputError("--path", None, "no point of the road lies within 45 m of it")
    half_width = float(np.clip(np.percentile(distances, 99) + _MARGIN, *_HALF_WIDTHS))
    # Repeated until the path moves by less than `_PARALLEL`: beside a kink in it lines bend too much to be followed.
    for number in range(_REGISTRATIONS):
        progress("path", number / _REGISTRATIONS)
        previous_path, path = path, register_path(path, make_profiles(cloud, path, half_width))
        if float(np.abs(previous_path.project(path.points)[1]).max()) <= _PARALLEL:
            break
    return path, half_width


def find_axis(
    cloud: RoadCloud, path: CloudPath, half_width: float, options: Options, progress: Progress = silent
) -> FoundRoad:
    """Return profiles along the road, the layout of lines that they show, and the axis that all views agree on.

    The axis is looked for along the given path, then again along the axis just found, until that moves no more: a
    straight line is followed better than a bent one, and a path that has slipped by a lane comes back. Where the middle
    line parts in two the path follows one branch, the axis runs between both. The result is the mean of the axes in
    several grids of bins, shifted against each other, so that where the bins lie makes no difference. ``progress`` is
    called with the share of the passes that are done.
    """
    progress("lines", 0.0)
    learned = _learned_points(cloud, path, options)
    road = _look_along(cloud, path, half_width, options, learned)
    for number in range(1, _PASSES):
        progress("lines", number / _PASSES)
        # The first path may be anywhere: only the second look, along an axis, can show that the axis stands still.
        if number > 1 and float(np.abs(road.axis.offsets).max()) <= _STILL:
            break
        road = _look_along(cloud, _next_path(road), half_width, options, learned)
    layout = with_branch(road.layout)
    learned_views = _learned_view(cloud, layout.profiles, options)
    path_axis = find_fused_axis(layout, learned_views)
    shifted_axes = [_axis_in_grid(road, learned_views, share * ACROSS) for share in _GRIDS]
    return replace(road, layout=layout, axis=mean_axis(path_axis, [axis for axis in shifted_axes if axis is not None]))


def _next_path(road: FoundRoad) -> CloudPath:
    """Return the axis of a road as a path: lines beside it are then straight, and smoothing bends none of them.

    Beside bays a path in the middle of the pavement has kinks against the axis, which smoothing offsets from it would
    take for faults: where no line shows the axis it is smoothed in the plane.
    """
    layout = road.layout
    if layout.one_sided is not None and layout.one_sided.excess.any() and axis_guides(layout)[0].width == 0.0:
        return layout.one_sided.course(road.path, layout.profiles.middles)
    return road.path.shift_by(np.interp(road.path.stations, road.axis.stations, road.axis.offsets))


def _axis_in_grid(road: FoundRoad, learned_views: list[View], shift: float) -> FusedAxis | None:
    """Return the axis as another grid of bins shows it, with offsets from the same path; None where it shows no road.

    Args:
        road: the road as it was found along the path.
        learned_views: views by a network, which don't come from a grid of bins.
        shift: distance by which the grid is shifted to the left, m.
    """
    try:
        layout = with_branch(road.layout_along(road.path.beside(shift), road.layout.kind))
        axis = find_fused_axis(layout, [replace(view, offsets=view.offsets - shift) for view in learned_views])
    except InputError:
        return None
    return replace(axis, offsets=axis.offsets + shift, raw=axis.raw + shift)


def _look_along(
    cloud: RoadCloud, path: CloudPath, half_width: float, options: Options, learned: Float | None
) -> FoundRoad:
    """Return the road that profiles along a path show: its layout, and its axis by the rule-based views."""
    profiles = make_profiles(cloud, path, half_width, keep_points=True)
    layout = find_layout(profiles, find_lines(profiles), options.road, learned=learned_along(learned, profiles))
    return FoundRoad(cloud, half_width, layout, find_fused_axis(layout), options.road, learned)


def _learned_points(cloud: RoadCloud, path: CloudPath, options: Options) -> Float | None:
    """Return the points (N, 2), m, of the axis that the predictor sees along a path; None if it sees none."""
    if options.predictor is None:
        return None
    offset, _ = options.predictor(cloud, path)
    is_predicted = np.isfinite(offset)
    return path.place(path.stations[is_predicted], offset[is_predicted]) if is_predicted.sum() > 1 else None


def learned_along(points: Float | None, profiles: Profiles) -> Float | None:
    """Return the offsets (K,), m, of a network's axis (N, 2) in profiles' stretches; NaN where it has no point near."""
    if points is None:
        return None
    station, offset = profiles.path.project(points)
    order = np.argsort(station, kind="stable")
    station, offset = station[order], offset[order]
    after = np.clip(np.searchsorted(station, profiles.middles), 1, len(station) - 1)
    nearest = np.minimum(np.abs(profiles.middles - station[after - 1]), np.abs(station[after] - profiles.middles))
    return np.where(nearest <= STRETCH, np.interp(profiles.middles, station, offset), np.nan)


def _learned_view(cloud: RoadCloud, profiles: Profiles, options: Options) -> list[View]:
    """Return the predictor's axis in the profiles' stretches as a list of one view; an empty list without a predictor.

    Raises:
        InputError: the model predicts no axis anywhere in this cloud.
    """
    if options.predictor is None:
        return []
    offset, std = options.predictor(cloud, profiles.path)
    path_stations, is_predicted = profiles.path.stations, np.isfinite(offset)
    if not is_predicted.any():
        raise InputError("--run", None, "the model predicts no axis anywhere in this cloud")
    has_axis = np.interp(profiles.middles, path_stations, is_predicted.astype(np.float64)) > 0.5
    value = np.interp(profiles.middles, path_stations[is_predicted], offset[is_predicted])
    # Chosen: no prediction counts as better than 1 cm, so that one view can't outweigh all the others.
    deviation = np.interp(profiles.middles, path_stations[is_predicted], np.maximum(std[is_predicted], 0.01))
    return [View("network", np.where(has_axis, value, np.nan), np.where(has_axis, deviation, np.inf))]
