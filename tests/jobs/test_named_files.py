"""Files that name files: a harmless marker shows for each row of the table in docs/inputs-paths.md that a guard holds.

What lies outside is a marker: a small picture, a text, a layer. It stays, or isn't read, and one line says so.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import sys
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
import torch

from headless import cli
from ml.centerline.measuring import read_cases
from ml.configuration import from_data
from ml.data.scene_stream import SceneStream, StreamOptions
from ml.data.sources import Source, read_tiles
from ml.data.yardsticks import load_yardstick
from ml.experiments import load_experiment
from ml.runs import Run
from ml.segmentation.task import _pretraining
from ml.tasks import Evaluation
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.scratch.locks import exclusive, this_process
from synthroads_addon.blender.materials.image import is_missing
from synthroads_addon.blender.scene.foreign import open_scene, open_scene_warnings
from synthroads_addon.blender.things.asset import _collection
from synthroads_addon.calibration.expected import read_texture
from synthroads_addon.dataset.manifest import append_record, read_manifest
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.jobs.dataset.scene_files import DONE
from synthroads_addon.materials.table import materials
from synthroads_addon.materials.textures import texture_files
from synthroads_addon.road.axes.centerline import read_axis
from synthroads_addon.road.ground.elevation_model import read_elevation_model
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.scanning.devices.device import load_device
from synthroads_addon.scenario.assets import read_asset_library
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import load_scenario
from tests.headless.test_dataset_overwrite import NEW, OLD, content, make
from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.roads.written_maps import well_known_binary
from tests.helpers.scenes.transparent_files import grey_png, obj, usd

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "inputs-paths.md"
Row = Callable[[Path], None]
ROWS: dict[str, Row] = {}
"""Tests by the first cell of its row in the documentation's table."""


def row(name: str) -> Callable[[Row], Row]:
    def add(test: Row) -> Row:
        ROWS[name] = test
        return test

    return add


def test_each_row_of_the_documentation_has_its_test() -> None:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    cells = [line.split("|")[1].strip() for line in lines if line.startswith("|")]
    assert sorted(cell for cell in cells[1:] if not set(cell) <= {"-"}) == sorted(ROWS)


# --- helpers ---------------------------------------------------------------------------------------------------------


def marker(folder: Path) -> Path:
    """Return a file that somebody else needs, beside a folder."""
    place = folder.parent / "outside" / "marker.txt"
    place.parent.mkdir(exist_ok=True)
    place.write_text("harmless")
    return place


