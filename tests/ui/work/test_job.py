"""Long work of the panel: steps in the window's thread, parts in a thread of their own, stopped at any time."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.base.errors import Cancelled, InputError
from synthroads_addon.ui.work import job as job_module
from synthroads_addon.ui.work.common import is_free
from synthroads_addon.ui.work.job import (
    BUDGET,
    TICK,
    Aside,
    PanelJob,
    Report,
    Step,
    Work,
    WorkPace,
    duration,
    running_job,
    stop_job,
)
from synthroads_addon.ui.work.long_operator import _draw_status
from tests.helpers.scenes.fake_layout import FakeLayout


@pytest.fixture(autouse=True)
def nothing_runs_before_and_after() -> Iterator[None]:
    assert running_job() is None
    yield
    stop_job()


def work(log: list[str], gate: threading.Event | None = None) -> Work[str]:
    try:
        log.append("begin")
        yield Step(0.1, "Reading")
        log.append("read")

        def aside(report: Report) -> str:
            for step in range(5):
                report(step / 5)
            if gate is not None:
                gate.wait(30.0)
            report(1.0)
            return threading.current_thread().name

        found = yield Aside(aside, "Scanning", 0.2, 0.8)
        log.append(found)
        yield 0.9
    finally:
        log.append("clean")
    return "done"


def tick_to_the_end(job: PanelJob[Any]) -> None:
    while job.tick(0.001):
        pass


def test_run_does_it_all_here() -> None:
    log: list[str] = []
    job = PanelJob("Test", work(log))
    assert job.run() == "done"
    assert log == ["begin", "read", threading.current_thread().name, "clean"]
    assert (job.result, job.share, job.error, running_job()) == ("done", 1.0, None, None)


def test_in_the_window_the_long_part_has_a_thread() -> None:
    log: list[str] = []
    gate = threading.Event()
    job = PanelJob("Test", work(log, gate), lambda: 0.0)
    job.start()
    assert running_job() is job
    assert job.running
    assert (job.share, job.state) == (0.1, "Reading 10%")
    _draw_status(SimpleNamespace(layout=(bar := FakeLayout())), bpy.context)
    assert bar.lines[-3:] == ["label 'SynthRoads: Reading 10%'", "progress ''", "spacer"]
    while job.touches_scene:
        job.tick(0.0)
    begin = time.perf_counter()
    assert job.tick(10.0)
    assert time.perf_counter() - begin < 5.0  # of ten: it does not wait for the thread
    while job.share < 0.6:
        time.sleep(0.001)
    assert job.share == pytest.approx(0.68)
    assert job.state == "Scanning 68%"
    gate.set()
    tick_to_the_end(job)
    assert log == ["begin", "read", "SynthRoads Test", "clean"]
    assert (job.result, job.running, running_job()) == ("done", False, None)


def test_the_state_tells_the_time_left_once_it_can_be_told() -> None:
    now = 100.0

    def steps() -> Work[None]:
        yield Step(0.01, "Building")
        yield Step(0.25, "Building")
        yield Step(0.5, "Building")

    job = PanelJob("Test", steps(), lambda: now)
    job.start()
    now = 104.0
    assert job.state == "Building 1%"
    now = 130.0
    job.tick(0.0)
    assert job.state == "Building 25%, 2 min left"
    now = 160.0
    job.tick(0.0)
    assert job.state == "Building 50%, 60 s left"
    job.stop(wait=True)


@pytest.mark.parametrize(("seconds", "text"), [(0.2, "1 s"), (89.0, "89 s"), (600.0, "10 min"), (9000.0, "2.5 h")])
def test_times_are_told_as_people_say_them(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_a_tick_keeps_to_its_budget() -> None:
    done = 0

    def steps() -> Work[None]:
        nonlocal done
        while True:
            time.sleep(0.01)
            done += 1
            yield 0.5

    job = PanelJob("Test", steps())
    job.start()
    begin, done = time.perf_counter(), 0
    job.tick(0.05)
    assert time.perf_counter() - begin >= 0.05
    assert 1 <= done <= 6  # each takes a fifth of the budget at least
    job.stop(wait=True)


def test_with_nothing_to_do_a_tick_ends() -> None:
    count = 0

    def steps() -> Work[None]:
        nonlocal count
        while True:
            count += 1
            yield None

    job = PanelJob("Test", steps())
    job.start()
    job.tick(10.0)
    assert count == 2
    job._idle = False
    job.stop(wait=True)


@pytest.mark.parametrize("thread", [True, False])
@pytest.mark.parametrize("patience", [0.0, 2.0])
def test_a_turn_waits_a_little_for_what_is_computed_aside(thread: bool, patience: float) -> None:
    """Else the window would be drawn meanwhile, which can take longer than all the work."""
    ready = time.perf_counter() + 0.05

    def steps() -> Work[str]:
        yield 0.1
        if thread:
            yield Aside(lambda _: time.sleep(0.05))
        while time.perf_counter() < ready:
            yield None
        return "done"

    job = PanelJob("Test", steps())
    job.start()
    assert job.tick(5.0, patience) == (not patience)
    tick_to_the_end(job)
    assert job.result == "done"


@pytest.mark.parametrize("ticks", [0, 1, 2])
@pytest.mark.parametrize("wait", [False, True])
def test_stopped_anywhere_it_cleans_up(ticks: int, wait: bool) -> None:
    log: list[str] = []
    job = PanelJob("Test", work(log))
    job.start()
    for _ in range(ticks):
        job.tick(0.0)
    job.stop(wait)
    if not wait:
        tick_to_the_end(job)
    assert isinstance(job.error, Cancelled)
    assert log[-1] == "clean"
    assert log.count("clean") == 1
    assert (job.result, running_job()) == (None, None)


def test_while_it_computes_aside_it_is_stopped_by_its_report() -> None:
    log: list[str] = []
    gate = threading.Event()
    job = PanelJob("Test", work(log, gate))
    job.start()
    while job.touches_scene:
        job.tick(0.001)
    job.stop()
    assert job.state == "Stopping"
    assert job.tick()  # still at work
    gate.set()
    tick_to_the_end(job)
    assert isinstance(job.error, Cancelled)
    assert log == ["begin", "read", "clean"]


@pytest.mark.parametrize("further", [False, True])
def test_stopped_when_all_is_done_already_it_has_ended_well(further: bool) -> None:
    """The files may stand already: to say that nothing was written would be wrong."""
    log: list[str] = []

    def steps() -> Work[str]:
        done = yield Aside(lambda report: log.append("files stand") or "done")
        if further:
            yield 0.9
            log.append("not to be done")
        return done

    job = PanelJob("Test", steps())
    job.start()
    assert job._thread is not None
    job._thread.join(30.0)
    job.stop()
    tick_to_the_end(job)
    assert log == ["files stand"]
    assert (job.result, running_job()) == (None if further else "done", None)
    assert isinstance(job.error, Cancelled) == further


def test_what_is_wrong_at_the_begin_is_raised_at_once() -> None:
    def wrong() -> Work[None]:
        raise InputError("Output", None, "choose a folder")
        yield 0.0

    job = PanelJob("Test", wrong())
    with pytest.raises(InputError, match="choose a folder"):
        job.start()
    assert running_job() is None


@pytest.mark.parametrize("where", ["step", "thread"])
def test_what_goes_wrong_later_is_kept(where: str) -> None:
    cleaned: list[bool] = []

    def wrong() -> Work[None]:
        try:
            yield 0.0
            if where == "thread":
                yield Aside(lambda report: 1 / 0)
            raise ZeroDivisionError
        finally:
            cleaned.append(True)

    job = PanelJob("Test", wrong())
    job.start()
    tick_to_the_end(job)
    assert isinstance(job.error, ZeroDivisionError)
    assert cleaned == [True]
    with pytest.raises(ZeroDivisionError):
        PanelJob("Test", wrong()).run()


def test_one_at_a_time() -> None:
    job = PanelJob("Test", work([]))
    job.start()
    with pytest.raises(AssertionError):
        PanelJob("Other", work([])).start()
    job.stop(wait=True)
    assert running_job() is None


def test_buttons_wait_for_a_job(monkeypatch: pytest.MonkeyPatch) -> None:
    import bpy

    synthroads_addon.register()
    said: list[str] = []

    class Operator:
        poll_message_set = said.append

    assert is_free(Operator, bpy.context)
    monkeypatch.setattr(job_module, "_running", PanelJob("Scan", work([])))
    assert not is_free(Operator, bpy.context)
    assert said == ["Scan is still running"]
    monkeypatch.setattr(job_module, "_running", None)
    synthroads_addon.unregister()


def test_slow_drawing_makes_turns_longer() -> None:
    """Of the time between two drawings four fifths are for the work, up to turns of two seconds."""
    now = [0.0]
    pace = WorkPace(lambda: now[0])
    assert pace.budget() == BUDGET
    for drawing, expected in ((0.001, BUDGET), (0.1, 0.4), (9.0, 2.0)):
        pace.leave()
        now[0] += TICK + drawing
        assert pace.budget() == pytest.approx(expected)
        assert WorkPace(drawing=pace.drawing).budget() == pace.budget()  # a next job begins as this one ended
        assert pace.patience == pytest.approx(min(drawing, 0.5))
