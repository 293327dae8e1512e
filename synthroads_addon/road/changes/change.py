"""`Change` and `ChangeList`: what differs between two epochs of a road, as data beside the parameter sets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, model_validator

from ...base.errors import InputError
from ...base.schema import ClosedModel, quantity, read_json

SCHEMA: Literal["synthroads/changes-1.0"] = "synthroads/changes-1.0"
Kind = Literal[
    "added",
    "removed",
    "moved",
    "damaged",
    "worn",
    "grown",
    "cut_back",
    "rutted",
    "settled",
    "cracked",
    "patched",
    "overlaid",
    "marked_anew",
    "construction_zone",
    "parked",
    "altered",
]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""Kinds of changes; their numbers in clouds are 1 for the first, and so on. ``altered`` is what has no name of its own:
no change that is drawn is of this kind, but two sets may differ in anything."""
DETAILS = ("bent", "leaning", "turned", "panel_missing", "spalled", "set_up", "taken_away", "")
"""Details by which a change of a kind is told more exactly."""
UNITS: dict[str, str] = {
    "added": "1",
    "removed": "1",
    "moved": "m",
    "damaged": "m",
    "worn": "1",
    "grown": "m",
    "cut_back": "m",
    "rutted": "m",
    "settled": "m",
    "cracked": "m",
    "patched": "m2",
    "overlaid": "m",
    "marked_anew": "m",
    "construction_zone": "m",
    "parked": "1",
    "altered": "1",
}
"""Unit of the size of each kind; what turns or leans has degrees."""
_Id = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")]


class Extent(ClosedModel):
    """Stations and offsets between which a change lies."""

    start_station: float = quantity(unit="m", description="Lowest station.")
    end_station: float = quantity(unit="m", description="Highest station.")
    low_offset: float | None = quantity(None, unit="m", description="Lowest offset; not given: across the whole road.")
    high_offset: float | None = quantity(None, unit="m", description="Highest offset.")


class Edit(ClosedModel):
    """One difference of the parameter sets: a value, an element of a list, or a whole object.

    ``before`` alone is what is taken away, ``after`` alone what is added, both are a value that is replaced.
    """

    thing: str = Field(description="Id of the object; empty for what belongs to the whole set.")
    path: str = Field(
        "",
        description="Field of the object, of fields in fields with dots between them; empty for the whole object. A "
        "number is the place in a list: in that of the first set, of what is added in that of the second.",
    )
    before: Any = Field(None, description="Value in the first set; null where it has none.")
    after: Any = Field(None, description="Value in the second set; null where it has none.")
    place: int | None = quantity(
        None, ge=0, le=10_000_000, unit="1", description="Place of an added object among those of the second set."
    )

    @model_validator(mode="after")
    def _differs(self) -> Edit:
        """Return the difference unchanged; ValueError where nothing differs, or an added object has no place."""
        if self.before == self.after:
            raise ValueError("before and after must differ: leave out what stays the same")
        if (self.place is not None) != (self.path == "" and self.before is None):
            raise ValueError("place must be given for an added object, and only there")
        return self


class Change(ClosedModel):
    """One change of a road: what happened to which of its things, where, how much, and the edits that this is."""

    id: _Id = Field(description="Name of the change in the list.")
    number: int = quantity(ge=1, le=65_535, unit="1", description="Number that the points of a cloud carry.")
    kind: Kind = Field(description="What happened.")
    detail: Literal[DETAILS] = Field("", description="What it is more exactly.")  # type: ignore[valid-type]
    things: tuple[str, ...] = Field(description="Ids of the objects that it concerns.")
    extent: Extent = Field(description="Where it is.")
    size: float = quantity(unit="", description="How large it is, in the unit.")
    unit: Literal["m", "m2", "deg", "1"] = Field(description="Unit of the size.")
    edits: tuple[Edit, ...] = Field(min_length=1, description="Differences of the two sets.")


class ChangeList(ClosedModel):
    """All changes that turn the parameter set of one epoch into that of another, and what else differs between them."""

    schema_: Literal["synthroads/changes-1.0"] = Field(SCHEMA, alias="schema", description="Name of this format.")
    before: str = Field(description="Identifier of the first set.")
    after: str = Field(description="Identifier of the second set.")
    years: float | None = quantity(None, ge=0, le=200, unit="a", description="Time between the epochs, if known.")
    changes: tuple[Change, ...] = Field(description="Changes of the road, in the order of their stations.")
    circumstances: tuple[Edit, ...] = Field(
        (), description="What differs but is no change of the road: names, light, weather, season, traffic."
    )
    own_numbers: bool | None = Field(
        None,
        strict=True,
        description="true: the second set numbers parts of its objects by itself; else parts that stay keep theirs.",
    )
    order: tuple[str, ...] | None = Field(
        None, description="Ids of all objects of the second set, where those that stay are in another order."
    )

    @model_validator(mode="after")
    def _numbered(self) -> ChangeList:
        """Return the list unchanged; ValueError for an id or a number that two changes have."""
        for name in ("id", "number"):
            values = [getattr(change, name) for change in self.changes]
            if len(set(values)) != len(values):
                raise ValueError(f"changes: two have the same {name}; each needs one of its own")
        return self

    @property
    def edits(self) -> tuple[Edit, ...]:
        """Return the edits of all changes and of the circumstances."""
        return (*(edit for change in self.changes for edit in change.edits), *self.circumstances)


def read_changes(path: Path | str) -> ChangeList:
    """Read a list of changes from a JSON file; InputError names file, field, value and what is allowed."""
    data = read_json(path)
    if isinstance(data, dict) and data.get("schema") not in (None, SCHEMA):
        raise InputError(f"{path}: schema", data["schema"], f"this program reads '{SCHEMA}'")
    return ChangeList.from_dict(data, source=str(path))


def changes_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a list of changes."""
    schema = ChangeList.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
