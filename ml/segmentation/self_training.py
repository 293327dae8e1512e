"""Labels of unlabelled clouds for self-training: those that a network is surest of.

They are learned as if they were true, beside synthetic points whose labels are true. Zou et al., "Unsupervised domain
adaptation for semantic segmentation via class-balanced self-training" (2018): of each class as large a share is
believed, or the easy ones alone would be left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from synthroads_addon.base.arrays import AnyArray, Float32
from synthroads_addon.base.errors import InputError

from ..data.classes import IGNORED, class_names
from ..data.tiles import CloudTile, scalings
from .loading import large_enough, thin_tiles
from .recipes import SegmentationConfiguration
from .scoring import Classifier, piece_scores


def target_tiles(configuration: SegmentationConfiguration) -> list[CloudTile]:
    """Read the thinned tiles of the target domain, without labels; labels that their files hold aren't looked at.

    Raises:
        MissingFileError, InputError: there are none, they are damaged, or hold no points.
    """
    thinned = thin_tiles(configuration.data.target, configuration, "target", labels=False)
    tiles = large_enough(list(thinned), configuration)
    if not tiles:
        raise InputError("data.target", 0, "must hold points for the training")
    return tiles


def believed_labels(
    tiles: Sequence[CloudTile], classifier: Classifier, configuration: SegmentationConfiguration
) -> list[CloudTile]:
    """Return tiles labelled by a network where it is surest: of the points that it calls a class, that class's share.

    Args:
        tiles: thinned ones, whose labels aren't looked at.
        classifier: scores of the network.
        configuration: of the training; ``self_training.believed`` is the share.
    """
    scaling = scalings(tiles, configuration.intensity)
    labels, sureness = [], []
    for tile in tiles:
        label, sure = np.zeros(len(tile), dtype=np.int16), np.zeros(len(tile), dtype=np.float32)
        for inside, scores in piece_scores(tile, scaling[tile.scene], classifier, configuration.crop_settings()):
            largest = scores.float().softmax(dim=1).max(dim=1)
            label[inside], sure[inside] = largest.indices.cpu().numpy(), largest.values.cpu().numpy()
        labels.append(label)
        sureness.append(sure)
    least = _thresholds(np.concatenate(labels), np.concatenate(sureness), configuration)
    return [
        replace(tile, segment=np.where(sure >= least[label], label, IGNORED).astype(np.int16))
        for tile, label, sure in zip(tiles, labels, sureness, strict=True)
    ]


def _thresholds(labels: AnyArray, sureness: Float32, configuration: SegmentationConfiguration) -> Float32:
    """Return for each class (C,) the probability from which its label is believed; 2, which none has, without any."""
    least = np.full(len(class_names(configuration.scheme())), 2.0, dtype=np.float32)
    for place in np.unique(labels):
        least[place] = np.quantile(sureness[labels == place], 1.0 - configuration.self_training.believed)
    return least
