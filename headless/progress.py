"""Progress of a command on standard error: a bar in a terminal, lines elsewhere."""

from __future__ import annotations

import argparse
import logging
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from headless.messages import logger, set_up
from synthroads_addon.base.process.end_signals import ENDS
from synthroads_addon.base.progress import Progress, duration, silent

INTERVAL = 10.0
"""Seconds between two lines about the same stage, where standard error is no terminal."""
PATIENCE = 2.0
"""Seconds until the first of these lines."""
_FIRST, _LEAST = 3.0, 0.01
"""Seconds and share of work that must be done before the time that is left is told."""
_working: list[_LineProgress] = []
"""The progress in lines of the command that is run."""
_endings: list[Callable[[], None]] = []
"""Functions that end the progress which is shown: the bar, and the stage that is timed."""


@contextmanager
def progress_display(arguments: argparse.Namespace) -> Iterator[None]:
    """Context of a command at work: says so in lines where there is no terminal, and ends what shows its progress."""
    if not arguments.quiet and not _in_a_terminal():
        _working.append(_lines(arguments))
    try:
        yield
    finally:
        _working.clear()
        while _endings:
            _endings.pop()()


def progress_bar(arguments: argparse.Namespace) -> Progress:
    """Return a progress callback: a bar in a terminal, log lines elsewhere, nothing with ``--quiet``."""
    if arguments.quiet:
        return silent
    set_up(arguments)  # for those that aren't run by `headless.commands.run`
    verbose = logger.isEnabledFor(logging.DEBUG)
    display = _bar() if _in_a_terminal() else _lines(arguments)
    return _StageTimeProgress(display) if verbose else display


def _in_a_terminal() -> bool:
    """Return whether standard error is a terminal."""
    return sys.stderr is not None and sys.stderr.isatty()


def _lines(arguments: argparse.Namespace) -> _LineProgress:
    """Return the progress in lines that the command has, or a new one of what isn't run as a command."""
    patience = 0.0 if logger.isEnabledFor(logging.DEBUG) else PATIENCE
    return _working[-1] if _working else _LineProgress(patience, getattr(arguments, "command", None) or "work")


def _start_thread(target: Callable[[], None]) -> threading.Thread:
    """Start a thread that ends with the process, and return it.

    Signals that end the command aren't delivered to it: they would leave the main thread asleep.
    """

    def run() -> None:
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_BLOCK, ENDS)
        target()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


class _LineProgress:
    """Progress callback that logs a line for each new stage, and one every `INTERVAL` seconds, whether called or not.

    What is over within `PATIENCE` seconds shows none, so that wrong input stays a single line.

    Args:
        patience: seconds until the first line.
        first_stage: what is at work while no stage is told.
    """

    def __init__(self, patience: float, first_stage: str) -> None:
        self._stages_told: set[str] = set()
        self._begin_time = self._last_time = time.perf_counter()
        self._stage, self._share = first_stage, 0.0
        self._rate = _Rate()
        self._lock = threading.RLock()
        self._held: list[str] | None = []
        self._is_over = threading.Event()
        self._patience = patience
        _start_thread(self._beat)
        _endings.append(self._end)

    def __call__(self, stage: str, share: float) -> None:
        with self._lock:
            now = time.perf_counter()
            self._stage, self._share = stage, share
            self._rate.add(now, stage, share)
            if stage not in self._stages_told or now - self._last_time >= INTERVAL:
                self._tell(now)

    def _tell(self, now: float) -> None:
        """Log a line on the stage that is at work."""
        self._stages_told.add(self._stage)
        self._last_time = now
        time_text = f"after {now - self._begin_time:.0f} s"
        state = f"{100.0 * self._share:.0f} % {time_text}" if self._rate.began else f"at work {time_text}"
        seconds_left = self._rate.left(now)
        state += "" if seconds_left is None else f", about {duration(seconds_left)} left"
        detail = getattr(self._stage, "detail", "")
        line = f"{self._stage}: {state}{f' ({detail})' if detail else ''}"
        if self._held is None:
            logger.info(line)
        else:
            self._held.append(line)

    def _beat(self) -> None:
        """Log a line whenever none was logged for `INTERVAL` seconds, until the end: work may tell nothing for long."""
        if not self._is_over.wait(self._patience):
            self._show_held()
        while not self._is_over.wait(max(0.01, self._last_time + INTERVAL - time.perf_counter())):
            with self._lock:
                now = time.perf_counter()
                if now - self._last_time >= INTERVAL and not self._is_over.is_set():
                    self._tell(now)

    def _show_held(self) -> None:
        """Log the lines held back so far; from now on lines are logged at once."""
        with self._lock:
            for line in self._held or ():
                logger.info(line)
            self._held = None

    def _end(self) -> None:
        """End the thread, so that no more lines come."""
        with self._lock:
            self._is_over.set()


