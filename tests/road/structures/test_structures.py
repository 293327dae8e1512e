"""Bridges and tunnels, exactly: the road's surface, caps, the ground, and their solids."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.structures.caps import CAP_RAMP, CAP_RISE, KERB_LEAN
from synthroads_addon.road.structures.tunnel_bodies import tubes_of
from synthroads_addon.road.terrain import LEAST_COVER, ground_below, surface_elevation
from synthroads_addon.twin.faces import enclosed_volume, loft
from synthroads_addon.twin.things import placed_things, road_course
from tests.helpers.roads.structures import KEPT, changed, with_bridge, with_structure, with_tunnel

ROADS = {
    "bridge": with_bridge,
    "bridge of a motorway": lambda: with_bridge("RQ31", superstructure="box", joint="lamella", barrier="h4b"),
    "tunnel": with_tunnel,
    "vault": lambda: with_tunnel(section="vault", height=7.5),
}
NAME = "structure"


def without(road: RoadParameters) -> RoadGeometry:
    """Return a road's geometry without its structure."""
    objects = {name: item for name, item in road.objects.items() if name != NAME}
    return RoadGeometry(road.model_copy(update={"objects": objects}))


@pytest.mark.parametrize("kind", ROADS)
def test_the_pavement_goes_on_exactly(kind: str) -> None:
    road = ROADS[kind]()
    geometry, plain = RoadGeometry(road), without(road)
    station = np.repeat(np.arange(70.0, 190.0, 0.5), 41)
    edges = plain.offsets(station)
    share = np.tile(np.linspace(0.0, 1.0, 41), len(station) // 41)
    offset = edges[:, 1] + share * (edges[:, -2] - edges[:, 1])
    strip = plain.strip_index(station, offset)
    paved = np.array([item.class_name == "road" for item in plain.strips])[strip]
    assert paved.sum() > 5000
    np.testing.assert_array_equal(geometry.elevation(station, offset)[paved], plain.elevation(station, offset)[paved])


def test_a_cap_rises_from_its_kerb() -> None:
    geometry = RoadGeometry(with_bridge(kerb_height=0.12))
    bridge = geometry.bridges[NAME]
    station = np.full(3, 110.0)
    offsets, heights = geometry.boundaries(station)
    distance = np.array([0.0, KERB_LEAN, 1.0])
    height = geometry.elevation(station, offsets[:, 1] + distance) - heights[:, 1]
    np.testing.assert_allclose(height, [0.0, 0.12, 0.12 + CAP_RISE * (1.0 - KERB_LEAN)], atol=1e-9)
    # At its end the cap is as high as the verge.
    at_end = np.full(1, bridge.cap_start + 1e-9)
    plain = without(with_bridge(kerb_height=0.12))
    edge = plain.offsets(at_end)[:, 0] - 0.01
    np.testing.assert_allclose(geometry.elevation(at_end, edge), plain.elevation(at_end, edge), atol=1e-6)
    assert bridge.stations.tolist() == [84.0, 84.0 + CAP_RAMP, 144.0 - CAP_RAMP, 144.0]


def test_the_ground_falls_away_below_a_bridge_and_meets_the_batters_at_its_ends() -> None:
    geometry = RoadGeometry(with_bridge(valley_depth=9.0))
    station = np.full(5, 114.0)
    depth = surface_elevation(geometry, station, np.zeros(5)) - ground_below(geometry, station, np.linspace(-4, 4, 5))
    assert depth.min() > 7.0
    assert depth.max() < 10.5
    for end in (84.0, 144.0):
        offset = np.concatenate([np.linspace(-45.0, -7.0, 200), np.linspace(7.0, 45.0, 200)])
        near, far = (surface_elevation(geometry, np.full(400, end + step), offset) for step in (-1e-5, 1e-5))
        np.testing.assert_allclose(near, far, atol=2e-4)


def test_the_ground_covers_a_tunnel() -> None:
    geometry = RoadGeometry(with_tunnel(cover=4.0))
    tunnel = geometry.tunnels[NAME]
    station, offset = (grid.ravel() for grid in np.meshgrid(np.linspace(90.1, 169.9, 60), np.linspace(-6.0, 6.0, 25)))
    course = road_course(geometry, 0.005)
    roof = tubes_of(tunnel, course)[0].crown(station) + tunnel.wall_thickness
    assert (ground_below(geometry, station, offset) - roof).min() >= LEAST_COVER - 1e-9
    middle = np.full(9, 130.0)
    cover = ground_below(geometry, middle, np.linspace(-4.0, 4.0, 9)) - (
        roof[0] * 0.0 + tubes_of(tunnel, course)[0].crown(middle) + 0.8
    )
    assert 2.0 < cover.min() < cover.max() < 7.0


@pytest.mark.parametrize("kind", ROADS)
def test_solids_are_closed_and_look_outwards(kind: str) -> None:
    geometry = RoadGeometry(ROADS[kind]())
    (placed,) = [item for item in placed_things(geometry, 0.005) if item.name == NAME]
    assert len({body.part for body in placed.bodies}) > 8
    for body in placed.bodies:
        faces = loft(body.sections)
        assert np.isfinite(faces.points).all()
        assert enclosed_volume(faces) > 0.0
        starts = np.cumsum(faces.sizes) - faces.sizes
        edges = [
            (ring[i], ring[(i + 1) % size])
            for start, size in zip(starts.tolist(), faces.sizes.tolist(), strict=True)
            for ring in [faces.corners[start : start + size].tolist()]
            for i in range(size)
        ]
        assert len(set(edges)) == len(edges), body.part
        assert {(b, a) for a, b in edges} == set(edges), body.part


def test_a_vault_leaves_the_clear_height_that_its_ceiling_says() -> None:
    geometry = RoadGeometry(with_tunnel(section="vault", height=7.5))
    (tube,) = tubes_of(geometry.tunnels[NAME], road_course(geometry, 0.005))
    station = np.full(2, 130.0)
    left, right = tube.walls(station)
    middle = (left + right) / 2.0
    np.testing.assert_allclose(tube.ceiling(station, middle), tube.crown(station), atol=1e-9)
    np.testing.assert_allclose(tube.ceiling(station, left), tube.crown(station) - 0.6 * 7.5, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: with_bridge(end_station=91.0), "end_station must be at least 2 m"),
        (lambda: with_bridge(pier_stations=[80.0]), "must lie between"),
        (lambda: with_bridge(pier_stations=[122.0, 106.0]), "must increase"),
        (lambda: with_tunnel(end_station=91.0), "end_station must be at least 4 m"),
    ],
)
def test_impossible_structures_are_refused(make, text: str) -> None:
    with pytest.raises(InputError, match=text):
        make()


@pytest.mark.parametrize("kind", ["Bridge", "Tunnel"])
def test_a_structure_needs_both_directions(kind: str) -> None:
    road = with_bridge() if kind == "Bridge" else with_tunnel()
    data = road.to_dict()
    data["objects"] = {
        name: item
        for name, item in data["objects"].items()
        if item["type"] in ("Alignment", kind) or name == "carriageway-right"
    }
    with pytest.raises(InputError, match=f"a {kind} needs a Carriageway on both sides"):
        RoadParameters.from_dict(data)


def test_what_a_road_keeps() -> None:
    road = with_structure({"type": "Bridge", "start_station": 90.0, "end_station": 138.0})
    assert {item.type for item in road.objects.values()} <= {*KEPT, "Bridge"}
    assert changed(road, NAME, joint="none").objects[NAME].joint == "none"
