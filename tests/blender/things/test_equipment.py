"""Kilometre boards, poles, traffic lights, cabinets and delineators on the built mesh: sizes, places, labels, edits."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.road.objects import ObjectT
from synthroads_addon.road.things import kilometre_board as sizes
from synthroads_addon.road.things.body import BURIED
from synthroads_addon.road.things.cabinet import CORNERS, PAD_RISE, PLINTH, Cabinet
from synthroads_addon.road.things.delineator import REFLECTOR, Delineator
from synthroads_addon.road.things.kilometre_board import KilometreBoard
from synthroads_addon.road.things.pole import Pole
from synthroads_addon.road.things.traffic_light import TrafficLight
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

MOST_TRIANGLES = 1000
PARTS = ("kilometre_boards", "poles", "traffic_lights", "cabinets", "delineators")
CLASSES = {"KilometreBoard": "road_sign", "Pole": "pole", "TrafficLight": "traffic_light", "Cabinet": "utility"}


def phone(**more: object) -> Data:
    return {"type": "Cabinet", "kind": "emergency_phone", **more}


def utility(width: float, depth: float, height: float, **more: object) -> Data:
    return {"type": "Cabinet", "kind": "utility", "width": width, "depth": depth, "height": height, **more}


KINDS: dict[str, Data] = {
    "board": {"type": "KilometreBoard", "text": "123,5"},
    "board-large": {"type": "KilometreBoard", "text": "9", "width": 1.0, "height": 0.5, "elevation": 0.75},
    "lighting": {"type": "Pole"},
    "lighting-long": {"type": "Pole", "height": 14.0, "diameter": 0.3, "arm_length": 2.5, "rotation_deg": 180.0},
    "lighting-plain": {"type": "Pole", "height": 8.0, "diameter": 0.12, "arm_length": 0.0},
    "cameras": {"type": "Pole", "kind": "surveillance", "height": 10.0, "diameter": 0.25, "arm_length": 1.0},
    "cameras-plain": {"type": "Pole", "kind": "surveillance", "height": 6.0, "diameter": 0.2, "arm_length": 0.0},
    **{f"light-{n}": {"type": "TrafficLight", "lights": n, "height": 2.5 + 0.5 * n} for n in (1, 2, 3, 4)},
    "light-large": {"type": "TrafficLight", "light_diameter": 0.3, "rotation_deg": 180.0},
    "phone": phone(),
    "phone-large": phone(width=0.4, depth=0.25, height=1.9, rotation_deg=180.0),
    "cabinet": utility(0.8, 0.35, 1.1),
    "cabinet-small": utility(0.6, 0.3, 0.9, elevation=0.2),
    "cabinet-turned": utility(1.2, 0.4, 1.3, rotation_deg=30.0),
    "cabinet-pad": utility(0.8, 0.35, 1.1, rotation_deg=90.0, pad_margin=0.3),
}
DELINEATORS: dict[str, Data] = {
    "post": {},
    "post-against": {"rotation_deg": 180.0},
    "post-short": {"height": 0.4, "elevation": 0.75},
}
ITEMS = {
    name: {"station": 12.0 + 8.0 * i, "offset": (-15.2, -17.0, 18.0)[i % 3], **item}
    for i, (name, item) in enumerate(KINDS.items())
} | {
    name: {"type": "Delineator", "station": 200.0 + 10.0 * i, "offset": -14.6, **item}
    for i, (name, item) in enumerate(DELINEATORS.items())
}


@pytest.fixture(scope="module")
def road() -> FurnishedRoad:
    return FurnishedRoad(ITEMS, PARTS)


def own(road: FurnishedRoad, name: str, *of: str) -> Float:
    """Return the corners (T, 3, 3) of an object's triangles in its frame, those of some materials if any is named."""
    mesh = road.mesh(name)
    return own_frame(road, name, corners(mesh, of_material(mesh, *of) if of else slice(None)))


def of_type(road: FurnishedRoad, name: str, kind: type[ObjectT]) -> ObjectT:
    item = road.parameters.objects[name]
    assert isinstance(item, kind)
    return item


def ground_below(road: FurnishedRoad, name: str) -> Float:
    """Return the built ground's heights at the corners of a utility cabinet or its pad, m above its foot; else none."""
    item = road.parameters.objects[name]
    if not isinstance(item, Cabinet) or item.kind != "utility":
        return np.empty(0)
    foot = road.point(item.station, item.offset)
    right, along, _ = axes(road, name)
    wide, deep = item.width + 2.0 * item.pad_margin, item.depth + 2.0 * item.pad_margin
    plan = [foot[:2] + x * wide * right[:2] + y * deep * along[:2] for x, y in CORNERS]
    return road.surface(np.array(plan)) - foot[2] - item.elevation


