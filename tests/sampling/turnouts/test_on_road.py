"""An exit, entry or bay more on a road that is there, changed and deleted: what belongs to it, what makes way."""

from __future__ import annotations

from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import EXIT_SEQUENCE
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Arrow, Hatching, LineMarking, Turnout
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.sampling.turnouts.on_road import place_of, with_changed_turnout, with_turnout, without_turnout
from synthroads_addon.scenario.road import RoadScenario, StatedTurnout

LENGTH = 1600.0
NONE = {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0}
KINDS = ("exit", "entry", "emergency_bay")
SIDES = ("left", "right")
SEEDS = (0, 3, 4)
STATION = 700.0


def bare_road(seed: int, **values: Any) -> RoadParameters:
    """Return a sampled motorway without turnouts, construction zones and lanes that change."""
    fields: dict[str, Any] = {"furniture": {"construction_zone": 0.0}, "lane_changes": {"share": 0.0}} | values
    return sample_road(RoadScenario(length=LENGTH, turnouts=NONE, **fields), seed)


def place(kind: str = "exit", side: str = "right", station: float = STATION, **sizes: float) -> StatedTurnout:
    """Return a stated turnout."""
    return StatedTurnout(kind=kind, side=side, station=station, **sizes)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("side", SIDES)
def test_a_road_with_one_more_keeps_all_rules(seed: int, kind: str, side: str) -> None:
    road = bare_road(seed)
    changed = with_turnout(road, place(kind, side))
    turnout = changed.parameters.of_type(Turnout)[changed.name]
    assert (turnout.start_station, turnout.kind) == (STATION, kind)
    assert check(changed.parameters) == []
    numbers = [item.instance for item in changed.parameters.objects.values()]
    assert len(set(numbers)) == len(numbers)
    for name, item in changed.parameters.objects.items():
        if name in road.objects:
            assert item.instance == road.objects[name].instance, name


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("side", SIDES)
def test_deleting_it_gives_the_road_of_before_but_for_what_was_left_out(kind: str, side: str) -> None:
    road = bare_road(4)
    changed = with_turnout(road, place(kind, side))
    assert changed.parameters.objects != road.objects
    again = without_turnout(changed.parameters, changed.name)
    differing = [
        name for name in road.objects | again.parameters.objects
        if road.objects.get(name) != again.parameters.objects.get(name)
    ]  # fmt: skip
    told = " ".join(changed.notes)
    assert all(name in told or name.startswith("sign-") for name in differing), differing
    assert check(again.parameters) == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_moved_one_keeps_all_rules_its_id_number_and_texts(kind: str) -> None:
    first = with_turnout(bare_road(4), place(kind))
    texts = {
        name: item.model_copy(update={"text": ("Neu",) * len(item.text)})
        for name, item in first.parameters.of_type(TrafficSign).items()
        if name.startswith(first.name)
    }
    own = first.parameters.model_copy(update={"objects": first.parameters.objects | texts})
    moved = with_changed_turnout(own, first.name, place(kind, station=640.0))
    turnout, before = (road.parameters.of_type(Turnout)[first.name] for road in (moved, first))
    assert (turnout.start_station, turnout.instance) == (640.0, before.instance)
    assert check(moved.parameters) == []
    signs = [item for name, item in moved.parameters.of_type(TrafficSign).items() if name.startswith(first.name)]
    assert {line for sign in signs for line in sign.text} <= {"Neu"}
    assert bool(signs) == (kind != "emergency_bay")


def test_an_exit_has_its_markings_and_signs_by_the_rules() -> None:
    road = bare_road(4)
    changed = with_turnout(road, place()).parameters
    lines = [item.kind for name, item in changed.of_type(LineMarking).items() if name not in road.objects]
    assert sorted(lines) == ["block", "gore_edge", "outer_edge", "turnout_edge"]
    assert [item.turnout for item in changed.of_type(Hatching).values()] == ["exit-right"]
    assert len([name for name in changed.of_type(Arrow) if name not in road.objects]) >= 3
    ahead = {distance: code for distance, code in EXIT_SEQUENCE.items() if distance <= STATION}
    for distance, code in ahead.items():
        stations = [item.station for item in changed.of_type(TrafficSign).values() if item.code == code]
        assert stations == [pytest.approx(STATION - distance, abs=5.0)], code


