"""Data sets as they are made: the same bytes however they come about, nothing half-done in sight, faults told."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from headless import commands
from synthroads_addon.dataset.manifest import read_manifest

pytestmark = pytest.mark.any_blender

ROOT = Path(__file__).resolve().parents[2]
TINY: dict[str, Any] = {
    "title": "Tiny",
    "seed": 5,
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
        "cloud.classes": "5",
    },
    "layouts": ["pointcept", "semantickitti"],
    "smallest_tile": 10,
    "groups": [{"name": "a", "scenes": 2, "split": {"train": 1, "test": 1}}],
}


def recipe_file(folder: Path, **changes: Any) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "recipe.yaml"
    path.write_text(yaml.safe_dump({**TINY, **changes}), encoding="utf-8")
    return path


def command(recipe: Path, output: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "headless.dataset", str(recipe), "--output", str(output), *more]


def run(recipe: Path, output: Path, *more: str) -> subprocess.CompletedProcess[str]:
    answer = subprocess.run(command(recipe, output, *more), cwd=ROOT, capture_output=True, text=True, check=False)
    assert "Traceback" not in answer.stdout + answer.stderr, answer.stderr
    return answer


def run_here(capfd: pytest.CaptureFixture[str], recipe: Path, output: Path, *more: str) -> tuple[int, str]:
    """Run the command in this process, for what makes no scene; return its exit code and its standard error."""
    capfd.readouterr()
    code = commands.command("dataset", [str(recipe), "--output", str(output), *more])
    return code, capfd.readouterr().err


def content(folder: Path) -> dict[str, bytes]:
    """Return all files but what is not to be the same: logs."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.name != ".lock"]
    names = {path.relative_to(folder).as_posix(): path for path in files}
    return {name: path.read_bytes() for name, path in sorted(names.items()) if not name.startswith("logs/")}


def processes_of(folder: Path) -> list[int]:
    """Return the processes that still work for a data set."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has just ended
            if str(folder / ".work").encode() in path.read_bytes():
                found.append(int(path.parent.name))
    return found


def wait_until(true: Callable[[], object], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until, "waited too long"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recipe and its data set, made in one go, both scenes at once."""
    folder = tmp_path_factory.mktemp("undisturbed")
    recipe = recipe_file(folder)
    answer = run(recipe, folder / "set", "--jobs", "2")
    assert answer.returncode == 0, answer.stderr
    return recipe, folder / "set"


def test_holds_what_its_manifest_says(undisturbed: tuple[Path, Path], capfd: pytest.CaptureFixture[str]) -> None:
    recipe, folder = undisturbed
    manifest = read_manifest(folder)
    assert manifest.complete
    assert [scene.name for scene in manifest.scenes] == ["a-01", "a-02"]
    named = {name for scene in manifest.scenes for name in scene.files or {}}
    there = {name for name in content(folder) if name.startswith(("scenes/", "pointcept/", "semantickitti/"))}
    assert there - named == {"pointcept/classes-5/classes.json", "semantickitti/classes-5/synthroads.yaml"}
    assert named <= there
    for scene in manifest.scenes:
        assert scene.points == sum((scene.classes or {}).values()) > 1000
        assert (folder / "logs" / f"{scene.name}.json").is_file()
    capfd.readouterr()
    assert commands.command("dataset", [str(recipe), "--output", str(folder), "--verify"]) == 0
    assert capfd.readouterr().out.split()[1:3] == ["files", "of"]


