"""Street sides of a carriageway in the nodes: gutter, parking bays, kerb and footway, lifted above the pavement."""

from __future__ import annotations

from collections.abc import Mapping

from ....base.classes import class_id
from ...nodes import operations as op
from ...nodes.builder import Operand, Tree, Value, makes_group
from ...nodes.inputs import FAR, Input, Inputs, backbone_socket, inputs_class, instance_number, material_of, metres
from ...nodes.strip import SEALED, StripFaces, strip_group
from .layout import STREET_NAMES
from .section import FAR_FROM_AXIS, Section, height_group


class _StreetStrip(Inputs):
    backbone = backbone_socket()
    inner_distance = metres(5.0, FAR_FROM_AXIS, "Distance of its inner edge from the axis")
    outer_distance = metres(9.0, FAR_FROM_AXIS, "Distance of its outer edge from the axis")
    inner_lift = metres(0.0, FAR, "Height of its inner edge above the pavement's plane where that ends")
    outer_lift = metres(0.12, FAR, "Height of its outer edge above the pavement's plane where that ends")


@makes_group("SR Street Strip")
def street_strip_group(tree: Tree) -> None:
    """A strip between two distances from the axis, its edges lifted above the pavement's plane; both may be fields."""
    strip, section, faces = _StreetStrip(tree), Section(tree), StripFaces(tree)
    with tree.frame("Both edges: outwards is to the left on the left side"):
        edges: dict[str, Value] = {}
        for name, if_left, if_right in (("left", "outer", "inner"), ("right", "inner", "outer")):
            values = strip.values
            distance, lift = (
                op.switch(section.left_side, values[f"{if_right}_{field}"], values[f"{if_left}_{field}"])
                for field in ("distance", "lift")
            )
            edge = tree.call(height_group(), **section.values, distance=distance)
            edges |= {f"{name}_offset": edge["Offset"], f"{name}_height": edge["Height"] + lift}
    with tree.frame("Strip"):
        mesh = tree.call(strip_group(), backbone=strip.backbone, **edges, **faces.values).value
    tree.output("Mesh", mesh, description="Ribbon whose faces look up")


def field_of(strip: str) -> str:
    """Return the input field of a strip's or street side's name: "Hard Shoulder" -> "hard_shoulder"."""
    return strip.lower().replace(" ", "_")


def street_fields(street: str) -> dict[str, Input]:
    """Return the input fields of a street side by name: start and end station, instance number, materials."""
    field = field_of(street)
    return {
        f"{field}_start_station": metres(0.0, (-1e6, 1e6), "Beginning of the street side"),
        f"{field}_end_station": metres(0.0, (-1e6, 1e6), "End of the street side"),
        f"{field}_instance": instance_number(),
        f"{field}_gutter_material": material_of("the gutter", "setts"),
        f"{field}_bay_material": material_of("the parking bays", "setts"),
        f"{field}_kerb_material": material_of("the kerb", "granite"),
        f"{field}_footway_material": material_of("the footway", "concrete_pavers"),
    }


_MATERIAL_OF_STRIP = {
    "Gutter": "gutter",
    "Parking Bay": "bay",
    "Kerb Face": "kerb",
    "Kerb": "kerb",
    "Footway": "footway",
}
"""Word of the input of each strip's material."""
_DRIVEN = ("Gutter", "Parking Bay")
"""Strips of street sides in the class of the road; the others lie beside it."""


class StreetInputs:
    """The inputs of street sides in the node group of a carriageway, and what a face has by its station."""

    def __init__(self, tree: Tree, count: int) -> None:
        self._tree = tree
        self._names = tuple(f"Side {number}" for number in range(1, count + 1))
        fields = {
            f"{field_of(strip)}_lift": metres(0.0, FAR, f"Height of the {strip.lower()}'s outer edge above the plane")
            for strip in STREET_NAMES[1:]
        }
        fields["verge_extra_width"] = metres(0.0, FAR, "Width that the verge has in addition, which may be negative")
        for name in self._names:
            fields |= street_fields(name)
        with tree.panel("Street Sides"):
            self.values = inputs_class("Streets", fields)(tree).values
        self._station = op.named_attribute(tree, "station")

    def lift(self, strip: str) -> Operand:
        """Return the height of a strip's outer edge above the plane, m."""
        return self.values.get(f"{field_of(strip)}_lift", 0.0)

    def edge_lift(self, distances: list[Value], verge_slope: Value) -> Operand:
        """Add nodes for the height of the verge's outer edge above the plane, m, by the boundaries' distances, m."""
        return self.lift("Footway") - (distances[-1] - distances[-2]) * verge_slope

    def instance(self) -> Operand:
        """Add nodes for the instance number of the street side at a face's station."""
        result: Operand = self.values["side_1_instance"]
        for name in self._names[1:]:
            result = op.switch(self._is_in(name), result, self.values[f"{field_of(name)}_instance"])
        return result

    def with_materials(self, mesh: Value, strip: str) -> Value:
        """Add nodes that give the faces of a strip the material of their street side, but those of the first one."""
        for name in self._names[1:]:
            mesh = mesh.tree.node(
                "GeometryNodeSetMaterial", mesh, selection=self._is_in(name), material=self.material(strip, name)
            ).value
        return mesh

    def material(self, strip: str, name: str = "Side 1") -> Value:
        """Return the material of a strip of a street side."""
        return self.values[f"{field_of(name)}_{_MATERIAL_OF_STRIP[strip]}_material"]

    def mesh(
        self,
        strips: list[str],
        number: int,
        about: Mapping[str, Operand],
        distances: list[Value],
        edge_lift: Operand,
    ) -> Value:
        """Add nodes for one of the strips, or the verge behind them, with its class, instance and materials.

        Args:
            strips: names of the carriageway's strips from the median outwards.
            number: index of the one that is wanted.
            about: inputs of SR Street Strip that all strips share, and the verge's instance and material.
            distances: of the strips' boundaries from the axis, m.
            edge_lift: height of the verge's outer edge above the plane, m.
        """
        strip, lift = strips[number], self.lift(strips[number - 1])
        about = {**about, "inner_distance": distances[number], "outer_distance": distances[number + 1]}
        if strip == "Verge":
            return self._tree.call(
                street_strip_group(), **about, inner_lift=lift, outer_lift=edge_lift, class_=class_id("roadside")
            ).value
        labels: dict[str, Operand] = {
            "class_": class_id("road" if strip in _DRIVEN else "roadside"),
            "instance": self.instance(),
            "material": self.material(strip),
        }
        mesh = self._tree.call(
            street_strip_group(), **{**about, **labels}, inner_lift=lift, outer_lift=self.lift(strip)
        ).value
        return op.store(self.with_materials(mesh, strip), SEALED, 1, "FACE")

    def _is_in(self, name: str) -> Value:
        """Add nodes for whether a face's station lies on a street side."""
        start, end = (self.values[f"{field_of(name)}_{end}_station"] for end in ("start", "end"))
        return (self._station >= start) & (self._station <= end)
