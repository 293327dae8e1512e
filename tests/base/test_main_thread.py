"""Calls that threads have the main thread make: results, errors, order, and an end that leaves nobody waiting."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import current_thread, main_thread

import pytest

from synthroads_addon.base.errors import Cancelled
from synthroads_addon.base.turns.main_thread import MainThreadCalls


def where() -> bool:
    """Return whether this is the main thread."""
    return current_thread() is main_thread()


def test_calls_are_made_by_the_main_thread_while_it_waits() -> None:
    calls = MainThreadCalls()
    with ThreadPoolExecutor(3) as pool:
        futures = [pool.submit(lambda n=n: (n, where(), calls.call(where))) for n in range(20)]
        assert [calls.result_of(future) for future in futures] == [(n, False, True) for n in range(20)]
    assert calls.call(where)


def test_an_error_is_the_callers() -> None:
    calls = MainThreadCalls()
    with ThreadPoolExecutor(1) as pool, pytest.raises(ZeroDivisionError):
        calls.result_of(pool.submit(calls.call, lambda: 1 // 0))


def test_nobody_waits_after_the_end() -> None:
    calls = MainThreadCalls()
    with ThreadPoolExecutor(2) as pool:
        early = pool.submit(calls.call, where)
        while not calls._queue.qsize():
            pass
        calls.close()
        late = pool.submit(calls.call, where)
        for future in (early, late):
            with pytest.raises(Cancelled):
                future.result(10.0)
        calls.open()
        assert calls.result_of(pool.submit(calls.call, where))
    assert not calls.make_next() or not calls.make_next()
