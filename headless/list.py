"""List shipped names (scenarios, scanners, recipes, classes, trainings, ...) and the fields that --set takes."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import ml.catalogue
from headless import catalogue
from headless.commands import Outcome, entry
from ml.configuration import configuration_kind
from synthroads_addon.base.catalogue import Kind, entries
from synthroads_addon.base.errors import InputError, nearest_name
from synthroads_addon.base.field_list import FieldEntry, fields_of
from synthroads_addon.base.text.table import text_table
from synthroads_addon.scenario.scenario import Scenario

_FIELDS = "fields"
_LONGEST_DEFAULT = 24
KINDS: dict[str, Kind] = {**catalogue.KINDS, **ml.catalogue.KINDS}
"""Kinds of things that are listed."""


_OWNERS: dict[str, Callable[[], Any]] = {
    "scenario": lambda: Scenario,
    "segmentation": partial(configuration_kind, "segmentation"),
    "centerline": partial(configuration_kind, "centerline"),
}
"""Things that have fields which ``--set`` takes, with their classes: of `train` and `experiment` the task's."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads list` to its parser."""
    text = f"{', '.join(KINDS)}, or {_FIELDS}: what --set takes (the kinds themselves)"
    parser.add_argument("kind", nargs="?", metavar="KIND", help=text)
    text = "only names, or paths of fields, that begin with this; or your files or folders of them (all shipped names)"
    parser.add_argument("names", nargs="*", metavar="NAME_OR_FILE", help=text)
    parser.words = "names"  # type: ignore[attr-defined]
    text = "list the fields of a scenario or of a training (%(default)s)"
    parser.add_argument("--of", choices=_OWNERS, default="scenario", help=text)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads list`; return exit code, the listed entries as JSON data and a printed table."""
    words = [*filter(None, [arguments.kind]), *arguments.names]  # after an option all of them are names
    name, *names = words or [None]
    if name != _FIELDS and arguments.of != "scenario":
        raise InputError("--of", arguments.of, f"is for {_FIELDS} only")
    if name is None:
        return _kinds()
    if name == _FIELDS:
        return _fields(arguments.of, names)
    if name not in KINDS:
        kinds = [*KINDS, _FIELDS]
        raise InputError("KIND", name, f"must be one of {', '.join(kinds)}{nearest_name(name, kinds)}")
    data = {name: [entry.to_dict() for entry in entries(KINDS[name], names)]}
    return 0, data, "\n".join(listing(name, names))


def listing(kind_name: str, names: Sequence[str]) -> list[str]:
    """Return the lines that show the entries of a kind: those of some names or files, or all if there are none."""
    kind = KINDS[kind_name]
    rows = [(entry.name, *row) for entry in entries(kind, names) for row in kind.rows(entry)]
    return [*text_table(("name", *kind.head), rows), "", f"use: {kind.use}"]


def _kinds() -> Outcome:
    """Return the outcome of `list` without a kind: number, title and use of every kind, the fields of --set last."""
    summaries = {name: (len(kind.names()), kind.title, kind.use) for name, kind in KINDS.items()}
    field_count = sum(1 for _ in fields_of(Scenario))
    summaries[_FIELDS] = (field_count, "Fields of a scenario; of trainings with --of", "--set PATH=VALUE")
    rows = [(name, str(count), title, use) for name, (count, title, use) in summaries.items()]
    data = {name: {"count": count, "title": title, "use": use} for name, (count, title, use) in summaries.items()}
    return 0, {"kinds": data}, "\n".join(text_table(("kind", "number", "what it is", "use"), rows))


def _fields(owner: str, prefixes: Sequence[str]) -> Outcome:
    """Return the outcome of `list fields`: all fields of an owner whose paths begin with one of the prefixes."""
    fields = list(fields_of(_OWNERS[owner]()))
    for text in prefixes:
        if not any(field.path.startswith(text) for field in fields):
            raise InputError(_FIELDS, text, f"no field of the {owner} begins so; `synthroads list fields` has them all")
    listed_fields = [field for field in fields if not prefixes or field.path.startswith(tuple(prefixes))]
    intervals = tuple(f"{field.path}." for field in listed_fields if field.interval)
    rows_of_fields = [field for field in listed_fields if not (intervals and field.path.startswith(intervals))]
    rows = [_row(field) for field in rows_of_fields]
    return (
        0,
        {_FIELDS: [field.to_dict() for field in listed_fields]},
        "\n".join(text_table(("path", "default", "meaning"), rows)),
    )


def _row(field: FieldEntry) -> tuple[str, str, str]:
    """Return the table cells (path, default, meaning) of a field; an interval's two fields share one row."""
    if field.interval:
        range_text = (
            f"{field.default['minimum']:g} to {field.default['maximum']:g} {field.unit}" if field.default else ""
        )
        return (
            f"{field.path}.{{minimum,maximum}}",
            range_text.strip(),
            f"{field.description} [two numbers{_in(field.unit)}]",
        )
    text = "" if field.default is None or isinstance(field.default, dict) else json.dumps(field.default).strip('"')
    value_text = (
        f"{'one of ' if field.allowed else ''}{field.value}{_in(field.unit)}{', required' if field.required else ''}"
    )
    if len(text) > _LONGEST_DEFAULT:
        text, value_text = "...", f"{value_text}; by default {text}"
    elif text and field.unit:
        text = f"{text} {field.unit}"
    return field.path, text, f"{field.description} [{value_text}]"


def _in(unit: str) -> str:
    """Return a unit as the end of a description; empty without a unit."""
    return f", in {unit}" if unit else ""


if __name__ == "__main__":
    entry("list")
