"""Roads and alignments of a file, found by its content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from os import SEEK_END
from pathlib import Path
from typing import TypeVar

from ..base.errors import InputError, MissingFileError
from .ifc import read_ifc
from .landxml import read_landxml
from .line import RoadLine
from .opendrive import read_opendrive
from .osm import PBF_MARK, read_osm, read_pbf
from .points import PointLine, read_point_lines
from .track import is_sbet, read_sbet
from .vector import DRIVERS, read_vector, vector_format

Named = TypeVar("Named", RoadLine, PointLine)
_HEAD = 1 << 16
_NO_LINE = "the file has no road or alignment with elements in plan"
_MARKS: tuple[tuple[bytes, str], ...] = (
    (b"<OpenDRIVE", "OpenDRIVE"),
    (b"<LandXML", "LandXML"),
    (b"ISO-10303-21;", "IFC"),
    (b"<kml", "KML"),
    (b"<gpx", "GPX"),
    (b"<osm", "OpenStreetMap"),
)
"""Bytes that the head of a file of a format holds, whatever the file is called."""
READERS: dict[str, Callable[[Path], list[RoadLine]]] = {
    "OpenDRIVE": read_opendrive,
    "LandXML": read_landxml,
    "IFC": read_ifc,
}
"""Readers of files with lines of elements, by format."""
OF_POINTS: dict[str, Callable[[Path], list[PointLine]]] = {
    "KML": read_point_lines,
    "GPX": read_point_lines,
    "OpenStreetMap": read_osm,
    "OpenStreetMap PBF": read_pbf,
    "SBET": read_sbet,
    **{name: partial(read_vector, kind=name) for name in DRIVERS},
}
"""Readers of files with lines of points, by format."""


def format_of(path: Path) -> str | None:
    """Return the format of a file by its content, a key of `READERS` or of `OF_POINTS`; None for any other.

    Raises:
        MissingFileError: the file can't be read.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
            size = file.seek(0, SEEK_END)
    except OSError as error:
        raise MissingFileError(str(path), None, f"must be a readable axis file ({error.strerror})") from None
    if head[4:].startswith(PBF_MARK):
        return "OpenStreetMap PBF"
    if (gis_format := vector_format(head)) is not None:
        return gis_format
    text = head.replace(b"\0", b"")  # so that words of UTF-16 are found as well
    text_format = next((name for mark, name in _MARKS if mark in text), None)
    return "SBET" if text_format is None and is_sbet(head, size) else text_format


def read_lines(path: Path) -> list[RoadLine]:
    """Return the roads and alignments of an OpenDRIVE, LandXML or IFC file.

    Raises:
        MissingFileError: the file can't be read.
        InputError: it is of another format, isn't understood, or has none.

    Example:
        >>> from pathlib import Path
        >>> from synthroads_addon import sample_road, write_twin
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> write_twin(sample_road(RoadScenario(length=120.0), seed=7), Path(), ["opendrive"])
        >>> line = read_lines(Path("twin.xodr"))[0]
        >>> line.source, round(line.length, 3)
        ('OpenDRIVE road', 120.0)
    """
    name = format_of(path)
    if name not in READERS:
        raise InputError(path.name, name, f"must be one of {', '.join(READERS)}")
    lines = READERS[name](path)
    if not lines:
        raise InputError(path.name, None, _NO_LINE)
    return lines


def read_points(path: Path, kind: str) -> list[PointLine]:
    """Return the lines of a file of points of a format, a key of `OF_POINTS`; see its reader."""
    return OF_POINTS[kind](path)


def named_line(lines: Sequence[Named], line_name: str, file: str) -> Named:
    """Return the line of a name; raise `InputError` where no line of the file has it."""
    for line in lines:
        if line.name == line_name:
            return line
    names = ", ".join(repr(line.name) for line in lines[:20])
    more = f" and {len(lines) - 20} more" if len(lines) > 20 else ""
    raise InputError(f"{file}: road", line_name, f"must be one of the roads in the file: {names}{more}")


def choose_line(lines: Sequence[RoadLine], line_name: str | None, file: str) -> RoadLine:
    """Return the line of a name, or without one the longest that belongs to no junction.

    Args:
        lines: of the file.
        line_name: name of the line, None for the longest.
        file: name for messages.

    Raises:
        InputError: there is none, or none of that name; or it, or each of the lines, can't be used.
    """
    if not lines:
        raise InputError(file, None, _NO_LINE)
    if line_name is not None:
        choice = named_line(lines, line_name, file)
    else:
        usable = [line for line in lines if line.fault is None] or list(lines)
        choice = max([line for line in usable if not line.junction] or usable, key=lambda line: line.length)
    if choice.fault is not None:
        fault = choice.fault
        raise InputError(f"{file}: {choice.name}: {fault.field}", fault.value, fault.allowed)
    return choice
