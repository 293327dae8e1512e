"""Service trenches in villages: strips of newer asphalt along a lane, with one to the kerb at some of the drives."""

from __future__ import annotations

import numpy as np

from ...base.random_streams import stream
from ...base.schema import round_value
from ...road.objects import Side
from ...road.section import Carriageway, Corner, Patch
from ...road.section_geometry import CarriagewaySection
from ...scenario.road import RoadScenario
from ..placing.draw import draw_between, pick
from ..placing.village_plan import Village

_WIDTH, _CROSS_WIDTH = (0.6, 1.2), (0.5, 0.8)
"""Widths of a trench along the road, and of one across the lane, m. Chosen."""
_SHORTEST, _LONGEST_SHARE = 15.0, 0.8
"""Shortest trench, m, and the longest as a share of its village. Chosen."""
_FROM_EDGE = 0.35
"""From the pavement's edge, and from the middle of the road, to a trench, m. Chosen."""
_AGES, _HEIGHTS = (0.0, 0.7), (-0.012, 0.003)
"""Age of its asphalt, and its height above the pavement, m: it sinks. Chosen."""
_CONNECTED = 0.6
"""Share of the drives beside a trench to which one leads. Chosen."""


def dig_trenches(
    scenario: RoadScenario, seed: int, villages: tuple[Village, ...], carriageways: dict[Side, Carriageway]
) -> dict[Side, Carriageway]:
    """Return the carriageways with the trenches of their villages as patches; as they are where none is drawn."""
    result = dict(carriageways)
    for number, village in enumerate(villages):
        rng = stream(seed, "trenches", number)
        if rng.random() >= scenario.villages.trenches:
            continue
        side = pick(rng, list(village.streets))
        carriageway = result[side]
        patches = _trench(rng, village, carriageway)
        pavement = carriageway.pavement
        pavement = pavement.model_copy(update={"patches": (*pavement.patches, *patches)})
        result[side] = carriageway.model_copy(update={"pavement": pavement})
    return result


def _trench(rng: np.random.Generator, village: Village, carriageway: Carriageway) -> list[Patch]:
    """Return a trench along one side of a village, and those from it to drives."""
    section, sign = CarriagewaySection(carriageway), float(carriageway.sign)
    inner, outer = section.lane_boundaries([village.start])[0][[-1, 0]]
    edge = float(section.main_edge([village.start])[0])
    length = max(_SHORTEST, (village.end - village.start) * draw_between(rng, (0.3, _LONGEST_SHARE)))
    start = village.start + (village.end - village.start - length) * rng.random()
    width = draw_between(rng, _WIDTH)
    room = float(outer - inner) - width - 2.0 * _FROM_EDGE
    near = float(inner) + _FROM_EDGE + max(room, 0.0) * rng.random()
    age, height = draw_between(rng, _AGES), draw_between(rng, _HEIGHTS)
    spans = [((start, start + length), (near, near + width))]
    for plot in village.plots[carriageway.side]:
        is_led_to, cross_width = rng.random() < _CONNECTED, draw_between(rng, _CROSS_WIDTH)
        if plot.drive is None or not is_led_to or not start < plot.drive < start + length:
            continue
        spans.append(((plot.drive - cross_width / 2.0, plot.drive + cross_width / 2.0), (near + width, edge)))
    return [Patch(outline=_corners(along, across, sign), age=age, height=height) for along, across in spans]


def _corners(along: tuple[float, float], across: tuple[float, float], sign: float) -> tuple[Corner, ...]:
    """Return the corners of a rectangle between two stations and two distances from the centreline, m."""
    places = [(along[0], across[0]), (along[1], across[0]), (along[1], across[1]), (along[0], across[1])]
    return tuple((round_value(station), round_value(sign * distance)) for station, distance in places)
