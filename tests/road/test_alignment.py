"""Alignment: against quadrature and Fresnel integrals, its inverse against brute force, and bad input."""

from __future__ import annotations

import itertools
import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import fresnel

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.alignment import Alignment, Element, clip_offset, running_sum
from tests.helpers.relative_speed import quiet_seconds


def chain(*rows: tuple[float, float, float]) -> list[Element]:
    return [Element(*row) for row in rows]


def mixed_elements(length: float = 10_000.0) -> list[Element]:
    """Radii from 40 m to infinity, nearly equal curvatures, egg and S clothoids; the rest of the length is gentle."""
    elements = chain(
        (300.0, 0.0, 0.0),
        (80.0, 0.0, 1 / 400),
        (500.0, 1 / 400, 1 / 400),
        (90.0, 1 / 400, -1 / 300),
        (300.0, -1 / 300, -1 / 300),
        (100.0, -1 / 300, 0.0),
        (200.0, 1 / 900, 1 / 900.0001),
        (30.0, 0.0, 1 / 40),
        (60.0, 1 / 40, 1 / 40),
        (25.0, 1 / 40, 1 / 55),
        (30.0, 1 / 55, 0.0),
        (150.0, 0.0, 1e-12),
    )
    rest = (length - sum(element.length for element in elements)) / 24
    for turn in range(8):
        k = (-1) ** turn / 1500
        elements += chain((rest, 0.0, k), (rest, k, k), (rest, k, 0.0))
    return elements


def exact_heading(elements: list[Element], heading: float, station: float) -> float:
    """Heading by summing turns element by element: nothing shared with the code under test."""
    parts, left = [heading], station
    for element in elements:
        u = min(left, element.length)
        slope = (element.curvature_end - element.curvature_start) / element.length
        parts.append(u * element.curvature_start + 0.5 * u * u * slope)
        left -= u
        if left <= 0:
            break
    return math.fsum(parts)


def quadrature(elements: list[Element], x: float, y: float, heading: float, stations: np.ndarray) -> np.ndarray:
    """Positions at increasing stations by adaptive quadrature, element borders being breakpoints."""
    borders = np.cumsum([element.length for element in elements])
    points, s = [], 0.0
    for station in stations:
        ends = [s, *borders[(borders > s) & (borders < station)], station]
        for a, b in itertools.pairwise(ends):
            if b > a:
                x += quad(lambda t: math.cos(exact_heading(elements, heading, t)), a, b, epsabs=1e-12, epsrel=1e-13)[0]
                y += quad(lambda t: math.sin(exact_heading(elements, heading, t)), a, b, epsabs=1e-12, epsrel=1e-13)[0]
        s = station
        points.append((x, y))
    return np.array(points)


def left_of(alignment: Alignment, station: np.ndarray, offset: np.ndarray) -> np.ndarray:
    position, heading, _ = alignment.frame(station)
    return position + np.asarray(offset)[..., None] * np.stack((-np.sin(heading), np.cos(heading)), axis=-1)


def test_position_and_heading_against_quadrature_over_10_km() -> None:
    elements = mixed_elements()
    alignment = Alignment(elements, 100.0, -50.0, 0.7)
    assert alignment.length == pytest.approx(10_000.0, abs=1e-9)
    stations = np.sort(np.concatenate((np.linspace(0.0, alignment.length, 121), alignment.element_starts[1:])))
    truth = quadrature(elements, 100.0, -50.0, 0.7, stations)
    assert np.abs(alignment.position(stations) - truth).max() < 1e-6
    headings = [exact_heading(elements, 0.7, station) for station in stations]
    assert np.abs(alignment.heading(stations) - headings).max() < 1e-9


