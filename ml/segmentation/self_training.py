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
from .loading import drop_slivers, thin_tiles
from .recipes import SegmentationConfiguration
from .scoring import Classifier, piece_scores


def target_tiles(configuration: SegmentationConfiguration) -> list[CloudTile]:
    """Read the thinned tiles of the target domain, without labels; labels that their files hold aren't looked at.

    Raises:
        MissingFileError, InputError: there are none, they are damaged, or hold no points.
    """
    thin_tiles_of_target = thin_tiles(configuration.data.target, configuration, "target", labels=False)
    tiles = drop_slivers(list(thin_tiles_of_target), configuration)
    if not tiles:
        raise InputError("data.target", 0, "must hold points for the training")
    return tiles


def label_confident_points(
    tiles: Sequence[CloudTile], classifier: Classifier, configuration: SegmentationConfiguration
) -> list[CloudTile]:
    """Return tiles labelled where a network is surest: of each class the same share of the points predicted as it.

    Args:
        tiles: thinned tiles; their labels aren't used.
        classifier: function that returns the network's scores.
        configuration: configuration of the training; ``self_training.believed`` is the share.
    """
    scaling = scalings(tiles, configuration.intensity)
    labels, sureness = [], []
    for tile in tiles:
        label, probability = np.zeros(len(tile), dtype=np.int16), np.zeros(len(tile), dtype=np.float32)
        for indices, scores in piece_scores(tile, scaling[tile.scene], classifier, configuration.crop_settings()):
            best_class = scores.float().softmax(dim=1).max(dim=1)
            label[indices], probability[indices] = best_class.indices.cpu().numpy(), best_class.values.cpu().numpy()
        labels.append(label)
        sureness.append(probability)
    thresholds = _thresholds(np.concatenate(labels), np.concatenate(sureness), configuration)
    return [
        replace(tile, segment=np.where(probability >= thresholds[label], label, IGNORED).astype(np.int16))
        for tile, label, probability in zip(tiles, labels, sureness, strict=True)
    ]


def _thresholds(labels: AnyArray, sureness: Float32, configuration: SegmentationConfiguration) -> Float32:
    """Return each class's least probability (C,) for its label to be kept; 2, which none reaches, without points."""
    thresholds = np.full(len(class_names(configuration.scheme())), 2.0, dtype=np.float32)
    for class_index in np.unique(labels):
        thresholds[class_index] = np.quantile(
            sureness[labels == class_index], 1.0 - configuration.self_training.believed
        )
    return thresholds
