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
from ...road.section import BAYS, Ramp, Turnout
from ...road.turnout_geometry import BLEND, NOSE_BEFORE_END, NOSE_WIDTH, STEP, TURNOUT_STRIPS
from .loss import Loss
from .records import FileLane
from .shape import SideShape
from .surface import LaneEdges

_RAMP_TYPES = frozenset({"offRamp", "onRamp"})
_KINDS = {"exit": "exit", "offRamp": "exit", "entry": "entry", "onRamp": "entry"}
_FLAT = 5e-4
"""Height, m, up to which a ramp's edges lie in the main road's plane."""
_RAMP_WIDTH = 6.0
"""Usual width of a ramp, m, over which a tilt is a height."""
_SAME_TILT, _SAME_LIFT = 1e-4, 3e-4
"""Differences of tilts, m/m, and of heights, m, up to which usual fields fit a ramp (chosen)."""
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
    """Yield the lanes of each turnout of a side, grouped by the instance that our own files note on lanes."""
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
        self.traffic = side.traffic
        road = side.surface.road
        self.low, self.high = road.sections[part.sections[0]].start, road.sections[part.sections[-1]].end

    def read(self, carriageway: str) -> Turnout:
        """Return the turnout; raise an error if it isn't one."""
        lanes = [lane for n in self.part.sections for lane in self.side.layout.of_strip(n, "turnout_lane")]
        common_fields = {"instance": 1, "carriageway": carriageway}
        return self._with_ramp(lanes, common_fields) if lanes else self._bay(common_fields)

    def _bay(self, common: dict[str, Any]) -> Turnout:
        """Return a bay, whose widths by station form a trapezoid; `common` are fields of all turnouts.

        Its kind is the one that our own files note, else that of a bay of a motorway.
        """
        widths = self._widths("bay")
        opening, full_begin, full_end, closing = _trapezoid(widths)
        low_taper, high_taper = full_begin[0] - opening[0], closing[0] - full_end[0]
        tapers = (low_taper, high_taper) if self.traffic > 0 else (high_taper, low_taper)
        return Turnout(
            **common,
            kind=next((kind for kind in BAYS if kind in self._noted_kinds()), BAYS[0]),
            start_station=opening[0],
            taper_in_length=_rounded(tapers[0]),
            lane_length=_rounded(full_end[0] - full_begin[0]),
            taper_out_length=_rounded(tapers[1]),
            lane_width=_rounded(full_begin[1]),
            edge_strip_width=0.0,
        )

    def _noted_kinds(self) -> set[str]:
        """Return the kinds that our own files note on the lanes of the bay."""
        lanes = (lane for n in self.part.sections for lane in self.side.layout.of_strip(n, "bay"))
        return {lane.notes.get("kind", "") for lane in lanes}

    def _with_ramp(self, lanes: list[FileLane], common: dict[str, Any]) -> Turnout:
        """Return an exit or entry with its ramp, read from its strips; `common` are the fields of all turnouts."""
        kind = _KINDS[lanes[0].type]
        # A turnout opens at one end, and its ramp ends at the other: True where it opens at the lower station.
        opens_forward = (self.traffic > 0) != (kind == "entry")
        sections = self.side.surface.road.sections
        rows = self._widths("turnout_lane")
        ramp_numbers = [n for n in self.part.sections if self._type(n) in _RAMP_TYPES]
        ramp_sections = [sections[n] for n in ramp_numbers]
        tip = ramp_sections[0].start if opens_forward else ramp_sections[-1].end
        # The ramp's last section also holds the step by which its strips end.
        ramp_end = ramp_sections[-1].end - STEP if opens_forward else ramp_sections[0].start + STEP
        opening = rows[0][0] if opens_forward else rows[-1][0]
        lane_rows = [row for row in rows if (tip - row[0]) * (1.0 if opens_forward else -1.0) > -1e-6]
        if not opens_forward:
            lane_rows = lane_rows[::-1]
        full_row = next(row for row in lane_rows if row[1] > 0.999 * max(width for _, width in lane_rows))
        taper_length, full_length = abs(full_row[0] - opening), abs(tip - full_row[0])
        lane_middle, ramp_length = 0.5 * (full_row[0] + tip), abs(ramp_end - tip)
        direction = 1.0 if opens_forward else -1.0
        far_station = tip + direction * 0.98 * ramp_length
        # A clothoid's offset at a length l is l^3 / (6 A^2): A follows from the wedge near the ramp's end.
        clothoid = math.sqrt((0.98 * ramp_length) ** 3 / (6.0 * self._wedge(far_station)))
        # The nose lies where the ramp has moved away by a shoulder's and the nose's width.
        nose_distance = (6.0 * clothoid**2 * (self._full_shoulder() + NOSE_WIDTH)) ** (1.0 / 3.0)
        nose_distance = min(nose_distance, ramp_length - NOSE_BEFORE_END)
        inner_width = self._width("ramp_inner_strip", far_station)
        ramp = Ramp(
            length=_rounded(ramp_length),
            clothoid_parameter=_rounded(clothoid, 4),
            lane_width=_rounded(self._width("turnout_lane", far_station)),
            edge_strip_width=_rounded(inner_width),
            **self._surface(tip, direction, nose_distance, ramp_length),
        )
        tapers = (taper_length, 0.0) if kind == "exit" else (0.0, taper_length)
        return Turnout(
            **common,
            kind=kind,
            start_station=opening if opens_forward else ramp_end,
            taper_in_length=_rounded(tapers[0]),
            lane_length=_rounded(full_length),
            taper_out_length=_rounded(tapers[1]),
            lane_width=_rounded(full_row[1]),
            edge_strip_width=_rounded(self._width("turnout_edge_strip", lane_middle)),
            shoulder_width=_rounded(self._width("turnout_shoulder", lane_middle)),
            ramp=ramp,
        )

    def _surface(self, tip: float, direction: float, nose: float, length: float) -> dict[str, Any]:
        """Return a ramp's crossfall, grade and what belongs to them; empty where it lies in the main road's plane."""
        length_behind = length - nose
        # Places between the nose and the ramp's end at which its plane is read (chosen).
        shares = np.array([0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.97])
        rows = [self._ramp_plane(tip + direction * (nose + share * length_behind)) for share in shares]
        lifts, tilts, rises = np.array(rows).T
        if max(np.abs(lifts).max(), np.abs(tilts).max() * _RAMP_WIDTH) < _FLAT:
            return {}
        fields: dict[str, Any] = {}
        distances = shares * length_behind
        if np.abs(tilts).max() * _RAMP_WIDTH >= _FLAT:
            fall, run_off = _run_off(distances, tilts, rises)
            fields["crossfall_percent"] = _rounded(100.0 * self.side.sign * fall, 4)
            fields["run_off_length"] = _rounded(run_off, 2)
        if np.abs(lifts).max() >= _FLAT:
            grade, radius = _grade(distances, lifts)
            fields["grade_percent"] = _rounded(100.0 * grade, 4)
            fields["rounding_radius"] = _rounded(min(max(radius, 200.0), 50_000.0), 1)
        return fields

    def _ramp_plane(self, station: float) -> tuple[float, float, float]:
        """Return the ramp's lift over the main road's plane at its inner edge (m), its tilt and that plane's rise."""
        inner_strip = next(
            e for kind in ("gore", "ramp_inner_strip", "turnout_lane") if (e := self._edges(kind, station))
        )
        outer_strip = next(e for kind in ("turnout_edge_strip", "turnout_lane") if (e := self._edges(kind, station)))
        stations, stretch = np.array([station]), self._stretch(station)
        rise = float(self.side.surface.rise(stations, self.side.inside(stations, stretch))[0])
        inner_lift, outer_lift = (
            float((edge.height - rise * edge.offset)[0]) for edge in (inner_strip.inner, outer_strip.outer)
        )
        width = abs(float((outer_strip.outer.offset - inner_strip.inner.offset)[0]))
        return inner_lift, (outer_lift - inner_lift) / width, self.side.sign * rise

    def _type(self, section: int) -> str:
        """Return the type of the turnout's lane in a section; "" without one."""
        lanes = self.side.layout.of_strip(section, "turnout_lane")
        return lanes[0].type if lanes else ""

    def _stretch(self, station: float) -> int:
        """Return the number of the stretch between breaks in which a station lies."""
        breaks = self.side.breaks
        return int(np.clip(np.searchsorted(breaks, station, side="right") - 1, 0, len(breaks) - 2))

    def _edges(self, kind: str, station: float, stretch: int | None = None) -> LaneEdges | None:
        """Return the edges of a strip at a station, m, by default in the stretch there; None without such a strip."""
        stretch = self._stretch(station) if stretch is None else stretch
        lanes = self.side.layout.of_strip(int(self.side.sections[stretch]), kind)
        if not lanes:
            return None
        side_edges = self.side.lanes(np.array([station]), stretch)[self.side.sign]
        edges_by_number = {edges.lane.number: edges for edges in side_edges}
        inner_edges, outer_edges = edges_by_number[lanes[0].number], edges_by_number[lanes[-1].number]
        return LaneEdges(lanes[0], inner_edges.inner, outer_edges.outer)

    def _width(self, kind: str, station: float, stretch: int | None = None) -> float:
        """Return the width of a strip at a station, m; 0 where there is no such strip."""
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


