"""Configurations of trainings and experiments made wrong by chance: taken, or refused in one line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ml.configuration import EXPERIMENTS, SHIPPED, load_configuration
from ml.data.classes import MAPPINGS, load_mapping
from ml.experiments import configurations, load_experiment
from ml.runs import CHECKPOINT, CONFIGURATION, Run
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import read_json, read_yaml
from tests.helpers.files.mutations import accepted, for_all, fuzz, json_files, yaml_files

Body = Callable[[bytes], None]


@pytest.fixture
def body(tmp_path: Path) -> Callable[[str, Callable[[Path], object]], Body]:
    """Return what turns a reader of a file into one of its content."""

    def make(name: str, read: Callable[[Path], object]) -> Body:
        path = tmp_path / name

        def run(content: bytes) -> None:
            path.write_bytes(content)
            accepted(lambda: read(path))

        return run

    return make


def documents(folder: Path, pattern: str, read: Callable[[Path], Any]) -> list[Any]:
    return [read(path) for path in sorted(folder.glob(pattern))]


@fuzz(30, 3000)
def test_configurations(body: Any, count: int) -> None:
    use = body("training.yaml", lambda path: load_configuration(str(path), ["seed=2"]))
    for_all(yaml_files(documents(SHIPPED, "*.yaml", read_yaml)), count, use)


class _AnyFolder(dict[str, str]):
    def __missing__(self, name: str) -> str:
        return "somewhere"

    def __iter__(self) -> Iterator[str]:
        return iter(("real", "synthetic", "other", "gantries"))


@fuzz(10, 1000)
def test_experiments(body: Any, count: int) -> None:
    use = body("experiment.yaml", lambda path: configurations(load_experiment(str(path)), _AnyFolder()))
    for_all(yaml_files(documents(EXPERIMENTS, "*.yaml", read_yaml)), count, use)


@fuzz(10, 1000)
def test_mappings_of_classes(body: Any, count: int) -> None:
    use = body("classes.json", lambda path: load_mapping(str(path)))
    for_all(json_files(documents(MAPPINGS, "*.json", read_json)), count, use)


@fuzz(10, 500)
def test_folders_of_runs(tmp_path: Path, count: int) -> None:
    """Damaged files of a run: opened and resumed, or refused."""
    sound = load_configuration("segmentation-small")
    (tmp_path / CHECKPOINT).write_bytes(b"no checkpoint")

    def use(content: bytes) -> None:
        (tmp_path / CONFIGURATION).write_bytes(content)
        accepted(lambda: Run.open(tmp_path))
        accepted(lambda: Run.start(tmp_path, sound, resume=True))

    for_all(json_files([sound.to_dict()]), count, use)


def test_a_checkpoint_of_something_else_is_refused(tmp_path: Path) -> None:
    import torch

    sound = load_configuration("segmentation-small")
    Run.start(tmp_path, sound).begin()
    torch.save({"weights": torch.zeros(3)}, tmp_path / CHECKPOINT)
    with pytest.raises(InputError, match=r"checkpoint\.pt: must be a checkpoint of SynthRoads"):
        Run.start(tmp_path, sound, resume=True)
