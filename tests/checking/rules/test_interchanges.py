"""Rules for interchanges: drawn ones keep all rules, and each planted breach is found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from synthroads_addon.checking.checker import check
from synthroads_addon.checking.rules.interchanges import RULES
from synthroads_addon.checking.rules.lines import line_of
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.network.network import network_of
from synthroads_addon.road.other_roads.guardrail import RampGuardrail
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import RampVehicle
from tests.helpers.roads.interchanges import FORMS, diamond, interchange, with_changed

RAMP = "ramp-exit-right"


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 4))])
@pytest.mark.parametrize("form", FORMS)
def test_drawn_interchanges_break_no_rule(form: str, seed: int) -> None:
    assert check(interchange(form, seed)) == []


def _raised(share: float) -> RoadParameters:
    """Return an interchange whose ramp's profile is moved up at one of its points, m."""
    points = [point.to_dict() for point in diamond().objects[RAMP].vertical]
    points[-1]["elevation"] += share
    return with_changed(diamond(), RAMP, vertical=points)


def _beside() -> RoadParameters:
    """Return an interchange with a pole in the middle of a ramp."""
    geometry = RoadGeometry(diamond())
    grid = network_of(geometry).joints[RAMP].surface.grid
    station, offset = geometry.alignment.project(grid.points[len(grid.points) // 2, 4:5, :2])
    place = {"station": float(station[0]), "offset": float(offset[0])}
    return with_changed(diamond(), "pole", type="Pole", instance=99999, kind="lighting", height=4.0, **place)


def _rounded() -> RoadParameters:
    """Return an interchange whose ramp's second point is rounded far too widely."""
    points = [point.to_dict() for point in diamond().objects[RAMP].vertical]
    points[1]["radius"] = 90_000.0
    return with_changed(diamond(), RAMP, vertical=points)


def _narrow() -> RoadParameters:
    """Return an interchange with a guardrail whose face stands 0.4 m from the ramp's pavement."""
    name, rail = next((n, r) for n, r in diamond().of_type(RampGuardrail).items() if r.road == RAMP)
    offset = np.sign(rail.offset) * (diamond().objects[RAMP].half_width + 0.6)
    return with_changed(diamond(), name, offset=float(offset))


def _moved() -> RoadParameters:
    """Return a half clover whose loop begins 25 m farther towards the ramp that runs around it."""
    road = interchange("half-clover")
    loop, other = (road.objects[name] for name in (RAMP, "ramp-entry-right"))
    way = np.array([other.start_x - loop.start_x, other.start_y - loop.start_y])
    x, y = np.array([loop.start_x, loop.start_y]) + 0.6 * way
    return with_changed(road, RAMP, start_x=float(x), start_y=float(y))


def _below(**fields: float) -> RoadParameters:
    """Return an interchange below the motorway with fields of the bridge changed."""
    return with_changed(interchange("diamond-under"), "interchange-bridge", **fields)


def _narrow_bridge() -> RoadParameters:
    """Return an interchange below the motorway whose bridge begins 4 m from the crossing road's axis."""
    crossing = interchange("diamond-under").objects["crossing-road"]
    return _below(start_station=crossing.station - 4.0)


BREACHES: dict[str, Callable[[], RoadParameters]] = {
    "ramp-radius": lambda: with_changed(diamond(), RAMP, design_speed=90.0),
    "ramp-grade": lambda: _raised(9.0),
    "ramp-rounding": _rounded,
    "ramp-join": lambda: _raised(0.0011),
    "ramp-guardrail": _narrow,
    "ramp-apart": _moved,
    "crossing-clearance": lambda: _below(deck_depth=2.6),
    "crossing-room": _narrow_bridge,
    "object-on-ramp": _beside,
}


FOUND = {"object-on-ramp": "pole", "ramp-guardrail": f"guardrail-{RAMP}-right-1"}
"""Object that a rule finds, where that isn't the ramp."""


def test_every_rule_has_a_planted_breach() -> None:
    assert set(BREACHES) == {rule.id for rule in RULES}


@pytest.mark.parametrize("rule", BREACHES)
def test_a_planted_breach_is_found(rule: str) -> None:
    found = {violation.object for violation in check(BREACHES[rule]()) if violation.rule == rule}
    crossing = "crossing-road" if rule.startswith("crossing") else RAMP
    assert found == {FOUND.get(rule, crossing)}


def test_a_ramp_that_ends_beside_its_mouth_is_found() -> None:
    ramp = diamond().objects[RAMP]
    moved = with_changed(diamond(), RAMP, start_x=ramp.start_x + 0.0011)
    assert [(item.rule, round(item.value, 4)) for item in check(moved)] == [("ramp-join", 0.0011)]


def test_axes_are_followed_to_a_micrometre() -> None:
    geometry = RoadGeometry(diamond())
    for joint in network_of(geometry).joints.values():
        line = line_of(joint.ramp)
        assert np.abs(line.place - joint.surface.axis.position(line.station)).max() < 1e-6


def test_a_sign_or_a_pole_on_a_mouths_straight_stretch_is_found() -> None:
    """On the last metres before the crossing road no element of the ramp lies."""
    geometry = RoadGeometry(diamond())
    joint = network_of(geometry).joints[RAMP]
    place = joint.surface.mouth.place(np.array([10.0]), np.array([0.5]))
    station, offset = geometry.alignment.project(place)
    name = f"sign-{RAMP}-1"
    moved = with_changed(diamond(), name, station=float(station[0]), offset=float(offset[0]))
    assert {(item.rule, item.object) for item in check(moved)} == {("object-on-ramp", name)}


def test_a_vehicle_in_another_one_is_found() -> None:
    vehicles = [
        (n, v) for n, v in diamond().of_type(RampVehicle).items() if v.carriageway == "crossing-road" and not v.lane
    ]
    (first, one), (second, _), *_ = vehicles
    moved = with_changed(diamond(), second, station=one.station + 1.0)
    assert [item.rule for item in check(moved)] == ["vehicle-overlap"]
    assert {item.object for item in check(moved)} <= {first, second}
