"""The parts of the reference that are made from code when the documentation is built: commands, fields, presets.

`docs/conf.py` puts them in the place of ``<!-- generated: NAME -->`` in a page; `GENERATED` holds the names. Fields
come from the JSON Schemas that pydantic derives from the classes which read the files, so that types, limits, defaults
and descriptions are those that a file is checked against.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

from synthroads_addon.core.schema import LARGEST, Model, read_json, read_yaml
from tools.reference_commands import commands

ROOT = Path(__file__).resolve().parents[1]
PRESETS = ROOT / "synthroads_addon" / "presets"
CONFIGURATIONS = ROOT / "ml" / "configurations"
MARK = re.compile(r"<!-- generated: ([a-z-]+) -->")

FILES = {
    "scenario": ["synthroads_addon.core.scenario:Scenario"],
    "parameters": ["synthroads_addon.core.parameters.model:RoadParameters"],
    "recipe": ["synthroads_addon.core.dataset.recipe:Recipe"],
    "device": ["synthroads_addon.core.scanning.devices:Device"],
    "materials": ["synthroads_addon.core.materials:MaterialTable"],
    "classes": ["synthroads_addon.core.cloud.labels:ClassTable"],
    "mapping": ["ml.segmentation.classes:LabelMapping", "synthroads_addon.core.class_mapping:ClassMapping"],
    "assets": ["synthroads_addon.core.parameters.assets:AssetLibrary"],
    "segmentation": [
        "ml.segmentation.recipes:SegmentationConfiguration",
        "ml.segmentation.experiment:Experiment",
    ],
    "centerline": ["ml.centerline.task:CenterlineConfiguration"],
}
"""Name of a page part -> the classes that read the files which it describes."""


def fields(classes: Sequence[str]) -> str:
    """Return the fields of classes and of all that they are made of, as Markdown, one table each.

    Args:
        classes: ``MODULE:NAME`` each.
    """
    parts: dict[str, dict[str, Any]] = {}
    for reference in classes:
        module, _, name = reference.partition(":")
        schema = _model(module, name).model_json_schema()
        for part, its_schema in {name: schema, **schema.pop("$defs", {})}.items():
            if parts.setdefault(part, its_schema) != its_schema:
                raise ValueError(f"two different classes are named {part}: give them a page each")
    return "\n\n".join(_section(name, parts) for name in parts)


def _model(module: str, name: str) -> type[Model]:
    model: type[Model] = getattr(import_module(module), name)
    return model


def _section(name: str, parts: dict[str, dict[str, Any]]) -> str:
    """Return a class's heading, description and table; ``parts`` has all of the page's by name."""
    schema = parts[name]
    text = schema.get("description", "").split("\n\nAttributes:")[0]
    rows = []
    for field, rule in schema["properties"].items():
        same = parts[_name(rule)].get("description", "") if "$ref" in rule else ""  # pydantic says it once
        cells = {"description": same.partition("\n")[0], **rule}
        rows.append(_row(field, cells, field in schema.get("required", ())))
    head = ["| field | value | default | meaning |", "|---|---|---|---|"]
    return "\n".join([f"# {name}", "", _plain(text), "", *head, *rows])


def _name(rule: Mapping[str, Any]) -> str:
    """Return the name of the class that a rule refers to."""
    return str(rule["$ref"]).rpartition("/")[2]


def _plain(docstring: str) -> str:
    """Return a docstring's text as Markdown: code is the only markup that both have, with two ticks there."""
    return docstring.replace("``", "`").replace("<", "\\<")


def _row(field: str, rule: dict[str, Any], required: bool) -> str:
    unit = "" if rule.get("unit") in (None, "1") else f" ({rule['unit']})"
    default = "**required**" if required else _default(rule)
    cells = [f"`{field}`", f"{_value(rule)}{unit}", default, _plain(rule.get("description", ""))]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _default(rule: dict[str, Any]) -> str:
    """Return a default as JSON; of parts with a table of their own nothing, as it says all."""
    value = rule.get("default")
    if value is None:
        return ""
    if isinstance(value, dict):
        return f"{value['minimum']:g} to {value['maximum']:g}" if set(value) == {"minimum", "maximum"} else ""
    text = json.dumps(value)
    return f"`{text}`" if len(text) <= 60 else ""


