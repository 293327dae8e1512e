"""Marks that files have of single points besides measurements: flags of LAS, its user data, and classes of noise.

Readers hand these arrays on in `PointBlock.more` where a file holds them, so that a copy keeps them. What works on
points leaves out those that are withheld or noise, see `CloudReader.usable_blocks`.
"""

import numpy as np

from ..base.arrays import Bool
from ..base.classes import ClassScheme
from .points import PointBlock

WITHHELD = "withheld"
FLAGS: tuple[str, ...] = (
    *(WITHHELD, "synthetic", "key_point", "overlap", "scanner_channel", "scan_direction_flag", "edge_of_flight_line"),
    "user_data",
)
"""Names of the fields, by LAS 1.4 R15 (tables 16 and 17), each of at most 8 bits; arrays (N,) uint8 of their names."""
NOISE_CODES = (7, 18)
"""LAS codes of low and of high noise (ASPRS LAS 1.4 R15, table 17)."""


def withheld_points(block: PointBlock) -> Bool:
    """Return a mask (N,) of the points that their file marks as not to be used, as good as deleted."""
    flags = block.array(WITHHELD)
    return np.zeros(len(block), dtype=bool) if flags is None else np.asarray(flags) != 0


def noise_points(block: PointBlock, scheme: ClassScheme) -> Bool:
    """Return a mask (N,) of the points of a class whose LAS code is one of noise."""
    return np.asarray(np.isin(scheme.las_codes(), NOISE_CODES)[block.class_id])


def without_flags(block: PointBlock) -> PointBlock:
    """Return the block without the arrays of `FLAGS`."""
    flag_names = [name for name in FLAGS if name in block.more]
    return block.with_arrays(dict.fromkeys(flag_names)) if flag_names else block
