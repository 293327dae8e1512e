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
        MissingFileError, InputError: the file can't be read, or a segment isn't understood.
        MissingPackageError: ifcopenshell isn't installed.
    """
    model = _open(path)
    try:
        return _lines(path, model)
    except _DAMAGES as error:
        raise InputError(path.name, None, f"must be a complete IFC file ({_first_line(error)})") from None


def _first_line(error: Exception) -> str:
    """Return the first line of an error, shortened, its letters printable."""
    line = next(iter(str(error).splitlines()), type(error).__name__)[:_LONGEST]
    return "".join(letter if letter.isprintable() else "?" for letter in line)


def _lines(path: Path, model: Any) -> list[RoadLine]:
    """Return the lines of a model's alignments; one that can't be used has its fault."""
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
    parts, counts, left_out = own_parts(model)
    if parts is not None and len(alignments) != 1:
        parts, counts, left_out = None, Counter(), [f"lanes: those of {len(alignments)} alignments"]
    return [replace(line, given=parts, taken=counts, left_out=(*line.left_out, *left_out)) for line in lines]


def _open(path: Path) -> Any:
    """Return the model of a file, read from a copy with a new header.

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

    pose = np.array(get_local_placement(placement), dtype=np.float64)
    pose[:3, 3] *= unit
    return pose


def _map(path: Path, model: Any, unit: float) -> tuple[MapSystem | None, np.ndarray]:
    """Return the map's coordinate system, and the matrix (4, 4) from the file's coordinates to the map's, m."""
    matrix = np.eye(4)
    conversions = model.by_type("IfcMapConversion")
    if not conversions:
        return None, matrix
    conversion = conversions[0]
    # The axis may be no unit vector, and its absence means the map's own east.
    east, north = (
        (1.0 if conversion.XAxisAbscissa is None else conversion.XAxisAbscissa),
        (conversion.XAxisOrdinate or 0.0),
    )
    size = math.hypot(east, north)
    if size == 0.0:
        east, north, size = 1.0, 0.0, 1.0
    scale = conversion.Scale or 1.0
    # Scale turns the file's units into the map's; coordinates here are metres already.
    if abs(scale - unit) < 1e-6 * unit:
        factor = scale / unit
    elif abs(scale - 1.0) > 0.1:  # units other than those that the file declares: metres stay as they are
        factor = 1.0
    else:
        factor = scale
    matrix[:2, :2] = np.array([[east, -north], [north, east]]) / size * factor
    matrix[:3, 3] = conversion.Eastings, conversion.Northings, conversion.OrthogonalHeight
    target = conversion.TargetCRS
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
    rotation = math.atan2(matrix[1, 0], matrix[0, 0])
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
        pieces.append(PlanPiece(piece.kind, piece.station, piece.length, x, y, piece.heading + rotation, piece.shape))
    shift = float(matrix[2, 3])
    heights = tuple(HeightPiece(h.start, h.end, h.elevation + shift, h.grade, h.square, h.cube) for h in line.heights)
    return replace(line, pieces=tuple(pieces), heights=heights, system=system)


def _nested(item: Any) -> list[Any]:
    """Return the objects nested below an object, in order, and those aggregated, as older files have them."""
    nested_parts = [each for relation in (item.IsNestedBy or ()) for each in relation.RelatedObjects]
    return nested_parts + [
        each for relation in (getattr(item, "IsDecomposedBy", None) or ()) for each in relation.RelatedObjects
    ]


def _alignment(alignment: Any, name: str, unit: float, angle: float) -> RoadLine | None:
    """Return the line of an alignment; None where it has no segment in plan. `unit` is in m, `angle` in rad."""
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
    station = 0.0
    for segment in segments:
        if piece := _plan_piece(segment.DesignParameters, station, unit, angle):
            pieces.append(piece)
            station += piece.length
    if not pieces:
        return None
    heights = _heights(profiles[0], unit) if profiles else []
    cants = [each for each in layouts if each.is_a("IfcAlignmentCant")]
    left_out = [f"{len(profiles) - 1} more profiles"] if len(profiles) > 1 else []
    left_out += ["the cant of a railway"] if cants else []
    start = getattr(plans[0], "StartDistAlong", None)
    station_count, equations = _stationing(layouts, unit)
    if station_count is None:
        station_count = 0.0 if start is None else float(start) * unit
    return RoadLine(
        name=name,
        source="IFC alignment",
        pieces=tuple(pieces),
        heights=tuple(heights),
        first_station=station_count,
        equations=equations,
        left_out=tuple(left_out),
    )


