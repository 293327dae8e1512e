"""Messages of a command on standard error while it works: progress, and details with ``--verbose``.

All of it goes through one logger: errors and failures are always shown, notes and progress unless ``--quiet`` is given,
details with ``--verbose`` only. Standard output is left to results.
"""

import argparse
import importlib.metadata
import json
import logging
import platform
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.version import generator

logger = logging.getLogger("synthroads")
INTERVAL = 10.0
"""Seconds between two lines about the same stage, where standard error is no terminal."""
PATIENCE = 2.0
"""Seconds until the first of these lines."""
_PACKAGES = ("bpy", "numpy", "embreex", "laspy", "lazrs", "pydantic", "torch", "scipy")
"""Packages that results and their speed depend on."""

_endings: list[Callable[[], None]] = []
"""Functions that end the progress which is shown: the bar, and the stage that is timed."""


@contextmanager
def messages(arguments: argparse.Namespace) -> Iterator[None]:
    """Context that logs to standard error as a command's flags say, and removes its progress display at the end."""
    set_up(arguments)
    begun = time.perf_counter()
    if logger.isEnabledFor(logging.DEBUG):
        logger.debug("%s, Python %s, %s", generator(), platform.python_version(), platform.platform())
        logger.debug("packages: %s", ", ".join(_versions()))
        detail("arguments", {name: value for name, value in vars(arguments).items() if name != "command"})
    try:
        yield
    finally:
        while _endings:
            _endings.pop()()
        logger.debug("all: took %.2f s", time.perf_counter() - begun)


def set_up(arguments: argparse.Namespace) -> None:
    """Set the logger's output to standard error and its level to what ``--quiet`` and ``--verbose`` ask for."""
    logger.handlers[:] = [logging.StreamHandler(sys.stderr)]
    logger.propagate = False
    verbose = getattr(arguments, "verbose", False)
    logger.setLevel(logging.ERROR if arguments.quiet else logging.DEBUG if verbose else logging.INFO)


def detail(name: str, data: Mapping[str, Any]) -> None:
    """Log named settings as one line of JSON at debug level, shown with ``--verbose``."""
    if logger.isEnabledFor(logging.DEBUG):
        logger.debug("%s: %s", name, json.dumps(data, default=str))


def _versions() -> Iterator[str]:
    for name in _PACKAGES:
        try:
            yield f"{name} {importlib.metadata.version(name)}"
        except importlib.metadata.PackageNotFoundError:
            continue


def progress_bar(arguments: argparse.Namespace) -> Progress:
    """Return a progress callback: a bar in a terminal, log lines elsewhere, nothing with ``--quiet``."""
    if arguments.quiet:
        return silent
    set_up(arguments)  # for those that aren't run by `headless.commands.run`
    verbose = logger.isEnabledFor(logging.DEBUG)
    shown = _bar() if sys.stderr is not None and sys.stderr.isatty() else _LineProgress(0.0 if verbose else PATIENCE)
    return _StageTimeProgress(shown) if verbose else shown


class _LineProgress:
    """Progress callback that logs a line for each new stage, and one every `INTERVAL` seconds.

    What is over within `PATIENCE` seconds shows none, so that wrong input stays a single line.
    """

    def __init__(self, patience: float) -> None:
        self._seen: set[str] = set()
        self._begun = self._last = time.perf_counter()
        self._lock = threading.Lock()
        self._held: list[str] | None = []
        timer = threading.Timer(patience, self._show_held)
        timer.daemon = True
        timer.start()
        _endings.append(timer.cancel)

    def __call__(self, stage: str, share: float) -> None:
        now = time.perf_counter()
        if stage in self._seen and now - self._last < INTERVAL:
            return
        self._seen.add(stage)
        self._last = now
        line = f"{stage}: {100.0 * share:.0f} % after {now - self._begun:.0f} s"
        with self._lock:
            if self._held is None:
                logger.info(line)
            else:
                self._held.append(line)

    def _show_held(self) -> None:
        with self._lock:
            for line in self._held or ():
                logger.info(line)
            self._held = None


class _StageTimeProgress:
    """Progress callback that logs each stage's beginning and duration, and calls another one."""

    def __init__(self, shown: Progress) -> None:
        self._shown = shown
        self._stage: str | None = None
        self._since = 0.0
        _endings.append(self._end)

    def __call__(self, stage: str, share: float) -> None:
        if stage != self._stage:
            self._end()
            logger.debug("stage %s: begins", stage)
            self._stage, self._since = stage, time.perf_counter()
        self._shown(stage, share)

    def _end(self) -> None:
        if self._stage is not None:
            logger.debug("stage %s: took %.2f s", self._stage, time.perf_counter() - self._since)
        self._stage = None


def _bar() -> Progress:
    from tqdm import tqdm

    class AboveTheBar(logging.StreamHandler):
        """Takes the bar away while a message is written."""

        def emit(self, record: logging.LogRecord) -> None:
            with tqdm.external_write_mode(file=sys.stderr):
                super().emit(record)

    logger.handlers[:] = [AboveTheBar(sys.stderr)]
    bar = tqdm(total=100, bar_format="{desc:<12} {bar:40} {n:3.0f} %  {elapsed}", file=sys.stderr, leave=False)
    _endings.append(bar.close)

    def show(stage: str, share: float) -> None:
        if bar.desc != f"{stage}: ":
            bar.reset()
            bar.set_description(stage)
        bar.update(100 * share - bar.n)

    return show
