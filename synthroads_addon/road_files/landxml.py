"""Alignments of LandXML 1.0 to 1.2, and of national dialects of it.

Plan and heights come from points, centres, lengths and senses of rotation alone: directions are written in degrees,
gon, radians or mirrored, and aren't read. LandXML 1.2 schema: `Alignment`, `CoordGeom`, `ProfAlign`, `StaEquation`; of
`Superelevation` see `beside.superelevation`.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np

from ..base.errors import InputError
from ..base.maps.crs import MapSystem
from ..base.remarks import warn
from ..road.given_road import GivenRoad
from .beside.superelevation import read_superelevation
from .curves import TRANSITIONS, Curve, transition
from .heights import HeightPiece, circle
from .line import SHORTEST, Equation, LineNames, PlanPiece, RoadLine
from .xml_text import child, children, finite, local_name, number, read_xml

_UNITS = {
    "meter": 1.0, "metre": 1.0, "millimeter": 1e-3, "centimeter": 1e-2, "kilometer": 1e3,
    "foot": 0.3048, "inch": 0.0254, "mile": 1609.344, "ussurveyfoot": 1200.0 / 3937.0,
}  # fmt: skip
"""Metres of the linear units that LandXML names (`metLinear`, `impLinear`)."""
_SPIRALS = {
    "clothoid": "clothoid", "bloss": "bloss", "cosine": "cosine", "sinusoid": "sine", "biquadratic": "helmert",
}  # fmt: skip
"""Kinds of transition curves by LandXML's names for them."""


def read_landxml(path: Path) -> list[RoadLine]:
    """Return the alignments of a LandXML file.

    Raises:
        MissingFileError, InputError: the file can't be read, isn't LandXML, or holds what isn't understood.
    """
    root = read_xml(path)
    unit = _unit(root)
    system = _system(root)
    names, lines, roadways = LineNames(), list[RoadLine](), _roadways(root)
    for group in children(root, "Alignments"):
        for row, alignment in enumerate(children(group, "Alignment")):
            name = names.unique(alignment.get("name"), f"alignment {row + 1}")
            try:
                if line := _alignment(alignment, name, unit, system):
                    roadway_texts = roadways.get(alignment.get("name", ""), ())
                    lines.append(replace(line, left_out=(*line.left_out, *roadway_texts)))
            except InputError as error:
                lines.append(RoadLine(name, "LandXML alignment", (), system=system, fault=error))
    return lines


def _unit(root: Element) -> float:
    """Return metres per unit of length."""
    units = child(root, "Units")
    unit_system = None if units is None else next(iter(children(units, "Metric", "Imperial")), None)
    if unit_system is None:
        raise InputError("Units", None, "must contain Metric or Imperial, as coordinates could be metres or feet")
    name = unit_system.get("linearUnit", "")
    if name.lower() not in _UNITS:
        raise InputError("Units linearUnit", name, f"must be one of {', '.join(_UNITS)}")
    return _UNITS[name.lower()]


def _system(root: Element) -> MapSystem | None:
    """Return the coordinate system that the file names by its code or its WKT; None without."""
    reference = child(root, "CoordinateSystem")
    if reference is None:
        return None
    code = reference.get("epsgCode", "").strip()
    text = f"EPSG:{code}" if code.isdigit() and int(code) else reference.get("ogcWktCode", "").strip()
    if not text:
        return None
    try:
        return MapSystem.read(text)
    except InputError as error:
        warn("the file's coordinate system %r isn't known (%s)", text, error)
        return None


