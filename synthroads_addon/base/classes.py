"""The classes of points: 17 in full, 5 in short, or a user's own; and their codes in LAS. The tables are data."""

from __future__ import annotations

import colorsys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from .errors import InputError, nearest_name
from .files import PRESETS
from .schema import Model, first_repeated, quantity, read_json

UNLABELLED = 255
"""`class_id` of faces that carry no label."""
UNCLASSIFIED = 1
"""LAS code of what carries no label (ASPRS LAS 1.4 R15, table 17)."""


@dataclass(frozen=True)
class PointClass:
    """One semantic class.

    Attributes:
        id: 0 to 254; the value of the faces' ``class_id`` and of the cloud's ``class_id``.
        name: as in scenario files and legends.
        las: code in the LAS field ``classification`` (ASPRS LAS 1.4 R15 table 17; 64 and above are user-defined).
        color: sRGB for previews, 0 to 255.
        of: names (or ids) of the full table's classes that a class of a shorter scheme stands for; empty in the full
            table.
    """

    id: int
    name: str
    las: int
    color: tuple[int, int, int]
    of: tuple[str | int, ...] = ()


_Byte = Annotated[int, Field(ge=0, le=255)]


class ClassRow(Model):
    """One class of a table in JSON."""

    id: int = quantity(ge=0, le=255, unit="1", description="Value of class_id; 255 is unlabelled.")
    name: str = Field(min_length=1, max_length=64, description="Name.")
    las: int = quantity(ge=0, le=255, unit="1", description="Code in the LAS field classification.")
    color: tuple[_Byte, _Byte, _Byte] = Field(description="sRGB for previews.")
    of: tuple[Annotated[str | int, Field(union_mode="left_to_right")], ...] = Field(
        (), description="Classes of the full table (names, or ids of one's own scene) that it stands for."
    )


class ClassTable(Model):
    """A table of classes, or a scheme that merges them, in JSON."""

    classes: tuple[ClassRow, ...] = Field(min_length=1, max_length=256, description="The classes.")

    @model_validator(mode="after")
    def _distinct(self) -> ClassTable:
        for what in ("id", "name"):
            if (twice := first_repeated([getattr(row, what) for row in self.classes])) is not None:
                raise ValueError(f"two classes have the {what} {twice!r}")
        return self


@dataclass(frozen=True)
class ClassScheme:
    """A set of classes that clouds are written with.

    Attributes:
        name: ``17``, ``5``, a file's stem, or ``asprs``.
        rows: the classes, ordered by id.
        ids: (256,) uint8, from the ``class_id`` of the points handed in to the scheme's.
    """

    name: str
    rows: tuple[PointClass, ...]
    ids: NDArray[np.uint8]

    def names(self) -> dict[int, str]:
        """Return the classes' names by id, 255 included."""
        return {row.id: row.name for row in self.rows} | {UNLABELLED: "unlabelled"}

    def las_codes(self) -> NDArray[np.uint8]:
        """Return a (256,) table from the scheme's ids to LAS classifications; unlabelled is 1."""
        table = np.full(256, UNCLASSIFIED, dtype=np.uint8)
        for row in self.rows:
            table[row.id] = row.las
        return table

    def colors(self) -> NDArray[np.uint8]:
        """Return a (256, 3) table of preview colours by the scheme's ids; unlabelled is magenta."""
        table = np.full((256, 3), (255, 0, 255), dtype=np.uint8)
        for row in self.rows:
            table[row.id] = row.color
        return table

    def to_dict(self) -> dict[str, Any]:
        """Return name and classes as JSON data, as they are stored in clouds."""
        rows = [{"id": row.id, "name": row.name, "las": row.las, "color": list(row.color)} for row in self.rows]
        return {"name": self.name, "classes": rows}

    def as_stored(self) -> ClassScheme:
        """Return the scheme for points whose ids are the scheme's own already."""
        return ClassScheme(self.name, self.rows, np.arange(256, dtype=np.uint8))


@cache
def classes() -> tuple[PointClass, ...]:
    """Return all classes ordered by id."""
    return _read_rows(PRESETS / "classes.json")


@cache
def class_id(name: str) -> int:
    """Return the id of the class `name`; KeyError if there is none."""
    return {row.name: row.id for row in classes()}[name]


def scheme_names() -> list[str]:
    """Return the names of the built-in schemes."""
    return ["17", "5"]


