"""Clouds to be compared: files, folders of them, or lists that say where each cloud's classes are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial import cKDTree

from ..base.errors import InputError, nearest_name
from ..base.schema import ClosedModel, Finite, quantity, read_yaml
from ..cloud.formats.registry import ENDINGS
from ..cloud.selection.classes import RealClass, RealCloud, class_by_label, read_real_cloud
from ..cloud.selection.patches import with_points_beside
from ..cloud.selection.pavement import CLEAR, RoadClasses, road_classes

LISTS = (".yaml", ".yml", ".json")
"""Endings of lists of clouds."""
ROAD = "road"
"""Name of the class that every cloud must have."""
CLASSES = (ROAD, "marking", "vegetation")
"""Classes that are compared; the first is needed."""
_Azimuth = Annotated[float, Field(ge=-180.0, le=180.0)]


class ListedCloud(ClosedModel):
    """A cloud of a list, and what tells its classes: labels, or offsets from an axis for a cloud without labels."""

    cloud: str = Field(min_length=1, description="File, from the list's folder.")
    class_field: str | None = Field(None, description="Extra attribute of a LAS file that holds the classes.")
    road: str = Field("road", description="Class of the pavement, by number or name.")
    marking: str | None = Field(None, description="Class of the markings.")
    vegetation: str | None = Field(None, description="Class of the vegetation.")
    axis: str | None = Field(None, description="Axis of the road (CSV or GeoJSON), which tells pavement and markings.")
    paved: tuple[tuple[Finite, Finite], ...] = Field((), description="Offsets between which there is pavement, m.")
    lines: tuple[Finite, ...] = Field((), description="Offsets of the markings' middles, m.")
    line_width: float = quantity(0.15, "m", "Width of the markings.", (0.05, 1.0))
    decibels: float | None = quantity(None, "dB", "The 16 bits of the intensity span this; they are linear.", (1, 200))
    scanner: tuple[Finite, Finite, Finite] | None = Field(None, description="Where all was seen from, map, m.")
    azimuth_deg: tuple[_Azimuth, _Azimuth] | None = Field(
        None,
        description="Azimuths about the scanner, from the x axis to the left, between which points count, deg; all if "
        "not given. The second may be the smaller one: then those around 180 count.",
    )

    @model_validator(mode="after")
    def _offsets_need_an_axis(self) -> ListedCloud:
        """Refuse an axis without offsets of pavement, and offsets without an axis."""
        if (self.axis is None) != (not self.paved):
            raise ValueError("axis and paved locate the pavement together: one of the two is missing")
        return self

    @model_validator(mode="after")
    def _azimuths_need_a_scanner(self) -> ListedCloud:
        """Refuse azimuths without the scanner's place that they are counted around."""
        if self.azimuth_deg is not None and self.scanner is None:
            raise ValueError("azimuth_deg needs scanner, about which it is counted")
        return self


class UnlistedCloud(ListedCloud):
    """A cloud given without a list: those of the usual classes that it has are compared."""

    marking: str | None = "road_marking"
    vegetation: str | None = "vegetation"


class CloudList(ClosedModel):
    """List of clouds that are compared as one kind, synthetic or real."""

    type: Literal["CloudList"] = "CloudList"
    version: Literal["1.0"] = "1.0"
    clouds: tuple[ListedCloud, ...] = Field(min_length=1, max_length=1000, description="The clouds.")


@dataclass(frozen=True)
class ComparedCloud:
    """A cloud's points of the classes that are compared.

    Attributes:
        name: name of the file.
        classes: points with linear intensities by class name (`CLASSES`); ``road`` is always there.
    """

    name: str
    classes: dict[str, RealClass]


def find_clouds(path: Path) -> list[tuple[Path, ListedCloud]]:
    """Return (file, row of the list) of each cloud that a path stands for: a file, a folder or a list.

    Raises:
        InputError: the path holds no cloud, or a list is wrong.
    """
    if path.suffix.lower() in LISTS:
        rows = CloudList.from_dict(read_yaml(path), str(path)).clouds
        return [(path.parent / row.cloud, row) for row in rows]
    files = sorted(file for file in path.rglob("*") if file.suffix.lower() in ENDINGS) if path.is_dir() else [path]
    if not files:
        raise InputError(str(path), None, f"holds no cloud ({', '.join(ENDINGS)})")
    # A name that isn't in UTF-8 is shown with its bytes' numbers.
    return [(file, UnlistedCloud(cloud=file.name.encode("utf-8", "backslashreplace").decode())) for file in files]