def _alignment(alignment: Element, name: str, unit: float, system: MapSystem | None) -> RoadLine | None:
    """Return the line of an alignment; None without elements in plan. `unit` is the metres of the file's unit."""
    geometry = child(alignment, "CoordGeom")
    if geometry is None:
        return None
    start = number(alignment, "staStart", 0.0) * unit
    pieces: list[PlanPiece] = []
    station = 0.0
    for element in geometry:
        kind = local_name(element)
        if kind in ("Feature", ""):
            continue
        if kind not in _ELEMENTS:
            raise InputError(f"CoordGeom at station {station:.3f} m", kind, f"must be one of {', '.join(_ELEMENTS)}")
        for piece in _ELEMENTS[kind](element, station, unit):
            if piece.length > SHORTEST:
                pieces.append(piece)
                station += piece.length
    if not pieces:
        return None
    equations = tuple(_equations(alignment, unit, start))
    heights, left_out = _profile(alignment, unit, start)
    tilt = read_superelevation(alignment, pieces, unit, start)
    return RoadLine(
        name=name,
        source="LandXML alignment",
        pieces=tuple(pieces),
        heights=tuple(heights),
        first_station=start,
        equations=equations,
        system=system,
        left_out=(*left_out, *tilt.left_out, *_others(alignment)),
        given=GivenRoad(crossfall=tilt.crossfall) if tilt.curves else None,
        taken={"superelevations": tilt.curves} if tilt.curves else {},
        remarks=tilt.remarks,
    )


def _point(element: Element, name: str, unit: float) -> complex:
    """Return a point x + iy, m, from a child element that has northing, easting and perhaps a height."""
    point = child(element, name)
    words = (point.text or "").split() if point is not None else []
    place = f"{local_name(element)} {name}"
    if point is not None and not words and point.get("pntRef"):
        raise InputError(place, point.get("pntRef"), "must contain coordinates; references to other points aren't read")
    if len(words) < 2:
        raise InputError(place, " ".join(words) or None, "must be a northing and an easting")
    north, east = (finite(place, word) * unit for word in words[:2])
    return complex(east, north)


def _rotation(element: Element) -> float:
    """Return 1 for an element that turns left, -1 for one that turns right."""
    name = element.get("rot", "")
    if name not in ("cw", "ccw"):
        raise InputError(f"{local_name(element)} rot", name or None, "must be cw or ccw")
    return 1.0 if name == "ccw" else -1.0


def _line(element: Element, run: float, unit: float) -> list[PlanPiece]:
    """Return the straight piece of a `Line` that begins at a station `run`, m."""
    start, end = (_point(element, name, unit) for name in ("Start", "End"))
    return [_straight("line", run, start, end)]


def _straight(kind: str, run: float, start: complex, end: complex) -> PlanPiece:
    """Return a straight piece between two points x + iy, m."""
    chord = end - start
    return PlanPiece(kind, run, abs(chord), start.real, start.imag, math.atan2(chord.imag, chord.real), (0.0, 0.0))


def _points(element: Element, run: float, unit: float) -> list[PlanPiece]:
    """Return the straight pieces that join the points of an irregular line, which begins at a station `run`, m."""
    point_list = next(iter(children(element, "PntList2D", "PntList3D")), None)
    words = [] if point_list is None else (point_list.text or "").split()
    dimension = 2 if point_list is not None and local_name(point_list) == "PntList2D" else 3
    values = [finite("IrregularLine", word) * unit for word in words]
    points = [complex(values[n + 1], values[n]) for n in range(0, len(values) - dimension + 1, dimension)]
    points = [_point(element, "Start", unit), *points, _point(element, "End", unit)]
    pieces = []
    for start, end in itertools.pairwise(points):
        if abs(end - start) > SHORTEST:
            pieces.append(_straight("irregular line", run, start, end))
            run += pieces[-1].length
    return pieces


def _curve(element: Element, run: float, unit: float) -> list[PlanPiece]:
    """Return the arc of a `Curve` that begins at a station `run`, m, by its start, centre and end."""
    start, centre, end = (_point(element, name, unit) for name in ("Start", "Center", "End"))
    rotation = _rotation(element)
    spokes = start - centre, end - centre
    radius = abs(spokes[0])
    if radius < SHORTEST or abs(abs(spokes[1]) - radius) > max(1e-3, 1e-5 * radius):
        raise InputError(
            f"Curve at station {run:.3f} m", abs(spokes[1]), f"its end must lie {radius:.6g} m from Center"
        )
    turn = rotation * (math.atan2((spokes[1] / spokes[0]).imag, (spokes[1] / spokes[0]).real)) % (2.0 * math.pi)
    # Rounding may make an almost full circle one of no angle.
    if turn < 1e-9 and abs(end - start) > SHORTEST:
        turn = 2.0 * math.pi
    heading = math.atan2(spokes[0].imag, spokes[0].real) + rotation * 0.5 * math.pi
    curvature = rotation / radius
    return [PlanPiece("arc", run, turn * radius, start.real, start.imag, heading, (curvature, curvature))]


