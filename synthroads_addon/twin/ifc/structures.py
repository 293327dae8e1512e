"""Structures across the road in IFC 4.3: gantries as assemblies of posts, a beam, signs and displays; bridges."""

from __future__ import annotations

import math

import numpy as np

from ...road.things import gantry as sizes
from ...road.things import overpass as overpass_sizes
from ...road.things.gantry import Gantry, GantrySign
from ...road.things.overpass import Overpass
from .entities import Entity
from .scene import IfcPlace, Scene
from .solids import Point2, Solids

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
        x = -sign.facing * (item.beam_depth / 2.0 + sizes.HANGER + sign.depth / 2.0)
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


_RAILING, _LOWEST_RAILING = 0.09, 0.5
"""Thickness of a railing, and the height (m) from which there is one."""


def write_overpasses(scene: Scene) -> None:
    """Add all overpasses."""
    for name, item in scene.geometry.parameters.of_type(Overpass).items():
        _Bridge(scene, name, item).write()


class _Bridge:
    """Writes one bridge. A skewed one is sheared: the ends of its deck stay parallel to the road."""

    def __init__(self, scene: Scene, name: str, item: Overpass) -> None:
        self.scene, self.ifc, self.name, self.item = scene, scene.ifc, name, item
        self.place: IfcPlace = scene.place_of(item)
        self.shear = math.tan(math.radians(item.rotation_deg))
        self.left, self.right = item.left_abutment - item.offset, item.right_abutment - item.offset
        along, across = (-item.width / 2.0, item.width / 2.0), (self.left, self.right)
        pavement = scene.pavement_below(self.place, along, across, self.shear)
        self.low = pavement + item.clearance - float(self.place.origin[2])
        self.solids = Solids(scene.ifc)

    def write(self) -> None:
        """Add the bridge, its parts and their elements."""
        ifc, item = self.ifc, self.item
        self.bridge = ifc.product(
            "IfcBridge", self.name, "NOTDEFINED", item.type, self.place.placement, CompositionType="ELEMENT"
        )
        ifc.gather("IfcRelAggregates", self.scene.site, [self.bridge])
        ifc.gather("IfcRelPositions", self.scene.axis.alignment, [self.bridge])
        self.scene.describe(self.bridge, item)
        above, below = self._part("superstructure"), self._part("substructure")
        self._deck(above)
        for number, offset in enumerate(item.pier_offsets, 1):
            size = (item.width * overpass_sizes.PIER_LENGTH, item.pier_width)
            self._support(below, "IfcColumn", f"pier-{number}", "PIERSTEM", offset - item.offset, size)
        for name, face, behind in (("left", self.left, 1.0), ("right", self.right, -1.0)):
            size = (item.width, overpass_sizes.ABUTMENT)
            middle = face + behind * overpass_sizes.ABUTMENT / 2.0
            self._support(below, "IfcWall", f"abutment-{name}", "RETAININGWALL", middle, size)

    def _part(self, kind: str) -> Entity:
        usage = {"CompositionType": "PARTIAL", "UsageType": "VERTICAL"}
        return self.scene.add_part(
            self.bridge, self.place, "IfcBridgePart", f"{self.name}/{kind}", kind.upper(), **usage
        )

    def _deck(self, part: Entity) -> None:
        item, left, right = self.item, self.left + overpass_sizes.SEAT, self.right - overpass_sizes.SEAT
        half = item.width / 2.0
        deck = self.solids.prism(self._strip(left, right, -half, half), (0.0, 0.0, self.low), item.deck_thickness)
        self._element(part, "IfcSlab", "deck", deck, "USERDEFINED", "bridge_concrete", "BRIDGEDECK")
        if item.parapet_height < _LOWEST_RAILING:
            return
        top = self.low + item.deck_thickness
        for name, near, far in (("near", -half, -half + _RAILING), ("far", half - _RAILING, half)):
            body = self.solids.prism(self._strip(left, right, near, far), (0.0, 0.0, top), item.parapet_height)
            self._element(part, "IfcRailing", f"railing-{name}", body, "BALUSTRADE", "galvanised_steel")

    def _strip(self, left: float, right: float, near: float, far: float) -> list[Point2]:
        """Return a strip across the road, x along the road and y to its left, against the clock."""
        return [(x - self.shear * y, y) for x, y in ((near, left), (near, right), (far, right), (far, left))]

    def _support(self, part: Entity, entity: str, name: str, kind: str, y: float, size: Point2) -> None:
        """Add what the deck rests on, from below the ground up to its bearings."""
        x = -self.shear * y
        station, offset = self.scene.geometry.alignment.project(self.place.plan(np.array([x]), np.array([y])))
        ground, _ = self.scene.at(float(station[0]), float(offset[0]))
        foot = ground - float(self.place.origin[2]) - overpass_sizes.BURIED
        height = max(self.low - overpass_sizes.BEARING - foot, overpass_sizes.BEARING)
        body = self.solids.box((*size, height), (x, y, foot))
        self._element(part, entity, name, body, kind, "bridge_concrete")

    def _element(
        self, part: Entity, entity: str, name: str, body: Entity, kind: str, material: str, about: str | None = None
    ) -> None:
        ifc = self.ifc
        frame, shape = self.place.frame(ifc), ifc.shape([body], "SweptSolid")
        made = ifc.product(entity, f"{self.name}/{name}", kind, about, frame, Representation=shape)
        ifc.gather("IfcRelContainedInSpatialStructure", part, [made])
        ifc.made_of(made, material)
        ifc.label(made, self.item.instance, self.item.points_class)
