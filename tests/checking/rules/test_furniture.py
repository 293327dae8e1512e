"""The checker's rules for barriers, signs, furniture, construction zones and vehicles."""

from typing import Any

import pytest

from synthroads_addon.checking.rules import barriers as checker_barriers
from synthroads_addon.checking.rules import furniture as checker_furniture
from synthroads_addon.checking.rules import signs as checker_signs
from synthroads_addon.checking.rules import traffic as checker_traffic
from tests.helpers.roads.checker_full_road import EXIT, LENGTH, cabinet, full, sign, turned, vehicle, wall
from tests.helpers.roads.checker_roads import (
    INSIDE,
    Data,
    Planted,
    assert_found,
    changed,
    checked,
    good,
    mirrored,
    rail,
    road,
    rules_of,
)


def of_full(*changes: tuple[str, Any]) -> Data:
    return changed(*changes, of=full())


def extra(item: Data, *changes: tuple[str, Any], of: Data | None = None) -> Data:
    """Return a road (the one with everything) with one more object, called ``extra``."""
    return changed(("extra", item | {"instance": 9999}), *changes, of=of or full())


K = 1.0 / 4000.0


def far_phones() -> Data:
    """Return a road of 3 km with two emergency phones on the left."""
    data = road([(900, 0, 0), (450, 0, K), (300, K, K), (450, K, 0), (900, 0, 0)])
    phones = {f"phone-{i}": cabinet("emergency_phone", at, 16.0) for i, at in enumerate((100.0, 2600.0))}
    data["objects"] |= {name: item | {"instance": 5000 + i} for i, (name, item) in enumerate(phones.items())}
    return data


NO_BARRIER = frozenset({"obstacle-barrier"})
POST = frozenset({"delineator-missing", "delineator-spacing"})
FACE = frozenset({"sign-distance", "clearance"})

BARRIERS = [
    Planted("median-barrier", lambda: changed(("rail-median/faces", "left")), "right", 0, 1400, 0),
    Planted("median-barrier", lambda: changed(("rail-median/end_station", 1000.0)), "left", 1000, 400, 0, times=2),
    Planted("median-barrier", lambda: of_full(("wall-median/start_station", 1010.0)), "left", 1000, 10, 0, times=2),
    Planted("median-barrier", lambda: of_full(("rail-pier-right/faces", "left")), "right", 1880, 120, 0, NO_BARRIER),
    Planted("embankment-barrier", lambda: changed(("rail-left/start_station", 90.0)), "left", 0, 90, 0),
    Planted(
        "embankment-barrier",
        lambda: changed(("rail-right/faces", "right")),
        "right",
        0,
        1400,
        0,
        frozenset({"curve-barrier"}),
    ),
    Planted(
        "curve-barrier",
        lambda: changed(("rail-right/start_station", 600.0), ("terrain/embankment_height", 1.0)),
        "right",
        550,
        50,
        0,
    ),
    Planted("obstacle-barrier", lambda: of_full(("rail-right/start_station", 450.0)), "pole", 440, 10.1, 0),
    Planted("obstacle-barrier", lambda: of_full(("rail-right/end_station", 700.0)), "gantry", 700, 10.25, 0),
    Planted("obstacle-barrier", lambda: of_full(("rail-gantry", None)), "gantry", 639.75, 70.5, 0),
    Planted("obstacle-barrier", lambda: of_full(("rail-right/offset", -19.0)), "pole", 439.9, 70.2, 0, times=2),
    Planted("obstacle-barrier", lambda: of_full(("overpass/pier_offsets", [-27.5])), "overpass", 1885, 80, 0),
    Planted("obstacle-barrier", lambda: of_full(("sign-448/post_diameter", 0.15)), "sign-448", 39.4, 70.15, 0, times=2),
    Planted("noise-barrier", lambda: of_full(("rail-left/end_station", 450.0)), "noise", 450, 10, 0),
    Planted(
        "noise-barrier",
        lambda: of_full(("rail-left/start_station", 150.0), ("noise/offset", 26.0)),
        "noise",
        100,
        50,
        0,
    ),
    Planted(
        "tree-distance",
        lambda: changed(
            ("trees/band_start", 9.0), ("rail-left/start_station", 100.0), ("terrain/embankment_height", 1.0)
        ),
        "trees",
        0,
        10.5,
        12,
    ),
    Planted("barrier-distance", lambda: changed(("rail-left/offset", 14.5)), "rail-left", 0, 0.3, 0.5),
    Planted("barrier-distance", lambda: of_full(("wall-median/offset", 1.4)), "wall-median", 1000, 0.33, 0.5),
    Planted(
        "barrier-distance",
        lambda: of_full(("rail-right/end_station", 1160.0), ("rail-right/offset", -18.5)),
        "rail-right",
        1130,
        0.3,
        0.5,
        NO_BARRIER | {"object-overlap"},
    ),
    Planted("barrier-length", lambda: extra(rail(100.0, 150.0, 16.0, "right"), of=good()), "extra", 100, 50, 60),
    Planted("barrier-length", lambda: extra(wall(1000.0, 1059.0, -24.0)), "extra", 1000, 59, 60),
]

