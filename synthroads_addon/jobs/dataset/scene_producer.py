"""Scenes for a training, made as it wants them: ``python -m synthroads_addon.jobs.dataset.scene_producer FOLDER N``.

A training begins it. It ends when that does: its standard input is then closed. What it makes is said in the folder:
see `synthroads_addon.dataset.scene_stream`. Each scene has a process of its own, as those of a data set.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...base.errors import InputError
from ...base.machine import available_cores
from ...base.process.end_signals import handle_end_signals
from ...base.process.leave import leave
from ...base.scratch.locks import LockHeldError, exclusive
from ...dataset.manifest import SceneEntry
from ...dataset.scene_stream import (
    LOCK,
    WORK,
    Failure,
    StreamPlan,
    is_made,
    publish,
    read_plan,
    read_wanted,
    write_failure,
)
from .processes import Stop, run_task, scene_task
from .scene_files import DONE, FAILED, FILES, TASK

_TICK = 0.1
"""Seconds between two looks at what is wanted."""
_PATIENCE = 30.0
"""Seconds that the producer of an earlier training in the folder has to end."""
Make = Callable[[Path, StreamPlan, int, Stop], None]
"""Makes and publishes the scene of a number, working below `WORK`; stops if told to."""


class SceneFailedError(Exception):
    """Raised where a scene couldn't be made, but perhaps another time could.

    Attributes:
        failure: why.
    """

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.error)
        self.failure = failure


def make_scene(folder: Path, plan: StreamPlan, number: int, stopping: Stop, threads: int = 1) -> None:
    """Make a scene in a process of its own and publish it; one whose scenario can't be met is published as failed.

    Raises:
        SceneFailedError: it couldn't be made for another reason.
    """
    job = plan.job(number)
    work = Path(tempfile.mkdtemp(prefix=f"{number:06d}-", dir=folder / WORK))
    (work / TASK).write_text(json.dumps(scene_task(job, plan.recipe)), encoding="utf-8")
    outcome = run_task(str(work), threads, stopping)
    if stopping.is_set():
        return
    scene_fields: dict[str, Any] = {"name": job.name, "split": job.split, "seed": job.scenario.seed}
    files = outcome.folder / FILES
    if outcome.error is None:
        result = json.loads((outcome.folder / DONE).read_text(encoding="utf-8"))
        entry = SceneEntry.from_dict({**scene_fields, "status": "done", **result}, "scene")
    elif _is_of_scenario(outcome.folder):
        # The same seed fails again: the training goes on without it, each time that it is done again.
        shutil.rmtree(files, ignore_errors=True)
        files.mkdir()
        entry = SceneEntry.from_dict({**scene_fields, "status": "failed", "error": outcome.error}, "scene")
    else:
        raise SceneFailedError(Failure(number=number, name=job.name, error=outcome.error))
    publish(folder, number, files, entry, plan)
    shutil.rmtree(work, ignore_errors=True)


def _is_of_scenario(attempt: Path) -> bool:
    """Return whether an attempt ended because the scenario can't be met."""
    with suppress(OSError, ValueError):
        return bool(json.loads((attempt / FAILED).read_text(encoding="utf-8"))["of_scenario"])
    return False


def produce(folder: Path, producers: int, make: Make, stopping: threading.Event) -> None:
    """Make the scenes that are wanted, so many at once, until told to stop.

    Args:
        folder: of the stream.
        producers: scenes made at once.
        make: makes and publishes a scene.
        stopping: set when the training has ended; it is set at the end in any case.

    Raises:
        SceneFailedError: a scene couldn't be made.
    """
    plan = read_plan(folder)
    running: dict[int, Future[None]] = {}
    with ThreadPoolExecutor(producers) as pool:
        try:
            while not stopping.wait(_TICK):
                for number in [number for number, future in running.items() if future.done()]:
                    running.pop(number).result()
                numbers = [k for k in read_wanted(folder) if k not in running and not is_made(folder, k)]
                # What was removed since is no longer wanted: that is said before it is removed.
                still_requested = read_wanted(folder)
                for number in [k for k in numbers if k in still_requested][: producers - len(running)]:
                    running[number] = pool.submit(make, folder, plan, number, stopping)
        finally:
            stopping.set()


def serve(folder: Path, producers: int, make: Make, patience: float = _PATIENCE) -> int:
    """Make scenes until standard input is closed; return the exit code, 2 if there is a failure, which is written."""
    stopping = threading.Event()
    threading.Thread(target=_stop_with_parent, args=(stopping,), daemon=True).start()
    waited_seconds = 0.0
    while not stopping.is_set():
        try:
            with exclusive(folder / LOCK):
                _serve_alone(folder, producers, make, stopping)
            return 0
        except LockHeldError:
            if waited_seconds >= patience:
                write_failure(folder, Failure(number=0, error="another training is running in this folder"))
                return 2
            waited_seconds += _TICK
            stopping.wait(_TICK)
        except SceneFailedError as failed:
            write_failure(folder, failed.failure)
            return 2
    return 0


def _serve_alone(folder: Path, producers: int, make: Make, stopping: threading.Event) -> None:
    """Make scenes as the only one in the folder; removes what was begun before and at the end."""
    try:
        shutil.rmtree(folder / WORK, ignore_errors=True)
        (folder / WORK).mkdir(exist_ok=True)
        produce(folder, producers, make, stopping)
    finally:
        shutil.rmtree(folder / WORK, ignore_errors=True)


def _stop_with_parent(stopping: threading.Event) -> None:
    """Block until standard input is closed, as when the training ends; then set the event."""
    sys.stdin.buffer.read()
    stopping.set()


def main() -> int:
    """Make scenes in the folder of ``sys.argv``, so many at once; return the exit code."""
    folder, producers = Path(sys.argv[1]), int(sys.argv[2])
    threads = max(1, available_cores() // producers)

    def make(folder: Path, plan: StreamPlan, number: int, stopping: Stop) -> None:
        """Make a scene; what is wrong with input or disk becomes the scene's failure."""
        try:
            make_scene(folder, plan, number, stopping, threads)
        except (InputError, OSError) as error:
            raise SceneFailedError(Failure(number=number, error=str(error))) from None

    return serve(folder, producers, make)


if __name__ == "__main__":
    handle_end_signals()
    leave(main)
