"""Figures by Matplotlib are drawn by one helper, and their files don't tell which release drew them."""

from __future__ import annotations

import io
import re
from pathlib import Path

from PIL import Image

from synthroads_addon.base.figure import new_figure, save_figure

ROOT = Path(__file__).resolve().parents[2]
OWN_FIGURES = re.compile(r"matplotlib\.figure|\bpyplot\b|\.savefig\(|\.use\(\"Agg\"\)")


def test_a_figure_has_its_size_and_no_software() -> None:
    figure = new_figure(3.0, 2.0)
    figure.add_subplot().plot([0.0, 1.0], [0.0, 1.0])
    drawn = io.BytesIO()
    save_figure(figure, drawn, dpi=50)
    with Image.open(drawn, formats=("PNG",)) as image:
        assert image.size == (150, 100)
        assert "Software" not in image.info


def test_no_other_makes_or_saves_figures() -> None:
    parts = ("synthroads_addon", "headless", "ml", "tools", "studies")
    paths = [path for part in parts for path in (ROOT / part).rglob("*.py")]
    own = [str(path.relative_to(ROOT)) for path in paths if OWN_FIGURES.search(path.read_text(encoding="utf-8"))]
    assert own == ["synthroads_addon/base/figure.py"]
