"""Geometric-semantic models of a road in open formats: CityJSON, IFC, OpenDRIVE, OpenCRG, GIS files and a table.

All come from the parameter set and its analytic geometry (`RoadGeometry`), in map coordinates. Objects keep their ids
and their ``instance`` numbers, which the points of a cloud carry as well.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from ..base.errors import InputError, MissingPackageError, nearest_name
from ..base.machine import linear_algebra_on_one_thread
from ..base.progress import Progress, part_of, silent
from ..base.schema import ClosedModel
from ..road.parameters import RoadParameters
from .trace import Trace


@dataclass(frozen=True)
class FormatEntry:
    """A file format of the geometric-semantic model (twin): its texts, file name, writer module and optional package.

    Attributes:
        label, description: for people.
        file: name of the file.
        module: module beside this one with ``write_NAME(parameters, path, tolerance)``, which returns a `Trace`.
        package: package that it needs and that not every installation has.
        seconds, megabytes: of the processor and of the file for a kilometre of motorway; measured on 5 km of the
            scenario ``rq31-600m`` (``--set road.length=5000``), two cores of an AMD EPYC, one thread.
    """

    label: str
    description: str
    file: str
    module: str
    package: str | None = None
    seconds: float = 1.0
    megabytes: float = 1.0


FORMATS = {
    "cityjson": FormatEntry(
        "CityJSON",
        "Surfaces and objects with their meaning (OGC CityJSON 2.0)",
        "twin.city.json",
        ".cityjson.writer",
        seconds=1.5,
        megabytes=3.5,
    ),
    "ifc": FormatEntry(
        "IFC",
        "Alignment, pavement and furniture for building information models (IFC 4.3)",
        "twin.ifc",
        ".ifc.writer",
        package="ifcopenshell",
        seconds=3.1,
        megabytes=4.3,
    ),
    "opendrive": FormatEntry(
        "OpenDRIVE",
        "Lanes, markings, signs and objects for driving simulators (ASAM OpenDRIVE)",
        "twin.xodr",
        ".opendrive.writer",
        seconds=0.4,
        megabytes=0.5,
    ),
    "lanelet2": FormatEntry(
        "Lanelet2",
        "Lanes with their neighbours and followers, for driving functions (Lanelet2, OSM XML)",
        "twin.osm",
        ".lanelet2",
        seconds=1.0,
        megabytes=1.0,
    ),
    "geojson": FormatEntry(
        "GeoJSON",
        "Lines, areas and points for geographic information systems",
        "twin.geojson",
        ".geojson",
        seconds=0.2,
        megabytes=0.6,
    ),
    "geopackage": FormatEntry(
        "GeoPackage",
        "Everything that has a place, damage too, in layers with fields and styles for QGIS (OGC GeoPackage)",
        "twin.gpkg",
        ".geopackage",
        package="pyogrio",
        seconds=0.5,
        megabytes=1.0,
    ),
    "inventory": FormatEntry(
        "Inventory",
        "Things beside the road by station, as a table (CSV)",
        "inventory.csv",
        ".inventory",
        seconds=0.1,
        megabytes=0.1,
    ),
    "opencrg": FormatEntry(
        "OpenCRG",
        "Heights of the pavement on a grid, with its waves and damage, for vehicle dynamics (ASAM OpenCRG)",
        "twin.crg",
        ".opencrg",
        seconds=5.1,
        megabytes=22.6,
    ),
}
"""Every format by its name."""

if TYPE_CHECKING:
    TwinFormat = str
else:
    TwinFormat = Literal[tuple(FORMATS)]
TWIN_FORMATS: tuple[TwinFormat, ...] = tuple(FORMATS)

TOLERANCE = 0.005
"""Chord error of curved surfaces and lines that isn't asked for otherwise, m."""

_Writer = Callable[..., Trace]
"""Parameters, path and tolerance (m) -> what became of everything; a format's own settings are handed to it by name."""

IfcPlacement = Literal["linear", "local"]


