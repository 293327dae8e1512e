"""Base of all JSON files of the project: strict models, one-line errors, byte-stable writing.

The models are pydantic's, because it names field, value and limit of every fault, makes the JSON Schema from the same
declarations, and its limits, units and descriptions can be read back by the panel. All numbers must be finite.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from .errors import InputError, nearest_name, suggestion
from .files import read_text
from .text.typed import similar_paths

VENDOR_PREFIX = "+"
"""Keys that begin with this are a vendor's own: read, kept, written back, never interpreted (CityJSON's habit)."""
LARGEST = 1e15
"""Limit, to either side, of a quantity that declares none: what is larger overflows somewhere later."""
Finite = Annotated[float, Field(strict=True, ge=-1e8, le=1e8)]
"""A coordinate or a distance in a list, which has no declaration of its own."""


def notes(
    *,
    unit: str = "",
    only_with: Mapping[str, Sequence[Any]] | None = None,
    inherits: str = "",
    unset: str = "",
    labels: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return the extra JSON Schema entries of a field (unit, conditions, labels), those that are empty left out.

    Args:
        unit: ``m``, ``deg``, ``1``, ...
        only_with: fields beside it and the values of theirs with which it has an effect; all of them are needed.
        inherits: where its value comes from while it isn't given, e.g. ``fidelity.tolerance``.
        unset: the same in two or three words, where it is no number.
        labels: values of a choice, and what people call them.
    """
    entries = {"unit": unit, "only_with": only_with, "inherits": inherits, "unset": unset, "labels": labels}
    return {name: value for name, value in entries.items() if value}


def quantity(
    default: Any = ...,
    unit: str = "",
    description: str = "",
    limits: tuple[float | None, float | None] = (None, None),
    *,
    ge: float | None = None,
    gt: float | None = None,
    le: float | None = None,
    lt: float | None = None,
    **further_notes: Any,
) -> Any:
    """Return a pydantic field for a strict number with a unit and limits.

    Args:
        default: value where none is given; None where the field may be left out, ``...`` where it is required.
        unit: ``m``, ``deg``, ``1``, ...
        description: what it means.
        limits: smallest and largest value, which are allowed themselves; `LARGEST` to either side if not given.
        ge, gt, le, lt: the same as pydantic has them, for limits that aren't allowed themselves.
        further_notes: ``title``, the name in the panel where the field's own won't do, and `notes`.
    """
    smallest, largest = limits
    return Field(
        default,
        title=further_notes.pop("title", None),
        description=description,
        ge=-LARGEST if ge is None and gt is None and smallest is None else smallest if ge is None else ge,
        gt=gt,
        le=LARGEST if le is None and lt is None and largest is None else largest if le is None else le,
        lt=lt,
        strict=True,
        json_schema_extra=notes(unit=unit, **further_notes),
    )


