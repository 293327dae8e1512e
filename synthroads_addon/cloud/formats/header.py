"""`CloudHeader`: what a cloud's file says of itself, its coordinate system and the notes of our own files included."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Float
from ...base.classes import ClassScheme, asprs_scheme, stored_scheme
from ...base.errors import InputError
from ...base.maps.crs import MapSystem, UnknownSystemError
from ...base.maps.places import Placement
from ..layers import LAYERS, Attribute, Column, attributes_of, columns

_LARGEST_SCALE = 1e300


@dataclass(frozen=True)
class CloudHeader:
    """Metadata of a cloud's file, from its header.

    Attributes:
        path: the file.
        kind: ``LAS 1.4, point format 7, LAZ`` and the like.
        count: number of points.
        offset: (3,) map coordinates near the points, m.
        place: the coordinate system, and what the file's own coordinates are multiplied by.
        intensity_scale: 16-bit steps per unit of `PointBlock.intensity`; None if the file doesn't say, whose
            intensities are then as they stand.
        scheme: the classes that ``class_id`` counts.
        labelled: whether the file has the project's ``class_id``; else ``class_id`` holds LAS codes.
        attributes: what the file holds of each point, of those known here.
        has_color: whether it holds colours.
        predicted: the classes that the blocks' `PREDICTED` counts; None if the file has no predicted classes.
        left_out: names of what it holds beyond that, which isn't read.
        standard_time: whether ``gps_time`` counts from the epoch of GPS, less 1e9 s.
    """

    path: Path
    kind: str
    count: int
    offset: Float
    place: Placement = field(default_factory=Placement)
    intensity_scale: float | None = None
    scheme: ClassScheme = field(default_factory=lambda: asprs_scheme(range(256)))
    labelled: bool = False
    attributes: tuple[Attribute, ...] = ()
    has_color: bool = False
    predicted: ClassScheme | None = None
    left_out: tuple[str, ...] = ()
    standard_time: bool = False

    @property
    def class_field(self) -> str:
        """Return the name of the file's field that ``class_id`` is read from."""
        return "class_id" if self.labelled else "classification"

    @property
    def system(self) -> MapSystem | None:
        """Return the system, in metres, that points are read in; None if the file names none."""
        return self.place.system

    @property
    def epsg(self) -> int | None:
        """Return the EPSG code of the horizontal system, None if it isn't named or has none."""
        return self.place.epsg

    @property
    def height_epsg(self) -> int | None:
        """Return the EPSG code of the vertical system, None if it isn't named or has none."""
        return self.place.height_epsg

    @property
    def crs_text(self) -> str | None:
        """Return the coordinate system as WKT, to be written with the points; None if the file names none."""
        return self.system.to_wkt() if self.system else None


def placed(path: Path, declared: MapSystem | None, notes: Sequence[str] = ()) -> Placement:
    """Return the placement of a cloud by the system that its file declares, with notes for the user.

    Args:
        path: the file.
        declared: the system; None if the file declares none.
        notes: remarks on it so far; those on units are added.

    Raises:
        InputError: its coordinates are degrees.
    """
    if declared is None:
        return Placement(notes=tuple(notes))
    if declared.unit is None:
        requirement = "its coordinates are degrees: metres or feet of a projected system are needed"
        raise InputError(f"{path}: coordinate system", declared.label, requirement)
    if declared.in_metres:
        return Placement(declared, declared, tuple(notes))
    system, units = declared.metric(), declared.scale
    note = f"it is in {declared.label}, a unit of which is {units[0]:.9g} m: it is read in metres, in {system.label}"
    if units[0] == 1.0:
        note = f"its heights are in units of {units[2]:.9g} m: they are read in metres"
    elif declared.height_unit is None:
        note += "; it names no unit of heights: the same unit is assumed"
    elif units[2] != units[0]:
        note += f"; a unit of its heights is {units[2]:.9g} m"
    return Placement(system, declared, (*notes, note))


def system_of_text(text: str | None) -> tuple[MapSystem | None, list[str]]:
    """Return the system that a file's text names, and remarks for the user; None without text, or if it names none.

    Raises:
        InputError: the system isn't one of a map.
    """
    if not text or not text.strip("\0 \r\n\t"):
        return None, []
    try:
        return MapSystem.read(text), []
    except UnknownSystemError:
        text_beginning = " ".join(text.split())[:60]
        return None, [f"its coordinate system can't be read ({text_beginning}): it is ignored, coordinates are metres"]


def header_from_notes(
    path: Path,
    kind: str,
    count: int,
    stored_names: set[str],
    notes: Any,
    *,
    name_of: Callable[[Column], str],
    usual: set[str],
    has_color: bool,
) -> CloudHeader:
    """Return the header of a PLY, E57 or NPZ file from the names of its columns and its notes.

    Args:
        path: the file.
        kind: of file.
        count: number of points.
        stored_names: names of what is stored of each point.
        notes: `CloudWriter.placed_notes`; None for a file of others.
        name_of: what the format calls a column.
        usual: names of what is read in any case.
        has_color: whether there are colours.

    Raises:
        InputError: the notes are damaged.
    """
    names = {column.name for layer in LAYERS.values() for column in layer.columns if name_of(column) in stored_names}
    attributes = attributes_of(names)
    left_out = tuple(sorted(stored_names - usual - {name_of(column) for column in columns(attributes)}))
    header = CloudHeader(path, kind, count, np.zeros(3), attributes=attributes, has_color=has_color, left_out=left_out)
    if not isinstance(notes, dict):
        return header
    text = notes.get("crs")
    try:
        offset = np.array(notes["offset"], dtype=np.float64).reshape(3)
    except (KeyError, TypeError, ValueError, OverflowError):
        offset = np.full(3, np.nan)
    if not np.isfinite(offset).all() or not isinstance(text, str | None):
        raise InputError(str(path), None, "its data on offset and coordinate system are damaged")
    place = placed(path, *system_of_text(text))
    return replace(
        header,
        offset=place.in_metres(offset),
        place=place,
        intensity_scale=intensity_scale(path, notes),
        scheme=stored_scheme(notes.get("classes"), str(path)),
        labelled=True,
        standard_time=notes.get("standard_time") is True,
    )


def intensity_scale(path: Path, notes: dict[str, Any]) -> float:
    """Return the 16-bit steps per unit of intensity that a file's notes give.

    Raises:
        InputError: they tell none, or it is no finite number above 0.
    """
    scale = notes.get("intensity_scale")
    if not isinstance(scale, int | float) or not 0.0 < scale <= _LARGEST_SCALE:
        raise InputError(f"{path}: intensity_scale", scale, "must be a finite number above 0")
    return float(scale)
