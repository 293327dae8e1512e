"""Agreement of a model with itself: the same points labelled from two directions, compared without any true label."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from synthroads_addon.base.arrays import Float, Int
from synthroads_addon.base.random_streams import stream
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.tools.quantile_mapping import LEVELS

from ..choice import SQUARE
from ..data.classes import IGNORED, class_names
from ..data.points import voxel_sample
from ..data.sources import FULL
from ..data.tiles import CloudTile, eight_bits, scalings
from ..runs import Run
from ..scores.confusion import Confusion
from .recipes import SegmentationConfiguration
from .scoring import classifier, label_tile, trained_model, turn_tile

SQUARES = 6
"""Most squares of a cloud that are labelled. Chosen: some seconds of work."""
ENOUGH_POINTS = 400_000
"""Points after which no further square is drawn. Chosen: bounds memory and time."""
_BLOCK = 1_000_000
"""Points that are read at once. Chosen: bounds memory."""


def self_agreement(run: Run[SegmentationConfiguration], sample: CloudTile) -> float:
    """Return how far a model gives the points of a sample the same classes when it sees them turned and mirrored.

    Each time by a single view: the mean of several ones agrees with itself whether or not it is right.

    Measured as Cohen's kappa (1960), the agreement beyond chance: a model that takes all points for one class has 0.

    Args:
        run: trained model.
        sample: N points; their labels aren't looked at.
    """
    configuration = run.configuration
    settings = replace(configuration.crop_settings(), votes=1)
    scaling = scalings([sample], configuration.intensity, configuration.voxel)[sample.scene]
    scores = classifier(trained_model(run), configuration)
    thinned = sample.select(voxel_sample(sample.coord, configuration.voxel))
    first_view, second_view = (label_tile(turn_tile(thinned, view), scaling, scores, settings) for view in (0, 1))
    confusion = Confusion(class_names(configuration.scheme()))
    confusion.add(first_view, second_view)
    return _kappa(confusion.counts)


def _kappa(counts: Int) -> float:
    """Return Cohen's kappa of a confusion (C, C): (p_o - p_e) / (1 - p_e); 0 if chance alone explains all, p_e = 1."""
    shares = counts / counts.sum()
    observed = float(np.trace(shares))
    expected = float(shares.sum(axis=0) @ shares.sum(axis=1))
    return (observed - expected) / (1.0 - expected) if expected < 1.0 else 0.0


def sample_cloud(path: Path, squares: Mapping[tuple[int, int], int], seed: int = 0) -> CloudTile:
    """Return the usable points of some squares of a cloud, drawn with their numbers of points as weights.

    Args:
        path: cloud file of any size; it is read once.
        squares: numbers of its usable points by column and row of squares of `SQUARE` m (`CloudTraits.squares`).
        seed: of the draw.

    Raises:
        InputError: it can't be read.
    """
    drawn = np.array(_draw_squares(squares, stream(seed, "self-agreement")))
    parts = []
    with open_cloud(path) as cloud:
        scale, has_color = cloud.header.intensity_scale or 1.0, cloud.header.has_color
        for block in cloud.usable_blocks(_BLOCK):
            is_drawn = (_square_of(block.xyz)[:, None, :] == drawn[None, :, :]).all(axis=2).any(axis=1)
            parts.append(block.select(is_drawn))
    xyz, rgb = np.concatenate([part.xyz for part in parts]), np.concatenate([part.rgb for part in parts])
    levels = np.clip(np.rint(np.concatenate([part.intensity for part in parts]) * scale), 0, LEVELS - 1)
    origin = np.floor(xyz.min(axis=0))
    return CloudTile(
        "sample",
        origin,
        (xyz - origin).astype(np.float32),
        eight_bits(rgb) if has_color and rgb.any() else None,
        (levels / FULL).astype(np.float32) if levels.any() else None,
        np.full(len(xyz), IGNORED, dtype=np.int16),
    )


def _draw_squares(counts: Mapping[tuple[int, int], int], generator: np.random.Generator) -> list[tuple[int, int]]:
    """Return at most `SQUARES` squares in the order drawn, up to the one with which `ENOUGH_POINTS` are met."""
    squares = sorted(counts)
    weights = np.array([counts[square] for square in squares], dtype=np.float64)
    rows = generator.choice(len(squares), min(SQUARES, len(squares)), replace=False, p=weights / weights.sum())
    drawn: list[tuple[int, int]] = []
    for row in rows:
        if sum(counts[square] for square in drawn) >= ENOUGH_POINTS:
            break
        drawn.append(squares[row])
    return drawn


def _square_of(xyz: Float) -> Int:
    """Return the column and row (N, 2) of the square of `SQUARE` m that each point lies in."""
    return np.floor(xyz[:, :2] / SQUARE).astype(np.int64)
