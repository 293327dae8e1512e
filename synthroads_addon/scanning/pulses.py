"""A block of pulses as they leave the scanner: errors, poses meanwhile, and which of them can hit anything."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..base.arrays import Bool, Float, Float32, Index, UInt8
from .devices.device import ScannerSetting
from .devices.shots import Columns
from .knots import Track
from .receiver import EchoValues, values_of_echoes
from .scene.target import Target


@dataclass(frozen=True)
class Errors:
    """Random errors of a block's P pulses in range, angle and intensity, and which returns are lost, whatever is met.

    Attributes:
        range: in units of one sigma; None without. Of this and of all others but `angle` echoes have what
            `receiver.values_of_echoes` says.
        angle: (2, P) rad; None without.
        lost: as `range`: shares, 0 to 1, that say who is lost; None without.
        speckle: as `range`: factors on the intensities, 1 on average; None without.
        receiver: as `range`: noise of the receiver, in units of one sigma; None without.
        tails: as `range`: factors on these; None without.
        number: as `range`: shares, 0 to 1, that say whose number is lost; None without.
        delay: as `range`: exponential with the mean 1; None without.
    """

    range: EchoValues | None
    angle: Float32 | None
    lost: EchoValues | None
    speckle: EchoValues | None = None
    receiver: EchoValues | None = None
    tails: EchoValues | None = None
    number: EchoValues | None = None
    delay: EchoValues | None = None

    def range_errors(self, pulse: Index, number: UInt8, delayed: float = 0.0) -> Float:
        """Return (N,) range errors of returns, in units of one sigma, with the tails and delays that the block has.

        Args:
            pulse: (N,) within the block.
            number: (N,) of each return in its pulse, from 1.
            delayed: share of sigma, 0 to 1, that comes of delays.
        """
        assert self.range is not None
        result = values_of_echoes(self.range, pulse, number)
        if self.tails is not None:
            result *= values_of_echoes(self.tails, pulse, number)
        if self.delay is not None:
            result *= math.sqrt(1.0 - delayed**2)
            result += delayed * (values_of_echoes(self.delay, pulse, number) - 1.0)
        return result


@dataclass(frozen=True)
class Poses:
    """Tracks of the scanner, true and measured, and of the target's moving parts, during a block.

    Attributes:
        true: of the scanner.
        measured: what its navigation says; the same where it makes no errors.
        motions: of the target's moving parts.
    """

    true: Track
    measured: Track
    motions: list[Track]


@dataclass(frozen=True)
class Pulses:
    """A block of pulses as they really leave the scanner, in local coordinates.

    Attributes:
        time: (P,) s since the first strip's start.
        scan_angle: (P,) rad, see `patterns.base.PulseRays`.
        channel: (P,) number of the laser that fires it.
        origin: (3, P) where each leaves the scanner, m.
        direction: (3, P) unit vectors of the beam's axis.
        in_plane: (3, P) unit vectors across the beam, in the scan plane; None for a single ray.
        across: (3, P) unit vectors across the beam and the scan plane; None for a single ray.
        measured_origin, measured_direction: (3, P) what the scanner believes; the same arrays where it doesn't err.
    """

    time: Float
    scan_angle: Float
    channel: UInt8
    origin: Float
    direction: Float
    in_plane: Float | None
    across: Float | None
    measured_origin: Float
    measured_direction: Float

    def select(self, pulses: Index) -> Pulses:
        """Return the pulses of these indices."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        selected_arrays: dict[str, Any] = {
            name: None if array is None else np.take(array, pulses, axis=-1) for name, array in values.items()
        }
        # What the scanner believes may be the very array of what is true: it stays so.
        if self.measured_origin is self.origin:
            selected_arrays["measured_origin"] = selected_arrays["origin"]
        return Pulses(**selected_arrays)


def turned_vectors(
    track: Track, times: Float, vectors: Sequence[Float], columns: Columns | None = None
) -> tuple[Float, list[Float]]:
    """Return a track's positions (3, N), m, at times (N,), s, and sets of vectors (3, N) turned by its rotations.

    Args:
        track: that spans the times.
        times: s.
        vectors: (3, N), or tables (3, M) of which columns are turned.
        columns: N of such tables.
    """
    rotation, position, _ = track.at(times)
    selected_vectors = vectors if columns is None else [columns.of(array, len(times)) for array in vectors]
    return position, [turn_vectors(rotation, array) for array in selected_vectors]


def turn_vectors(rotation: Float, vectors: Float) -> Float:
    """Return vectors (3, N), each rotated by its matrix (9, N), row by row."""
    result = np.empty_like(vectors)
    product = np.empty(vectors.shape[1])
    for i in range(3):
        np.multiply(rotation[3 * i], vectors[0], out=result[i])
        for j in (1, 2):
            result[i] += np.multiply(rotation[3 * i + j], vectors[j], out=product)
    return result


def tilt_vectors(vectors: Float, first_axis: Float, second_axis: Float, angle: Float32) -> Float:
    """Return unit vectors (3, N) tilted towards two axes (3, N) at right angles to them and each other.

    Args:
        angle: (2, N) tangents of the tilts.
    """
    scale = 1.0 / np.sqrt(1.0 + angle[0].astype(np.float64) ** 2 + angle[1].astype(np.float64) ** 2)
    result = np.empty_like(vectors)
    product = np.empty(vectors.shape[1])
    for i in range(3):
        np.multiply(angle[0], first_axis[i], out=result[i])
        result[i] += np.multiply(angle[1], second_axis[i], out=product)
        result[i] += vectors[i]
        result[i] *= scale
    return result


def may_hit_scene(
    setting: ScannerSetting, target: Target, origins: Float, directions: Float, motions: list[Track]
) -> Bool | None:
    """Return a mask (P,) of the pulses that may hit anything, by bounding boxes; None if all may.

    Args:
        setting: the scanner's.
        target: what is scanned.
        origins, directions: (3, P) where the pulses begin, local, m, and unit vectors of their axes.
        motions: tracks of the target's moving parts.
    """
    boxes = [] if target.bounds is None else [target.bounds]
    boxes += target.moving_bounds(motions)
    if not boxes:
        return np.zeros(origins.shape[1], dtype=bool)
    lowest_corner = np.min([box[0] for box in boxes], axis=0)
    highest_corner = np.max([box[1] for box in boxes], axis=0)
    # Twice the full divergence, so that no ray of a footprint is missed: an angle, rad, and a width at the end, m.
    cone = max(setting.divergence) * 2.0
    width = cone * setting.maximum_range
    mask: Bool | None = None
    for axis in range(3):
        place, direction = origins[axis], directions[axis]
        # Along an axis on which all pulses begin on one side of the box, only those that go towards it may hit it.
        if place.min() > highest_corner[axis] + width:
            heads_for_box = direction < cone
        elif place.max() < lowest_corner[axis] - width:
            heads_for_box = direction > -cone
        else:
            continue
        mask = heads_for_box if mask is None else mask & heads_for_box
    return None if mask is None or mask.all() else mask
