"""A long road by section: each is built, scanned and dropped, so that memory doesn't grow with the road.

The points are those of the road built whole. They come section by section, and within one in the order of time.
"""

from __future__ import annotations

import gc
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.progress import StageTimer
from ...blender.materials import vary
from ...blender.model.build import build_road, remove_road
from ...blender.scene.evaluated import scene_mesh
from ...blender.scene.vehicle_meshes import VehicleMeshes
from ...blender.services import BlenderServices
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...scanning.beam import RINGS, beam_pattern
from ...scanning.blocks import Block, Blocks
from ...scanning.plan import ScanConditions, ScanPlan
from ...scanning.platforms.path import Strip
from ...scanning.platforms.stretches import PathStretches
from ...scanning.scene.motion import LaneMotion, ScannedScene, ShiftedMotion, lane_motions
from ...scanning.sections import Section, sections, shadow_length
from ...scenario.scan import scanner_setting
from ...scenario.scenario import Scenario
from .files import CloudFiles, record_to_files
from .plan import may_render, plan_scan, road_path, road_view

Float = NDArray[np.float64]

_LOOK = 1.0
"""Seconds between two looks at where a vehicle is."""
_AROUND = 60.0
"""A vehicle counts as near a section up to so far beyond it: more than it drives and reaches between two looks, m."""


def scan_by_section(
    scenario: Scenario, parameters: RoadParameters, folder: Path, timer: StageTimer
) -> dict[str, Any]:
    """Build and scan a road section by section; write the cloud and the previews; must run in the main thread.

    A road in the open scene is replaced; afterwards there is none.

    Returns:
        the counts, as JSON data.

    Raises:
        InputError: see `plan_scan` and `check_colour`.
    """
    work = SectionScan(scenario, parameters)
    view = road_view(work.geometry) if "previews" in scenario.outputs else None
    origin = np.array(parameters.transform.translate)
    files = CloudFiles(scenario, folder, origin, work.cut.path.typical_range, parameters.metadata.epsg, view)
    with closing(work.plans(timer)) as plans:
        counts = record_to_files(plans, files, timer)
    return counts | {"sections": work.scanned}


class SectionScan:
    """The plans of a road's sections, which are built one after the other.

    Attributes:
        geometry: the road's.
        cut: the scan's blocks.
        scanned: sections that are done.
    """

    def __init__(self, scenario: Scenario, parameters: RoadParameters) -> None:
        self.scenario, self.parameters = scenario, parameters
        self.geometry = RoadGeometry(parameters)
        setting, path = scanner_setting(scenario.scan), road_path(scenario, self.geometry)
        rings = scenario.scan.beam_rings or RINGS[scenario.settings().rays_per_pulse]
        self.cut = Blocks(setting, path, len(beam_pattern(rings).weights))
        every = lane_motions(self.geometry, scenario.scan.traffic_speed_factor)
        self._motions = {name: motion for name, motion in every.items() if not motion.stands}
        self._vehicles = VehicleMeshes()
        standing = {name: item for name, item in parameters.objects.items() if name not in self._motions}
        self.scanned = 0
        self._standing = parameters.model_copy(update={"objects": standing})

    def sections(self) -> Iterator[Section]:
        """Yield the sections from the road's start to its end."""
        shadows = shadow_length(self.geometry) if may_render(self.scenario) else 0.0
        length = self.geometry.length
        return sections(self.cut, self.geometry, self.scenario.section_length(length) or length, shadows)

    def plans(self, timer: StageTimer) -> Generator[ScanPlan, None, None]:
        """Build one section after the other and yield its plan; afterwards the section is dropped."""
        done, total = 0, self.cut.count()
        for section in self.sections():
            shares = done / total, (done + len(section.blocks)) / total
            try:
                yield replace(self.plan(section, timer), progress=shares)
            finally:
                remove_road()
                gc.collect()
            done += len(section.blocks)
            self.scanned += 1

    def plan(self, section: Section, timer: StageTimer) -> ScanPlan:
        """Build a section and return the plan of its blocks."""
        with timer.stage("model"):
            scene, frame = self._built(section)
        path = PathStretches(self.cut.path, self.cut.path.strips, frame)
        with timer.stage("caster"):
            plan = plan_scan(self.scenario, scene, path, BlenderServices(), ScanConditions.of(self.parameters))
        assert plan.request is not None
        seen_from = replace(path, strips=_strips(self.cut, section.blocks))
        request = replace(plan.request, path=seen_from, frame=(frame[0], frame[1], frame[2]))
        return replace(plan, frame=frame, only=section.blocks, request=request)

    def _built(self, section: Section) -> tuple[ScannedScene, Float]:
        """Return what is scanned of a section, and where its frame begins in the road's."""
        settings, scenario = self.scenario.settings(), self.scenario
        stretch = (section.low, section.high)
        tolerance, detail = settings.tolerance, settings.vegetation_detail
        model = build_road(self._standing, tolerance, detail, stretch=stretch, geometry=self.geometry)
        frame = model.origin - np.array(self.parameters.transform.translate)
        static = scene_mesh(objects=list(model.objects.values()))
        passing = self._passing(section)
        vehicles = {name: motion.vehicle for name, motion in passing.items()}
        motions = {name: ShiftedMotion(motion, frame) for name, motion in passing.items()}
        scene = self._vehicles.with_traffic(static, vehicles, motions)
        # The vehicles' materials may be new.
        vary(self.parameters.materials, self.parameters.environment, scenario.own_materials())
        return scene, frame

    def _passing(self, section: Section) -> dict[str, LaneMotion]:
        """Return the vehicles that drive through a section while it is scanned."""
        times = np.concatenate([
            strip.start_time + np.linspace(0.0, strip.duration, int(np.ceil(strip.duration / self._look)) + 2)
            for strip in _strips(self.cut, section.blocks)
        ])  # fmt: skip
        low, high = section.low - _AROUND, section.high + _AROUND
        found = {}
        for name, motion in self._motions.items():
            station = motion.station(times)
            if ((station > low) & (station < high)).any():
                found[name] = motion
        return found

    @property
    def _look(self) -> float:
        return _LOOK / max(1.0, self.scenario.scan.traffic_speed_factor)


def _strips(cut: Blocks, blocks: tuple[Block, ...]) -> tuple[Strip, ...]:
    """Return the parts of strips that some blocks are, each with its strip's index."""
    parts = []
    for strip in {block[0].index: block[0] for block in blocks}.values():
        own = [number for owner, number in blocks if owner.index == strip.index]
        for run in np.split(own, np.flatnonzero(np.diff(own) > 1) + 1):
            first, _ = cut.pulses_of(strip, int(run[0]))
            last, count = cut.pulses_of(strip, int(run[-1]))
            begin, end = cut.time(strip, first), cut.time(strip, last + count - 1)
            parts.append(Strip(strip.index, begin, end - begin))
    return tuple(parts)
