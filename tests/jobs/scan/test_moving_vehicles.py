"""Vehicles of the model in motion: they begin where the nodes put them, and a moving scanner's points lie on them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.roads import ROAD
from synthroads_addon.blender.model.settle import settle
from synthroads_addon.blender.model.store import remember
from synthroads_addon.blender.model.truth import read_road
from synthroads_addon.blender.scene.evaluated import scanned_scene, scene_mesh
from synthroads_addon.blender.services import BlenderServices
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.jobs.scan.parts import Survey
from synthroads_addon.jobs.scan.plan import plan_scan
from synthroads_addon.road import stretches as stretch
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import Vehicle
from synthroads_addon.road.things.vehicles import CHASSIS, VEHICLE_TYPES
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scanning.record import scan_blocks
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import LaneMotion, MovingMesh, ScannedScene
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import load_scenario
from tests.blender.things.test_vehicle import MODELS, VEHICLES, alone, vehicle
from tests.helpers.scenes.furnished_road import Data, Float, road_data
from tests.helpers.scenes.scan_scenes import altered

pytestmark = pytest.mark.any_blender

FINE = 1e-4
"""Tolerance (m) of a road whose mesh is hardly farther from the analytic surface than 32 bits make it."""
HEIGHTS = 5e-5
"""Error of the nodes' heights below a wheel, m: they cast rays from 500 m above in 32 bits."""


def build(objects: Data, tolerance: float = FINE, **road: Any) -> RoadGeometry:
    parameters = RoadParameters.from_dict(road_data(objects, **road))
    build_road(BuildRequest(parameters, tolerance, 0.0, {"road", "vehicles"}))
    return RoadGeometry(parameters)


def of(scene: ScannedScene, geometry: RoadGeometry, name: str) -> MovingMesh:
    """Return the moving mesh of the vehicle with an id."""
    number = geometry.parameters.objects[name].instance
    (found,) = [part for part in scene.moving if set(part.mesh.instance_id.tolist()) == {number}]
    return found


def at(part: MovingMesh, time: float) -> Float:
    """Return a moving mesh's local vertices (V, 3) at a time."""
    rotation, place, present = part.motion.pose(np.array([time]))
    assert present[0]
    return part.mesh.vertices.astype(np.float64) @ rotation[0].T + place[0]


