"""The machine that something was measured on, in words."""

import ctypes
import mmap
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import cast

import numpy as np
from threadpoolctl import threadpool_limits

LEAST_MEMORY = 128 << 20
"""Bytes of memory without which no command is begun."""
_TRIM_THRESHOLD, _TOP_PAD, _MMAP_THRESHOLD = -1, -2, -3
"""Numbers of malloc's parameters (malloc.h): free bytes at the top that are given back, bytes asked for beyond what is
needed, and size from which a block is a mapping of its own."""
_LARGEST_THRESHOLD = 32 << 20
_KEEPING = {_MMAP_THRESHOLD: _LARGEST_THRESHOLD, _TRIM_THRESHOLD: 1 << 30, _TOP_PAD: 64 << 20}
_USUAL = {_MMAP_THRESHOLD: _LARGEST_THRESHOLD, _TRIM_THRESHOLD: 2 * _LARGEST_THRESHOLD, _TOP_PAD: 128 << 10}
"""Values that glibc comes to by itself where large blocks are freed: once any is set it no longer adapts them."""


def machine(versions: Mapping[str, str]) -> str:
    """Return the machine in words: processor, usable cores, and versions of programs by their names."""
    programs = ", ".join(f"{name} {version}" for name, version in versions.items())
    return f"{_processor()}, {available_cores()} cores; {programs}"


def available_cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def share_of_core(seconds: float = 0.1) -> float:
    """Return the share of a core, 0 to 1, that one thread gets now beside what else runs, by working for some time."""
    wall_start, thread_start = time.perf_counter(), time.thread_time()
    while (elapsed := time.perf_counter() - wall_start) < seconds:
        pass
    return min(1.0, max(0.01, (time.thread_time() - thread_start) / elapsed))


def free_cores(threads: int, share: float) -> float:
    """Return how many cores' work some threads get done beside what else runs.

    Args:
        threads: that work.
        share: of a core that one of them got by itself, see `share_of_core`; from 0.95 on nothing else is assumed.
    """
    cores = available_cores()
    other_threads = cores / share - 1.0 if share < 0.95 else 0.0  # threads that want as much
    return min(float(min(threads, cores)), cores * threads / (threads + other_threads))


@contextmanager
def cores_of_children(count: int) -> Iterator[None]:
    """Context in which processes that are begun may use so many cores of this one's; all where the system can't say."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed_cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(allowed_cores)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed_cores)


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


class _Shared:
    """Setting of the whole process that several may hold at a time: the first makes it, the last undoes it.

    Args:
        make: makes the setting; returns what undoes it.
    """

    def __init__(self, make: Callable[[], Callable[[], None]]) -> None:
        self._make, self._undo = make, _nothing
        self._lock, self._holders = Lock(), 0

    @contextmanager
    def held(self) -> Iterator[None]:
        """Context in which the setting is made."""
        with self._lock:
            if self._holders == 0:
                self._undo = self._make()
            self._holders += 1
        try:
            yield
        finally:
            with self._lock:
                self._holders -= 1
                if self._holders == 0:
                    self._undo()


def _nothing() -> None:
    """Do nothing."""


def _limit_linear_algebra() -> Callable[[], None]:
    """Have the linear algebra that is loaded take one thread; return what gives it those back that it had."""
    limit = threadpool_limits(1, user_api="blas")
    return cast(Callable[[], None], limit.restore_original_limits)


def _keep_freed_memory() -> Callable[[], None]:
    """Have the C library keep freed memory, where it can; return what has it given back, now and from now on."""
    _set_malloc(_KEEPING)
    used_huge_pages = _set_huge_pages(False)

    def give_back() -> None:
        """Restore the C library's usual settings, and give what is free back to the system."""
        _set_huge_pages(used_huge_pages)
        _set_malloc(_USUAL)
        release_memory()

    return give_back


def _set_huge_pages(enabled: bool) -> bool:
    """Have NumPy ask the system for huge pages for large arrays, or not, where it can; return whether it did before."""
    with suppress(ImportError, AttributeError):  # NumPy's own switch, which is also NUMPY_MADVISE_HUGEPAGE
        return bool(import_module("numpy._core.multiarray")._set_madvise_hugepage(enabled))
    return enabled


def _set_malloc(values: Mapping[int, int]) -> None:
    """Set parameters of glibc's malloc, by their numbers; do nothing where there is another C library."""
    with suppress(OSError, AttributeError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        for parameter, value in values.items():
            mallopt(parameter, value)


def _limit_with_scipy() -> Callable[[], None]:
    """Do the same once SciPy's linear algebra is loaded: it has a library of its own, which can't be limited before."""
    import_module("scipy.linalg")
    return _limit_linear_algebra()


_one_thread, _scipy_too = _Shared(_limit_linear_algebra), _Shared(_limit_with_scipy)
_kept_memory = _Shared(_keep_freed_memory)


@contextmanager
def linear_algebra_on_one_thread(scipy: bool = False) -> Iterator[None]:
    """Context, also a decorator, in which linear algebra of NumPy, and of SciPy if asked, begins no threads of its own.

    For work whose result is written: sums over several threads have other last bits on machines with other cores. And
    for work that is shared out to threads: after each product OpenBLAS's threads keep a core busy for a while, waiting
    for the next. Threads may hold it side by side. Other linear algebra in the process, but for PyTorch's, is limited
    meanwhile as well.

    Args:
        scipy: the work uses SciPy, which is loaded beforehand: a quarter of a second of processor time, and 11 MB,
            which other work needn't spend. What is loaded of it already is limited in any case.
    """
    with _one_thread.held(), _scipy_too.held() if scipy else nullcontext():
        yield


@contextmanager
def freed_memory_kept() -> Iterator[None]:
    """Context in which freed memory is kept for what comes next, for work that takes and frees large arrays in turns.

    The system clears each page that it hands out, and page faults are dear. In the end all that is free is given back.
    NumPy asks for no huge pages meanwhile: 2 MB that are handed out at once are cleared at once, however little of them
    is used, and in a virtual machine they may have to be fetched from its host.
    Threads may hold it side by side. It does something where the C library is glibc, or NumPy asks for huge pages.
    """
    with _kept_memory.held():
        yield


def _processor() -> str:
    """Return the name of the processor, as the system tells it."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())