def picture(path: Path) -> Path:
    """Write a grey picture of 4 by 4 pixels."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(grey_png(np.full((4, 4), 0.5)))
    return path


def scene_folder(folder: Path) -> tuple[Path, Path]:
    """Return an empty folder of a scene and a picture outside of it."""
    (folder / "scene").mkdir()
    return folder / "scene", picture(folder / "outside" / "marker.png")


def refused(use: Callable[[], object], file: str, address: str, remedy: str = "--also-from") -> None:
    """See that one line names the file, the address, what is allowed, and what is to be done."""
    with pytest.raises(InputError) as caught:
        use()
    text = str(caught.value)
    assert "\n" not in text
    assert file in text, text
    assert address in text, text
    assert "must stay in the file's folder" in text, text
    assert remedy in text, text


# --- what is written, moved or removed ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["../outside", "scenes/../../outside", "ABSOLUTE", "way/marker.txt", ".", "scenes/.."])
def test_what_is_to_be_removed_of_a_data_set_lies_in_it(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "set"
    make(folder, OLD)
    there = marker(folder)
    (folder / "way").symlink_to(there.parent, target_is_directory=True)
    before = content(folder)
    (folder / ".replaced.json").write_text(json.dumps(["DATA_CARD.md", name.replace("ABSOLUTE", str(there.parent))]))
    (tmp_path / "recipe.json").write_text(json.dumps(OLD))
    assert cli.main(["dataset", str(tmp_path / "recipe.json"), "--output", str(folder), "--resume"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith(f"error: {folder / '.replaced.json'} is ")
    assert "must name a place in" in said[-1]
    with pytest.raises(InputError, match="must name a place in"):
        make(folder, NEW, overwrite=True)
    assert there.read_text() == "harmless"
    (folder / ".replaced.json").unlink()
    assert content(folder) == before, "nor is anything else removed"


@row("`.replaced.json` of a data set")
def _(folder: Path) -> None:
    for wrong in ('{"a": 1}', "[1]", '"text"'):
        make(folder / "set", OLD, overwrite=(folder / "set").exists())
        (folder / "set" / ".replaced.json").write_text(wrong)
        with pytest.raises(InputError, match="must be a list of paths"):
            make(folder / "set", OLD, resume=True)
        (folder / "set" / ".replaced.json").unlink()


@row("`manifest.json`, `.scenes.jsonl` of a data set: scenes, their folders and files")
def _(folder: Path) -> None:
    make(folder / "set", OLD)
    there = marker(folder / "set")
    path = folder / "set" / "manifest.json"
    sound = json.loads(path.read_text())
    outside = there.read_bytes()
    entry = {"bytes": len(outside), "sha256": hashlib.sha256(outside).hexdigest()}
    for change in (
        {"name": "../../outside"},
        {"folders": ["../outside"]},
        {"folders": [str(there.parent)]},
        {"files": {"../outside/marker.txt": entry}},
        {"files": {str(there): entry}},
    ):
        data = json.loads(json.dumps(sound))
        data["scenes"][0] |= change
        path.write_text(json.dumps(data))
        for option in ("resume", "overwrite"):
            with pytest.raises(InputError, match=r"manifest\.json"):
                make(path.parent, OLD, **{option: True})
        assert cli.main(["dataset", "small-roads", "--output", str(path.parent), "--verify"]) == 2
        assert there.read_text() == "harmless"


@row("what an interrupted run left in `.work` of a data set")
def _(folder: Path) -> None:
    make(folder / "set", OLD)
    there = marker(folder / "set")
    place = folder / "set" / ".work" / "a-01-x" / "attempt-y"
    place.mkdir(parents=True)
    for told in ({"folders": ["../outside"]}, {"folders": [str(there.parent)]}, {"folders": [3]}, {}, []):
        (place / DONE).write_text(json.dumps(told))
        with pytest.raises(InputError, match="is damaged"):
            make(folder / "set", NEW, overwrite=True)
        assert there.exists()


@row("links in the folder of a data set")
def _(folder: Path) -> None:
    for name in ("scenes", "logs", "pointcept"):
        place = folder / f"set-{name}"
        make(place, OLD)
        (place / name).rename(folder / f"outside-{name}")
        (place / name).symlink_to(folder / f"outside-{name}", target_is_directory=True)
        before = content(folder / f"outside-{name}")
        with pytest.raises(InputError, match="must name a place in"):
            make(place, NEW, overwrite=True)
        assert content(folder / f"outside-{name}") == before
    whole = folder / "whole"
    make(whole, OLD)
    there = marker(whole)
    (whole / ".manifest.json.part").symlink_to(there)
    make(whole, OLD, resume=True)
    assert there.read_text() == "harmless", "what is written goes through no link"
    (whole / ".scenes.jsonl").symlink_to(there)
    with pytest.raises(InputError, match="must name a place in"):
        append_record(whole, read_manifest(whole).scenes[0])
    make(whole, OLD, resume=True)
    assert there.read_text() == "harmless"


@row("lock files (`.lock`)")
def _(folder: Path) -> None:
    (folder / "set").mkdir()
    there = marker(folder / "set")
    (folder / "set" / ".lock").symlink_to(there)

    def lock() -> None:
        with exclusive(folder / "set" / ".lock"):
            pass

    with pytest.raises(InputError, match="must name a place in"):
        lock()
    with pytest.raises(InputError, match="must name a place in"):
        make(folder / "set", OLD)
    assert there.read_text() == "harmless"


@row("half-finished moves and leftovers (`.partial-...`, `synthroads-...`)")
def _(folder: Path) -> None:
    there = marker(folder / "out")

    def next_work() -> None:
        with output_folder(folder / "out", [], False) as work:
            (work / "new.txt").write_text("new")

    dead = this_process().to_json().replace(f'"pid": {os.getpid()}', '"pid": 2').replace('"start": ', '"start": 9')
    for kind in ("new", "old", "whole"):
        left = folder / "out" / ".partial-2-abcdefgh"
        left.parent.mkdir(exist_ok=True)
        if kind == "whole":
            left.symlink_to(there.parent, target_is_directory=True)
            (there.parent / ".owner.json").write_text(dead)
        else:
            left.mkdir()
            (left / ".owner.json").write_text(dead)
            (left / kind).symlink_to(there.parent, target_is_directory=True)
            (left / {"new": "old", "old": "new"}[kind]).mkdir()
        next_work()
        assert there.read_text() == "harmless"
        assert sorted(path.name for path in left.parent.glob("[!.]*")) == ["new.txt"]
        shutil.rmtree(folder / "out", ignore_errors=True)


@row("`pretraining`, `scenes` in the folder of a training")
def _(folder: Path) -> None:
    (folder / "run").mkdir()
    there = marker(folder / "run")
    (folder / "run" / "pretraining").symlink_to(there.parent, target_is_directory=True)
    (folder / "run" / "scenes").symlink_to(there.parent, target_is_directory=True)
    plain = {"task": "segmentation", "set_up": "fine_tuned", "data": {"real": [], "synthetic": []}}
    run = Run.start(folder / "run", from_data(plain, "configuration"))
    with pytest.raises(InputError, match="must name a place in"):
        _pretraining(run)
    with pytest.raises(InputError, match="must name a place in"):
        SceneStream(StreamOptions(recipe="small-roads"), 1, run.folder, 1)
    (folder / "run" / "checkpoint.pt").write_bytes(b"")
    Run.start(folder / "run", run.configuration, overwrite=True).begin()  # of the link the link alone goes
    assert content(there.parent) == {"marker.txt": b"harmless"}
    assert not (folder / "run" / "pretraining").exists()


@row("`data.cache` of a run that is evaluated")
def _(folder: Path) -> None:
    data = write_data_set(folder / "roads")
    plain = {"task": "centerline", "data": {"data_sets": [str(data)], "cache": str(folder / "outside")}}
    cases = read_cases(from_data(plain, "run"), Evaluation([data], "validation", folder / "out"))
    assert cases
    assert not (folder / "outside").exists()


@row("names of an experiment's variants")
def _(folder: Path) -> None:
    sound = {"title": "x", "configuration": "segmentation-small", "data": {}, "variants": {"real": {}}}
    for name in ("../outside", "/outside", "..", "a/b"):
        (folder / "experiment.json").write_text(json.dumps({**sound, "variants": {name: {}}}))
        with pytest.raises(InputError, match="variants"):
            load_experiment(str(folder / "experiment.json"))


# --- what is read of files of others --------------------------------------------------------------------------------


@row("glTF: buffers and pictures (`uri`)")
def _(folder: Path) -> None:
    scene, there = scene_folder(folder)
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "part.bin"}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "../outside/marker.png"}],
    }
    (scene / "part.bin").write_bytes(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes())
    (scene / "a.gltf").write_text(json.dumps(document))
    refused(lambda: open_scene(scene / "a.gltf"), "a.gltf", "../outside/marker.png")
    open_scene(scene / "a.gltf", also_from=(there.parent,))
    assert [image.size[0] for image in bpy.data.images] == [4]


def test_an_obj_s_picture_outside_is_refused_or_allowed_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, there = scene_folder(tmp_path)
    obj(f"map_Kd {there}")(scene / "a.obj")
    words = ["scan", str(scene / "a.obj"), "--output", str(tmp_path / "out"), "--quiet"]
    assert cli.main(words) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    for part in ("a.mtl", "marker.png", "must stay in the file's folder", "--also-from"):
        assert part in said[0]
    assert not (tmp_path / "out").exists()
    open_scene(scene / "a.obj", also_from=(there.parent,))
    assert {image.name for image in bpy.data.images if image.size[0] == 4} == {"marker.png"}


@row("OBJ: material libraries (`mtllib`), their pictures (`map_...`, `bump`, `norm`, ...)")
def _(folder: Path) -> None:
    scene, there = scene_folder(folder)
    (scene / "link.png").symlink_to(there)
    (scene / "inside.png").symlink_to(scene / "g.png")
    lines = [f"map_Kd {there}", "map_Kd ../outside/marker.png", "map_Kd ..\\outside\\marker.png", "bump link.png"]
    lines += [f"map_Bump -bm 0.5 -s 1 1 1 {there}", f'map_Kd "{there}"', f"map_d -o 1 2 {there}", f"norm {there}"]
    for line in lines:
        obj(line)(scene / "a.obj")
        refused(lambda: open_scene(scene / "a.obj"), "a.mtl", line.split()[-1].strip('"').replace("\\", "\\\\"))
    for line in ("map_Kd inside.png", "map_Kd C:\\gone\\from\\here.png", "map_Kd /no/such.png", "map_Kd a.png"):
        obj(line)(scene / "a.obj")
        open_scene(scene / "a.obj")
    (there.parent / "marker.mtl").write_text("newmtl Clear\nKd 1 0 0\n")
    text = (scene / "a.obj").read_text()
    for name in ("../outside/marker.mtl", str(there.parent / "marker.mtl")):
        (scene / "a.obj").write_text(text.replace("mtllib a.mtl", f"mtllib {name}"))
        refused(lambda: open_scene(scene / "a.obj"), "a.obj", name)
    if hasattr(os, "mkfifo"):
        os.mkfifo(scene / "pipe")
        (scene / "a.obj").write_text(text.replace("mtllib a.mtl", "mtllib pipe"))
        refused(lambda: open_scene(scene / "a.obj"), "a.obj", "pipe")


_USD_TEXTURE = """      float inputs:opacity.connect = </Root/Looks/Clear/Picture.outputs:r>"""


@row("USD: sublayers, references, payloads, value clips, pictures, in all variants")
def _(folder: Path) -> None:
    scene, there = scene_folder(folder)
    layer = '#usda 1.0\n(\n    defaultPrim = "Mark"\n)\ndef Mesh "Mark"\n{\n'
    layer += "    int[] faceVertexCounts = [3]\n    int[] faceVertexIndices = [0, 1, 2]\n"
    layer += "    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n}\n"
    (there.parent / "marker.usda").write_text(layer)
    head = '#usda 1.0\n(\n    defaultPrim = "Root"\n    metersPerUnit = 1\n    upAxis = "Z"\n{sub})\n'
    body = 'def Xform "Root"\n{{\n    def "A" ({arc})\n    {{\n    }}\n}}\n'
    outside = "../outside/marker.usda"
    cases = {
        "sub.usda": head.format(sub=f"    subLayers = [@{outside}@]\n") + body.format(arc=""),
        "reference.usda": head.format(sub="") + body.format(arc=f"references = @{outside}@"),
        "payload.usda": head.format(sub="") + body.format(arc=f"payload = @{there.parent}/marker.usda@"),
        "below.usda": head.format(sub="    subLayers = [@./reference.usda@]\n") + body.format(arc=""),
        "variant.usda": head.format(sub="")
        + 'def Xform "Root" (\n    variants = {\n        string v = "a"\n    }\n    prepend variantSets = "v"\n)\n{\n'
        + '    variantSet "v" = {\n        "a" {\n        }\n        '
        + f'"b" (payload = @{outside}@) {{\n        }}\n    }}\n}}\n',
        "picture.usda": head.format(sub="")
        + 'def Xform "Root"\n{\n    def Shader "T"\n    {\n        uniform token info:id = "UsdUVTexture"\n'
        + "        asset inputs:file = @../outside/marker.png@\n    }\n}\n",
    }
    for name, named in {
        "clip.usda": f"asset[] assetPaths = [@{outside}@]",
        "manifest.usda": f"asset manifestAssetPath = @{outside}@",
        "template.usda": 'string templateAssetPath = "../outside/marker.#.usda"\n'
        "double templateStartTime = 1\ndouble templateEndTime = 1\ndouble templateStride = 1",
    }.items():
        clips = (
            f'clips = {{\n        dictionary default = {{\n            {named}\n            string primPath = "/Mark"'
        )
        cases[name] = head.format(sub="") + body.format(arc=f"{clips}\n        }}\n    }}")
    (there.parent / "marker.1.usda").write_text(layer)
    cases["damaged.usda"] = head.format(sub="    subLayers = [@./broken.usda@, @./gone.usda@]\n") + body.format(
        arc=f"references = [@./broken.usda@, @{outside}@]"
    )
    (scene / "broken.usda").write_text("#usda 1.0\ndef {{{\n")
    for name, text in cases.items():
        (scene / name).write_text(text)
    for name in cases:
        file = "reference.usda" if name == "below.usda" else name
        refused(lambda name=name: open_scene(scene / name), file, "marker.")  # type: ignore[misc]
    open_scene(scene / "reference.usda", also_from=(there.parent,))
    assert [len(item.data.vertices) for item in bpy.data.objects if item.type == "MESH"] == [3]
    usd("      float inputs:opacity = 0.5")(scene / "sound.usda")
    open_scene(scene / "sound.usda")


@row("FBX: pictures")
def _(folder: Path) -> None:
    scene, there = scene_folder(folder)
    bpy.ops.mesh.primitive_plane_add()
    item = bpy.data.materials.new("M")
    item.use_nodes = True
    node = item.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(str(there))
    shader = next(each for each in item.node_tree.nodes if each.type == "BSDF_PRINCIPLED")
    item.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    bpy.context.object.data.materials.append(item)
    bpy.ops.export_scene.fbx(filepath=str(scene / "a.fbx"), path_mode="ABSOLUTE")
    refused(lambda: open_scene(scene / "a.fbx"), "a.fbx", "marker.png")
    open_scene(scene / "a.fbx", also_from=(there.parent,))
    assert "marker.png" in {image.name for image in bpy.data.images}
    there.rename(scene / "marker.png")
    open_scene(scene / "a.fbx")
    assert not any(is_missing(image) for image in bpy.data.images if image.source == "FILE")


def library(folder: Path, file: str) -> Path:
    """Write an asset library of one asset."""
    placement = {"side": "left", "distance": {"minimum": 1.0, "maximum": 2.0}, "spacing": {"minimum": 9, "maximum": 9}}
    asset = {"file": file, "class_name": "vegetation", "placement": placement}
    (folder / "library.json").write_text(json.dumps({"assets": {"thing": asset}}))
    return folder / "library.json"


@row("asset libraries (`library.json`): files of assets")
def _(folder: Path) -> None:
    (folder / "library").mkdir()
    outside = folder / "outside"
    outside.mkdir()
    obj("")(outside / "marker.obj")
    for name in ("../outside/marker.obj", str(outside / "marker.obj")):
        with pytest.raises(InputError, match="must lie in the library's folder"):
            read_asset_library(library(folder / "library", name))
    (folder / "library" / "link.obj").symlink_to(outside / "marker.obj")
    (folder / "library" / "way").symlink_to(outside, target_is_directory=True)
    for name in ("link.obj", "way/marker.obj"):
        with pytest.raises(InputError, match="must name a place in"):
            read_asset_library(library(folder / "library", name))
    obj("")(folder / "library" / "sound.obj")
    (folder / "library" / "inside.obj").symlink_to(folder / "library" / "sound.obj")
    read_asset_library(library(folder / "library", "inside.obj"))


@row("assets other than `.blend`: what their files name")
def _(folder: Path) -> None:
    (place := folder / "library" / "trees").mkdir(parents=True)
    there = picture(folder / "outside" / "marker.png")
    beside = picture(folder / "library" / "textures" / "bark.png")
    obj(f"map_Kd {there}")(place / "tree.obj")
    asset = read_asset_library(library(folder / "library", "trees/tree.obj")).assets["thing"]
    remedy = "copy it into the library's folder"
    refused(lambda: _collection(folder / "library", asset), "tree.mtl", "marker.png", remedy)
    obj(f"map_Kd ../textures/{beside.name}")(place / "tree.obj")
    assert _collection(folder / "library", asset).objects


# --- Blender's own files ---------------------------------------------------------------------------------------------


@row("`.blend`: pictures, linked files")
def _(folder: Path) -> None:
    scene, there = scene_folder(folder)
    film = folder / "outside" / "marker.png.m3u8"
    film.write_text(f"#EXTM3U\n#EXTINF:1,\nfile://{there}\n")
    (folder / "outside" / "text.png").write_text("no picture")
    bpy.ops.mesh.primitive_plane_add()
    item = bpy.data.materials.new("M")
    item.use_nodes = True
    shader = next(each for each in item.node_tree.nodes if each.type == "BSDF_PRINCIPLED")
    for name, source in ((there, "FILE"), (film, "MOVIE"), (folder / "outside" / "text.png", "FILE")):
        node = item.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = bpy.data.images.new(name.name, 4, 4)
        node.image.source, node.image.filepath = source, str(name)
        item.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    bpy.context.object.data.materials.append(item)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "outside" / "linked.blend"), copy=True)
    text = bpy.data.texts.new("run.py")
    text.write(f"open({str(folder / 'ran')!r}, 'w')")
    text.use_module = True
    bpy.ops.wm.save_as_mainfile(filepath=str(scene / "a.blend"), copy=True)
    open_scene(scene / "a.blend")
    assert not (folder / "ran").exists(), "scripts aren't run"
    shown = {image.name: is_missing(image) for image in bpy.data.images if image.name != "Render Result"}
    assert shown == {"marker.png": False, "marker.png.m3u8": True, "text.png": True}
    assert not open_scene_warnings()


# --- pictures and rasters --------------------------------------------------------------------------------------------


@row("`calibrate --texture`: an image")
def _(folder: Path) -> None:
    """Of a format for which Pillow starts a program: a harmless stand-in for it, which leaves a file, isn't started."""
    (folder / "bin").mkdir()
    program = folder / "bin" / "gs"
    program.write_text(f"#!/bin/sh\necho started > {folder / 'started'}\n")
    program.chmod(0o755)
    page = "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 4 4\n%%EndComments\nshowpage\n%%EOF\n"
    before = os.environ["PATH"]
    os.environ["PATH"] = f"{folder / 'bin'}{os.pathsep}{before}"
    try:
        for name in ("road.eps", "road.png"):
            (folder / name).write_text(page)
            with pytest.raises(InputError) as caught:
                read_texture(folder / name, 1.0, materials()["asphalt"])
            assert not (folder / "started").exists()
            assert "must be a whole image: PNG, JPEG, TIFF, BMP, WEBP" in str(caught.value)
    finally:
        os.environ["PATH"] = before
    assert read_texture(picture(folder / "sound.png"), 1.0, materials()["asphalt"]).values.shape == (4, 4)


