"""Trainings that are stopped, killed, or lose a worker: what stands is whole, and resumed they end as undisturbed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import write_pointcept

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="signals and /proc as Linux has them"),
]

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("centerline", "segmentation")
ROUNDS, MOST_ROUNDS = 4, 12
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""To all processes of a training: from a terminal, from Slurm or a container, from a lost connection."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_data_set(folder / "roads")
    for split, seed in (("train", 1), ("test", 3)):
        write_pointcept(folder / "real", split, [road_tile(3000, seed + k, f"real{k}") for k in range(2)])
    return folder


def configuration(kind: str, data: Path, **changes: Any) -> dict[str, Any]:
    """Return a training of some seconds, in many epochs."""
    if kind == "centerline":
        plain: dict[str, Any] = {
            "data": {"data_sets": [str(data / "roads")]},
            "slices": {"half_width": 20.0, "points_per_slice": 96},
            "network": {
                "name": "transformer",
                "cells": 4,
                "point_width": 8,
                "width": 16,
                "context": 16,
                "layers": 1,
                "heads": 2,
                "dropout": 0.1,
            },
            "batches": {"size": 4, "steps": 4, "passes": 2, "validation": 8},
            "schedule": {"epochs": 12, "learning_rate": 0.003},
        }
    else:
        source = {"path": str(data / "real")}
        plain = {
            "voxel": 0.3,
            "crop_points": 800,
            "crops_per_tile": 8,
            "batch": 4,
            "workers": 2,
            "set_up": "real",
            "network": {"preset": "S", "width": 8, "radius": 0.9, "neighbours": 8, "dropout": 0.1},
            "schedule": {"epochs": 6},
            "data": {"real": [{**source, "split": "train"}], "tests": {"unseen": [{**source, "split": "test"}]}},
        }
    return {"task": kind, "threads": 1, "device": "cpu", **plain, **changes}


@dataclass(frozen=True)
class Training:
    """A training as a command: of what, and into which folder."""

    file: Path
    folder: Path

    @contextmanager
    def begun(self) -> Iterator[subprocess.Popen[str]]:
        """Begin it or go on with it, in a group of processes of its own; wait until its folder is made."""
        arguments = ["env", "--default-signal=INT,HUP", sys.executable, "-m", "headless.train", str(self.file)]
        arguments += ["--output", str(self.folder), "--resume", "--quiet"]
        pipes: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        before = self._stamp()
        with subprocess.Popen(arguments, cwd=ROOT, start_new_session=True, **pipes) as process:
            wait_until(lambda: self._stamp() != before or process.poll() is not None)
            yield process

    def _stamp(self) -> int:
        path = self.folder / "configuration.json"
        return path.stat().st_mtime_ns if path.exists() else 0

    def to_its_end(self) -> None:
        with self.begun() as process:
            _, said = process.communicate()
        assert process.returncode == 0, said

    def stopped(self, after: float, sign: signal.Signals) -> tuple[int, str]:
        """Send a signal to all its processes, as a terminal does, some seconds after it began; return how it ended."""
        with self.begun() as process:
            time.sleep(after)
            with suppress(ProcessLookupError):
                os.killpg(process.pid, sign)
            _, said = process.communicate(timeout=60)
        return process.returncode, said


def wait_until(true: Callable[[], object], seconds: float = 120.0) -> None:
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until, "waited too long"
        time.sleep(0.01)


def training(kind: str, data: Path, folder: Path, **changes: Any) -> Training:
    """Write a training's configuration; nothing but that is there of it."""
    folder.mkdir()
    content = configuration(kind, data, **changes)
    if kind == "centerline":
        content["data"]["cache"] = str(folder / "cache")
    (folder / "toy.yaml").write_text(json.dumps(content))
    return Training(folder / "toy.yaml", folder / "run")


def outcome(folder: Path) -> dict[str, Any]:
    """Return what a training ended with, but for what it took."""
    state = torch.load(folder / "checkpoint.pt", weights_only=True)
    history = json.loads((folder / "history.json").read_text())
    metrics = json.loads((folder / "metrics.json").read_text())
    return {
        "weights": {name: value.numpy().tobytes() for name, value in state["model"].items()},
        "history": [{name: value for name, value in epoch.items() if name != "seconds"} for epoch in history],
        "metrics": {name: value for name, value in metrics.items() if name != "peak_memory_mb"},
        "files": sorted(path.name for path in folder.iterdir() if not path.name.startswith(".")),
    }


def check_whole(folder: Path) -> None:
    """See that each file that stands under its final name can be read to its end."""
    for path in folder.glob("[!.]*"):
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".pt":
            assert {"model", "optimizer", "epoch"} == set(torch.load(path, weights_only=True))
        else:
            assert path.name == "curves.png"
            assert path.read_bytes().endswith(b"IEND\xaeB`\x82")


