"""Roads of OpenDRIVE 1.4 to 1.8: the reference line of each, and its elevation.

ASAM OpenDRIVE 1.8.1, chapters 8 (geometry), 9 (reference line) and 10.5 (elevation): `line`, `spiral`, `arc`, `poly3`
and `paramPoly3`, each from a start of its own, and cubics of the height.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np

from ..base.errors import InputError
from ..base.maps.crs import MapSystem, UnknownSystemError
from ..base.maps.proj_strings import is_proj_string, read_proj_string
from ..base.remarks import warn
from .curves import Curve, cubic_curve, cubic_up_to
from .heights import HeightPiece
from .line import SHORTEST, LineNames, PlanPiece, RoadLine
from .xml_text import child, children, local_name, number, read_xml

_LENGTHS = 1e-3
"""Share by which a cubic's arc length may differ from the length that the file gives it before that is told."""
_CODE = re.compile(r"[1-9][0-9]{3,5}")
"""Text of an EPSG code."""
_OBJECTS = {"objects": "objects", "signals": "signals"}


def read_opendrive(path: Path) -> list[RoadLine]:
    """Return the roads of an OpenDRIVE file, those of junctions among them.

    Raises:
        MissingFileError, InputError: the file can't be read, isn't OpenDRIVE, or holds no number where one must be.
    """
    root = read_xml(path)
    header = child(root, "header")
    system = _system(path, header)
    shift = _shift(header)
    names, lines = LineNames(), list[RoadLine]()
    for row, road in enumerate(children(root, "road")):
        name = names.unique(road.get("name"), f"road {road.get('id', row)}")
        try:
            if line := _road(road, name, system, shift):
                lines.append(line)
        except InputError as error:
            lines.append(RoadLine(name, "OpenDRIVE road", (), system=system, fault=error))
    return lines


def _system(path: Path, header: Element | None) -> MapSystem | None:
    """Return the system that the header names; None without a word on it, and where nobody knows it (warned)."""
    reference = None if header is None else child(header, "geoReference")
    text = "" if reference is None else "".join(reference.itertext()).strip()
    if not text:
        return None
    try:
        system = read_proj_string(text) if is_proj_string(text) else MapSystem.read(text)
        return _with_noted_codes(header, system)
    except InputError as error:
        reason = error.allowed if isinstance(error, UnknownSystemError) else str(error)
        warn("%s: its coordinate system %r isn't used: it %s", path.name, text, reason)
        return None


def _with_noted_codes(header: Element | None, system: MapSystem) -> MapSystem:
    """Return the system with EPSG codes that our own files note beside the PROJ string, if that is the same system.

    A PROJ string names neither the datum nor what heights are counted from.
    """
    values = {} if header is None else {row.get("code"): row.get("value", "") for row in children(header, "userData")}
    codes = [
        int(text) if _CODE.fullmatch(text) else None for text in (values.get("epsg", ""), values.get("height_epsg", ""))
    ]
    if codes[0] is None:
        return system
    try:
        noted_system = MapSystem.of(codes[0], codes[1])
    except InputError:
        return system
    return noted_system if system.same_as(noted_system) else system


def _shift(header: Element | None) -> tuple[float, float, float, float]:
    """Return the header's offset x, y, z (m) and its turn (rad): what is added to the file's coordinates."""
    offset = None if header is None else child(header, "offset")
    if offset is None:
        return 0.0, 0.0, 0.0, 0.0
    return (
        number(offset, "x", 0.0),
        number(offset, "y", 0.0),
        number(offset, "z", 0.0),
        number(offset, "hdg", 0.0),
    )


def _road(
    road: Element, name: str, system: MapSystem | None, shift: tuple[float, float, float, float]
) -> RoadLine | None:
    """Return the line of a road element in the map's coordinates; None without a geometry that is longer than 0 m.

    `shift` is what `_shift` returns for the header.
    """
    plan = child(road, "planView")
    pieces = [] if plan is None else [_piece(geometry) for geometry in children(plan, "geometry")]
    pieces = [piece for piece in pieces if piece.length > SHORTEST]
    if not pieces:
        return None
    x, y, z, turn = shift
    cos, sin = math.cos(turn), math.sin(turn)
    map_pieces = tuple(
        replace(
            piece,
            x=x + piece.x * cos - piece.y * sin,
            y=y + piece.x * sin + piece.y * cos,
            heading=piece.heading + turn,
        )
        for piece in pieces
    )
    end = map_pieces[-1].station + map_pieces[-1].length
    return RoadLine(
        name=name,
        source="OpenDRIVE road",
        pieces=map_pieces,
        heights=tuple(_heights(road, end, z)),
        system=system,
        lanes=_lane_count(road, 0.5 * end),
        junction=road.get("junction", "-1").strip() not in ("-1", ""),
        left_out=tuple(_left_out(road)),
    )