@pytest.mark.parametrize(("a", "length"), [(300.0, 100.0), (30.0, 200.0), (1e7, 1000.0)])
def test_clothoid_against_fresnel_integrals(a: float, length: float) -> None:
    """From the straight, x + iy = a sqrt(pi) (C + iS)(s / (a sqrt(pi))); a = 30 m turns by 22 rad."""
    s = np.linspace(0.0, length, 50)
    scale = a * math.sqrt(math.pi)
    sine, cosine = fresnel(s / scale)
    alignment = Alignment(chain((length, 0.0, length / a**2)))
    assert np.abs(alignment.position(s) - scale * np.column_stack((cosine, sine))).max() < 1e-9


def test_arc_and_line_against_closed_forms() -> None:
    s = np.linspace(0.0, 200.0, 41)
    arc = Alignment(chain((200.0, -1 / 40, -1 / 40))).position(s)
    np.testing.assert_allclose(arc, 40 * np.column_stack((np.sin(s / 40), np.cos(s / 40) - 1)), atol=1e-11)
    line = Alignment(chain((200.0, 0.0, 0.0)), 5.0, 6.0, math.pi / 2).position(s)
    np.testing.assert_allclose(line, np.column_stack((np.full(41, 5.0), 6.0 + s)), atol=1e-12)


def test_nearly_equal_curvatures_go_over_into_the_arc() -> None:
    """1/900 to 1/900.0001 differs from the arc by what the mean change of curvature explains, and no more."""
    s = np.linspace(0.0, 500.0, 26)
    arc = Alignment(chain((500.0, 1 / 900, 1 / 900)))
    near = Alignment(chain((500.0, 1 / 900, 1 / 900.0001)))
    gap = np.hypot(*(near.position(s) - arc.position(s)).T)
    bound = abs(1 / 900 - 1 / 900.0001) * s**3 / (6 * 500.0)
    assert (gap <= 1.01 * bound + 1e-12).all()
    assert gap[-1] > 0.5 * bound[-1]


def test_a_road_of_1_m_and_one_of_100_km() -> None:
    short = Alignment(chain((0.3, 0.0, 0.02), (0.4, 0.02, 0.02), (0.3, 0.02, 0.0)), heading=1.0)
    stations = np.linspace(0.0, 1.0, 11)
    truth = quadrature(list(short.elements), 0.0, 0.0, 1.0, stations)
    assert np.abs(short.position(stations) - truth).max() < 1e-12
    elements = []
    for turn in range(100):
        k = (-1) ** turn / 1000
        elements += chain((250.0, 0.0, k), (500.0, k, k), (250.0, k, 0.0))
    long = Alignment(elements)
    assert long.length == 100_000.0
    stations = np.array([0.0, 777.7, 25_000.0, 60_123.4, 100_000.0])
    truth = quadrature(elements, 0.0, 0.0, 0.0, stations)
    assert np.abs(long.position(stations) - truth).max() < 1e-6


def test_end_heading_is_the_sum_of_the_turns() -> None:
    radii = [(500, 0, 0), (100, 0, 1 / 900), (400, 1 / 900, 1 / 900), (100, 1 / 900, 0)]
    radii += [(150, 0, -1 / 1200), (300, -1 / 1200, -1 / 1200), (150, -1 / 1200, 0), (200, 0, 0)]
    alignment = Alignment(chain(*radii))
    by_hand = 100 / 1800 + 400 / 900 + 100 / 1800 - 150 / 2400 - 300 / 1200 - 150 / 2400
    assert float(alignment.heading(alignment.length)) == pytest.approx(by_hand, abs=1e-14)


def test_straight_on_beyond_the_ends() -> None:
    alignment = Alignment(chain((100.0, 1 / 50, 1 / 80)), 7.0, 8.0, 0.3)
    before, after = alignment.frame(np.array([-30.0, 0.0])), alignment.frame(np.array([100.0, 140.0]))
    np.testing.assert_allclose(before[0][0], before[0][1] - 30 * np.array([math.cos(0.3), math.sin(0.3)]), atol=1e-12)
    turned = 0.3 + 50.0 * (1 / 50 + 1 / 80)
    np.testing.assert_allclose(after[1], turned, atol=1e-14)
    np.testing.assert_allclose(
        after[0][1] - after[0][0], 40 * np.array([math.cos(turned), math.sin(turned)]), atol=1e-12
    )
    np.testing.assert_allclose(np.concatenate((before[2], after[2])), [0.0, 1 / 50, 1 / 80, 0.0], atol=1e-15)


