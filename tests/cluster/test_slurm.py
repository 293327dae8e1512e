"""A data set made by Slurm jobs, whatever ends them: a real Slurm of one node, by `make test-cluster`."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml

from synthroads_addon.dataset.manifest import faults, read_manifest
from tests.cluster.slurm import missing, slurm

ROOT = Path(__file__).parents[2]
SCENES = 8
RECIPE = {
    "title": "Short roads",
    "seed": 3,
    "layouts": ["pointcept"],
    "set": {
        "fidelity": "draft",
        "vegetation_detail": 0,
        "outputs": ["parameters", "cloud", "centerline"],
        "road.length": 40,
        "road.half_width": 20,
        "scan.lines_per_second": 50,
        "scan.platform.speed": 40,
        "scan.platform.lateral_offsets": [0],
        "colour.source": "material",
    },
    "groups": [{"name": "a", "scenes": SCENES}],
}

pytestmark = [pytest.mark.cluster, pytest.mark.skipif(bool(missing()), reason=missing())]


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Return the environment for the commands of a Slurm that is at work."""
    with slurm(tmp_path_factory.mktemp("slurm")) as variables:
        yield {**variables, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recipe") / "recipe.yaml"
    path.write_text(yaml.safe_dump(RECIPE), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def local(recipe: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """Return the files with their checksums of the same data set made without a cluster."""
    folder = tmp_path_factory.mktemp("local") / "set"
    command = [sys.executable, "-m", "headless.dataset", str(recipe), "--output", str(folder), "--jobs", "2", "--quiet"]
    subprocess.run(command, cwd=ROOT, check=True)
    return checksums(folder)


def checksums(folder: Path) -> dict[str, object]:
    scenes = read_manifest(folder).scenes
    assert not faults(folder, scenes)
    return {scene.name: scene.files for scene in scenes}


@contextmanager
def running(recipe: Path, folder: Path, environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    """Start the shipped script; two jobs of a minute at most."""
    words = ["--jobs", "2", "--cores", "1", "--memory", "2GB", "--walltime", "00:01:00", "--interface", "lo"]
    command = [sys.executable, str(ROOT / "docs" / "slurm_cluster.py"), str(recipe), str(folder), *words]
    with subprocess.Popen(
        command, cwd=folder.parent, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            yield process
        finally:
            process.terminate()


def jobs(environment: dict[str, str], state: str = "all") -> list[str]:
    command = ["squeue", "--noheader", "--format=%i", f"--states={state}"]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()


def wait_until(condition: object, seconds: float, what: str) -> None:
    end = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end, what
        time.sleep(0.5)


def test_workers_that_end_every_minute(
    recipe: Path, local: dict[str, object], tmp_path: Path, environment: dict[str, str]
) -> None:
    """Each is replaced, and the scenes that they were at work on are made by others: the same bytes as without."""
    with running(recipe, tmp_path / "set", environment) as process:
        said, _ = process.communicate(timeout=900)
    assert process.returncode == 0, said
    assert f"{SCENES} of {SCENES} scenes" in said
    assert checksums(tmp_path / "set") == local
    accounts = (job for job in (tmp_path / "set").parent.glob("slurm-*.out"))
    assert len(list(accounts)) > 2, "no worker was replaced: the test shows nothing"


def test_all_workers_cancelled_in_mid_run(
    recipe: Path, local: dict[str, object], tmp_path: Path, environment: dict[str, str]
) -> None:
    """Others come, and the data set is finished."""
    with running(recipe, tmp_path / "set", environment) as process:
        wait_until(lambda: list((tmp_path / "set").glob("scenes/*")), 300.0, "no scene was made")
        first = jobs(environment, "running")
        assert first
        subprocess.run(["scancel", *first], env=environment, check=True)
        wait_until(lambda: set(jobs(environment)) - set(first), 60.0, "no other job was submitted")
        said, _ = process.communicate(timeout=900)
    assert process.returncode == 0, said
    assert checksums(tmp_path / "set") == local


def test_no_worker_ever_comes(recipe: Path, tmp_path: Path, environment: dict[str, str]) -> None:
    """It is said, and after the stated time there is an end."""
    subprocess.run(["scontrol", "update", "PartitionName=batch", "State=DOWN"], env=environment, check=True)
    try:
        words = ["--jobs", "1", "--interface", "lo", "--worker-timeout", "30"]
        command = [sys.executable, str(ROOT / "docs" / "slurm_cluster.py"), str(recipe), str(tmp_path / "set"), *words]
        answer = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=180, check=False
        )
    finally:
        subprocess.run(["scontrol", "update", "PartitionName=batch", "State=UP"], env=environment, check=True)
    assert answer.returncode == 2, answer.stderr
    assert "has no worker; waiting for one, up to 30 s in all" in answer.stderr
    assert "had no worker for 30 s (--worker-timeout); --resume continues with what is done" in answer.stderr
