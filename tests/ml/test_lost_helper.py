"""A process that trains with others, and one of these is lost: noticed also by a library that waits for ever."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
WAITING = """
import os, sys, time
from types import SimpleNamespace
import torch
from ml import processes

def learn(run):
    if processes.process_number():
        time.sleep(2.0)
        os._exit(ENDS)
    time.sleep(SECONDS)  # as NCCL does: it raises nothing

if __name__ == "__main__":
    processes._GRACE = 2.0
    run = SimpleNamespace(configuration=SimpleNamespace(processes=2, device="cpu"))
    with processes.helper_processes(run, learn, torch.device("cpu")):
        learn(run)
    print("done")
"""


LOST = (
    "error: processes is 2: one of the processes ended unexpectedly, perhaps because memory is short; "
    "--resume continues\n"
)


@pytest.mark.parametrize(
    ("ends", "seconds", "code", "said"),
    [
        (9, 300, 2, LOST),
        (0, 12, 0, ""),  # it has nothing left to do, and the first one scores alone
    ],
)
def test_one_that_is_lost_ends_the_wait_for_it(ends: int, seconds: int, code: int, said: str, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(WAITING.replace("ENDS", str(ends)).replace("SECONDS", str(seconds)))
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, env={"PYTHONPATH": str(ROOT), "GLOO_SOCKET_IFNAME": "lo"},
        capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (code, said)
