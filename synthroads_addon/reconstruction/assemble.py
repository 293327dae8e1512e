"""Measurements as a parameter set: the same kind that is sampled or written by hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..base.arrays import Float
from ..base.schema import round_value
from ..base.version import generator
from ..fitting.fit import AxisFit, alignment_object
from ..road.guidelines import LIMITS, STANDARD_CROSS_SECTIONS, design_class_of
from ..road.objects import RoadObject
from ..road.parameters import EPSG_URI, Metadata, RoadParameters, Transform
from ..road.section import Carriageway, CrossfallPoint, Lane, LineMarking, Median
from ..road.surroundings import Terrain
from ..road.things.concrete_barrier import ConcreteBarrier
from ..road.things.delineator import Delineator
from ..road.things.guardrail import Guardrail
from ..road.things.noise_barrier import NoiseBarrier
from .lines import Line
from .objects import FoundBarrier, FoundPost
from .section import MeasuredSection, Side, SideSection, line_width

RotationAxis = Literal["carriageway_axis", "inner_edge"]

UNKNOWN_EPSG = 25832
"""Written where a cloud doesn't say its map system: a parameter set must name one (ETRS89 / UTM 32N)."""
_SIDES: tuple[Side, ...] = ("right", "left")
_CROSSFALL_TOLERANCE = 0.15  # %
_TERMINAL = 12.0
_END = 5.0  # m: a barrier that ends so near to the road's end goes on beyond it
_ROUND = 4  # digits of lengths: a tenth of a millimetre


@dataclass(frozen=True)
class GroundShape:
    """Ground beside the road: reach, mean height of the centreline above it, its spread, the verge's width (m)."""

    half_width: float
    embankment_height: float
    undulation: float
    verge_width: float
    verge_seen: bool


@dataclass(frozen=True)
class Measured:
    """All that a parameter set is made from.

    Attributes:
        fit: the alignment in local coordinates.
        origin: (3,) map coordinates of the local origin.
        epsg: map system, or None.
        section: the cross-section.
        stations: (K,) stations that the crossfall was measured at.
        crossfall: (K,) m/m by side; NaN where unknown.
        rotation: axis of rotation of the crossfall.
        barriers, posts: what stands.
        ground: what lies beside.
        marked: whether paint was told by class.
        title: for people.
    """

    fit: AxisFit
    origin: Float
    epsg: int | None
    section: MeasuredSection
    stations: Float
    crossfall: dict[Side, Float]
    rotation: RotationAxis
    barriers: list[FoundBarrier]
    posts: list[FoundPost]
    ground: GroundShape
    marked: bool
    title: str


def assemble_parameters(measured: Measured) -> RoadParameters:
    """Return the parameter set of what was measured; the schema checks it.

    Raises:
        InputError: a value lies beyond what a parameter set allows.
    """
    items: dict[str, RoadObject] = {"alignment": alignment_object(measured.fit)}
    if measured.section.kind == "dual":
        items["median"] = Median(instance=1)
    for side in _SIDES:
        items[f"carriageway-{side}"] = _carriageway(measured, measured.section.sides[side])
    items |= dict(_markings(measured))
    items |= dict(_furniture(measured))
    items["terrain"] = _terrain(measured.ground)
    objects = {name: item.model_copy(update={"instance": i}) for i, (name, item) in enumerate(items.items(), 1)}
    data = {
        "type": "RoadParameters",
        "version": "1.0",
        "metadata": Metadata(
            identifier="reconstructed",
            title=measured.title,
            generator=generator(),
            referenceSystem=EPSG_URI.format(measured.epsg or UNKNOWN_EPSG),
        ).to_dict(),
        "transform": Transform(translate=tuple(float(v) for v in measured.origin)).to_dict(),
        "design_class": _design_class(measured),
        "objects": {name: item.to_dict() for name, item in objects.items()},
    }
    # Once more as a whole: each value within its limits, each name known.
    return RoadParameters.from_dict(data, source="reconstructed road")


