"""Base of the writers of sweeps, and what their files share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np

from .sweep import Sweep, SweepPlace


class SweepWriter(ABC):
    """Base of writers that take a scan's sweeps in their order and are closed in the end.

    Args:
        path: of the file or folder that is written.
        place: what the sweeps have in common.
    """

    def __init__(self, path: Path, place: SweepPlace) -> None:
        self.path, self.place = path, place
        self._open()

    def _open(self) -> None:  # noqa: B027 (not every format has something to begin with)
        """Begin the files."""

    @abstractmethod
    def write(self, sweep: Sweep) -> None:
        """Write a sweep."""

    @abstractmethod
    def close(self) -> None:
        """Write what is known at the end only."""


def write_velodyne(path: Path, sweep: Sweep) -> None:
    """Write the points of a sweep as KITTI's ``.bin``: x, y, z, m, and remission, 0 to 1, of four bytes each."""
    np.column_stack([sweep.xyz, sweep.remission]).astype("<f4").tofile(path)


def numbers_text(values: object) -> str:
    """Return numbers as KITTI's text files have them, in 13 digits: a place of 1000 km is right to a nanometre."""
    return " ".join(f"{value:.12e}" for value in np.asarray(values, dtype=np.float64).ravel())
