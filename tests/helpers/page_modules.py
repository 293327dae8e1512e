"""Modules and other code that a page of the documentation tells its readers to write."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


def module_of_page(page: str, file: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the module that a page says to save as a file, as if it stood there.

    Args:
        page: in the documentation's folder, e.g. ``extend/pattern.md``.
        file: e.g. ``synthroads_addon/scanning/patterns/lissajous.py``.
        monkeypatch: takes the module away after the test.
    """
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    code = re.split(r"```python\n|```\n", text[text.index(f"`{file}`") :])[1]
    module = ModuleType(file.removesuffix(".py").replace("/", "."))
    module.__package__ = module.__name__.rpartition(".")[0]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(code, file, "exec"), vars(module))
    return module


def block_of_page(page: str, language: str, number: int = 0) -> str:
    """Return a page's fenced block in a language, the first if no number says otherwise."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"(?ms)^```{language}\n(.*?)^```$", text)[number]
