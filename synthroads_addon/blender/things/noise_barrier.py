"""Noise barriers: level panels between posts, which step down with the ground from post to post (SR Noise Barrier)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...base.classes import class_id
from ...road.things import noise_barrier as sizes
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.thing import SHORTEST_ELEMENT
from ..nodes import operations as op
from ..nodes.backbone import first_station, last_station
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.foot import Lengthwise, foot_at
from ..nodes.inputs import Inputs, instance_number, integer, material_of, metres
from ..nodes.solids import box, paint_faces, prism, put_on_points, row_of_points
from .model_builder import ModelBuilder
from .registry import model_part

_KINDS = ("aluminium", "concrete", "wood", "glass")
_SUNK = 0.003
"""Depth of slats in the panel's core, m: rays can't tell apart faces that coincide; chosen."""


@dataclass(frozen=True)
class _Relief:
    """Dimensions of the slats (cassettes, ribs or boards) on a panel's face.

    Attributes:
        is_horizontal: whether slats run along the panel; else they are upright.
        pitch: distance between slats, m.
        share: width of a slat as a share of the pitch.
        bevel: width of each flank of a slat, as a share of its width.
        cap: whether a strip closes the panel's top.
    """

    is_horizontal: bool
    pitch: float
    share: float
    bevel: float
    cap: bool


_RELIEFS = {
    "aluminium": _Relief(is_horizontal=True, pitch=0.25, share=0.9, bevel=0.15, cap=True),
    "concrete": _Relief(is_horizontal=False, pitch=0.2, share=0.7, bevel=0.2, cap=False),
    "wood": _Relief(is_horizontal=False, pitch=0.14, share=0.82, bevel=0.02, cap=True),
}


class _Wall(Lengthwise):
    start_station = metres(0.0, (0.0, 1e6), "First post")
    end_station = metres(0.0, (0.0, 1e6), "Last post; 0 is at the end of what it follows")
    offset = metres(0.0, (-100.0, 100.0), "Offset of the panels' middle")
    height = metres(4.0, (1.0, 12.0), "Top of the posts above the surface")
    panel = integer(0, (0, 3), "Kind of the panels: 0 aluminium, 1 concrete, 2 wood, 3 glass")
    thickness = metres(0.15, (0.02, 0.6), "Thickness of the panels")
    post_spacing = metres(4.0, (1.0, 10.0), "Distance between posts")
    post_width = metres(0.16, (0.05, 0.5), "Width of a post")
    instance = instance_number()
    post_material = material_of("the posts", "galvanised_steel")
    panel_material = material_of("the panels", "noise_aluminium")
    frame_material = material_of("frames and caps", "noise_aluminium")
    plinth_material = material_of("the plinth", "noise_concrete")


@makes_group("SR Noise Barrier", catalogue="Barriers")
def noise_barrier_group(tree: Tree) -> None:
    """A noise barrier along the road: posts, and between them level panels on a plinth."""
    wall = _Wall(tree)
    axis, surfaces = wall.geometry()
    with tree.frame("Number of bays"):
        count = op.round_up(
            op.maximum((wall.end_station - wall.start_station) / wall.post_spacing - SHORTEST_ELEMENT, 1.0)
        )
    with tree.frame("Posts"):
        posts = _posts(tree, wall, count, axis, surfaces)
        posts = paint_faces(op.realize(posts), wall.post_material)
    with tree.frame("Bays: both ends' feet"):
        bays = _bays(tree, wall, count, axis, surfaces)
    with tree.frame("Plinths and panels"):
        plinth = op.minimum(wall.height * sizes.PLINTH_SHARE, sizes.HIGHEST_PLINTH)
        is_slim = wall.thickness < wall.post_width * (2.0 * sizes.INSIDE)
        gap = op.switch(is_slim, wall.post_width * 0.5, wall.post_width * sizes.WEB) + sizes.PLAY
        panel = tree.call(
            _panel_group(),
            panel=wall.panel,
            length=wall.post_spacing - gap * 2.0,
            height=wall.height - plinth,
            thickness=wall.thickness,
            panel_material=wall.panel_material,
            frame_material=wall.frame_material,
        ).value
        walls = _fill_bays(tree, wall, bays, (gap, plinth), (panel, paint_faces(box(tree, 1.0), wall.plinth_material)))
    with tree.frame("Labels"):
        mesh = op.label(op.join(posts, walls), class_id(NoiseBarrier.points_class), wall.instance)
    tree.output("Mesh", mesh, description="Posts, plinths and panels; a panel's points carry the number of its bay")


def _posts(tree: Tree, wall: _Wall, count: Value, axis: Value, surfaces: tuple[Value, Value]) -> Value:
    """Add nodes for the posts as instances; those beyond the backbone, or on an end the wall passes, are left out."""
    posts = row_of_points(tree, count + 1)
    post_index = op.index(tree)
    posts = op.store(
        posts,
        "station",
        op.switch(post_index < count, wall.end_station, wall.start_station + post_index * wall.post_spacing),
    )
    station, end = op.named_attribute(tree, "station"), last_station(axis)
    is_next_section = (station > end - 1e-3) & (wall.end_station > end + 1e-3)
    posts = op.delete_points(posts, is_next_section | (station < first_station(axis)))
    foot, left = foot_at(axis, surfaces, station, wall.offset)
    size = op.vector(tree, wall.post_width, wall.post_width, wall.height + sizes.BURIED)
    rotation = op.upright(left)
    return put_on_points(posts, _post(tree), foot + (0.0, 0.0, -sizes.BURIED), size, rotation)


def _post(tree: Tree) -> Value:
    """Add nodes for an HEA profile of 1 m width and height on z = 0: x is across the wall, y along it."""
    flange = (sizes.FLANGE - sizes.INSIDE, 1.0, 1.0)
    flange_x = (sizes.FLANGE + sizes.INSIDE) / 2
    web = box(tree, (2.0 * sizes.INSIDE + 0.01, 2.0 * sizes.WEB, 1.0), (0.0, 0.0, 0.5))
    return op.join(web, *(box(tree, flange, (flange_x * side, 0.0, 0.5)) for side in (1.0, -1.0)))


def _bays(tree: Tree, wall: _Wall, count: Value, axis: Value, surfaces: tuple[Value, Value]) -> Value:
    """Add nodes for one point per bay with its number and its foot's ``start`` and ``end``, cut at the backbone."""
    bays = row_of_points(tree, count)
    bay_index = op.index(tree)
    start = wall.start_station + bay_index * wall.post_spacing
    end = op.switch(bay_index < count - 1, wall.end_station, start + wall.post_spacing)
    for name, station in {"from": start, "to": end}.items():
        clamped_station = op.minimum(op.maximum(station, first_station(axis)), last_station(axis))
        bays = op.store(bays, name, clamped_station)
    bays = op.store(bays, "bay", bay_index)
    bays = op.delete_points(bays, op.named_attribute(tree, "to") - op.named_attribute(tree, "from") < 0.05)
    for name, station_name in {"start": "from", "end": "to"}.items():
        foot, _ = foot_at(axis, surfaces, op.named_attribute(tree, station_name), wall.offset)
        bays = op.store(bays, name, foot)
    return bays


