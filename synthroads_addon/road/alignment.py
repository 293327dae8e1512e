"""Horizontal alignment: lines, arcs and clothoids chained from a start point and heading.

Everything is parameterised by curvature, which varies linearly along an element, so that a line, an arc, a clothoid
and anything nearly one of them are the same case. The heading is then a quadratic of the station and exact; the
position is its integral, for which no closed form is stable. Each element is cut into pieces that turn by at most
0.25 rad. On a piece z(v) = x + iy is a power series in v = u / h, u the station from the piece's middle and h half its
length: with K = k h and C = k' h^2 the direction w = exp(i (K v + C v^2 / 2)) obeys w' = i (K + C v) w, hence

    w[n+1] = i (K w[n] + C w[n-1]) / (n + 1),        z[n+1] = h w[n] / (n + 1).

Twelve terms leave less than 1e-14 of the piece's length. Nothing is divided by a radius or by a difference of
curvatures, so infinity and nearly equal radii need no branch.

Beyond its ends an alignment goes on straight along its end tangents.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arithmetic.loops import point_loops
from ..base.arrays import Float, Int
from ..base.errors import InputError

Kind = Literal["line", "arc", "clothoid"]

#: A change of curvature times length below this (rad) is an arc or a line: a clothoid so flat breaks other programs'
#: formulas (IFC readers divide by the difference), and the arc through it is less than 1e-7 of its length away.
FLAT_CLOTHOID = 1e-6
#: A turn below this (rad) is a line: 0.1 mm of deviation on the longest straight the rules allow, 2 km.
FLAT_ARC = 1e-7
#: Curvatures beyond this (1/m) are refused: no road has a radius under a metre, but a radius typed as a curvature is.
CURVATURE_LIMIT = 1.0

_PIECE_TURN = 0.25  # rad
_TERMS = 12
_NODE_SPACING = 20.0  # m, of the coarse nodes that start a projection
_LEAF = 4096  # points projected at a time: their temporaries stay in the cache
_PAIRS = 1_000_000  # distances held at a time
_BLOCK = 65_536  # stations evaluated at a time
_ITERATIONS = 60
_REACH = 0.98  # of the radius that an offset may use


@dataclass(frozen=True)
class Element:
    """One element of a horizontal alignment; its curvature varies linearly with the station.

    Attributes:
        length: m, > 0.
        curvature_start: 1/m at its start, positive in a left curve.
        curvature_end: 1/m at its end.

    Raises:
        InputError: a value is not a finite number or out of range.

    Example:
        >>> Element(length=90.0, curvature_start=0.0, curvature_end=1 / 300).kind
        'clothoid'
        >>> round(Element(90.0, 0.0, 1 / 300).turn, 3)
        0.15
    """

    length: float
    curvature_start: float
    curvature_end: float

    def __post_init__(self) -> None:
        finite_array("element.length", self.length)
        if self.length <= 0:
            raise InputError("element.length", self.length, "a length above 0 m is needed")
        for name in ("curvature_start", "curvature_end"):
            value = getattr(self, name)
            finite_array(f"element.{name}", value)
            if abs(value) > CURVATURE_LIMIT:
                raise InputError(f"element.{name}", value, f"from -{CURVATURE_LIMIT:g} to {CURVATURE_LIMIT:g} 1/m")

    @property
    def kind(self) -> Kind:
        """Return "line", "arc" or "clothoid", told by angles (`FLAT_CLOTHOID`, `FLAT_ARC`) whatever the scale.

        What is no clothoid is well represented by `mean_curvature`, which is not zero where the kind is "arc".
        """
        if abs(self.curvature_end - self.curvature_start) * self.length >= FLAT_CLOTHOID:
            return "clothoid"
        return "arc" if abs(self.turn) >= FLAT_ARC else "line"

    @property
    def mean_curvature(self) -> float:
        """Mean of both curvatures, 1/m."""
        return 0.5 * (self.curvature_start + self.curvature_end)

    @property
    def turn(self) -> float:
        """Change of heading along the element, rad."""
        return self.mean_curvature * self.length


class Alignment:
    """A horizontal alignment: lines, arcs and clothoids chained from a start, evaluated at stations and inverted.

    Stations are metres along the axis in the map plane, 0 at the start. At an element's border curvature is that of
    the element which begins there; at the very end that of the last one; beyond the ends it is 0.

    Attributes:
        elements: tuple of E elements.
        element_starts: (E + 1,) stations of their borders, the last one the length.
        length: m.
        x, y: map position of the start, m.
        start_heading: rad, counter-clockwise from +x (east).

    Example:
        >>> import numpy as np
        >>> straight, half_circle = Element(100.0, 0.0, 0.0), Element(100.0 * np.pi, 0.01, 0.01)
        >>> axis = Alignment([straight, half_circle])  # from (0, 0) to the east
        >>> axis.position(axis.length).round(3).tolist()
        [100.0, 200.0]
        >>> station, offset = axis.project([[50.0, 3.5]])
        >>> station.round(3).tolist(), offset.round(3).tolist()
        ([50.0], [3.5])
    """

    def __init__(self, elements: Sequence[Element], x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Chain elements from x, y (m) and a heading (rad); InputError without any or for a value that isn't finite."""
        for name, value in (("x", x), ("y", y), ("heading", heading)):
            finite_array(f"alignment.{name}", value)
        if not elements:
            raise InputError("alignment.elements", None, "at least one element is needed")
        self.elements = tuple(elements)
        self.x, self.y, self.start_heading = float(x), float(y), float(heading)
        lengths = [element.length for element in self.elements]
        self.element_starts = running_sum(lengths)
        self.length = float(self.element_starts[-1])
        headings = self.start_heading + running_sum([element.turn for element in self.elements])
        self._build_pieces(np.asarray(lengths), headings)
        self._nodes = self._build_nodes()

    def _build_pieces(self, lengths: Float, headings: Float) -> None:
        """Store the power series of all pieces of the elements, first and last the tangents beyond the ends.

        Args:
            lengths: (E,) of the elements, m.
            headings: (E + 1,) at the elements' borders, rad.
        """
        k_start = np.array([element.curvature_start for element in self.elements])
        k_change = np.array([element.curvature_end for element in self.elements]) - k_start
        largest_curvature = np.maximum(np.abs(k_start), np.abs(k_start + k_change))
        count = np.maximum(1, np.ceil(largest_curvature * lengths / _PIECE_TURN)).astype(np.int64)
        element_of_piece = np.repeat(np.arange(len(count)), count)
        first_piece = np.cumsum(count) - count
        number_in_element = np.arange(len(element_of_piece)) - first_piece[element_of_piece]
        middle_share = (number_in_element + 0.5) / count[element_of_piece]  # as a share of the element
        half_length = 0.5 * lengths[element_of_piece] / count[element_of_piece]
        heading = headings[element_of_piece] + lengths[element_of_piece] * middle_share * (
            k_start[element_of_piece] + 0.5 * middle_share * k_change[element_of_piece]
        )
        curvature = k_start[element_of_piece] + middle_share * k_change[element_of_piece]
        curvature_rate = k_change[element_of_piece] / lengths[element_of_piece]
        series = _position_series(curvature * half_length, curvature_rate * half_length**2) * (
            half_length * np.exp(1j * heading)
        )
        # A piece runs over v from -1 to 1: z(1) - z(-1) is twice the sum of the odd terms, and z(-1) is the even terms'
        # sum less that of the odd ones. The constant term is chosen so that each piece starts where the last one ended.
        piece_vectors = 2.0 * series[1::2].sum(axis=0)
        piece_starts = np.concatenate(([0.0], np.cumsum(piece_vectors)))
        series[0] = piece_starts[:-1] - (series[2::2].sum(axis=0) - series[1::2].sum(axis=0))
        tangent_series = np.zeros((_TERMS + 1, 2), complex)
        tangent_series[0] = 0.0, piece_starts[-1]
        tangent_series[1] = np.exp(1j * headings[[0, -1]])

        def with_ends(first_value: float, piece_values: Float, last_value: float) -> Float:
            """Return the pieces' values between one for what lies before the axis and one for what lies behind."""
            return np.concatenate(([first_value], piece_values, [last_value]))

        series = np.concatenate((tangent_series[:, :1], series, tangent_series[:, 1:]), axis=1)
        self._series_x, self._series_y = np.ascontiguousarray(series.real), np.ascontiguousarray(series.imag)
        self._middles = with_ends(
            0.0, self.element_starts[:-1][element_of_piece] + middle_share * lengths[element_of_piece], self.length
        )
        self._halves = with_ends(1.0, half_length, 1.0)
        self._headings = with_ends(headings[0], heading, headings[-1])
        self._bends, self._slopes = with_ends(0.0, curvature, 0.0), with_ends(0.0, curvature_rate, 0.0)
        borders = (
            self.element_starts[:-1][element_of_piece]
            + lengths[element_of_piece] * number_in_element / count[element_of_piece]
        )
        # The end itself belongs to the last element.
        self._borders = np.concatenate((borders, [np.nextafter(self.length, np.inf)]))

    def _build_nodes(self) -> Float:
        """Return station, x, y (M, 3) of coarse nodes along the axis, ends included, at most `_NODE_SPACING` apart."""
        borders = np.concatenate((self._borders[:-1], [self.length]))
        count = np.maximum(1, np.ceil(np.diff(borders) / _NODE_SPACING)).astype(np.int64)
        piece_of_node = np.repeat(np.arange(len(count)), count)
        number_in_piece = np.arange(len(piece_of_node)) - (np.cumsum(count) - count)[piece_of_node]
        station = np.append(
            borders[piece_of_node] + np.diff(borders)[piece_of_node] * number_in_piece / count[piece_of_node],
            self.length,
        )
        x, y, _, _ = self._evaluate(station)
        return np.column_stack((station, x, y))

    def _evaluate(self, station: Float) -> tuple[Float, Float, Float, Float]:
        """Return x and y less the start's (m), heading (rad) and curvature (1/m), each (N,), at stations (N,)."""
        if (loops := point_loops()) is not None:
            columns = (self._middles, self._halves, self._bends, self._slopes, self._headings)
            x, y, heading, curvature = loops.evaluate_pieces(
                station, (self._borders, *columns, self._series_x, self._series_y)
            )
            return x, y, heading, curvature
        piece = np.searchsorted(self._borders, station, side="right")
        u = station - self._middles[piece]
        v = u / self._halves[piece]
        x, y = self._series_x[_TERMS][piece], self._series_y[_TERMS][piece]
        for n in range(_TERMS - 1, -1, -1):
            x *= v
            x += self._series_x[n][piece]
            y *= v
            y += self._series_y[n][piece]
        curvature, curvature_change = self._bends[piece], self._slopes[piece] * u
        return x, y, self._headings[piece] + u * (curvature + 0.5 * curvature_change), curvature + curvature_change

    def frame(self, station: ArrayLike) -> tuple[Float, Float, Float]:
        """Return position (..., 2) m, heading (...) rad and curvature (...) 1/m at stations of any shape.

        The heading is not wrapped: it goes on counting through full turns. InputError for stations that aren't finite.
        """
        stations = finite_array("station", station)
        flat_stations = stations.ravel()
        columns = np.empty((4, flat_stations.size))
        for start in range(0, flat_stations.size, _BLOCK):
            block = slice(start, start + _BLOCK)
            columns[:, block] = self._evaluate(flat_stations[block])
        position = np.stack((columns[0] + self.x, columns[1] + self.y), axis=-1).reshape(*stations.shape, 2)
        return position, columns[2].reshape(stations.shape)[()], columns[3].reshape(stations.shape)[()]

    def position(self, station: ArrayLike) -> Float:
        """Return the axis' map positions (..., 2), m, at stations (...)."""
        return self.frame(station)[0]

    def place(self, station: Float, offset: Float) -> Float:
        """Return the map positions (N, 2) of stations and offsets (N,), m."""
        position, heading, _ = self.frame(station)
        return position + offset[:, None] * left_vectors(heading)

    def heading(self, station: ArrayLike) -> Float:
        """Return the axis' heading (...) at stations (...), rad, counter-clockwise from +x, not wrapped."""
        return self.frame(station)[1]

    def curvature(self, station: ArrayLike) -> Float:
        """Return the axis' curvature (...) at stations (...), 1/m, positive in a left curve."""
        return self.frame(station)[2]

    def project(self, points: ArrayLike) -> tuple[Float, Float]:
        """Return station and offset (N,), m, of map points (N, 2) projected onto the axis; offset positive to the left.

        The foot is the road's nearest point. The tangents beyond the ends serve the points whose nearest point of the
        road is an end (the nearer tangent, if both would do), so a road that bends round and crosses its own
        prolongation is measured on the road.
        Memory beyond the result is bounded. InputError for a wrong shape or points that aren't finite.
        """
        xy = finite_array("points", points)
        if xy.ndim != 2 or xy.shape[1] != 2:
            raise InputError("points", xy.shape, "an array of shape (N, 2) is needed")
        station, offset = np.empty(len(xy)), np.empty(len(xy))
        for indices, x, y, nodes in self._point_groups(xy[:, 0] - self.x, xy[:, 1] - self.y):
            station[indices], offset[indices] = self._project_leaf(x, y, nodes)
        return station, offset

    def project_near(self, points: ArrayLike, station: ArrayLike, reach: float) -> tuple[Float, Float]:
        """Return station and offset (N,) of points (N, 2) whose stations are known to within `reach` metres.

        Faster than `project`, it cannot stray to another branch of a road that crosses itself, and it takes the
        tangents beyond the ends like the road. A foot farther away is replaced by the end of the reach.
        """
        known_station, xy = finite_array("station", station), finite_array("points", points)
        if xy.shape != (*known_station.shape, 2) or known_station.ndim != 1:
            raise InputError(
                "points", xy.shape, f"the shape ({known_station.size}, 2) is needed, one point per station"
            )
        x, y = xy[:, 0] - self.x, xy[:, 1] - self.y
        foot, _, offset = self._find_feet(x, y, known_station, known_station - reach, known_station + reach)
        return foot, offset

    def _point_groups(self, x: Float, y: Float) -> Iterator[tuple[Int, Float, Float, Int]]:
        """Yield compact groups of the points: indices, x, y, and the indices of all nodes that may be nearest to them.

        Points in any order thus fall into compact boxes, and each box meets only the nodes around it.
        """
        stack = [(np.arange(len(x)), x, y)] if len(x) else []
        while stack:
            indices, x, y = stack.pop()
            lower, upper = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
            if len(indices) <= _LEAF:
                nodes = self._nodes_near(lower, upper)
                if len(indices) * len(nodes) <= _PAIRS or len(indices) <= 16:
                    yield indices, x, y, nodes
                    continue
            half_count = len(indices) // 2
            order = np.argpartition(x if upper[0] - lower[0] > upper[1] - lower[1] else y, half_count)
            stack += [(indices[part], x[part], y[part]) for part in (order[:half_count], order[half_count:])]

    def _nodes_near(self, lower: Float, upper: Float) -> Int:
        """Return the indices of all nodes that may lie next to the foot of a point in the box from low to high (2,).

        The nearest node of a point is at most half a spacing farther than its foot, hence the margin.
        """
        nodes = self._nodes[:, 1:]
        least_distances = np.hypot(*np.maximum(np.maximum(lower - nodes, nodes - upper), 0.0).T)
        largest_distances = np.hypot(*np.maximum(nodes - lower, upper - nodes).T)
        return np.flatnonzero(least_distances <= largest_distances.min() + _NODE_SPACING)

    def _project_leaf(self, x: Float, y: Float, nodes: Int) -> tuple[Float, Float]:
        """Return station and offset (K,) of points: of the feet found from each locally nearest node the nearest."""
        point_index, column = _candidate_nodes(x, y, self._nodes[nodes, 1], self._nodes[nodes, 2])
        node_index = nodes[column]
        stations = self._nodes[:, 0]
        lower_station = stations[np.maximum(node_index - 1, 0)]
        upper_station = stations[np.minimum(node_index + 1, len(stations) - 1)]
        station, rest, offset = self._find_feet(
            x[point_index], y[point_index], stations[node_index], lower_station, upper_station
        )
        if len(point_index) > len(x):
            order = np.lexsort((np.hypot(rest, offset), point_index))
            # `point_index` is sorted, and within a point the nearest foot comes first: its first row is its best.
            best_foot = order[np.searchsorted(point_index, np.arange(len(x)))]
            station, rest, offset = station[best_foot], rest[best_foot], offset[best_foot]
        is_beyond_end = ((station <= 0.0) & (rest < 0.0)) | ((station >= self.length) & (rest > 0.0))
        if is_beyond_end.any():
            station[is_beyond_end], offset[is_beyond_end] = self._project_on_tangents(
                x[is_beyond_end], y[is_beyond_end]
            )
        return station, offset

    def _project_on_tangents(self, x: Float, y: Float) -> tuple[Float, Float]:
        """Return station and offset (K,), m, of points beyond an end, on the nearer of both end tangents."""
        projections = []
        for end_station, outward in ((0.0, -1.0), (self.length, 1.0)):
            px, py, heading, _ = (float(value[0]) for value in self._evaluate(np.array([end_station])))
            distance_along = (x - px) * np.cos(heading) + (y - py) * np.sin(heading)
            offset = (y - py) * np.cos(heading) - (x - px) * np.sin(heading)
            projections.append(
                (end_station + distance_along, offset, np.where(distance_along * outward > 0.0, np.abs(offset), np.inf))
            )
        (station_0, offset_0, distance_0), (station_1, offset_1, distance_1) = projections
        end_is_nearer = distance_1 < distance_0
        return np.where(end_is_nearer, station_1, station_0), np.where(end_is_nearer, offset_1, offset_0)

    def _find_feet(
        self, x: Float, y: Float, station: Float, lower_station: Float, upper_station: Float
    ) -> tuple[Float, Float, Float]:
        """Return the points' feet, found by iteration within brackets of stations, and their distances from there, m.

        The step is exact on a circle: with g along and d across, the angle at its centre is atan2(k g, 1 - k d). A
        step that leaves the bracket, which narrows by the sign of g, is replaced by bisection.
        Returns station, the rest g along the tangent (0 but at the road's ends) and the offset d.
        """
        if (loops := point_loops()) is not None:
            return loops.find_feet(self._evaluate, (x, y), (station, lower_station, upper_station), _ITERATIONS)
        station, lower_station, upper_station = station.copy(), lower_station.copy(), upper_station.copy()
        rest, offset = np.empty_like(station), np.empty_like(station)
        unfinished = np.arange(len(station))
        for _ in range(_ITERATIONS):
            s = station[unfinished]
            px, py, heading, curvature = self._evaluate(s)
            dx, dy, cos, sin = x[unfinished] - px, y[unfinished] - py, np.cos(heading), np.sin(heading)
            g, d = dx * cos + dy * sin, dy * cos - dx * sin
            rest[unfinished], offset[unfinished] = g, d
            lower_station[unfinished] = lower_bracket = np.where(g > 0, s, lower_station[unfinished])
            upper_station[unfinished] = upper_bracket = np.where(g < 0, s, upper_station[unfinished])
            next_station = s + _arc_to_foot(g, d, curvature)
            is_outside = ~((next_station >= lower_bracket) & (next_station <= upper_bracket))
            # At the road's end the bracket closes at once; elsewhere its middle is a safe guess.
            next_station[is_outside] = 0.5 * (lower_bracket + upper_bracket)[is_outside]
            station[unfinished] = next_station
            unfinished = unfinished[np.abs(next_station - s) > 1e-7]
            if not len(unfinished):
                break
        return station, rest, offset