def test_curvature_at_a_border_is_that_of_the_next_element() -> None:
    alignment = Alignment(chain((10.0, 0.0, 0.0), (10.0, 0.01, 0.02)))
    np.testing.assert_allclose(alignment.curvature([9.999, 10.0, 15.0, 20.0]), [0.0, 0.01, 0.015, 0.02], atol=1e-12)


def test_shapes_follow_the_stations() -> None:
    alignment = Alignment(mixed_elements())
    assert alignment.position(5.0).shape == (2,)
    assert np.ndim(alignment.heading(5.0)) == 0
    assert np.ndim(alignment.curvature(5)) == 0
    position, heading, curvature = alignment.frame(np.zeros((2, 3)))
    assert (position.shape, heading.shape, curvature.shape) == ((2, 3, 2), (2, 3), (2, 3))
    assert alignment.position([]).shape == (0, 2)


def test_many_stations_at_once_equal_few() -> None:
    alignment = Alignment(mixed_elements())
    s = np.linspace(-10.0, 10_010.0, 200_003)
    np.testing.assert_array_equal(alignment.position(s)[::5000], alignment.position(s[::5000]))


def test_mirrored_alignment_gives_mirrored_result() -> None:
    elements = mixed_elements()
    mirrored = [Element(e.length, -e.curvature_start, -e.curvature_end) for e in elements]
    a, b = Alignment(elements, 3.0, 4.0, 0.5), Alignment(mirrored, 3.0, -4.0, -0.5)
    s = np.linspace(-50.0, 10_050.0, 1001)
    np.testing.assert_allclose(a.position(s), b.position(s) * [1.0, -1.0], atol=1e-8)
    np.testing.assert_allclose(a.heading(s), -b.heading(s), atol=1e-12)
    points = left_of(a, s, 15.0 * np.sin(s))
    station, offset = a.project(points)
    mirrored_station, mirrored_offset = b.project(points * [1.0, -1.0])
    np.testing.assert_allclose(station, mirrored_station, atol=1e-7)
    np.testing.assert_allclose(offset, -mirrored_offset, atol=1e-7)


element_rows = st.tuples(st.floats(1.0, 300.0), st.floats(-1 / 60, 1 / 60), st.floats(-1 / 60, 1 / 60))


@given(
    rows=st.lists(element_rows, min_size=1, max_size=6),
    shift=st.tuples(st.floats(-6e6, 6e6), st.floats(-6e6, 6e6)),
    turn=st.floats(-7.0, 7.0),
)
@settings(max_examples=60, deadline=None)
def test_moving_and_turning_the_start_moves_and_turns_the_road(
    rows: list[tuple[float, float, float]], shift: tuple[float, float], turn: float
) -> None:
    plain, moved = Alignment(chain(*rows)), Alignment(chain(*rows), *shift, turn)
    s = np.linspace(-20.0, plain.length + 20.0, 40)
    turned = (plain.position(s) @ np.array([1.0, 1j])) * np.exp(1j * turn) + complex(*shift)
    np.testing.assert_allclose(moved.position(s) @ np.array([1.0, 1j]), turned, atol=2e-8, rtol=0)
    np.testing.assert_allclose(moved.heading(s), plain.heading(s) + turn, atol=1e-12)


