"""Everything seen of a road: the evaluated model's triangles, and the points of a sparse scan with their colours."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
import laspy
import numpy as np
from mathutils import Matrix

from synthroads_addon.blender.model.edits import attribute_of, vertices_of
from synthroads_addon.blender.views.landscape import add_landscape, remove_landscape
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scenario.scenario import Scenario

Look = dict[str, str]
"""Name of what is seen -> digest of it."""
LABEL = "instance_id"
"""Name of numbers that only say which object something is of."""


def look_at(scenario: Scenario, parameters: RoadParameters) -> Look:
    """Build a road as a scenario asks for it, scan it, and return what is seen; for the main thread."""
    scene = RoadScene.of(scenario, RoadGeometry(parameters))
    scene.build()
    seen = look_at_model(scene.read()) | {f"points.{name}": value for name, value in look_at_scan(scene).items()}
    return seen | look_at_landscape(parameters)


def look_at_landscape(parameters: RoadParameters) -> Look:
    """Return what pictures show of a road's landscape; nothing where it has none."""
    made = add_landscape(bpy.context.scene, parameters, Matrix.Identity(4))
    seen: Look = {}
    for kind, item in made.items():
        arrays: dict[str, Any] = {"corners": vertices_of(item.data)}
        arrays["material"] = [polygon.material_index for polygon in item.data.polygons]
        arrays |= {name: attribute_of(item.data, name) for name in ("turn", "crown", "station")}
        seen |= {f"landscape.{kind}.{name}": value for name, value in _digests(arrays).items()}
    remove_landscape(bpy.context.scene)
    return seen


def look_at_model(scene: ScannedScene) -> Look:
    """Return what is seen of a scene: what stands, and each thing that moves with its way through the first second."""
    seen = {f"model.{name}": value for name, value in look_at_mesh(scene.static).items()}
    for number, body in enumerate(scene.moving):
        way = np.concatenate([array.ravel() for array in body.motion.pose(np.array([0.0, 1.0]))])
        mesh = look_at_mesh(body.mesh) | _digests({"way": way})
        seen |= {f"model.moving {number}.{name}": value for name, value in mesh.items()}
    return seen


def look_at_mesh(mesh: SceneMesh) -> Look:
    """Return what is seen of a mesh: corners, classes, numbers, materials by name, and where it is on the map."""
    names = np.array(mesh.materials or [""], "U64")
    return _digests(
        {
            "corners": mesh.vertices[mesh.triangles],
            "class_id": mesh.class_id,
            "instance_id": mesh.instance_id,
            "material": names[mesh.material],
            "origin": mesh.origin,
        }
    )


def look_at_scan(scene: RoadScene) -> Look:
    """Scan a scene and return what is seen of the points."""
    blocks = CollectedBlocks()
    record(scene.plan(), blocks)
    names = {name for block in blocks.results for name in block.points.attributes()}
    return _digests(
        {name: np.concatenate([block.points.attributes()[name] for block in blocks.results]) for name in names}
    )


def _digests(arrays: Mapping[str, Any]) -> Look:
    return {name: hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest() for name, array in arrays.items()}


def changes(before: Look, after: Look) -> set[str]:
    """Return the names of what is seen otherwise, or on one side only."""
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}


def look_at_cloud(scenario: Scenario, parameters: RoadParameters, folder: Path) -> Look:
    """Write the cloud of a road to a new folder and return what is seen in the file."""
    folder.mkdir(parents=True)
    road = folder / "road.json"
    road.write_text(parameters.to_json(), encoding="utf-8")
    wanted = scenario.model_copy(update={"outputs": ("cloud",)})
    generate(Job(wanted, folder / "out", road))
    cloud = laspy.read(folder / "out" / "cloud.laz")
    return _digests({name: np.asarray(cloud[name]) for name in cloud.point_format.dimension_names})


def look_at_files(scenario: Scenario, parameters: RoadParameters, folder: Path) -> Look:
    """Write all files of a job on a road to a new folder and return them but the report, which has times."""
    folder.mkdir(parents=True)
    road = folder / "road.json"
    road.write_text(parameters.to_json(), encoding="utf-8")
    generate(Job(scenario, folder / "out", road))
    files = sorted(path for path in (folder / "out").rglob("*") if path.is_file() and path.name != "report.json")
    return {str(path.relative_to(folder / "out")): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
