"""Processes of a data set when the user interrupts at the worst moment, and when nobody works on it."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from headless.messages import logger
from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.dataset import processes
from synthroads_addon.jobs.dataset.cluster import WorkerAbsence
from synthroads_addon.jobs.dataset.processes import Outcome, local_processes, run_task
from synthroads_addon.jobs.dataset.scene_files import DONE, TASK


class InterruptedPool:
    """A pool whose user interrupts while a thread starts: it runs, but the pool doesn't know it."""

    at_work = Event()

    def __init__(self, jobs: int) -> None:
        pass

    def submit(self, work: Callable[[str], Outcome], folder: str) -> Any:
        Thread(target=work, args=(folder,)).start()
        assert self.at_work.wait(10.0)
        raise KeyboardInterrupt

    def shutdown(self, **options: Any) -> None:
        pass


def test_an_interrupt_while_a_thread_starts_leaves_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[str] = []

    def slow_to_end(folder: str, threads: int, stopping: Event) -> Outcome:
        InterruptedPool.at_work.set()
        assert stopping.wait(10.0)
        time.sleep(0.5)
        ended.append(folder)
        return Outcome(Path(folder), "was stopped")

    monkeypatch.setattr(processes, "ThreadPoolExecutor", InterruptedPool)
    monkeypatch.setattr(processes, "run_task", slow_to_end)
    with pytest.raises(KeyboardInterrupt):
        list(local_processes(1)(["scene"]))
    assert ended == ["scene"]


def test_nothing_is_begun_that_would_be_stopped_at_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(processes.subprocess, "Popen", None)
    stopping = Event()
    stopping.set()
    (tmp_path / TASK).write_text("{}")
    assert run_task(str(tmp_path), 1, stopping).error == "was stopped"


def test_each_attempt_has_a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A process that was given up may still be writing."""
    seen: list[Path] = []

    def killed_twice(path: Path, threads: int, stopping: Event) -> int:
        assert (path / TASK).is_file()
        seen.append(path)
        return -9 if len(seen) < 3 else (path / DONE).write_text("{}") and 0

    monkeypatch.setattr(processes, "_run_process", killed_twice)
    (tmp_path / TASK).write_text("{}")
    assert run_task(str(tmp_path), 1, Event()) == Outcome(seen[2])
    assert len({path for path in seen if path.parent == tmp_path}) == 3


def test_absence_of_workers_is_said_after_a_minute_and_ended_in_the_end(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, logger.name)  # a command that was run quietly in this process has left another
    absence = WorkerAbsence("tcp://here:1", 600.0)
    for workers, now in ((1, 0.0), (0, 10.0), (0, 69.0)):
        absence.update(workers, now)
    assert not caplog.records
    absence.update(0, 70.0)
    absence.update(0, 300.0)
    assert [record.getMessage() for record in caplog.records] == [
        "warning: tcp://here:1 has no worker; waiting for one, up to 600 s in all"
    ]
    absence.update(2, 400.0)
    assert caplog.records[-1].getMessage() == "tcp://here:1 has workers again: 2"
    absence.update(0, 500.0)
    with pytest.raises(InputError, match=r"had no worker for 600 s \(--worker-timeout\); --resume continues"):
        absence.update(0, 1100.0)
