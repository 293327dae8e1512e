"""Trainings on scenes that are made meanwhile: the same weights however they come, and a folder that stays small.

The scenes are made by `tests/helpers/quick_producer.py`, without Blender; a slow test makes real ones.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import torch

from ml.centerline import task as centerline_task
from ml.configuration import from_data
from ml.data import scene_stream
from ml.data.scene_stream import SCENES, SceneStream, StreamOptions
from ml.runs import METRICS, Run
from ml.segmentation import task
from ml.segmentation.loading import StreamedCropBatches
from ml.segmentation.recipes import SegmentationConfiguration, plan
from synthroads_addon.base.errors import Cancelled, InputError, OutputError
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.base.version import generator
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from synthroads_addon.dataset.scene_stream import (
    PLAN,
    StreamPlan,
    read_entry,
    scene_folder,
    scene_numbers,
    write_wanted,
)
from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import toy, write_pointcept

torch.set_num_threads(1)
QUICK = (sys.executable, str(Path(__file__).resolve().parents[1] / "helpers" / "quick_producer.py"))
STREAM = {"recipe": "small-roads", "scenes_per_epoch": 2, "keep": 5}


@pytest.fixture(autouse=True)
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Have scenes made in no time; return the file that says which."""
    monkeypatch.setattr(scene_stream, "PRODUCER", QUICK)
    monkeypatch.setenv("QUICK_LOG", str(tmp_path / "made.txt"))
    return tmp_path / "made.txt"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with real tiles to train on and to test on."""
    folder = tmp_path_factory.mktemp("data")
    for split, seed in (("train", 1), ("test", 3)):
        write_pointcept(folder / "real", split, [road_tile(500, seed, f"real-{split}", length=20.0)])
    return folder


def small(data: Path, **changes: Any) -> SegmentationConfiguration:
    """Return a toy that learns from scenes that are made meanwhile, four epochs of six crops."""
    base = toy(data).to_dict()
    given = base["data"] | {"synthetic": [], "stream": {**STREAM, **changes.pop("stream", {})}}
    few = {"crop_points": 300, "crops_per_epoch": 6, "batch": 2, "schedule": {"epochs": 4}, "set_up": "synthetic"}
    return SegmentationConfiguration.from_dict({**base, **few, "data": given, **changes})


def weights(run: Run[Any]) -> dict[str, torch.Tensor]:
    state = run.last_checkpoint()
    assert state is not None
    return state["model"]


def same(one: Run[Any], other: Run[Any]) -> bool:
    first, second = weights(one), weights(other)
    return first.keys() == second.keys() and all(torch.equal(first[name], second[name]) for name in first)


def begun(log: Path) -> list[list[int]]:
    """Return number, scenes that stood then and seed of each scene that was begun."""
    return [[int(word) for word in line.split()] for line in log.read_text().splitlines()]


class Stop:
    """Interrupts a training in its n-th step, as Ctrl-C would."""

    def __init__(self, after: int) -> None:
        self.left = after

    def __call__(self, stage: str, share: float) -> None:
        self.left -= stage == "training"
        if self.left < 0:
            raise Cancelled


@pytest.mark.slow
def test_the_same_weights_however_the_scenes_come_and_after_an_interruption(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: Path
) -> None:
    """By one quick producer, by three slow ones, and where the training and they are interrupted and go on."""
    whole = Run.start(tmp_path / "whole", small(data))
    metrics = task.train(whole)
    assert metrics["streamed_scenes"] == 8
    assert not (whole.folder / SCENES).exists(), "it is cleaned up"
    first = begun(log)
    assert sorted(number for number, *_ in first) == list(range(8))
    assert len({seed for *_, seed in first}) == 8
    assert max(stood for _, stood, _ in first) < STREAM["keep"]
    log.unlink()

    monkeypatch.setenv("QUICK_DELAY", "0.5")
    slow = Run.start(tmp_path / "slow", small(data, stream={"producers": 3}))
    task.train(slow)
    assert same(slow, whole)
    assert {(number, seed) for number, _, seed in begun(log)} == {(number, seed) for number, _, seed in first}
    assert max(stood for _, stood, _ in begun(log)) < STREAM["keep"]
    log.unlink()

    broken = Run.start(tmp_path / "broken", small(data))
    with pytest.raises(Cancelled):
        task.train(broken, Stop(8))  # in the third epoch
    left = scene_numbers(broken.folder / SCENES)
    assert {3, 4, 5} <= set(left), "those that it draws from"
    assert len(left) <= STREAM["keep"]
    assert {path.name for path in (broken.folder / SCENES).glob(".*")} <= {".lock"}
    resumed = Run.start(tmp_path / "broken", small(data, stream={"producers": 2}), resume=True)
    task.train(resumed)
    assert same(resumed, whole)
    assert resumed.history[-1]["loss"] == whole.history[-1]["loss"]
    numbers = [number for number, *_ in begun(log)]
    assert all(numbers.count(number) == 1 for number in left), "what was there isn't made again"
    assert not (resumed.folder / SCENES).exists()


@pytest.mark.slow
def test_another_seed_has_other_scenes_and_another_order(data: Path, tmp_path: Path, log: Path) -> None:
    seeds = []
    for seed in (1, 2):
        task.train(Run.start(tmp_path / str(seed), small(data, seed=seed, schedule={"epochs": 1})))
        seeds.append({scene for *_, scene in begun(log)})
        log.unlink()
    assert seeds[0].isdisjoint(seeds[1])


def test_scenes_follow_from_recipe_seed_and_number_alone() -> None:
    recipe = load_recipe("small-roads")
    one, other = (StreamPlan(recipe=recipe, split="train", seed=seed, generator="g") for seed in (1, 2))
    rounds = [[one.job(number) for number in range(6 * turn, 6 * turn + 6)] for turn in range(2)]
    names = {job.name for job in scene_jobs(recipe) if job.split == "train"}
    for jobs in rounds:
        assert {job.name for job in jobs} == names, "each once in a round"
    assert [job.name for job in rounds[0]] != [job.name for job in rounds[1]]
    assert len({job.scenario.seed for jobs in rounds for job in jobs}) == 12
    assert one.job(7) == rounds[1][1]
    assert other.job(7) != one.job(7)
    with pytest.raises(InputError, match="has no scene of it"):
        one.model_copy(update={"split": "trian"}).job(0)


def test_an_epoch_draws_from_its_new_scenes_and_the_newest_before_them() -> None:
    options = StreamOptions(recipe="small-roads", scenes_per_epoch=2, keep=7)
    assert [list(options.window(epoch)) for epoch in range(4)] == [
        [0, 1],
        [0, 1, 2, 3],
        [1, 2, 3, 4, 5],
        [3, 4, 5, 6, 7],
    ]


def test_mixed_crops_keep_their_share_and_an_epoch_its_length(data: Path, tmp_path: Path) -> None:
    """Mapped intensities, too: however many tiles an epoch has."""
    settings = small(
        data, set_up="mixed_mapped", synthetic_share=0.5, balanced=True, crops_per_epoch=8, stream={"keep": 8}
    )
    from ml.segmentation.loading import read_domains

    fixed = read_domains(settings)
    with SceneStream(settings.data.stream, 1, tmp_path, 4, ("pointcept",)) as stream:
        batches = StreamedCropBatches(settings, fixed, stream, torch.device("cpu"))
        assert len(batches) == 4
        for epoch, scenes in ((0, 2), (1, 4), (3, 6)):
            assert len(list(batches(epoch))) == 4
            assert [len(tiles) for tiles in batches.domains(epoch).values()] == [scenes, 1]
            assert len(batches.tiles) == scenes + 1
    draws = plan([3, 2], 30, None, seed=1, epoch=0, total=11)
    assert (len(draws), sum(draw.tile < 3 for draw in draws)) == (11, 7)
    assert plan([3, 2], 3, None, 1, 0) == plan([3, 2], 30, None, 1, 0, total=15)


@pytest.mark.slow
def test_scores_are_shifted_by_the_last_epochs_scenes_and_real_data_may_follow(data: Path, tmp_path: Path) -> None:
    tuning = {"epochs": 1, "learning_rate": 0.001}
    for name, changes in (
        ("shifted", {"fitted_offsets": True}),
        ("tuned", {"set_up": "fine_tuned", "fine_tuning": tuning}),
    ):
        run = Run.start(tmp_path / name, small(data, schedule={"epochs": 1}, **changes))
        task.train(run)
        assert ("offsets" in (run.last_checkpoint() or {})) == (name == "shifted")
        assert not (run.folder / SCENES).exists()


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("2:error", r"scene 2, roads-\d+': couldn't be made: the disk is on fire; --resume tries again"),
        (
            "2:exit",
            r"can't be made: the process that makes scenes has ended with code 9 \(out of luck\); --resume tries again",
        ),
    ],
)
def test_a_failure_is_told_and_the_training_can_be_resumed(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, told: str
) -> None:
    monkeypatch.setenv("QUICK_FAULT", fault)
    run = Run.start(tmp_path / "run", small(data))
    with pytest.raises(InputError, match=told):
        task.train(run)
    assert (run.last_checkpoint() or {})["epoch"] == 1
    monkeypatch.delenv("QUICK_FAULT")
    resumed = Run.start(tmp_path / "run", small(data), resume=True)
    task.train(resumed)
    assert (resumed.last_checkpoint() or {})["epoch"] == 4


def test_a_scenario_that_cannot_be_met_is_done_without(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("QUICK_FAULT", "0:scenario")
    task.train(Run.start(tmp_path / "run", small(data, schedule={"epochs": 1})))
    none = small(data, schedule={"epochs": 1}, stream={"scenes_per_epoch": 1})
    with pytest.raises(
        InputError, match=r"can't be made \(road.length is 1: must be more\), and neither can the other scenes"
    ):
        task.train(Run.start(tmp_path / "none", none))


def test_what_does_not_fit_is_refused(data: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="keep is 3: must be at least twice scenes_per_epoch, 4"):
        small(data, stream={"keep": 3})
    with pytest.raises(InputError, match=r"data\.stream needs crops_per_epoch"):
        small(data, crops_per_epoch=None)
    with pytest.raises(InputError, match="recipe"):
        task.train(Run.start(tmp_path / "run", small(data, stream={"recipe": "small-rods"})))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(OutputError, match="must be an empty folder, or one of scenes: this one holds other files"):
        task.train(Run.start(tmp_path / "other", small(data, stream={"folder": str(tmp_path / "mine")})))
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]


@pytest.mark.slow
def test_scenes_of_another_plan_and_damaged_ones_are_made_anew(tmp_path: Path, log: Path) -> None:
    def flow(seed: int) -> None:
        with SceneStream(StreamOptions.from_dict(STREAM), seed, tmp_path, 1, ("pointcept",)) as stream:
            stream.begin_epoch(0)

    flow(1)
    flow(1)
    assert len(begun(log)) == 2
    (array,) = scene_folder(tmp_path / SCENES, 1).rglob("coord.npy")
    array.write_bytes(array.read_bytes()[:-9])
    flow(1)
    assert [number for number, *_ in begun(log)][2:] == [1]
    flow(2)
    assert len(begun(log)) == 5
    assert {read_entry(tmp_path / SCENES, number).seed for number in (0, 1)} == {seed for *_, seed in begun(log)[3:]}


def test_producers_end_with_whoever_wanted_the_scenes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QUICK_DELAY", "600")
    folder = tmp_path / "stream"
    folder.mkdir()
    recipe = load_recipe("small-roads").model_copy(update={"layouts": ("pointcept",)})
    made = StreamPlan(recipe=recipe, split="train", seed=1, generator=generator())
    (folder / PLAN).write_text(canonical_json(made.to_dict()))
    write_wanted(folder, range(2))
    with subprocess.Popen([*QUICK, str(folder), "2"], stdin=subprocess.PIPE) as process:
        while len(list((folder / ".work").glob("*"))) < 2:
            time.sleep(0.05)
        with subprocess.Popen([*QUICK, str(folder), "1"], stdin=subprocess.PIPE) as second:
            assert second.wait() == 2
        assert "another training is running in this folder" in (folder / "failure.json").read_text()
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(60) == 0
    assert not (folder / ".work").exists()


@pytest.mark.slow
def test_centrelines_are_learned_from_a_stream_with_the_same_bits(tmp_path: Path, log: Path) -> None:
    data = write_data_set(tmp_path / "roads")
    plain = {
        "task": "centerline",
        "threads": 1,
        "data": {"data_sets": [str(data)], "train_split": "", "stream": {**STREAM, "scenes_per_epoch": 1}},
        "slices": {"half_width": 20.0, "points_per_slice": 48, "slices": 3},
        "network": {"name": "transformer", "cells": 4, "point_width": 8, "width": 16, "context": 16, "layers": 1},
        "batches": {"size": 2, "steps": 4, "passes": 2, "validation": 2},
        "schedule": {"epochs": 3},
    }
    whole = Run.start(tmp_path / "whole", from_data(plain, "test"))
    centerline_task.train(whole)
    assert len(begun(log)) == 3
    broken = Run.start(tmp_path / "broken", from_data(plain, "test"))
    with pytest.raises(Cancelled):
        centerline_task.train(broken, Stop(6))
    resumed = Run.start(tmp_path / "broken", from_data(plain, "test"), resume=True)
    centerline_task.train(resumed)
    assert same(resumed, whole)
    assert (whole.folder / METRICS).read_bytes() == (resumed.folder / METRICS).read_bytes()
    assert not (whole.folder / SCENES).exists()


@pytest.mark.slow
def test_two_processes_learn_from_one_stream(data: Path, tmp_path: Path, log: Path) -> None:
    """The same twice, and each scene is made once; scenes of another seed that are there before don't count."""
    runs = []
    for name in ("one", "other"):
        folder = tmp_path / f"{name}-scenes"
        with SceneStream(
            StreamOptions.from_dict({**STREAM, "folder": str(folder)}), 7, tmp_path, 1, ("pointcept",)
        ) as old:
            old.begin_epoch(0)
        log.unlink()
        settings = small(data, processes=2, crops_per_epoch=8, schedule={"epochs": 2}, stream={"folder": str(folder)})
        runs.append(Run.start(tmp_path / name, settings))
        task.train(runs[-1])
        assert sorted(number for number, *_ in begun(log)) == [0, 1, 2, 3]
        assert not folder.exists()
    assert same(*runs)


