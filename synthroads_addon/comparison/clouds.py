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
    """A cloud, and where its classes are: by labels, or beside an axis for a cloud without."""

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
        if (self.axis is None) != (not self.paved):
            raise ValueError("axis and paved locate the pavement together: one of the two is missing")
        return self

    @model_validator(mode="after")
    def _azimuths_need_a_scanner(self) -> ListedCloud:
        if self.azimuth_deg is not None and self.scanner is None:
            raise ValueError("azimuth_deg needs scanner, about which it is counted")
        return self


class UnlistedCloud(ListedCloud):
    """A cloud without a list: of the usual classes those that it has are compared."""

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
        name: of the file.
        classes: by name of `CLASSES`: its points, with linear intensities; ``road`` is always there.
    """

    name: str
    classes: dict[str, RealClass]


def find_clouds(path: Path) -> list[tuple[Path, ListedCloud]]:
    """Return (file, how its classes are told) of each cloud that a path stands for: a file, a folder or a list.

    Raises:
        InputError: nothing is there, or a list is wrong.
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
    everything = read_real_cloud(path, row.class_field, f"{path.name}: class_field")
    cloud = between_azimuths(everything, row)
    if row.axis is not None:
        beside = road_classes(
            cloud, RoadClasses(path.parent / row.axis, row.paved, row.lines, row.line_width), f"{path.name}: "
        )
        classes = {ROAD: beside["paved"]} | ({"marking": beside["line"]} if "line" in beside else {})
    else:
        classes = {ROAD: _road(cloud, row, path.name)}
        classes |= _other_classes(cloud, row, path.name)
        if "marking" in classes:
            classes[ROAD] = _clear_of(classes[ROAD], classes["marking"])
    classes[ROAD] = with_points_beside(everything, classes[ROAD])
    return ComparedCloud(name_of(path, row), {name: _with_view(points, row) for name, points in classes.items()})


def name_of(path: Path, row: ListedCloud) -> str:
    """Return the name of a listed cloud: its file's, and which part of it counts."""
    if row.azimuth_deg is None:
        return path.stem
    return "{} ({:g} to {:g} deg)".format(path.stem, *row.azimuth_deg)


def between_azimuths(cloud: RealCloud, row: ListedCloud) -> RealCloud:
    """Return the points of a cloud that lie between a row's azimuths about the scanner; all without azimuths."""
    if row.azimuth_deg is None or row.scanner is None:
        return cloud
    east, north, _ = (cloud.xyz - np.asarray(row.scanner)).T
    low, high = row.azimuth_deg
    azimuth = np.rad2deg(np.arctan2(north, east))
    inside = (azimuth >= low) & (azimuth <= high) if low <= high else (azimuth >= low) | (azimuth <= high)
    arrays = {name: value for name, value in vars(cloud).items() if isinstance(value, np.ndarray)}
    return replace(cloud, **{name: value[inside] for name, value in arrays.items()})


def _clear_of(road: RealClass, marking: RealClass) -> RealClass:
    """Return the pavement's points that are `CLEAR` of every marking, as those told beside an axis are.

    Where a marking was taken out the pavement has a gap, which says nothing about the scanner.
    """
    nearest = cKDTree(marking.place[:, :2]).query(road.place[:, :2], distance_upper_bound=CLEAR)[0]
    kept = ~np.isfinite(nearest)
    names = ("place", "intensity", "distance", "incidence", "returns")
    time = None if road.time is None else road.time[kept]
    return replace(road, time=time, **{name: getattr(road, name)[kept] for name in names})


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
    """Return the marking and vegetation points, by class, as far as the cloud has enough of them."""
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
    """Refuse the name of a class that a cloud's scheme doesn't have."""
    if code.lstrip("-").isdigit():
        return
    names = [row.name for row in cloud.scheme.rows] if cloud.scheme else []
    if code not in names:
        allowed = f"one of {', '.join(names)}" if names else "a number: the attribute has no names"
        raise InputError(field, code, f"must be {allowed}{nearest_name(code, names)}")


def _with_view(points: RealClass, row: ListedCloud) -> RealClass:
    """Return a class's points with intensities made linear, and ranges, m, computed if the scanner's place is given."""
    intensity, distance = points.intensity, points.distance
    if row.decibels is not None:
        intensity = 10.0 ** (intensity / 65535.0 * row.decibels / 10.0)
    if row.scanner is not None:
        distance = np.linalg.norm(points.place - np.asarray(row.scanner), axis=1)
    return replace(points, intensity=intensity, distance=distance)
