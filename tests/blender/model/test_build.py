"""The road model against the analytic road, by numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import modifier_input, set_modifier_input
from synthroads_addon.blender.model.build import COLLECTION, RoadModel, build_road, remove_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.blender.things.road.layout import names_in_words, side_of
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.section import Carriageway, LineMarking
from synthroads_addon.road.surroundings import Landscape, Vegetation
from synthroads_addon.road.terrain import ground_elevation, surface_elevation
from synthroads_addon.road.tessellation import sample_stations
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.relative_speed import quiet_seconds

TOLERANCE = 0.005
ROUNDING = 2e-4
"""Error of float32 coordinates of some hundred metres, m."""
BUILT = {"road", "terrain", "guardrails", "delineators"}

Float = NDArray[np.float64]


@dataclass
class Built:
    """A road in the scene beside its analytic truth."""

    parameters: RoadParameters
    geometry: RoadGeometry
    model: RoadModel

    def mesh(self, *roles: str) -> SceneMesh:
        """Return the triangles of some of its objects, all if none is named."""
        return scene_mesh(objects=[self.model.objects[role] for role in roles] or None)

    def modifier(self, role: str) -> bpy.types.NodesModifier:
        """Return an object's Geometry Nodes modifier."""
        return self.model.objects[role].modifiers[0]

    def located(self, vertices: NDArray[Any]) -> tuple[Float, Float]:
        """Return station and offset of local points (N, 3)."""
        return self.geometry.alignment.project(vertices[:, :2].astype(np.float64))

    def surface(self, station: Float, offset: Float) -> Float:
        """Return the analytic elevation; points beyond the ends or the edges by rounding count as on them."""
        across = self.geometry.offsets(0.0)[0]
        low, high = across[-1], across[0]
        assert offset.max() < high + 0.01
        assert offset.min() > low - 0.01
        return self.geometry.elevation(np.clip(station, 0.0, self.geometry.length), np.clip(offset, low, high))


def demo_parameters(**changes: Any) -> RoadParameters:
    scenario = load_scenario("rq31-600m-even")
    return sample_road(scenario.road.model_copy(update=changes), scenario.seed)


def built(parameters: RoadParameters, tolerance: float = TOLERANCE, parts: set[str] | None = None) -> Built:
    return Built(
        parameters, RoadGeometry(parameters), build_road(BuildRequest(parameters, tolerance, 0.3, parts or BUILT))
    )


def with_object(parameters: RoadParameters, name: str, **changes: Any) -> RoadParameters:
    objects = parameters.objects | {name: parameters.objects[name].model_copy(update=changes)}
    return parameters.model_copy(update={"objects": objects})


@pytest.fixture(scope="class")
def demo() -> Built:
    return built(demo_parameters())


def of_class(mesh: SceneMesh, *names: str) -> NDArray[np.int32]:
    """Return the triangles (T, 3) of some classes."""
    return mesh.triangles[np.isin(mesh.class_id, [class_id(name) for name in names])]


def random_points(mesh: SceneMesh, triangles: NDArray[np.int32], count: int = 40_000) -> Float:
    """Return points (N, 3) spread over triangles by their area."""
    rng = np.random.default_rng(1)
    corners = mesh.vertices[triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    weight = rng.dirichlet((1.0, 1.0, 1.0), count)
    return np.einsum("nk,nkd->nd", weight, corners[rng.choice(len(area), count, p=area / area.sum())])


def pieces(mesh: SceneMesh) -> list[NDArray[np.intp]]:
    """Return the vertices of each connected piece of a mesh."""
    edges = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(mesh.vertices),) * 2)
    labels = connected_components(graph, directed=False)[1]
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


def timed_edit(road: Built, role: str, name: str, value: float) -> float:
    """Set an input of an object's modifier; return the update's processor seconds, as of a quiet machine."""
    bpy.context.view_layer.update()

    def edit() -> None:
        set_modifier_input(road.modifier(role), name, value)
        bpy.context.view_layer.update()

    seconds = quiet_seconds(edit)
    print(f"{role}, {name}: {seconds * 1000:.0f} ms")
    return seconds


