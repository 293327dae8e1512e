"""Roads that are hard to tell: grey medians, exits, three carriageways, streets without paint, strips cut anyhow."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np

from synthroads_addon.base.arrays import Bool, Float
from synthroads_addon.base.classes import class_id
from tests.helpers.clouds.foreign_clouds import EAST, NORTH, UP, axis_north
from tests.helpers.clouds.road_clouds import block_of, write
from tests.helpers.clouds.survey_faults import SurveyFaults

LENGTH, DENSITY = 150.0, 14.0
ASPHALT, GRASS, PAINT = 0.12, 0.42, 0.7
"""Intensities of pavement, verge and paint; points scatter about them as speckle does."""
_WIDTH = 0.16  # m, of lines


@dataclass(frozen=True)
class Ground:
    """A strip of ground from right to left, m, with its intensity, roughness (m) and height above the pavement, m.

    It begins at the station ``start``, m; until the road's end a ramp is shifted by ``turn``, m. Pavement is that of a
    carriageway, of a ramp, or of neither (``use``: ""). It falls by ``fall``, m/m, to the left, from its right edge on.
    """

    low: float
    high: float
    level: float = ASPHALT
    rough: float = 0.004
    height: float = 0.0
    turn: float = 0.0
    start: float = 0.0
    use: str = ""
    fall: float = 0.0


@dataclass(frozen=True)
class Paint:
    """A line at an offset, m, with dash and gap (m; 0: solid), turned outwards as its ground is.

    Its dashes are moved along by ``phase``, m.
    """

    offset: float
    dash: float = 0.0
    gap: float = 0.0
    turn: float = 0.0
    start: float = 0.0
    phase: float = 0.0


@dataclass(frozen=True)
class HardRoad:
    """A road drawn from strips and lines, its axis at offset 0, cut to a strip that changes every 50 m.

    Attributes:
        name: in words.
        grounds: strips, the later over the earlier; beside them is grass.
        lines: of paint.
        reach: distance to either side that the cloud holds, m, before it is cut.
        cut: largest share of the reach that is cut off on either side.
        carriageways: number of carriageways that the road has.
        seed: of the points, cuts and course.
        slant: distance, m, by which the axis bends.
        faults: of the survey, and wear; None: even strips, fresh paint.
    """

    name: str
    grounds: tuple[Ground, ...]
    lines: tuple[Paint, ...] = ()
    reach: float = 18.0
    cut: float = 0.0
    carriageways: int = 1
    seed: int = 1
    slant: float = 3.0
    length: float = LENGTH
    marks: dict[str, float] = field(default_factory=dict)
    faults: SurveyFaults | None = None

    def cut_by(self, share: float) -> Self:
        """Return the road cut to a strip by up to a share of its reach."""
        return replace(self, cut=share)

    def write(self, folder: Path) -> Path:
        """Write its cloud of ground points without classes into a folder, if that wasn't done; return the file."""
        kind = "hard" if self.faults else "even"
        path = folder / f"{self.name.replace(' ', '-')}-{self.seed}-{self.cut:g}-{kind}.laz"
        if path.exists():
            return path
        rng = np.random.default_rng([self.seed, 77])
        count = int(DENSITY * self.length * 2.0 * self.reach)
        station, offset = rng.uniform(0.0, self.length, count), rng.uniform(-self.reach, self.reach, count)
        height, level = rng.normal(0.03, 0.05, count), np.full(count, GRASS) * np.exp(rng.normal(0.0, 0.2, count))
        for ground in self.grounds:
            inside = _inside(ground, station, offset, self.length)
            height[inside] = ground.height + rng.normal(0.0, ground.rough, inside.sum())
            height[inside] -= ground.fall * (offset[inside] - ground.low)
            level[inside] = ground.level
        faults = self.faults or SurveyFaults()
        if self.faults:
            on_pavement = level < 1.5 * ASPHALT
            level[on_pavement] *= faults.pavement_gain(station, offset)[on_pavement]
        for index, line in enumerate(self.lines):
            along = station + 3.0 * self.seed + line.phase
            painted = np.ones(count, bool) if line.dash == 0.0 else along % (line.dash + line.gap) < line.dash
            distance = np.abs(offset - line.offset - _shift(line.turn, line.start, station, self.length))
            share = faults.paint_share(distance, _WIDTH) * (painted & (station >= line.start))
            fresh = faults.paint_level(index, station, level, PAINT) if self.faults else PAINT
            level = level + share * (fresh - level)
        level = level * np.exp(rng.normal(0.0, faults.speckle, count))
        in_second = faults.second_strip(station, offset, self.length)
        level = np.where(in_second, level * 10.0 ** (faults.gain_step / 10.0), level)
        height = height + faults.height_step * in_second
        seen = self._seen(station, offset) & ~faults.cut_out(offset)
        xyz = np.column_stack(
            [EAST + station, NORTH + offset + axis_north(station, self.slant, self.length), UP + height]
        )
        xyz[:, 2] += rng.normal(0.0, 0.012, count)
        block = block_of(xyz[seen], np.clip(level, 0.0, 1.0)[seen], np.full(seen.sum(), class_id("ground"), np.uint8))
        return write(path, block)

    def _seen(self, station: Float, offset: Float) -> Bool:
        """Return a mask of the points that the cuts leave: either side's is another one every 50 m."""
        right_cut, left_cut = self.sides(station)
        return (offset > -right_cut) & (offset < left_cut)

    def sides(self, station: Float) -> tuple[Float, Float]:
        """Return how far to the right and to the left of the axis the cloud reaches at stations (N,), (N,) m each."""
        rng = np.random.default_rng([self.seed, 78])
        right_cut, left_cut = self.reach * (1.0 - self.cut * rng.uniform(0.0, 1.0, (2, 20)))
        block = np.clip(station / 50.0, 0, 19).astype(np.int64)
        return right_cut[block], left_cut[block]

    def strips(self, station: Float, use: str, least: float = 3.0) -> list[tuple[Bool, Float]]:
        """Return the strips of pavement of one use, from right to left: where each is seen (N,), and its middle (N,).

        Args:
            station: (N,) m.
            use: of the ground.
            least: width of a strip, m, that the cloud must hold.
        """
        right_cut, left_cut = self.sides(station)
        result = []
        for ground in sorted((ground for ground in self.grounds if ground.use == use), key=lambda ground: ground.low):
            shift = _shift(ground.turn, ground.start, station, self.length)
            low, high = np.maximum(ground.low + shift, -right_cut), np.minimum(ground.high + shift, left_cut)
            result.append(((high - low >= least) & (station >= ground.start), 0.5 * (ground.low + ground.high) + shift))
        return result


