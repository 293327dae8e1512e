"""Concrete, noise and temporary barriers on the built mesh: sizes, spacing, labels, that they stand and are closed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.helpers.scenes.furnished_road import (
    MEASURE,
    Data,
    Float,
    FurnishedRoad,
    corners,
    of_material,
    open_edges,
    pieces,
    volume,
)

pytestmark = pytest.mark.any_blender

PARTS = ("concrete_barriers", "guardrails", "noise_barriers", "temporary_barriers")
PANELS = {"aluminium": 0.12, "concrete": 0.2, "wood": 0.14, "glass": 0.06}
PANEL_MATERIALS = {"aluminium": "noise_aluminium", "concrete": "noise_concrete", "wood": "noise_wood"}
PANEL_MATERIALS |= {"glass": "acrylic_glass"}


def line(kind: str, start: float, end: float, offset: float, **more: object) -> Data:
    return {"type": kind, "start_station": start, "end_station": end, "offset": offset, **more}


OBJECTS: dict[str, Data] = {
    "step": line("ConcreteBarrier", 50.0, 201.3, 0.0),
    "jersey": line("ConcreteBarrier", 30.0, 90.0, -14.8, profile="new_jersey", height=0.81, base_width=0.6),
    "blunt": line("ConcreteBarrier", 100.0, 120.0, 14.8, terminal_length=0.0),
    **{
        kind: line(
            "NoiseBarrier",
            20.0 + 62.0 * i,
            67.0 + 62.0 * i,
            -18.0,
            panel=kind,
            thickness=thickness,
            height=3.5 + 0.5 * i,
        )
        for i, (kind, thickness) in enumerate(PANELS.items())
    },
    "rail": line("Guardrail", 82.0, 190.0, 14.9, faces="right", reflector_spacing=30.0),
    "bare-rail": line("Guardrail", 210.0, 230.0, 0.0, faces="both", reflector_spacing=0.0, beam_length=6.0),
    "left-wall": line("NoiseBarrier", 100.0, 148.0, 19.0, post_spacing=5.0),
    "steel": line("TemporaryBarrier", 100.0, 181.0, -5.0, end_offset=-8.0),
    "plastic": line(
        "TemporaryBarrier", 100.0, 115.0, -12.0, end_offset=-12.0, segment_length=1.5, height=0.8, base_width=0.5
    ),
}


@pytest.fixture(scope="module")
def road() -> FurnishedRoad:
    return FurnishedRoad(OBJECTS, PARTS)


def above(road: FurnishedRoad, points: Float) -> Float:
    """Return how far points (N, 3) are above the surface."""
    return points[:, 2] - road.surface(points[:, :2])


def crest(road: FurnishedRoad, mesh: SceneMesh, offset: float) -> tuple[Float, Float]:
    """Return stations of a barrier's rows, and its height over its axis there."""
    station, _ = road.located(mesh.vertices)
    rows = np.unique(np.round(station, 3))
    tops = [mesh.vertices[np.abs(station - row) < 2e-3, 2].max() for row in rows]
    feet = [road.point(row, offset)[2] for row in rows]
    return rows, np.array(tops) - np.array(feet)


