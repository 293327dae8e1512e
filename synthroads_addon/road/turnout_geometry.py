"""How a turnout changes the widths of its carriageway's strips along the road."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Float
from .objects import width_at
from .section import Carriageway, Ramp, Turnout

STEP = 0.05
"""Length over which sudden changes happen (pavement at the nose and at a ramp's end), m.

Long enough that coordinates of 32 bits don't turn the faces over: they lie skew, some metres to one side."""
NOSE_WIDTH = 1.0
"""Unpaved ground between hard shoulder and ramp at the nose, m."""
_NOSE_TURN = np.arange(6) * (np.pi / 10.0)
NOSE_ROUND = STEP / (1.0 - np.cos(_NOSE_TURN[1])) * (1.0 - np.cos(_NOSE_TURN))
NOSE_SHARE = np.sin(_NOSE_TURN)
"""Corners of the island's rounded nose, half an ellipse: distances behind the nose (m), and the shares of its width
that it has there. The first piece is the step in which the pavement changes."""
NOSE_BEFORE_END = 10.0
"""The nose lies at least this far before the ramp's end, m."""
BLEND = 30.0
"""Length behind a ramp's end over which the verge comes back beside the main road, m."""

TURNOUT_STRIPS = (
    "island",
    "gore",
    "ramp_inner_strip",
    "turnout_lane",
    "turnout_edge_strip",
    "turnout_shoulder",
    "bay",
)
"""Strips between hard shoulder and verge that turnouts make, from the hard shoulder outwards."""


@dataclass(frozen=True)
class TurnoutWidths:
    """Widths (N,) that a turnout gives its strips, m.

    Attributes:
        strips: by kind, of `TURNOUT_STRIPS`.
        hard_shoulder: what is left of the main road's.
        shoulder_extra: pavement between it and the rounded nose of the island.
        verge_extra: what the verge has in addition behind a ramp's end.
    """

    strips: dict[str, Float]
    hard_shoulder: Float
    shoulder_extra: Float
    verge_extra: Float


@dataclass(frozen=True)
class RampSurface:
    """How a ramp lies against the main road's plane, (N,).

    Attributes:
        presence: 1 up to the ramp's end, 0 behind it; over the step between in between.
        verge_share: share of what it has at its end that the verge behind it still has; 0 up to there.
        lift: height of its inner edge above the plane, m.
        crossfall_share: share of its own crossfall that it has.
    """

    presence: Float
    verge_share: Float
    lift: Float
    crossfall_share: Float


class TurnoutShape:
    """The widths that one turnout gives its carriageway's strips, by station.

    Along it counts w (m): for an exit from its beginning in the direction of traffic, for an entry backwards from its
    end; so both begin with their taper and end with their ramp. x counts from the gore's tip.

    Attributes:
        turnout, carriageway: the turnout, and what it widens.
        nose: x of the nose, m; infinite for an emergency bay.
        joined: whether its ramp goes on beyond its end, as a road of its own.
    """

    def __init__(self, turnout: Turnout, carriageway: Carriageway, joined: bool = False) -> None:
        self.turnout = turnout
        self.joined = joined
        self.carriageway = carriageway
        self._runs_forward = (carriageway.traffic > 0) != (turnout.kind == "entry")
        self._taper = turnout.taper_out_length if turnout.kind == "entry" else turnout.taper_in_length
        self._tip = self._taper + turnout.lane_length
        self.nose = np.inf
        if turnout.ramp:
            # Where x^3 / (6 A^2), by which a clothoid leaves its tangent, is the shoulder's width and the nose's.
            shoulder_at_tip = float(width_at(carriageway.hard_shoulder_width, self.station(self._tip)))
            nose_cubed = 6.0 * turnout.ramp.clothoid_parameter**2 * (shoulder_at_tip + NOSE_WIDTH)
            self.nose = max(min(nose_cubed ** (1.0 / 3.0), turnout.ramp.length - NOSE_BEFORE_END), STEP)
        self._range = self.range()

    def station(self, w: float) -> float:
        """Return the station at a distance w along the turnout (both m), for an entry backwards from its end."""
        return self.turnout.start_station + w if self._runs_forward else self.turnout.end_station - w

    def kinks(self) -> list[float]:
        """Return the stations (m, unsorted) at which a width's rate of change, or a width, jumps."""
        end_distance = self.turnout.length + STEP + BLEND if self.turnout.ramp else self.turnout.length
        marks = [self.station(w) for w in (0.0, self._taper, self._tip, end_distance)]
        if self.turnout.ramp:
            marks += [self.nose_station(distance_behind) for distance_behind in NOSE_ROUND[2:].tolist()]
            end_distance = self.turnout.ramp.length - self.nose
            marks += [
                self.nose_station(min(distance_behind, end_distance))
                for distance_behind in self._surface_marks(self.turnout.ramp)
            ]
        return [*marks, *(station for step in self.steps() for station in step)]

    def steps(self) -> list[tuple[float, float]]:
        """Return (lowest, highest) station of each `STEP` over which the pavement's width jumps; a bay has none."""
        if self.turnout.ramp is None:
            return []
        begins = [self._tip + x for x in (self.nose, self.turnout.ramp.length)]
        steps = [sorted((self.station(w), self.station(w + STEP))) for w in begins]
        return [(lowest, highest) for lowest, highest in steps]

    def range(self) -> tuple[float, float]:
        """Return the lowest and the highest station, m, at which the turnout changes any width."""
        marks = self.kinks()
        return min(marks), max(marks)

    def reaches(self, station: Float) -> bool:
        """Say whether any station (N,) may lie where the turnout changes a width."""
        lowest, highest = self._range
        return not np.all((station > highest) | (station < lowest))

    def gore_tip(self) -> float:
        """Return the station of the gore's tip, m; only exits and entries have one."""
        return self.station(self._tip)

    def nose_station(self, behind: float = 0.0) -> float:
        """Return the station of the nose, or of a place ``behind`` it, m; only exits and entries have one."""
        return self.station(self._tip + self.nose + behind)

    def ramp_end(self) -> float:
        """Return the station at which the ramp beside the main road ends, m; only exits and entries have one."""
        assert self.turnout.ramp is not None
        return self.station(self._tip + self.turnout.ramp.length)

    def leaves_forward(self) -> bool:
        """Return whether the ramp leaves the main road in the direction of the stations."""
        return self._runs_forward

    def gap_at_end(self) -> float:
        """Return the width of the ground between hard shoulder and ramp at the ramp's end, m."""
        ramp = self.turnout.ramp
        assert ramp is not None
        moved = ramp.length**3 / (6.0 * ramp.clothoid_parameter**2)
        return max(moved - float(width_at(self.carriageway.hard_shoulder_width, self.ramp_end())), 0.0)

    def bend(self, station: Float) -> Float:
        """Return the second derivative (N,) of the ramp's offset by station, 1/m; 0 without a ramp."""
        ramp = self.turnout.ramp
        if ramp is None:
            return np.zeros(station.shape)
        x = self._x(station)
        return np.where((x > 0.0) & (x < ramp.length), x / ramp.clothoid_parameter**2, 0.0)

    def ramp_bend(self, station: Float) -> Float:
        """Return the second derivative (N,) by station of the height of the ramp's inner edge, 1/m; 0 without any."""
        ramp = self.turnout.ramp
        if ramp is None or ramp.grade_percent == 0.0:
            return np.zeros(station.shape)
        distance_behind = self._x(station) - self.nose
        return np.where(
            (distance_behind > 0.0) & (distance_behind < _curve_length(ramp)), 1.0 / ramp.rounding_radius, 0.0
        )

    def ramp_surface(self, station: Float) -> RampSurface | None:
        """Return how the ramp lies at stations (N,), m; None where it has neither crossfall nor grade of its own."""
        ramp = self.turnout.ramp
        if ramp is None or (ramp.crossfall_percent is None and ramp.grade_percent == 0.0 and not self.joined):
            return None
        x = self._x(station)
        presence, blend = _end_of_ramp(ramp, x)
        distance_behind = np.clip(x, self.nose, ramp.length) - self.nose
        distance_in_curve = np.minimum(distance_behind, _curve_length(ramp))
        curve_rise = np.copysign(distance_in_curve**2 / (2.0 * ramp.rounding_radius), ramp.grade_percent)
        lift = curve_rise + ramp.grade_percent / 100.0 * (distance_behind - distance_in_curve)
        run_off = (
            np.zeros(x.shape)
            if ramp.crossfall_percent is None
            else np.minimum(distance_behind / ramp.run_off_length, 1.0)
        )
        return RampSurface(presence, (1.0 - presence) * blend, lift, run_off)

    @staticmethod
    def _surface_marks(ramp: Ramp) -> list[float]:
        """Return the distances behind the nose, m, at which the change of the ramp's heights jumps."""
        marks = [ramp.run_off_length] if ramp.crossfall_percent is not None else []
        return [*marks, _curve_length(ramp)] if ramp.grade_percent else marks

    def widths(self, station: Float) -> TurnoutWidths:
        """Return the widths of the turnout's strips, and how others change, at stations (N,), m."""
        full_shoulder = width_at(self.carriageway.hard_shoulder_width, station)
        strips = {kind: np.zeros(station.shape) for kind in TURNOUT_STRIPS}
        turnout, w = self.turnout, self._w(station)
        if turnout.ramp is None:
            open_share = np.minimum(w / turnout.taper_in_length, (turnout.length - w) / turnout.taper_out_length)
            strips["bay"] = turnout.lane_width * np.clip(open_share, 0.0, 1.0)
            return TurnoutWidths(strips, full_shoulder, np.zeros(station.shape), np.zeros(station.shape))
        return self._with_ramp(turnout.ramp, w, full_shoulder, strips)

    def _with_ramp(self, ramp: Ramp, w: Float, full_shoulder: Float, strips: dict[str, Float]) -> TurnoutWidths:
        """Return the widths of an exit's or entry's strips, m, filled into the zeros of `strips`.

        Args:
            ramp: its ramp.
            w: (N,) distances along the turnout, m.
            full_shoulder: (N,) width of the main road's hard shoulder, m.
            strips: width by kind, changed in place.
        """
        turnout, x = self.turnout, w - self._taper - self.turnout.lane_length
        open_share = np.clip(w / self._taper, 0.0, 1.0)
        to_ramp = np.clip(x / self.nose, 0.0, 1.0)
        behind_nose = np.clip((x - self.nose) / STEP, 0.0, 1.0)
        presence, blend = _end_of_ramp(ramp, x)
        distance_apart = np.clip(x, 0.0, ramp.length) ** 3 / (6.0 * ramp.clothoid_parameter**2)

        def between(lane_width: float, ramp_width_there: float) -> Float:
            """Return a strip's width (N,), m: it opens over the taper and turns into the ramp's up to the nose."""
            return presence * (open_share * lane_width * (1.0 - to_ramp) + ramp_width_there * to_ramp)

        shoulder = np.minimum(full_shoulder, distance_apart)
        gap_width = distance_apart - shoulder
        island = gap_width * np.interp(x - self.nose, NOSE_ROUND, NOSE_SHARE)
        # Half of what the rounded nose leaves lies on either side; over the step it grows evenly.
        edge_width = behind_nose * (gap_width - np.maximum(island, NOSE_SHARE[1] * gap_width)) / 2.0
        strips["island"] = presence * island
        step_width = distance_apart - island - behind_nose * shoulder - edge_width
        strips["gore"] = presence * np.where(behind_nose < 1.0, step_width, edge_width)
        strips["ramp_inner_strip"] = between(0.0, ramp.edge_strip_width)
        strips["turnout_lane"] = between(turnout.lane_width, ramp.lane_width)
        strips["turnout_edge_strip"] = between(turnout.edge_strip_width, ramp.edge_strip_width)
        strips["turnout_shoulder"] = between(turnout.shoulder_width, 0.0)
        narrowing_shoulder = full_shoulder * (1.0 - open_share) * (1.0 - behind_nose)
        hard_shoulder = presence * (narrowing_shoulder + behind_nose * shoulder) + (1.0 - presence) * full_shoulder
        at_end = distance_apart - shoulder + ramp_width(ramp)
        verge_extra = np.zeros(x.shape) if self.joined else (1.0 - presence) * blend * at_end
        return TurnoutWidths(strips, hard_shoulder, presence * edge_width, verge_extra)

    def _w(self, station: Float) -> Float:
        """Return the distances (N,) along the turnout from its beginning, m, at stations (N,)."""
        return station - self.turnout.start_station if self._runs_forward else self.turnout.end_station - station

    def _x(self, station: Float) -> Float:
        """Return the distances (N,) along the turnout from the gore's tip, m, at stations (N,)."""
        return self._w(station) - self._taper - self.turnout.lane_length


def ramp_width(ramp: Ramp) -> float:
    """Return the width (m) of a ramp behind the nose: its lane and both edge strips."""
    return ramp.lane_width + 2.0 * ramp.edge_strip_width


def _curve_length(ramp: Ramp) -> float:
    """Return the length (m) of a ramp's vertical curve."""
    return abs(ramp.grade_percent) / 100.0 * ramp.rounding_radius


def _end_of_ramp(ramp: Ramp, x: Float) -> tuple[Float, Float]:
    """Return two shares (N,) at distances (N,) from the gore's tip, m.

    The first is 1 where the ramp is there and falls to 0 over the `STEP` at its end; the second falls from 1 to 0 over
    the `BLEND` behind that, in which the verge comes back.
    """
    presence = 1.0 - np.clip((x - ramp.length) / STEP, 0.0, 1.0)
    return presence, np.clip(1.0 - (x - ramp.length - STEP) / BLEND, 0.0, 1.0)
