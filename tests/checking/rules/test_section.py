"""The checker's rules for cross-section, turnouts and markings, and the edges that it works out by itself."""

import copy
from typing import Any

import numpy as np
import pytest

from synthroads_addon.checking.rules import markings as checker_markings
from synthroads_addon.checking.rules import section as checker_section
from synthroads_addon.checking.rules import turnouts as checker_turnout
from synthroads_addon.checking.rules.edges import Edges
from synthroads_addon.road.objects import WidthPoint
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway, CrossfallPoint, Lane, Ramp, Turnout
from synthroads_addon.road.section_geometry import CarriagewaySection
from tests.helpers.roads.checker_full_road import BAY, ENTRY, EXIT, LENGTH, full, line, right_edge, turned
from tests.helpers.roads.checker_roads import Data, Planted, assert_found, changed, checked, rules_of
from tests.sampling.test_country_roads import OF_COUNTRY_ROADS
from tests.sampling.test_other_countries import BREACHES as ELSEWHERE
from tests.sampling.test_overtaking_lanes import BREACHES as OF_OVERTAKING_LANES


def of_full(*changes: tuple[str, Any]) -> Data:
    return changed(*changes, of=full())


def points(*pairs: tuple[float, float]) -> list[Data]:
    return [{"station": float(station), "width": float(width)} for station, width in pairs]


def widths_out_of_order() -> RoadParameters:
    """Return a road whose lane's points go back, which no file can hold but Python can make."""
    parameters = RoadParameters.from_dict(full())
    left = parameters.objects["left"]
    back = (
        WidthPoint(station=0.0, width=3.5),
        WidthPoint(station=900.0, width=3.5),
        WidthPoint(station=800.0, width=3.5),
    )
    left = left.model_copy(update={"lanes": (left.lanes[0].model_copy(update={"width": back}), *left.lanes[1:])})
    return parameters.model_copy(update={"objects": {**parameters.objects, "left": left}})


def second_exit(start: float) -> Data:
    """Return the road of EKA 3 with one more exit in place of its bay, its lane 30 m from the first's taper on."""
    data = of_full(("bay", None))
    more: Data = {
        "extra": copy.deepcopy(data["objects"]["exit"]) | {"start_station": start},
        "extra-hatching": {"type": "Hatching", "turnout": "extra"},
        "extra-block": line("right", "block", start, start + 280.0),
        "extra-outside": line("right", "turnout_edge", start, start + 365.0, turnout="extra"),
        "extra-gore": line("right", "gore_edge", start + 280.0, start + 365.0, turnout="extra"),
    }
    for number, item in enumerate(more.values()):
        item["instance"] = 1000 + number
    data["objects"] |= more
    return data


DROPPED = ((500.0, 3.5), (700.0, 0.0))
BESIDE = frozenset(
    {"object-on-pavement", "delineator-distance", "barrier-distance", "sign-distance", "obstacle-barrier"}
)
SIGNS = frozenset({"exit-sign-missing", "exit-sign-place", "gore-sign"})

SECTION = [
    Planted("width-order", widths_out_of_order, "left", 800, 800, 900, BESIDE | {"lane-taper"}),
    Planted("lane-width", lambda: changed(("left/lanes/1/width", 3.25)), "left", 0, 3.25, 3.5),
    Planted(
        "lane-width",
        lambda: of_full(("left/lanes/2/width", points((1350, 0), (1500, 3.4), (1900, 3.5)))),
        "left",
        1500,
        3.4,
        3.5,
        frozenset({"marking-between"}),
    ),
    Planted(
        "lane-taper", lambda: of_full(("left/lanes/2/width/0/station", 1400.0)), "left", 1400, 100, 120, frozenset()
    ),
    Planted(
        "median-width", lambda: changed(("left/inner_offset", 1.0), ("right/inner_offset", 1.0)), "median", 0, 2.0, 2.5
    ),
    Planted(
        "median-width",
        lambda: of_full(("left/inner_offset", points((500, 2), (600, 0.3), (700, 2)))),
        "median",
        600,
        2.3,
        2.5,
        BESIDE,
    ),
    Planted("hard-shoulder-width", lambda: changed(("left/hard_shoulder_width", 2.0)), "left", 0, 2.0, 2.5),
    Planted("edge-strip-width", lambda: changed(("left/outer_edge_strip_width", 0.4)), "left", 0, 0.4, 0.5),
    Planted("edge-strip-width", lambda: changed(("left/inner_edge_strip_width", 0.3)), "left", 0, 0.3, 0.75),
    Planted("verge-width", lambda: changed(("left/verge_width", points((0, 1.5), (700, 1.0)))), "left", 700, 1.0, 1.5),
    Planted(
        "rut-lane",
        lambda: of_full(("right/pavement/ruts/0/width", 1.6), ("right/pavement/ruts/0/track", 2.6)),
        "right",
        500,
        3.75,
        4.2,
    ),
    Planted(
        "rut-lane",
        lambda: of_full(
            ("left/pavement", {"ruts": [{"lane": 2, "start_station": 1400.0, "end_station": 1600.0, "depth": 0.01}]})
        ),
        "left",
        1400,
        3.5 / 3,
        2.6,
    ),
    Planted("pothole-pavement", lambda: of_full(("right/pavement/potholes/0/offset", -16.4)), "right", 450, 0.1, 0),
    Planted("pothole-pavement", lambda: of_full(("right/pavement/potholes/0/offset", 8.0)), "right", 450, 10.2, 0),
]

