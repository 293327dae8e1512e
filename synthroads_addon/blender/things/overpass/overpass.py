"""SR Overpass: a bridge over the road, with piers, abutments, wing walls and embankments."""

from __future__ import annotations

import bpy
import numpy as np

from ....base.classes import class_id
from ....road.other_roads.parts import CrossingRoad
from ....road.things import overpass as sizes
from ....road.things.overpass import Overpass
from ...nodes import operations as op
from ...nodes.backbone import height_on
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.clearance import highest_below, pavement_near
from ...nodes.inputs import Inputs, instance_number, material_of, metres, number, socket
from ...nodes.solids import flip_faces, move_geometry, put_on_points
from ..meshes import fill
from ..model_builder import ModelBuilder
from ..registry import model_part
from .deck import bridge_deck_group
from .embankment import bridge_embankment_group
from .supports import bridge_abutment_group, bridge_pier_group


class _Overpass(Inputs):
    piers = socket("Geometry", "A point per pier, in the middle of the deck")
    road = socket("Object", "Surface with the pavement below")
    terrain = socket("Object", "Surface beside the road")
    left_abutment = metres(20.0, (1.0, 300.0), "Face of the left abutment, left of the origin")
    right_abutment = metres(-20.0, (-300.0, -1.0), "Face of the right one, negative: right of the origin")
    left_approach_length = metres(40.0, (0.0, 500.0), "Embankment behind the left face; 0 for none")
    right_approach_length = metres(40.0, (0.0, 500.0), "Embankment behind the right face; 0 for none")
    skew = number(0.0, (-1.0, 1.0), "Turn about the vertical", unit="rad")
    width = metres(10.0, (2.0, 60.0), "Width of the deck along the road")
    clearance = metres(4.9, (3.0, 20.0), "Underside above the pavement's highest point below it")
    deck_thickness = metres(1.2, (0.3, 5.0), "Height of the deck")
    parapet_height = metres(1.1, (0.0, 3.0), "Top of the railings above the deck; none below 0.5 m")
    pier_width = metres(1.0, (0.2, 4.0), "Width of a pier across the road")
    slope = number(1.5, (0.5, 10.0), "Run of the embankments per metre of height (m/m)")
    concrete_material = material_of("deck, piers and walls", "bridge_concrete")
    edge_material = material_of("edge beams", "barrier_concrete")
    steel_material = material_of("railings and bearings", "galvanised_steel")
    pavement_material = material_of("the crossing road", "asphalt")
    ground_material = material_of("the embankments", "grass_ground")
    instance = instance_number()

    def __init__(self, tree: Tree) -> None:
        """Declare the inputs, and add nodes for `faces`: x (m) of the abutments' faces by side, -1 left, +1 right."""
        super().__init__(tree)
        self.faces = {-1.0: -self.left_abutment, 1.0: -self.right_abutment}


@makes_group("SR Overpass", catalogue="Structures")
def overpass_group(tree: Tree) -> None:
    """A level bridge around the origin, which crosses along y; the road that it spans runs along x.

    Piers are points, of which only y counts. The bridge is skewed by moving it along x: its faces stay parallel to x.
    Within the group it is made with x to the right and y along the road, and turned at the end.
    """
    bridge = _Overpass(tree)

    with tree.frame("Surfaces and skew"):
        surfaces = op.object_geometry_across(bridge.road), op.object_geometry_across(bridge.terrain)
        shear = op.unary("TANGENT", bridge.skew)
    with tree.frame("Underside, above the pavement's highest point"):
        reach = op.maximum(bridge.faces[1.0], -bridge.faces[-1.0]) * 1.5 + bridge.width
        pavement = pavement_near(surfaces[0], reach)
        edges = bridge.width * -0.5, bridge.width * 0.5
        underside = highest_below(pavement, bridge.faces[-1.0], bridge.faces[1.0], edges, shear) + bridge.clearance
    with tree.frame("Ground at the abutments, and wing walls"):
        foot_heights = {side: _lowest_ground(bridge, shear, face) for side, face in bridge.faces.items()}
        wing_lengths = {side: _wing_length(bridge, underside, foot) for side, foot in foot_heights.items()}
    with tree.frame("Deck and abutments, skewed"):
        mesh = op.join(
            _deck(bridge, underside, wing_lengths),
            *(_abutment(bridge, underside, foot_heights, wing_lengths, side) for side in (-1.0, 1.0)),
        )
        place = op.position(tree)
        mesh = op.set_position(mesh, place + op.vector(tree, 0.0, op.component(place, "X") * shear))
    with tree.frame("Piers, parallel to the road"):
        mesh = op.join(mesh, _piers(bridge, shear, underside))
    with tree.frame("Embankments"):
        ground = op.join(*surfaces)
        banks = [_embankment(bridge, ground, underside, wing_lengths[side], shear, side) for side in (-1.0, 1.0)]
    with tree.frame("Labels"):
        mesh = op.join(op.store(mesh, "class_id", class_id(Overpass.points_class), "FACE"), *banks)
        mesh = op.along(op.store(mesh, "instance_id", bridge.instance, "FACE"))
    tree.output("Mesh", mesh, description="The bridge; its embankments' slopes are ground")


def _height_across(bridge: _Overpass, place: Value) -> Value:
    """Add nodes for the z (m) of the ground at a place whose x is to the right and whose y is along the road."""
    x, y = op.component(place, "X"), op.component(place, "Y")
    return height_on(bridge.road, bridge.terrain, op.vector(bridge.tree, y, x * -1.0))


def _lowest_ground(bridge: _Overpass, shear: Value, face: Value) -> Value:
    """Add nodes for the lower z (m) of the ground at both ends of an abutment's face."""
    ends = [
        _height_across(bridge, op.vector(bridge.tree, face, bridge.width * half + face * shear)) for half in (0.5, -0.5)
    ]
    return op.minimum(*ends)


