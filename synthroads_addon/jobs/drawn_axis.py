"""Roads along a line that somebody drew: points fitted, or a tangent polygon rounded; how far off, which rules broken.

Both become an `AlignmentObject` in the line's own coordinates. Heights are those of the line, unless they are to be
drawn from the seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Float
from ..base.random_streams import stream
from ..base.schema import round_value
from ..checking.checker import RULES, Violation, check, check_axis
from ..fitting.fit import alignment_object, fit_axis
from ..fitting.tangents import CurveRule, TangentAxis, tangent_axis
from ..road.alignment import Alignment
from ..road.geometry import alignment_of, profile_of
from ..road.guidelines import LIMITS
from ..road.other_roads.axis import HorizontalElement, VerticalPoint
from ..road.parameters import AlignmentObject, RoadParameters
from ..sampling.alignment import sample_profile
from ..sampling.road import sample_road
from ..sampling.section import cross_section_of
from ..scenario.road import RoadScenario
from ..scenario.scenario import Scenario

LEVEL = 1e-3
"""Heights (m) that differ by no more are level: a curve drawn on the ground has no heights of its own."""
_MOST_NAMED = 3
"""Rules that a message names; the list of rules has all of them."""


@dataclass(frozen=True)
class DrawnAxis:
    """An axis along a drawn line.

    Attributes:
        axis: the alignment, in the line's coordinates.
        deviation: largest horizontal distance of the line's points from it, m.
        height_deviation: largest distance of their heights from the profile, m; 0 where the heights are the seed's.
        violations: rules for centrelines that it breaks.
        is_tangents: whether the line was a tangent polygon, whose inner points the axis passes by on purpose.
    """

    axis: AlignmentObject
    deviation: float
    height_deviation: float
    violations: tuple[Violation, ...]
    is_tangents: bool

    @property
    def text(self) -> str:
        """Return a sentence on the deviation, for people."""
        points = "the tangents' points" if self.is_tangents else "the curve"
        heights = f", in height {self.height_deviation:.3f} m" if self.height_deviation >= LEVEL else ""
        count = len(self.axis.horizontal)
        elements = f"{count} element{'s' * (count != 1)}"
        return f"{elements}, at most {self.deviation:.3f} m from {points}{heights}"


def curve_rule(scenario: RoadScenario) -> CurveRule:
    """Return the rule by which curves of a scenario's road are rounded."""
    return CurveRule(scenario.design_class, cross_section_of(scenario).paved_width / 2.0)


def fitted_axis(points: ArrayLike, scenario: RoadScenario, tolerance: float, name: str = "curve") -> DrawnAxis:
    """Return lines, clothoids and arcs fitted to a drawn curve.

    Args:
        points: (N, 3) along the curve, m.
        scenario: limits whose design class the rules are of.
        tolerance: root mean square distance that the fit aims at, m.
        name: of the curve, for messages.

    Raises:
        AxisRefusedError: no road follows the curve, as it has a corner or turns on the spot.
        InputError: a point isn't finite, or there are fewer than two.

    Example:
        >>> angle = np.linspace(0.0, 0.4, 50)
        >>> arc = np.column_stack([1000.0 * np.sin(angle), 1000.0 * (1.0 - np.cos(angle)), np.zeros(50)])
        >>> drawn = fitted_axis(arc, RoadScenario(), tolerance=0.05)
        >>> [element.kind for element in drawn.axis.horizontal], drawn.deviation < 0.01, drawn.violations
        (['arc'], True, ())
    """
    fit = fit_axis(points, tolerance, design_ends=True)
    fit.check(name)
    axis = alignment_object(fit)
    violations = tuple(check_axis(axis, scenario.design_class))
    return DrawnAxis(axis, fit.horizontal.worst, fit.height.worst, violations, False)


def rounded_axis(points: ArrayLike, radii: Sequence[float | None], scenario: RoadScenario) -> DrawnAxis:
    """Return the axis of a drawn tangent polygon: exact lines, clothoids and arcs.

    Args:
        points: (N, 3) of the polygon, m. Their heights are those of the profile's points of intersection.
        radii: of the N - 2 curves, m; None or 0 takes the design class's, as `tangents.tangent_axis`.
        scenario: limits of the road.

    Raises:
        InputError: see `tangents.tangent_axis`.
    """
    polygon = np.asarray(points, dtype=np.float64)
    tangents = tangent_axis(polygon[:, :2], radii, curve_rule(scenario))
    alignment = tangents.alignment
    stations = np.array([0.0, *((corner.start + corner.end) / 2.0 for corner in tangents.corners), alignment.length])
    axis = plain_alignment(alignment, tangent_profile(stations, polygon[:, 2], scenario.design_class))
    height_error = np.abs(profile_of(axis).elevation(stations) - polygon[:, 2]).max()
    violations = tuple(check_axis(axis, scenario.design_class))
    return DrawnAxis(axis, tangents.deviation, float(height_error), violations, True)


def plain_alignment(alignment: Alignment, vertical: tuple[VerticalPoint, ...]) -> AlignmentObject:
    """Return an alignment with the points of a profile as an object of a parameter set, with the number 1."""
    rows = [(round_value(e.length), e.curvature_start, e.curvature_end) for e in alignment.elements]
    heading = float(np.rad2deg(np.angle(np.exp(1j * alignment.start_heading))))
    return AlignmentObject(
        instance=1,
        start_x=round_value(alignment.x),
        start_y=round_value(alignment.y),
        start_heading_deg=round_value(heading, 12),
        horizontal=tuple(HorizontalElement.between(*row) for row in rows),
        vertical=vertical,
    )