TURNOUT = [
    Planted(
        "turnout-lane-length",
        lambda: of_full(("exit/lane_length", 240.0), ("exit/taper_in_length", 40.0)),
        "exit",
        EXIT,
        240,
        250,
    ),
    Planted("turnout-lane-width", lambda: of_full(("entry/lane_width", 3.4)), "entry", ENTRY, 3.4, 3.5),
    Planted("turnout-taper", lambda: of_full(("entry/taper_out_length", 25.0)), "entry", ENTRY, 25, 30),
    Planted("turnout-taper", lambda: of_full(("bay/taper_in_length", 15.0)), "bay", BAY, 15, 20),
    Planted("bay-width", lambda: of_full(("bay/lane_width", 2.8)), "bay", BAY, 2.8, 3.0),
    Planted("bay-length", lambda: of_full(("bay/lane_length", 35.0)), "bay", BAY, 35, 40),
    Planted("ramp-nose", lambda: of_full(("exit/ramp/length", 60.0)), "exit", EXIT + 280, 60, 65.40744, SIGNS | BESIDE),
    Planted("turnout-gap", lambda: of_full(("bay/start_station", 1905.0)), "bay", 1905, 10, 20, BESIDE),
    Planted(
        "interchange-spacing",
        lambda: second_exit(200.0),
        "exit",
        EXIT,
        EXIT - 200,
        8000,
        SIGNS | BESIDE | {"clearance"},
    ),
    Planted("turnout-range", lambda: of_full(("bay/start_station", -10.0)), "bay", -10, -10, 0, BESIDE),
    Planted(
        "turnout-range",
        lambda: of_full(("bay/start_station", LENGTH - 70)),
        "bay",
        LENGTH + 10,
        LENGTH + 10,
        LENGTH,
        BESIDE,
    ),
    Planted(
        "turnout-lane-change",
        lambda: of_full(("right/lanes/2/width", points((200, 0), (350, 3.5)))),
        "bay",
        300,
        50,
        0,
        frozenset({"marking-between"}),
    ),
]

MARKINGS = [
    Planted("marking-missing", lambda: changed(("left-line-1", None)), "left", 0, 0, 1),
    Planted("marking-missing", lambda: of_full(("left-2", None)), "left", 1500, 0, 1),
    Planted("marking-missing", lambda: of_full(("exit-outside", None)), "exit", EXIT, 0, 1),
    Planted("marking-missing", lambda: of_full(("exit-gore", None)), "exit", EXIT, 0, 1),
    Planted("marking-missing", lambda: of_full(("entry-hatching", None)), "entry", ENTRY, 0, 1),
    Planted(
        "marking-missing",
        lambda: of_full(("right-0d/kind", "outer_edge"), ("right-0d/dash_length", 0.0), ("right-0d/gap_length", 0.0)),
        "entry",
        ENTRY,
        0,
        1,
    ),
    Planted("marking-coverage", lambda: changed(("left-line-1/end_station", 1200.0)), "left-line-1", 1200, 200, 0),
    Planted("marking-coverage", lambda: of_full(("right-0b/end_station", 1300.0)), "right-0a", 1300, 80, 0),
    Planted("marking-coverage", lambda: of_full(("left-2/start_station", 1600.0)), "left-2", 1500, 100, 0),
    Planted("marking-coverage", lambda: of_full(("exit-outside/end_station", 1400.0)), "exit-outside", 1400, 65, 0),
    Planted("marking-coverage", lambda: of_full(("entry-gore/start_station", 1520.0)), "entry-gore", 1500, 20, 0),
    Planted("marking-between", lambda: of_full(("left-2/start_station", 1200.0)), "left-2", 1200, 150, 0),
    Planted("marking-width", lambda: changed(("left-line-0/width", 0.15)), "left-line-0", 0, 0.15, 0.3),
    Planted("marking-width", lambda: of_full(("right-0b/width", 0.15)), "right-0b", EXIT, 0.15, 0.3),
    Planted("marking-width", lambda: of_full(("exit-gore/width", 0.25)), "exit-gore", EXIT + 280, 0.25, 0.3),
    Planted("marking-pattern", lambda: changed(("left-line-1/gap_length", 9.0)), "left-line-1", 0, 9, 12),
    Planted("marking-pattern", lambda: of_full(("right-0b/gap_length", 3.0)), "right-0b", EXIT, 3, 6),
    Planted("marking-pavement", lambda: of_full(("left-yellow/offset", 13.2)), "left-yellow", 950, 0.2, 0),
    Planted(
        "marking-pavement",
        lambda: of_full(("left-yellow/offset", points((950, 5.5), (1250, 1.5)))),
        "left-yellow",
        1250,
        0.5,
        0,
    ),
    Planted("marking-pavement", lambda: of_full(("arrow/offset", -18.25)), "arrow", 1300, 0.25, 0),
    Planted("arrow-direction", lambda: of_full(("arrow/rotation_deg", 180.0)), "arrow", 1300, 180, 45),
]

