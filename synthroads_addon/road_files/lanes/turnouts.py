"""Exits, entries and emergency bays of our own files, read from the strips that their lanes are named after.

What `road.turnout_geometry` makes of a turnout's fields is turned around: lengths from where widths bend, the clothoid
from how far the ramp has moved away, crossfall and grade of the ramp from the heights of its edges.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.section import Ramp, Turnout
from ...road.turnout_geometry import BLEND, NOSE_BEFORE_END, NOSE_WIDTH, STEP, TURNOUT_STRIPS
from .loss import Loss
from .records import FileLane
from .shape import SideShape
from .surface import LaneEdges

_RAMP_TYPES = frozenset({"offRamp", "onRamp"})
_KINDS = {"exit": "exit", "offRamp": "exit", "entry": "entry", "onRamp": "entry"}
_FLAT = 5e-4
"""Height, m, up to which a ramp's edges lie in the main road's plane."""
_SAME_TILT, _SAME_LIFT = 1e-4, 3e-4
_DIGITS = 6


@dataclass(frozen=True)
class _Part:
    """Lanes of one turnout: its instance and id in the file, and the sections in which it has any."""

    instance: str
    id: str
    sections: tuple[int, ...]


def read_turnouts(side: SideShape, carriageway: str, loss: Loss) -> tuple[dict[str, Turnout], dict[str, str]]:
    """Return the turnouts beside a carriageway by id, stations those of the file, and ids by the file's instances.

    Those that aren't understood are told.
    """
    turnouts: dict[str, Turnout] = {}
    ids: dict[str, str] = {}
    for part in _parts(side):
        try:
            turnout = _Reader(side, part).read(carriageway)
        except (ValidationError, ValueError, ZeroDivisionError, StopIteration, LookupError):
            loss.leave_out("turnouts", "their strips have another shape than an exit, entry or bay", surface=True)
            continue
        name = f"{turnout.kind.replace('_', '-')}-{'left' if side.sign > 0 else 'right'}"
        count = sum(other.startswith(name) for other in turnouts) + 1
        ids[part.instance] = part.id or (name if count == 1 else f"{name}-{count}")
        turnouts[ids[part.instance]] = turnout
        loss.read["turnouts"] += 1
    return turnouts, ids


def has_turnouts(side: SideShape) -> bool:
    """Return whether any lane is a strip of a turnout."""
    return any(kind in TURNOUT_STRIPS for rows in side.layout.strips.values() for kind, _ in rows)


def _parts(side: SideShape) -> Iterator[_Part]:
    by_instance: dict[str, list[int]] = {}
    ids: dict[str, str] = {}
    for number, rows in side.layout.strips.items():
        for kind, lane in rows:
            if kind in TURNOUT_STRIPS:
                instance = lane.notes.get("instance", "")
                numbers = by_instance.setdefault(instance, [])
                ids[instance] = lane.notes.get("id", "")
                if number not in numbers:
                    numbers.append(number)
    for instance, numbers in by_instance.items():
        yield _Part(instance, ids[instance], tuple(sorted(numbers)))


class _Reader:
    """Reads one turnout: widths and heights of its strips at stations of the file."""

    def __init__(self, side: SideShape, part: _Part) -> None:
        self.side, self.part = side, part
        self.traffic = -side.sign
        road = side.surface.road
        self.low, self.high = road.sections[part.sections[0]].start, road.sections[part.sections[-1]].end

    def read(self, carriageway: str) -> Turnout:
        """Return the turnout; raise an error if it isn't one."""
        lanes = [lane for n in self.part.sections for lane in self.side.layout.of_strip(n, "turnout_lane")]
        same = {"instance": 1, "carriageway": carriageway}
        return self._with_ramp(lanes, same) if lanes else self._bay(same)

    def _bay(self, same: dict[str, Any]) -> Turnout:
        rows = self._widths("bay")
        start, full, last, end = _trapezoid(rows)
        first, second = full[0] - start[0], end[0] - last[0]
        tapers = (first, second) if self.traffic > 0 else (second, first)
        return Turnout(
            **same,
            kind="emergency_bay",
            start_station=start[0],
            taper_in_length=_rounded(tapers[0]),
            lane_length=_rounded(last[0] - full[0]),
            taper_out_length=_rounded(tapers[1]),
            lane_width=_rounded(full[1]),
            edge_strip_width=0.0,
        )

    def _with_ramp(self, lanes: list[FileLane], same: dict[str, Any]) -> Turnout:
        kind = _KINDS[lanes[0].type]
        # Along it counts w, from where it opens to the end of its ramp.
        forward = (self.traffic > 0) != (kind == "entry")
        sections = self.side.surface.road.sections
        rows = self._widths("turnout_lane")
        on_ramp = [n for n in self.part.sections if self._type(n) in _RAMP_TYPES]
        ends = [sections[n] for n in on_ramp]
        tip = ends[0].start if forward else ends[-1].end
        # The step at its end is in its section.
        last = ends[-1].end - STEP if forward else ends[0].start + STEP
        begin = rows[0][0] if forward else rows[-1][0]
        beside = [row for row in rows if (tip - row[0]) * (1.0 if forward else -1.0) > -1e-6]
        if not forward:
            beside = beside[::-1]
        full = next(row for row in beside if row[1] > 0.999 * max(width for _, width in beside))
        taper, lane = abs(full[0] - begin), abs(tip - full[0])
        middle, ramp_length = 0.5 * (full[0] + tip), abs(last - tip)
        ahead = 1.0 if forward else -1.0
        far = tip + ahead * 0.98 * ramp_length
        clothoid = math.sqrt((0.98 * ramp_length) ** 3 / (6.0 * self._wedge(far)))
        nose = (6.0 * clothoid**2 * (self._full_shoulder() + NOSE_WIDTH)) ** (1.0 / 3.0)
        nose = min(nose, ramp_length - NOSE_BEFORE_END)
        inner = self._width("ramp_inner_strip", far)
        ramp = Ramp(
            length=_rounded(ramp_length),
            clothoid_parameter=_rounded(clothoid, 4),
            lane_width=_rounded(self._width("turnout_lane", far)),
            edge_strip_width=_rounded(inner),
            **self._surface(tip, ahead, nose, ramp_length),
        )
        tapers = (taper, 0.0) if kind == "exit" else (0.0, taper)
        return Turnout(
            **same,
            kind=kind,
            start_station=begin if forward else last,
            taper_in_length=_rounded(tapers[0]),
            lane_length=_rounded(lane),
            taper_out_length=_rounded(tapers[1]),
            lane_width=_rounded(full[1]),
            edge_strip_width=_rounded(self._width("turnout_edge_strip", middle)),
            shoulder_width=_rounded(self._width("turnout_shoulder", middle)),
            ramp=ramp,
        )

    def _surface(self, tip: float, ahead: float, nose: float, length: float) -> dict[str, Any]:
        """Return a ramp's crossfall, grade and what belongs to them; empty where it lies in the main road's plane."""
        behind = length - nose
        shares = np.array([0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.97])
        rows = [self._ramp_plane(tip + ahead * (nose + share * behind)) for share in shares]
        lift, tilt, rise = np.array(rows).T
        if max(np.abs(lift).max(), np.abs(tilt).max() * 6.0) < _FLAT:
            return {}
        given: dict[str, Any] = {}
        b = shares * behind
        if np.abs(tilt).max() * 6.0 >= _FLAT:
            fall, run_off = _run_off(b, tilt, rise)
            given["crossfall_percent"] = _rounded(100.0 * self.side.sign * fall, 4)
            given["run_off_length"] = _rounded(run_off, 2)
        if np.abs(lift).max() >= _FLAT:
            grade, radius = _grade(b, lift)
            given["grade_percent"] = _rounded(100.0 * grade, 4)
            given["rounding_radius"] = _rounded(min(max(radius, 200.0), 50_000.0), 1)
        return given

    def _ramp_plane(self, station: float) -> tuple[float, float, float]:
        """Return the ramp's lift above the main road's plane at its inner edge (m), its tilt and the plane's rise."""
        first = next(e for kind in ("gore", "ramp_inner_strip", "turnout_lane") if (e := self._edges(kind, station)))
        last = next(e for kind in ("turnout_edge_strip", "turnout_lane") if (e := self._edges(kind, station)))
        at, stretch = np.array([station]), self._stretch(station)
        rise = float(self.side.surface.rise(at, self.side.inside(at, stretch))[0])
        low, high = (float((edge.height - rise * edge.offset)[0]) for edge in (first.inner, last.outer))
        width = abs(float((last.outer.offset - first.inner.offset)[0]))
        return low, (high - low) / width, self.side.sign * rise

    def _type(self, section: int) -> str:
        lanes = self.side.layout.of_strip(section, "turnout_lane")
        return lanes[0].type if lanes else ""

    def _stretch(self, station: float) -> int:
        breaks = self.side.breaks
        return int(np.clip(np.searchsorted(breaks, station, side="right") - 1, 0, len(breaks) - 2))

    def _edges(self, kind: str, station: float, stretch: int | None = None) -> LaneEdges | None:
        stretch = self._stretch(station) if stretch is None else stretch
        lanes = self.side.layout.of_strip(int(self.side.sections[stretch]), kind)
        if not lanes:
            return None
        all_of = self.side.lanes(np.array([station]), stretch)[self.side.sign]
        edges_by_number = {edges.lane.number: edges for edges in all_of}
        first, last = edges_by_number[lanes[0].number], edges_by_number[lanes[-1].number]
        return LaneEdges(lanes[0], first.inner, last.outer)

    def _width(self, kind: str, station: float, stretch: int | None = None) -> float:
        edges = self._edges(kind, station, stretch)
        return abs(float((edges.outer.offset - edges.inner.offset)[0])) if edges else 0.0

    def _wedge(self, station: float) -> float:
        """Return the distance of a ramp's inner edge from the outer edge strip, m."""
        ramp = next(e for kind in ("ramp_inner_strip", "turnout_lane") if (e := self._edges(kind, station)))
        number = int(self.side.sections[self._stretch(station)])
        lanes = self.side.layout.of_strip(number, "outer_edge_strip")
        lanes = lanes or [slot.lanes[number] for slot in self.side.layout.slots if number in slot.lanes]
        edges_by_number = {
            e.lane.number: e for e in self.side.lanes(np.array([station]), self._stretch(station))[self.side.sign]
        }
        return abs(float((ramp.inner.offset - edges_by_number[lanes[-1].number].outer.offset)[0]))

    def _full_shoulder(self) -> float:
        """Return the hard shoulder's width where no turnout is beside it, m; 0 without any."""
        widths = [0.0]
        for stretch, number in enumerate(self.side.sections.tolist()):
            kinds = {kind for kind, _ in self.side.layout.strips.get(number, [])}
            if "hard_shoulder" in kinds and not kinds & set(TURNOUT_STRIPS):
                middle = 0.5 * float(self.side.breaks[stretch] + self.side.breaks[stretch + 1])
                widths.append(self._width("hard_shoulder", middle, stretch))
        return max(widths)

    def _widths(self, kind: str) -> list[tuple[float, float]]:
        """Return (station, width) of a strip at both ends of each stretch in which it is, in order."""
        rows: list[tuple[float, float]] = []
        for stretch, number in enumerate(self.side.sections.tolist()):
            if number not in self.part.sections or not self.side.layout.of_strip(number, kind):
                continue
            for station in self.side.breaks[stretch : stretch + 2].tolist():
                rows.append((station, self._width(kind, station, stretch)))
        return rows


