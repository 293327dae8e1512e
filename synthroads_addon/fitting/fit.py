"""A measured axis becomes an alignment of lines, arcs and clothoids and a vertical profile, within a tolerance.

The axis is smoothed, cut into many elements of linear curvature (in height: of linear grade), and these are thinned,
moved and snapped to lines and arcs while the tolerance holds (`fitting.search`). Data without noise, such as points on
another alignment, give its elements back. Long axes are fitted in overlapping windows: each begins with the pose and
curvature at which the one before was left, so time and memory stay proportional to the length.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError

from ..base.arrays import Float, Int
from ..base.errors import InputError
from ..base.machine import linear_algebra_on_one_thread
from ..base.maps.crs import MapSystem
from ..base.remarks import warn
from ..base.schema import round_value
from ..road.alignment import Alignment, finite_array
from ..road.other_roads.axis import HorizontalElement, VerticalPoint
from ..road.parameters import AlignmentObject
from ..road.profile import IntersectionPoint, Profile
from ..scenario.road import RoadScenario
from .chain import EQUAL, FREE, NEAR, ZERO, AxisData, Chain, ChainFit, Heights, Plan, Start, elevations, refine
from .follow import follow_heights, follow_points
from .search import Goal, descent, improve_fit, independent_count

_WINDOW = 1200.0
"""Length of a window, m. Chosen: the work grows with its third power."""
_TAIL = 300.0
"""Length at a window's end that only steadies what lies before, m. Chosen: more than an element's influence reaches."""
_MOST_POINTS = 3000
"""Points in a window at most. Chosen: denser data are thinned for the search, not for the figures reported."""
_HEIGHT_SHARE = 0.6
"""Share of the tolerance that the heights' root mean square may use. Chosen: heights are seen more exactly than they
matter in plan."""
_END_ELEMENT = 20.0
"""Length of a line or an arc at an end, to begin with, m. Chosen: the fit changes it."""
_SPARED = 1.0
"""Twice the logarithm of likelihood that such an end may cost. Chosen: one standard deviation of one parameter."""
_EXACT = 1e-6
"""Root mean square up to which data lie on a chain of elements, m. Chosen: no smooth curve comes so near with few of
them."""
_ROUNDED = 3.5e-4
"""The same of coordinates that were rounded to 1 mm, m, where residuals are random. Chosen: a millimetre over sqrt(12)
is 2.9e-4."""
_RANDOM = 0.5
"""Correlation of neighbouring residuals that still passes for random. Chosen: what a missed element leaves is nearer to
1."""
_GAP = 100.0
"""Distance of points from which on the chord between them is given some weight, m. Chosen: an element may bend there
unseen."""
_CHORD_WEIGHT = 1e-3
"""Weight of a chord's points. Chosen: they hold where there is nothing else, and pull no real point."""
_MARGIN = 0.98
"""Share of the tolerance that the search aims at. Chosen: it may see thinned points only."""
_NEGLIGIBLE = 0.3
"""Share of the tolerance below which residuals are worth no element. Chosen: an eleventh of its square."""
_FINER_HELPS = 0.8
"""Share of the noise that knots half as far apart must leave at most to be needed. Chosen: else the rest is noise."""
_SCATTER = 1.2
"""Times the noise that fewer elements may leave where the tolerance asks for less. Chosen: the data scatter so."""
_RELAXED = 1.5
"""Times what dense knots reach that is aimed at where the tolerance can't be had. Chosen: less would fit noise."""
_FLATTEST = 1e7
"""Largest radius of a rounding, m. Chosen: a larger one bends by less than 1 mm over 100 m, and is written as a
kink."""
REFUSED_BEYOND = 40.0
"""Times the tolerance that a point may be away from the road fitted to an axis: 2 m of the usual 5 cm. Real axes stay
below 6, a corner of 90 degrees just passes; beyond that it is another line than the one that was measured."""
_KNOTS = 2.5
"""Points that a knot needs between it and the next one. Chosen: heights between sparse points don't swing."""
_NO_ROAD = 3.0
"""Times what is refused that dense knots are off where fewer elements aren't looked for. Chosen: no road does so."""
_PLAY = 1e-5
"""Share of a radius that is left out. Chosen: roundings that touch must not overlap once stations and elevations are
rounded."""


