"""Steel guardrails: W-beams on posts, on one side or on both, ramped into the ground at their ends (SR Guardrail)."""

from __future__ import annotations

import math

from ...base.classes import class_id
from ...road.things import guardrail as sizes
from ...road.things.deformation import DENT_ROWS, Dent
from ...road.things.guardrail import Guardrail
from ..nodes import operations as op
from ..nodes.backbone import first_station, last_station, raise_place
from ..nodes.builder import Operand, Tree, Value, makes_group
from ..nodes.foot import Lengthwise, foot_at
from ..nodes.inputs import Inputs, boolean, instance_number, material_of, metres, number, socket
from ..nodes.solids import flip_faces, move_geometry, paint_faces, put_on_points, row_of_points
from .model_builder import ModelBuilder
from .registry import model_part

# Front of the sheet, then its back, closed.
BEAM_PROFILE = [(x, 0.0, z) for x, z in sizes.BEAM]
BEAM_PROFILE += [(x - sizes.SHEET, 0.0, z) for x, z in reversed(sizes.BEAM)]
BEAM_PROFILE.append(BEAM_PROFILE[0])

_LAP_PROFILE = [(x + sizes.LAP_SHEET, 0.0, z) for x, z in sizes.BEAM]
_LAP_PROFILE = [BEAM_PROFILE[0], *_LAP_PROFILE, (sizes.BEAM[-1][0], 0.0, sizes.BEAM[-1][1])]
"""Front of a splice's upper sheet, with edges that close the gap to the beam below."""
_BOLT_SIDES = 6
_NO_BOLTS = 0.01
"""Tolerance (m) from which on splices have no bolts: the height of their heads."""

_HALF_DEPTH, _HALF_WIDTH = sizes.POST[0] / 2, sizes.POST[1] / 2
_POST = [
    (_HALF_DEPTH, -0.010),
    (_HALF_DEPTH, _HALF_WIDTH),
    (-_HALF_DEPTH, _HALF_WIDTH),
    (-_HALF_DEPTH, -_HALF_WIDTH),
    (_HALF_DEPTH, -_HALF_WIDTH),
]
"""Section of a post, open on one side: coordinates across the road and along it, m."""
POST_DEPTH = _HALF_DEPTH
"""Distance from a post's axis to the back of a beam that is bolted to it, m."""


class _Rail(Lengthwise):
    """Inputs of the guardrail's node group, with nodes for the rail's foot and top at any station."""

    offset = metres(0.0, (-100.0, 100.0), "Offset of the posts' axis")
    left_beam = boolean(True, "A beam on the left of the posts")
    right_beam = boolean(True, "A beam on the right of the posts")
    spacer = metres(0.0, (0.0, 0.5), "Distance between posts and beam")
    height = metres(0.75, (0.3, 1.5), "Top of the beam above the surface")
    post_spacing = metres(4.0, (0.5, 10.0), "Distance between posts")
    terminal_length = metres(12.0, (0.0, 50.0), "Length of the ramp at each end")
    beam_length = metres(4.0, (1.0, 20.0), "Distance between the splices of the beam's sheets")
    bolts = boolean(True, "Bolts on the splices")
    reflector_spacing = metres(50.0, (0.0, 1000.0), "Distance between the reflectors in the beam; 0 for none")
    beam_step = metres(2.0, (0.1, 8.0), "Largest length of a straight piece of beam")
    instance = instance_number()
    material = material_of("beams and posts", "galvanised_steel")
    reflector_material = material_of("the reflectors", "reflector")

    def beams(self) -> tuple[tuple[float, Value], ...]:
        """Return (side, whether it has a beam) for the left, +1, and the right side, -1."""
        return (1.0, self.left_beam), (-1.0, self.right_beam)

    def ramp(self) -> Value:
        """Add nodes for the length (m) of the ramp at either end, at most half the rail's."""
        return op.minimum(self.terminal_length, (self.end_station - self.start_station) * 0.5)

    def top_at(self, station: Value, ramp: Value) -> Value:
        """Add nodes for the height (m) of the beam's top edge above the surface at a station (field)."""
        ramp_share = op.minimum(station - self.start_station, self.end_station - station) / op.maximum(ramp, 1e-3)
        height_share = op.switch(ramp > 1e-3, 1.0, op.minimum(ramp_share, 1.0))
        return self.height * height_share + sizes.TIP * (1.0 - height_share)