def _run_off(behind: Float, tilt: Float, rise: Float) -> tuple[float, float]:
    """Return a ramp's own rise outwards (m/m), and the length (m) over which it comes to that.

    Args:
        behind: (N,) distances behind the nose, m.
        tilt: (N,) how much the ramp rises outwards more than the main road's plane there, m/m.
        rise: (N,) how much that plane does, m/m.
    """
    usual = float(Ramp.model_fields["run_off_length"].default)
    # On a ramp that ends before its run-off does, crossfall and length can't be told apart: the usual length fits.
    share = np.minimum(behind / usual, 1.0)
    fall = float(tilt[-1] / share[-1] + rise[-1])
    if np.abs(share * (fall - rise) - tilt).max() < _SAME_TILT:
        return fall, usual
    fall = float(tilt[-1] + rise[-1])
    tilt_share = tilt / (fall - rise)
    part = (tilt_share > 0.02) & (tilt_share < 0.98)
    return fall, float(np.median(behind[part] / tilt_share[part])) if part.any() else usual


def _grade(behind: Float, lift: Float) -> tuple[float, float]:
    """Return the grade (m/m) of a ramp against the main road's, and the radius (m) of the curve at its nose.

    Args:
        behind: (N,) distances behind the nose, m.
        lift: (N,) heights of the ramp's inner edge above the main road's plane there, m.
    """
    usual = float(Ramp.model_fields["rounding_radius"].default)
    last, height = float(behind[-1]), float(abs(lift[-1]))
    if last**2 >= 2.0 * usual * height:  # the lift is g b - g^2 R / 2 where the curve has ended
        grade = (last - math.sqrt(last**2 - 2.0 * usual * height)) / usual
        curve = np.minimum(behind, grade * usual)
        usual_lift = curve**2 / (2.0 * usual) + grade * (behind - curve)
        if np.abs(usual_lift - np.abs(lift)).max() < _SAME_LIFT:
            return math.copysign(grade, float(lift[-1])), usual
    grade = float((lift[-1] - lift[-2]) / (behind[-1] - behind[-2]))
    radius = 2.0 * (grade * last - float(lift[-1])) / (grade * abs(grade))
    if not abs(grade) * radius <= behind[-2]:  # its rounding goes on to its end
        radius = last**2 / (2.0 * height)
        grade = math.copysign(last / radius, float(lift[-1]))
    return grade, radius


def _trapezoid(rows: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of widths that open, stay and close."""
    full = max(width for _, width in rows)
    there = [row for row in rows if row[1] > 0.9999 * full]
    return [rows[0], there[0], there[-1], rows[-1]]


def _rounded(value: float, digits: int = _DIGITS) -> float:
    return round_value(float(value), digits)


def influence(turnout: Turnout) -> tuple[float, float]:
    """Return the lowest and the highest station, m, at which a turnout may change a width.

    Tapers begin with the full width; behind a ramp the verge comes back over a length of its own.
    """
    behind = STEP + BLEND + 1.0 if turnout.ramp else 0.0
    # An exit's ramp lies ahead in the direction of traffic, which is that of the stations on the right.
    ahead = (turnout.kind == "exit") == (turnout.carriageway == "carriageway-right")
    before, after = (0.0, behind) if ahead else (behind, 0.0)
    return turnout.start_station - before, turnout.end_station + after


def beside(stations: Float, turnouts: dict[str, Turnout]) -> Any:
    """Return which stations (N,) lie where a turnout may change a width."""
    mask = np.zeros(stations.shape, dtype=bool)
    for turnout in turnouts.values():
        low, high = influence(turnout)
        mask |= (stations > low) & (stations < high)
    return mask
