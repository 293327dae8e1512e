"""The superelevation of LandXML alignments as the crossfall of two carriageways.

LandXML 1.2 schema, `Superelevation`: stations of run-out and run-off on both sides of one curve, and its full
superelevation. It names neither a side nor the crossfall of straights: the road falls to the inside of the curve, and
run-out and run-off have one rate, as the stations are meant (AASHTO, A Policy on Geometric Design, chapter 3).
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.schema import round_value
from ...road.objects import Side
from ...road.section import CrossfallPoint
from ..curves import Curve
from ..line import PlanPiece
from ..xml_text import children, finite, local_name

_STATIONS = ("BeginRunoutSta", "BeginRunoffSta", "FullSuperSta", "RunoffSta", "StartofRunoutSta", "EndofRunoutSta")
"""Stations of a superelevation in order: usual crossfall, outer side level, full; and back."""
_STEEPEST = 12.0
"""Largest full superelevation, %, that a parameter set allows."""
_USUAL = 2.5
"""Crossfall of straights, %, of the guidelines (RAA)."""
_LEAST, _MOST = 1.0, 4.0
"""Crossfalls of straights, %, that rates may give."""
_SAME = 0.05
"""Crossfalls, %, that differ by no more are the same (chosen)."""
_SIDES: dict[Side, float] = {"left": -1.0, "right": 1.0}
"""Sign of the crossfall, positive where it falls to the right, that falls outwards."""


@dataclass(frozen=True)
class _Curve:
    """One superelevation: its stations from the line's begin (m), and its crossfall (%), positive to the right."""

    stations: tuple[float, ...]
    full: float


class _Unfit(Exception):
    """A superelevation that a parameter set can't hold as it is; its text says why."""


@dataclass(frozen=True)
class Superelevation:
    """The superelevation of an alignment.

    Attributes:
        crossfall: of both carriageways, stations counted from the line's begin; empty where no curve has any.
        curves: how many curves have it.
        left_out: what of it isn't taken over, as text with numbers.
        remarks: what is to be told where it is used.
    """

    crossfall: Mapping[Side, tuple[CrossfallPoint, ...]] = field(default_factory=dict)
    curves: int = 0
    left_out: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def read_superelevation(alignment: Element, pieces: Sequence[PlanPiece], unit: float, start: float) -> Superelevation:
    """Return the superelevation of an alignment.

    Args:
        alignment: the element of LandXML.
        pieces: of its plan.
        unit: of length, m.
        start: station of its begin, m.
    """
    rows = children(alignment, "Superelevation")
    reasons: Counter[str] = Counter()
    curves: list[_Curve] = []
    counted_anew = bool(children(alignment, "StaEquation"))
    for row in rows:
        try:
            if counted_anew:
                raise _Unfit("beside station equations it isn't said which count its stations have")
            curves.append(_curve(row, pieces, unit, start))
        except _Unfit as error:
            reasons[str(error)] += 1
    # Curves that overlap contradict each other, and those below the straights' crossfall would turn the road back.
    curves.sort(key=lambda curve: curve.stations)
    overlapping = _overlapping(curves)
    separate = [curve for n, curve in enumerate(curves) if n not in overlapping]
    if overlapping:
        reasons["it overlaps that of another curve"] += len(overlapping)
    left_out = [f"crossfall: {count} superelevations: {reason}" for reason, count in sorted(reasons.items())]
    if not separate:
        return Superelevation(left_out=tuple(left_out))
    straight, remark = _usual(separate)
    turned = [curve for curve in separate if abs(curve.full) >= straight - 1e-9]
    if len(turned) < len(separate):
        left_out.append(
            f"crossfall: {len(separate) - len(turned)} superelevations: below the {straight:g} % of straights"
        )
    if not turned:
        return Superelevation(left_out=tuple(left_out))
    crossfall = {side: _points(turned, outward_sign * straight) for side, outward_sign in _SIDES.items()}
    return Superelevation(crossfall, len(turned), tuple(left_out), (remark,))


