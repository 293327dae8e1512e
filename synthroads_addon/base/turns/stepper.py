"""Long work in turns: a plain function that can be set down at any depth, and taken up again by its caller.

Building a road calls functions that call functions, sixty node groups deep, and all of it must happen in Blender's main
thread or while that waits. A generator would have to be threaded through every one of them. So the work has a Python
thread of its own, but only ever runs while its caller waits for it in `Stepper.run_for`, or while it computes what
needs no turn in `run_aside`::

    def work():
        path = run_aside(lambda: heavy_numpy()) # both run meanwhile
        for item in path:
            add(item)                           # the caller waits
            yield_if_due()                      # hands back if the turn's time is over
        yield_now()                             # hands back in any case

    stepper = Stepper(work)
    while stepper.run_for(0.05):
        ...                                     # the work stands still, or computes aside
    result = stepper.result()

Outside of a `Stepper` these three do nothing but their work, so the same function runs straight through as well.
"""

import threading
import time
from collections.abc import Callable
from enum import Enum
from typing import Generic, TypeVar

from ..errors import Cancelled

T = TypeVar("T")
R = TypeVar("R")

_here = threading.local()
_SHORT = 0.005
"""How long (s) a turn waits for what is computed aside, so that short sums don't cost a turn each."""


class _State(Enum):
    """State of a work: it waits for its turn, has it, computes without it, or has ended."""

    WAITING = 0
    WORKING = 1
    ASIDE = 2
    DONE = 3


class Stepper(Generic[T]):
    """Runs a function in turns, in a thread of its own that only works while the caller waits.

    Args:
        work: what is to be done; it calls `yield_if_due`, `yield_now`, `run_aside` and `run_in_caller`.
        name: of its thread.
    """

    def __init__(self, work: Callable[[], T], name: str = "SynthRoads turns") -> None:
        self._work = work
        self._result: T | None = None
        self._error: BaseException | None = None
        self._call_to_make: Callable[[], None] | None = None
        self._stopping = False
        self._deadline = 0.0
        self._state = _State.WAITING
        self._change = threading.Condition()
        # A work that is left alone must not keep the process from ending.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def runs_aside(self) -> bool:
        """Return whether the work is computing what needs no turn (`run_aside`)."""
        return self._state is _State.ASIDE

    def run_for(self, seconds: float) -> bool:
        """Let the work run for about ``seconds``; return whether any is left. Raises what the work raises."""
        self._deadline = time.perf_counter() + seconds
        with self._change:
            if self._state is _State.ASIDE:
                self._change.wait_for(lambda: self._state is not _State.ASIDE, timeout=min(seconds, _SHORT))
            self._give_turn()
            while self._call_to_make is not None:
                function, self._call_to_make = self._call_to_make, None
                function()
                self._give_turn()
        if self._error is not None:
            raise self._error
        return self._state is not _State.DONE

    def result(self) -> T:
        """Return what the work's function returned; only allowed once `run_for` has returned False."""
        assert self._state is _State.DONE
        return self._result  # type: ignore[return-value]

    def close(self) -> None:
        """Stop the work where it stands: it sees `Cancelled` there. Waits until it has ended."""
        with self._change:
            self._stopping = True
            if self._thread.ident is None:
                self._state = _State.DONE
            while self._state is not _State.DONE:
                self._change.wait_for(lambda: self._state is not _State.ASIDE)
                self._give_turn()

    def _give_turn(self) -> None:
        """Let the work go on if it waits for its turn, and wait until it hands back."""
        if self._state is not _State.WAITING:
            return
        self._state = _State.WORKING
        if self._thread.ident is None:
            self._thread.start()
        self._change.notify_all()
        self._change.wait_for(lambda: self._state is not _State.WORKING)

    # In the work's own thread

    def _run(self) -> None:
        """Do the work in its own thread, and keep what it returns or raises; an error while stopping is none."""
        _here.stepper = self
        try:
            self._result = self._work()
        except BaseException as error:
            self._error = None if self._stopping else error
        self._hand_back(_State.DONE)

    def _hand_back(self, state: _State) -> None:
        """Set the work's state and let the caller go on."""
        with self._change:
            self._state = state
            self._change.notify_all()

    def _wait(self) -> None:
        """Hand back to the caller and wait for the next turn; Cancelled if the work is to stop."""
        with self._change:
            self._state = _State.WAITING
            self._change.notify_all()
            self._change.wait_for(lambda: self._state is _State.WORKING)
        if self._stopping:
            raise Cancelled("the work was stopped")


def yield_if_due() -> None:
    """Hand back to the stepper's caller if the turn's time is over; do nothing outside of a `Stepper`."""
    stepper: Stepper[object] | None = getattr(_here, "stepper", None)
    if stepper is not None and time.perf_counter() >= stepper._deadline:
        stepper._wait()


def yield_now() -> None:
    """Hand back to the stepper's caller; do nothing outside of a `Stepper`."""
    stepper: Stepper[object] | None = getattr(_here, "stepper", None)
    if stepper is not None:
        stepper._wait()


def run_aside(compute: Callable[[], R]) -> R:
    """Return what a function returns, run while the stepper's caller goes on: it must touch nothing of the caller's."""
    stepper: Stepper[object] | None = getattr(_here, "stepper", None)
    if stepper is None:
        return compute()
    stepper._hand_back(_State.ASIDE)
    try:
        return compute()
    finally:
        stepper._wait()


def run_in_caller(function: Callable[[], R]) -> R:
    """Return what a function returns, run in the stepper's caller's thread: for what only the main thread may do."""
    stepper: Stepper[object] | None = getattr(_here, "stepper", None)
    if stepper is None:
        return function()
    results: list[R] = []
    errors: list[BaseException] = []

    def run() -> None:
        """Run the function and keep its result or its error."""
        try:
            results.append(function())
        except BaseException as error:
            errors.append(error)

    stepper._call_to_make = run
    stepper._wait()
    if errors:
        raise errors[0]
    return results[0]
