"""Light that an image has where no surface is met: the sky, and a plain ground beyond the scene's end.

The sky's relative luminance is that of the CIE's standard skies (CIE S 011/E:2003, types 12, clear, and 1, overcast),
mixed by the cloud cover, and scaled so that a level surface gets from it the light that the scene's surfaces get.
Below haze, fog, rain and snow the sky is seen through their layer, which adds light of its own; so do things at a
distance through the air (see `colour.haze`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arrays import Float, Float32
from ..colour.haze import HEIGHT, HazeLight, below_haze
from ..colour.light import GROUND_ALBEDO, SunAndSky
from ..weather.extinction import visible_extinction

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
_CLEAR_AIR = visible_extinction(23_000.0)
"""Extinction (1/m) of the usual clear air, which the light of sun and sky has come through already."""


@dataclass(frozen=True)
class Surroundings:
    """Sky, far ground and air as seen by cameras.

    Attributes:
        light: sun and sky in clear air, exposed.
        cloud_cover: share of the sky in clouds, 0 to 1.
        extinction: of visible light by the air, 1/m of path; 0 for none.
    """

    light: SunAndSky
    cloud_cover: float = 0.0
    extinction: float = 0.0

    @cached_property
    def light_below(self) -> SunAndSky:
        """Return sun and sky as they light the scene: below the layer of haze, if there is one."""
        return self._below[0]

    @property
    def air(self) -> Float:
        """Return the light (3,) of the air itself along the road, which what is far away fades into."""
        return self._below[1].air

    def through_air(self, colours: Float32, distance: Float) -> Float32:
        """Return linear colours (N, 3) as they are seen from a distance (N,), m, by the law of Koschmieder."""
        if not self.extinction:
            return colours
        left = np.exp(-self.extinction * distance)[:, None]
        return np.asarray(left * colours + (1.0 - left) * self.air, np.float32)

    def colours(self, direction: Float, height: Float | float = 0.0) -> Float32:
        """Return the linear colours (N, 3) in unit directions (3, N), local frame, away from the camera.

        Args:
            direction: (3, N).
            height: (N,) of the camera above the plain ground beyond the scene, m.
        """
        result = self._sky(direction)
        below = np.flatnonzero(direction[2] < 0.0)
        if len(below):
            light, fall = self.light_below, -direction[2, below]
            level = light.sun * max(float(light.direction[2]), 0.0) + light.above
            share = np.clip(np.arcsin(np.clip(fall, 0.0, 1.0)) / _HAZE, 0.0, 1.0)[:, None].astype(np.float32)
            ground = np.broadcast_to((GROUND_ALBEDO * _GRASS * level).astype(np.float32), (len(below), 3))
            heights = np.maximum(np.broadcast_to(height, direction[2].shape)[below], 0.0)
            ground = self.through_air(ground, heights / np.maximum(fall, _LOWEST))
            result[below] += share * (ground - result[below])
        return result

    @cached_property
    def _below(self) -> tuple[SunAndSky, HazeLight]:
        """Return the light below the layer of haze beyond clear air, and what the layer makes of it."""
        return below_haze(self.light, max(self.extinction - _CLEAR_AIR, 0.0))

    @property
    def _depth(self) -> float:
        """Return the optical depth of the layer of haze beyond clear air, straight up."""
        return max(self.extinction - _CLEAR_AIR, 0.0) * HEIGHT

    def _sky(self, direction: Float) -> Float32:
        """Return the sky's linear colours (N, 3) in directions (3, N); below the horizon those at it."""
        clear = self._clear_sky(direction)
        if not self._depth:
            return np.asarray(clear, np.float32)
        sine = np.clip(direction[2], 0.0, 1.0)[:, None]
        left = np.exp(-self._depth / np.maximum(sine, _LOWEST))
        return np.asarray(left * clear + (1.0 - left) * (self.air + self._rise * sine), np.float32)

    @cached_property
    def _rise(self) -> Float:
        """Return by how much (3,) the layer's own light is brighter overhead than at the horizon.

        It rises with the sine of the elevation, as in Moon and Spencer's overcast sky (1942), so far that a level
        surface gets from all of the sky the light that the scene's surfaces get.
        """
        directions, sine = _even_directions()
        left = np.exp(-self._depth / np.maximum(sine, _LOWEST))[:, None]
        missing = self.light_below.above - (left * self._clear_sky(directions) + (1.0 - left) * self.air).mean(axis=0)
        return np.asarray(missing / ((1.0 - left) * sine[:, None]).mean(axis=0))

    def _clear_sky(self, direction: Float) -> Float:
        """Return the linear colours (N, 3) in directions (3, N) of the sky in clear air."""
        luminance = self._luminance(direction) * self._scale
        zenith = (self.light.above / max(float(self.light.above.mean()), 1e-9)) ** _DEEPER
        zenith = zenith / zenith.mean()
        share = _PALE * (1.0 - np.sqrt(np.clip(direction[2], 0.0, 1.0)))
        share = share + self.cloud_cover * (1.0 - share)
        colour = zenith + share[:, None] * (1.0 - zenith)
        return np.asarray(luminance[:, None] * colour * float(self.light.above.mean()))

    @cached_property
    def _scale(self) -> float:
        """Return the factor by which the sky's light on a level surface is that of an even sky of luminance 1."""
        return 1.0 / max(float(self._luminance(_even_directions()[0]).mean()), 1e-9)

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


def _even_directions() -> tuple[Float, Float]:
    """Return directions (3, N) over the sky whose mean light is that of a level surface, and their sines (N,)."""
    azimuth = (np.arange(_STEPS) + 0.5) * (2.0 * np.pi / _STEPS)
    sine = np.sqrt((np.arange(_STEPS) + 0.5) / _STEPS)  # even in the squared sine: equal shares of the light
    azimuth, sine = (grid.ravel() for grid in np.meshgrid(azimuth, sine))
    level = np.sqrt(1.0 - sine * sine)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), sine]), sine
