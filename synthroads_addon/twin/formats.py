"""Geometric-semantic models of a road in open formats: CityJSON, IFC, OpenDRIVE and GeoJSON.

All come from the parameter set and its analytic geometry (`RoadGeometry`), in map coordinates. Objects keep their ids
and their ``instance`` numbers, which the points of a cloud carry as well.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Literal, get_args

from ..base.errors import InputError, nearest_name
from ..road.parameters import RoadParameters

TwinFormat = Literal["cityjson", "ifc", "opendrive", "geojson"]
TWIN_FORMATS: tuple[TwinFormat, ...] = get_args(TwinFormat)
"""Every format; each is written by ``write_NAME(parameters, path, tolerance)`` of its module in `_WRITERS`."""
_WRITERS = {
    "cityjson": ".cityjson.writer",
    "ifc": ".ifc.writer",
    "opendrive": ".opendrive.writer",
    "geojson": ".geojson",
}
"""Modules with the functions that write the formats."""

TOLERANCE = 0.005
"""Chord error of curved surfaces and lines that isn't asked for otherwise, m."""

_FILES = {
    "cityjson": "twin.city.json",
    "ifc": "twin.ifc",
    "opendrive": "twin.xodr",
    "geojson": "twin.geojson",
}
_PACKAGES = {"ifc": "ifcopenshell"}
_Writer = Callable[[RoadParameters, Path, float], None]


def twin_file_names(formats: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the files that formats are written to.

    Raises:
        InputError: a format is unknown.
    """
    return tuple(_FILES[known_format(name)] for name in formats)


def known_format(name: str) -> TwinFormat:
    """Return a format's name if there is such a format.

    Raises:
        InputError: there is none; the nearest name is suggested.
    """
    for known in TWIN_FORMATS:
        if name == known:
            return known
    raise InputError("twin", name, f"must be one of {', '.join(TWIN_FORMATS)}{nearest_name(name, TWIN_FORMATS)}")


def missing_packages(name: str) -> str | None:
    """Return the package that a format needs and that isn't installed, or None if it can be written.

    Raises:
        InputError: the format is unknown.
    """
    package = _PACKAGES.get(known_format(name))
    return package if package and importlib.util.find_spec(package) is None else None


def check_formats(formats: Iterable[str]) -> None:
    """Refuse formats that are unknown or can't be written here, before any work starts.

    Raises:
        InputError: a format is unknown, or its package isn't installed.
    """
    for name in formats:
        if package := missing_packages(name):
            raise InputError("twin", name, f"needs the package {package}: pip install 'synthroads[twin]'")


def write_twin(
    parameters: RoadParameters, folder: Path, formats: Sequence[str], tolerance: float = TOLERANCE
) -> None:
    """Write a road's geometric-semantic model into a folder, one file per format (`twin_file_names`).

    Args:
        parameters: the road.
        folder: where the files go; it must be there.
        formats: of `TWIN_FORMATS`.
        tolerance: largest chord error (m) of curved surfaces and lines; their vertices are exact.

    Raises:
        InputError: a format is unknown or its package isn't installed, or a road can't be said in it.
    """
    check_formats(formats)
    for name, file_name in zip(formats, twin_file_names(formats), strict=True):
        writer: _Writer = getattr(import_module(_WRITERS[name], __package__), f"write_{name}")
        writer(parameters, folder / file_name, tolerance)
