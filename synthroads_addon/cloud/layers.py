"""THE table of per-point layers: what a cloud's files can hold of each point beyond what they always hold.

A layer is a row of `LAYERS`. All else follows from it: what a scenario may ask for, which arrays the scan fills, the
columns of all formats, and the labels in the panel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..base.arrays import AnyArray
from .flags import FLAGS
from .points import FIELDS, POINT_TYPES, PointBlock, make_block


@dataclass(frozen=True)
class Column:
    """One number per point: its name in files, how it is stored, and the `PointBlock` array it comes from.

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
        """Return whether the column holds whole numbers, which are stored without a scale."""
        return self.scale is None

    def values(self, block: PointBlock) -> AnyArray:
        """Return the column's values (N,) in a block; KeyError if the block lacks their array."""
        array = block.array(self.array)
        if array is None:
            raise KeyError(self.array)
        return array if self.component is None else array[:, self.component]


def _scalar(name: str, array: str, dtype: str, scale: float | None, unit: str, description: str) -> tuple[Column, ...]:
    """Return, in a tuple, the one column of an array of one dimension; see `Column`."""
    return (Column(name, array, None, dtype, scale, False, unit, description),)


def _vector(names: tuple[str, ...], array: str, dtype: str, scale: float, unit: str, text: str) -> tuple[Column, ...]:
    """Return the three columns of an array (N, 3), of map coordinates where the unit is m; see `Column`."""
    local = unit == "m"
    return tuple(
        Column(name, array, i, dtype, scale, local, unit, f"{text} {'xyz'[i]}") for i, name in enumerate(names)
    )


PREDICTED = "predicted_class"
"""Column of LAS files, and array of blocks, with the class that a model gave each point; no scan fills it."""

LayerFiller = Literal["scan", "material", "colour"]
"""Who fills a layer: the scan (`scanning.point_layers`), the materials' layers, or the source of colours."""


@dataclass(frozen=True)
class Layer:
    """An optional per-point layer: its label, its columns in files, and what fills it.

    Attributes:
        label: for people.
        columns: in files, in their order.
        types: of the `PointBlock` arrays that they are of.
        filler: who fills them.
        always: the arrays are there in any case, whether files hold them or not.
    """

    label: str
    columns: tuple[Column, ...]
    types: dict[str, str]
    filler: LayerFiller = "scan"
    always: bool = False


LABELS: tuple[Column, ...] = (
    *_scalar("class_id", "class_id", "uint8", None, "1", "class, see VLR SynthRoads 1"),
    *_scalar("instance_id", "instance_id", "uint32", None, "1", "object's instance number"),
)
"""Columns that every file has, though LAS has no field for them."""


def _material_layer(name: str) -> Layer:
    """Return the layer of a material's property, stored in steps of 1e-4."""
    column = _scalar(name, name, "uint16", 1e-4, "1", f"material {name}, 0 to 1")
    return Layer(name.capitalize(), column, {name: "float32"}, filler="material")


LAYERS: dict[str, Layer] = {
    "range": Layer(
        "Range", _scalar("range", "range", "uint32", 1e-4, "m", "measured range, m"), {"range": "float64"}, always=True
    ),
    "incidence": Layer(
        "Incidence",
        _scalar("incidence", "incidence_deg", "uint16", 0.01, "deg", "incidence angle, deg"),
        {"incidence_deg": "float32"},
        always=True,
    ),
    # These names are those that PDAL and CloudCompare look for.
    "normal": Layer(
        "Normal",
        _vector(("NormalX", "NormalY", "NormalZ"), "normal", "int16", 1e-4, "1", "unit normal"),
        {"normal": "float32"},
    ),
    "roughness": _material_layer("roughness"),
    "metallic": _material_layer("metallic"),
    "specular": _material_layer("specular"),
    "noise_free": Layer(
        "Noise-Free Position",
        (
            *_scalar("true_range", "true_range", "uint32", 1e-4, "m", "range without noise, m"),
            *_vector(("true_x", "true_y", "true_z"), "true_xyz", "int32", 1e-4, "m", "position without noise, m,"),
        ),
        {"true_range": "float64", "true_xyz": "float64"},
    ),
    "material": Layer(
        "Material",
        _scalar("material", "material", "uint16", None, "1", "index of the material"),
        {"material": "uint16"},
    ),
    "damage": Layer(
        "Pavement Damage",
        _scalar("damage", "damage", "uint8", None, "1", "damage of pavement, 0 none"),
        {"damage": "uint8"},
    ),
    "power": Layer(
        "Received Power",
        _scalar("power_db", "power_db", "int16", 0.01, "dB", "received power, dB"),
        {"power_db": "float32"},
    ),
    "channel": Layer(
        "Laser",
        _scalar("channel", "channel", "uint8", None, "1", "number of the laser"),
        {"channel": "uint8"},
    ),
    "scanner": Layer(
        "Scanner",
        _vector(("scanner_x", "scanner_y", "scanner_z"), "scanner", "int32", 1e-3, "m", "pulse's origin, m,"),
        {"scanner": "float64"},
    ),
    "change": Layer(
        "Changes",
        (
            *_scalar("change", "change", "uint8", None, "1", "kind of change, 0 unchanged"),
            *_scalar("change_id", "change_id", "uint16", None, "1", "number of the change, 0 none"),
            *_scalar("change_distance", "change_distance", "int32", 1e-5, "m", "distance to other epoch, m"),
            *_scalar("not_seen_before", "not_seen_before", "uint8", None, "1", "1: hidden from epoch before"),
        ),
        {"change": "uint8", "change_id": "uint16", "change_distance": "float32", "not_seen_before": "uint8"},
    ),
    "road": Layer(
        "Place along Roads",
        (
            *_scalar("station", "station", "int32", 1e-4, "m", "along the axis of its road, m"),
            *_scalar("offset", "offset", "int32", 1e-4, "m", "from that axis, left positive, m"),
            *_scalar("road_id", "road_id", "uint32", None, "1", "instance of its road, 0 none"),
        ),
        {"station": "float64", "offset": "float64", "road_id": "uint32"},
    ),
    "color_source": Layer(
        "Colour Source",
        _scalar("color_source", "color_source", "uint8", None, "1", "image that gave the colour"),
        {"color_source": "uint8"},
        filler="colour",
    ),
}
"""Layers by the name by which a scenario asks for them (`CloudScenario.attributes`)."""

