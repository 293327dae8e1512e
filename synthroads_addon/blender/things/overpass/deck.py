"""SR Bridge Deck: a bridge's deck with two webs, the edge beams on it, the pavement and the railings."""

from __future__ import annotations

from ....road.things import overpass as sizes
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, material_of, metres
from ...nodes.solids import box, flip_faces, loft, move_geometry, paint_faces, put_on_points, row_of_points

_BEAM = [(0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, -1.0)]
"""Corners of an edge beam's section as codes, see `_edge_beam`: 1 on its inner side, 0 on the outer one; 1 at the back
of its nose; 1 on top, 0 at the deck's surface, -1 at the lower edge."""


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
        size = op.vector(tree, end - start, width * (1.0 - 1.96 * sizes.EDGE), sizes.PAVEMENT)
        road = box(tree, size, op.vector(tree, (start + end) * 0.5, 0.0, height - sizes.PAVEMENT / 2))
    with tree.frame("Railings"):
        railing = tree.call(bridge_railing_group(), length=end - start, height=inputs.parapet_height - sizes.CURB).value
        railing_y = width * 0.5 - sizes.RAILING_INSIDE
        pair = [
            move_geometry(railing, op.vector(tree, start, railing_y * side, height + sizes.CURB))
            for side in (1.0, -1.0)
        ]
        railings = op.only_if(
            inputs.parapet_height > sizes.LOWEST_PARAPET, paint_faces(op.join(*pair), inputs.steel_material)
        )
    with tree.frame("All"):
        mesh = op.join(deck, beams, paint_faces(road, inputs.pavement_material), railings)
    tree.output("Mesh", mesh, description="The deck")


def _deck(tree: Tree, ends: tuple[Value, Value], width: Value, height: Value) -> Value:
    """Add nodes for the deck's solid between two x (m), with its underside on z = 0."""
    half = [(0.0, y, z) for y, z in sizes.DECK]
    outline = half + [(x, -y, z) for x, y, z in reversed(half)]

    def place(point: Value, row: Value) -> Value:
        x = op.switch(row > 0, *ends)
        y = op.component(point, "Y") * width * 0.5
        return op.vector(tree, x, y, op.component(point, "Z") * (height - sizes.PAVEMENT * 0.5))

    return loft(tree, lambda number: op.choose(number, outline), len(outline), 2, place)


def _edge_beam(tree: Tree, ends: tuple[Value, Value], width: Value, height: Value) -> Value:
    """Add nodes for the deck's edge beam on the left of an observer who looks along x."""
    share, maximum = sizes.HANG
    hang = op.minimum(height * share, maximum)

    def place(point: Value, row: Value) -> Value:
        inner_distance = op.component(point, "X") * (width * sizes.EDGE) + op.component(point, "Y") * sizes.NOSE
        z = op.component(point, "Z")
        rise = op.switch(z > 0.5, op.switch(z < -0.5, -sizes.PAVEMENT, -hang), sizes.CURB)
        return op.vector(tree, op.switch(row > 0, *ends), width * 0.5 - inner_distance, height + rise)

    return loft(tree, lambda number: op.choose(number, _BEAM), len(_BEAM), 2, place)


_BAR_SPACING = 0.14
"""Distance between the bars of a railing, m; chosen."""


class _Railing(Inputs):
    length = metres(20.0, (0.5, 300.0), "Length")
    height = metres(1.0, (0.3, 3.0), "Top of the handrail")


@makes_group("SR Bridge Railing")
def bridge_railing_group(tree: Tree) -> None:
    """A railing from x = 0 on along x, standing on z = 0."""
    post_width, rail_width, rail_z = sizes.RAILING_POST, sizes.RAILING_RAIL, sizes.RAILING_LOWER
    railing = _Railing(tree)
    length, height = railing.length, railing.height
    with tree.frame("Rails"):
        hand_width, hand_height = sizes.RAILING_HAND
        rail = box(
            tree,
            op.vector(tree, length, rail_width, rail_width),
            op.vector(tree, length * 0.5, 0.0, rail_z),
        )
        upper_rail = move_geometry(rail, op.vector(tree, 0.0, 0.0, height - hand_height - 2.0 * rail_z))
        hand_size = op.vector(tree, length, hand_width, hand_height)
        handrail = box(tree, hand_size, op.vector(tree, length * 0.5, 0.0, height - hand_height / 2))
    with tree.frame("Posts"):
        bays = op.round_up(length / sizes.RAILING_SPACING)
        points = row_of_points(tree, bays + 1)
        x = op.index(tree) * ((length - post_width) / bays) + post_width / 2
        post_height = height - hand_height / 2
        posts = put_on_points(
            points,
            box(tree, op.vector(tree, post_width, post_width, post_height)),
            op.vector(tree, x, 0.0, post_height * 0.5),
        )
    with tree.frame("Bars between the rails"):
        points = row_of_points(tree, op.round_up(length / _BAR_SPACING) - 1)
        x = (op.index(tree) + 1) * _BAR_SPACING
        bar_height = height - hand_height - 2.0 * rail_z
        bar = tree.node(
            "GeometryNodeMeshCylinder", vertices=4, fill_type="NONE", radius=sizes.RAILING_BAR * 0.7, depth=bar_height
        ).value
        bars = put_on_points(points, bar, op.vector(tree, x, 0.0, bar_height * 0.5 + rail_z))
    with tree.frame("All"):
        mesh = op.realize(op.join(rail, upper_rail, handrail, posts, bars))
    tree.output("Mesh", mesh, description="The railing")
