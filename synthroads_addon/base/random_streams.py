"""Random numbers keyed by what they are for, so that no result depends on order, worker or time."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, *purpose: str | int) -> np.random.Generator:
    """Return the generator of one purpose, e.g. ``stream(seed, "range noise", strip, block)``.

    The same seed and purpose give the same numbers on every machine (PCG64 seeded by `SeedSequence`).
    """
    key = [zlib.crc32(part.encode()) if isinstance(part, str) else int(part) for part in purpose]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([int(seed), *key])))
