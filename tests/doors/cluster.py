"""A Dask cluster of one worker on this machine, by an environment's own interpreter."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DOCUMENTED = "tcp://HOST:8786"
"""The scheduler's address in the pages."""
_PATIENCE = 60.0


@contextmanager
def cluster(python: Path, folder: Path, command: str, *, wanted: bool) -> Iterator[str]:
    """Yield a command with the address of a scheduler in the place of `DOCUMENTED`, and end the scheduler afterwards.

    Where none is wanted the command is yielded as it is.
    """
    if not wanted:
        yield command
        return
    file = folder / "scheduler.json"
    parts = [
        ["dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)],
        ["dask_worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-dashboard"],
    ]
    started = []
    try:
        for module, *options in parts:
            words = [str(python), "-m", f"distributed.cli.{module}", *options]
            started.append(subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
            _wait_for(file)
        yield command.replace(DOCUMENTED, json.loads(file.read_text(encoding="utf-8"))["address"])
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()
        file.unlink(missing_ok=True)


def _wait_for(file: Path) -> None:
    """Wait until the scheduler has written its address."""
    end = time.monotonic() + _PATIENCE
    while not (file.exists() and file.read_text(encoding="utf-8").rstrip().endswith("}")):
        if time.monotonic() > end:
            raise TimeoutError(f"no scheduler within {_PATIENCE:g} s")
        time.sleep(0.2)
