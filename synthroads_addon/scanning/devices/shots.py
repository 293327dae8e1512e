"""Shots of a device: when each pulse of its heads is fired, and where to."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import AnyArray, Float, Index
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


def shots(setting: ScannerSetting, first_shot: int, count: int, with_frame: bool = False) -> PulseRays:
    """Return ``count`` pulses from number ``first`` on in the scanner's frame: x forward, y left, z up.

    They are the same, to the bit, as that slice of all pulses. Shot i is pulse i // H of head i mod H of a device with
    H heads; head h fires h / H of a pulse interval late, so that times increase. Times are products of whole numbers
    and intervals, never sums.

    Args:
        with_frame: whether the axes across the beam are wanted.
    """
    return shot_run(setting, first_shot, count, with_frame).shots()


class Columns(NamedTuple):
    """Columns of tables (..., M) that repeat.

    Attributes:
        first: the first of a run of them.
        rows: (N,) which of the run, ascending; None for all.
    """

    first: int
    rows: Index | None = None

    def of(self, table: AnyArray, count: int) -> AnyArray:
        """Return ``count`` columns (..., count) of a table (..., M) that repeats."""
        if self.rows is None:
            return _repeated(table, self.first, count)
        # Repeated up to the last one: remainders of all would take longer.
        column_count = int(self.rows[-1]) + 1 if count else 0
        return np.take(_repeated(table, self.first, column_count), self.rows, axis=-1)


@dataclass(frozen=True)
class ShotRun:
    """Shots one after the other, as the columns of a table of shots that repeats.

    Attributes:
        table: of the shots; its times are those within a cycle.
        first: column of the first one.
        time: (P,) of each, s.
    """

    table: PulseRays
    first: int
    time: Float

    def column(self, name: str, rows: Index | None = None) -> Any:
        """Return an array (..., N) of the shots, or of rows (N,) of these, ascending; None if the table has none."""
        values: AnyArray | None = getattr(self.table, name)
        count = len(self.time) if rows is None else len(rows)
        return None if values is None else Columns(self.first, rows).of(values, count)

    def shots(self) -> PulseRays:
        """Return the times and directions of all shots of the run."""
        names = ("scan_angle", "direction", "in_plane", "across", "beam")
        return PulseRays(self.time, *(self.column(name) for name in names))


def shot_run(setting: ScannerSetting, first_shot: int, count: int, with_frame: bool = False) -> ShotRun:
    """Return the shots that `shots` returns, as columns of a cached table where their directions repeat.

    Args:
        setting: the scanner's.
        first_shot: number of the first pulse.
        count: of pulses.
        with_frame: whether the axes across the beam are worked out.
    """
    lines = setting.device.pattern.cycle_lines
    length = lines * setting.pulses_per_line * len(setting.device.heads)  # shots of a cycle
    if 0 < length <= _LARGEST_TABLE and not setting.free_mirror:
        table = _cycle_table(setting, with_frame)
        first_cycle, column = divmod(first_shot, length)
        cycle_count = -(-(column + count) // length)
        cycles = np.arange(first_cycle, first_cycle + cycle_count, dtype=np.int64)
        time = table.time + (cycles * lines / setting.lines_per_second)[:, None]
        return ShotRun(table, column, time.ravel()[column : column + count].copy())
    # Directions that don't repeat, or too many to keep, are worked out shot by shot.
    numbers = np.arange(first_shot, first_shot + count, dtype=np.int64)
    if lines == 0 or setting.free_mirror:
        rays = _shots(setting, numbers, with_frame)
    else:
        cycles = numbers // length
        numbers -= cycles * length
        rays = _shots(setting, numbers, with_frame)
        rays.time[:] += cycles * lines / setting.lines_per_second
    return ShotRun(rays, 0, rays.time)


def _repeated(table: AnyArray, first_column: int, count: int) -> AnyArray:
    """Return columns (..., count) of a table (..., M) that repeats, from ``first_column`` on, as a copy.

    All whole repetitions are copied at once: NumPy lets go of Python's lock for each copy, and threads wait to have it
    back.
    """
    length = table.shape[-1]
    if first_column + count <= length:
        return table[..., first_column : first_column + count].copy()
    # What is left of the table from the first column on, whole repetitions, and the beginning of one more.
    head = length - first_column
    repetitions, tail = divmod(count - head, length)
    result, tail_begin = np.empty((*table.shape[:-1], count), table.dtype), head + repetitions * length
    result[..., :head], result[..., tail_begin:] = table[..., first_column:], table[..., :tail]
    result[..., head:tail_begin].reshape(*table.shape[:-1], repetitions, length)[...] = table[..., None, :]
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
    head_rays = setting.device.pattern.rays(setting.timing, pulse, with_frame)
    beam = np.zeros(len(number), dtype=np.int64) if head_rays.beam is None else head_rays.beam
    if head is not None:
        beam = beam + head * setting.device.pattern.beams
        head_rays.time[:] += head / (heads * setting.pulse_rate)
    turn = _mounting(setting, head)
    in_plane, across = (None if axis is None else turn(axis) for axis in (head_rays.in_plane, head_rays.across))
    direction = turn(head_rays.direction)
    return PulseRays(head_rays.time, head_rays.scan_angle, direction, in_plane, across, beam.astype(np.uint8))


def _mounting(setting: ScannerSetting, head: Numbers | None) -> Callable[[Float], Float]:
    """Return a function that turns vectors (3, P) from the frames of their heads to the scanner's frame.

    Args:
        setting: the scanner's.
        head: (P,) number of each vector's head; None where there is only one.
    """
    angles = np.deg2rad([(h.yaw_deg, h.pitch_deg, h.roll_deg) for h in setting.device.heads])
    if not angles.any():
        return lambda vectors: vectors
    turns = rotation_matrix(*angles.T)
    if head is None:
        return lambda vectors: np.asarray(turns[0] @ vectors)
    return lambda vectors: np.asarray(np.einsum("pij,jp->ip", turns[head], vectors))
