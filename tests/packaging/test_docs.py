"""The documentation holds together: every page is found, every link leads somewhere, every command is understood.

The site itself is built by `make docs`, which fails on whatever its generator complains of.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from headless.cli import COMMANDS, build_parser
from synthroads_addon.dataset.recipe import Recipe, scene_jobs
from synthroads_addon.scenario.scenario import load_scenario, scenario_names
from tests.packaging.docs_pages import (
    DOCS,
    MADE_BY_THE_BUILD,
    PAGES,
    ROOT,
    adds_fields,
    anchors,
    commands,
    current,
    entries,
    fences,
    files,
    imports,
    links,
    modules,
    saved_files,
)
from tools.reference_pages import FILES, GENERATED, MARK, filled, generated, stale_pages

README = ROOT / "README.md"
CHANGELOG = ROOT / "CHANGELOG.md"
LAYOUT = DOCS / "extend" / "layout.md"
ADDON = ROOT / "synthroads_addon"
IMPORTS = sorted({statement for page in [README, CHANGELOG, *PAGES] for statement in imports(current(page))})
WITH_PYTORCH = {f"fields-{name}" for name, classes in FILES.items() if any(c.startswith("ml.") for c in classes)}


CHARTS = ("centerline-", "segmentation-", "tutorial-")
"""Pictures that may have a palette: charts of few colours."""


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


every_page = pytest.mark.parametrize("page", [README, CHANGELOG, *PAGES], ids=name_of)


def test_every_page_is_in_the_navigation_once() -> None:
    named = Counter(entry for page in PAGES for entry in entries(page))
    pages = {page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES} - {"index"}
    assert named == Counter(pages | MADE_BY_THE_BUILD)


def test_what_is_read_first_is_short() -> None:
    guides = sorted((DOCS / "guide").glob("*.md"))
    first = [README, DOCS / "start.md", DOCS / "tasks.md", *sorted((DOCS / "tutorials").glob("*.md")), *guides]
    words = {name_of(page): len(page.read_text(encoding="utf-8").split()) for page in first}
    assert words["README.md"] < 700
    assert [name for name in map(name_of, guides) if words[name] > 1200] == []
    assert sum(words.values()) < 20_000


@pytest.mark.parametrize(
    ("heading", "rows"),
    [
        ("What it needs", {"`rq31-600m` (standard fidelity)", "`tripod-200m`"}),
        ("If it doesn't work", {"`synthroads: command not found`", "exit code 3"}),
        ("Words", {"RQ 31", "EKA 1 A", "station", "strip", "return", "fidelity", "twin"}),
    ],
)
def test_tasks_answers_the_usual_questions(heading: str, rows: set[str]) -> None:
    text = (DOCS / "tasks.md").read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    first_cells = re.findall(r"(?m)^\| (.+?) \|", text)[1:]
    assert rows <= set(first_cells)
    assert heading != "If it doesn't work" or len(first_cells) >= 10


@every_page
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in links(text):
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.is_file(), target
        if anchor:
            assert anchor in anchors(path.read_text(encoding="utf-8")), target


@cache
def parser() -> argparse.ArgumentParser:
    return build_parser()


def parsed(words: list[str]) -> Any:
    """Parse a command's words after `synthroads`; fail where the parser complains. Some end it before it is done."""
    if words[0] in ("--help", "--print-completion"):
        return None
    try:
        return parser().parse_args(words)
    except SystemExit:
        pytest.fail(f"synthroads {' '.join(words)}")


def command_lines(text: str) -> list[list[str]]:
    """Return the words after `synthroads` of all commands, however they are called."""
    lines = [words[1:] for words in commands(text, "synthroads")]
    for words in commands(text, "python"):
        if words[1:2] == ["-m"] and (match := re.fullmatch(r"headless\.(\w+)", words[2])):
            lines.append([match[1], *words[3:]])
    for words in commands(text, "blender"):
        script = next((Path(word) for word in words if word.startswith("headless/")), None)
        if script:
            lines.append([script.stem, *words[words.index("--") + 1 :]])
    return [words for words in lines if "..." not in words]


