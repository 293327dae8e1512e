"""The roads that join and cross a main road, with their surfaces, and the one ground between all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary, ref

import numpy as np
from scipy.spatial import cKDTree

from ...base.arrays import Bool, Float, Int
from ..geometry import RoadGeometry
from ..ground.main_surface import ground_at_bridge, main_surface_elevation
from ..objects import Side
from ..other_roads.parts import ConnectingRamp, CrossingRoad
from ..section import LineMarking
from ..tessellation import sample_stations
from ..things.overpass import WINGS, Overpass
from ..turnout_geometry import STEP
from .crossing import Crossing
from .grid import SurfaceGrid
from .ground import EDGE_CLEARANCE, Limit, Triangles, cone_limits, inside, triangulated
from .ramp import LINE, Cut, RampSurfaceGrid, cut_of

_REACH = 45.0
"""Distance (m) from a road's edge up to which its batter can reach: 30 m of height at 1 : 1.5."""
_EDGE_SPACING = 0.5
"""Distance of the points of edges from which batters begin, m: between two they are 8 cm lower at the worst where
the ground is cut, and exact in the middle of grades."""
_COARSE, _FINE, _FINE_WITHIN = 5.0, 1.6, 12.0
"""Spacing of the ground's points, m: beyond, and within a distance (m) from the roads."""
_SIDES: tuple[Side, ...] = ("left", "right")
_END = 0.5
"""Depth (m) to which the end of a crossing road counts as the terrain's edge."""
_ORDER = 1e-7
"""Step (m) by which points of one station are put into an order."""
_LOOKED_UP = 0.005
"""Tolerance (m) of the main road's surface beside which the ground lies whose heights are looked up."""
_SAME_PLACE = 1e-5
"""Distance (m) up to which points are the same."""
_SAME_ROW = 2e-4
"""Distance (m) up to which rows are the same: a mesh leaves out those that are nearer to another one."""
BURIED = 0.25
"""Length (m) from a bridge's end over which there is no ground below the road, as it would touch the pavement."""
_UNDER_DECK = 2.0
"""Distance (m) of the points of the ground's edge there."""
_END_POINTS = 40
"""Points of the terrain's edge at either end of the road, on either side."""


_NETWORKS: WeakKeyDictionary[RoadGeometry, Network] = WeakKeyDictionary()


def network_of(geometry: RoadGeometry) -> Network:
    """Return the network of a road's geometry, made once."""
    network = _NETWORKS.get(geometry)
    if network is None:
        network = _NETWORKS[geometry] = Network(geometry)
    return network


@dataclass(frozen=True)
class Ground(Triangles):
    """The ground of a stretch.

    Attributes:
        distances: (N,) distance of its points from the nearest road, m.
    """

    distances: Float


def network_ground(geometry: RoadGeometry, tolerance: float, stretch: tuple[float, float] | None = None) -> Ground:
    """Return the ground around all roads of a network, beside the main road's surface as it is meshed.

    Args:
        geometry: the main road.
        tolerance: of the main road's surface, m.
        stretch: stations (m) between which the middles of its triangles lie; all if None.
    """
    network = network_of(geometry)
    ground, distances = network.ground(tolerance)
    corners = ground.corners
    if stretch is not None and stretch != (0.0, geometry.length):
        middle, _ = geometry.alignment.project(ground.points[corners][..., :2].mean(axis=1))
        corners = corners[(middle >= stretch[0]) & (middle < stretch[1])]
    used, inverse = np.unique(corners, return_inverse=True)
    return Ground(ground.points[used], inverse.reshape(-1, 3), distances[used])


@dataclass(frozen=True)
class Joint:
    """A connecting ramp with its cut and its surface.

    Attributes:
        name: id of the ramp.
        ramp: what the set says of it.
        side: carriageway that it leaves or joins.
        cut: where it begins.
        surface: its surface.
    """

    name: str
    ramp: ConnectingRamp
    side: Side
    cut: Cut
    surface: RampSurfaceGrid


