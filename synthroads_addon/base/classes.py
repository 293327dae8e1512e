"""The classes of points: 17 in full, 5 in short, or a user's own; and their codes in LAS. The tables are data.

A scheme merges the classes of the full table, splits them (by material, by type of thing, by asset) and adds others.
Until it is written a point's ``class_id`` is that of the full table, or of a *fine* class: one of the scheme's that
the full table doesn't have, with a number from 254 downwards that nothing else stands for.
"""

from __future__ import annotations

import colorsys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from .errors import InputError, nearest_name
from .files import PRESETS
from .schema import Model, first_repeated, quantity, read_json

UNLABELLED = 255
"""`class_id` of faces that carry no label."""
UNCLASSIFIED = 1
"""LAS code of what carries no label (ASPRS LAS 1.4 R15, table 17)."""


class ClassSelector(Model):
    """Faces that the full table doesn't tell apart. All that is given must fit; names are shell patterns."""

    vendor_keys_allowed: ClassVar[bool] = False

    class_name: str | None = Field(None, alias="class", description="Class of the full table.")
    material: str | None = Field(None, description="Material, e.g. concrete.")
    thing: str | None = Field(None, description="Type of object in the parameter set, e.g. Vehicle.")
    where: dict[str, str] = Field({}, description="Fields of that object and what they must be, e.g. model: truck.")
    asset: str | None = Field(None, description="Name of a free asset in its library.")

    @model_validator(mode="after")
    def _check_selection(self) -> ClassSelector:
        """Return the selector unchanged; ValueError if it selects nothing, or has fields but no thing."""
        if not any((self.class_name, self.material, self.thing, self.asset)):
            raise ValueError("must have at least one of class, material, thing, asset")
        if self.where and not self.thing:
            raise ValueError("where needs thing, whose fields it names")
        return self


Member = str | int | ClassSelector
"""Source of a class: a class of the full table, a number of a scene's own, or what a selector finds."""


def _form(member: object) -> str | None:
    """Return "name", "number" or "selector" by the form of a class's member, else None; the union's discriminator."""
    if isinstance(member, str | bool):
        return "name" if isinstance(member, str) else None
    return {int: "number", dict: "selector", ClassSelector: "selector"}.get(type(member))


_FORM = Discriminator(_form, "member_type", "must be a class's name, a number, or a JSON object that selects faces")
_Members = tuple[
    Annotated[
        Annotated[str, Tag("name")] | Annotated[int, Tag("number")] | Annotated[ClassSelector, Tag("selector")], _FORM
    ],
    ...,
]


@dataclass(frozen=True)
class PointClass:
    """One semantic class.

    Attributes:
        id: 0 to 254; the value of the faces' ``class_id`` and of the cloud's ``class_id``.
        name: as in scenario files and legends.
        las: code in the LAS field ``classification`` (ASPRS LAS 1.4 R15 table 17; 64 and above are user-defined).
        color: sRGB for previews, 0 to 255.
        of: what a class of another scheme stands for; empty in the full table.
    """

    id: int
    name: str
    las: int
    color: tuple[int, int, int]
    of: tuple[Member, ...] = ()

    def selectors(self) -> Iterator[ClassSelector]:
        """Yield the selectors (by material, thing or asset) among what the class stands for."""
        return (member for member in self.of if isinstance(member, ClassSelector))


_Byte = Annotated[int, Field(ge=0, le=255)]


class ClassRow(Model):
    """One class of a table in JSON."""

    id: int = quantity(..., "1", "Value of class_id; 255 is unlabelled.", (0, 255))
    name: str = Field(min_length=1, max_length=64, description="Name.")
    las: int = quantity(..., "1", "Code in the LAS field classification.", (0, 255))
    color: tuple[_Byte, _Byte, _Byte] = Field(description="sRGB for previews.")
    of: _Members = Field(
        (),
        description="What it stands for: classes of the full table by name, numbers of one's own scene, or selectors; "
        "that of its own name if not given.",
    )


class ClassTable(Model):
    """A table of classes, or a scheme that merges, splits or adds to them, in JSON."""

    extends: Literal["17", "5", "19"] | None = Field(
        None, description="Built-in scheme whose classes these are added to."
    )
    classes: tuple[ClassRow, ...] = Field(min_length=1, max_length=256, description="The classes.")

    @model_validator(mode="after")
    def _refuse_repetitions(self) -> ClassTable:
        """Return the table unchanged; ValueError if two classes have the same id or name."""
        for column in ("id", "name"):
            if (repeated := first_repeated([getattr(row, column) for row in self.classes])) is not None:
                raise ValueError(f"two classes have the {column} {repeated!r}")
        return self


