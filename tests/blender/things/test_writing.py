"""Writing on signs, as a mesh: its typeface, the heights of its letters, and that it stays in its box."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.nodes import builder
from synthroads_addon.blender.nodes.builder import TYPEFACE
from synthroads_addon.blender.things.sign.typeface import sign_typeface
from synthroads_addon.blender.things.sign.writing import LETTERS, sign_writing_group
from tests.blender.nodes.test_nodes import evaluated
from tests.helpers.scenes.furnished_road import Float

pytestmark = pytest.mark.any_blender

STROKE = 1.0 / 7.0
"""Width of a stroke of a letter whose capitals are 1 high."""
NEAR = 1e-3
LEFT = {"Flush Left": True}


def written(*lines: str, group: bpy.types.NodeTree | None = None) -> Float:
    """Return the outlines' points (N, 2) of lines in a box that is just high enough for capitals of height 1."""
    inputs = {f"Line {number}": line for number, line in enumerate(lines, 1)}
    box = {"Low Corner": (0.0, 0.0, 0.0), "High Corner": (100.0, len(lines) / LETTERS, 0.0)}
    mesh = evaluated(group or sign_writing_group(), **inputs, **box, **LEFT)
    points = np.array([vertex.co[:2] for vertex in mesh.vertices]).reshape(-1, 2)
    return points - [0.0, (1.0 / LETTERS - 1.0) / 2.0]  # capitals of the last line stand on 0


def test_capitals_have_their_height_and_strokes_their_width() -> None:
    points = written("I")
    assert points.min(axis=0) == pytest.approx([0.0, 0.0], abs=NEAR)
    assert points.max(axis=0) == pytest.approx([STROKE, 1.0], abs=NEAR)
    assert np.ptp(written("H")[:, 0]) == pytest.approx(4.4 * STROKE, abs=NEAR)


def test_small_letters_are_lower_and_some_reach_below() -> None:
    assert written("x")[:, 1].max() == pytest.approx(5.0 * STROKE, abs=NEAR)
    assert written("p")[:, 1].min() == pytest.approx(-2.0 * STROKE, abs=NEAR)


@pytest.mark.parametrize(("letter", "plain", "above"), [("Ü", "U", 7.6), ("Ö", "O", 7.6), ("ü", "u", 6.0)])
def test_umlauts_have_two_square_dots_above(letter: str, plain: str, above: float) -> None:
    with_dots, without = written(letter), written(plain)
    assert np.ptp(with_dots[:, 0]) == pytest.approx(np.ptp(without[:, 0]), abs=NEAR)
    dots = with_dots[with_dots[:, 1] > (above - 0.1) * STROKE]
    assert len(dots) == 8
    assert np.ptp(dots[:, 1]) == pytest.approx(STROKE, abs=NEAR)
    left, right = (dots[dots[:, 0] < dots[:, 0].mean()], dots[dots[:, 0] > dots[:, 0].mean()])
    assert np.ptp(left[:, 0]) == pytest.approx(STROKE, abs=NEAR)
    assert np.ptp(right[:, 0]) == pytest.approx(STROKE, abs=NEAR)


@pytest.mark.parametrize("letter", "ÄÖÜäöüßéł–°&")
def test_letters_beyond_ascii_are_drawn(letter: str) -> None:
    points, missing = written(letter), written("Ж")
    assert len(points) > 3
    assert points.shape != missing.shape or not np.allclose(points, missing)


def test_figures_are_all_of_one_width_but_for_one() -> None:
    def step(figure: str) -> float:
        return float(np.ptp(written(figure + figure)[:, 0]) - np.ptp(written(figure)[:, 0]))

    assert [step(figure) for figure in "023456789"] == pytest.approx([5.2 * STROKE] * 9, abs=NEAR)
    assert step("1") < 4.5 * STROKE


def test_dots_and_descenders_stay_in_their_lines() -> None:
    points = written("Ägypten", "Üg", "Åj")
    pitch = 1.0 / LETTERS
    bottom = (1.0 - pitch) / 2.0
    assert points[:, 1].min() > bottom
    assert points[:, 1].max() < bottom + 3.0 * pitch
    # Between the lines nothing is drawn.
    for border in (bottom + pitch, bottom + 2.0 * pitch):
        assert np.abs(points[:, 1] - border).min() > 0.01


def test_a_long_line_is_as_wide_as_its_box() -> None:
    text = "Donaudampfschifffahrtsgesellschaft"
    box = {"Low Corner": (0.0, 0.0, 0.0), "High Corner": (2.0, 1.0, 0.0)}
    mesh = evaluated(sign_writing_group(), **{"Line 1": text}, **box, **LEFT)
    x = [vertex.co.x for vertex in mesh.vertices]
    assert (min(x), max(x)) == (pytest.approx(0.0, abs=NEAR), pytest.approx(2.0, abs=NEAR))


class TestTypeface:
    def test_it_is_in_the_file_once_and_names_no_folder(self) -> None:
        font = sign_typeface()
        assert sign_typeface() == font
        assert font.packed_file.size == TYPEFACE.stat().st_size
        assert font.filepath == f"//{TYPEFACE.name}"

    def test_an_older_one_is_left_alone(self) -> None:
        font = sign_typeface()
        font["synthroads_typeface"] = "older"
        assert sign_typeface() != font

    def test_another_one_makes_new_groups(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        other = tmp_path / "other.ttf"
        other.write_bytes(TYPEFACE.read_bytes() + b"\0")
        monkeypatch.setattr(builder, "TYPEFACE", other)
        assert builder._sources_digest.__wrapped__() != builder._sources_digest()

    def test_it_goes_with_the_groups_into_another_file(self, tmp_path: Path) -> None:
        expected = written("Straße")
        bpy.data.libraries.write(str(tmp_path / "groups.blend"), {sign_writing_group()}, fake_user=True)
        empty_file()
        with bpy.data.libraries.load(str(tmp_path / "groups.blend")) as (_, here):
            here.node_groups = ["SR Sign Writing"]
        assert [font.packed_file is not None for font in bpy.data.fonts] == [True]
        points = written("Straße", group=here.node_groups[0])
        assert points == pytest.approx(expected, abs=1e-6)
