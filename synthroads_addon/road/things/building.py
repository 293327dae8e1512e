"""Buildings beside the road: houses, barns and halls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Place, box
from .limits import Interval, Limits, interval
from .thing import Block, StandingThing, TwinTypes

OVERHANG, SLAB = 0.45, 0.22
"""How far a roof stands out over the walls, and its thickness, m."""
STOREY = 2.8
"""Height of a storey, m."""
WINDOW, DOOR = (1.1, 1.25), (1.1, 2.1)
"""Width and height of a window and of a door, m."""
GATE = (4.0, 3.6)
"""Width and height of a barn's or hall's gate at most, m."""
_PROUD = 0.04
"""How far windows and doors stand out of the wall, m."""
_BAY = 2.7
"""Width of wall that a window has, m at least."""
WALLS = {"house": "plaster", "brick_house": "brick", "barn": "noise_wood", "hall": "noise_aluminium"}
"""Kind of building -> material of its walls."""
ROOFS = {"house": "roof_tiles", "brick_house": "roof_tiles", "barn": "roof_tiles", "hall": "noise_aluminium"}
"""Kind of building -> material of its roof."""


class BuildingLimits(Limits):
    """Limits of buildings."""

    group: ClassVar = "roadside"
    place: ClassVar = 30
    allowed: ClassVar = {"buildings_per_km": (0.0, 100.0)}

    buildings_per_km: Interval = interval(
        0.0, 2.5, "1/km", "Buildings per km of either side, 40 m from the pavement.", title="Buildings (per km)"
    )


class Building(StandingThing):
    """A building with a gable roof, its ridge along its width; a roof that rises by nothing is flat."""

    points_class: ClassVar = "roadside"
    order: ClassVar = 170
    limits: ClassVar = BuildingLimits
    clearing: ClassVar = 1.5
    type: Literal["Building"] = "Building"
    kind: Literal["house", "brick_house", "barn", "hall"] = Field("house", description="What it is.")
    width: float = quantity(11.0, ge=2, le=80, unit="m", description="Width, seen from the road that it faces.")
    depth: float = quantity(9.0, ge=2, le=60, unit="m", description="Depth.")
    height: float = quantity(5.6, ge=2, le=30, unit="m", description="Eaves above the highest ground at its walls.")
    roof_height: float = quantity(4.0, ge=0, le=20, unit="m", description="Ridge above the eaves.")
    at_street: Annotated[bool, Field(strict=True)] | None = Field(
        None, description="Whether it stands at a street, with other things close beside it."
    )

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a building."""
        whole_type, part_type = "Building", "BuildingConstructiveElement"
        return TwinTypes(
            "IfcElementAssembly.USERDEFINED.SITE", f"building.{self.kind}", whole_type, part_type, kind=self.kind
        )

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of walls, roof and chimney in its frame; windows and doors are details."""
        x, y = (np.array([-0.5, 0.5, 0.5, -0.5, 0.0]) * self.width, np.array([-0.5, -0.5, 0.5, 0.5, 0.0]) * self.depth)
        ground = place.ground(x, y)
        floor, bottom = float(np.max(ground)), float(np.min(ground)) - BURIED
        eaves = floor + self.height
        walls = Body(self._walls(bottom, eaves), WALLS[self.kind], "walls", "IfcWall.SOLIDWALL")
        return [walls, *self._roof(eaves), *self._openings(floor)]

    def _walls(self, bottom: float, eaves: float) -> Float:
        """Return the sections of walls and gables: an outline across the ridge, extruded along it."""
        half_depth = self.depth / 2.0
        outline = [(-half_depth, bottom), (half_depth, bottom), (half_depth, eaves), (-half_depth, eaves)]
        if self.roof_height > 0.0:
            outline.insert(3, (0.0, eaves + self.roof_height))
        return self._along(outline, self.width / 2.0)

    def _roof(self, eaves: float) -> Iterator[Body]:
        """Yield the slabs of the roof and a house's chimney."""
        half_length, half_span = self.width / 2.0 + OVERHANG, self.depth / 2.0 + OVERHANG
        ridge, material = eaves + self.roof_height, ROOFS[self.kind]
        # The roof's plane goes on beyond the wall: by so much the overhang's edge lies below the eaves.
        drop = OVERHANG * self.roof_height / (self.depth / 2.0)
        for side in (-1.0, 1.0):
            slope = [
                (0.0, ridge),
                (side * half_span, eaves - drop),
                (side * half_span, eaves - drop + SLAB),
                (0.0, ridge + SLAB),
            ]
            shape = self._along(slope if side > 0.0 else slope[::-1], half_length)
            yield Body(shape, material, "roof", "IfcRoof.GABLE_ROOF")
        if self.kind in ("house", "brick_house"):
            top = ridge + 0.7
            size = (0.5, 0.5, top - eaves)
            shape = box(size, (self.width * 0.2, self.depth * 0.08, (top + eaves) / 2.0))
            yield Body(shape, "brick", "chimney", "IfcChimney.NOTDEFINED")

    @staticmethod
    def _along(outline: list[tuple[float, float]], half_length: float) -> Float:
        """Return the sections (2, K, 3) of an outline in y, z extruded along x from -half_length to half_length, m."""
        corners = np.array(outline)
        return np.stack([np.column_stack([np.full(len(corners), x), corners]) for x in (-half_length, half_length)])

    def _openings(self, floor: float) -> Iterator[Body]:
        """Yield windows, doors and gates, which stand out of the walls by a little."""
        if self.kind in ("barn", "hall"):
            gate_width, gate_height = min(GATE[0], 0.5 * self.width), min(GATE[1], self.height - 0.3)
            for side in (-1.0, 1.0):
                yield self._opening((0.0, side, floor), (gate_width, gate_height), "gantry_steel")
            return
        bays = max(1, int(self.width / _BAY))
        pitch = self.width / bays
        for storey in range(max(1, int(self.height / STOREY))):
            sill = floor + storey * STOREY + 0.9
            for side in (-1.0, 1.0):
                for bay in range(bays):
                    x = (bay - (bays - 1) / 2.0) * pitch
                    if storey == 0 and side < 0.0 and bay == bays // 2:
                        yield self._opening((x, side, floor), DOOR, "noise_wood")
                    else:
                        yield self._opening((x, side, sill), WINDOW, "glass")

    def _opening(self, place: tuple[float, float, float], size: tuple[float, float], material: str) -> Body:
        """Return a window, door or gate as a thin box before a wall.

        Args:
            place: x of its middle (m), side of the wall (-1 or 1 in y), and height of its lower edge (m).
            size: width and height, m.
            material: of its surface.
        """
        x, side, bottom = place
        middle = (x, side * self.depth / 2.0, bottom + size[1] / 2.0)
        return Body(box((size[0], 2.0 * _PROUD, size[1]), middle), material, "openings", detail=_PROUD)

    def footprint(self) -> Iterator[Block]:
        """Yield the box in which nothing else may stand: it holds it however it is turned, at a street as it stands."""
        top = self.height + self.roof_height + 1.0
        if self.at_street:
            turn = math.radians(self.rotation_deg)
            sine, cosine, s, d = abs(math.sin(turn)), abs(math.cos(turn)), self.station, self.offset
            width, depth = self.width / 2.0 + OVERHANG, self.depth / 2.0 + OVERHANG
            along, across = cosine * depth + sine * width, sine * depth + cosine * width
            yield Block("foot", s - along, s + along, d - across, d + across, self.elevation, self.elevation + top)
            return
        radius = math.hypot(self.width, self.depth) / 2.0 + OVERHANG
        yield self.upright(radius, top)
