"""The gallery: pictures of scenes, of every kind of object, and of every material with its layers.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...base.files import PRESETS, made_folder
from ...base.schema import read_json
from ...base.scratch.folders import scratch_folder
from ...materials.table import materials
from ...road.geometry import RoadGeometry
from ...road.parameters import AlignmentObject, RoadParameters
from ...road.surroundings import Environment
from ...sampling.road import sample_road
from ...scanning.scene.mesh import SceneMesh
from ...scenario.road import RoadScenario
from ..files import empty_file
from ..materials import material
from ..materials.looks import COLOR
from ..materials.shading import LAYERS
from ..materials.surface_layers import PROPERTY
from ..model.build import build_road
from ..scene.evaluated import scene_mesh
from ..things.meshes import attribute
from ..things.model_builder import BuildRequest
from . import pictures
from .landscape import add_landscape
from .sward import Lawn, add_sward
from .viewpoints import Viewpoint, aerial_view, driver_view

PRESET = PRESETS / "gallery.json"
_TOLERANCE = 0.005
"""Tolerance of the roads' meshes, m."""
_CLOSE_RADIUS = 5.0
"""Distance from an object's middle within which its parts are shown close up, m; chosen."""
_PITCH = 1.6
"""Distance between the centres of the materials' cubes, m; chosen."""
_ON_CUBES = {COLOR: (0.03, 0.09, 0.3), "shade": 0.5}
"""Attributes of meshes that some materials read: a car's colour, and the brightness of a gantry's steel."""
_DAYLIGHT = Environment(sun_azimuth_deg=215.0, sun_elevation_deg=42.0, cloud_cover=0.35, cloud_size=250.0)
_ROAD_MATRIX = Matrix.Identity(4)
"""Matrix from the road's coordinates to the scene's."""
_VIEWS = {"aerial": aerial_view, "driver": driver_view}
_NOT_SHOWN = ("Alignment", "Carriageway", "Median", "Terrain", "LineMarking", "Landscape")


