"""Delineators, kilometre boards, emergency phones, cabinets, poles and traffic lights."""

from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.things.cabinet import Cabinet
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.kilometre_board import KilometreBoard
from synthroads_addon.road.things.pole import Pole
from synthroads_addon.road.things.traffic_light import TrafficLight
from tests.helpers.roads.sites import bay_at, beside, curve, entry_at, exit_at, make_site, of, place, straight

EDGE = 14.0
"""Distance of the outer paved edge of an RQ 31 from the centreline, m."""
POSTS: dict[str, Any] = {"furniture": {"delineators": True}}


# --- delineators --------------------------------------------------------------------------------------------------


def test_delineators_every_50_m_outside_of_both_carriageways() -> None:
    furniture = place(make_site(barriers={"roadside": False}, **POSTS))
    for side, sign, facing in (("right", -1.0, 0.0), ("left", 1.0, 180.0)):
        posts = beside(furniture, side, Delineator)
        assert [post.station for post in posts] == [25.0 + 50.0 * i for i in range(12)]
        assert {post.offset for post in posts} == {sign * (EDGE + 0.5)}
        assert {post.rotation_deg for post in posts} == {facing}


def test_delineators_stand_closer_in_curves() -> None:
    site = make_site(curve(-300.0), design_class="EKA3", cross_section="RQ25", **POSTS)
    stations = np.array([post.station for post in beside(place(site), "right", Delineator)])
    gaps = np.diff(stations)
    in_arc = (stations[:-1] > 850.0) & (stations[1:] < 1150.0)
    assert gaps[in_arc] == pytest.approx(20.0)
    # They come closer before the curve begins, and go apart behind it.
    assert gaps[stations[1:] < 700.0] == pytest.approx(50.0)
    assert gaps[-1] == pytest.approx(50.0)
    assert 19.9 < gaps.min() < gaps.max() < 50.1


def test_delineators_stand_behind_barriers_and_outside_of_turnouts() -> None:
    site = make_site(straight(1200.0), embankment=4.0, turnouts=[exit_at(400.0), bay_at(100.0)], **POSTS)
    furniture = place(site)
    rails = beside(furniture, "right", Guardrail)
    for post in beside(furniture, "right", Delineator):
        along = [rail for rail in rails if rail.start_station <= post.station <= rail.end_station]
        assert all(-post.offset - -rail.offset >= 0.45 - 1e-6 for rail in along)
        inner, outer = (float(e[0]) for e in site.sections["right"].boundaries_of("island", post.station))
        paved = float(site.sections["right"].paved_edge(post.station)[0])
        in_island = inner + 0.5 <= -post.offset <= outer - 0.5
        assert in_island or -post.offset >= paved + 0.5 - 1e-6
    beside_island = [p for p in beside(furniture, "right", Delineator) if p.station == 775.0]
    assert -beside_island[0].offset == pytest.approx(EDGE + 1.15)


# --- kilometre boards, phones, cabinets -----------------------------------------------------------------------------


def test_kilometre_boards_every_500_m_on_both_sides() -> None:
    rises = set()
    for seed in range(20):
        site = make_site(straight(3200.0), seed=seed, furniture={"kilometre_boards": True})
        furniture = place(site)
        right, left = beside(furniture, "right", KilometreBoard), beside(furniture, "left", KilometreBoard)
        assert [(b.station, b.text) for b in right] == [(b.station, b.text) for b in left]
        stations = np.array([board.station for board in right])
        kilometres = np.array([float(board.text.replace(",", ".")) for board in right])
        assert stations[0] < 500.0
        assert stations[-1] > 2700.0
        assert np.diff(stations) == pytest.approx(500.0)
        assert np.abs(np.diff(kilometres)) == pytest.approx(0.5)
        assert kilometres.min() > 0.0
        rises.add(bool(kilometres[1] > kilometres[0]))
        assert {b.text[-2:] for b in right} == {",0", ",5"}
        assert {b.rotation_deg for b in left} == {180.0}
    assert rises == {True, False}


def test_emergency_phones_in_pairs_every_2_km() -> None:
    firsts = []
    for seed in range(40):
        site = make_site(straight(7000.0), seed=seed, furniture={"emergency_phones": True, "kilometre_boards": True})
        furniture = place(site)
        right, left = ([c.station for c in beside(furniture, side, Cabinet)] for side in ("right", "left"))
        assert right == left
        assert np.diff(right) == pytest.approx(2000.0)
        firsts.append(right[0])
        boards = np.array([b.station for b in beside(furniture, "right", KilometreBoard)])
        assert all(np.abs(boards - station).min() >= 10.0 for station in right)
    assert min(firsts) < 250.0
    assert max(firsts) > 1750.0
    assert {c.kind for c in of(furniture, Cabinet).values()} == {"emergency_phone"}


def test_cabinets_per_km() -> None:
    per_km = {"cabinets_per_km": {"minimum": 2.0, "maximum": 4.0}}
    counts = [len(of(place(make_site(straight(2000.0), seed=s, furniture=per_km)), Cabinet)) for s in range(40)]
    assert min(counts) >= 4
    assert max(counts) <= 8
    assert np.mean(counts) == pytest.approx(6.0, abs=0.7)


# --- poles and traffic lights ---------------------------------------------------------------------------------------


def test_lighting_stands_behind_barriers() -> None:
    sides = set()
    for seed in range(30):
        site = make_site(straight(1500.0), seed=seed, turnouts=[bay_at(700.0)], furniture={"lighting": 1.0})
        furniture = place(site)
        lit = [side for side in ("right", "left") if beside(furniture, side, Pole)]
        sides.add(tuple(lit))
        for side in lit:
            poles = beside(furniture, side, Pole)
            gaps = np.diff([pole.station for pole in poles])
            assert 35.0 <= gaps.min() <= 50.0
            rail = beside(furniture, side, Guardrail)[0]
            assert all(abs(pole.offset) > abs(rail.offset) + 0.3 for pole in poles)
            assert len({pole.height for pole in poles}) == 1
            assert all(not 638.0 < pole.station < 862.0 for pole in poles if side == "right")
    assert sides == {("right", "left"), ("right",), ("left",)}


@pytest.mark.parametrize("side", ["right", "left"])
def test_traffic_lights_beside_entry_ramps(side: str) -> None:
    site = make_site(straight(1200.0), turnouts=[entry_at(400.0, side)], furniture={"traffic_lights": 1.0})
    (light,) = of(place(site), TrafficLight).values()
    turnout = site.turnouts["turnout-1"]
    ahead = 1.0 if side == "right" else -1.0
    assert 0.0 <= ahead * (site.shape(turnout).nose_station() - light.station) <= 20.0
    edge = float(site.sections[side].paved_edge(light.station)[0])
    assert edge + 1.0 < abs(light.offset) < edge + 3.0
    assert light.rotation_deg == (0.0 if side == "right" else 180.0)
    assert not of(place(make_site(turnouts=[exit_at(100.0)], furniture={"traffic_lights": 1.0})), TrafficLight)


def test_what_stands_at_a_ramps_end_stays_beside_the_main_road() -> None:
    """Behind a ramp's end, and in a wide island, small things stand at the main road and not far out."""
    for seed in range(150):
        site = make_site(turnouts=[exit_at(100.0)], seed=seed, furniture={"kilometre_boards": True})
        for board in beside(place(site), "right", KilometreBoard):
            if board.station > 480.0:
                assert -board.offset < EDGE + 3.0
