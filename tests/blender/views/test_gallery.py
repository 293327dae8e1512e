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
        "materials-base_color",
        pytest.param("scene-rural-driver", marks=[pytest.mark.any_blender, pytest.mark.slow]),
        pytest.param("materials-lit", marks=pytest.mark.slow),
    ],
)
def test_a_picture_is_made_and_has_the_same_bytes_again(
    tmp_path: Path, only: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Blender and Cycles write dates, names of files and the seconds that it took into theirs."""
    folders = tmp_path / "first", tmp_path / "second"
    for folder in folders:
        arguments = ["--output", str(folder), "--only", only, "--width", "160", "--samples", "1"]
        assert command("gallery", arguments) == 0
        out, err = capsys.readouterr()
        assert out == f"1 pictures in {folder}\n"
        assert f"{folder / only}.png" in err.splitlines(), "told as soon as it is there"
        assert [path.name for path in folder.iterdir()] == [f"{only}.png"]
    first, second = (folder / f"{only}.png" for folder in folders)
    assert first.read_bytes() == second.read_bytes()
    with Image.open(first) as image:
        assert not image.info
        picture = np.asarray(image.convert("L"), dtype=np.float64)
    assert picture.shape == (90, 160)
    assert picture.std() > 5.0