@makes_group("SR Guardrail", catalogue="Barriers")
def guardrail_group(tree: Tree) -> None:
    """A steel guardrail along the road: W-beams with splices and reflectors, posts and spacers, ramped terminals."""
    rail = _Rail(tree)
    axis, surfaces = rail.geometry()
    with tree.frame("Rows of the beams: terminal, middle, terminal"):
        ramp = rail.ramp()
        backbone_start, backbone_end = first_station(axis), last_station(axis)
        station = op.named_attribute(tree, "station")

        def place_rows(line: Value) -> Value:
            """Add nodes that store the top edge at the rows; rows beyond an end of the backbone collapse onto it."""
            line = op.store(line, "station", op.clip(station, backbone_start, backbone_end))
            foot, left = foot_at(axis, surfaces, station, rail.offset)
            return op.store(op.store(line, "left", left), "top", raise_place(foot, rail.top_at(station, ramp)))

        def place_on_ground(points: Value) -> Value:
            """Add nodes that put points by their station on the ground, and store the height ``tall`` of the beam."""
            points = op.store(points, "tall", rail.top_at(station, ramp))
            # A point on the end of a backbone beyond which the rail goes on belongs to the road's next stretch.
            is_beyond = (station > backbone_end) | (
                (station > backbone_end - 1e-3) & (rail.end_station > backbone_end + 1e-3)
            )
            points = op.delete_points(points, is_beyond | (station < backbone_start))
            foot, left = foot_at(axis, surfaces, station, rail.offset)
            return op.set_position(op.store(points, "left", left), foot)

        line = place_rows(_rows(tree, rail, ramp))
    with tree.frame("Splices: two rows each, the faces between them away"):
        laps = place_rows(_splice_rows(tree, rail, (-sizes.LAP / 2.0, sizes.LAP / 2.0)))
    with tree.frame("Bolts of the splices, and reflectors"):
        bolts = op.only_if(rail.bolts, place_on_ground(_splice_rows(tree, rail, sizes.BOLT_ROWS)))
        reflectors = place_on_ground(_reflector_rows(tree, rail, ramp))
    parts, plates = [], []
    for side, has_beam in rail.beams():
        with tree.frame(f"{'Left' if side > 0 else 'Right'} beam"):
            beam = tree.call(
                _side_group(), line=line, laps=laps, bolts=bolts, reflectors=reflectors, side=side, spacer=rail.spacer
            )
            parts.append(op.only_if(has_beam, beam["Beam"]))
            plates.append(op.only_if(has_beam, beam["Plates"]))
    with tree.frame("Posts from the start on, where the beam is high enough"):
        posts = place_on_ground(_post_rows(tree, rail))
        posts = op.delete_points(posts, op.named_attribute(tree, "tall") < sizes.LOWEST_POST)
        parts += _instances(tree, posts, rail)
    with tree.frame("Labels"):
        plates_mesh = paint_faces(op.realize(op.join(*plates)), rail.reflector_material)
        mesh = op.join(paint_faces(op.realize(op.join(*parts)), rail.material), plates_mesh)
        mesh = op.label(mesh, class_id(Guardrail.points_class), rail.instance)
    tree.output("Mesh", mesh, description="Beams, posts, spacers and reflectors")


def _post_rows(tree: Tree, rail: _Rail) -> Value:
    """Add nodes for one point per post with its ``station``, evenly spaced from the rail's start."""
    number = (rail.end_station - rail.start_station) / rail.post_spacing + 1e-4
    count = tree.node("FunctionNodeFloatToInt", number, rounding_mode="FLOOR").value + 1
    posts = row_of_points(tree, count)
    return op.store(posts, "station", rail.start_station + op.index(tree) * rail.post_spacing)