@given(
    rows=st.lists(element_rows, min_size=1, max_size=5),
    share=st.floats(-1.0, 1.0),
    where=st.floats(-0.2, 1.2),
)
@settings(max_examples=150, deadline=None)
def test_project_is_the_inverse_where_the_foot_is_unique(
    rows: list[tuple[float, float, float]], share: float, where: float
) -> None:
    alignment = Alignment(chain(*rows))
    station = where * alignment.length
    sharpest = max(abs(k) for row in rows for k in row[1:])
    offset = share * min(300.0, 0.9 / max(sharpest, 1e-9))
    point = left_of(alignment, np.array([station]), np.array([offset]))
    distance = np.hypot(*(alignment.position(np.linspace(0.0, alignment.length, 4000)) - point).T)
    nearest = distance.min()
    found, lateral = (float(value[0]) for value in alignment.project(point))
    same = found == pytest.approx(station, abs=1e-6) and lateral == pytest.approx(offset, abs=1e-6)
    if 0.0 <= station <= alignment.length:
        # Another part of the road may be nearer, or (to within the samples' spacing) as near.
        assert same or (nearest < abs(offset) + 1e-3 and abs(lateral) <= nearest + 1e-6)
    elif 0 < distance.argmin() < 3999:
        assert 0.0 <= found <= alignment.length  # the road comes first
        assert abs(lateral) <= nearest + 1e-6
    else:
        assert same or abs(lateral) < abs(offset) + 1e-6  # the tangents may cross


def test_round_trip_at_large_offsets_on_every_element() -> None:
    """Up to 0.9 of the radius and 300 m, at map coordinates of 5.6e6 m; points beyond the ends as well."""
    for radius in (40.0, 280.0, 900.0):
        k = 1 / radius
        rows = (0.5 * radius, 0.0, k), (0.8 * radius, k, k), (0.4 * radius, k, 0.2 * k), (0.5 * radius, 0.2 * k, 0.0)
        alignment = Alignment(chain(*rows), 3.5e5, 5.6e6, 1.0)
        reach = min(300.0, 0.9 * radius)
        station, offset = np.meshgrid(np.linspace(-50.0, alignment.length + 50.0, 301), np.linspace(-reach, reach, 31))
        found, lateral = alignment.project(left_of(alignment, station, offset).reshape(-1, 2))
        assert np.abs(found - station.ravel()).max() < 1e-6
        assert np.abs(lateral - offset.ravel()).max() < 1e-6


def test_project_finds_the_nearest_point_of_the_road_wherever_the_point_is() -> None:
    """Random points, most of them far beyond the centres of curvature, against a search at 0.1 m."""
    rng = np.random.default_rng(3)
    rows = (
        (120.0, 0.0, 1 / 60),
        (150.0, 1 / 60, 1 / 60),
        (90.0, 1 / 60, -1 / 45),
        (200.0, -1 / 45, -1 / 45),
        (80.0, -1 / 45, 0),
    )
    alignment = Alignment(chain(*rows))
    dense = alignment.position(np.arange(0.0, alignment.length, 0.1))
    points = rng.uniform(dense.min(axis=0) - 250.0, dense.max(axis=0) + 250.0, (3000, 2))
    station, offset = alignment.project(points)
    nearest = np.array([np.hypot(*(dense - point).T).min() for point in points])
    on_road = (station > 0) & (station < alignment.length)
    assert 1000 < on_road.sum() < 3000
    assert (np.abs(offset) <= nearest + 1e-9).all()
    assert (nearest[on_road] <= np.hypot(offset[on_road], 0.06 * (1 + np.abs(offset[on_road]) / 45))).all()
    feet, heading, _ = alignment.frame(station)
    across = np.sum((points - feet) * np.column_stack((np.cos(heading), np.sin(heading))), axis=1)
    assert np.abs(across).max() < 1e-8


