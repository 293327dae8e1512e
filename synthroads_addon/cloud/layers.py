"""What a cloud's files can hold of each point, beyond what they always hold: one table for every format."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from .points import PointBlock

Attribute = Literal[
    "range",
    "incidence",
    "normal",
    "roughness",
    "metallic",
    "specular",
    "noise_free",
    "material",
    "scanner",
    "color_source",
]
ATTRIBUTES: tuple[Attribute, ...] = get_args(Attribute)
DEFAULT_ATTRIBUTES: tuple[Attribute, ...] = ("range", "incidence")


@dataclass(frozen=True)
class Column:
    """One number per point, as files name and store it.

    Attributes:
        name: in LAS, PLY and E57.
        array: the `PointBlock` array that it is of.
        component: which column of that array; None if the array has one dimension.
        dtype: type of the stored integers in LAS and E57.
        scale: value of one step; None for whole numbers.
        local: a map coordinate: stored less the file's offset.
        unit: of the value.
        description: in LAS; at most 31 characters.
    """

    name: str
    array: str
    component: int | None
    dtype: str
    scale: float | None
    local: bool
    unit: str
    description: str

    @property
    def whole(self) -> bool:
        """Whether the values are whole numbers."""
        return self.scale is None

    def of(self, block: PointBlock) -> NDArray[Any]:
        """Return the column (N,) of a block; KeyError if the block doesn't have it."""
        array = getattr(block, self.array)
        if array is None:
            raise KeyError(self.array)
        return array if self.component is None else array[:, self.component]


def _scalar(name: str, array: str, dtype: str, scale: float | None, unit: str, description: str) -> tuple[Column, ...]:
    return (Column(name, array, None, dtype, scale, False, unit, description),)


def _vector(names: tuple[str, ...], array: str, dtype: str, scale: float, unit: str, text: str) -> tuple[Column, ...]:
    local = unit == "m"
    return tuple(
        Column(name, array, i, dtype, scale, local, unit, f"{text} {'xyz'[i]}") for i, name in enumerate(names)
    )


LABELS: tuple[Column, ...] = (
    *_scalar("class_id", "class_id", "uint8", None, "1", "class, see VLR SynthRoads 1"),
    *_scalar("instance_id", "instance_id", "uint32", None, "1", "object's instance number"),
)
"""Columns that every file has, though LAS has no field for them."""

COLUMNS: dict[Attribute, tuple[Column, ...]] = {
    "range": _scalar("range", "range", "uint32", 1e-4, "m", "measured range, m"),
    "incidence": _scalar("incidence", "incidence_deg", "uint16", 0.01, "deg", "incidence angle, deg"),
    "normal": _vector(("NormalX", "NormalY", "NormalZ"), "normal", "int16", 1e-4, "1", "unit normal"),
    "roughness": _scalar("roughness", "roughness", "uint16", 1e-4, "1", "material roughness, 0 to 1"),
    "metallic": _scalar("metallic", "metallic", "uint16", 1e-4, "1", "material metallic, 0 to 1"),
    "specular": _scalar("specular", "specular", "uint16", 1e-4, "1", "material specular, 0 to 1"),
    "noise_free": (
        *_scalar("true_range", "true_range", "uint32", 1e-4, "m", "range without noise, m"),
        *_vector(("true_x", "true_y", "true_z"), "true_xyz", "int32", 1e-4, "m", "position without noise, m,"),
    ),
    "material": _scalar("material", "material", "uint16", None, "1", "index of the material"),
    "scanner": _vector(("scanner_x", "scanner_y", "scanner_z"), "scanner", "int32", 1e-3, "m", "pulse's origin, m,"),
    "color_source": _scalar("color_source", "color_source", "uint8", None, "1", "image that gave the colour"),
}
"""Columns of each attribute. The names of the normal's are those that PDAL and CloudCompare look for."""


def needs(attribute: Attribute) -> frozenset[str]:
    """Return the names of the `PointBlock` arrays that an attribute is made of."""
    return frozenset(column.array for column in COLUMNS[attribute])


def columns(attributes: tuple[Attribute, ...]) -> tuple[Column, ...]:
    """Return the columns that a file with these attributes has beyond the fields of LAS, in their order."""
    return LABELS + tuple(column for name in ATTRIBUTES if name in attributes for column in COLUMNS[name])


def attributes_of(names: set[str]) -> tuple[Attribute, ...]:
    """Return the attributes all of whose columns are among a file's names."""
    return tuple(name for name in ATTRIBUTES if {column.name for column in COLUMNS[name]} <= names)


def gather(values: dict[str, NDArray[Any]], attributes: tuple[Attribute, ...], count: int) -> dict[str, NDArray[Any]]:
    """Return `PointBlock` arrays from columns (N,) by name; a vector's columns are put together.

    Arrays that a block always has and the file hasn't are NaN, or 0 where they are whole numbers.
    """
    arrays: dict[str, NDArray[Any]] = {
        "range": np.full(count, np.nan),
        "incidence_deg": np.full(count, np.nan, dtype=np.float32),
        "class_id": np.zeros(count, dtype=np.uint8),
        "instance_id": np.zeros(count, dtype=np.uint32),
    }
    parts: dict[str, list[NDArray[Any]]] = {}
    for column in columns(attributes):
        if column.name in values:
            parts.setdefault(column.array, []).append(values[column.name])
    for array, found in parts.items():
        joined = found[0] if len(found) == 1 else np.stack(found, axis=1)
        arrays[array] = joined.astype(_TYPES.get(array, np.float64), copy=False)
    return arrays


_TYPES: dict[str, Any] = {
    "incidence_deg": np.float32,
    "normal": np.float32,
    "roughness": np.float32,
    "metallic": np.float32,
    "specular": np.float32,
    "material": np.uint16,
    "color_source": np.uint8,
    "class_id": np.uint8,
    "instance_id": np.uint32,
}
"""Types of `PointBlock` arrays that aren't float64."""
