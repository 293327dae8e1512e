"""Texts of users in figures stand there as they are, whatever Matplotlib makes of such signs elsewhere."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import pytest

from synthroads_addon.base.text.literal import literal_texts, shown_text

pytest.importorskip("matplotlib")
ROOT = Path(__file__).parents[3]
TEXTS = ("a$^_$b", "_hidden", "no text \udcff", "\U0001f6a7 works", "two\nlines", "bell \x07")


def drawn(text: str) -> list[str]:
    """Draw a text as a title and in both kinds of legends; return the texts of the legends."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(layout="constrained")
    axes = figure.subplots()
    axes.plot([1.0, 2.0], [1.0, 2.0], label=text)
    axes.set_title(text)
    legends = [axes.legend(), figure.legend(handles=[Patch(label=text)])]
    figure.savefig(io.BytesIO(), format="png")
    return [entry.get_text() for legend in legends for entry in legend.get_texts()]


@pytest.mark.parametrize("text", TEXTS)
def test_any_text_is_drawn_as_it_stands(text: str) -> None:
    with warnings.catch_warnings(record=True) as said, literal_texts():
        entries = drawn(shown_text(text))
    assert len(entries) == 2
    assert all(text.split(maxsplit=1)[0].strip("_") in entry for entry in entries)
    assert not said


def test_formulas_fail_elsewhere() -> None:
    with pytest.raises(ValueError, match=r"ParseException|Expected"):
        drawn(TEXTS[0])


def test_every_module_that_draws_with_matplotlib_draws_texts_literally() -> None:
    """Names of files, classes, recipes and runs get into all of their figures."""
    sources = [path for folder in ("synthroads_addon", "headless", "ml") for path in (ROOT / folder).rglob("*.py")]
    drawing = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sources}
    helper = "synthroads_addon/base/figure.py"
    drawing = {name: text for name, text in drawing.items() if "save_figure(" in text and name != helper}
    assert len(drawing) >= 5
    assert [name for name, text in drawing.items() if "@literal_texts()" not in text] == []