@row("folders of textures (`textures`): images in them")
def _(folder: Path) -> None:
    there = marker(folder / "set")
    (folder / "set").mkdir()
    (folder / "set" / "base_color.png").symlink_to(there)
    with pytest.raises(InputError, match="is no PNG, JPEG, OpenEXR or TIFF image"):
        texture_files(str(folder / "set"))


@row("maps that an axis is taken from")
def _(folder: Path) -> None:
    """GDAL's virtual format and its connections are no maps here, whatever their names end in."""
    pyogrio = pytest.importorskip("pyogrio")
    shape = np.array([well_known_binary(np.array([[0.0, 0.0, 1.0], [90.0, 0.0, 2.0]]))], dtype=object)
    names = [np.array(["elsewhere"], dtype=object)]
    there = folder / "outside.gpkg"
    options = {"driver": "GPKG", "geometry_type": "LineString Z", "crs": "EPSG:25832"}
    pyogrio.raw.write(there, shape, names, ["name"], **options)
    layer = f'<OGRVRTLayer name="outside"><SrcDataSource>{there}</SrcDataSource></OGRVRTLayer>'
    for name in ("a.vrt", "a.gpkg", "a.shp", "a.fgb"):
        (folder / name).write_text(f"<OGRVRTDataSource>{layer}</OGRVRTDataSource>")
        assert name != "a.vrt" or pyogrio.read_info(folder / name)["features"] == 1, "GDAL itself reads it"
        with pytest.raises(InputError) as caught:
            axis_from_file(folder / name, RoadScenario(), 1)
        assert "elsewhere" not in str(caught.value)
    entity = f'<!DOCTYPE osm [<!ENTITY a SYSTEM "{there}">]>'
    (folder / "a.osm").write_text(f'<?xml version="1.0"?>{entity}<osm version="0.6"><node id="&a;"/></osm>')
    with pytest.raises(InputError, match="must be removed, as entities aren't read"):
        axis_from_file(folder / "a.osm", RoadScenario(), 1)


