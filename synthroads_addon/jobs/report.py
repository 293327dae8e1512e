"""``report.json``: what every job writes about itself."""

from __future__ import annotations

import platform as machine
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import laspy
import numpy as np

from ..base.machine import available_cores
from ..base.progress import StageTimer
from ..base.schema import canonical_json
from ..base.version import generator, version
from ..scenario.scenario import Scenario

FILES = {
    "parameters": ("parameters.json",),
    "cloud": ("cloud.laz",),
    "centerline": ("centerline.geojson",),
    "scene": ("scene.blend",),
    "previews": ("preview_class.png", "preview_intensity.png", "preview_rgb.png"),
}
"""The files that each output of a scenario stands for, with one format of the cloud; see `file_names`."""


def file_names(scenario: Scenario, outputs: Sequence[str]) -> list[str]:
    """Return the names of all files that outputs stand for, and of the report, which is always written."""
    files = FILES | {"cloud": scenario.cloud.file_names()}
    return [name for output in outputs for name in files[output]] + ["report.json"]


def report_header() -> dict[str, Any]:
    """Return the head of every job's report."""
    return {"type": "Report", "generator": generator()}


def report_footer(scenario: Scenario, timer: StageTimer) -> dict[str, Any]:
    """Return the part of the report that is the same for every job: seed, settings, scenario, stages, versions."""
    bpy = sys.modules.get("bpy")  # not there if nothing needed Blender
    return {
        "seed": scenario.seed,
        "settings": asdict(scenario.settings()),
        "scenario": scenario.to_dict(),
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


def empty_scan_warnings(counts: Mapping[str, Any]) -> list[str]:
    """Return what to warn of where a scan has no point; nothing where nothing was scanned."""
    if counts.get("points", 1):
        return []
    return ["not one pulse came back: is the scene within the scanner's range and field of view?"]


def write_report(folder: Path, report: dict[str, Any]) -> dict[str, Any]:
    """Write ``report.json`` and return what it holds."""
    (folder / "report.json").write_text(canonical_json(report), encoding="utf-8")
    return report
