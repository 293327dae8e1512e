"""The mouths of side roads: where they join, how high they lie, and that ground and things leave them free."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.network.patches import side_road_paint, side_road_patches
from synthroads_addon.road.side_roads.mouth import HIGH, LOW, Mouth
from synthroads_addon.road.terrain import surface_elevation
from tests.helpers.roads.side_roads import SHAPES, drawn, with_side_road

MILLIMETRE = 1e-3


@pytest.fixture(params=list(SHAPES), scope="module")
def geometry(request: pytest.FixtureRequest) -> RoadGeometry:
    return RoadGeometry(with_side_road(**SHAPES[request.param]))


@pytest.fixture
def mouth(geometry: RoadGeometry) -> Mouth:
    return geometry.mouths["side-road-1"]


def test_heights_and_crossfalls_agree_along_the_join(geometry: RoadGeometry, mouth: Mouth) -> None:
    station = np.linspace(mouth.low.start_station, mouth.high.start_station, 400)
    level, step = np.zeros(len(station)), 0.01
    main = geometry.main_elevation(station, mouth.offset(station, level))
    joined = mouth.pavement_height(station, level)
    assert np.abs(joined - main).max() < 1e-9
    inwards = (main - geometry.main_elevation(station, mouth.offset(station, level - step))) / step
    outwards = (mouth.pavement_height(station, level + step) - joined) / step
    # A metre from the join the two planes are a millimetre apart at most.
    assert np.abs(outwards - inwards).max() < MILLIMETRE


def test_surface_is_continuous_across_every_join(geometry: RoadGeometry, mouth: Mouth) -> None:
    """From the main road into the mouth, from its verge to the corner's, and from its verge to the ground."""
    station = np.linspace(mouth.start, mouth.end, 3000)
    for depth in (0.0, mouth.verge_width):
        below, above = (surface_elevation(geometry, station, mouth.offset(station, depth + d)) for d in (-1e-6, 1e-6))
        assert np.nanmax(np.abs(above - below)) < MILLIMETRE
    depth = np.linspace(0.01, mouth.reach - 0.5, 2000)
    for sign in (LOW, HIGH):
        inner = mouth.plan(mouth.edge_station(sign, depth), depth)
        for away in (0.0, mouth.verge_width):
            rows = []
            for side in (-1e-6, 1e-6):
                shifted = _outwards(mouth, sign, inner, away + side)
                place = mouth.main_coordinates(shifted)
                rows.append(surface_elevation(geometry, place[0], mouth.offset(*place)))
            assert np.abs(rows[1] - rows[0]).max() < MILLIMETRE, (sign, away)


def _outwards(mouth: Mouth, sign: float, inner: np.ndarray, distance: float) -> np.ndarray:
    """Return points (N, 2) a distance outwards of the pavement's edge."""
    corner = mouth.corner(sign)
    u, _ = mouth.local(inner)
    radial = corner.centre + (inner - corner.centre) * (1.0 - distance / corner.radius)
    return np.where((u >= corner.end_u)[:, None], inner + sign * distance * mouth.across, radial)


def test_corners_touch_both_edges(geometry: RoadGeometry, mouth: Mouth) -> None:
    for sign, radius in ((LOW, mouth.side_road.near_radius), (HIGH, mouth.side_road.far_radius)):
        corner = mouth.corner(sign)
        _, depth = mouth.main_coordinates(corner.centre[None])
        u, v = mouth.local(corner.centre[None])
        assert depth[0] == pytest.approx(radius, abs=1e-6)
        assert abs(v[0]) == pytest.approx(mouth.side_road.half_width + radius, abs=1e-9)
        assert np.sign(v[0]) == sign
        assert u[0] == pytest.approx(corner.end_u, abs=1e-9)


