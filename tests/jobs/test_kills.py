"""Jobs that are ended at any moment, by each signal: nothing half-written, nothing left, the same bytes afterwards."""

from __future__ import annotations

import json
import os
import random
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from synthroads_addon.dataset.manifest import faults, read_manifest
from tests.helpers.ended_commands import run_until
from tests.jobs.test_dataset import content, recipe_file
from tests.jobs.test_faults import check_whole, command, files, inputs

pytestmark = [
    pytest.mark.slow,
    pytest.mark.any_blender,
    pytest.mark.skipif(sys.platform != "linux", reason="signals as Linux has them"),
]
__all__ = ["inputs"]  # the fixture

KILLS = 10
"""Of each job; where one had ended before its signal came, another is sent to the next."""
ENDS = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
SEED = os.environ.get("KILL_SEED") or "1"


@dataclass(frozen=True)
class DisturbedJob:
    """A job as a command, and how its files are looked at.

    Attributes:
        words: the command without what is to become of files that are there.
        output: its folder.
        resumes: whether it can go on with what is there; else it begins anew.
        check: sees that what stands in the folder is whole.
        outcome: returns all that is to be the same in each run.
    """

    words: list[str]
    output: Path
    resumes: bool
    check: Callable[[Path], None]
    outcome: Callable[[Path], Any]

    def arguments(self, number: int) -> list[str]:
        """Return the command of a run; of those that can go on each third begins anew."""
        return [*self.words, "--resume" if self.resumes and number % 3 else "--overwrite"]


def files_of_job(folder: Path) -> dict[str, bytes]:
    """Return a job's files but those that hold times, and all that is hidden, which there must be none of."""
    hidden = {path.name: b"hidden" for path in folder.glob(".*")}
    return hidden | {name: data for name, data in files(folder).items() if name not in ("report.json", "scene.blend")}


def check_data_set(folder: Path) -> None:
    """See that all scenes that the manifest names are whole."""
    if (folder / "manifest.json").exists():
        assert not faults(folder, read_manifest(folder).scenes)


def disturbed_job(kind: str, inputs: Path, folder: Path, output: Path) -> DisturbedJob:
    """Return a job whose inputs are made in a folder."""
    if kind in ("generate", "scan", "twin"):
        return DisturbedJob(command(kind, inputs, output), output, False, check_whole, files_of_job)
    words = [sys.executable, "-m", f"headless.{kind}"]
    if kind == "dataset":
        words += [str(recipe_file(folder)), "--jobs", "2", "--quiet", "--output", str(output)]
        return DisturbedJob(words, output, True, check_data_set, content)
    pytest.importorskip("torch")
    from tests.helpers.clouds.road_data_sets import write_data_set
    from tests.ml import test_training_faults as trainings

    data = write_data_set(folder / "roads")
    settings = trainings.configuration("centerline", data.parent)
    settings["data"]["cache"] = str(folder / "cache")
    (folder / "toy.yaml").write_text(json.dumps(settings))
    words += [str(folder / "toy.yaml"), "--quiet", "--output", str(output)]
    return DisturbedJob(words, output, True, trainings.check_whole, trainings.outcome)


@pytest.mark.parametrize("kind", ["generate", "scan", "twin", "dataset", "train"])
def test_killed_at_any_moment(kind: str, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """KILL_SEED=N kills at other moments than usual."""
    rng = random.Random(f"{SEED} {kind}")
    for name in ("temporary", "inputs"):
        (tmp_path / name).mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    whole = disturbed_job(kind, inputs, tmp_path / "inputs", tmp_path / "whole")
    undisturbed = run_until(whole.arguments(0), 0.0, None)
    code, said, seconds = undisturbed.code, undisturbed.said, undisturbed.seconds
    assert code == 0, said
    wanted = whole.outcome(whole.output)
    job = DisturbedJob(
        [word.replace(str(whole.output), str(tmp_path / "out")) for word in whole.words],
        tmp_path / "out", whole.resumes, whole.check, whole.outcome,
    )  # fmt: skip
    signs = [ENDS[number % len(ENDS)] for number in range(2 * KILLS)]
    rng.shuffle(signs)
    codes: list[tuple[str, int]] = []
    for number, sign in enumerate(signs):
        if sum(code != 0 for _, code in codes) == KILLS:
            break
        ended = run_until(job.arguments(number), rng.uniform(0.1, 1.0) * seconds, sign)
        code, said = ended.code, ended.said
        codes.append((sign.name, code))
        assert code in (0, 130, -sign), (sign, code, said)
        assert "Traceback" not in said, said
        job.check(job.output)
        if code == 0:  # the machine has become faster meanwhile
            seconds *= 0.8
    assert sum(code != 0 for _, code in codes) == KILLS, codes
    last = run_until(job.arguments(1), 0.0, None)
    code, said = last.code, last.said
    assert code == 0, said
    assert job.outcome(job.output) == wanted
    assert list((tmp_path / "temporary").iterdir()) == []
    print(kind, codes)