class Network:
    """A main road's network: crossing roads, their ramps and the ground.

    Attributes:
        geometry: the main road.
    """

    def __init__(self, geometry: RoadGeometry) -> None:
        self._geometry = ref(geometry)
        self._grounds: dict[bytes, tuple[Triangles, Float]] = {}

    @property
    def geometry(self) -> RoadGeometry:
        """Return the main road."""
        geometry = self._geometry()
        assert geometry is not None
        return geometry

    @property
    def exists(self) -> bool:
        """Return whether there is any other road."""
        return bool(self.geometry.crossing_roads)

    @cached_property
    def crossings(self) -> dict[str, Crossing]:
        """The crossing roads by id."""
        parameters = self.geometry.parameters
        ramps = parameters.of_type(ConnectingRamp)
        return {
            name: Crossing(
                parameters,
                road,
                {key: ramp for key, ramp in ramps.items() if ramp.crossing_road == name},
                bridge_span(self.geometry, road, parameters.objects[road.bridge]),
            )
            for name, road in parameters.of_type(CrossingRoad).items()
        }

    @cached_property
    def joints(self) -> dict[str, Joint]:
        """The connecting ramps by id."""
        parameters = self.geometry.parameters
        joints = {}
        for name, ramp in parameters.of_type(ConnectingRamp).items():
            turnout = parameters.objects[ramp.turnout]
            section, shape = next(
                (section, shape)
                for section in self.geometry.sections.values()
                for shape in section.turnouts
                if shape.turnout is turnout
            )
            lines = [item.width for item in parameters.of_type(LineMarking).values() if item.turnout == ramp.turnout]
            cut = cut_of(self.geometry, section, shape)
            mouth = self.crossings[ramp.crossing_road].mouths[name]
            surface = RampSurfaceGrid(ramp, cut, mouth, min([*lines, LINE]) if lines else LINE)
            joints[name] = Joint(name, ramp, section.carriageway.side, cut, surface)
        return joints

    def leaves(self, joint: Joint) -> bool:
        """Return whether a ramp's traffic leaves the main road: an exit's."""
        return self.geometry.parameters.objects[joint.ramp.turnout].kind == "exit"  # type: ignore[attr-defined]

    # --- outlines -----------------------------------------------------------------------------------------------

    def main_edges(self, stations: Float) -> list[tuple[Float, Float]]:
        """Return the points (N, 3) of the right and the left edge of each piece of the main road that has no bridge.

        Its surface has rows at stations (N,), m. At a cut an edge follows the row there from the ramp's verge to the
        main road's.
        """
        offsets, heights = self.geometry.boundaries(stations)
        plan = [self.geometry.alignment.place(stations, offsets[:, column]) for column in (0, -1)]
        left, right = (np.column_stack([xy, heights[:, column]]) for xy, column in zip(plan, (0, -1), strict=True))
        rows: dict[Side, list[tuple[float, Float]]] = {
            "left": list(zip(stations.tolist(), left, strict=True)),
            "right": list(zip(stations.tolist(), right, strict=True)),
        }
        for joint in self.joints.values():
            # From the ramp's verge to the main road's, which lies at the cut's one and the same station.
            row = joint.surface.grid.points[0]
            inwards = row[-2::-1] if joint.surface.main_is_left else row[1:]
            shift = _ORDER * joint.cut.ahead
            rows[joint.side] += [
                (joint.cut.station + shift * (1.0 + number), point) for number, point in enumerate(inwards)
            ]
        ordered = {side: sorted(items, key=lambda item: item[0]) for side, items in rows.items()}
        pieces = []
        for start, end in self._ground_pieces:
            right, left = (
                np.array([point for station, point in ordered[side] if start - _SAME_ROW <= station <= end + _SAME_ROW])
                for side in ("right", "left")
            )
            pieces.append((right, left))
        return pieces

    @cached_property
    def _ground_pieces(self) -> list[tuple[float, float]]:
        """The stations (m) between which the main road lies on the ground: before, between and behind its bridges."""
        bridges = sorted((item.cap_start, item.cap_end) for item in self.geometry.bridges.values())
        borders = [0.0, *(station for ends in bridges for station in ends), self.geometry.length]
        pieces = zip(borders[::2], borders[1::2], strict=True)
        return [(start, end) for start, end in pieces if end - start > _SAME_PLACE]

    def _bridge_end(self, station: float, outwards: float) -> Float:
        """Return the points (N, 3) of the ground's edge below a bridge, from right to left; heights aren't known yet.

        It lies a little behind the bridge's end at a station (m), in the direction in which the deck lies.
        """
        place = np.array([station + outwards * BURIED])
        edges = self.geometry.offsets(place)[0, [-1, 0]]
        offset = np.linspace(edges[0], edges[1], max(2, int(np.ceil((edges[1] - edges[0]) / _UNDER_DECK)) + 1))
        return _unknown(self.geometry.alignment.place(np.full(len(offset), place[0]), offset))

    def _main_limits(self, stations: Float) -> tuple[list[Float], list[Limit], Float]:
        """Return the outlines (K, 3) of the main road on the ground, the limits there, and its edges (S, 2, 3)."""
        outlines, limits, edges = [], [], []
        length = self.geometry.length
        for (start, end), (right, left) in zip(self._ground_pieces, self.main_edges(stations), strict=True):
            sides = [Limit(right, False), Limit(left, False)]
            edges += [limit.segments for limit in sides]
            before, behind = np.empty((0, 3)), np.empty((0, 3))
            if end < length:
                behind = self._bridge_end(end, 1.0)
                sides.append(Limit(np.concatenate([right[-1:], behind, left[-1:]]), False))
            if start > 0.0:
                before = self._bridge_end(start, -1.0)
                sides.append(Limit(np.concatenate([right[:1], before, left[:1]]), False))
            limits += sides
            outlines.append(np.concatenate([right, behind, left[::-1], before[::-1]]))
        return outlines, limits, np.concatenate(edges)

    def stubs(self) -> dict[str, Float]:
        """Return by ramp the corners (4, 3) of the piece of the main road's verge in the step at its cut."""
        result = {}
        for name, joint in self.joints.items():
            cut = joint.cut
            station = np.array([cut.station + cut.ahead * STEP])
            section = self.geometry.sections[joint.side]
            distances = section.distances(station)[0]
            crossfall = self.geometry.crossfall(section.carriageway, station)
            heights = self.geometry.profile.elevation(station) + section.elevations(station, crossfall)[0]
            plan = self.geometry.alignment.place(np.repeat(station, 2), cut.sign * distances[-2:])
            behind = np.column_stack([plan, heights[-2:]])
            quad = np.stack([cut.verge[0], cut.verge[1], behind[1], behind[0]])
            a, b, c = quad[0], quad[1], quad[2]
            is_clockwise = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0] < 0.0
            result[name] = quad[::-1] if is_clockwise else quad
        return result

    def mouth_outline(self, name: str) -> Float:
        """Return the points (N, 3) around the pavement and verges of a ramp's mouth."""
        ramp = self.joints[name].ramp
        pavement, low, high = self.crossings[ramp.crossing_road].patches(name)
        first, last = pavement.points[0], pavement.points[-1]
        return np.concatenate([first, high.points[:, -1], last[::-1], low.points[::-1, -1]])

    # --- ground -------------------------------------------------------------------------------------------------

    def ground(self, tolerance: float) -> tuple[Triangles, Float]:
        """Return the ground around all roads, made once for a tolerance (m) of the main road's surface.

        With it the distances (N,) of its points from the nearest road, m.
        """
        return self.ground_beside(sample_stations(self.geometry, tolerance))

    def ground_beside(self, stations: Float) -> tuple[Triangles, Float]:
        """Return `ground` beside a main road whose surface has rows at stations (N,), m; made once for them."""
        key = stations.tobytes()
        if key not in self._grounds:
            self._grounds[key] = self._make_ground(stations)
        return self._grounds[key]

    def _make_ground(self, stations: Float) -> tuple[Triangles, Float]:
        """Return the ground around all roads, with the main road's rows at stations (N,), m, and distances."""
        assert self.geometry.terrain is not None
        # What bridges carry has ground below it.
        holes, main_limits, main_edges = self._main_limits(stations)
        for name, joint in self.joints.items():
            holes += [joint.surface.grid.outline(), self.mouth_outline(name)]
        spans = [part for crossing in self.crossings.values() for part in _beside_bridge(crossing)]
        holes += spans
        border, sides = self._border(spans), self._sides(spans)
        limits = [*main_limits, Limit(border), *sides]
        edges = _dense(np.concatenate([limit.segments for limit in sides]))
        free = self._free_points(np.concatenate([limit.segments for limit in limits]))
        free = free[inside(border, free)]
        for hole in holes:
            free = free[~inside(hole, free)]
        points, corners, of_limits = triangulated(limits, free)
        middle = points[corners][..., :2].mean(axis=1)
        keep = inside(border, middle)
        for hole in holes:
            keep &= ~inside(hole, middle)
        a, b, c = (points[corners[:, k]] for k in range(3))
        area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        corners = corners[keep & (area > 1e-9)]
        is_known = np.zeros(len(points), dtype=bool)
        is_known[of_limits] = ~np.isnan(points[of_limits, 2])
        unknown = np.flatnonzero(~is_known)
        points[unknown, 2] = self._ground_heights(points[unknown, :2], edges)
        used, inverse = np.unique(corners, return_inverse=True)
        distances, _ = cKDTree(np.concatenate([_dense(main_edges), edges])[:, :2]).query(points[used, :2])
        return Triangles(points[used], inverse.reshape(-1, 3)), distances

    def _ground_heights(self, points: Float, edges: Float) -> Float:
        """Return the heights (N,) of the ground at places (N, 2): the main road's, within what the edges leave, m."""
        terrain = self.geometry.terrain
        assert terrain is not None
        station, offset = self.geometry.alignment.project(points)
        station = np.clip(station, 0.0, self.geometry.length)
        natural = main_surface_elevation(self.geometry, station, offset)
        for bridge in self.geometry.bridges.values():
            there = np.flatnonzero((station > bridge.cap_start) & (station < bridge.cap_end))
            natural[there] = ground_at_bridge(self.geometry, bridge, station[there], offset[there])
        low, high = cone_limits(points, edges, terrain.batter_slope, _REACH)
        return np.minimum(np.maximum(natural, low), high)

    def _sides(self, spans: list[Float]) -> list[Limit]:
        """Return the edges of the other roads at which ground begins, without those at which roads meet."""
        limits = []
        for name, joint in self.joints.items():
            grid = joint.surface.grid
            _, low, high = self.crossings[joint.ramp.crossing_road].patches(name)
            lines = (grid.points[:, 0], grid.points[:, -1], low.points[:, -1], high.points[:, -1])
            limits += [Limit(line, False) for line in lines]
        mouths = np.concatenate([np.empty((0, 3)), *(self.mouth_outline(name) for name in self.joints)])
        for span in spans:
            segments = Limit(span).segments
            # Along a mouth the crossing road's edge is within the pavement.
            inner = cKDTree(mouths[:, :2]) if len(mouths) else None
            for segment in segments:
                if inner is not None and (inner.query(segment[:, :2])[0] < _SAME_PLACE).all():
                    continue
                limits.append(Limit(segment, False))
        return limits

    def _border(self, spans: list[Float]) -> Float:
        """Return the points (N, 3) around the terrain, heights NaN where they are the ground's; by the roads' ends."""
        terrain = self.geometry.terrain
        assert terrain is not None
        geometry, reach, length = self.geometry, terrain.half_width, self.geometry.length
        along = np.linspace(0.0, length, max(2, int(np.ceil(length / _COARSE))) + 1)
        sides = []
        for sign in (-1.0, 1.0):
            edge = _unknown(geometry.alignment.place(along, np.full(len(along), sign * reach)))
            for span in spans:
                edge = _through_end(edge, span)
            sides.append(edge)
        ends = []
        for station, offsets in zip((0.0, length), geometry.offsets(np.array([0.0, length])), strict=True):
            right = np.linspace(-reach, offsets[-1], _END_POINTS)[1:-1]
            left = np.linspace(offsets[0], reach, _END_POINTS)[1:-1]
            across = np.concatenate([right, offsets[::-1], left])
            ends.append(_unknown(geometry.alignment.place(np.full(len(across), station), across)))
        return np.concatenate([sides[0], ends[1], sides[1][::-1], ends[0][::-1]])

    def _free_points(self, segments: Float) -> Float:
        """Return points (N, 2) of the ground that lie on no edge: closer near the roads than far away."""
        terrain = self.geometry.terrain
        assert terrain is not None
        tree = cKDTree(_dense(segments)[:, :2])
        points = []
        for spacing, is_near in ((_COARSE, False), (_FINE, True)):
            station = np.arange(spacing / 2.0, self.geometry.length, spacing)
            offset = np.arange(-terrain.half_width + spacing / 2.0, terrain.half_width, spacing)
            s, o = (a.ravel() for a in np.meshgrid(station, offset, indexing="ij"))
            # Every other row is shifted: triangles come nearer to equal sides.
            o = o + (np.round(s / spacing - 0.5) % 2.0) * spacing / 2.0 * 0.9
            xy = self.geometry.alignment.place(s, np.clip(o, -terrain.half_width, terrain.half_width))
            distance, _ = tree.query(xy)
            wanted = (distance < _FINE_WITHIN) if is_near else (distance >= _FINE_WITHIN)
            points.append(xy[wanted & (distance > EDGE_CLEARANCE * spacing)])
        return np.concatenate(points)

    # --- places -------------------------------------------------------------------------------------------------

    @cached_property
    def _top(self) -> Triangles:
        """The parts of the other roads and of the ground that are the top surface, without what a bridge carries."""
        parts = []
        for crossing in self.crossings.values():
            grid = crossing.grid
            middle = (crossing.rows[1:] + crossing.rows[:-1]) / 2.0
            parts.append(_triangles(replace(grid, built=grid.built & ~crossing.is_carried(middle)[:, None])))
        for name, joint in self.joints.items():
            parts.append(_triangles(joint.surface.grid))
            for patch in self.crossings[joint.ramp.crossing_road].patches(name):
                quads = patch.quads(joint.surface.mouth.sign)
                parts.append((patch.points.reshape(-1, 3), np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])))
        if self.geometry.terrain is not None:
            ground, _ = self.ground(_LOOKED_UP)
            parts.append((ground.points, ground.corners))
        starts = np.cumsum([0, *(len(points) for points, _ in parts[:-1])])
        return Triangles(
            np.concatenate([points for points, _ in parts]),
            np.concatenate([corners + start for (_, corners), start in zip(parts, starts, strict=True)]),
        )

    def surface_height(self, points: Float) -> Float:
        """Return the heights (N,) of other roads and of the ground at places (N, 2), m; NaN on the main road."""
        return self._top.height(points)

    @cached_property
    def _outlines(self) -> list[Float]:
        """The outlines (N, 3) of all other roads and their mouths."""
        outlines = [crossing.outline() for crossing in self.crossings.values()]
        for name, joint in self.joints.items():
            outlines += [joint.surface.grid.outline(), self.mouth_outline(name)]
        return outlines

    @cached_property
    def _edges(self) -> cKDTree:
        """The places along those outlines."""
        return cKDTree(_dense(np.concatenate([Limit(outline).segments for outline in self._outlines]))[:, :2])

    def covers(self, points: Float, beside: float = 0.0) -> Bool:
        """Return whether places (N, 2) lie on another road's pavement or verges, or nearer than a distance (m)."""
        return _covered(self._outlines, self._edges, points, beside)

    @cached_property
    def _pavements(self) -> list[Float]:
        """The outlines (N, 3) of the pavements of all other roads and of their mouths, without what bridges carry."""
        outlines = []
        for crossing in self.crossings.values():
            for part in _rows_beside_bridge(crossing, crossing.rows):
                points = crossing.grid.points[part]
                outlines.append(np.concatenate([points[:, 1], points[::-1, -2]]))
        for name, joint in self.joints.items():
            points = joint.surface.grid.points
            pavement = self.crossings[joint.ramp.crossing_road].patches(name)[0].points
            outlines.append(np.concatenate([points[:, 1], points[::-1, -2]]))
            outlines.append(np.concatenate([pavement[0], pavement[1:, -1], pavement[-1, -2::-1], pavement[-2:0:-1, 0]]))
        return outlines

    @cached_property
    def _pavement_edges(self) -> cKDTree:
        """The places along those outlines."""
        return cKDTree(_dense(np.concatenate([Limit(outline).segments for outline in self._pavements]))[:, :2])

    def paves(self, points: Float, beside: float = 0.0) -> Bool:
        """Return whether places (N, 2) lie on another road's pavement, or nearer than a distance (m) to it."""
        return _covered(self._pavements, self._pavement_edges, points, beside)