@dataclass(frozen=True)
class Deviations:
    """Statistics of points' distances from the alignment or profile fitted to them.

    Attributes:
        rms, p95, worst: root mean square, 95th percentile and maximum of the absolute distances, m.
        worst_station: station of the largest distance, m.
    """

    rms: float
    p95: float
    worst: float
    worst_station: float

    @classmethod
    def of(cls, station: Float, distance: Float) -> Self:
        """Return root mean square, 95th percentile and maximum of the absolute distances (N,) at stations (N,), m."""
        size = np.abs(distance)
        worst_index, rms = int(size.argmax()), float(np.sqrt((size**2).mean()))
        return cls(rms, float(np.percentile(size, 95)), float(size[worst_index]), float(station[worst_index]))

    def to_dict(self, largest: str = "worst", digits: int = 2) -> dict[str, float]:
        """Return the statistics rounded as JSON data, m.

        Args:
            largest: name of the maximum's field.
            digits: decimals of its station.
        """
        sizes = {"rms": self.rms, "p95": self.p95, largest: self.worst}
        rounded = {name: round(value, 4) for name, value in sizes.items()}
        return rounded | {f"{largest}_station": round(self.worst_station, digits)}


@dataclass(frozen=True)
class AxisFit:
    """The alignment and profile fitted to the points of an axis, with the points' distances from both.

    Attributes:
        alignment: alignment from the foot of the first point to that of the last.
        profile: elevation over the alignment's stations.
        horizontal: statistics of the points' horizontal distances from the alignment, also beyond its ends.
        height: statistics of their heights above the profile.
        points: number of points used: without consecutive duplicates.
        stations, across, above: (N,) of the points: station, offset to the left of the alignment (beyond its ends the
            distance from these as well), height above the profile, m.
        tolerance: root mean square distance that the fit aimed at, m.
    """

    alignment: Alignment
    profile: Profile
    horizontal: Deviations
    height: Deviations
    points: int
    stations: Float
    across: Float
    above: Float
    tolerance: float

    @property
    def limit(self) -> float:
        """Return the largest distance that a point may have from the fit, across or in height, m."""
        return REFUSED_BEYOND * self.tolerance

    def check(self, name: str) -> None:
        """Raise AxisRefusedError if the fit leaves a point farther away than `limit`.

        Args:
            name: name of the file that the points are from.

        Raises:
            AxisRefusedError: a point is farther away.
        """
        if max(self.horizontal.worst, self.height.worst) > self.limit:
            raise AxisRefusedError(name, self)


class AxisRefusedError(InputError):
    """Raised where the road fitted to an axis leaves a point farther away than is allowed.

    Attributes:
        name: name of the file that the points are from.
        fit: the refused fit, for a picture (`fitting.plot`).
    """

    def __init__(self, name: str, fit: AxisFit, picture: Path | str | None = None) -> None:
        self.name, self.fit = name, fit
        horizontal, vertical = fit.horizontal, fit.height
        text = f"no road follows its points within {fit.limit:g} m, which is {REFUSED_BEYOND:g} times the tolerance of "
        text += f"{100.0 * fit.tolerance:g} cm: the nearest is {horizontal.worst:.2f} m off at station "
        text += f"{horizontal.worst_station:.1f} m, in height {vertical.worst:.2f} m at station "
        text += f"{vertical.worst_station:.1f} m. Look there for corners, jumps or points out of their order"
        super().__init__(f"axis {name}", None, f"{text}; {picture} shows it" if picture else text)

    def with_picture(self, picture: Path | str) -> Self:
        """Return a copy of the error that names a picture's file, or something else that shows the fit."""
        return type(self)(self.name, self.fit, picture)


