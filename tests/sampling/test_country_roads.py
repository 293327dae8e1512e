"""Roads of one carriageway: nothing broken, one plane in curves, the right lines, sight; and each breach is found."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.axes.sight import overtaking_spans, sight_distances
from synthroads_addon.road.geometry import RoadGeometry, alignment_of
from synthroads_addon.road.guidelines import (
    DUAL_CLASSES,
    GUIDELINE_OF_CLASS,
    GUIDELINES,
    LIMITS,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    is_single,
)
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.section import Carriageway, LineMarking, Median
from synthroads_addon.road.surroundings import Vehicle
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

SECTIONS = list(
    dict.fromkeys(
        name
        for design_class, names in SECTIONS_OF_CLASS.items()
        if GUIDELINE_OF_CLASS[design_class].name == "RAL"
        for name in names
    )
)
"""The sections of the German guideline; those of other countries have tests of their own."""
PAVED = {
    "RQ15.5": 12.5,
    "RQ11.5+": 8.5,
    "RQ11": 8.0,
    "RQ9": 6.0,
    "RQ10.5": 7.5,
    "RQ9.5": 6.5,
    "RQ7.5": 5.5,
    "W5.5": 5.5,
}
"""Paved widths, m."""


def road(section: str, seed: int = 1, length: float = 900.0, **limits: Any) -> RoadParameters:
    return sample_road(RoadScenario.from_dict({"cross_section": section, "length": length, **limits}), seed)


def changed(parameters: RoadParameters, *changes: tuple[str, Any]) -> RoadParameters:
    """Return a parameter set with fields of its objects, by path, set to other values."""
    data = json.loads(parameters.to_json())
    for path, value in changes:
        target = data["objects"]
        *parts, last = path.split("/")
        for part in parts:
            target = target[int(part) if part.isdigit() else part]
        target[int(last) if last.isdigit() else last] = value
    return RoadParameters.from_dict(data)


def axis_of(elements: list[tuple[float, float, float]], points: list[tuple[float, float, float]]) -> AlignmentObject:
    """Return an axis of elements (length m, curvatures 1/m) and points (station m, elevation m, radius m)."""
    return AlignmentObject(
        instance=1,
        start_x=0.0,
        start_y=0.0,
        start_heading_deg=0.0,
        horizontal=tuple(HorizontalElement.between(*row) for row in elements),
        vertical=tuple(VerticalPoint(station=s, elevation=z, radius=r) for s, z, r in points),
    )


LEVEL = [(0.0, 0.0, 0.0)]
NO_ENTRANCES = {"furniture": {"entrances_per_km": {"minimum": 0.0, "maximum": 0.0}}}


def on_axis(
    elements: list[tuple[float, float, float]],
    points: list[tuple[float, float, float]] = LEVEL,
    section: str = "RQ11",
    **limits: Any,
) -> RoadParameters:
    """Return a road of a section, without anything beside it, along an axis."""
    bare = {"trees_per_hectare": 0.0, "roadside": {"avenues": 0.0}, "turnouts": {"bus_bays": 0.0, "laybys": 0.0}}
    scenario = RoadScenario.from_dict({"cross_section": section, **bare, **NO_ENTRANCES, **limits})
    return sample_road(scenario, 1, axis=axis_of(elements, points))


def test_all_standard_widths_add_up() -> None:
    assert {name: STANDARD_CROSS_SECTIONS[name].total_width for name in SECTIONS} == pytest.approx(
        {name: paved + 2.0 * STANDARD_CROSS_SECTIONS[name].verge for name, paved in PAVED.items()}
    )


@pytest.mark.parametrize("section", SECTIONS)
def test_both_directions_share_one_carriageway(section: str) -> None:
    parameters = road(section)
    left, right = (parameters.carriageway(side) for side in ("left", "right"))
    assert left is not None
    assert right is not None
    assert left.inner_offset == right.inner_offset == 0.0
    assert not parameters.of_type(Median)
    assert {left.rotation_axis, right.rotation_axis} == {"centreline"}
    assert left.pavement.kind == right.pavement.kind
    geometry = RoadGeometry(parameters)
    edges = [geometry.sections[side].paved_edge(np.zeros(1))[0] for side in ("left", "right")]
    assert sum(edges) == pytest.approx(PAVED[section])


@pytest.mark.parametrize("section", SECTIONS)
def test_the_pavement_is_a_roof_or_one_plane(section: str) -> None:
    """The directions fall outwards on straights; where one falls to the inside of a curve, both are one plane."""
    for seed in range(4):
        parameters = road(section, seed, 2000.0)
        station = np.linspace(0.0, 2000.0, 1001)
        falls = {
            item.side: np.interp(
                station,
                [point.station for point in item.crossfall],
                [point.crossfall_percent for point in item.crossfall],
            )
            for item in parameters.of_type(Carriageway).values()
        }
        right, left = falls["right"], falls["left"]
        curvature = np.abs(alignment_of(parameters.alignment).curvature(station))
        limits = LIMITS[parameters.design_class]
        is_straight = curvature * limits.radius_outwards < 1e-6
        is_arc = np.isclose(curvature, np.roll(curvature, 3)) & np.isclose(curvature, np.roll(curvature, -3))
        is_arc &= curvature * limits.radius_outwards > 1.0
        assert np.allclose(right[is_arc], left[is_arc])
        assert np.abs(right).max() <= limits.largest_crossfall_percent
        # Neither side ever falls by less than the least crossfall while the other one turns over.
        assert (np.maximum(np.abs(right), np.abs(left)) >= np.where(np.isclose(right, left), 0.0, 2.5 - 1e-6)).all()
        assert is_straight.any() or is_arc.any()


@pytest.mark.parametrize("section", SECTIONS)
def test_vehicles_drive_on_the_right_and_both_ways(section: str) -> None:
    parameters = road(section, length=2000.0, vehicles={"per_km": {"minimum": 8.0, "maximum": 8.0}})
    vehicles = list(parameters.of_type(Vehicle).values())
    assert {vehicle.carriageway for vehicle in vehicles} == {"carriageway-left", "carriageway-right"}
    assert parameters.carriageway("right").traffic == 1  # type: ignore[union-attr]
    assert parameters.carriageway("left").traffic == -1  # type: ignore[union-attr]


LINES = {
    "RQ15.5": {"inner_edge", "outer_edge", "lane"},
    "RQ11.5+": {"inner_edge", "outer_edge"},
    "RQ11": {"free", "outer_edge"},
    "RQ9": {"outer_edge"},
    "RQ10.5": {"free", "outer_edge"},
    "RQ9.5": {"free", "outer_edge"},
    "RQ7.5": {"free"},
    "W5.5": set(),
}
"""Kinds of lines of each section: a free one lies between the directions."""


@pytest.mark.parametrize("section", SECTIONS)
def test_each_section_has_its_lines(section: str) -> None:
    lines = list(road(section).of_type(LineMarking).values())
    assert {line.kind for line in lines} == LINES[section]
    assert all(line.width == 0.12 for line in lines)
    dashed_edges = {line.dash_length > 0.0 for line in lines if line.kind == "outer_edge"}
    assert dashed_edges == ({section == "RQ9"} if "outer_edge" in LINES[section] else set())


def test_narrowed_lanes_lose_the_line_between_them() -> None:
    assert not [line for line in road("RQ9.5", lane_width=2.7).of_type(LineMarking).values() if line.kind == "free"]
    assert [line for line in road("RQ9.5", lane_width=2.75).of_type(LineMarking).values() if line.kind == "free"]


def test_the_line_is_solid_where_drivers_do_not_see_far() -> None:
    straight, curve = (500.0, 0.0, 0.0), (400.0, 1 / 300, 1 / 300)
    axis = axis_of([straight, curve, straight], LEVEL)
    spans = overtaking_spans(axis, paved_half=4.0, sight=300.0, length=1400.0)
    assert [may for *_, may in spans] == [True, False, True]
    assert 100.0 < spans[1][0] < 500.0
    assert 900.0 < spans[1][1] < 1300.0
    assert spans[0][0] == 0.0
    assert spans[-1][1] == 1400.0


def test_sight_in_curves_and_over_crests_follows_the_formulas() -> None:
    # A chord of the length D has the sagitta D^2 / (8 R) from the arc.
    arc = axis_of([(1000.0, 1 / 300, 1 / 300)], LEVEL)
    assert sight_distances(arc, np.array([100.0]), 6.0, 400.0)[0] == pytest.approx(np.sqrt(8 * 300 * 6.0), abs=10.0)
    # Past a crest of the radius H one sees sqrt(2 H) * (sqrt(eye) + sqrt(target)).
    crest = axis_of([(1000.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (500.0, 25.0, 3000.0), (1000.0, 0.0, 0.0)])
    expected = np.sqrt(2 * 3000.0) * (1.0 + np.sqrt(0.5))
    assert sight_distances(crest, np.array([430.0]), 6.0, 400.0)[0] == pytest.approx(expected, abs=10.0)
    assert sight_distances(crest, np.array([570.0]), 6.0, 400.0, -1)[0] == pytest.approx(expected, abs=10.0)
    straight = axis_of([(1000.0, 0.0, 0.0)], LEVEL)
    assert np.isinf(sight_distances(straight, np.array([0.0, 900.0]), 6.0, 400.0)).all()


# --- planted breaches -------------------------------------------------------------------------------------------------

ARC = 1 / 600
TREE = {"type": "Tree", "station": 150.0, "offset": -7.0, "crown_diameter": 6.0, "crown_bottom": 5.0}
ENTRANCE = {"type": "FieldEntrance", "station": 150.0, "offset": -4.0, "pipe_diameter": 0.0}
CURVE_SIGN = {"type": "TrafficSign", "code": "103-10", "shape": "triangle", "width": 0.9, "height": 0.78} | {
    "station": 150.0,
    "offset": -6.0,
}
CURVED = [(400.0, 0.0, 0.0), (60.0, 0.0, 1 / 300), (100.0, 1 / 300, 1 / 300)]


def with_things(section: str = "RQ11", **things: dict[str, Any]) -> RoadParameters:
    """Return a road with a left curve from 460 m on, and with these things beside it."""
    data = json.loads(on_axis(CURVED, section=section).to_json())
    for number, (name, fields) in enumerate(things.items(), 5000):
        data["objects"][name] = (
            {"instance": number, "rotation_deg": 0.0, **fields}
            if "station" in fields
            else {
                "instance": number,
                **fields,
            }
        )
    return RoadParameters.from_dict(data)


BREACHES = {
    "radius-minimum": lambda: on_axis([(100.0, 0.0, 0.0), (60.0, 0.0, 1 / 200), (100.0, 1 / 200, 1 / 200)]),
    "curvature-jump": lambda: on_axis([(200.0, 0.0, 0.0), (200.0, ARC, ARC)]),
    "straight-between": lambda: on_axis(
        [
            (100.0, ARC, ARC),
            (100.0, ARC, 0.0),
            (500.0, 0.0, 0.0),
            (100.0, 0.0, ARC),
            (100.0, ARC, ARC),
        ]
    ),
    "arc-length": lambda: on_axis(
        [(100.0, 0.0, 0.0), (100.0, 0.0, ARC), (49.0, ARC, ARC), (100.0, ARC, 0.0), (100.0, 0.0, 0.0)]
    ),
    "grade-maximum": lambda: on_axis([(300.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (300.0, 20.0, 0.0)]),
    "crest-radius": lambda: on_axis([(600.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (300.0, 9.0, 4900.0), (600.0, 0.0, 0.0)]),
    "sag-radius": lambda: on_axis([(600.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (300.0, -9.0, 2900.0), (600.0, 0.0, 0.0)]),
    "vertical-tangent": lambda: on_axis(
        [(600.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (300.0, 3.0, 6000.0), (600.0, 3.0, 0.0)]
    ),
    "stopping-sight": lambda: on_axis([(600.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (300.0, 18.0, 2000.0), (600.0, 0.0, 0.0)]),
    "run-off-steepest": lambda: changed(
        on_axis([(100.0, 0.0, 0.0), (100.0, 0.0, ARC), (100.0, ARC, ARC)]),
        (
            "carriageway-right/crossfall",
            [
                {"station": 100.0, "crossfall_percent": 2.5},
                {"station": 110.0, "crossfall_percent": -2.5},
                {"station": 200.0, "crossfall_percent": -4.5},
            ],
        ),
    ),
    "run-off-least": lambda: changed(
        on_axis([(100.0, 0.0, 0.0), (100.0, 0.0, ARC), (100.0, ARC, ARC)]),
        (
            "carriageway-right/crossfall",
            [{"station": 100.0, "crossfall_percent": 2.5}, {"station": 200.0, "crossfall_percent": -4.5}],
        ),
    ),
    "centre-line-missing": lambda: changed(on_axis([(300.0, 0.0, 0.0)]), ("centre-line/end_station", 250.0)),
    "centre-line-narrow": lambda: changed(
        on_axis([(300.0, 0.0, 0.0)]), ("carriageway-right/lanes/0/width", 2.7), ("carriageway-left/lanes/0/width", 2.7)
    ),
    "lane-width": lambda: changed(on_axis([(300.0, 0.0, 0.0)]), ("carriageway-right/lanes/0/width", 2.9)),
    "plant-distance": lambda: with_things(
        hedge={"type": "Hedge", "start_station": 100.0, "end_station": 130.0, "offset": -5.7, "width": 1.2}
    ),
    "entrance-gap": lambda: with_things(entrance=ENTRANCE | {"offset": -4.5}),
    "entrance-class": lambda: with_things("RQ15.5", entrance=ENTRANCE | {"offset": -7.75}),
    "danger-sign-distance": lambda: with_things(sign=CURVE_SIGN | {"station": 110.0}),
    "obstacle-barrier": lambda: with_things(tree=TREE),
    "tree-distance": lambda: changed(
        on_axis([(300.0, 0.0, 0.0)], trees_per_hectare=40.0, vegetation={"trees": ["maple"]}),
        ("tree-maple/band_start", 5.0),
    ),
}
"""Rule -> a road of EKL 3 that breaks it."""
OF_COUNTRY_ROADS = {
    *("vertical-tangent", "stopping-sight", "centre-line-missing", "centre-line-narrow"),
    *("plant-distance", "entrance-gap", "entrance-class", "danger-sign-distance"),
}
"""Rules that motorways don't have."""


