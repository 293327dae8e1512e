"""Where a command is to write is looked at before its work: what can't be written is one line, and nothing is made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from tests.helpers.clouds.random_points import make_points

IN_A_FILE = "{folder}/file.txt/deep"
"""Folder that can't be made: a file stands where one above it would be."""
NONE = "{folder}/none"
"""Input that isn't there: a command that says so first has not looked at its output before."""

COMMANDS = {
    "centerline": ["centerline", f"{NONE}.laz", "-o", f"{IN_A_FILE}/a.geojson"],
    "calibrate --save-device": [
        "calibrate",
        "--material",
        "asphalt=2",
        "--real",
        f"{NONE}.laz",
        "--save-device",
        f"{IN_A_FILE}/a.json",
    ],
    "calibrate --plot": ["calibrate", "--material", "asphalt", "--plot", f"{IN_A_FILE}/a.png"],
    "cloud convert": ["cloud", "convert", f"{NONE}.laz", "-o", f"{IN_A_FILE}/a.ply"],
    "cloud crop": ["cloud", "crop", f"{NONE}.laz", "--heights", "1", "2", "-o", f"{IN_A_FILE}/a.ply"],
    "cloud merge": ["cloud", "merge", f"{NONE}.laz", f"{NONE}2.laz", "-o", f"{IN_A_FILE}/a.ply"],
    "cloud tile": ["cloud", "tile", f"{NONE}.laz", "-o", IN_A_FILE],
    "dataset": ["dataset", "standin", "-o", IN_A_FILE],
    "gallery": ["gallery", "--only", "no such picture", "-o", IN_A_FILE],
    "reconstruct": ["reconstruct", f"{NONE}.laz", "-o", IN_A_FILE],
    "road": ["road", f"{NONE}.xodr", "-o", IN_A_FILE],
    "tradeoff": ["tradeoff", "--knobs", "fidelity", "-o", IN_A_FILE],
    "tradeoff --pictures": ["tradeoff", "--knobs", "fidelity", "-o", "{folder}/rows", "--pictures", IN_A_FILE],
}
LEARNING = {
    "evaluate": ["evaluate", NONE, NONE, "-o", IN_A_FILE],
    "export": ["export", NONE, "-o", f"{IN_A_FILE}/a.onnx"],
    "forecast": ["forecast", "segmentation-small", "-o", f"{IN_A_FILE}/a.json"],
    "pack": ["pack", NONE, "-o", f"{IN_A_FILE}/a.npz"],
    "predict": ["predict", "{folder}/cloud.laz", "-o", f"{IN_A_FILE}/a.laz"],
    "train": ["train", "segmentation-small", "-o", IN_A_FILE],
}
EVERY = COMMANDS | LEARNING


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "file.txt").write_text("mine")
    with open_writer(tmp_path / "cloud.laz", 25832, np.array([294_000.0, 5_628_000.0, 180.0]), 5e8) as writer:
        writer.write(make_points(500))
    return tmp_path


@pytest.mark.parametrize("name", EVERY)
def test_what_cannot_be_written_is_told_before_the_work(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name in LEARNING:
        pytest.importorskip("torch")
    monkeypatch.chdir(folder)
    before = sorted(path.name for path in folder.iterdir())
    assert main([word.format(folder=folder) for word in EVERY[name]]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "file.txt" in said
    assert "Not a directory" in said
    assert sorted(path.name for path in folder.iterdir()) == before
    assert (folder / "file.txt").read_text() == "mine"


def test_folders_are_made_where_they_are_not_there(folder: Path) -> None:
    cloud, far = str(folder / "cloud.laz"), folder / "new" / "deep"
    assert main(["cloud", "convert", cloud, "-o", str(far / "a.ply"), "-q"]) == 0
    assert main(["cloud", "subsample", cloud, "--grid", "1", "-o", str(folder / "other" / "b.laz"), "-q"]) == 0
    assert main(["cloud", "tile", cloud, "--size", "500", "-o", str(folder / "tiles" / "of" / "it"), "-q"]) == 0
    for path in (far / "a.ply", folder / "other" / "b.laz", *(folder / "tiles" / "of" / "it").iterdir()):
        with open_cloud(path) as made:
            assert made.header.count > 0


def test_no_folder_is_left_where_the_work_fails(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "text.laz").write_text("no cloud")
    for tool in (["convert"], ["subsample", "--grid", "1"], ["tile"]):
        output = "new/deep" if tool == ["tile"] else "new/deep/a.laz"
        assert main(["cloud", *tool, str(folder / "text.laz"), "-o", str(folder / output)]) == 2
        assert not (folder / "new").exists()


NO_FILE = {
    "centerline CLOUD": ["centerline", "{name}"],
    "centerline --output": ["centerline", f"{NONE}.laz", "-o", "{name}"],
    "cloud convert": ["cloud", "convert", f"{NONE}.laz", "-o", "{name}"],
    "calibrate --save": ["calibrate", "--material", "asphalt=2", "--real", f"{NONE}.laz", "--save", "{name}"],
}
NO_FILE_OF_LEARNING = {
    "predict CLOUD": ["predict", "centerline-airborne", "{name}"],
    "predict CLOUD, labelled": ["predict", "segmentation-overhead", "{name}"],
    "predict --output": ["predict", "centerline-airborne", f"{NONE}.laz", "-o", "{name}"],
    "predict --output, labelled": ["predict", "segmentation-overhead", f"{NONE}.laz", "-o", "{name}"],
    "export": ["export", "segmentation-overhead", "-o", "{name}"],
    "pack": ["pack", NONE, "-o", "{name}"],
}
NO_FILES = NO_FILE | NO_FILE_OF_LEARNING


@pytest.mark.parametrize("given", ["", ".", "/"])
@pytest.mark.parametrize("name", NO_FILES)
def test_names_of_no_file_are_refused(
    name: str, given: str, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name beside a file, or with another ending, can't be made of them."""
    if name in NO_FILE_OF_LEARNING:
        pytest.importorskip("torch", reason="needs PyTorch")
    monkeypatch.chdir(folder)
    before = sorted(folder.rglob("*"))
    words = [word.format(folder=folder, name=given) for word in NO_FILES[name]]
    assert main([*words, "--quiet"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    assert sorted(folder.rglob("*")) == before


LONG = "x" * 5000


@pytest.mark.parametrize(
    "words",
    [
        ["compare", "clouds.yaml", "clouds.yaml", "-o", LONG],
        ["list", "recipes", LONG],
        ["cloud", "info", LONG],
        ["cloud", "convert", "cloud.laz", "-o", f"{LONG}.ply"],
        ["reconstruct", "cloud.laz", "-o", LONG],
        ["check", LONG],
        ["road", LONG, "--list"],
        ["generate", "-o", LONG],
        ["generate", "--axis", LONG, "-o", "out"],
    ],
)
def test_a_name_that_the_system_takes_none_as_long_as_is_one_line(
    words: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    before = sorted(path.name for path in folder.iterdir())
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("error: ")
    assert sorted(path.name for path in folder.iterdir()) == before
