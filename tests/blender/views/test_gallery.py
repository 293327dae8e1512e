"""The gallery: its pictures are made, and they show something."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from headless.commands import command
from synthroads_addon.blender.views import gallery


@pytest.fixture
def short_roads(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the scenes have roads of 200 m."""
    preset = json.loads(gallery.PRESET.read_text(encoding="utf-8"))
    for scene in preset["scenes"].values():
        scene["road"]["length"] = 200.0
    file = tmp_path_factory.mktemp("preset") / "gallery.json"
    file.write_text(json.dumps(preset), encoding="utf-8")
    monkeypatch.setattr(gallery, "PRESET", file)


@pytest.mark.usefixtures("short_roads")
@pytest.mark.parametrize(
    "only",
    [
        pytest.param("materials-base_color", marks=pytest.mark.any_blender),
        pytest.param("scene-rural-driver", marks=[pytest.mark.any_blender, pytest.mark.slow]),
        pytest.param("materials-lit", marks=[pytest.mark.any_blender, pytest.mark.slow]),
    ],
)
def test_a_picture_is_made(tmp_path: Path, only: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--output", str(tmp_path), "--only", only, "--width", "160", "--samples", "1"]
    assert command("gallery", arguments) == 0
    out, err = capsys.readouterr()
    assert out == f"1 pictures in {tmp_path}\n"
    assert f"{tmp_path / only}.png" in err.splitlines(), "told as soon as it is there"
    assert [path.name for path in tmp_path.iterdir()] == [f"{only}.png"]
    picture = np.asarray(Image.open(tmp_path / f"{only}.png").convert("L"), dtype=np.float64)
    assert picture.shape == (90, 160)
    assert picture.std() > 5.0


def test_a_picture_has_the_same_bytes_again(tmp_path: Path) -> None:
    """Blender and Cycles write dates, names of files and the seconds that it took into theirs."""
    for name in ("first", "second"):
        words = ["--only", "materials-lit", "--width", "48", "--samples", "1", "--quiet", "--output"]
        assert command("gallery", [*words, str(tmp_path / name)]) == 0
    first, second = (tmp_path / name / "materials-lit.png" for name in ("first", "second"))
    assert first.read_bytes() == second.read_bytes()
    with Image.open(first) as picture:
        assert not picture.info
