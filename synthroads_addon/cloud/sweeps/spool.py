"""`SweepSpool`: sweeps kept on disk until all are there, and read back in their order.

A long road is scanned by sections, each with parts of several strips: sweeps come in the order of the sections, and
their files number them by strip and time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import AnyArray
from ...base.scratch.folders import scratch_folder
from ..points import make_block
from .sweep import Box, Sweep

_OPTIONAL = ("seen", "seen_centre", "seen_size")
"""Attributes of a box that may be None: kept as not a number."""
_NUMBERS = ("number", "strip", "number_in_strip", "begin", "end")
_ARRAYS = ("position", "rotation", "xyz", "remission", "class_id")
_POINTS, _BOXES = "points.", "boxes."


class SweepSpool:
    """Scratch files of sweeps, one each.

    Args:
        folder: where they are kept meanwhile; a folder in it is made, and removed by `close`.
    """

    def __init__(self, folder: Path) -> None:
        self._scratch = ExitStack()
        self._folder = self._scratch.enter_context(scratch_folder(folder))
        self._keys: list[tuple[int, int]] = []

    def keep(self, sweep: Sweep) -> None:
        """Write a sweep."""
        arrays: dict[str, Any] = {name: getattr(sweep, name) for name in (*_NUMBERS, *_ARRAYS)}
        arrays |= {f"{_POINTS}{name}": array for name, array in sweep.points.attributes().items()}
        arrays |= {f"{_BOXES}{name}": array for name, array in _box_arrays(sweep.boxes).items()}
        key = (sweep.strip, sweep.number_in_strip)
        self._keys.append(key)
        np.savez(self._file(key), **arrays)

    def sweeps(self) -> Iterator[Sweep]:
        """Yield the sweeps by strip and time, and remove their files."""
        for key in sorted(self._keys):
            with np.load(self._file(key), allow_pickle=False) as data:
                arrays = dict(data)
            self._file(key).unlink()
            yield Sweep(
                **{name: arrays[name].item() for name in _NUMBERS},
                **{name: arrays[name] for name in _ARRAYS},
                points=make_block(**_of(arrays, _POINTS)),
                boxes=tuple(_boxes(_of(arrays, _BOXES))),
            )
        self._keys = []

    def close(self) -> None:
        """Remove what is left."""
        self._scratch.close()

    def _file(self, key: tuple[int, int]) -> Path:
        """Return the file of a sweep by strip and number in it."""
        return self._folder / f"{key[0]}_{key[1]}.npz"


def _of(arrays: dict[str, AnyArray], prefix: str) -> dict[str, AnyArray]:
    """Return the arrays whose names begin with a prefix, without it."""
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


def _box_arrays(boxes: tuple[Box, ...]) -> dict[str, AnyArray]:
    """Return the attributes of B boxes as arrays (B, ...); empty where there are none."""
    if not boxes:
        return {}
    empty = {"seen": np.nan, "seen_centre": np.full(3, np.nan), "seen_size": np.full(3, np.nan)}
    rows = [{**vars(box), **{name: empty[name] for name in _OPTIONAL if vars(box)[name] is None}} for box in boxes]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _boxes(arrays: dict[str, AnyArray]) -> Iterator[Box]:
    """Yield the boxes of arrays as `_box_arrays` returns them."""
    for row in range(len(next(iter(arrays.values()), ()))):
        values = {name: array[row] for name, array in arrays.items()}
        plain = {name: value.item() if value.ndim == 0 else value for name, value in values.items()}
        yield Box(**plain | {name: None for name in _OPTIONAL if np.isnan(plain[name]).any()})