def axis_of_points(
    name: str,
    points: Float,
    declared: MapSystem | None,
    scenario: RoadScenario,
    show_fit: Callable[[AxisFit], None] | None = None,
) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Return the alignment fitted to points (N, 3) of the scenario's system, m, the scenario for it, and a report.

    Args:
        name: name of the points' file.
        points: (N, 3) in their order along the road, m.
        declared: map system that the file names; its height system is taken where the scenario's names none.
        scenario: scenario whose map system and limits apply.
        show_fit: function that is called with the fit, to draw it; None if nothing is drawn.

    Returns:
        the alignment in local coordinates, the scenario with the length and map origin that follow from it, and with
        the vertical coordinate system that the file names if it names none itself, and how well it fits (m): root mean
        square, 95th percentile and worst distance, horizontally and in height.

    Raises:
        AxisRefusedError: no road follows the points (`AxisFit.check`).
    """
    system = MapSystem.of(scenario.epsg, scenario.height_epsg)
    heights = scenario.height_epsg
    if declared is not None and system.height_unit is None:
        heights = declared.height_epsg if declared.unit is None else declared.metric().height_epsg
    origin = np.round(points.mean(axis=0))
    fit = fit_axis(points - origin, follow=True)
    fit.check(name)
    _tell_misfit(name, fit)
    if show_fit:
        show_fit(fit)
    alignment = alignment_object(fit)
    road = scenario.model_copy(
        update={"length": alignment.length, "map_origin": tuple(origin.tolist()), "height_epsg": heights}
    )
    report = {
        "file": name,
        "points": fit.points,
        "elements": len(alignment.horizontal),
        "horizontal": fit.horizontal.to_dict(),
        "height": fit.height.to_dict(),
    }
    return alignment, road, report


def _tell_misfit(name: str, fit: AxisFit) -> None:
    """Warn where the road fitted to an axis is farther off its points than the fit aimed at (root mean square)."""
    rows = (("across", fit.horizontal, fit.tolerance), ("in height", fit.height, _HEIGHT_SHARE * fit.tolerance))
    for direction, deviations, aim in rows:
        if deviations.rms > aim:
            text = "%s: the fitted road is off its points by %.1f cm %s (rms), which is to be %g cm at most: worst"
            sizes = (100.0 * deviations.rms, direction, 100.0 * aim, 100.0 * deviations.worst, deviations.worst_station)
            warn(f"{text} %.1f cm at station %.0f m", name, *sizes)


def alignment_object(fit: AxisFit) -> AlignmentObject:
    """Return a fitted axis as the alignment of a parameter set, with the instance number 1.

    Raises:
        InputError: the fitted alignment is no road's: its bends, lengths or elevations are beyond all limits.
    """
    start, heading, _ = fit.alignment.frame(0.0)
    elements = [(round_value(e.length), e.curvature_start, e.curvature_end) for e in fit.alignment.elements]
    try:
        return AlignmentObject(
            instance=1,
            start_x=round_value(float(start[0])),
            start_y=round_value(float(start[1])),
            start_heading_deg=round_value(float(np.rad2deg(np.angle(np.exp(1j * heading)))), 12),
            horizontal=tuple(HorizontalElement.between(*element) for element in elements),
            vertical=_vertical_points(fit.profile),
        )
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        field, message = fault["loc"][0] if fault["loc"] else "axis", str(fault["msg"]).lower()
        raise InputError(f"axis: {field}", fault.get("input"), f"no road runs through its points ({message})") from None


def fit_heights(station: Float, heights: Float, length: float, tolerance: float) -> tuple[VerticalPoint, ...]:
    """Return the points of vertical intersection of a profile fitted to heights.

    Args:
        station, heights: (N,), m.
        length: length of the road, m.
        tolerance: root mean square of the heights that the fit aims at, m.

    Example:
        >>> import numpy as np
        >>> station = np.linspace(0.0, 600.0, 121)
        >>> heights = np.where(station < 300.0, 100.0 - 0.02 * station, 94.0 + 0.03 * (station - 300.0))
        >>> points = fit_heights(station, heights, length=600.0, tolerance=0.05)
        >>> [round(point.station) for point in points]
        [0, 300, 600]
    """
    profile = _fit_heights(station, heights, np.ones(len(station)), length, tolerance)
    return _vertical_points(profile)


def _vertical_points(profile: Profile) -> tuple[VerticalPoint, ...]:
    """Return a profile's points of vertical intersection as objects of a parameter set."""
    rows = [(round_value(p.station), round_value(p.elevation), p.radius) for p in profile.points]
    return tuple(VerticalPoint(station=s, elevation=z, radius=_written_radius(radius)) for s, z, radius in rows)


