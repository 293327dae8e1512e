"""The standard cross-section of one carriageway that measured widths and lines are nearest to, and its design class."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...road.guidelines import (
    GUIDELINE_OF_CLASS,
    LIMITS,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    CentreLine,
    EdgeLine,
    StandardCrossSection,
    is_single,
)

COUNTRY = "DE"
"""Country whose guidelines measured roads are compared with: widths and lines alone don't tell a country."""
_CLASSES = tuple(name for name in LIMITS if is_single(name) and GUIDELINE_OF_CLASS[name].country == COUNTRY)
SINGLE_CROSS_SECTIONS = {
    section: STANDARD_CROSS_SECTIONS[section] for name in _CLASSES for section in SECTIONS_OF_CLASS[name]
}
"""Name -> standard cross-section of one carriageway."""
_OTHER_LINES = 0.1
"""Difference, m, that lines of another kind than a section's count as. Chosen: less than a step of lanes' widths, more
than those are measured to; sections of one width differ by their lines alone."""
_USUALLY, _MOSTLY, _FEWEST_FALLS = 0.5, 1.0, 0.8
"""Difference of two crossfalls, %, that are one plane, and sum of two that make a roof, in half of the stretches and in
a share of them. Chosen: 2 cm at the edge of a lane, which a survey tells; a run-off between both is neither."""
_TIGHTER = 1.02
"""Curvature, in that of a class's least radius, which is allowed for the fit's error."""


@dataclass(frozen=True)
class Direction:
    """One direction of a single carriageway as measured, m.

    Attributes:
        lanes: widths from the axis outwards.
        inner_strip: width of the strip between the axis and the innermost lane.
        outer_strip: width of the pavement outside of the lanes; None where its edge isn't seen.
        edge_line: how its edge line is.
    """

    lanes: tuple[float, ...]
    inner_strip: float
    outer_strip: float | None
    edge_line: EdgeLine


def nearest_single(directions: Sequence[Direction], centre_line: CentreLine) -> tuple[str, float]:
    """Return the name of the standard cross-section of one carriageway nearest to two directions, and how far it is, m.

    The distance is that of widths alone; of sections as near, the one with the same lines comes first.

    Args:
        directions: both directions; which of them runs with the stations doesn't matter.
        centre_line: lines between them.
    """
    result: dict[str, tuple[float, float]] = {}
    for name, section in SINGLE_CROSS_SECTIONS.items():
        orders = (directions, directions[::-1])
        width = min(
            max(_misfit(one, section, lanes) for one, lanes in zip(order, _lanes(section), strict=True))
            for order in orders
        )
        edge_lines = sum(one.edge_line != section.edge_line for one in directions) / len(directions)
        lines = _OTHER_LINES * ((centre_line != section.centre_line) + edge_lines)
        result[name] = (width + lines, width)
    name = min(result, key=lambda key: result[key][0])
    return name, result[name][1]


def _lanes(section: StandardCrossSection) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the widths, m, of a section's lanes from the axis outwards, of both directions."""
    return section.lanes[::-1], section.of_side("left").lanes[::-1]


def _misfit(direction: Direction, section: StandardCrossSection, lanes: tuple[float, ...]) -> float:
    """Return the largest difference, m, of a direction's widths from a section's; differences of lanes count twice.

    Of a section with other numbers of lanes it is the whole width's, and a lane more.
    """
    outer_strip = section.outer_edge_strip + section.hard_shoulder
    if len(direction.lanes) != len(lanes):
        return abs(math.fsum(direction.lanes) - math.fsum(lanes)) + min(lanes)
    differences = [2.0 * abs(width - lane) for width, lane in zip(direction.lanes, lanes, strict=True)]
    differences.append(abs(direction.inner_strip - section.inner_edge_strip))
    if direction.outer_strip is not None:
        differences.append(abs(direction.outer_strip - outer_strip))
    return max(differences)


def unlined_section(widths: Sequence[float], tolerance: float) -> StandardCrossSection | None:
    """Return the standard section without any lines whose directions are as wide as both measured ones; None if none.

    Args:
        widths: from the axis to the pavement's edge, m.
        tolerance: difference of a width from it at most, m.
    """
    rows = [row for row in SINGLE_CROSS_SECTIONS.values() if row.centre_line == row.edge_line == "none"]
    distances = [max(abs(width - row.paved_width) for width in widths) for row in rows]
    return rows[int(np.argmin(distances))] if rows and min(distances) <= tolerance else None


def single_class(section: str, curvature: float) -> str:
    """Return the design class of one carriageway that has a cross-section; the first whose radii a curvature keeps.

    Args:
        section: name of a standard cross-section.
        curvature: the road's largest, 1/m.
    """
    classes = [name for name in _CLASSES if section in SECTIONS_OF_CLASS[name]]
    return next((name for name in classes if curvature * LIMITS[name].radius <= _TIGHTER), classes[-1])


def joined_falls(falls: Mapping[int, Float]) -> tuple[str, dict[int, Float]]:
    """Return the form of a single carriageway's surface, and its crossfalls (K,), m/m, by side, made those of the form.

    A plane has one crossfall for both sides, a roof falls as much to either side; of anything else ("") each side
    keeps its own.

    Args:
        falls: crossfalls (K,), m/m, positive to the right, of the right (-1) and the left (1) side.
    """
    right, left = falls[-1], falls[1]
    both_seen = np.isfinite(right) & np.isfinite(left)
    if not both_seen.any():
        return "", dict(falls)
    if _is_small(100.0 * np.abs(right - left)[both_seen]):
        plane = np.where(both_seen, 0.5 * (right + left), np.where(np.isfinite(right), right, left))
        return "plane", {-1: plane, 1: plane}
    if _is_small(100.0 * np.abs(right + left)[both_seen]):
        roof = np.where(both_seen, 0.5 * (right - left), np.where(np.isfinite(right), right, -left))
        return "roof", {-1: roof, 1: -roof}
    return "", dict(falls)


def _is_small(percent: Float) -> bool:
    """Return whether differences (N,), %, are small enough for one form of the surface."""
    return float(np.median(percent)) <= _USUALLY and float((percent <= _MOSTLY).mean()) >= _FEWEST_FALLS
