"""Rules that a road breaks, by the row of its tables that breaks them."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from ..road.objects import width_kinks
from ..road.parameters import RoadParameters
from ..road.section import Carriageway
from .checker import check
from .rules import alignment, crossfall, section
from .rules.rule import SAME_STATION, Violation

PROFILE_RULES = frozenset({"vertical-order", "grade-maximum", "crest-radius", "sag-radius", "rounding-overlap"})
"""Rules of the centreline that are about vertical points."""
_RULES = {rule.id: rule for rule in (*alignment.RULES, *crossfall.RULES, *section.RULES)}
_CROSSFALL_RULES = frozenset(rule.id for rule in crossfall.RULES)
_STRIPS = {"hard-shoulder-width": "Hard Shoulder", "verge-width": "Verge", "median-width": "Inner Offset"}
"""Rules about one strip, and the strip."""


@dataclass(frozen=True)
class RowMarks:
    """Broken rules of a road by row, from 0.

    Attributes:
        elements: of the alignment, by the element's number.
        vertical: by the vertical point's number.
        crossfall: by the carriageway's id and the crossfall point's number.
        widths: by the carriageway's id, the strip's name and the row's number.
    """

    elements: dict[int, list[Violation]] = field(default_factory=dict)
    vertical: dict[int, list[Violation]] = field(default_factory=dict)
    crossfall: dict[tuple[str, int], list[Violation]] = field(default_factory=dict)
    widths: dict[tuple[str, str, int], list[Violation]] = field(default_factory=dict)


def row_marks(parameters: RoadParameters) -> RowMarks:
    """Return the rules of alignment, profile, crossfall and widths that a road breaks, each at its row.

    What a rule says of a border of two elements is at the second one's row, but a clothoid whose sharp end has no arc
    is marked itself. A grade is at the vertical point where it begins.
    """
    marks = RowMarks()
    axis = parameters.alignment
    starts = np.cumsum([0.0, *(element.length for element in axis.horizontal)])
    for violation in check(parameters, _RULES):
        item = parameters.objects.get(violation.object)
        if violation.rule in PROFILE_RULES:
            stations = [point.station for point in axis.vertical]
            is_grade = violation.rule == "grade-maximum"
            row = _row_at(stations, violation.station) if is_grade else _nearest(stations, violation.station)
            marks.vertical.setdefault(row, []).append(violation)
        elif item is axis:
            row = _row_at(list(starts[:-1]), violation.station)
            if violation.rule == "radius-minimum" and row and axis.horizontal[row].kind != "arc":
                end = abs(axis.horizontal[row - 1].curvature_end)
                row -= end > abs(axis.horizontal[row].curvature_start)
            marks.elements.setdefault(row, []).append(violation)
        elif violation.rule in _CROSSFALL_RULES and isinstance(item, Carriageway):
            row = _row_at([point.station for point in item.crossfall], violation.station)
            marks.crossfall.setdefault((violation.object, row), []).append(violation)
        else:
            _mark_width(marks, parameters, violation)
    return marks


def _mark_width(marks: RowMarks, parameters: RoadParameters, violation: Violation) -> None:
    """Add a broken rule of a strip's width to its row; of the median's to both carriageways' inner offsets."""
    carriageways = parameters.of_type(Carriageway)
    owners = [violation.object] if violation.object in carriageways else list(carriageways)
    strip = _STRIPS.get(violation.rule, "")
    if lane := re.match(r"Lane \d+", violation.text):
        strip = lane[0]
    elif violation.rule == "edge-strip-width":
        strip = "Inner Edge Strip" if "inner" in violation.text else "Outer Edge Strip"
    if not strip:
        return
    for owner in owners:
        width = _width(carriageways[owner], strip)
        row = _row_at(width_kinks(width), violation.station) if isinstance(width, tuple) else 0
        marks.widths.setdefault((owner, strip, row), []).append(violation)


def _width(carriageway: Carriageway, strip: str) -> object:
    """Return the width of a strip by the name that the table has for it."""
    if strip.startswith("Lane "):
        return carriageway.lanes[int(strip.removeprefix("Lane ")) - 1].width
    name = strip.lower().replace(" ", "_")
    return carriageway.inner_offset if name == "inner_offset" else getattr(carriageway, f"{name}_width")


def _row_at(stations: list[float], station: float) -> int:
    """Return the number of the last row that doesn't begin behind a station, m; the first one's before all."""
    return max(0, bisect_right(stations, station + SAME_STATION) - 1)


def _nearest(stations: list[float], station: float) -> int:
    """Return the number of the row nearest to a station, m."""
    return min(range(len(stations)), key=lambda row: abs(stations[row] - station))
