"""Work in turns: it stands still between them, computes aside, and is stopped where it stands."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

from synthroads_addon.base.errors import Cancelled
from synthroads_addon.base.turns.stepper import Stepper, run_aside, run_in_caller, yield_if_due, yield_now


def straight(work: Callable[[], object]) -> object:
    return work()


def in_turns(work: Callable[[], object]) -> object:
    turns = Stepper(work)
    while turns.run_for(0.001):
        pass
    return turns.result()


@pytest.mark.parametrize("run", [straight, in_turns])
def test_what_is_returned_is_the_same(run: Callable[[Callable[[], object]], object]) -> None:
    def work() -> list[object]:
        found: list[object] = []
        for number in range(20):
            found.append(run_aside(lambda number=number: number * number))
            yield_now()
            yield_if_due()
        return [*found, run_in_caller(lambda: "caller")]

    assert run(work) == [n * n for n in range(20)] + ["caller"]


def test_it_stands_still_between_turns() -> None:
    done: list[int] = []

    def work() -> None:
        for number in range(5):
            done.append(number)
            yield_now()

    turns = Stepper(work)
    assert done == []
    for expected in range(1, 6):
        assert turns.run_for(1.0)
        time.sleep(0.01)
        assert len(done) == expected
    assert not turns.run_for(1.0)


def test_a_pause_hands_back_only_when_the_time_is_over() -> None:
    counts: list[int] = []

    def work() -> None:
        for number in range(100):
            counts.append(number)
            yield_if_due()

    turns = Stepper(work)
    assert not turns.run_for(60.0)
    assert len(counts) == 100
    turns = Stepper(work)
    for _ in range(3):
        turns.run_for(-1.0)
    assert len(counts) == 103
    turns.close()


def test_aside_the_caller_goes_on() -> None:
    gate = threading.Event()
    turns = Stepper(lambda: run_aside(lambda: gate.wait(30.0)))
    assert turns.run_for(0.001)
    assert turns.runs_aside
    assert turns.run_for(0.001)  # comes back at once: the work still computes
    gate.set()
    while turns.run_for(0.001):
        pass
    assert turns.result() is True


def test_the_caller_does_what_only_it_may_do() -> None:
    main = threading.get_ident()
    turns = Stepper(lambda: (threading.get_ident(), run_in_caller(threading.get_ident)))
    while turns.run_for(0.001):
        pass
    own, asked = turns.result()
    assert asked == main != own


@pytest.mark.parametrize("wrapped", [lambda f: f(), run_aside, run_in_caller])
def test_what_goes_wrong_reaches_the_caller(wrapped: Callable[[Callable[[], object]], object]) -> None:
    with pytest.raises(ZeroDivisionError):
        in_turns(lambda: wrapped(lambda: 1 / 0))


@pytest.mark.parametrize("steps", [0, 1, 3])
def test_closing_stops_it_where_it_stands_and_lets_it_clean_up(steps: int) -> None:
    seen: list[object] = []

    def work() -> None:
        try:
            for number in range(5):
                seen.append(number)
                yield_now()
        except Cancelled:
            seen.append("cancelled")
            raise
        finally:
            seen.append("clean")

    turns = Stepper(work)
    for _ in range(steps):
        turns.run_for(1.0)
    turns.close()
    assert seen == ([*range(steps), "cancelled", "clean"] if steps else [])
    assert not turns.run_for(1.0)
    turns.close()  # twice does no harm


def test_closing_waits_for_what_is_computed_aside() -> None:
    gate, ended = threading.Event(), []
    turns = Stepper(lambda: run_aside(lambda: (gate.wait(30.0), ended.append(True))))
    turns.run_for(0.001)
    threading.Timer(0.05, gate.set).start()
    turns.close()
    assert ended == [True]
