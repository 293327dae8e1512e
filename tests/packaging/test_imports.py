"""Imports beyond the contracts of `make lint`: the add-on has any name, and needs Blender late."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "synthroads_addon"
BLENDERS = ("bpy", "bpy_extras", "bmesh", "mathutils", "gpu")
NEED_BLENDER = {"blender", "jobs", "ui"}
ABSOLUTE = re.compile(r"^\s*(?:from|import) (?:synthroads_addon|headless|ml|tests|tools|studies)\b", re.MULTILINE)


def _free_modules() -> list[str]:
    """Return the add-on's modules that need no Blender."""
    paths = [path.relative_to(ADDON) for path in sorted(ADDON.rglob("*.py"))]
    free = [path for path in paths if path.parts[0] not in NEED_BLENDER]
    return [".".join(("synthroads_addon", *path.with_suffix("").parts)).removesuffix(".__init__") for path in free]


def _run(code: str, *options: str, folder: Path = ROOT) -> None:
    call = [sys.executable, *options, "-c", code]
    answer = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr


def test_the_add_on_imports_itself_relatively() -> None:
    """As an extension the package is bl_ext.user_default.synthroads, and headless and ml are not there."""
    for path in sorted(ADDON.rglob("*.py")):
        assert not ABSOLUTE.findall(path.read_text(encoding="utf-8")), path


def test_commands_and_learning_import_nothing_that_is_not_installed() -> None:
    """The wheel has neither tests nor tools nor studies."""
    left_out = re.compile(r"^\s*(?:from|import) (?:tests|tools|studies)\b", re.MULTILINE)
    paths = [path for part in ("headless", "ml") for path in sorted((ROOT / part).rglob("*.py"))]
    assert [path.name for path in paths if left_out.search(path.read_text(encoding="utf-8"))] == []


def test_the_library_is_imported_without_blender() -> None:
    _run(f"""
import importlib, sys
for name in {BLENDERS!r}:
    sys.modules[name] = None # importing it raises ImportError
for name in {_free_modules()!r}:
    importlib.import_module(name)
""")


def test_the_add_on_is_imported_under_another_name(tmp_path: Path) -> None:
    parent = tmp_path / "bl_ext" / "user_default"
    parent.mkdir(parents=True)
    (parent / "synthroads").symlink_to(ADDON, target_is_directory=True)
    names = [name.replace("synthroads_addon", "bl_ext.user_default.synthroads", 1) for name in _free_modules()]
    code = f"""
import importlib, sys
sys.path.insert(0, {str(tmp_path)!r})
for name in {names!r}:
    importlib.import_module(name)
assert "synthroads_addon" not in sys.modules
"""
    _run(code, "-P", folder=tmp_path)


def test_importing_the_package_takes_no_library_along() -> None:
    _run("import sys, synthroads_addon; assert not {'numpy', 'pydantic', 'bpy'} & set(sys.modules)")


def test_names_at_the_top_are_those_of_their_modules() -> None:
    _run("""
import sys
import synthroads_addon as package
for name in package._PLACES:
    assert getattr(package, name).__name__ == name
assert "bpy" not in sys.modules
try:
    package.nothing
except AttributeError as error:
    assert "nothing" in str(error)
else:
    raise AssertionError
""")


def test_the_command_loads_its_own_packages(tmp_path: Path) -> None:
    """Folders called headless and ml where one works, and in PYTHONPATH, are not taken for the command's."""
    for name in ("headless", "ml"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('somebody else')\n", encoding="utf-8")
    code = f"""
import sys
sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]
sys.argv = ["synthroads", "train", "--help"]
from synthroads_addon import console
console()
"""
    _run(code, folder=tmp_path)
