"""Processes of a data set when the user interrupts at the worst moment."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from headless import dataset_run
from headless.dataset_run import Outcome, local_processes


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

    monkeypatch.setattr(dataset_run, "ThreadPoolExecutor", InterruptedPool)
    monkeypatch.setattr(dataset_run, "run_task", slow_to_end)
    with pytest.raises(KeyboardInterrupt):
        list(local_processes(1)(["scene"]))
    assert ended == ["scene"]


def test_nothing_is_begun_that_would_be_stopped_at_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(dataset_run.subprocess, "Popen", None)
    stopping = Event()
    stopping.set()
    assert dataset_run.run_task(str(tmp_path), 1, stopping).error == "was stopped"
