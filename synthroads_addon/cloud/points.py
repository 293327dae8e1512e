"""`PointBlock`: what passes from the scanner to the writers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

NO_MATERIAL = 65535
"""`PointBlock.material` of points in the air, which lie on no surface."""


@dataclass(frozen=True)
class PointBlock:
    """N points in the order in which they were measured; one array per attribute.

    Attributes:
        xyz: (N, 3) float64 map coordinates, m.
        intensity: (N,) float64; an ideal white target, struck at a right angle at 1 m, being 1.
        rgb: (N, 3) uint16 sRGB.
        class_id: (N,) uint8, see `base.classes`.
        instance_id: (N,) uint32, the object's instance in the parameter set; 0 for none.
        return_number: (N,) uint8 from 1.
        number_of_returns: (N,) uint8 of the same pulse.
        gps_time: (N,) float64 s since the scan's start; the same for all returns of a pulse.
        scan_angle_deg: (N,) float32, positive to the right of the flight direction.
        strip: (N,) uint16 from 0.
        range: (N,) float64 measured range, m.
        incidence_deg: (N,) float32 angle between beam and surface normal.

    Only where something asks for them, else None:
        normal: (N, 3) float32 unit normals towards the scanner.
        material: (N,) uint16 index into the scene mesh's materials; `NO_MATERIAL` in the air.
        scanner: (N, 3) float64 map coordinates of where the pulse left the scanner.
        true_range: (N,) float64 without any error, m.
        true_xyz: (N, 3) float64 without any error.
        roughness, metallic, specular: (N,) float32 material layers.
        color_source: (N,) uint8, which image, or the material, gave colour and layers.
        more: (N, ...) arrays of other layers of `cloud.layers`, by name.
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
    normal: NDArray[np.float32] | None = None
    material: NDArray[np.uint16] | None = None
    scanner: NDArray[np.float64] | None = None
    true_range: NDArray[np.float64] | None = None
    true_xyz: NDArray[np.float64] | None = None
    roughness: NDArray[np.float32] | None = None
    metallic: NDArray[np.float32] | None = None
    specular: NDArray[np.float32] | None = None
    color_source: NDArray[np.uint8] | None = None
    more: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.xyz)

    def select(self, keep: NDArray[np.bool_] | NDArray[np.intp] | slice) -> PointBlock:
        """Return the points chosen by a mask, indices or a slice."""
        return make_block(**{name: array[keep] for name, array in self.attributes().items()})

    def attributes(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that are there, by name."""
        named = {name: array for name in FIELDS if (array := getattr(self, name)) is not None}
        return named | dict(self.more)

    def array(self, name: str) -> Any:
        """Return an array by its name; None if it isn't there."""
        return getattr(self, name) if name in FIELDS else self.more.get(name)

    def with_arrays(self, arrays: Mapping[str, NDArray[Any] | None]) -> PointBlock:
        """Return the block with arrays put in place of those of the same names; None takes one away."""
        kept = {name: array for name, array in {**self.attributes(), **arrays}.items() if array is not None}
        return make_block(**kept)


POINT_TYPES: dict[str, tuple[str, int]] = {
    "xyz": ("<f8", 3),
    "intensity": ("<f8", 1),
    "rgb": ("<u2", 3),
    "class_id": ("|u1", 1),
    "instance_id": ("<u4", 1),
    "return_number": ("|u1", 1),
    "number_of_returns": ("|u1", 1),
    "gps_time": ("<f8", 1),
    "scan_angle_deg": ("<f4", 1),
    "strip": ("<u2", 1),
}
"""Type and number of components of the arrays that every block has and every file holds."""
FIELDS = tuple(f.name for f in fields(PointBlock) if f.name != "more")


def make_block(**arrays: NDArray[Any]) -> PointBlock:
    """Return the block that arrays make up, those of `cloud.layers` that have no field of their own included."""
    more = {name: array for name, array in arrays.items() if name not in FIELDS}
    return PointBlock(**{name: array for name, array in arrays.items() if name in FIELDS}, more=more)


def concatenate(blocks: list[PointBlock]) -> PointBlock:
    """Return one block of all points, in order; at least one block is needed, and all have the same attributes."""
    parts = [block.attributes() for block in blocks]
    return make_block(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
