"""A line of a file: the elements of its plan, its heights and its stations, as the file has them."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from pydantic import ValidationError

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.maps.crs import MapSystem
from ..road.alignment import Alignment, Element
from ..road.given_road import GivenRoad
from ..road.other_roads.axis import LONGEST_ROAD, HorizontalElement, VerticalPoint
from ..road.parameters import AlignmentObject, StationEquation
from ..road.profile import IntersectionPoint
from .curves import Curve, as_elements
from .heights import HeightPiece, Heights, as_parabolas
from .kinks import Rounding, rounded
from .xml_text import on_one_line

GAP, KINK = 1e-3, 1e-4
"""Gaps (m) and changes of direction (rad) between elements up to which they are joined without a word."""
SHARPEST = 0.1
"""Largest curvature of a road, 1/m, as in a parameter set."""
_SAMPLES = 1025
"""Places of a curve at which its curvature is looked at."""
_LONGEST_NAME = 200
SHORTEST = 1e-6
"""Elements shorter than this, m, are none."""


@contextmanager
def within_limits(place: str) -> Iterator[None]:
    """Context that turns a parameter set's refusal of a file's value into an `InputError` that names its place."""
    try:
        yield
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in fault["loc"]) or "axis"
        reason = on_one_line(str(fault["msg"]).lower())
        raise InputError(
            f"{place}: {field}", fault.get("input"), f"must be within the limits of a parameter set ({reason})"
        ) from None


class LineNames:
    """Names of a file's lines as they are shown: at most 200 characters, and a number behind those that come again."""

    def __init__(self) -> None:
        self._used: Counter[str] = Counter()

    def unique(self, name: str | None, otherwise: str) -> str:
        """Return a line's name (`otherwise` if it has none), with a number behind it where an earlier line has it."""
        shown = (name or "").strip()[:_LONGEST_NAME] or otherwise
        self._used[shown] += 1
        return shown if self._used[shown] == 1 else f"{shown} ({self._used[shown]})"


@dataclass(frozen=True)
class PlanPiece:
    """An element of a file's plan.

    Attributes:
        kind: as the file calls it, e.g. ``arc`` or ``bloss``.
        station: in the file at its start, m, counted from the line's begin whatever the file adds.
        length: that the file gives it, m.
        x, y, heading: of its start, m and rad counter-clockwise from east.
        shape: curvatures at its ends, 1/m, between which it is linear; or a curve of another kind.
    """

    kind: str
    station: float
    length: float
    x: float
    y: float
    heading: float
    shape: tuple[float, float] | Curve


@dataclass(frozen=True)
class Equation:
    """A station equation: at a station the count jumps.

    Attributes:
        station: counted from the line's begin, m.
        back, ahead: stations that the file gives the place, before it and behind it, m.
    """

    station: float
    back: float
    ahead: float


@dataclass(frozen=True)
class RoadLine:
    """A road or alignment of a file.

    Attributes:
        name: as the file has it, unique in the file.
        source: format and kind, e.g. ``OpenDRIVE road``.
        pieces: elements of the plan in order.
        heights: pieces of the profile, stations counted from the line's begin; empty without any.
        first_station: station that the file gives the begin, m.
        equations: station equations.
        system: coordinate system that the file declares; None without.
        lanes: number of lanes at its middle; None where the file knows none.
        junction: whether it belongs to a junction.
        left_out: what the file says of it and isn't read, as text with numbers.
        fault: why it can't be used, where it can't; it has no pieces then.
        given: parts of the road beside its line, stations those of the file; None where nothing is read of them.
        taken: numbers of those parts by kind.
        remarks: what is to be told where they are used.
    """

    name: str
    source: str
    pieces: tuple[PlanPiece, ...]
    heights: tuple[HeightPiece, ...] = ()
    first_station: float = 0.0
    equations: tuple[Equation, ...] = ()
    system: MapSystem | None = None
    lanes: int | None = None
    junction: bool = False
    left_out: tuple[str, ...] = ()
    fault: InputError | None = None
    given: GivenRoad | None = None
    taken: Mapping[str, int] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def length(self) -> float:
        """Return the length, m."""
        return math.fsum(piece.length for piece in self.pieces)


