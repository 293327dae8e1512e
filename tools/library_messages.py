"""The texts of the library that reach Blender's window: errors, remarks, rules, fixes, names of classes.

They are read from the source, with holes ``{0}``, ``{1}``, ... where something is filled in, of all modules that the
panel imports; see `translations`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1] / "synthroads_addon"
_ERRORS = {"InputError": 2, "MissingFileError": 2, "OutputError": 2}
"""Error -> place of the argument that says what is allowed."""
_SHOWN = _ERRORS | {
    "warn": 0,
    "assume": 0,
    "Finding": 4,
    "at_least": 4,
    "at_most": 4,
    "Rule": 1,
    "Fix": 0,
    "with_remedy": 1,
    "_vertical_fix": 0,
    "_of_elements": 0,
}
"""Function of the library -> place of its argument that users read."""
_FORMAT = re.compile(r"%[-+ #0]*[\d.]*[sdrgfe]")
_HOLE = re.compile(r"\{\d\}")
_HOLES = re.compile(r"(?:\{\d\})+")
"""Holes beside each other, which nothing tells apart, and which count as one."""
_DEEPEST = 5
"""Most names that are followed from a text to where it is written; chosen: none needs more than three."""
_FEWEST_LETTERS = 3
"""Letters that a text with holes has at least, to be translated as a whole; chosen."""
_BY_NAME = ("twin", "cloud/formats", "road/things", "scanning/patterns", "scanning/platforms")
"""Folders whose modules are loaded by name, not imported."""
_FEWEST_OF_A_PART = 8
"""The same of a text that stands in another's hole: one with fewer, such as ``{0} of {1}``, would match anything."""
_UNSEEN = ("jobs/dataset/cluster.py", "jobs/measure", "jobs/choose", "comparison", "base/process", "base/compiled")
"""Modules that the panel imports and whose errors only commands can meet."""


def library_messages() -> set[str]:
    """Return the texts of the library that the panel shows, with holes where something is filled in."""
    modules = {path: Module(path) for path in sorted(_imported())}
    texts: set[str] = set()
    for path, module in modules.items():
        place = path.relative_to(PACKAGE).as_posix()
        if not place.startswith(("ui/", *_UNSEEN)):
            texts |= set(module.messages())
    return texts


def data_messages() -> set[str]:
    """Return the texts of data that the panel shows: classes, scenarios, obstacles, sources of rules, unset fields."""
    from synthroads_addon.base.classes import classes
    from synthroads_addon.road.guidelines import GUIDELINE_OF_CLASS
    from synthroads_addon.road.things.registry import THINGS
    from synthroads_addon.scenario.scenario import Scenario, load_scenario, scenario_names
    from synthroads_addon.ui.fields.wording import title_case

    texts = {title_case(row.name) for row in classes()} | set(_unset_texts(Scenario.model_json_schema()))
    texts |= {re.sub(r"^\d+", "{0}", load_scenario(name).title) for name in scenario_names()}
    texts |= {str(thing.obstacle) for thing in THINGS.values() if getattr(thing, "obstacle", "")}
    for guideline in GUIDELINE_OF_CLASS.values():
        texts |= {row.source for row in guideline.quantities.values() if row.source}
        texts |= {str(row.sure) for row in guideline.quantities.values()}
    return texts


def _unset_texts(schema: Any) -> Iterator[str]:
    """Yield what a schema's fields say instead of a value that isn't given."""
    for name, part in schema.items() if isinstance(schema, dict) else enumerate(schema):
        if name == "unset" and isinstance(part, str):
            yield part
        elif isinstance(part, dict | list):
            yield from _unset_texts(part)


def _imported() -> set[Path]:
    """Return the source files that the panel imports, directly or not, and those that are loaded by their names."""
    waiting = [PACKAGE / "__init__.py", *(PACKAGE / "ui").rglob("*.py")]
    waiting += [
        path
        for folder in ("twin", "road/things", "scanning/patterns", "scanning/platforms")
        for path in (PACKAGE / folder).rglob("*.py")
    ]
    waiting += (PACKAGE / "cloud" / "formats").glob("*.py")
    seen: set[Path] = set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        waiting += _imports_of(path)
    return seen


