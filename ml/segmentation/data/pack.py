"""Pack the corridor of a data set's roads into one file of training data, to be carried to where training is fast.

Example: ``python -m ml.segmentation.data.pack out/reference --split train --output train.npz --limit-mb 50``
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from headless.commands import add_short_options
from synthroads_addon.base.classes import ClassScheme, class_scheme
from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.base.schema import read_json
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.cloud.tools.quantile_mapping import steps_per_unit
from synthroads_addon.cloud.tools.subsample import GridSubsampler
from synthroads_addon.dataset.manifest import MANIFEST, SceneEntry, read_manifest

from .packing import Packed, pack_tile, write_pack
from .sources import Source, labelled_blocks, read_tiles, tile_of
from .tiles import Tile

CROP = 24_000
"""Points of a crop, in which the size of a packed set is told."""
_SMALLEST = 2_000
"""Tiles of fewer points, at a road's ends, are left out."""


def corridor_tiles(
    folder: Path, scene: str, scheme: ClassScheme, voxel: float, corridor: float, length: float = 60.0
) -> Iterator[Tile]:
    """Yield the corridor of one scene of a data set, a tile per ``length`` of its road.

    The thinned corridor of one scene is held in memory: about 100 MB per km.

    Args:
        folder: of the data set.
        scene: its name there.
        scheme: classes wanted.
        voxel: edge of the cells of which one point each is kept, m.
        corridor: largest horizontal distance from the centreline, m.
        length: of a tile along the road, m.
    """
    home = folder / "scenes" / scene
    line = densified(_line(home / "centerline.geojson"), 0.5)
    tree = cKDTree(line)
    clouds = sorted(home.glob("cloud.*"))
    if not clouds:
        raise InputError(str(home), None, "holds no cloud")
    with open_cloud(clouds[0]) as cloud, GridSubsampler(voxel, home) as grid:
        scale = steps_per_unit(cloud)
        for block in labelled_blocks(cloud, scheme, Source(path=str(clouds[0]))):
            away, _ = tree.query(block.xyz[:, :2], distance_upper_bound=corridor)
            grid.add(block.select(np.isfinite(away)))
        blocks = [_lean(block) for block in grid.blocks()]
    if not blocks:
        return
    points = concatenate(blocks)
    _, nearest = tree.query(points.xyz[:, :2])
    station = nearest * 0.5 // length
    for number in np.unique(station):
        part = points.select(station == number)
        if len(part) >= _SMALLEST:
            yield tile_of(part, scene, np.floor(part.xyz.min(axis=0)), scale)


def _lean(block: PointBlock) -> PointBlock:
    """Return a block without what isn't packed."""
    block = replace(block, normal=None, material=None, scanner=None, true_range=None, true_xyz=None)
    return replace(block, roughness=None, metallic=None, specular=None, color_source=None)


def _line(path: Path) -> NDArray[np.float64]:
    """Return the vertices (M, 2) of a centreline in GeoJSON."""
    data = read_json(path)
    try:
        line = np.array(data["features"][0]["geometry"]["coordinates"], dtype=np.float64)[:, :2]
    except (KeyError, IndexError, TypeError, ValueError):
        raise InputError(str(path), None, "holds no line") from None
    return line