def tangent_profile(stations: Float, heights: Float, design_class: str) -> tuple[VerticalPoint, ...]:
    """Return points of vertical intersection at stations (N,), m, of heights (N,), m, rounded as far as there is room.

    Each rounding has the class's smallest radius, or what half of the shorter tangent beside it holds.

    Example:
        >>> points = tangent_profile(np.array([0.0, 500.0, 1000.0]), np.array([0.0, 10.0, 0.0]), "EKA1A")
        >>> [round(point.radius) for point in points]
        [0, 13000, 0]
    """
    if np.ptp(heights) <= LEVEL:
        ends = (0.0, float(stations[-1]))
        return tuple(VerticalPoint(station=round_value(s), elevation=round_value(heights[0])) for s in ends)
    grades = np.diff(heights) / np.diff(stations)
    spans = np.diff(stations)
    radii = [0.0]
    for i, change in enumerate(np.diff(grades).tolist()):
        limits = LIMITS[design_class]
        # T = R |change| / 2, at the road's ends a span has one rounding only
        room_before = spans[i] if i == 0 else 0.5 * spans[i]
        room_after = spans[i + 1] if i + 2 == len(spans) else 0.5 * spans[i + 1]
        largest = 2.0 * min(room_before, room_after) * (1.0 - 1e-9) / max(abs(change), 1e-12)
        radii.append(min(limits.sag if change > 0.0 else limits.crest, largest))
    radii.append(0.0)
    rows = zip(stations.tolist(), heights.tolist(), radii, strict=True)
    return tuple(
        VerticalPoint(station=round_value(s), elevation=round_value(z), radius=round_value(r)) for s, z, r in rows
    )


def with_drawn_heights(drawn: DrawnAxis, scenario: RoadScenario, seed: int) -> DrawnAxis:
    """Return a drawn axis with a profile from the seed, within the limits of a scenario, instead of its own."""
    limits = scenario.model_copy(update={"length": drawn.axis.length})
    vertical = sample_profile(limits, stream(seed, "profile"))
    axis = drawn.axis.model_copy(update={"vertical": vertical})
    violations = tuple(check_axis(axis, scenario.design_class))
    return DrawnAxis(axis, drawn.deviation, 0.0, violations, drawn.is_tangents)


def road_along(
    drawn: DrawnAxis, scenario: Scenario, origin: tuple[float, float, float]
) -> tuple[RoadParameters, list[Violation]]:
    """Return the road of a scenario along a drawn axis, and all rules that it breaks.

    Args:
        drawn: the axis.
        scenario: limits and seed of all else.
        origin: map coordinates of the line's own origin, m.

    Raises:
        InputError: the scenario's limits contradict each other.
    """
    limits = scenario.road.model_copy(update={"length": drawn.axis.length, "map_origin": origin})
    parameters = sample_road(limits, scenario.seed, scenario.title, drawn.axis)
    return parameters, check(parameters)


def rules_text(violations: Sequence[Violation]) -> str:
    """Return which rules are broken, in words: each named once with the place and value of its first finding.

    Example:
        >>> rules_text([])
        'it keeps all rules'
    """
    if not violations:
        return "it keeps all rules"
    by_rule = [(rule, list(group)) for rule, group in groupby(violations, key=lambda violation: violation.rule)]
    named = []
    for rule, group in by_rule[:_MOST_NAMED]:
        first = group[0]
        unit = "" if first.unit == "1" else f" {first.unit}"
        value = f"{first.value:.4g} instead of {first.limit:.4g}{unit} at station {first.station:.0f} m"
        further = f" and {len(group) - 1} more" if len(group) > 1 else ""
        named.append(f"{RULES[rule].title} ({value}{further})")
    rest = f"; and {len(by_rule) - _MOST_NAMED} more rules" if len(by_rule) > _MOST_NAMED else ""
    count = "1 rule" if len(by_rule) == 1 else f"{len(by_rule)} rules"
    return f"it breaks {count}: {'; '.join(named)}{rest}"


def place_text(axis: AlignmentObject, point: Sequence[float]) -> str:
    """Return where a point (x, y, ..., m, in the axis' coordinates) lies, in words: station and offset from the axis.

    Example:
        >>> line = HorizontalElement.between(200.0, 0.0, 0.0)
        >>> place = {"instance": 1, "start_x": 0.0, "start_y": 0.0, "start_heading_deg": 0.0}
        >>> axis = AlignmentObject(horizontal=(line,), vertical=(VerticalPoint(station=0.0, elevation=0.0),), **place)
        >>> place_text(axis, (123.4, -4.2))
        'station 123.40 m, offset -4.20 m'
    """
    station, offset = alignment_of(axis).project(np.array([point[:2]], dtype=np.float64))
    return f"station {station[0]:.2f} m, offset {round_value(offset[0], 2):.2f} m"


def tangents_of(points: ArrayLike, radii: Sequence[float | None], scenario: RoadScenario) -> TangentAxis:
    """Return the rounded tangent polygon (N, 2 or 3) of a scenario's road, as it is shown while it is drawn."""
    return tangent_axis(np.asarray(points, dtype=np.float64)[:, :2], radii, curve_rule(scenario))
