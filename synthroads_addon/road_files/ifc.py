"""Alignments of IFC 4.3: their segments as designed, not the curves that programs have made of them.

IFC 4.3.2 (ISO 16739-1:2024), `IfcAlignmentHorizontalSegment` and `IfcAlignmentVerticalSegment`, and the older names of
its schema: these two entities have been the same since its second candidate.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, MissingFileError, MissingPackageError
from ..base.maps.crs import MapSystem
from ..base.remarks import warn
from .beside.own_parts import own_parts
from .curves import Curve, transition
from .heights import HeightPiece, circle
from .line import SHORTEST, Equation, LineNames, PlanPiece, RoadLine
from .xml_text import finite

_SCHEMA = re.compile(rb"FILE_SCHEMA\s*\(\s*\(\s*'([^']*)'\s*\)\s*\)", re.IGNORECASE)
_END = b"END-ISO-10303-21"
"""The end of each file of STEP (ISO 10303-21): without it something was cut off, which the library reads over."""
_DATA = re.compile(rb"ENDSEC\s*;\s*DATA\s*;")
_HEADER = b"""ISO-10303-21;
HEADER;FILE_DESCRIPTION((''),'2;1');FILE_NAME('','',(''),(''),'','','');FILE_SCHEMA(('IFC4X3_ADD2'));
"""
"""Header up to its end, with the schema that the library reads."""
_KINDS = {
    "CLOTHOID": "clothoid", "BLOSSCURVE": "bloss", "COSINECURVE": "cosine", "SINECURVE": "sine",
    "HELMERTCURVE": "helmert",
}  # fmt: skip
"""Kinds of transition curves by IFC's names for them."""
_LARGEST = 512 << 20
_LONGEST = 200
"""Letters of the library's own words in an error."""
_DAMAGES = (ArithmeticError, AttributeError, LookupError, RecursionError, RuntimeError, TypeError, ValueError)
"""Errors of the library, and of attributes that are missing or of another kind, in damaged files."""


def read_ifc(path: Path) -> list[RoadLine]:
    """Return the alignments of an IFC file that have segments in plan.

    Raises:
        MissingFileError, InputError: it can't be read, `ifcopenshell` isn't installed, or a segment isn't understood.
    """
    model = _open(path)
    try:
        return _lines(path, model)
    except _DAMAGES as error:
        raise InputError(path.name, None, f"must be a complete IFC file ({_first_line(error)})") from None


def _first_line(error: Exception) -> str:
    """Return the first line of an error, shortened, its letters printable."""
    said = next(iter(str(error).splitlines()), type(error).__name__)[:_LONGEST]
    return "".join(letter if letter.isprintable() else "?" for letter in said)


def _lines(path: Path, model: Any) -> list[RoadLine]:
    """Return the alignments of a model, those that can't be used with their fault."""
    unit, angle = _units(model)
    system, place = _map(path, model, unit)
    names, lines = LineNames(), list[RoadLine]()
    alignments = model.by_type("IfcAlignment")
    for number_of, alignment in enumerate(alignments):
        unique = names.unique(alignment.Name, f"alignment {number_of + 1}")
        try:
            if line := _alignment(alignment, unique, unit, angle):
                lines.append(_placed(line, place @ _placement(alignment.ObjectPlacement, unit), system))
        except InputError as error:
            lines.append(RoadLine(unique, "IFC alignment", (), system=system, fault=error))
    # With several alignments nothing says which of them the parts of the road belong to.
    given, taken, left_out = own_parts(model)
    alone = given is None or len(alignments) == 1
    if not alone:
        given, taken, left_out = None, Counter(), [f"lanes: those of {len(alignments)} alignments"]
    return [replace(one, given=given, taken=taken, left_out=(*one.left_out, *left_out)) for one in lines]


def _open(path: Path) -> Any:
    """Return the model of a file, read from a copy with a header of its own.

    The library knows one name of the schema alone, and a broken header can end the process.
    """
    try:
        import ifcopenshell  # an extra, and it takes seconds
    except ImportError:
        raise MissingPackageError(path.name, "IFC", "ifcopenshell", "twin") from None
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(
                path.name, f"{path.stat().st_size / 1e6:,.0f} MB", f"must be at most {_LARGEST / 1e6:,.0f} MB"
            )
        data = path.read_bytes()
    except OSError as error:
        raise MissingFileError(str(path), None, f"cannot be read ({error.strerror})") from None
    match = _SCHEMA.search(data[: 1 << 20])
    schema = match[1].decode("ascii", "replace").upper() if match else ""
    if not schema.startswith("IFC4X3"):
        raise InputError(
            path.name, schema or None, "must be IFC 4.3 (IFC4X3 or a candidate of it), as older versions have no roads"
        )
    if _END not in data[-4096:]:
        raise InputError(path.name, None, "must end with END-ISO-10303-21: this file is cut off")
    begin = _DATA.search(data)
    if begin is None:
        raise InputError(path.name, None, "must have a section DATA after the header")
    try:
        data = _HEADER + data[begin.start() :]
        with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
            copy = Path(folder) / "model.ifc"
            copy.write_bytes(data)
            return ifcopenshell.open(str(copy))
    except (RuntimeError, OSError, ValueError, ifcopenshell.Error) as error:
        raise InputError(path.name, None, f"must be a readable IFC file ({_first_line(error)})") from None


