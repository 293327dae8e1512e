"""Light on the scene as the points' colours need it: sun, open sky, and the drifting shadows of clouds."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Float, Float32
from ...base.random_streams import stream
from ...road.surroundings import Environment

SUN = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
"""Direction of a usual sun, where no environment says another. Chosen: some 55 degrees high."""
WHITE = 0.9
"""Exposure: linear value of a white matt horizontal surface in the sun. Chosen: leaves room for gloss."""
GROUND_ALBEDO = 0.2
"""Share of the light that the ground throws back at what faces down. As is usual in models of solar radiation (soil and
grass)."""
SHADE = 0.15
"""Share of the direct sun below a cloud. Chosen: a shadow that is seen, and not black."""
_CELLS = 256
"""Cells along the periodic field of clouds. Chosen: 32 clouds before it repeats."""
_CELL = 1.0 / 8.0
"""Width of a cell as a share of a cloud. Chosen: edges are some cells wide."""
_OCTAVES = ((8, 1.0), (4, 0.45), (2, 0.2))
"""Cells per feature and its weight, from the clouds' own size down. Chosen: weights fall by about a half."""
_PENUMBRA = 0.04
"""Half the width of a shadow's edge, as a share of the field's range: some 10 m of a cloud of 120 m. Chosen: soft, as
the sun is half a degree wide."""


def sun_direction(environment: Environment) -> Float:
    """Return the unit vector (3,) towards an environment's sun; x east, y north, z up."""
    azimuth, elevation = np.deg2rad([environment.sun_azimuth_deg, environment.sun_elevation_deg])
    return np.array([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])


@dataclass(frozen=True)
class SunAndSky:
    """Light that a white matt surface reflects, exposed so that `WHITE` is a horizontal one's value in the sun.

    Attributes:
        direction: (3,) unit vector towards the sun.
        sun: (3,) of a surface that faces the sun.
        above: (3,) of a surface that faces the open sky straight up.
        below: (3,) of a surface that faces the ground straight down.
    """

    direction: Float = field(default_factory=SUN.copy)
    sun: Float = field(default_factory=lambda: np.full(3, 0.55))
    above: Float = field(default_factory=lambda: np.full(3, 0.45))
    below: Float = field(default_factory=lambda: np.full(3, 0.45))

    def sunlight(self, normal: NDArray[np.floating]) -> Float32:
        """Return (N, 3) light of the sun on white matt surfaces with these unit normals (N, 3), unshadowed."""
        cosine = np.clip(np.asarray(normal, np.float32) @ self.direction.astype(np.float32), 0.0, None)
        return np.asarray(cosine[:, None] * self.sun.astype(np.float32))

    def sky(self, normal: NDArray[np.floating]) -> Float32:
        """Return (N, 3) light of an unobstructed sky, and of the ground below it, on white matt surfaces.

        A surface sees a share (1 + n_z) / 2 of an even sky.
        """
        share = (1.0 + np.asarray(normal, np.float32)[:, 2]) / 2.0
        ground_share, result = 1.0 - share, np.empty((len(share), 3), np.float32)
        colours = zip(self.above.astype(np.float32), self.below.astype(np.float32), strict=True)
        for column, (sky_light, ground_light) in enumerate(colours):  # long rows are several times as fast
            np.add(share * sky_light, ground_share * ground_light, out=result[:, column])
        return result


def expose_light(direction: Float, sun: Float, sky: Float) -> tuple[SunAndSky, float]:
    """Return sun and sky, scaled so that a white horizontal surface in the sun has the value `WHITE`, and the factor.

    Args:
        direction: (3,) unit vector towards the sun.
        sun: (3,) radiance of a white matt surface that faces the sun.
        sky: (3,) radiance of one that faces straight up, from the sky alone.
    """
    horizontal = sun * max(float(direction[2]), 0.0) + sky
    exposure = WHITE / max(float(horizontal.mean()), 1e-9)
    ground_light = GROUND_ALBEDO * horizontal
    return SunAndSky(direction, sun * exposure, sky * exposure, ground_light * exposure), exposure