def _shift(turn: float, start: float, station: Float, length: float) -> Float:
    return turn * np.clip((station - start) / max(length - start, 1.0), 0.0, 1.0)


def _inside(ground: Ground, station: Float, offset: Float, length: float) -> Bool:
    across = offset - _shift(ground.turn, ground.start, station, length)
    return (across > ground.low) & (across < ground.high) & (station >= ground.start)


def carriageway(inner: float, lanes: int, lane: float, shoulder: float, sign: int) -> tuple[Ground, list[Paint], float]:
    """Return pavement and lines of a carriageway from its inner edge outwards, and its outer edge, m."""
    first = inner + sign * 0.5
    borders = [first + sign * lane * number for number in range(lanes + 1)]
    outer = borders[-1] + sign * shoulder
    lines = [Paint(borders[0]), *(Paint(border, 6.0, 12.0) for border in borders[1:-1]), Paint(borders[-1])]
    return Ground(min(inner, outer), max(inner, outer), use="carriageway"), lines, outer


def motorway(seed: int, decibel: float | None = None, exit_from: float | None = None, third: bool = False) -> HardRoad:
    """Return a motorway with a narrow grey median, perhaps with an exit, or a third carriageway beside.

    Args:
        seed: of widths and of brightness.
        decibel: brightness of the median above the pavement; None: drawn from 0.5 to 3.7 dB.
        exit_from: station at which a ramp leaves to the right, m; None for none.
        third: whether a collector carriageway runs beside.
    """
    rng = np.random.default_rng([seed, 5])
    median, lane = rng.uniform(1.5, 4.0), float(rng.choice([3.5, 3.75]))
    decibel = float(rng.uniform(0.5, 3.7)) if decibel is None else decibel
    right, right_lines, right_outer = carriageway(-0.5 * median, 2, lane, 2.5, -1)
    left, left_lines, _ = carriageway(0.5 * median, 2, lane, 2.5, 1)
    level = ASPHALT * 10.0 ** (decibel / 10.0)
    grey = Ground(-0.5 * median, 0.5 * median, level, 0.02, 0.03)
    grounds, lines, name = [right, left, grey], [*right_lines, *left_lines], "motorway"
    if exit_from is not None:
        name = "motorway with an exit"
        grounds.insert(0, Ground(right_outer - 3.0, right_outer + 1.0, turn=-8.0, start=exit_from))
        lines.append(Paint(right_outer - 2.6, turn=-8.0, start=exit_from))
    if third:
        name = "three carriageways"
        collector, more_lines, _ = carriageway(right_outer - rng.uniform(2.0, 4.0), 1, 4.5, 1.5, -1)
        grounds.append(collector)
        lines += more_lines
    marks = {"median": median, "decibel": decibel}
    reach = 26.0 if third or exit_from is not None else 18.0
    count = 3 if third else 2
    return HardRoad(name, tuple(grounds), tuple(lines), reach, 0.0, count, seed, marks=marks)


def street(seed: int) -> HardRoad:
    """Return a dark village street without paint between lighter pavements for pedestrians, gardens beyond."""
    rng = np.random.default_rng([seed, 6])
    half, kerb = rng.uniform(2.2, 3.5), float(rng.choice([0.0, 0.03, 0.1]))
    lighter = ASPHALT * 10.0 ** (rng.uniform(1.2, 2.5) / 10.0)
    walks = [rng.uniform(1.2, 2.5), rng.uniform(1.2, 2.5)]
    grounds = (
        Ground(-half - walks[0], half + walks[1], lighter, 0.008, kerb),
        Ground(-half, half),
    )
    return HardRoad("street without paint", grounds, (), 12.0, 0.0, 1, seed, marks={"half": half, "kerb": kerb})


def rural(seed: int) -> HardRoad:
    """Return a rural road of two lanes with edge lines and a dashed middle line."""
    rng = np.random.default_rng([seed, 7])
    half = rng.uniform(3.0, 4.0)
    lines = (Paint(-half + 0.3), Paint(0.0, 4.0, 8.0), Paint(half - 0.3))
    return HardRoad("rural road", (Ground(-half, half),), lines, 9.0, 0.0, 1, seed, marks={"half": half})
