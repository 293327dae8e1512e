"""A long road by section: each is built, scanned and dropped, so that memory doesn't grow with the road.

The points are those of the road built whole. They come section by section, and within one in the order of time.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.progress import StageTimer
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...scanning.beam import RINGS, beam_pattern
from ...scanning.blocks import Block, Blocks
from ...scanning.platforms.path import Strip
from ...scanning.platforms.shifted import ShiftedMotion, ShiftedPath
from ...scanning.scan import Scan
from ...scanning.scene.motion import LaneMotion, ScannedScene, lane_motions
from ...scanning.sections import Section, sections, shadow_length
from ...scenario.scan import scanner_setting
from ...scenario.scenario import Scenario
from .cloud_files import CloudFiles
from .files import colour_job, make_finish, make_scan, may_render, of_scan, road_path, scan_blocks, top_view

Float = NDArray[np.float64]

_LOOK = 1.0
"""Seconds between two looks at where a vehicle is."""
_AROUND = 60.0
"""A vehicle counts as near a section up to so far beyond it: more than it drives and reaches between two looks, m."""


def check_by_section(scenario: Scenario, length: float) -> None:
    """Refuse what needs the whole model of a road of a length (m) that is built by section."""
    section = scenario.section_length(length)
    if section is not None and scenario.chooses:
        name = "time_budget" if scenario.tolerance is None else "tolerance"
        raise InputError(
            name,
            getattr(scenario, name),
            f"can't be kept on a road of {length:g} m, which is built by sections of {section:g} m: choose on a "
            "shorter road, and set what was chosen",
        )
    if section is not None and "scene" in scenario.outputs:
        raise InputError(
            "outputs",
            list(scenario.outputs),
            f"can't have scene: a road of {length:g} m is built by sections of {section:g} m; leave "
            f"scene out, or set scan.section_length to {length / 2.0:g} or more",
        )


def scan_by_section(
    scenario: Scenario, parameters: RoadParameters, folder: Path, timer: StageTimer
) -> dict[str, Any]:
    """Build and scan a road section by section; write the cloud and the previews; must run in the main thread.

    A road in the open scene is replaced; afterwards there is none.

    Returns:
        the counts, as JSON data.

    Raises:
        InputError: see `make_scan` and `check_colour`.
    """
    work = SectionScan(scenario, parameters)
    view = top_view(work.geometry) if "previews" in scenario.outputs else None
    origin = np.array(parameters.transform.translate)
    files = CloudFiles(scenario, folder, origin, work.cut.path.typical_range, parameters.metadata.epsg, view)
    totals = _Totals()
    with files.opened():
        done, number = 0, len(work.cut.all())
        for section in work.sections():
            with work.prepared(section, timer) as (scan, finish):
                with timer.stage("scan"):
                    for blocks in files.take(scan_blocks(scan, scenario.scan.threads, finish)):
                        done += blocks
                        timer.progress("scan", done / number)
                totals.add(scan, finish.source.report)
    return totals.summary(files)


class SectionScan:
    """What all sections of a road have in common.

    Attributes:
        geometry: the road's.
        cut: the scan's blocks.
    """

    def __init__(self, scenario: Scenario, parameters: RoadParameters) -> None:
        from ...blender.scene.vehicle_meshes import VehicleMeshes

        self.scenario, self.parameters = scenario, parameters
        self.geometry = RoadGeometry(parameters)
        setting, path = scanner_setting(scenario.scan), road_path(scenario, self.geometry)
        rings = scenario.scan.beam_rings or RINGS[scenario.settings().rays_per_pulse]
        self.cut = Blocks(setting, path, len(beam_pattern(rings).weights))
        every = lane_motions(self.geometry, scenario.scan.traffic_speed_factor)
        self._motions = {name: motion for name, motion in every.items() if not motion.stands}
        self._vehicles = VehicleMeshes()
        standing = {name: item for name, item in parameters.objects.items() if name not in self._motions}
        self._standing = parameters.model_copy(update={"objects": standing})

    def sections(self) -> Iterator[Section]:
        """Yield the sections from the road's start to its end."""
        shadows = shadow_length(self.geometry) if may_render(self.scenario) else 0.0
        length = self.geometry.length
        return sections(self.cut, self.geometry, self.scenario.section_length(length) or length, shadows)

    @contextmanager
    def prepared(self, section: Section, timer: StageTimer) -> Iterator[tuple[Scan, Any]]:
        """Build a section; yield its scan and what is done to its points; drop it afterwards."""
        from ...blender.cameras import layer_source
        from ...blender.model.build import remove_road

        try:
            with timer.stage("model"):
                scene, frame = self._built(section)
            environment = self.parameters.environment
            path = ShiftedPath(self.cut.path, frame, self.cut.path.strips)
            with timer.stage("caster"):
                scan = make_scan(self.scenario, scene, path, environment, variation=self.parameters.materials)
                scan = replace(scan, frame=frame, only=section.blocks)
            cameras = colour_job(self.scenario, scan, scene, environment)
            strips = _strips(self.cut, section.blocks)
            cameras = replace(cameras, path=replace(path, strips=strips), frame=(frame[0], frame[1], frame[2]))
            del scene
            with layer_source(cameras, progress=lambda share: timer.progress("images", share)) as source:
                yield scan, make_finish(self.scenario, scan, source)
        finally:
            remove_road()
            gc.collect()

    def _built(self, section: Section) -> tuple[ScannedScene, Float]:
        """Return what is scanned of a section, and where its frame begins in the road's."""
        from ...blender.materials import vary
        from ...blender.model.build import build_road
        from ...blender.scene.evaluated import scene_mesh

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


class _Totals:
    """What is counted over all sections."""

    def __init__(self) -> None:
        self._sections = 0
        self._largest: dict[str, Any] = {"triangles": 0, "vertices": 0}
        self._rendered: dict[str, Any] = {}

    def add(self, scan: Scan, rendered: Mapping[str, Any]) -> None:
        self._sections += 1
        counts = of_scan(scan)
        for name in ("triangles", "vertices"):
            counts[name] = max(counts[name], self._largest[name])
        self._largest = counts
        for name, value in rendered.items():
            number = isinstance(value, int | float) and name in self._rendered
            self._rendered[name] = self._rendered[name] + value if number else value

    def summary(self, files: CloudFiles) -> dict[str, Any]:
        """Return the counts as JSON data: triangles and vertices are those of the largest section."""
        return self._largest | files.summary() | {"rendered": self._rendered, "sections": self._sections}
