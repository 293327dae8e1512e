"""Offsets of the class scores by which a trained network reaches its best mean IoU on what it has learned from.

The likeliest class of a point is hardly ever a rare one: a network that knows how rare markings are in a sweep finds
none, and one that learned with weights finds them where none are. The best thresholds lie between.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from synthroads_addon.base.arrays import Float, Float32, Int
from synthroads_addon.base.random_streams import stream

from ..data.classes import IGNORED
from ..data.crops import change_tile
from ..data.tiles import CloudTile, scalings
from ..scores.confusion import Confusion
from .recipes import SegmentationConfiguration
from .scoring import Classifier, piece_scores

MOST_POINTS = 2_000_000
"""Points that offsets are fitted to; of more tiles every n-th is taken. Chosen: more move no threshold."""
_STEPS = (1.0, 0.5, 0.25)
"""Changes of an offset that are tried, largest first, in natural logarithms of odds. Chosen: the last is a factor of
1.3."""
_LEAST_GAIN = 1e-4
"""Gain in mean IoU for which an offset is changed: less is chance."""


def fit_offsets(tiles: Sequence[CloudTile], classifier: Classifier, configuration: SegmentationConfiguration) -> Float:
    """Return the offsets (C,) of the classes' scores by which the mean IoU over thinned, labelled tiles is largest.

    Tiles are cut to strips and lit as at random in the training: what is rare in scenes isn't in strips.

    Args:
        tiles: thinned training tiles.
        classifier: function that returns the trained network's scores.
        configuration: configuration of the training.
    """
    stride = -(-sum(map(len, tiles)) // MOST_POINTS)
    sampled_tiles = tiles[::stride]
    scaling = scalings(tiles, configuration.intensity)
    # By one view thresholds hardly differ, and it takes a part of the time.
    settings = replace(configuration.crop_settings(), votes=1)
    scores: list[Float32] = []
    truth: list[Int] = []
    for number, whole_tile in enumerate(sampled_tiles):
        tile = change_tile(whole_tile, settings, configuration.effects, stream(configuration.seed, "offsets", number))
        # A tile that was changed is scaled by what it has, as in the training.
        own_scaling = scaling if tile is whole_tile else scalings([tile], configuration.intensity)
        for indices, piece_score in piece_scores(tile, own_scaling[tile.scene], classifier, settings):
            has_label = tile.segment[indices] != IGNORED
            scores.append(piece_score.float().cpu().numpy()[has_label])
            truth.append(tile.segment[indices][has_label].astype(np.int64))
    return best_offsets(np.concatenate(scores), np.concatenate(truth))


def best_offsets(scores: Float32, truth: Int) -> Float:
    """Return the offsets (C,) at which the mean IoU of the largest scores (N, C) against true classes (N,) is largest.

    Coordinate ascent: one class's offset changes at a time, by ever smaller steps. Classes without a point keep 0.
    """
    present_classes = np.unique(truth)
    offsets = np.zeros(scores.shape[1])
    best_iou = _mean_iou(scores, truth)
    for step in _STEPS:
        improved = True
        while improved:
            improved = False
            for class_index in present_classes:
                for change in (step, -step):
                    trial_offsets = offsets.copy()
                    trial_offsets[class_index] += change
                    trial_iou = _mean_iou(scores + trial_offsets.astype(np.float32), truth)
                    if trial_iou > best_iou + _LEAST_GAIN:
                        offsets, best_iou, improved = trial_offsets, trial_iou, True
    return offsets


def _mean_iou(scores: Float32, truth: Int) -> float:
    """Return the mean IoU of the classes of largest scores (N, C) against true classes (N,)."""
    confusion = Confusion([str(class_index) for class_index in range(scores.shape[1])])
    confusion.add(truth, scores.argmax(axis=1))
    return confusion.mean("iou")
