"""Plants on the built mesh: shapes of the species, places, heights, labels, detail and seeds."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils.bvhtree import BVHTree

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.nodes.inputs import input_name
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.vegetation import shrub, tree
from synthroads_addon.blender.things.vegetation.grass import tuft_group
from synthroads_addon.materials.table import materials
from synthroads_addon.road.instances import GRASS_STRIPS
from synthroads_addon.road.surroundings import SPECIES, Vegetation
from synthroads_addon.road.things.plant_shape import species_shapes
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.twin.plants import placed_plants
from tests.helpers.scenes.furnished_road import Data, Float, FurnishedRoad, normals, of_material, pieces

pytestmark = pytest.mark.any_blender

TREES, SHRUBS, GRASSES = (SPECIES[kind] for kind in ("tree", "shrub", "grass"))
SHAPES = species_shapes()
GROUPS = {"tree": tree.shape_group, "shrub": shrub.shape_group, "grass": tuft_group}
MOST_TRIANGLES = {"tree": 3000, "shrub": 1100, "grass": 12}
"""Of one plant: what keeps the scenes as large as they are meant to be."""
TREE_HEIGHT, SHRUB_HEIGHT, GRASS_HEIGHT = (6.0, 9.0), (1.0, 2.0), (0.1, 0.4)
LENGTH = 120.0
LEANING = 0.08
"""Horizontal distance of a leaning plant's top from its foot, as a share of its height."""
MARGIN = 0.05
"""Difference in height of a leaning plant from an upright one, as a share of its height."""


def plants(kind: str, name: str, density: float, band: tuple[float, float], heights: tuple[float, float]) -> Data:
    item = {"type": "Vegetation", "kind": kind, "species": name, "density": density, "seed": 5}
    return item | {"band_start": band[0], "band_end": band[1], "height_min": heights[0], "height_max": heights[1]}


STANDS = {
    **{name: plants("tree", name, 0.004, (12.0, 35.0), TREE_HEIGHT) for name in TREES},
    **{name: plants("shrub", name, 0.006, (2.0 + 8 * i, 10.0 + 8 * i), SHRUB_HEIGHT) for i, name in enumerate(SHRUBS)},
    **{name: plants("grass", name, 0.2, (0.0, 30.0), GRASS_HEIGHT) for name in GRASSES},
}


def alone(kind: str, name: str, **inputs: float) -> SceneMesh:
    """Return one plant of a species as its group makes it."""
    item = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    bpy.context.scene.collection.objects.link(item)
    modifier = item.modifiers.new("Nodes", "NODES")
    modifier.node_group = GROUPS[kind]()
    made_of = {} if kind == "grass" else {"Bark Material": "bark", "Leaves Material": "leaves"}
    for key, part in made_of.items():
        set_modifier_input(modifier, key, material(f"{name}_{part}"))
    for key, value in {**SHAPES[kind][name], **inputs}.items():
        set_modifier_input(modifier, input_name(key), value)
    bpy.context.view_layer.update()
    return scene_mesh(objects=[item])


def corners_of(mesh: SceneMesh, part: str) -> Float:
    """Return the corners (N, 3) of the triangles whose material's name ends so."""
    names = [name for name in mesh.materials if name.endswith(part)]
    return mesh.vertices[mesh.triangles[of_material(mesh, *names)]].reshape(-1, 3)


def open_share(mesh: SceneMesh) -> float:
    """Return the share of level rays through the middle of the crown's outline that meet nothing."""
    leaves = corners_of(mesh, "leaves")
    low, high = np.quantile(leaves, 0.2, axis=0), np.quantile(leaves, 0.8, axis=0)
    bodies = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles.tolist())
    rng = np.random.default_rng(1)
    starts = np.column_stack([np.full(500, -5.0), rng.uniform(low[1:], high[1:], (500, 2))])
    return float(np.mean([bodies.ray_cast(tuple(start), (1.0, 0.0, 0.0))[0] is None for start in starts]))


