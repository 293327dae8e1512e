"""Panoptic truth: whether a cloud and the twins of its road have the same instances.

No number of a point may be missing in a twin: it has an entity, or its report says why it has none. The other way round
an instance that a twin has must be in the cloud if it was in reach and not hidden. That is decided by the scan's own
pulses: those that meet the instance, as the twin draws it, before they meet anything else of the scene.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.blender.casters.embree import EmbreeCaster
from synthroads_addon.blender.files import empty_file
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import AlignmentObject, read_parameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.surroundings import Landscape, Vegetation, Vehicle
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scanning.scene.caster import FacePlanes
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.files.cityjson_files import read_city, triangles_of_rings
from tests.helpers.files.twin_reports import TwinReport, read_report
from tests.helpers.scenes.scan_scenes import mesh_of

NEAR = 0.05
"""Something of the scene this much (m) before an instance hides it; less is the instance itself."""
ENOUGH, ENOUGH_LEAVES = 30, 400
"""Pulses that meet an instance freely: so many give a point. A plant's crown is full of gaps."""


@dataclass
class PanopticSet:
    """A cloud, its twins, and the scan that made it."""

    road: RoadGeometry
    cloud: set[int]
    reports: dict[str, TwinReport]
    plan: ScanPlan
    scene: SceneMesh
    traffic: bool
    folder: Path

    def unknown(self) -> dict[str, list[str | None]]:
        """Return the ids of the cloud's instances that each twin lacks without saying so."""
        names = self.road.numbers.name_of
        missing = {
            key: [names(number) for number in sorted(self.cloud) if not report.knows(number)]
            for key, report in self.reports.items()
        }
        return {key: found for key, found in missing.items() if found}

    def not_in_the_scene(self) -> list[str | None]:
        """Return the ids of what the twins have and no face of the scene is of."""
        faces = set(np.unique(self.plan.target.instance_id).tolist())
        return [self.road.numbers.name_of(number) for number in sorted(self.solid_numbers() - faces)]

    def solid_numbers(self) -> set[int]:
        """Return the numbers that any twin has an entity of, and that faces can be of."""
        objects = self.road.parameters.objects
        found: set[int] = set().union(*(report.entities for report in self.reports.values()))
        whole = (AlignmentObject, Landscape, Vegetation)
        bare = {item.instance for item in objects.values() if isinstance(item, whole)}
        lines = self.road.parameters.of_type(LineMarking).values()
        return found - bare - {line.instance for line in lines if line.dash_length}

    def met(self) -> dict[int, int]:
        """Return by how many pulses each instance that the cloud lacks is met freely; 0 is left out."""
        vehicles = self.road.parameters.of_type(Vehicle).values()
        moving = {item.instance for item in vehicles if item.speed > 0.0 and self.traffic}
        lacking = sorted(self.solid_numbers() - self.cloud - moving)
        mesh = self._twin_mesh(lacking)
        if not len(mesh):
            return {}
        caster, planes = EmbreeCaster(mesh), FacePlanes(mesh)
        found: dict[int, int] = {}
        scan, most = BlockScan(self.plan), self.plan.setting.maximum_range
        for strip, block in self.plan.blocks():
            first, count = self.plan.cut.pulse_span(strip, block)
            poses = scan.emitter.poses_between(
                strip, *(self.plan.cut.time(strip, n) for n in (first, first + count - 1))
            )
            pulses = scan.emitter.emit(strip, poses, None, first, count)
            rays = [np.ascontiguousarray(one.T, dtype=np.float32) for one in (pulses.origin, pulses.direction)]
            face = caster.cast(*rays, most)
            hit = np.flatnonzero(face >= 0)
            if not len(hit):
                continue
            origin, direction = pulses.origin[:, hit], pulses.direction[:, hit]
            away, _ = planes.intersect(face[hit], origin, direction)
            scene = self.plan.target.cast(origin, direction, most, pulses.time[hit], poses.motions)
            free = (scene.distance > away - NEAR) & (away > self.plan.setting.minimum_range)
            for number, times in zip(*np.unique(mesh.instance_id[face[hit[free]]], return_counts=True), strict=True):
                found[int(number)] = found.get(int(number), 0) + int(times)
        return found

    def hidden_truth(self) -> dict[str | None, int]:
        """Return the ids of what was in reach and not hidden, and yet isn't in the cloud, with the pulses."""
        names, objects = self.road.numbers.name_of, self.road.parameters.objects
        found = {}
        for number, times in self.met().items():
            leafy = isinstance(objects[str(self.road.numbers.owner(number))], Vegetation)
            if times >= (ENOUGH_LEAVES if leafy else ENOUGH):
                found[names(number)] = times
        return found

    def _twin_mesh(self, numbers: Iterable[int]) -> SceneMesh:
        """Return the faces of instances as the CityJSON draws them, or as the scene has them where it draws none."""
        city, entities = read_city(self.folder / "twin.city.json"), self.reports["cityjson"].entities
        scene = self.scene
        parts: list[Float] = [np.empty((0, 3, 3))]
        owners: list[int] = []
        for number in numbers:
            owner = self.road.parameters.objects[str(self.road.numbers.owner(number))].instance
            own = entities.get(number, [])
            # A rut is within its carriageway's surface.
            rings = [] if owner != number and own == entities.get(owner) else [r for e in own for r in city.rings(e)]
            if rings:
                triangles = triangles_of_rings(rings) - self.plan.target.origin
            else:
                triangles = scene.vertices[scene.triangles[scene.instance_id == number]].astype(np.float64)
            parts.append(triangles)
            owners += [number] * len(triangles)
        corners = np.concatenate(parts)
        mesh = mesh_of(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        return replace(mesh, instance_id=np.array(owners, dtype=np.uint32))


def panoptic_set(scenario: Scenario, folder: Path) -> PanopticSet:
    """Make a cloud and all twins of a road by one job, and plan the scan again, of the scene that it left."""
    empty_file()
    generate(Job(scenario, folder))
    road = RoadGeometry(read_parameters(folder / "parameters.json"))
    with open_cloud(folder / "cloud.npz") as cloud:
        numbers = np.unique(np.concatenate([part.instance_id for part in cloud.blocks()]))
    reports = {name: read_report(folder, name) for name in scenario.twin}
    shown, traffic = RoadScene.of(scenario, road), scenario.scan.traffic_speed_factor > 0.0
    return PanopticSet(road, set(numbers.tolist()), reports, shown.plan(), shown.read().static, traffic, folder)