@dataclass(frozen=True)
class ExactAxis:
    """The alignment that a file's line became.

    Attributes:
        alignment: in the file's coordinates, m.
        heights: None where the file has none.
        approximated: for each piece that is neither line, arc nor clothoid, its kind, station, number of elements and
            their largest distance from it, m.
        gap, gap_station: largest distance (m) between a piece's end and the next one's start, and where.
        kink, kink_station: largest change of direction there (rad), and where.
        drift, drift_station: largest distance (m) of the chained elements from the starts that the file gives them.
        starts: stations along the alignment at which the file's pieces begin, m.
        roundings: kinks that two clothoids stand for.
    """

    alignment: Alignment
    heights: Heights | None
    approximated: tuple[tuple[str, float, int, float], ...]
    gap: float
    gap_station: float
    kink: float
    kink_station: float
    drift: float
    drift_station: float
    starts: tuple[float, ...] = ()
    roundings: tuple[Rounding, ...] = ()


@dataclass
class _Chain:
    """Elements in order, exact stations (m) of the file's pieces, and the rows of `ExactAxis.approximated`."""

    elements: list[Element] = field(default_factory=list)
    starts: list[float] = field(default_factory=list)  # exact stations of the pieces
    approximated: list[tuple[str, float, int, float]] = field(default_factory=list)


def exact_axis(line: RoadLine, round_kinks: float | None = None) -> ExactAxis:
    """Return a line's alignment, chained from its first element's start, and its heights.

    Args:
        line: of a file.
        round_kinks: largest distance (m) from a kink that two clothoids may keep in its place; None refuses kinks.

    Raises:
        InputError: elements don't join (`GAP`, `KINK`), or there are none.
    """
    roundings: list[Rounding] = []
    if round_kinks is not None and line.pieces:
        line, roundings = rounded(line, _joints(line.pieces)[1], KINK, round_kinks, SHARPEST)
    chain = _Chain()
    chained_length = 0.0
    for piece in line.pieces:
        chain.starts.append(chained_length)
        _refuse_unfit(line, piece, chained_length)
        if isinstance(piece.shape, Curve):
            elements, deviation = as_elements(piece.shape)
            chain.approximated.append((piece.kind, piece.station, len(elements), deviation))
        else:
            elements = [Element(piece.length, *piece.shape)]
        chain.elements += elements
        chained_length += math.fsum(element.length for element in elements)
    if not chain.elements:
        raise InputError(line.name, None, "must have an element that is longer than 0 m")
    first_piece = line.pieces[0]
    alignment = Alignment(chain.elements, first_piece.x, first_piece.y, first_piece.heading)
    gaps, kinks = _joints(line.pieces)
    drift = _drift(alignment, line.pieces, chain.starts)
    stations = [piece.station for piece in line.pieces]
    worst_gap, worst_kink, worst_drift = (int(np.argmax(values)) for values in (gaps, kinks, drift))
    axis = ExactAxis(
        alignment,
        as_parabolas(_heights_along(line, chain.starts, chained_length)) if line.heights else None,
        tuple(chain.approximated),
        *(
            gaps[worst_gap],
            stations[worst_gap],
            kinks[worst_kink],
            stations[worst_kink],
            drift[worst_drift],
            stations[worst_drift],
        ),
        starts=tuple(chain.starts),
        roundings=tuple(roundings),
    )
    _refuse_broken(line, axis)
    return axis


