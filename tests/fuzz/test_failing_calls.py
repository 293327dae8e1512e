"""The n-th call that changes a file fails, as on a full disk: one line, nothing half-written, nothing left behind."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.dataset.manifest import faults, read_manifest
from tests.helpers.clouds.road_data_sets import write_data_set

ROOT = Path(__file__).parents[2]
SMALL = {
    "fidelity": "draft",
    "vegetation_detail": 0,
    "road.length": 20,
    "road.half_width": 20,
    "scan.lines_per_second": 20,
    "scan.platform.speed": 40,
    "scan.platform.lateral_offsets": [0],
    "colour.source": "material",
}
NUMBERS = (*range(101), *np.random.default_rng(29).choice(np.arange(101, 1500), 100, replace=False).tolist())
"""The calls that fail, one in each run; 0: none."""
OTHERS = ("blender_", "torchinductor_")
"""Empty folders for temporary files of Blender, where our own for it couldn't be made, and PyTorch's cache."""
NEEDED = shutil.which("gcc") or shutil.which("cc")

pytestmark = [
    pytest.mark.any_blender,
    pytest.mark.skipif(sys.platform != "linux" or not NEEDED, reason="preloads a library that a C compiler makes"),
]


class Server:
    """Runs commands with a failing call in copies of one process that has loaded everything."""

    def __init__(self, folder: Path, *names: str) -> None:
        library = folder / "failing_calls.so"
        source = Path(__file__).with_name("failing_calls.c")
        subprocess.run([NEEDED or "cc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
        environment = {**os.environ, "LD_PRELOAD": str(library), "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, str(Path(__file__).with_name("failing_calls_server.py")), *names]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, cwd=folder, env=environment, stdin=pipe, stdout=pipe, text=True)
        self._folder = folder

    def run(self, at: int, argv: list[str], folder: Path) -> tuple[int, str]:
        """Return exit code and output of a command whose call number ``at`` below a folder fails; 0: none."""
        assert self._process.stdin
        assert self._process.stdout
        (folder / "tmp").mkdir(parents=True)
        said = self._folder / "said.txt"
        case = {"at": at, "argv": argv, "folder": str(folder), "said": str(said)}
        self._process.stdin.write(json.dumps(case) + "\n")
        self._process.stdin.flush()
        code = json.loads(self._process.stdout.readline())
        return code, said.read_text(encoding="utf-8", errors="replace")

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    pytest.importorskip("bpy", reason="needs Blender")
    torch = ["train"] if _has_torch() else []
    running = Server(tmp_path_factory.mktemp("server"), "generate", "dataset", *torch)
    yield running
    running.close()


def _has_torch() -> bool:
    from importlib.util import find_spec

    return find_spec("torch") is not None


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recipe, and a training with its data."""
    folder = tmp_path_factory.mktemp("inputs")
    recipe = {"title": "t", "seed": 3, "layouts": ["pointcept"], "groups": [{"name": "a", "scenes": 1}]}
    recipe["set"] = {**SMALL, "outputs": ["parameters", "cloud", "centerline"]}
    (folder / "recipe.yaml").write_text(yaml.safe_dump(recipe))
    write_data_set(folder / "roads")
    network = {"name": "transformer", "cells": 4, "point_width": 8, "width": 16, "context": 16, "layers": 1, "heads": 2}
    training = {
        "task": "centerline",
        "threads": 1,
        "device": "cpu",
        "data": {"data_sets": [str(folder / "roads")]},
        "slices": {"half_width": 20.0, "points_per_slice": 96},
        "network": network,
        "batches": {"size": 4, "steps": 1, "passes": 1, "validation": 4},
        "schedule": {"epochs": 2, "learning_rate": 0.003},
    }
    (folder / "training.yaml").write_text(yaml.safe_dump(training))
    return folder


def words(job: str, inputs: Path, output: Path) -> list[str]:
    """Return a command that writes to a folder."""
    arguments = {
        "generate": ["--scenario", "rq31-600m-even", *(f"--set={k}={json.dumps(v)}" for k, v in SMALL.items())],
        "dataset": [str(inputs / "recipe.yaml")],
        "train": [str(inputs / "training.yaml")],
    }[job]
    return [job, *arguments, "--quiet", "--output", str(output)]


def check_whole(job: str, output: Path) -> None:
    """See that each file that is there can be read to its end, and that nothing else is."""
    if not output.exists():
        return
    hidden = [path for path in output.rglob(".*") if path.name != ".lock"]
    assert not hidden, hidden
    for path in output.rglob("*"):
        if path.suffix in (".json", ".geojson"):
            json.loads(path.read_text())
        elif path.suffix == ".laz":
            with open_cloud(path) as cloud:
                assert sum(len(block) for block in cloud.blocks()) == cloud.header.count
    if job == "dataset" and (output / "manifest.json").exists():
        scenes = read_manifest(output).scenes
        assert not faults(output, scenes)


def check_case(server: Server, job: str, at: int, inputs: Path, folder: Path) -> int:
    """Run a job whose call number ``at`` fails, and see how it ends; return the exit code."""
    output = folder / "out"
    code, said = server.run(at, words(job, inputs, output), folder)
    assert "Traceback" not in said, f"{at}: {said}"
    assert at or code == 0, f"undisturbed it isn't made: {said}"
    assert code in ((0, 2, 3) if job == "dataset" else (0, 2)), f"{at}: {code}: {said}"
    errors = [line for line in said.splitlines() if line.startswith("error:")]
    assert len(errors) == (code == 2), f"{at}: {said}"
    left = [path for path in (folder / "tmp").rglob("*") if not path.name.startswith(OTHERS)]
    assert not left, f"{at}: {left}"
    check_whole(job, output)
    return code


@pytest.mark.fuzz
@pytest.mark.parametrize("job", ["generate", "dataset", "train"])
def test_a_call_that_fails(job: str, server: Server, inputs: Path, tmp_path: Path) -> None:
    if job == "train" and not _has_torch():
        pytest.skip("needs PyTorch")
    codes: list[int] = []
    for at in NUMBERS:
        codes.append(check_case(server, job, at, inputs, tmp_path / str(at)))
        shutil.rmtree(tmp_path / str(at))
    assert 2 in codes or 3 in codes, "no call has failed: the test shows nothing"