def _run_off(distances: Float, tilts: Float, rises: Float) -> tuple[float, float]:
    """Return a ramp's own rise outwards (m/m), and the length (m) over which it comes to that.

    Args:
        distances: (N,) behind the nose, m.
        tilts: (N,) by how much the ramp rises more steeply outwards than the main road's plane there, m/m.
        rises: (N,) of that plane outwards, m/m.
    """
    usual_length = float(Ramp.model_fields["run_off_length"].default)
    # On a ramp that ends before its run-off does, crossfall and length can't be told apart: the usual length fits.
    share = np.minimum(distances / usual_length, 1.0)
    fall = float(tilts[-1] / share[-1] + rises[-1])
    if np.abs(share * (fall - rises) - tilts).max() < _SAME_TILT:
        return fall, usual_length
    fall = float(tilts[-1] + rises[-1])
    tilt_share = tilts / (fall - rises)
    in_run_off = (tilt_share > 0.02) & (tilt_share < 0.98)
    return fall, float(np.median(distances[in_run_off] / tilt_share[in_run_off])) if in_run_off.any() else usual_length


def _grade(distances: Float, lifts: Float) -> tuple[float, float]:
    """Return the grade (m/m) of a ramp against the main road's, and the radius (m) of the curve at its nose.

    Args:
        distances: (N,) behind the nose, m.
        lifts: (N,) heights of the ramp's inner edge above the main road's plane there, m.
    """
    usual_radius = float(Ramp.model_fields["rounding_radius"].default)
    end_distance, end_height = float(distances[-1]), float(abs(lifts[-1]))
    if end_distance**2 >= 2.0 * usual_radius * end_height:  # the lift is g b - g^2 R / 2 where the curve has ended
        grade = (end_distance - math.sqrt(end_distance**2 - 2.0 * usual_radius * end_height)) / usual_radius
        curve_length = np.minimum(distances, grade * usual_radius)
        usual_lift = curve_length**2 / (2.0 * usual_radius) + grade * (distances - curve_length)
        if np.abs(usual_lift - np.abs(lifts)).max() < _SAME_LIFT:
            return math.copysign(grade, float(lifts[-1])), usual_radius
    grade = float((lifts[-1] - lifts[-2]) / (distances[-1] - distances[-2]))
    radius = 2.0 * (grade * end_distance - float(lifts[-1])) / (grade * abs(grade))
    if not abs(grade) * radius <= distances[-2]:  # its rounding goes on to its end
        radius = end_distance**2 / (2.0 * end_height)
        grade = math.copysign(end_distance / radius, float(lifts[-1]))
    return grade, radius


