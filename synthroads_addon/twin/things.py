"""Things of a road with their bodies, where they stand: what every format makes its furniture and structures from."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..road.geometry import RoadGeometry
from ..road.network.network import network_of
from ..road.other_roads.guardrail import RampGuardrail
from ..road.terrain import ground_below, highest_pavement
from ..road.things.body import Body, Course, Place
from ..road.things.deformation import lean_bodies
from ..road.things.thing import LengthwiseThing, StandingThing, Thing
from .surfaces import Float, even_stations, level_left_vectors, simplify_polyline, surface_points

_ACROSS, _ROWS = 0.0125, 7
"""Distance (m) of the points across the road at which the pavement is looked at (0.9 mm at 7 % crossfall), and their
rows along it."""
_SLOPE = 1.5
"""Run of batters per metre of height where there is no terrain."""


@dataclass(frozen=True)
class Frame:
    """Local frame of a thing that stands at one place: x to the right, y along the traffic that it faces, z up.

    Attributes:
        geometry: the road.
        origin: (3,) local coordinates of its foot.
        right, along: (2,) unit vectors in plan: to the right of the traffic that it faces, and along it.
    """

    geometry: RoadGeometry
    origin: Float
    right: Float
    along: Float

    def to_local(self, points: Float) -> Float:
        """Transform points (..., 3) from this frame into the road's local coordinates."""
        xy = points[..., :1] * self.right + points[..., 1:2] * self.along
        return self.origin + np.concatenate([xy, points[..., 2:]], axis=-1)

    def place(self) -> Place:
        """Return the ground and pavement heights around this frame as functions of x and y, and the batters' slope."""
        terrain = self.geometry.terrain
        return Place(self._ground, self._pavement, terrain.batter_slope if terrain else _SLOPE)

    def _located(self, x: Float, y: Float) -> tuple[Float, Float]:
        """Return the stations and offsets (N,) of places x, y (N,) in this frame, m."""
        return self.geometry.alignment.project(self.origin[:2] + x[:, None] * self.right + y[:, None] * self.along)

    def _ground(self, x: ArrayLike, y: ArrayLike) -> Float:
        """Return the ground's heights (N,) above the thing's foot at x, y in this frame, m."""
        right_distance, ahead_distance = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        return surface_points(self.geometry, *self._located(right_distance, ahead_distance))[:, 2] - self.origin[2]

    def _pavement(self, x: tuple[float, float], y: tuple[float, float], shear: float) -> float:
        """Return the height of the highest pavement above the thing's foot in a range of x and y, m; 0 if none.

        The range is a parallelogram: y is counted from the line y = shear x.
        """
        columns = np.linspace(*x, max(2, int(np.ceil((x[1] - x[0]) / _ACROSS)) + 1))
        right_distance, ahead_distance = (grid.ravel() for grid in np.meshgrid(columns, np.linspace(*y, _ROWS)))
        highest_elevation = highest_pavement(
            self.geometry, *self._located(right_distance, ahead_distance + shear * right_distance)
        )
        return 0.0 if highest_elevation is None else highest_elevation - float(self.origin[2])


class PlacedThing(NamedTuple):
    """A thing of a road with the bodies that it consists of and the frame in which they are given.

    Attributes:
        name: its id.
        thing: what it is.
        frame: that of its bodies; None for what runs along the road, whose bodies have local coordinates.
        bodies: its bodies.
    """

    name: str
    thing: Thing
    frame: Frame | None
    bodies: list[Body]

    def local_sections(self, body: Body) -> Float:
        """Transform a body's sections (R, K, 3) into the road's local coordinates."""
        return self.frame.to_local(body.sections) if self.frame else body.sections


def placed_things(geometry: RoadGeometry, tolerance: float) -> Iterator[PlacedThing]:
    """Yield all standing and lengthwise things of a road with their bodies, in the parameter set's order.

    Args:
        geometry: the road.
        tolerance: largest chord error of what runs along it, m.
    """
    remaining_things = standing_things(geometry)
    course = road_course(geometry, tolerance)
    for name, item in geometry.parameters.objects.items():
        if isinstance(item, StandingThing):
            yield next(remaining_things)
        elif isinstance(item, LengthwiseThing):
            yield PlacedThing(name, item, None, item.bodies(course))
        elif isinstance(item, RampGuardrail):
            yield PlacedThing(name, item, None, item.bodies(other_road_course(geometry, item.road, tolerance)))


def standing_things(geometry: RoadGeometry) -> Iterator[PlacedThing]:
    """Yield only the things that stand at one place, with frames and bodies, in the parameter set's order."""
    things = geometry.parameters.of_type(StandingThing)
    frames = standing_frames(geometry, list(things.values()))
    for (name, item), frame in zip(things.items(), frames, strict=True):
        bodies = lean_bodies(item.bodies(frame.place()), item.lean_deg, item.lean_direction_deg)
        yield PlacedThing(name, item, frame, bodies)


