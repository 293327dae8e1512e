"""Memory that is free goes back to the system, also from below what is still in use; a scan keeps it meanwhile."""

from __future__ import annotations

import ctypes
import mmap
import platform
import resource
import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest

from synthroads_addon.base.machine import freed_memory_kept, release_memory
from tests.helpers.process_memory import STATUS, memory_mb

BLOCK, COUNT = 64 << 10, 2500
"""Bytes of a block, less than glibc asks the system for by itself, and how many there are: 160 MB."""


glibc = pytest.mark.skipif(not STATUS.exists() or platform.libc_ver()[0] != "glibc", reason="glibc keeps what is freed")


@glibc
def test_memory_below_what_is_in_use_is_released() -> None:
    library = ctypes.CDLL(None)
    library.malloc.restype, library.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    library.free.argtypes = [ctypes.c_void_p]
    blocks = [library.malloc(BLOCK) for _ in range(COUNT)]
    for block in blocks:
        ctypes.memset(block, 1, BLOCK)
    last = library.malloc(BLOCK)
    try:
        for block in blocks:
            library.free(block)
        kept = memory_mb()
        release_memory()
        assert memory_mb() < kept - 0.8 * COUNT * BLOCK / 1e6
    finally:
        library.free(last)


def page_faults() -> int:
    """Return how many pages the system has handed out to this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt


def use_and_free() -> int:
    """Use 120 MB in arrays of 20 MB and free them; return the page faults."""
    before = page_faults()
    arrays = [np.ones(20 << 20, np.uint8) for _ in range(6)]
    del arrays
    return page_faults() - before


@glibc
def test_what_is_freed_is_used_again_meanwhile_and_given_back_in_the_end() -> None:
    pages = (120 << 20) // mmap.PAGESIZE
    before = memory_mb()
    with freed_memory_kept():
        use_and_free()
        with freed_memory_kept():  # as another scan beside this one
            pass
        assert sum(use_and_free() for _ in range(10)) < 0.1 * pages
        assert memory_mb() > before + 100.0
    assert memory_mb() < before + 10.0
    use_and_free()
    assert memory_mb() < before + 70.0  # no more than the C library keeps by itself


def asks_for_huge_pages() -> bool:
    """Return whether NumPy asks the system for huge pages for large arrays."""
    return bool(import_module("numpy._core.multiarray")._get_madvise_hugepage())


@pytest.mark.parametrize("usual", [True, False])
def test_no_huge_pages_are_asked_for_meanwhile(usual: bool) -> None:
    set_huge_pages = import_module("numpy._core.multiarray")._set_madvise_hugepage
    before = set_huge_pages(usual)
    try:
        with freed_memory_kept():
            with freed_memory_kept():
                assert not asks_for_huge_pages()
            assert not asks_for_huge_pages()
        assert asks_for_huge_pages() == usual
    finally:
        set_huge_pages(before)


IN_CONTEXT = """
import sys
from threadpoolctl import threadpool_info
from synthroads_addon.base.machine import linear_algebra_on_one_thread

with linear_algebra_on_one_thread({}):
    threads = {{library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}}
    print(sorted(threads), "scipy.linalg" in sys.modules)
"""


@pytest.mark.parametrize("scipy", [False, True])
def test_scipy_is_loaded_only_for_work_that_uses_it(scipy: bool) -> None:
    """A scan uses none, and its process needn't spend the time and the memory."""
    words = [sys.executable, "-c", IN_CONTEXT.format(f"scipy={scipy}")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[1]", str(scipy)]
