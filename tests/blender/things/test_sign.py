"""Traffic signs on the built mesh: sizes, which way they face, writing, posts, labels."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, get_args

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.nodes import operations as op
from synthroads_addon.blender.nodes.builder import Tree, node_group
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.sign.face import RAISED, sign_face_group
from synthroads_addon.blender.things.sign.looks import FaceStyle, face_inputs
from synthroads_addon.blender.things.sign.outline import SHAPES
from synthroads_addon.blender.things.sign.pictograms import NAMES, PICTOGRAMS
from synthroads_addon.blender.things.sign.typeface import sign_typeface
from synthroads_addon.blender.things.sign.writing import LETTERS, LINES
from synthroads_addon.materials.table import materials
from synthroads_addon.road import stretches
from synthroads_addon.road.things import sign as sizes
from synthroads_addon.road.things.body import BURIED
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.road.things.sign_catalogue import Pictogram, sign_catalogue
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.blender.nodes.test_nodes import evaluated
from tests.helpers.relative_speed import times_as_long
from tests.helpers.scenes.furnished_road import (
    MEASURE,
    Data,
    Float,
    FurnishedRoad,
    corners,
    normals,
    of_material,
    open_edges,
    pieces,
    volume,
)
from tests.helpers.scenes.own_frame import axes, own_frame

pytestmark = pytest.mark.any_blender

MOST_TRIANGLES = 1500
MOST_LETTERS = 700
"""The letters that Blender itself fills in the time that a sign may take."""
PLATE = 0.003
THIN = 1e-9  # m2
BROAD = 2e-7  # m2


def filled_letters(tree: Tree) -> None:
    """A hundred letters, filled."""
    words = tree.input("Words", "String", description="What is written")
    curves = tree.node("GeometryNodeStringToCurves", words, size=1.0, font=sign_typeface()).value
    tree.output("Mesh", op.realize(tree.node("GeometryNodeFillCurve", curves).value))


def made_anew(group: bpy.types.NodeTree, **inputs: object) -> Callable[[], object]:
    """Return what evaluates a group's modifier once more, in a scene that stays as it is."""
    evaluated(group, **inputs)
    item = bpy.context.scene.objects[-1]

    def make() -> None:
        item.update_tag()
        bpy.context.view_layer.update()

    return make


def catalogue_sign(code: str, station: float, offset: float, **more: Any) -> Data:
    sign = sign_catalogue().signs[code]
    values = {"exit": "Eschweiler", "number": "5", "near": "Kerpen", "middle": "Bergheim", "far": "Aachen"}
    values["motorway"] = "A 4"
    fields = sign.fields() | {"code": code, "text": [line.format(**values) for line in sign.text]}
    return {"type": "TrafficSign", "station": station, "offset": offset, **fields, **more}


STEP = 280.0 / len(sign_catalogue().signs)
"""Distance of the catalogue's signs, so that all of them stand on the road of 300 m."""
OF_CATALOGUE = {
    code: catalogue_sign(code, 10.0 + STEP * i, -18.0 - i % 3, rotation_deg=180.0 * (i % 2))
    for i, code in enumerate(sign_catalogue().signs)
}
OTHERS: dict[str, Data] = {
    "stop": {"shape": "octagon", "code": "206", "text": ["STOP"], "width": 0.9, "height": 0.9},
    "wide": {"shape": "rectangle", "code": "386.2", "text": ["Rheinland", "Eifel"], "width": 3.0, "height": 1.5},
    "four": {"shape": "rectangle", "code": "x", "width": 6.0, "height": 3.0, "posts": 4, "post_diameter": 0.2},
    "gore": {"shape": "arrow", "code": "333", "text": ["Ausfahrt"], "width": 0.4, "height": 0.75, "posts": 2},
    "raised": {"shape": "round", "code": "274-100", "width": 0.6, "height": 0.6, "elevation": 0.7, "lower_edge": 1.0},
    "turned": {"shape": "triangle", "code": "101", "width": 0.9, "height": 0.78, "rotation_deg": -35.0},
    "point": {"shape": "triangle_down", "code": "205", "width": 0.9, "height": 0.78, "rotation_deg": 120.0},
    "priority": {"shape": "diamond", "code": "306", "width": 0.6, "height": 0.6},
    "letter": {"shape": "rectangle", "code": "x", "text": ["L"], "width": 1.0, "height": 1.0},
}
SIGNS = OF_CATALOGUE | {
    name: {"type": "TrafficSign", "station": 200.0 + 6.0 * i, "offset": 19.0} | item
    for i, (name, item) in enumerate(OTHERS.items())
}


