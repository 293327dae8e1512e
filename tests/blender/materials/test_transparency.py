"""Beams through materials of others: every way to be clear, by the rays' shares; and Cycles as the judge of nodes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from synthroads_addon.blender.materials.transparency import read_transparency
from synthroads_addon.blender.scene.evaluated import scanned_scene
from synthroads_addon.blender.scene.foreign import open_scene
from synthroads_addon.blender.services import BlenderServices
from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.scanning.colour.surfaces import SceneSurfaces
from synthroads_addon.scanning.colour.transparency import SeeThrough
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scanning.scene.surface_values import ALONG, SurfaceInput
from synthroads_addon.scanning.scene.target import Target
from synthroads_addon.scanning.trace import Openings, Rays, TracedRays, trace
from tests.helpers.scenes.cycles import calculator
from tests.helpers.scenes.transparent_files import FILES
from tests.helpers.scenes.transparent_materials import CASES, Case, Nodes, add_card, add_ground, half, rising

Float = NDArray[np.float64]
SIDE = 40
"""Rays along a side of the card."""


def traced_down(scene: ScannedScene, place: Float, caster: str = "embree", begin: float = 9.0) -> TracedRays:
    """Return what vertical rays at places (N, 2) meet."""
    services, names = BlenderServices(), scene.static.materials
    clear = services.transparencies(names)
    surfaces = surfaces_of(services.materials(names), clear=clear)
    target = Target(scene, lambda mesh: services.caster(caster, mesh, "auto"))
    origin = np.array([place[:, 0], place[:, 1], np.full(len(place), begin)])[:, None, :]
    direction = np.zeros_like(origin)
    direction[2] = -1.0
    time = np.zeros(len(place))
    openings = Openings(None, SeeThrough(SceneSurfaces(scene.static, scene.moving), clear)) if clear else None
    motions = target.motions(0.0, 1.0, 0.1)
    rays = Rays(origin, direction, np.ones((1, 1)), time)
    return trace(target, surfaces, rays, motions, 0.0, 100.0, None, openings)


def shares_at(traced: TracedRays, height: float, begin: float = 9.0) -> Float:
    """Return the share of its light that each ray leaves at a height."""
    count = traced.first.face.size
    result = np.zeros(count)
    on = np.arange(count)
    for hits, rays in ((traced.first, on), (traced.behind, traced.ray)):
        here = np.isclose(hits.distance.ravel(), begin - height, atol=1e-3)
        np.add.at(result, rays[here], np.broadcast_to(hits.share, hits.distance.shape).ravel()[here])
    return result


def places(size: float = 4.0) -> tuple[Float, Float, Float]:
    """Return texture coordinates u, v (N,) on a card, and the places (N, 2) of these."""
    across = (np.arange(SIDE) + 0.53) / SIDE
    u, v = (axis.ravel() for axis in np.meshgrid(across, across))
    return u, v, np.stack([u, v], axis=1) * size - size / 2.0


def passed(case: Case) -> tuple[ScannedScene, TracedRays]:
    nodes = Nodes()
    case.build(nodes)
    add_ground()
    add_card(nodes.item)
    bpy.context.view_layer.update()
    scene = scanned_scene()
    return scene, traced_down(scene, places()[2])


def check_shares(traced: TracedRays, through: Callable[[Float, Float], Float | float], edge: float) -> None:
    """Check what the ground gets below a card by texture coordinates, but nearer to an edge than that."""
    u, v, _ = places()
    wanted = np.broadcast_to(np.asarray(through(u, v), np.float64), u.shape)
    around = np.array([
        np.broadcast_to(np.asarray(through(u + du, v + dv), np.float64), u.shape)
        for du in (-edge, edge) for dv in (-edge, edge)
    ])  # fmt: skip
    clear_of_edges = (np.abs(around - wanted) < 0.1).all(axis=0)
    assert clear_of_edges.mean() > 0.7
    card, ground = shares_at(traced, 3.0), shares_at(traced, 0.0)
    assert np.abs(ground - wanted)[clear_of_edges].max() < 0.02
    assert np.abs(card + ground - 1.0).max() < 1e-6


@pytest.mark.any_blender
@pytest.mark.parametrize("name", CASES)
def test_the_beam_passes_where_a_material_is_clear(name: str) -> None:
    """Card and ground share the light as stated; a node that can't be worked out is named."""
    case = CASES[name]
    scene, traced = passed(case)
    check_shares(traced, case.through, case.edge)
    if case.warning:
        assert any(case.warning in text for text in scene.warnings), scene.warnings
    else:
        assert scene.warnings == ()


