"""`PointBlock`: what passes from the scanner to the writers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import AnyArray, Bool, Float, Float32, Index, UInt8, UInt16, take_rows

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

    xyz: Float
    intensity: Float
    rgb: UInt16
    class_id: UInt8
    instance_id: NDArray[np.uint32]
    return_number: UInt8
    number_of_returns: UInt8
    gps_time: Float
    scan_angle_deg: Float32
    strip: UInt16
    range: Float
    incidence_deg: Float32
    normal: Float32 | None = None
    material: UInt16 | None = None
    scanner: Float | None = None
    true_range: Float | None = None
    true_xyz: Float | None = None
    roughness: Float32 | None = None
    metallic: Float32 | None = None
    specular: Float32 | None = None
    color_source: UInt8 | None = None
    more: Mapping[str, AnyArray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.xyz)

    def select(self, keep: Bool | Index | slice) -> PointBlock:
        """Return the points chosen by a mask, indices or a slice."""
        return make_block(**{name: take_rows(array, keep) for name, array in self.attributes().items()})

    def attributes(self) -> dict[str, AnyArray]:
        """Return the block's arrays by name, without those that are None."""
        field_arrays = {name: array for name in FIELDS if (array := getattr(self, name)) is not None}
        return field_arrays | dict(self.more)

    def array(self, name: str) -> Any:
        """Return an array by its name; None if it isn't there."""
        return getattr(self, name) if name in FIELDS else self.more.get(name)

    def with_arrays(self, arrays: Mapping[str, AnyArray | None]) -> PointBlock:
        """Return a copy of the block with these arrays replaced or added; None removes one."""
        all_arrays = {name: array for name, array in {**self.attributes(), **arrays}.items() if array is not None}
        return make_block(**all_arrays)


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


def make_block(**arrays: AnyArray) -> PointBlock:
    """Return the block of these arrays; layers without a field of their own go into `more`."""
    more = {name: array for name, array in arrays.items() if name not in FIELDS}
    return PointBlock(**{name: array for name, array in arrays.items() if name in FIELDS}, more=more)


def concatenate(blocks: list[PointBlock]) -> PointBlock:
    """Return one block of all points of one or more blocks that have the same attributes, in order."""
    parts = [block.attributes() for block in blocks]
    return make_block(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
