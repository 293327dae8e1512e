"""Messages of a command on standard error while it works: failures and notes, and details with ``--verbose``.

All of it goes through one logger, and so does `headless.progress`: errors and failures are always shown, notes and
progress unless ``--quiet`` is given, details with ``--verbose`` only. Standard output is left to results.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from synthroads_addon.base.remarks import ASSUMPTION
from synthroads_addon.base.version import generator

logger = logging.getLogger("synthroads")
_PACKAGES = ("bpy", "numpy", "embreex", "laspy", "lazrs", "pydantic", "torch", "scipy")
"""Packages that results and their speed depend on."""


@contextmanager
def messages(arguments: argparse.Namespace) -> Iterator[None]:
    """Context that logs to standard error as a command's flags say, warnings of libraries and remarks on input too."""
    set_up(arguments)
    start = time.perf_counter()
    if logger.isEnabledFor(logging.DEBUG):
        import platform

        logger.debug("%s, Python %s, %s", generator(), platform.python_version(), platform.platform())
        logger.debug("packages: %s", ", ".join(_versions()))
        detail("arguments", {name: value for name, value in vars(arguments).items() if name != "command"})
    remarks = _Remarks()
    logger.addFilter(remarks)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _log_warning
            yield
        remarks.tell_assumptions()
    finally:
        logger.removeFilter(remarks)
        logger.debug("all: took %.2f s", time.perf_counter() - start)


def _log_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    """Log a warning of a library as a detail: it speaks of arrays, not of what the user gave, and may precede an error.

    What a user has to know of odd input is told by `synthroads_addon.base.remarks`.
    """
    logger.debug("%s: %s", category.__name__, " ".join(str(message).split()))


class _Remarks(logging.Filter):
    """Filter of a command's messages: each warning once, and assumptions at the end of work that succeeds.

    So wrong input stays a single line, whatever was assumed before the fault was found.
    """

    def __init__(self) -> None:
        super().__init__()
        self._texts_seen: set[str] = set()
        self._assumptions: list[logging.LogRecord] = []

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a message is shown now: each remark once, and assumptions only at the end."""
        if record.levelno < logging.WARNING and not hasattr(record, ASSUMPTION):
            return True
        text = record.getMessage()
        if text in self._texts_seen:
            return False
        self._texts_seen.add(text)
        if hasattr(record, ASSUMPTION):
            self._assumptions.append(record)
            return False
        return True

    def tell_assumptions(self) -> None:
        """Log what was assumed."""
        for record in self._assumptions:
            logger.info(record.getMessage())


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
    """Yield name and version of the packages that results depend on."""
    import importlib.metadata

    for name in _PACKAGES:
        try:
            yield f"{name} {importlib.metadata.version(name)}"
        except importlib.metadata.PackageNotFoundError:
            continue
