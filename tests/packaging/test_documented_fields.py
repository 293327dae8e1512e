"""Objects, limits and conditions in the documentation are those of the code."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic.fields import FieldInfo

from synthroads_addon.base.schema import ClosedModel, Model, unit_of
from synthroads_addon.road.parameters import Metadata
from synthroads_addon.road.section import Lane, Pavement, Pothole, Ramp, Rut
from synthroads_addon.road.surroundings import Environment, MaterialVariation
from synthroads_addon.road.things.gantry import GantrySign
from synthroads_addon.road.things.limits import Interval
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.parameter_sets import LIBRARY_ONLY, OBJECTS

DOCS = Path(__file__).parents[2] / "docs"


def fields_of(model: type[Model], path: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Yield the dotted path of every limit of a scenario, intervals as a whole."""
    for name, field in model.model_fields.items():
        if isinstance(field.default, ClosedModel) and not isinstance(field.default, Interval):
            yield from fields_of(type(field.default), f"{path}{name}.")
        else:
            yield path + name, field


def shown(field: FieldInfo) -> str:
    """Return a default as the documentation writes it."""
    value, unit = field.default, f" {unit_of(field)}".removesuffix(" 1").replace("m2", "m²").rstrip()
    if isinstance(value, Interval):
        return f"{value.minimum:g} to {value.maximum:g}{unit}"
    if isinstance(value, bool) or value is None:
        return "–" if value is None else f"`{value}`".lower()
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    return f"`{value}`" if isinstance(value, str) else f"{value:g}{unit}"


def test_every_limit_is_documented_with_its_default() -> None:
    rows = {
        cells[1].strip(" `"): cells[3].strip()
        for line in (DOCS / "scenario.md").read_text(encoding="utf-8").splitlines()
        if len(cells := line.split("|")) == 5
    }
    assert {path: rows.get(path) for path, _ in fields_of(RoadScenario)} == {
        path: shown(field) for path, field in fields_of(RoadScenario)
    }


@pytest.mark.parametrize("kind", OBJECTS)
def test_every_object_is_documented_with_its_fields(kind: str) -> None:
    text = (DOCS / "parameters.md").read_text(encoding="utf-8")
    common = {"type", "instance", "station", "offset", "elevation", "rotation_deg", "start_station", "end_station"}
    common |= {"lean_deg", "lean_direction_deg"}
    row = re.search(rf"^\| `{kind}` .*$", text, re.MULTILINE)
    assert row
    assert [name for name in OBJECTS[kind].model_fields if name not in common and f"`{name}`" not in row[0]] == []


PARTS = {
    Environment: "`environment`: ",
    MaterialVariation: "`materials`: ",
    Metadata: "`metadata`: ",
    Lane: "| `Carriageway` ",
    Pavement: "| its `pavement` ",
    Rut: "| its `pavement` ",
    Pothole: "| its `pavement` ",
    Ramp: "| `Turnout` ",
    GantrySign: "| `Gantry` ",
}
"""Part of an object or of a set -> how its row or paragraph begins."""


@pytest.mark.parametrize("model", PARTS)
def test_every_part_is_documented_with_its_fields(model: type[Model]) -> None:
    text = (DOCS / "parameters.md").read_text(encoding="utf-8")
    begin = text.index(f"\n{PARTS[model]}")
    passage = text[begin : text.index("\n" if PARTS[model].startswith("|") else "\n\n", begin + 1)]
    assert [name for name in model.model_fields if f"`{name}`" not in passage] == []


def test_conditions_that_the_schema_lacks_are_documented() -> None:
    text = (DOCS / "parameters.md").read_text(encoding="utf-8")
    assert [name for name in LIBRARY_ONLY if name not in " ".join(text.split())] == []
