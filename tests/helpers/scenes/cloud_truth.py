"""A scan of the panel compared with the truth that is written with it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters, read_parameters
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.panel_road import choose
from tests.helpers.scenes.small_road import PARTS, TOLERANCE

EXACT = 0.001
"""Largest difference of a place from the one that was meant, m."""
_FARTHEST = 0.003
"""Nearly all points of a thing are nearer to its surface, m: a face seen edge-on is met beyond its edge by rays of 32
bits. The few that are farther off are pulses that met a window and what is right behind it."""
_SAMPLE = 300
"""So many points of each thing are compared."""


def scan(folder: Path, name: str, scanner: str, kind: str = "npz") -> Path:
    """Scan the shown road from the panel, without noise; return the folder of the files."""
    panel = bpy.context.scene.synthroads
    panel.show_scenario(load_scenario("rq31-600m-even"))
    choose(panel, **{"scan.device": scanner, "scan.relief": 0.0, "scan.traffic_speed_factor": 0.0})
    choose(panel, **{"scan.own_rays_per_pulse": True, "scan.rays_per_pulse": "1", "colour.source": "material"})
    choose(panel, **{"scan.platform.lateral_offsets": "0", "scan.platform.speed": 20.0, "overwrite": True})
    panel.outputs, panel.twin, panel.cloud.formats = {"parameters", "cloud"}, {"geojson"}, {kind}
    panel.output = str(folder / name)
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    return folder / name


@dataclass(frozen=True)
class Written:
    """The files of a scan, read back.

    Attributes:
        folder: of the files.
        by_instance: points (N, 3) of the cloud by instance number, map coordinates.
        classes: of the points, by instance number.
        parameters: the written road; None if there is none.
        report: the report.
        twin: features of the semantic model by id; the first of each.
    """

    folder: Path
    by_instance: dict[int, np.ndarray]
    classes: dict[int, set[int]]
    parameters: RoadParameters | None
    report: dict[str, Any]
    twin: dict[str, Any]

    @classmethod
    def read(cls, folder: Path) -> Written:
        """Read it back."""
        with open_cloud(next(folder.glob("cloud.*"))) as reader:
            blocks = list(reader.blocks())
        xyz, numbers, classes = (
            np.concatenate([getattr(block, name) for block in blocks]) for name in ("xyz", "instance_id", "class_id")
        )
        by_instance = {int(number): xyz[numbers == number] for number in np.unique(numbers)}
        known = folder / "parameters.json"
        model = folder / "twin.geojson"
        features = json.loads(model.read_text())["features"] if model.exists() else []
        return cls(
            folder,
            by_instance,
            {number: set(classes[numbers == number].tolist()) for number in by_instance},
            read_parameters(known) if known.exists() else None,
            json.loads((folder / "report.json").read_text()),
            {feature["properties"]["id"]: feature for feature in reversed(features)},
        )

    def by_hand(self) -> set[str]:
        """Return the names of the objects that the report calls edited by hand."""
        return {entry["object"] for entry in self.report.get("edited_by_hand", [])}

    def foreign(self) -> set[int]:
        """Check that the points of all that the parameters know lie on it; return the other numbers in the cloud.

        The road is built anew from them in an empty file.
        """
        assert self.parameters is not None
        empty_file()
        build_road(BuildRequest(self.parameters, TOLERANCE, 0.0, PARTS))
        mesh, numbers = scene_mesh(), RoadGeometry(self.parameters).numbers
        known = {number for number in self.by_instance if numbers.owner(number) is not None}
        assert len(known) > 5
        for number in known:
            assert self.lies_on(mesh, number, mesh.instance_id == number), numbers.name_of(number)
        return set(self.by_instance) - known

    def lies_on(self, mesh: SceneMesh, number: int, which: np.ndarray | None = None) -> bool:
        """Return whether the points of a number lie on some triangles (T,) of a mesh; on any if None."""
        triangles = mesh.triangles if which is None else mesh.triangles[which]
        if not len(triangles):
            return False
        tree = BVHTree.FromPolygons(mesh.vertices.tolist(), triangles.tolist())
        points = self.by_instance[number] - mesh.origin
        away = [tree.find_nearest(Vector(point))[3] for point in points[:: 1 + len(points) // _SAMPLE]]
        return bool(np.median(away) < EXACT and np.percentile(away, 95.0) < _FARTHEST)

    def seen(self, names: set[str]) -> set[str]:
        """Return which things of the parameters the cloud has points of."""
        assert self.parameters is not None
        return {name for name in names if self.parameters.objects[name].instance in self.by_instance}

    def classes_of(self, numbers: set[int]) -> set[int]:
        """Return the classes of the points of some numbers."""
        return {kind for number in numbers for kind in self.classes[number]}