def _imports_of(path: Path) -> Iterator[Path]:
    """Yield the package's files that one imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            for target in (base, *(base / item.name for item in node.names)):
                yield from (file for file in (target.with_suffix(".py"), target / "__init__.py") if file.is_file())


class Module:
    """A module of the library, whose texts are followed from where they are shown to where they are written."""

    def __init__(self, path: Path) -> None:
        self._tree = ast.parse(path.read_text("utf-8"))

    def messages(self) -> Iterator[str]:
        """Yield the texts that users read."""
        for node, function in self._calls:
            name = _name_of(node)
            place = _SHOWN.get(name)
            if place is not None and len(node.args) > place:
                for text in self.texts(node.args[place], function):
                    yield from _parts(text, name)

    @cached_property
    def _calls(self) -> list[tuple[ast.Call, ast.FunctionDef | None]]:
        """Return all calls, each with the function that it is in."""
        return list(_calls_in(self._tree, None))

    @cached_property
    def _functions(self) -> dict[str, ast.FunctionDef]:
        return {node.name: node for node in ast.walk(self._tree) if isinstance(node, ast.FunctionDef)}

    def texts(self, node: ast.expr, function: ast.FunctionDef | None, depth: int = 0) -> Iterator[str]:
        """Yield the texts that an expression may be, each with holes."""
        if depth > _DEEPEST:
            return
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield from self._filled(node, function, depth + 1)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
            yield from self._sums(node, function, depth)
        elif isinstance(node, ast.Name):
            yield from self._named(node.id, function, depth + 1)
        elif isinstance(node, ast.Call):
            yield from self._returned(node, function, depth + 1)
        for part in _alternatives(node):
            yield from self.texts(part, function, depth + 1)

    def _filled(self, node: ast.JoinedStr, function: ast.FunctionDef | None, depth: int) -> Iterator[str]:
        """Yield an f-string with holes, and the texts that may stand in them and are no mere names."""
        yield _holed(node)
        for part in node.values:
            if isinstance(part, ast.FormattedValue):
                yield from (text for text in self.texts(part.value, function, depth) if _is_phrase(text))

    def _sums(self, node: ast.BinOp, function: ast.FunctionDef | None, depth: int) -> Iterator[str]:
        """Yield the texts of two that are joined; one that isn't known is a hole."""
        left, right = ([*self.texts(side, function, depth + 1)] or ["{0}"] for side in (node.left, node.right))
        for before in left:
            for behind in right:
                yield _numbered(before + behind)

    def _named(self, name: str, function: ast.FunctionDef | None, depth: int) -> Iterator[str]:
        """Yield the texts that a name stands for: in its function, in the calls of that, or in the module."""
        assigned = list(_assignments(function or self._tree, name))
        if function and not assigned:
            parameters = [argument.arg for argument in function.args.args]
            if name in parameters:
                yield from self._given(function, name, parameters.index(name), depth)
                return
            assigned = list(_assignments(self._tree, name))
        for value in assigned:
            yield from self.texts(value, function, depth)

    def _given(self, function: ast.FunctionDef, name: str, place: int, depth: int) -> Iterator[str]:
        """Yield the texts that are given for a function's parameter in this module."""
        for call, caller in self._calls:
            if _name_of(call) != function.name:
                continue
            values = [keyword.value for keyword in call.keywords if keyword.arg == name]
            is_method = function.args.args[0].arg in ("self", "cls")
            values += call.args[place - is_method : place - is_method + 1]
            for value in values:
                yield from self.texts(value, caller, depth)

    def _returned(self, node: ast.Call, function: ast.FunctionDef | None, depth: int) -> Iterator[str]:
        """Yield the texts that a function of this module returns, or those of ``"".join`` and ``.format``."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "format":
            for text in self.texts(node.func.value, function, depth):
                yield _numbered(re.sub(r"\{[^}]*\}", "{0}", text))
        called = self._functions.get(_name_of(node))
        for part in ast.walk(called) if called else ():
            if isinstance(part, ast.Return) and part.value is not None:
                yield from self.texts(part.value, called, depth)


def _calls_in(node: ast.AST, function: ast.FunctionDef | None) -> Iterator[tuple[ast.Call, ast.FunctionDef | None]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Call):
            yield child, function
        yield from _calls_in(child, child if isinstance(child, ast.FunctionDef) else function)


def _name_of(node: ast.Call) -> str:
    """Return the last part of what is called."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _assignments(tree: ast.AST, name: str) -> Iterator[ast.expr]:
    """Yield the values that a name is given below a node."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name) and target.id == name:
                    yield node.value
        elif (
            isinstance(node, ast.AnnAssign | ast.NamedExpr | ast.AugAssign)
            and isinstance(node.target, ast.Name)
            and node.target.id == name
            and node.value is not None
        ):
            yield node.value


def _alternatives(node: ast.expr) -> list[ast.expr]:
    """Return the expressions one of which another one is: both sides of a condition, a table's values."""
    if isinstance(node, ast.IfExp):
        return [node.body, node.orelse]
    if isinstance(node, ast.BoolOp):
        return node.values
    if isinstance(node, ast.Subscript):
        return [node.value]
    return node.values if isinstance(node, ast.Dict) else []


def _is_phrase(text: str) -> bool:
    """Return whether a text in another's hole is to be translated by itself."""
    return " " in text.strip() and (not _HOLE.search(text) or _letters(text) >= _FEWEST_OF_A_PART)


def _letters(text: str) -> int:
    """Return the number of letters of a text without its holes."""
    return sum(map(str.isalpha, _HOLE.sub("", text)))


def _holed(node: ast.JoinedStr) -> str:
    """Return an f-string with numbered holes."""
    text = "".join(str(part.value) if isinstance(part, ast.Constant) else "{0}" for part in node.values)
    return _numbered(text)


def _numbered(text: str) -> str:
    """Return a text with its holes numbered from 0."""
    pieces = _HOLES.split(text)
    return pieces[0] + "".join(f"{{{number}}}{piece}" for number, piece in enumerate(pieces[1:]))


def _parts(text: str, name: str) -> Iterator[str]:
    """Yield a text as it is shown, if it has words."""
    if name in ("warn", "assume"):
        text = _numbered(_FORMAT.sub("{0}", text).replace("%%", "%"))
    if _letters(text) >= _FEWEST_LETTERS:
        yield text.strip()