class CloudShadows:
    """Shadows of clouds: a periodic field of the direct sun's transmission that drifts with the wind.

    A cloud's shadow is soft-edged and leaves `SHADE` of the direct sun; its share of the ground is the
    environment's cloud cover.
    """

    def __init__(self, environment: Environment, seed: int, frame: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Build the field of clouds from a seed; `frame` (3,) is the local frame's origin in the whole road's, m."""
        self.environment = environment
        self._frame = np.asarray(frame, dtype=np.float64)
        self._cell = environment.cloud_size * _CELL
        heading = np.deg2rad(environment.cloud_direction_deg)
        self.drift: Float = environment.cloud_speed * np.array([np.sin(heading), np.cos(heading)])
        sun = sun_direction(environment)
        # At sunset shadows would be infinitely long.
        self._slope = sun[:2] / max(float(sun[2]), 0.05)
        self._field = _cloud_field(environment.cloud_cover, seed)

    def transmission(self, position: Float, time: ArrayLike) -> Float32:
        """Return the share (N,) of the direct sun at local positions (N, 3), m, and times (N,) or one time, s."""
        position = position + self._frame
        # Along the sun's ray down to height 0, where the field is; then back with the wind to where it was at time 0.
        plan = position[:, :2] - position[:, 2:3] * self._slope
        plan = plan - np.asarray(time, np.float64).reshape(-1, 1) * self.drift
        cell_place = plan / self._cell
        corner = np.floor(cell_place).astype(np.int64)
        # Bilinear between the four lattice points around each place; the lattice is periodic.
        u, v = (cell_place - corner).T.astype(np.float32)
        i, j = (corner % _CELLS).T
        next_i, next_j = (i + 1) % _CELLS, (j + 1) % _CELLS
        field = self._field
        value_before = (1 - u) * field[i, j] + u * field[next_i, j]
        value_after = (1 - u) * field[i, next_j] + u * field[next_i, next_j]
        return np.asarray((1 - v) * value_before + v * value_after)


def _cloud_field(cover: float, seed: int) -> Float32:
    """Return the transmission of the direct sun, `SHADE` to 1, on a periodic lattice (`_CELLS`, `_CELLS`).

    Args:
        cover: share of the lattice that clouds shade, 0 to 1.
        seed: of the clouds.
    """
    random = stream(seed, "cloud shadows")
    density = np.zeros((_CELLS, _CELLS))
    for cells, weight in _OCTAVES:
        coarse_noise = random.normal(size=(_CELLS // cells,) * 2)
        density += weight * _upsample(_upsample(coarse_noise, cells).T, cells).T
    # The densest share of the field is cloud: ranks are even from 0 to 1, so the cover is met exactly.
    rank = np.argsort(np.argsort(density, axis=None)).reshape(density.shape) / density.size
    cloud = np.clip((rank - (1.0 - cover)) / (2.0 * _PENUMBRA) + 0.5, 0.0, 1.0)
    if cover in (0.0, 1.0):
        cloud = np.full(density.shape, cover)
    return np.asarray(1.0 - (1.0 - SHADE) * cloud, np.float32)


def _upsample(values: Float, cells: int) -> Float:
    """Return a periodic field's rows (n, m) upsampled to (n * cells, m), with cubic steps between them."""
    t = (np.arange(cells) / cells)[:, None]
    # Cubic Hermite step 3 t^2 - 2 t^3: without slope at both ends, so that the field has no creases.
    step = t * t * (3.0 - 2.0 * t)
    next_values = np.roll(values, -1, axis=0)
    rows = values[:, None, :] * (1.0 - step) + next_values[:, None, :] * step
    return np.asarray(rows.reshape(-1, values.shape[1]))
