"""SynthRoads: synthetic motorway scenes, scanned by simulated laser scanners.

Importing this package needs no Blender, and takes no time: what users call most is loaded when it is first asked for.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .base.version import version as version

if TYPE_CHECKING:
    from .cloud.formats.registry import open_cloud as open_cloud
    from .comparison.job import compare as compare
    from .jobs.dataset.cluster import Cluster as Cluster
    from .jobs.dataset.make import make_dataset as make_dataset
    from .jobs.generate import Job as Job
    from .jobs.generate import generate as generate
    from .jobs.scan.arrays import ScanArrays as ScanArrays
    from .jobs.scan_arrays import scan_to_arrays as scan_to_arrays
    from .jobs.scan_scene import SceneScan as SceneScan
    from .jobs.scan_scene import scan_scene as scan_scene
    from .road.parameters import read_parameters as read_parameters
    from .sampling.road import sample_road as sample_road
    from .scenario.scenario import load_scenario as load_scenario
    from .twin.formats import write_twin as write_twin

_PLACES = {
    "Cluster": ".jobs.dataset.cluster",
    "Job": ".jobs.generate",
    "ScanArrays": ".jobs.scan.arrays",
    "SceneScan": ".jobs.scan_scene",
    "compare": ".comparison.job",
    "generate": ".jobs.generate",
    "load_scenario": ".scenario.scenario",
    "make_dataset": ".jobs.dataset.make",
    "open_cloud": ".cloud.formats.registry",
    "read_parameters": ".road.parameters",
    "sample_road": ".sampling.road",
    "scan_scene": ".jobs.scan_scene",
    "scan_to_arrays": ".jobs.scan_arrays",
    "write_twin": ".twin.formats",
}
"""Name -> module that has it."""


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_PLACES[name], __name__), name)
    globals()[name] = value
    return value


def register() -> None:
    """Register the extension's classes with Blender."""
    from . import ui  # needs Blender, which the library doesn't

    ui.register()


def unregister() -> None:
    """Remove the extension's classes from Blender."""
    from . import ui  # see `register`

    ui.unregister()


def console() -> None:
    """Run the command `synthroads`, whatever packages called `headless` or `ml` the working folder may have."""
    beside = str(Path(__file__).parents[1])
    for name in ("headless", "ml"):
        spec = PathFinder.find_spec(name, [beside])
        assert spec, name
        assert spec.loader, name
        sys.modules[name] = module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    import_module("headless.cli").console()
