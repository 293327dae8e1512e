"""Pack the labelled points of a data set's roads into one small file, to train on a faster machine.

Where they exceed the size limit, a random choice of tiles is packed, equally many of each road.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_file_target

_LIMITS = {"voxel": (0.02, 10.0), "corridor": (5.0, 1000.0), "limit_mb": (0.5, 1e5)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads pack` to its parser."""
    parser.add_argument("source", type=Path, metavar="DATASET", help="data set, or another source of labelled points")
    parser.add_argument("--split", metavar="NAME", help="split to pack (all)")
    parser.add_argument("--output", required=True, type=Path, metavar="FILE", help="file to write, .npz")
    parser.add_argument("--classes", default="5", metavar="SCHEME", help="5, 17 or a JSON file (%(default)s)")
    text = "edge of the grid cells, each of which keeps one point, m (%(default)s)"
    parser.add_argument("--voxel", type=float, default=0.1, metavar="M", help=text)
    text = "distance to either side of the centreline within which points are kept, m (30)"
    parser.add_argument("--corridor", type=float, default=30.0, metavar="M", help=text)
    text = "largest size of the file, 1e6 bytes (50)"
    parser.add_argument("--limit-mb", type=float, default=50.0, metavar="MB", help=text)
    text = "seed of the choice of tiles (%(default)s)"
    parser.add_argument("--seed", type=int, default=1, metavar="N", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace a file that is there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads pack`; return exit code, figures of the file as JSON data and printed text."""
    _check(arguments)
    from ml.data.pack import choose_tiles, pack_summary, packed_tiles
    from ml.data.packed import write_pack
    from synthroads_addon.base.classes import class_scheme

    scheme = class_scheme(arguments.classes)
    all_tiles = packed_tiles(arguments.source, arguments.split, scheme, arguments.voxel, arguments.corridor)
    tiles = choose_tiles(all_tiles, int(arguments.limit_mb * 1e6), arguments.seed)
    size = write_pack(arguments.output, tiles, scheme, arguments.voxel, arguments.overwrite)
    figures = pack_summary([tile.notes for tile in tiles], size)
    return 0, figures, f"written {arguments.output}: {contents(figures)}"


def _check(arguments: argparse.Namespace) -> None:
    """Raise an InputError if an option is out of range or the file can't be written, before hours of work."""
    check_file_target(arguments.output, overwrite=arguments.overwrite, ending=".npz")
    if not 0 <= arguments.seed < 2**63:
        raise InputError("--seed", arguments.seed, "must be a whole number from 0")
    for name, (smallest, largest) in _LIMITS.items():
        if not smallest <= getattr(arguments, name) <= largest:
            raise InputError(
                f"--{name.replace('_', '-')}", getattr(arguments, name), f"must be {smallest} to {largest:g}"
            )


def contents(figures: dict[str, Any]) -> str:
    """Return a line of text on a packed file: size, tiles, scenes, points and crops."""
    return (
        f"{figures['bytes'] / 1e6:.1f} MB with {figures['tiles']:,} tiles of {figures['scenes']:,} scenes, "
        f"{figures['points']:,} points ({figures['bytes_per_point']:.2f} bytes each), "
        f"which are {figures['crops']:,} crops"
    )


if __name__ == "__main__":
    entry("pack")