@dataclass(frozen=True)
class ClassScheme:
    """A set of classes that clouds are written with.

    Attributes:
        name: ``17``, ``5``, ``19``, a file's stem, or ``asprs``.
        rows: the classes, ordered by id.
        ids: (256,) uint8, from the ``class_id`` of the points handed in to the scheme's.
        fine: classes that the full table doesn't have, by the ``class_id`` of the points handed in; as in the file.
    """

    name: str
    rows: tuple[PointClass, ...]
    ids: NDArray[np.uint8]
    fine: Mapping[int, PointClass] = field(default_factory=dict)

    def source_ids(self) -> dict[str, int]:
        """Return class name -> ``class_id`` of points as handed in, for all names that objects may have as class."""
        return {row.name: number for number, row in self.fine.items()} | {row.name: row.id for row in classes()}

    def sources(self) -> ClassScheme:
        """Return the class scheme of points as they are scanned: the full table and the fine classes, none merged."""
        full_table = classes()
        fine = (replace(row, id=number, of=()) for number, row in sorted(self.fine.items()))
        return ClassScheme("17", (*full_table, *fine), np.arange(256, dtype=np.uint8))

    def selectors(self) -> Iterator[tuple[int, ClassSelector]]:
        """Yield (``class_id``, selector) of the fine classes; of several that fit the first counts."""
        return ((number, selector) for number, row in self.fine.items() for selector in row.selectors())

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
        """Return the class scheme for points whose ids are already its own, not the full table's."""
        return ClassScheme(self.name, self.rows, np.arange(256, dtype=np.uint8))


@cache
def classes() -> tuple[PointClass, ...]:
    """Return the classes of the full table ordered by id, read once."""
    return _read_rows(PRESETS / "classes.json")


@cache
def class_id(name: str) -> int:
    """Return the id of the class ``name`` in the full table; KeyError if there is none.

    Example:
        >>> class_id("guardrail")
        4
    """
    return {row.name: row.id for row in classes()}[name]


def scheme_names() -> list[str]:
    """Return the names of the built-in schemes."""
    return ["17", "5", "19"]


def scheme_file(name_or_file: str) -> Path:
    """Return the path of a built-in scheme's table, or that of a file by its name."""
    shipped = {"17": "classes.json"} | {name: f"classes_{name}.json" for name in scheme_names()[1:]}
    return PRESETS / shipped[name_or_file] if name_or_file in shipped else Path(name_or_file)


def class_scheme(name_or_file: str) -> ClassScheme:
    """Return a built-in class scheme, or one from a JSON file of the form of ``presets/classes_5.json``.

    Classes of the full table that no row names become unlabelled. A row with selectors, or of a name that the full
    table doesn't have and without `of`, is a fine class.

    Raises:
        InputError: there is no such scheme, or its file names unknown classes, one class twice or a code beyond LAS.

    Example:
        >>> [row.name for row in class_scheme("5").rows]
        ['ground', 'road', 'road_marking', 'vegetation', 'road_furniture']
    """
    if name_or_file == "17":
        return ClassScheme("17", classes(), np.arange(256, dtype=np.uint8))
    path = scheme_file(name_or_file)
    if path.suffix.lower() != ".json":
        known_names = ", ".join(scheme_names())
        raise InputError("classes", name_or_file, f"must be one of {known_names}, or a .json file of classes")
    table = _read_table(path)
    name = name_or_file if name_or_file in scheme_names() else path.stem
    fine = _fine_classes(table.classes)
    return ClassScheme(name, _rows(table.classes), _merging_table(table.classes, fine, str(path)), fine)


def stored_scheme(data: object, source: str) -> ClassScheme:
    """Return the class scheme that a cloud says it was written with (`ClassScheme.to_dict`), else InputError."""
    if not isinstance(data, dict) or "classes" not in data:
        raise InputError(source, None, "holds no table of its classes")
    table = ClassTable.from_dict({"classes": data["classes"]}, source)
    return ClassScheme(str(data.get("name", "")), _rows(table.classes), np.arange(256, dtype=np.uint8))


def asprs_scheme(codes: Iterable[int] = ()) -> ClassScheme:
    """Return the class scheme whose ids are LAS codes, for clouds of others, any given codes included."""
    named_rows = {row.id: row for row in _asprs_classes()}
    all_codes = sorted({*named_rows, *(int(code) for code in codes)})
    rows = (
        named_rows.get(code) or PointClass(code, f"class_{code}", code, _distinct_color(code)) for code in all_codes
    )
    return ClassScheme("asprs", tuple(rows), np.arange(256, dtype=np.uint8))