PLANTED = [*SECTION, *TURNOUT, *MARKINGS]


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_a_planted_violation_is_found(case: Planted) -> None:
    assert_found(case)


def test_every_rule_has_a_planted_violation() -> None:
    assert {case.rule for case in SECTION} | OF_OVERTAKING_LANES.keys() == rules_of(checker_section)
    assert {case.rule for case in TURNOUT} == rules_of(checker_turnout)
    planted = {case.rule for case in MARKINGS}
    assert planted | set(ELSEWHERE) >= rules_of(checker_markings) - OF_COUNTRY_ROADS
    assert planted <= rules_of(checker_markings) - OF_COUNTRY_ROADS


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_the_road_seen_from_its_other_end_breaks_the_same_rules(case: Planted) -> None:
    made = case.make()
    if isinstance(made, dict) and "exit" in made["objects"]:
        found, other = ([v for v in checked(data) if v.rule == case.rule] for data in (made, turned(made)))
        assert len(found) == len(other)
        if not case.rule.endswith(("-order", "-range")):  # whose values are stations
            assert sorted(v.value for v in found) == pytest.approx(sorted(v.value for v in other))


def test_the_edges_of_a_road_with_turnouts() -> None:
    parameters = RoadParameters.from_dict(full())
    right = parameters.objects["right"]
    assert isinstance(right, Carriageway)
    edges = Edges("right", right, parameters.of_type(Turnout), LENGTH)
    # Off the noses and the ramps' ends, where the pavement steps.
    station = np.array(
        [0.0, 310.0, 340.0, 375.0, 1099.0, 1115.0, 1200.0, 1385.0, 1430.0, 1464.0, 1466.0, 1501.0, 1600.0]
    )
    assert edges.at(station).outer == pytest.approx([right_edge(s) for s in station], abs=1e-9)
    assert edges.at(station).main == pytest.approx(np.full(len(station), 16.5))
    behind = edges.at(np.array([1455.0]))  # 75 m behind the gore's tip the ramp is 75^3 / (6 * 90^2) away
    assert (behind.gap_low[0], behind.gap_high[0]) == pytest.approx((16.5, 14.0 + 75.0**3 / 48600.0))
    assert edges.at(np.array([1430.0])).gap_low[0] == edges.at(np.array([1430.0])).outer[0]


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("kind", ["exit", "entry", "emergency_bay"])
def test_the_edges_agree_with_the_road_model(side: Any, kind: Any) -> None:
    """The checker works its edges out by itself; the model's cross-section is the other implementation."""
    widths = {"inner_offset": 2.0, "outer_edge_strip_width": 0.5, "inner_edge_strip_width": 0.75, "verge_width": 1.5}
    lanes = tuple(Lane(width=width) for width in (3.75, tuple(WidthPoint(station=s, width=w) for s, w in DROPPED)))
    carriageway = Carriageway(
        instance=1,
        side=side,
        lanes=lanes,
        hard_shoulder_width=tuple(WidthPoint(station=s, width=w) for s, w in ((100.0, 2.0), (900.0, 3.0))),
        crossfall=(CrossfallPoint(station=0.0, crossfall_percent=2.5),),
        **widths,
    )
    turnout = Turnout(
        instance=2,
        carriageway=side,
        kind=kind,
        start_station=300.0,
        taper_in_length=0.0 if kind == "entry" else 40.0,
        taper_out_length=0.0 if kind == "exit" else 60.0,
        lane_length=150.0,
        lane_width=3.5,
        shoulder_width=0.0 if kind == "emergency_bay" else 1.5,
        ramp=None if kind == "emergency_bay" else Ramp(length=90.0, clothoid_parameter=80.0),
    )
    edges, section = Edges(side, carriageway, {"turnout": turnout}, 1000.0), CarriagewaySection(carriageway, [turnout])
    station = np.arange(0.0, 1000.0, 0.37)
    steps = np.abs(station[:, None] - edges.turnouts[0].marks()).min(axis=1)
    station = station[steps > 0.02]  # where the pavement steps, the two do so in different ways
    found = edges.at(station)
    assert found.inner == pytest.approx(section.distances(station)[:, 0], abs=1e-9)
    assert found.lanes == pytest.approx(section.lane_boundaries(station), abs=1e-9)
    assert found.main == pytest.approx(section.main_edge(station), abs=1e-9)
    assert found.outer == pytest.approx(section.paved_edge(station), abs=1e-9)
    if kind != "emergency_bay":
        inner, outer = section.boundaries_of("island", station)
        bare = outer - inner > 1e-9
        assert found.gap_low[bare] == pytest.approx(inner[bare], abs=1e-9)
        assert found.gap_high[bare] == pytest.approx(outer[bare], abs=1e-9)
        assert np.all(found.gap_low[~bare] == found.outer[~bare])
