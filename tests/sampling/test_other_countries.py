"""Roads of other countries, by files of guidelines: what is drawn, traffic on the left, breaches, one's own file."""

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import PRESETS
from synthroads_addon.blender.views.viewpoints import driver_view
from synthroads_addon.checking.checker import check
from synthroads_addon.road.axes.sight import DASHED, SOLID, WARNING, LineSights, line_spans
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import (
    GUIDELINE_OF_CLASS,
    GUIDELINES,
    LIMITS,
    OWN_GUIDELINES,
    SECTIONS_OF_CLASS,
    guideline_files,
    read_guidelines,
)
from synthroads_addon.road.lane_lines import LaneLine
from synthroads_addon.road.network.patches import side_road_paint
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking, Turnout
from synthroads_addon.road.side_roads.side_road import SideRoad
from synthroads_addon.road.streets.street_side import StreetSide
from synthroads_addon.road.surroundings import Vehicle
from synthroads_addon.road.things.field_entrance import FieldEntrance
from synthroads_addon.road.things.gantry import GantrySign
from synthroads_addon.road.things.pole import Pole
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.road.things.sign_catalogue import sign_catalogue, signs_of_country
from synthroads_addon.sampling.placing.single import thing_by_rule
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.platforms.guides import RoadGuide
from synthroads_addon.scenario.road import RoadScenario
from tests.sampling.test_country_roads import axis_of, changed

REPOSITORY = Path(__file__).parents[2]
EXAMPLE = REPOSITORY / "docs" / "example-guideline.json"
OTHERS = [name for name in GUIDELINE_OF_CLASS if GUIDELINE_OF_CLASS[name].country != "DE"]
ROADS = [(name, section) for name in OTHERS for section in SECTIONS_OF_CLASS[name]]
ENTRANCES = {"minimum": 4.0, "maximum": 8.0}
SIDE_ROADS = {"side_roads": {"per_km": {"minimum": 4.0, "maximum": 4.0}}}
OLDER = [("EKL3", "RQ9.5"), ("EKL4", "RQ7.5"), ("EKL4", "W5.5")]


def road(design_class: str, seed: int = 1, length: float = 1500.0, **limits: Any) -> RoadParameters:
    return sample_road(RoadScenario.from_dict({"design_class": design_class, "length": length, **limits}), seed)


def straight_road(design_class: str, **limits: Any) -> RoadParameters:
    scenario = RoadScenario.from_dict({"design_class": design_class, "trees_per_hectare": 0.0, **limits})
    return sample_road(scenario, 1, axis=axis_of([(600.0, 0.0, 0.0)], [(0.0, 0.0, 0.0)]))


@pytest.mark.parametrize(("design_class", "section"), [*ROADS, *OLDER])
def test_drawn_roads_break_no_rule(design_class: str, section: str) -> None:
    for seed in range(20):
        assert check(road(design_class, seed, 600.0, cross_section=section)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("design_class", "section"), [*ROADS, *OLDER])
def test_five_hundred_drawn_roads_break_no_rule(design_class: str, section: str) -> None:
    for seed in range(500):
        assert check(road(design_class, seed, 600.0, cross_section=section)) == []