def test_own_surface_has_its_grade_and_crossfall(geometry: RoadGeometry, mouth: Mouth) -> None:
    road = mouth.side_road
    u = np.full(3, road.length - 3.0)
    v = np.array([-1.0, 0.0, 1.0]) * road.half_width * 0.9
    station, depth = mouth.main_coordinates(mouth.place(u, v))
    left, middle, right = surface_elevation(geometry, station, mouth.offset(station, depth)).tolist()
    fall = road.crossfall_percent / 100.0 * road.half_width * 0.9
    lower = (fall, fall) if road.lanes > 1 else (-fall, fall)
    assert (middle - left, middle - right) == pytest.approx(lower, abs=1e-6)
    ahead = mouth.main_coordinates(mouth.place(u[:1] + 1.0, np.zeros(1)))
    rise = surface_elevation(geometry, ahead[0], mouth.offset(*ahead))[0] - middle
    assert rise == pytest.approx(road.grade_percent / 100.0, abs=1e-6)


def test_triangles_lie_on_the_surface(geometry: RoadGeometry, mouth: Mouth) -> None:
    for patch in side_road_patches(geometry, mouth, geometry.terrain):
        quads = patch.points.reshape(-1, 3)[patch.quads(mouth.sign)]
        first, second = quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]
        assert (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).min() > 0.0, patch.kind
        middle = quads.mean(axis=1)
        station, offset = geometry.alignment.project(middle[:, :2])
        error = np.abs(surface_elevation(geometry, station, offset) - middle[:, 2])
        if patch.kind != "ground":
            assert np.quantile(error, 0.999) < MILLIMETRE, patch.kind


def test_every_field_changes_the_surface() -> None:
    """No field of a side road is without effect on its mesh or its markings."""
    changes = {
        "station": 155.0, "angle_deg": 80.0, "lanes": 1, "lane_width": 3.0, "edge_strip_width": 0.5, "length": 40.0,
        "near_radius": 12.0, "far_radius": 12.0, "grade_percent": 2.0, "crossfall_percent": 3.0, "blend_length": 8.0,
        "priority": "stop", "centre_line": False, "edge_lines": False,
    }  # fmt: skip
    usual = _shape()
    for name, value in changes.items():
        assert _shape(**{name: value}) != usual, name


def _shape(**fields: object) -> tuple[float, ...]:
    """Return sums that tell one side road's mesh and markings from another's."""
    geometry = RoadGeometry(with_side_road(**fields))
    mouth = geometry.mouths["side-road-1"]
    patches = side_road_patches(geometry, mouth, geometry.terrain)
    paint = side_road_paint(geometry, mouth)
    sums = [float(np.abs(patch.points).sum()) for patch in patches if patch.kind != "ground"]
    return (*np.round(sums, 6).tolist(), float(len(paint)), round(float(np.sum(paint)), 6))


@pytest.mark.parametrize("seed", range(6))
def test_nothing_stands_in_a_mouth(seed: int) -> None:
    from synthroads_addon.road.objects import LineObject, PointObject

    road = drawn(("RQ11", "RQ9", "RQ10.5")[seed % 3], seed, 600.0)
    geometry = RoadGeometry(road)
    assert geometry.mouths
    for name, item in road.objects.items():
        if isinstance(item, PointObject):
            station, offset = np.array([item.station]), np.array([item.offset])
        elif isinstance(item, LineObject):
            station = np.arange(item.start_station, min(item.end_station, geometry.length), 0.5)
            offset = item.offset_at(station)
        else:
            continue
        for mouth in geometry.mouths.values():
            on_side = mouth.sign * offset > 0.0
            # A mouth's own sign stands on its verge.
            is_in = mouth.is_paved if name.endswith("-sign") else mouth.contains
            inside = is_in(station, mouth.depth(station, offset)) & on_side
            assert not inside.any(), (name, station[inside][:3])


def test_roads_without_side_roads_are_drawn_as_before() -> None:
    """The side roads have random numbers of their own: carriageways, ground and traffic don't change with them."""
    plain, with_roads = drawn(per_km=0.0), drawn()
    for name in ("alignment", "carriageway-left", "carriageway-right", "terrain", "landscape"):
        first, second = (road.objects[name].model_dump(exclude={"instance"}) for road in (plain, with_roads))
        assert first == second, name
