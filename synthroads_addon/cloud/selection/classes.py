"""The points of a class in a real cloud: by the cloud's labels, or by where they lie beside an axis."""

from dataclasses import dataclass, field
from pathlib import Path

import laspy
import numpy as np

from ...base.arrays import AnyArray, Bool, Float, Index, Int, UInt8
from ...base.classes import ClassScheme
from ...base.errors import InputError, nearest_name
from ...base.maps.places import Placement
from ..flags import without_flags
from ..formats.registry import open_cloud
from ..points import concatenate

FEWEST = 200
"""Points that a class must have for its quantiles to mean anything."""


@dataclass(frozen=True)
class RealCloud:
    """N points of a measured cloud with what the calibration needs; (N,) arrays.

    Attributes:
        xyz: (N, 3) map coordinates, m.
        intensity: as stored in the file.
        label: numbers that tell the classes apart.
        scheme: what the numbers mean; None for an attribute of the file's own.
        distance, incidence: m and rad; NaN where the file doesn't say.
        returns: how many returns the pulse of each has.
        time: GPS time, s; None where all have the same, as where none is known.
        place: the coordinate system.
    """

    xyz: Float
    intensity: Float
    label: Int
    scheme: ClassScheme | None
    distance: Float
    incidence: Float
    returns: UInt8
    time: Float | None = None
    place: Placement = field(default_factory=Placement)


@dataclass(frozen=True)
class RealClass:
    """N points of one class of a measured cloud, all with an intensity above 0.

    Attributes:
        selection: how they are told from the others, in words.
        place: (N, 3) map coordinates, m.
        intensity: (N,) as stored, above 0.
        zeros: how many more there are whose intensity is 0: left out.
        distance, incidence: (N,) m and rad; NaN where unknown.
        returns: (N,) how many returns the pulse of each has.
        time: (N,) GPS time, s; None where unknown.
        beside: (M, 2) plan places of the surface's other points around these, m; None where not looked for.
    """

    selection: str
    place: Float
    intensity: Float
    zeros: int
    distance: Float
    incidence: Float
    returns: UInt8
    time: Float | None = None
    beside: Float | None = None


def read_real_cloud(path: Path, attribute: str | None = None, field: str = "--class-field") -> RealCloud:
    """Read a measured cloud's points, withheld ones and noise left out, with class labels.

    Args:
        path: of any format that is read here.
        attribute: extra attribute of a LAS or LAZ file that holds the labels; ``class_id`` if None.
        field: what names the attribute, for errors.

    Raises:
        InputError: the file can't be read, has no points, or lacks the attribute.
    """
    with open_cloud(path) as cloud:
        header = cloud.header
        blocks, masks = [], []
        for block in cloud.blocks():
            masks.append(cloud.usable_points(block, noise=attribute is not None))
            blocks.append(without_flags(block.select(masks[-1])))
    if not sum(map(len, blocks)):
        raise InputError(str(path), 0, "has no points")
    points = concatenate(blocks)
    label = points.class_id.astype(np.int64)
    if attribute is not None:
        label = _attribute(path, attribute, field)[np.concatenate(masks)]
    return RealCloud(
        xyz=points.xyz,
        intensity=points.intensity * (header.intensity_scale or 1.0),
        label=label,
        scheme=header.scheme if attribute is None else None,
        distance=points.range,
        incidence=np.deg2rad(points.incidence_deg.astype(np.float64)),
        returns=points.number_of_returns,
        time=points.gps_time if len(points) and np.ptp(points.gps_time) > 0.0 else None,
        place=header.place,
    )


def _attribute(path: Path, name: str, field: str) -> Int:
    """Return a named attribute (N,) of a LAS or LAZ file as integers."""
    if path.suffix.lower() not in (".las", ".laz"):
        raise InputError(field, name, f"needs a LAS or LAZ file, not {path.name}")
    with laspy.open(path, read_evlrs=False) as file:
        names = list(file.header.point_format.dimension_names)
        if name not in names:
            raise InputError(field, name, f"must be one of {', '.join(names)}{nearest_name(name, names)}")
        return np.asarray(file.read_points(file.header.point_count)[name]).astype(np.int64)


