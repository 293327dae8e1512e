"""Ramps and crossing roads: surfaces that meet, the ground between them, and heights that go on."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.network.ground import Triangles, inside
from synthroads_addon.road.network.network import Network, network_of
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.terrain import surface_elevation
from tests.helpers.roads.interchanges import diamond, interchange

MILLIMETRE = 1e-3
CHORD = 0.01
"""Distance (m) of the main road's edge from its chords, at most."""
SLOW = [("diamond", 2), ("diamond", 5), ("diamond-under", 1), ("half-clover-entries", 1), ("half-clover-one-side", 3)]
ROADS = [("diamond", 1), ("half-clover", 1), ("half-clover-under", 1)]


@pytest.fixture(params=[*ROADS, *(pytest.param(item, marks=pytest.mark.slow) for item in SLOW)], scope="module")
def network(request: pytest.FixtureRequest) -> tuple[RoadGeometry, Network]:
    geometry = RoadGeometry(interchange(*request.param))
    return geometry, network_of(geometry)


def test_a_ramp_begins_on_the_main_roads_surface(network: tuple[RoadGeometry, Network]) -> None:
    geometry, roads = network
    assert set(roads.joints) == {f"ramp-{kind}-{side}" for kind in ("exit", "entry") for side in ("left", "right")}
    for joint in roads.joints.values():
        row = joint.surface.grid.points[0]
        station, offset = geometry.alignment.project(row[:, :2])
        assert np.abs(station - joint.cut.station).max() < 1e-6
        # Just on the turnout's side of the cut.
        before = np.full(len(station), joint.cut.station - 1e-7 * joint.cut.ahead)
        height = geometry.main_elevation(before, offset * (1.0 - 1e-7))
        assert np.abs(height - row[:, 2]).max() < 0.1 * MILLIMETRE


def test_a_ramp_ends_on_its_mouths_surface(network: tuple[RoadGeometry, Network]) -> None:
    _, roads = network
    for name, joint in roads.joints.items():
        row, mouth = joint.surface.grid.points[-1], joint.surface.mouth
        pavement = roads.crossings[joint.ramp.crossing_road].patches(name)[0]
        u, v = mouth.local(row[:, :2])
        assert np.abs(u - joint.ramp.mouth_length).max() < 1e-6
        paved = np.abs(v) <= joint.ramp.half_width + 1e-9
        at = np.argsort(mouth.local(pavement.points[-1, :, :2])[1])
        heights = np.interp(v, mouth.local(pavement.points[-1, :, :2])[1][at], pavement.points[-1, at, 2])
        assert np.abs(heights - row[:, 2])[paved].max() < 0.1 * MILLIMETRE


def test_a_ramps_middle_lies_on_its_stated_profile(network: tuple[RoadGeometry, Network]) -> None:
    """Its own surface is what the set says of it; only its ends follow what they join, by less than a millimetre."""
    _, roads = network
    for joint in roads.joints.values():
        surface = joint.surface
        grid = surface.grid
        wanted = surface.own_height(grid.station.ravel(), grid.offset.ravel()).reshape(grid.station.shape)
        away = np.abs(wanted - grid.points[..., 2])
        assert away[:, 2:-2].max() < MILLIMETRE
        inner = (surface.rows > 16.0) & (surface.rows < surface.axis.length - 9.0)
        assert away[inner].max() < 1e-9


def test_the_ground_has_no_holes_and_lies_on_no_road(network: tuple[RoadGeometry, Network]) -> None:
    """Its area and those of all roads add up to the terrain's, and its height at every road's edge is the edge's."""
    _, roads = network
    ground, _ = roads.ground(0.005)
    corners = ground.points[ground.corners][..., :2]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2.0
    assert areas.min() > 0.0
    middles = corners.mean(axis=1)
    assert not roads.covers(middles[~_below_bridge(roads, middles)]).any()
    for joint in roads.joints.values():
        for column in (0, -1):
            edge = joint.surface.grid.points[:, column]
            height = _beside(ground, edge[:, :2])
            assert np.nanmax(np.abs(height - edge[:, 2])) < MILLIMETRE


def _below_bridge(roads: Network, points: np.ndarray) -> np.ndarray:
    result = np.zeros(len(points), dtype=bool)
    for crossing in roads.crossings.values():
        along, _ = crossing.geometry.alignment.project(points)
        result |= crossing.is_carried(along)
    return result


def _beside(ground: Triangles, places: np.ndarray) -> np.ndarray:
    """Return the ground's heights (N,) at corners of triangles that lie at places (N, 2); NaN where none does."""
    result = np.full(len(places), np.nan)
    for number, place in enumerate(places):
        away = np.abs(ground.points[:, :2] - place).max(axis=1)
        nearest = int(away.argmin())
        if away[nearest] < 1e-5:
            result[number] = ground.points[nearest, 2]
    assert np.count_nonzero(np.isnan(result)) <= 2
    return result


def test_vertical_rays_meet_one_surface(network: tuple[RoadGeometry, Network]) -> None:
    """On a grid of 10 cm over the cuts and the mouths: main road, ramps, mouths, crossing road and ground."""
    geometry, roads = network
    steps = np.arange(-4.0, 4.0, 0.1) + 0.0137
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    for joint in roads.joints.values():
        for middle in (joint.cut.points[0], joint.surface.mouth.origin, joint.surface.grid.points[-1, 0, :2]):
            points = middle + grid
            station, offset = geometry.alignment.project(points)
            boundaries = geometry.offsets(station)
            on_main = (offset <= boundaries[:, 0]) & (offset >= boundaries[:, -1])
            # In the step at the cut the ramp lies, and the main road's verge beside it.
            step = [low < s < high for s in station for low, high in geometry.joined_steps(joint.side)]
            steps_here = np.array(step).reshape(len(station), -1).any(axis=1)
            other = ~np.isnan(roads.surface_height(points))
            # The ground begins at chords of the main road's edge.
            at_edge = np.abs(offset[:, None] - boundaries[:, [0, -1]]).min(axis=1) < CHORD
            assert ((on_main ^ other) | steps_here | at_edge).all()
            assert np.count_nonzero(steps_here | at_edge) < 0.1 * len(points)


def test_heights_go_on_where_roads_meet(network: tuple[RoadGeometry, Network]) -> None:
    geometry, roads = network
    for joint in roads.joints.values():
        cut, mouth = joint.cut, joint.surface.mouth
        share = np.linspace(0.25, 0.95, 15)[:, None]
        row = cut.points[1] + share * (cut.points[4] - cut.points[1])
        forward = np.array([np.cos(joint.surface.axis.start_heading), np.sin(joint.surface.axis.start_heading)])
        heights = []
        for distance in (-0.002, 0.002):
            station, offset = geometry.alignment.project(row + distance * forward)
            heights.append(surface_elevation(geometry, station, offset))
        assert np.abs(heights[1] - heights[0]).max() < MILLIMETRE
        across = mouth.place(np.array([-0.001, 0.001]), np.zeros(2))
        assert np.abs(np.diff(roads.surface_height(across)))[0] < MILLIMETRE


def test_places_in_a_polygon() -> None:
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    assert inside(square, np.array([[1.0, 1.0], [3.0, 1.0], [-0.1, 1.0]])).tolist() == [True, False, False]


def test_a_set_is_read_back_the_same() -> None:
    road = diamond()
    assert RoadParameters.from_dict(road.to_dict()) == road