def densified(line: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return points (K, 2) every ``spacing`` along a polyline (M, 2), m."""
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))]
    at = np.arange(int(along[-1] / spacing) + 1) * spacing
    return np.stack([np.interp(at, along, line[:, axis]) for axis in range(2)], axis=1)


def packed_tiles(
    folder: Path, split: str | None, scheme: ClassScheme, voxel: float, corridor: float
) -> Iterator[Packed]:
    """Yield all tiles of a data set (its corridors), or of any other source of labelled points as it is."""
    if (folder / MANIFEST).is_file():
        for scene in scenes_of(folder, split):
            for tile in corridor_tiles(folder, scene.name, scheme, voxel, corridor):
                yield pack_tile(tile)
        return
    for tile in read_tiles(Source(path=str(folder), split=split), scheme, voxel):
        if len(tile) >= _SMALLEST:
            yield pack_tile(tile)


def scenes_of(folder: Path, split: str | None) -> list[SceneEntry]:
    """Return the finished scenes of a data set's split.

    Raises:
        InputError: there are none.
    """
    scenes = [scene for scene in read_manifest(folder).scenes if scene.status == "done"]
    chosen = [scene for scene in scenes if split in (None, scene.split)]
    if not chosen:
        known = ", ".join(dict.fromkeys(scene.split for scene in scenes)) or "none"
        raise InputError("--split", split, f"holds no scene; there are the splits {known}")
    return chosen


def within(tiles: Iterable[Packed], limit: int, seed: int) -> list[Packed]:
    """Return as many tiles as fit into a number of bytes: of each scene as many, drawn at random, in their order.

    Args:
        tiles: of all scenes.
        limit: bytes of the file.
        seed: of the choice.
    """
    given = list(tiles)
    order = stream(seed, "packed tiles").permutation(len(given))
    turns: dict[str, int] = {}
    ranked = []
    for place in order.tolist():
        scene = str(given[place].notes["scene"])
        ranked.append((turns.get(scene, 0), place))
        turns[scene] = turns.get(scene, 0) + 1
    size, chosen = 1 << 16, []  # room for the notes' frame
    for _, place in sorted(ranked):
        more = len(given[place].content) + 700  # and for the tile's own notes and names
        if size + more <= limit:
            size += more
            chosen.append(place)
    return [given[place] for place in sorted(chosen)]


def summary(notes: Sequence[Mapping[str, Any]], size: int) -> dict[str, Any]:
    """Return what a packed file holds, as JSON data; ``crops`` is how many of the recipe's its points make up.

    Args:
        notes: of each tile.
        size: of the file, bytes.
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


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = argparse.ArgumentParser(prog="python -m ml.segmentation.data.pack", description=__doc__)
    made.add_argument("source", type=Path, metavar="DATASET", help="data set, or another source of labelled points")
    made.add_argument("--split", metavar="NAME", help="split to pack (default: all)")
    made.add_argument("--output", type=Path, required=True, metavar="FILE", help="file to write, .npz")
    made.add_argument("--classes", default="5", metavar="SCHEME", help="5, 17 or a JSON file (default: 5)")
    made.add_argument("--voxel", type=float, default=0.1, metavar="M", help="edge of the grid's cells (default: 0.1)")
    made.add_argument("--corridor", type=float, default=30.0, metavar="M", help="reach to either side (default: 30)")
    made.add_argument(
        "--limit-mb", type=float, default=50.0, metavar="MB", help="largest file, 1e6 bytes (default: 50)"
    )
    made.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the choice of tiles (default: 1)")
    made.add_argument("--overwrite", action="store_true", help="replace a file that is there")
    add_short_options(made)
    return made


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    arguments = parser().parse_args(argv)
    try:
        if arguments.output.suffix != ".npz":
            raise InputError("--output", str(arguments.output), "must end in .npz")
        if arguments.output.exists() and not arguments.overwrite:
            raise OutputError("--output", str(arguments.output), "is there already; --overwrite replaces it")
        if not 0 <= arguments.seed < 2**63:
            raise InputError("--seed", arguments.seed, "must be a whole number from 0")
        for name, low, high in (("voxel", 0.02, 10.0), ("corridor", 5.0, 1000.0), ("limit_mb", 0.5, 1e5)):
            if not low <= getattr(arguments, name) <= high:
                raise InputError(f"--{name.replace('_', '-')}", getattr(arguments, name), f"must be {low} to {high:g}")
        scheme = class_scheme(arguments.classes)
        every = packed_tiles(arguments.source, arguments.split, scheme, arguments.voxel, arguments.corridor)
        tiles = within(every, int(arguments.limit_mb * 1e6), arguments.seed)
        size = write_pack(arguments.output, tiles, scheme, arguments.voxel, arguments.overwrite)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(json.dumps(summary([tile.notes for tile in tiles], size), indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
