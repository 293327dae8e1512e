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
    # CIE 15: L* = 116 f(Y / Yn) - 16, a* = 500 (f(X / Xn) - f(Y / Yn)), b* = 200 (f(Y / Yn) - f(Z / Zn)).
    ratio = decode_srgb(rgb.astype(np.float64) / 65535.0) @ _TO_XYZ.T / _WHITE
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


def ciede2000(colour: Float, other_colour: Float) -> Float:
    """Return the CIEDE2000 differences (N,) of L*a*b* colours (N, 3) (CIE 142-2001, form of Sharma et al. 2005)."""
    # Their symbols: c1, c2 are C'_1, C'_2, and so for h; a bar is a mean of both colours.
    (l1, a1, b1), (l2, a2, b2) = colour.T, other_colour.T
    c_bar = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2.0
    # a' = (1 + G) a, G = (1 - sqrt(C^7 / (C^7 + 25^7))) / 2: greys differ by more than their a* says.
    scale = 1.5 - 0.5 * np.sqrt(c_bar**7 / (c_bar**7 + 25.0**7))
    a1, a2 = a1 * scale, a2 * scale
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360.0, np.degrees(np.arctan2(b2, a2)) % 360.0
    grey = c1 * c2 == 0.0
    delta_h = np.where(grey, 0.0, (h2 - h1 + 180.0) % 360.0 - 180.0)
    # Opposite hues: the sign follows Sharma's convention, +180 where h2 > h1.
    delta_h = np.where((np.abs(delta_h) == 180.0) & (h2 > h1), 180.0, delta_h)
    # Delta H' = 2 sqrt(C'_1 C'_2) sin(delta h' / 2).
    delta_big_h = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(delta_h / 2.0))
    l_mean, c_mean = (l1 + l2) / 2.0, (c1 + c2) / 2.0
    h_mean = np.where(np.abs(h1 - h2) <= 180.0, (h1 + h2) / 2.0, ((h1 + h2 + 360.0) / 2.0) % 360.0)
    h_mean = np.radians(np.where(grey, h1 + h2, h_mean))  # of a grey and a hue the mean is that hue
    t = (
        1.0
        - 0.17 * np.cos(h_mean - np.radians(30.0))
        + 0.24 * np.cos(2.0 * h_mean)
        + 0.32 * np.cos(3.0 * h_mean + np.radians(6.0))
        - 0.20 * np.cos(4.0 * h_mean - np.radians(63.0))
    )
    s_l = 1.0 + 0.015 * (l_mean - 50.0) ** 2 / np.sqrt(20.0 + (l_mean - 50.0) ** 2)
    s_c, s_h = 1.0 + 0.045 * c_mean, 1.0 + 0.015 * c_mean * t
    # R_T = -sin(2 delta theta) R_C, delta theta = 30 exp(-((h' - 275) / 25)^2): blues' hue and chroma go together.
    two_delta_theta = 60.0 * np.exp(-(((np.degrees(h_mean) - 275.0) / 25.0) ** 2))
    r_t = -np.sin(np.radians(two_delta_theta)) * 2.0 * np.sqrt(c_mean**7 / (c_mean**7 + 25.0**7))
    # With the weights k_L = k_C = k_H = 1 of the reference conditions.
    dl, dc, dh = (l2 - l1) / s_l, (c2 - c1) / s_c, delta_big_h / s_h
    return np.sqrt(dl * dl + dc * dc + dh * dh + r_t * dc * dh)


def known_rows(truth: LayerValues) -> Bool:
    """Return a mask (N,) of the points whose layers were rendered at the very point: neither means nor taken nearby."""
    return ~np.isin(truth.source, (FROM_MATERIAL, NEARBY))


def colour_difference(mine: LayerValues, truth: LayerValues, rows: Bool) -> Float:
    """Return the CIEDE2000 differences (n,) of the RGB in two sets of layers, at the n points of a mask (N,)."""
    return ciede2000(cie_lab(mine.arrays["rgb"][rows]), cie_lab(truth.arrays["rgb"][rows]))  # type: ignore[arg-type]


def squared_error(name: str, mine: LayerValues, truth: LayerValues, rows: Bool) -> Float:
    """Return the squared errors (n, components) of a material layer at the n points that a mask (N,) chooses."""
    difference = mine.arrays[name][rows].astype(np.float64) - truth.arrays[name][rows].astype(np.float64)
    return np.square(difference).reshape(len(difference), -1)
