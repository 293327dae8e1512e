"""Training, measuring, experiments on files made wrong by chance: configurations, data, classes, runs gone on with."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml
from hypothesis import assume
from hypothesis import strategies as st

from ml import runs
from ml.configuration import from_data
from ml.experiments import configurations as configured
from ml.experiments import load_experiment
from ml.runs import CHECKPOINT, CONFIGURATION, HISTORY
from synthroads_addon.base.schema import read_json
from tests.fuzz.test_bytes import SHORT
from tests.helpers.files.command_runs import IN, OUT, MakeWorkplace, fuzz_commands, wrong_file, wrong_words
from tests.helpers.files.learning_inputs import configurations, experiments
from tests.helpers.files.mutations import YAML_TOKENS, damaged, json_files, wrong_values
from tests.helpers.files.wrong_weights import wrong_checkpoints

KINDS = ("segmentation", "centerline")
AMOUNTS = {
    **dict.fromkeys(("workers", "processes", "accumulation", "threads"), 1),
    **dict.fromkeys(("epochs", "steps", "passes", "rounds", "layers", "votes"), 2),
    **dict.fromkeys(("size", "batch", "crops_per_tile", "crops_per_epoch", "validation", "heads", "cells"), 8),
    **dict.fromkeys(("width", "point_width", "context", "neighbours", "slices"), 64),
    **dict.fromkeys(("crop_points", "points_per_slice"), 1000),
}
"""Numbers that say how much is to be done, and what is little: more takes its time, and nothing is wrong with it."""


@pytest.fixture(scope="module")
def folder(learning_folder: Path) -> Iterator[Path]:
    """Return the folder in which commands work; curves aren't drawn, as that takes longer than the training."""
    with pytest.MonkeyPatch.context() as patch:
        picture = b"\x89PNG, not drawn\0\0\0\0IEND\0\0\0\0"
        patch.setattr(runs, "_curves", lambda history: picture)
        yield learning_folder


def amounts(data: Any, path: str = "") -> dict[str, float]:
    """Return the amounts of a configuration's data by their paths."""
    if isinstance(data, dict):
        parts = [amounts(value, f"{path}.{name}") for name, value in data.items()]
        return {name: value for part in parts for name, value in part.items()}
    return {path: data} if isinstance(data, int | float) and path.rpartition(".")[2] in AMOUNTS else {}


def asks_for_little(data: Mapping[str, Any], sound: Mapping[str, float]) -> bool:
    """Return whether a configuration's data ask for no more than is little, or than a sound one's amounts."""
    found = amounts(data)
    streams = isinstance(data["data"], dict) and data["data"].get("stream")  # scenes are made by Blender
    return not streams and all(
        value <= max(AMOUNTS[path.rpartition(".")[2]], sound.get(path, 0)) for path, value in found.items()
    )


def little_work(document: Any, all_of: Callable[[Any], list[Any]]) -> st.SearchStrategy[bytes]:
    """Return YAML files with wrong values, or with damaged bytes, that don't ask for much work.

    Args:
        document: a sound one.
        all_of: returns the configurations that a document stands for.
    """
    sound = amounts(all_of(document)[0].to_dict())

    def kept(content: bytes) -> bytes:
        try:
            found = all_of(json.loads(content) if content.startswith(b"{") else yaml.safe_load(content))
        except Exception:  # whatever is wrong with it, the command is to say
            return content
        assume(len(found) < 4 and all(asks_for_little(one.to_dict(), sound) for one in found))
        return content

    text = yaml.safe_dump(document, sort_keys=False).encode()
    tokens = [token for token in (*SHORT, *YAML_TOKENS) if len(token) < 100]
    values = wrong_values([document]).map(lambda data: json.dumps(data).encode())
    return st.one_of(values, values, values, damaged([text], tokens)).map(kept)


def little_training(folder: Path, kind: str) -> st.SearchStrategy[bytes]:
    """Return wrong configurations of a training."""
    return little_work(configurations(folder)[kind], lambda data: [from_data(data, kind)])


def little_experiment(folder: Path, kind: str) -> st.SearchStrategy[bytes]:
    """Return wrong files of an experiment."""
    places = {"real": str(folder / "data" / "real"), "synthetic": str(folder / "data" / "synthetic")}
    file = folder.parent / "experiment.yaml"

    def trainings(data: Any) -> list[Any]:
        file.write_text(json.dumps(data))
        experiment = load_experiment(str(file))
        return [one for one in configured(experiment, places).values() for _ in experiment.seeds]

    return little_work(experiments(folder)[kind], trainings)


