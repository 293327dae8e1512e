"""Colours of files as 16-bit sRGB: what full brightness is, by what a file declares, or else by its largest value."""

import numpy as np

from ..base.arrays import AnyArray, UInt16

EIGHT_BITS, SIXTEEN_BITS = 255.0, 65535.0
_BRIGHTNESSES = (1.0, EIGHT_BITS, SIXTEEN_BITS)


def full_brightness(largest_value: float, *, is_integer: bool = True) -> float:
    """Return the stored value of full brightness, by the largest value of a file that declares none.

    Files of 16-bit or floating-point fields often hold 8 bits or shares from 0 to 1.

    Args:
        largest_value: of all channels of all points.
        is_integer: whether the field holds whole numbers: a share of 1 is then no possibility.

    Returns:
        255 or 65535; of floating-point fields 1 as well; a larger largest value itself.

    Example:
        >>> full_brightness(212), full_brightness(40_000), full_brightness(0.8, is_integer=False)
        (255.0, 65535.0, 1.0)
    """
    return next(
        (brightness for brightness in _BRIGHTNESSES[is_integer:] if largest_value <= brightness), float(largest_value)
    )


def brightness_text(brightness: float) -> str:
    """Return, in words, the range of numbers that stored colours have whose full brightness is ``brightness``."""
    return {1.0: "shares from 0 to 1", EIGHT_BITS: "8 bits (0 to 255)"}.get(
        brightness, f"numbers from 0 to {brightness:,.0f}"
    )


def sixteen_bits(values: AnyArray, brightness: float) -> UInt16:
    """Return colours of any shape as 16 bits, from stored values whose full brightness is given; NaN is dark.

    Example:
        >>> import numpy as np
        >>> sixteen_bits(np.array([0, 128, 255]), brightness=255).tolist()
        [0, 32896, 65535]
    """
    share = np.clip(np.nan_to_num(np.asarray(values, dtype=np.float64)) / brightness, 0.0, 1.0)
    return np.rint(share * SIXTEEN_BITS).astype(np.uint16)