def test_no_code_names_a_country() -> None:
    """Guidelines, their classes, sections and signs are in files alone; German ones are the defaults of fields."""
    names = {*GUIDELINES, *OTHERS, *(section for _, section in ROADS)} - {"RAA", "RAL", "S2"}
    names |= {code for name in OTHERS for code in GUIDELINE_OF_CLASS[name].signs}
    for folder in ("synthroads_addon", "headless", "ml"):
        for path in (REPOSITORY / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            assert not [name for name in names if f'"{name}"' in text], path


def test_every_quantity_says_where_it_is_from() -> None:
    for guideline in GUIDELINES.values():
        assert guideline.traffic.source
        for name, row in guideline.quantities.items() if guideline.country != "DE" else ():
            assert row.source, (guideline.name, name)
            assert ("from memory" in row.source) <= (row.sure == "unconfirmed"), (guideline.name, name)


# --- on the left ------------------------------------------------------------------------------------------------------


def test_who_drives_on_the_left_goes_with_the_stations_there() -> None:
    parameters = road("DMRB85", vehicles={"per_km": {"minimum": 8.0, "maximum": 8.0}})
    left, right = (parameters.carriageway(side) for side in ("left", "right"))
    assert left is not None
    assert right is not None
    assert parameters.traffic_side == "left"
    assert (left.traffic, right.traffic) == (1, -1)
    vehicles = list(parameters.of_type(Vehicle).values())
    assert {vehicle.carriageway for vehicle in vehicles} == {"carriageway-left", "carriageway-right"}
    geometry = RoadGeometry(parameters)
    offset = float(LaneLine(geometry, left, 0).offset(np.array([100.0]))[0])
    assert offset > 0.0
    # A driver, and a vehicle with a scanner, first go along the left lane.
    view = driver_view(parameters)
    ahead = geometry.alignment.project(np.array([view.place[:2], view.target[:2]]))
    assert ahead[0][1] > ahead[0][0]
    assert (ahead[1] > 0.0).all()
    assert RoadGuide(geometry).driving_offsets()[0] == pytest.approx(offset, abs=0.01)


def test_signs_stand_on_the_left_and_face_who_comes() -> None:
    for design_class, side in (("DMRB85", 1.0), ("R80", -1.0)):
        signs = [sign for seed in range(4) for sign in road(design_class, seed, 2500.0).of_type(TrafficSign).values()]
        assert len(signs) > 2
        for sign in signs:
            with_stations = sign.rotation_deg == 0.0
            assert sign.offset * (side if with_stations else -side) > 0.0
            assert sign.code.startswith(f"{GUIDELINE_OF_CLASS[design_class].country}.")


def test_a_curve_to_the_left_is_announced_as_one_to_who_drives_either_way() -> None:
    arc = axis_of(
        [(700.0, 0.0, 0.0), (60.0, 0.0, 1 / 400), (200.0, 1 / 400, 1 / 400), (60.0, 1 / 400, 0.0), (700.0, 0.0, 0.0)],
        [(0.0, 0.0, 0.0)],
    )
    parameters = sample_road(RoadScenario.from_dict({"design_class": "DMRB85"}), 1, axis=arc)
    codes = {sign.rotation_deg: sign.code for sign in parameters.of_type(TrafficSign).values()}
    assert codes == {0.0: "GB.512-L", 180.0: "GB.512-R"}


def test_the_side_is_the_scenarios_where_that_gives_one() -> None:
    mirrored = straight_road("EKL3", traffic_side="left")
    assert mirrored.traffic_side == "left"
    assert [violation.rule for violation in check(mirrored)] == ["traffic-side", "traffic-side"]
    assert straight_road("DMRB85", traffic_side="right").traffic_side == "right"
    usual = straight_road("EKL3")
    assert "traffic_side" not in usual.to_json()


def test_both_carriageways_keep_to_one_side() -> None:
    with pytest.raises(InputError, match="traffic_side must be the same"):
        changed(straight_road("DMRB85"), ("carriageway-left/traffic_side", "right"))


def test_motorways_can_be_driven_on_the_left() -> None:
    parameters = road("EKA1B", 2, 4000.0, traffic_side="left", turnouts={"exits": 1.0}, furniture={"gantries": 1.0})
    assert {violation.rule for violation in check(parameters)} <= {"traffic-side"}
    arrows = [item for name, item in parameters.objects.items() if "arrow" in name]
    assert {arrow.kind for arrow in arrows} == {"straight_left"}
    for item in parameters.objects.values():
        for sign in getattr(item, "signs", ()):
            assert isinstance(sign, GantrySign)
            assert sign.facing == (1.0 if sign.offset > 0.0 else -1.0)


# --- lines ------------------------------------------------------------------------------------------------------------


def test_lines_are_as_the_guideline_has_them() -> None:
    seen: dict[str, set[tuple[float, float, float]]] = {}
    for design_class in ("DMRB100", "R80"):
        for parameters in (crest_road(design_class), road(design_class, 3, 2500.0)):
            for name, line in parameters.of_type(LineMarking).items():
                kind = "centre" if name.startswith("centre") else line.kind
                seen.setdefault(f"{design_class} {kind}", set()).add((line.width, line.dash_length, line.gap_length))
    assert seen["DMRB100 outer_edge"] == {(0.15, 0.0, 0.0)}
    assert seen["DMRB100 centre"] == {(0.1, 3.0, 6.0), (0.1, 6.0, 3.0), (0.1, 0.0, 0.0)}
    assert seen["R80 outer_edge"] == {(0.18, 3.0, 3.5)}
    assert seen["R80 centre"] == {(0.12, 3.0, 10.0), (0.12, 3.0, 1.33), (0.18, 0.0, 0.0)}


CREST = [(0.0, 0.0, 0.0), (700.0, 35.0, 1800.0), (1400.0, 0.0, 0.0)]
"""A sharp crest: drivers see sqrt(2 * 1800) * (1 + sqrt(0.5)), 102 m, past it."""


def test_warning_dashes_lead_to_the_solid_lines_at_a_crest() -> None:
    axis = axis_of([(1400.0, 0.0, 0.0)], CREST)
    spans = line_spans(axis, 4.0, LineSights(240.0, 150.0, 60.0, True), 1400.0)
    assert [kind for *_, kind in spans] == [DASHED, WARNING, SOLID, WARNING, DASHED]
    assert all(end == start for (_, end, _), (start, *_) in pairwise(spans))
    assert (spans[0][0], spans[-1][1]) == (0.0, 1400.0)
    assert spans[1][1] - spans[1][0] >= 60.0
    # Without warning dashes the line is solid where it isn't dashed.
    assert [kind for *_, kind in line_spans(axis, 4.0, LineSights(240.0), 1400.0)] == [DASHED, SOLID, DASHED]


def crest_road(design_class: str = "DMRB85") -> RoadParameters:
    scenario = RoadScenario.from_dict({"design_class": design_class, "trees_per_hectare": 0.0})
    return sample_road(scenario, 1, axis=axis_of([(1400.0, 0.0, 0.0)], CREST))


def test_two_solid_lines_lie_beside_each_other() -> None:
    lines = {
        name: line
        for name, line in crest_road().of_type(LineMarking).items()
        if line.kind == "free" and not line.dash_length
    }
    assert sorted(line.carriageway for line in lines.values()) == ["carriageway-left", "carriageway-right"]
    assert {line.offset for line in lines.values()} == {0.1375}  # (0.175 + 0.1) / 2
    assert len({(line.start_station, line.end_station) for line in lines.values()}) == 1


# --- planted breaches -------------------------------------------------------------------------------------------------


def _solid_line(parameters: RoadParameters) -> str:
    lines = parameters.of_type(LineMarking).items()
    return next(name for name, line in lines if line.kind == "free" and not line.dash_length)


def _moved_line() -> RoadParameters:
    parameters = crest_road()
    return changed(parameters, (f"{_solid_line(parameters)}/offset", 0.2))


BREACHES = {
    "traffic-side": lambda: changed(
        straight_road("DMRB85"),
        ("carriageway-left/traffic_side", "right"),
        ("carriageway-right/traffic_side", "right"),
    ),
    "marking-pattern": lambda: changed(straight_road("DMRB85"), ("centre-line/dash_length", 4.0)),
    "marking-width": lambda: changed(straight_road("DMRB85"), ("centre-line/width", 0.12)),
    "double-line-gap": _moved_line,
    "centre-line-narrow": lambda: changed(
        straight_road("DMRB70"), *((f"carriageway-{side}/lanes/0/width", 2.7) for side in ("left", "right"))
    ),
    "radius-minimum": lambda: sample_road(
        RoadScenario.from_dict({"design_class": "DMRB85"}),
        1,
        axis=axis_of([(100.0, 0.0, 0.0), (60.0, 0.0, 1 / 200), (100.0, 1 / 200, 1 / 200)], [(0.0, 0.0, 0.0)]),
    ),
    "crest-radius": crest_road,
}


@pytest.mark.parametrize("rule", BREACHES)
def test_a_planted_breach_is_found_with_its_source_and_how_sure_it_is(rule: str) -> None:
    texts = [violation.text for violation in check(BREACHES[rule]()) if violation.rule == rule]
    assert texts
    assert all("confirmed" in text or "derived" in text for text in texts), texts
    assert not any("RMS" in text or "RAL" in text for text in texts), texts


def test_what_is_from_memory_says_so() -> None:
    axis = axis_of([(100.0, 0.0, 0.0), (60.0, 0.0, 1 / 200), (100.0, 1 / 200, 1 / 200)], [(0.0, 0.0, 0.0)])
    found = check(sample_road(RoadScenario.from_dict({"design_class": "R80"}), 1, axis=axis))
    (text,) = {violation.text for violation in found if violation.rule == "radius-minimum"}
    assert "from memory; unconfirmed" in text


# --- signs and files --------------------------------------------------------------------------------------------------


def test_signs_are_of_their_country() -> None:
    assert set(signs_of_country("DE", rural=True)) == set(json.loads((PRESETS / "signs.json").read_text())["signs"])
    assert "GB.670-50" in signs_of_country("GB", rural=True)
    entry = sign_catalogue().signs["GB.670-50"]
    sign = TrafficSign(instance=1, station=0.0, offset=0.0, code="GB.670-50", text=entry.text, **entry.fields())
    signal = sign.signals()["face"]
    assert (signal.country, signal.type, signal.subtype) == ("GB", "670", "50")
    assert (signal.speed, signal.speed_unit) == (50.0, "mph")
    for seed in range(3):
        signs = road("DMRB85", seed, placement="random").of_type(TrafficSign).values()
        assert {sign.code[:3] for sign in signs} <= {"GB."}
        assert signs


def test_every_role_names_a_sign_of_the_catalogue() -> None:
    for guideline in GUIDELINES.values():
        assert set(guideline.sign_roles.values()) <= set(signs_of_country(guideline.country, rural=True))


def test_a_guideline_of_ones_own_is_read_from_a_folder_elsewhere(tmp_path: Path) -> None:
    """The example of the documentation, in a folder of the user's, adds its class to all that lists or checks one."""
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "norway.json").write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
    program = (
        "from synthroads_addon import sample_road\n"
        "from synthroads_addon.checking.checker import check\n"
        "from synthroads_addon.road.section import LineMarking\n"
        "from synthroads_addon.scenario.road import RoadScenario\n"
        "road = sample_road(RoadScenario.from_dict({'design_class': 'NO80', 'length': 900.0}), 1)\n"
        "print(check(road), sorted({line.color for line in road.of_type(LineMarking).values()}))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    run = [sys.executable, "-c", program]
    assert "NO80" not in LIMITS
    refused = subprocess.run(run, env=environment, capture_output=True, text=True, check=False)
    assert refused.returncode != 0
    environment[OWN_GUIDELINES] = str(tmp_path / "own")
    done = subprocess.run(run, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "[] ['white', 'yellow']", done.stderr


def test_a_guideline_that_cannot_be_is_refused_in_one_line(tmp_path: Path) -> None:
    shipped = PRESETS / "guidelines" / "arp.json"
    with pytest.raises(MissingFileError, match=OWN_GUIDELINES):
        guideline_files(str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match=r"arp\.json has that already"):
        read_guidelines([shipped, shipped])
    data = json.loads(shipped.read_text(encoding="utf-8"))
    del data["traffic"]
    (tmp_path / "wrong.json").write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(InputError, match="traffic"):
        read_guidelines(guideline_files(str(tmp_path / "wrong.json"))[-1:])


# --- beside country roads of other countries, and where traffic keeps left --------------------------------------------


@pytest.mark.parametrize("design_class", ["DMRB85", "DMRB70", "R80", "R60"])
def test_no_sign_of_another_country_stands_beside_a_road(design_class: str) -> None:
    everything = {
        "turnouts": {"bus_bays": 1.0},
        "furniture": {"town_signs": 1.0, "entrances_per_km": {"minimum": 10.0, "maximum": 10.0}, "tracks": 1.0},
    }
    for seed in range(4):
        parameters = road(design_class, seed, 2000.0, **everything)
        assert any(turnout.kind == "bus_bay" for turnout in parameters.of_type(Turnout).values())
        codes = {sign.code for sign in parameters.of_type(TrafficSign).values()}
        assert not [code for code in codes if not code.startswith(f"{GUIDELINE_OF_CLASS[design_class].country}.")]


@pytest.mark.parametrize(
    ("design_class", "code"),
    [
        ("EKA1A", "274-120"),
        ("EKL3", "274-80"),
        ("DMRB85", "GB.670-50"),
        ("DMRB100", "GB.670-60"),
        ("R80", "FR.B14-70"),
        ("R60", "FR.B14-50"),
    ],
)
def test_a_sign_placed_by_hand_is_a_limit_of_the_country_that_the_class_is_designed_for(
    design_class: str, code: str
) -> None:
    geometry = RoadGeometry(road(design_class, length=300.0))
    sign = thing_by_rule(geometry, "TrafficSign", "right", 120.0, {})
    assert isinstance(sign, TrafficSign)
    known = sign_catalogue().signs[code]
    assert (sign.code, sign.text, sign.width) == (code, known.text, known.width)
    given = thing_by_rule(geometry, "TrafficSign", "right", 120.0, {"code": "448"})
    assert isinstance(given, TrafficSign)
    assert given.code == "448"


def test_each_tight_curve_of_a_german_road_is_announced_once_and_has_boards() -> None:
    arc = axis_of(
        [(700.0, 0.0, 0.0), (60.0, 0.0, 1 / 300), (150.0, 1 / 300, 1 / 300), (60.0, 1 / 300, 0.0), (700.0, 0.0, 0.0)],
        [(0.0, 0.0, 0.0)],
    )
    parameters = sample_road(RoadScenario.from_dict({"design_class": "EKL3"}), 1, axis=arc)
    codes = sorted(sign.code for sign in parameters.of_type(TrafficSign).values())
    assert [code for code in codes if not code.startswith("625")] == ["103-10", "103-20", "274-70", "274-70"]
    assert {code for code in codes if code.startswith("625")} == {"625-10", "625-20"}


@pytest.mark.parametrize(
    ("scenario", "named"),
    [
        ({"design_class": "R80", "lane_changes": {"share": 0.5}}, "road.lane_changes.share is 0.5, R80 has none"),
        ({"design_class": "DMRB85", "turnouts": {"exits": 1.0}}, "turnouts.exits is 1, DMRB85 has none"),
    ],
)
def test_what_another_country_cannot_have_is_refused_with_the_remedy(scenario: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named) as caught:
        sample_road(RoadScenario.from_dict(scenario), 1)
    assert "road.road." not in str(caught.value)


@pytest.mark.parametrize("design_class", ["R80", "R60", "DMRB85", "DMRB70"])
def test_side_roads_and_villages_of_other_countries_keep_the_rules(design_class: str) -> None:
    """Whoever comes from a side road keeps to the country's side, and has its signs."""
    limits = {**SIDE_ROADS, "villages": {"share": 1.0}, "furniture": {"entrances_per_km": ENTRANCES}}
    codes: set[str] = set()
    for seed in range(3):
        parameters = road(design_class, seed, **limits)
        assert check(parameters) == []
        assert parameters.of_type(SideRoad)
        assert parameters.of_type(StreetSide)
        codes |= {sign.code for sign in parameters.of_type(TrafficSign).values()}
    roles = GUIDELINE_OF_CLASS[design_class].sign_roles
    assert codes >= {roles["give_way"], roles["town_begin"], roles["town_end"]}


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("traffic_side", ["left", "right"])
def test_the_line_for_giving_way_lies_across_the_lane_of_those_who_come(side: str, traffic_side: str) -> None:
    parameters = straight_road("EKL3", traffic_side=traffic_side)
    own = {"type": "SideRoad", "instance": 9999, "carriageway": f"carriageway-{side}", "station": 300.0}
    data = json.loads(parameters.to_json())
    data["objects"]["mouth"] = own | {"centre_line": False, "edge_lines": False}
    geometry = RoadGeometry(RoadParameters.from_dict(data))
    mouth = geometry.mouths["mouth"]
    station, offset = np.concatenate(side_road_paint(geometry, mouth)).T
    u, v = mouth.local(mouth.plan(station, mouth.depth(station, offset)))
    assert (u > 0.0).all()
    # Seen by those who come, against the axis, their own side is that of the traffic.
    their_right = np.array([-mouth.ahead[1], mouth.ahead[0]])
    right = v[:, None] * mouth.across @ their_right
    assert (right < 0.0).all() if traffic_side == "left" else (right > 0.0).all()


def test_lines_at_mouths_and_in_villages_are_the_guidelines() -> None:
    """Britain has two rows of blocks of 0.6 m, and dashes of 2 m in villages; France squares of 0.5 m."""
    pieces = {}
    for design_class in ("DMRB85", "R80"):
        data = json.loads(straight_road(design_class).to_json())
        own = {"type": "SideRoad", "instance": 9999, "carriageway": "carriageway-left", "station": 300.0}
        data["objects"]["mouth"] = own | {"centre_line": False, "edge_lines": False}
        geometry = RoadGeometry(RoadParameters.from_dict(data))
        mouth = geometry.mouths["mouth"]
        quads = side_road_paint(geometry, mouth)
        pieces[design_class] = {
            (round(float(np.ptp(depth)), 3), round(float(depth.min()), 1))
            for depth in (mouth.depth(q[:, 0], q[:, 1]) for q in quads)
        }
    assert {depth for depth, _ in pieces["DMRB85"]} == {0.2}
    assert len({row for _, row in pieces["DMRB85"]}) >= 2
    assert {depth for depth, _ in pieces["R80"]} == {0.5}
    village = road("DMRB85", 1, 600.0, villages={"share": 1.0})
    start, end = next((s.start_station, s.end_station) for s in village.of_type(StreetSide).values())
    inside = [m for m in village.of_type(LineMarking).values() if start <= m.start_station and m.end_station <= end]
    assert {(m.dash_length, m.gap_length) for m in inside if m.dash_length} == {(2.0, 4.0)}


def test_entrances_placed_by_hand_are_allowed() -> None:
    for design_class in ("DMRB85", "R80"):
        data = json.loads(straight_road(design_class).to_json())
        edge = RoadGeometry(RoadParameters.from_dict(data)).sections["right"].paved_edge(np.array([300.0]))[0]
        place = {"station": 300.0, "offset": -float(edge), "rotation_deg": 0.0}
        data["objects"]["gate"] = {"type": "FieldEntrance", "instance": 9999, "width": 5.0, "depth": 8.0, **place}
        found = [item for item in check(RoadParameters.from_dict(data)) if item.object == "gate"]
        assert [item.rule for item in found if item.rule == "entrance-class"] == []


@pytest.mark.parametrize("traffic_side", ["right", "left"])
def test_entrances_lights_and_signposts_are_on_their_side_of_the_road(traffic_side: str) -> None:
    limits = {"entrances_per_km": {"minimum": 12.0, "maximum": 12.0}, "tracks": 1.0}
    parameters = road("EKL3", 2, 1500.0, traffic_side=traffic_side, furniture=limits)
    lit = road("EKL3", 2, 1500.0, traffic_side=traffic_side, furniture={"lighting": 1.0})
    parameters_of_village = road("EKL3", 2, 500.0, traffic_side=traffic_side, villages={"share": 1.0})
    entrances = list(parameters.of_type(FieldEntrance).values())
    assert {entrance.offset > 0.0 for entrance in entrances} == {True, False}
    for entrance in entrances:  # it lies to the right of its direction
        assert (entrance.rotation_deg == 0.0) == (entrance.offset < 0.0)
    for place in (lit, parameters_of_village):
        lights = [pole for pole in place.of_type(Pole).values() if pole.kind == "lighting"]
        assert lights
        for light in lights:  # its arm points to the left of its direction
            assert (light.rotation_deg == 0.0) == (light.offset < 0.0)
    posts = [sign for sign in parameters.of_type(TrafficSign).values() if sign.code.startswith("418")]
    assert posts
    for sign in posts:  # who goes with the stations has a track of the left side on the left
        assert (sign.code == "418-10") == ((sign.offset > 0.0) == (sign.rotation_deg == 0.0))