@pytest.mark.slow
def test_a_resumed_set_has_the_same_bytes(
    undisturbed: tuple[Path, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A scene is missing, one was published without having come into the manifest, one lost a file."""
    recipe, folder = undisturbed
    copy = tmp_path / "set"
    subprocess.run(["cp", "-r", folder, copy], check=True)
    data = json.loads((copy / "manifest.json").read_text())
    data["scenes"], data["complete"] = data["scenes"][1:], False
    (copy / "manifest.json").write_text(json.dumps(data))
    (copy / "scenes" / "a-02" / "cloud.laz").unlink()
    (copy / ".work" / "a-01-left").mkdir(parents=True)
    code, said = run_here(capfd, recipe, copy)
    assert (code, "--resume continues it" in said) == (2, True)
    assert run(recipe, copy, "--resume").returncode == 0
    assert content(copy) == content(folder)


def test_a_failing_scene_is_told_and_the_rest_goes_on(tmp_path: Path) -> None:
    bad = {"name": "bad", "scenes": 1, "set": {"road.elevation_model": "nowhere.tif"}}
    recipe = recipe_file(tmp_path, groups=[bad, {"name": "good", "scenes": 1}])
    answer = run(recipe, tmp_path / "set", "--json")
    manifest = read_manifest(tmp_path / "set")
    assert answer.returncode == 3
    assert [scene.status for scene in manifest.scenes] == ["failed", "done"]
    assert "nowhere.tif: an elevation model is needed here" in (manifest.scenes[0].error or "")
    assert not manifest.complete
    assert json.loads(answer.stdout) == manifest.to_dict()
    assert "**Failed:** bad-01" in (tmp_path / "set" / "DATA_CARD.md").read_text()


def test_wrong_input_is_one_line(
    undisturbed: tuple[Path, Path],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recipe, folder = undisturbed
    other = recipe_file(tmp_path / "other", seed=6)
    occupied = tmp_path / "occupied"
    occupied.mkdir()
    (occupied / "mine.txt").touch()
    monkeypatch.setattr("synthroads_addon.jobs.dataset.cluster._ANSWER", 1.0)
    cases = {
        "begun with another recipe": run_here(capfd, other, folder, "--resume"),
        "holds other files": run_here(capfd, recipe, occupied),
        "must be 1 to 1024": run_here(capfd, recipe, tmp_path / "set", "--jobs", "0"),
        "must be splits of the recipe: test, train": run_here(capfd, recipe, tmp_path / "none", "--splits", "tset"),
        "no scheduler answers there": run_here(capfd, recipe, tmp_path / "dask", "--scheduler", "tcp://127.0.0.1:1"),
    }
    for words, (code, said) in cases.items():
        assert (code, said.count("\n")) == (2, 1), said
        assert words in said


@pytest.mark.slow
def test_a_split_alone_is_as_in_the_whole_set(undisturbed: tuple[Path, Path], tmp_path: Path) -> None:
    """Also: scenes that are made one after the other have the bytes of those that were made at once."""
    recipe, whole = undisturbed
    part = tmp_path / "part"
    answer = run(recipe, part, "--splits", "test")
    assert (answer.returncode, "1 of 1 scenes" in answer.stdout) == (0, True), answer.stdout + answer.stderr
    manifest = read_manifest(part)
    assert ([scene.split for scene in manifest.scenes], manifest.complete) == (["test"], False)
    assert run(recipe, part, "--resume").returncode == 0
    assert content(part) == content(whole)


def test_two_runs_do_not_share_a_folder(undisturbed: tuple[Path, Path], tmp_path: Path) -> None:
    recipe, _ = undisturbed
    hearing = ["env", "--default-signal=INT", *command(recipe, tmp_path / "set", "--quiet")]
    with subprocess.Popen(hearing, cwd=ROOT) as first:
        wait_until((tmp_path / "set" / ".work").is_dir)
        answer = run(recipe, tmp_path / "set", "--resume")
        assert (answer.returncode, "another run is at work in it" in answer.stderr) == (2, True)
        assert first.poll() is None
        first.send_signal(signal.SIGINT)
        assert first.wait() == 130


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_interrupted_it_ends_at_once_and_leaves_no_process(undisturbed: tuple[Path, Path], tmp_path: Path) -> None:
    recipe, _ = undisturbed
    folder = tmp_path / "set"
    # A run in a shell's background would hand on that it is deaf to interrupts.
    hearing = ["env", "--default-signal=INT", *command(recipe, folder)]
    with subprocess.Popen(hearing, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        wait_until(lambda: processes_of(folder))
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
    assert (process.returncode, "interrupted" in said) == (130, True), said
    assert not processes_of(folder)
    assert not (folder / "scenes").exists() or len(list((folder / "scenes").iterdir())) < 2


# --- killed ----------------------------------------------------------------------------------------------------------


def assert_nothing_partial(folder: Path) -> None:
    """See that every folder in sight is whole: laid out at once, with all files of the scene that it belongs to."""
    for scene in (folder / "scenes").glob("*"):
        names = {path.name for path in scene.iterdir()}
        assert names >= {"cloud.laz", "parameters.json", "centerline.geojson"}, (scene, names)
        assert not [name for name in names if name.startswith(".")]
    for tile in (folder / "pointcept").glob("*/*/*"):
        assert (tile / "tile.json").is_file(), tile
    if (folder / "manifest.json").exists():
        read_manifest(folder)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_killed_twenty_times_it_ends_with_the_same_bytes(tmp_path: Path) -> None:
    recipe, begin = recipe_file(tmp_path, groups=[{"name": "a", "scenes": 6}]), time.monotonic()
    assert run(recipe, tmp_path / "whole", "--jobs", "2").returncode == 0
    seconds_of_scene = (time.monotonic() - begin) / 3
    folder, rng = tmp_path / "set", np.random.default_rng(3)
    kills = {"run": 0, "scene": 0}
    for _ in range(20):
        with subprocess.Popen(command(recipe, folder, "--jobs", "2", "--resume", "--quiet"), cwd=ROOT) as process:
            time.sleep(float(rng.uniform(0.5, 6.0)))
            victims = processes_of(folder)
            if victims and rng.random() < 0.5:
                os.kill(victims[0], signal.SIGKILL)
                kills["scene"] += 1
                time.sleep(0.5)
            process.kill()
            kills["run"] += 1
        assert_nothing_partial(folder)
    # What was begun ends with whoever began it, long before a scene is done, however busy the machine is.
    wait_until(lambda: not processes_of(folder), max(1.0, seconds_of_scene / 3))
    assert kills["scene"] >= 3, kills
    assert run(recipe, folder, "--jobs", "2", "--resume").returncode == 0
    assert content(folder) == content(tmp_path / "whole")


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes_whatever_is_killed(tmp_path: Path) -> None:
    """Scheduler and workers are processes of their own on loopback; each is killed once in the middle of the work."""
    pytest.importorskip("distributed")
    recipe = recipe_file(tmp_path, groups=[{"name": "a", "scenes": 5}])
    assert run(recipe, tmp_path / "whole", "--jobs", "2").returncode == 0
    with cluster(tmp_path / "first") as (address, _):
        assert run(recipe, tmp_path / "set", "--scheduler", address).returncode == 0
    assert content(tmp_path / "set") == content(tmp_path / "whole")
    with cluster(tmp_path / "second") as (address, parts):
        process = subprocess.Popen(command(recipe, tmp_path / "killed", "--scheduler", address, "--quiet"), cwd=ROOT)
        wait_for_scenes(tmp_path / "killed", 1)
        parts["worker"].kill()  # the other one takes over
        wait_for_scenes(tmp_path / "killed", 2)
        parts["scheduler"].kill()
        assert process.wait(timeout=120) == 2
    assert_nothing_partial(tmp_path / "killed")
    with cluster(tmp_path / "third") as (address, _):
        assert run(recipe, tmp_path / "killed", "--scheduler", address, "--resume").returncode == 0
    assert content(tmp_path / "killed") == content(tmp_path / "whole")


def wait_for_scenes(folder: Path, count: int) -> None:
    wait_until(lambda: len(list((folder / "scenes").glob("*"))) >= count, 120.0)


class cluster:  # noqa: N801 (a context manager that reads as one)
    """A Dask scheduler and two workers, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __enter__(self) -> tuple[str, dict[str, subprocess.Popen[bytes]]]:
        self._folder.mkdir()
        file = self._folder / "scheduler.json"
        dask = [sys.executable, "-m", "distributed.cli"]
        scheduler = ["dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0"]
        worker = ["dask_worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-dashboard"]
        self.parts = {"scheduler": self._start(dask, [*scheduler, "--scheduler-file", str(file)])}
        wait_until(lambda: file.exists() and file.read_text())
        for name in ("worker", "other worker"):
            self.parts[name] = self._start(dask, worker)
        return json.loads(file.read_text())["address"], self.parts

    def _start(self, dask: list[str], arguments: list[str]) -> subprocess.Popen[bytes]:
        module, *rest = arguments
        call = [*dask[:2], f"{dask[2]}.{module}", *rest]
        log = (self._folder / f"{module}.log").open("ab")
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        return subprocess.Popen(call, cwd=self._folder, env=environment, stdout=log, stderr=log)

    def __exit__(self, *_: object) -> None:
        for process in self.parts.values():
            process.kill()
            process.wait()


@pytest.mark.skipif(sys.platform == "win32", reason="a Slurm cluster's nodes run Linux")
def test_job_script_for_slurm(tmp_path: Path) -> None:
    """The script is what Slurm would be handed; its command is a worker that our Dask starts."""
    pytest.importorskip("dask_jobqueue")
    call = [sys.executable, str(ROOT / "docs" / "slurm_cluster.py"), "reference", "set", "--print-script"]
    answer = subprocess.run(call + ["--interface", "lo"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    script = tmp_path / "job.sh"
    script.write_text(answer.stdout)
    for line in ("#SBATCH --cpus-per-task=2", "#SBATCH --mem=4G", "#SBATCH -t 04:00:00"):
        assert line in answer.stdout
    assert subprocess.run(["bash", "-n", script], check=False).returncode == 0
    worker = next(line for line in answer.stdout.splitlines() if "dask_worker" in line)
    helps = subprocess.run([*worker.split()[:3], "--help"], capture_output=True, text=True, check=False)
    assert all(option in helps.stdout for option in ("--nthreads", "--memory-limit", "--death-timeout", "--interface"))


# --- the reference set -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reference set at draft fidelity, thinly scanned."""
    folder = tmp_path_factory.mktemp("reference") / "set"
    cheap = ["fidelity=draft", "scan.lines_per_second=20", "scan.platform.speed=100", "colour.source=material"]
    cheap += ["vegetation_detail=0.1", "scan.rays_per_pulse=1"]
    options = [word for change in cheap for word in ("--set", change)]
    call = [sys.executable, "-m", "headless.dataset", "reference", "--output", str(folder), "--jobs", "2", *options]
    answer = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return folder


@pytest.mark.slow
def test_reference_set_is_complete_and_memory_flat(reference: Path) -> None:
    manifest = read_manifest(reference)
    assert manifest.complete
    assert len(manifest.scenes) == 26
    five, rest = set(), set()
    for scene in manifest.scenes:
        (rest if scene.name.startswith("gantries") else five).update(scene.classes or {})
    assert five == {"ground", "road", "road_marking", "vegetation", "road_furniture"}
    assert "shield_gantry" in rest
    assert len(rest) >= 12
    peaks = {}
    for scene in manifest.scenes:
        log = json.loads((reference / "logs" / f"{scene.name}.json").read_text())
        peaks[scene.name] = max(stage["peak_memory_mb"] for stage in log["stages"].values())
    same = [peaks[scene.name] for scene in manifest.scenes if scene.name.startswith("plain-600")]
    assert max(same[-3:]) < 1.3 * max(same[:3]), peaks
    assert max(peaks.values()) < 2000, peaks