def _position_series(curvature: Float, curvature_rate: Float) -> NDArray[np.complex128]:
    """Return the position's complex coefficients (terms + 1, P) for unit half length; the constant is left 0."""
    w = np.zeros((_TERMS + 1, len(curvature)), complex)
    z = np.zeros_like(w)
    w[0] = 1.0
    for n in range(_TERMS):
        z[n + 1] = w[n] / (n + 1)
        w[n + 1] = 1j * (curvature * w[n] + (curvature_rate * w[n - 1] if n else 0.0)) / (n + 1)
    return z


def _arc_to_foot(along: Float, offset: Float, curvature: Float) -> Float:
    """Return the arc length (m) along the circle of curvature to a point's foot, on a straight the distance along."""
    curvature_times_along, distance_ratio = curvature * along, 1.0 - curvature * offset
    is_curved = np.abs(curvature_times_along) > 1e-9
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(
            is_curved,
            np.arctan2(curvature_times_along, distance_ratio) / np.where(is_curved, curvature, 1.0),
            along / distance_ratio,
        )


def _candidate_nodes(x: Float, y: Float, node_x: Float, node_y: Float) -> tuple[Int, Int]:
    """Return (point, node) index pairs, sorted by point, of nodes at a local minimum of distance near the least."""
    if (loops := point_loops()) is not None:
        return loops.candidate_nodes((x, y), (node_x, node_y), _NODE_SPACING)
    centre_x, centre_y = node_x.mean(), node_y.mean()  # cancellation then stays far below a node spacing
    p = np.column_stack((x - centre_x, y - centre_y))
    q = np.stack((node_x - centre_x, node_y - centre_y))
    # Squared distance less the point's own part, which is the same for all nodes.
    relative_square = p @ (-2.0 * q) + (q**2).sum(axis=0)
    squared_length = p[:, 0] ** 2 + p[:, 1] ** 2
    bound = (
        np.sqrt(np.maximum(relative_square.min(axis=1) + squared_length, 0.0)) + _NODE_SPACING
    ) ** 2 - squared_length
    is_candidate = relative_square <= bound[:, None]
    is_falling = relative_square[:, 1:] < relative_square[:, :-1]
    is_candidate[:, 1:] &= is_falling
    is_candidate[:, :-1] &= ~is_falling
    point_index, node_index = np.divmod(np.flatnonzero(is_candidate), is_candidate.shape[1])
    return point_index, node_index


