"""Things of a road with their bodies, where they stand: what every format makes its furniture and structures from."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..road.geometry import RoadGeometry
from ..road.terrain import highest_pavement
from ..road.things.body import Body, Course, Place
from ..road.things.thing import LengthwiseThing, StandingThing, Thing
from .surfaces import Float, close_stations, left_of, needed_rows, on_ground

_ACROSS, _ROWS = 0.0125, 7
"""Distance (m) of the points across the road at which the pavement is looked at (0.9 mm at 7 % crossfall), and their
rows along it."""
_SLOPE = 1.5
"""Run of batters per metre of height where there is no terrain."""


@dataclass(frozen=True)
class Frame:
    """Frame of what stands at one place.

    Attributes:
        geometry: the road.
        origin: (3,) local coordinates of its foot.
        right, along: (2,) unit vectors in plan: to the right of the traffic that it faces, and along it.
    """

    geometry: RoadGeometry
    origin: Float
    right: Float
    along: Float

    def local(self, points: Float) -> Float:
        """Return local coordinates (..., 3) of points (..., 3) of the frame."""
        plan = points[..., :1] * self.right + points[..., 1:2] * self.along
        return self.origin + np.concatenate([plan, points[..., 2:]], axis=-1)

    def place(self) -> Place:
        """Return what lies below it."""
        terrain = self.geometry.parameters.terrain
        return Place(self._ground, self._pavement, terrain.batter_slope if terrain else _SLOPE)

    def _located(self, x: Float, y: Float) -> tuple[Float, Float]:
        return self.geometry.alignment.project(self.origin[:2] + x[:, None] * self.right + y[:, None] * self.along)

    def _ground(self, x: ArrayLike, y: ArrayLike) -> Float:
        beside, ahead = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        return on_ground(self.geometry, *self._located(beside, ahead))[:, 2] - self.origin[2]

    def _pavement(self, x: tuple[float, float], y: tuple[float, float], shear: float) -> float:
        across = np.linspace(*x, max(2, int(np.ceil((x[1] - x[0]) / _ACROSS)) + 1))
        beside, ahead = (grid.ravel() for grid in np.meshgrid(across, np.linspace(*y, _ROWS)))
        highest = highest_pavement(self.geometry, *self._located(beside, ahead + shear * beside))
        return 0.0 if highest is None else highest - float(self.origin[2])


class PlacedThing(NamedTuple):
    """A thing of a road.

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

    def local(self, body: Body) -> Float:
        """Return a body's sections (R, K, 3) in local coordinates."""
        return self.frame.local(body.sections) if self.frame else body.sections


def placed_things(geometry: RoadGeometry, tolerance: float) -> Iterator[PlacedThing]:
    """Yield all things of a road in the order of the parameter set.

    Args:
        geometry: the road.
        tolerance: largest chord error of what runs along it, m.
    """
    standing = standing_things(geometry)
    course = _course(geometry, tolerance)
    for name, item in geometry.parameters.objects.items():
        if isinstance(item, StandingThing):
            yield next(standing)
        elif isinstance(item, LengthwiseThing):
            yield PlacedThing(name, item, None, item.bodies(course))


def standing_things(geometry: RoadGeometry) -> Iterator[PlacedThing]:
    """Yield all things of a road that stand at one place, in the order of the parameter set."""
    standing = geometry.parameters.of_type(StandingThing)
    frames = frames_of(geometry, list(standing.values()))
    for (name, item), frame in zip(standing.items(), frames, strict=True):
        yield PlacedThing(name, item, frame, item.bodies(frame.place()))


def frames_of(geometry: RoadGeometry, items: Sequence[StandingThing]) -> list[Frame]:
    """Return the frames of things on the surface below them, turned by their rotations."""
    places = [(item.station, item.offset, item.elevation, item.turn) for item in items]
    station, offset, above, turn = np.array(places, dtype=np.float64).reshape(-1, 4).T
    origins = on_ground(geometry, station, offset)
    origins[:, 2] += above
    heading = geometry.alignment.heading(station) + turn
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return [Frame(geometry, *axes) for axes in zip(origins, right, along, strict=True)]


def _course(geometry: RoadGeometry, tolerance: float) -> Course:
    """Return the road as what runs along it needs it."""

    def rows(offset: Callable[[Float], Float], start: float, end: float, kinks: Sequence[float]) -> Float:
        station = np.unique(np.concatenate([close_stations(start, end), kinks]))
        feet = on_ground(geometry, station, offset(station))
        return station[needed_rows(feet, tolerance, np.isin(station, kinks))]

    return Course(
        length=geometry.length,
        feet=lambda station, offset: on_ground(geometry, station, offset),
        left=lambda station: left_of(geometry, station),
        rows=rows,
    )