def class_by_label(cloud: RealCloud, code: str, field: str) -> RealClass:
    """Return the points of a measured cloud's class, given by its number or its name.

    Args:
        cloud: with its labels.
        code: number or name.
        field: what names the class, for errors.

    Raises:
        InputError: there is no such class, or fewer than `FEWEST` of its points have an intensity.
    """
    number, name = _number(cloud, code, field)
    return select_class(cloud, np.flatnonzero(cloud.label == number), f"labelled {name} in the file", field)


def _number(cloud: RealCloud, code: str, field: str) -> tuple[int, str]:
    """Return the number of a class, given by its number or name, and how it is called in messages.

    Raises:
        InputError: no point of the cloud has it.
    """
    present_numbers = {int(value) for value in np.unique(cloud.label)}
    if code.lstrip("-").isdigit():
        number = int(code)
        if number not in present_numbers:
            values_text = ", ".join(str(value) for value in sorted(present_numbers)[:40])
            raise InputError(field, number, f"no point has it; the file has {values_text}")
        return number, str(number)
    names = {row.name: row.id for row in cloud.scheme.rows} if cloud.scheme else {}
    present_names = {name: row for name, row in names.items() if row in present_numbers}
    if code not in present_names:
        values_text = (
            f"one of {', '.join(sorted(present_names))}" if present_names else "a number: the attribute has no names"
        )
        raise InputError(field, code, f"must be {values_text}{nearest_name(code, present_names)}")
    return present_names[code], f"{code} ({present_names[code]})"


def select_class(cloud: RealCloud, indices: Index, selection: str, field: str) -> RealClass:
    """Return the points at these indices as a class; those of intensity 0 are only counted.

    Args:
        cloud: that they are of.
        indices: (N,) their indices.
        selection: in words, how they were chosen.
        field: what asks for them, for errors.

    Raises:
        InputError: fewer than `FEWEST` have an intensity.
    """
    bright_indices = indices[cloud.intensity[indices] > 0.0]
    if len(bright_indices) < FEWEST:
        raise InputError(
            field, selection, f"{len(bright_indices)} points have an intensity, at least {FEWEST} are needed"
        )
    return RealClass(
        selection=selection,
        place=cloud.xyz[bright_indices],
        intensity=cloud.intensity[bright_indices],
        zeros=len(indices) - len(bright_indices),
        distance=cloud.distance[bright_indices],
        incidence=cloud.incidence[bright_indices],
        returns=cloud.returns[bright_indices],
        time=None if cloud.time is None else cloud.time[bright_indices],
    )


def ranges_and_incidences(real: RealClass, scanner: Float) -> tuple[Float, Float]:
    """Return ranges (N,), m, and incidence angles (N,), rad, of a class's points to a scanner at one place.

    The surface's normal is that of the plane through the points of each square of `_CELL`; where those are few or in
    line, it is upright.

    Args:
        real: the points.
        scanner: (3,) map coordinates, m.
    """
    towards = np.asarray(scanner, dtype=np.float64) - real.place
    distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-6)
    cosine = np.abs(np.einsum("ij,ij->i", _normals(real.place), towards)) / distance
    return distance, np.arccos(np.minimum(cosine, 1.0))


_CELL = 3.0
"""m."""


def _normals(place: Float) -> Float:
    """Return unit normals (N, 3) of points (N, 3) on ground-like surfaces: those of a plane fitted in each square cell.

    Where a cell has few points, or points in line, the normal is upright.
    """
    cell = np.floor(place[:, :2] / _CELL).astype(np.int64)
    _, owner, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    owner = owner.ravel()

    def mean(values: AnyArray) -> Float:
        """Return the mean (C,) of values (N,) in each cell."""
        return np.asarray(np.bincount(owner, values) / count)

    # Least squares of z = slope_x x + slope_y y about each cell's mean, by Cramer's rule.
    x, y, z = (place[:, i] - mean(place[:, i])[owner] for i in range(3))
    xx, xy, yy, xz, yz = mean(x * x), mean(x * y), mean(y * y), mean(x * z), mean(y * z)
    determinant = xx * yy - xy * xy
    is_upright: Bool = (count < 12) | (determinant < 1e-2 * np.maximum(xx, yy) ** 2)
    determinant[is_upright] = np.inf
    slope_x, slope_y = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    normal = np.stack([-slope_x, -slope_y, np.ones(len(count))], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return np.asarray(normal[owner])