def _refuse_unfit(line: RoadLine, piece: PlanPiece, start: float) -> None:
    """Raise `InputError` for a piece that begins at a station (m) and is too long or too sharp a bend for a road."""
    curve = piece.shape if isinstance(piece.shape, Curve) else None
    length = curve.length if curve else piece.length
    place = f"{line.name}: {piece.kind} at station {piece.station:.3f} m"
    if start + length > LONGEST_ROAD:
        raise InputError(f"{place}: its end, m", start + length, f"must be at most {LONGEST_ROAD:g} m")
    curvatures = curve.curvature(np.linspace(0.0, length, _SAMPLES)) if curve else np.array(piece.shape)
    largest_curvature = float(np.abs(curvatures).max())
    if not largest_curvature <= SHARPEST:
        raise InputError(
            f"{place}: curvature, 1/m", largest_curvature, f"must be at most {SHARPEST:g}, as no road has sharper bends"
        )


def _joints(pieces: Sequence[PlanPiece]) -> tuple[list[float], list[float]]:
    """Return the gap (m) and the kink (rad, not signed) before each piece, 0 before the first."""
    gaps, kinks = [0.0], [0.0]
    for piece, next_piece in itertools.pairwise(pieces):
        x, y, heading = end_pose(piece)
        gaps.append(math.hypot(next_piece.x - x, next_piece.y - y))
        kinks.append(abs(math.remainder(next_piece.heading - heading, 2.0 * math.pi)))
    return gaps, kinks


def end_pose(piece: PlanPiece) -> tuple[float, float, float]:
    """Return x, y (m) and heading (rad) of a piece's end."""
    if isinstance(piece.shape, Curve):
        end = np.array([piece.shape.length])
        forward, leftward = piece.shape.positions(end)[0].tolist()
        cos, sin = math.cos(piece.heading), math.sin(piece.heading)
        end_heading = piece.heading + float(piece.shape.heading(end)[0])
        return piece.x + forward * cos - leftward * sin, piece.y + forward * sin + leftward * cos, end_heading
    alignment = Alignment([Element(piece.length, *piece.shape)], piece.x, piece.y, piece.heading)
    position, heading, _ = alignment.frame(alignment.length)
    return float(position[0]), float(position[1]), float(heading)


def sampled(line: RoadLine) -> tuple[Float, Float]:
    """Return places (N, 2), m, on a line's pieces as the file has them, at most 1 m apart, and stations (N,), m."""
    places, stations = [], []
    for piece in line.pieces:
        curve_length = piece.shape.length if isinstance(piece.shape, Curve) else piece.length
        distances = np.linspace(0.0, curve_length, max(2, min(_SAMPLES, math.ceil(curve_length) + 1)))
        if isinstance(piece.shape, Curve):
            curve_places = piece.shape.positions(distances) @ np.array([1.0, 1j]) * np.exp(1j * piece.heading)
            places.append(np.column_stack([curve_places.real, curve_places.imag]) + [piece.x, piece.y])
        else:
            alignment = Alignment([Element(piece.length, *piece.shape)], piece.x, piece.y, piece.heading)
            places.append(alignment.position(distances))
        # A curve may be longer than the file says: its stations are spread over the file's length.
        stations.append(piece.station + distances * (piece.length / curve_length))
    return np.vstack(places), np.concatenate(stations)


def heights_at(line: RoadLine, station: Float) -> Float:
    """Return the file's heights (N,), m, at stations (N,) of a line with heights; end grades go on beyond its ends."""
    starts = np.array([piece.start for piece in line.heights])
    piece_index = np.clip(np.searchsorted(starts, station, "right") - 1, 0, len(starts) - 1)
    rows = np.array([(h.start, h.end, h.elevation, h.grade, h.square, h.cube) for h in line.heights])[piece_index]
    piece_start, piece_end, start_height, grade, square, cube = rows.T
    u = np.clip(station, piece_start, piece_end) - piece_start
    overhang = station - piece_start - u
    inner_height = start_height + u * (grade + u * (square + u * cube))
    return np.asarray(inner_height + overhang * (grade + u * (2.0 * square + 3.0 * u * cube)))