def _fill_bays(tree: Tree, wall: _Wall, bays: Value, gaps: tuple[Value, Value], bodies: tuple[Value, Value]) -> Value:
    """Add nodes for a panel on a plinth in every bay, level at the lower one of its posts' feet."""
    (gap, plinth), (panel, block) = gaps, bodies
    start, end = (op.named_attribute(tree, name, "FLOAT_VECTOR") for name in ("start", "end"))
    lower_foot = op.minimum(op.component(start, "Z"), op.component(end, "Z"))
    direction = (end - start) * (1.0, 1.0, 0.0)
    length = op.maximum(op.length(direction) - gap * 2.0, 0.02)
    middle = (start + end) * 0.5
    panel_place = op.vector(tree, op.component(middle, "X"), op.component(middle, "Y"), lower_foot + plinth)
    rotation = op.upright(direction)
    # The panels' face looks to -y, which is away from the road on its right side.
    panel_rotation = tree.node(
        "FunctionNodeRotateRotation",
        rotation,
        op.turn(tree, z=op.switch(wall.offset < 0.0, 0.0, math.pi)),
        rotation_space="LOCAL",
    ).value
    panels = put_on_points(
        bays, panel, panel_place, op.vector(tree, length / (wall.post_spacing - gap * 2.0), 1.0, 1.0), panel_rotation
    )
    plinth_height = plinth + sizes.BURIED
    plinth_place = panel_place - op.vector(tree, 0.0, 0.0, plinth_height * 0.5)
    return op.realize(
        op.join(
            panels,
            put_on_points(bays, block, plinth_place, op.vector(tree, length, wall.thickness, plinth_height), rotation),
        )
    )


class _Panel(Inputs):
    panel = integer(0, (0, 3), "Kind: 0 aluminium, 1 concrete, 2 wood, 3 glass")
    length = metres(3.98, (0.1, 20.0), "Length")
    height = metres(3.5, (0.1, 20.0), "Height")
    thickness = metres(0.15, (0.02, 0.6), "Thickness")
    panel_material = material_of("the panel")
    frame_material = material_of("frame and cap")


