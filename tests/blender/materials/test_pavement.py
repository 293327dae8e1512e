"""The pavement's field: its two evaluators, and the mesh that tells the materials where they are."""

from __future__ import annotations

from copy import deepcopy

import bpy
import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.blender.casters.embree import EmbreeCaster
from synthroads_addon.blender.materials import RoadMaterials, material
from synthroads_addon.blender.materials.pavement import AGE, ATTRIBUTE, SHAPE, WEAR_INPUTS, look_group
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.damage import DAMAGES
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.age import strip_contrasts
from synthroads_addon.road.pavement.field import (
    CODES,
    PAINT_BESIDE,
    PAINT_CROSSED,
    PAINT_IN_LANE,
    ArrayCalculus,
    PavementPlace,
    Shape,
    Wear,
    asphalt_height,
    asphalt_look,
    concrete_height,
    concrete_look,
    paint_look,
    place_code,
)
from synthroads_addon.road.pavement.outlines import CRACK_FILM, crack_outlines, patch_outline
from synthroads_addon.road.pavement.places import pavement_places
from synthroads_addon.road.section import Patch
from synthroads_addon.road.surroundings import Environment, MaterialVariation
from synthroads_addon.scanning.relief.pavement import PavementRelief
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scanning.scene.surface_values import SurfaceInput
from synthroads_addon.scanning.scene.target import Target
from tests.helpers.effects.road_cases import base_road
from tests.helpers.scenes.cycles import calculator

PLACES = 100_000


@pytest.mark.parametrize("kind", ["asphalt", "concrete", "paint"])
def test_nodes_and_arrays_give_the_same_field(kind: str) -> None:
    rng, wear, slab = np.random.default_rng(7), Wear(0.5, 4711.0, 0.3, 0.2, 0.4), 4.5
    code = place_code(rng.integers(0, 28, PLACES), rng.integers(0, 2, PLACES), 1.75)
    across = rng.uniform(-2.5, 2.5, PLACES)
    values = np.zeros((PLACES, 4), np.float32)
    values[:, :3] = np.column_stack([rng.uniform(-20.0, 3000.0, PLACES), across, code])
    shape = Shape(0.5, 0.25)
    shapes = np.tile(np.array([slab, shape.joints, shape.tracks, 0.0], np.float32), (PLACES, 1))
    ages = np.zeros((PLACES, 4), np.float32)
    ages[:, 0] = rng.uniform(-0.6, 0.5, PLACES)
    feed = {
        SurfaceInput("attribute", name): given for name, given in ((ATTRIBUTE, values), (SHAPE, shapes), (AGE, ages))
    }
    outputs = {"roughness": "Brightness", "specular": "Roughness"} | ({"metallic": "Height"} if kind != "paint" else {})
    with calculator({0: _probe(kind, wear, outputs)}, tuple(outputs)) as work:
        found = work.calculate(np.zeros(PLACES, np.intp), {what: feed[what] for what in work.inputs_of(0)})
    calculus, place = ArrayCalculus(), PavementPlace(*values[:, :3].T.astype(np.float64), ages[:, 0].astype(np.float64))
    if kind == "paint":
        look, height = paint_look(calculus, place, wear), None
    elif kind == "asphalt":
        look, height = asphalt_look(calculus, place, wear), asphalt_height(calculus, place, shape)
    else:
        look, height = concrete_look(calculus, place, wear, slab), concrete_height(calculus, place, shape, slab)
    assert np.ptp(look.brightness) > 0.3
    assert np.ptp(look.roughness) > 0.08
    assert found["roughness"][:, 0] == pytest.approx(look.brightness, abs=1e-5)
    assert found["specular"][:, 0] == pytest.approx(look.roughness, abs=1e-5)
    if height is None:
        return
    assert np.ptp(height) > 0.4
    assert found["metallic"][:, 0] == pytest.approx(height, abs=1e-5)


