"""Vehicles on the built mesh: sizes, that they are closed and stand on the road in their lanes, labels and colours."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.materials.looks import COLOR
from synthroads_addon.blender.nodes.builder import usual_materials
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.vehicle.models import model_group
from synthroads_addon.materials.table import materials
from synthroads_addon.road.section import Carriageway
from synthroads_addon.road.surroundings import Vehicle
from synthroads_addon.road.tessellation import sample_stations
from synthroads_addon.road.things.vehicles import CHASSIS, COLORS, VEHICLE_TYPES
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.helpers.scenes.furnished_road import (
    MEASURE,
    Data,
    Float,
    FurnishedRoad,
    of_material,
    open_edges,
    pieces,
    road_data,
    volume,
)

pytestmark = pytest.mark.any_blender

MODELS = tuple(VEHICLE_TYPES)
ON_ROAD = 0.01
"""Distance that the wheels may be above or below the road, m."""
MOST_TRIANGLES = 3000


def vehicle(model: str, side: str, lane: int, station: float, color: tuple[float, float, float]) -> Data:
    item = {"type": "Vehicle", "model": model, "carriageway": side, "lane": lane, "station": station, "speed": 25.0}
    return item | {"color": list(color)}


VEHICLES = {
    f"{side}-{model}": vehicle(model, side, number % 2, 20.0 + 40.0 * number, list(COLORS)[number])
    for side in ("left", "right")
    for number, model in enumerate(MODELS)
}


def alone(model: str) -> SceneMesh:
    """Return a vehicle as its group makes it."""
    item = bpy.data.objects.new(model, bpy.data.meshes.new(model))
    bpy.context.scene.collection.objects.link(item)
    modifier = item.modifiers.new("Nodes", "NODES")
    modifier.node_group = model_group(model)
    for key, entry in usual_materials(modifier.node_group).items():
        set_modifier_input(modifier, key, material(entry))
    bpy.context.view_layer.update()
    return scene_mesh(objects=[item])


class TestModels:
    @pytest.mark.parametrize("model", MODELS)
    def test_its_size_is_that_of_its_type(self, model: str) -> None:
        kind, mesh = VEHICLE_TYPES[model], alone(model)
        # Mirrors stand beside the body.
        bodies = np.concatenate([p for p in pieces(mesh) if abs(np.mean(p[..., 0])) < 0.95 * kind.width / 2])
        size = bodies.max(axis=(0, 1)) - bodies.min(axis=(0, 1))
        assert size == pytest.approx([kind.width, kind.length, kind.height], abs=MEASURE)
        assert bodies.max(axis=(0, 1))[:2] == pytest.approx([kind.width / 2, kind.length / 2], abs=MEASURE)
        assert mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
        assert np.ptp(mesh.vertices[:, 0]) < kind.width + 0.45

    @pytest.mark.parametrize("model", MODELS)
    def test_its_parts_are_closed_and_look_outwards(self, model: str) -> None:
        mesh = alone(model)
        print(f"{model}: {len(mesh.triangles)} triangles")
        assert len(mesh.triangles) < MOST_TRIANGLES
        assert mesh.areas().min() > 5e-6
        for piece in pieces(mesh):
            assert open_edges(piece) == 0
            assert volume(piece) > 0.0

    @pytest.mark.parametrize("model", MODELS)
    def test_it_has_windows_wheels_lights_and_a_plate(self, model: str) -> None:
        mesh = alone(model)
        for name in ("car_paint", "glass", "rubber", "lamp_glass", "lamp_red", "number_plate"):
            assert of_material(mesh, name).any(), name
        front, rear = (mesh.vertices[mesh.triangles[of_material(mesh, m)]] for m in ("lamp_glass", "lamp_red"))
        assert front[..., 1].min() > 0.0 > rear[..., 1].max()
        # The axles that it stands on are where its wheels are.
        tyres = [p.mean(axis=(0, 1)) for p in pieces(mesh, of_material(mesh, "rubber"))]
        places = np.array([tyre[1] for tyre in tyres])
        axles = places[places > 0.0].mean(), places[places < 0.0].mean()
        assert axles == pytest.approx(CHASSIS[model][:2], abs=MEASURE)

    def test_rims_look_away_from_the_vehicle(self) -> None:
        mesh = alone("car")
        rims = pieces(mesh, of_material(mesh, "chrome"))
        tyres = pieces(mesh, of_material(mesh, "rubber"))
        assert len(rims) == len(tyres) == 4
        out = {abs(round(float(p[..., 0].mean()), 3)) for p in rims}
        assert min(out) > max(abs(float(p[..., 0].mean())) for p in tyres)


@pytest.fixture(scope="module")
def road() -> FurnishedRoad:
    return FurnishedRoad(VEHICLES, ("vehicles",))


def above(road: FurnishedRoad, mesh: SceneMesh) -> Float:
    """Return how far the lowest point of each tyre is above the road."""
    lowest = []
    for tyre in pieces(mesh, of_material(mesh, "rubber")):
        corners = tyre.reshape(-1, 3)
        lowest.append((corners[:, 2] - road.surface(corners[:, :2])).min())
    return np.array(lowest)


@pytest.mark.keep_scene
class TestOnTheRoad:
    @pytest.mark.parametrize("name", VEHICLES)
    def test_its_wheels_stand_on_the_road(self, road: FurnishedRoad, name: str) -> None:
        gaps = above(road, road.mesh(name))
        print(f"{name}: tyres {gaps.min() * 1000:.1f} to {gaps.max() * 1000:.1f} mm above the road")
        assert np.abs(gaps).max() < ON_ROAD

    @pytest.mark.parametrize("name", VEHICLES)
    def test_it_drives_in_the_middle_of_its_lane_with_the_traffic(self, road: FurnishedRoad, name: str) -> None:
        item, mesh = road.parameters.objects[name], road.mesh(name)
        assert isinstance(item, Vehicle)
        carriageway = road.parameters.objects[item.carriageway]
        assert isinstance(carriageway, Carriageway)
        boundaries = road.geometry.sections[carriageway.side].lane_boundaries(item.station)[0]
        middle = carriageway.sign * boundaries[item.lane : item.lane + 2].mean()
        place = np.array([p.mean(axis=(0, 1)) for p in pieces(mesh, of_material(mesh, "rubber"))])
        station, offset = road.located(place)
        # A long vehicle's axles lie on a chord of the curve, and wheels' middles lean with the crossfall of 4 %.
        chord, lean = VEHICLE_TYPES[item.model].length ** 2 / 8.0 / 1200.0, 0.5 * 0.04
        assert abs((offset.min() + offset.max()) / 2 - middle) < chord + lean + MEASURE
        ahead = (station - item.station) * carriageway.traffic
        axles = ahead[ahead > 0.0].mean(), ahead[ahead < 0.0].mean()
        assert axles == pytest.approx(CHASSIS[item.model][:2], abs=0.15)
        lamps = [mesh.vertices[mesh.triangles[of_material(mesh, m)]] for m in ("lamp_glass", "lamp_red")]
        front, rear = (road.located(corners.reshape(-1, 3))[0].mean() for corners in lamps)
        assert np.sign(front - rear) == carriageway.traffic

    def test_it_is_labelled_and_coloured(self, road: FurnishedRoad) -> None:
        for name, data in VEHICLES.items():
            mesh = road.mesh(name)
            assert np.unique(mesh.class_id).tolist() == [class_id("vehicle")]
            assert np.unique(mesh.instance_id).tolist() == [road.instance(name)]
            item = road.model.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get())
            colors = np.empty(3 * len(item.data.vertices), np.float32)
            item.data.attributes[COLOR].data.foreach_get("vector", colors)
            assert colors.reshape(-1, 3) == pytest.approx(np.tile(data["color"], (len(item.data.vertices), 1)))

    def test_it_keeps_to_the_road_when_the_road_changes(self, road: FurnishedRoad) -> None:
        name = "right-car"
        before = road.mesh(name).vertices[:, 2].mean()
        changed = FurnishedRoad({name: VEHICLES[name]}, ("vehicles",))
        changed.edit("Road", "Right Inner Offset", 3.0)
        mesh = changed.mesh(name)
        assert abs(mesh.vertices[:, 2].mean() - before) > 0.02
        assert np.abs(above(changed, mesh)).max() < ON_ROAD


def test_it_is_pitched_and_rolled_where_crossfall_and_grade_change() -> None:
    """On the smallest crest there is, where the crossfall runs off as fast as it may."""
    points = [{"station": 0.0, "elevation": 0.0}, {"station": 150.0, "elevation": 6.0, "radius": 3000.0}]
    vertical = [*points, {"station": 300.0, "elevation": 0.0}]
    runoff = [{"station": 100.0, "crossfall_percent": -2.5}, {"station": 167.0, "crossfall_percent": 2.5}]
    plain = road_data({})["objects"]
    changed = {"axis": plain["axis"] | {"vertical": vertical}}
    changed |= {side: plain[side] | {"crossfall": runoff} for side in ("left", "right")}
    vehicles = {key: data | {"station": 110.0 + 0.25 * data["station"]} for key, data in VEHICLES.items()}
    road = FurnishedRoad(changed | vehicles, ("vehicles",))
    for name in VEHICLES:
        gaps = above(road, road.mesh(name))
        print(f"{name}: tyres {gaps.min() * 1000:.1f} to {gaps.max() * 1000:.1f} mm above the road")
        assert np.abs(gaps).max() < ON_ROAD


def test_beyond_the_end_of_a_stretch_it_goes_on_at_its_grade() -> None:
    """Half of a vehicle may stand beyond the road that is built."""
    # A stretch ends where the road's surface has a row.
    end = float(sample_stations(FurnishedRoad({}, ()).geometry, 0.005, 0.0, 100.0)[-1])
    near = {"right-bus": vehicle("bus", "right", 0, end - 1.0, (0.5, 0.5, 0.5))}
    whole = FurnishedRoad(near, ("vehicles",))
    corners = whole.mesh("right-bus").vertices + whole.origin
    cut = FurnishedRoad(near, ("vehicles",), stretch=(0.0, 100.0))
    assert np.abs(cut.mesh("right-bus").vertices + cut.origin - corners).max() < 0.02


def test_without_vehicles_there_are_none() -> None:
    road = FurnishedRoad({}, ("vehicles",))
    assert not set(MODELS) & set(road.model.objects)


def test_materials_reflect_as_measured_at_905_nm() -> None:
    wanted = {"car_paint": (0.03, 0.8), "glass": (0.05, 0.1), "rubber": (0.03, 0.05), "chrome": (0.4, 0.8)}
    for name, (low, high) in wanted.items():
        assert low <= materials()[name].reflectivity <= high, name