def _written_radius(radius: float) -> float:
    """Return the radius (m) to write for a rounding: a little smaller, so that none overlap; 0 if it is too flat."""
    return radius * (1.0 - _PLAY) if radius < _FLATTEST else 0.0


@linear_algebra_on_one_thread()
def fit_axis(points: ArrayLike, tolerance: float = 0.05, design_ends: bool = False, follow: bool = False) -> AxisFit:
    """Return the alignment and profile fitted to the points of an axis, with the points' deviations.

    Args:
        points: (N, 3) map position and elevation, m, in the axis' order; (N, 2) is taken as elevation 0.
        tolerance: m; the fit aims at an rms of the lateral distances up to it and 95 % within twice it (heights: 0.6
            of both) with as few elements as that takes. What is reached is reported: axes that no alignment of
            elements of a few metres follows (corners, jumps) are refused by `AxisFit.check` only.
        design_ends: let the alignment begin and end on a line or an arc, as roads are designed, wherever the points
            allow one as well as the clothoid that they end in. Too short a one is seen in no points.
        follow: keep to points without noise (a design's) as near as their elements allow, with as many as that takes
            (`fitting.follow`), instead of aiming at the tolerance's rms; points with noise are fitted as without it.

    Raises:
        InputError: wrong shape, a value that isn't finite, fewer than two distinct points, a tolerance not above 0.

    Example:
        >>> import numpy as np
        >>> angle = np.linspace(0.0, 0.5, 60)
        >>> points = np.column_stack([500.0 * np.sin(angle), 500.0 * (1.0 - np.cos(angle))])
        >>> (arc,) = fit_axis(points, tolerance=0.02).alignment.elements
        >>> arc.kind, round(1.0 / arc.mean_curvature)
        ('arc', 500)
    """
    axis_points = _check_points(points)
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise InputError("tolerance", tolerance, "a finite length above 0 m is needed")
    origin = np.append(np.round(axis_points[:, :2].mean(axis=0)), 0.0)
    local, weights = _bridge_gaps(axis_points - origin)
    is_point = weights == 1.0
    design = _follow_plan(local, is_point, tolerance) if follow else None
    alignment, approximate_stations = design or _fit_plan(local[:, :2], weights, _MARGIN * tolerance, design_ends)
    reach = max(NEAR, 5.0 * float(np.median(np.diff(approximate_stations))))
    station, offset = alignment.project_near(local[:, :2], approximate_stations, reach)
    # Each point's station and distance on the fitted alignment.
    axis_distance = np.hypot(*(local[:, :2] - alignment.position(station)).T)
    # The road ends at its last point's foot: points before its begin or behind its end, out of their order, are off it.
    axis_distance = np.hypot(axis_distance, np.maximum(np.maximum(-station, station - alignment.length), 0.0))
    # Where points go back their feet may all be the begin: heights are then fitted along the points, to be refused.
    run = station if station.max() > 0.0 else np.append(0.0, np.cumsum(np.hypot(*np.diff(local[:, :2], axis=0).T)))
    order = np.argsort(run, kind="stable")
    height_data = run[order], local[order, 2], weights[order], alignment.length, _HEIGHT_SHARE * tolerance
    profile = _follow_heights(*height_data) if follow else _fit_heights(*height_data)
    heading = alignment.start_heading
    map_alignment = Alignment(alignment.elements, alignment.x + origin[0], alignment.y + origin[1], heading)
    station, height_error = station[is_point], local[is_point, 2] - profile.elevation(station[is_point])
    horizontal, vertical = Deviations.of(station, axis_distance[is_point]), Deviations.of(station, height_error)
    signed_offset = np.copysign(axis_distance, offset)[is_point]
    return AxisFit(
        map_alignment, profile, horizontal, vertical, len(axis_points), station, signed_offset, height_error, tolerance
    )