class TestSpecies:
    def test_every_species_has_a_shape_and_materials(self) -> None:
        assert {kind: set(shapes) for kind, shapes in SHAPES.items()} == {k: set(v) for k, v in SPECIES.items()}
        for name in (*TREES, *SHRUBS):
            assert 0.45 < materials()[f"{name}_leaves"].reflectivity < 0.6
            assert 0.25 < materials()[f"{name}_bark"].reflectivity < 0.6
        assert all(0.45 < materials()[name].reflectivity < 0.6 for name in GRASSES)

    @pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, names in SPECIES.items() for name in names])
    def test_a_plant_is_1_high_and_has_few_triangles(self, kind: str, name: str) -> None:
        mesh = alone(kind, name)
        print(f"{name}: {len(mesh.triangles)} triangles")
        assert mesh.vertices[:, 2].max() == pytest.approx(1.0, abs=1e-5)
        assert len(mesh.triangles) <= MOST_TRIANGLES[kind]

    @pytest.mark.parametrize(("kind", "name"), [(k, name) for k in ("tree", "shrub") for name in SPECIES[k]])
    def test_there_are_gaps_between_the_leaves(self, kind: str, name: str) -> None:
        share = open_share(alone(kind, name))
        print(f"{name}: {share:.0%} of level rays pass through")
        assert 0.01 < share < 0.4

    def test_species_differ_in_their_crowns(self) -> None:
        crowns = {name: corners_of(alone("tree", name), "leaves") for name in TREES}
        widths = {name: np.quantile(np.hypot(c[:, 0], c[:, 1]), 0.9) for name, c in crowns.items()}
        bottoms = {name: np.quantile(c[:, 2], 0.05) for name, c in crowns.items()}
        assert widths["poplar"] < widths["birch"] < widths["maple"]
        assert bottoms["spruce"] < bottoms["birch"] < bottoms["pine"]
        # A spruce is widest at its foot.
        low, high = (crowns["spruce"][(crowns["spruce"][:, 2] - at) ** 2 < 0.01] for at in (0.2, 0.7))
        assert np.hypot(low[:, 0], low[:, 1]).mean() > 1.8 * np.hypot(high[:, 0], high[:, 1]).mean()

    def test_the_trunk_is_closed_round_and_looks_outwards(self) -> None:
        mesh = alone("tree", "maple")
        trunk = max(pieces(mesh, of_material(mesh, "maple_bark")), key=lambda piece: np.ptp(piece[..., 2]))
        foot = trunk[trunk[..., 2].max(axis=1) < 0.3]
        middle = foot.mean(axis=1)
        assert trunk[..., 2].min() < 0.0
        assert trunk[..., 2].max() > 0.85
        sides = np.cross(foot[:, 1] - foot[:, 0], foot[:, 2] - foot[:, 0])
        assert (np.einsum("ij,ij->i", sides[:, :2], middle[:, :2] - middle[:, :2].mean(axis=0)) > 0.0).all()

    @pytest.mark.parametrize(("kind", "name"), [("tree", "maple"), ("shrub", "hazel")])
    def test_detail_is_the_share_of_the_leaves(self, kind: str, name: str) -> None:
        all_of_them, some = (of_material(alone(kind, name, Detail=x), f"{name}_leaves").sum() for x in (1.0, 0.3))
        assert some == pytest.approx(0.3 * all_of_them, rel=0.01)


@pytest.fixture(scope="module")
def road() -> FurnishedRoad:
    return FurnishedRoad(STANDS, ("vegetation",), detail=1.0, length=LENGTH)


def feet(road: FurnishedRoad, name: str) -> Float:
    """Return the places (N, 3) of trunks, stems or blades on the ground."""
    mesh, item = road.mesh(name), road.parameters.objects[name]
    assert isinstance(item, Vegetation)
    chosen = slice(None) if item.kind == "grass" else of_material(mesh, f"{name}_bark")
    least = {"tree": 0.8, "shrub": 0.5, "grass": 0.0}[item.kind] * item.height_min
    parts = [p.reshape(-1, 3) for p in pieces(mesh, chosen) if np.ptp(p[..., 2]) >= least]
    return np.array([part[part[:, 2].argmin()] for part in parts])