class _Rate:
    """How fast a share of work grows, for the time that is left of it.

    Attributes:
        began: time and share of the first report since a stage began at 0, or the share fell or was 1; None before any.
    """

    def __init__(self) -> None:
        self.began: tuple[float, float] | None = None
        self._stage = ""
        self._share = 0.0
        self._at = 0.0

    def add(self, now: float, stage: str, share: float) -> None:
        """Take a report into account. Shares may be of a stage, or of all stages one after the other."""
        is_new_work = share < self._share or self._share >= 1.0 or (share == 0.0 and stage != self._stage)
        if self.began is None or is_new_work:
            self.began = now, share
        self._at, self._stage, self._share = now, stage, share

    def left(self, now: float) -> float | None:
        """Return the seconds left, by what was done since the first report; None where that says too little.

        What the last report said may have gone on since: the time since then counts as spent.
        """
        if self.began is None:
            return None
        seconds_spent, share_done = self._at - self.began[0], self._share - self.began[1]
        if seconds_spent < _FIRST or share_done < _LEAST or self._share >= 1.0:
            return None
        return max(0.0, seconds_spent * (1.0 - self._share) / share_done - (now - self._at))


class _StageTimeProgress:
    """Progress callback that logs each stage's beginning and duration, and calls another one."""

    def __init__(self, display: Progress) -> None:
        self._display = display
        self._stage: str | None = None
        self._since = 0.0
        _endings.append(self._end)

    def __call__(self, stage: str, share: float) -> None:
        if stage != self._stage:
            self._end()
            logger.debug("stage %s: begins", stage)
            self._stage, self._since = stage, time.perf_counter()
        self._display(stage, share)

    def _end(self) -> None:
        """Log how long the stage took, if there is one."""
        if self._stage is not None:
            logger.debug("stage %s: took %.2f s", self._stage, time.perf_counter() - self._since)
        self._stage = None


def _bar() -> Progress:
    """Return a progress callback that draws a bar in the terminal."""
    from tqdm import tqdm

    class AboveTheBar(logging.StreamHandler):
        """Takes the bar away while a message is written."""

        def emit(self, record: logging.LogRecord) -> None:
            with tqdm.external_write_mode(file=sys.stderr):
                super().emit(record)

    logger.handlers[:] = [AboveTheBar(sys.stderr)]
    form = "{desc:<12} {bar:40} {n:3.0f} %  {elapsed}{postfix}"
    bar = tqdm(total=100, bar_format=form, file=sys.stderr, leave=False)
    rate, is_over = _Rate(), threading.Event()

    def refresh() -> None:
        while not is_over.wait(1.0):
            bar.refresh()

    def end() -> None:
        is_over.set()
        thread.join(2.0)
        bar.close()

    def show(stage: str, share: float) -> None:
        if bar.desc != f"{stage}: ":
            bar.reset()
            bar.set_description(stage)
        now = time.perf_counter()
        rate.add(now, stage, share)
        seconds_left = rate.left(now)
        notes = ["" if seconds_left is None else f"about {duration(seconds_left)} left", getattr(stage, "detail", "")]
        bar.set_postfix_str(", ".join(filter(None, notes)), refresh=False)
        bar.update(100 * share - bar.n)

    thread = _start_thread(refresh)
    _endings.append(end)
    return show
