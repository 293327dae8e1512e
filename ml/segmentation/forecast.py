"""How long a training takes on this machine: seconds per step, measured on a few, times all of its steps.

Tiles in Pointcept's layout are counted, slivers included that a training leaves out; only a few are read. Scores after
the epochs take more.
"""

import math
import time
from itertools import chain, count
from pathlib import Path
from statistics import median
from typing import Any

import torch

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import peak_memory_mb

from ..data.sources import Source, pointcept_folders, pointcept_root
from ..data.tiles import CloudTile
from ..training_loop import chosen_device, optimizer_of, train_step
from .loading import CropBatches, thin_tiles
from .network import build
from .recipes import SegmentationConfiguration
from .task import objective

_TILES = 8
"""Tiles that the measured steps' crops are cut from. Chosen: steps of one tile would be too much alike."""


def forecast(configuration: SegmentationConfiguration, steps: int) -> dict[str, Any]:
    """Time some training steps; return seconds per step, the steps and hours of the whole training, ..., as JSON data.

    A step is all that a training does for a batch: cutting crops, finding neighbours, loss, gradients, changing
    weights. One more step is run first and not counted.

    Raises:
        InputError: the data are missing, or their tiles have fewer points than a crop; or the set-up has several
            trainings, or scenes are made meanwhile.
    """
    if configuration.set_up in ("fine_tuned", "self_trained"):
        raise InputError("set_up", configuration.set_up, "has several trainings: forecast each of them separately")
    if configuration.data.stream is not None:
        remedy = (
            "makes its scenes during the training, so it can't be forecast; set data.stream=null and name existing data"
        )
        raise InputError("data.stream", configuration.data.stream.recipe, remedy)
    device = chosen_device(configuration)
    sources = [source for rows in configuration.needed_sources().values() for source in rows]
    count = sum(tile_count(source, configuration) for source in sources)
    wall, cpu = timed_steps(configuration, _first_tiles(sources, configuration), steps, device)
    crops = configuration.crops_per_epoch or configuration.crops_per_tile * count
    steps_per_epoch = math.ceil(crops / configuration.batch) // configuration.processes
    step_count = steps_per_epoch * configuration.schedule.epochs
    return {
        "title": configuration.title,
        "device": str(device),
        "threads": torch.get_num_threads(),
        "tiles": count,
        "batch_points": configuration.batch * configuration.crop_points,
        "steps_measured": steps,
        "seconds_per_step": round(wall, 4),
        "cpu_seconds_per_step": round(cpu, 4),
        "steps_per_epoch": steps_per_epoch,
        "steps": step_count,
        "hours": round(step_count * wall / 3600.0, 2),
        "peak_memory_mb": peak_memory_mb(),
    }


def tile_count(source: Source, configuration: SegmentationConfiguration) -> int:
    """Return the number of a source's tiles, reading them unless they are in Pointcept's layout."""
    path = Path(source.path)
    root = pointcept_root(path) if path.is_dir() else None
    if root is not None:
        return len(pointcept_folders(root, source.split))
    return sum(1 for _ in thin_tiles([source], configuration, "counted"))


def _first_tiles(sources: list[Source], configuration: SegmentationConfiguration) -> list[CloudTile]:
    """Return up to 8 tiles of at least a crop's points; raise `InputError` if there are none."""
    tiles: list[CloudTile] = []
    for tile in thin_tiles(sources, configuration, "first"):
        if len(tile) >= configuration.crop_points:
            tiles.append(tile)
        if len(tiles) == _TILES:
            break
    if not tiles:
        raise InputError("crop_points", configuration.crop_points, "must not exceed the points of every tile")
    return tiles


def timed_steps(
    configuration: SegmentationConfiguration, tiles: list[CloudTile], steps: int, device: torch.device
) -> tuple[float, float]:
    """Run training steps on random weights; return the median wall-clock and processor seconds of a step."""
    model = build(configuration).to(device).train()
    optimizer = optimizer_of(model, configuration.schedule)
    loss = objective(configuration, tiles, device)
    wall, cpu = [], []
    crop_numbers = {"crops_per_tile": configuration.batch, "crops_per_epoch": None}
    crop_batches = CropBatches(configuration.model_copy(update=crop_numbers), [tiles], device)
    batches = chain.from_iterable(map(crop_batches, count()))  # epoch after epoch
    for _ in range(steps + 1):
        start_times = time.perf_counter(), time.process_time()
        batch = next(batches)
        train_step(model, optimizer, configuration.schedule.learning_rate, configuration, loss, batch)
        wall.append(time.perf_counter() - start_times[0])
        cpu.append(time.process_time() - start_times[1])
    return median(wall[1:]), median(cpu[1:])
