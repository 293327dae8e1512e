"""Rules for bridges and tunnels: drawn ones keep them, and each planted breach is found."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from synthroads_addon.checking.checker import check
from synthroads_addon.checking.rules.structures import RULES
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.structures.bridge import Bridge
from synthroads_addon.road.structures.tunnel import Tunnel
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.structures import changed, with_bridge, with_structure, with_tunnel

SECTIONS = ("RQ31", "RQ25", "RQ15.5", "RQ11", "RQ9")


def drawn(section: str, seed: int, length: float = 900.0) -> RoadParameters:
    """Return a drawn road with up to two bridges and one or two tunnels per km."""
    limits = {
        "bridges": {"per_km": {"minimum": 0.0, "maximum": 2.0}},
        "tunnels": {"per_km": {"minimum": 1.0, "maximum": 2.0}},
    }
    return sample_road(RoadScenario.from_dict({"cross_section": section, "length": length, **limits}), seed)


@pytest.mark.parametrize("section", SECTIONS)
def test_drawn_structures_break_no_rule(section: str) -> None:
    for seed in range(4):
        assert check(drawn(section, seed)) == []


def test_bridges_and_tunnels_are_drawn() -> None:
    kinds = {type(item) for seed in range(3) for item in drawn("RQ11", seed).objects.values()}
    assert {Bridge, Tunnel} <= kinds


def _second() -> RoadParameters:
    return changed(with_bridge(), "second", type="Bridge", start_station=146.0, end_station=180.0, barrier="h2")


def _narrow() -> RoadParameters:
    road = with_tunnel()
    for side in ("left", "right"):
        road = changed(road, f"carriageway-{side}", verge_width=0.9)
    return road


BREACHES: dict[str, tuple[Callable[[], RoadParameters], float, float]] = {
    "structure-within-road": (lambda: with_bridge(start_station=3.0, pier_stations=[]), 3.0, 0.0),
    "structure-apart": (_second, 4.0, 0.0),
    "bridge-barrier": (lambda: with_bridge(barrier="none"), 48.0, 0.0),
    "bridge-railing": (lambda: with_bridge(railing_height=0.9), 0.9, 1.0),
    "bridge-kerb": (lambda: with_bridge(kerb_height=0.2), 0.2, 0.15),
    "bridge-joint": (lambda: with_bridge(joint="none"), 48.0, 12.5),
    "bridge-clear-height": (lambda: with_bridge(valley_depth=3.0, deck_depth=1.2), 1.8, 2.0),
    "tunnel-clear-height": (lambda: with_tunnel(height=4.4), 4.4, 4.5),
    "tunnel-walkway": (_narrow, 0.9, 1.0),
    "tunnel-call-points": (lambda: _long(phone_spacing=200.0), 200.0, 150.0),
    "tunnel-exits": (lambda: _long(exit_spacing=0.0), 450.0, 300.0),
    "object-in-tunnel": (
        lambda: changed(with_tunnel(), "pole", type="Pole", station=120.0, offset=-4.6, kind="lighting", height=4.0),
        1.0,
        0.0,
    ),
}


def _long(**fields: float) -> RoadParameters:
    scenario = RoadScenario.from_dict({"cross_section": "RQ11", "length": 600.0})
    road = sample_road(scenario, 3)
    return changed(road, "structure", type="Tunnel", start_station=60.0, end_station=510.0, **fields)


def test_every_rule_has_a_planted_breach() -> None:
    assert set(BREACHES) == {rule.id for rule in RULES}


@pytest.mark.parametrize("rule", BREACHES)
def test_a_planted_breach_is_found(rule: str) -> None:
    make, value, limit = BREACHES[rule]
    found = [violation for violation in check(make()) if violation.rule == rule]
    assert found
    assert found[0].value == pytest.approx(value, abs=0.01)
    assert found[0].limit == pytest.approx(limit)
    sound = {violation.rule for road in (with_bridge(), with_tunnel()) for violation in check(road)}
    assert rule not in sound


def test_a_vault_is_lower_at_the_pavements_edge() -> None:
    """By its ellipse: 40 % of its crown's height upright, above them an arc over the tube's width."""
    road = with_tunnel(section="vault", height=5.0)
    found = [violation for violation in check(road) if violation.rule == "tunnel-clear-height"]
    edges = RoadGeometry(road).offsets([130.0])[0]
    share = (edges[1] - edges[-2]) / (edges[0] - edges[-1])
    assert [item.value for item in found] == pytest.approx([5.0 * (0.4 + 0.6 * (1.0 - share**2) ** 0.5)])


def test_a_road_has_what_its_seed_gives_without_structures() -> None:
    """Limits of structures that ask for none change nothing that is drawn."""
    plain = sample_road(RoadScenario(length=400.0, cross_section="RQ11"), 5)
    limits = {"bridges": {"length": {"minimum": 20.0, "maximum": 30.0}}, "tunnels": {"vaults": 1.0}}
    other = sample_road(RoadScenario.from_dict({"length": 400.0, "cross_section": "RQ11", **limits}), 5)
    assert plain.to_json() == other.to_json()


def test_helpers_change_roads() -> None:
    assert with_structure({"type": "Tunnel", "start_station": 90.0, "end_station": 170.0}).of_type(Tunnel)