SIGNS = [
    Planted("sign-distance", lambda: of_full(("sign-448/offset", -18.1)), "sign-448", 100, 0.35, 0.5),
    Planted("sign-distance", lambda: of_full(("left-km-1/offset", 13.4)), "left-km-1", 750, 0.125, 0.5),
    Planted("sign-distance", lambda: of_full(("sign-333/offset", -17.8)), "sign-333", 1455, 0.3, 0.5),
    Planted("sign-lower-edge", lambda: of_full(("sign-449/lower_edge", 1.4)), "sign-449", 600, 1.4, 1.5),
    Planted("sign-facing", lambda: of_full(("sign-274/rotation_deg", 0.0)), "sign-274", 700, 180, 45),
    Planted("sign-facing", lambda: of_full(("light/rotation_deg", -60.0)), "light", 1560, 60, 45),
    Planted("exit-sign-missing", lambda: of_full(("sign-51", None)), "exit", EXIT - 200, LENGTH, 5),
    Planted(
        "exit-sign-missing",
        lambda: of_full(("sign-52/station", 793.0)),
        "exit",
        EXIT - 300,
        7,
        5,
        frozenset({"exit-sign-place"}),
    ),
    Planted(
        "exit-sign-missing",
        lambda: of_full(("sign-50/code", "450-51"), ("sign-51/code", "450-50")),
        "exit",
        EXIT - 200,
        100,
        5,
        frozenset({"exit-sign-place"}),
        2,
    ),
    Planted(
        "exit-sign-missing",
        lambda: of_full(("sign-448/rotation_deg", 180.0)),
        "exit",
        EXIT - 1000,
        LENGTH,
        5,
        frozenset({"sign-facing"}),
    ),
    Planted("exit-sign-place", lambda: extra(sign("450-52", 1050.0, -19.0, lower_edge=0.5)), "extra", 1050, 250, 5),
    Planted("gore-sign", lambda: of_full(("sign-333/offset", -31.0)), "exit", EXIT + 335.4, 0, 1),
    Planted("gore-sign", lambda: of_full(("sign-333", None)), "exit", EXIT + 335.4, 0, 1),
    Planted("gantry-sign", lambda: of_full(("gantry/signs/0/offset", -2.2)), "gantry", 700, 0.1, 0),
    Planted("clearance", lambda: of_full(("gantry/clearance", 4.6)), "gantry", 700, 4.6, 4.7),
    Planted("clearance", lambda: of_full(("overpass/clearance", 4.5)), "overpass", 1950, 4.5, 4.7),
    Planted(
        "clearance",
        lambda: of_full(("sign-449/offset", -17.5)),
        "sign-449",
        600,
        2.0,
        4.7,
        frozenset({"object-overlap", "object-on-pavement"}),
    ),
]

FURNITURE = [
    Planted("delineator-missing", lambda: changed(("left-post-0", None)), "left", 0, 75, 25),
    Planted("delineator-spacing", lambda: changed(("left-post-5", None)), "left", 225, 100, 50),
    Planted("delineator-spacing", lambda: changed(("left-post-27", None)), "left", 1325, 75, 50),
    Planted(
        "delineator-spacing",
        lambda: changed(of=road([(600, 1 / 450, 1 / 450)], "EKA3")),
        "left",
        25,
        50,
        35,
        INSIDE | {"delineator-missing"},
        22,
    ),
    Planted("delineator-distance", lambda: changed(("left-post-5/offset", 14.3)), "left-post-5", 275, 0.3, 0.5),
    Planted("kilometre-spacing", lambda: of_full(("right-km-1", None)), "right-km-0", 250, 1000, 500),
    Planted("kilometre-text", lambda: of_full(("right-km-1/text", "12,6")), "right-km-1", 750, 100, 5),
    Planted("kilometre-text", lambda: of_full(("right-km-1/text", "km")), "right-km-1", 750, LENGTH, 5),
    Planted("phone-spacing", far_phones, "phone-0", 100, 2500, 2000),
    Planted("object-range", lambda: changed(("left-line-0/end_station", 1500.0)), "left-line-0", 1500, 1500, 1400),
    Planted("object-range", lambda: of_full(("car/station", 2010.0)), "car", 2010, 2010, LENGTH),
    Planted("object-range", lambda: of_full(("asset/station", 2010.0)), "asset", 2010, 2010, LENGTH),
    Planted(
        "object-range", lambda: of_full(("right/pavement/potholes/0/station", 2001.0)), "right", 2001, 2001, LENGTH
    ),
    Planted("object-range", lambda: of_full(("right/pavement/ruts/0/end_station", 400.0)), "right", 400, 400, 500),
    Planted("object-on-pavement", lambda: changed(("left-post-5/offset", 13.0)), "left-post-5", 275, -1.06, 0),
    Planted("object-on-pavement", lambda: changed(("trees/band_start", -3.0)), "trees", 0, -1.5, 0),
    Planted("object-on-pavement", lambda: of_full(("shrub/band_start", -2.0)), "shrub", 0, -0.5, 0),
    Planted("object-on-pavement", lambda: of_full(("asset/offset", -17.0)), "asset", 1200, -1.0, 0),
    Planted(
        "object-on-pavement",
        lambda: of_full(("gantry/right_offset", -16.0)),
        "gantry",
        700,
        -0.75,
        0,
        frozenset({"object-overlap"}),
    ),
    Planted("object-on-pavement", lambda: of_full(("overpass/pier_offsets", [-16.8])), "overpass", 1945, -0.2, 0),
    Planted("object-on-pavement", lambda: of_full(("noise/offset", 12.0)), "noise", 100, -1.08, 0),
    Planted(
        "object-on-pavement",
        lambda: of_full(("rail-right/end_station", 1120.0)),
        "rail-right",
        1120,
        -0.5,
        0,
        NO_BARRIER,
    ),
    Planted("object-overlap", lambda: extra(sign("250", 500.1, -18.55, 0.6)), "extra", 500, 0.038, 0),
    Planted(
        "object-overlap", lambda: of_full(("cabinet/offset", 14.7), ("cabinet/station", 610.2)), "cabinet", 610, 0.1, 0
    ),
    Planted("object-overlap", lambda: of_full(("right-post-10/offset", -17.3)), "right-post-10", 525, 0.01, 0),
]