def _trapezoid(widths: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the four corners (station, width), m, of widths that open, stay and close."""
    full_width = max(width for _, width in widths)
    full_rows = [row for row in widths if row[1] > 0.9999 * full_width]
    return [widths[0], full_rows[0], full_rows[-1], widths[-1]]


def _rounded(value: float, digits: int = _DIGITS) -> float:
    return round_value(float(value), digits)


def influence(turnout: Turnout) -> tuple[float, float]:
    """Return the lowest and the highest station, m, at which a turnout may change a width.

    Tapers begin with the full width; behind a ramp the verge comes back over a length of its own.
    """
    length_behind = STEP + BLEND + 1.0 if turnout.ramp else 0.0
    # An exit's ramp lies ahead in the direction of traffic, which is that of the stations on the right.
    ramp_at_high_end = (turnout.kind == "exit") == (turnout.carriageway == "carriageway-right")
    margin_low, margin_high = (0.0, length_behind) if ramp_at_high_end else (length_behind, 0.0)
    return turnout.start_station - margin_low, turnout.end_station + margin_high


def beside(stations: Float, turnouts: dict[str, Turnout]) -> Any:
    """Return which of the stations (N,), m, lie where a turnout may change a width: N booleans."""
    mask = np.zeros(stations.shape, dtype=bool)
    for turnout in turnouts.values():
        start, end = influence(turnout)
        mask |= (stations > start) & (stations < end)
    return mask
