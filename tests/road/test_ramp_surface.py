"""Crossfall and grade of a ramp's own, behind the nose."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.section import Carriageway, CrossfallPoint, Lane, Ramp, Turnout
from synthroads_addon.road.section_geometry import CarriagewaySection
from synthroads_addon.road.turnout_geometry import BLEND, STEP, TurnoutShape

CROSSFALL, RUN_OFF, GRADE, RADIUS, MAIN = 0.06, 15.0, 0.03, 500.0, -0.02
CURVE = GRADE * RADIUS
"""Length of the vertical curve, m."""
OWN = {"run_off_length": RUN_OFF, "grade_percent": 100.0 * GRADE, "rounding_radius": RADIUS}
KINDS = [("exit", "right"), ("exit", "left"), ("entry", "right"), ("entry", "left")]


def section_of(kind: Any, side: Any, **own: Any) -> tuple[CarriagewaySection, TurnoutShape]:
    """Return a carriageway that falls towards the median, with an exit or entry whose ramp falls outwards."""
    widths = {"inner_offset": 2.0, "outer_edge_strip_width": 0.5, "inner_edge_strip_width": 0.75, "verge_width": 1.5}
    sign = 1.0 if side == "left" else -1.0
    fall = (CrossfallPoint(station=0.0, crossfall_percent=100.0 * -sign * MAIN),)
    road = Carriageway(
        instance=1, side=side, lanes=(Lane(width=3.75),) * 2, hard_shoulder_width=2.5, crossfall=fall, **widths
    )
    if own:
        own["crossfall_percent"] = 100.0 * -sign * CROSSFALL
    ramp = Ramp(length=110.0, clothoid_parameter=80.0, **own)
    taper = {"taper_in_length": 30.0} if kind == "exit" else {"taper_out_length": 30.0}
    place: dict[str, Any] = {"instance": 2, "carriageway": side, "kind": kind, "start_station": 100.0}
    section = CarriagewaySection(road, [Turnout(**place, **taper, lane_length=150.0, lane_width=3.5, ramp=ramp)])
    return section, section.turnouts[0]


def heights(section: CarriagewaySection, station: Float) -> Float:
    crossfall = np.full(len(station), section.carriageway.crossfall[0].crossfall_percent / 100.0)
    return section.elevations(station, crossfall)


@pytest.mark.parametrize(("kind", "side"), KINDS)
def test_it_has_its_crossfall_and_grade_behind_the_nose(kind: str, side: str) -> None:
    section, shape = section_of(kind, side, **OWN)
    plain, _ = section_of(kind, side)
    behind = np.array([3.0, 8.0, RUN_OFF, 20.0, 110.0 - shape.nose])
    station = np.array([shape.nose_station(at) for at in behind.tolist()])
    level, plane = heights(section, station), heights(plain, station)
    first = section.kinds.index("ramp_inner_strip")
    island = section.kinds.index("island")
    assert level[:, : island + 1] == pytest.approx(plane[:, : island + 1])
    curve = np.minimum(behind, CURVE)
    lift = curve**2 / (2.0 * RADIUS) + GRADE * (behind - curve)
    assert level[:, first] - plane[:, first] == pytest.approx(lift)
    distances = section.distances(station)
    falls = (level[:, first] - level[:, -2]) / (distances[:, -2] - distances[:, first])
    share = np.minimum(behind / RUN_OFF, 1.0)
    # The main road rises outwards by 2 %, the ramp falls by 6 %.
    assert falls == pytest.approx(MAIN + share * (CROSSFALL - MAIN))
    verge = section.carriageway.verge_slope_percent / 100.0
    assert level[:, -2] - level[:, -1] == pytest.approx(verge * 1.5)


@pytest.mark.parametrize(("kind", "side"), KINDS)
def test_heights_change_at_once_only_where_the_pavement_does(kind: str, side: str) -> None:
    section, shape = section_of(kind, side, **OWN)
    plain, _ = section_of(kind, side)
    low, high = shape.range()
    station = np.linspace(low - 5.0, high + 5.0, 20_001)
    added = heights(section, station) - heights(plain, station)
    steps = [step for step in section.steps() if abs(step[0] - shape.nose_station()) > 1.0]
    inside = np.any([(station > a - 0.03) & (station < b + 0.03) for a, b in steps], axis=0)
    jumps = np.abs(np.diff(added, axis=0))[~(inside[1:] | inside[:-1])]
    assert jumps.max() < 0.1 * (station[1] - station[0])
    # The verge's edge goes on behind the ramp's end as it was there, and comes back to the main road's.
    end = [shape.station(shape.turnout.length + STEP + share * BLEND) for share in (0.0, 0.5, 1.0)]
    behind = heights(section, np.array(end)) - heights(plain, np.array(end))
    before = heights(section, np.array([shape.station(shape.turnout.length)]))
    before = before - heights(plain, np.array([shape.station(shape.turnout.length)]))
    assert abs(before[0, -1]) > 0.1
    assert behind[:, -1] == pytest.approx(before[0, -1] * np.array([1.0, 0.5, 0.0]), abs=1e-9)
    assert np.abs(behind[:, :-1]).max() == 0.0
    assert np.abs(added[(station < low) | (station > high)]).max() == 0.0


@pytest.mark.parametrize(("kind", "side"), KINDS)
def test_the_fields_of_the_nodes_give_the_same_heights(kind: str, side: str) -> None:
    section, shape = section_of(kind, side, **OWN)
    plain, _ = section_of(kind, side)
    station = np.linspace(*shape.range(), 5001)
    station = station[~np.any([(station > a + 1e-9) & (station < b - 1e-9) for a, b in section.steps()], axis=0)]
    crossfall = np.full(len(station), section.carriageway.crossfall[0].crossfall_percent / 100.0)
    fields, distances = section.ramp_fields(station, crossfall), section.distances(station)
    extra = plain.distances(station)[:, -1] - section.carriageway.verge_width - plain.paved_edge(station)
    plane = np.minimum(distances, (plain.paved_edge(station) + extra)[:, None])
    begin = plane[:, -1:] - fields.width[:, None]
    added = np.where(distances > begin - 0.001, fields.lift[:, None] + fields.tilt[:, None] * (plane - begin), 0.0)
    assert heights(plain, station) + added == pytest.approx(heights(section, station), abs=1e-4)
    assert np.ptp(added) > 0.5


def test_without_any_of_its_own_it_lies_in_the_main_roads_plane() -> None:
    section, shape = section_of("exit", "right")
    station = np.linspace(*shape.range(), 500)
    distances, level = section.distances(station), heights(section, station)
    pivot = section.pivot(station)
    paved = slice(None, -1)
    assert level[:, paved] == pytest.approx(-MAIN * (distances[:, paved] - pivot[:, None]))
    assert shape.ramp_surface(station) is None
