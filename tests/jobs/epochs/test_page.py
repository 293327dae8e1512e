"""The commands of the page on epochs, run in the order in which its reader meets them, on a short road."""

from __future__ import annotations

import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

from headless.cli import main
from tests.doors.documented import ROOT, documented_lines

PAGE = ROOT / "docs" / "epochs.md"
SMALL = [
    *("--fidelity", "draft"),
    *("--set", "road.length=40", "--set", "road.half_width=20", "--set", "scan.platform.speed=30"),
    *("--set", 'outputs=["parameters","cloud"]'),
]
RECIPE = "changes"
"""Name of a shipped recipe, of which a copy with two pairs of a short road is made."""


def recipe(folder: Path) -> Path:
    """Write a copy of the shipped recipe with two short pairs; return its path."""
    text = (ROOT / "synthroads_addon" / "presets" / "recipes" / f"{RECIPE}.yaml").read_text(encoding="utf-8")
    for whole, part in (
        ("road.length: 300", "road.length: 40"),
        ("road.half_width: 40", "road.half_width: 20"),
        ("scenes: 18\n    split: {train: 14, validation: 2, test: 2}", "scenes: 1\n    split: {train: 1}"),
        ("scenes: 2\n    split: {validation: 1, test: 1}", "scenes: 1\n    split: {test: 1}"),
    ):
        assert whole in text
        text = text.replace(whole, part)
    path = folder / f"{RECIPE}.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def small(words: list[str], folder: Path) -> list[str]:
    """Return a command's words with a short road in place of the page's."""
    if words[0] == "epochs":
        words = words if "--parameters" not in words else [*words, "--scenario", "rq31-600m"]
        return [*words, *SMALL]
    if words[:2] == ["changes", "detect"] and "--method" not in words and find_spec("py4dgeo") is None:
        return [*words, "--method", "raster"]
    return [str(recipe(folder)) if word == RECIPE and words[0] == "dataset" else word for word in words]


@pytest.mark.slow
def test_the_page_is_what_a_reader_can_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    texts = [line.text for line in documented_lines([PAGE]) if line.kind == "command"]
    done = set()
    for text in texts:
        words = shlex.split(text)
        assert words[0] == "synthroads"
        assert main(small(words[1:], tmp_path)) == 0, text
        done.add(words[1])
        assert capsys.readouterr().err.find("error:") < 0, text
    assert done == {"epochs", "list", "changes", "dataset"}
    pairs = sorted(path.name for path in (tmp_path / "out" / "pairs" / "scenes").iterdir())
    assert len(pairs) == 2
    for name in pairs:
        scene = tmp_path / "out" / "pairs" / "scenes" / name
        assert (scene / "epoch-2" / "changes.json").is_file()
        assert (scene / "registration.json").is_file()
