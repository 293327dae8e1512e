"""Offsets of a data set's points from the axes of their roads, which lie in its scenes' folders."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from .tiles import CloudTile

AXIS = "centerline.geojson"
"""Name of the file of a scene's axis."""


def with_offsets(folder: Path, tiles: Iterable[CloudTile]) -> Iterator[CloudTile]:
    """Yield tiles with their points' offsets from the axis in ``FOLDER/scenes/SCENE``; without, where there is none.

    Args:
        folder: folder of the data set, or its folder of tiles in Pointcept's layout.
        tiles: tiles of the data set.
    """
    axes: dict[str, MeasuredAxis | None] = {}
    roots = [folder, *folder.absolute().parents[:2]]
    for tile in tiles:
        if tile.scene not in axes:
            files = [root / "scenes" / tile.scene / AXIS for root in roots]
            axes[tile.scene] = next((_read_axis(file) for file in files if file.is_file()), None)
        axis = axes[tile.scene]
        if axis is None:
            yield tile
        else:
            _, offset = axis.project(tile.coord.astype(np.float64) + tile.origin)
            yield replace(tile, offset=offset.astype(np.float32))


def _read_axis(file: Path) -> MeasuredAxis:
    """Read a scene's axis in the coordinate system of the cloud beside it."""
    with open_cloud(next(iter(sorted(file.parent.glob("cloud.*"))))) as cloud:
        return MeasuredAxis.read(file, place=cloud.header.place)