def highest_below(road: FurnishedRoad, name: str) -> float:
    """Return by how much the ground below a utility cabinet is higher than its foot, m; 0 of other things."""
    pad = getattr(road.parameters.objects[name], "pad_margin", 0.0)
    return float(ground_below(road, name).max(initial=0.0)) + (PAD_RISE if pad else 0.0)


@pytest.mark.keep_scene
@pytest.mark.parametrize("name", list(KINDS))
class TestEach:
    def test_every_face_is_labelled_and_has_an_area(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        assert np.unique(mesh.class_id).tolist() == [class_id(CLASSES[KINDS[name]["type"]])]
        assert np.unique(mesh.instance_id).tolist() == [road.instance(name)]
        assert "unknown" not in {mesh.materials[i] for i in np.unique(mesh.material)}
        assert len(mesh.triangles) < MOST_TRIANGLES
        item = road.model.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        assert min(face.area for face in item.polygons) > 1e-8

    def test_its_top_is_as_high_as_it_says(self, road: FurnishedRoad, name: str) -> None:
        item = road.parameters.objects[name]
        top = item.height + getattr(item, "lower_edge", 0.0) + highest_below(road, name)
        assert own(road, name)[..., 2].max() == pytest.approx(top, abs=MEASURE)

    def test_it_reaches_into_the_ground(self, road: FurnishedRoad, name: str) -> None:
        low = own(road, name)[..., 2].min()
        assert -0.5 - MEASURE < low - ground_below(road, name).min(initial=0.0) < -0.3 + MEASURE

    def test_its_solids_look_outwards(self, road: FurnishedRoad, name: str) -> None:
        written = ("sheeting_white", "sheeting_blue", "board_back")
        mesh = road.mesh(name)
        solid = ~of_material(mesh, *written)
        for piece in pieces(mesh, solid):
            assert open_edges(piece) == 0
            assert volume(piece) > 0.0


@pytest.mark.keep_scene
class TestKilometreBoard:
    @pytest.mark.parametrize("name", ["board", "board-large"])
    def test_it_has_its_size_and_is_read_from_both_sides(self, road: FurnishedRoad, name: str) -> None:
        board = of_type(road, name, KilometreBoard)
        mesh = road.mesh(name)
        face = own(road, name, "sheeting_blue", "sheeting_white")
        assert np.ptp(face[..., 0]) == pytest.approx(board.width, abs=MEASURE)
        assert face[..., 2].min() == pytest.approx(board.lower_edge, abs=MEASURE)
        along = normals(mesh, of_material(mesh, "sheeting_white")) @ axes(road, name)[1]
        assert np.count_nonzero(along < -0.99) == np.count_nonzero(along > 0.99) > 10
        assert len(along) == np.count_nonzero(np.abs(along) > 0.99)
        post = own(road, name, "galvanised_steel")
        assert np.ptp(post[..., :2], axis=(0, 1)).max() == pytest.approx(sizes.POST, abs=MEASURE)

    def test_longer_numbers_have_more_faces(self, road: FurnishedRoad) -> None:
        before = len(road.mesh("board").triangles)
        assert len(road.edit("board", "Line 1", "1").triangles) < before
        assert len(road.edit("board", "Line 1", "123,5").triangles) == before


@pytest.mark.keep_scene
class TestPole:
    @pytest.mark.parametrize("name", ["lighting", "lighting-long", "lighting-plain", "cameras", "cameras-plain"])
    def test_it_stands_upright_with_its_diameter(self, road: FurnishedRoad, name: str) -> None:
        pole = of_type(road, name, Pole)
        steel = own(road, name, "galvanised_steel").reshape(-1, 3)
        foot = steel[np.abs(steel[:, 2]) < 0.01]
        assert np.ptp(foot[:, :2], axis=0) == pytest.approx(pole.diameter, abs=MEASURE)
        assert np.abs(foot[:, :2].mean(axis=0)).max() < MEASURE
        reach = -steel[:, 0].min()
        assert reach == pytest.approx(max(pole.arm_length, pole.diameter / 2), abs=MEASURE)
        high = steel[(steel[:, 2] > 0.7 * pole.height) & (np.abs(steel[:, 0]) < 0.2)]
        assert np.ptp(high[:, 1]) < 0.8 * pole.diameter

    @pytest.mark.parametrize("name", ["lighting", "lighting-long", "lighting-plain"])
    def test_the_lamp_looks_down_from_the_end_of_the_arm(self, road: FurnishedRoad, name: str) -> None:
        pole = of_type(road, name, Pole)
        glass = own(road, name, "lamp_glass")
        housing = own(road, name, "cabinet_grey")
        assert glass[..., 2].min() < housing[..., 2].min() - 0.005
        assert -pole.arm_length - 0.7 < glass[..., 0].min() < glass[..., 0].max() < -pole.arm_length

    def test_cameras_look_along_the_road_both_ways(self, road: FurnishedRoad) -> None:
        for name, domes in (("cameras", 1), ("cameras-plain", 0)):
            mesh = road.mesh(name)
            lenses = [own_frame(road, name, piece) for piece in pieces(mesh, of_material(mesh, "display"))]
            assert len(lenses) == 2 + domes
            along = sorted(float(lens[..., 1].mean()) for lens in lenses)
            assert along[0] < -0.3
            assert along[-1] > 0.3

    def test_edits_change_the_mesh(self, road: FurnishedRoad) -> None:
        before = own(road, "lighting")
        road.edit("lighting", "Arm Length", 2.5)
        assert own(road, "lighting")[..., 0].min() == pytest.approx(before[..., 0].min() - 1.0, abs=1e-3)
        road.edit("lighting", "Height", 9.0)
        assert own(road, "lighting")[..., 2].max() == pytest.approx(9.0, abs=MEASURE)
        for name, value in {"Height": 12.0, "Arm Length": 1.5}.items():
            road.edit("lighting", name, value)


@pytest.mark.keep_scene
class TestTrafficLight:
    @pytest.mark.parametrize("name", ["light-1", "light-2", "light-3", "light-4", "light-large"])
    def test_it_has_its_lights_from_red_to_green(self, road: FurnishedRoad, name: str) -> None:
        light, mesh = of_type(road, name, TrafficLight), road.mesh(name)
        found: list[tuple[float, str]] = []
        for color in ("red", "yellow", "green"):
            chosen = of_material(mesh, f"lamp_{color}")
            for lamp in pieces(mesh, chosen) if chosen.any() else []:
                place = own_frame(road, name, lamp)
                assert np.ptp(place[..., 0]) == pytest.approx(light.light_diameter, abs=MEASURE)
                assert (place[..., 1] < 0.0).all()
                found.append((float(place[..., 2].mean()), color))
        colors = [color for _, color in sorted(found, reverse=True)]
        assert colors == {1: ["red"], 2: ["red", "green"], 3: ["red", "yellow", "green"]}.get(
            light.lights, ["red", "yellow", "green", "yellow"]
        )

    def test_visors_reach_beyond_the_lights(self, road: FurnishedRoad) -> None:
        lamp = own(road, "light-3", "lamp_red")
        black = own(road, "light-3", "plastic_black").reshape(-1, 3)
        above = black[np.abs(black[:, 2] - lamp[..., 2].max()) < 0.02]
        assert above[:, 1].min() < lamp[..., 1].min() - 0.05

    def test_edits_change_the_mesh(self, road: FurnishedRoad) -> None:
        one, three = len(road.edit("light-3", "Lights", 1).triangles), len(road.edit("light-3", "Lights", 3).triangles)
        assert three > 2 * one
        road.edit("light-3", "Light Diameter", 0.3)
        assert np.ptp(own(road, "light-3", "lamp_red")[..., 0]) == pytest.approx(0.3, abs=MEASURE)
        road.edit("light-3", "Light Diameter", 0.2)


@pytest.mark.keep_scene
class TestCabinet:
    @pytest.mark.parametrize("name", ["phone", "phone-large", "cabinet", "cabinet-small", "cabinet-turned"])
    def test_it_has_its_width_and_depth(self, road: FurnishedRoad, name: str) -> None:
        cabinet = of_type(road, name, Cabinet)
        place = own(road, name).reshape(-1, 3)
        low, high = place.min(axis=0), place.max(axis=0)
        assert high[0] - low[0] == pytest.approx(cabinet.width, abs=MEASURE)
        assert high[1] == pytest.approx(cabinet.depth / 2, abs=MEASURE)
        assert low[1] == pytest.approx(-cabinet.depth / 2, abs=MEASURE)

    def test_a_pad_is_level_around_it(self, road: FurnishedRoad) -> None:
        cabinet = of_type(road, "cabinet-pad", Cabinet)
        pad = own(road, "cabinet-pad", "concrete").reshape(-1, 3)
        assert np.ptp(pad[:, :2], axis=0) == pytest.approx([cabinet.width + 0.6, cabinet.depth + 0.6], abs=MEASURE)
        outer = pad[np.abs(pad[:, 0]) > cabinet.width / 2.0 + 0.29]
        assert np.unique(outer[:, 2].round(3)).tolist() == pytest.approx(
            [ground_below(road, "cabinet-pad").min() - BURIED, highest_below(road, "cabinet-pad")], abs=MEASURE
        )

    @pytest.mark.parametrize("name", ["cabinet", "cabinet-small", "cabinet-turned", "cabinet-pad"])
    def test_it_stands_level_above_all_ground_below_it(self, road: FurnishedRoad, name: str) -> None:
        body, plinth = (own(road, name, material)[..., 2] for material in ("cabinet_grey", "concrete"))
        ground = ground_below(road, name)
        assert body.min() == pytest.approx(highest_below(road, name) + PLINTH, abs=MEASURE)
        assert plinth.max() == pytest.approx(body.min(), abs=MEASURE)
        assert plinth.min() == pytest.approx(min(ground.min(), 0.0) - BURIED, abs=MEASURE)

    def test_on_a_batter_the_ground_below_one_differs_by_more_than_its_plinth(self, road: FurnishedRoad) -> None:
        assert np.ptp(ground_below(road, "cabinet-turned")) > PLINTH

    def test_wide_ones_have_two_doors(self, road: FurnishedRoad) -> None:
        for name, doors in (("cabinet", 2), ("cabinet-small", 1)):
            mesh = road.mesh(name)
            black = [own_frame(road, name, piece) for piece in pieces(mesh, of_material(mesh, "plastic_black"))]
            handles = [piece for piece in black if np.ptp(piece[..., 2]) > 0.1]
            assert len(handles) == doors
            assert all((piece[..., 1] < 0.0).all() for piece in handles)

    def test_a_phone_says_sos_on_all_sides(self, road: FurnishedRoad) -> None:
        mesh = road.mesh("phone")
        white = normals(mesh, of_material(mesh, "sheeting_white")) @ axes(road, "phone").T
        letters = [np.count_nonzero((white * side).sum(axis=1) > 0.999) for side in np.eye(3)[:2].tolist()]
        letters += [np.count_nonzero((white * side).sum(axis=1) < -0.999) for side in np.eye(3)[:2].tolist()]
        assert min(letters) > 40
        assert max(letters) - min(letters) == 0

    def test_edits_change_the_mesh(self, road: FurnishedRoad) -> None:
        road.edit("cabinet", "Width", 1.5)
        assert np.ptp(own(road, "cabinet")[..., 0]) == pytest.approx(1.5, abs=MEASURE)
        road.edit("cabinet", "Width", 0.8)
        road.edit("phone", "Height", 1.8)
        assert own(road, "phone")[..., 2].max() == pytest.approx(1.8, abs=MEASURE)
        road.edit("phone", "Height", 1.6)


@pytest.mark.keep_scene
@pytest.mark.parametrize("name", list(DELINEATORS))
class TestDelineator:
    def triangles(self, road: FurnishedRoad, name: str, *of: str) -> tuple[Float, Float]:
        """Return corners (T, 3, 3) and normals (T, 3) of a post's triangles in its frame."""
        mesh = road.mesh("Delineators")
        chosen = mesh.instance_id == road.instance(name)
        chosen &= of_material(mesh, *of) if of else True
        return own_frame(road, name, corners(mesh, chosen)), normals(mesh, chosen) @ axes(road, name).T

    def test_it_stands_on_the_surface_plus_its_elevation(self, road: FurnishedRoad, name: str) -> None:
        post = of_type(road, name, Delineator)
        place, _ = self.triangles(road, name)
        assert place[..., 2].max() == pytest.approx(post.height, abs=MEASURE)
        assert np.ptp(place[..., 0]) == pytest.approx(0.12, abs=MEASURE)

    def test_reflectors_look_away_from_the_post(self, road: FurnishedRoad, name: str) -> None:
        post = of_type(road, name, Delineator)
        place, normal = self.triangles(road, name, "reflector")
        front, behind = normal[:, 1] < -0.8, normal[:, 1] > 0.8
        assert np.count_nonzero(front) == 2
        # Two discs of 16 corners.
        assert np.count_nonzero(behind) == 2 * 14
        assert np.ptp(place[front][..., 2]) == pytest.approx(REFLECTOR[1] * post.height, abs=MEASURE)
        body, _ = self.triangles(road, name, "plastic_black")
        assert place[..., 2].max() < body[..., 2].max()
        assert place[..., 2].min() > body[..., 2].min()
        faces, _ = self.triangles(road, name, "reflector")
        for piece in faces[front], faces[behind]:
            # The black flank lies 4 mm behind: at the same x it is nearer to the axis.
            x, y = piece[..., 0].mean(), np.abs(piece[..., 1]).mean()
            assert y > 0.055 - (x + 0.045) * 0.041 / 0.095 + 0.003
