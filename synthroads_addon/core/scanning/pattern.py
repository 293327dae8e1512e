"""Scan patterns: when each pulse is fired, and where to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .devices import ScannerSetting
from .path import FlightPath, Strip

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Pulses:
    """A block of pulses, in local coordinates.

    Attributes:
        time: (P,) s since the first strip's start.
        scan_angle: (P,) rad from the nadir, positive to the right of the flight direction.
        origin: (P, 3) where each leaves the scanner, m.
        direction: (P, 3) unit vectors of the beam's axis.
        in_plane: (P, 3) unit vectors across the beam, in the scan plane.
        across: (P, 3) unit vectors across the beam and the scan plane.
    """

    time: Float
    scan_angle: Float
    origin: Float
    direction: Float
    in_plane: Float
    across: Float


def pulse_count(setting: ScannerSetting, strip: Strip) -> int:
    """Return how many pulses a strip has: whole lines only."""
    return max(1, int(strip.duration * setting.lines_per_second + 1e-9)) * setting.pulses_per_line


def rotating_mirror(setting: ScannerSetting, path: FlightPath, strip: Strip, first: int, count: int) -> Pulses:
    """Return pulses ``first`` to ``first + count`` of a strip scanned by a rotating mirror.

    Line k begins at k / lines_per_second; its pulses follow at the pulse rate, an angle step apart, centred on the
    nadir. The scan plane is perpendicular to the heading; the platform moves on during a line.
    """
    line, within = np.divmod(np.arange(first, first + count, dtype=np.int64), setting.pulses_per_line)
    time = strip.start_time + line / setting.lines_per_second + within / setting.pulse_rate
    angle = (within - (setting.pulses_per_line - 1) / 2.0) * setting.angle_step
    origin, heading = path.pose(strip, time)
    right = np.stack([np.sin(heading), -np.cos(heading), np.zeros(count)], axis=1)
    forward = np.stack([np.cos(heading), np.sin(heading), np.zeros(count)], axis=1)
    down = np.array([0.0, 0.0, -1.0])
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    return Pulses(time, angle, origin, cosine * down + sine * right, cosine * right - sine * down, forward)