def _piece(geometry: Element) -> PlanPiece:
    """Return the piece of a geometry element in the file's coordinates; raise `InputError` for one that is no curve."""
    station, length = number(geometry, "s"), number(geometry, "length")
    x, y, heading = (number(geometry, name) for name in ("x", "y", "hdg"))
    shapes = [each for each in geometry if local_name(each) in _SHAPES]
    place = f"geometry at s = {station:g}"
    if len(shapes) != 1:
        names = ", ".join(sorted(_SHAPES))
        raise InputError(place, [local_name(each) for each in geometry], f"must contain one of {names}")
    kind = local_name(shapes[0])
    if length <= SHORTEST:
        return PlanPiece(kind, station, 0.0, x, y, heading, (0.0, 0.0))
    try:
        shape, start_turn, start = _SHAPES[kind](shapes[0], length)
    except ValueError as error:
        raise InputError(place, kind, f"must be a curve, but {error}") from None
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = x + start[0] * cos - start[1] * sin, y + start[0] * sin + start[1] * cos
    if isinstance(shape, Curve) and abs(shape.length - length) > _LENGTHS * length:
        text = "the curve at s = %.3f m is %.3f m long, where the file says %.3f m: the curve counts"
        warn(text, station, shape.length, length)
    return PlanPiece(kind, station, length, x, y, heading + start_turn, shape)


_Shape = tuple[tuple[float, float] | Curve, float, tuple[float, float]]
"""Curvatures at both ends (1/m) or a curve; its turn (rad) against the file's heading; its start (m) in that frame."""
_AT_START = (0.0, 0.0)


def _line(_: Element, __: float) -> _Shape:
    """Return the shape of a straight line."""
    return (0.0, 0.0), 0.0, _AT_START


def _arc(element: Element, _: float) -> _Shape:
    """Return the shape of an arc of constant curvature."""
    curvature = number(element, "curvature")
    return (curvature, curvature), 0.0, _AT_START


def _spiral(element: Element, _: float) -> _Shape:
    """Return the shape of a clothoid between two curvatures."""
    return (number(element, "curvStart"), number(element, "curvEnd")), 0.0, _AT_START


def _poly3(element: Element, length: float) -> _Shape:
    """Return the shape of a cubic of the distance along the tangent (m), up to an arc length (m)."""
    v = np.array([number(element, name) for name in "abcd"])
    curve, turn, start = cubic_up_to(v, length)
    return curve, turn, (float(start[0]), float(start[1]))


def _param_poly3(element: Element, length: float) -> _Shape:
    """Return the shape of two cubics of a parameter, which ends at 1 or at the length (m)."""
    u, v = (np.array([number(element, f"{power}{axis}") for power in "abcd"]) for axis in "UV")
    end = 1.0 if element.get("pRange", "normalized") == "normalized" else length
    curve, turn, start = cubic_curve(u, v, end)
    return curve, turn, (float(start[0]), float(start[1]))


_SHAPES = {"line": _line, "arc": _arc, "spiral": _spiral, "poly3": _poly3, "paramPoly3": _param_poly3}


def _heights(road: Element, end: float, z_offset: float) -> list[HeightPiece]:
    """Return the pieces of a road's elevation up to its end, m, raised by the header's z; empty where it has none."""
    profile = child(road, "elevationProfile")
    rows = [] if profile is None else children(profile, "elevation")
    records = sorted([number(row, name) for name in ("s", "a", "b", "c", "d")] for row in rows)
    records = [row for n, row in enumerate(records) if n + 1 == len(records) or records[n + 1][0] > row[0] + SHORTEST]
    records = [row for row in records if row[0] < end - SHORTEST]
    if not records:
        return []
    ends = [row[0] for row in records[1:]] + [end]
    pieces = [HeightPiece(s, e, a + z_offset, b, c, d) for (s, a, b, c, d), e in zip(records, ends, strict=True)]
    first_piece = pieces[0]
    if first_piece.start > SHORTEST:  # heights begin with 0 before the first record
        pieces.insert(0, HeightPiece(0.0, first_piece.start, z_offset, 0.0))
    return pieces


def _lane_count(road: Element, station: float) -> int | None:
    """Return the number of lanes of all kinds at a station, m."""
    lanes = child(road, "lanes")
    sections = [] if lanes is None else children(lanes, "laneSection")
    if not sections:
        return None
    sections_before = [section for section in sections if number(section, "s") <= station] or sections[:1]
    sides = [side for name in ("left", "right") for side in children(sections_before[-1], name)]
    return sum(len(children(side, "lane")) for side in sides)


def _left_out(road: Element) -> list[str]:
    """Return texts with the numbers of lane sections, lateral profiles, objects and signals, which aren't read here."""
    texts = []
    lanes = child(road, "lanes")
    if lanes is not None and (sections := children(lanes, "laneSection")):
        texts.append(f"lanes of {len(sections)} lane sections")
    lateral = child(road, "lateralProfile")
    if lateral is not None and len(lateral):
        counts = Counter(local_name(row) for row in lateral)
        texts.append("lateral profile: " + ", ".join(f"{count} {name}" for name, count in sorted(counts.items())))
    for group, text in _OBJECTS.items():
        group_element = child(road, group)
        if group_element is not None and len(group_element):
            texts.append(f"{len(group_element)} {text}")
    return texts