@makes_group("SR Noise Panel")
def _panel_group(tree: Tree) -> None:
    """A panel of a noise barrier, upright on the origin along x; its face looks to -y."""
    panel = _Panel(tree)
    parts = []
    for number, name in enumerate(_KINDS):
        with tree.frame(f"{name.capitalize()} panel"):
            panel_body = _slatted_wall(tree, panel, name) if name in _RELIEFS else _glass_pane(tree, panel)
            parts.append(op.only_if(panel.panel.equals(number), panel_body))
    tree.output("Mesh", op.realize(op.join(*parts)), description="The panel")


def _slatted_wall(tree: Tree, panel: _Panel, kind: str) -> Value:
    """Add nodes for a panel with slats on its face, and a cap where its kind has one."""
    relief = _RELIEFS[kind]
    relief_depth = op.minimum(panel.thickness * sizes.RELIEF_SHARE, sizes.RELIEFS[kind])
    core_height = panel.height - (sizes.CAP if relief.cap else 0.0)
    core = box(
        tree,
        op.vector(tree, panel.length, panel.thickness - relief_depth, core_height),
        op.vector(tree, 0.0, relief_depth * 0.5, core_height * 0.5),
    )
    span, length = (core_height, panel.length) if relief.is_horizontal else (panel.length, core_height)
    count = op.round_up(span / relief.pitch - 0.5)
    pitch = span / count
    slat_position = (op.index(tree) + 0.5) * pitch
    front = relief_depth - panel.thickness * 0.5 + _SUNK
    slat = prism(tree, [(-0.5, 0.0), (relief.bevel - 0.5, -1.0), (0.5 - relief.bevel, -1.0), (0.5, 0.0)])
    size = op.vector(tree, pitch * relief.share, relief_depth + _SUNK, length - 0.002)
    if relief.is_horizontal:
        start = op.vector(tree, 0.001 - length * 0.5, front, slat_position)
        slats = put_on_points(row_of_points(tree, count), slat, start, size, op.turn(tree, y=math.pi / 2))
    else:
        start = op.vector(tree, slat_position - panel.length * 0.5, front, 0.001)
        slats = put_on_points(row_of_points(tree, count), slat, start, size)
    parts = [paint_faces(core, panel.panel_material), paint_faces(op.realize(slats), panel.panel_material)]
    if relief.cap:
        strip = op.vector(tree, panel.length, panel.thickness, sizes.CAP)
        parts.append(
            paint_faces(box(tree, strip, op.vector(tree, 0.0, 0.0, core_height + sizes.CAP / 2)), panel.frame_material)
        )
    return op.join(*parts)


def _glass_pane(tree: Tree, panel: _Panel) -> Value:
    """Add nodes for a glass pane in a frame of two rails (along the panel) and two stiles (upright)."""
    depth, height = panel.thickness, panel.height
    rail = box(tree, op.vector(tree, panel.length, depth, sizes.FRAME))
    stile = box(tree, op.vector(tree, sizes.FRAME, depth, height - 2.0 * sizes.FRAME))
    stile_x = panel.length * 0.5 - sizes.FRAME / 2
    frame = [
        op.transform(part, translation=op.vector(tree, x, 0.0, z))
        for part, x, z in (
            (rail, 0.0, sizes.FRAME / 2),
            (rail, 0.0, height - sizes.FRAME / 2),
            (stile, stile_x, height * 0.5),
            (stile, -stile_x, height * 0.5),
        )
    ]
    # Less than two widths of the frame: the pane reaches 5 % of one into it at each edge, so that no gap is seen.
    pane_size = op.vector(
        tree,
        panel.length - 1.9 * sizes.FRAME,
        op.minimum(depth * 0.6, sizes.PANE),
        height - 1.9 * sizes.FRAME,
    )
    pane = box(tree, pane_size, op.vector(tree, 0.0, 0.0, height * 0.5))
    return op.join(paint_faces(op.join(*frame), panel.frame_material), paint_faces(pane, panel.panel_material))


@model_part("noise_barriers", 60)
def build_noise_barriers(builder: ModelBuilder) -> None:
    """Add one object per noise barrier to the model."""
    for name, wall in builder.parameters.of_type(NoiseBarrier).items():
        face, frame = sizes.MATERIALS[wall.panel]
        builder.add_thing(
            name,
            wall,
            noise_barrier_group(),
            end_station=builder.along(min(wall.end_station, builder.geometry.length)),
            panel=_KINDS.index(wall.panel),
            panel_material=face,
            frame_material=frame,
        )
