"""Models found by the files of a folder."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from synthroads_addon.base.discovery import discover_models
from synthroads_addon.base.schema import Model

MODEL = """
from typing import ClassVar, Literal
from synthroads_addon.base.schema import Model
class {name}(Model):
    {order}
    kind: Literal["{kind}"] = "{kind}"
class Untagged(Model):
    size: int = 1
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty package that can be imported by its name ``kinds_of_test``."""
    made = tmp_path / "kinds_of_test"
    made.mkdir()
    (made / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    yield made
    for name in [name for name in sys.modules if name.partition(".")[0] == made.name]:
        del sys.modules[name]


def test_every_file_adds_its_model_and_an_order_comes_before_names(folder: Path) -> None:
    for name, order in (("beta", ""), ("alpha", ""), ("gamma", "order: ClassVar[int] = 1")):
        text = MODEL.format(name=name.title(), kind=name, order=order)
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    assert list(discover_models(folder.name, Model, "kind")) == ["gamma", "alpha", "beta"]


def test_two_files_of_one_name_are_refused(folder: Path) -> None:
    for file in ("one", "two"):
        (folder / f"{file}.py").write_text(MODEL.format(name="Same", kind="same", order=""), encoding="utf-8")
    with pytest.raises(ValueError, match=r"kinds_of_test.one and kinds_of_test.two both have the kind 'same'"):
        discover_models(folder.name, Model, "kind")
