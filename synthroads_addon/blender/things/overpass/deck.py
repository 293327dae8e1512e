"""SR Bridge Deck: a bridge's deck with two webs, the edge beams on it, the pavement and the railings."""

from __future__ import annotations

from ....road.things import overpass as sizes
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, material_of, metres
from ...nodes.solids import box, flip_faces, loft, move_geometry, paint_faces, put_on_points, row_of_points

WEB = sizes.DECK[1][0], sizes.DECK[2][0]
"""Where the webs begin and end beside the middle, as shares of half the deck's width."""
PAVEMENT = 0.05
"""Thickness of the asphalt, m."""
EDGE = 0.1
"""Width of an edge beam as a share of the deck's."""
# An edge beam: 1 for its inner side and 0 for the outer one; 1 for the back of its nose; 1 on top, 0 and -1 below.
_BEAM = [(0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, -1.0)]
_CURB = 0.15
"""Height of the edge beams above the pavement, m."""
_NOSE = (0.3, 0.45)
"""Thickness of the edge beam's outer face, and how far it hangs below the pavement, m."""
_LOWEST_PARAPET = 0.5


class _Deck(Inputs):
    deck_start = metres(-20.0, (-300.0, 300.0), "x of the deck's left end")
    deck_end = metres(20.0, (-300.0, 300.0), "x of its right end")
    start = metres(-28.0, (-300.0, 300.0), "x of the edge beams' left end")
    end = metres(28.0, (-300.0, 300.0), "x of their right end")
    width = metres(10.0, (2.0, 60.0), "Width")
    thickness = metres(1.2, (0.3, 5.0), "Height from the underside to the pavement's top")
    parapet_height = metres(1.1, (0.0, 3.0), "Top of the railings above the pavement; none below 0.5 m")
    concrete_material = material_of("the deck")
    edge_material = material_of("edge beams")
    steel_material = material_of("railings")
    pavement_material = material_of("the crossing road")


@makes_group("SR Bridge Deck")
def bridge_deck_group(tree: Tree) -> None:
    """A deck along x with its underside on z = 0; edge beams, pavement and railings go on over the wing walls."""
    inputs = _Deck(tree)
    start, end, width, height = inputs.start, inputs.end, inputs.width, inputs.thickness
    with tree.frame("Deck"):
        deck = paint_faces(_deck(tree, (inputs.deck_start, inputs.deck_end), width, height), inputs.concrete_material)
    with tree.frame("Edge beam"):
        beam = paint_faces(_edge_beam(tree, (start, end), width, height), inputs.edge_material)
        beams = op.join(beam, flip_faces(op.transform(beam, scale=(1.0, -1.0, 1.0))))
    with tree.frame("Pavement between the edge beams"):
        size = op.vector(tree, end - start, width * (1.0 - 1.96 * EDGE), PAVEMENT)
        road = box(tree, size, op.vector(tree, (start + end) * 0.5, 0.0, height - PAVEMENT / 2))
    with tree.frame("Railings"):
        railing = tree.call(bridge_railing_group(), length=end - start, height=inputs.parapet_height - _CURB).value
        beside = width * 0.5 - 0.2
        pair = [move_geometry(railing, op.vector(tree, start, beside * side, height + _CURB)) for side in (1.0, -1.0)]
        railings = op.only_if(
            inputs.parapet_height > _LOWEST_PARAPET, paint_faces(op.join(*pair), inputs.steel_material)
        )
    with tree.frame("All"):
        mesh = op.join(deck, beams, paint_faces(road, inputs.pavement_material), railings)
    tree.output("Mesh", mesh, description="The deck")


def _deck(tree: Tree, ends: tuple[Value, Value], width: Value, height: Value) -> Value:
    half = [(0.0, y, z) for y, z in sizes.DECK]
    outline = half + [(x, -y, z) for x, y, z in reversed(half)]

    def place(point: Value, row: Value) -> Value:
        x = op.switch(row > 0, *ends)
        y = op.component(point, "Y") * width * 0.5
        return op.vector(tree, x, y, op.component(point, "Z") * (height - PAVEMENT * 0.5))

    return loft(tree, lambda number: op.choose(number, outline), len(outline), 2, place)


def _edge_beam(tree: Tree, ends: tuple[Value, Value], width: Value, height: Value) -> Value:
    """Return the edge beam on the left of an observer who looks along x."""
    hang = op.minimum(height * 0.6, _NOSE[1])

    def place(point: Value, row: Value) -> Value:
        inwards = op.component(point, "X") * (width * EDGE) + op.component(point, "Y") * _NOSE[0]
        z = op.component(point, "Z")
        rise = op.switch(z > 0.5, op.switch(z < -0.5, -PAVEMENT, -hang), _CURB)
        return op.vector(tree, op.switch(row > 0, *ends), width * 0.5 - inwards, height + rise)

    return loft(tree, lambda number: op.choose(number, _BEAM), len(_BEAM), 2, place)


_POST_SPACING, _BAR_SPACING = 2.0, 0.14  # m
_POST, _BAR, _RAIL, _HANDRAIL = 0.06, 0.016, 0.04, (0.09, 0.06)  # m
_LOWER = 0.1
"""Lower rail above the deck, m."""


class _Railing(Inputs):
    length = metres(20.0, (0.5, 300.0), "Length")
    height = metres(1.0, (0.3, 3.0), "Top of the handrail")


@makes_group("SR Bridge Railing")
def bridge_railing_group(tree: Tree) -> None:
    """A railing from x = 0 on along x, standing on z = 0."""
    railing = _Railing(tree)
    length, height = railing.length, railing.height
    with tree.frame("Rails"):
        wide, high = _HANDRAIL
        rail = box(tree, op.vector(tree, length, _RAIL, _RAIL), op.vector(tree, length * 0.5, 0.0, _LOWER))
        upper = move_geometry(rail, op.vector(tree, 0.0, 0.0, height - high - 0.1 - _LOWER))
        hand = box(tree, op.vector(tree, length, wide, high), op.vector(tree, length * 0.5, 0.0, height - high / 2))
    with tree.frame("Posts"):
        bays = op.round_up(length / _POST_SPACING)
        points = row_of_points(tree, bays + 1)
        x = op.index(tree) * ((length - _POST) / bays) + _POST / 2
        tall = height - high / 2
        posts = put_on_points(
            points, box(tree, op.vector(tree, _POST, _POST, tall)), op.vector(tree, x, 0.0, tall * 0.5)
        )
    with tree.frame("Bars between the rails"):
        points = row_of_points(tree, op.round_up(length / _BAR_SPACING) - 1)
        x = (op.index(tree) + 1) * _BAR_SPACING
        tall = height - high - 0.1 - _LOWER
        open_ = tree.node("GeometryNodeMeshCylinder", vertices=4, fill_type="NONE", radius=_BAR * 0.7, depth=tall).value
        bars = put_on_points(points, open_, op.vector(tree, x, 0.0, tall * 0.5 + _LOWER))
    with tree.frame("All"):
        mesh = op.realize(op.join(rail, upper, hand, posts, bars))
    tree.output("Mesh", mesh, description="The railing")