def fitted(source: Float, target: Float) -> tuple[Float, Float]:
    """Return the turn (3,), rad, and shift (3,), m, that take points (N, 3) best to others (Kabsch)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = (u @ vt).T
    shift = target.mean(axis=0) - turn @ source.mean(axis=0)
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2.0, shift


def facing_x(model: str) -> Float:
    """Return the vertices of a model as its group makes it, turned into the frame in which vehicles move."""
    right, ahead, up = alone(model).vertices.astype(np.float64).T
    return np.stack([ahead, -right, up], axis=1)


def without_writing(part: MovingMesh, model: Float) -> Float:
    """Return a moving mesh's vertices that are its model's; those of the writing on its plates come after them."""
    assert len(part.mesh.vertices) > len(model)
    return part.mesh.vertices[: len(model)].astype(np.float64)


class _Built:
    """A curved (600 m), rising (5 %), superelevated road with all vehicles, in a scene that a whole class shares."""

    def __init__(self) -> None:
        self.models = {model: facing_x(model) for model in MODELS}
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.geometry = build(VEHICLES, curvature=1 / 600, grade=0.05)
        self.scene = scanned_scene(geometry=self.geometry)


@pytest.fixture(scope="module")
def built() -> _Built:
    return _Built()


@pytest.mark.keep_scene
class TestAtTheTime0:
    @pytest.mark.parametrize("name", VEHICLES)
    def test_it_is_where_the_nodes_put_it(self, built: _Built, name: str) -> None:
        model = VEHICLES[name]["model"]
        part = of(built.scene, built.geometry, name)
        vertices = without_writing(part, built.models[model])
        turn, shift = fitted(built.models[model], vertices)
        off = np.abs(vertices - built.models[model]).max()
        print(f"{name}: {off * 1000:.3f} mm, shift {np.abs(shift).max() * 1000:.3f} mm, turn {np.abs(turn).max():.1e}")
        assert np.abs(shift).max() < 1e-4
        front, rear, track = CHASSIS[model]
        assert np.abs(turn[:2]) == pytest.approx(0.0, abs=1e-5 + 2.0 * HEIGHTS / min(2.0 * track, front - rear))
        assert abs(turn[2]) < 1e-5
        assert off < 1.5e-4

    def test_together_they_are_the_whole_scene(self, built: _Built) -> None:
        whole = scene_mesh()
        scene = built.scene
        assert len(scene.moving) == len(VEHICLES)
        assert len(whole) == len(scene.static) + sum(len(part.mesh) for part in scene.moving)
        assert class_id("vehicle") not in scene.static.class_id
        for name in VEHICLES:
            part = of(scene, built.geometry, name)
            mine = whole.instance_id == built.geometry.parameters.objects[name].instance
            shown = whole.vertices[whole.triangles[mine]]
            assert np.abs(at(part, 0.0)[part.mesh.triangles] - shown).max() < 3e-5  # 32 bits at 300 m

    def test_labels_and_materials_are_kept(self, built: _Built) -> None:
        whole = scene_mesh()
        assert built.scene.static.materials == whole.materials
        for part in built.scene.moving:
            assert part.mesh.materials == whole.materials
            assert set(part.mesh.class_id.tolist()) == {class_id("vehicle")}
            mine = whole.instance_id == part.mesh.instance_id[0]
            assert np.array_equal(part.mesh.material, whole.material[mine])
            assert np.abs(part.mesh.vertices).max() < 10.0
            assert part.mesh.origin.tolist() == [0.0, 0.0, 0.0]

    def test_it_drives_on_along_its_lane(self, built: _Built) -> None:
        for name in VEHICLES:
            part, item = of(built.scene, built.geometry, name), built.geometry.parameters.objects[name]
            assert isinstance(item, Vehicle)
            (_, places, present) = part.motion.pose(np.array([0.0, 0.5]))
            if present.all():
                assert np.hypot(*(places[1] - places[0])[:2]) == pytest.approx(0.5 * item.speed, rel=1e-3)

    def test_nothing_in_the_scene_changes(self, built: _Built) -> None:
        def state() -> list[Any]:
            return [len(bpy.data.meshes), len(bpy.data.objects), [tuple(o.matrix_world[0]) for o in bpy.data.objects]]

        before, shown = state(), scene_mesh()
        scanned_scene(geometry=built.geometry, speed_factor=0.5)
        assert state() == before
        assert np.array_equal(scene_mesh().vertices, shown.vertices)


class TestWhatMoves:
    def test_without_geometry_or_speed_all_stand(self) -> None:
        parked = vehicle("van", "left", 0, 60.0, (0.5, 0.5, 0.5)) | {"speed": 0.0}
        objects = {"a": vehicle("car", "right", 0, 60.0, (0.5, 0.5, 0.5)), "b": parked}
        geometry = build(objects, 0.01)
        whole = scene_mesh()
        assert len(scanned_scene().moving) == 0
        assert len(scanned_scene(geometry=geometry, speed_factor=0.0).moving) == 0
        scene = scanned_scene(geometry=geometry)
        assert len(scene.moving) == 1
        assert geometry.parameters.objects["b"].instance in scene.static.instance_id
        assert np.array_equal(scanned_scene().static.vertices, whole.vertices)

    def test_on_a_stretch_with_an_origin_of_its_own(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(stretch, "FRAME", 50.0)
        parameters = RoadParameters.from_dict(road_data(VEHICLES))
        build_road(BuildRequest(parameters, 0.005, 0.0, {"road", "vehicles"}, stretch=(100.0, 200.0)))
        geometry = RoadGeometry(parameters)
        scene = scanned_scene(geometry=geometry)
        assert 0 < len(scene.moving) < len(VEHICLES)
        for part in scene.moving:
            assert np.abs(part.mesh.vertices).max() < 10.0
            assert part.mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=0.02)

    def test_a_lane_that_widens(self) -> None:
        """The nodes turn a vehicle along its lane's line as its motion does."""
        widths = [{"station": 80.0, "width": 3.0}, {"station": 180.0, "width": 6.0}]
        bpy.ops.wm.read_factory_settings(use_empty=True)
        model = facing_x("bus")
        bpy.ops.wm.read_factory_settings(use_empty=True)
        changed = road_data({})["objects"]["right"] | {"lanes": [{"width": 3.75}, {"width": widths}]}
        geometry = build({"right": changed, "it": vehicle("bus", "right", 0, 130.0, (0.5, 0.5, 0.5))})
        (part,) = scanned_scene(geometry=geometry).moving
        turn, shift = fitted(model, without_writing(part, model))
        assert np.abs(turn).max() < 1e-4
        assert np.abs(shift).max() < 1e-4
        rotation, _, _ = part.motion.pose(np.zeros(1))
        heading = np.arctan2(rotation[0, 1, 0], rotation[0, 0, 0]) - geometry.alignment.heading(130.0)
        # Measured along the outer side of the curve, 10 m from the centreline.
        assert heading == pytest.approx(-0.03, abs=5e-4)

    def test_a_vehicle_that_the_user_moved_drives_on_from_there(self) -> None:
        objects = {name: vehicle("car", side, 0, 100.0, (0.5,) * 3) for name, side in (("a", "right"), ("b", "left"))}
        geometry = build(objects, 0.01)
        for name in objects:
            start = geometry.point(100.0, 0.0)[0]
            end = geometry.point(160.0, 2.0)[0]
            turn = float(geometry.alignment.heading(160.0) - geometry.alignment.heading(100.0))
            about = Matrix.Translation(Vector(end)) @ Matrix.Rotation(turn, 4, "Z") @ Matrix.Translation(-Vector(start))
            bpy.context.view_layer.update()
            bpy.data.objects[name].matrix_world = about @ bpy.data.objects[name].matrix_world
        bpy.context.view_layer.update()
        scene, whole = scanned_scene(geometry=geometry), scene_mesh()
        for name in objects:
            part = of(scene, geometry, name)
            shown = whole.vertices[whole.triangles[whole.instance_id == part.mesh.instance_id[0]]]
            assert np.abs(at(part, 0.0)[part.mesh.triangles] - shown).max() < 1e-4
            for time in (0.5, 1.0, 2.0):
                middle = at(part, time).mean(axis=0)
                station, offset = geometry.alignment.project(middle[None, :2])
                assert isinstance(part.motion, LaneMotion)
                expected = part.motion.station(np.array([time]))
                assert abs(expected[0] - 160.0) == pytest.approx(25.0 * time, rel=0.02)
                assert station[0] == pytest.approx(expected[0], abs=0.2)
                beside = offset[0] - part.motion.line.offset(expected)[0]
                assert beside == pytest.approx(2.0, abs=0.05)

    def test_a_copy_of_a_vehicle_moves_as_well(self) -> None:
        """It is one more vehicle of the road as edited: on the lane that it was put on."""
        parameters = RoadParameters.from_dict(road_data({"a": vehicle("car", "right", 0, 100.0, (0.5, 0.5, 0.5))}))
        root = build_road(BuildRequest(parameters, 0.01, 0.0, {"road", "vehicles"})).root
        remember(root, parameters, load_scenario("rq31-600m-even"), "")
        copy = bpy.data.objects["a"].copy()
        bpy.context.scene.collection.objects.link(copy)
        here, ahead = RoadGeometry(parameters).alignment.position(np.array([100.0, 130.0]))
        copy.location.xy = np.array(copy.location.xy) + ahead - here
        bpy.context.view_layer.update()
        edited = read_road(root)
        settle(root[ROAD], edited)
        geometry = RoadGeometry(edited.known())
        first, second = scanned_scene(geometry=geometry).moving
        assert {part.mesh.instance_id[0] for part in (first, second)} == {
            item.instance for item in geometry.parameters.of_type(Vehicle).values()
        }
        apart = at(second, 1.0).mean(axis=0) - at(first, 1.0).mean(axis=0)
        assert np.hypot(*apart[:2]) == pytest.approx(30.0, abs=0.1)

    def test_the_geometry_of_another_road_is_refused(self) -> None:
        geometry = build({"a": vehicle("car", "right", 0, 100.0, (0.5, 0.5, 0.5))}, 0.01)
        elsewhere = RoadParameters.from_dict(road_data({"a": vehicle("car", "right", 0, 290.0, (0.5, 0.5, 0.5))}))
        with pytest.raises(InputError, match="geometry"):
            scanned_scene(geometry=RoadGeometry(elsewhere))
        assert len(scanned_scene(geometry=geometry).moving) == 1