def test_a_road_that_crosses_its_own_prolongation_is_measured_on_the_road() -> None:
    """After 300 degrees of turn the last straight crosses the line from which the road came."""
    alignment = Alignment(chain((80.0 * math.radians(300.0), 1 / 80, 1 / 80), (100.0, 0.0, 0.0)))
    s = np.linspace(alignment.element_starts[1], alignment.length, 201)
    points = left_of(alignment, s, np.full(s.size, 0.25))
    assert (points[0, 1], points[-1, 1]) == (pytest.approx(40.0, abs=1.0), pytest.approx(-46.6, abs=1.0))
    assert (points[np.abs(points[:, 1]) < 1.0, 0] < -40.0).all()  # on the start's prolongation, the negative x axis
    station, offset = alignment.project(points)
    np.testing.assert_allclose(station, s, atol=1e-7)
    np.testing.assert_allclose(offset, 0.25, atol=1e-9)


def test_points_beyond_the_ends() -> None:
    alignment = Alignment(chain((100.0, 0.0, 0.01), (50.0, 0.01, 0.01)), 10.0, 20.0, -2.0)
    s, d = np.array([-1e4, -70.0, -1e-3, 150.001, 200.0, 3e4]), np.array([3.0, -40.0, 1.0, -2.0, 30.0, -7.0])
    station, offset = alignment.project(left_of(alignment, s, d))
    np.testing.assert_allclose(station, s, atol=1e-7)
    np.testing.assert_allclose(offset, d, atol=1e-7)


def test_project_near_stays_on_its_branch() -> None:
    """On three turns of one circle every station has two others at the same place."""
    alignment = Alignment(chain((2 * math.pi * 50.0 * 3, 1 / 50, 1 / 50)))
    s = np.linspace(-5.0, alignment.length + 5.0, 400)
    station, offset = alignment.project_near(left_of(alignment, s, np.full(400, -2.0)), s + 3.0 * np.sin(s), 20.0)
    np.testing.assert_allclose(station, s, atol=1e-7)
    np.testing.assert_allclose(offset, -2.0, atol=1e-9)


def test_order_and_number_of_points_make_no_difference() -> None:
    rng = np.random.default_rng(5)
    alignment = Alignment(mixed_elements())
    s = rng.uniform(0.0, alignment.length, 30_000)
    points = left_of(alignment, s, rng.uniform(-30.0, 30.0, s.size))
    station, offset = alignment.project(points)
    order = np.argsort(s)
    sorted_station, sorted_offset = alignment.project(points[order])
    np.testing.assert_allclose(sorted_station, station[order], atol=1e-9)
    np.testing.assert_allclose(sorted_offset, offset[order], atol=1e-9)
    single = alignment.project(points[:1])
    np.testing.assert_allclose((single[0][0], single[1][0]), (station[0], offset[0]), atol=1e-9)
    assert [part.shape for part in alignment.project(np.empty((0, 2)))] == [(0,), (0,)]


def test_the_centre_of_a_circle_is_as_far_as_its_radius() -> None:
    alignment = Alignment(chain((2 * math.pi * 50.0, 1 / 50, 1 / 50)))
    station, offset = alignment.project(np.tile([0.0, 50.0], (5000, 1)))
    np.testing.assert_allclose(offset, 50.0, atol=1e-9)
    assert ((station >= 0) & (station <= alignment.length)).all()


def test_a_million_points_in_two_seconds_and_bounded_memory() -> None:
    rng = np.random.default_rng(7)
    alignment = Alignment(mixed_elements())
    s = rng.uniform(0.0, alignment.length, 1_000_000)
    points = left_of(alignment, s, rng.uniform(-35.0, 35.0, s.size))
    assert quiet_seconds(lambda: alignment.project(points)) < 2.0
    station, _ = alignment.project(points)
    assert np.mean(np.abs(station - s) < 1e-6) > 0.999
    tracemalloc.start()
    alignment.project(points)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 12 * points.nbytes  # results, the coordinates in columns, and the halved parts on the stack