def _covered(outlines: list[Float], edges: cKDTree, points: Float, beside: float) -> Bool:
    """Return whether places (N, 2) lie in any outline (K, 3), or nearer than a distance (m) to its edge."""
    result = np.zeros(len(points), dtype=bool)
    for outline in outlines:
        result |= inside(outline, points)
    if beside > 0.0:
        result |= edges.query(points, distance_upper_bound=beside)[0] < beside
    return result


def _unknown(places: Float) -> Float:
    """Return places (N, 2) as points (N, 3) whose heights aren't known yet."""
    return np.column_stack([places, np.full(len(places), np.nan)])


def _triangles(grid: SurfaceGrid) -> tuple[Float, Int]:
    """Return the points (N, 3) and the triangles (T, 3) of a grid's pavement and verges."""
    quads = np.concatenate([grid.quads(kind) for kind in ("pavement", "verge")])
    return grid.points.reshape(-1, 3), np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


def _dense(segments: Float) -> Float:
    """Return points (N, 3) along segments (S, 2, 3), no farther apart than `_EDGE_SPACING`."""
    lengths = np.linalg.norm(segments[:, 1, :2] - segments[:, 0, :2], axis=1)
    counts = np.maximum(1, np.ceil(lengths / _EDGE_SPACING)).astype(np.int64)
    index = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (number / counts[index])[:, None]
    return segments[index, 0] * (1.0 - share) + segments[index, 1] * share