def _drift(alignment: Alignment, pieces: Sequence[PlanPiece], starts: Sequence[float]) -> list[float]:
    """Return for each piece how far (m) the chained elements are from the start that the file gives the piece."""
    file_starts = np.array([(piece.x, piece.y) for piece in pieces])
    distances: list[float] = np.hypot(*(alignment.position(np.array(starts)) - file_starts).T).tolist()
    return distances


def _heights_along(line: RoadLine, starts: Sequence[float], length: float) -> list[HeightPiece]:
    """Return the profile's pieces with stations along the alignment, whose curves may be longer than the file says."""
    file_stations = np.array([*(piece.station for piece in line.pieces), line.length])
    axis_stations = np.array([*starts, length])
    if np.abs(file_stations - axis_stations).max() < 1e-9:
        return list(line.heights)
    borders = np.array([[piece.start, piece.end] for piece in line.heights])
    # Before the first piece and behind the last one stations are shifted by as much as at that end.
    moved_borders = np.interp(borders, file_stations, axis_stations) + np.where(
        borders > file_stations[-1], borders - file_stations[-1], 0.0
    )
    moved_borders += np.where(borders < 0.0, borders, 0.0)
    return [
        HeightPiece(float(a), float(b), piece.elevation, piece.grade, piece.square, piece.cube)
        for piece, (a, b) in zip(line.heights, moved_borders, strict=True)
    ]


def _refuse_broken(line: RoadLine, axis: ExactAxis) -> None:
    """Raise `InputError` where elements have a gap or kink between them, or keep too far from a curve."""
    name = f"{line.source} {line.name!r}"
    for kind, station, _, deviation in axis.approximated:
        if deviation > GAP:
            allowed = f"clothoids must follow this curve within {1000 * GAP:g} mm, but can't, as it bends too much"
            raise InputError(f"{name}: {kind} at station {station:.3f} m: distance, m", round(deviation, 6), allowed)
    if axis.gap > GAP:
        allowed = f"elements must join within {1000 * GAP:g} mm, but those at station {axis.gap_station:.3f} m don't"
        raise InputError(f"{name}: gap, m", round(axis.gap, 6), allowed)
    if axis.kink > KINK:
        allowed = f"elements must join within {KINK:g} rad, but those at station {axis.kink_station:.3f} m form a kink"
        allowed += ": --round-kinks rounds those that two clothoids can follow"
        raise InputError(f"{name}: change of direction, rad", round(axis.kink, 6), allowed)


def alignment_object(axis: ExactAxis, origin: Float, line: RoadLine | None = None) -> AlignmentObject:
    """Return an axis as the alignment of a parameter set about an origin (3,), m, with the instance number 1.

    Args:
        axis: what the line became.
        origin: m.
        line: whose count of stations it has; None: none.
    """
    equations = [] if line is None else [e for e in line.equations if 0.0 <= e.station <= axis.alignment.length]
    alignment = axis.alignment
    elements = tuple(
        HorizontalElement.between(element.length, element.curvature_start, element.curvature_end)
        for element in alignment.elements
    )
    level = (IntersectionPoint(0.0, float(origin[2])),)
    points = level if axis.heights is None else axis.heights.points
    heading = math.degrees(math.remainder(alignment.start_heading, 2.0 * math.pi))
    # Raises pydantic's ValidationError beyond the limits of roads.
    return AlignmentObject(
        instance=1,
        start_x=alignment.x - float(origin[0]),
        start_y=alignment.y - float(origin[1]),
        start_heading_deg=heading,
        horizontal=elements,
        vertical=tuple(
            VerticalPoint(station=point.station, elevation=point.elevation - float(origin[2]), radius=point.radius)
            for point in points
        ),
        first_station=None if line is None else line.first_station,
        equations=tuple(StationEquation(station=e.station, ahead=e.ahead) for e in equations),
    )
