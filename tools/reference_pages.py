"""Write the parts of docs/reference that are made from code: commands, fields, presets.

    python tools/reference_pages.py            # writes them into the pages
    python tools/reference_pages.py --check    # compares them with what the pages say

Each part stands in its page between ``<!-- generated: NAME -->`` and ``<!-- end: NAME -->``; `GENERATED` holds the
names. Fields come from the JSON Schemas that pydantic derives from the classes which read the files, so that types,
limits, defaults and descriptions are those that a file is checked against.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.list import KINDS
from synthroads_addon.base.catalogue import Entry, Kind, entries
from synthroads_addon.base.field_list import Wording, class_of
from synthroads_addon.base.schema import Model
from tools.reference_commands import commands

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs" / "reference"
MARK = re.compile(r"<!-- generated: ([a-z-]+) -->\n(?:.*?\n)?<!-- end: \1 -->", re.DOTALL)

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
    """Return a class of a module, both by name."""
    model: type[Model] = getattr(import_module(module), name)
    return model


def _section(name: str, parts: dict[str, dict[str, Any]]) -> str:
    """Return Markdown of one class: heading, description and table of fields; ``parts`` are the schemas by name."""
    schema = parts[name]
    text = schema.get("description", "").split("\n\nAttributes:")[0]
    rows = []
    for field, rule in schema["properties"].items():
        class_text = parts[class_of(rule)].get("description", "") if "$ref" in rule else ""  # pydantic says it once
        cells = {"description": class_text.partition("\n")[0], **rule}
        rows.append(_row(field, cells, field in schema.get("required", ())))
    head = ["| field | value | default | meaning |", "|---|---|---|---|"]
    return "\n".join([f"# {name}", "", _plain(text), "", *head, *rows])


def _plain(docstring: str) -> str:
    """Return a docstring's text as Markdown: double backticks become single ones, < is escaped."""
    return docstring.replace("``", "`").replace("<", "\\<")


def _row(field: str, rule: dict[str, Any], is_required: bool) -> str:
    """Return the row of a field in a table of Markdown."""
    unit = "" if rule.get("unit") in (None, "1") else f" ({rule['unit']})"
    default = "**required**" if is_required else _default(rule)
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
    """Return a kind's shipped entries as a table of Markdown."""
    files = ((entry, entry.file.relative_to(ROOT).as_posix()) for entry in entries(kind))
    rows = [f"| [`{entry.name}`](../../{file}) | {_what(entry)} |" for entry, file in files]
    return "\n".join([f"# {kind.title}", "", f"By name: `{kind.use}`", "", "| name | what it is |", "|---|---|", *rows])


def _what(entry: Entry) -> str:
    """Return a catalogue entry's description: its title, with the key figures of those made of others."""
    if "scenes" in entry.figures:
        return f"{entry.title}: {entry.figures['scenes']} scenes. {entry.note}"
    for parts in ("assets", "materials"):
        if parts in entry.figures:
            return f"{entry.title}: {', '.join(entry.figures[parts])}"
    return entry.title


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
    """Return a page with the text between its marks made anew, headings one level below the one before each mark."""

    def text(mark: re.Match[str]) -> str:
        """Return a mark with its text made anew, headings one level below those before it."""
        levels = re.findall(r"^(#+) ", page[: mark.start()], re.MULTILINE) or [""]
        part = re.sub("^#", f"{levels[-1]}#", generated(mark[1]), flags=re.MULTILINE)
        return f"<!-- generated: {mark[1]} -->\n\n{part}\n\n<!-- end: {mark[1]} -->"

    return MARK.sub(text, page)


def stale_pages() -> dict[Path, str]:
    """Return the pages of the reference that aren't what the code says, with the text that they should have."""
    pages = {path: path.read_text(encoding="utf-8") for path in sorted(PAGES.glob("*.md"))}
    return {path: new_text for path, text in pages.items() if (new_text := filled(text)) != text}


def main() -> int:
    """Write the pages anew, or with ``--check`` name those that would change and return 1."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing: fail if a page isn't current")
    arguments, new_texts = parser.parse_args(), stale_pages()
    for path, text in new_texts.items():
        print(f"{path.relative_to(ROOT)} is not current" if arguments.check else f"written {path.relative_to(ROOT)}")
        if not arguments.check:
            path.write_text(text, encoding="utf-8")
    return 1 if arguments.check and new_texts else 0


if __name__ == "__main__":
    sys.exit(main())
