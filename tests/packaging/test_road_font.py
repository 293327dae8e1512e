"""The signs' typeface: its file is what the tool draws, and has what is written on signs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from fontTools.ttLib import TTFont
from shapely import union_all

from synthroads_addon.base.files import PRESETS
from tools.make_road_font import CAPITAL, FAMILY, TARGET, UNIT, glyphs, make_font, outlines

LARGEST = 100_000
HOLES = {"B": 2, "8": 2, "O": 1, "L": 0, "ß": 0, "Ü": 0, "ä": 1, "%": 2}
WANTED = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789ÄÖÜäöüß .,:-–/()&+'°%!"


def test_the_file_is_what_the_tool_draws(tmp_path: Path) -> None:
    make_font(tmp_path / "road.ttf")
    assert (tmp_path / "road.ttf").read_bytes() == TARGET.read_bytes()
    assert TARGET.stat().st_size < LARGEST


def test_it_is_the_projects_own_under_its_licence() -> None:
    names = TTFont(TARGET)["name"]
    assert names.getDebugName(1) == FAMILY
    assert names.getDebugName(13) == "GPL-3.0-or-later"


def test_it_has_all_characters_of_german_signs() -> None:
    catalogue = json.loads((PRESETS / "signs.json").read_text(encoding="utf-8"))
    written = [line for sign in catalogue["signs"].values() for line in sign.get("text", ())]
    characters = set("".join((WANTED, *written, *catalogue["destinations"]))) - set("{}")
    assert characters <= set(map(chr, TTFont(TARGET).getBestCmap()))


def test_contours_run_clockwise_and_their_holes_do_not() -> None:
    for character, glyph in glyphs().items():
        contours, _ = outlines(glyph)
        areas = [
            sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1], strict=True)) / 2.0
            for ring in contours
        ]
        drawn = union_all([stroke.area() for stroke in glyph.strokes]).area * UNIT**2
        assert -sum(areas) == pytest.approx(drawn, rel=0.01), character
        if character in HOLES:
            assert sum(area > 0.0 for area in areas) == HOLES[character], character


def test_figures_stand_below_each_other() -> None:
    widths = {figure: outlines(glyphs()[figure])[1] for figure in "023456789"}
    assert len(set(widths.values())) == 1
    assert outlines(glyphs()["1"])[1] < widths["0"]


def test_strokes_are_a_seventh_of_a_capital() -> None:
    (stem,), _ = outlines(glyphs()["I"])
    assert max(y for _, y in stem) == CAPITAL * UNIT
    assert max(x for x, _ in stem) - min(x for x, _ in stem) == UNIT