TRAFFIC = [
    Planted("beacon-spacing", lambda: of_full(("beacon-12", None)), "beacon-13", 1129, 36, 18),
    Planted("beacon-spacing", lambda: of_full(("beacon-3", None)), "beacon-4", 1264, 18, 9),
    Planted(
        "open-lane",
        lambda: of_full(("beacon-12/offset", 5.0)),
        "beacon-12",
        1147,
        2.125,
        2.5,
        frozenset({"beacon-spacing"}),
    ),
    Planted(
        "open-lane",
        lambda: of_full(
            ("left/lanes", [{"width": 3.5}]),
            ("left-3/boundary", 1),
            *((f"left-{i}", None) for i in (1, 2)),
            *((name, None) for name in ("last", "bus")),
            ("closure/offset", 4.5),
            ("closure/end_offset", 4.4),
        ),
        "closure",
        1000,
        1.55,
        2.5,
    ),
    Planted("vehicle-lane", lambda: of_full(("last/station", 1300.0)), "last", 1300, 0, 1.6),
    Planted(
        "vehicle-lane", lambda: of_full(("last/station", 1450.0), ("last/model", "bus")), "last", 1450, 2.21083, 2.4
    ),
    Planted("vehicle-closed", lambda: of_full(("bus/station", 980.0), ("bus/lane", 0)), "bus", 980, 2.675, 0),
    Planted("vehicle-closed", lambda: of_full(("bus/station", 1246.0), ("bus/lane", 0)), "bus", 1246, 2.225, 0),
    Planted(
        "vehicle-closed",
        lambda: of_full(("bus/station", 1100.0), ("closure/offset", 4.6), ("closure/end_offset", 4.6)),
        "bus",
        1100,
        1.3,
        0,
    ),
    Planted("vehicle-overlap", lambda: of_full(("truck/station", 207.0)), "truck", 207, -1.65, 0),
    Planted("vehicle-overlap", lambda: extra(vehicle("left", "motorcycle", 1, 703.0)), "extra", 703, -3.15, 0),
]

PLANTED = [*BARRIERS, *SIGNS, *FURNITURE, *TRAFFIC]


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_a_planted_violation_is_found(case: Planted) -> None:
    assert_found(case)


def test_every_rule_has_a_planted_violation() -> None:
    assert {case.rule for case in BARRIERS} == rules_of(checker_barriers)
    assert {case.rule for case in SIGNS} == rules_of(checker_signs)
    assert {case.rule for case in FURNITURE} == rules_of(checker_furniture)
    assert {case.rule for case in TRAFFIC} == rules_of(checker_traffic)


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_the_road_seen_from_its_other_end_breaks_the_same_rules(case: Planted) -> None:
    """The hand-made roads without an exit are mirrored instead: their rules don't look at the direction of traffic."""
    if case.rule.endswith("-range"):
        return  # what lies beyond the road's end would lie before its begin, which no file can hold
    made = case.make()
    other = turned(made) if "exit" in made["objects"] else mirrored(made)
    found, others = ([v for v in checked(data) if v.rule == case.rule] for data in (made, other))
    assert len(found) == len(others)
    assert sorted(v.value for v in found) == pytest.approx(sorted(v.value for v in others))
