"""The extension brings every package that the code it contains imports, anywhere, but those of the extras."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from tools.build_extension import EXTENSIONS, read_wheel_list

PACKAGE = Path(__file__).parents[2] / "synthroads_addon"
BLENDERS = {
    "_cycles",
    "addon_utils",
    "bl_ui",
    "blf",
    "bpy",
    "bpy_extras",
    "gpu",
    "gpu_extras",
    "idprop",
    "imbuf",
    "mathutils",
    "numpy",
    "pxr",
}
"""Modules that every Blender has."""
OF_EXTRAS = {"ifcopenshell", "matplotlib", "osmium", "py4dgeo", "pye57", "shtab", "pyogrio", "distributed", "sklearn"}
"""Modules of extras, whose absence is said in a sentence where they are needed."""
OURS = {"headless", "ml", "synthroads_addon"}
DISTRIBUTIONS = {"OpenEXR": "openexr", "PIL": "pillow", "yaml": "pyyaml"}
"""Module -> its package, where that is called otherwise."""


def imported_modules() -> Iterator[tuple[str, Path]]:
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level and node.module:
                names = [node.module]
            yield from ((name.partition(".")[0], path) for name in names)


def test_the_extension_brings_what_its_code_imports() -> None:
    brought = {line.partition("==")[0] for line in read_wheel_list(EXTENSIONS[0].wheel_list)}
    missing = {
        (module, path.relative_to(PACKAGE).as_posix())
        for module, path in imported_modules()
        if module not in BLENDERS | OF_EXTRAS | OURS
        and module not in sys.stdlib_module_names
        and DISTRIBUTIONS.get(module, module).replace("_", "-") not in brought
    }
    assert missing == set()
