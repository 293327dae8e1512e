"""Lines of the profile and the cross-section: in the view, and where the road's own numbers put them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from synthroads_addon.jobs.tables.diagram import SHORTEST_SHOWN, Diagram, picked_point, road_diagram, zoomed
from synthroads_addon.road.axes.sight import road_sight
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.other_roads.axis import VerticalPoint
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

SIZE = (900.0, 640.0)


@pytest.fixture(scope="module")
def geometry() -> RoadGeometry:
    return RoadGeometry(sample_road(RoadScenario(length=1500.0), 7))


def station_at(diagram: Diagram, x: float) -> float:
    return (x - diagram.left) / (diagram.right - diagram.left) * diagram.length


def lines(diagram: Diagram, role: str) -> list[np.ndarray]:
    return [line.points for line in diagram.lines if line.role == role]


@pytest.mark.parametrize("station", [0.0, 733.0, 1500.0, 9999.0])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_all_is_within_the_view(geometry: RoadGeometry, station: float, scale: float) -> None:
    size = (SIZE[0] * scale, SIZE[1] * scale)
    diagram = road_diagram(geometry, station, *size, scale)
    for line in diagram.lines:
        assert np.isfinite(line.points).all()
        assert (line.points >= -1.0).all()
        assert (line.points <= np.array(size) + 1.0).all(), line.role
    for text in diagram.texts:
        assert 0.0 <= text.x <= size[0]
        assert 0.0 <= text.y <= size[1] - 8.0 * scale, text.text


def test_the_gradient_line_is_the_profile(geometry: RoadGeometry) -> None:
    """Pixels and metres are linear: the heights at three stations give the scale, and all others follow it."""
    diagram = road_diagram(geometry, 0.0, *SIZE)
    road = lines(diagram, "road")[0]
    station = (road[:, 0] - diagram.left) / (diagram.right - diagram.left) * geometry.length
    elevation = geometry.profile.elevation(np.clip(station, 0.0, geometry.length))
    slope, offset = np.polyfit(elevation, road[:, 1], 1)
    assert slope > 0.0
    assert np.allclose(slope * elevation + offset, road[:, 1], atol=1e-6)
    # Vertical points lie on the same scale, each with its number.
    points = lines(diagram, "point")
    axis = geometry.parameters.alignment
    assert len(points) == len(axis.vertical)
    for diamond, point in zip(points, axis.vertical, strict=True):
        x, y = diamond[1:4:2].mean(axis=0)
        assert station_at(diagram, float(x)) == pytest.approx(point.station, abs=1e-6)
        assert y == pytest.approx(slope * point.elevation + offset, abs=1e-6)


def test_curvature_changes_at_the_elements_borders(geometry: RoadGeometry) -> None:
    diagram = road_diagram(geometry, 0.0, *SIZE)
    (curve,) = lines(diagram, "curvature")
    station = np.array([station_at(diagram, float(x)) for x in curve[:, 0]])
    borders = np.repeat(geometry.alignment.element_starts, 2)[1:-1]
    assert np.allclose(station, borders, atol=1e-4)
    curvature = [k for e in geometry.parameters.alignment.horizontal for k in (e.curvature_start, e.curvature_end)]
    slope, offset = np.polyfit(curvature, curve[:, 1], 1)
    assert slope > 0.0  # left curves upwards
    assert np.allclose(slope * np.array(curvature) + offset, curve[:, 1], atol=1e-6)


def test_the_cross_section_has_the_surfaces_heights_and_the_stated_widths(geometry: RoadGeometry) -> None:
    station = 700.0
    diagram = road_diagram(geometry, station, *SIZE)
    section = lines(diagram, "road")[1]
    edges = geometry.offsets(np.array([station]))[0]
    offset = np.interp(section[:, 0], section[[0, -1], 0], edges[[0, -1]])
    height = geometry.elevation(np.full(len(offset), station), np.clip(offset, edges[-1], edges[0]))
    slope, base = np.polyfit(height, section[:, 1], 1)
    assert slope > 0.0
    assert np.allclose(slope * height + base, section[:, 1], atol=0.05)
    texts = [text.text for text in diagram.texts]
    assert texts.count("3.75") == 4
    assert any(text.startswith("Cross-section at 700.00 m") for text in texts)
    for side in ("left", "right"):
        carriageway = geometry.parameters.carriageway(side)  # type: ignore[arg-type]
        percent = 100.0 * float(geometry.crossfall(carriageway, station))  # type: ignore[arg-type]
        assert f"{percent:+.2f} %" in texts


def test_a_level_straight_road_without_ground_is_drawn() -> None:
    parameters = sample_road(RoadScenario(length=300.0), 1)
    axis = parameters.alignment
    level = [point.model_copy(update={"elevation": 5.0}) for point in axis.vertical]
    straight = axis.horizontal[0].between(300.0, 0.0, 0.0)
    changed = axis.model_copy(update={"vertical": tuple(level), "horizontal": (straight,)})
    kept = {
        name: changed if item is axis else item
        for name, item in parameters.objects.items()
        if type(item).__name__ in ("AlignmentObject", "Carriageway", "Median")
    }
    diagram = road_diagram(RoadGeometry(parameters.model_copy(update={"objects": kept})), 100.0, *SIZE)
    heights = lines(diagram, "road")[0][:, 1]
    assert np.ptp(heights) < 1e-9
    assert all(np.isfinite(line.points).all() for line in diagram.lines)


def test_country_roads_show_what_drivers_see_and_what_they_need_to() -> None:
    parameters = sample_road(RoadScenario.from_dict({"cross_section": "RQ11", "length": 1500.0}), 7)
    country = RoadGeometry(parameters)
    diagram = road_diagram(country, 0.0, *SIZE)
    (needed,) = [line for line in lines(diagram, "point") if len(line) == 2]  # the others are diamonds
    curves = [line for role in ("right", "left") for line in lines(diagram, role) if len(line) > 20]
    station = np.array([station_at(diagram, float(x)) for x in curves[0][:, 0]])
    sight = road_sight(country, station)
    assert sight is not None
    # The scale of the band: 0 at its bottom is as far below the needed sight as that is long.
    largest = max(sight.stopping, sight.overtaking)
    for curve, values in zip(curves, (sight.ahead, sight.back), strict=True):
        shown = np.minimum(values, 1.05 * largest)
        slope, offset = np.polyfit(shown, curve[:, 1], 1)
        assert slope > 0.0
        assert np.allclose(slope * shown + offset, curve[:, 1], atol=1e-6)
        assert slope * sight.stopping + offset == pytest.approx(needed[0, 1], abs=1e-6)
    assert any(text.text == f"Sight: {sight.stopping:.0f} m to stop, 600 m to overtake" for text in diagram.texts)
    assert len({round(float(value)) for value in sight.ahead if np.isfinite(value)}) > 3


def test_motorways_have_no_band_of_sight(geometry: RoadGeometry) -> None:
    assert road_sight(geometry, np.zeros(1)) is None
    assert not [text for text in road_diagram(geometry, 0.0, *SIZE).texts if text.text.startswith("Sight")]


def test_a_part_of_the_road_is_shown_larger_and_keeps_its_place(geometry: RoadGeometry) -> None:
    whole = road_diagram(geometry, 500.0, *SIZE)
    middle = 0.5 * (whole.left + whole.right)
    shown = zoomed((0.0, 1500.0), 1500.0, whole.station(middle), 0.25)
    part = road_diagram(geometry, 500.0, *SIZE, shown=shown)
    assert (part.first, part.last) == shown == (pytest.approx(562.5), pytest.approx(937.5))
    assert float(part.x(750.0)) == pytest.approx(middle)
    for line in part.lines:  # nothing reaches beyond the frame; the cross-section has no stations
        assert (line.points[:, 0] >= part.left - 1e-6).all()
        assert (line.points[:, 0] <= part.right + 1e-6).all()
    road = lines(part, "road")[0]
    station = part.first + (road[:, 0] - part.left) / (part.right - part.left) * part.length
    elevation = geometry.profile.elevation(np.clip(station, 0.0, geometry.length))
    slope, offset = np.polyfit(elevation, road[:, 1], 1)
    assert np.allclose(slope * elevation + offset, road[:, 1], atol=1e-6)
    bend = lines(part, "curvature")[0]
    assert (bend[0, 0], bend[-1, 0]) == (pytest.approx(part.left), pytest.approx(part.right))
    assert not any("Station 500.00" in text.text for text in part.texts)
    assert zoomed(shown, 1500.0, 750.0, 100.0) == (0.0, 1500.0)
    first, last = zoomed(shown, 1500.0, 937.5, 1e-9)
    assert last - first == pytest.approx(SHORTEST_SHOWN)


def test_the_nearest_vertical_point_is_picked(geometry: RoadGeometry) -> None:
    diagram = road_diagram(geometry, 0.0, *SIZE)
    assert len(diagram.points) == len(geometry.parameters.alignment.vertical)
    for number, x, y in diagram.points:
        assert picked_point(diagram, x + 3.0, y - 4.0, reach=8.0) == number
    assert picked_point(diagram, diagram.points[0][1] + 30.0, diagram.points[0][2], reach=8.0) is None


def test_names_of_near_vertical_points_do_not_cover_each_other(geometry: RoadGeometry) -> None:
    axis = geometry.parameters.alignment
    points = [VerticalPoint(station=700.0 + 6.0 * i, elevation=0.0, radius=0.0) for i in range(5)]
    name = next(key for key, item in geometry.parameters.objects.items() if item is axis)
    objects = geometry.parameters.objects | {name: axis.model_copy(update={"vertical": tuple(points)})}
    crowded = RoadGeometry(geometry.parameters.model_copy(update={"objects": objects}))
    names = [text for text in road_diagram(crowded, 0.0, *SIZE).texts if text.role == "point"]
    assert len(names) == len(points)
    for one, other in combinations(names, 2):
        assert abs(one.y - other.y) >= 12.0 or abs(one.x - other.x) >= 6.5 * max(len(one.text), len(other.text))