def _curvature(element: Element, name: str, unit: float) -> float:
    """Return the curvature (1/m, not signed) of a radius; 0 for a radius of 0 or a word for infinity."""
    text = element.get(name, "").strip()
    if text.lower() in ("inf", "infinity", "infinite", "-inf", "+inf"):
        return 0.0
    value = abs(finite(f"{local_name(element)} {name}", text or None)) * unit
    return 1.0 / value if value > 1e-9 else 0.0


def _spiral(element: Element, station: float, unit: float) -> list[PlanPiece]:
    """Return the transition curve of a `Spiral` that begins at a station, m; an empty list for one without length."""
    start, end = (_point(element, name, unit) for name in ("Start", "End"))
    name = element.get("spiType", "clothoid")
    length = number(element, "length") * unit
    rotation = _rotation(element)
    curvatures = rotation * _curvature(element, "radiusStart", unit), rotation * _curvature(element, "radiusEnd", unit)
    place = f"Spiral at station {station:.3f} m"
    if name.lower() not in _SPIRALS:
        raise InputError(f"{place}: spiType", name, f"must be one of {', '.join(_SPIRALS)}")
    if length <= SHORTEST:
        return []
    kind = _SPIRALS[name.lower()]
    shape: tuple[float, float] | Curve = curvatures if kind == "clothoid" else transition(kind, length, *curvatures)
    curve = transition(kind, length, *curvatures)
    # The chord between its end points gives its heading, so that no direction of the file is needed.
    chord = complex(*curve.positions(np.array([length]))[0].tolist())
    length_error = abs(abs(end - start) - abs(chord))
    if length_error > max(2e-3, 1e-5 * length):
        condition = f"its ends must be {abs(chord):.6f} m apart, as its length and radii say"
        raise InputError(place, round(abs(end - start), 6), condition)
    heading = math.atan2((end - start).imag, (end - start).real) - math.atan2(chord.imag, chord.real)
    return [PlanPiece(name.lower(), station, length, start.real, start.imag, heading, shape)]


_ELEMENTS = {"Line": _line, "Curve": _curve, "Spiral": _spiral, "IrregularLine": _points}
assert set(_SPIRALS.values()) <= set(TRANSITIONS)


def _equations(alignment: Element, unit: float, start: float) -> list[Equation]:
    """Return an alignment's station equations in order, with places counted from its begin, m."""
    equations = []
    for row in children(alignment, "StaEquation"):
        distance = number(row, "staInternal") * unit - start
        ahead_station = number(row, "staAhead") * unit
        back_station = number(row, "staBack", number(row, "staInternal")) * unit
        equations.append(Equation(distance, back_station, ahead_station))
    return sorted(equations, key=lambda each: each.station)


def _profile(alignment: Element, unit: float, start: float) -> tuple[list[HeightPiece], list[str]]:
    """Return the pieces of the first design profile of an alignment, and what is left out of the others."""
    designs = [each for profile in children(alignment, "Profile") for each in children(profile, "ProfAlign")]
    ground_profiles = [each for profile in children(alignment, "Profile") for each in children(profile, "ProfSurf")]
    left_out = [f"{len(designs) - 1} more design profiles"] if len(designs) > 1 else []
    left_out += [f"{len(ground_profiles)} profiles of the ground"] if ground_profiles else []
    if not designs:
        return [], left_out
    rows = [_intersection(row, unit) for row in designs[0] if local_name(row) in _CURVES]
    if not rows:
        return [], left_out
    shift = _profile_shift(rows, start, _plan_length(alignment, unit))
    rows = [row._replace(station=row.station - shift) for row in rows]
    return _height_pieces(rows), left_out