def _design_class(measured: Measured) -> str:
    """Return the design class that the radii and the nearest standard cross-section allow, the fastest first."""
    bend = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in measured.fit.alignment.elements)
    fast = [name for name, limits in LIMITS.items() if bend * limits.radius <= 1.02]
    preferred = fast[0] if fast else "EKA3"
    nearest = measured.section.nearest
    return design_class_of(nearest, preferred) if nearest in STANDARD_CROSS_SECTIONS else preferred


def _carriageway(measured: Measured, side: SideSection) -> Carriageway:
    lanes = tuple(Lane(width=_length(float(np.clip(lane.value, 2.0, 6.0)))) for lane in reversed(side.lanes))
    return Carriageway(
        instance=1,
        side=side.side,
        inner_offset=_length(side.inner_offset.value),
        hard_shoulder_width=_length(side.shoulder.value),
        outer_edge_strip_width=_length(min(side.strip.value, 2.0)),
        lanes=lanes,
        inner_edge_strip_width=_length(side.inner_strip.value),
        verge_width=_length(measured.ground.verge_width),
        crossfall=crossfall_points(measured.stations, measured.crossfall[side.side]),
        rotation_axis=measured.rotation,
    )


def crossfall_points(stations: Float, fall: Float) -> tuple[CrossfallPoint, ...]:
    """Return the corners of a chain of straight lines that the crossfall (K,), m/m, stays within 0.15 % of."""
    known = np.isfinite(fall)
    if not known.any():
        return (CrossfallPoint(station=0.0, crossfall_percent=0.0),)
    station, percent = stations[known], np.clip(100.0 * fall[known], -12.0, 12.0)
    corners = _corners(station, percent, _CROSSFALL_TOLERANCE)
    if len(corners) == 2 and abs(percent[corners[0]] - percent[corners[1]]) <= _CROSSFALL_TOLERANCE:
        return (CrossfallPoint(station=0.0, crossfall_percent=round(float(np.median(percent)), 3)),)
    return tuple(
        CrossfallPoint(station=_length(float(station[i])), crossfall_percent=round(float(percent[i]), 3))
        for i in corners
    )


def _corners(station: Float, value: Float, tolerance: float) -> list[int]:
    """Return the indices that Douglas and Peucker's method keeps."""
    kept, stack = {0, len(station) - 1}, [(0, len(station) - 1)]
    while stack:
        low, high = stack.pop()
        if high - low < 2:
            continue
        inner = slice(low + 1, high)
        chord = np.interp(station[inner], station[[low, high]], value[[low, high]])
        away = np.abs(value[inner] - chord)
        if away.max() > tolerance:
            middle = low + 1 + int(away.argmax())
            kept.add(middle)
            stack += [(low, middle), (middle, high)]
    return sorted(kept)


def _markings(measured: Measured) -> Iterator[tuple[str, LineMarking]]:
    section = measured.section
    length = round_value(measured.fit.alignment.length)
    for side in _SIDES:
        measured_side = section.sides[side]
        last = len(measured_side.lines) - 1
        for number, line in enumerate(measured_side.lines):
            if number == 0 and section.kind == "single":
                continue
            if line is None and (number in (0, last) or measured_side.assumed) and not measured_side.mirrored:
                continue
            kind = _kind(number, last, measured_side.closed)
            width = line_width(line, kind, section.kind, measured.marked)
            boundary = last - number
            name = f"carriageway-{side}-line-{boundary}"
            yield (
                name,
                _line(f"carriageway-{side}", _MARKING[kind], boundary, width, _dashes(line, length, kind == "edge")),
            )
    if section.middle is not None:
        width = line_width(section.middle, "lane", "single", measured.marked)
        yield "middle-line", _line("carriageway-right", "free", 0, width, _dashes(section.middle, length))


