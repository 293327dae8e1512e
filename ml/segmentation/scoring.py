"""From the network's points back to all points: pieces with overlap, and voxels' classes carried to the full cloud."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor, nn

from synthroads_addon.base.arrays import Bool, Float, Float32, Index
from synthroads_addon.base.classes import ClassScheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.random_streams import stream

from ..data.classes import IGNORED, class_names
from ..data.crops import CropSettings, Item, crop_of, make_item
from ..data.points import voxel_sample
from ..data.sources import Source, read_tiles
from ..data.tiles import CloudTile, Scaling, scalings
from ..data.workers import report_lost_workers
from ..runs import NOT_FINITE, Run, load_state
from ..scores.confusion import Confusion
from ..training_loop import chosen_device, move_to_device
from .loading import adaptation_batches, thin_tiles
from .network import adapt_network, build, gpu_prepares, prepare_on_gpu, scores_of
from .recipes import SegmentationConfiguration

EDGE = 24.0
"""Edge of the pieces that are predicted at a time, m: about as wide as a crop of training."""
MARGIN = 4.0
"""Width that is seen around a piece, m. Chosen: what lies farther off says little of a point."""
LARGEST = 100_000
"""Points of a piece, margin included; what has more is cut in four, down to `_SMALLEST_EDGE`. Chosen: bounds memory."""
_SMALLEST_EDGE = 1.5
"""Edge of the smallest pieces, m. Chosen: a smaller one shows no shape."""
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""Angle from one view to the next, rad: however many there are, they point to all sides."""

Classifier = Callable[[Item], torch.Tensor]
"""Turns a batch of one item into the scores of its points."""


def overlapping_pieces(
    plan: NDArray[np.floating[Any]],
    core_mask: Bool | None = None,
    edge: float = EDGE,
    margin: float = MARGIN,
    largest: int = LARGEST,
) -> Iterator[tuple[Index, Index]]:
    """Yield square pieces of a tile as (indices of the points within, indices of these and of the points around).

    Every point of the core lies within exactly one piece.

    Args:
        plan: (N, 2) m.
        core_mask: (N,) mask of the points to lie within pieces, the others being context; None for all.
        edge: edge of the squares, m.
        margin: width of the context around a square, m.
        largest: largest number of points of a piece with its context; squares with more are cut in four.
    """
    members = np.arange(len(plan)) if core_mask is None else np.flatnonzero(core_mask)
    if len(members) == 0:
        return
    position = np.asarray(plan, dtype=np.float64)

    def cut(members: Index, candidates: Index, low: Float, edge: float, margin: float) -> Iterator[tuple[Index, Index]]:
        """Yield the pieces in squares of a grid from a corner on, recursively smaller where points are many."""
        cells = np.floor((position[members] - low) / edge).astype(np.int64)
        for cell in np.unique(cells, axis=0):
            core = members[np.all(cells == cell, axis=1)]
            square_corner = low + cell * edge
            candidate_positions = position[candidates]
            visible_points = candidates[
                np.all(
                    (candidate_positions >= square_corner - margin)
                    & (candidate_positions < square_corner + edge + margin),
                    axis=1,
                )
            ]
            if len(visible_points) > largest and edge / 2 >= _SMALLEST_EDGE:
                yield from cut(core, visible_points, square_corner, edge / 2, min(margin, edge / 2))
            else:
                yield core, visible_points

    yield from cut(members, np.arange(len(plan)), position[members].min(axis=0), edge, margin)


def label_tile(
    tile: CloudTile,
    scaling: Scaling,
    classifier: Classifier,
    settings: CropSettings,
    core: Bool | None = None,
    seed: int = 0,
) -> NDArray[np.int16]:
    """Return the predicted class of each (core) point of a tile, (N,): predicted per voxel, carried to all points.

    Args:
        tile: N points of any density; its labels aren't looked at.
        scaling: scaling of the tile's intensities.
        classifier: scores (n, C) of a batch.
        settings: voxel and features.
        core: (N,) mask of the points to label; None for all.
        seed: seed of the noise that stands for missing features.
    """
    voxel_points = voxel_sample(tile.coord, settings.voxel)
    thinned_tile = tile.select(voxel_points)
    needed_rows = _needed_points(thinned_tile.coord, tile.coord, core, settings.voxel)
    labels = np.zeros(len(thinned_tile), dtype=np.int16)
    for indices, scores in piece_scores(thinned_tile, scaling, classifier, settings, needed_rows, seed):
        labels[indices] = scores.argmax(dim=1).cpu().numpy()
    return nearest_labels(
        thinned_tile.coord[needed_rows], labels[needed_rows], tile.coord if core is None else tile.coord[core]
    )


