"""Data workers of training: what becomes of those that don't end by themselves."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest
import torch

from ml.data.workers import load_batches

ROOT = Path(__file__).resolve().parents[3]


class SlowCrops:
    """Four crops, each of which takes a worker a long time."""

    def __len__(self) -> int:
        return 4

    def __getitem__(self, number: int) -> torch.Tensor:
        if number:
            time.sleep(60.0)
        return torch.zeros(1)


def test_workers_that_a_signal_ends_with_the_training_leave_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal to all processes of a terminal or job; of the workers' end PyTorch hears while it waits for them."""
    ignored: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", ignored.append)
    batches = load_batches(SlowCrops(), [[number] for number in range(4)], torch.stack, 2)
    assert next(batches).shape == (1, 1)

    workers, join = multiprocessing.active_children(), BaseProcess.join

    def end_and_join(process: BaseProcess, timeout: float | None = None) -> None:
        """Join a worker that another process ends now: if the training does workers take it for their proper end."""
        subprocess.run(["kill", "-TERM", str(process.pid)], check=True)
        time.sleep(0.5)
        join(process, timeout)

    monkeypatch.setattr(BaseProcess, "join", end_and_join)
    del batches
    assert len(workers) == 2
    assert [str(fault.exc_value) for fault in ignored] == []


IN_A_LONG_FOLDER = """
import sys, tempfile
import torch
from ml.data.workers import load_batches

print([batch.tolist() for batch in load_batches(torch.arange(4.0), [[0, 1], [2, 3]], torch.stack, 1)])
"""


def test_batches_arrive_where_the_folder_for_temporary_files_has_a_long_name(tmp_path: Path) -> None:
    """As on clusters: a socket's name has 107 characters at most, and without one nothing would ever arrive."""
    (long := tmp_path / ("long" * 20)).mkdir()
    environment = os.environ | {"TMPDIR": str(long), "PYTHONPATH": str(ROOT)}
    short = {path.name for path in Path("/tmp").glob(".partial-*")}
    done = subprocess.run(
        [sys.executable, "-c", IN_A_LONG_FOLDER],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "[[0.0, 1.0], [2.0, 3.0]]\n"), done.stderr
    assert "Traceback" not in done.stderr
    assert list(long.iterdir()) == []
    assert {path.name for path in Path("/tmp").glob(".partial-*")} <= short
