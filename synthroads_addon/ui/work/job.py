"""Long-running jobs: generators that run step by step in the main thread or in threads beside the window.

What a job does is a generator. It runs in Blender's main thread up to its next `yield`, and says there how far it is:

    def work() -> Work[int]:
        mesh = yield Aside(lambda progress: prepare(progress))   # in a thread; the window lives meanwhile
        for item in mesh:
            add(item)                                            # a step in the main thread: at most some 50 ms
            yield 0.5                                            # share that is done

Whoever wants to see whether something is at work asks `running_job`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass, field, replace
from threading import Event, Thread
from typing import Any, Generic, TypeAlias, TypeVar, cast

from ...base.errors import Cancelled
from ...base.remarks import collected_remarks
from ...base.turns.main_thread import MainThreadCalls

T = TypeVar("T")
Report: TypeAlias = Callable[[float], None]
"""Called in a thread with the share that is done; raises `Cancelled` where the job is to stop."""

TICK = 0.03
"""Seconds between two turns of a job in the window's thread."""
BUDGET = 0.05
"""Seconds of one such turn, where drawing the window takes next to no time."""
_WORK_FOR_DRAWING, _LONGEST = 4.0, 2.0
"""So many times as long as the window was drawn a turn lasts, but no longer than this (s)."""
_MOST_PATIENCE = 0.5
"""Longest time (s) that a turn waits for what is computed aside."""
_TOLD_FROM = 0.05, 2.0
"""Share that is done, and seconds, from which on the time left is told. Chosen: before, it jumps."""
_LOOK_AGAIN = 0.001
"""Seconds between two looks whether there is something to do in the main thread again."""


def duration(seconds: float) -> str:
    """Return a time in s, min or h, rounded as people say it."""
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    if seconds < 90.0 * 60.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"


