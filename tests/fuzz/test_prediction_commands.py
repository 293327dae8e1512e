"""Prediction on files made wrong by chance: run, checkpoint, shipped weights, calibration, cloud, line along it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

import ml.cards
from ml.runs import CALIBRATION, CHECKPOINT, CONFIGURATION, HISTORY
from tests.fuzz.test_bytes import SHORT
from tests.helpers.files.command_runs import IN, OUT, MakeWorkplace, fuzz_commands, wrong_file, wrong_words
from tests.helpers.files.learning_inputs import NAMES
from tests.helpers.files.mutations import damaged, json_files
from tests.helpers.files.wrong_weights import wrong_checkpoints, wrong_headers, wrong_numbers

KINDS = ("segmentation", "centerline")
CLOUDS = {"segmentation": "cloud.laz", "centerline": "road.laz"}
OWN = {
    "segmentation": ("predict", f"{IN}/segmentation", f"{IN}/cloud.laz", "--output", f"{OUT}/a.laz"),
    "centerline": (
        *("predict", f"{IN}/centerline", f"{IN}/road.laz", "--path", f"{IN}/axis.csv", "--output", f"{OUT}/a.geojson"),
    ),
}
"""Command of a run of one's own."""
SHIPPED = {
    "segmentation": ("predict", f"{IN}/cloud.laz", "--output", f"{OUT}/a.laz"),
    "centerline": ("predict", "tiny-line", *OWN["centerline"][2:]),
}
"""Command of a shipped model."""


@pytest.fixture(scope="module")
def folder(learning_folder: Path) -> Iterator[Path]:
    """Return the folder in which commands work, whose weights stand in for those of the package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ml.cards, "WEIGHTS", learning_folder / "in" / "weights")
        yield learning_folder


@pytest.mark.parametrize("kind", KINDS)
def test_sound_ones_are_taken(kind: str, folder: Path, workplace: MakeWorkplace) -> None:
    """Else the tests below would show nothing."""
    place = workplace(folder, f"predict: sound {kind}")
    assert place.run((OWN[kind], {})) == 0
    assert place.run((SHIPPED[kind], {})) in (0, 3)


@fuzz_commands(3, 200)
@pytest.mark.parametrize("kind", KINDS)
def test_clouds(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    sound = (folder / "in" / CLOUDS[kind]).read_bytes()
    place = workplace(folder, f"predict: cloud, {kind}")
    place.run_all(wrong_file(OWN[kind], CLOUDS[kind], damaged([sound], SHORT, head=900)), count)


@fuzz_commands(3, 200)
@pytest.mark.parametrize("name", [CONFIGURATION, HISTORY])
@pytest.mark.parametrize("kind", KINDS)
def test_files_of_runs(kind: str, name: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    file = f"{kind}/{name}"
    place = workplace(folder, f"predict: {name}, {kind}")
    sound = json.loads((folder / "in" / file).read_text())
    place.run_all(wrong_file(OWN[kind], file, json_files([sound])), count if name == CONFIGURATION else -(-count // 6))


@fuzz_commands(3, 250)
@pytest.mark.parametrize("kind", KINDS)
def test_checkpoints(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    file = f"{kind}/{CHECKPOINT}"
    state = torch.load(folder / "in" / file, weights_only=True)
    place = workplace(folder, f"predict: checkpoint, {kind}")
    place.run_all(wrong_file(OWN[kind], file, wrong_checkpoints(state)), count)


@fuzz_commands(3, 100)
@pytest.mark.parametrize("kind", KINDS)
def test_bytes_of_checkpoints(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    file = f"{kind}/{CHECKPOINT}"
    place = workplace(folder, f"predict: bytes of checkpoint, {kind}")
    place.run_all(wrong_file(OWN[kind], file, damaged([(folder / "in" / file).read_bytes()], SHORT)), count)


@fuzz_commands(3, 250)
def test_calibrations(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    file = f"centerline/{CALIBRATION}"
    place = workplace(folder, "predict: calibration")
    place.run_all(
        wrong_file(OWN["centerline"], file, json_files([json.loads((folder / "in" / file).read_text())])), count
    )


@fuzz_commands(3, 200)
@pytest.mark.parametrize("kind", KINDS)
def test_shipped_weights(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    file = f"weights/{NAMES[kind]}.safetensors"
    sound = (folder / "in" / file).read_bytes()
    place = workplace(folder, f"predict: weights, {kind}")
    contents = wrong_headers(sound) | wrong_headers(sound) | damaged([sound], SHORT) | wrong_numbers(sound)
    place.run_all(wrong_file(SHIPPED[kind], file, contents), count)


@fuzz_commands(3, 120)
@pytest.mark.parametrize("kind", KINDS)
def test_cards(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    file = f"weights/{NAMES[kind]}.json"
    place = workplace(folder, f"predict: card, {kind}")
    place.run_all(wrong_file(SHIPPED[kind], file, json_files([json.loads((folder / "in" / file).read_text())])), count)


@fuzz_commands(3, 150)
def test_lines_along_the_road(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    place = workplace(folder, "predict: line along the road")
    sound = (folder / "in" / "axis.csv").read_bytes()
    place.run_all(wrong_file(OWN["centerline"], "axis.csv", damaged([sound])), count)


@fuzz_commands(3, 40)
@pytest.mark.parametrize("kind", KINDS)
def test_words(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    names = (
        "",
        ".",
        "/dev/null",
        "/",
        "nowhere",
        "\udcff",
        f"{IN}/axis.csv",
        f"{IN}/mapping.json",
        f"{OUT}/x",
        "x" * 300,
    )
    more = [
        *((option, name) for option in ("--path", "--output") for name in names),
        *((name,) for name in names),
        ("--classification",),
        ("--overwrite",),
    ]
    workplace(folder, f"predict: words, {kind}").run_all(wrong_words(OWN[kind], more), count)