@pytest.mark.parametrize(
    ("row", "kind"),
    [
        ((100.0, 0.0, 0.0), "line"),
        ((100.0, 1e-12, -1e-12), "line"),
        ((2000.0, 1e-12, 1e-12), "line"),
        ((100.0, 1 / 900, 1 / 900), "arc"),
        ((100.0, -1 / 900, -1 / 900.0001), "arc"),
        ((100.0, 1e-6, 1e-6), "arc"),
        ((100.0, 1 / 900, 1 / 901), "clothoid"),
        ((100.0, -1e-5, 1e-5), "clothoid"),
        ((0.001, 0.0, 0.5), "clothoid"),
    ],
)
def test_kinds(row: tuple[float, float, float], kind: str) -> None:
    assert Element(*row).kind == kind


@given(st.floats(1e-3, 5e3), st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3))
def test_an_arc_is_never_without_mean_curvature(length: float, start: float, end: float) -> None:
    element = Element(length, start, end)
    assert element.kind != "arc" or element.mean_curvature != 0.0


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Element(NAN, 0.0, 0.0), "element.length"),
        (lambda: Element(0.0, 0.0, 0.0), "element.length"),
        (lambda: Element(-1.0, 0.0, 0.0), "element.length"),
        (lambda: Element(INF, 0.0, 0.0), "element.length"),
        (lambda: Element(1.0, NAN, 0.0), "element.curvature_start"),
        (lambda: Element(1.0, 0.0, INF), "element.curvature_end"),
        (lambda: Element(1.0, 0.0, 900.0), "element.curvature_end"),
        (lambda: Alignment([]), "alignment.elements"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0)), x=NAN), "alignment.x"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0)), y=INF), "alignment.y"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0)), heading=NAN), "alignment.heading"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0))).position([0.0, NAN]), r"station\[1\]"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0))).heading(INF), "station"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0))).curvature("here"), "station"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0))).project([[0.0, 0.0], [1.0, NAN]]), r"points\[1\]\[1\]"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0))).project([[0.0, 0.0, 0.0]]), "points"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0))).project_near([[0.0, 0.0]], [NAN], 1.0), "station"),
        (lambda: Alignment(chain((1.0, 0.0, 0.0))).project_near([[0.0, 0.0]], [0.0, 1.0], 1.0), "points"),
        (lambda: clip_offset(NAN, 0.0), "offset"),
        (lambda: clip_offset(1.0, INF), "curvature"),
    ],
)
def test_bad_input_is_refused_by_name(make: object, named: str) -> None:
    with pytest.raises(InputError, match=f"^{named}"):
        make()  # type: ignore[operator]


def test_offsets_are_cut_before_they_fold() -> None:
    offset = np.array([-100.0, -39.0, 0.0, 39.0, 40.0, 100.0])
    np.testing.assert_allclose(clip_offset(offset, 1 / 40), [-100.0, -39.0, 0.0, 39.0, 39.2, 39.2])
    np.testing.assert_allclose(clip_offset(offset, -1 / 40), [-39.2, -39.0, 0.0, 39.0, 40.0, 100.0])
    np.testing.assert_array_equal(clip_offset(offset, 0.0), offset)
    assert np.ndim(clip_offset(50.0, 1 / 40)) == 0


@given(st.floats(-1e4, 1e4), st.floats(-1.0, 1.0))
def test_a_cut_offset_keeps_its_share_of_the_radius(offset: float, curvature: float) -> None:
    cut, share = float(clip_offset(offset, curvature)), 0.98
    assert curvature * cut <= share * (1 + 1e-12)
    assert cut == offset or curvature * offset > share
    assert abs(cut) <= abs(offset)


def test_running_sum_does_not_drift() -> None:
    values = [0.1] * 100_000
    sums = running_sum(values)
    assert sums[-1] == pytest.approx(math.fsum(values), abs=2e-12)
    assert np.abs(sums - 0.1 * np.arange(100_001)).max() < 1e-11
    assert abs(np.cumsum(values)[-1] - 10_000.0) > 1e-9  # what it is there for