TRAIN = {kind: ("train", f"{IN}/{kind}.yaml", "--output", f"{OUT}/run") for kind in KINDS}
DATA = ("--data", f"real={IN}/data/real", "--data", f"synthetic={IN}/data/synthetic")
EXPERIMENT = {
    "segmentation": ("experiment", f"{IN}/segmentation-experiment.yaml", *DATA, "--output", f"{OUT}/runs"),
    "centerline": (
        *("experiment", f"{IN}/centerline-experiment.yaml", "--data", f"real={IN}/measured"),
        *("--data", f"synthetic={IN}/roads", "--output", f"{OUT}/runs"),
    ),
}
EVALUATE = {
    "segmentation": ("evaluate", f"{IN}/segmentation", f"{IN}/cloud.laz", "--output", f"{OUT}/scores"),
    "centerline": ("evaluate", f"{IN}/centerline", f"{IN}/roads", "--output", f"{OUT}/scores"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_sound_ones_are_taken(kind: str, folder: Path, workplace: MakeWorkplace) -> None:
    """Else the tests below would show nothing."""
    place = workplace(folder, f"train, experiment: sound {kind}")
    assert place.run((TRAIN[kind], {})) == 0
    assert place.run((EXPERIMENT[kind], {})) == 0
    if kind == "segmentation":
        assert place.run((EVALUATE[kind], {})) == 0


@fuzz_commands(3, 400)
@pytest.mark.parametrize("kind", KINDS)
def test_configurations(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    place = workplace(folder, f"train: configuration, {kind}")
    place.run_all(wrong_file(TRAIN[kind], f"{kind}.yaml", little_training(folder / "in", kind)), count)


def data_files(folder: Path, kind: str) -> list[str]:
    """Return the files that a training learns from."""
    names = ("data/real/**/train/**/*.npy", "data/real/**/*.json", "pack.npz")
    if kind == "centerline":
        names = ("roads/manifest.json", "roads/scenes/a-01/*.json", "roads/scenes/a-01/*.laz")
    return sorted(str(path.relative_to(folder)) for name in names for path in folder.glob(name))


@fuzz_commands(3, 150)
@pytest.mark.parametrize("kind", KINDS)
def test_data(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    inputs, cases = folder / "in", []
    for name in data_files(inputs, kind):
        content = (inputs / name).read_bytes()
        wrong = json_files([json.loads(content)]) if name.endswith(".json") else damaged([content], SHORT, head=300)
        words = TRAIN[kind]
        if name == "pack.npz":
            words = (*words, "--set", f'data.real=[{{"path": "{IN}/pack.npz"}}]')
        cases.append(wrong_file(words, name, wrong))
    workplace(folder, f"train: data, {kind}").run_all(st.one_of(*cases), count)


@fuzz_commands(3, 120)
@pytest.mark.parametrize("kind", KINDS)
def test_classes_and_changes(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    changes = (
        "seed=-1",
        "seed=1e400",
        "x=1",
        "data=[",
        "network.width=0",
        "network=3",
        "schedule.epochs=nan",
        "=",
        "classes=nowhere.json",
    )
    cases = wrong_words(TRAIN[kind], [("--set", change) for change in changes])
    if kind == "segmentation":
        scheme = json_files([read_json(folder / "in" / "classes.json")])
        cases |= wrong_file((*TRAIN[kind], "--set", f"classes={IN}/classes.json"), "classes.json", scheme)
        begun = (*TRAIN[kind], "--set", f"start={IN}/{kind}")
    else:
        begun = (*TRAIN[kind], "--set", f"begin_with={IN}/{kind}")
    state = torch.load(folder / "in" / kind / CHECKPOINT, weights_only=True)
    cases |= wrong_file(begun, f"{kind}/{CHECKPOINT}", wrong_checkpoints(state))
    workplace(folder, f"train: classes, changes, start, {kind}").run_all(cases, count)


@fuzz_commands(3, 120)
@pytest.mark.parametrize("kind", KINDS)
def test_runs_that_are_gone_on_with(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    """The run's folder is the output, so that it is an input as well."""
    place = workplace(folder, f"train --resume: files of a run, {kind}", resumes=kind)
    sound = folder / "in" / kind
    words = (*TRAIN[kind][:2], "--output", f"{OUT}/{kind}", "--resume")
    state = torch.load(sound / CHECKPOINT, weights_only=True)
    cases = [wrong_file(words, f"{kind}/{CHECKPOINT}", wrong_checkpoints(state))]
    cases += [wrong_file(words, f"{kind}/{CHECKPOINT}", damaged([(sound / CHECKPOINT).read_bytes()], SHORT))]
    for name in (CONFIGURATION, HISTORY):
        cases.append(wrong_file(words, f"{kind}/{name}", json_files([json.loads((sound / name).read_text())])))
    place.run_all(st.one_of(*cases), count)


@fuzz_commands(3, 300)
@pytest.mark.parametrize("kind", KINDS)
def test_experiments(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    name = f"{kind}-experiment.yaml"
    place = workplace(folder, f"experiment: file, {kind}")
    fewer = count if kind == "segmentation" else -(-count // 2)
    place.run_all(wrong_file(EXPERIMENT[kind], name, little_experiment(folder / "in", kind)), fewer)


@fuzz_commands(3, 60)
@pytest.mark.parametrize("kind", KINDS)
def test_words_of_experiments(kind: str, folder: Path, workplace: MakeWorkplace, count: int) -> None:
    more = [
        *(("--data", text) for text in ("real=", "=x", "x", f"real={IN}/cloud.laz", f"real={IN}/nowhere", "{a}=b")),
        *(("--seeds", text) for text in ("-1", "x", "99999999999999999999999", "1e5", "")),
        *(("--leave-out", text) for text in ("a", "", ",", "nowhere,a", "../x")),
        *(("--configuration", text) for text in ("nowhere", f"{IN}/classes.json", f"{IN}/cloud.laz", "/dev/null", "")),
        *(("--set", text) for text in ("seed=x", "data.real=3", "set_up=none", "threads=-1")),
    ]
    base = st.just(EXPERIMENT[kind])
    words = base.flatmap(lambda words: wrong_words(words, more))
    cases = words | wrong_file(EXPERIMENT[kind], f"{kind}.yaml", little_training(folder / "in", kind))
    workplace(folder, f"experiment: words, configuration, {kind}").run_all(cases, count)


@fuzz_commands(3, 350)
def test_measuring_of_segmentations(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    inputs, words = folder / "in", EVALUATE["segmentation"]
    tiles = ("evaluate", f"{IN}/segmentation", f"{IN}/data/real", "--output", f"{OUT}/scores")
    state = torch.load(inputs / "segmentation" / CHECKPOINT, weights_only=True)

    def sound(name: str) -> Any:
        return read_json(inputs / name)

    cases = [
        wrong_file(words, f"segmentation/{CHECKPOINT}", wrong_checkpoints(state)),
        wrong_file(words, f"segmentation/{CONFIGURATION}", json_files([sound(f"segmentation/{CONFIGURATION}")])),
        wrong_file(words, "cloud.laz", damaged([(inputs / "cloud.laz").read_bytes()], SHORT, head=900)),
        wrong_file((*words, "--mapping", f"{IN}/mapping.json"), "mapping.json", json_files([sound("mapping.json")])),
        wrong_file(
            (*words[:2], f"{IN}/data", *words[3:], "--yardstick", f"{IN}/yardstick.json"),
            *("yardstick.json", json_files([sound("yardstick.json")])),
        ),
        *(
            wrong_file(tiles, name, damaged([(inputs / name).read_bytes()], SHORT, head=300))
            for name in sorted(str(path.relative_to(inputs)) for path in inputs.glob("data/real/**/test/**/*.*"))
        ),
        wrong_words(tiles, [("--split", text) for text in ("", "train", "nowhere", "..", "a/b", "*")]),
        wrong_words(
            words, [("--mapping", text) for text in ("", "ign", "nowhere", f"{IN}/cloud.laz", f"{IN}/classes.json")]
        ),
        wrong_words(tiles, [("--yardstick", text) for text in ("", "dales", "nowhere", f"{IN}/mapping.json")]),
        wrong_words(
            ("evaluate", f"{IN}/segmentation"),
            [("--output", f"{OUT}/s", one) for one in (f"{IN}/roads", f"{IN}/road.laz", "nowhere", f"{IN}", "")],
        ),
    ]
    workplace(folder, "evaluate: segmentation").run_all(st.one_of(*cases), count)


@fuzz_commands(3, 80)
def test_measuring_of_centrelines(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    inputs, words = folder / "in", EVALUATE["centerline"]
    state = torch.load(inputs / "centerline" / CHECKPOINT, weights_only=True)
    cases = [
        wrong_file(words, f"centerline/{CHECKPOINT}", wrong_checkpoints(state)),
        wrong_file(words, "roads/manifest.json", json_files([read_json(inputs / "roads/manifest.json")])),
        wrong_file(
            words, "roads/scenes/a-03/cloud.laz", damaged([(inputs / "road.laz").read_bytes()], SHORT, head=900)
        ),
        wrong_file(
            words,
            "roads/scenes/a-03/parameters.json",
            json_files([read_json(inputs / "roads/scenes/a-03/parameters.json")]),
        ),
        wrong_words(words, [("--split", text) for text in ("", "nowhere", "..")]),
    ]
    workplace(folder, "evaluate: centerline").run_all(st.one_of(*cases), count)
