"""Counts how often files are opened, by whatever way Python does it."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

_counted: list[Counter[Path]] = []


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _counted and isinstance(arguments[0], str | bytes | os.PathLike):
        _counted[-1][Path(os.fsdecode(arguments[0]))] += 1


@cache
def _listen() -> None:
    sys.addaudithook(_note)  # it can't be removed


@contextmanager
def opened_files() -> Iterator[Counter[Path]]:
    """Context whose value counts the openings of each file by its path, as it is opened by."""
    _listen()
    _counted.append(Counter())
    try:
        yield _counted[-1]
    finally:
        _counted.pop()