SCRIPT = """
import sys
from pathlib import Path
from ml.configuration import from_data
from ml.data import scene_stream
from ml.runs import Run
from ml.segmentation import task
from synthroads_addon.base.schema import read_json
scene_stream.PRODUCER = sys.argv[3:]
task.train(Run.start(Path(sys.argv[2]), from_data(read_json(Path(sys.argv[1])), "test"), resume=True))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="kills by signal")
def test_killed_it_ends_as_undisturbed(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In its third epoch, with scenes being made; the producers, whom nobody tells, end too."""
    whole = Run.start(tmp_path / "whole", small(data))
    task.train(whole)
    (tmp_path / "toy.json").write_text(json.dumps(small(data).to_dict()))
    killed = tmp_path / "killed"
    with monkeypatch.context() as patch:
        patch.setenv("QUICK_DELAY", "2")
        arguments = [sys.executable, "-c", SCRIPT, str(tmp_path / "toy.json"), str(killed), *QUICK]
        with subprocess.Popen(arguments, cwd=Path(__file__).resolve().parents[2]) as process:
            while not (killed / "history.json").is_file() or len(json.loads((killed / "history.json").read_text())) < 2:
                assert process.poll() is None
                time.sleep(0.02)
            process.kill()
    until = time.monotonic() + 60.0
    while (killed / SCENES / ".work").exists():
        assert time.monotonic() < until, "the producers go on"
        time.sleep(0.1)
    resumed = Run.start(killed, small(data), resume=True)
    task.train(resumed)
    assert same(resumed, whole)
    assert not (killed / SCENES).exists()