def box(name: str, collection: bpy.types.Collection | None = None) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for x in (-2.0, 2.0) for y in (-1.0, 1.0) for z in (0.0, 1.5)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(item)
    return item


class TestForeignThings:
    def test_what_has_a_velocity_moves_with_what_is_parented_to_it(self) -> None:
        car, wheel, house = box("Car"), box("Wheel"), box("House")
        wheel.parent, wheel.location = car, (0.0, 0.0, -0.5)
        car.location, car["synthroads_velocity"] = (100.0, 20.0, 1.0), (10.0, -5.0, 0.0)
        car.data.materials.append(material("car_paint"))
        house.data.materials.append(material("concrete"))
        bpy.context.view_layer.update()
        scene, whole = scanned_scene(speed_factor=0.5), scene_mesh()
        assert len(scene.static) == 12
        (part,) = scene.moving
        assert len(part.mesh) == 24
        assert part.mesh.materials == scene.static.materials == whole.materials
        names = {part.mesh.materials[i] for i in part.mesh.material}
        assert names == {"car_paint", "unknown"}
        assert np.abs(part.mesh.vertices).max() < 5.0
        assert at(part, 0.0).min(axis=0) == pytest.approx([98.0, 19.0, 0.5])
        assert at(part, 4.0).min(axis=0) == pytest.approx([98.0 + 20.0, 19.0 - 10.0, 0.5])

    def test_what_shows_a_collection_carries_it(self) -> None:
        source = bpy.data.collections.new("Source")
        box("Body", source)
        for number, speed in enumerate((3.0, 7.0)):
            empty = bpy.data.objects.new("Empty", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", source
            empty.location.y = 10.0 * number
            empty["synthroads_velocity"] = (speed, 0.0, 0.0)
            bpy.context.scene.collection.objects.link(empty)
        scene = scanned_scene()
        assert len(scene.static) == 0
        assert sorted(at(part, 2.0)[:, 0].max() for part in scene.moving) == pytest.approx([8.0, 16.0])

    @pytest.mark.parametrize("value", ["fast", (1.0, 2.0), 3.0, (1.0, 2.0, float("nan"))])
    def test_wrong_velocities_are_refused_by_name(self, value: Any) -> None:
        box("Rocket")["synthroads_velocity"] = value
        with pytest.raises(InputError, match="Rocket: synthroads_velocity"):
            scanned_scene()

    def test_wrong_factors_are_refused(self) -> None:
        with pytest.raises(InputError, match="speed_factor"):
            scanned_scene(speed_factor=-1.0)

    def test_without_velocity_it_stands(self) -> None:
        box("Car")["synthroads_velocity"] = (0.0, 0.0, 0.0)
        assert scanned_scene().moving == ()


class _Drone:
    """A scanner that flies along the road at 12 m/s, 40 m above its beginning, rolling and pitching."""

    strips = (Strip(0, 0.0, 6.0),)
    knot_spacing = 1e-3
    typical_range = 40.0

    def __init__(self, geometry: RoadGeometry) -> None:
        self.alignment = geometry.alignment

    def pose(self, _strip: Strip, time: Float) -> tuple[Float, Float]:
        position, heading, _ = self.alignment.frame(100.0 + 12.0 * time)
        rotation = [
            np.array((Matrix.Rotation(h, 3, "Z") @ Matrix.Rotation(0.05 * np.sin(2.0 * t), 3, "X")).copy())
            for h, t in zip(heading, time, strict=True)
        ]
        return np.column_stack([position, np.full(len(time), 45.0)]), np.array(rotation)


def on_mesh(mesh: SceneMesh, points: Float) -> Float:
    """Return the distances (N,) of points from a mesh's surface, m.

    The tree only tells the nearest triangle: its own distances are half a millimetre off on long, narrow ones.
    """
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles.tolist())
    nearest = np.array([tree.find_nearest(Vector(point))[2] for point in points])
    corners = mesh.vertices[mesh.triangles[nearest]].astype(np.float64)
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    way = points[:, None, :] - corners
    inside = (np.einsum("nci,nci->nc", np.cross(normal[:, None], sides), way) >= 0.0).all(axis=1)
    share = np.einsum("nci,nci->nc", way, sides) / np.einsum("nci,nci->nc", sides, sides)
    to_sides = np.linalg.norm(way - np.clip(share, 0.0, 1.0)[..., None] * sides, axis=2).min(axis=1)
    return np.where(inside, np.abs(np.einsum("ni,ni->n", way[:, 0], normal)), to_sides)


