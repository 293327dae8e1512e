"""Gantries, the overpass, and construction zones."""

from collections import Counter
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.guidelines import StandardCrossSection
from synthroads_addon.road.things.beacon import ConstructionBeacon
from synthroads_addon.road.things.gantry import Gantry
from synthroads_addon.road.things.overpass import Overpass
from synthroads_addon.road.things.temporary_barrier import TemporaryBarrier
from tests.helpers.roads.sites import bay_at, beside, exit_at, make_site, of, place, straight

EDGE, LANES = 14.0, (10.25, 6.5, 2.75)
"""Distances of the outer paved edge and of the lanes' boundaries of an RQ 31 from the centreline, m."""
GANTRY: dict[str, Any] = {"furniture": {"gantries": 1.0}}
OVERPASS: dict[str, Any] = {"furniture": {"overpass": 1.0}}
ZONE: dict[str, Any] = {"furniture": {"construction_zone": 1.0}}


def gantries(count: int, **changes: Any) -> list[Gantry]:
    return [gantry for seed in range(count) for gantry in of(place(make_site(seed=seed, **changes)), Gantry).values()]


# --- gantries -----------------------------------------------------------------------------------------------------


def test_kinds_of_gantries_occur_evenly_and_in_all_shapes() -> None:
    found = gantries(240, **GANTRY)
    kinds = Counter(gantry.kind for gantry in found)
    assert len(found) == 240
    assert min(kinds.values()) > 55
    assert set(kinds) == {"one_sided", "two_sided", "cantilever"}
    assert {gantry.beam for gantry in found} == {"box", "truss", "tube"}
    assert len({gantry.shade for gantry in found}) == 5
    assert {sign.kind for gantry in found for sign in gantry.signs} == {"display", "destination"}


def test_what_gantries_span_and_carry() -> None:
    for gantry in gantries(60, **GANTRY):
        left, right, offsets = gantry.left_offset, gantry.right_offset, [sign.offset for sign in gantry.signs]
        assert gantry.offset == pytest.approx((left + right) / 2.0)
        assert 5.0 <= gantry.clearance <= 5.8
        for sign in gantry.signs:
            assert right <= sign.offset - sign.width / 2.0 < sign.offset + sign.width / 2.0 <= left
        if gantry.kind == "two_sided":
            assert right < -EDGE - 1.25
            assert left > EDGE + 1.25
            assert sorted(offsets) == pytest.approx([-8.375, -4.625, 4.625, 8.375])
        elif gantry.kind == "one_sided":
            assert 0.0 in (left, right)
            assert max(abs(left), abs(right)) > EDGE + 1.25
            assert sorted(map(abs, offsets)) == pytest.approx([4.625, 8.375])
        else:
            post = left if gantry.post_side == "left" else right
            assert abs(post) > EDGE + 1.25
            assert min(abs(left), abs(right)) == pytest.approx(LANES[2])


def test_a_cantilever_reaches_over_two_lanes_of_four() -> None:
    found = [g for g in gantries(40, cross_section="RQ43.5", **GANTRY) if g.kind == "cantilever"]
    assert {len(gantry.signs) for gantry in found} == {2}


def test_only_cantilevers_where_the_median_has_no_room_for_a_post() -> None:
    section = StandardCrossSection((3.75, 3.75), 3.0, 0.75, 0.75, 2.0)
    assert {gantry.kind for gantry in gantries(30, section=section, **GANTRY)} == {"cantilever"}
    posts = [g.post_width for g in gantries(60, design_class="EKA3", cross_section="RQ25", **GANTRY)]
    assert max(posts) > 0.4
    narrow = [
        g.post_width
        for g in gantries(60, design_class="EKA3", cross_section="RQ25", **GANTRY)
        if g.kind != "cantilever"
    ]
    assert max(narrow) <= 1.25 - 0.85


def test_gantries_at_a_spacing() -> None:
    furniture = {"gantry_spacing": 200.0, "overpass": 0.0}
    stations = [g.station for g in gantries(1, elements=straight(1500.0), furniture=furniture)]
    assert stations == [100.0 + 200.0 * i for i in range(7)] + [1500.0]
    assert [g.station for g in gantries(1, elements=straight(5.0), furniture={"gantry_spacing": 5.0})] == [2.5]


def test_gantries_keep_away_from_turnouts() -> None:
    turnouts = [exit_at(300.0), bay_at(300.0, "left")]
    found = gantries(60, elements=straight(1000.0), turnouts=turnouts, **GANTRY)
    assert len(found) > 40
    for gantry in found:
        if gantry.kind == "two_sided" or gantry.right_offset < -3.0:
            assert not 238.0 < gantry.station < 812.0


# --- overpass -----------------------------------------------------------------------------------------------------


def overpasses(count: int, **changes: Any) -> list[Overpass]:
    return [bridge for seed in range(count) for bridge in of(place(make_site(seed=seed, **changes)), Overpass).values()]