@pytest.mark.keep_scene
class TestOnTheRoad:
    @pytest.mark.parametrize("name", STANDS)
    def test_plants_grow_in_their_band_and_never_on_the_road(self, road: FurnishedRoad, name: str) -> None:
        item = road.parameters.objects[name]
        assert isinstance(item, Vegetation)
        station, offset = road.located(feet(road, name))
        inside = (station > 0.5) & (station < road.geometry.length - 0.5)
        station, offset = station[inside], offset[inside]
        assert len(station) > 10
        distance = np.abs(offset) - road.geometry.sections["left"].road_edge(station)
        # A tuft's blades and a shrub's stems stand around its middle.
        room = {"tree": 0.3, "shrub": 0.6, "grass": 0.5}[item.kind]
        assert distance.max() < item.band_end + room
        if item.kind == "grass" and name != "reed":
            strips = road.geometry.strip_index(station, offset)
            kinds = {road.geometry.strips[index].kind for index in strips[strips >= 0]}
            assert {"verge", "median"} <= kinds
            paved = np.abs(offset) - 2.0, road.geometry.sections["left"].paved_edge(station) - np.abs(offset)
            assert np.minimum(*paved).max() < room
        else:
            assert distance.min() > item.band_start - room

    @pytest.mark.parametrize("name", [*TREES, *SHRUBS])
    def test_as_many_as_the_density_says_stand_on_the_ground(self, road: FurnishedRoad, name: str) -> None:
        item = road.parameters.objects[name]
        assert isinstance(item, Vegetation)
        places = feet(road, name)
        gap = places[:, 2] - road.surface(places[:, :2])
        assert np.nanmax(gap) < 0.05
        assert np.nanmin(gap) > -0.4
        if item.kind == "tree":
            expected = item.density * 2.0 * LENGTH * (item.band_end - item.band_start)
            assert abs(len(places) - expected) < 4.0 * np.sqrt(expected)

    @pytest.mark.parametrize("name", TREES)
    def test_trees_are_as_high_as_the_parameters_say(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        trunks = pieces(mesh, of_material(mesh, f"{name}_bark"))
        tall = np.array([np.ptp(p[..., 2]) for p in trunks])
        # A trunk is 0.93 of the tree and goes on below the ground.
        tall = tall[tall > 0.8 * TREE_HEIGHT[0]] / 0.95
        assert tall.min() > TREE_HEIGHT[0] * (1.0 - MARGIN)
        assert tall.max() < TREE_HEIGHT[1] * (1.0 + MARGIN)
        assert np.ptp(tall) > 0.4 * (TREE_HEIGHT[1] - TREE_HEIGHT[0])

    @pytest.mark.parametrize("name", GRASSES)
    def test_grass_is_as_high_as_the_parameters_say(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        tips = np.array([p.reshape(-1, 3)[p[..., 2].argmax()] for p in pieces(mesh)])
        tips = tips[np.isfinite(road.surface(tips[:, :2]))]
        above = tips[:, 2] - road.surface(tips[:, :2])
        # On a batter a leaning blade ends further above the ground than it is long.
        assert np.quantile(above, 0.99) < GRASS_HEIGHT[1] * 1.4
        assert above.max() > 0.7 * GRASS_HEIGHT[1]

    def test_they_are_labelled(self, road: FurnishedRoad) -> None:
        for name in STANDS:
            mesh = road.mesh(name)
            assert np.unique(mesh.class_id).tolist() == [class_id("vegetation")]
            known = road.geometry.numbers.parts[name]
            assert set(np.unique(mesh.instance_id).tolist()) <= set(range(known.first, known.first + known.count))
            wanted = {name} if name in GRASSES else {f"{name}_bark", f"{name}_leaves"}
            assert {mesh.materials[index] for index in np.unique(mesh.material)} == wanted
            assert np.isfinite(normals(mesh)).all()

    @pytest.mark.parametrize("name", [*TREES, *SHRUBS])
    def test_each_plant_is_where_the_road_says_and_has_a_number_of_its_own(
        self, road: FurnishedRoad, name: str
    ) -> None:
        mesh = road.mesh(name)
        known = {plant.instance: plant for plant in placed_plants(road.geometry) if plant.stand == name}
        assert np.unique(mesh.instance_id).tolist() == list(known)
        for number, plant in known.items():
            height, radius, place = plant.height, plant.breadth * plant.shape.crown_radius, plant.foot
            corners = mesh.vertices[mesh.triangles[mesh.instance_id == number]].reshape(-1, 3) + road.origin
            assert corners[:, 2].max() - place[2] == pytest.approx(height, rel=MARGIN)
            reach = np.linalg.norm(corners[:, :2] - place[:2], axis=1)
            assert 0.6 * radius < reach.max() < 1.4 * radius + LEANING * height
            if plant.vegetation.kind == "tree":
                foot = corners[corners[:, 2].argmin(), :2]
                assert np.linalg.norm(foot - place[:2]) < 0.05 * height

    def test_a_plant_that_the_road_does_not_have_does_not_grow(self, road: FurnishedRoad) -> None:
        item, before = road.model.objects["birch"], np.unique(road.mesh("birch").instance_id)
        stands = item.data.attributes["stands"].data
        row = int(before[0]) - road.geometry.numbers.parts["birch"].first
        stands[row].value = 0
        item.data.update()
        road.update()
        assert np.unique(road.mesh("birch").instance_id).tolist() == before[1:].tolist()
        # A stand that was edited decides for itself.
        edited = road.edit("birch", "Band End", 34.9)
        assert before[0] in edited.instance_id
        stands[row].value = 1
        item.data.update()
        assert np.unique(road.edit("birch", "Band End", 35.0).instance_id).tolist() == before.tolist()

    def test_grass_has_a_number_for_each_strip_that_it_grows_on(self, road: FurnishedRoad) -> None:
        for name in GRASSES:
            mesh, first = road.mesh(name), road.geometry.numbers.parts[name].first
            strips = 2 if name == "reed" else len(GRASS_STRIPS)
            assert np.unique(mesh.instance_id).tolist() == list(range(first, first + strips))
            middle = mesh.vertices[mesh.triangles].mean(axis=1)
            _, offset = road.located(middle)
            strip = mesh.instance_id - first
            for number, side in ((0, 1.0), (1, -1.0), (2, 1.0), (3, -1.0)):
                assert (side * offset[strip == number] > 8.0).all(), GRASS_STRIPS[number]
            assert (np.abs(offset[strip == 4]) < 2.6).all()

    def test_seeds_make_other_plants_and_the_same_seed_the_same(self, road: FurnishedRoad) -> None:
        before, places = road.mesh("hazel").vertices, feet(road, "hazel")[:, :2]
        road.edit("hazel", "Seed", 6)
        other = feet(road, "hazel")[:, :2]
        again = road.edit("hazel", "Seed", 5).vertices
        assert np.linalg.norm(other[:, None] - places, axis=2).min(axis=1).mean() > 0.3
        assert np.array_equal(again, before)

    def test_an_edit_changes_them(self, road: FurnishedRoad) -> None:
        before = road.mesh("poplar")
        assert len(road.edit("poplar", "Density", 0.012).triangles) > 1.5 * len(before.triangles)
        assert len(road.edit("poplar", "Density", 0.004).triangles) == len(before.triangles)
        slim = road.edit("poplar", "Crown Radius", 0.05)
        assert np.allclose(slim.triangles.shape, before.triangles.shape)
        road.edit("poplar", "Crown Radius", SHAPES["tree"]["poplar"]["crown_radius"])


def test_less_detail_is_fewer_triangles_and_none_is_none() -> None:
    few = {name: STANDS[name] for name in ("birch", "hazel", "meadow")}
    counts = []
    for detail in (1.0, 0.3):
        road = FurnishedRoad(few, ("vegetation",), detail=detail, length=LENGTH)
        counts.append(sum(len(road.mesh(name).triangles) for name in few))
    assert 0.25 < counts[1] / counts[0] < 0.45
    assert not set(few) & set(FurnishedRoad(few, ("vegetation",), detail=0.0, length=LENGTH).model.objects)


@pytest.mark.parametrize("stretch", [None, (30.0, 70.0)])
def test_a_stand_may_grow_on_one_side_and_along_a_part_of_the_road(stretch: tuple[float, float] | None) -> None:
    part = {"side": "left", "start_station": 40.0, "end_station": 80.0, "density": 0.05}
    road = FurnishedRoad({"hazel": STANDS["hazel"] | part}, ("vegetation",), stretch, 1.0, length=LENGTH)
    last = 80.0 if stretch is None else 70.0
    known = [plant.instance for plant in placed_plants(road.geometry) if plant.station < last]
    assert len(known) > 5
    assert np.unique(road.mesh("hazel").instance_id).tolist() == known
    # The nodes keep to it by themselves as well.
    for mesh in (road.mesh("hazel"), road.edit("hazel", "Band End", 17.9)):
        faces = [mesh.triangles[mesh.instance_id == number] for number in np.unique(mesh.instance_id)]
        station, offset = road.located(np.array([mesh.vertices[face].mean(axis=(0, 1)) for face in faces]))
        assert 38.0 < station.min() < station.max() < last + 2.0
        assert offset.min() > 0.0
    shorter = road.edit("hazel", "End Station", 55.0)
    assert 0 < len(np.unique(shorter.instance_id)) < len(known)