if TYPE_CHECKING:
    Attribute = str
else:
    Attribute = Literal[tuple(LAYERS)]
ATTRIBUTES: tuple[Attribute, ...] = tuple(LAYERS)
DEFAULT_ATTRIBUTES: tuple[Attribute, ...] = tuple(name for name, layer in LAYERS.items() if layer.always)
_TYPES = {"class_id": "uint8", "instance_id": "uint32"} | {
    array: kind for layer in LAYERS.values() for array, kind in layer.types.items()
}
STORED_TYPES: dict[str, str] = (
    {name: kind for name, (kind, _) in POINT_TYPES.items()}
    | {column.name: _TYPES[column.array] for layer in LAYERS.values() for column in layer.columns}
    | _TYPES
    | dict.fromkeys(FLAGS, "uint8")
)
"""Types of arrays and of columns by their names."""


def optional_arrays(*fillers: LayerFiller) -> frozenset[str]:
    """Return the names of the arrays that a block may lack: of all layers, or of those that one of these fills."""
    rows = (layer for layer in LAYERS.values() if not layer.always and (not fillers or layer.filler in fillers))
    return frozenset(array for layer in rows for array in layer.types)


def layer_arrays() -> dict[str, tuple[str, int]]:
    """Return type and number of components of the arrays of all layers, in the order of the block's fields."""
    rows = {array: (kind, layer) for layer in LAYERS.values() for array, kind in layer.types.items()}
    names = [name for name in FIELDS if name in rows] + [name for name in rows if name not in FIELDS]
    return {name: (rows[name][0], sum(column.array == name for column in rows[name][1].columns)) for name in names}


def columns(attributes: tuple[Attribute, ...]) -> tuple[Column, ...]:
    """Return the columns of files with these attributes, beyond LAS's own fields, in the files' order."""
    return LABELS + tuple(column for name in ATTRIBUTES if name in attributes for column in LAYERS[name].columns)


def attributes_of(names: set[str]) -> tuple[Attribute, ...]:
    """Return the attributes of which all columns are among these names of a file's columns."""
    return tuple(name for name in ATTRIBUTES if {column.name for column in LAYERS[name].columns} <= names)


def make_points(stored: dict[str, AnyArray], attributes: tuple[Attribute, ...], count: int) -> PointBlock:
    """Return the block of N points from a file's stored columns and arrays.

    Arrays that a block always has and the file hasn't are 0; range and incidence are NaN.

    Args:
        stored: columns (N,) by name, of which those of a vector are put together, and the arrays of `POINT_TYPES`
            and of `FLAGS`, in any type; the block keeps them where it can.
        attributes: that the file holds.
        count: N.
    """
    arrays: dict[str, AnyArray] = {
        name: np.full(count, np.nan if np.dtype(kind).kind == "f" else 0, dtype=kind)
        for name, kind in _TYPES.items()
        if name not in optional_arrays()
    }
    parts: dict[str, list[AnyArray]] = {}
    for column in columns(attributes):
        if column.name in stored:
            parts.setdefault(column.array, []).append(stored[column.name])
    for array, components in parts.items():
        values = components[0] if len(components) == 1 else np.stack(components, axis=1)
        arrays[array] = values.astype(_TYPES[array], copy=False)
    for name, (kind, width) in POINT_TYPES.items():
        if name not in _TYPES:
            shape = (count, width) if width > 1 else (count,)
            arrays[name] = stored[name].astype(kind, copy=False) if name in stored else np.zeros(shape, dtype=kind)
    arrays |= {name: stored[name].astype(np.uint8, copy=False) for name in FLAGS if name in stored}
    return make_block(**arrays)