def _wing_length(bridge: _Overpass, underside: Value, foot: Value) -> Value:
    """Add nodes for the wing walls' length (m), such that the embankment's cones reach the abutment's face."""
    cone_reach = (underside + bridge.deck_thickness - foot) * bridge.slope
    return op.clip(cone_reach, *sizes.WINGS)


def _deck(bridge: _Overpass, underside: Value, wing_lengths: dict[float, Value]) -> Value:
    """Add nodes for the deck, straight, with its edge beams over the wing walls."""
    left_face, right_face = bridge.faces[-1.0], bridge.faces[1.0]
    deck = bridge.tree.call(
        bridge_deck_group(),
        deck_start=left_face - sizes.SEAT,
        deck_end=right_face + sizes.SEAT,
        start=left_face - wing_lengths[-1.0],
        end=right_face + wing_lengths[1.0],
        width=bridge.width,
        thickness=bridge.deck_thickness,
        parapet_height=bridge.parapet_height,
        concrete_material=bridge.concrete_material,
        edge_material=bridge.edge_material,
        steel_material=bridge.steel_material,
        pavement_material=bridge.pavement_material,
    ).value
    return move_geometry(deck, op.vector(bridge.tree, 0.0, 0.0, underside))


def _abutment(
    bridge: _Overpass, underside: Value, foot_heights: dict[float, Value], wing_lengths: dict[float, Value], side: float
) -> Value:
    """Add nodes for the abutment of one side (-1 left, +1 right), straight."""
    tree = bridge.tree
    abutment = tree.call(
        bridge_abutment_group(),
        width=bridge.width,
        thickness=bridge.deck_thickness,
        foot=foot_heights[side] - underside - sizes.BURIED,
        wing_length=wing_lengths[side],
        concrete_material=bridge.concrete_material,
        steel_material=bridge.steel_material,
    ).value
    if side < 0.0:
        abutment = flip_faces(op.transform(abutment, scale=(-1.0, 1.0, 1.0)))
    return move_geometry(abutment, op.vector(tree, bridge.faces[side], 0.0, underside))


def _piers(bridge: _Overpass, shear: Value, underside: Value) -> Value:
    """Add nodes for the piers with their bearings, each on the surface below it."""
    tree = bridge.tree
    pier = tree.call(
        bridge_pier_group(),
        pier_width=bridge.pier_width,
        width=bridge.width,
        concrete_material=bridge.concrete_material,
        steel_material=bridge.steel_material,
    )
    piers = op.across(bridge.piers)
    x = op.component(op.position(tree), "X")
    plan = op.vector(tree, x, x * shear)
    points = op.store(piers, "foot", _height_across(bridge, plan) - sizes.BURIED)
    pier_height = underside - sizes.BEARING - op.named_attribute(tree, "foot")
    top = plan + op.vector(tree, 0.0, 0.0, underside - sizes.BEARING)
    bodies = put_on_points(points, pier["Body"], top, op.vector(tree, 1.0, 1.0, pier_height))
    return op.realize(
        op.join(bodies, put_on_points(points, pier["Bearings"], plan + op.vector(tree, 0.0, 0.0, underside)))
    )


def _embankment(
    bridge: _Overpass, ground: Value, underside: Value, wing_length: Value, shear: Value, side: float
) -> Value:
    """Add nodes for the embankment of one side (-1 left, +1 right)."""
    approach = bridge.left_approach_length if side < 0.0 else bridge.right_approach_length
    bank = bridge.tree.call(
        bridge_embankment_group(),
        ground=ground,
        face=bridge.faces[side],
        side=side,
        wing_length=wing_length,
        length=op.maximum(approach, wing_length + 1.0),
        top=underside + bridge.deck_thickness,
        width=bridge.width,
        edge_width=bridge.width * sizes.EDGE,
        shear=shear,
        slope=bridge.slope,
        pavement_material=bridge.pavement_material,
        ground_material=bridge.ground_material,
    ).value
    return op.only_if(approach > 0.0, bank)


_LONGEST_APPROACH = 150.0
"""Largest length (m) of the embankments; chosen."""
_APPROACH_ALONE = 20.0
"""Length (m) of the embankments without terrain; chosen."""


@model_part("overpasses", 100)
def build_overpasses(builder: ModelBuilder) -> None:
    """Add one object per overpass to the model."""
    terrain = builder.parameters.terrain
    carrying = {road.bridge for road in builder.parameters.of_type(CrossingRoad).values()}
    for name, bridge in builder.parameters.of_type(Overpass).items():
        approaches = {}
        for side, face in (("left", bridge.left_abutment), ("right", -bridge.right_abutment)):
            # The embankment ends where the terrain does.
            reach = terrain.half_width - face if terrain else _APPROACH_ALONE
            length = float(np.clip(reach, 1.0, _LONGEST_APPROACH))
            # A crossing road has embankments of its own.
            approaches[f"{side}_approach_length"] = 0.0 if name in carrying else length
        mesh = bpy.data.meshes.new("SR Overpass")
        across = np.array([bridge.offset - offset for offset in bridge.pier_offsets])
        fill(mesh, np.column_stack([np.zeros(len(across)), -across, np.zeros(len(across))]))
        builder.add_thing(
            name,
            bridge,
            overpass_group(),
            mesh,
            **approaches,
            left_abutment=bridge.left_abutment - bridge.offset,
            right_abutment=bridge.right_abutment - bridge.offset,
            skew=float(np.deg2rad(bridge.rotation_deg)),
            slope=terrain.batter_slope if terrain else 1.5,
        )