@pytest.mark.keep_scene
class TestConcrete:
    @pytest.mark.parametrize(("name", "height", "width"), [("step", 0.9, 0.54), ("jersey", 0.81, 0.6)])
    def test_it_is_as_high_and_wide_as_said_and_ramped_at_its_ends(
        self, road: FurnishedRoad, name: str, height: float, width: float
    ) -> None:
        mesh, item = road.mesh(name), OBJECTS[name]
        start, end, offset = item["start_station"], item["end_station"], item["offset"]
        station, height_there = crest(road, mesh, offset)
        assert station[0] == pytest.approx(start, abs=MEASURE)
        assert station[-1] == pytest.approx(end, abs=MEASURE)
        inside = np.minimum(station - start, end - station)
        assert np.abs(height_there[inside > 8.0 - 1e-3] - height).max() < MEASURE
        # The ramps are straight but for their last 8 cm, and begin 8 m from the ends.
        ramp = (inside > 1.0) & (inside < 8.0)
        assert np.abs(height_there[ramp] - height * inside[ramp] / 8.0).max() < MEASURE
        assert np.abs(inside - 8.0).min() < 1e-3
        assert height_there[[0, -1]].max() < 0.1
        _, across = road.located(mesh.vertices)
        assert across.max() - offset == pytest.approx(width / 2, abs=MEASURE)
        assert across.min() - offset == pytest.approx(-width / 2, abs=MEASURE)

    def test_profiles_differ(self, road: FurnishedRoad) -> None:
        widths = {}
        for name in ("step", "jersey"):
            mesh, item = road.mesh(name), OBJECTS[name]
            station, offset = road.located(mesh.vertices)
            full = (station > item["start_station"] + 10) & (station < item["start_station"] + 40)
            level = mesh.vertices[full, 2] - [road.point(s, item["offset"])[2] for s in station[full]]
            # Half way up, where the New Jersey profile has its kink and the step profile is already narrow.
            share = level / item.get("height", 0.9)
            middle = (share > 0.28) & (share < 0.5)
            widths[name] = np.ptp(offset[full][middle]) / item.get("base_width", 0.54)
        assert widths["jersey"] == pytest.approx(0.44, abs=0.02)
        assert widths["step"] == pytest.approx(0.7, abs=0.02)

    def test_a_blunt_end_is_closed_at_full_height(self, road: FurnishedRoad) -> None:
        station, height = crest(road, road.mesh("blunt"), 14.8)
        assert np.abs(height - 0.9).max() < MEASURE
        assert (station[0], station[-1]) == (pytest.approx(100.0, abs=MEASURE), pytest.approx(120.0, abs=MEASURE))

    @pytest.mark.parametrize("name", ["step", "jersey", "blunt"])
    def test_it_is_one_closed_solid_in_the_ground(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        (piece,) = pieces(mesh)
        assert open_edges(piece) == 0
        length = OBJECTS[name]["end_station"] - OBJECTS[name]["start_station"]
        assert volume(piece) > 0.25 * length
        _, offset = road.located(mesh.vertices)
        foot = np.abs(offset - OBJECTS[name]["offset"]) > 0.26
        assert above(road, mesh.vertices[foot]).min() < -0.05


@pytest.mark.keep_scene
class TestGuardrail:
    def parts(self, road: FurnishedRoad, name: str, low: float, high: float) -> tuple[Float, list[Float]]:
        """Return the stations (N,) of the middles of pieces between two lengths (m) along the road, and the pieces."""
        found = [p for p in pieces(road.mesh(name)) if low < np.ptp(road.located(p.reshape(-1, 3))[0]) < high]
        middles = [road.located(p.reshape(-1, 3))[0] for p in found]
        return np.array([(s.min() + s.max()) / 2.0 for s in middles]), found

    @pytest.mark.parametrize("name", ["rail", "bare-rail"])
    def test_sheets_are_spliced_at_their_length(self, road: FurnishedRoad, name: str) -> None:
        item = OBJECTS[name]
        start, length, sides = item["start_station"], item.get("beam_length", 4.0), 2 if item["faces"] == "both" else 1
        expected = np.repeat(np.arange(start + length, item["end_station"] - 1e-6, length), sides)
        station, laps = self.parts(road, name, 0.3, 0.4)
        assert np.sort(station) == pytest.approx(expected, abs=MEASURE)
        deepest = [np.abs(road.located(points)[1] - item["offset"]).max() for points in (
            np.concatenate(laps).reshape(-1, 3), np.concatenate(self.parts(road, name, 10.0, 200.0)[1]).reshape(-1, 3)
        )]  # fmt: skip
        # A sheet of 3 mm lies over the beam.
        assert deepest[0] - deepest[1] == pytest.approx(0.003, abs=1e-3)
        bolts, heads = self.parts(road, name, 0.02, 0.05)
        assert len(bolts) == 6 * len(expected)
        assert np.sort(bolts) == pytest.approx(np.sort(np.repeat([expected - 0.1, expected + 0.1], 3)), abs=MEASURE)
        # The disc below is on the sheet; the head is upright on the flank.
        assert all(np.linalg.norm(np.ptp(head.reshape(-1, 3), axis=0)) < 0.06 for head in heads)

    def test_reflectors_stand_across_the_trough(self, road: FurnishedRoad) -> None:
        mesh = road.mesh("rail")
        plates = pieces(mesh, of_material(mesh, "reflector"))
        station = [road.located(plate.mean(axis=(0, 1))[None])[0][0] for plate in plates]
        assert sorted(station) == pytest.approx([94.0, 124.0, 154.0], abs=MEASURE)
        for plate in plates:
            assert open_edges(plate) == 0
            station, offset = road.located(plate.reshape(-1, 3))
            over = plate[..., 2] - road.point(station.mean(), 14.9)[2]
            assert (over.min(), over.max()) == (pytest.approx(0.55, abs=MEASURE), pytest.approx(0.64, abs=MEASURE))
            assert 14.9 - offset.min() == pytest.approx(0.05 + 0.07 + 0.08, abs=MEASURE)
        assert "reflector" not in {road.mesh("bare-rail").materials[i] for i in road.mesh("bare-rail").material}


@pytest.mark.keep_scene
class TestNoise:
    def posts(self, road: FurnishedRoad, name: str) -> list[Float]:
        """Return the corners of each post, by station: a web and two flanges."""
        mesh = road.mesh(name)
        chosen = of_material(mesh, "galvanised_steel")
        found = [p for p in pieces(mesh, chosen) if np.ptp(p[..., 2]) > OBJECTS[name].get("height", 4.0) + 0.1]
        points = sorted((p.reshape(-1, 3) for p in found), key=lambda p: road.located(p.mean(axis=0)[None])[0][0])
        assert len(points) % 3 == 0
        return [np.concatenate(points[i : i + 3]) for i in range(0, len(points), 3)]

    @pytest.mark.parametrize("name", [*PANELS, "left-wall"])
    def test_posts_stand_at_their_spacing_and_height(self, road: FurnishedRoad, name: str) -> None:
        item, posts = OBJECTS[name], self.posts(road, name)
        spacing, height = item.get("post_spacing", 4.0), item.get("height", 4.0)
        middles = np.array([(p.max(axis=0) + p.min(axis=0)) / 2 for p in posts])
        station, offset = road.located(middles)
        length = item["end_station"] - item["start_station"]
        whole = np.arange(0.0, length + 1e-6, spacing)
        wanted = item["start_station"] + (whole if length - whole[-1] < 0.1 * spacing else np.append(whole, length))
        wanted[-1] = item["end_station"]
        assert station == pytest.approx(wanted, abs=MEASURE)
        assert offset == pytest.approx(item["offset"], abs=MEASURE)
        feet = np.array([road.point(s, item["offset"])[2] for s in station])
        assert np.array([p[:, 2].max() for p in posts]) - feet == pytest.approx(height, abs=MEASURE)
        assert (np.array([p[:, 2].min() for p in posts]) - feet).max() < -0.3

    @pytest.mark.parametrize("name", list(PANELS))
    def test_panels_are_level_and_step_down_with_the_lower_post(self, road: FurnishedRoad, name: str) -> None:
        mesh, item = road.mesh(name), OBJECTS[name]
        tops = np.array([p[:, 2].max() for p in self.posts(road, name)])
        panel = corners(mesh, of_material(mesh, PANEL_MATERIALS[name])).reshape(-1, 3)
        station, offset = road.located(panel)
        bay = ((station - item["start_station"]) // 4.0).astype(int)
        for number in range(len(tops) - 1):
            level = panel[bay == number, 2].max()
            low = min(tops[number], tops[number + 1])
            # A pane ends below its frame.
            assert level == pytest.approx(low - (0.07 * 0.95 if name == "glass" else 0.0), abs=MEASURE)
        thickness = np.ptp(offset[np.abs((station - item["start_station"]) % 4.0 - 2.0) < 1.0])
        expected = 0.02 if name == "glass" else item["thickness"]
        # Panels are straight between posts on a curve.
        assert thickness == pytest.approx(expected, abs=MEASURE + 4.0**2 / 8 / 1200)

    @pytest.mark.parametrize("name", list(PANELS))
    def test_walls_are_tight_down_to_the_ground(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        blocks = [p.reshape(-1, 3) for p in pieces(mesh, of_material(mesh, "noise_concrete"))]
        # Those of slats end above the ground; a concrete panel and its plinth are one piece.
        blocks = [points for points in blocks if above(road, points).min() < 0.2]
        assert len(blocks) == 12
        for points in blocks:
            assert above(road, points[points[:, 2] < points[:, 2].min() + 1e-3]).max() < -0.1

    @pytest.mark.parametrize("name", [*PANELS, "left-wall"])
    def test_all_parts_are_closed_and_look_outwards(self, road: FurnishedRoad, name: str) -> None:
        for piece in pieces(road.mesh(name)):
            assert open_edges(piece) == 0
            assert volume(piece) > 0.0

    @pytest.mark.parametrize(("name", "side"), [("wood", 1.0), ("left-wall", -1.0)])
    def test_the_relief_looks_to_the_road(self, road: FurnishedRoad, name: str, side: float) -> None:
        mesh = road.mesh(name)
        material = PANEL_MATERIALS.get(name, "noise_aluminium")
        slats = [p for p in pieces(mesh, of_material(mesh, material)) if np.ptp(p[..., 2]) < 0.3 or volume(p) < 0.02]
        middles = np.array([p.reshape(-1, 3).mean(axis=0) for p in slats if np.ptp(p[..., 2]) > 0.1])
        _, offset = road.located(middles)
        assert len(middles) > 100
        assert ((offset - OBJECTS[name]["offset"]) * side > 0.01).all()


@pytest.mark.keep_scene
class TestTemporary:
    def elements(self, road: FurnishedRoad, name: str) -> list[Float]:
        mesh = road.mesh(name)
        found = pieces(mesh, ~of_material(mesh, "reflector"))
        return sorted((p.reshape(-1, 3) for p in found), key=lambda p: road.located(p.mean(axis=0)[None])[0][0])

    @pytest.mark.parametrize("name", ["steel", "plastic"])
    def test_elements_stand_one_after_the_other(self, road: FurnishedRoad, name: str) -> None:
        item, elements = OBJECTS[name], self.elements(road, name)
        pitch, height = item.get("segment_length", 4.0), item.get("height", 0.55)
        first, length = item["start_station"], item["end_station"] - item["start_station"]
        assert len(elements) == math.ceil(length / pitch)
        for number, points in enumerate(elements):
            over = above(road, points)
            assert over.max() == pytest.approx(height, abs=MEASURE + 0.04 * 0.25)
            assert -0.05 < over.min() < 0.0
            # Elements lean back with the grade: at the foot they are where they should be.
            station, offset = road.located(points[over < 0.2 * height])
            last = number == len(elements) - 1
            end = length if last else (number + 1) * pitch
            # Elements are straight and may stand obliquely: their foot's corners lie a little beyond.
            slack = MEASURE + item.get("base_width", 0.4) * abs(item["end_offset"] - item["offset"]) / length
            assert station.min() - first == pytest.approx(number * pitch + 0.015, abs=slack)
            assert station.max() - first == pytest.approx(end - 0.015, abs=slack)
            share = (station.mean() - first) / length
            axis = item["offset"] + (item["end_offset"] - item["offset"]) * share
            assert (offset.max() + offset.min()) / 2 == pytest.approx(axis, abs=MEASURE)

    def test_the_top_is_at_its_height_over_the_axis(self, road: FurnishedRoad) -> None:
        for name in ("steel", "plastic"):
            for points in self.elements(road, name):
                crown = points[points[:, 2] > points[:, 2].max() - 0.15]
                ends, _ = road.located(crown)
                for near in (ends < ends.mean(), ends > ends.mean()):
                    middle = crown[near]
                    middle = middle[middle[:, 2] > middle[:, 2].max() - 0.02].mean(axis=0)
                    gap = above(road, middle[None])[0]
                    assert gap == pytest.approx(OBJECTS[name].get("height", 0.55), abs=MEASURE)

    def test_plastic_elements_are_red_and_white_by_turns(self, road: FurnishedRoad) -> None:
        mesh = road.mesh("plastic")
        stations = {}
        for color in ("red", "white"):
            middles = np.array([p.mean(axis=(0, 1)) for p in pieces(mesh, of_material(mesh, f"plastic_{color}"))])
            stations[color] = road.located(middles)[0] - 100.0
        assert set((stations["red"] // 1.5).astype(int)) == {0, 2, 4, 6, 8}
        assert set((stations["white"] // 1.5).astype(int)) == {1, 3, 5, 7, 9}
        assert "plastic_red" not in road.mesh("steel").materials

    @pytest.mark.parametrize("name", ["steel", "plastic"])
    def test_elements_are_closed(self, road: FurnishedRoad, name: str) -> None:
        for piece in pieces(road.mesh(name)):
            assert open_edges(piece) == 0
            assert volume(piece) > 0.0


@pytest.mark.keep_scene
class TestAll:
    def test_faces_carry_class_instance_and_material(self, road: FurnishedRoad) -> None:
        classes = {"ConcreteBarrier": "barrier", "NoiseBarrier": "noise_barrier"}
        classes |= {"TemporaryBarrier": "construction_barrier", "Guardrail": "guardrail"}
        for name, item in OBJECTS.items():
            mesh = road.mesh(name)
            assert set(mesh.class_id) == {class_id(classes[item["type"]])}
            assert set(mesh.instance_id) == {road.instance(name)}
            assert "unknown" not in {mesh.materials[i] for i in np.unique(mesh.material)}

    def test_no_face_is_without_area(self, road: FurnishedRoad) -> None:
        for name in OBJECTS:
            a, b, c = np.moveaxis(corners(road.mesh(name)), 1, 0)
            assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() / 2 > 1e-7, name

    def test_triangles_are_few(self, road: FurnishedRoad) -> None:
        most = {"ConcreteBarrier": 20, "Guardrail": 120, "NoiseBarrier": 130, "TemporaryBarrier": 60}
        for name, item in OBJECTS.items():
            per_metre = len(road.mesh(name).triangles) / (item["end_station"] - item["start_station"])
            scale = 4.0 / item.get("segment_length", 4.0)
            print(f"{name}: {per_metre:.0f} triangles per metre")
            assert per_metre < most[item["type"]] * scale, name


def test_a_changed_input_changes_the_mesh() -> None:
    road = FurnishedRoad({name: OBJECTS[name] for name in ("step", "wood", "steel")}, PARTS)
    _, height = crest(road, road.edit("step", "Height", 1.2), 0.0)
    assert height.max() == pytest.approx(1.2, abs=MEASURE)
    before = len(road.mesh("wood").triangles)
    after = road.edit("wood", "Post Spacing", 2.0)
    assert len(after.triangles) > before
    posts = pieces(after, of_material(after, "galvanised_steel"))
    assert len(posts) == 3 * 25  # a web and two flanges each
    # 81 m in elements of 8 m; the last metre is one of its own.
    longer = road.edit("steel", "Segment Length", 8.0)
    assert len(pieces(longer, ~of_material(longer, "reflector"))) == 11


def test_stretches_of_a_road_have_the_same_barriers_together() -> None:
    names = ("step", "rail", "wood", "steel")
    whole = FurnishedRoad({name: OBJECTS[name] for name in names}, PARTS)
    wanted = {name: _solids(whole, name) for name in names}
    found: dict[str, int] = dict.fromkeys(names, 0)
    ends: list[float] = []
    for stretch in ((0.0, 150.0), (150.0, 300.0)):
        part = FurnishedRoad({name: OBJECTS[name] for name in names}, PARTS, stretch)
        for name in names:
            if name in part.model.objects:
                found[name] += _solids(part, name)
        station, _ = part.located(part.mesh("step").vertices)
        ends += [station.min(), station.max()]
    assert ends == pytest.approx([50.0, 150.0, 150.0, 201.3], abs=MEASURE)
    # An element that the border cuts is one in either stretch.
    assert found == {"step": 2, "rail": wanted["rail"], "wood": wanted["wood"], "steel": wanted["steel"] + 1}


def _solids(road: FurnishedRoad, name: str) -> int:
    mesh = road.mesh(name)
    if name == "rail":
        return sum(np.ptp(road.located(piece.reshape(-1, 3))[0]) < 0.05 for piece in pieces(mesh))
    chosen = {"wood": of_material(mesh, "galvanised_steel"), "steel": ~of_material(mesh, "reflector")}
    return len(pieces(mesh, chosen.get(name, slice(None))))


def test_elements_of_a_stretch_are_those_of_the_whole_barrier() -> None:
    oblique = line("TemporaryBarrier", 10.0, 289.5, -4.0, end_offset=-9.0, segment_length=1.5, height=0.8)
    middles = []
    for stretch in (None, (200.0, 300.0)):
        built = FurnishedRoad({"oblique": oblique}, PARTS, stretch)
        mesh = built.mesh("oblique")
        middles.append([
            np.array([p.mean(axis=(0, 1)) + built.origin for p in pieces(mesh, of_material(mesh, f"plastic_{color}"))])
            for color in ("red", "white")
        ])  # fmt: skip
    for wanted, found in zip(*middles, strict=True):
        nearest = np.linalg.norm(found[:, None] - wanted, axis=-1).min(axis=1)
        # All but the one that the border cuts.
        assert len(found) > 25
        assert np.sort(nearest)[-2] < 0.01