@pytest.mark.any_blender
@pytest.mark.parametrize("name", FILES)
def test_files_of_others_let_through_what_they_declare(name: str, tmp_path: Path) -> None:
    case = FILES[name]
    case.write(tmp_path / case.name)
    open_scene(tmp_path / case.name)
    traced = traced_down(scanned_scene(), places()[2])
    check_shares(traced, case.through, 0.03)


@pytest.mark.parametrize("name", ["alpha of an image", "alpha of 0.3", "one side"])
def test_casters_agree(name: str) -> None:
    scene, traced = passed(CASES[name])
    other = traced_down(scene, places()[2], "bvhtree")
    for height in (0.0, 3.0):
        assert np.array_equal(shares_at(traced, height), shares_at(other, height))


def test_one_side_is_clear_from_the_other() -> None:
    """A surface that is drawn on one side alone is passed by rays that come from the other."""
    nodes = Nodes()
    CASES["one side"].build(nodes)
    add_ground()
    add_card(nodes.item).rotation_euler = (np.pi, 0.0, 0.0)
    bpy.context.view_layer.update()
    traced = traced_down(scanned_scene(), places()[2], begin=9.0)
    assert shares_at(traced, -3.0).max() == 0.0
    assert np.allclose(shares_at(traced, 0.0), 1.0)  # the ground above it
    bpy.data.objects["Ground"].location.z = -9.0
    bpy.context.view_layer.update()
    traced = traced_down(scanned_scene(), places()[2])
    assert np.allclose(shares_at(traced, -9.0), 1.0)


def test_what_hardly_stands_out_is_passed_without_what_lies_under_it() -> None:
    """A picture that is glued on a millimetre above the ground, a sheet of cards, and the same card twice."""
    nodes = Nodes()
    CASES["alpha of an image"].build(nodes)
    add_ground()
    for height in (0.0005, *np.linspace(1.0, 3.0, 60).tolist(), 3.0):
        add_card(nodes.item, height=height)
    bpy.context.view_layer.update()
    u, _, place = places()
    traced = traced_down(scanned_scene(), place)
    ground, top = shares_at(traced, 0.0), shares_at(traced, 3.0)
    assert ground[u > 0.51].min() == 1.0
    assert top[u < 0.49].min() == 1.0


def test_far_from_the_origin_no_card_is_met_twice() -> None:
    """Where float32 rounds to half a centimetre rays get behind the face that they have passed all the same."""
    nodes = Nodes()
    CASES["alpha of 0.3"].build(nodes)
    card, ground = add_card(nodes.item), add_ground()
    card.location = ground.location = (80_000.0, -60_000.0, 0.0)
    card.rotation_euler.y = 0.5  # so that where a ray meets it rounds in all directions
    card.scale.x = 40.0
    bpy.context.view_layer.update()
    place = places()[2] * 0.9 + [80_000.0, -60_000.0]
    traced = traced_down(scanned_scene(), place)
    assert np.allclose(shares_at(traced, 0.0), 0.7)
    met = np.bincount(traced.ray, minlength=len(place))
    assert met.max() > 0
    assert np.allclose(np.ravel(traced.first.share), 0.3)


def test_a_moving_card_takes_its_texture_along() -> None:
    nodes = Nodes()
    CASES["alpha of an image"].build(nodes)
    add_ground()
    card = add_card(nodes.item)
    card["synthroads_velocity"] = (2.0, 0.0, 0.0)
    card.rotation_euler.z = np.pi / 2.0
    bpy.context.view_layer.update()
    scene = scanned_scene()
    assert len(scene.moving) == 1
    _, v, place = places()
    traced = traced_down(scene, place)
    ground = shares_at(traced, 0.0)
    assert np.array_equal(ground[np.abs(v - 0.5) > 0.01], (v > 0.5)[np.abs(v - 0.5) > 0.01] * 1.0)


