"""The corridor of a data set's roads as packed tiles, as many as fit into a file of training data."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from synthroads_addon.base.classes import ClassScheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.cloud.tools.quantile_mapping import steps_per_unit
from synthroads_addon.cloud.tools.subsample import GridSubsampler
from synthroads_addon.dataset.manifest import MANIFEST
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from .packed import Packed, pack_tile
from .roads import scene_folders
from .sources import Source, labelled_blocks, read_tiles, tile_of
from .tiles import CloudTile

CROP = 24_000
"""Points of a crop, the unit in which the size of a packed set is reported."""
_SPACING = 0.5
"""Distance of the points of a centreline, m."""
_SMALLEST = 2_000
"""Tiles of fewer points, at a road's ends, are left out."""


def corridor_tiles(
    scene: Path, scheme: ClassScheme, voxel: float, corridor: float, length: float = 60.0
) -> Iterator[CloudTile]:
    """Yield a scene's labelled points within `corridor` (m) of its centreline, thinned, a tile per `length` (m).

    The thinned corridor of one scene is held in memory: about 100 MB per km.

    Args:
        scene: folder of the scene in the data set.
        scheme: scheme of the classes to learn.
        voxel: edge of the cells of which one point each is kept, m.
        corridor: largest horizontal distance from the centreline, m.
        length: length of a tile along the road, m.
    """
    line = MeasuredAxis.read(scene / "centerline.geojson")
    tree = cKDTree(line.position(line.stations(_SPACING)))
    clouds = sorted(scene.glob("cloud.*"))
    if not clouds:
        raise InputError(str(scene), None, "must hold a cloud")
    with open_cloud(clouds[0]) as cloud, GridSubsampler(voxel, scene) as grid:
        scale = steps_per_unit(cloud)
        for block in labelled_blocks(cloud, scheme, Source(path=str(clouds[0]))):
            away, _ = tree.query(block.xyz[:, :2], distance_upper_bound=corridor)
            grid.add(block.select(np.isfinite(away)))
        blocks = [_drop_unpacked_layers(block) for block in grid.blocks()]
    if not blocks:
        return
    points = concatenate(blocks)
    _, nearest_index = tree.query(points.xyz[:, :2])
    station = nearest_index * _SPACING // length
    for number in np.unique(station):
        part = points.select(station == number)
        if len(part) >= _SMALLEST:
            yield tile_of(part, scene.name, np.floor(part.xyz.min(axis=0)), scale)


def _drop_unpacked_layers(block: PointBlock) -> PointBlock:
    """Return a copy of the block without the layers that packed files don't hold (normals, materials, ...)."""
    block = replace(block, normal=None, material=None, scanner=None, true_range=None, true_xyz=None)
    return replace(block, roughness=None, metallic=None, specular=None, color_source=None)


def packed_tiles(
    folder: Path, split: str | None, scheme: ClassScheme, voxel: float, corridor: float
) -> Iterator[Packed]:
    """Yield the packed tiles of a data set's corridors, or of another source's whole clouds, tiny tiles left out."""
    if (folder / MANIFEST).is_file():
        for scene in scene_folders(folder, split):
            for tile in corridor_tiles(scene, scheme, voxel, corridor):
                yield pack_tile(tile)
        return
    for tile in read_tiles(Source(path=str(folder), split=split), scheme, voxel):
        if len(tile) >= _SMALLEST:
            yield pack_tile(tile)


def choose_tiles(tiles: Iterable[Packed], limit: int, seed: int) -> list[Packed]:
    """Return a random choice of tiles that fits into `limit` bytes, equally many per scene, in the given order.

    Args:
        tiles: of all scenes.
        limit: largest size of the file, bytes.
        seed: seed of the choice.
    """
    all_tiles = list(tiles)
    order = stream(seed, "packed tiles").permutation(len(all_tiles))
    turns: dict[str, int] = {}
    ranked = []
    for tile_index in order.tolist():
        scene = str(all_tiles[tile_index].notes["scene"])
        ranked.append((turns.get(scene, 0), tile_index))
        turns[scene] = turns.get(scene, 0) + 1
    size, chosen_places = 1 << 16, []  # room for the notes' frame
    for _, tile_index in sorted(ranked):
        tile_size = len(all_tiles[tile_index].content) + 700  # and for the tile's own notes and names
        if size + tile_size <= limit:
            size += tile_size
            chosen_places.append(tile_index)
    return [all_tiles[tile_index] for tile_index in sorted(chosen_places)]


def pack_summary(notes: Sequence[Mapping[str, Any]], size: int) -> dict[str, Any]:
    """Return a packed file's counts as JSON data: bytes, tiles, scenes, points, bytes per point and crops' worth.

    Args:
        notes: notes of each tile.
        size: size of the file, bytes.
    """
    points = sum(int(tile["points"]) for tile in notes)
    return {
        "bytes": size,
        "tiles": len(notes),
        "scenes": len({tile["scene"] for tile in notes}),
        "points": points,
        "bytes_per_point": round(size / max(points, 1), 3),
        "crops": points // CROP,
    }
