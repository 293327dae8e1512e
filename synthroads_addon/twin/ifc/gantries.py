"""Shield gantries in IFC 4.3: an assembly of posts, a beam, signs and displays."""

from __future__ import annotations

import math

from ...road.parameters import Gantry
from ...road.things import body_shapes as shapes
from ...road.things.furniture import GantrySign
from .entities import Entity
from .scene import IfcPlace, Scene
from .solids import Solids

_BURIED = 0.6
"""Depth of the posts' foundations below the surface, m."""
_SIGNS = {"display": ("IfcSignal", "display", "VISUAL"), "destination": ("IfcSign", "sheeting_blue", "PICTORAL")}
"""Kind of a sign -> its entity, material and predefined type."""


def write_gantries(scene: Scene) -> None:
    """Add all gantries."""
    for name, item in scene.geometry.parameters.of_type(Gantry).items():
        _IfcGantry(scene, name, item).write()


class _IfcGantry:
    """Writes one gantry. Its frame's y is to the left; it is turned about the middle of its beam."""

    def __init__(self, scene: Scene, name: str, item: Gantry) -> None:
        self.scene, self.ifc, self.name, self.item = scene, scene.ifc, name, item
        self.place: IfcPlace = scene.place_of(item)
        self.solids = Solids(scene.ifc, math.radians(item.rotation_deg))
        across = (item.left_offset - item.offset, item.right_offset - item.offset)
        along = (-item.reach(1.0), item.reach(-1.0))
        pavement = scene.pavement_below(self.place, along, across)
        self.low = pavement + item.clearance - float(self.place.origin[2])
        self.bottom = item.beam_bottom(self.low)

    def write(self) -> None:
        """Add the assembly and its parts."""
        item, scene = self.item, self.scene
        about, placement = f"Gantry {item.kind}", self.place.placement
        self.assembly = self.ifc.product(
            "IfcElementAssembly", self.name, "SIGNALASSEMBLY", about, placement, AssemblyPlace="SITE"
        )
        scene.describe(self.assembly, item)
        scene.stand(self.assembly, scene.parts[f"roadside-{item.post_side}"])
        middle = (item.left_offset + item.right_offset) / 2.0 - item.offset
        size = (item.beam_depth, item.left_offset - item.right_offset, item.beam_height)
        self._part("IfcBeam", "beam", self.solids.box(size, (0.0, middle, self.bottom)), "gantry_steel", "BEAM")
        for number, offset in enumerate(self._posts()):
            self._post(number, offset)
        for number, sign in enumerate(item.signs, 1):
            self._sign(number, sign)

    def _posts(self) -> list[float]:
        """Return the offsets of the posts, m."""
        item = self.item
        if item.kind == "cantilever":
            return [item.left_offset if item.post_side == "left" else item.right_offset]
        return [item.left_offset, item.right_offset, *([0.0] if item.kind == "two_sided" else [])]

    def _post(self, number: int, offset: float) -> None:
        item = self.item
        ground, _ = self.scene.at(item.station, offset)
        foot = ground + item.elevation - float(self.place.origin[2]) - _BURIED
        size = (item.beam_depth, item.post_width, self.bottom + item.beam_height - foot)
        solid = self.solids.box(size, (0.0, offset - item.offset, foot))
        self._part("IfcColumn", f"post-{number + 1}", solid, "gantry_steel", "COLUMN")

    def _sign(self, number: int, sign: GantrySign) -> None:
        """Add a sign, or a display, which is a signal; it faces the traffic of the carriageway below it."""
        item = self.item
        # Lower edges are in line; what is smaller than the beam hangs before its middle.
        small = item.ends_in_beam(sign, self.low)
        middle = self.bottom + item.beam_height / 2.0 if small else self.low + sign.height / 2.0
        z = middle - sign.height / 2.0
        # The middle of the board, before the beam as its traffic sees it.
        x = -sign.facing * (item.beam_depth / 2.0 + shapes.GANTRY_HANGER + sign.depth / 2.0)
        solid = self.solids.box((sign.depth, sign.width, sign.height), (x, sign.offset - item.offset, z))
        entity, material, kind = _SIGNS[sign.kind]
        part = self._part(entity, f"sign-{number}", solid, material, kind)
        self.ifc.properties(part, "SynthRoads sign", self.ifc.parameters_of(sign))

    def _part(self, entity: str, name: str, solid: Entity, material: str, kind: str) -> Entity:
        ifc = self.ifc
        part = self.scene.add_part(self.assembly, self.place, entity, f"{self.name}/{name}", kind)
        part.Representation = ifc.shape([solid], "SweptSolid")
        ifc.made_of(part, material)
        ifc.label(part, self.item.instance, self.item.points_class)
        return part