def left_vectors(heading: Float) -> Float:
    """Return the unit vectors (..., 2) to the left of headings (...), rad."""
    return np.stack([-np.sin(heading), np.cos(heading)], axis=-1)


def clip_offset(offset: ArrayLike, curvature: ArrayLike) -> Float:
    """Return the offset (m) cut where its parallel curve would fold, so that 1 - curvature x offset stays above 0.

    Args:
        offset: m, positive to the left; broadcast against `curvature`.
        curvature: 1/m of the axis, positive in a left curve.

    Raises:
        InputError: a value that isn't finite.

    Example:
        >>> clip_offset([5.0, 20.0], curvature=1 / 10).round(2).tolist()
        [5.0, 9.8]
    """
    offsets, curvatures = np.broadcast_arrays(finite_array("offset", offset), finite_array("curvature", curvature))
    is_folding = offsets * curvatures > _REACH
    return np.where(is_folding, _REACH / np.where(is_folding, curvatures, 1.0), offsets)[()]


def running_sum(values: Sequence[float]) -> Float:
    """Return (N + 1,) sums of the first 0, 1, ... N values, compensated (Neumaier), so that they don't drift."""
    total, compensation, sums = 0.0, 0.0, [0.0]
    for value in values:
        next_total = total + value
        compensation += (total - next_total) + value if abs(total) >= abs(value) else (value - next_total) + total
        total = next_total
        sums.append(total + compensation)
    return np.array(sums)


def finite_array(name: str, values: ArrayLike) -> Float:
    """Return the values as float64, or raise InputError naming the first that is not a finite number."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(name, values, "numbers are needed") from None
    if not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        index_text = "".join(f"[{i}]" for i in place)
        raise InputError(f"{name}{index_text}", float(array[place]), "a finite number is needed")
    return array