def _kind(number: int, last: int, closed: bool) -> Literal["edge", "lane", "inner"]:
    """Return what a line is, counted from inside."""
    if number == last:
        return "edge" if closed else "lane"
    return "lane" if number else "inner"


_MARKING: dict[str, Literal["outer_edge", "lane", "inner_edge"]] = {
    "edge": "outer_edge",
    "lane": "lane",
    "inner": "inner_edge",
}


def _dashes(line: Line | None, length: float, edge: bool = False) -> tuple[float, float, float, float]:
    """Return dash, gap, start and end station of a marking."""
    if line is None:
        return (0.0, 0.0, 0.0, length) if edge else (6.0, 12.0, 0.0, length)
    start, end = max(0.0, line.start), min(length, line.end)
    start = 0.0 if start < 2.0 * _END else start
    end = length if end > length - 2.0 * _END else end
    if not line.solid:
        period = line.dash + line.gap
        start = max(0.0, line.first_dash - period * np.floor((line.first_dash - start) / period))
    return line.dash, line.gap, _length(start), _length(end)


def _line(
    carriageway: str,
    kind: Literal["outer_edge", "lane", "inner_edge", "free"],
    boundary: int,
    width: float,
    dashes: tuple[float, float, float, float],
) -> LineMarking:
    dash, gap, start, end = dashes
    return LineMarking(
        instance=1,
        carriageway=carriageway,
        kind=kind,
        boundary=boundary,
        width=width,
        dash_length=dash,
        gap_length=gap,
        start_station=start,
        end_station=end,
    )


def _furniture(measured: Measured) -> Iterator[tuple[str, RoadObject]]:
    length = round_value(measured.fit.alignment.length)
    for number, barrier in enumerate(measured.barriers, 1):
        start = 0.0 if barrier.start < _END else _length(barrier.start)
        end = length if barrier.end > length - _END else _length(barrier.end)
        if end - start > 1.0:
            yield f"barrier-{number}", barrier_object(barrier, start, end, length)
    posts = [post for post in measured.posts if 0.0 <= post.station <= length]
    for number, post in enumerate(posts, 1):
        yield (
            f"delineator-{number:04d}",
            Delineator(
                instance=1,
                station=_length(post.station),
                offset=_length(post.offset),
                rotation_deg=0.0 if post.offset < 0.0 else 180.0,
                height=_length(float(np.clip(post.height, 0.3, 1.5))),
            ),
        )


def barrier_object(barrier: FoundBarrier, start: float, end: float, length: float) -> RoadObject:
    """Return a found barrier between two stations as an object; it is ramped where it ends on the road."""
    ends: dict[str, Any] = {
        "instance": 1,
        "start_station": start,
        "end_station": end,
        "offset": _length(barrier.offset),
    }
    inside = start > 0.0 or end < length
    terminal = round(min(_TERMINAL, (end - start) / 4.0), 2) if inside else 0.0
    if barrier.kind == "noise":
        return NoiseBarrier(**ends, height=_length(float(np.clip(barrier.height, 1.0, 12.0))))
    if barrier.kind == "concrete":
        height = _length(float(np.clip(barrier.height, 0.4, 2.0)))
        return ConcreteBarrier(**ends, height=height, terminal_length=terminal)
    height = _length(float(np.clip(barrier.height, 0.3, 1.5)))
    return Guardrail(**ends, height=height, faces=barrier.faces, terminal_length=terminal)


def _terrain(ground: GroundShape) -> Terrain:
    return Terrain(
        instance=1,
        half_width=_length(float(np.clip(ground.half_width, 5.0, 1000.0))),
        embankment_height=_length(float(np.clip(ground.embankment_height, -20.0, 20.0))),
        undulation=_length(float(np.clip(ground.undulation, 0.0, 20.0))),
        wavelength=40.0,
        seed=0,
    )


def _length(value: float) -> float:
    return round(float(value), _ROUND)