def scanned(scene: ScannedScene, geometry: RoadGeometry, *changes: str) -> PointBlock:
    options = ["scan.noise.range_sigma=0", "scan.rays_per_pulse=1", 'cloud.attributes=["noise_free"]', "scan.threads=1"]
    scenario = load_scenario("rq31-600m-even", [*options, *changes])
    scan = plan_scan(Survey(scenario, ScenarioInputs.read(scenario), BlenderServices()), scene, _Drone(geometry))
    # What a pulse meets behind a window is a return of its own, and no return lies between two surfaces.
    scan = altered(scan, setting=replace(scan.setting, range_resolution=0.0))
    return concatenate([result.points for result in scan_blocks(scan)])


@pytest.fixture(scope="module")
def traffic() -> tuple[RoadGeometry, ScannedScene, PointBlock]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    objects = {
        "overtaking": vehicle("car", "right", 1, 80.0, (0.5, 0.5, 0.5)) | {"speed": 22.0},
        "beside": vehicle("semitrailer", "right", 0, 108.0, (0.5, 0.5, 0.5)) | {"speed": 10.0},
        "against": vehicle("bus", "left", 0, 190.0, (0.5, 0.5, 0.5)) | {"speed": 25.0},
        "ahead": vehicle("car", "right", 1, 130.0, (0.5, 0.5, 0.5)) | {"speed": 36.0},
        "parked": vehicle("van", "left", 1, 140.0, (0.5, 0.5, 0.5)) | {"speed": 0.0},
    }
    geometry = build(objects, 0.01, curvature=1 / 600, grade=0.05)
    scene = scanned_scene(geometry=geometry)
    return geometry, scene, scanned(scene, geometry)