def _beside_bridge(crossing: Crossing) -> list[Float]:
    """Return the outlines (N, 3) of a crossing road's pavement and verges before and behind its bridge."""
    outline = crossing.outline()
    along, _ = crossing.geometry.alignment.project(outline[:, :2])
    return [outline[_one_run(keep)] for keep in _rows_beside_bridge(crossing, along)]


def _rows_beside_bridge(crossing: Crossing, along: Float) -> list[Bool]:
    """Return which own stations (N,), m, lie before, and which behind a crossing road's bridge; all without one."""
    if crossing.bridge is None:
        return [np.ones(along.shape, dtype=bool)]
    start, end = crossing.bridge
    return [along <= start + 1e-6, along >= end - 1e-6]


def _one_run(mask: Bool) -> Float:
    """Return the indices of the true places of a ring's mask (N,), beginning behind a false one."""
    begin = int(np.flatnonzero(~mask)[-1]) + 1 if (~mask).any() else 0
    order = (np.arange(len(mask)) + begin) % len(mask)
    index: Float = order[mask[order]]
    return index


def _through_end(edge: Float, span: Float) -> Float:
    """Return the terrain's outer edge (N, 3) led along the end of a road's outline (K, 3) where this meets it."""
    distance = np.linalg.norm(span[:, None, :2] - edge[None, :, :2], axis=2)
    nearest = distance.min(axis=1)
    is_end = nearest < _COARSE
    # Of the outline only the end row lies on the terrain's edge.
    direction = edge[-1, :2] - edge[0, :2]
    direction = direction / np.linalg.norm(direction)
    normal = np.array([-direction[1], direction[0]])
    depth = np.abs((span[:, :2] - edge[distance.argmin(axis=1), :2]) @ normal)
    is_end &= depth < _END
    if np.count_nonzero(is_end) < 2:
        return edge
    row = span[is_end]
    row = row[np.argsort(row[:, :2] @ direction)]
    place = edge[:, :2] @ direction
    low, high = row[0, :2] @ direction, row[-1, :2] @ direction
    before, behind = edge[place < low - 0.2], edge[place > high + 0.2]
    return np.concatenate([before, row, behind])


