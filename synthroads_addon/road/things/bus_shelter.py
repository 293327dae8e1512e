"""Bus shelters: a roof on posts over a bench, with walls of glass, wood or brick at the back and the sides."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.schema import quantity
from .body import BURIED, Body, Place, box
from .thing import Block, StandingThing, TwinTypes

WALLS = {"glass": "glass", "wood": "noise_wood", "brick": "brick"}
"""Kind of shelter -> material of its walls."""
THICKNESS = {"glass": 0.012, "wood": 0.05, "brick": 0.24}
"""Kind of shelter -> thickness of its walls, m. Chosen."""
ROOFS = {"glass": "galvanised_steel", "wood": "roof_tiles", "brick": "roof_tiles"}
"""Kind of shelter -> material of its roof."""
SLAB, ROOF_THICKNESS, OVERHANG = 0.03, 0.12, 0.15
"""Rise of its floor above the highest ground below it, thickness of the roof, and how far it stands out, m. Chosen."""
POST, GAP = 0.08, 0.15
"""Width of its posts, and height of glass walls above the floor, m. Chosen."""
BENCH_HEIGHT, BENCH_DEPTH, BENCH_THICKNESS = 0.45, 0.4, 0.05
"""Height, depth and thickness of the bench, m. Chosen."""
_SIDE_SHARE = 0.8
"""Length of side walls as a share of the depth. Chosen: the front stays open."""
_BENCH_SHARE = 0.7
"""Length of the bench as a share of the width. Chosen."""
_CORNERS = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (0.0, 0.0)])


class BusShelter(StandingThing):
    """A bus shelter. It faces as a sign does: at rotation 0 its open side looks against the stations."""

    points_class: ClassVar = "roadside"
    order: ClassVar = 171
    clearing: ClassVar = 0.5
    type: Literal["BusShelter"] = "BusShelter"
    kind: Literal["glass", "wood", "brick"] = Field("glass", description="What its walls are of.")
    width: float = quantity(3.0, "m", "Width of its open side.", (1, 12))
    depth: float = quantity(1.5, "m", "Depth.", (0.8, 5))
    height: float = quantity(2.5, "m", "Top of its roof above its floor.", (2, 5))

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a shelter, which is an assembly."""
        return TwinTypes("IfcElementAssembly.USERDEFINED.SITE", f"building.{self.kind}Shelter", kind="bus shelter")

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of floor, posts, walls, roof and bench in its frame."""
        x, y = (_CORNERS * (self.width, self.depth)).T
        ground = place.ground(x, y)
        floor, bottom = float(np.max(ground)) + SLAB, float(np.min(ground)) - BURIED
        roof_bottom, thickness = floor + self.height - ROOF_THICKNESS, THICKNESS[self.kind]
        bodies = [
            self._part((0.0, 0.0), (self.width, self.depth), (bottom, floor), "concrete", "floor", "IfcSlab.PAVING"),
            self._part(
                (0.0, 0.0),
                (self.width + 2.0 * OVERHANG, self.depth + 2.0 * OVERHANG),
                (roof_bottom, roof_bottom + ROOF_THICKNESS),
                ROOFS[self.kind],
                "roof",
                "IfcRoof.FLAT_ROOF",
            ),
        ]
        bodies += [
            self._part(
                (i * (self.width - POST) / 2.0, j * (self.depth - POST) / 2.0),
                (POST, POST),
                (floor, roof_bottom),
                "noise_wood" if self.kind == "wood" else "galvanised_steel",
                "posts",
                "IfcColumn.COLUMN",
            )
            for i in (-1.0, 1.0)
            for j in (-1.0, 1.0)
        ]
        wall_bottom = floor + (GAP if self.kind == "glass" else 0.0)
        span = (wall_bottom, roof_bottom - (GAP if self.kind == "glass" else 0.0))
        back = (self.depth - thickness) / 2.0
        walls = [((0.0, back), (self.width - 2.0 * POST, thickness))]
        length = self.depth * _SIDE_SHARE - thickness
        for i in (-1.0, 1.0):
            middle = (i * (self.width - thickness) / 2.0, self.depth / 2.0 - thickness - length / 2.0)
            walls.append((middle, (thickness, length)))
        bodies += [
            self._part(middle, size, span, WALLS[self.kind], "walls", "IfcWall.SOLIDWALL") for middle, size in walls
        ]
        seat = floor + BENCH_HEIGHT
        bench = (self.width * _BENCH_SHARE, BENCH_DEPTH)
        middle = (0.0, self.depth / 2.0 - thickness - 0.1 - BENCH_DEPTH / 2.0)
        bodies.append(
            self._part(middle, bench, (seat - BENCH_THICKNESS, seat), "noise_wood", "bench", "IfcFurniture.NOTDEFINED")
        )
        for i in (-1.0, 1.0):
            leg = (middle[0] + i * (bench[0] / 2.0 - POST), middle[1])
            legs = (POST, BENCH_DEPTH - POST), (floor, seat - BENCH_THICKNESS)
            bodies.append(self._part(leg, *legs, "galvanised_steel", "bench", "IfcFurniture.NOTDEFINED"))
        return bodies

    @staticmethod
    def _part(
        middle: tuple[float, float],
        size: tuple[float, float],
        span: tuple[float, float],
        material: str,
        part: str,
        ifc: str,
    ) -> Body:
        """Return a box around a place (x, y), of a size (x, y), between two heights, all m."""
        height = span[1] - span[0]
        return Body(box((*size, height), (*middle, (span[0] + span[1]) / 2.0)), material, part, ifc)

    def footprint(self) -> Iterator[Block]:
        """Yield the box that holds it, on a slope too; nothing else may stand there."""
        turn = np.radians(self.rotation_deg)
        sine, cosine = float(abs(np.sin(turn))), float(abs(np.cos(turn)))
        half_width, half_depth = self.width / 2.0 + OVERHANG, self.depth / 2.0 + OVERHANG
        along, across = sine * half_width + cosine * half_depth, cosine * half_width + sine * half_depth
        s, d, z = self.station, self.offset, self.elevation
        yield Block("foot", s - along, s + along, d - across, d + across, z, z + SLAB + self.height)
