"""Every field of a class that reads a file, by its dotted path: type, limits, unit, default, description.

All of it comes from the JSON Schema that pydantic derives from the class, so it is what a value is checked against.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel

from .schema import LARGEST

Rule = Mapping[str, Any]
"""JSON Schema of a field."""
_LIMITS = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "exclusiveMaximum": "below"}
_TYPES = {"integer": "whole number", "number": "number", "string": "text"}


@dataclass(frozen=True)
class FieldEntry:
    """A field of a file, with what it may hold, as ``--set`` takes it.

    Attributes:
        path: e.g. ``scan.platform.height``.
        value: what it may be, in words with its limits.
        unit: of the number; empty if it has none.
        required: whether it must be given, as it has no default.
        default: as JSON data; None also where it may be left out.
        description: what it means.
        allowed: the values that it may have, if these are counted.
        limits: of the number, in the words of JSON Schema (``minimum`` and so on).
        interval: whether it holds the minimum and the maximum of what is drawn.
    """

    path: str
    value: str
    unit: str
    required: bool
    default: Any
    description: str
    allowed: tuple[Any, ...] = ()
    limits: dict[str, float] = field(default_factory=dict)
    interval: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return path, type, unit, limits, default and description as JSON data."""
        return {
            "path": self.path,
            "type": self.value,
            "unit": self.unit or None,
            "allowed": list(self.allowed) or None,
            **self.limits,
            "required": self.required,
            "default": self.default,
            "description": self.description,
        }


@dataclass(frozen=True)
class Wording:
    """Turns the JSON Schema of a field into words for people.

    Attributes:
        constant: from JSON's text of a value that may be chosen to what is shown of it.
        group: from the name of a class of fields to what is shown of it.
    """

    constant: Callable[[str], str]
    group: Callable[[str], str]

    def value(self, rule: Rule) -> str:
        """Return in words what a field may hold, its limits included, by its JSON Schema."""
        if "$ref" in rule:
            return self.group(class_of(rule))
        if "const" in rule:
            return self.constant(json.dumps(rule["const"]))
        if "enum" in rule:
            return ", ".join(self.constant(json.dumps(value)) for value in rule["enum"])
        for union_key in ("anyOf", "oneOf"):
            if union_key in rule:
                choices = (choice for choice in rule[union_key] if choice != {"type": "null"})
                return " or ".join(dict.fromkeys(self.value(choice) for choice in choices))
        if rule.get("type") == "array":
            return self._list(rule)
        if rule.get("type") == "object":
            inner_rule = rule.get("additionalProperties")
            return f"object of {self.value(inner_rule)}" if isinstance(inner_rule, dict) and inner_rule else "object"
        if rule.get("type") == "boolean":
            return f"{self.constant('true')} or {self.constant('false')}"
        return f"{_TYPES.get(rule.get('type', ''), 'any value')}{_limits_in_words(rule)}"

    def _list(self, rule: Rule) -> str:
        """Return in words what a list may hold, and how many values."""
        if "prefixItems" in rule:
            item_texts = "; ".join(dict.fromkeys(map(self.value, rule["prefixItems"])))
            return f"list of {len(rule['prefixItems'])}: {item_texts}"
        least, most = rule.get("minItems", 0), rule.get("maxItems")
        count = f" ({least} to {most})" if most else f" (at least {least})" if least else ""
        return f"list{count} of {self.value(rule.get('items', {}))}"


PLAIN = Wording(lambda text: text.strip('"'), lambda name: "object")
"""For a terminal: no marks around what may be chosen."""


def class_of(rule: Rule) -> str:
    """Return the name of the class that a rule's ``$ref`` refers to."""
    return str(rule["$ref"]).rpartition("/")[2]


def fields_of(model: type[BaseModel]) -> Iterator[FieldEntry]:
    """Yield the entries of a class's fields and of all that lie in them, each before its own.

    Those of one value and those of earlier versions are left out.
    """
    schema = model.model_json_schema()
    yield from _fields(schema, schema.get("$defs", {}), None)


def _fields(schema: Rule, parts: Mapping[str, Rule], outer_entry: FieldEntry | None) -> Iterator[FieldEntry]:
    """Yield the entries of a class's fields by its JSON Schema; the class lies in ``outer_entry``, or in nothing."""
    for name, rule in schema["properties"].items():
        if "const" in rule or rule.get("deprecated"):
            continue
        inner_classes = [parts[class_of(choice)] for choice in _choices(rule) if "$ref" in choice]
        entry = _field(name, rule, schema, inner_classes, outer_entry)
        yield entry
        for part in _kinds_as_one(inner_classes):
            yield from _fields(part, parts, entry)


def _kinds_as_one(classes: Sequence[Rule]) -> Sequence[Rule]:
    """Return the classes of a field that is of one of them merged: constants that tell them apart become a choice."""
    if len(classes) < 2:
        return classes
    properties: dict[str, Rule] = {}
    for name, rule in ((name, rule) for class_rule in classes for name, rule in class_rule["properties"].items()):
        merged_rule = properties.setdefault(name, rule)
        if "const" in rule:
            values = [*merged_rule.get("enum", []), rule["const"]]
            properties[name] = {key: value for key, value in merged_rule.items() if key != "const"} | {"enum": values}
    required = set.intersection(*(set(class_rule.get("required", ())) for class_rule in classes))
    return [{"properties": properties, "required": required}]


def _field(
    name: str, rule: Rule, schema: Rule, inner_classes: Sequence[Rule], outer_entry: FieldEntry | None
) -> FieldEntry:
    """Return the entry of one field of a class; what lies in an interval has its unit and its meaning.

    Args:
        name: of the field.
        rule: what the schema says of it.
        schema: of its class.
        inner_classes: classes whose fields lie in it.
        outer_entry: field that it lies in.
    """
    default, unit = rule.get("default"), rule.get("unit", "")
    description = rule.get("description") or (
        inner_classes[0].get("description", "").partition("\n")[0] if inner_classes else ""
    )
    if outer_entry and isinstance(outer_entry.default, dict):
        default = outer_entry.default.get(name, default)
    if outer_entry and outer_entry.interval:
        unit, description = outer_entry.unit, f"{outer_entry.description} {description}"
    choice = next((choice for choice in _choices(rule) if choice.get("type") != "null"), rule)
    return FieldEntry(
        path=f"{outer_entry.path}.{name}" if outer_entry else name,
        value=PLAIN.value(rule),
        unit="" if unit == "1" else unit,
        required=default is None and name in schema.get("required", ()),
        default=default,
        description=description,
        allowed=tuple(choice.get("enum", ())),
        limits=_limits(choice),
        interval=any(set(part["properties"]) == {"minimum", "maximum"} for part in inner_classes),
    )


def _choices(rule: Rule) -> Sequence[Rule]:
    """Return the rules of which a field follows one, those of nested unions included; itself if it is no union."""
    alternatives = rule.get("anyOf") or rule.get("oneOf")
    return [inner_choice for choice in alternatives for inner_choice in _choices(choice)] if alternatives else [rule]


def _limits(rule: Rule) -> dict[str, float]:
    """Return a number's limits by their JSON Schema keys, but for those that only keep out overflow."""
    return {key: rule[key] for key in _LIMITS if abs(rule.get(key, LARGEST)) < LARGEST}


def _limits_in_words(rule: Rule) -> str:
    """Return a number's limits as text, such as ", from 0 to 5"; empty if it has none."""
    words = [f"{_LIMITS[key]} {value:g}" for key, value in _limits(rule).items()]
    return f", {' '.join(words)}" if words else ""