def _curve(row: Element, pieces: Sequence[PlanPiece], unit: float, start: float) -> _Curve:
    """Return the curve of a `Superelevation` element; raise `_Unfit` with the reason where a set can't hold it."""
    texts = {local_name(each): (each.text or "").strip() for each in row}
    if texts.get("AdverseSE", "non-adverse") == "adverse":
        raise _Unfit("it is adverse")
    missing_names = [each for each in (*_STATIONS, "FullSuperelev") if not texts.get(each)]
    is_repeated = len([each for each in row if local_name(each) in _STATIONS]) > len(_STATIONS)
    if missing_names or is_repeated:
        raise _Unfit(f"{missing_names[0]} is missing" if missing_names else "a station comes twice")
    try:
        stations = tuple(finite(each, texts[each]) * unit - start for each in _STATIONS)
        full_percent = abs(finite("FullSuperelev", texts["FullSuperelev"]))
    except InputError:
        raise _Unfit("a number is none") from None
    plan_end = pieces[-1].station + pieces[-1].length
    # Only at its full part may two stations be one.
    if any(
        next_station < a or (next_station == a and n != 2)
        for n, (a, next_station) in enumerate(itertools.pairwise(stations))
    ):
        raise _Unfit("its stations don't grow")
    if stations[2] < 0.0 or stations[3] > plan_end:
        raise _Unfit("it lies beyond the alignment's ends")
    if 100.0 * full_percent <= _STEEPEST:  # a ratio: no percent is as small
        full_percent *= 100.0
    elif not 1.0 <= full_percent <= _STEEPEST:
        raise _Unfit(f"FullSuperelev is neither a ratio nor a percentage up to {_STEEPEST:g} %")
    senses = {float(np.sign(k)) for k in _curvature(pieces, np.linspace(stations[2], stations[3], 9))}
    if len(senses) != 1 or 0.0 in senses:
        raise _Unfit("the alignment doesn't bend one way where it is full")
    return _Curve(stations, -senses.pop() * full_percent)


def _curvature(pieces: Sequence[PlanPiece], stations: Float) -> list[float]:
    """Return the curvatures (N,), 1/m, positive to the left, at stations (N,), m."""
    curvatures = []
    starts = np.array([piece.station for piece in pieces])
    for station, number in zip(stations.tolist(), np.searchsorted(starts, stations, "right").tolist(), strict=True):
        piece = pieces[max(number - 1, 0)]
        share = min(max((station - piece.station) / piece.length, 0.0), 1.0)
        if isinstance(piece.shape, Curve):
            curvatures.append(float(piece.shape.curvature(np.array([share * piece.shape.length]))[0]))
        else:
            curvatures.append(piece.shape[0] + share * (piece.shape[1] - piece.shape[0]))
    return curvatures


def _overlapping(curves: Sequence[_Curve]) -> set[int]:
    """Return the numbers of those curves, given in order of their stations, that overlap another curve."""
    numbers: set[int] = set()
    farthest = 0
    for number, curve in enumerate(curves[1:], 1):
        if curve.stations[0] < curves[farthest].stations[-1]:
            numbers |= {farthest, number}
        if curve.stations[-1] > curves[farthest].stations[-1]:
            farthest = number
    return numbers


def _usual(curves: Sequence[_Curve]) -> tuple[float, str]:
    """Return the crossfall of straights, %, by the rates of all curves, or else by the guidelines; and a remark."""
    # Run-out and run-off have one rate, so the straights' crossfall is full * run-out length / run-off length.
    rates = []
    for curve in curves:
        runout_begin, level_begin, full_begin, full_end, level_end, runout_end = curve.stations
        rates += [abs(curve.full) * (level_begin - runout_begin) / (full_begin - level_begin)]
        rates += [abs(curve.full) * (runout_end - level_end) / (level_end - full_end)]
    least_rate, largest_rate = min(rates), max(rates)
    remark = "the crossfall of straights isn't said:"
    if largest_rate - least_rate <= _SAME and least_rate >= _LEAST and largest_rate <= _MOST:
        crossfall = round(0.5 * (least_rate + largest_rate), 2)
        return crossfall, f"{remark} {crossfall:g} % follow from the lengths of its run-outs"
    return _USUAL, f"{remark} run-outs have several rates, and {_USUAL:g} % are taken"


def _points(curves: Sequence[_Curve], straight: float) -> tuple[CrossfallPoint, ...]:
    """Return the crossfall, %, of one carriageway by station: `straight` between the curves, turned over in them."""
    corners: list[tuple[float, float]] = [(0.0, straight)]
    for curve in curves:
        runout_begin, level_begin, full_begin, full_end, level_end, runout_end = curve.stations
        if straight * curve.full < 0.0:  # the outer side turns over
            transitions = [(runout_begin, straight), (level_begin, 0.0)], [(level_end, 0.0), (runout_end, straight)]
        else:  # the inner one waits until the outer lies in its plane
            share = abs(straight / curve.full)
            transitions = (
                [(level_begin + share * (full_begin - level_begin), straight)],
                [(level_end - share * (level_end - full_end), straight)],
            )
        corners += [*transitions[0], (full_begin, curve.full), (full_end, curve.full), *transitions[1]]
    if min(station for station, _ in corners) < 0.0:  # a curve that begins before the road does
        stations, values = np.array(sorted(corners[1:])).T
        begin_value = float(np.interp(0.0, stations, values))
        corners = [(0.0, begin_value), *((s, v) for s, v in corners[1:] if s > 0.0)]
    points: list[CrossfallPoint] = []
    for station, percent in corners:
        if not points or round_value(station) > points[-1].station:
            points.append(CrossfallPoint(station=round_value(station), crossfall_percent=round_value(percent, 6)))
    return tuple(points)
