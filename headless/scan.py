"""Scan an existing scene: .blend, .glb, .gltf, .obj, .ply, .stl, .fbx or .usd; the file isn't changed."""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless import generate
from headless.commands import Outcome, entry
from headless.messages import detail
from headless.options import (
    add_allow_large_argument,
    add_changes_argument,
    add_choice_arguments,
    add_cloud_arguments,
    add_device_argument,
    add_formats_argument,
    all_changes,
    choice_changes,
    numbers,
)
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.scenario.scenario import Scenario, load_scenario, scenario_changes, scenario_names, with_changes
from synthroads_addon.scenario.without import scenario_without

_FIELDS = {
    "device": "scan.device",
    "height": "scan.platform.height",
    "speed": "scan.platform.speed",
    "rays": "scan.rays_per_pulse",
    "seed": "seed",
    "fidelity": "fidelity",
    "cloud": "cloud.formats",
    "sweeps": "sweeps.formats",
    "allow_large": "scan.most_pulses",
}
"""Arguments that are short for fields of the scenario."""
_SAME = ("output", "scene", "path", "classes", "road", "epsg", "origin", "up", "visible", "overwrite")
"""Arguments that the scan of a scene has under the same name."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads scan` to its parser."""
    names = ", ".join(scenario_names())
    parser.add_argument("scene", type=Path, metavar="SCENE", help="file with the scene")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the files")
    add_device_argument(parser)
    path_group = parser.add_mutually_exclusive_group()
    text = "line to follow, CSV (x, y, z) or GeoJSON (the scene's road, else straight over its middle)"
    path_group.add_argument("--path", type=Path, metavar="FILE", help=text)
    path_group.add_argument(
        "--trajectory", metavar="FILE", help="recorded path, CSV: time, x, y, z, roll, pitch, heading"
    )
    text = "place of a tripod on the surface, or of its scanner if Z is given (can be repeated; X < 0: --tripod=-4,7)"
    place = numbers((2, 3), "X,Y or X,Y,Z")
    path_group.add_argument("--tripod", type=place, action="append", default=[], metavar="X,Y[,Z]", help=text)
    text = "height of the scanner above ground, in flight or on a tripod, m (the platform's usual one)"
    parser.add_argument("--height", type=float, metavar="M", help=text)
    parser.add_argument("--speed", type=float, metavar="M/S", help="speed over ground, m/s (the platform's usual one)")
    parser.add_argument("--rays", type=int, metavar="N", help="rays per pulse (the fidelity's own)")
    parser.add_argument("--classes", type=Path, metavar="FILE", help="JSON: classes by names (none), see docs/scan.md")
    text = "name of the root of the road to scan, if a .blend has several (the active one)"
    parser.add_argument("--road", metavar="NAME", help=text)
    text = f"scenario with the scan's settings: {names}, or a .json file (the defaults of a scenario)"
    parser.add_argument("--scenario", metavar="NAME_OR_FILE", help=text)
    add_cloud_arguments(parser)
    add_changes_argument(parser)
    generate.add_without_argument(parser)
    parser.add_argument("--seed", type=int, metavar="N", help="seed of the noise (the scenario's own)")
    text = "speed against accuracy, as a preset (the scenario's own)"
    parser.add_argument("--fidelity", choices=("draft", "standard", "high"), help=text)
    add_choice_arguments(parser)
    add_allow_large_argument(parser)
    parser.add_argument("--epsg", type=int, metavar="N", help="EPSG code of the map (that of the scene's road)")
    text = "map coordinates of the scene's origin (0,0,0); auto: the scene has map coordinates already"
    parser.add_argument("--origin", type=_origin, metavar="X,Y,Z", help=text)
    parser.add_argument("--up", choices=("y", "z"), help="axis that points up in an .obj (y), .ply or .stl (z)")
    text = "scan the scene as it is in renders, or in the viewport (render)"
    parser.add_argument("--visible", choices=("render", "viewport"), default="render", help=text)
    text = "further folder with files that a scene (not a .blend) refers to (its own folder; can be repeated)"
    parser.add_argument("--also-from", type=Path, action="append", default=[], metavar="DIR", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")
    add_formats_argument(parser, "cloud", "sweeps")


def _origin(text: str) -> tuple[float, ...] | str:
    """Return the scene's origin, or "auto": a type for argparse."""
    return text if text == "auto" else numbers((3,), "X,Y,Z, or auto,")(text)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads scan`; return exit code, the job's report as JSON data and printed text."""
    start = time.perf_counter()
    scenario = scenario_without(scenario_of(arguments), arguments.without)
    detail("scenario", scenario.to_dict())
    from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene

    copied_values = {name: getattr(arguments, name) for name in _SAME}
    job = SceneScan(
        scenario=scenario,
        tripods=tuple(arguments.tripod),
        also_from=tuple(arguments.also_from),
        begun=start,
        **copied_values,
    )
    report = scan_scene(job, progress_bar(arguments))
    return 0, report, summary(report, arguments.output)


def scenario_of(arguments: argparse.Namespace) -> Scenario:
    """Return the scenario that the command line's arguments describe."""
    changes = [*choice_changes(arguments), *all_changes(arguments, _FIELDS)]
    if arguments.trajectory:
        for name in ("height", "speed"):
            if (value := getattr(arguments, name)) is not None:
                raise InputError(f"--{name}", value, "can't be given with --trajectory, which says it")
        changes += ['scan.platform.kind="trajectory"', f"scan.platform.file={json.dumps(arguments.trajectory)}"]
    if arguments.tripod:
        if arguments.speed is not None:
            raise InputError("--speed", arguments.speed, "can't be given with --tripod, which doesn't move")
        changes.append('scan.platform.kind="tripod"')
    if arguments.scenario:
        return load_scenario(arguments.scenario, changes)
    return Scenario.from_dict(with_changes(Scenario().to_dict(), scenario_changes(changes)))


def summary(report: dict[str, Any], output: Path) -> str:
    """Return the report as text: number of points by class, then the summary of `synthroads generate`."""
    counts = report["counts"]
    rows = sorted(counts["points_by_class"].items(), key=lambda row: -row[1])
    lines = [f"  {name:<20} {number:>12,} points" for name, number in rows]
    return "\n".join([*lines, generate.summary(report, output)])


if __name__ == "__main__":
    entry("scan")