def _probe(kind: str, wear: Wear, outputs: dict[str, str]) -> bpy.types.Material:
    """Return a material whose layers are a field's results."""
    probe = bpy.data.materials.new("Probe")
    if probe.node_tree is None:
        probe.use_nodes = True
    nodes, links = probe.node_tree.nodes, probe.node_tree.links
    nodes.clear()
    group = nodes.new("ShaderNodeGroup")
    group.node_tree = look_group(kind)
    for name, value in zip(WEAR_INPUTS, wear, strict=True):
        if name in group.inputs:
            group.inputs[name].default_value = value
    for name, entry in ((ATTRIBUTE, "Place"), (SHAPE, "Shape"), (AGE, "Age")):
        if entry not in group.inputs:
            continue
        attribute = nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = name
        links.new(attribute.outputs["Vector"], group.inputs[entry])
    for layer, output in outputs.items():
        end = nodes.new("ShaderNodeOutputAOV")
        end.aov_name = layer
        links.new(group.outputs[output], end.inputs["Value"])
    return probe


def test_the_mesh_says_where_on_the_pavement_its_points_are() -> None:
    """Widths change along this road, so that a lane's middle moves."""
    parameters = RoadParameters.from_dict(base_road({}))
    geometry = RoadGeometry(parameters)
    road = build_road(BuildRequest(parameters, 0.005, 1.0, {"road"})).objects["Road"]
    mesh = road.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    offset, place, shape, age = (np.empty((len(mesh.vertices), parts), np.float32) for parts in (1, 3, 3, 1))
    for name, values in (("offset", offset), (AGE, age)):
        mesh.attributes[name].data.foreach_get("value", values.ravel())
    for name, values in ((ATTRIBUTE, place), (SHAPE, shape)):
        mesh.attributes[name].data.foreach_get("vector", values.ravel())
    offset = offset[:, 0]
    station, across, code = place.T.astype(np.float64)
    paved = np.flatnonzero((code > 0.0) & (code % CODES < PAINT_CROSSED))
    assert len(paved) > 100
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rows = paved[sign * offset[paved] > 0.0]
        section = geometry.sections[side]
        # Points on a boundary belong to the strips on both of its sides: a hair to either one is one of them.
        contrasts = strip_contrasts(section, parameters.materials.asphalt_age)
        found = [
            pavement_places(section, station[rows], offset[rows].astype(np.float64) + nudge, contrasts)
            for nudge in (-1e-4, 1e-4)
        ]
        off = [
            np.abs(one.across - across[rows]) + np.abs(one.code - code[rows]) + np.abs(one.age - age[rows, 0])
            for one in found
        ]
        assert np.minimum(*off).max() < 1e-3, side
        assert (np.ptp(age[rows]) > 0.02) == (side == "right")
        pavement = section.carriageway.pavement
        values = (pavement.slab_length, pavement.joint_depth, pavement.wheel_track_depth)
        assert shape[rows] == pytest.approx(np.tile(values, (len(rows), 1)))


def test_lines_that_lane_changes_cross_are_more_worn_than_those_beside_the_lanes() -> None:
    """Their film's mean brightness by the field at the places that the mesh tells; arrows are between both."""
    objects = {"arrow": {"type": "Arrow", "carriageway": "right", "kind": "straight", "station": 20, "offset": -8.375}}
    edge = {"type": "LineMarking", "carriageway": "right", "kind": "outer_edge", "width": 0.15, "dash_length": 0.0}
    objects["edge"] = edge | {"gap_length": 0.0, "start_station": 0.0, "end_station": 60.0}
    parameters = RoadParameters.from_dict(base_road(objects))
    model = build_road(BuildRequest(parameters, 0.005, 1.0, {"road", "painted_areas"}))
    brightness = {}
    for name in ("Road", "Painted Areas"):
        mesh = model.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        place = np.empty((len(mesh.vertices), 3), np.float32)
        mesh.attributes[ATTRIBUTE].data.foreach_get("vector", place.ravel())
        kind = np.floor(place[:, 2]) % 32
        look = paint_look(ArrayCalculus(), PavementPlace(*place.T.astype(np.float64)), Wear(0.0, 7.0))
        brightness |= {number: look.brightness[kind == number] for number in (16, 17, 19) if (kind == number).any()}
        station = place[(kind == 16) | (kind == 17), 0]
        assert not len(station) or (station.min() < 9.0 and station.max() > 49.0)
    assert brightness[PAINT_CROSSED].mean() < brightness[PAINT_BESIDE].mean() - 0.1
    assert brightness[PAINT_CROSSED].mean() < brightness[PAINT_IN_LANE].mean() < brightness[PAINT_BESIDE].mean()