def test_instances_and_mirrored_objects_have_their_own_texture() -> None:
    nodes = Nodes()
    CASES["alpha of an image"].build(nodes)
    add_ground()
    card = add_card(nodes.item)
    twin = bpy.data.objects.new("Twin", card.data)
    twin.location.x, twin.scale.x = 10.0, -1.0
    bpy.context.scene.collection.objects.link(twin)
    bpy.context.view_layer.update()
    u, _, place = places()
    scene = scanned_scene()
    sure = np.abs(u - 0.5) > 0.01
    for x, clear in ((0.0, u > 0.5), (10.0, u < 0.5)):
        ground = shares_at(traced_down(scene, place + [x, 0.0]), 0.0)
        assert np.array_equal(ground[sure], clear[sure] * 1.0)


def test_solid_scenes_know_nothing_of_it() -> None:
    """Neither a road's own materials nor solid ones of others cost a ray anything: no openings are there to ask."""
    for name in ("solid", "noise between solids", "metal is no glass"):
        nodes = Nodes(name)
        CASES[name].build(nodes)
        assert read_transparency(nodes.item).transparency is None
        assert BlenderServices().transparencies([nodes.item.name]) == {}


# Cycles as the judge


def _math(operation: str, *numbers: float) -> Any:
    def build(nodes: Nodes) -> Any:
        alpha = nodes.image(rising(), interpolation="Linear", extension="EXTEND").outputs["Alpha"]
        value = nodes.node("ShaderNodeMath", alpha, 3.0, -1.0, operation="MULTIPLY_ADD").outputs[0]
        return nodes.node("ShaderNodeMath", value, *numbers, operation=operation).outputs[0]

    return build


def _node(kind: str, output: str | int = 0, place: int = 0, inputs: Any = None, **values: Any) -> Any:
    def build(nodes: Nodes) -> Any:
        value = nodes.image(rising(), interpolation="Linear", extension="EXTEND").outputs["Alpha"]
        made = nodes.node(kind, **values)
        for name, number in (inputs or {}).items():
            made.inputs[name].default_value = number
        nodes.feed(made.inputs[place], value)
        return made.outputs[output]

    return build


def _of_place(kind: str, output: str | int = 0, inputs: Any = None, **values: Any) -> Any:
    def build(nodes: Nodes) -> Any:
        made = nodes.node(kind, nodes.node("ShaderNodeTexCoord").outputs["UV"], **values)
        for name, number in (inputs or {}).items():
            made.inputs[name].default_value = number
        return made.outputs[output]

    return build


def _image(**values: Any) -> Any:
    def build(nodes: Nodes) -> Any:
        scaled = nodes.node("ShaderNodeMapping", nodes.node("ShaderNodeTexCoord").outputs["UV"])
        scaled.inputs["Scale"].default_value, scaled.inputs["Location"].default_value = (2.3, 1.7, 1), (-0.6, -0.3, 0)
        coarse = half()[:8, ::8] * np.linspace(0.2, 1.0, 8)[:, None]
        made = nodes.image(coarse, **values)
        nodes.feed(made.inputs["Vector"], scaled.outputs[0])
        return made.outputs["Alpha"]

    return build


def _mapping(kind: str) -> Any:
    def build(nodes: Nodes) -> Any:
        made = nodes.node("ShaderNodeMapping", nodes.node("ShaderNodeTexCoord").outputs["UV"], vector_type=kind)
        made.inputs["Rotation"].default_value, made.inputs["Scale"].default_value = (0.3, 0.2, 0.7), (1.5, 0.8, 2.0)
        if kind != "VECTOR":
            made.inputs["Location"].default_value = (0.1, 0.2, 0.3)
        return nodes.node("ShaderNodeSeparateXYZ", made.outputs[0]).outputs[0]

    return build


def _blend(blend: str) -> Any:
    def build(nodes: Nodes) -> Any:
        value = nodes.image(rising(), interpolation="Linear", extension="EXTEND").outputs["Alpha"]
        mix = nodes.node("ShaderNodeMix", data_type="RGBA", blend_type=blend)
        factor, first, second = (entry for entry in mix.inputs if entry.enabled)
        factor.default_value, second.default_value = 0.7, (0.3, 0.6, 0.9, 1.0)
        nodes.feed(first, value)
        return next(entry for entry in mix.outputs if entry.enabled)

    return build