@pytest.fixture(scope="module")
def whole(data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[float, dict[str, Any]]]:
    """How long each training takes from when its folder is made, s, and what it ends with."""
    found = {}
    for kind in KINDS:
        undisturbed = training(kind, data, tmp_path_factory.mktemp(kind) / "whole")
        with undisturbed.begun() as process:
            begin = time.monotonic()
            assert process.wait() == 0
            found[kind] = time.monotonic() - begin, outcome(undisturbed.folder)
    return found


Whole = dict[str, tuple[float, dict[str, Any]]]


@pytest.mark.parametrize("kind", KINDS)
def test_killed_at_any_moment_it_ends_as_undisturbed(kind: str, data: Path, whole: Whole, tmp_path: Path) -> None:
    """Killed twice, with its workers: the second time while it goes on."""
    seconds, wanted = whole[kind]
    rng, codes = np.random.default_rng(8), []
    for number in range(MOST_ROUNDS):
        disturbed = training(kind, data, tmp_path / str(number))
        for _ in range(2):
            codes.append(disturbed.stopped(float(rng.uniform(0.0, 0.8) * seconds), signal.SIGKILL)[0])
            check_whole(disturbed.folder)
        seconds *= 0.5 if codes[-2] == 0 else 1.0  # the machine is faster than it was
        disturbed.to_its_end()
        assert outcome(disturbed.folder) == wanted
        if number + 1 >= ROUNDS and codes.count(-signal.SIGKILL) >= ROUNDS:
            return
    raise AssertionError(f"too few were killed before they had ended: {codes}")


@pytest.mark.parametrize("kind", KINDS)
def test_interrupted_at_any_moment_it_says_so_and_goes_on(kind: str, data: Path, whole: Whole, tmp_path: Path) -> None:
    seconds, wanted = whole[kind]
    rng, codes = np.random.default_rng(9), []
    for number in range(MOST_ROUNDS):
        disturbed = training(kind, data, tmp_path / str(number))
        sign = ENDS[number % len(ENDS)]
        code, said = disturbed.stopped(float(rng.uniform(0.0, 0.8) * seconds), sign)
        codes.append(code)
        assert code in (0, 130), said
        assert "Traceback" not in said, said
        check_whole(disturbed.folder)
        if code == 130:
            assert said == "interrupted; nothing was left half-written\n"
            assert not list(disturbed.folder.glob(".*"))
            disturbed.to_its_end()
        seconds *= 0.5 if code == 0 else 1.0  # the machine is faster than it was
        assert outcome(disturbed.folder) == wanted
        if number + 1 >= ROUNDS and codes.count(130) >= ROUNDS // 2:
            return
    raise AssertionError(f"too few were interrupted before they had ended: {codes}")


def begun_by(process: int) -> list[int]:
    """Return the processes that a process has begun."""
    with suppress(OSError):
        return [int(child) for child in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    return []


def workers_of(process: int) -> list[int]:
    """Return the processes that a command's work has begun, which is done in a process of its own."""
    return [worker for work in begun_by(process) for worker in begun_by(work)]


def test_a_lost_worker_is_one_line_and_the_training_goes_on_when_resumed(data: Path, tmp_path: Path) -> None:
    """As the system kills one where memory is short."""
    changes = {"crops_per_tile": 200, "schedule": {"epochs": 2}}
    undisturbed = training("segmentation", data, tmp_path / "whole", **changes)
    undisturbed.to_its_end()
    disturbed = training("segmentation", data, tmp_path / "lost", **changes)
    for epoch in (0, 1):
        with disturbed.begun() as process:
            wait_until(lambda: (disturbed.folder / "history.json").exists() or not epoch)  # noqa: B023
            wait_until(lambda: len(workers_of(process.pid)) == 2)
            time.sleep(0.3)
            os.kill(workers_of(process.pid)[-1], signal.SIGKILL)
            _, said = process.communicate(timeout=60)
        assert (process.returncode, len(said.splitlines())) == (2, 1), said
        assert said.startswith("error: workers is 2: ")
        assert "--resume" in said
        check_whole(disturbed.folder)
        assert not list(disturbed.folder.glob(".*"))
        assert (disturbed.folder / "checkpoint.pt").exists() == bool(epoch)
    training("segmentation", data, tmp_path / "alone", **changes, workers=0)
    Training(tmp_path / "alone" / "toy.yaml", disturbed.folder).to_its_end()  # fewer workers give the same bits
    assert outcome(disturbed.folder) == outcome(undisturbed.folder)