@row("elevation models")
def _(folder: Path) -> None:
    import rasterio
    from rasterio.transform import from_origin

    there = folder / "outside.tif"
    place = {"width": 4, "height": 4, "count": 1, "dtype": "float32", "crs": "EPSG:25832"}
    with rasterio.open(there, "w", driver="GTiff", transform=from_origin(0, 4, 1, 1), **place) as file:
        file.write(np.ones((1, 4, 4), np.float32))
    band = f'<VRTRasterBand dataType="Float32" band="1"><SimpleSource><SourceFilename>{there}</SourceFilename>'
    band += "<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand>"
    vrt = f'<VRTDataset rasterXSize="4" rasterYSize="4"><SRS>EPSG:25832</SRS>{band}</VRTDataset>'
    (folder / "heights.tif").write_text(vrt)
    assert rasterio.open(folder / "heights.tif").read(1).sum() == 16.0, "GDAL itself reads what lies elsewhere"
    with pytest.raises(InputError, match="must be a GeoTIFF or ESRI ASCII grid"):
        read_elevation_model(str(folder / "heights.tif"), 25832)


# --- files that say what is to be done -------------------------------------------------------------------------------


@row("scenarios, parameter sets: files of any kind")
def _(folder: Path) -> None:
    """They may lie anywhere, as those of the command line; each is read as what is needed there or refused."""
    there = marker(folder / "x").rename(folder / "outside" / "marker.json")
    uses: list[Callable[[], object]] = [
        lambda: load_device(load_scenario("rq31-600m-even", [f"scan.device={there}"]).scan.device),
        load_scenario("rq31-600m-even", [f"cloud.classes={there}"]).cloud.scheme,
        partial(read_parameters, there),
        partial(read_axis, there),
        partial(read_asset_library, there),
        lambda: read_elevation_model(str(there), 25832),
    ]
    for use in uses:
        with pytest.raises(InputError):
            use()
    device = json.loads((ROOT / "synthroads_addon/presets/devices/riegl-minivux-3uav.json").read_text())
    there.write_text(json.dumps(device))
    load_device(load_scenario("rq31-600m-even", [f"scan.device={there}"]).scan.device)


