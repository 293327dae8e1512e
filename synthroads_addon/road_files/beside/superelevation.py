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
_USUAL = 2.5
"""Crossfall of straights, %, of the guidelines (RAA)."""
_LEAST, _MOST = 1.0, 4.0
"""Crossfalls of straights, %, that rates may give."""
_SAME = 0.05
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
    wrong: Counter[str] = Counter()
    curves: list[_Curve] = []
    counted_anew = bool(children(alignment, "StaEquation"))
    for row in rows:
        try:
            if counted_anew:
                raise _Unfit("beside station equations it isn't said which count its stations have")
            curves.append(_curve(row, pieces, unit, start))
        except _Unfit as error:
            wrong[str(error)] += 1
    curves.sort(key=lambda curve: curve.stations)
    overlapping = _overlapping(curves)
    kept = [curve for n, curve in enumerate(curves) if n not in overlapping]
    if overlapping:
        wrong["it overlaps that of another curve"] += len(overlapping)
    left_out = [f"crossfall: {count} superelevations: {why}" for why, count in sorted(wrong.items())]
    if not kept:
        return Superelevation(left_out=tuple(left_out))
    usual, remark = _usual(kept)
    steep = [curve for curve in kept if abs(curve.full) >= usual - 1e-9]
    if len(steep) < len(kept):
        left_out.append(f"crossfall: {len(kept) - len(steep)} superelevations: below the {usual:g} % of straights")
    if not steep:
        return Superelevation(left_out=tuple(left_out))
    crossfall = {side: _points(steep, sign * usual) for side, sign in _SIDES.items()}
    return Superelevation(crossfall, len(steep), tuple(left_out), (remark,))


def _curve(row: Element, pieces: Sequence[PlanPiece], unit: float, start: float) -> _Curve:
    texts = {local_name(each): (each.text or "").strip() for each in row}
    if texts.get("AdverseSE", "non-adverse") == "adverse":
        raise _Unfit("it is adverse")
    missing = [each for each in (*_STATIONS, "FullSuperelev") if not texts.get(each)]
    repeated = len([each for each in row if local_name(each) in _STATIONS]) > len(_STATIONS)
    if missing or repeated:
        raise _Unfit(f"{missing[0]} is missing" if missing else "a station comes twice")
    try:
        stations = tuple(finite(each, texts[each]) * unit - start for each in _STATIONS)
        value = abs(finite("FullSuperelev", texts["FullSuperelev"]))
    except InputError:
        raise _Unfit("a number is none") from None
    end = pieces[-1].station + pieces[-1].length
    # Only at its full part may two stations be one.
    if any(b < a or (b == a and n != 2) for n, (a, b) in enumerate(itertools.pairwise(stations))):
        raise _Unfit("its stations don't grow")
    if stations[2] < 0.0 or stations[3] > end:
        raise _Unfit("it lies beyond the alignment's ends")
    if 100.0 * value <= _STEEPEST:  # a ratio: no percent is as small
        value *= 100.0
    elif not 1.0 <= value <= _STEEPEST:
        raise _Unfit(f"FullSuperelev is neither a ratio nor a percentage up to {_STEEPEST:g} %")
    senses = {float(np.sign(k)) for k in _curvature(pieces, np.linspace(stations[2], stations[3], 9))}
    if len(senses) != 1 or 0.0 in senses:
        raise _Unfit("the alignment doesn't bend one way where it is full")
    return _Curve(stations, -senses.pop() * value)


def _curvature(pieces: Sequence[PlanPiece], stations: Float) -> list[float]:
    """Return the curvature, 1/m, at stations (N,), m."""
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
    """Return the numbers of those that overlap another one, of curves in the order of their stations."""
    numbers: set[int] = set()
    farthest = 0
    for number, curve in enumerate(curves[1:], 1):
        if curve.stations[0] < curves[farthest].stations[-1]:
            numbers |= {farthest, number}
        if curve.stations[-1] > curves[farthest].stations[-1]:
            farthest = number
    return numbers


def _usual(curves: Sequence[_Curve]) -> tuple[float, str]:
    """Return the crossfall of straights, %, that the rates of all curves give, else the guidelines'; and a remark."""
    rates = []
    for curve in curves:
        out, level, full, back, level_again, end = curve.stations
        rates += [abs(curve.full) * (level - out) / (full - level)]
        rates += [abs(curve.full) * (end - level_again) / (level_again - back)]
    low, high = min(rates), max(rates)
    unsaid = "the crossfall of straights isn't said:"
    if high - low <= _SAME and low >= _LEAST and high <= _MOST:
        usual = round(0.5 * (low + high), 2)
        return usual, f"{unsaid} {usual:g} % follow from the lengths of its run-outs"
    return _USUAL, f"{unsaid} run-outs have several rates, and {_USUAL:g} % are taken"


def _points(curves: Sequence[_Curve], straight: float) -> tuple[CrossfallPoint, ...]:
    """Return one carriageway's crossfall, %, which is `straight` between curves."""
    corners: list[tuple[float, float]] = [(0.0, straight)]
    for curve in curves:
        out, level, full, back, level_again, end = curve.stations
        if straight * curve.full < 0.0:  # the outer side turns over
            inner = [(out, straight), (level, 0.0)], [(level_again, 0.0), (end, straight)]
        else:  # the inner one waits until the outer lies in its plane
            share = abs(straight / curve.full)
            inner = (
                [(level + share * (full - level), straight)],
                [(level_again - share * (level_again - back), straight)],
            )
        corners += [*inner[0], (full, curve.full), (back, curve.full), *inner[1]]
    if min(station for station, _ in corners) < 0.0:  # a curve that begins before the road does
        stations, values = np.array(sorted(corners[1:])).T
        at_begin = float(np.interp(0.0, stations, values))
        corners = [(0.0, at_begin), *((s, v) for s, v in corners[1:] if s > 0.0)]
    points: list[CrossfallPoint] = []
    for station, percent in corners:
        if not points or round_value(station) > points[-1].station:
            points.append(CrossfallPoint(station=round_value(station), crossfall_percent=round_value(percent, 6)))
    return tuple(points)