class _Intersection(NamedTuple):
    """A point of vertical intersection with its curve, lengths in m.

    Attributes:
        station, height: of the point.
        before, behind: lengths of the curve's tangents, in plan.
        radius: of a circle; 0 for a parabola or no curve.
    """

    station: float
    height: float
    before: float
    behind: float
    radius: float


def _intersection(row: Element, unit: float) -> _Intersection:
    """Return the intersection of a PVI or curve element of `ProfAlign`; raise `InputError` for half a curve."""
    kind = local_name(row)
    words = (row.text or "").split()
    if len(words) < 2:
        raise InputError(kind, " ".join(words) or None, "must be a station and an elevation")
    station, height = (finite(kind, word) * unit for word in words[:2])
    tangent_before = tangent_behind = radius = 0.0
    if kind == "ParaCurve":
        tangent_before = tangent_behind = 0.5 * number(row, "length") * unit
    elif kind == "UnsymParaCurve":
        tangent_before, tangent_behind = number(row, "lengthIn") * unit, number(row, "lengthOut") * unit
    elif kind == "CircCurve":
        tangent_before = tangent_behind = 0.5 * number(row, "length") * unit
        radius = abs(number(row, "radius", 0.0)) * unit
    shorter, longer = sorted((tangent_before, tangent_behind))
    if shorter < 0.0 or shorter <= SHORTEST < longer:
        raise InputError(f"{kind} at station {station:.3f} m", shorter, "must have two lengths above 0 m")
    return _Intersection(station, height, tangent_before, tangent_behind, radius)


_CURVES = ("PVI", "ParaCurve", "UnsymParaCurve", "CircCurve")


def _plan_length(alignment: Element, unit: float) -> float:
    """Return the length, m, that an alignment states; 0 without any."""
    return number(alignment, "length", 0.0) * unit


def _profile_shift(rows: list[_Intersection], start: float, length: float) -> float:
    """Return the difference, m, between the profile's stations and the distances from the line's begin.

    A profile's stations may include the alignment's first station, or begin with 0. The difference is taken with which
    the profile covers more of the plan.
    """
    begin, end = rows[0].station, rows[-1].station
    if abs(start) < SHORTEST or length <= 0.0:
        return start

    def covered(shift: float) -> float:
        """Return the length, m, of the plan that the profile covers when its stations are less by a shift (m)."""
        return max(0.0, min(end - shift, length) - max(begin - shift, 0.0))

    with_start, without_start = covered(start), covered(0.0)
    if without_start > with_start + 1e-6:
        text = "stations of the profile begin with %.3f m and not with the alignment's %.3f m: taken from its begin"
        warn(text, begin, start)
        return 0.0
    return start


def _height_pieces(rows: list[_Intersection]) -> list[HeightPiece]:
    """Return the pieces of the profile, grades and curves, between intersections in order of their stations.

    Raises:
        InputError: stations don't grow, or the curves of neighbours overlap.
    """
    for row, next_row in itertools.pairwise(rows):
        if next_row.station - row.station <= SHORTEST:
            allowed = f"must be more than {row.station:g} m, as stations must increase"
            raise InputError("ProfAlign", next_row.station, allowed)
    if len(rows) == 1:  # one height says nothing of a grade: the profile is level
        return [HeightPiece(rows[0].station, rows[0].station + 1.0, rows[0].height, 0.0)]
    grades = [(b.height - a.height) / (b.station - a.station) for a, b in itertools.pairwise(rows)]
    pieces: list[HeightPiece] = []
    reached, height = rows[0].station, rows[0].height  # where the pieces so far end
    for n, row in enumerate(rows):
        is_inner = 0 < n < len(rows) - 1
        tangent_before, tangent_behind = _tangents(row, grades[n - 1], grades[n]) if is_inner else (0.0, 0.0)
        if n:
            curve_begin = row.station - tangent_before
            if curve_begin < reached - 1e-3:
                room = row.station - reached
                allowed = (
                    f"curves must not overlap: this one needs {tangent_before:.3f} m before it, but has {room:.3f} m"
                )
                raise InputError(f"ProfAlign at station {row.station:.3f} m", tangent_before, allowed)
            if curve_begin - reached > SHORTEST:
                pieces.append(HeightPiece(reached, curve_begin, height, grades[n - 1]))
                height += grades[n - 1] * (curve_begin - reached)
                reached = curve_begin
        if is_inner and tangent_before + tangent_behind > SHORTEST:
            pieces += _rounding(row, (tangent_before, tangent_behind), height, (grades[n - 1], grades[n]))
            reached = row.station + tangent_behind
            height = row.height + grades[n] * tangent_behind
    return pieces


