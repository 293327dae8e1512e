"""Remarks to users on their input: warnings, and assumptions about what a file can't declare.

All of it goes to one logger: commands show it on standard error. Reports of jobs and the panel have what was collected.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

_logger = logging.getLogger("synthroads")
ASSUMPTION = "assumption"
"""Attribute of the records that tell an assumption: they wait until the work is done."""
_collecting: list[list[str]] = []
"""Lists of the contexts that collect, the innermost last."""
_lock = Lock()


def warn(text: str, *values: object) -> None:
    """Log a warning: what a file declares and isn't used, or contradicts itself; values as `logging` takes them."""
    _collect(text, values)
    _logger.warning(text, *values)


def assume(text: str, *values: object) -> None:
    """Log an assumption about what a file doesn't declare, or what was done to its values."""
    _collect(text, values)
    _logger.info(text, *values, extra={ASSUMPTION: True})


@contextmanager
def collected_remarks(remarks: list[str] | None = None) -> Iterator[list[str]]:
    """Context that collects warnings and assumptions of all threads, each once, in a list: a new one if none is given.

    It does so whatever the logger shows.
    """
    collection = [] if remarks is None else remarks
    with _lock:
        _collecting.append(collection)
    try:
        yield collection
    finally:
        with _lock:
            place = next(
                position for position in reversed(range(len(_collecting))) if _collecting[position] is collection
            )
            del _collecting[place]


def remarks_so_far() -> list[str]:
    """Return a copy of what the innermost `collected_remarks` has collected; empty outside of any."""
    with _lock:
        return list(_collecting[-1]) if _collecting else []


def _collect(text: str, values: tuple[object, ...]) -> None:
    """Add a remark, its values filled in, to the list of every context that collects and hasn't got it."""
    remark = text % values if values else text
    with _lock:
        for remarks in _collecting:
            if remark not in remarks:
                remarks.append(remark)
