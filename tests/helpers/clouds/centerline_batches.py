"""Batches of slices over analytic roads, and small models, for tests of what learns from them."""

from __future__ import annotations

from functools import cache
from typing import Any

import torch

from ml.data.effects import SequenceEffects
from ml.data.slices import Batch, SliceDataset, SliceSettings, collate
from ml.networks.centerline.models import CenterlineModel
from ml.registry import networks
from tests.helpers.roads import analytic_roads

torch.set_num_threads(1)

SETTINGS = SliceSettings(half_width=20.0, points_per_slice=128)
MODELS = ("single", "sequence", "transformer")


@cache
def dataset(effects: SequenceEffects | None = None, seed: int = 7) -> SliceDataset:
    return SliceDataset(analytic_roads.roads(), SETTINGS, 32, seed, effects)


def batch(count: int = 4, effects: SequenceEffects | None = None) -> Batch:
    """Return the first sequences of the data set."""
    return collate([dataset(effects)[number] for number in range(count)])


def small(name: str, **changes: Any) -> CenterlineModel:
    """Return a small model with weights that are always the same."""
    torch.manual_seed(3)
    options = {"cells": 4, "point_width": 8, "width": 16, "context": 16, "layers": 1, "heads": 2, "fine_width": 8}
    return networks("centerline")[name](**(options | changes)).build(SETTINGS.half_width, SETTINGS.slices)


def moved(one: Batch, by: float) -> Batch:
    """Return a batch whose points and truth lie farther to the left, m."""
    corridor = one["corridor"].clone()
    corridor[..., :2] += by
    coord = one["coord"] + torch.tensor([0.0, by, 0.0])
    return dict(one, coord=coord, center=one["center"] + by, corridor=corridor)


def select(one: Batch, numbers: slice) -> Batch:
    return {name: values[numbers] for name, values in one.items()}


__all__ = ["MODELS", "SETTINGS", "batch", "dataset", "moved", "select", "small"]
