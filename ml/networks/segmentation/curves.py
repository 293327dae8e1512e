"""Space-filling curves through the cells of a grid: codes that sort cells so that neighbours in line are near in space.

z-order: Morton, "A computer oriented geodetic data base" (1966). Hilbert's curve: Hilbert, "Über die stetige Abbildung
einer Linie auf ein Flächenstück" (1891), by the entry points and directions of Hamilton and Rau-Chaplin, "Compact
Hilbert indices: space-filling curves for domains with unequal side lengths" (2008). Curves as the order of points
for attention, and several of them in turn: Wu et al., "Point Transformer V3: simpler, faster, stronger" (2024).
"""

from functools import cache
from typing import Literal, get_args

import torch
from torch import Tensor

BITS = 16
"""Bits of a cell's number along an axis; the code of a cell takes three times as many."""
Curve = Literal["hilbert", "z-order", "hilbert-transposed", "z-order-transposed"]
CURVES: tuple[Curve, ...] = get_args(Curve)
"""All of them."""
_AXES = 3
"""Of space: x, y, z."""
_OCTANTS = 1 << _AXES
"""Of a cell: two halves along each axis."""
_SPREAD = ((16, 0x00FF0000FF), (8, 0x00F00F00F00F), (4, 0x0C30C30C30C3), (2, 0x249249249249))
"""Steps (shift, mask) that spread the bits of a number so that two zeros lie between each two."""


def curve_codes(cells: Tensor, curve: Curve) -> Tensor:
    """Return the places (M,) along a curve, below 2^48, of cells (M, 3) with numbers from 0 to 2^16 - 1.

    Transposed curves have x and y swapped.
    """
    if curve.endswith("-transposed"):
        cells = cells[:, [1, 0, 2]]
    code = hilbert_codes if curve.startswith("hilbert") else z_order_codes
    return code(cells)


def z_order_codes(cells: Tensor) -> Tensor:
    """Return the places (M,) along the z-order curve of cells (M, 3): the axes' bits in turn, x first."""
    bits = cells.long()
    for shift, bit_mask in _SPREAD:
        bits = (bits | (bits << shift)) & bit_mask
    return (bits[:, 0] << 2) | (bits[:, 1] << 1) | bits[:, 2]


def hilbert_codes(cells: Tensor) -> Tensor:
    """Return the places (M,) along Hilbert's curve of cells (M, 3); cells that follow each other share a face."""
    digits, states = (torch.tensor(table, device=cells.device) for table in _hilbert_tables())
    octants = z_order_codes(cells)
    code = torch.zeros_like(octants)
    state = torch.zeros_like(octants)
    for bit in range(BITS - 1, -1, -1):
        table_index = state + ((octants >> (_AXES * bit)) & (_OCTANTS - 1))
        code = (code << _AXES) | digits[table_index]
        state = states[table_index]
    return code


@cache
def _hilbert_tables() -> tuple[list[int], list[int]]:
    """Return two tables at index 8 state + octant: the octant's place along the curve, and 8 times the state within it.

    A state combines the corner (0 to 7) at which the curve enters a cube and the axis along which it leaves:
    3 corner + axis.
    """
    digits, states = [], []
    for corner in range(_OCTANTS):
        for axis in range(_AXES):
            for octant in range(_OCTANTS):
                # Hamilton and Rau-Chaplin 2008: an octant b of a cube that the curve enters at e, along axis d, is the
                # inverse Gray code of (b xor e) rotated right by d + 1.
                digit = _from_gray(_rotate_bits(octant ^ corner, -(axis + 1)))
                entry = corner ^ _rotate_bits(_entry(digit), axis + 1)
                digits.append(digit)
                states.append(_OCTANTS * (_AXES * entry + (axis + _direction(digit) + 1) % _AXES))
    return digits, states


def _rotate_bits(bits: int, steps: int) -> int:
    """Return three bits rotated to the left by some steps."""
    steps %= _AXES
    return ((bits << steps) | (bits >> (_AXES - steps))) & (_OCTANTS - 1)


def _from_gray(gray: int) -> int:
    """Return the three-bit number whose reflected Gray code is given (inverse Gray code)."""
    return gray ^ (gray >> 1) ^ (gray >> 2)


def _entry(digit: int) -> int:
    """Return the corner at which the curve enters the octant that is visited as number `digit`."""
    if digit == 0:
        return 0
    even_number = 2 * ((digit - 1) // 2)
    return even_number ^ (even_number >> 1)


def _direction(digit: int) -> int:
    """Return the axis along which the curve crosses the octant that is visited as number `digit`."""
    if digit == 0:
        return 0
    ones = digit if digit % 2 else digit - 1
    return ((ones ^ (ones + 1)).bit_length() - 1) % _AXES
