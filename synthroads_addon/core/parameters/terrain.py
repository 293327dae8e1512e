"""The ground beside the road before the batter meets it: analytic, so that it can be sampled anywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..random_streams import stream
from .geometry import RoadGeometry
from .model import Terrain

_WAVES = 24
_OCTAVES = 3.0


def ground_elevation(
    geometry: RoadGeometry, terrain: Terrain, station: NDArray[np.float64], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the ground's local elevation (N,) at stations and offsets (N,), without batter.

    The ground follows the profile at ``embankment_height`` below it and undulates as a sum of seeded plane waves over
    the local plan, whose wavelengths spread over three octaves above ``wavelength`` and whose heights have the standard
    deviation ``undulation``.
    """
    position, heading, _ = geometry.alignment.frame(station)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    plan = position + offset[:, None] * left
    rng = stream(terrain.seed, "terrain undulation")
    octave = rng.uniform(0.0, _OCTAVES, _WAVES)
    direction = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    phase = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    # Longer waves are higher; a wave of amplitude a has the variance a^2 / 2.
    weight = 2.0**octave
    amplitude = terrain.undulation * weight * np.sqrt(2.0 / np.sum(weight**2))
    number = 2.0 * np.pi / (terrain.wavelength * weight)
    vectors = number * np.stack([np.cos(direction), np.sin(direction)])
    waves = np.sin(plan @ vectors + phase) @ amplitude
    return geometry.profile.elevation(station) - terrain.embankment_height + waves