def _line_brightness(kind: int, **changes: float) -> np.ndarray:
    """Return the factors on a marking's brightness, every 0.5 m of a line of 60 km."""
    station = np.arange(0.25, 60_000.0, 0.5)
    place = PavementPlace(station, np.zeros(len(station)), np.full(len(station), place_code(kind, 1)))
    return np.asarray(paint_look(ArrayCalculus(), place, Wear(0.0, 7.0)._replace(**changes)).brightness)


def test_lines_painted_anew_are_so_on_the_given_share_of_stretches_and_are_brighter() -> None:
    usual, renewed = (_line_brightness(PAINT_CROSSED, renewed=share) for share in (0.0, 0.3))
    is_new = np.abs(renewed - usual) > 1e-9
    assert np.mean(is_new) == pytest.approx(0.3, abs=0.06)
    assert renewed[is_new].min() > usual.max(), "a new film is brighter than any old one"
    assert np.ptp(renewed[is_new]) < 1e-9, "neither worn nor dirty"
    assert np.allclose((np.flatnonzero(np.diff(is_new)) + 1) * 0.5 % 120.0, 0.0), "in stretches, not in spots"


def test_dirt_takes_its_share_of_the_brightness_in_stretches() -> None:
    usual, dirty = (_line_brightness(PAINT_BESIDE, dirt=share) for share in (0.0, 0.2))
    taken = 1.0 - dirty / usual
    assert taken.mean() == pytest.approx(0.2, abs=0.01)
    assert taken.min() < 0.08
    assert taken.max() > 0.32
    assert np.abs(np.diff(taken)).max() < 0.02, "smooth along the line"
    spotless = _line_brightness(PAINT_BESIDE, dirt=0.2, renewed=1.0)
    assert spotless == pytest.approx(np.full(len(spotless), spotless[0])), "new lines are clean"


def test_rubber_blackens_lines_that_tyres_cross_more_than_those_beside_the_lanes() -> None:
    black = {}
    for kind in (PAINT_CROSSED, PAINT_BESIDE):
        usual, marked = (_line_brightness(kind, rubber=share) for share in (0.0, 0.2))
        is_black = marked < usual - 1e-9
        assert np.allclose(marked[is_black] / usual[is_black], marked[is_black][0] / usual[is_black][0])
        black[kind] = np.mean(is_black)
    assert black[PAINT_CROSSED] == pytest.approx(0.2, abs=0.03)
    assert black[PAINT_BESIDE] == pytest.approx(0.04, abs=0.01)


def test_a_road_s_paint_is_as_new_dirty_and_black_as_its_parameters_say() -> None:
    variation = MaterialVariation(paint_renewed=0.4, paint_dirt=0.1, paint_rubber=0.05)
    item = RoadMaterials(variation, Environment(), 3.0).material("paint_white")
    group = next(node for node in item.node_tree.nodes if node.type == "GROUP")
    found = [group.inputs[name].default_value for name in ("Seed", "Renewed", "Dirt", "Rubber")]
    assert found == pytest.approx([3.0, 0.4, 0.1, 0.05])


def test_a_road_has_its_own_polish_and_seed() -> None:
    usual = material("asphalt")
    item = RoadMaterials(MaterialVariation(wheel_track_polish=0.6), Environment(), 3.0).material("asphalt")
    group = next(node for node in item.node_tree.nodes if node.type == "GROUP")
    assert item not in (usual, RoadMaterials(MaterialVariation(), Environment(), 3.0).material("asphalt"))
    assert group.inputs["Polish"].default_value == pytest.approx(0.6)
    assert group.inputs["Seed"].default_value == 3.0