class WorkPace:
    """Time budget of a job's turns in the main thread: slow drawing of the window makes them longer.

    Args:
        clock: returns seconds.
        drawing: seconds that the window took to be drawn the last time, as far as that is known.

    Attributes:
        drawing: the same, now.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter, drawing: float = 0.0) -> None:
        self._clock = clock
        self._left: float | None = None
        self.drawing = drawing

    def budget(self) -> float:
        """Return the budget (s) of the turn that begins now, from the time that the window took since the last turn."""
        if self._left is not None:
            self.drawing = max(self._clock() - self._left - TICK, 0.0)
        return min(max(BUDGET, _WORK_FOR_DRAWING * self.drawing), _LONGEST)

    @property
    def patience(self) -> float:
        """Return how long (s) a turn waits for a thread: as long as drawing the window would take."""
        return min(self.drawing, _MOST_PATIENCE)

    def leave(self) -> None:
        """Record the end of a turn."""
        self._left = self._clock()


@dataclass(frozen=True)
class Aside:
    """Request of a job to run a function in a thread; the generator is sent its result.

    Attributes:
        work: gets a `Report` to call now and then; touches no data-block of Blender.
        state: what it does, in words for the window.
        first, last: the shares of the job at its begin and end.
        calls: what the thread has the main thread do meanwhile; each of them leaves nothing in the file.
        notes: sentences that the window shows below the progress; the work may add some while it runs.
    """

    work: Callable[[Report], Any]
    state: str = ""
    first: float = 0.0
    last: float = 1.0
    calls: MainThreadCalls | None = None
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Step:
    """Progress of a job after a step: share of the whole, and a text of what comes next."""

    share: float
    state: str = ""


Work: TypeAlias = Generator[float | Step | Aside | None, Any, T]
"""Work of a job. ``None`` means that there is nothing to do in the main thread just now."""


def part_of_work(work: Work[T], first: float, last: float) -> Work[T]:
    """Generator that does a part of a job's work in the main thread, at the shares from `first` to `last` of the whole.

    Args:
        work: steps without `Aside`.
        first, last: the shares of the job at its begin and end.
    """
    with closing(work):
        while True:
            try:
                outcome = next(work)
            except StopIteration as end:
                return cast(T, end.value)
            assert not isinstance(outcome, Aside)
            if outcome is not None:
                step = outcome if isinstance(outcome, Step) else Step(outcome)
                outcome = replace(step, share=first + step.share * (last - first))
            yield outcome


class PanelJob(Generic[T]):
    """Long-running job of the panel. While a thread runs it must hold no data-blocks: an undo may free them.

    Args:
        title: what is done, as a noun: "Scan".
        work: see `Work`; closed when the job is stopped, so that its ``finally`` can clean up.
        clock: returns seconds.

    Attributes:
        title: what is done.
        share: how much is done, 0 to 1.
        error: what ended it early, if something did; `Cancelled` after `stop`.
        result: what the work returned; None until it has ended well.
        remarks: what users must know of the input, see `base.remarks`.
    """

    def __init__(self, title: str, work: Work[T], clock: Callable[[], float] = time.perf_counter) -> None:
        self.title = title
        self.share = 0.0
        self.error: BaseException | None = None
        self.result: T | None = None
        self.remarks: list[str] = []
        self._work = work
        self._state = ""
        self._clock, self._begin = clock, clock()
        self._stopping = Event()
        self._ended = self._idle = self._is_new = self._done_aside = False
        self._thread: _Thread | None = None
        self._answer: Any = None
        self._failure: BaseException | None = None
        self._aside: Aside | None = None

    @classmethod
    def aside(cls, title: str, work: Callable[[Report], T], state: str = "") -> PanelJob[T]:
        """Return a job that runs one function in a thread; `state` is the text in the window."""

        def steps() -> Work[T]:
            return (yield Aside(work, state or title))

        return cls(title, steps())

    @property
    def running(self) -> bool:
        """Return whether the job was started and hasn't ended yet."""
        return running_job() is self and not self._ended

    @property
    def state(self) -> str:
        """Return the text of the current step with the share done, as shown in the window."""
        if self._stopping.is_set():
            return "Stopping"
        left = self._time_left()
        return f"{self._state or self.title} {self.share:.0%}" + (f", {left} left" if left else "")

    def _time_left(self) -> str:
        """Return the time that the rest takes if it goes on as so far; empty while that can't be told yet."""
        passed = self._clock() - self._begin
        if self.share < _TOLD_FROM[0] or passed < _TOLD_FROM[1] or self.share >= 1.0:
            return ""
        return duration(passed * (1.0 - self.share) / self.share)

    @property
    def notes(self) -> list[str]:
        """Return the sentences that are shown below the progress of what runs aside; none in between."""
        return self._aside.notes if self._thread is not None and self._aside is not None else []

    @property
    def touches_scene(self) -> bool:
        """Return whether the job may hold data-blocks of the file: not while a thread runs, nor after its end."""
        return not self._ended and self._thread is None

    def run(self) -> T:
        """Run the whole job in this thread and return its result; raises the job's error."""
        while not self._ended:
            self._advance(self._do_at_once)
        if self.error is not None:
            raise self.error
        return self.result  # type: ignore[return-value]

    def start(self) -> None:
        """Run the first step and become the running job; raises that step's error, so that wrong input is refused.

        `tick` does the rest.
        """
        global _running
        assert running_job() is None
        self._advance(self._begin_thread)
        if self.error is not None:
            raise self.error
        _running = self

    def tick(self, seconds: float = BUDGET, patience: float = 0.0) -> bool:
        """Run steps in the main thread for about a given time, at least one; return whether the job is still running.

        Args:
            seconds: how long.
            patience: how long (s) it waits where there is nothing to do in the main thread; for a thread only once.
        """
        deadline = time.perf_counter() + seconds
        idle_until = time.perf_counter() + patience
        while not self._ended:
            if self._thread is not None:
                if self._is_new:
                    self._thread.join(patience)
                    self._is_new = False
                if self._thread.is_alive():
                    self._make_calls(deadline, idle_until)
                    break
                self._take_over()
            self._advance(self._begin_thread)
            now = time.perf_counter()
            if now >= deadline or (self._idle and now >= idle_until):
                break
            if self._idle:
                time.sleep(_LOOK_AGAIN)
            else:
                idle_until = now + patience
        return not self._ended

    def stop(self, wait: bool = False) -> None:
        """Request the job to stop after the current step; `wait` blocks until it has."""
        self._stopping.set()
        if not wait or self._ended:
            return
        if self._thread is not None:
            if self._aside is not None and self._aside.calls is not None:
                self._aside.calls.close()  # or the thread would wait for this one
            self._thread.join()
            self._take_over()
        self._close(Cancelled(f"{self.title} was cancelled"))

    def _make_calls(self, deadline: float, idle_until: float) -> None:
        """Make the thread's main-thread calls until the deadline; without any wait until `idle_until`."""
        calls = None if self._aside is None else self._aside.calls
        while calls is not None:
            idle = not calls.make_next()
            now = time.perf_counter()
            if now >= deadline or (idle and now >= idle_until):
                return
            if idle:
                time.sleep(_LOOK_AGAIN)

    def _advance(self, begin: Callable[[Aside], None]) -> None:
        """Run the generator up to its next `yield`; a job that is to stop is closed there, unless it has ended.

        What was done aside to its end is handed over even then: its files may stand already, and nothing be left to do.
        """
        stopping, done = self._stopping.is_set() and not self._idle, self._done_aside
        self._done_aside = False
        if stopping and not done:
            self._close(Cancelled(f"{self.title} was cancelled"))
            return
        answer, failure, self._answer, self._failure = self._answer, self._failure, None, None
        try:
            with collected_remarks(self.remarks):
                outcome = self._work.send(answer) if failure is None else self._work.throw(failure)
        except StopIteration as end:
            self.result, self.share = end.value, 1.0
            self._end()
        except BaseException as error:
            self._close(error)
        else:
            if stopping:
                self._close(Cancelled(f"{self.title} was cancelled"))
            else:
                self._note(outcome, begin)

    def _note(self, turn: float | Step | Aside | None, begin: Callable[[Aside], None]) -> None:
        """Update progress from the value that the generator yielded; if it is an `Aside`, begin its thread."""
        self._idle = turn is None
        if isinstance(turn, Aside):
            turn = replace(turn, work=self._with_remarks(turn.work))
            self._aside, self._state, self.share = turn, turn.state or self._state, turn.first
            begin(turn)
        elif turn is not None:
            step = turn if isinstance(turn, Step) else Step(turn)
            self.share, self._state = step.share, step.state or self._state

    def _with_remarks(self, work: Callable[[Report], Any]) -> Callable[[Report], Any]:
        """Return a function that does work and collects its remarks."""

        def do(report: Report) -> Any:
            with collected_remarks(self.remarks):
                return work(report)

        return do

    def _do_at_once(self, aside: Aside) -> None:
        try:
            self._answer = aside.work(self._report)
            self._done_aside = True
        except BaseException as error:
            self._failure = error

    def _begin_thread(self, aside: Aside) -> None:
        self._thread = _Thread(lambda: aside.work(self._report), f"SynthRoads {self.title}")
        self._is_new = True
        self._thread.start()

    def _take_over(self) -> None:
        """Store the ended thread's result or error, to be sent to the generator."""
        assert self._thread is not None
        thread, self._thread = self._thread, None
        self._answer, self._failure = thread.result, thread.error
        self._done_aside = thread.error is None

    def _report(self, share: float) -> None:
        if self._stopping.is_set():
            raise Cancelled(f"{self.title} was cancelled")
        if self._aside is not None:
            self.share = self._aside.first + share * (self._aside.last - self._aside.first)

    def _close(self, error: BaseException) -> None:
        """End the job early with an error, closing the generator."""
        self.error = error
        try:
            self._work.close()
        except Exception as worse:
            worse.__context__ = error
            self.error = worse
        self._end()

    def _end(self) -> None:
        global _running
        self._ended = True
        if _running is self:
            _running = None


class _Thread(Thread):
    """Thread that stores its function's result or error."""

    def __init__(self, work: Callable[[], Any], name: str) -> None:
        super().__init__(name=name)
        self._work = work
        self.result: Any = None
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self.result = self._work()
        except BaseException as error:
            self.error = error


_running: PanelJob[Any] | None = None


def running_job() -> PanelJob[Any] | None:
    """Return the running job; None if there is none."""
    return _running


def stop_job() -> None:
    """Stop the running job, if any, and wait until it has ended."""
    if _running is not None:
        _running.stop(wait=True)