def standing_frames(geometry: RoadGeometry, items: Sequence[StandingThing]) -> list[Frame]:
    """Return the frames of standing things, placed on the surface below them and turned by their rotations."""
    places = [(item.station, item.offset, item.elevation, item.turn) for item in items]
    station, offset, elevations, turn = np.array(places, dtype=np.float64).reshape(-1, 4).T
    origins = surface_points(geometry, station, offset)
    origins[:, 2] += elevations
    heading = geometry.alignment.heading(station) + turn
    ahead_axes = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    right_axes = np.stack([ahead_axes[:, 1], -ahead_axes[:, 0]], axis=1)
    return [Frame(geometry, *origin_and_axes) for origin_and_axes in zip(origins, right_axes, ahead_axes, strict=True)]


def road_course(geometry: RoadGeometry, tolerance: float) -> Course:
    """Return the road as bodies along it are built from it: its length, surface points, left vectors and sampling."""

    def rows(offset: Callable[[Float], Float], start: float, end: float, kinks: Sequence[float]) -> Float:
        """Return the stations (R,) at which a body along the road needs sections: the kinks, and by the tolerance."""
        station = np.unique(np.concatenate([even_stations(start, end), kinks]))
        feet = surface_points(geometry, station, offset(station))
        return station[simplify_polyline(feet, tolerance, np.isin(station, kinks))]

    return Course(
        length=geometry.length,
        feet=lambda station, offset: surface_points(geometry, station, offset),
        left=lambda station: level_left_vectors(geometry, station),
        rows=rows,
        edges=lambda station: _edges(geometry, station),
        pavement=lambda station, offset: _pavement(geometry, station, offset),
        ground=lambda station, offset: ground_below(geometry, station, offset),
    )


def other_road_course(geometry: RoadGeometry, name: str, tolerance: float) -> Course:
    """Return a ramp or a crossing road of a network as bodies along it are built from it.

    Args:
        geometry: the main road.
        name: id of the ramp or crossing road.
        tolerance: largest chord error of what runs along it, m.
    """
    network = network_of(geometry)
    road = network.joints[name].ramp if name in network.joints else network.crossings[name].road
    axis = network.joints[name].surface.axis if name in network.joints else network.crossings[name].geometry.alignment
    borders = np.array([road.half_width + road.verge_width, road.half_width, 0.0])

    def feet(station: Float, offset: Float) -> Float:
        """Return the points (N, 3) on the surface at own stations and offsets (N,)."""
        plan = axis.place(station, offset)
        return np.column_stack([plan, network.surface_height(plan)])

    def left(station: Float) -> Float:
        """Return the level unit vectors (N, 3) to the left at own stations (N,)."""
        heading = axis.heading(station)
        return np.column_stack([-np.sin(heading), np.cos(heading), np.zeros(len(heading))])

    def rows(offset: Callable[[Float], Float], start: float, end: float, kinks: Sequence[float]) -> Float:
        """Return the stations (R,) at which a body along the road needs sections: the kinks, and by the tolerance."""
        station = np.unique(np.concatenate([even_stations(start, end), kinks]))
        return station[simplify_polyline(feet(station, offset(station)), tolerance, np.isin(station, kinks))]

    def heights(station: Float, offset: Float) -> Float:
        """Return the elevations (N,) of the surface at own stations and offsets (N,), m."""
        return feet(station, offset)[:, 2]

    edges = np.concatenate([borders, -borders[::-1]])
    return Course(
        length=axis.length,
        feet=feet,
        left=left,
        rows=rows,
        edges=lambda station: np.tile(edges, (len(station), 1)),
        pavement=heights,
        ground=heights,
    )


def begin_beside(geometry: RoadGeometry, rail: RampGuardrail) -> tuple[float, float]:
    """Return the main road's station and offset (m) at the beginning of a guardrail along another road."""
    course = other_road_course(geometry, rail.road, 1.0)
    begin = course.feet(np.array([rail.start_station]), np.array([rail.offset]))
    station, offset = geometry.alignment.project(begin[:, :2])
    return float(station[0]), float(offset[0])


def _edges(geometry: RoadGeometry, station: Float) -> Float:
    """Return the offsets (N, 6) at stations (N,) of the edges of verges and pavements from the left, see `Course`."""
    offsets, left_strips = geometry.offsets(station), sum(strip.side == "left" for strip in geometry.strips)
    return offsets[:, [0, 1, left_strips, left_strips + 1, -2, -1]]


def _pavement(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the elevations (N,), m, between the verges' outer edges, without damage and bridges' caps."""
    offsets, heights = geometry.boundaries(station)
    rows, within = np.arange(len(station)), np.clip(offset, offsets[:, -1], offsets[:, 0])
    left = np.clip(np.count_nonzero(offsets >= within[:, None], axis=1) - 1, 0, offsets.shape[1] - 2)
    width = np.maximum(offsets[rows, left] - offsets[rows, left + 1], 1e-12)
    share = np.clip((offsets[rows, left] - within) / width, 0.0, 1.0)
    return heights[rows, left] * (1.0 - share) + heights[rows, left + 1] * share