def _follow_plan(local: Float, is_point: NDArray[Any], tolerance: float) -> tuple[Alignment, Float] | None:
    """Return the alignment through points of a design and their approximate stations (M,); None for points with noise.

    Args:
        local: (M, 3) points, and points of small weight on the chords between, m.
        is_point: (M,) mask of the points themselves.
        tolerance: m.
    """
    points = local[is_point, :2]
    try:
        design = follow_points(points, tolerance)
    except (InputError, np.linalg.LinAlgError):  # lines that turn on the spot
        return None
    if design is None:
        return None
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(local[:, :2], axis=0).T))])
    if design.rank(points, tolerance)[0]:
        plain_alignment, approximate_stations = _fit_plan(points, np.ones(len(points)), _MARGIN * tolerance, False)
        # Fewer elements are likelier than many where sparse points tell neither.
        if np.abs(plain_alignment.project_near(points, approximate_stations, NEAR)[1]).max() <= 0.5 * tolerance:
            return plain_alignment, np.interp(run, run[is_point], approximate_stations)
    return design.alignment, np.interp(run, run[is_point], design.stations)


def _follow_heights(station: Float, heights: Float, weights: Float, length: float, tolerance: float) -> Profile:
    """Return the profile that heights of a design lie on, or that of `_fit_heights` if it is nearer to the heights."""
    is_point = weights == 1.0
    point_stations, point_heights = station[is_point], heights[is_point]

    def largest_error(profile: Profile) -> float:
        """Return a profile's largest distance from the heights, m."""
        return float(np.abs(profile.elevation(point_stations) - point_heights).max())

    design: Profile | None = None
    if (np.diff(point_stations) > 0.0).all():
        try:
            design = follow_heights(point_stations, point_heights, length, tolerance)
        except (InputError, np.linalg.LinAlgError):  # grades that no road has
            design = None
    if design is not None and largest_error(design) <= tolerance:
        return design
    plain_profile = _fit_heights(station, heights, weights, length, tolerance)
    return plain_profile if design is None or largest_error(plain_profile) <= largest_error(design) else design


def _check_points(points: ArrayLike) -> Float:
    """Return the points as (N, 3), N >= 2, without consecutive duplicates in plan; InputError for values not finite."""
    array = finite_array("points", points)
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise InputError("points", array.shape, "an array of shape (N, 3) or (N, 2) is needed")
    if array.shape[1] == 2:
        array = np.column_stack((array, np.zeros(len(array))))
    if len(array):
        step = np.hypot(*np.diff(array[:, :2], axis=0).T)
        array = array[np.concatenate(([True], step > 1e-6))]
    if len(array) < 2:
        raise InputError("points", len(array), "at least two distinct points are needed")
    return array


def _bridge_gaps(points: Float) -> tuple[Float, Float]:
    """Return points (M, 3) with points of small weight added on the chords of long gaps, and all weights (M,).

    A polyline with dense points on its curves only would leave the fit without a hold on the straights between. The
    added points weigh next to nothing, so a curve across a gap is still bridged as a curve.
    """
    step = np.hypot(*np.diff(points[:, :2], axis=0).T)
    median_step = float(np.median(step))
    added_count = np.where(
        step > max(_GAP, 5.0 * median_step), np.ceil(step / max(Plan.spacings.first, 2.0 * median_step)) - 1.0, 0.0
    )
    owner = np.repeat(np.arange(len(step)), added_count.astype(np.int64) + 1)
    nth = np.arange(len(owner)) - np.searchsorted(owner, owner)
    share = (nth / (added_count[owner] + 1.0))[:, None]
    dense_points = points[owner] + share * (points[owner + 1] - points[owner])
    return np.vstack((dense_points, points[-1:])), np.append(np.where(nth == 0, 1.0, _CHORD_WEIGHT), 1.0)