class IfcSettings(ClosedModel):
    """Settings of the IFC export: how objects are placed."""

    placement: IfcPlacement = Field(
        "linear",
        title="Placement",
        description="Placement of objects: along the alignment, or by coordinates for viewers without alignments.",
    )


def twin_file_names(formats: Iterable[str]) -> tuple[str, ...]:
    """Return the names of all files that formats are written to: for each the model, then its JSON report.

    Raises:
        InputError: a format is unknown.
    """
    return tuple(file for name in formats for file in (FORMATS[known_format(name)].file, report_file_name(name)))


def report_file_name(name: str) -> str:
    """Return the file name of a format's JSON report: what the model lacks, and where each instance is in it."""
    return f"twin-{name}-report.json"


def known_format(name: str) -> TwinFormat:
    """Return a format's name unchanged, or raise an InputError that suggests the nearest known name.

    Raises:
        InputError: no format has this name; the nearest name is suggested.
    """
    for format_name in TWIN_FORMATS:
        if name == format_name:
            return format_name
    raise InputError("twin", name, f"must be one of {', '.join(TWIN_FORMATS)}{nearest_name(name, TWIN_FORMATS)}")


def missing_package(name: str) -> str | None:
    """Return the optional Python package that a format needs and that isn't installed, or None.

    Raises:
        InputError: the format is unknown.
    """
    package = FORMATS[known_format(name)].package
    return package if package and importlib.util.find_spec(package) is None else None


def check_formats(formats: Iterable[str]) -> None:
    """Raise an InputError if one of the formats is unknown or the Python package that it needs isn't installed.

    Raises:
        InputError: a format is unknown, or its package isn't installed.
    """
    for name in formats:
        if package := missing_package(name):
            raise MissingPackageError("twin", name, package, "twin")


@linear_algebra_on_one_thread()
def write_twin(
    parameters: RoadParameters,
    folder: Path,
    formats: Sequence[str],
    tolerance: float = TOLERANCE,
    ifc: IfcSettings | None = None,
    local_projection: bool = False,
    progress: Progress = silent,
) -> None:
    """Write a road's geometric-semantic model into a folder: for each format the model file and a JSON report.

    Args:
        parameters: the road.
        folder: where the files go; it must be there.
        formats: of `TWIN_FORMATS`.
        tolerance: largest chord error (m) of curved surfaces and lines; their vertices are exact.
        ifc: settings of the format ``ifc``; the usual ones if None.
        local_projection: whether the format ``opendrive`` has a projection about the site in place of an offset.
        progress: receives the format's name and the share of the work that is done.

    Raises:
        InputError: a format is unknown or its package isn't installed, or the format can't hold this road.

    Example:
        >>> from pathlib import Path
        >>> from synthroads_addon import sample_road
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> write_twin(sample_road(RoadScenario(length=50.0), seed=7), Path(), ["opendrive", "geojson"])
        >>> sorted(path.name for path in Path().iterdir())
        ['twin-geojson-report.json', 'twin-opendrive-report.json', 'twin.geojson', 'twin.xodr']
    """
    check_formats(formats)
    # Progress is the share of the seconds that the formats usually take.
    total = sum(FORMATS[name].seconds for name in formats)
    seconds_before = 0.0
    for name in formats:
        entry = FORMATS[name]
        seconds_after = seconds_before + entry.seconds
        progress(entry.label, seconds_before / total)
        settings: dict[str, Any] = {}
        if name == "ifc":
            settings = (ifc or IfcSettings()).to_dict() | {
                "progress": part_of(progress, seconds_before / total, seconds_after / total)
            }
        elif name == "opendrive":
            settings = {"local_projection": local_projection}
        writer: _Writer = getattr(import_module(entry.module, __package__), f"write_{name}")
        trace = writer(parameters, folder / entry.file, tolerance, **settings)
        trace.write(folder / report_file_name(name), name, entry.file)
        seconds_before = seconds_after