TINY = """
type: Recipe
version: "1.0"
title: Two roads of 60 m
seed: 3
scenario: every-class-1500m
set:
  cloud.classes: "5"
  fidelity: draft
  outputs: [cloud]
  road.length: 60
  road.half_width: 20
  road.furniture.construction_zone: 0
  road.furniture.gantries: 0
  road.furniture.gantry_spacing: null
  road.furniture.overpass: 0
  scan.platform.speed: 12
point_spacing: 0.2
groups:
  - {name: road, scenes: 2}
"""


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("bpy") is None, reason="needs Blender to make roads")
def test_real_scenes_are_the_same_bytes_and_give_the_same_weights(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Made by one process, or by two at once."""
    monkeypatch.undo()
    (tmp_path / "tiny.yaml").write_text(TINY)
    found: list[dict[int, dict[str, str]]] = []
    runs = []
    for producers in (1, 2):
        settings = small(
            data,
            stream={"recipe": str(tmp_path / "tiny.yaml"), "scenes_per_epoch": 1, "keep": 3, "producers": producers},
            schedule={"epochs": 2},
            voxel=0.5,
        )
        run = Run.start(tmp_path / f"run-{producers}", settings)
        sums: dict[int, dict[str, str]] = {}

        def watch(stage: str, share: float, run: Run[Any] = run, sums: dict[int, dict[str, str]] = sums) -> None:
            for number in scene_numbers(run.folder / SCENES):
                entry = read_entry(run.folder / SCENES, number)
                sums[number] = {name: file.sha256 for name, file in (entry.files or {}).items()}

        task.train(run, watch)
        found.append(sums)
        runs.append(run)
        assert not (run.folder / SCENES).exists()
    assert found[0] == found[1]
    assert sorted(found[0]) == [0, 1]
    assert len(found[0][0]) > 3
    assert same(*runs)