def test_every_rule_of_country_roads_has_a_planted_breach() -> None:
    assert set(BREACHES) >= OF_COUNTRY_ROADS


@pytest.mark.parametrize("rule", BREACHES)
def test_a_planted_breach_is_found_with_its_source_and_how_sure_it_is(rule: str) -> None:
    found = [violation for violation in check(BREACHES[rule]()) if violation.rule == rule]
    assert found
    texts = {violation.text for violation in found}
    assert not any("RAA" in text for text in texts), texts
    if rule in ("entrance-gap",):  # which follows from what an entrance is
        assert texts
    elif rule != "lane-width":  # whose source are the sections that the message names
        assert all("confirmed" in text or "derived" in text for text in texts), texts
    else:
        assert all("RQ9.5" in text for text in texts)


def test_edges_that_keep_the_rules_are_not_reported() -> None:
    """Things farther away, at the pavement's edge, or before the rules keep them; so do roads without limits."""
    kept = with_things(
        hedge={"type": "Hedge", "start_station": 100.0, "end_station": 130.0, "offset": -5.9, "width": 1.2},
        entrance=ENTRANCE,
        sign=CURVE_SIGN | {"station": 260.0},
        tree=TREE | {"station": 200.0, "stock": True},
    )
    rules = {"plant-distance", "entrance-gap", "entrance-class", "danger-sign-distance", "obstacle-barrier"}
    assert not rules & {violation.rule for violation in check(kept)}
    low = with_things(tree=TREE | {"stock": True, "crown_bottom": 4.4, "offset": -6.5})
    assert [v.limit for v in check(low) if v.rule == "plant-distance"] == [4.5]