def _tangents(row: _Intersection, grade_before: float, grade_behind: float) -> tuple[float, float]:
    """Return how far (m) a curve reaches before and behind its intersection, between two grades.

    A circle's tangents are R tan(angle / 2) long along the slope, so that they differ in plan.
    """
    if not row.radius:
        return row.before, row.behind
    slope_before, slope_behind = math.atan(grade_before), math.atan(grade_behind)
    tangent = row.radius * math.tan(0.5 * abs(slope_behind - slope_before))
    return tangent * math.cos(slope_before), tangent * math.cos(slope_behind)


def _rounding(
    row: _Intersection, tangents: tuple[float, float], height: float, grades: tuple[float, float]
) -> list[HeightPiece]:
    """Return the pieces of a curve at an intersection, from the height (m) at its begin."""
    station, (tangent_before, tangent_behind), (grade_before, grade_behind) = row.station, tangents, grades
    start, end = station - tangent_before, station + tangent_behind
    if row.radius and abs(grade_behind - grade_before) > 1e-12:
        return circle(start, end, height, grade_before, grade_behind)
    if abs(tangent_before - tangent_behind) < SHORTEST:
        return [HeightPiece(start, end, height, grade_before, 0.5 * (grade_behind - grade_before) / (end - start))]
    # Two parabolas that meet at the intersection's station, with the chord's grade there.
    middle_grade = (grade_before * tangent_before + grade_behind * tangent_behind) / (tangent_before + tangent_behind)
    half_rise = 0.5 * (grade_before + middle_grade) * tangent_before
    return [
        HeightPiece(start, station, height, grade_before, 0.5 * (middle_grade - grade_before) / tangent_before),
        HeightPiece(
            station, end, height + half_rise, middle_grade, 0.5 * (grade_behind - middle_grade) / tangent_behind
        ),
    ]


def _others(alignment: Element) -> list[str]:
    """Return texts on those elements of an alignment that aren't read, with their numbers."""
    counts = Counter(local_name(row) for row in alignment)
    read_names = ("CoordGeom", "Profile", "StaEquation", "Feature", "Superelevation", "CrossSects", "")
    sections = sum(len(children(row, "CrossSect")) for row in children(alignment, "CrossSects"))
    texts = [f"crossfall: {sections} cross-sections, which don't say what of them is paved"] if sections else []
    return texts + [f"{count} {name}" for name, count in sorted(counts.items()) if name not in read_names]


def _roadways(root: Element) -> dict[str, list[str]]:
    """Return texts on lanes and speeds of roadways, which aren't read, by the names of their alignments."""
    texts_by_name: dict[str, list[str]] = {}
    for roadway in (each for group in children(root, "Roadways") for each in children(group, "Roadway")):
        counts = Counter(local_name(each) for group in children(roadway, "Lanes") for each in group)
        speeds = sum(len(group) for group in children(roadway, "Speeds"))
        texts = [f"lanes: {', '.join(f'{n} {kind}' for kind, n in sorted(counts.items()))}"] if counts else []
        texts += [f"speed limits: {speeds} of the roadway"] if speeds else []
        for name in roadway.get("alignmentRefs", "").split():
            texts_by_name.setdefault(name, []).extend(texts)
    return texts_by_name