def piece_scores(
    tile: CloudTile,
    scaling: Scaling,
    classifier: Classifier,
    settings: CropSettings,
    core_mask: Bool | None = None,
    seed: int = 0,
) -> Iterator[tuple[Index, Tensor]]:
    """Yield the class scores (n, C) of a thinned tile's points, piece by piece, with the points' indices (n,).

    With several votes the scores are logarithms of the views' mean probabilities, of all points at once.

    Args:
        tile: N points, one per voxel; its labels aren't looked at.
        scaling, classifier, settings, seed: see `label_tile`.
        core_mask: (N,) mask of the points to score; None for all.
    """
    tile = replace(tile, segment=np.full(len(tile), IGNORED, dtype=np.int16))
    if settings.votes == 1:
        yield from _view_scores(tile, scaling, classifier, settings, core_mask, seed)
        return
    total: Tensor | None = None
    for view in range(settings.votes):
        for indices, scores in _view_scores(turn_tile(tile, view), scaling, classifier, settings, core_mask, seed):
            if total is None:
                total = scores.new_zeros(len(tile), scores.shape[1], dtype=torch.float32)
            total[torch.from_numpy(indices)] += scores.float().softmax(dim=1)
    if total is not None:
        rows = np.arange(len(tile)) if core_mask is None else np.flatnonzero(core_mask)
        yield rows, (total[torch.from_numpy(rows)] / settings.votes).clamp_min(1e-9).log()


def _view_scores(
    tile: CloudTile, scaling: Scaling, classifier: Classifier, settings: CropSettings, core_mask: Bool | None, seed: int
) -> Iterator[tuple[Index, Tensor]]:
    """Yield the scores of a tile's points in one view, piece by piece, with the points' indices; see `piece_scores`."""
    for number, (indices, visible_points) in enumerate(overlapping_pieces(tile.coord[:, :2], core_mask)):
        batch = make_item(
            crop_of(tile.select(visible_points), scaling), settings, stream(seed, "missing features", number)
        )
        scores = classifier(batch)
        if not torch.isfinite(scores).all():
            raise InputError("network", None, NOT_FINITE)
        yield indices, scores[torch.from_numpy(np.searchsorted(visible_points, indices))]


def turn_tile(tile: CloudTile, view: int) -> CloudTile:
    """Return a tile turned for a view: by the golden angle times its number, and mirrored for odd numbers.

    Pieces are cut after turning, so that each view has other borders.
    """
    if view == 0:
        return tile
    cosine, sine = np.cos(view * _GOLDEN_ANGLE), np.sin(view * _GOLDEN_ANGLE)
    turn = np.array([[cosine, sine], [-sine, cosine]], dtype=np.float32)
    if view % 2:
        turn[:, 0] *= -1.0
    coord = tile.coord.copy()
    middle = coord[:, :2].mean(axis=0)
    coord[:, :2] = (coord[:, :2] - middle) @ turn + middle
    return replace(tile, coord=coord)


def _needed_points(thinned_points: Float32, all_points: Float32, core: Bool | None, voxel: float) -> Bool:
    """Return a mask of the thinned points within two voxels of the core's bounding box in plan; all without a core."""
    if core is None:
        return np.ones(len(thinned_points), dtype=bool)
    lower_corner = all_points[core][:, :2].min(axis=0) - 2 * voxel
    upper_corner = all_points[core][:, :2].max(axis=0) + 2 * voxel
    return np.asarray(np.all((thinned_points[:, :2] >= lower_corner) & (thinned_points[:, :2] <= upper_corner), axis=1))


