"""How Sphinx makes the site that `make docs` builds in build/site: pages from docs/, the library's from the code."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import astroid
from astroid.brain.brain_dataclasses import dataclass_transform, is_decorated_with_dataclass

ROOT = Path(__file__).resolve().parents[1]

project = "SynthRoads"
copyright = "SynthRoads developers; GPL-3.0-or-later"  # noqa: A001 (Sphinx's name for it)
release = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))["version"]
extensions = ["myst_parser", "sphinx.ext.napoleon", "autoapi.extension"]

html_theme = "furo"  # brings its own styles and uses the reader's fonts: nothing is fetched when a page is viewed
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_title = f"SynthRoads {release}"
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}
highlight_language = "none"
napoleon_use_ivar = True  # attributes as a list: their types stand in the class's signature
default_role = "py:obj"  # docstrings name things of this project in single ticks
myst_heading_anchors = 4  # links such as page.md#a-heading, as they work where the repository is read

# The library's public part, read and never imported: neither Blender nor PyTorch is needed.
PACKAGE = ROOT / "synthroads_addon"
PRIVATE = ("blender", "presets", "ui")
autoapi_dirs = [str(PACKAGE), str(ROOT / "ml")]
autoapi_ignore = [f"{PACKAGE / name}*" for name in PRIVATE]
autoapi_root = "reference/api"
autoapi_options = ["members", "show-inheritance", "show-module-summary"]
autoapi_member_order = "bysource"
autoapi_add_toctree_entry = False
autoapi_keep_files = False
suppress_warnings = [
    # It misses what is assigned several at a time (A, B = ...) and what `PRIVATE` names; mypy looks after imports.
    "autoapi.python_import_resolution",
    # A bare name in a docstring that several classes have: the link leads to the first of them.
    "ref.python",
]


# It would find out which values each field of a dataclass can have: a minute, of which nothing is shown.
astroid.MANAGER.unregister_transform(astroid.nodes.ClassDef, dataclass_transform, is_decorated_with_dataclass)

MODULE_LIST = re.compile(r"^\.\. toctree::\n(?: +:\w+:.*\n)*\n((?:\s*/reference/api/\S+\n)+)", re.MULTILINE)
MODULE_TITLE = re.compile(r"^(\w+(?:\.\w+)*)\.\w+\n=+\n", re.MULTILINE)


def link_modules(app: Any, docname: str, content: list[str]) -> None:
    """Have the page of a package link to its modules, and theirs to it, instead of all being in every page's menu.

    A menu of five hundred pages, made anew for each of them, took longer than all else together.
    """
    if not docname.startswith("reference/api/"):
        return

    def links(found: re.Match[str]) -> str:
        names = [path.split("/")[3:-1] for path in found[1].split()]
        return "\n".join(f"* :py:mod:`{'.'.join(name)}`" for name in names) + "\n"

    text = MODULE_TITLE.sub(r"\g<0>\nIn :py:mod:`\1`.\n", MODULE_LIST.sub(links, content[0]), count=1)
    content[0] = f":orphan:\n\n{text}"


def setup(app: Any) -> dict[str, bool]:
    """Connect to Sphinx; pages can be read side by side."""
    app.connect("source-read", link_modules)
    return {"parallel_read_safe": True}
