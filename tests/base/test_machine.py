"""Memory that is free goes back to the system, also from below what is still in use."""

from __future__ import annotations

import ctypes
import platform

import pytest

from synthroads_addon.base.machine import release_memory
from tests.helpers.process_memory import STATUS, memory_mb

BLOCK, COUNT = 64 << 10, 2500
"""Bytes of a block, less than glibc asks the system for by itself, and how many there are: 160 MB."""


@pytest.mark.skipif(not STATUS.exists() or platform.libc_ver()[0] != "glibc", reason="glibc keeps what is freed")
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