def _stationing(layouts: list[Any], unit: float) -> tuple[float | None, tuple[Equation, ...]]:
    """Return the station count at the begin (m; None without referents), and the station equations of referents."""
    rows = []
    for referent in layouts:
        if not referent.is_a("IfcReferent"):
            continue
        count, incoming = (_stationing_value(referent, name) for name in ("Station", "IncomingStation"))
        location = getattr(getattr(referent.ObjectPlacement, "RelativePlacement", None), "Location", None)
        distance = getattr(getattr(location, "DistanceAlong", None), "wrappedValue", None)
        if count is not None and distance is not None:
            rows.append((float(distance) * unit, count * unit, None if incoming is None else incoming * unit))
    if not rows:
        return None, ()
    rows.sort(key=lambda row: row[0])
    station, count, incoming = rows[0]
    equations = tuple(
        Equation(place, back_count, ahead_count) for place, ahead_count, back_count in rows if back_count is not None
    )
    return (count if incoming is None else incoming) - station, equations


def _stationing_value(referent: Any, name: str) -> float | None:
    """Return a number of a referent's Pset_Stationing; None without it."""
    for relation in getattr(referent, "IsDefinedBy", ()) or ():
        definition = getattr(relation, "RelatingPropertyDefinition", None)
        if getattr(definition, "Name", None) != "Pset_Stationing":
            continue
        for each in getattr(definition, "HasProperties", ()) or ():
            if each.Name == name and each.is_a("IfcPropertySingleValue") and each.NominalValue is not None:
                return finite(f"Pset_Stationing {name}", each.NominalValue.wrappedValue)
    return None


def _plan_piece(segment: Any, station: float, unit: float, angle: float) -> PlanPiece | None:
    """Return the piece of one horizontal segment that begins at a station (m); None for one without a length."""
    if segment is None or not segment.is_a("IfcAlignmentHorizontalSegment"):
        raise InputError(
            f"segment at station {station:.3f} m", None, "must have the DesignParameters of a horizontal segment"
        )
    length = float(segment.SegmentLength) * unit
    if length <= SHORTEST:
        return None
    x, y = (float(value) * unit for value in segment.StartPoint.Coordinates[:2])
    heading = float(segment.StartDirection) * angle
    kind = segment.PredefinedType
    start_curvature, end_curvature = (
        1.0 / (float(radius) * unit) if radius else 0.0
        for radius in (segment.StartRadiusOfCurvature, segment.EndRadiusOfCurvature)
    )
    shape: tuple[float, float] | Curve
    if kind == "LINE":
        shape = (0.0, 0.0)
    elif kind == "CIRCULARARC":
        shape = (start_curvature, start_curvature)
    elif kind == "CLOTHOID":
        shape = (start_curvature, end_curvature)
    elif kind in _KINDS:
        shape = transition(_KINDS[kind], length, start_curvature, end_curvature)
    else:
        allowance = f"must be one of LINE, CIRCULARARC, {', '.join(_KINDS)}"
        raise InputError(f"segment at station {station:.3f} m: PredefinedType", kind, allowance)
    return PlanPiece(_KINDS.get(kind, kind.lower()), station, length, x, y, heading, shape)


def _heights(profile: Any, unit: float) -> list[HeightPiece]:
    """Return the pieces of a vertical layout, in m."""
    pieces: list[HeightPiece] = []
    for segment in _nested(profile):
        design = getattr(segment, "DesignParameters", None)
        if design is None or not design.is_a("IfcAlignmentVerticalSegment"):
            continue
        start, length, height = (
            float(v) * unit for v in (design.StartDistAlong, design.HorizontalLength, design.StartHeight)
        )
        if length <= SHORTEST:
            continue
        start_grade, end_grade = float(design.StartGradient), float(design.EndGradient)
        kind = design.PredefinedType
        if kind == "CONSTANTGRADIENT" or (
            kind in ("PARABOLICARC", "CIRCULARARC") and abs(end_grade - start_grade) < 1e-12
        ):
            pieces.append(HeightPiece(start, start + length, height, start_grade))
        elif kind == "PARABOLICARC":
            pieces.append(
                HeightPiece(start, start + length, height, start_grade, 0.5 * (end_grade - start_grade) / length)
            )
        elif kind == "CIRCULARARC":
            pieces += circle(start, start + length, height, start_grade, end_grade)
        else:
            allowance = "must be one of CONSTANTGRADIENT, PARABOLICARC, CIRCULARARC"
            raise InputError(f"vertical segment at {start:.3f} m: PredefinedType", kind, allowance)
    return pieces