@dataclass(frozen=True)
class Quality:
    """Size (pixels) and samples of the gallery's pictures."""

    size: tuple[int, int] = (1280, 720)
    samples: int = 48

    def half(self) -> Quality:
        """Return the quality with half the width and height."""
        return Quality((self.size[0] // 2, self.size[1] // 2), self.samples)


def make_gallery(folder: Path, quality: Quality, only: str, say: Callable[[str], None]) -> list[Path]:
    """Render the gallery's pictures whose names contain `only` to PNG files, discarding the open file; return paths."""
    preset = read_json(PRESET)
    paths: list[Path] = []
    shown_kinds: set[str] = set()
    for name, settings in preset["scenes"].items():
        paths += _scene_pictures(folder, name, settings, quality, only, say, shown_kinds)
    for design_class, section in preset["design_classes"].items():
        name = f"class-{design_class.lower()}"
        if only in name:
            road = {"design_class": design_class, "cross_section": section, "length": 800.0}
            scene = _build_scene({"road": road, "seed": 2})
            scene.aim_camera(aerial_view(scene.parameters))
            paths.append(_render(folder / f"{name}.png", quality, say))
    paths += _material_pictures(folder, quality, only, say)
    return paths


def planned_pictures(only: str) -> int:
    """Return the largest number of pictures that `make_gallery` renders; objects without faces have none."""
    preset = read_json(PRESET)
    names = {f"scene-{name}-{view}" for name in preset["scenes"] for view in _VIEWS}
    names |= {f"class-{design_class.lower()}" for design_class in preset["design_classes"]}
    names |= {f"materials-{layer}" for layer in ("lit", *LAYERS)}
    for name, settings in preset["scenes"].items():
        if _is_built(name, only):
            road = sample_road(RoadScenario.from_dict(settings["road"]), settings["seed"])
            names |= {f"object-{kind}" for kind, _ in _shown_objects(road)}
    return sum(only in name for name in names)


def _is_built(name: str, only: str) -> bool:
    """Return whether a scene of the gallery is needed for the pictures whose names contain `only`."""
    return not only or only.startswith("object") or any(only in f"scene-{name}-{view}" for view in _VIEWS)


def _scene_pictures(
    folder: Path,
    name: str,
    settings: dict[str, Any],
    quality: Quality,
    only: str,
    say: Callable[[str], None],
    shown_kinds: set[str],
) -> list[Path]:
    """Render a scene's views and close-ups of kinds of objects that no earlier scene has shown; return the paths."""
    if not _is_built(name, only):
        return []
    scene = _build_scene(settings)
    paths = []
    for view_name, viewpoint in _VIEWS.items():
        if only in f"scene-{name}-{view_name}":
            scene.aim_camera(viewpoint(scene.parameters))
            paths.append(_render(folder / f"scene-{name}-{view_name}.png", quality, say))
    mesh = scene_mesh()
    for kind, item in _shown_objects(scene.parameters):
        picture = f"object-{kind}"
        if kind in shown_kinds or only not in picture:
            continue
        if (view := _close_view(scene.parameters, mesh, item)) is not None:
            scene.aim_camera(view)
            shown_kinds.add(kind)
            paths.append(_render(folder / f"{picture}.png", quality.half(), say))
    return paths


@dataclass(frozen=True)
class _Scene:
    """The scene in the open file.

    Attributes:
        parameters: its road.
        lawn: ground on which grass grows.
    """

    parameters: RoadParameters
    lawn: Lawn

    def aim_camera(self, view: Viewpoint) -> None:
        """Add the camera, and the sward around it, to the scene, replacing earlier ones."""
        pictures.camera(view.place, view.target, view.lens)
        add_sward(bpy.context.scene, self.parameters, self.lawn, view.place, _ROAD_MATRIX)


def _build_scene(settings: dict[str, Any]) -> _Scene:
    """Build a scene of the gallery in a new empty file, from a road's settings and seed."""
    empty_file()
    parameters = sample_road(RoadScenario.from_dict(settings["road"]), settings["seed"])
    build_road(BuildRequest(parameters, _TOLERANCE))
    pictures.light(_DAYLIGHT)
    add_landscape(bpy.context.scene, parameters, _ROAD_MATRIX)
    return _Scene(parameters, Lawn.of(bpy.context.scene, _ROAD_MATRIX))


def _shown_objects(parameters: RoadParameters) -> Iterator[tuple[str, str]]:
    """Yield (kind, id) of the objects to show close up; a kind is the type and its species, model or variant."""
    for key, item in parameters.objects.items():
        name = type(item).__name__
        if name in _NOT_SHOWN or isinstance(item, AlignmentObject):
            continue
        texts = (getattr(item, field, None) for field in ("kind", "model", "species", "profile", "panel"))
        variant = next((text for text in texts if isinstance(text, str)), "")
        species = getattr(item, "species", "")
        yield "-".join(filter(None, (name.lower(), species or variant))), key


def _close_view(parameters: RoadParameters, mesh: SceneMesh, name: str) -> Viewpoint | None:
    """Return a view of an object's faces from the road, at a distance by their size; None if it has none."""
    geometry = RoadGeometry(parameters)
    corners = mesh.vertices[mesh.triangles[geometry.numbers.belong(name, mesh.instance_id)]].reshape(-1, 3)
    if not len(corners):
        return None
    station, offset = geometry.alignment.project(corners[:, :2].astype(np.float64))
    # Of a long or scattered object only a piece around its middle is shown.
    anchor = np.argmin(np.abs(station - np.median(station)))
    is_near = np.linalg.norm(corners[:, :2] - corners[anchor, :2], axis=1) < _CLOSE_RADIUS
    near_corners, anchor_station, offset = corners[is_near], station[anchor], offset[is_near]
    minimum, maximum = near_corners.min(axis=0), near_corners.max(axis=0)
    centre = (minimum + maximum) / 2.0
    # Far enough for a long piece, and for a tall one in a wide picture; the factors are chosen.
    distance = max(
        2.2, 1.25 * min(float(np.linalg.norm(maximum - minimum)), 24.0), 2.4 * float(maximum[2] - minimum[2])
    )
    heading = float(geometry.alignment.heading(np.array([anchor_station]))[0])
    side = -1.0 if np.median(offset) < 0.0 else 1.0
    # Seen as by approaching traffic: from in front of it, and from the road's side.
    travel_direction = 1.0 if side < 0.0 else -1.0
    forward = Vector((math.cos(heading), math.sin(heading), 0.0))
    left_direction = Vector((-forward.y, forward.x, 0.0))
    eye_side = -side if abs(np.median(offset)) > 1.5 else 1.0
    eye = (
        Vector(centre.tolist())
        - forward * (0.8 * travel_direction * distance)
        + left_direction * (0.6 * eye_side * distance)
    )
    eye.z += 0.25 * distance
    return Viewpoint(np.array(eye), centre, 40.0)


def _material_pictures(folder: Path, quality: Quality, only: str, say: Callable[[str], None]) -> list[Path]:
    """Render pictures of cubes of all materials, lit and one per layer as plain colour; return the paths."""
    layers = [layer for layer in ("lit", *LAYERS) if only in f"materials-{layer}"]
    if not layers:
        return []
    empty_file()
    pictures.light(_DAYLIGHT)
    names = [name for name in materials() if name != "unknown"]
    columns = math.ceil(math.sqrt(len(names) * 1.6))
    for index, name in enumerate(names):
        _cube(name, index % columns, index // columns)
    rows = math.ceil(len(names) / columns)
    centre = Vector((_PITCH * (columns - 1) / 2.0, 0.0, -_PITCH * (rows - 1) / 2.0 - 0.1))
    bpy.ops.mesh.primitive_plane_add(size=200.0, location=(0.0, 2.0, 0.0), rotation=(math.pi / 2.0, 0.0, 0.0))
    bpy.context.object.data.materials.append(material("unknown"))
    # Far enough for the whole wall of cubes in a picture of 16 : 9.
    distance = 1.1 * _PITCH * max(columns, rows * 16.0 / 9.0) * 60.0 / 36.0
    pictures.camera(centre + Vector((0.12 * distance, -distance, 0.14 * distance)), centre, 60.0)
    paths = []
    for layer in layers:
        if layer != "lit":
            _show_layer(layer)
        paths.append(_render(folder / f"materials-{layer}.png", quality, say))
    return paths


def _cube(name: str, column: int, row: int) -> None:
    """Add a cube of one material, with its name below, at a column and row of the wall to the scene."""
    place = Vector((_PITCH * column, 0.0, -_PITCH * row))
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place)
    cube = bpy.context.object.data
    cube.materials.append(material(name))
    for key, value in _ON_CUBES.items():
        attribute(cube, key, np.repeat([value], len(cube.vertices), axis=0))
    text_place = place + Vector((-0.5, -0.5, -0.72))
    bpy.ops.object.text_add(location=text_place, rotation=(math.pi / 2.0, 0.0, 0.0))
    bpy.context.object.data.body, bpy.context.object.data.size = name.replace("_", " "), 0.15


def _show_layer(layer: str) -> None:
    """Make every material of the file emit the values of one of its layers, in place."""
    for item in bpy.data.materials:
        if PROPERTY in item:
            nodes, links = item.node_tree.nodes, item.node_tree.links
            source = next(node for node in nodes if node.type == "OUTPUT_AOV" and node.aov_name == layer)
            socket = source.inputs["Color" if LAYERS[layer] == "COLOR" else "Value"]
            emission = nodes.get("Layer") or nodes.new("ShaderNodeEmission")
            emission.name = "Layer"
            if socket.links:
                links.new(socket.links[0].from_socket, emission.inputs["Color"])
            elif LAYERS[layer] == "COLOR":
                emission.inputs["Color"].default_value = socket.default_value
            else:
                emission.inputs["Color"].default_value = (*[socket.default_value] * 3, 1.0)
            output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
            links.new(emission.outputs[0], output.inputs["Surface"])


def _render(path: Path, quality: Quality, say: Callable[[str], None]) -> Path:
    """Render the scene to a PNG file, which appears only when it is complete; report and return its path."""
    with made_folder(path.parent), scratch_folder(path.parent) as folder:
        pictures.render(folder / path.name, quality.size, quality.samples)
        (folder / path.name).replace(path)
    say(str(path))
    return path