def when(test: dict[str, Any], then: dict[str, Any], otherwise: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return a condition of `Model.conditions`: where the fields of ``test`` are there and fit, those of ``then`` must.

    Each argument maps fields to what JSON Schema says of them. A field that must be null or a constant may be left out.
    """
    result = {"if": {"properties": test, "required": list(test)}, "then": _fields_fit(then)}
    return result | ({"else": _fields_fit(otherwise)} if otherwise else {})


def _fields_fit(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of fields that must fit rules; those that may be null or a constant may be missing."""
    required_names = [name for name, rule in fields.items() if rule.get("type") != "null" and "const" not in rule]
    return {"properties": fields, "required": required_names}


_FORMER = {"deprecated": True, "description": "Field of earlier versions, without effect. It is read and dropped."}


def _complete_schema(schema: dict[str, Any], model: type[Any]) -> None:
    """Add to a class's JSON Schema, in place, unknown keys and conditions between fields."""
    schema["additionalProperties"] = False
    schema.get("properties", {}).update(dict.fromkeys(sorted(model.former_fields), _FORMER))
    if model.vendor_keys_allowed:
        schema["patternProperties"] = {f"^\\{VENDOR_PREFIX}": {}}
    conditions = [rule for base in reversed(model.__mro__) for rule in base.__dict__.get("conditions", ())]
    if conditions:
        schema["allOf"] = conditions


@cache
def _keys(model: type[Model]) -> tuple[frozenset[str], frozenset[str]]:
    """Return the keys of a class's fields, and those of its fields of whole numbers; cached."""
    fields = {field.alias or name: field.annotation for name, field in model.model_fields.items()}
    whole_number_names = [
        name for name, kind in fields.items() if int in (kinds := list(_kinds(kind))) and float not in kinds
    ]
    return frozenset(fields), frozenset(whole_number_names)


def _kinds(kind: Any) -> Iterator[Any]:
    """Yield a field's type, and all that it is made of."""
    yield kind
    for part in get_args(kind):
        yield from _kinds(part)


def _whole_numbers(value: Any) -> Any:
    """Return JSON data with 2.0 as 2, in lists and objects too."""
    if isinstance(value, list | tuple):
        return [_whole_numbers(item) for item in value]
    if isinstance(value, dict):
        return {key: _whole_numbers(item) for key, item in value.items()}
    return int(value) if isinstance(value, float) and value.is_integer() else value


class UnknownKeyError(ValueError):
    """A key of JSON data is none of its class.

    Attributes:
        key: the unknown key.
        similar: paths of similar fields in the class, relative to the place of the key; empty if there are none.
    """

    def __init__(self, key: str, similar: list[str]) -> None:
        self.key, self.similar = key, similar
        super().__init__(f"unknown key {key!r}{suggestion(similar)}")

    def hint(self, root: type[BaseModel], path: list[str]) -> str:
        """Return the message with whole paths for fields that don't lie where the key stands.

        Args:
            root: class of all the data.
            path: of the place where the key stands.
        """
        beside = [name for name in self.similar if "." not in name]
        whole = [".".join([*path, name]) for name in self.similar] or similar_paths(root, self.key)
        return f"unknown key {self.key!r}{suggestion(beside or whole)}"


class Model(BaseModel):
    """Base of all parameter classes: immutable, no unknown keys but a vendor's, no NaN; numbers are strict.

    Attributes:
        conditions: what the class's validators require of several fields together, in the words of JSON Schema.
        former_fields: keys that earlier versions wrote and nothing showed: they are read, and left out.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False, json_schema_extra=_complete_schema)
    vendor_keys_allowed: ClassVar[bool] = True
    conditions: ClassVar[Sequence[dict[str, Any]]] = ()
    former_fields: ClassVar[frozenset[str]] = frozenset()

    @model_validator(mode="before")
    @classmethod
    def _prepare(cls, data: Any) -> Any:
        """Return input data with 2.0 as 2 for whole numbers and -0.0 as 0.0; ValueError for unknown keys.

        JSON doesn't tell the first two apart, comparisons don't the others: what is equal has to have the same text.
        """
        if not isinstance(data, dict):
            return data
        known_keys, whole_number_keys = _keys(cls)
        data = {key: value for key, value in data.items() if key not in cls.former_fields}
        for key in data:
            if key in known_keys or (cls.vendor_keys_allowed and str(key).startswith(VENDOR_PREFIX)):
                continue
            raise UnknownKeyError(str(key), similar_paths(cls, str(key)))
        data = {key: _unsigned_zeros(value) if key in known_keys else value for key, value in data.items()}
        return data | {key: _whole_numbers(data[key]) for key in whole_number_keys & data.keys()}

    @classmethod
    def from_dict(cls: type[T], data: object, source: str = "") -> T:
        """Return the model of plain JSON data; InputError names the first wrong field."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise _input_error(error, data, source, cls) from None
        except (TypeError, ValueError, RecursionError) as error:
            raise InputError(source or cls.__name__, None, f"must be plain JSON data ({error})") from None

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data in the order of the declaration, without fields that are None."""
        data: dict[str, Any] = _without_absent_fields(self.model_dump(mode="json", by_alias=True))
        return data

    def to_json(self) -> str:
        """Return the canonical JSON text: the same set gives the same bytes."""
        return canonical_json(self.to_dict())


T = TypeVar("T", bound=Model)


def _unsigned_zeros(value: Any) -> Any:
    """Return a field's value with 0.0 for every -0.0, in lists too (objects in them see to their own fields)."""
    if isinstance(value, float):
        return value + 0.0
    return type(value)(map(_unsigned_zeros, value)) if type(value) in (list, tuple) else value


def _without_absent_fields(data: Any) -> Any:
    """Return JSON data without fields that are None; what a vendor wrote is kept as it is."""
    if isinstance(data, dict):
        return {
            key: value if key.startswith(VENDOR_PREFIX) else _without_absent_fields(value)
            for key, value in data.items()
            if value is not None or key.startswith(VENDOR_PREFIX)
        }
    return [_without_absent_fields(value) for value in data] if isinstance(data, list) else data


def canonical_json(data: object) -> str:
    """Return data as JSON text in the project's one layout: one space of indent, keys as ordered, final newline."""
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def first_repeated(values: Sequence[Any]) -> Any:
    """Return the first of some values that stands among them again; None if none does."""
    return next((value for value in values if values.count(value) > 1), None)


def compact_json(data: object) -> str:
    """Return data as JSON text without spaces and line ends."""
    return json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def round_value(value: float, digits: int = 9) -> float:
    """Return a value rounded to decimals, so that its text is the same on every machine (-0.0 becomes 0.0)."""
    return round(float(value), digits) + 0.0


def is_number(value: Any) -> bool:
    """Return whether JSON data are a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def read_json(path: Path | str) -> Any:
    """Return the data of a JSON file; NaN, infinity and a key that an object has twice are refused.

    Raises:
        MissingFileError: there is no such file, or it can't be read.
        InputError: it isn't JSON; the message names line and column.
    """
    text = read_text(path, "must be JSON in UTF-8")
    try:
        data = json.loads(
            text, parse_constant=_refuse_constant, parse_float=_finite, object_pairs_hook=_refuse_key_twice
        )
        if "\\u" in text:
            json.dumps(data, ensure_ascii=False).encode()  # refuses half a surrogate pair, which no file could hold
        return data
    except (ValueError, RecursionError) as error:
        raise InputError(str(path), None, f"must be valid JSON ({error})") from None


def read_yaml(path: Path) -> Any:
    """Return a YAML (or JSON) file as plain data; YAML's own types (dates, say) are refused, as JSON has none.

    Raises:
        MissingFileError: there is no such file, or it can't be read.
        InputError: it isn't YAML.
    """
    # Only recipes and lists of jobs are YAML: what reads JSON works without PyYAML.
    import yaml

    from .config_files import Loader

    text = read_text(path, "must be YAML in UTF-8")
    try:
        yaml_data = yaml.load(text, Loader=Loader)  # nosec B506 # it is a SafeLoader
        data = json.loads(json.dumps(yaml_data, allow_nan=False))
        if "\\" in text:
            json.dumps(data, ensure_ascii=False).encode()  # refuses half a surrogate pair, which no file could hold
        return data
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        raise InputError(str(path), None, f"must be valid YAML ({error})") from None
    except (LookupError, AttributeError):  # PyYAML's own, of a tag such as !!int before what isn't one
        raise InputError(str(path), None, "must be valid YAML (a value is not what its tag says)") from None


def note_of(field: FieldInfo, name: str) -> Any:
    """Return one of the `notes` of a field's declaration, or None."""
    extra = field.json_schema_extra
    return extra.get(name) if isinstance(extra, dict) else None


def unit_of(field: FieldInfo) -> str:
    """Return the unit declared by `quantity`, or an empty string."""
    return str(note_of(field, "unit") or "")


def _refuse_constant(name: str) -> float:
    """Raise ValueError for NaN and infinity, which Python's JSON takes and the standard doesn't have."""
    raise ValueError(f"{name} is not a number")


def _finite(text: str) -> float:
    """Return the number that a JSON text stands for; ValueError if it is too large for a float."""
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise ValueError(f"{text} is too large a number")
    return value


def _refuse_key_twice(members: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object's members as a dictionary; ValueError for a key that is there twice."""
    data = dict(members)
    if len(data) < len(members):
        raise ValueError(f"an object has the key {first_repeated([key for key, _ in members])!r} twice")
    return data


_WORDING = {
    "missing": "is required",
    "model_type": "must be a JSON object",
    "model_attributes_type": "must be a JSON object",
    "dict_type": "must be a JSON object",
    "tuple_type": "must be a list",
    "union_tag_not_found": "must be a JSON object that names its type",
    "string_unicode": "must be Unicode text",
}
"""Type of complaint -> our words, where pydantic's speak of Python."""


def _input_error(error: ValidationError, data: object, source: str, root: type[BaseModel]) -> InputError:
    """Return pydantic's first complaint as the project's error of one line.

    Args:
        error: pydantic's.
        data: what was read.
        source: where it comes from; empty: from no file.
        root: class of the whole of it, whose name stands for the data if it comes from no file.
    """
    complaint = error.errors(include_url=False)[0]
    kind, value, context = complaint["type"], complaint.get("input"), complaint.get("ctx", {})
    path = _real_path(complaint["loc"], data, missing=kind == "missing")
    message = _WORDING.get(kind) or _in_our_words(str(complaint["msg"]))
    if kind == "union_tag_invalid":
        path, value = [*path, str(context["discriminator"]).strip("'")], context["tag"]
        known_tags = re.findall(r"\w+", context["expected_tags"])
        message = f"must be one of {', '.join(known_tags)}{nearest_name(str(value), known_tags)}"
    elif kind == "literal_error" and isinstance(value, str):
        message += nearest_name(value, re.findall(r"'([^']*)'", context["expected"]))
    elif isinstance(fault := context.get("error"), UnknownKeyError):
        message, value = fault.hint(root, path), None
    elif kind in ("missing", "value_error"):
        value = None
    field = ".".join(part if part.isprintable() else repr(part) for part in path)
    if not field:
        field = root.__name__.lower() if not source else "the file" if value is not None else ""
    return InputError(": ".join(filter(None, (source, field))), value, " ".join(message.split()))


def _in_our_words(message: str) -> str:
    """Return pydantic's complaint without Python's words, beginning with a small letter."""
    message = re.sub(r"^(Input|Tuple|List|String|Dictionary) should ", "must ", message.removeprefix("Value error, "))
    for pydantic_words, own_words in (
        ("a valid integer", "a whole number"),
        ("a valid ", "a "),
        (" after validation", ""),
    ):
        message = message.replace(pydantic_words, own_words)
    return message[0].lower() + message[1:]


def _real_path(location: tuple[int | str, ...], data: Any, missing: bool) -> list[str]:
    """Return the keys and indices that lead to a field; pydantic also names the chosen types of unions between them.

    Args:
        location: pydantic's.
        data: what was read.
        missing: the last key isn't there, and that is the fault.
    """
    path = []
    for depth, part in enumerate(location, start=1):
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            if not (missing and depth == len(location)):
                continue
        path.append(str(part))
    return path


class ClosedModel(Model):
    """Model without vendor keys: every key that it doesn't declare is refused."""

    vendor_keys_allowed: ClassVar[bool] = False
