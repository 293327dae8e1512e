"""Shots of a device: when each pulse of its heads is fired, and where to."""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from ...base.arrays import AnyArray, Float
from ...base.rotations import rotation_matrix
from ..patterns.base import Numbers, PulseRays
from .device import ScannerSetting

_LARGEST_TABLE = 2**18
"""Shots of a cycle that are kept at most: with the axes across the beam 23 MB."""


def shot_count(setting: ScannerSetting, duration: float, ends: bool = False) -> int:
    """Return how many pulses all heads together fire in a duration (s): whole lines only, and at least one.

    A wedge prism has no lines: whole pulses.

    Args:
        setting: the scanner's.
        duration: s.
        ends: whether nothing can be fired after it: of the only line, then, the pulses within it, and at least one.
    """
    heads = len(setting.device.heads)
    if setting.device.pattern.cycle_lines == 0:
        return heads * max(1, math.floor(duration * setting.pulse_rate + 1e-9))
    if ends and duration * setting.lines_per_second + 1e-9 < 1.0:
        line = shots(setting, 0, heads * setting.pulses_per_line).time
        return max(1, int(np.searchsorted(line, duration, side="right")))
    return heads * max(1, math.floor(duration * setting.lines_per_second + 1e-9)) * setting.pulses_per_line


def shots(setting: ScannerSetting, first: int, count: int, with_frame: bool = False) -> PulseRays:
    """Return ``count`` pulses from number ``first`` on in the scanner's frame: x forward, y left, z up.

    They are the same, to the bit, as that slice of all pulses. Shot i is pulse i // H of head i mod H of a device with
    H heads; head h fires h / H of a pulse interval late, so that times increase. Times are products of whole numbers
    and intervals, never sums.

    Args:
        with_frame: whether the axes across the beam are wanted.
    """
    number = np.arange(first, first + count, dtype=np.int64)
    lines = setting.device.pattern.cycle_lines
    if lines == 0 or setting.free_mirror:
        return _shots(setting, number, with_frame)
    length = lines * setting.pulses_per_line * len(setting.device.heads)
    cycle = number // length
    number -= cycle * length
    if length > _LARGEST_TABLE:
        chosen = _shots(setting, number, with_frame)
    else:
        chosen = _look_up_shots(_cycle_table(setting, with_frame), int(number[0]) if count else 0, count)
    chosen.time[:] += cycle * lines / setting.lines_per_second
    return chosen


def _look_up_shots(table: PulseRays, first: int, count: int) -> PulseRays:
    """Return ``count`` shots from ``first`` on of a table of shots, which repeats."""
    time, scan_angle, direction = (
        _repeated(array, first, count) for array in (table.time, table.scan_angle, table.direction)
    )
    others = (table.in_plane, table.across, table.beam)
    return PulseRays(
        time, scan_angle, direction, *(None if one is None else _repeated(one, first, count) for one in others)
    )


def _repeated(table: AnyArray, first: int, count: int) -> AnyArray:
    """Return the columns (..., count) from ``first`` on of a table (..., M) that repeats, a copy.

    All whole repetitions are copied at once: NumPy lets go of Python's lock for each copy, and threads wait to have it
    back.
    """
    length = table.shape[-1]
    if first + count <= length:
        return table[..., first : first + count].copy()
    begin = length - first
    whole, rest = divmod(count - begin, length)
    result, end = np.empty((*table.shape[:-1], count), table.dtype), begin + whole * length
    result[..., :begin], result[..., end:] = table[..., first:], table[..., :rest]
    result[..., begin:end].reshape(*table.shape[:-1], whole, length)[...] = table[..., None, :]
    return result


@lru_cache(maxsize=4)
def _cycle_table(setting: ScannerSetting, with_frame: bool) -> PulseRays:
    """Return the shots of one scan cycle, cached: cycles repeat, and looking up is cheaper than a sine."""
    length = setting.device.pattern.cycle_lines * setting.pulses_per_line * len(setting.device.heads)
    return _shots(setting, np.arange(length, dtype=np.int64), with_frame)


def _shots(setting: ScannerSetting, number: Numbers, with_frame: bool) -> PulseRays:
    """Compute the shots of all heads by their numbers (P,), in the scanner's frame."""
    heads = len(setting.device.heads)
    pulse, head = np.divmod(number, heads) if heads > 1 else (number, None)
    part = setting.device.pattern.rays(setting.timing, pulse, with_frame)
    beam = np.zeros(len(number), dtype=np.int64) if part.beam is None else part.beam
    if head is not None:
        beam = beam + head * setting.device.pattern.beams
        part.time[:] += head / (heads * setting.pulse_rate)
    turn = _mounting(setting, head)
    in_plane, across = (None if axis is None else turn(axis) for axis in (part.in_plane, part.across))
    direction = turn(part.direction)
    return PulseRays(part.time, part.scan_angle, direction, in_plane, across, beam.astype(np.uint8))


def _mounting(setting: ScannerSetting, head: Numbers | None) -> Callable[[Float], Float]:
    """Return the function that turns vectors (3, P) from the frames of their heads (P,) to the scanner's frame."""
    angles = np.deg2rad([(h.yaw_deg, h.pitch_deg, h.roll_deg) for h in setting.device.heads])
    if not angles.any():
        return lambda vectors: vectors
    turns = rotation_matrix(*angles.T)
    if head is None:
        return lambda vectors: np.asarray(turns[0] @ vectors)
    return lambda vectors: np.asarray(np.einsum("pij,jp->ip", turns[head], vectors))
