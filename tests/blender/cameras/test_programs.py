"""Programs and Cycles side by side: which works out which material, what the report says, and that both agree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import bpy
import numpy as np
import pytest

from synthroads_addon.base.arithmetic.loops import loops_by
from synthroads_addon.blender.cameras import MaterialSnapshot, layer_source
from synthroads_addon.blender.cameras import programs as module
from synthroads_addon.blender.cameras.nodes import NodeLayers
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.scanning.colour.colour import FROM_NODES, LayerValues, SeenPoints
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.kernels.points import CompiledPoints, usable_points
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.helpers.scenes.coded_scene import job

BASE = frozenset({"base_color"})


def _board(place: float, kind: str, output: str) -> None:
    """Add a plane whose colour a texture gives by the place in the world."""
    item = bpy.data.materials.new(kind)
    if item.node_tree is None:
        item.use_nodes = True
    tree = item.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    texture, geometry = tree.nodes.new(f"ShaderNode{kind}"), tree.nodes.new("ShaderNodeNewGeometry")
    tree.links.new(geometry.outputs["Position"], texture.inputs["Vector"])
    tree.links.new(texture.outputs[output], shader.inputs["Base Color"])
    bpy.ops.mesh.primitive_plane_add(size=4.0, location=(place, 0.0, 0.0))
    bpy.context.object.data.materials.append(item)


@pytest.fixture
def scene() -> tuple[SceneMesh, SeenPoints]:
    """Return a board of noise, which has a program, beside one of Gabor's, which has none, and points on both."""
    _board(0.0, "TexNoise", "Color")
    _board(10.0, "TexGabor", "Value")
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    random = np.random.default_rng(3)
    face = random.integers(0, len(mesh), 3000)
    share = random.dirichlet((1.0, 1.0, 1.0), 3000)
    place = np.einsum("nc,nck->nk", share, mesh.vertices[mesh.triangles[face]].astype(np.float64))
    normal = mesh.normals()[face]
    return mesh, SeenPoints(place, place + 5.0 * normal, normal, mesh.material[face], np.zeros(3000), face)


def _sampled(
    mesh: SceneMesh, points: SeenPoints, kernels: Literal["auto", "off"] = "auto"
) -> tuple[LayerValues, dict[str, Any], bool]:
    """Return base colours, the report, and whether the main thread is needed."""
    with layer_source(replace(job(mesh, set(BASE), source="nodes"), kernels=kernels)) as layers:
        assert isinstance(layers, NodeLayers)
        return layers.sample(points, BASE), layers.report, layers.calls is not None


def test_unknown_nodes_are_left_to_cycles_and_named(scene: tuple[SceneMesh, SeenPoints]) -> None:
    mesh, points = scene
    both, report, _ = _sampled(mesh, points)
    alone, without, _ = _sampled(mesh, points, "off")
    assert report["by_cycles"] == {"TexGabor": {"because_of": "Gabor Texture"}}
    assert (report["kernels"], report["returns"]) == ("programs", 3000)
    assert (without["kernels"], "by_cycles" in without) == ("off", False)
    assert (both.source == FROM_NODES).all()
    np.testing.assert_allclose(both.arrays["base_color"], alone.arrays["base_color"], atol=1e-5)
    of_cycles = points.material == mesh.materials.index("TexGabor")
    np.testing.assert_array_equal(both.arrays["base_color"][of_cycles], alone.arrays["base_color"][of_cycles])
    assert (both.arrays["base_color"][~of_cycles] != alone.arrays["base_color"][~of_cycles]).any()


def test_without_unknown_nodes_nothing_is_rendered(
    scene: tuple[SceneMesh, SeenPoints], monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, points = scene
    bpy.data.objects.remove(bpy.data.objects["Plane.001"])
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    on_it = points.select(np.flatnonzero(points.position[:, 0] < 5.0))
    on_it = replace(on_it, material=np.zeros(len(on_it), np.uint16), face=np.zeros(len(on_it), np.intp))
    expected, _, rendered = _sampled(mesh, on_it, "off")
    assert rendered

    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("Cycles is asked")

    monkeypatch.setattr(module, "opened_calculator", refuse)
    found, report, rendered = _sampled(mesh, on_it)
    assert not rendered
    assert "by_cycles" not in report
    np.testing.assert_allclose(found.arrays["base_color"], expected.arrays["base_color"], atol=1e-5)


def test_compiled_loops_around_materials_change_nothing(scene: tuple[SceneMesh, SeenPoints]) -> None:
    mesh, points = scene
    loops, results = usable_points(), []
    assert isinstance(loops, CompiledPoints), "python tools/build_kernels.py"
    wanted = {"base_color", "roughness", "metallic", "specular", "rgb"}
    for used in (None, loops):
        with loops_by(used), layer_source(job(mesh, wanted, source="nodes")) as layers:
            results.append(layers.sample(replace(points), frozenset(wanted)))
    for name, values in results[0].arrays.items():
        assert values.tobytes() == results[1].arrays[name].tobytes(), name
    assert np.ptp(results[0].arrays["rgb"], axis=0).all()


@pytest.mark.parametrize("reason", ["no library", "another Blender", "other colours"])
def test_where_programs_cannot_be_used_cycles_works_out_all_and_it_is_said(
    scene: tuple[SceneMesh, SeenPoints], monkeypatch: pytest.MonkeyPatch, reason: str
) -> None:
    mesh, points = scene
    expected, _, _ = _sampled(mesh, points, "off")
    if reason == "no library":
        monkeypatch.setattr(module, "usable_materials", lambda: NoKernelError("it isn't installed"))
        told = "none: Cycles works them out, as it isn't installed"
    elif reason == "another Blender":
        monkeypatch.setattr(module, "COMPARED", ((4, 4),))
        told = f"nobody has compared programs with Cycles of Blender {bpy.app.version_string}"
    else:
        monkeypatch.setattr(module, "_REC709", "ACEScg")
        told = "programs have the colours of ACEScg, and not of Linear Rec.709"
        if bpy.app.version < (5, 0, 0):
            pytest.skip("Blender < 5")
    found, report, _ = _sampled(mesh, points)
    assert told in report["kernels"]
    np.testing.assert_array_equal(found.arrays["base_color"], expected.arrays["base_color"])


def test_a_snapshot_has_programs_and_copies(scene: tuple[SceneMesh, SeenPoints], tmp_path: Any) -> None:
    mesh, _ = scene
    snapshot = MaterialSnapshot(mesh.materials, {0, 1}, tmp_path)
    programs, copies = snapshot.work({0, 1}, ("base_color",)).calculators
    assert (programs.main_thread, copies.main_thread) == (False, True)
    assert {mesh.materials[index] for index in programs.materials} == {"TexNoise"}
    assert {mesh.materials[index] for index in copies.materials} == {"TexGabor"}
    (alone,) = MaterialSnapshot(mesh.materials, {0, 1}, tmp_path, "off").work({0, 1}, ("base_color",)).calculators
    assert alone.materials == {0, 1}
