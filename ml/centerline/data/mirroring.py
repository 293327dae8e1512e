"""Batches with left and right swapped."""

from __future__ import annotations

from torch import Tensor

from .corridor import CORRIDOR
from .slices import Batch

_OTHER_SIDE = {"left_edge": "right_edge", "right_edge": "left_edge"}
_TURNED = ("left_edge", "right_edge", "heading")
"""Columns of the corridor whose sign changes."""


def mirror_batch(batch: Batch) -> Batch:
    """Return a batch with left and right swapped, truth and frames included."""
    flip = batch["coord"].new_tensor([1.0, -1.0, 1.0])
    other = dict(batch, coord=batch["coord"] * flip)
    other["frame"] = batch["frame"] * batch["frame"].new_tensor([1.0, -1.0, -1.0, 1.0])
    if "center" in batch:
        other["center"] = -batch["center"]
    if "corridor" in batch:
        other["corridor"] = mirrored_corridor(batch["corridor"])
    return other


def mirrored_corridor(corridor: Tensor) -> Tensor:
    """Return the corridor (..., K) of the mirrored road."""
    signs = corridor.new_tensor([-1.0 if name in _TURNED else 1.0 for name in CORRIDOR])
    return with_sides_swapped(corridor) * signs


def with_sides_swapped(corridor: Tensor) -> Tensor:
    """Return values (..., K) by column of the corridor, those of the left and the right edge exchanged."""
    return corridor[..., [CORRIDOR.index(_OTHER_SIDE.get(name, name)) for name in CORRIDOR]]
