"""`JobFiles`: the files of a job that need no scene, and ``report.json``: what every job writes about itself."""

import platform as machine
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np

from ..base.machine import available_cores
from ..base.progress import StageTimer, in_stage
from ..base.remarks import remarks_so_far
from ..base.schema import canonical_json
from ..base.version import generator, version
from ..cloud.sweeps.registry import sweep_file_names
from ..road.axes.centerline import centerline_geojson
from ..road.geometry import RoadGeometry
from ..road.tessellation import sample_stations
from ..scenario.cloud import STRIPS
from ..scenario.scenario import OF_POINTS, Output, Scenario
from ..twin.formats import twin_file_names, write_twin
from ..twin.scene.registry import scene_file_names

IMAGES = "images"
"""Folder of the images of a scenario's cameras."""
FILES = {
    "parameters": ("parameters.json",),
    "cloud": ("cloud.laz",),
    "centerline": ("centerline.geojson",),
    "scene": ("scene.blend",),
    "previews": ("preview_class.png", "preview_intensity.png", "preview_rgb.png"),
}
"""The files that each output of a scenario stands for, with one format of the cloud; see `JobFiles.names`."""


@dataclass(frozen=True)
class JobFiles:
    """The output files of a job: their names, and writers of those that need no Blender scene.

    Attributes:
        scenario: the job.
        road: whether the job makes a road; else it has no other files than `OF_POINTS`.
    """

    scenario: Scenario
    road: bool = True

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Return the requested outputs; a job without a road has only those made from points."""
        return tuple(name for name in self.scenario.outputs if self.road or name in OF_POINTS)

    @property
    def names(self) -> list[str]:
        """Return the names of all files that the job writes, `report.json` included."""
        scenes = scene_file_names(self.scenario.scene_formats)
        cloud = self.scenario.cloud
        strips = (STRIPS,) if cloud.strip_files else ()
        files = FILES | {"cloud": (*cloud.file_names(), *strips), "scene": scenes}
        twins = twin_file_names(self.scenario.twin) if self.road else []
        images = [IMAGES] if self.scenario.scan.cameras is not None else []
        sweeps = sweep_file_names(self.scenario.sweeps.formats) if set(self.outputs) & set(OF_POINTS) else ()
        return [*(name for output in self.outputs for name in files[output]), *images, *sweeps, "report.json", *twins]

    def write_road(self, folder: Path, road: RoadGeometry, timer: StageTimer) -> None:
        """Write the road's files that need no scene: parameters, centreline and geometric-semantic models."""
        if "parameters" in self.outputs:
            (folder / "parameters.json").write_text(road.parameters.to_json(), encoding="utf-8")
        tolerance = self.scenario.settings().tolerance
        if "centerline" in self.outputs:
            text = canonical_json(centerline_geojson(road, sample_stations(road, tolerance)))
            (folder / "centerline.geojson").write_text(text, encoding="utf-8")
        if self.scenario.twin:
            with timer.stage("twin"):
                stage_progress = in_stage(timer.progress, "twin")
                write_twin(
                    road.parameters, folder, self.scenario.twin, tolerance, self.scenario.ifc, progress=stage_progress
                )

    def write_report(self, folder: Path, content: dict[str, Any], timer: StageTimer) -> dict[str, Any]:
        """Write ``report.json`` into a folder and return its content; the other arguments are those of `report`."""
        report = self.report(content, timer)
        (folder / "report.json").write_text(canonical_json(report), encoding="utf-8")
        return report

    def report(self, content: dict[str, Any], timer: StageTimer) -> dict[str, Any]:
        """Return the content of ``report.json``; warnings and assumptions that are being collected are in it.

        Args:
            content: what is to be said of this job besides what every report has: seed, settings, scenario, stages,
                versions.
            timer: of the job's stages.
        """
        bpy = sys.modules.get("bpy")  # not there if nothing needed Blender
        scenario = self.scenario.to_dict()
        return (
            {"type": "Report", "generator": generator()}
            | content
            | {
                "remarks": remarks_so_far(),
                "seed": self.scenario.seed,
                "settings": asdict(self.scenario.settings()),
                "scenario": {name: value for name, value in scenario.items() if self.road or name != "road"},
                "seconds": round(timer.seconds, 3),
                "stages": timer.stages,
                "versions": {
                    "synthroads": version(),
                    "blender": bpy.app.version_string if bpy else None,
                    "python": machine.python_version(),
                    "numpy": np.__version__,
                    "laspy": laspy.__version__,
                },
                "cores": available_cores(),
            }
        )


def empty_scan_warnings(counts: Mapping[str, Any]) -> list[str]:
    """Return a list with a warning if a scan has no points; empty otherwise, also if nothing was scanned."""
    images_alone = "images" in counts and not counts.get("pulses")
    if counts.get("points", 1) or images_alone:
        return []
    return ["no pulse came back: is the scene within the scanner's range and field of view?"]