def read_compared(path: Path, row: ListedCloud) -> ComparedCloud:
    """Read a cloud file and return its points of the compared classes, with linear intensities.

    Raises:
        InputError: the file can't be read, has too few points of the road, or a list names a class that it has none of.
    """
    whole_cloud = read_real_cloud(path, row.class_field, f"{path.name}: class_field")
    cloud = between_azimuths(whole_cloud, row)
    if row.axis is not None:
        axis_classes = road_classes(
            cloud, RoadClasses(path.parent / row.axis, row.paved, row.lines, row.line_width), f"{path.name}: "
        )
        classes = {ROAD: axis_classes["paved"]} | ({"marking": axis_classes["line"]} if "line" in axis_classes else {})
    else:
        classes = {ROAD: _road(cloud, row, path.name)}
        classes |= _other_classes(cloud, row, path.name)
        if "marking" in classes:
            classes[ROAD] = _clear_of(classes[ROAD], classes["marking"])
    classes[ROAD] = with_points_beside(whole_cloud, classes[ROAD])
    return ComparedCloud(name_of(path, row), {name: _with_view(points, row) for name, points in classes.items()})


def name_of(path: Path, row: ListedCloud) -> str:
    """Return the name of a listed cloud: its file's, with the azimuths between which its points count."""
    if row.azimuth_deg is None:
        return path.stem
    return "{} ({:g} to {:g} deg)".format(path.stem, *row.azimuth_deg)


def between_azimuths(cloud: RealCloud, row: ListedCloud) -> RealCloud:
    """Return the points of a cloud that lie between a row's azimuths about the scanner; all without azimuths."""
    if row.azimuth_deg is None or row.scanner is None:
        return cloud
    east, north, _ = (cloud.xyz - np.asarray(row.scanner)).T
    first_azimuth, last_azimuth = row.azimuth_deg
    azimuth = np.rad2deg(np.arctan2(north, east))
    in_sector = (
        (azimuth >= first_azimuth) & (azimuth <= last_azimuth)
        if first_azimuth <= last_azimuth
        else (azimuth >= first_azimuth) | (azimuth <= last_azimuth)
    )
    arrays = {name: value for name, value in vars(cloud).items() if isinstance(value, np.ndarray)}
    return replace(cloud, **{name: value[in_sector] for name, value in arrays.items()})


def _clear_of(road: RealClass, marking: RealClass) -> RealClass:
    """Return the pavement's points at least `CLEAR` away from every marking, as `road_classes` leaves them.

    A marking leaves a gap in the pavement's points that says nothing about the scanner.
    """
    marking_distance = cKDTree(marking.place[:, :2]).query(road.place[:, :2], distance_upper_bound=CLEAR)[0]
    is_clear = ~np.isfinite(marking_distance)
    names = ("place", "intensity", "distance", "incidence", "returns")
    time = None if road.time is None else road.time[is_clear]
    return replace(road, time=time, **{name: getattr(road, name)[is_clear] for name in names})


def _road(cloud: RealCloud, row: ListedCloud, file: str) -> RealClass:
    """Return the pavement's points; an error says how another class can be named for a cloud without a list."""
    try:
        return class_by_label(cloud, row.road, f"{file}: {ROAD}")
    except InputError as error:
        if isinstance(row, UnlistedCloud):
            remedy = "; name a list of clouds (.yaml) instead, which says which class is the pavement, or where it is"
            raise InputError(error.field, error.value, f"{error.allowed}{remedy}") from None
        raise


def _other_classes(cloud: RealCloud, row: ListedCloud, file: str) -> dict[str, RealClass]:
    """Return the points of the marking and vegetation classes that the cloud has enough of, by class name."""
    classes = {}
    for name in CLASSES[1:]:
        code = getattr(row, name)
        if code is not None:
            if not isinstance(row, UnlistedCloud):
                _check_class(cloud, code, f"{file}: {name}")
            try:
                classes[name] = class_by_label(cloud, code, f"{file}: {name}")
            except InputError:  # a cloud may well have none of them
                continue
    return classes


def _check_class(cloud: RealCloud, code: str, field: str) -> None:
    """Raise InputError for the name of a class that a cloud's scheme doesn't have."""
    if code.lstrip("-").isdigit():
        return
    names = [row.name for row in cloud.scheme.rows] if cloud.scheme else []
    if code not in names:
        valid_names = f"one of {', '.join(names)}" if names else "a number: the attribute has no names"
        raise InputError(field, code, f"must be {valid_names}{nearest_name(code, names)}")


def _with_view(points: RealClass, row: ListedCloud) -> RealClass:
    """Return a class's points with intensities made linear, and ranges, m, computed if the scanner's place is given."""
    intensity, distance = points.intensity, points.distance
    if row.decibels is not None:
        intensity = 10.0 ** (intensity / 65535.0 * row.decibels / 10.0)
    if row.scanner is not None:
        distance = np.linalg.norm(points.place - np.asarray(row.scanner), axis=1)
    return replace(points, intensity=intensity, distance=distance)