JUDGED: dict[str, Any] = {
    **{f"math {name}": _math(name, 0.3) for name in ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "POWER", "MINIMUM")},
    **{f"math {name}": _math(name, 0.3) for name in ("MAXIMUM", "LESS_THAN", "GREATER_THAN", "MODULO", "SNAP")},
    **{f"math {name}": _math(name, 0.3) for name in ("PINGPONG", "LOGARITHM", "ARCTAN2", "FLOORED_MODULO")},
    **{f"math {name}": _math(name) for name in ("SQRT", "ABSOLUTE", "ROUND", "FLOOR", "CEIL", "FRACT", "SINE", "SIGN")},
    **{f"math {name}": _math(name, 0.4, 0.2) for name in ("MULTIPLY_ADD", "COMPARE", "WRAP")},
    **{f"image {name}": _image(interpolation=name) for name in ("Closest", "Linear", "Cubic")},
    **{f"image {name}": _image(interpolation="Linear", extension=name) for name in ("EXTEND", "CLIP", "MIRROR")},
    **{f"mapping {name}": _mapping(name) for name in ("POINT", "TEXTURE", "VECTOR")},
    **{f"blend {name}": _blend(name) for name in ("MIX", "ADD", "SUBTRACT", "MULTIPLY", "SCREEN", "DARKEN")},
    **{f"blend {name}": _blend(name) for name in ("LIGHTEN", "DIFFERENCE", "DIVIDE")},
    "ramp": _node("ShaderNodeValToRGB"),
    "invert": _node("ShaderNodeInvert", place=1, inputs={0: 0.8}),
    "clamp": _node("ShaderNodeClamp", inputs={"Min": 0.2, "Max": 0.6}),
    "map range": _node("ShaderNodeMapRange", inputs={"From Min": 0.2, "From Max": 0.7, "To Min": 0.9, "To Max": 0.1}),
    "map range smooth": _node("ShaderNodeMapRange", inputs={"From Min": 0.2}, interpolation_type="SMOOTHSTEP"),
    "map range stepped": _node("ShaderNodeMapRange", inputs={"Steps": 3.0}, interpolation_type="STEPPED"),
    "gamma": _node("ShaderNodeGamma", inputs={1: 2.2}),
    "contrast": _node("ShaderNodeBrightContrast", inputs={1: 0.1, 2: 0.4}),
    "float curve": _node("ShaderNodeFloatCurve", place=1),
    "checker": _of_place("ShaderNodeTexChecker", 1, {"Scale": 6.0}),
    "checker colours": _of_place("ShaderNodeTexChecker", 0, {"Scale": 5.0}),
    **{f"gradient {name}": _of_place("ShaderNodeTexGradient", 0, gradient_type=name) for name in ("LINEAR", "RADIAL")},
    "gradient easing": _of_place("ShaderNodeTexGradient", 0, gradient_type="EASING"),
    "length": _of_place("ShaderNodeVectorMath", 1, operation="LENGTH"),
}


@pytest.mark.parametrize("name", JUDGED)
def test_nodes_give_what_cycles_makes_of_them(name: str) -> None:
    """A material's roughness is linked to the very socket of its alpha, and rendered."""
    nodes = Nodes()
    value = JUDGED[name](nodes)
    # Between 0 and 1, where both the alpha and the roughness are clipped.
    inside = nodes.node("ShaderNodeMath", value, 0.37, 0.31, operation="MULTIPLY_ADD").outputs[0]
    nodes.alpha(inside)
    nodes.feed(nodes.shader.inputs["Roughness"], inside)
    u, v = np.random.default_rng(5).random((2, 500))
    uv = np.pad(np.stack([u, v], axis=1), ((0, 0), (0, 2))).astype(np.float32)
    transparency = read_transparency(nodes.item).transparency
    assert transparency is not None
    assert transparency.inputs <= {SurfaceInput("uv"), ALONG}
    mine = 1.0 - np.broadcast_to(transparency.share({SurfaceInput("uv"): uv.astype(np.float64)}), u.shape)
    with calculator({0: nodes.item}, ["roughness"]) as judge:
        wanted = judge.calculate(np.zeros(len(u), np.intp), dict.fromkeys(judge.inputs_of(0), uv))["roughness"]
    wanted = np.clip(wanted, 0.0, 1.0)
    assert np.ptp(wanted) > 0.01
    different = np.abs(mine - wanted[:, 0]) > 2e-3
    assert different.mean() <= 0.006, (mine[different][:5], wanted[different, 0][:5])  # on an edge either may be right
