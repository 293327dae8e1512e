"""Scan a scene that is there already: .blend, .glb, .gltf, .obj, .ply, .stl, .fbx or .usd; the file is only read."""

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
    add_device_argument,
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
    where = parser.add_mutually_exclusive_group()
    text = "follow this line, CSV (x, y, z) or GeoJSON (the scene's road, else straight over its middle)"
    where.add_argument("--path", type=Path, metavar="FILE", help=text)
    where.add_argument("--trajectory", metavar="FILE", help="CSV: time, x, y, z, roll, pitch, heading")
    text = "stand here, on the surface or with the scanner at Z (can be repeated; --tripod=-4,7 where X < 0)"
    place = numbers((2, 3), "X,Y or X,Y,Z")
    where.add_argument("--tripod", type=place, action="append", default=[], metavar="X,Y[,Z]", help=text)
    text = "flight height, or that of the scanner on a tripod, m (the platform's usual one)"
    parser.add_argument("--height", type=float, metavar="M", help=text)
    parser.add_argument("--speed", type=float, metavar="M/S", help="speed over ground, m/s (the platform's usual one)")
    parser.add_argument("--rays", type=int, metavar="N", help="rays per pulse (the fidelity's own)")
    parser.add_argument("--classes", type=Path, metavar="FILE", help="JSON: classes by names (none), see docs/scan.md")
    text = "the road that is scanned, by its root's name, where a .blend has several (the one that is active in it)"
    parser.add_argument("--road", metavar="NAME", help=text)
    text = f"take the scan from it: {names}, or a .json file (the defaults of a scenario)"
    parser.add_argument("--scenario", metavar="NAME_OR_FILE", help=text)
    add_changes_argument(parser)
    generate.add_without_argument(parser)
    parser.add_argument("--seed", type=int, metavar="N", help="seed of the noise (the scenario's own)")
    text = "point on the trade-off (the scenario's own)"
    parser.add_argument("--fidelity", choices=("draft", "standard", "high"), help=text)
    add_choice_arguments(parser)
    add_allow_large_argument(parser)
    parser.add_argument("--epsg", type=int, metavar="N", help="coordinate system of the map (that of the scene's road)")
    text = "map coordinates of the scene's origin (0,0,0); auto: the scene's own are the map's"
    parser.add_argument("--origin", type=_origin, metavar="X,Y,Z", help=text)
    parser.add_argument("--up", choices=("y", "z"), help="what points up in .obj (y), .ply and .stl (z)")
    text = "whose state of the scene: that of renders, or of the viewport (render)"
    parser.add_argument("--visible", choices=("render", "viewport"), default="render", help=text)
    text = "further folder with pictures and parts that a scene other than a .blend names (its own; can be repeated)"
    parser.add_argument("--also-from", type=Path, action="append", default=[], metavar="DIR", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def _origin(text: str) -> tuple[float, ...] | str:
    return text if text == "auto" else numbers((3,), "X,Y,Z, or auto,")(text)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads scan`; return exit code, the job's report as JSON data and printed text."""
    begun = time.perf_counter()
    scenario = scenario_without(scenario_of(arguments), arguments.without)
    detail("scenario", scenario.to_dict())
    from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene

    same = {name: getattr(arguments, name) for name in _SAME}
    job = SceneScan(
        scenario=scenario, tripods=tuple(arguments.tripod), also_from=tuple(arguments.also_from), begun=begun, **same
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