def _value(rule: Mapping[str, Any]) -> str:
    """Return what a value may be, with its limits."""
    if "$ref" in rule:
        return f"[{_name(rule)}](#{_name(rule).lower()})"
    if "const" in rule:
        return f"`{json.dumps(rule['const'])}`"
    if "enum" in rule:
        return ", ".join(f"`{json.dumps(value)}`" for value in rule["enum"])
    for several in ("anyOf", "oneOf"):
        if several in rule:
            return " or ".join(dict.fromkeys(_value(choice) for choice in rule[several] if choice != {"type": "null"}))
    if rule.get("type") == "array":
        return _list(rule)
    if rule.get("type") == "object":
        inner = rule.get("additionalProperties")
        return f"object of {_value(inner)}" if isinstance(inner, dict) and inner else "object"
    names = {"integer": "whole number", "number": "number", "string": "text", "boolean": "`true` or `false`"}
    return f"{names.get(rule.get('type', ''), 'any value')}{_limits(rule)}"


def _list(rule: Mapping[str, Any]) -> str:
    if "prefixItems" in rule:
        return f"list of {len(rule['prefixItems'])}: {'; '.join(dict.fromkeys(map(_value, rule['prefixItems'])))}"
    low, high = rule.get("minItems", 0), rule.get("maxItems")
    count = f" ({low} to {high})" if high else f" (at least {low})" if low else ""
    return f"list{count} of {_value(rule.get('items', {}))}"


def _limits(rule: Mapping[str, Any]) -> str:
    """Return a number's limits in words; those that only keep out overflow are none."""
    words = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "exclusiveMaximum": "below"}
    found = [f"{word} {rule[key]:g}" for key, word in words.items() if abs(rule.get(key, LARGEST)) < LARGEST]
    return f", {' '.join(found)}" if found else ""


def presets() -> str:
    """Return tables of everything that is shipped under a name; links are those of a page in docs/reference."""
    parts = [
        _table("Scenarios", "`--scenario NAME`", _titled(PRESETS.glob("scenarios/*.json"))),
        _table("Laser scanners", "`--set scan.device=NAME`", _titled(PRESETS.glob("devices/*.json"))),
        _table("Recipes", "`synthroads dataset NAME`", _titled(PRESETS.glob("recipes/*.yaml"), _scenes)),
        _table("Trainings", "`synthroads train NAME`", _titled(CONFIGURATIONS.glob("*.yaml"))),
        _table(
            "Experiments",
            "`synthroads experiment NAME`",
            _titled(CONFIGURATIONS.glob("experiments/*.yaml")),
        ),
        _table("Libraries of assets", "`--set 'road.assets=[\"NAME\"]'`", _libraries()),
        _table("Tables of materials", "`--set materials_table=NAME`", _materials()),
    ]
    return "\n\n".join(parts)


def _table(heading: str, use: str, rows: Iterable[tuple[str, Path, str]]) -> str:
    lines = [f"| [`{name}`](../../{path.relative_to(ROOT).as_posix()}) | {text} |" for name, path, text in rows]
    return "\n".join([f"# {heading}", "", f"By name: {use}", "", "| name | what it is |", "|---|---|", *lines])


def _titled(
    paths: Iterable[Path], more: Callable[[dict[str, Any]], str] = lambda data: ""
) -> Iterator[tuple[str, Path, str]]:
    """Yield name, file, and title with what ``more`` says of the file's content."""
    for path in sorted(paths):
        data = read_json(path) if path.suffix == ".json" else read_yaml(path)
        yield path.stem, path, f"{data['title']}{more(data)}"


def _scenes(recipe: dict[str, Any]) -> str:
    scenes = sum(group["scenes"] for group in recipe["groups"])
    return f": {scenes} scenes. {' '.join(recipe.get('description', '').split())}"


def _libraries() -> Iterator[tuple[str, Path, str]]:
    for path in sorted(PRESETS.glob("assets/*/library.json")):
        yield path.parent.name, path, ", ".join(read_json(path)["assets"])


def _materials() -> Iterator[tuple[str, Path, str]]:
    for path in sorted(PRESETS.glob("material_tables/*.json")):
        names = ", ".join(read_json(path)["materials"])
        yield path.stem, path, f"in place of the usual ones: {names}"


GENERATED: dict[str, Callable[[], str]] = {
    **{f"fields-{name}": partial(fields, classes) for name, classes in FILES.items()},
    "commands": commands,
    "presets": presets,
}
"""Name of a mark -> what makes its text."""


@cache
def generated(name: str) -> str:
    """Return the text for a mark, its headings of the first level; raise `KeyError` if there is none of that name."""
    return GENERATED[name]()


def filled(page: str) -> str:
    """Return a page with the generated text in place of its marks, headings one level below the one before a mark."""

    def text(mark: re.Match[str]) -> str:
        levels = re.findall(r"^(#+) ", page[: mark.start()], re.MULTILINE) or [""]
        return re.sub("^#", f"{levels[-1]}#", generated(mark[1]), flags=re.MULTILINE)

    return MARK.sub(text, page)
