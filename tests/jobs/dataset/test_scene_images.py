"""Images and sweeps of a data set's scenes: in its manifest, and the same bytes when they are made again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from headless import commands
from synthroads_addon.dataset.manifest import read_manifest
from tests.jobs.test_dataset import content, recipe_file, run

CAMERAS = {"rig": "front-rolling-shutter", "spacing": 15, "megapixels": 0.01, "samples": 1, "rolling_shutter": True}


@pytest.mark.slow
@pytest.mark.any_blender
def test_images_are_in_the_manifest_and_come_again(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    changes = {"scan.cameras": CAMERAS, "sweeps.formats": ["openlabel"]}
    recipe = recipe_file(tmp_path, layouts=[], groups=[{"name": "a", "scenes": 1, "set": changes}])
    folder = tmp_path / "set"
    answer = run(recipe, folder)
    assert answer.returncode == 0, answer.stderr
    (scene,) = read_manifest(folder).scenes
    images = [name for name in scene.files or {} if name.startswith("scenes/a-01/images/")]
    index = json.loads((folder / "scenes/a-01/images/images.json").read_text())["images"]
    assert len(index) == 3
    named = {f"scenes/a-01/images/{file}" for image in index for file in image["files"].values()}
    assert named < set(images)
    assert {"scenes/a-01/openlabel.json", "scenes/a-01/sweeps.json"} < set(scene.files or {})
    card = (folder / "DATA_CARD.md").read_text()
    assert "poses, by front-rolling-shutter; 3 pictures" in card
    assert "`openlabel.json`" in card

    before = content(folder)
    lost = folder / next(name for name in sorted(named) if "/rgb/" in name)
    lost.unlink()
    capfd.readouterr()
    assert commands.command("dataset", [str(recipe), "--output", str(folder), "--verify"]) == 3
    assert lost.name in "".join(capfd.readouterr())
    assert run(recipe, folder, "--resume").returncode == 0
    assert content(folder) == before
