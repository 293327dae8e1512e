"""The machine that something was measured on, in words."""

import ctypes
import mmap
import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

import numpy as np
from threadpoolctl import threadpool_limits

LEAST_MEMORY = 128 << 20
"""Bytes of memory without which no command is begun."""


def machine(versions: Mapping[str, str]) -> str:
    """Return the machine in words: processor, usable cores, and versions of programs by their names."""
    programs = ", ".join(f"{name} {version}" for name, version in versions.items())
    return f"{_processor()}, {available_cores()} cores; {programs}"


def available_cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def cores_of_children(count: int) -> Iterator[None]:
    """Context in which processes that are begun may use so many cores of this one's; all where the system can't say."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def physical_memory() -> int | None:
    """Return the machine's physical memory, bytes; None where the system doesn't tell."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def prepare_memory() -> None:
    """Raise MemoryError if hardly any memory can be had, and have linear algebra take its buffers now.

    OpenBLAS tries for ever to get its buffer, where it can't, and takes it when it is first needed.

    Raises:
        MemoryError: less than `LEAST_MEMORY` can be had.
    """
    try:
        mmap.mmap(-1, LEAST_MEMORY).close()
    except OSError:
        raise MemoryError(f"less than {LEAST_MEMORY >> 20} MB can be had") from None
    square = np.ones((256, 256))
    square @ square


def release_memory() -> None:
    """Give back to the system what the C library keeps of freed memory, where it can: much, after much has been built.

    What is built next lies elsewhere than what was there before, so that gaps are left and memory grows without this.
    """
    with suppress(OSError, AttributeError, TypeError):  # none but glibc has it
        ctypes.CDLL(None).malloc_trim(0)


class _OneThread:
    """Limit of linear algebra to one thread that several may hold at a time; it is the whole process's."""

    def __init__(self) -> None:
        self._lock, self._holders = Lock(), 0
        self._limit: threadpool_limits | None = None

    def take(self) -> None:
        """Set the limit, if nobody holds it yet."""
        with self._lock:
            self._holders += 1
            if self._holders == 1:
                self._limit = threadpool_limits(1, user_api="blas")

    def give_back(self) -> None:
        """Restore the threads that there were, if nobody else holds the limit."""
        with self._lock:
            self._holders -= 1
            if self._holders == 0 and self._limit is not None:
                self._limit.restore_original_limits()


_one_thread = _OneThread()


@contextmanager
def linear_algebra_on_one_thread() -> Iterator[None]:
    """Context in which NumPy's linear algebra begins no threads of its own, for work that is shared out to threads.

    After each product OpenBLAS's threads keep a core busy for a while, waiting for the next. Threads may hold it side
    by side. Other linear algebra in the process, but for PyTorch's, is limited meanwhile as well.
    """
    _one_thread.take()
    try:
        yield
    finally:
        _one_thread.give_back()


def _processor() -> str:
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())
