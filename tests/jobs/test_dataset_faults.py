"""A data set whose scenes' processes are killed, as the system does where memory is short, while its run goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from synthroads_addon.dataset.manifest import read_manifest
from tests.jobs.test_dataset import (
    ROOT,
    assert_nothing_partial,
    command,
    content,
    processes_of,
    recipe_file,
    run,
    wait_until,
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.any_blender,
    pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc"),
]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recipe and its data set."""
    folder = tmp_path_factory.mktemp("undisturbed")
    recipe = recipe_file(folder)
    assert run(recipe, folder / "set", "--jobs", "2").returncode == 0
    return recipe, folder / "set"


def process_of(folder: Path, scene: str) -> int | None:
    """Return the process that makes a scene; None while there is none."""
    for number in processes_of(folder):
        with suppress(OSError):  # it has just ended
            if f"/.work/{scene}-" in Path(f"/proc/{number}/cmdline").read_text():
                return number
    return None


def kill(folder: Path, scene: str, times: int, after: float = 0.0) -> None:
    """Kill a scene's process, and those that are begun in its place."""
    killed: set[int | None] = {None}
    for _ in range(times):
        wait_until(lambda: process_of(folder, scene) not in killed)
        time.sleep(after)
        number = process_of(folder, scene)
        assert number, "it had ended already"
        os.kill(number, signal.SIGKILL)
        killed.add(number)


def test_a_scene_whose_process_is_killed_is_made_again(undisturbed: tuple[Path, Path], tmp_path: Path) -> None:
    recipe, whole = undisturbed
    folder = tmp_path / "set"
    with subprocess.Popen(command(recipe, folder, "--jobs", "2", "--quiet"), cwd=ROOT) as process:
        kill(folder, "a-01", 1, after=1.0)
        kill(folder, "a-02", 2)
        assert process.wait() == 0
    assert content(folder) == content(whole)


def test_a_scene_that_is_killed_each_time_is_told_and_the_others_stay(
    undisturbed: tuple[Path, Path], tmp_path: Path
) -> None:
    recipe, whole = undisturbed
    folder = tmp_path / "set"
    with subprocess.Popen(
        command(recipe, folder, "-j", "2", "-q"), cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        kill(folder, "a-01", 3)
        told, said = process.communicate()
    assert (process.returncode, told) == (3, "")
    assert said == "failed: a-01: its process was killed by signal 9, 3 times (too little memory?)\n"
    assert [scene.status for scene in read_manifest(folder).scenes] == ["failed", "done"]
    assert_nothing_partial(folder)
    assert not (folder / "scenes" / "a-01").exists()
    assert run(recipe, folder, "--resume").returncode == 0
    assert content(folder) == content(whole)
