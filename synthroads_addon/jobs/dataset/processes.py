"""The processes of a data set's scenes: one for each attempt at a scene, so many at once on this machine."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any, Protocol

from ...base.machine import available_cores
from ...base.process.end_signals import EXIT_CODE
from ...base.process.modules import module_command, module_environment
from ...dataset.recipe import Recipe, SceneJob
from .scene_files import DONE, FAILED, TASK

ATTEMPTS = 3
"""A scene whose process is killed (too little memory, a lost node) is tried this often."""
ATTEMPT = "attempt-"
"""Beginning of the names of the attempts' folders."""
_TICK = 0.1
"""Seconds between two looks at a process."""
_MODULE = "jobs.dataset.scene_process"


@dataclass(frozen=True)
class Outcome:
    """Result of one scene's process: the folder it worked in, and an error if it failed.

    Attributes:
        folder: where it worked.
        error: what went wrong, in one line; None if nothing.
    """

    folder: Path
    error: str | None = None


class Stop(Protocol):
    """Protocol of a stop flag, as of `threading.Event`."""

    def is_set(self) -> bool:
        """Return whether work has to stop."""
        ...

    def wait(self, timeout: float) -> bool:
        """Wait for at most so many seconds until work has to stop; return whether it has to."""
        ...


def scene_task(job: SceneJob, recipe: Recipe) -> dict[str, Any]:
    """Return what a scene's process has to be told, as JSON data."""
    return {
        "name": job.name,
        "number": job.number,
        "split": job.split,
        "scenario": job.scenario.to_dict(),
        "recipe": recipe.to_dict(),
    }


def run_task(folder: str, threads: int, stopping: Stop) -> Outcome:
    """Run the process of a task in a folder, again if it is killed; return how it ended; stops if ``stopping`` is set.

    Each attempt has a folder of its own: one on a lost node may still be writing while the next is at work.
    """
    outcome = Outcome(Path(folder), "was not tried")
    for _ in range(ATTEMPTS):
        attempt = Path(tempfile.mkdtemp(prefix=ATTEMPT, dir=folder))
        shutil.copy(Path(folder) / TASK, attempt)
        code = _run_process(attempt, threads, stopping)
        if stopping.is_set():
            return Outcome(attempt, "was stopped")
        if code == 0 and (attempt / DONE).is_file():
            return Outcome(attempt)
        if (attempt / FAILED).is_file():
            return Outcome(attempt, str(json.loads((attempt / FAILED).read_text(encoding="utf-8"))["error"]))
        outcome = Outcome(attempt, _reason(code, attempt / "log.txt"))
        if code > 0 and code != EXIT_CODE:  # a fault of its own: it would come again
            return outcome
    return outcome


def _run_process(path: Path, threads: int, stopping: Stop) -> int:
    """Run a scene's process in a folder until it ends or all is stopping; return its exit code, 0 if not begun."""
    if stopping.is_set():
        return 0
    command, environment = [*module_command(_MODULE), str(path / TASK), str(threads)], module_environment()
    with (
        (path / "log.txt").open("wb") as log,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log, env=environment) as process,
    ):  # at the end of this block its standard input is closed, which ends it
        while process.poll() is None and not stopping.wait(_TICK):
            pass
    return process.returncode


def _reason(code: int, log: Path) -> str:
    """Return why a process failed, by its exit code and the last line of its log."""
    if code == EXIT_CODE:
        return f"its process was terminated, {ATTEMPTS} times"
    if code < 0:
        return f"its process was killed by signal {-code}, {ATTEMPTS} times (too little memory?)"
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return f"exit code {code}: {lines[-1] if lines else 'no message'}"


Submit = Callable[[list[str]], Iterator[Outcome]]
"""Has the tasks in these folders done, and yields how each ended, in any order."""


def no_beat() -> None:
    """Do nothing: the beat of work that nobody watches."""


def local_processes(jobs: int, beat: Callable[[], None] = no_beat) -> Submit:
    """Return a function that runs tasks in so many processes at once on this machine.

    Args:
        jobs: processes at once.
        beat: called several times a second meanwhile; what it raises ends the work.
    """

    threads = max(1, available_cores() // jobs)

    def submit(folders: list[str]) -> Iterator[Outcome]:
        """Run the tasks in folders, so many at once, and yield how each ended; stops all if it is closed early."""
        stopping = Event()
        pool = ThreadPoolExecutor(jobs)
        folders_begun: list[str] = []
        folders_ended: list[str] = []

        def task(folder: str) -> Outcome:
            """Run the task in a folder, and note when a thread begins with it and ends."""
            folders_begun.append(folder)
            try:
                return run_task(folder, threads, stopping)
            finally:
                folders_ended.append(folder)

        try:
            waiting = {pool.submit(task, folder) for folder in folders}
            while waiting:
                ended, waiting = wait(waiting, timeout=_TICK, return_when=FIRST_COMPLETED)
                for future in ended:
                    yield future.result()
                beat()
        finally:
            stopping.set()
            pool.shutdown(wait=True, cancel_futures=True)
            # The pool doesn't know, and doesn't wait for, a thread that was just starting when the user interrupted.
            while len(folders_ended) < len(folders_begun):
                time.sleep(_TICK)

    return submit