def _units(model: Any) -> tuple[float, float]:
    """Return metres per unit of length, and radians per unit of angle."""
    from ifcopenshell.util.unit import calculate_unit_scale  # an extra

    length = float(calculate_unit_scale(model, "LENGTHUNIT"))
    angle = float(calculate_unit_scale(model, "PLANEANGLEUNIT"))
    return length, angle


def _placement(placement: Any, unit: float) -> np.ndarray:
    """Return the matrix (4, 4) of an object's placement, m; the unit matrix without one."""
    if placement is None:
        return np.eye(4)
    from ifcopenshell.util.placement import get_local_placement  # an extra

    matrix = np.array(get_local_placement(placement), dtype=np.float64)
    matrix[:3, 3] *= unit
    return matrix


def _map(path: Path, model: Any, unit: float) -> tuple[MapSystem | None, np.ndarray]:
    """Return the map's coordinate system, and the matrix (4, 4) from the file's coordinates to the map's, m."""
    matrix = np.eye(4)
    rows = model.by_type("IfcMapConversion")
    if not rows:
        return None, matrix
    row = rows[0]
    # The axis may be no unit vector, and its absence means the map's own east.
    east, north = (1.0 if row.XAxisAbscissa is None else row.XAxisAbscissa), (row.XAxisOrdinate or 0.0)
    size = math.hypot(east, north)
    if size == 0.0:
        east, north, size = 1.0, 0.0, 1.0
    scale = row.Scale or 1.0
    # Scale turns the file's units into the map's; coordinates here are metres already.
    away = scale / unit if abs(scale - unit) < 1e-6 * unit else 1.0 if abs(scale - 1.0) > 0.1 else scale
    matrix[:2, :2] = np.array([[east, -north], [north, east]]) / size * away
    matrix[:3, 3] = row.Eastings, row.Northings, row.OrthogonalHeight
    target = row.TargetCRS
    names = [text for text in (getattr(target, "Name", None), getattr(target, "Description", None)) if text]
    for text in names:
        try:
            return MapSystem.read(str(text)), matrix
        except InputError:
            continue
    if names:
        warn("%s: its coordinate system %r isn't known: give it by --set road.epsg=...", path.name, names[0])
    return None, matrix


def _placed(line: RoadLine, matrix: np.ndarray, system: MapSystem | None) -> RoadLine:
    """Return a line moved and turned into the map by a matrix (4, 4)."""
    turn = math.atan2(matrix[1, 0], matrix[0, 0])
    scale = math.hypot(matrix[0, 0], matrix[1, 0])
    if abs(scale - 1.0) > 1e-2:
        raise InputError(
            "map conversion: scale", scale, "must be within 1 % of 1, as the lengths of a road are in metres"
        )
    if abs(scale - 1.0) > 1e-9:
        warn("%s: the map's scale of %.9f moves places and leaves lengths as they are designed", line.name, scale)
    pieces = []
    for piece in line.pieces:
        x, y = (matrix @ np.array([piece.x, piece.y, 0.0, 1.0]))[:2].tolist()
        pieces.append(PlanPiece(piece.kind, piece.station, piece.length, x, y, piece.heading + turn, piece.shape))
    up = float(matrix[2, 3])
    heights = tuple(HeightPiece(h.start, h.end, h.elevation + up, h.grade, h.square, h.cube) for h in line.heights)
    return replace(line, pieces=tuple(pieces), heights=heights, system=system)


def _nested(item: Any) -> list[Any]:
    """Return what is nested below an object, in order; what is aggregated as well, as older files have it."""
    parts = [each for relation in (item.IsNestedBy or ()) for each in relation.RelatedObjects]
    return parts + [
        each for relation in (getattr(item, "IsDecomposedBy", None) or ()) for each in relation.RelatedObjects
    ]


def _alignment(alignment: Any, name: str, unit: float, angle: float) -> RoadLine | None:
    layouts = _nested(alignment)
    plans = [each for each in layouts if each.is_a("IfcAlignmentHorizontal")]
    profiles = [each for each in layouts if each.is_a("IfcAlignmentVertical")]
    for child in layouts:  # profiles of one plan, each in an alignment of its own
        if child.is_a("IfcAlignment"):
            profiles += [each for each in _nested(child) if each.is_a("IfcAlignmentVertical")]
    if not plans:
        return None
    segments = [each for each in _nested(plans[0]) if each.is_a("IfcAlignmentSegment")]
    pieces: list[PlanPiece] = []
    run = 0.0
    for segment in segments:
        if piece := _plan_piece(segment.DesignParameters, run, unit, angle):
            pieces.append(piece)
            run += piece.length
    if not pieces:
        return None
    heights = _heights(profiles[0], unit) if profiles else []
    cants = [each for each in layouts if each.is_a("IfcAlignmentCant")]
    left_out = [f"{len(profiles) - 1} more profiles"] if len(profiles) > 1 else []
    left_out += ["the cant of a railway"] if cants else []
    start = getattr(plans[0], "StartDistAlong", None)
    first, equations = _stationing(layouts, unit)
    if first is None:
        first = 0.0 if start is None else float(start) * unit
    return RoadLine(
        name=name,
        source="IFC alignment",
        pieces=tuple(pieces),
        heights=tuple(heights),
        first_station=first,
        equations=equations,
        left_out=tuple(left_out),
    )