@pytest.mark.keep_scene
class TestSurface:
    def test_vertices_lie_on_the_analytic_surface(self, demo: Built) -> None:
        mesh = demo.mesh("Road")
        vertices = mesh.vertices[np.unique(of_class(mesh, "road", "roadside"))]
        station, offset = demo.located(vertices)
        boundaries = demo.geometry.offsets(0.0)[0]
        expected = sample_stations(demo.geometry, TOLERANCE)
        assert np.abs(offset[:, None] - boundaries).min(axis=1).max() < ROUNDING
        assert np.abs(station[:, None] - expected).min(axis=1).max() < ROUNDING
        assert np.abs(vertices[:, 2] - demo.surface(station, offset)).max() < ROUNDING
        # Every boundary has every station.
        assert np.unique(np.abs(offset[:, None] - boundaries).argmin(axis=1)).size == boundaries.size

    @pytest.mark.parametrize("names", [("road", "roadside"), ("road_marking",)])
    def test_chord_error_is_within_the_tolerance(self, demo: Built, names: tuple[str, ...]) -> None:
        mesh = demo.mesh("Road")
        points = random_points(mesh, of_class(mesh, *names))
        station, offset = demo.located(points)
        error = points[:, 2] - demo.surface(station, offset)
        if names == ("road_marking",):
            error -= 0.003
        print(f"chord error of {names}: {np.abs(error).max() * 1000:.2f} mm at most")
        assert np.abs(error).max() < TOLERANCE

    def test_strips_have_their_classes_and_instances(self, demo: Built) -> None:
        mesh = demo.mesh("Road")
        chosen = mesh.class_id != class_id("road_marking")
        _, offset = demo.located(mesh.vertices[mesh.triangles[chosen]].mean(axis=1))
        strips = demo.geometry.strip_index(np.zeros(len(offset)), offset)
        wanted = np.array([class_id(strip.class_name) for strip in demo.geometry.strips])
        numbers = np.array([strip.instance for strip in demo.geometry.strips])
        names = np.array([strip.material for strip in demo.geometry.strips])
        assert np.array_equal(mesh.class_id[chosen], wanted[strips])
        assert np.array_equal(mesh.instance_id[chosen], numbers[strips])
        assert np.array_equal(np.array(mesh.materials)[mesh.material[chosen]], names[strips])

    def test_there_are_no_cracks_between_strips_and_to_the_terrain(self, demo: Built) -> None:
        mesh = demo.mesh("Road", "Terrain")
        triangles = of_class(mesh, "road", "roadside", "ground")
        # Points that are equal to the last bit are one; an edge that has one face only is a border.
        _, same = np.unique(mesh.vertices, axis=0, return_inverse=True)
        corners = same.ravel()[triangles]
        edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
        borders, counts = np.unique(edges, axis=0, return_counts=True)
        assert counts.max() == 2
        place = np.empty((same.max() + 1, 3), np.float32)
        place[same.ravel()] = mesh.vertices
        middle = place[borders[counts == 1]].mean(axis=1)
        station, offset = demo.located(middle)
        half_width = demo.parameters.terrain.half_width
        outer = np.abs(np.abs(offset) - half_width) < 0.05
        at_end = np.minimum(np.abs(station), np.abs(station - demo.geometry.length)) < 1e-3
        assert (outer | at_end).all()

    def test_faces_have_area_and_look_up(self, demo: Built) -> None:
        mesh = demo.mesh("Road", "Terrain")
        item = demo.model.objects["Road"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        assert min(face.area for face in item.polygons) > 1e-6
        assert mesh.areas().min() > 1e-7
        assert mesh.normals()[:, 2].min() > 0.3


class TestMarkings:
    def test_films_lie_just_above_the_pavement(self) -> None:
        road = built(demo_parameters(), TOLERANCE, {"road"})
        mesh = road.mesh("Road")
        pavement = of_class(mesh, "road")
        tree = BVHTree.FromPolygons(mesh.vertices.tolist(), pavement.tolist())
        height = []
        for point in random_points(mesh, of_class(mesh, "road_marking"), 5000):
            hit = tree.ray_cast((*point[:2], point[2] + 1.0), (0.0, 0.0, -1.0))
            height.append(point[2] - hit[0][2])
        print(f"films: {min(height) * 1000:.2f} to {max(height) * 1000:.2f} mm above the pavement")
        assert min(height) > 0.0
        assert max(height) < 0.006

    def test_dashes_are_where_the_parameters_say(self) -> None:
        road = built(demo_parameters(), TOLERANCE, {"road"})
        mesh = road.mesh("Road")
        for name, line in road.parameters.of_type(LineMarking).items():
            numbers = mesh.instance_id[road.geometry.numbers.belong(name, mesh.instance_id)]
            chosen = mesh.triangles[road.geometry.numbers.belong(name, mesh.instance_id)]
            station, offset = road.located(mesh.vertices[np.unique(chosen)])
            left, right = (edges[0] for edges in road.geometry.marking_edges(line, 0.0))
            assert np.isclose(offset.max(), left, atol=ROUNDING)
            assert np.isclose(offset.min(), right, atol=ROUNDING)
            dashes = road.geometry.dashes(line)
            corners = mesh.vertices[chosen].astype(np.float64)
            area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
            turn = np.diff(road.geometry.alignment.heading(dashes), axis=1)
            wanted = (np.diff(dashes, axis=1) - turn * (left + right) / 2).sum() * line.width
            assert np.isclose(area.sum(), wanted, rtol=2e-3)
            inside = (station[:, None] > dashes[:, 0] - 1e-3) & (station[:, None] < dashes[:, 1] + 1e-3)
            assert inside.any(axis=1).all()
            if line.dash_length:
                part = numbers - road.geometry.numbers.parts[name].first
                begin = road.located(mesh.vertices[chosen[:, 0]])[0]
                assert ((begin > dashes[part, 0] - 1e-3) & (begin < dashes[part, 1] + 1e-3)).all()
                assert np.unique(part).tolist() == list(range(len(dashes)))
            else:
                assert set(numbers.tolist()) == {line.instance}

    def test_a_changed_dash_is_exact_without_python(self) -> None:
        road = built(demo_parameters(), TOLERANCE, {"road"})
        name, line = next((n, m) for n, m in road.parameters.of_type(LineMarking).items() if m.dash_length)
        words = f"{side_of(road.parameters, line)} {names_in_words(road.parameters)[name]}"
        for key, value in {"Dash Length": 4.3, "Gap Length": 7.9, "Start Station": 3.1}.items():
            set_modifier_input(road.modifier("Road"), f"{words} {key}", value)
        mesh = road.mesh("Road")
        of_line = road.geometry.numbers.belong(name, mesh.instance_id)
        station, _ = road.located(mesh.vertices[np.unique(mesh.triangles[of_line])])
        changed = line.model_copy(update={"dash_length": 4.3, "gap_length": 7.9, "start_station": 3.1})
        ends = road.geometry.dashes(changed).ravel()
        assert np.abs(station[:, None] - ends).min(axis=0).max() < 2e-3


@pytest.mark.keep_scene
class TestTerrain:
    def test_it_is_the_analytic_ground(self, demo: Built) -> None:
        terrain = demo.parameters.terrain
        mesh = demo.mesh("Terrain")
        station, offset = demo.located(mesh.vertices)
        inside = (station > 0.0) & (station < demo.geometry.length)
        station, offset, z = station[inside], offset[inside], mesh.vertices[inside, 2]
        error = z - surface_elevation(demo.geometry, station, offset)
        print(f"terrain: {np.abs(error).max() * 1000:.1f} mm off the ground at most")
        assert np.abs(error).max() < 0.015
        edges = demo.geometry.offsets(station)[:, [-1, 0]]
        assert (np.abs(z - demo.surface(station, np.clip(offset, *edges.T))) > 1.0).any(), "no batter"
        far = np.abs(offset) > 40.0
        ground = ground_elevation(demo.geometry, terrain, station[far], offset[far])
        assert np.abs(z[far] - ground).max() < 0.015


@pytest.mark.keep_scene
class TestFurniture:
    def rail(self, road: Built, name: str) -> tuple[Guardrail, SceneMesh, list[NDArray[np.intp]]]:
        mesh = road.mesh(name)
        return road.parameters.objects[name], mesh, pieces(mesh)  # type: ignore[return-value]

    @pytest.mark.parametrize("name", ["guardrail-median", "guardrail-right-1"])
    def test_beams_are_as_high_as_the_parameters_say(self, demo: Built, name: str) -> None:
        rail, mesh, parts = self.rail(demo, name)
        beams = [mesh.vertices[part] for part in parts if len(part) > 100]
        assert len(beams) == (2 if rail.faces == "both" else 1)
        for beam in beams:
            station, offset = demo.located(beam)
            assert np.isclose(station.min(), rail.start_station, atol=2e-3)
            assert np.isclose(station.max(), min(rail.end_station, demo.geometry.length), atol=2e-3)
            side = np.sign(offset.mean() - rail.offset)
            assert rail.faces in ("both", "left" if side > 0 else "right")
            full = np.minimum(station - rail.start_station, rail.end_station - station) > rail.terminal_length + 0.01
            rows = np.round(station[full], 2)
            top = np.array([beam[full][rows == row, 2].max() for row in np.unique(rows)])
            surface = demo.surface(np.unique(rows), np.full(top.size, rail.offset))
            assert np.abs(top - surface - rail.height).max() < TOLERANCE
            if rail.terminal_length:
                ends = np.minimum(station - rail.start_station, rail.end_station - station) < 0.01
                surface = demo.surface(station[ends], np.full(ends.sum(), rail.offset))
                assert (beam[ends, 2] <= surface).all()

    @pytest.mark.parametrize("spacing", [4.0, 1.33])
    def test_posts_are_evenly_spaced_from_the_start(self, demo: Built, spacing: float) -> None:
        set_modifier_input(demo.modifier("guardrail-right-1"), "Post Spacing", spacing)
        rail, mesh, parts = self.rail(demo, "guardrail-right-1")
        set_modifier_input(demo.modifier("guardrail-right-1"), "Post Spacing", rail.post_spacing)
        stations = []
        for part in parts:
            station, offset = demo.located(mesh.vertices[part])
            if len(part) < 100 and np.ptp(mesh.vertices[part, 2]) > 0.4:
                stations.append((station.min() + station.max()) / 2)
                assert np.isclose((offset.min() + offset.max()) / 2, rail.offset, atol=TOLERANCE)
        number = (np.sort(stations) - rail.start_station) / spacing
        assert np.abs(number - np.round(number)).max() * spacing < 0.005
        assert np.array_equal(np.diff(np.round(number)), np.ones(len(number) - 1))
        assert len(number) > 0.9 * (rail.end_station - rail.start_station - 8.0) / spacing

    def test_delineators_stand_where_the_parameters_say(self, demo: Built) -> None:
        mesh = demo.mesh("Delineators")
        posts = demo.parameters.of_type(Delineator).values()
        assert len(posts) > 10
        for post in posts:
            vertices = mesh.vertices[np.unique(mesh.triangles[mesh.instance_id == post.instance])]
            station, offset = demo.located(vertices)
            assert np.isclose((station.min() + station.max()) / 2, post.station, atol=0.005)
            assert np.isclose((offset.min() + offset.max()) / 2, post.offset, atol=0.005)
            top = vertices[:, 2].max() - demo.surface(np.array([post.station]), np.array([post.offset]))[0]
            assert np.isclose(top, post.height, atol=TOLERANCE)
            # The upper edge falls towards the road.
            assert abs(offset[vertices[:, 2].argmax()]) > abs(post.offset)

    def test_reflectors_face_the_oncoming_driver(self, demo: Built) -> None:
        mesh = demo.mesh("Delineators")
        reflector = mesh.material == mesh.materials.index("reflector")
        for post in demo.parameters.of_type(Delineator).values():
            chosen = reflector & (mesh.instance_id == post.instance)
            upright = np.flatnonzero(chosen)[:2]
            heading = demo.geometry.alignment.heading(post.station) + np.deg2rad(post.rotation_deg)
            along = mesh.normals()[upright][:, :2] @ [np.cos(heading), np.sin(heading)]
            assert (along < -0.8).all()


class TestLabels:
    def test_every_face_is_labelled_and_every_object_has_faces(self) -> None:
        parameters = demo_parameters(length=300.0)
        model = build_road(BuildRequest(parameters, TOLERANCE, 0.2))
        mesh = scene_mesh()
        road = Built(parameters, RoadGeometry(parameters), model)
        assert not (mesh.class_id == 255).any()
        owners = {road.geometry.numbers.owner(number) for number in np.unique(mesh.instance_id).tolist()}
        bare = (AlignmentObject, Landscape)  # pictures alone show the landscape
        assert owners == {name for name, item in parameters.objects.items() if not isinstance(item, bare)}
        assert "unknown" not in {mesh.materials[index] for index in np.unique(mesh.material)}
        expected = {Vegetation: "vegetation", Guardrail: "guardrail", Delineator: "warning_post"}
        for name, item in parameters.objects.items():
            if type(item) in expected:
                found = np.unique(mesh.class_id[road.geometry.numbers.belong(name, mesh.instance_id)])
                assert found.tolist() == [class_id(expected[type(item)])]
        self.plants_grow_in_their_band(road)

    @staticmethod
    def plants_grow_in_their_band(road: Built) -> None:
        for name, plants in road.parameters.of_type(Vegetation).items():
            mesh = road.mesh(name)
            # A tree's longest piece is its trunk, a shrub's its stems; every blade of grass is a piece of its own.
            least = {"tree": 0.8, "shrub": 0.5, "grass": 0.0}[plants.kind] * plants.height_min
            parts = [mesh.vertices[part] for part in pieces(mesh)]
            feet = np.array([part[part[:, 2].argmin()] for part in parts if np.ptp(part[:, 2]) >= least])
            assert len(feet) > 10
            _, offset = road.located(feet)
            across = road.geometry.offsets(0.0)[0]
            beyond = np.maximum(offset - across[0], across[-1] - offset)
            # Blades stand up to half their length from the middle of their tuft.
            room = plants.height_max if plants.kind == "grass" else 0.4
            assert beyond.max() < plants.band_end + room
            if plants.kind == "tree":
                assert beyond.min() > plants.band_start - room
            for side in ("left", "right"):
                section = road.geometry.sections[side]
                width = section.paved_edge(0.0)[0] - section.distances(0.0)[0, 0]
                outwards = section.carriageway.sign * offset - section.distances(0.0)[0, 0]
                assert np.minimum(outwards, width - outwards).max() < room

    def test_large_instance_numbers_survive(self) -> None:
        parameters = with_object(demo_parameters(length=100.0), "median", instance=2**32 - 5)
        delineator = next(iter(parameters.of_type(Delineator)))
        parameters = with_object(parameters, delineator, instance=2**31 + 12345)
        mesh = built(parameters).mesh()
        assert {2**32 - 5, 2**31 + 12345} <= set(np.unique(mesh.instance_id).tolist())


@pytest.mark.keep_scene
class TestLiveEdits:
    @pytest.mark.parametrize(
        ("role", "name", "value"),
        [
            ("Road", "Left Inner Offset", 3.0),
            ("Road", "Left Verge Slope", 0.05),
            ("Terrain", "Batter Slope", 3.0),
            ("guardrail-median", "Post Spacing", 2.0),
            ("guardrail-right-1", "Height", 0.9),
        ],
    )
    def test_an_input_changes_the_mesh_at_once(self, demo: Built, role: str, name: str, value: float) -> None:
        before = demo.mesh(role).vertices
        old = modifier_input(demo.modifier(role), name)
        seconds = timed_edit(demo, role, name, value)
        after = demo.mesh(role).vertices
        set_modifier_input(demo.modifier(role), name, old)
        assert seconds < 1.0
        assert before.shape != after.shape or not np.array_equal(before, after)
        assert np.array_equal(before, demo.mesh(role).vertices)


class TestLiveEditsOfTheRoad:
    def test_a_lane_moves_all_that_lies_outside_of_it(self) -> None:
        parameters = demo_parameters()
        road = built(parameters)
        assert timed_edit(road, "Road", "Right Lane 1 Width", 4.0) < 1.0
        carriageway = parameters.objects["carriageway-right"]
        assert isinstance(carriageway, Carriageway)
        lanes = (carriageway.lanes[0].model_copy(update={"width": 4.0}), *carriageway.lanes[1:])
        wider = with_object(parameters, "carriageway-right", lanes=lanes)
        live = road.mesh("Road", "Terrain")
        again = built(wider, parts={"road", "terrain"}).mesh("Road", "Terrain")
        # The rebuilt mesh is held to the same truth as the one that was edited.
        truth = Built(wider, RoadGeometry(wider), road.model)
        for mesh in (live, again):
            vertices = mesh.vertices[np.unique(of_class(mesh, "road", "roadside"))]
            station, offset = truth.located(vertices)
            assert np.abs(offset[:, None] - truth.geometry.offsets(0.0)).min(axis=1).max() < ROUNDING
            assert np.abs(vertices[:, 2] - truth.surface(station, offset)).max() < ROUNDING
            for name, line in wider.of_type(LineMarking).items():
                of_line = truth.geometry.numbers.belong(name, mesh.instance_id)
                _, offset = truth.located(mesh.vertices[np.unique(mesh.triangles[of_line])])
                assert np.isclose(offset.max(), truth.geometry.marking_edges(line, 0.0)[0][0], atol=ROUNDING)

    def test_guardrails_and_terrain_follow_the_road(self) -> None:
        road = built(demo_parameters())
        set_modifier_input(road.modifier("Road"), "Right Verge Width", 2.5)
        edge = road.geometry.offsets(0.0)[0, -1] - 1.0
        _, offset = road.located(road.mesh("Terrain").vertices)
        assert np.isclose(offset[offset < 0].max(), edge, atol=ROUNDING)


class TestBuilding:
    @pytest.mark.parametrize("tolerance", [0.02, 0.001])
    def test_other_tolerances_hold_too(self, tolerance: float) -> None:
        road = built(demo_parameters(length=400.0), tolerance, {"road"})
        mesh = road.mesh("Road")
        points = random_points(mesh, of_class(mesh, "road", "roadside"))
        error = points[:, 2] - road.surface(*road.located(points))
        assert np.abs(error).max() < tolerance

    def test_offsets_that_fold_are_cut(self) -> None:
        parameters = demo_parameters(length=150.0)
        bend = [{"kind": "arc", "length": 150.0, "curvature_start": 0.02, "curvature_end": 0.02}]
        data = parameters.to_dict()
        data["objects"]["alignment"]["horizontal"] = bend
        road = built(RoadParameters.from_dict(data), TOLERANCE, {"road", "terrain"})
        mesh = road.mesh("Road", "Terrain")
        _, offset = road.located(mesh.vertices[np.unique(mesh.triangles)])
        assert offset.max() < 0.98 * 50.0 + 1e-3
        assert offset.max() > 40.0
        assert offset.min() < -70.0
        assert mesh.normals()[:, 2].min() > 0.0

    def test_a_second_build_replaces_the_first_and_leaves_the_rest(self) -> None:
        cube = bpy.data.objects.new("Mine", bpy.data.meshes.new("Mine"))
        bpy.context.scene.collection.objects.link(cube)
        first = built(demo_parameters(length=100.0))
        count = len(bpy.data.objects)
        names = sorted(first.model.objects)
        kept = bpy.data.objects.new("Kept", None)
        first.model.collection.objects.link(kept)
        second = built(demo_parameters(length=100.0))
        assert sorted(second.model.objects) == names
        assert len(bpy.data.objects) == count + 1
        remove_road()
        assert {item.name for item in bpy.data.objects} == {"Mine", "Kept"}
        assert [item.name for item in bpy.data.collections[COLLECTION].objects] == ["Kept"]
        assert not [mesh for mesh in bpy.data.meshes if mesh.name.startswith("SR ")]

    def test_only_what_is_wanted_is_built(self) -> None:
        parameters = demo_parameters(length=100.0)
        assert set(built(parameters, parts={"road"}).model.objects) == {"Backbone", "Road"}
        road = built(parameters, parts={"delineators"})
        assert set(road.model.objects) == {"Backbone", "Road", "Delineators"}
        assert np.unique(scene_mesh().class_id).tolist() == [class_id("warning_post")]
        with pytest.raises(ValueError, match="bridges"):
            build_road(BuildRequest(parameters, TOLERANCE, parts=["bridges"]))

    def test_the_origin_is_the_map_origin(self) -> None:
        parameters = demo_parameters(length=100.0)
        road = built(parameters, parts={"road"})
        assert road.model.origin.tolist() == list(parameters.transform.translate)
        assert scene_mesh().origin.tolist() == list(parameters.transform.translate)

    def test_the_same_parameters_give_the_same_bytes(self) -> None:
        parameters = demo_parameters(length=100.0)
        meshes = []
        for _ in range(2):
            build_road(BuildRequest(parameters, TOLERANCE, 0.3))
            meshes.append(scene_mesh())
        assert np.array_equal(meshes[0].vertices, meshes[1].vertices)
        assert np.array_equal(meshes[0].triangles, meshes[1].triangles)
        assert np.array_equal(meshes[0].instance_id, meshes[1].instance_id)

    def test_a_mirrored_road_gives_the_mirrored_mesh(self) -> None:
        parameters = demo_parameters(length=300.0)
        meshes = []
        for data in (parameters, RoadParameters.from_dict(mirrored(parameters.to_dict()))):
            mesh = built(data, parts={"road", "guardrails"}).mesh()
            beams_and_road = mesh.class_id != class_id("guardrail")
            meshes.append((mesh.vertices[np.unique(mesh.triangles[beams_and_road])], mesh))
        flipped = meshes[1][0] * np.array([1.0, -1.0, 1.0])
        assert len(flipped) == len(meshes[0][0])
        for a, b in ((flipped, meshes[0][0]), (meshes[0][0], flipped)):
            assert cKDTree(a).query(b)[0].max() < ROUNDING
        # Guardrails stand on the mesh's triangles, whose diagonals a mirror turns: both lie within the tolerance.
        heights = [np.sort(mesh.vertices[:, 2]) for _, mesh in meshes]
        assert np.abs(heights[0] - heights[1]).max() < 2 * TOLERANCE

    @pytest.mark.parametrize("length", [1.0, 5.0])
    def test_a_very_short_road_is_built(self, length: float) -> None:
        mesh = built(demo_parameters(length=length)).mesh("Road", "Terrain")
        assert mesh.areas().sum() == pytest.approx(156.0 * length, rel=0.05)

    def test_one_carriageway_without_verge_is_built(self) -> None:
        data = demo_parameters(length=100.0).to_dict()
        left = {"carriageway-left"} | {
            k for k, v in data["objects"].items() if v.get("carriageway") == "carriageway-left"
        }
        data["objects"] = {
            k: v for k, v in data["objects"].items() if k not in left and "left" not in k and k != "median"
        }
        data["objects"]["carriageway-right"]["verge_width"] = 0.0
        data["objects"]["carriageway-right"]["rotation_axis"] = "inner_edge"
        road = built(RoadParameters.from_dict(data), parts={"road", "terrain"})
        mesh = road.mesh("Road", "Terrain")
        assert set(np.unique(mesh.class_id)) == {class_id(name) for name in ("road", "road_marking", "ground")}
        vertices = mesh.vertices[np.unique(of_class(mesh, "road"))]
        station, offset = road.located(vertices)
        assert np.abs(vertices[:, 2] - road.surface(station, offset)).max() < ROUNDING
        _, offset = road.located(mesh.vertices[np.unique(of_class(mesh, "ground"))])
        assert np.isclose(offset[offset > -10].min(), road.geometry.offsets(0.0)[0, 0], atol=ROUNDING)


def mirrored(data: dict[str, Any]) -> dict[str, Any]:
    """Return a parameter set mirrored at the x axis."""
    swap = {"left": "right", "right": "left", "both": "both"}
    for item in data["objects"].values():
        for key in ("side", "faces"):
            if key in item:
                item[key] = swap[item[key]]
        for key in ("start_y", "start_heading_deg", "offset", "rotation_deg"):
            if key in item:
                item[key] = -item[key]
        for element in item.get("horizontal", []):
            element["curvature_start"] = -element["curvature_start"]
            element["curvature_end"] = -element["curvature_end"]
        for point in item.get("crossfall", []):
            point["crossfall_percent"] = -point["crossfall_percent"]
    return data