@row("recipes: scenarios")
def _(folder: Path) -> None:
    (folder / "elsewhere").mkdir()
    (folder / "elsewhere" / "own.json").write_text(load_scenario("rq31-600m-even").to_json())
    there = marker(folder / "x")
    for name, good in ((folder / "elsewhere" / "own.json", True), (there, False), (folder / "no.json", False)):
        (folder / "recipe.json").write_text(json.dumps({**OLD, "scenario": str(name)}))
        if good:
            assert scene_jobs(load_recipe(str(folder / "recipe.json")))
        else:
            with pytest.raises(InputError) as caught:
                scene_jobs(load_recipe(str(folder / "recipe.json")))
            assert "harmless" not in str(caught.value)


@row("configurations of trainings: data sets, lists of clouds, axes, runs to begin with")
def _(folder: Path) -> None:
    there = marker(folder / "x")
    plain = {"task": "segmentation", "data": {"real": [{"path": str(there)}]}}
    configuration = from_data(plain, "configuration")
    with pytest.raises(InputError) as caught:
        list(read_tiles(configuration.data.real[0], class_scheme("5"), 0.5))
    assert "harmless" not in str(caught.value)


@row("devices, class tables, mappings, material tables")
def _(folder: Path) -> None:
    """They have no field for a file: what is unknown is refused."""
    there = marker(folder / "x")
    device = json.loads((ROOT / "synthroads_addon/presets/devices/riegl-minivux-3uav.json").read_text())
    (folder / "device.json").write_text(json.dumps(device))
    load_device(str(folder / "device.json"))
    for name in ("file", "path", "include", "$ref"):
        (folder / "device.json").write_text(json.dumps({**device, name: str(there)}))
        with pytest.raises(InputError, match="unknown key"):
            load_device(str(folder / "device.json"))