def test_every_quantity_of_a_country_road_says_how_it_is_used_and_how_sure_it_is() -> None:
    for name, row in GUIDELINES["RAL"].quantities.items():
        assert row.source, name
        assert (row.use == "limit") == (row.sure in ("confirmed", "derived")) or name == "unsigned_speed", name


def test_defaults_of_the_guideline_give_way_to_what_is_given() -> None:
    plain = RoadScenario.from_dict({"design_class": "EKL3"})
    assert not plain.furniture.emergency_phones
    assert plain.turnouts.exits == 0.0
    given = RoadScenario.from_dict({"design_class": "EKL3", "furniture": {"emergency_phones": True}})
    assert given.furniture.emergency_phones
    assert not given.furniture.kilometre_boards
    assert RoadScenario.from_dict(plain.to_dict()) == plain
    assert RoadScenario.from_dict({"design_class": "EKA3"}).furniture.emergency_phones


@pytest.mark.parametrize(
    ("limits", "named"),
    [
        ({"turnouts": {"exits": 0.5}}, "turnouts.exits"),
        ({"lane_changes": {"share": 0.5}}, "lane_changes.share"),
        ({"median_width": 3.0}, "median_width"),
        ({"cross_section": {"lanes": [3.0]}}, "by hand"),
        ({"cross_section": "RQ31"}, "RQ11"),
        ({"radius": {"minimum": 200.0, "maximum": 300.0}}, "radius.minimum"),
    ],
)
def test_what_one_carriageway_cannot_have_is_refused(limits: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        sample_road(RoadScenario.from_dict({"design_class": "EKL3", **limits}), 1)


def test_a_class_is_of_one_guideline_and_its_sections_are_in_the_table() -> None:
    assert [name for name in GUIDELINE_OF_CLASS if not is_single(name)] == list(DUAL_CLASSES)
    assert {section for names in SECTIONS_OF_CLASS.values() for section in names} == set(STANDARD_CROSS_SECTIONS)


def test_the_sight_is_written_as_csv(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parameters = on_axis([(500.0, 0.0, 0.0), (400.0, 1 / 300, 1 / 300), (500.0, 0.0, 0.0)])
    (tmp_path / "road.json").write_text(parameters.to_json())
    main(["check", str(tmp_path / "road.json"), "--sight", str(tmp_path / "sight.csv")])
    head, *rows = (tmp_path / "sight.csv").read_text().splitlines()
    assert head == "station,sight_ahead,sight_back,stopping_sight,overtaking_sight"
    table = [[float(cell) if cell else np.inf for cell in row.split(",")] for row in rows]
    station, ahead, back, stopping, overtaking = np.array(table).T
    assert station.tolist() == [10.0 * number for number in range(141)]
    assert set(overtaking) == {600.0}
    assert stopping[0] == pytest.approx(LIMITS["EKL3"].stopping_sight, abs=0.05)
    # In the arc the chord leaves the clear width of 4 + 7.5 m, in either direction as far.
    expected = np.sqrt(8.0 * 300.0 * 11.5)
    assert ahead[60] == pytest.approx(expected, abs=10.0)
    assert back[80] == pytest.approx(expected, abs=10.0)
    assert np.isinf(ahead[-1])
    motorway = sample_road(RoadScenario(length=300.0), 1)
    (tmp_path / "motorway.json").write_text(motorway.to_json())
    assert main(["check", str(tmp_path / "motorway.json"), "--sight", str(tmp_path / "none.csv")]) == 2
    assert "no sight for stopping is known" in capsys.readouterr().err