@pytest.mark.keep_scene
class TestScanned:
    @pytest.mark.parametrize("name", ["overtaking", "beside", "against"])
    def test_points_unwarped_by_their_times_lie_on_the_vehicle(
        self, traffic: tuple[RoadGeometry, ScannedScene, PointBlock], name: str
    ) -> None:
        geometry, scene, points = traffic
        part = of(scene, geometry, name)
        mine = points.select(points.instance_id == part.mesh.instance_id[0])
        assert len(mine) > 200
        assert mine.true_xyz is not None
        assert mine.xyz == pytest.approx(mine.true_xyz, abs=1e-9)
        local = mine.xyz - scene.static.origin
        rotation, place, present = part.motion.pose(mine.gps_time)
        assert present.all()
        own = np.einsum("nji,nj->ni", rotation, local - place)
        distance = on_mesh(part.mesh, own)
        length = VEHICLE_TYPES[geometry.parameters.objects[name].model].length  # type: ignore[attr-defined]
        first, start, _ = part.motion.pose(mine.gps_time.min(keepdims=True))
        warped = (local - start[0]) @ first[0]
        print(
            f"{name}: {len(mine)} points, {distance.max() * 1000:.3f} mm from the vehicle;"
            f" {np.ptp(warped[:, 0]):.1f} m of its {length:.1f} m"
        )
        assert distance.max() < 1e-3
        # As scanned it isn't as long as it is: it moved meanwhile.
        assert on_mesh(part.mesh, warped).max() > 0.1

    def test_what_stands_is_not_warped(self, traffic: tuple[RoadGeometry, ScannedScene, PointBlock]) -> None:
        geometry, scene, points = traffic
        mine = points.select(points.instance_id == geometry.parameters.objects["parked"].instance)
        assert len(mine) > 200
        assert on_mesh(scene.static, mine.xyz - scene.static.origin).max() < 1e-3

    def test_who_has_left_hides_nothing(self, traffic: tuple[RoadGeometry, ScannedScene, PointBlock]) -> None:
        """Where a car stood at the time 0 the road is whole: it had driven on before the scanner came."""
        geometry, scene, points = traffic
        part = of(scene, geometry, "ahead")
        assert not (points.instance_id == part.mesh.instance_id[0]).any()
        assert isinstance(part.motion, LaneMotion)
        road = points.select(points.class_id == class_id("road"))
        station, offset = geometry.alignment.project((road.xyz - scene.static.origin)[:, :2])
        below = (np.abs(station - 130.0) < 2.0) & (np.abs(offset - part.motion.line.offset(station)) < 0.8)
        assert below.sum() > 100

    def test_a_factor_of_0_scans_what_the_scene_shows(
        self, traffic: tuple[RoadGeometry, ScannedScene, PointBlock]
    ) -> None:
        geometry, _, _ = traffic
        scene = scanned_scene(geometry=geometry, speed_factor=0.0)
        points = scanned(scene, geometry)
        mine = points.select(points.class_id == class_id("vehicle"))
        assert len(mine) > 1000
        assert on_mesh(scene.static, mine.xyz - scene.static.origin).max() < 1e-3
