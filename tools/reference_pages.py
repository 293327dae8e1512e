"""The parts of the reference that are made from code when the documentation is built: commands, fields, presets.

`docs/conf.py` puts them in the place of ``<!-- generated: NAME -->`` in a page; `GENERATED` holds the names. Fields
come from the JSON Schemas that pydantic derives from the classes which read the files, so that types, limits, defaults
and descriptions are those that a file is checked against.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

from headless.list import KINDS
from synthroads_addon.base.catalogue import Entry, Kind, entries
from synthroads_addon.base.field_list import Wording, class_of
from synthroads_addon.base.schema import Model
from tools.reference_commands import commands

ROOT = Path(__file__).resolve().parents[1]
MARK = re.compile(r"<!-- generated: ([a-z-]+) -->")

FILES = {
    "scenario": ["synthroads_addon.scenario.scenario:Scenario"],
    "parameters": ["synthroads_addon.road.parameters:RoadParameters"],
    "recipe": ["synthroads_addon.dataset.recipe:Recipe"],
    "device": ["synthroads_addon.scanning.devices.device:Device"],
    "materials": ["synthroads_addon.materials.table:MaterialTable"],
    "classes": ["synthroads_addon.base.classes:ClassTable"],
    "mapping": ["ml.data.classes:LabelMapping", "synthroads_addon.base.class_mapping:ClassMapping"],
    "assets": ["synthroads_addon.scenario.assets:AssetLibrary"],
    "segmentation": [
        "ml.segmentation.recipes:SegmentationConfiguration",
        "ml.segmentation.experiment:Experiment",
    ],
    "centerline": ["ml.centerline.task:CenterlineConfiguration", "ml.centerline.experiment:Experiment"],
}
"""Name of a page part -> the classes that read the files which it describes."""
_WORDING = Wording(lambda text: f"`{text}`", lambda name: f"[{name}](#{name.lower()})")


def fields(classes: Sequence[str]) -> str:
    """Return Markdown with a table of fields for each class and for every class that they contain.

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
    """Return Markdown of one class: heading, description and table of fields; ``parts`` are the schemas by name."""
    schema = parts[name]
    text = schema.get("description", "").split("\n\nAttributes:")[0]
    rows = []
    for field, rule in schema["properties"].items():
        same = parts[class_of(rule)].get("description", "") if "$ref" in rule else ""  # pydantic says it once
        cells = {"description": same.partition("\n")[0], **rule}
        rows.append(_row(field, cells, field in schema.get("required", ())))
    head = ["| field | value | default | meaning |", "|---|---|---|---|"]
    return "\n".join([f"# {name}", "", _plain(text), "", *head, *rows])


def _plain(docstring: str) -> str:
    """Return a docstring's text as Markdown: double backticks become single ones, < is escaped."""
    return docstring.replace("``", "`").replace("<", "\\<")


def _row(field: str, rule: dict[str, Any], required: bool) -> str:
    unit = "" if rule.get("unit") in (None, "1") else f" ({rule['unit']})"
    default = "**required**" if required else _default(rule)
    cells = [f"`{field}`", f"{_WORDING.value(rule)}{unit}", default, _plain(rule.get("description", ""))]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _default(rule: dict[str, Any]) -> str:
    """Return a field's default as Markdown code; empty for None, for objects but ranges, and for long ones."""
    value = rule.get("default")
    if value is None:
        return ""
    if isinstance(value, dict):
        return f"{value['minimum']:g} to {value['maximum']:g}" if set(value) == {"minimum", "maximum"} else ""
    text = json.dumps(value)
    return f"`{text}`" if len(text) <= 60 else ""


def presets() -> str:
    """Return Markdown tables of everything that is shipped under a name, linked as from docs/reference."""
    return "\n\n".join(map(_table, KINDS.values()))


def _table(kind: Kind) -> str:
    files = ((one, one.file.relative_to(ROOT).as_posix()) for one in entries(kind))
    rows = [f"| [`{one.name}`](../../{file}) | {_what(one)} |" for one, file in files]
    return "\n".join([f"# {kind.title}", "", f"By name: `{kind.use}`", "", "| name | what it is |", "|---|---|", *rows])


def _what(one: Entry) -> str:
    """Return a catalogue entry's description: its title, with the key figures of those made of others."""
    if "scenes" in one.figures:
        return f"{one.title}: {one.figures['scenes']} scenes. {one.note}"
    for parts in ("assets", "materials"):
        if parts in one.figures:
            return f"{one.title}: {', '.join(one.figures[parts])}"
    return one.title


GENERATED: dict[str, Callable[[], str]] = {
    **{f"fields-{name}": partial(fields, classes) for name, classes in FILES.items()},
    "commands": commands,
    "presets": presets,
}
"""Name of a mark -> what makes its text."""


@cache
def generated(name: str) -> str:
    """Return the Markdown generated for a mark's name, headings from level 1, cached; KeyError for unknown names."""
    return GENERATED[name]()


def filled(page: str) -> str:
    """Return a page with its marks replaced by generated text, headings one level below the one before each mark."""

    def text(mark: re.Match[str]) -> str:
        levels = re.findall(r"^(#+) ", page[: mark.start()], re.MULTILINE) or [""]
        return re.sub("^#", f"{levels[-1]}#", generated(mark[1]), flags=re.MULTILINE)

    return MARK.sub(text, page)