def test_where_an_overpass_stands() -> None:
    found = overpasses(120, **OVERPASS)
    assert len(found) == 120
    assert {len(bridge.pier_offsets) for bridge in found} == {0, 1, 3}
    for bridge in found:
        assert abs(bridge.rotation_deg) <= 30.0
        assert 4.7 <= bridge.clearance <= 5.6
        assert 6.0 <= bridge.width <= 14.0
        corner = bridge.width / 2.0 * np.sin(np.radians(abs(bridge.rotation_deg)))
        assert min(bridge.left_abutment, -bridge.right_abutment) - corner >= EDGE + 1.5 + 1.5 - 1e-6
        for pier in bridge.pier_offsets:
            assert abs(pier) < 1e-9 or EDGE + 1.25 < abs(pier) < bridge.left_abutment - corner - 1.5
        # Within the road, as far as its skew reaches.
        assert bridge.width / 2.0 <= bridge.station <= 600.0 - bridge.width / 2.0
    rotations = [bridge.rotation_deg for bridge in found]
    assert min(rotations) < -25.0
    assert max(rotations) > 25.0


def test_an_overpass_keeps_away_from_gantries_and_turnouts() -> None:
    checked = 0
    for seed in range(60):
        site = make_site(
            straight(1200.0), seed=seed, turnouts=[exit_at(100.0)], furniture={"gantries": 1, "overpass": 1}
        )
        furniture = place(site)
        bridges, beams = of(furniture, Overpass).values(), of(furniture, Gantry).values()
        for bridge in bridges:
            low, high = bridge.station - bridge.width / 2.0, bridge.station + bridge.width / 2.0
            assert high <= 100.0 - 60.0 or low >= 530.0 + 60.0
            for gantry in beams:
                checked += 1
                assert abs(bridge.station - gantry.station) > bridge.width / 2.0 + 0.75
    assert checked > 30


def test_no_overpass_without_room() -> None:
    assert overpasses(20, elements=straight(5.0), **OVERPASS) == []
    assert overpasses(5, elements=straight(180.0), turnouts=[bay_at(40.0)], **OVERPASS) == []


# --- construction zones -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", ["right", "left"])
def test_beacons_close_the_outermost_lane(side: str) -> None:
    sign = -1.0 if side == "right" else 1.0
    for seed in range(15):
        furniture = place(make_site(straight(1000.0), seed=seed, **ZONE))
        beacons = beside(furniture, side, ConstructionBeacon)
        stations = np.array([beacon.station for beacon in beacons])
        distances = sign * np.array([beacon.offset for beacon in beacons])
        if side == "left":
            stations, distances = 1000.0 - stations[::-1], distances[::-1]
        gaps, moves = np.diff(stations), np.diff(distances)
        assert gaps.max() <= 18.0
        assert gaps[np.abs(moves) > 1e-6].max() <= 9.0
        inside = distances < LANES[1] + 0.56
        assert LANES[1] + 0.125 < distances.min()
        assert stations[inside][0] - stations[0] >= 60.0
        assert distances[0] == pytest.approx(EDGE - 0.4)
        assert distances[-1] == pytest.approx(EDGE - 0.4)
        assert 120.0 <= stations[-1] - stations[0] <= 400.0
        assert {beacon.pass_side for beacon in beacons} == {"left" if side == "right" else "right"}


def test_yellow_line_and_movable_barrier() -> None:
    barriers = 0
    for seed in range(20):
        furniture = place(make_site(straight(1000.0), seed=seed, **ZONE))
        line = furniture["marking-construction-right"]
        beacons = beside(furniture, "right", ConstructionBeacon)
        assert (line.color, line.dash_length, line.kind) == ("yellow", 0.0, "free")
        stations, widths = zip(*((p.station, p.width) for p in line.offset), strict=True)
        assert (line.start_station, line.end_station) == (stations[0], stations[-1])
        along = np.interp([b.station for b in beacons], stations, widths)
        assert -np.array([b.offset for b in beacons]) - along == pytest.approx(0.35)
        assert along.min() - line.width / 2.0 > LANES[1] + 0.07
        for barrier in beside(furniture, "right", TemporaryBarrier):
            barriers += 1
            assert barrier.offset == barrier.end_offset < -(LANES[1] + 0.55 + 0.125 + barrier.base_width / 2.0)
            assert stations[1] < barrier.start_station < barrier.end_station < stations[2]
    assert barriers > 8


def test_no_construction_zone_beside_turnouts_or_on_a_single_lane() -> None:
    for seed in range(20):
        furniture = place(make_site(straight(1000.0), seed=seed, turnouts=[exit_at(300.0)], **ZONE))
        for beacon in beside(furniture, "right", ConstructionBeacon):
            assert not 280.0 < beacon.station < 750.0
    short = make_site(straight(500.0), turnouts=[bay_at(200.0)], **ZONE)
    assert beside(place(short), "right", ConstructionBeacon)
    assert not beside(place(make_site(straight(100.0), **ZONE)), "right", ConstructionBeacon)
    single = StandardCrossSection((3.75,), 3.0, 0.75, 0.75, 4.0)
    assert not of(place(make_site(straight(1000.0), section=single, **ZONE)), ConstructionBeacon)
    narrow = StandardCrossSection((3.75, 2.4), 3.0, 0.75, 0.75, 4.0)
    assert not of(place(make_site(straight(1000.0), section=narrow, **ZONE)), ConstructionBeacon)


def test_zones_lie_anywhere_they_can() -> None:
    starts = []
    for seed in range(60):
        line = place(make_site(straight(1000.0), seed=seed, **ZONE))["marking-construction-right"]
        starts.append(line.start_station / (1000.0 - (line.end_station - line.start_station)))
    assert min(starts) < 0.1
    assert max(starts) > 0.9
    assert all(b > a for a, b in pairwise(np.quantile(starts, [0.0, 0.25, 0.5, 0.75, 1.0])))
