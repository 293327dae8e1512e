"""An IFC 4.3 file in the making: entities with stable identifiers, placements, properties, relations, materials.

Everything that says the same of several objects (a container's elements, a material's) is gathered, and becomes one
relation each at the end. Identifiers come from the objects' names, never from chance or from the clock.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, MissingPackageError
from ...base.schema import Model, canonical_json, unit_of
from ...materials.table import UNKNOWN, materials
from ..trace import Trace

Float = NDArray[np.float64]
Entity = Any
"""An instance in the file (`ifcopenshell.entity_instance`)."""
Values = Mapping[str, Entity]

SCHEMA = "IFC4X3_ADD2"
LENGTH_DIGITS = 6
"""Digits of coordinates: a micrometre."""
_DIRECTION_DIGITS = 10
_LONGEST_LABEL = 255
_HEADER_TIME = "1970-01-01T00:00:00"
_MEASURES = {"m": "IfcLengthMeasure", "m/s": "IfcLinearVelocityMeasure"}


def import_ifcopenshell() -> Any:
    """Import and return `ifcopenshell`, or raise an InputError that says how to install it."""
    try:
        import ifcopenshell
        import ifcopenshell.guid
    except ImportError:
        raise MissingPackageError("twin", "ifc", "ifcopenshell", "twin") from None
    return ifcopenshell


def rounded(values: Any, digits: int = LENGTH_DIGITS) -> Any:
    """Return numbers rounded to decimals as (nested) lists of floats, without negative zeros."""
    return (np.round(np.asarray(values, dtype=np.float64), digits) + 0.0).tolist()


class IfcFile:
    """An IFC file in the making, with reproducible identifiers and relations gathered until the end.

    Attributes:
        file: ifcopenshell's file.
        project: the IfcProject, once it is there.
        trace: it is told which numbers became which entities.
    """

    def __init__(self, namespace: str, trace: Trace) -> None:
        """Make an empty file; ``namespace`` (the road's identifier) keeps apart the identifiers of different roads."""
        self.trace = trace
        ifcopenshell = import_ifcopenshell()
        self.file = ifcopenshell.file(schema=SCHEMA)
        self._schema = ifcopenshell.schema_by_name(SCHEMA)
        self._compress = ifcopenshell.guid.compress
        self._namespace = namespace
        self._keys: set[str] = set()
        self._gathered: dict[tuple[str, int, str], tuple[Entity, list[Entity]]] = {}
        self._materials: dict[str, Entity] = {}
        self._styles: dict[str, Entity] = {}
        self._directions: dict[tuple[float, ...], Entity] = {}
        self._shapes: dict[object, Entity] = {}
        self._maps: dict[object, Entity] = {}
        self.project: Entity = None
        self.contexts: dict[str, Entity] = {}
        self.origin = self.add("IfcCartesianPoint", [0.0, 0.0, 0.0])
        self.flat_axes = self.add("IfcAxis2Placement3D", self.origin, None, None)
        self.local_frame = self.add("IfcLocalPlacement", None, self.flat_axes)

    # --- entities -------------------------------------------------------------------------------------------------

    def add(self, entity: str, *values: Any, **attributes: Any) -> Entity:
        """Add an entity of an IFC class with attributes by position or name, and return it."""
        return self.file.create_entity(entity, *values, **attributes)

    def has_type(self, entity: str, kind: str) -> bool:
        """Return whether the schema has a concrete element or bridge class with this predefined type."""
        try:
            declaration = self._schema.declaration_by_name(entity)
        except RuntimeError:
            return False
        classes, ancestor = [], declaration
        while ancestor:
            classes.append(ancestor.name())
            ancestor = ancestor.supertype()
        if declaration.is_abstract() or not {"IfcElement", "IfcBridge"}.intersection(classes):
            return False
        for attribute in declaration.all_attributes():
            if attribute.name() == "PredefinedType":
                return kind in attribute.type_of_attribute().declared_type().enumeration_items()
        return False

    def guid(self, key: str) -> str:
        """Return the compressed GlobalId hashed from the road's identifier and a key; ValueError if it was used."""
        if key in self._keys:
            raise ValueError(f"two objects have the key {key!r}")
        self._keys.add(key)
        digest = hashlib.sha256(f"{self._namespace}\n{key}".encode()).digest()[:16]
        # The version and variant bits of a UUID by a hash of the application's choice (RFC 9562, version 8).
        uuid_bytes = bytearray(digest)
        uuid_bytes[6] = uuid_bytes[6] & 0x0F | 0x80
        uuid_bytes[8] = uuid_bytes[8] & 0x3F | 0x80
        return str(self._compress(bytes(uuid_bytes).hex()))

    def add_root(self, entity: str, key: str, **attributes: Any) -> Entity:
        """Add and return an entity with a GlobalId, which is hashed from its class and key."""
        return self.add(entity, GlobalId=self.guid(f"{entity}/{key}"), **attributes)

    def add_product(
        self,
        entity: str,
        name: str,
        kind: str,
        object_type: str | None = None,
        placement: Entity = None,
        **attributes: Any,
    ) -> Entity:
        """Add and return an IfcProduct: `kind` is its predefined type, `object_type` its object type.

        Without a placement its coordinates are local. Its key is its name.
        """
        placement = self.local_frame if placement is None else placement
        attributes = {
            "Name": name,
            "ObjectType": object_type,
            "ObjectPlacement": placement,
            "PredefinedType": kind,
        } | attributes
        return self.add_root(entity, name, **attributes)

    # --- geometry -------------------------------------------------------------------------------------------------

    def point(self, *coordinates: float) -> Entity:
        """Add and return an IfcCartesianPoint, rounded to micrometres."""
        return self.add("IfcCartesianPoint", rounded(coordinates))

    def direction(self, *ratios: float) -> Entity:
        """Return an IfcDirection; equal ones are one entity."""
        key = tuple(rounded(ratios, _DIRECTION_DIGITS))
        if key not in self._directions:
            self._directions[key] = self.add("IfcDirection", list(key))
        return self._directions[key]

    def heading(self, angle: float, dimension: int = 2) -> Entity:
        """Return the IfcDirection (2D or 3D) of a horizontal angle from the x axis, rad."""
        return self.direction(*(math.cos(angle), math.sin(angle), 0.0)[:dimension])

    def axes_2d(self, x: float, y: float, angle: float) -> Entity:
        """Add and return an IfcAxis2Placement2D at a point, its x axis at an angle (rad)."""
        return self.add("IfcAxis2Placement2D", self.point(x, y), self.heading(angle))

    def axes_3d(self, place: Sequence[float], angle: float = 0.0) -> Entity:
        """Add and return an upright IfcAxis2Placement3D, turned about the vertical by an angle (rad)."""
        return self.add(
            "IfcAxis2Placement3D", self.point(*place), self.direction(0.0, 0.0, 1.0), self.heading(angle, 3)
        )

    def length_measure(self, value: float) -> Entity:
        """Return an IfcLengthMeasure (m) for attributes whose type is a choice."""
        return self.add("IfcLengthMeasure", rounded(value, 9))

    def mesh(self, vertices: Float, triangles: NDArray[np.intp], closed: bool) -> Entity | None:
        """Add and return an IfcTriangulatedFaceSet; None if all triangles are degenerate.

        Args:
            vertices: (N, 3) m, in the frame of the product's placement.
            triangles: (M, 3) indices, counter-clockwise from outside or above.
            closed: whether it bounds a solid.
        """
        rounded_vertices = np.round(vertices, LENGTH_DIGITS) + 0.0
        unique_points, index = np.unique(rounded_vertices, axis=0, return_inverse=True)
        corners = index.reshape(-1)[triangles]
        a, b, c = corners.T
        corners = corners[(a != b) & (b != c) & (c != a)]
        if not len(corners):
            return None
        used_points, numbers = np.unique(corners, return_inverse=True)
        points = self.add("IfcCartesianPointList3D", unique_points[used_points].tolist())
        rows_from_1 = (numbers.reshape(-1, 3) + 1).tolist()
        return self.add("IfcTriangulatedFaceSet", Coordinates=points, Closed=closed, CoordIndex=rows_from_1)

    def shape(self, items: Iterable[Entity | None], kind: str, key: object = None) -> Entity | None:
        """Add and return a product's body from items of one representation type; None if there are no items.

        Bodies of the same ``key`` are one: the second product shares the first one's.
        """
        if key is not None and key in self._shapes:
            return self._shapes[key]
        bodies = [item for item in items if item is not None]
        if not bodies:
            return None
        body = self.add("IfcShapeRepresentation", self.contexts["Body"], "Body", kind, bodies)
        entity = self.add("IfcProductDefinitionShape", None, None, [body])
        if key is not None:
            self._shapes[key] = entity
        return entity

    def has_shape(self, key: object) -> bool:
        """Return whether a body with this key has been added."""
        return key in self._shapes

    def scaled_shape(self, key: object, make: Callable[[], list[Entity]], scale: tuple[float, float, float]) -> Entity:
        """Add and return a scaled copy of a mapped shape, which `make` creates once per key."""
        if key not in self._maps:
            shape = self.add("IfcShapeRepresentation", self.contexts["Body"], "Body", "Tessellation", make())
            self._maps[key] = self.add("IfcRepresentationMap", self.flat_axes, shape)
        x, y, z = rounded(scale)
        target = self.add(
            "IfcCartesianTransformationOperator3DnonUniform",
            LocalOrigin=self.origin,
            Scale=x,
            Scale2=y,
            Scale3=z,
        )
        item = self.add("IfcMappedItem", self._maps[key], target)
        body = self.add("IfcShapeRepresentation", self.contexts["Body"], "Body", "MappedRepresentation", [item])
        return self.add("IfcProductDefinitionShape", None, None, [body])

    # --- what is said of objects ----------------------------------------------------------------------------------

    def note_relation(self, relation: str, owner: Entity, members: Iterable[Entity], group: str = "") -> None:
        """Note members of a relation (``IfcRelAggregates``, ...) to an object; `relate` writes it at the end.

        Those of different groups become relations of their own.
        """
        self._gathered.setdefault((relation, owner.id(), group), (owner, []))[1].extend(members)

    def add_labels(self, item: Entity, instance: int, class_name: str, model: Model | None = None) -> None:
        """Give an entity the property set `SynthRoads`: instance number, class of its points, and a model's fields."""
        values = {"instance": self.value(instance), "class": self.value(class_name)}
        self.add_properties(item, "SynthRoads", values | (self.parameters_of(model) if model else {}))

    def add_properties(self, item: Entity, name: str, values: Values) -> None:
        """Add a property set to an entity, none if it is empty; lists of strings become enumerated values."""
        entities = [self._property(key, value) for key, value in values.items()]
        if not entities:
            return
        if name == "SynthRoads" and "instance" in values:
            self.trace.record_entity(values["instance"].wrappedValue, entity=item.is_a(), GlobalId=item.GlobalId)
        key = f"{item.GlobalId}/{name}"
        definition = self.add_root("IfcPropertySet", key, Name=name, HasProperties=entities)
        self.add_root("IfcRelDefinesByProperties", key, RelatedObjects=[item], RelatingPropertyDefinition=definition)

    def _property(self, name: str, value: Entity | list[str]) -> Entity:
        """Add and return a property: an enumerated one for a list of labels, else one with a single value."""
        if isinstance(value, list):
            labels = [self.add("IfcLabel", label) for label in value]
            return self.add("IfcPropertyEnumeratedValue", name, None, labels, None)
        return self.add("IfcPropertySingleValue", name, None, value, None)

    def value(self, value: object, unit: str = "") -> Entity:
        """Return a Python value as an IFC simple type by its type and unit; structured values become JSON text."""
        if isinstance(value, bool):
            return self.add("IfcBoolean", value)
        if isinstance(value, int):
            return self.add("IfcInteger", value)
        if isinstance(value, float):
            return self.add(_MEASURES.get(unit, "IfcReal"), value + 0.0)
        text = value if isinstance(value, str) else " ".join(canonical_json(_plain(value)).split())
        return self.add("IfcLabel" if isinstance(value, str) and len(text) <= _LONGEST_LABEL else "IfcText", text)

    def parameters_of(self, model: Model) -> dict[str, Entity]:
        """Return a model's fields that aren't None as IFC values, by field name."""
        fields = type(model).model_fields
        values = {name: (getattr(model, name), unit_of(field)) for name, field in fields.items()}
        return {name: self.value(value, unit) for name, (value, unit) in values.items() if value is not None}

    def assign_material(self, item: Entity, name: str) -> None:
        """Assign an object a material of the material table by name; the material is added once."""
        if name not in self._materials:
            self._materials[name] = self._material(name)
        self.note_relation("IfcRelAssociatesMaterial", self._materials[name], [item])

    def assign_style(self, item: Entity, name: str) -> None:
        """Give one body of an object the surface style of a material other than the object's."""
        if name not in self._materials:
            self._materials[name] = self._material(name)
        self.add("IfcStyledItem", item, [self._styles[name]], None)

    def _material(self, name: str) -> Entity:
        """Add and return an IfcMaterial, its surface style in the table's base colour (or the unknown material's)."""
        entry = materials().get(name, materials()[UNKNOWN])
        # Viewers show the colour without converting it, so it has to be encoded for displays (gamma 2.2) here.
        red, green, blue = rounded([channel ** (1.0 / 2.2) for channel in entry.base_color], 4)
        material = self.add("IfcMaterial", Name=name)
        colour = self.add("IfcColourRgb", None, red, green, blue)
        shading = self.add("IfcSurfaceStyleShading", colour, None)
        style = self._styles[name] = self.add("IfcSurfaceStyle", name, "BOTH", [shading])
        item = self.add("IfcStyledItem", None, [style], None)
        representation = self.add("IfcStyledRepresentation", self.contexts["Body"], "Style", "Material", [item])
        self.add("IfcMaterialDefinitionRepresentation", None, None, [representation], material)
        return material

    # --- the end --------------------------------------------------------------------------------------------------

    def write_relations(self) -> None:
        """Write the gathered relations to the file, one entity each, and clear them."""
        for (relation, _, group), (owner, members) in self._gathered.items():
            owner_attribute, members_attribute = _RELATIONS[relation]
            key = f"{owner.GlobalId if hasattr(owner, 'GlobalId') else owner.Name}/{group}"
            self.add_root(relation, key, **{owner_attribute: owner, members_attribute: members})
        self._gathered.clear()

    def write(self, path: Path, title: str, program: str) -> None:
        """Write the IFC file to a path; its header has a fixed time, so that the same road gives the same bytes."""
        header = self.file.header
        header.file_description.description = ("ViewDefinition [NotAssigned]",)
        name = header.file_name
        name.name, name.time_stamp, name.author, name.organization = title, _HEADER_TIME, ("",), ("",)
        name.preprocessor_version, name.originating_system = "IfcOpenShell", program
        name.authorization = ""
        try:
            self.file.write(str(path))
        except RuntimeError as error:
            raise InputError(str(path), None, f"cannot be written ({error})") from None


_RELATIONS = {
    "IfcRelAggregates": ("RelatingObject", "RelatedObjects"),
    "IfcRelNests": ("RelatingObject", "RelatedObjects"),
    "IfcRelContainedInSpatialStructure": ("RelatingStructure", "RelatedElements"),
    "IfcRelReferencedInSpatialStructure": ("RelatingStructure", "RelatedElements"),
    "IfcRelAssociatesMaterial": ("RelatingMaterial", "RelatedObjects"),
    "IfcRelAdheresToElement": ("RelatingElement", "RelatedSurfaceFeatures"),
    "IfcRelPositions": ("RelatingPositioningElement", "RelatedProducts"),
}
"""Relation -> its attributes for the one object and for the many."""


def _plain(value: object) -> object:
    """Return a value with the models in it, also in tuples and lists, turned into JSON data."""
    if isinstance(value, Model):
        return value.to_dict()
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value
