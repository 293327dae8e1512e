"""What imports what: the add-on is a package of any name, and nothing but Blender's own part needs Blender."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "synthroads_addon"
OWN_PACKAGES = {"synthroads_addon", "headless", "ml", "tests", "tools"}
BLENDER = {"bpy", "bpy_extras", "bmesh", "mathutils", "gpu"}


def _sources(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def _name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def _imports(path: Path) -> list[tuple[ast.stmt, str, int]]:
    """Return each import statement of a file with the module's name as written and its number of leading dots."""
    found: list[tuple[ast.stmt, str, int]] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))):
        if isinstance(node, ast.Import):
            found += [(node, alias.name, 0) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found.append((node, node.module or "", node.level))
    return found


def _absolute_top_levels(path: Path) -> set[str]:
    return {name.split(".")[0] for _, name, level in _imports(path) if level == 0}


def test_addon_imports_itself_relatively() -> None:
    """As an extension the package is bl_ext.user_default.synthroads, and headless and ml are not there."""
    for path in _sources(ADDON):
        assert not _absolute_top_levels(path) & OWN_PACKAGES, _name(path)
        depth = len(path.relative_to(ADDON).parts)
        for node, name, level in _imports(path):
            assert level <= depth, f"{_name(path)}, line {node.lineno}: {'.' * level}{name} leaves the package"


def test_core_and_ml_know_no_blender() -> None:
    for path in [*_sources(ADDON / "core"), *_sources(ROOT / "ml")]:
        assert not _absolute_top_levels(path) & BLENDER, _name(path)
        if path.is_relative_to(ADDON):
            above_core = len(path.relative_to(ADDON).parts)
            for node, name, level in _imports(path):
                if level == above_core and isinstance(node, ast.ImportFrom):
                    reached = {name.split(".")[0]} if name else {alias.name for alias in node.names}
                    assert not reached & {"blender", "pipeline", "ui"}, f"{_name(path)}, line {node.lineno}"


def test_ml_imports_the_core_alone() -> None:
    for path in _sources(ROOT / "ml"):
        for node, name, level in _imports(path):
            if level == 0 and name.split(".")[0] == "synthroads_addon":
                assert name.startswith("synthroads_addon.base"), f"{_name(path)}, line {node.lineno}: {name}"


def _modules(folder: Path) -> list[str]:
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in _sources(folder)]
    return [name.removesuffix(".__init__") for name in names]


def test_library_is_imported_without_blender() -> None:
    """Import every module of core, and the package itself, in a process that has no bpy."""
    modules = ["synthroads_addon", *_modules(ADDON / "core")]
    code = f"""
import importlib, sys
for name in {sorted(BLENDER)!r}:
    sys.modules[name] = None # importing it raises ImportError
modules = {modules!r}
for name in modules:
    importlib.import_module(name)
"""
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr


def test_addon_is_imported_under_another_name(tmp_path: Path) -> None:
    """The core works when the package is called as Blender calls it."""
    parent = tmp_path / "bl_ext" / "user_default"
    parent.mkdir(parents=True)
    (parent / "synthroads").symlink_to(ADDON, target_is_directory=True)
    names = _modules(ADDON / "core")
    modules = [name.replace("synthroads_addon", "bl_ext.user_default.synthroads", 1) for name in names]
    code = f"""
import importlib, sys
sys.path.insert(0, {str(tmp_path)!r})
modules = {modules!r}
for name in modules:
    importlib.import_module(name)
assert "synthroads_addon" not in sys.modules
"""
    answer = subprocess.run(
        [sys.executable, "-P", "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