def _fit_plan(points: Float, weights: Float, tolerance: float, design_ends: bool) -> tuple[Alignment, Float]:
    """Return the alignment from the first point's foot to the last one's, and the points' approximate stations (N,)."""
    run = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    chain, station = _fit_windows(Plan(points, weights), run, tolerance, design_ends)
    return _trim_ends(chain, float(station[0]), float(station[-1])), station - station[0]


def _fit_heights(station: Float, heights: Float, weights: Float, length: float, tolerance: float) -> Profile:
    """Return the profile fitted to weighted heights (N,), m, at stations (N,), m, clipped to the road's length."""
    order = np.argsort(station, kind="stable")
    station = np.clip(station[order], 0.0, length)
    return _profile(_fit_windows(Heights(heights[order], weights[order], station), station, tolerance)[0])


def _fit_windows(data: AxisData, run: Float, tolerance: float, design_ends: bool = False) -> tuple[Chain, Float]:
    """Fit data window after window; return the whole chain and the approximate stations (N,) of all points on it, m.

    Args:
        data: points of the axis, or heights.
        run: (N,) approximate stations of the data, m.
        tolerance: m.
        design_ends: see `fit_axis`.
    """
    step = float(np.median(np.diff(run)))
    # Chosen: at least 60 points in a window, and 15 that the next window fits again.
    window, tail = max(_WINDOW, 60.0 * step), max(_TAIL, 15.0 * step)
    pieces: list[Chain] = []
    start: Start | None = None
    first_point, origin, is_refused = 0, 0.0, False
    station = np.empty(len(run))
    while True:
        # The window's points, thinned where they are too many.
        is_last_window = run[-1] - run[first_point] <= window + tail
        end = len(run) if is_last_window else int(np.searchsorted(run, run[first_point] + window))
        end = max(end, min(first_point + 8, len(run)))
        stride = -(-(end - first_point) // _MOST_POINTS)
        indices = np.unique(np.append(np.arange(first_point, end, stride), end - 1))
        length = float(run[end - 1] - run[first_point])
        if is_refused:  # an axis that is refused needs no search for few elements
            fit = data.fit_window(indices, max(data.spacings.first, _KNOTS * length / len(indices)), start, origin)
        else:
            fit = _fit_window(data, indices, start, origin, length, tolerance)
            is_refused = _is_lost(fit, tolerance)
        if design_ends:
            ends = (["first"] if start is None else []) + (["last"] if end == len(run) else [])
            fit = _end_on_design(fit, ends, tolerance)
        station[first_point:end] = origin + np.interp(np.arange(first_point, end), indices, fit.stations)
        if end == len(run):
            return _join_pieces([*pieces, fit.chain]), station
        # The last part of the window is fitted again in the next one, with points to both sides.
        end_station = _window_end(fit.chain, tail)
        start = data.state_at(fit.chain, end_station)
        pieces.append(_cut_chain(fit.chain, end_station))
        first_point, origin = int(indices[np.argmax(fit.stations >= end_station)]), origin + end_station


def _fit_window(
    data: AxisData, indices: Int, start: Start | None, origin: float, length: float, tolerance: float
) -> ChainFit:
    """Return the fit of one window: of exact data by few elements, of others by knots as dense as the tolerance needs.

    Args:
        data: points of the axis, or heights.
        indices: of the window's points.
        start: pose and value at the end of the previous window; None for the first one.
        origin: station at which the window begins, m.
        length: length of the window, m.
        tolerance: root mean square of the residuals that the fit aims at, m.
    """
    scale = _KNOTS * length / len(indices)
    count = independent_count(length, len(indices))
    # Chosen: at most one element per 15 m for exact points, per 30 m for measured ones, five more or at least five.
    exact_goal = Goal(tolerance, 2.0 * tolerance, _EXACT, count, int(length / 15.0) + 5)
    dense_fit = data.fit_window(indices, max(data.spacings.exact, scale), start, origin)
    if dense_fit.rms < 3.0 * _ROUNDED:
        best_fit = min(descent(dense_fit, exact_goal), key=exact_goal.rank)
        if _is_exact(best_fit) and exact_goal.rank(best_fit)[:2] == (False, False):
            return best_fit
    goal = Goal(tolerance, 2.0 * tolerance, _NEGLIGIBLE * tolerance, count, int(max(5.0, length / 30.0 - 0.01)))
    spacing = max(data.spacings.first, scale)
    dense_fit = data.fit_window(indices, spacing, start, origin)
    while not goal.is_met(dense_fit) and 0.5 * spacing >= max(data.spacings.finest, scale):
        spacing *= 0.5
        finer_fit = data.fit_window(indices, spacing, start, origin)
        if finer_fit.noise > _FINER_HELPS * dense_fit.noise:
            break
        dense_fit = finer_fit
    if _is_lost(dense_fit, tolerance):
        return dense_fit  # fewer elements are no nearer
    noise_factor = _SCATTER if goal.is_met(dense_fit) else _RELAXED
    goal = replace(
        goal, rms=max(goal.rms, noise_factor * dense_fit.noise), p95=max(goal.p95, noise_factor * dense_fit.p95)
    )
    return improve_fit(min(descent(dense_fit, goal), key=goal.rank), goal)


def _is_lost(fit: ChainFit, tolerance: float) -> bool:
    """Return whether a fit leaves a point so far off that the axis is refused however many elements it has."""
    return bool(np.abs(fit.residuals).max() > _NO_ROAD * REFUSED_BEYOND * tolerance)


def _end_on_design(fit: ChainFit, ends: Iterable[str], tolerance: float) -> ChainFit:
    """Return a fit whose first or last element (as ``ends`` says) is a line or an arc, as far as its data allow it.

    An arc in place of a clothoid's last metres bends the axis by millimetres: the data can't tell it from noise, and
    by their number of parameters alone every road would begin and end in a clothoid.
    """
    floor = _NEGLIGIBLE * tolerance
    for end in ends:
        if fit.chain.kinds[0 if end == "first" else -1] != FREE or _is_exact(fit):
            continue
        count = independent_count(float(fit.chain.knots[-1]), len(fit.residuals))
        largest_square = (fit.sum_of_squares / len(fit.residuals) + floor**2) * np.exp(_SPARED / count)
        trials = [refine(fit.data, chain, fit.stations, True, 20) for chain in _end_chains(fit.chain, end)]
        allowed_fits = [
            end_fit
            for end_fit in trials
            if end_fit.sum_of_squares / len(end_fit.residuals) + floor**2 <= largest_square
        ]
        fit = min(allowed_fits, key=lambda trial: (trial.chain.freedom(), trial.sum_of_squares), default=fit)
    return fit


def _end_chains(chain: Chain, end: str) -> Iterator[Chain]:
    """Yield the chain with the outer part of its first or last element made a line, and an arc."""
    length = chain.knots[1] if end == "first" else chain.knots[-1] - chain.knots[-2]
    part = min(_END_ELEMENT, 0.25 * length)
    knot = part if end == "first" else chain.knots[-1] - part
    knot_index = int(np.searchsorted(chain.knots, knot))
    knots = np.insert(chain.knots, knot_index, knot)
    values = np.insert(chain.values, knot_index, np.interp(knot, chain.knots, chain.values))
    for kind in (ZERO, EQUAL):
        kinds = np.insert(chain.kinds, 0 if end == "first" else chain.size, kind)
        yield replace(chain, knots=knots, values=values, kinds=kinds).tie_values()


def _is_exact(fit: ChainFit) -> bool:
    """Return whether the residuals are no more than the rounding of coordinates leaves."""
    residuals = fit.residuals
    return fit.rms < _EXACT or (
        fit.rms < _ROUNDED and float(residuals[1:] @ residuals[:-1]) < _RANDOM * fit.sum_of_squares
    )


def _window_end(chain: Chain, tail: float) -> float:
    """Return the station (m) at which to cut a window's chain: its last knot before the tail, or in a long element."""
    latest = max(chain.knots[-1] - tail, 0.5 * chain.knots[-1])  # points that turn back make a short chain
    candidate_knots = chain.knots[(chain.knots <= latest) & (chain.knots >= 0.4 * latest)]
    return float(candidate_knots[-1]) if len(candidate_knots) else float(latest)


def _cut_chain(chain: Chain, end_station: float) -> Chain:
    """Return the part of a chain up to a station (m)."""
    count = int(np.searchsorted(chain.knots, end_station - 1e-9))  # elements that begin before the cut
    knots = np.append(chain.knots[:count], end_station)
    values = np.append(chain.values[:count], np.interp(end_station, chain.knots, chain.values))
    return replace(chain, knots=knots, values=values, kinds=chain.kinds[:count])


def _join_pieces(pieces: list[Chain]) -> Chain:
    """Return the windows' pieces joined as one chain; lines, arcs and constant grades cut in two become one again."""
    knots, values = [0.0], [float(pieces[0].values[0])]
    kinds: list[int] = []
    offset = 0.0
    for piece in pieces:
        for e, kind in enumerate(piece.kinds):
            continues = bool(kinds) and e == 0 and kind != FREE and kinds[-1] != FREE and piece.values[0] == values[-1]
            if continues:
                knots[-1] = offset + piece.knots[1]
                continue
            kinds.append(int(kind))
            knots.append(offset + piece.knots[e + 1])
            values.append(float(piece.values[e + 1]))
        offset += piece.knots[-1]
    return Chain(pieces[0].pose, np.array(knots), np.array(values), np.array(kinds))


def _trim_ends(chain: Chain, first_station: float, last_station: float) -> Alignment:
    """Return the alignment from the first point's foot to the last one's, the outer elements cut or prolonged."""
    knots, values = chain.knots.copy(), chain.values.copy()
    heading, (x, y) = float(chain.pose[2]), chain.pose[:2]
    slope = chain.slopes
    if first_station < knots[1]:
        value = values[0] + slope[0] * first_station
        turn = 0.5 * first_station * (values[0] + value)
        # A prolongation of centimetres: the chord's direction is its mean heading.
        x, y = x + first_station * np.cos(heading + 0.5 * turn), y + first_station * np.sin(heading + 0.5 * turn)
        heading, knots[0], values[0] = heading + turn, first_station, value
    if last_station > knots[-2]:
        values[-1] += slope[-1] * (last_station - knots[-1])
        knots[-1] = last_station
    return replace(chain, pose=np.array([x, y, heading]), knots=knots, values=values).alignment


def _profile(chain: Chain) -> Profile:
    """Return the profile whose grade is the chain; each parabola's intersection lies at its middle."""
    middle = 0.5 * (chain.knots[1:] + chain.knots[:-1])
    gap, change = np.diff(chain.knots), np.diff(chain.values)
    knot_elevations = elevations(chain, chain.knots)
    points = [IntersectionPoint(0.0, float(knot_elevations[0]))]
    for e in range(chain.size):
        if abs(change[e]) * gap[e] > 1e-7:  # less is no kink that anything could show
            elevation = knot_elevations[e] + 0.5 * gap[e] * chain.values[e]
            points.append(IntersectionPoint(float(middle[e]), float(elevation), float(gap[e] / abs(change[e]))))
    points.append(IntersectionPoint(float(chain.knots[-1]), float(knot_elevations[-1])))
    return Profile(points)
