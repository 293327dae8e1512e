"""`PointBlock`: what passes from the scanner to the writers."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PointBlock:
    """N points in the order in which they were measured; one array per attribute.

    Attributes:
        xyz: (N, 3) float64 map coordinates, m.
        intensity: (N,) float64; an ideal white target, struck at a right angle at 1 m, being 1.
        rgb: (N, 3) uint16 sRGB.
        class_id: (N,) uint8, see `labels`.
        instance_id: (N,) uint32, the object's instance in the parameter set; 0 for none.
        return_number: (N,) uint8 from 1.
        number_of_returns: (N,) uint8 of the same pulse.
        gps_time: (N,) float64 s since the scan's start; the same for all returns of a pulse.
        scan_angle_deg: (N,) float32, positive to the right of the flight direction.
        strip: (N,) uint16 from 0.
        range: (N,) float64 measured range, m.
        incidence_deg: (N,) float32 angle between beam and surface normal.
    """

    xyz: NDArray[np.float64]
    intensity: NDArray[np.float64]
    rgb: NDArray[np.uint16]
    class_id: NDArray[np.uint8]
    instance_id: NDArray[np.uint32]
    return_number: NDArray[np.uint8]
    number_of_returns: NDArray[np.uint8]
    gps_time: NDArray[np.float64]
    scan_angle_deg: NDArray[np.float32]
    strip: NDArray[np.uint16]
    range: NDArray[np.float64]
    incidence_deg: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.xyz)

    def select(self, keep: NDArray[np.bool_] | NDArray[np.intp]) -> PointBlock:
        """Return the points chosen by a mask or by indices."""
        return PointBlock(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})


def concatenate(blocks: list[PointBlock]) -> PointBlock:
    """Return one block of all points, in order; at least one block is needed."""
    names = [f.name for f in fields(PointBlock)]
    return PointBlock(**{name: np.concatenate([getattr(block, name) for block in blocks]) for name in names})
