"""The examples in docstrings give what they show, without Blender."""

from __future__ import annotations

import doctest
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NEED_BLENDER = {"blender", "jobs", "ui"}
FEWEST = 40
"""Fewest functions and classes with an example."""
LIKE_NUMBERS_OF_NUMPY = re.compile(r"\bnp\.(?:float|int|bool)")
"""How one release of NumPy shows its numbers, and another doesn't."""


def _examples() -> Iterator[doctest.DocTest]:
    """Yield the examples of each docstring of the modules that need no Blender."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    for path in sorted((ROOT / "synthroads_addon").rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        if parts[1] in NEED_BLENDER or ">>>" not in path.read_text(encoding="utf-8"):
            continue
        module = importlib.import_module(".".join(parts).removesuffix(".__init__"))
        yield from (test for test in finder.find(module) if test.examples)


EXAMPLES = list(_examples())


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name.removeprefix("synthroads_addon."))
def test_an_example_gives_what_it_shows(
    example: doctest.DocTest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # some write files
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert runner.run(example, out=said.append).failed == 0, "".join(said)


def test_many_have_examples() -> None:
    assert len(EXAMPLES) >= FEWEST
    assert all(any(part.want for part in example.examples) for example in EXAMPLES), "each shows a result"
    assert not [example.name for example in EXAMPLES if LIKE_NUMBERS_OF_NUMPY.search(example.docstring or "")]
