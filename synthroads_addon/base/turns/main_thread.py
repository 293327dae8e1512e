"""Calls that other threads have the main thread make for them: whatever only Blender's main thread may do."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from threading import Lock, current_thread, main_thread
from typing import Any, TypeVar

from ..errors import Cancelled

T = TypeVar("T")


@dataclass(frozen=True)
class _Call:
    """A function that waits to be called, and what its caller waits for."""

    work: Callable[[], Any]
    result: Future[Any] = field(default_factory=Future)

    def make(self) -> None:
        """Call the function, and give its caller what it returned or raised."""
        try:
            self.result.set_result(self.work())
        except BaseException as error:
            self.result.set_exception(error)


class MainThreadCalls:
    """Calls that threads have the main thread make, one after the other in the order in which they were asked for."""

    def __init__(self) -> None:
        self._queue: SimpleQueue[_Call | None] = SimpleQueue()
        self._lock = Lock()
        self._open = True

    def call(self, work: Callable[[], T]) -> T:
        """Return what a function returns that the main thread calls; wait for it, unless this is the main thread.

        Raises:
            Cancelled: the main thread makes no more calls.
            Exception: what the function raises.
        """
        if current_thread() is main_thread():
            return work()
        waiting_call = _Call(work)
        with self._lock:
            if not self._open:
                raise Cancelled("the main thread makes no more calls")
            self._queue.put(waiting_call)
        result: T = waiting_call.result.result()
        return result

    def make_next(self) -> bool:
        """Make the call that has waited longest; return whether one has waited. In the main thread only."""
        try:
            waiting_call = self._queue.get_nowait()
        except Empty:
            return False
        if waiting_call is not None:
            waiting_call.make()
        return True

    def result_of(self, future: Future[T]) -> T:
        """Return the result of a future; the main thread makes the calls of others while it waits."""
        if current_thread() is main_thread():
            future.add_done_callback(lambda _: self._queue.put(None))
            while not future.done():
                waiting_call = self._queue.get()
                if waiting_call is not None:
                    waiting_call.make()
        return future.result()

    def open(self) -> None:
        """Take calls again after `close`."""
        with self._lock:
            self._open = True

    def close(self) -> None:
        """Take no more calls: who waits for one gets `Cancelled`."""
        with self._lock:
            self._open = False
            while not self._queue.empty():
                waiting_call = self._queue.get_nowait()
                if waiting_call is not None:
                    waiting_call.result.set_exception(Cancelled("the main thread makes no more calls"))
