"""A long road by section: each is built, scanned and dropped, so that memory doesn't grow with the road.

The points are those of the road built whole. They come section by section, and within one in the order of time.
"""

import gc
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Float
from ...base.machine import release_memory
from ...base.progress import StageTimer
from ...blender.materials import RoadMaterials
from ...blender.model.build import build_road, remove_road
from ...blender.scene.evaluated import scene_mesh
from ...blender.scene.left_out import material_warnings
from ...blender.scene.vehicle_meshes import VehicleMeshes
from ...blender.services import BlenderServices
from ...blender.things.model_builder import BuildRequest
from ...road.geometry import RoadGeometry
from ...scanning.plan import ScanPlan
from ...scanning.platforms.stretches import PathStretches
from ...scanning.scene.motion import ScannedScene, ShiftedMotion, lane_motions
from ...scanning.sections import RoadSection, shadow_length, strip_parts, vehicles_through
from ...scanning.sections import sections as sections_of_scan
from .arrays import ArraySink
from .plan import Site
from .sink import record_cloud
from .sweeps import sight_of_sweeps


def scan_by_section(
    site: Site, road: RoadGeometry, to: Path | ArraySink, timer: StageTimer
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Build and scan a road section by section into a folder's files or into memory; only in the main thread.

    A road in the open scene is replaced; afterwards there is none.

    Returns:
        the counts, as JSON data; warnings about what isn't scanned as it is declared.

    Raises:
        InputError: see `plan_scan` and `check_colour`.
    """
    work = SectionScan(site, road)
    sink = site.sink(to, np.array(road.parameters.transform.translate))
    with closing(work.plans(timer)) as plans:
        counts = record_cloud(plans, sink, timer)
    return counts | {"sections": work.section_count}, tuple(work.warnings)


class SectionScan:
    """Plans of the scan of a road by sections, each of which is built, scanned and removed in turn.

    Args:
        site: of the whole road's scan.
        road: the road.

    Attributes:
        cut: the scan's blocks.
        section_count: number of sections that are done.
        warnings: what of them isn't scanned as it is declared, each once.
    """

    def __init__(self, site: Site, road: RoadGeometry) -> None:
        self._site, self._scenario, self._road, self.cut = site, site.scenario, road, site.cut
        motions = lane_motions(road, self._scenario.scan.traffic_speed_factor)
        self._motions = {name: motion for name, motion in motions.items() if not motion.stands}
        self._own_materials = site.inputs.materials
        self._vehicles = VehicleMeshes(RoadMaterials.of(road.parameters, self._own_materials))
        fixed_objects = {name: item for name, item in road.parameters.objects.items() if name not in self._motions}
        self.section_count = 0
        self.warnings: list[str] = []
        self._parameters_of_fixed = road.parameters.model_copy(update={"objects": fixed_objects})

    def sections(self) -> Iterator[RoadSection]:
        """Yield the road's sections from its start to its end; the whole road as one where it isn't cut."""
        road_length = self._road.length
        section_length = self._scenario.section_length(road_length) or road_length
        # Colours are rendered: what throws a shadow into a section must be built with it.
        shadows = shadow_length(self._road) if self._scenario.may_render else 0.0
        # Cameras look farther along the road than the scanner's pulses reach, and boxes are around farther things.
        cameras = self._scenario.scan.cameras
        sight = max(0.0 if cameras is None else cameras.farthest, sight_of_sweeps(self._scenario.sweeps, self.cut.path))
        return sections_of_scan(self.cut, self._road, section_length, shadows + sight)

    def plans(self, timer: StageTimer) -> Generator[ScanPlan, None, None]:
        """Build each section in turn and yield its plan; the section is removed when the next one is asked for."""
        blocks_done, total = 0, self.cut.count()
        gc.collect()  # or what is garbage by now would stay
        gc.freeze()  # what is there before needn't be looked through after each section
        try:
            for section in self.sections():
                shares = blocks_done / total, (blocks_done + len(section.blocks)) / total
                try:
                    yield self.plan(section, timer, shares)
                finally:
                    remove_road()
                    gc.collect()
                    release_memory()
                blocks_done += len(section.blocks)
                self.section_count += 1
        finally:
            gc.unfreeze()

    def plan(self, section: RoadSection, timer: StageTimer, progress: tuple[float, float] = (0.0, 1.0)) -> ScanPlan:
        """Build a section in the open file and return the plan of its blocks of pulses; for progress see `Run`."""
        with timer.stage("model"):
            scene, frame = self._build(section)
        path = PathStretches(self.cut.path, self.cut.path.strips, frame)
        with timer.stage("caster"):
            plan = replace(self._site, path=path).plan(scene, BlenderServices())
        assert plan.layers.request is not None
        seen_from = replace(path, strips=strip_parts(self.cut, section.blocks))
        request = replace(plan.layers.request, path=seen_from, frame=(frame[0], frame[1], frame[2]))
        return replace(
            plan,
            reflection=replace(plan.reflection, frame_origin=frame),
            layers=replace(plan.layers, request=request),
            run=replace(plan.run, chosen_blocks=section.blocks, progress=progress),
        )

    def _build(self, section: RoadSection) -> tuple[ScannedScene, Float]:
        """Build a section; return its scene with passing vehicles, and its frame's origin (3,) in the road's, m."""
        settings, parameters = self._scenario.settings(), self._road.parameters
        stretch = (section.build_start, section.build_end)
        tolerance, detail = settings.tolerance, settings.vegetation_detail
        request = BuildRequest(
            self._parameters_of_fixed, tolerance, detail, None, stretch, self._road, self._own_materials
        )
        model = build_road(request)
        frame = model.origin - np.array(parameters.transform.translate)
        class_ids = self._site.inputs.scheme.source_ids()
        static_mesh = scene_mesh(objects=list(model.objects.values()), class_ids=class_ids)
        section_warnings = material_warnings(dict.fromkeys(static_mesh.materials, ()))
        self.warnings += [text for text in section_warnings if text not in self.warnings]
        motions_here = vehicles_through(section, self.cut, self._motions, self._scenario.scan.traffic_speed_factor)
        vehicles = {name: motion.vehicle for name, motion in motions_here.items()}
        motions = {name: ShiftedMotion(motion, frame) for name, motion in motions_here.items()}
        return self._vehicles.with_traffic(static_mesh, vehicles, motions, self._road.numbers.passes), frame
