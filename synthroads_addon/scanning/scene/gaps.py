"""Leaves and gaps that a face stands for: which of them the rays of a beam meet.

A leaf's triangle stands for the leaves of a twig and for what is open between them, as a mesh of single leaves would be
hundreds of times as large. A beam narrower than a tuft of leaves meets it or passes by; one that is wider does both. So
space is divided into cells as large as the tufts. In each there is a gap with the probability of the material's
transmission, by a hash of the cell and the seed: a place has its leaves in every strip, for every scanner and every
order of the blocks. A ray stands for a part of the beam's cross-section. It is looked up at four places that are spread
as far as that part (the corners of a tetrahedron, the same from all sides), and goes on with the share that is open
there: all or nothing where the beam is narrow, about the transmission where it is wide.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ...base.arithmetic.noise import hash_cells
from ...base.arrays import Float, Index
from ...base.random_streams import stream
from ...materials.surfaces import Surfaces
from ..beam import beam_radii
from ..devices.device import ScannerSetting

CORNERS = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]) / math.sqrt(3.0)
"""Corners of a regular tetrahedron around the origin, with a radius of 1."""


@dataclass(frozen=True)
class LeafGaps:
    """How the rays of a scan meet leaves and gaps.

    Attributes:
        solid_angle: of the beam at 1/e2, m2 of its cross-section for each m2 of squared distance.
        key: of the cells' random numbers.
        frame_origin: (3,) origin of the scene's local frame in the coordinates of the cells, m.
    """

    solid_angle: float
    key: int
    frame_origin: Float = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def of(cls, setting: ScannerSetting, seed: int, frame_origin: Float) -> LeafGaps:
        """Return the gaps that a scanner's beam meets in the scene of a seed."""
        radii = beam_radii(setting.divergence)
        key = int(stream(seed, "leaf gaps").integers(0, 2**32, dtype=np.uint32))
        return cls(math.pi * radii[0] * radii[1], key, frame_origin)

    def transmitted(self, surfaces: Surfaces, material: Index, place: Float, distance: Float, share: Float) -> Float:
        """Return the share (N,) of its light that each of N rays keeps behind a face with gaps: 0, 1/4, 1/2, 3/4 or 1.

        Args:
            surfaces: the materials.
            material: (N,) of the face, one with a ``gap_size``.
            place: (3, N) where the ray meets it, local, m.
            distance: (N,) from the scanner, m.
            share: (N,) of the pulse's energy that the ray stands for, light lost on its way not counted.
        """
        cell_size = np.take(surfaces.gap_size, material)
        # Hashes are even from 0 to 2^32: a cell is open with the probability of the material's transmission.
        open_below = np.take(surfaces.transmission, material) * 2.0**32
        # The mean squared distance of the corners from the ray is that of a disc of the ray's cross-section A, in three
        # dimensions in place of two: r^2 = 3/2 (A / pi) / 2.
        radius = np.sqrt(0.75 / math.pi * self.solid_angle * share) * distance
        centre = (place + self.frame_origin[:, None]) / cell_size
        scaled_radius = radius / cell_size
        open_corners = np.zeros(len(material))
        for corner in CORNERS:
            cells = np.floor(centre + corner[:, None] * scaled_radius).astype(np.int64)
            open_corners += hash_cells(cells, self.key) < open_below
        return open_corners / len(CORNERS)