def numbered_scheme() -> ClassScheme:
    """Return the class scheme of ids of which nothing is known: each is a class that is called by its number."""
    rows = (PointClass(number, f"class_{number}", 0, _distinct_color(number)) for number in range(UNLABELLED))
    return ClassScheme("", tuple(rows), np.arange(256, dtype=np.uint8))


@cache
def _asprs_classes() -> tuple[PointClass, ...]:
    """Return the classes of the LAS codes that have a meaning of their own (ASPRS LAS 1.4 R15, table 17)."""
    return _read_rows(PRESETS / "classes_asprs.json")


def _distinct_color(number: int) -> tuple[int, int, int]:
    """Return an sRGB colour (0 to 255) unlike those of neighbouring numbers: hues a golden section apart."""
    red, green, blue = colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.65, 0.85)
    return round(red * 255), round(green * 255), round(blue * 255)


def las_codes() -> NDArray[np.uint8]:
    """Return a (256,) uint8 table from the full table's ``class_id`` to the LAS classification; unlabelled is 1."""
    return class_scheme("17").las_codes()


def _read_rows(path: Path) -> tuple[PointClass, ...]:
    """Return the classes of a table's file, ordered by id."""
    return _rows(_read_table(path).classes)


def _read_table(path: Path) -> ClassTable:
    """Read a table, the classes that it extends before its own; InputError for reserved ids and LAS codes."""
    table = ClassTable.from_dict(read_json(path), str(path))
    for row in table.classes:
        if row.id == UNLABELLED:
            raise InputError(f"{path}: {row.name}.id", row.id, "must be 0 to 254: 255 is unlabelled")
        if 23 <= row.las <= 63:
            allowed = "must be 0 to 22 or 64 to 255: ASPRS reserves 23 to 63"
            raise InputError(f"{path}: {row.name}.las", row.las, allowed)
    if table.extends is None:
        return table
    extended = [row.to_dict() for row in _read_table(scheme_file(table.extends)).classes]
    return ClassTable.from_dict({"classes": extended + [row.to_dict() for row in table.classes]}, str(path))


def _rows(rows: Iterable[ClassRow]) -> tuple[PointClass, ...]:
    """Return the rows of a table as classes, ordered by id."""
    point_classes = [PointClass(r.id, r.name, r.las, r.color, r.of) for r in rows]
    return tuple(sorted(point_classes, key=lambda row: row.id))


def _fine_classes(rows: Sequence[ClassRow]) -> dict[int, PointClass]:
    """Return number -> class for the classes that the full table doesn't have; numbers from 254 downwards."""
    known_names = {row.name for row in classes()}
    named_numbers = {member for row in rows for member in row.of if isinstance(member, int)}
    free_numbers = (number for number in range(UNLABELLED - 1, -1, -1) if number not in named_numbers)
    point_classes = [PointClass(r.id, r.name, r.las, r.color, r.of) for r in rows]
    fine = [row for row in point_classes if any(row.selectors()) or (not row.of and row.name not in known_names)]
    return dict(zip(free_numbers, fine, strict=False))


def _merging_table(rows: Sequence[ClassRow], fine: Mapping[int, PointClass], source: str) -> NDArray[np.uint8]:
    """Return the (256,) table from a point's source ``class_id`` to its id in the scheme; InputError for a bad member.

    Args:
        rows: classes of the scheme, each with its members: classes of the full table, by name or id.
        fine: classes of the scheme that the full table doesn't have, by the source id that stands for each.
        source: of the rows, for messages.
    """
    ids = {row.name: row.id for row in classes()}
    table = np.full(256, UNLABELLED, dtype=np.uint8)
    for row in rows:
        # A class without members is the full table's of its name, or one of the fine ones.
        for member in row.of or ((row.name,) if row.name in ids else ()):
            if isinstance(member, ClassSelector):  # picks faces, whose class is one of the fine ones
                _known_class(member.class_name, ids, f"{source}: {row.name}.of.class")
                continue
            _known_class(member, ids, f"{source}: {row.name}")
            source_id = ids[member] if isinstance(member, str) else member
            if not 0 <= source_id < UNLABELLED:
                raise InputError(f"{source}: {row.name}", member, "must be a class's name or an id from 0 to 254")
            if table[source_id] != UNLABELLED:
                raise InputError(f"{source}: {row.name}", member, "belongs to another class already")
            table[source_id] = row.id
    for source_id, point_class in fine.items():
        table[source_id] = point_class.id
    return table


def _known_class(name: Member | None, ids: Mapping[str, int], field: str) -> None:
    """Raise InputError if a member is the name of a class that the full table doesn't have."""
    if isinstance(name, str) and name not in ids:
        raise InputError(field, name, f"must be a class of {', '.join(ids)}{nearest_name(name, ids)}")