@every_page
def test_commands_are_understood(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in command_lines(page.read_text(encoding="utf-8")):
        arguments = parsed(words)
        changes = getattr(arguments, "changes", [])
        if words[0] == "generate" and arguments.scenario in scenario_names() and not adds_fields(page):
            load_scenario(arguments.scenario, changes)  # refuses fields that aren't there and values out of limits


@pytest.mark.parametrize("picture", sorted((DOCS / "pictures").glob("*.png")), ids=lambda path: path.stem)
def test_pictures_keep_their_colours(picture: Path) -> None:
    """A palette of 256 colours takes the red of beacons and the blue of signs."""
    with Image.open(picture) as image:
        assert image.mode in ("RGB", "RGBA") or (image.mode == "P" and picture.name.startswith(CHARTS))


def test_commands_are_found() -> None:
    found = {words[0] for page in [README, *PAGES] for words in command_lines(page.read_text(encoding="utf-8"))}
    assert set(COMMANDS) <= found, "each command is shown somewhere"


@every_page
def test_modules_and_targets_that_are_run_are_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for words in commands(text, "python"):
        if words[1] == "-m" and words[2].split(".")[0] == "headless":
            assert find_spec(words[2].rpartition(".")[0]), words
            assert (ROOT / f"{words[2].replace('.', '/')}.py").is_file(), words
        elif words[1].endswith(".py") and not words[1].startswith("my"):
            assert (ROOT / words[1]).is_file(), words
    for words in commands(text, "make"):
        for word in words[1:]:
            variable, equals, _ = word.partition("=")
            assert re.search(rf"(?m)^{variable} \?=" if equals else rf"(?m)^{word}:", makefile), words


@every_page
def test_python_compiles(page: Path) -> None:
    for block in fences(page.read_text(encoding="utf-8"), "python"):
        ast.parse(block)


def test_imports_are_found() -> None:
    shown = set(imports(README.read_text(encoding="utf-8")))
    assert "from synthroads_addon import Job, generate, load_scenario" in shown
    assert "from synthroads_addon.core.errors import InputError" not in IMPORTS, "that is how it was called"
    assert "from synthroads_addon.base.errors import InputError" in IMPORTS
    assert [statement for statement in IMPORTS if not statement.isprintable()] == []


@pytest.mark.parametrize(
    ("package", "library"),
    [
        ("synthroads_addon", None),
        pytest.param("ml", "torch", marks=pytest.mark.first_python),
        ("synthroads_addon.blender", "bpy"),
    ],
)
def test_imports_that_are_shown_work(package: str, library: str | None) -> None:
    """Run every import statement of the pages, without Blender where it isn't of its packages."""
    if library and find_spec(library) is None:
        pytest.skip(f"needs {library}")
    statements = [statement for statement in IMPORTS if package_of(statement) == package]
    assert statements
    code = f"""
import os, sys
if {library != "bpy"}:
    sys.modules["bpy"] = None # importing it raises ImportError
for statement in {statements!r}:
    try:
        exec(statement)
    except ImportError as problem:
        sys.exit(f"{{statement}}: {{problem}}")
os._exit(0) # Blender's own teardown can crash
"""
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr


def package_of(statement: str) -> str:
    """Return which package a statement is about: learning, the one that needs Blender, or the rest of the library."""
    parts = statement.split()[1].split(".")
    if parts[0] == "ml":
        return "ml"
    return "synthroads_addon.blender" if {"blender", "ui"} & set(parts[1:2]) else "synthroads_addon"


@every_page
def test_what_is_named_is_there(page: Path) -> None:
    """Modules and the names in them, files, folders, and tests."""
    text = current(page)
    assert [name for name in sorted(modules(text)) if not is_there(name)] == []
    for name in sorted(files(text) - saved_files(page)):
        file, *tests = name.split("::")
        there = next((root / file for root in (ROOT, ADDON) if (root / file).exists()), None)
        assert there, name
        for test in tests:
            assert re.search(rf"(def|class) {test}\b", there.read_text(encoding="utf-8")), name


def is_there(name: str) -> bool:
    """Return whether a dotted name is a module of ours, or something that a module of ours defines or imports."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:count])
        if path.is_dir() or path.with_suffix(".py").is_file():
            return count == len(parts) or parts[count] in defined(".".join(parts[:count]))
    return False


def defined(module: str) -> set[str]:
    """Return the names that a module of ours defines or imports, read from its source: no PyTorch, no Blender."""
    path = ROOT / module.replace(".", "/")
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    names: set[str] = set()
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {target.id for target in targets if isinstance(target, ast.Name)}
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {alias.asname or alias.name for alias in node.names}
    return names


def test_the_layout_has_every_floor_in_its_place() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    floors = next(one["layers"] for one in contracts if one.get("containers") == ["synthroads_addon"])
    text = LAYOUT.read_text(encoding="utf-8").partition("\n## Floors\n")[2].partition("\n## ")[0]
    rows = re.findall(r"(?m)^\| (`\w+`(?:, `\w+`)*) \|", text)
    assert [set(re.findall(r"\w+", row)) for row in rows] == [set(re.findall(r"\w+", floor)) for floor in floors]


def test_the_layout_has_every_folder() -> None:
    named = paths(LAYOUT)
    folders = [path.parent.relative_to(ADDON).as_posix() for path in ADDON.glob("*/*/__init__.py")]
    learning = [path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "ml").rglob("*/__init__.py")]
    studies = [path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "studies").glob("*/*.py")]
    assert sorted({*folders, *learning, *studies} - named - {"presets"}) == []


def test_what_the_layout_names_is_there() -> None:
    assert [name for name in sorted(paths(LAYOUT)) if not ((ROOT / name).exists() or (ADDON / name).exists())] == []


def paths(page: Path) -> set[str]:
    """Return what a page names with a slash in it."""
    return {name for name in re.findall(r"`([\w./-]+)`", page.read_text(encoding="utf-8")) if "/" in name}


def test_recipes_are_recipes() -> None:
    yaml = pytest.importorskip("yaml")
    blocks = [block for page in PAGES for block in fences(page.read_text(encoding="utf-8"), "yaml")]
    recipes = [data for block in blocks if (data := yaml.safe_load(block)).get("type") == "Recipe"]
    assert len(recipes) >= 2
    for data in recipes:
        recipe = Recipe.from_dict(data)
        assert len(scene_jobs(recipe)) == sum(group.scenes for group in recipe.groups)


def test_every_generated_part_has_its_place() -> None:
    marks = Counter(mark for page in PAGES for mark in MARK.findall(page.read_text(encoding="utf-8")))
    assert marks == Counter(list(GENERATED))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.first_python if name in WITH_PYTORCH else ()) for name in GENERATED]
)
def test_generated_parts_say_what_everything_is(name: str) -> None:
    if name in WITH_PYTORCH:
        pytest.importorskip("torch")
    text = generated(name)
    assert not MARK.search(text)
    rows = re.findall(r"(?m)^\| (.*) \|$", text)
    wide = {len(re.split(r"(?<!\\)\|", row)) for row in rows}
    assert len(wide) == 1, "all tables of a part have the same columns"
    assert [row for row in rows if row.startswith(("`", "[`"))], "it names something"
    unsaid = [row for row in rows if row.endswith("| ") and row.split("`")[1] not in ("type", "version")]
    assert unsaid == []
    assert all(f"](#{target})" not in text or target in anchors(text) for target in re.findall(r"\]\(#([^)]+)\)", text))


@pytest.mark.first_python
def test_the_reference_is_what_the_code_says() -> None:
    """`python tools/reference_pages.py` writes it anew."""
    pytest.importorskip("torch")
    assert [path.name for path in stale_pages()] == []


def test_the_reference_of_commands_has_all_of_them() -> None:
    assert set(COMMANDS) <= {heading.strip() for heading in re.findall(r"(?m)^# (.*)$", generated("commands"))}


def test_the_reference_of_commands_shows_no_option_that_help_hides() -> None:
    text = generated("commands")
    assert "SUPPRESS" not in text
    assert "`--part " not in text
    assert "`--tolerance M`" not in text


def test_headings_of_generated_parts_lie_below_the_one_before() -> None:
    page = "# Page\n\n## Recipes\n\n<!-- generated: fields-recipe -->\n<!-- end: fields-recipe -->\n"
    assert filled(filled(page)) == filled(page)
    assert [line for line in filled(page).splitlines() if line.startswith("#")][:3] == [
        "# Page",
        "## Recipes",
        "### Recipe",
    ]
