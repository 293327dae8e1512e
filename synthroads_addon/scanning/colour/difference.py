"""How different two colours look, by CIEDE2000, and two sets of the same points' layers."""

import numpy as np

from ...base.arrays import Bool, Float, UInt16
from .colour import FROM_MATERIAL, NEARBY, LayerValues, decode_srgb

_WHITE = np.array([0.95047, 1.0, 1.08883])
"""Tristimulus values X, Y, Z of the white point D65 (CIE 1931, 2 degrees), Y being 1."""
_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""Matrix from linear sRGB to X, Y, Z (IEC 61966-2-1)."""


def cie_lab(rgb: UInt16) -> Float:
    """Return CIE L*a*b* (N, 3) under D65 of 16-bit sRGB (N, 3)."""
    ratio = decode_srgb(rgb.astype(np.float64) / 65535.0) @ _TO_XYZ.T / _WHITE
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


def ciede2000(one: Float, other: Float) -> Float:
    """Return the CIEDE2000 differences (N,) of L*a*b* colours (N, 3) (CIE 142-2001, form of Sharma et al. 2005)."""
    (l1, a1, b1), (l2, a2, b2) = one.T, other.T
    mean_chroma = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2.0
    stretch = 1.5 - 0.5 * np.sqrt(mean_chroma**7 / (mean_chroma**7 + 25.0**7))
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360.0, np.degrees(np.arctan2(b2, a2)) % 360.0
    grey = c1 * c2 == 0.0
    turn = np.where(grey, 0.0, (h2 - h1 + 180.0) % 360.0 - 180.0)
    # Opposite hues: the sign follows Sharma's convention, +180 where h2 > h1.
    turn = np.where((np.abs(turn) == 180.0) & (h2 > h1), 180.0, turn)
    hue_difference = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2.0))
    lightness, chroma = (l1 + l2) / 2.0, (c1 + c2) / 2.0
    hue = np.where(np.abs(h1 - h2) <= 180.0, (h1 + h2) / 2.0, ((h1 + h2 + 360.0) / 2.0) % 360.0)
    hue = np.radians(np.where(grey, h1 + h2, hue))
    t = (
        1.0
        - 0.17 * np.cos(hue - np.radians(30.0))
        + 0.24 * np.cos(2.0 * hue)
        + 0.32 * np.cos(3.0 * hue + np.radians(6.0))
        - 0.20 * np.cos(4.0 * hue - np.radians(63.0))
    )
    s_l = 1.0 + 0.015 * (lightness - 50.0) ** 2 / np.sqrt(20.0 + (lightness - 50.0) ** 2)
    s_c, s_h = 1.0 + 0.045 * chroma, 1.0 + 0.015 * chroma * t
    rotation = 60.0 * np.exp(-(((np.degrees(hue) - 275.0) / 25.0) ** 2))
    r_t = -np.sin(np.radians(rotation)) * 2.0 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7))
    dl, dc, dh = (l2 - l1) / s_l, (c2 - c1) / s_c, hue_difference / s_h
    return np.sqrt(dl * dl + dc * dc + dh * dh + r_t * dc * dh)


def known_rows(truth: LayerValues) -> Bool:
    """Return a mask (N,) of the points whose layers were rendered at the very point, not means nor taken nearby."""
    return ~np.isin(truth.source, (FROM_MATERIAL, NEARBY))


def colour_difference(mine: LayerValues, truth: LayerValues, rows: Bool) -> Float:
    """Return the CIEDE2000 differences (n,) between two sets' RGB at the n points chosen by a mask."""
    return ciede2000(cie_lab(mine.arrays["rgb"][rows]), cie_lab(truth.arrays["rgb"][rows]))  # type: ignore[arg-type]


def squared_error(name: str, mine: LayerValues, truth: LayerValues, rows: Bool) -> Float:
    """Return the squared errors (n, components) of a material layer at the n points chosen by a mask."""
    difference = mine.arrays[name][rows].astype(np.float64) - truth.arrays[name][rows].astype(np.float64)
    return np.square(difference).reshape(len(difference), -1)