def class_scheme(name_or_file: str) -> ClassScheme:
    """Return a built-in scheme, or one from a JSON file of the form of ``presets/classes_5.json``.

    Classes of the full table that no row names become unlabelled.

    Raises:
        InputError: there is no such scheme, or its file names unknown classes, one class twice or a code beyond LAS.
    """
    if name_or_file == "17":
        return ClassScheme("17", classes(), np.arange(256, dtype=np.uint8))
    path = PRESETS / "classes_5.json" if name_or_file == "5" else Path(name_or_file)
    if path.suffix.lower() != ".json":
        known = ", ".join(scheme_names())
        raise InputError("classes", name_or_file, f"must be one of {known}, or a .json file of classes")
    rows = _read_rows(path)
    name = "5" if name_or_file == "5" else path.stem
    return ClassScheme(name, rows, _merging_table(rows, str(path)))


def stored_scheme(data: object, source: str) -> ClassScheme:
    """Return the scheme that a cloud says it was written with (`ClassScheme.to_dict`)."""
    if not isinstance(data, dict) or "classes" not in data:
        raise InputError(source, None, "holds no table of its classes")
    table = ClassTable.from_dict({"classes": data["classes"]}, source)
    return ClassScheme(str(data.get("name", "")), _rows(table.classes), np.arange(256, dtype=np.uint8))


def asprs_scheme(codes: Iterable[int] = ()) -> ClassScheme:
    """Return the scheme whose ids are LAS codes, for clouds of others; given codes without a meaning included."""
    named = {row.id: row for row in _asprs_classes()}
    every = sorted({*named, *(int(code) for code in codes)})
    rows = (named.get(code) or PointClass(code, f"class_{code}", code, _distinct_color(code)) for code in every)
    return ClassScheme("asprs", tuple(rows), np.arange(256, dtype=np.uint8))


@cache
def _asprs_classes() -> tuple[PointClass, ...]:
    """Return the LAS codes that have a meaning of their own (ASPRS LAS 1.4 R15, table 17)."""
    return _read_rows(PRESETS / "classes_asprs.json")


def _distinct_color(number: int) -> tuple[int, int, int]:
    """Return a colour that differs from those of the numbers around it: hues a golden section apart."""
    red, green, blue = colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.65, 0.85)
    return round(red * 255), round(green * 255), round(blue * 255)


def las_codes() -> NDArray[np.uint8]:
    """Return a (256,) uint8 table from the full table's ``class_id`` to the LAS classification; unlabelled is 1."""
    return class_scheme("17").las_codes()


def class_colors() -> NDArray[np.uint8]:
    """Return a (256, 3) uint8 table of preview colours by the full table's ``class_id``; unlabelled is magenta."""
    return class_scheme("17").colors()


def _read_rows(path: Path) -> tuple[PointClass, ...]:
    table = ClassTable.from_dict(read_json(path), str(path))
    for row in table.classes:
        if row.id == UNLABELLED:
            raise InputError(f"{path}: {row.name}.id", row.id, "must be 0 to 254: 255 is unlabelled")
        if 23 <= row.las <= 63:
            allowed = "must be 0 to 22 or 64 to 255: ASPRS reserves 23 to 63"
            raise InputError(f"{path}: {row.name}.las", row.las, allowed)
    return _rows(table.classes)


def _rows(rows: Iterable[ClassRow]) -> tuple[PointClass, ...]:
    made = [PointClass(r.id, r.name, r.las, r.color, r.of) for r in rows]
    return tuple(sorted(made, key=lambda row: row.id))


def _merging_table(rows: tuple[PointClass, ...], source: str) -> NDArray[np.uint8]:
    """Return the (256,) table from full ids to a scheme's, checked."""
    ids = {row.name: row.id for row in classes()}
    table = np.full(256, UNLABELLED, dtype=np.uint8)
    for row in rows:
        for member in row.of or (row.name,):
            if isinstance(member, str) and member not in ids:
                hint = nearest_name(member, ids)
                raise InputError(f"{source}: {row.name}", member, f"must be a class of {', '.join(ids)}{hint}")
            number = ids[member] if isinstance(member, str) else member
            if not 0 <= number < UNLABELLED:
                raise InputError(f"{source}: {row.name}", member, "must be a class's name or an id from 0 to 254")
            if table[number] != UNLABELLED:
                raise InputError(f"{source}: {row.name}", member, "belongs to another class already")
            table[number] = row.id
    return table
