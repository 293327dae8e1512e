"""Shots of a device: when each pulse of its heads is fired, and where to."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...base.rotations import rotation_matrix
from ..patterns.base import Float, Numbers
from .device import ScannerSetting

_LARGEST_TABLE = 2**18
"""Shots of a cycle that are kept at most: with the axes across the beam 23 MB."""


@dataclass(frozen=True)
class Shots:
    """Pulses in the order in which they are fired, in the scanner's frame: x forward, y left, z up.

    Attributes:
        time: (P,) s since the strip's start.
        scan_angle: (P,) rad: across the forward direction from the nadir, positive to the right; a rotating head's
            azimuth from the forward direction, positive to the right. Of the head itself, however it is mounted.
        direction: (3, P) unit vectors of the beam's axis.
        in_plane: (3, P) unit vectors across the beam, in the scan plane (along a rotating head's turn; to the right
            for a wedge prism); None if not asked for.
        across: (3, P) unit vectors across the beam and `in_plane`; None if not asked for.
        channel: (P,) uint8, number of the beam: that of the beam on its head + beams of a head x number of the head.
    """

    time: Float
    scan_angle: Float
    direction: Float
    in_plane: Float | None
    across: Float | None
    channel: NDArray[np.uint8]


def shot_count(setting: ScannerSetting, duration: float) -> int:
    """Return how many pulses all heads together fire in a duration (s): whole lines only, and at least one.

    A wedge prism has no lines: whole pulses.
    """
    heads = len(setting.device.heads)
    if setting.device.pattern.cycle_lines == 0:
        return heads * max(1, math.floor(duration * setting.pulse_rate + 1e-9))
    return heads * max(1, math.floor(duration * setting.lines_per_second + 1e-9)) * setting.pulses_per_line


def shots(setting: ScannerSetting, first: int, count: int, with_frame: bool = False) -> Shots:
    """Return pulses ``first`` to ``first + count``: the same, to the bit, as that slice of all pulses.

    Shot i is pulse i // H of head i mod H of a device with H heads; head h fires h / H of a pulse interval late, so
    that times increase. Times are products of whole numbers and intervals, never sums.

    Args:
        with_frame: whether the axes across the beam are wanted.
    """
    number = np.arange(first, first + count, dtype=np.int64)
    lines = setting.device.pattern.cycle_lines
    if lines == 0:
        return _shots(setting, number, with_frame)
    length = lines * setting.pulses_per_line * len(setting.device.heads)
    cycle = number // length
    number -= cycle * length
    if length > _LARGEST_TABLE:
        chosen = _shots(setting, number, with_frame)
    else:
        chosen = _look_up_shots(_table(setting, with_frame), number)
    chosen.time[:] += cycle * lines / setting.lines_per_second
    return chosen


def _look_up_shots(table: Shots, number: Numbers) -> Shots:
    """Return shots of a table by their numbers (P,)."""
    return Shots(
        table.time[number],
        table.scan_angle[number],
        _columns(table.direction, number),
        None if table.in_plane is None else _columns(table.in_plane, number),
        None if table.across is None else _columns(table.across, number),
        table.channel[number],
    )


def _columns(vectors: Float, number: Numbers) -> Float:
    """Return columns of vectors (3, M), row by row, which is thrice as fast as all at once."""
    result = np.empty((3, len(number)))
    for row, chosen in zip(vectors, result, strict=True):
        np.take(row, number, out=chosen, mode="clip")
    return result


@lru_cache(maxsize=4)
def _table(setting: ScannerSetting, with_frame: bool) -> Shots:
    """Return the shots of one cycle: mirrors and heads repeat themselves, and looking up is cheaper than a sine."""
    length = setting.device.pattern.cycle_lines * setting.pulses_per_line * len(setting.device.heads)
    return _shots(setting, np.arange(length, dtype=np.int64), with_frame)


def _shots(setting: ScannerSetting, number: Numbers, with_frame: bool) -> Shots:
    """Return shots by their numbers (P,)."""
    heads = len(setting.device.heads)
    pulse, head = np.divmod(number, heads) if heads > 1 else (number, None)
    part = setting.device.pattern.rays(setting.timing, pulse, with_frame)
    channel = np.zeros(len(number), dtype=np.int64) if part.beam is None else part.beam
    if head is not None:
        channel = channel + head * setting.device.pattern.beams
        part.time[:] += head / (heads * setting.pulse_rate)
    turn = _mounting(setting, head)
    return Shots(
        part.time,
        part.scan_angle,
        turn(part.direction),
        None if part.in_plane is None else turn(part.in_plane),
        None if part.across is None else turn(part.across),
        channel.astype(np.uint8),
    )


def _mounting(setting: ScannerSetting, head: Numbers | None) -> Callable[[Float], Float]:
    """Return the function that turns vectors (3, P) from their heads' frames, by number (P,), to the scanner's."""
    angles = np.deg2rad([(h.yaw_deg, h.pitch_deg, h.roll_deg) for h in setting.device.heads])
    if not angles.any():
        return lambda vectors: vectors
    turns = rotation_matrix(*angles.T)
    if head is None:
        return lambda vectors: np.asarray(turns[0] @ vectors)
    return lambda vectors: np.asarray(np.einsum("pij,jp->ip", turns[head], vectors))
