"""Crops of two domains with parts of each other in them.

Saltori et al., "CoSMix: compositional semantic mix for domain adaptation in 3D LiDAR segmentation" (2022): points of
some classes are laid into the other domain's crop, so that the surroundings don't tell a network which domain it is in.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from synthroads_addon.base.arrays import Bool
from synthroads_addon.base.random_streams import stream

from .classes import IGNORED
from .crops import CropDataset, Item, centre_coordinates, make_item
from .samples import Crop


@dataclass(frozen=True)
class ExchangedCrops:
    """Pairs of crops, a synthetic and a target one, each with points of some of the other's classes laid into it.

    Attributes:
        synthetic, target: the crops of an epoch, as many of each.
        seed, epoch: key of the random choice of classes.
    """

    synthetic: CropDataset
    target: CropDataset
    seed: int
    epoch: int

    def __len__(self) -> int:
        return len(self.synthetic)

    def __getitem__(self, pair_index: int) -> list[Item]:
        """Return the pair at a place as two items."""
        synthetic_crop, random = self.synthetic.crop(pair_index)
        target_crop, _ = self.target.crop(pair_index)
        pair = exchange_classes(synthetic_crop, target_crop, stream(self.seed, "exchange", self.epoch, pair_index))
        return [make_item(crop, self.synthetic.settings, random) for crop in pair]


def exchange_classes(one: Crop, other_crop: Crop, random: np.random.Generator) -> tuple[Crop, Crop]:
    """Return two crops, centred, each with the points of a random half of the other's classes added."""
    centred_pair = [replace(crop, coord=centre_coordinates(crop.coord)) for crop in (one, other_crop)]
    class_masks = [_random_classes(crop, random) for crop in centred_pair]
    first_crop, second_crop = centred_pair
    return _append_points(first_crop, second_crop, class_masks[1]), _append_points(
        second_crop, first_crop, class_masks[0]
    )


def _random_classes(crop: Crop, random: np.random.Generator) -> Bool:
    """Return a mask (N,) of the points of a random half of a crop's classes, at least one where it has any."""
    present_classes = np.unique(crop.segment[crop.segment != IGNORED])
    chosen_classes = random.permutation(present_classes)[: -(-len(present_classes) // 2)]
    return np.asarray(np.isin(crop.segment, chosen_classes))


def _append_points(crop: Crop, other_crop: Crop, keep: Bool) -> Crop:
    """Return a crop with some of another's points appended; attributes that either lacks are None."""
    parts: dict[str, Any] = {}
    for name in crop.per_point:
        values, other_values = getattr(crop, name), getattr(other_crop, name)
        parts[name] = None if values is None or other_values is None else np.concatenate([values, other_values[keep]])
    return replace(crop, **parts)
