"""Scenes of others with image textures: every point has its own place's colour, and an intensity that follows."""

from __future__ import annotations

import json
from pathlib import Path
from threading import Event
from typing import Any

import bpy
import laspy
import numpy as np
import pytest

from synthroads_addon.blender.cameras.nodes import NodeLayers
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.jobs.scan.files import CloudFiles
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.materials.reflectance import reflectivity
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning import blocks, record
from synthroads_addon.scanning.colour.colour import LayerValues, SeenPoints
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.checkered_scene import APART, build_checkered_scene, expected_colors

PLACE = (15.0, -9.0, 7.0)
"""Place of the scanner: it does not see what is straight below it."""
SCAN = ["scan.lines_per_second=80", "scan.noise.range_sigma=0", "scan.relief=0"]
SCAN += ["scan.rays_per_pulse=1", 'outputs=["cloud"]', "colour.mode=unlit", "cloud.intensity=range_corrected"]
SCAN += ["scan.reflection=lambert", 'cloud.attributes=["incidence","color_source"]']


def scanned(
    folder: Path, scene: Path | None, *changes: str, tripods: tuple[tuple[float, ...], ...] = (PLACE,)
) -> tuple[dict[str, Any], laspy.LasData]:
    scenario = load_scenario("tripod-200m-even", [*SCAN, *changes])
    job = SceneScan(scenario, folder, scene, tripods=tripods)
    report = scan_scene(job)
    return report, laspy.read(folder / "cloud.laz")


@pytest.mark.parametrize("suffix", [".blend", ".glb"])
def test_points_have_their_fields_colour_and_its_luminance(tmp_path: Path, suffix: str) -> None:
    empty_file()
    build_checkered_scene(tmp_path)
    path = tmp_path / f"scene{suffix}"
    if suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    else:
        bpy.ops.export_scene.gltf(filepath=str(path))
    report, cloud = scanned(tmp_path / "out", path)
    place = np.asarray(cloud.xyz)
    assert len(place) > 10_000
    assert report["counts"]["points_by_colour_source"] == {"nodes": 1.0}
    expected, edge = expected_colors(place)
    inside = edge > 0.02
    assert (np.bincount(np.round(place[inside, 0] / APART).astype(int)) > 200).all(), "all boards are seen"
    stored = np.stack([np.asarray(cloud[name]) for name in ("red", "green", "blue")], axis=1) / 65535.0
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    assert np.abs(linear - expected)[inside].max() < 0.002
    cosine = np.cos(np.deg2rad(np.asarray(cloud["incidence"], float)))
    bright = np.asarray(cloud.intensity, float) / cosine
    wanted = reflectivity(expected.astype(np.float32), np.zeros(len(place)), np.zeros(len(place)))
    ratio = bright[inside] / wanted[inside]
    assert ratio.std() < 0.01 * ratio.mean()
    assert wanted[inside].std() > 0.2 * wanted[inside].mean(), "fields differ"


SHORT = ["scan.platform.turn_seconds=1"]
LIT = ["colour.mode=lit", "scan.lines_per_second=150"]


def shaded_scene(folder: Path) -> None:
    """Make the boards with a cube above one of them."""
    empty_file()
    build_checkered_scene(folder)
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(10.0, 3.0, 2.0))


@pytest.mark.any_blender
def test_threads_change_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lots of points are finished while others are rendered, which they wait for in a thread."""
    monkeypatch.setattr(record, "RETURNS_AT_ONCE", 15_000)
    shaded_scene(tmp_path)
    one, three = (scanned(tmp_path / name, None, *LIT, f"scan.threads={name}")[1] for name in ("1", "3"))
    assert len(one) > 60_000
    assert one.points.array.tobytes() == three.points.array.tobytes()
    dark = np.asarray(one.green, float) < 0.75 * np.median(np.asarray(one.green))
    assert dark.any(), "the cube throws a shadow"


@pytest.mark.any_blender
def test_an_error_while_others_wait_to_be_rendered_ends_the_scan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second lot asks the main thread after this has gone on to its end."""
    monkeypatch.setattr(blocks, "RAYS_PER_BLOCK", 1 << 13)
    monkeypatch.setattr(record, "RETURNS_AT_ONCE", 500)
    failed, asking, sample = Event(), Event(), NodeLayers.sample

    def ask_late(layers: NodeLayers, points: SeenPoints, wanted: frozenset[str]) -> LayerValues:
        if points.time.min() > 0.5:  # s; all but the first lot, which is written first, whichever asks first
            asking.set()
            failed.wait(60.0)
        return sample(layers, points, wanted)

    def fail(*_: Any) -> None:
        assert asking.wait(60.0)
        failed.set()
        raise ZeroDivisionError

    monkeypatch.setattr(NodeLayers, "sample", ask_late)
    monkeypatch.setattr(CloudFiles, "write", fail)
    shaded_scene(tmp_path)
    with pytest.raises(ZeroDivisionError):
        scanned(tmp_path / "out", None, *SHORT, "scan.threads=3", "scan.kernels=off")


@pytest.mark.slow
@pytest.mark.parametrize("road", [False, True])
def test_casters_give_the_same_layers(tmp_path: Path, road: bool) -> None:
    """Lit boards with a shadow on them, and base colour and layers of a road."""
    if road:
        empty_file()
        scenario = load_scenario("rq31-600m-even", ["road.length=40", "road.half_width=20", "vegetation_detail=0.2"])
        build_road(BuildRequest(sample_road(scenario.road, scenario.seed), 0.02, 0.2))
        bpy.context.view_layer.update()
    else:
        shaded_scene(tmp_path)
    layers = ("roughness", "metallic", "specular")
    changes = [f"cloud.attributes={json.dumps(layers)}", f"colour.mode={'unlit' if road else 'lit'}"]
    changes += SHORT if road else []
    one, other = (
        scanned(tmp_path / name, None, *changes, f"scan.caster={name}", tripods=() if road else (PLACE,))[1]
        for name in ("embree", "bvhtree")
    )
    assert len(other) == len(one) > 10_000
    same = np.ones(len(one), bool)
    for name in ("red", "green", "blue", "intensity", *layers):
        same &= np.isclose(np.asarray(one[name], float), np.asarray(other[name], float), rtol=0.0, atol=1.01e-4)
    assert same.mean() > 0.9995
    assert not road or all(np.ptp(np.asarray(one[name], float)) > 0.01 for name in ("red", "roughness", "specular"))
