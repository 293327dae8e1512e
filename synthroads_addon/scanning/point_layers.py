"""Per-point layers that the scan itself fills: one function for each `PointBlock` array, see `cloud.layers`."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.arrays import AnyArray, Float, Index
from .devices.device import ScannerSetting
from .epochs.truth import ChangePoints
from .pulses import Pulses
from .receiving.radiometry import decibels
from .scene.target import Target


@dataclass(frozen=True)
class MeasuredPoints:
    """N points of a block, of P pulses, at the time when their layers are filled.

    Attributes:
        setting: the scanner's.
        target: what is scanned.
        pulses: the block's.
        pulse: (N,) pulse of each point.
        distance: (N,) range without errors, m.
        range_bias: systematic error of the measured ranges, m.
        intensity: (N,) before the detector saturates.
        face: (N,) triangle that gave most of each return; -1 in the air.
        normal: (3, N) unit normals towards the scanner; None where nothing asks for them.
    """

    setting: ScannerSetting
    target: Target
    pulses: Pulses
    pulse: Index
    distance: Float
    range_bias: float
    intensity: Float
    face: Index
    normal: Float | None


Filler = Callable[[MeasuredPoints], AnyArray]
FILLERS: dict[str, Filler] = {}
"""Function that fills an array, by the array's name."""


TOGETHER: dict[tuple[str, ...], Callable[[MeasuredPoints], dict[str, AnyArray]]] = {}
"""Function that fills several arrays at once, by their names."""


def fills_together(*arrays: str) -> Callable[..., Callable[[MeasuredPoints], dict[str, AnyArray]]]:
    """Return a decorator that registers a function as the one that fills several `PointBlock` arrays at once."""

    def register(
        filler: Callable[[MeasuredPoints], dict[str, AnyArray]],
    ) -> Callable[[MeasuredPoints], dict[str, AnyArray]]:
        """Register a function under the arrays' names, and return it."""
        TOGETHER[arrays] = filler
        return filler

    return register


def fills(array: str) -> Callable[[Filler], Filler]:
    """Return a decorator that registers a function as the one that fills a `PointBlock` array."""

    def register(filler: Filler) -> Filler:
        """Register a function under the array's name, and return it."""
        FILLERS[array] = filler
        return filler

    return register


def fill_layers(points: MeasuredPoints, names: frozenset[str]) -> dict[str, AnyArray]:
    """Return those of the named per-point layers that the scan itself fills, as arrays by name."""
    arrays = {array: filler(points) for array, filler in FILLERS.items() if array in names}
    for filled, fill_together in TOGETHER.items():
        if names & set(filled):
            arrays |= {array: values for array, values in fill_together(points).items() if array in names}
    return arrays


def place_points(origin: Float, direction: Float, pulse: Index, distance: Float, map_origin: Float) -> Float:
    """Return the map coordinates (N, 3) of points at a distance (N,) along the beams (3, P) of their pulses, m."""
    result = np.empty((len(pulse), 3))
    for axis in range(3):
        coordinate = np.take(direction[axis], pulse)
        coordinate *= distance
        coordinate += np.take(origin[axis], pulse)
        coordinate += map_origin[axis]
        result[:, axis] = coordinate
    return result


@fills("normal")
def _normal(points: MeasuredPoints) -> AnyArray:
    """Return the unit normals (N, 3), towards the scanner."""
    assert points.normal is not None
    return np.ascontiguousarray(points.normal.T, dtype=np.float32)


@fills("scanner")
def _scanner(points: MeasuredPoints) -> AnyArray:
    """Return the map coordinates (N, 3), m, at which the points' pulses left the scanner."""
    return points.pulses.origin.T[points.pulse] + points.target.origin


@fills("true_range")
def _true_range(points: MeasuredPoints) -> AnyArray:
    """Return the ranges (N,) without errors, m."""
    return points.distance


@fills("true_xyz")
def _true_xyz(points: MeasuredPoints) -> AnyArray:
    """Return the map coordinates (N, 3) without errors, m."""
    pulses, origin = points.pulses, points.target.origin
    return place_points(pulses.origin, pulses.direction, points.pulse, points.distance, origin)


@fills("power_db")
def _power(points: MeasuredPoints) -> AnyArray:
    """Return the received powers (N,), dB."""
    return decibels(points.intensity)


@fills("channel")
def _channel(points: MeasuredPoints) -> AnyArray:
    """Return the numbers (N,) of the lasers that fired the points' pulses."""
    return points.pulses.channel[points.pulse]


@fills("material")
def _material(points: MeasuredPoints) -> AnyArray:
    """Return the indices (N,) of the materials of the points' faces."""
    return points.target.face_values("material", points.face)


@fills("damage")
def _damage(points: MeasuredPoints) -> AnyArray:
    """Return the codes (N,) of the damages of the points' faces."""
    return points.target.face_values("damage", points.face)


_CHANGES = {"change": np.uint8, "change_id": np.uint16, "change_distance": np.float32, "not_seen_before": np.uint8}


@fills_together(*_CHANGES)
def _changes(points: MeasuredPoints) -> dict[str, AnyArray]:
    """Return the points' changes to another epoch, see `epochs.truth`; all 0 in a scan that knows of no other one."""
    truth, count = points.target.truth, len(points.pulse)
    if truth is None:
        return {name: np.zeros(count, kind) for name, kind in _CHANGES.items()}
    pulses, origin = points.pulses, points.target.origin
    place = place_points(pulses.origin, pulses.direction, points.pulse, points.distance, origin)
    instance = points.target.instances(points.face, pulses.time[points.pulse])
    scanner = pulses.origin[:, len(pulses.time) // 2] + origin
    reached = points.distance + points.range_bias
    measured = place_points(pulses.measured_origin, pulses.measured_direction, points.pulse, reached, origin)
    return truth.arrays(ChangePoints(place, measured, instance, scanner, points.setting.maximum_range))


_PLACES = {"station": np.float64, "offset": np.float64, "road_id": np.uint32}


@fills_together(*_PLACES)
def _road_places(points: MeasuredPoints) -> dict[str, AnyArray]:
    """Return the points' places along the roads that they are of, by where they are without errors; 0 without roads."""
    places, count = points.target.places, len(points.pulse)
    if places is None:
        return {name: np.zeros(count, kind) for name, kind in _PLACES.items()}
    pulses = points.pulses
    local = place_points(
        pulses.origin, pulses.direction, points.pulse, points.distance, points.target.origin - places.origin
    )
    instance = points.target.instances(points.face, pulses.time[points.pulse])
    return dict(zip(_PLACES, places.at(local[:, :2], instance), strict=True))
