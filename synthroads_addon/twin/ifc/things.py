"""Things of the road in IFC 4.3: one element each, or an assembly or a bridge of elements, as they say themselves.

What stands at one place is placed there, its rotation is in its body; what runs along the road is placed at its
beginning. Bodies that are outlines pushed along an axis become extrusions, the others closed meshes; things of the same
bodies share them. Fittings are left out.
"""

from __future__ import annotations

import math
from typing import Any

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.progress import Progress
from ...road.other_roads.guardrail import RampGuardrail
from ...road.things.body import Body, rotate_z
from ...road.things.thing import LengthwiseThing, StandingThing, Thing, TwinTypes
from ..things import PlacedThing, begin_beside, placed_things
from .entities import Entity, Values
from .scene import STAGE, IfcPlace, Scene
from .solids import assign_bodies

_SUBSTRUCTURE = ("IfcColumn", "IfcWall")
"""Elements that carry a bridge."""


def write_things(scene: Scene, progress: Progress) -> None:
    """Add every thing on and beside the road to the IFC file, and record what is left out."""
    count = len(scene.geometry.parameters.of_type(Thing))
    for number, placed in enumerate(placed_things(scene.geometry, scene.tolerance)):
        progress(STAGE, number / count)
        _Writer(scene, placed).write()
        scene.ifc.trace.record_omissions(placed)


class _Writer:
    """Writer of one thing as an element, an assembly or a bridge."""

    def __init__(self, scene: Scene, placed: PlacedThing) -> None:
        self.scene, self.ifc = scene, scene.ifc
        self.name, self.thing = placed.name, placed.thing
        self.bodies = [body for body in placed.bodies if not body.detail]
        self.types = self.thing.twin()
        self.station, self.offset, elevation = _foot_place(scene, self.thing)
        self.place: IfcPlace = scene.place(self.station, self.offset, elevation)

    def write(self) -> None:
        """Add the thing with its properties, bodies and parts, and put it into its spatial container."""
        entity, kind, *assembly_place = self.types.ifc.split(".")
        self._check(entity, kind)
        is_bridge = entity == "IfcBridge"
        attributes = (
            {"AssemblyPlace": assembly_place[0]}
            if assembly_place
            else {"CompositionType": "ELEMENT"}
            if is_bridge
            else {}
        )
        object_type = self.types.kind or type(self.thing).__name__
        element = self.ifc.add_product(entity, self.name, kind, object_type, self.place.placement, **attributes)
        self.scene.add_parameters(element, self.thing)
        if is_bridge:
            self.ifc.note_relation("IfcRelAggregates", self.scene.site, [element])
            self.ifc.note_relation("IfcRelPositions", self.scene.axis.alignment, [element])
        else:
            offset = self.thing.foot_offset if isinstance(self.thing, StandingThing) else self.offset
            self.scene.contain(element, self.scene.container(self.station, offset))
        self.ifc.add_properties(element, *self._common(entity))
        self._give_bodies(element, [body for body in self.bodies if not body.ifc])
        parts: dict[str, list[Body]] = {}
        for body in self.bodies:
            if body.ifc:
                parts.setdefault(body.part, []).append(body)
        self._parts(element, parts, is_bridge)

    def _check(self, entity: str, kind: str) -> None:
        """Raise an InputError if IFC 4.3 has no such type; record in the trace if it is only a proxy."""
        if entity == TwinTypes().ifc.partition(".")[0]:
            self.ifc.trace.record_loss(self.name, "a proxy: neither its library nor its class says what it is")
        if not self.ifc.has_type(entity, kind):
            allowed = "must be an element of IFC 4.3 and one of its predefined types, with a dot between them"
            raise InputError(f"objects.{self.name}.twin_types.ifc", self.types.ifc, allowed)

    def _parts(self, whole: Entity, parts: dict[str, list[Body]], is_bridge: bool) -> None:
        """Add a thing's part elements; a bridge's go into its superstructure or substructure."""
        spatial: dict[str, Entity] = {}
        models = self.thing.part_models()
        for name, bodies in parts.items():
            entity, kind = bodies[0].ifc.split(".")
            if is_bridge:
                half = "substructure" if entity in _SUBSTRUCTURE else "superstructure"
                if half not in spatial:
                    usage = {"CompositionType": "PARTIAL", "UsageType": "VERTICAL"}
                    spatial[half] = self._add_part(whole, "IfcBridgePart", half, half.upper(), **usage)
                element = self.ifc.add_product(
                    entity, f"{self.name}/{name}", kind, placement=self.place.frame(self.ifc)
                )
                self.ifc.note_relation("IfcRelContainedInSpatialStructure", spatial[half], [element])
            else:
                element = self._add_part(whole, entity, name, kind)
            if kind == "USERDEFINED":
                element.ObjectType = name.rstrip("-0123456789").upper()
            self._give_bodies(element, bodies)
            self.ifc.add_labels(element, self.thing.instance, self.thing.semantic_class)
            if name in models:
                self.ifc.add_properties(element, "SynthRoads sign", self.ifc.parameters_of(models[name]))

    def _add_part(self, whole: Entity, entity: str, name: str, kind: str, **attributes: Any) -> Entity:
        """Add and return an element that the whole aggregates, placed at the thing's frame."""
        frame = self.place.frame(self.ifc)
        part = self.ifc.add_product(entity, f"{self.name}/{name}", kind, placement=frame, **attributes)
        self.ifc.note_relation("IfcRelAggregates", whole, [part])
        return part

    def _common(self, entity: str) -> tuple[str, Values]:
        """Return the name and values of the standard property set for an entity class; empty if it has none."""
        ifc, is_external = self.ifc, self.ifc.value(True)
        status = ["TEMPORARY" if self.types.temporary else "EXISTING"]
        if entity == "IfcRailing":
            height = float(getattr(self.thing, "height", 0.0))
            height_value = {"Height": ifc.add("IfcPositiveLengthMeasure", height)} if height > 0.0 else {}
            return "Pset_RailingCommon", {"Status": status, **height_value, "IsExternal": is_external}
        if entity == "IfcWall":
            return "Pset_WallCommon", {"Status": status, "IsExternal": is_external}
        if entity != "IfcSign":
            return "", {}
        category = {"IsExternal": is_external, "Category": ifc.add("IfcLabel", type(self.thing).__name__)}
        reference = self.types.reference
        return "Pset_SignCommon", category | ({"Reference": ifc.add("IfcIdentifier", reference)} if reference else {})

    def _give_bodies(self, product: Entity, bodies: list[Body]) -> None:
        """Set a product's shape from bodies in the placement's frame; without bodies it gets none."""
        if bodies:
            assign_bodies(self.ifc, product, [(self._to_placement(body.sections), body.material) for body in bodies])

    def _to_placement(self, sections: Float) -> Float:
        """Transform sections into the thing's placement: x along the road, y to the left."""
        if isinstance(self.thing, StandingThing):
            return rotate_z(sections, self.thing.turn - math.pi / 2.0)
        return self.place.to_frame(sections)


def _foot_place(scene: Scene, thing: Thing) -> tuple[float, float, float]:
    """Return station, offset and height above the surface (m) of the point at which a thing is placed."""
    if isinstance(thing, StandingThing):
        return thing.station, thing.offset, thing.elevation
    if isinstance(thing, RampGuardrail):
        return (*begin_beside(scene.geometry, thing), 0.0)
    assert isinstance(thing, LengthwiseThing)
    return min(max(thing.start_station, 0.0), scene.geometry.length), thing.offset, 0.0