@row("yardsticks (public data sets): files, names")
def _(folder: Path) -> None:
    shipped = json.loads((ROOT / "ml/configurations/yardsticks/dales-objects.json").read_text())
    splits: list[dict[str, Any]] = [{"splits": {"train": [name]}} for name in ("../outside/*.ply", "/x/*.ply")]
    for change in (*splits, {"names": "../x.json"}):
        (folder / "own.json").write_text(json.dumps(shipped | change))
        with pytest.raises(InputError, match="must lie in the data set's folder"):
            load_yardstick(str(folder / "own.json"))


# --- files that name none --------------------------------------------------------------------------------------------


class _Marks:
    """A stand-in for what a pickle can run: it makes a folder, by a name that it holds."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.path),)


@row("weights and checkpoints")
def _(folder: Path) -> None:
    """Read without running what they hold."""
    torch.save({"model": {}, "epoch": 1, "more": _Marks(folder / "ran")}, folder / "checkpoint.pt")
    run: Run[Any] = Run(folder, None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="must be an undamaged checkpoint"):
        run.last_checkpoint()
    assert not (folder / "ran").exists()


@row("tiles (`classes.json`, `tile.json`), packed tiles, clouds (also `.npz`, `.npy`)")
def _(folder: Path) -> None:
    """Arrays of objects, which would be run, are refused."""
    from synthroads_addon.cloud.formats.registry import open_cloud

    array = np.array([_Marks(folder / "ran")], dtype=object)
    np.savez(folder / "cloud.npz", xyz=array, notes=array)
    with pytest.raises((InputError, MissingFileError)):
        open_cloud(folder / "cloud.npz").__enter__()
    (tile := folder / "train" / "a").mkdir(parents=True)
    (folder / "classes.json").write_text(json.dumps({"classes": ["ground"], "ids": [0]}))
    np.save(tile / "coord.npy", array, allow_pickle=True)
    np.save(tile / "segment.npy", array, allow_pickle=True)
    with pytest.raises(InputError):
        list(read_tiles(Source(path=str(folder)), class_scheme("5"), 0.5))
    with zipfile.ZipFile(folder / "pack.npz", "w") as archive:
        archive.writestr("notes.json", json.dumps({"tiles": [{"file": "../outside"}]}))
    with pytest.raises(InputError):
        list(read_tiles(Source(path=str(folder / "pack.npz")), class_scheme("5"), 0.5))
    assert not (folder / "ran").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
@pytest.mark.parametrize("name", list(ROWS))
def test_rows(name: str, tmp_path: Path) -> None:
    ROWS[name](tmp_path)


def test_every_picture_is_opened_by_listed_formats_alone() -> None:
    parts = ("synthroads_addon", "headless", "ml", "tools", "studies")
    files = [path for part in parts for path in (ROOT / part).rglob("*.py")]
    lines = [(path.name, line) for path in files for line in path.read_text().splitlines()]
    opened = [(name, line) for name, line in lines if re.search(r"Image\.open\(", line)]
    assert opened
    assert [(name, line) for name, line in opened if "formats=" not in line] == []