def test_barriers_and_delineators_stand_outside_of_a_bay() -> None:
    road = bare_road(0)
    changed = with_turnout(road, place("emergency_bay", lane_length=60.0)).parameters
    geometry = RoadGeometry(changed)
    middle = STATION + 50.0
    edge = float(geometry.sections["right"].paved_edge(middle)[0])
    assert edge > float(RoadGeometry(road).sections["right"].paved_edge(middle)[0]) + 2.9
    rails = [item for item in changed.of_type(Guardrail).values() if item.offset < -6.0]
    there = [item for item in rails if item.start_station <= middle <= item.end_station]
    assert there
    assert all(-item.offset >= edge + 0.5 for item in there)
    posts = [item for item in changed.of_type(Delineator).values() if item.offset < 0.0]
    beside = [post for post in posts if STATION + 20.0 < post.station < STATION + 80.0]
    assert beside
    assert all(-post.offset >= edge + 0.5 for post in beside)


def test_one_more_leaves_what_an_other_one_has_opened() -> None:
    """On the other side, and farther along on the same one."""
    road = bare_road(7)
    first = with_turnout(road, place(station=400.0))
    assert "fence-right-1 is opened" in " ".join(first.notes)
    for other in (place("entry", "left", 500.0), place("emergency_bay", station=150.0)):
        second = with_turnout(first.parameters, other).parameters
        for name, item in first.parameters.objects.items():
            if name.startswith(("fence-right", "guardrail-right")) and item.start_station > 300.0:
                assert second.objects[name] == item, name


def test_sizes_are_taken_as_stated_and_read_back() -> None:
    sizes = {
        "taper_length": 45.0,
        "lane_length": 300.0,
        "lane_width": 3.75,
        "ramp_length": 95.0,
        "ramp_clothoid": 100.0,
    }
    changed = with_turnout(bare_road(4), place(**sizes))
    assert place_of(changed.parameters, changed.name) == place(**sizes)


@pytest.mark.parametrize(
    ("stated", "reason"),
    [
        (place(station=1500.0), "reaches beyond the road's end: choose a station from 0 to 1205 m"),
        (place("entry", station=10.0), "choose a station from 30 to"),
        (
            place("entry", station=400.0),
            r"less than 20 m from exit-right \(RAA\): choose a station of at most 315 m or",
        ),
        (place(station=1090.0, ramp_length=120.0, ramp_clothoid=50.0), "the ramp leaves the road by 115.2 m"),
        (place("entry", station=1090.0, ramp_clothoid=400.0), "doesn't reach 10 m behind its nose: make it"),
    ],
)
def test_what_does_not_fit_is_refused_with_reason_and_remedy(stated: StatedTurnout, reason: str) -> None:
    road = with_turnout(bare_road(4), place()).parameters
    with pytest.raises(InputError, match=reason) as error:
        with_turnout(road, stated)
    assert "\n" not in str(error.value)


def refusals(road: RoadParameters) -> str:
    """Return the messages of exits on the right that don't fit, every 100 m."""
    messages = []
    for station in range(100, 1100, 100):
        try:
            with_turnout(road, place(station=float(station)))
        except InputError as error:
            messages.append(str(error))
    return "\n".join(messages)


def test_construction_zones_and_lanes_refuse_it() -> None:
    zone = bare_road(2, furniture={"construction_zone": 1.0})
    assert "choose a station farther than 20 m from it, or delete its beacons" in refusals(zone)
    assert "begins or ends from" in refusals(bare_road(2, cross_section="RQ36", lane_changes={"share": 1.0}))


def test_a_country_road_and_unknown_ids_are_refused() -> None:
    country = bare_road(2, design_class="EKL3", furniture={})
    with pytest.raises(InputError, match="they are for motorways"):
        with_turnout(country, place())
    with pytest.raises(InputError, match="the road has none"):
        without_turnout(bare_road(4), "exit-right")
    with pytest.raises(InputError, match="must be one of exit-right"):
        without_turnout(with_turnout(bare_road(4), place()).parameters, "exit-left")


def test_sizes_below_the_guidelines_and_missing_signs_are_told() -> None:
    notes = with_turnout(bare_road(4), place(lane_length=100.0)).notes
    assert any("the exit's lane's length is 100 m: 250 m are needed (RAA)" in note for note in notes)
    bay = with_turnout(bare_road(4), place("emergency_bay"))
    assert any("add one by Add > SynthRoads > Traffic Sign" in note for note in bay.notes)