def test_patches_and_cracks_lie_where_the_parameters_say() -> None:
    """Faces cover the polygons, within 2 cm, less than a millimetre above the pavement; their points know the kind."""
    parameters = RoadParameters.from_dict(base_road({}))
    geometry = RoadGeometry(parameters)
    model = build_road(BuildRequest(parameters, 0.005, 1.0, {"road", "damaged_areas"}))
    mesh = scene_mesh(objects=list(model.objects.values()))
    corners = mesh.vertices[mesh.triangles].astype(np.float64) + (
        model.origin - np.array(parameters.transform.translate)
    )
    pavement = parameters.carriageway("right").pavement
    damages, rng = geometry.numbers.damages(), np.random.default_rng(3)
    for kind, item in (("patch", pavement.patches[0]), ("longitudinal crack", pavement.cracks[0])):
        outlines = [patch_outline(item)] if isinstance(item, Patch) else list(crack_outlines(item))
        mine = [number for number, damage in damages.items() if DAMAGES[damage] == kind]
        faces = np.isin(mesh.instance_id, mine)
        station, offset = geometry.alignment.project(corners[faces, :, :2].reshape(-1, 2))
        triangles = list(np.stack([station, offset], axis=-1).reshape(-1, 3, 2))
        assert len(mine) == 1
        for these, others in ((outlines, triangles), (triangles, outlines)):
            places = np.concatenate([_inside(shape, rng) for shape in these])
            assert np.min([_outside(places, other) for other in others], axis=0).max() < 0.02, kind
    target = Target(ScannedScene(mesh), EmbreeCaster, damages)
    assert set(np.unique(target.damage)) >= {DAMAGES.index(kind) for kind in ("none", "patch", "longitudinal crack")}


def test_cracks_go_through_lines_and_are_as_deep_there_as_beside_them() -> None:
    """Seen from above a crack is topmost all across a dash; its points lie as far below the pavement as beside it."""
    data = deepcopy(base_road({}))
    crack = {"kind": "transverse", "width": 0.04, "depth": 0.01, "lines": [[[11.0, -8.0], [11.0, -5.0]]]}
    data["objects"]["right"]["pavement"] = {"cracks": [crack], "unevenness": 0.0, "wheel_track_depth": 0.0}
    parameters = RoadParameters.from_dict(data)
    geometry = RoadGeometry(parameters)
    mesh = scene_mesh(
        objects=list(build_road(BuildRequest(parameters, 0.005, 1.0, {"road", "damaged_areas"})).objects.values())
    )
    station, offset = np.repeat([11.0, 11.5], 7), np.tile(np.linspace(-6.8, -6.2, 7), 2)
    place = geometry.point(station, offset) + parameters.transform.translate
    above = place - mesh.origin + [0.0, 0.0, 5.0]
    faces = EmbreeCaster(mesh).cast(
        above.astype(np.float32), np.tile(np.array([0.0, 0.0, -1.0], np.float32), (14, 1)), 20.0
    )
    (number,) = geometry.numbers.damages()
    assert (mesh.instance_id[faces[:7]] == number).all()
    on_film = np.abs(offset + 6.5) < 0.075
    assert set(mesh.instance_id[faces[7:]][on_film[7:]]) == {geometry.numbers.parts["line"].first}
    height = mesh.vertices[mesh.triangles[faces]].mean(axis=1)[:, 2] - (place - mesh.origin)[:, 2]
    film = parameters.objects["line"].film_thickness
    assert np.ptp(height[:7]) > film / 2.0
    raised = PavementRelief(geometry).heights(np.full(7, number), place[:7])
    assert raised == pytest.approx(-0.01 - CRACK_FILM - film * on_film[:7], abs=1e-6)


def _inside(shape: Float, rng: np.random.Generator) -> Float:
    """Return places within a convex shape (K, 2)."""
    return np.asarray(rng.dirichlet(np.ones(len(shape)), 50) @ shape)


def _outside(places: Float, shape: Float) -> Float:
    """Return how far places (N, 2) lie outside of the farthest edge of a convex shape (K, 2), against the clock, m."""
    edges = np.roll(shape, -1, axis=0) - shape
    outwards = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    return np.asarray(np.einsum("nkj,kj->nk", places[:, None] - shape, outwards).max(axis=1))