@pytest.fixture(scope="module")
def road() -> FurnishedRoad:
    return FurnishedRoad(SIGNS, {"signs"})


def sign_of(road: FurnishedRoad, name: str) -> TrafficSign:
    sign = road.parameters.objects[name]
    assert isinstance(sign, TrafficSign)
    return sign


def has_content(sign: TrafficSign) -> bool:
    """Return whether something is drawn on a face: that for giving way is blank, and a limit is its text's number."""
    entry = sign_catalogue().signs.get(sign.code)
    return bool(sign.text) or (entry is not None and entry.pictogram not in ("none", "number"))


def is_front(mesh: SceneMesh) -> NDArray[np.bool_]:
    """Return which triangles (T,) are sheeting."""
    return of_material(mesh, *(name for name in mesh.materials if name.startswith("sheeting_")))


def writing(road: FurnishedRoad, name: str) -> Float:
    """Return the triangles (T, 3, 3) of writing and pictogram in the sign's frame."""
    mesh = road.mesh(name)
    own = own_frame(road, name, corners(mesh, is_front(mesh)))
    return own[own[..., 1].mean(axis=1) < own[..., 1].max() - RAISED / 2]


@pytest.mark.keep_scene
@pytest.mark.parametrize("name", list(SIGNS))
class TestSign:
    def test_its_face_has_its_size_and_height(self, road: FurnishedRoad, name: str) -> None:
        sign, mesh = sign_of(road, name), road.mesh(name)
        own = own_frame(road, name, corners(mesh, is_front(mesh))).reshape(-1, 3)
        low, high = own.min(axis=0), own.max(axis=0)
        assert high[0] - low[0] == pytest.approx(sign.width, abs=MEASURE)
        assert low[0] + high[0] == pytest.approx(0.0, abs=MEASURE)
        assert low[2] == pytest.approx(sign.lower_edge, abs=MEASURE)
        assert high[2] == pytest.approx(sign.lower_edge + sign.height, abs=MEASURE)
        front = -(sign.post_diameter / 2 + sizes.RAIL + PLATE)
        drawn = RAISED if has_content(sign) else 0.0
        assert (low[1], high[1]) == (pytest.approx(front - drawn, abs=5e-4), pytest.approx(front, abs=5e-4))

    def test_it_faces_the_traffic_and_its_back_is_grey(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        front = is_front(mesh)
        a, b, c = np.moveaxis(corners(mesh, front), 1, 0)
        broad = front.copy()  # thin pieces of letters have the normals of rounded places
        broad[front] = np.linalg.norm(np.cross(b - a, c - a), axis=1) > BROAD
        assert (normals(mesh, broad) @ axes(road, name)[1] < -0.99).all()
        back = normals(mesh, of_material(mesh, "board_back")) @ axes(road, name)[1]
        assert np.count_nonzero(back > 0.99) > 2

    def test_nothing_touches_the_back_of_the_plate(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        grey = of_material(mesh, "board_back")
        along = normals(mesh, grey) @ axes(road, name)[1]
        level = own_frame(road, name, corners(mesh, grey))[..., 1].mean(axis=1)
        back = level[along > 0.99].min()
        assert np.abs(level[along < -0.99] - back).min() > 3e-4

    def test_its_plate_is_closed(self, road: FurnishedRoad, name: str) -> None:
        sign, mesh = sign_of(road, name), road.mesh(name)
        own = own_frame(road, name, corners(mesh, is_front(mesh) | of_material(mesh, "board_back")))
        front = -(sign.post_diameter / 2 + sizes.RAIL)
        plate = own[(own[..., 1].max(axis=1) < front + 2e-4) & (own[..., 1].min(axis=1) > front - PLATE - RAISED / 2)]
        assert open_edges(plate) == 0
        area = np.linalg.norm(np.cross(plate[:, 1] - plate[:, 0], plate[:, 2] - plate[:, 0]), axis=1).sum() / 2
        assert volume(plate) == pytest.approx(area / 2 * PLATE, rel=0.1)

    def test_its_posts_stand_on_the_ground_beside_each_other(self, road: FurnishedRoad, name: str) -> None:
        sign, mesh = sign_of(road, name), road.mesh(name)
        steel = of_material(mesh, "galvanised_steel")
        vertices = corners(mesh, steel).reshape(-1, 3)
        x = own_frame(road, name, vertices)[:, 0]
        assert sign.posts == len(self.posts_at(x, sign))
        for middle in self.posts_at(x, sign):
            post = vertices[np.abs(x - middle) < sign.post_diameter]
            ground = road.surface(post[:, :2].mean(axis=0)[None])[0]
            assert post[:, 2].min() - ground == pytest.approx(sign.elevation - BURIED, abs=0.02)
            wide = np.ptp(own_frame(road, name, post)[:, :2], axis=0)
            assert wide.max() <= sign.post_diameter + MEASURE
            assert wide.max() > 0.84 * sign.post_diameter  # three chords don't reach all around
        top = own_frame(road, name, vertices)[:, 2].max()
        assert sign.lower_edge < top < sign.lower_edge + sign.height

    @staticmethod
    def posts_at(x: Float, sign: TrafficSign) -> list[float]:
        """Return the x of those places of posts that something stands at."""
        wanted = ((np.arange(sign.posts) + 0.5) / sign.posts - 0.5) * sign.width
        return [middle for middle in wanted.tolist() if (np.abs(x - middle) <= sign.post_diameter / 2 + MEASURE).any()]

    def test_every_face_is_labelled_and_has_an_area(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        assert np.unique(mesh.class_id).tolist() == [class_id("road_sign")]
        assert np.unique(mesh.instance_id).tolist() == [road.instance(name)]
        assert "unknown" not in {mesh.materials[i] for i in np.unique(mesh.material)}
        assert len(mesh.triangles) < MOST_TRIANGLES
        item = road.model.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        assert min(face.area for face in item.polygons) > THIN

    def test_writing_and_pictogram_stand_off_the_border(self, road: FurnishedRoad, name: str) -> None:
        sign, drawn = sign_of(road, name), writing(road, name)
        assert bool(len(drawn)) == has_content(sign)
        if not len(drawn):
            return
        own = drawn.reshape(-1, 3)
        half, middle = np.array([sign.width, sign.height]) / 2, sign.lower_edge + sign.height / 2
        assert (np.abs(own[:, [0, 2]] - [0.0, middle]) < half * 0.97).all()
        if sign.shape == "round" and sign.code != "282":
            assert np.hypot(own[:, 0], own[:, 2] - middle).max() < 0.89 * half[0]
        if sign.shape == "triangle":
            # Below the inner sides, which run up to the apex.
            assert (np.abs(own[:, 0]) < (middle + half[1] - own[:, 2]) / sign.height * half[0] - 0.05 * half[0]).all()


@pytest.mark.keep_scene
class TestWriting:
    def test_it_is_not_mirrored(self, road: FurnishedRoad) -> None:
        letter = writing(road, "letter")
        area = np.linalg.norm(np.cross(letter[:, 1] - letter[:, 0], letter[:, 2] - letter[:, 0]), axis=1)
        middle = (letter.mean(axis=1) * area[:, None]).sum(axis=0) / area.sum()
        low, high = letter.min(axis=(0, 1)), letter.max(axis=(0, 1))
        assert middle[0] < (low[0] + high[0]) / 2 - 0.01
        assert middle[2] < (low[2] + high[2]) / 2 - 0.01

    def test_letters_are_as_high_as_their_line_allows(self, road: FurnishedRoad) -> None:
        height = np.ptp(writing(road, "letter")[..., 2])
        # The box is 0.88 of the face of 1 m.
        assert height == pytest.approx(LETTERS * 0.88, abs=MEASURE)

    def test_lines_stand_one_below_the_other_in_one_size(self, road: FurnishedRoad) -> None:
        own = writing(road, "453")
        # Letters of a line overlap in height, lines don't: cut between them.
        spans = sorted((float(t[:, 2].min()), float(t[:, 2].max())) for t in own)
        lines: list[list[float]] = []
        for low, high in spans:
            if lines and low < lines[-1][1]:
                lines[-1][1] = max(lines[-1][1], high)
            else:
                lines.append([low, high])
        tops = [high for _, high in lines]
        assert len(lines) == 4
        assert all(after - before == pytest.approx(tops[1] - tops[0], abs=0.03) for before, after in pairwise(tops))
        assert np.ptp(own[..., 0]) < 0.9 * sign_of(road, "453").width

    def test_limits_differ_by_their_number_only(self, road: FurnishedRoad) -> None:
        drawn = {code: len(writing(road, code)) for code in ("274-60", "274-80", "274-100", "274-120")}
        assert all(drawn.values())
        assert len(writing(road, "101")) < min(drawn.values())

    @pytest.mark.parametrize(("code", "bars"), [("450-50", 1), ("450-51", 2), ("450-52", 3)])
    def test_beacons_have_a_bar_per_hundred_metres(self, road: FurnishedRoad, code: str, bars: int) -> None:
        mesh = road.mesh(code)
        white = [own_frame(road, code, piece) for piece in pieces(mesh, of_material(mesh, "sheeting_white"))]
        wide = [piece for piece in white if 0.6 < np.ptp(piece[..., 0]) < 0.9]
        assert len(wide) == bars
        for bar in wide:
            left, right = (
                bar[..., 2][np.isclose(bar[..., 0], x)].mean() for x in (bar[..., 0].min(), bar[..., 0].max())
            )
            assert right > left + 0.1  # rising towards the exit

    def test_the_exit_arrow_points_up_to_the_right(self, road: FurnishedRoad) -> None:
        mesh = road.mesh("333")
        white = [own_frame(road, "333", p).reshape(-1, 3) for p in pieces(mesh, of_material(mesh, "sheeting_white"))]
        arrow = min((p for p in white if len(p) > 12 and np.ptp(p[:, 0]) < 0.5), key=lambda p: p[:, 2].min())
        tip = arrow[(arrow[:, 0] + arrow[:, 2]).argmax()]
        assert tip[0] == pytest.approx(arrow[:, 0].max(), abs=1e-3)
        assert tip[2] == pytest.approx(arrow[:, 2].max(), abs=1e-3)

    def test_what_must_not_be_overtaken_is_red_and_black(self, road: FurnishedRoad) -> None:
        mesh = road.mesh("276")
        middle = {}
        for color in ("red", "black"):
            own = own_frame(road, "276", corners(mesh, of_material(mesh, f"sheeting_{color}")))
            drawn = own[own[..., 1].mean(axis=1) < own[..., 1].max() - RAISED / 2] if color == "red" else own
            middle[color] = float(drawn[..., 0].mean())
        assert middle["red"] < -0.05
        assert middle["black"] > 0.05


@pytest.mark.keep_scene
class TestEdits:
    def test_inputs_change_the_mesh(self, road: FurnishedRoad) -> None:
        before = road.mesh("wide")
        wider = own_frame(road, "wide", road.edit("wide", "Width", 4.0).vertices)
        assert np.ptp(wider[:, 0]) == pytest.approx(4.0, abs=MEASURE)
        assert len(road.edit("wide", "Line 2", "Hohes Venn und Eifel").triangles) > len(before.triangles) + 100
        assert len(road.edit("wide", "Pictogram", NAMES.index("works")).triangles) > len(before.triangles) + 130
        lattice = road.edit("wide", "Lattice", True)
        assert np.count_nonzero(of_material(lattice, "galvanised_steel")) > 200
        raised = own_frame(road, "wide", road.edit("wide", "Lower Edge", 3.0).vertices)
        assert raised[:, 2].max() == pytest.approx(3.0 + 1.5, abs=MEASURE)


def test_a_sign_stands_in_its_place_on_a_stretch_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stretches, "FRAME", 50.0)
    road = FurnishedRoad(SIGNS, {"signs"}, stretch=(195.0, 245.0))
    assert np.abs(road.origin).max() > 50.0
    sign = sign_of(road, "turned")
    own = own_frame(road, "turned", road.mesh("turned").vertices)
    assert own[:, 0].max() == pytest.approx(sign.width / 2, abs=MEASURE)
    assert own[:, 2].max() == pytest.approx(sign.lower_edge + sign.height, abs=MEASURE)
    assert "274-60" not in road.model.objects


class TestFace:
    @pytest.mark.parametrize("shape", SHAPES)
    def test_every_shape_fills_its_box_and_has_no_holes(self, shape: str) -> None:
        style = FaceStyle("white", "red", "black")
        for width, height in ((0.75, 0.75), (1.26, 1.09), (2.0, 0.5), (0.1, 0.75)):
            inputs = face_inputs(style, shape, width, height, ()) | {"Border Width": 0.04, "Edge Width": 0.01}
            mesh = evaluated(sign_face_group(), **inputs)
            place = np.array([vertex.co for vertex in mesh.vertices])
            assert np.ptp(place[:, [0, 2]], axis=0) == pytest.approx([width, height], abs=MEASURE)
            front = sum(face.area for face in mesh.polygons if face.normal.y < -0.9)
            back = sum(face.area for face in mesh.polygons if face.normal.y > 0.9)
            assert front == pytest.approx(back, rel=1e-4)

    def test_a_border_wider_than_the_face_leaves_no_tangle(self) -> None:
        for shape in range(len(SHAPES)):
            mesh = evaluated(sign_face_group(), **{"Shape": shape, "Border Width": 0.9, "Edge Width": 0.4})
            front = [face for face in mesh.polygons if abs(face.normal.y) > 0.9]
            assert sum(face.area for face in front) < 2.0 + 1e-3

    def test_the_catalogue_can_be_drawn(self) -> None:
        for code, sign in sign_catalogue().signs.items():
            assert sign.pictogram in (*NAMES, "number"), code
            for color in (sign.ground, sign.border, sign.writing):
                assert materials()[f"sheeting_{color}"].base_color == sign_catalogue().colors[color]
        assert set(get_args(Pictogram)) == {*NAMES, "number"}

    def test_pictograms_run_anticlockwise(self) -> None:
        for name, polygons in PICTOGRAMS.items():
            for polygon in polygons:
                x, y = np.array(polygon).T
                assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0.0, name

    def test_all_lines_are_written(self) -> None:
        style, text = FaceStyle("blue", "white", "white"), [chr(ord("A") + i) for i in range(LINES)]
        faces = []
        for count in range(LINES + 1):
            mesh = evaluated(sign_face_group(), **face_inputs(style, "rectangle", 2.0, 3.0, text[:count]))
            faces.append(len(mesh.polygons))
        assert all(after > before for before, after in pairwise(faces))

    def test_making_a_sign_is_quick(self) -> None:
        style = FaceStyle("blue", "white", "white", "exit_arrow")
        inputs = face_inputs(style, "rectangle", 4.0, 3.0, ("Aachen", "Eschweiler", "Kerpen"))
        letters = made_anew(node_group("Letters", filled_letters), Words="Aachen Eschweiler Kerpen " * 4)
        ratio = times_as_long(made_anew(sign_face_group(), **inputs), letters, rounds=20)
        print(f"a sign takes {ratio:.2f} times as long as a hundred letters")
        assert ratio < MOST_LETTERS / 100.0

    def test_a_face_is_labelled(self) -> None:
        inputs = face_inputs(FaceStyle("white", "red", "black"), "round", 0.75, 0.75, ("120",)) | {"Instance": 7}
        evaluated(sign_face_group(), **inputs)
        mesh = scene_mesh()
        assert (mesh.class_id == class_id("road_sign")).all()
        assert (mesh.instance_id == 7).all()
        used = {mesh.materials[i] for i in np.unique(mesh.material)}
        assert used == {"sheeting_white", "sheeting_red", "sheeting_black", "board_back"}
        assert material("sheeting_red").name in {item.name for item in bpy.data.materials}
