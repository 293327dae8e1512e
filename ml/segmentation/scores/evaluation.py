"""Scores of a network on labelled points of all densities, and the network as it was trained."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from synthroads_addon.base.classes import ClassScheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import Progress, silent

from ...runs import Run
from ..data.classes import IGNORED, class_names
from ..data.crops import Item
from ..data.sources import Source, read_tiles
from ..data.tiles import CloudTile, scalings
from ..loading import adaptation_batches, thin_tiles, watched_workers
from ..network import adapt_network, build, on_device, scores_of
from ..recipes import SegmentationConfiguration
from .metrics import Confusion
from .scoring import Classifier, label_tile


def trained_model(run: Run[SegmentationConfiguration], device: torch.device) -> nn.Module:
    """Return the network of a trained run.

    Raises:
        InputError: the checkpoint is damaged or of another network.
    """
    state = run.saved(device)
    if state is None:
        raise InputError(str(run.folder), None, "holds no checkpoint")
    model = build(run.configuration).to(device)
    try:
        model.load_state_dict(state["model"])
    except (KeyError, RuntimeError):
        raise InputError(str(run.folder), None, "its checkpoint is of another network than its configuration") from None
    return model.eval()


def classifier(model: nn.Module, configuration: SegmentationConfiguration, device: torch.device) -> Classifier:
    """Return what scores the points of an item."""

    def scores(batch: Item) -> Tensor:
        model.eval()
        with torch.inference_mode():
            return scores_of(model, on_device(configuration.network.prepare(batch), device))

    return scores


def check_tests(configuration: SegmentationConfiguration) -> None:
    """Look at the data of all tests, as far as can be told without a network: trainings take hours.

    Raises:
        MissingFileError: there are none.
        InputError: see `score`, or a source's first tile can't be read.
    """
    scheme = configuration.scheme()
    for sources in configuration.data.tests.values():
        _targets(sources, scheme)
        for source in sources:
            _groups(source, scheme)
            if next(read_tiles(source, scheme, None), None) is None:
                raise InputError("data.tests", source.path, "holds no points")


def score_all(
    model: nn.Module, configuration: SegmentationConfiguration, device: torch.device, progress: Progress = silent
) -> dict[str, Any]:
    """Return the scores of a configuration's tests by name, see `Confusion.to_dict`."""
    return {
        name: score(model, configuration, sources, device, progress)[0].to_dict()
        for name, sources in configuration.data.tests.items()
    }


def score(
    model: nn.Module,
    configuration: SegmentationConfiguration,
    sources: Sequence[Source],
    device: torch.device,
    progress: Progress = silent,
) -> tuple[Confusion, tuple[CloudTile, Any] | None]:
    """Return the confusion over all points of some sources, and the largest tile with its classes, to be drawn.

    Raises:
        InputError: the sources tell different classes apart, or a mapping's groups leave out a class.
    """
    scheme = configuration.scheme()
    confusion = Confusion(_targets(sources, scheme))
    if configuration.adaptation.adabn:
        tiles = list(thin_tiles(sources, configuration, "test"))
        with watched_workers(configuration):
            model = adapt_network(model, adaptation_batches(tiles, configuration), device)
    scores = classifier(model, configuration, device)
    shown = None
    for source in sources:
        groups = _groups(source, scheme)
        for scene in _scenes(read_tiles(source, scheme, None)):
            scaling = scalings(scene, configuration.intensity, configuration.voxel)
            for tile in scene:
                labels = label_tile(tile, scaling[tile.scene], scores, configuration.crop_settings())
                confusion.add(tile.segment, groups[labels])
                if shown is None or len(tile) > len(shown[0]):
                    shown = (tile, groups[labels])
            progress("scoring", 0.5)
    return confusion, shown


def _targets(sources: Sequence[Source], scheme: ClassScheme) -> tuple[str, ...]:
    names = {source.targets(scheme) for source in sources}
    if len(names) != 1:
        raise InputError("data.tests", len(names), "sources of one test must tell the same classes apart")
    return names.pop()


def _groups(source: Source, scheme: ClassScheme) -> NDArray[np.int16]:
    """Return for each class of the scheme (C,) the place of the target that it counts as."""
    mapping, names = source.label_mapping(), class_names(scheme)
    groups = mapping.group_of(names) if mapping else np.arange(len(names), dtype=np.int16)
    if (groups == IGNORED).any():
        raise InputError("groups", mapping and mapping.title, "must have a place for every class of the scheme")
    return groups


def _scenes(tiles: Iterator[CloudTile]) -> Iterator[list[CloudTile]]:
    """Yield the tiles of one scene after another, which stand together."""
    scene: list[CloudTile] = []
    for tile in tiles:
        if scene and scene[0].scene != tile.scene:
            yield scene
            scene = []
        scene.append(tile)
    if scene:
        yield scene
