"""Every format of the geometric-semantic model that the table of formats has, and the one of the documentation."""

from __future__ import annotations

import ast
import csv
from collections.abc import Iterator
from pathlib import Path

import pytest

from synthroads_addon.road.objects import PointObject
from synthroads_addon.twin.formats import FORMATS, TWIN_FORMATS, FormatEntry, missing_package, write_twin
from tests.helpers.page_modules import block_of_page, module_of_page
from tests.helpers.roads.twin_roads import one_of_many
from tests.twin.test_geojson import features_of

TWIN = Path(__file__).parents[2] / "synthroads_addon" / "twin"
HOMES = {entry.module.split(".")[1] for entry in FORMATS.values()}
"""File or folder of each format."""
PAGE = "extend/twin-format.md"


@pytest.mark.parametrize("name", TWIN_FORMATS)
def test_a_format_is_written_to_its_file_with_the_same_bytes_each_time(name: str, tmp_path: Path) -> None:
    if package := missing_package(name):
        pytest.skip(f"needs {package}")
    road, entry = one_of_many(3), FORMATS[name]
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        write_twin(road, tmp_path / folder, [name])
    one, two = (tmp_path / folder / entry.file for folder in ("one", "two"))
    assert one.stat().st_size > 100
    assert one.read_bytes() == two.read_bytes()
    assert entry.label
    assert entry.description


def test_no_format_knows_another() -> None:
    """Nor does what they share know any; the table of formats names their modules as text."""
    known = {(home, other) for path in TWIN.rglob("*.py") for home, other in _imports(path) if other in HOMES - {home}}
    assert known == set()


def _imports(path: Path) -> Iterator[tuple[str, str]]:
    """Yield (file or folder of a module, file or folder that it imports) within the floor."""
    parts = path.relative_to(TWIN).with_suffix("").parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == len(parts):
            for name in [node.module] if node.module else [alias.name for alias in node.names]:
                yield parts[0], name.split(".")[0]


def test_the_format_of_the_page_has_every_object_at_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = eval(f"{{{block_of_page(PAGE, 'text')}}}", {"FormatEntry": FormatEntry})["objects"]
    module = module_of_page(PAGE, f"synthroads_addon/twin{entry.module.replace('.', '/')}.py", monkeypatch)
    road = one_of_many(2)
    module.write_objects(road, tmp_path / entry.file, 0.005)
    with (tmp_path / entry.file).open(encoding="utf-8", newline="") as file:
        rows = {row["id"]: row for row in csv.DictReader(file)}
    assert set(rows) == set(road.of_type(PointObject))
    points = {f["properties"]["id"]: f for f in features_of(road, tmp_path) if f["geometry"]["type"] == "Point"}
    assert len(set(rows) & set(points)) > 3
    for name in set(rows) & set(points):
        place = [float(rows[name][axis]) for axis in "xy"]
        assert place == pytest.approx(points[name]["geometry"]["coordinates"][:2], abs=1e-3)
        assert int(rows[name]["instance"]) == points[name]["properties"]["instance"]
