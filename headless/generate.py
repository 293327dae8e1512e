"""Make a road, scan it, and write the labelled cloud with the parameters that it was made from."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import detail
from headless.options import (
    AXIS_FILES,
    add_allow_large_argument,
    add_axis_name_argument,
    add_changes_argument,
    add_choice_arguments,
    add_cloud_arguments,
    add_device_argument,
    add_formats_argument,
    add_twin_argument,
    all_changes,
    axis_place,
    choice_changes,
    choice_summary,
    whole_number,
)
from headless.progress import progress_bar
from synthroads_addon.base.changes import parse_change
from synthroads_addon.base.errors import InputError
from synthroads_addon.scenario.scenario import Scenario, load_scenario, scenario_names
from synthroads_addon.scenario.without import EFFECTS, scenario_without

_FIELDS = {
    "device": "scan.device",
    "seed": "seed",
    "fidelity": "fidelity",
    "cloud": "cloud.formats",
    "sweeps": "sweeps.formats",
    "twin": "twin",
    "allow_large": "scan.most_pulses",
}
"""Arguments that are short for fields of the scenario."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads generate` to its parser."""
    names = ", ".join(scenario_names())
    text = f"{names}, or a .json file (%(default)s)"
    parser.add_argument("--scenario", default="rq31-600m", metavar="NAME_OR_FILE", help=text)
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the files")
    add_device_argument(parser)
    seed = whole_number(2**63 - 1, "2^63 - 1")
    parser.add_argument("--seed", type=seed, metavar="N", help="seed of all random choices (the scenario's own)")
    text = "speed against accuracy, as a preset (the scenario's own)"
    parser.add_argument("--fidelity", choices=("draft", "standard", "high"), help=text)
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="take this parameter set, and sample none")
    parser.add_argument("--axis", type=Path, metavar="FILE", help=AXIS_FILES)
    text = "file whose whole road is taken: all of OpenDRIVE and of our own IFC, of LandXML the superelevation as well"
    parser.add_argument("--road", type=Path, metavar="FILE", help=text)
    add_axis_name_argument(parser)
    add_choice_arguments(parser)
    add_allow_large_argument(parser)
    add_cloud_arguments(parser)
    add_twin_argument(parser)
    add_changes_argument(parser)
    add_without_argument(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")
    add_formats_argument(parser, "cloud", "sweeps", "scene", "twin")


def add_without_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--without``, which leaves an effect of the sensor out."""
    text = f"leave out this effect; rays and seed stay the same (can be repeated): {', '.join(EFFECTS)}"
    parser.add_argument("--without", action="append", default=[], choices=list(EFFECTS), metavar="EFFECT", help=text)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads generate`; return exit code, the job's report as JSON data and printed text."""
    start = time.perf_counter()
    _check_road_changes(arguments)
    scenario = load_scenario(arguments.scenario, [*choice_changes(arguments), *all_changes(arguments, _FIELDS)])
    scenario = scenario_without(scenario, arguments.without)
    detail("scenario", scenario.to_dict())
    from synthroads_addon.jobs.generate import Job, generate

    files = (arguments.output, arguments.parameters, arguments.axis, arguments.axis_name, axis_place(arguments))
    job = Job(scenario, *files, arguments.overwrite, arguments.road, new_file=True, begun=start)
    report = generate(job, progress_bar(arguments))
    return 0, report, summary(report, arguments.output)


def _check_road_changes(arguments: argparse.Namespace) -> None:
    """Raise an InputError if ``--set`` changes what of the road the given axis or parameters say themselves."""
    if not (arguments.parameters or arguments.axis or arguments.road):
        return
    from synthroads_addon.jobs.generate import FROM_AXIS, FROM_ROAD
    from synthroads_addon.road_files.read import format_of

    option = "--parameters" if arguments.parameters else "--axis" if arguments.axis else "--road"
    # LandXML has no lanes.
    fields = FROM_ROAD if arguments.road and format_of(arguments.road) != "LandXML" else FROM_AXIS
    for change in arguments.changes:
        for name in _road_fields(change):
            if arguments.parameters or name in fields:
                file_content = "course and place of the road" if arguments.axis else "the whole road"
                text = (
                    f"road.{name} has no effect with {option}, whose file says {file_content}; leave one of the two out"
                )
                raise InputError("--set", change, text)


def _road_fields(change: str) -> list[str]:
    """Return the names of the road's fields that ``path=value`` sets."""
    path, value = parse_change(change, Scenario)
    part, _, rest = path.partition(".")
    if part != "road":
        return []
    return [rest.partition(".")[0]] if rest else list(value) if isinstance(value, dict) else []


def summary(report: dict[str, Any], output: Path) -> str:
    """Return a job's report as text: warnings, choice, points, seconds and memory of each stage, output folder."""
    counts = report.get("counts", {})
    lines = [*(f"warning: {text}" for text in report.get("warnings", [])), *choice_summary(report)]
    if "axis" in report:
        from synthroads_addon.jobs.axis_source import axis_summary

        lines += [axis_summary(report["axis"]), *report["axis"].get("summary", [])]
    if "points" in counts:
        lines.append(f"{counts['points']:,} points from {counts['pulses']:,} pulses, {counts['triangles']:,} triangles")
        if counts["below_threshold"] > counts["points"]:
            lines.append(
                f"{counts['below_threshold']:,} echoes were too weak to be detected: "
                f"range, weather (attenuation {counts['attenuation']:.3g} per metre) or dark surfaces"
            )
    for name, stage in report["stages"].items():
        lines.append(f"  {name:<12} {stage['seconds']:8.2f} s   peak {stage['peak_memory_mb'] or 0:7.0f} MB")
    lines.append(f"  {'in all':<12} {report['seconds']:8.2f} s")
    lines.append(f"written to {output}")
    return "\n".join(lines)


if __name__ == "__main__":
    entry("generate")