def _stationing(nested: list[Any], unit: float) -> tuple[float | None, tuple[Equation, ...]]:
    """Return the count at the begin (m; None without referents) and the station equations that referents give."""
    rows = []
    for referent in nested:
        if not referent.is_a("IfcReferent"):
            continue
        count, back = (_stated(referent, name) for name in ("Station", "IncomingStation"))
        location = getattr(getattr(referent.ObjectPlacement, "RelativePlacement", None), "Location", None)
        along = getattr(getattr(location, "DistanceAlong", None), "wrappedValue", None)
        if count is not None and along is not None:
            rows.append((float(along) * unit, count * unit, None if back is None else back * unit))
    if not rows:
        return None, ()
    rows.sort(key=lambda row: row[0])
    station, count, back = rows[0]
    equations = tuple(Equation(at, before, there) for at, there, before in rows if before is not None)
    return (count if back is None else back) - station, equations


def _stated(referent: Any, name: str) -> float | None:
    """Return a number of a referent's Pset_Stationing; None without it."""
    for relation in getattr(referent, "IsDefinedBy", ()) or ():
        definition = getattr(relation, "RelatingPropertyDefinition", None)
        if getattr(definition, "Name", None) != "Pset_Stationing":
            continue
        for each in getattr(definition, "HasProperties", ()) or ():
            if each.Name == name and each.is_a("IfcPropertySingleValue") and each.NominalValue is not None:
                return finite(f"Pset_Stationing {name}", each.NominalValue.wrappedValue)
    return None


def _plan_piece(row: Any, run: float, unit: float, angle: float) -> PlanPiece | None:
    """Return the piece of one horizontal segment that begins at a station (m); None for one without a length."""
    if row is None or not row.is_a("IfcAlignmentHorizontalSegment"):
        raise InputError(
            f"segment at station {run:.3f} m", None, "must have the DesignParameters of a horizontal segment"
        )
    length = float(row.SegmentLength) * unit
    if length <= SHORTEST:
        return None
    x, y = (float(value) * unit for value in row.StartPoint.Coordinates[:2])
    heading = float(row.StartDirection) * angle
    kind = row.PredefinedType
    first, last = (
        1.0 / (float(r) * unit) if r else 0.0 for r in (row.StartRadiusOfCurvature, row.EndRadiusOfCurvature)
    )
    shape: tuple[float, float] | Curve
    if kind == "LINE":
        shape = (0.0, 0.0)
    elif kind == "CIRCULARARC":
        shape = (first, first)
    elif kind == "CLOTHOID":
        shape = (first, last)
    elif kind in _KINDS:
        shape = transition(_KINDS[kind], length, first, last)
    else:
        allowance = f"must be one of LINE, CIRCULARARC, {', '.join(_KINDS)}"
        raise InputError(f"segment at station {run:.3f} m: PredefinedType", kind, allowance)
    return PlanPiece(_KINDS.get(kind, kind.lower()), run, length, x, y, heading, shape)


def _heights(profile: Any, unit: float) -> list[HeightPiece]:
    """Return the pieces of a vertical layout."""
    pieces: list[HeightPiece] = []
    for segment in _nested(profile):
        row = getattr(segment, "DesignParameters", None)
        if row is None or not row.is_a("IfcAlignmentVerticalSegment"):
            continue
        start, length, height = (float(v) * unit for v in (row.StartDistAlong, row.HorizontalLength, row.StartHeight))
        if length <= SHORTEST:
            continue
        first, last = float(row.StartGradient), float(row.EndGradient)
        kind = row.PredefinedType
        if kind == "CONSTANTGRADIENT" or (kind in ("PARABOLICARC", "CIRCULARARC") and abs(last - first) < 1e-12):
            pieces.append(HeightPiece(start, start + length, height, first))
        elif kind == "PARABOLICARC":
            pieces.append(HeightPiece(start, start + length, height, first, 0.5 * (last - first) / length))
        elif kind == "CIRCULARARC":
            pieces += circle(start, start + length, height, first, last)
        else:
            allowance = "must be one of CONSTANTGRADIENT, PARABOLICARC, CIRCULARARC"
            raise InputError(f"vertical segment at {start:.3f} m: PredefinedType", kind, allowance)
    return pieces