def _splice_rows(tree: Tree, rail: _Rail, distances: tuple[float, float]) -> Value:
    """Add nodes for two points per splice with their ``station``, at two distances (m) after the splice's middle."""
    count = op.maximum(op.round_up((rail.end_station - rail.start_station) / rail.beam_length - 1e-4) - 1, 0)
    count = tree.node("FunctionNodeFloatToInt", count, rounding_mode="ROUND").value
    points, point_index = row_of_points(tree, count * 2), op.index(tree)
    first_distance, second_distance = distances
    station = (
        rail.start_station
        + (point_index // 2 + 1) * rail.beam_length
        + (point_index % 2) * (second_distance - first_distance)
        + first_distance
    )
    return op.store(points, "station", op.clip(station, rail.start_station, rail.end_station))


def _reflector_rows(tree: Tree, rail: _Rail, ramp: Value) -> Value:
    """Add nodes for one point per reflector with its ``station``, from the first terminal's end to the last one's."""
    spacing = op.maximum(rail.reflector_spacing, sizes.SHORTEST_REFLECTOR_SPACING)
    number = (rail.end_station - rail.start_station - ramp * 2.0) / spacing + 1e-4
    count = tree.node("FunctionNodeFloatToInt", number, rounding_mode="FLOOR").value + 1
    points = row_of_points(tree, op.switch(rail.reflector_spacing > 0.0, 0, count))
    return op.store(points, "station", rail.start_station + ramp + op.index(tree) * spacing)


def _rows(tree: Tree, rail: _Rail, ramp: Value) -> Value:
    """Add nodes for the beams' rows as points with their ``station``, no farther apart than the beam's step.

    Between the ramps the post spacing is divided evenly, so that there is a row at each post.
    """
    start, end = rail.start_station, rail.end_station
    step = rail.post_spacing / op.round_up(rail.post_spacing / rail.beam_step - 1e-4)
    ramp_rows = op.round_up(ramp / rail.beam_step - 1e-4)
    skipped_rows = op.round_up(ramp / step + 1e-4)
    middle_rows = op.maximum(op.round_up((end - start - ramp) / step - 1e-4) - skipped_rows, 0)
    middle_rows = tree.node("FunctionNodeFloatToInt", middle_rows, rounding_mode="ROUND").value
    # Rows: ramp up, its end, middle, ramp down. Middle rows that would lie on a ramp are skipped.
    line = row_of_points(tree, ramp_rows * 2 + middle_rows + 2)
    row_index = op.index(tree)
    ramp_up_station = start + ramp * (row_index / op.maximum(ramp_rows, 1))
    middle_station = start + (row_index - ramp_rows + skipped_rows - 1) * step
    ramp_down_station = end - ramp + ramp * ((row_index - ramp_rows - middle_rows - 1) / op.maximum(ramp_rows, 1))
    middle_station = op.minimum(op.maximum(middle_station, start + ramp), end - ramp)
    station = op.switch(
        row_index > ramp_rows,
        ramp_up_station,
        op.switch(row_index > ramp_rows + middle_rows, middle_station, ramp_down_station),
    )
    return op.store(line, "station", op.maximum(op.minimum(station, end), start))


class _Side(Inputs):
    line = socket("Geometry", "Rows of the beam, with ``top`` and ``left``")
    laps = socket("Geometry", "Rows of its splices, two each")
    bolts = socket("Geometry", "Points of its rows of bolts, on the ground, with ``tall`` and ``left``")
    reflectors = socket("Geometry", "Points of its reflectors, likewise")
    side = number(1.0, (-1.0, 1.0), "+1 for the left, -1 for the right side")
    spacer = metres(0.07, (0.0, 0.5), "Distance between posts and beam")


@makes_group("SR Guardrail Side")
def _side_group(tree: Tree) -> None:
    """The beam on one side of the posts, with its splices and bolts, and the reflectors in it."""
    rail = _Side(tree)
    with tree.frame("Beam"):
        beam = op.delete_degenerate(_sweep(rail, rail.line, BEAM_PROFILE))
    with tree.frame("Upper sheets of the splices"):
        # Faces of a grid run column by column, one less than the rows of them each.
        is_gap = (op.index(tree) % op.maximum(op.point_count(rail.laps) - 1, 1)) % 2
        laps = op.delete_faces(_sweep(rail, rail.laps, _LAP_PROFILE), op.maximum(is_gap, 0).equals(1))
    with tree.frame("Bolts"):
        bolt_heads = _in_beam(rail, rail.bolts, _bolts(tree))
    tree.output(
        "Beam", op.join(beam, op.delete_degenerate(laps), bolt_heads), description="Beam with splices and bolts"
    )
    with tree.frame("Reflectors"):
        reflector_plates = _in_beam(rail, rail.reflectors, _reflector(tree))
    tree.output("Plates", reflector_plates, description="Plates of the reflectors, as instances")


def _sweep(rail: _Side, line: Value, outline: list[tuple[float, float, float]]) -> Value:
    """Add nodes that sweep an outline (depth in front of the posts, height under the top edge) along a beam's rows."""
    tree = rail.tree
    mesh, column, row = op.grid(tree, len(outline), op.point_count(line))
    profile = op.choose(column, outline)
    top_edge = op.sample_index(line, op.named_attribute(tree, "top", "FLOAT_VECTOR"), row)
    left_vector = op.sample_index(line, op.named_attribute(tree, "left", "FLOAT_VECTOR"), row)
    depth = (op.component(profile, "X") + rail.spacer + POST_DEPTH) * rail.side
    place = top_edge + left_vector * depth + op.vector(tree, 0.0, 0.0, op.component(profile, "Z"))
    # Seen along the rows the profile runs round clockwise on the right side: there its faces look outwards.
    return flip_faces(op.set_position(mesh, place), rail.side > 0.0)


def _in_beam(rail: _Side, points: Value, body: Value) -> Value:
    """Add nodes for an instance of a body on every point, its origin on the beam's rear plane at its top edge.

    The body's x points away from the posts.
    """
    tree = rail.tree
    outward_vector = op.named_attribute(tree, "left", "FLOAT_VECTOR") * rail.side
    top = op.vector(tree, 0.0, 0.0, op.named_attribute(tree, "tall"))
    return put_on_points(
        points,
        body,
        op.position(tree) + outward_vector * (rail.spacer + POST_DEPTH) + top,
        rotation=op.upright(outward_vector),
    )


def _bolts(tree: Tree) -> Value:
    """Add nodes for the heads of a row of bolts; x points away from the posts, z = 0 is the beam's top edge."""
    radius, height = sizes.BOLT_HEAD
    disc = tree.node("GeometryNodeMeshCircle", vertices=_BOLT_SIDES, radius=radius, fill_type="NGON").value
    head = tree.node("GeometryNodeExtrudeMesh", disc, offset_scale=height, individual=False).value
    heads = []
    for depth, z, angle in sizes.BOLTS:
        # From facing up to facing the road, and then along with the flank's slope.
        flank = op.transform(head, rotation=(0.0, math.pi / 2.0 - angle, 0.0))
        sheet_shift = math.cos(angle) * sizes.LAP_SHEET, math.sin(angle) * sizes.LAP_SHEET
        heads.append(move_geometry(flank, (depth + sheet_shift[0], 0.0, z + sheet_shift[1])))
    return op.join(*heads)


def _reflector(tree: Tree) -> Value:
    """Add nodes for a reflector's plate; x points away from the posts, z = 0 is the beam's top edge."""
    (inner_x, inner_height), (outer_x, outer_height) = sizes.REFLECTOR
    # A cube whose x, from -0.5 to 0.5, becomes the way from the inner to the outer edge.
    plate = tree.node("GeometryNodeMeshCube", size=1.0).value
    share = op.component(op.position(tree), "X") + 0.5
    height = op.component(op.position(tree), "Z") * (share * (outer_height - inner_height) + inner_height)
    thickness = op.component(op.position(tree), "Y") * sizes.REFLECTOR_PLATE
    corner = op.vector(tree, share * (outer_x - inner_x) + inner_x, thickness, height + sizes.REFLECTOR_MIDDLE)
    return op.set_position(plate, corner)


def _instances(tree: Tree, posts: Value, rail: _Rail) -> list[Value]:
    """Add nodes for an instance of a post on every point, and of a spacer per beam beside it."""
    left_vector, beam_height = op.named_attribute(tree, "left", "FLOAT_VECTOR"), op.named_attribute(tree, "tall")
    rotation = op.upright(left_vector)

    def on_posts(body: Value, height: Operand, scale: Operand) -> Value:
        """Add nodes for a body on each post's point, `height` (m) above it."""
        points = tree.node("GeometryNodeSetPosition", posts, offset=op.vector(tree, 0.0, 0.0, height)).value
        return tree.node("GeometryNodeInstanceOnPoints", points, instance=body, rotation=rotation, scale=scale).value

    parts = [
        on_posts(
            _post(tree),
            -sizes.BURIED,
            op.vector(tree, 1.0, 1.0, beam_height + (sizes.BURIED - sizes.POST_TOP)),
        )
    ]
    for side, has_beam in rail.beams():
        block_width, block_length, block_height, block_depth = sizes.BLOCK
        box = tree.node("GeometryNodeMeshCube", size=(block_width, block_length, block_height)).value
        middle = op.vector(tree, (rail.spacer * 0.5 + POST_DEPTH) * side, 0.0, -block_depth)
        body = op.transform(box, translation=middle, scale=op.vector(tree, rail.spacer, 1.0, 1.0))
        parts.append(op.only_if(has_beam & (rail.spacer > 1e-3), on_posts(body, beam_height, 1.0)))
    return parts


def _post(tree: Tree) -> Value:
    """Add nodes for a post of 1 m height; x is across the road, y along it."""
    mesh, column, number = op.grid(tree, len(_POST), 2)
    section = op.choose(column, [(x, y, 0.0) for x, y in _POST])
    return op.set_position(mesh, section + op.vector(tree, 0.0, 0.0, number))


@model_part("guardrails", 40, on_the_road=True)
def build_guardrails(builder: ModelBuilder) -> None:
    """Add one object per guardrail to the model."""
    for name, rail in builder.parameters.of_type(Guardrail).items():
        builder.add_thing(
            name,
            rail,
            guardrail_group(),
            end_station=builder.along(min(rail.end_station, builder.geometry.length)),
            left_beam=rail.faces in ("left", "both"),
            right_beam=rail.faces in ("right", "both"),
            spacer=sizes.SPACER[rail.faces],
            beam_step=min([builder.step, *(dent.length / DENT_ROWS for dent in _dents(builder, name))]),
            bolts=builder.tolerance < _NO_BOLTS,
        )


def _dents(builder: ModelBuilder, name: str) -> list[Dent]:
    """Return the dents that a rail has in any epoch of the road."""
    rails = [epoch.parameters.objects.get(name) for epoch in (builder.geometry, *builder.geometry.epochs)]
    return [dent for rail in rails if isinstance(rail, Guardrail) for dent in rail.dents or ()]
