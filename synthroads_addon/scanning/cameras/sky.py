"""Light that an image has where no surface is met: the sky, and a plain ground beyond the scene's end.

The sky's relative luminance is that of the CIE's standard skies (CIE S 011/E:2003, types 12, clear, and 1, overcast),
mixed by the cloud cover, and scaled so that a level surface gets from it the light that the scene's surfaces get.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arrays import Float, Float32
from ..colour.light import GROUND_ALBEDO, SunAndSky

_CLEAR = (-1.0, -0.32, 10.0, -3.0, 0.45)
"""Coefficients a to e of the CIE's sky 12: clear, low turbidity."""
_OVERCAST = (4.0, -0.70, 0.0, -1.0, 0.0)
"""Coefficients a to e of the CIE's sky 1: overcast, steep gradation."""
_LOWEST = 0.035
"""Least sine of the elevation at which the sky is evaluated: nearer to the horizon the air is as bright as there."""
_SUN_ANGLE = math.radians(2.0)
"""Nearest angle to the sun, rad, at which the sky is evaluated: the disc itself would fill the sensor anyway."""
_PALE = 0.75
"""How far colours turn to white from the zenith to the horizon. Chosen: air near the horizon is nearly white."""
_DEEPER = 1.8
"""Power of the colour of all skylight that is the zenith's. Chosen: the zenith is bluer than the sky's mean."""
_HAZE = math.radians(3.0)
"""Angle below the horizon, rad, within which the ground beyond the scene fades into the sky. Chosen."""
_GRASS = np.array([0.75, 1.0, 0.55])
"""Colour of the ground beyond the scene, as a factor on `GROUND_ALBEDO` for red, green and blue. Chosen: fields."""
_EQUAL = 0.25
"""Factor by which an overcast sky's formula has about the mean of a clear one's."""
_STEPS = 64
"""Steps of azimuth and elevation by which the sky's own light on a level surface is summed."""


@dataclass(frozen=True)
class Surroundings:
    """Sky and far ground as seen by cameras.

    Attributes:
        light: sun and sky, exposed.
        cloud_cover: share of the sky in clouds, 0 to 1.
    """

    light: SunAndSky
    cloud_cover: float = 0.0

    def colours(self, direction: Float) -> Float32:
        """Return the linear colours (N, 3) in unit directions (3, N), local frame, away from the camera."""
        result = self._sky(direction)
        below = np.flatnonzero(direction[2] < 0.0)
        if len(below):
            light = self.light
            level = light.sun * max(float(light.direction[2]), 0.0) + light.above
            ground = (GROUND_ALBEDO * _GRASS * level).astype(np.float32)
            share = np.clip(-np.arcsin(np.clip(direction[2, below], -1.0, 0.0)) / _HAZE, 0.0, 1.0)[:, None]
            result[below] += share.astype(np.float32) * (ground - result[below])
        return result

    def _sky(self, direction: Float) -> Float32:
        """Return the sky's linear colours (N, 3) in directions (3, N); below the horizon those at it."""
        luminance = self._luminance(direction) * self._scale
        zenith = (self.light.above / max(float(self.light.above.mean()), 1e-9)) ** _DEEPER
        zenith = zenith / zenith.mean()
        share = _PALE * (1.0 - np.sqrt(np.clip(direction[2], 0.0, 1.0)))
        share = share + self.cloud_cover * (1.0 - share)
        colour = zenith + share[:, None] * (1.0 - zenith)
        return np.asarray(luminance[:, None] * colour * float(self.light.above.mean()), np.float32)

    @cached_property
    def _scale(self) -> float:
        """Return the factor by which the sky's light on a level surface is that of an even sky of luminance 1."""
        azimuth = (np.arange(_STEPS) + 0.5) * (2.0 * np.pi / _STEPS)
        sine = np.sqrt((np.arange(_STEPS) + 0.5) / _STEPS)  # even in the squared sine: equal shares of the light
        azimuth, sine = (grid.ravel() for grid in np.meshgrid(azimuth, sine))
        level = np.sqrt(1.0 - sine * sine)
        luminance = self._luminance(np.stack([level * np.cos(azimuth), level * np.sin(azimuth), sine]))
        return 1.0 / max(float(luminance.mean()), 1e-9)

    def _luminance(self, direction: Float) -> Float:
        """Return the relative luminance (N,) in directions (3, N), by the formula of the CIE's standard skies."""
        sine = np.maximum(direction[2], _LOWEST)
        sun = self.light.direction
        cosine = sun[0] * direction[0] + sun[1] * direction[1] + sun[2] * direction[2]
        cosine = np.clip(cosine, -1.0, math.cos(_SUN_ANGLE))
        angle = np.arccos(cosine)
        parts = []
        for a, b, c, d, e in (_CLEAR, _OVERCAST):
            gradation = 1.0 + a * np.exp(b / sine)
            scattering = 1.0 + c * (np.exp(d * angle) - math.exp(d * math.pi / 2.0)) + e * cosine**2
            parts.append(gradation * scattering)
        # Each is relative: 1 at the zenith of a sky with the sun there; an overcast one is scaled to the same mean.
        return np.asarray((1.0 - self.cloud_cover) * parts[0] + self.cloud_cover * parts[1] * _EQUAL)