def nearest_labels(labelled_points: Float32, labels: NDArray[np.int16], points: Float32) -> NDArray[np.int16]:
    """Return for each point (M,) the label of the nearest known point in 3D.

    Args:
        labelled_points: (N, 3) m, at least one.
        labels: (N,).
        points: (M, 3) m.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int16)
    _, nearest_index = cKDTree(labelled_points).query(points)
    return labels[nearest_index]


def trained_model(run: Run[SegmentationConfiguration]) -> nn.Module:
    """Load a run's network with the weights of its last checkpoint, in evaluation mode.

    Raises:
        InputError: the checkpoint is damaged or of another network.
    """
    model = build(run.configuration).to(chosen_device(run.configuration))
    load_weights(model, run)
    return model.eval()


def load_weights(model: nn.Module, run: Run[SegmentationConfiguration]) -> None:
    """Load the weights of a run's last checkpoint into a network, in place, on the network's device.

    Raises:
        InputError: the checkpoint is damaged or of another network.
    """
    state = run.last_checkpoint(next(model.parameters()).device)
    if state is None:
        raise InputError(
            str(run.folder), None, "must hold a checkpoint; `synthroads train` writes one after each epoch"
        )
    load_state(model, state["model"], str(run.folder))


def classifier(model: nn.Module, configuration: SegmentationConfiguration) -> Classifier:
    """Return a function from an item to class scores (N, C) by the model in evaluation mode, without gradients."""

    def scores(batch: Item) -> Tensor:
        """Return the class scores (N, C) of an item's points."""
        model.eval()
        with torch.inference_mode():
            if not gpu_prepares(configuration, next(model.parameters()).device):
                batch = configuration.network.prepare(batch)
            return scores_of(model, prepare_on_gpu(configuration, move_to_device(model, batch)))

    return scores


def check_tests(configuration: SegmentationConfiguration) -> None:
    """Raise `InputError` or `MissingFileError` if a test's data can't be scored, before hours of training.

    Raises:
        MissingFileError: there are none.
        InputError: see `score`, or a source's first tile can't be read.
    """
    scheme = configuration.scheme()
    for sources in configuration.data.tests.values():
        target_names(sources, scheme)
        for source in sources:
            _groups(source, scheme)
            if next(read_tiles(source, scheme, None), None) is None:
                raise InputError("data.tests", source.path, "must hold points")


def score_all(
    model: nn.Module, configuration: SegmentationConfiguration, progress: Progress = silent
) -> dict[str, Any]:
    """Score the model on all tests of a configuration; return `Confusion.to_dict` by test name."""
    return {
        name: score(model, configuration, sources, progress)[0].to_dict()
        for name, sources in configuration.data.tests.items()
    }


def score(
    model: nn.Module,
    configuration: SegmentationConfiguration,
    sources: Sequence[Source],
    progress: Progress = silent,
) -> tuple[Confusion, tuple[CloudTile, Any] | None]:
    """Return the confusion over all points of some sources, and (largest tile, its predicted classes) or None.

    Raises:
        InputError: the sources tell different classes apart, or a mapping's groups leave out a class.
    """
    scheme = configuration.scheme()
    confusion = Confusion(target_names(sources, scheme))
    if configuration.adaptation.adabn:
        tiles = list(thin_tiles(sources, configuration, "test"))
        with report_lost_workers(configuration.workers):
            batches = adaptation_batches(tiles, configuration, next(model.parameters()).device)
            model = adapt_network(model, batches, configuration)
    scores = classifier(model, configuration)
    largest_result = None
    for source in sources:
        groups = _groups(source, scheme)
        for _, scene_tiles in groupby(read_tiles(source, scheme, None), key=lambda tile: tile.scene):
            scene = list(scene_tiles)
            scaling = scalings(scene, configuration.intensity, configuration.voxel)
            for tile in scene:
                labels = label_tile(tile, scaling[tile.scene], scores, configuration.crop_settings())
                confusion.add(tile.segment, groups[labels])
                if largest_result is None or len(tile) > len(largest_result[0]):
                    largest_result = (tile, groups[labels])
            # Half way: the number of tiles isn't known before they are read.
            progress("scoring", 0.5)
    return confusion, largest_result


def target_names(sources: Sequence[Source], scheme: ClassScheme) -> tuple[str, ...]:
    """Return the names of the classes, or groups, that the truth of one test's sources distinguishes.

    Raises:
        InputError: the sources distinguish different classes.
    """
    names = {source.targets(scheme) for source in sources}
    if len(names) != 1:
        raise InputError("data.tests", len(names), "all sources of one test must have the same classes")
    return names.pop()


def _groups(source: Source, scheme: ClassScheme) -> NDArray[np.int16]:
    """Return for each class of the scheme (C,) the index of the source's target (class or group) it counts as."""
    mapping, names = source.label_mapping(), class_names(scheme)
    groups = mapping.group_of(names) if mapping else np.arange(len(names), dtype=np.int16)
    if (groups == IGNORED).any():
        raise InputError("groups", mapping and mapping.title, "must assign every class of the scheme to a group")
    return groups