def bridge_span(geometry: RoadGeometry, road: CrossingRoad, bridge: object) -> tuple[float, float] | None:
    """Return the own stations (m) of a crossing road between which its bridge lies, wing walls included.

    The wing walls are as long as the batters beside them, as the bridge has them. None below a main road's bridge.
    """
    if not isinstance(bridge, Overpass):
        return None
    heading = np.deg2rad(road.start_heading_deg)
    middle = geometry.alignment.position(np.array([road.station]))[0]
    own = float((middle - (road.start_x, road.start_y)) @ (np.cos(heading), np.sin(heading)))
    left = geometry.alignment.heading(np.array([road.station]))[0] + np.pi / 2.0
    forward = float(np.sign(np.cos(left - heading)))
    places = []
    top = float(np.interp(own, [p.station for p in road.vertical], [p.elevation for p in road.vertical]))
    slope = geometry.terrain.batter_slope if geometry.terrain else 1.5
    for face in (bridge.left_abutment, bridge.right_abutment):
        ground = main_surface_elevation(
            geometry, road.station + np.array([-0.5, 0.5]) * bridge.width, np.full(2, face)
        ).min()
        wing = float(np.clip((top - ground) * slope, *WINGS))
        places.append(own + forward * (face + np.copysign(wing, face)))
    return min(places), max(places)
