"""Changes of a road: the list between two parameter sets, simple detectors on two clouds, and scores of a detector."""

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import canonical_json

METHODS = ("m3c2", "nearest", "raster")
STATED, ESTIMATED = "stated", "estimated"
"""Words in place of a registration error: that of the second epoch's folder, or what follows from the distances."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads changes` and its tools to the parser."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    diff = tools.add_parser("diff", help="list what differs between two parameter sets of a road")
    diff.add_argument("before", type=Path, metavar="A.json", help="parameter set of the first epoch")
    diff.add_argument("after", type=Path, metavar="B.json", help="parameter set of the second epoch")
    diff.add_argument("--output", type=Path, metavar="FILE", help="list of changes to write (standard output)")
    diff.add_argument("--years", type=float, metavar="YEARS", help="between the two, if known")
    apply = tools.add_parser("apply", help="make a list of changes to a parameter set")
    apply.add_argument("before", type=Path, metavar="A.json", help="parameter set of the first epoch")
    apply.add_argument("changes", type=Path, metavar="CHANGES", help="list of changes (changes.json)")
    apply.add_argument("--output", type=Path, metavar="FILE", help="parameter set to write (standard output)")
    detect = tools.add_parser("detect", help="find changes between two clouds by a simple method")
    detect.add_argument("first", type=Path, metavar="FIRST", help="cloud of the first epoch, or its folder")
    detect.add_argument("second", type=Path, metavar="SECOND", help="cloud of the second epoch, or its folder")
    text = "m3c2 (by py4dgeo), nearest distances, or the difference of rasters (%(default)s)"
    detect.add_argument("--method", choices=METHODS, default="m3c2", help=text)
    detect.add_argument("--output", required=True, type=Path, metavar="FILE", help="distances to write (.npz)")
    detect.add_argument("--radius", type=float, default=0.25, metavar="M", help="radius of the cylinders, m (0.25)")
    text = "standard deviation of the clouds' registration, m; or stated (in the second epoch's registration.json); or "
    text += "estimated, from the distances (%(default)s)"
    detect.add_argument("--registration", type=_registration, default=ESTIMATED, metavar="M", help=text)
    evaluate = tools.add_parser("evaluate", help="judge a detector's distances, labels or list by the truth")
    evaluate.add_argument("truth", type=Path, metavar="TRUTH", help="folder of the second epoch, or its cloud")
    text = "distances or labels per point (.npz, .las, .laz), or a list of changes (.json)"
    evaluate.add_argument("result", type=Path, metavar="RESULT", help=text)
    text = "distance from which a point counts as changed where the result has no limits or labels, m (0.01)"
    evaluate.add_argument("--limit", type=float, default=0.01, metavar="M", help=text)
    evaluate.add_argument("--output", type=Path, metavar="FILE", help="report to write (.json)")
    for tool in (diff, apply, detect, evaluate):
        tool.add_argument("--overwrite", action="store_true", help="replace a file that is already there")


def _registration(text: str) -> float | str:
    """Return a registration error (m), or the word that stands for one; ArgumentTypeError for another text."""
    if text in (STATED, ESTIMATED):
        return text
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a number of metres from 0 on, {STATED} or {ESTIMATED}, not {text!r}")
    return value


def run(arguments: argparse.Namespace) -> Outcome:
    """Run a tool of `synthroads changes`; return exit code, result as JSON data and printed text."""
    actions = {"diff": _diff, "apply": _apply, "detect": _detect}
    return actions.get(arguments.tool, _evaluate)(arguments)


def _write(path: Path, text: str, overwrite: bool) -> None:
    """Write a text to a file; InputError if it is there and may not be replaced."""
    if path.exists() and not overwrite:
        raise InputError("--output", str(path), "is there already: choose another name, or add --overwrite")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _diff(arguments: argparse.Namespace) -> Outcome:
    """Run `changes diff`; return its outcome."""
    from synthroads_addon.road.changes.diff import diff_roads
    from synthroads_addon.road.parameters import read_parameters

    changes = diff_roads(read_parameters(arguments.before), read_parameters(arguments.after), arguments.years)
    if arguments.output is None:
        return 0, changes.to_dict(), changes.to_json().rstrip("\n")
    _write(arguments.output, changes.to_json(), arguments.overwrite)
    lines = [
        f"{change.id}: {change.kind.replace('_', ' ')}{' ' + change.detail if change.detail else ''}, "
        f"{change.size:g} {change.unit.replace('m2', 'm²')}, station {change.extent.start_station:.1f} m"
        for change in changes.changes
    ]
    lines.append(f"{len(changes.changes)} changes written to {arguments.output}")
    return 0, changes.to_dict(), "\n".join(lines)


def _apply(arguments: argparse.Namespace) -> Outcome:
    """Run `changes apply`; return its outcome."""
    from synthroads_addon.road.changes.change import read_changes
    from synthroads_addon.road.changes.edits import apply_changes
    from synthroads_addon.road.parameters import read_parameters

    after = apply_changes(read_parameters(arguments.before), read_changes(arguments.changes))
    if arguments.output is None:
        return 0, after.to_dict(), after.to_json().rstrip("\n")
    _write(arguments.output, after.to_json(), arguments.overwrite)
    return 0, {"output": str(arguments.output)}, f"written to {arguments.output}"


def _detect(arguments: argparse.Namespace) -> Outcome:
    """Run `changes detect`; return its outcome."""
    import numpy as np

    from synthroads_addon.comparison.epochs.detectors import DETECTORS, DetectorSettings
    from synthroads_addon.comparison.epochs.pairs import read_places, stated_registration

    if arguments.output.suffix != ".npz":
        raise InputError("--output", str(arguments.output), "must end with .npz")
    if arguments.output.exists() and not arguments.overwrite:
        raise InputError("--output", str(arguments.output), "is there already: add --overwrite to replace it")
    first, second = read_places(arguments.first), read_places(arguments.second)
    registration = arguments.registration
    if registration == STATED:
        registration = stated_registration(arguments.second)
    settings = DetectorSettings(arguments.radius, None if registration == ESTIMATED else registration)
    result = DETECTORS[arguments.method](first, second, settings)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(arguments.output, distance=result.distance, detection_limit=result.detection_limit)
    beyond = int((np.abs(np.nan_to_num(result.distance)) > np.nan_to_num(result.detection_limit, nan=np.inf)).sum())
    data = {"method": arguments.method, "points": len(second), "beyond_limit": beyond}
    text = f"{beyond:,} of {len(second):,} points are beyond the limit of detection"
    if result.registration is not None:
        data["registration"] = round(result.registration, 6)
        text += f", with a registration error of {1000.0 * result.registration:.1f} mm"
    text += f"; written to {arguments.output}"
    return 0, data, text


def _evaluate(arguments: argparse.Namespace) -> Outcome:
    """Run `changes evaluate`; return its outcome."""
    from synthroads_addon.comparison.epochs.judge import judge_list, judge_points
    from synthroads_addon.comparison.epochs.pairs import read_points, read_result
    from synthroads_addon.road.changes.change import read_changes

    if arguments.result.suffix == ".json":
        listed = arguments.truth if arguments.truth.suffix == ".json" else arguments.truth / "changes.json"
        report = judge_list(read_changes(listed), read_changes(arguments.result))
    else:
        points = read_points(arguments.truth)
        report = judge_points(points, read_result(arguments.result, len(points.xyz)), arguments.limit)
    if arguments.output is not None:
        _write(arguments.output, canonical_json(report), arguments.overwrite)
    return 0, report, summary(report)


def summary(report: dict[str, Any]) -> str:
    """Return the report on a detector as text."""
    lines = []
    if "changed" in report:
        row = report["changed"]
        lines.append(
            f"changed points: IoU {_text(row['iou'])}, precision {_text(row['precision'])}, "
            f"recall {_text(row['recall'])}, false alarms {_text(row['false_alarms'])}"
        )
    if report.get("mean_iou_of_changes") is not None:
        lines.append(f"mean IoU over the kinds of changes: {report['mean_iou_of_changes']:.3f}")
        lines += [f"  {kind:<18} IoU {_text(row['iou'])}" for kind, row in report["kinds"].items()]
    objects = report["objects"]
    lines.append(f"changes: {objects['found']} found, {objects['missed']} missed, {objects['false']} false")
    lines += [f"  {kind:<18} {row['found']} found, {row['missed']} missed" for kind, row in objects["by_kind"].items()]
    for kind, row in report.get("distances", {}).get("by_kind", {}).items():
        lines.append(
            f"  {kind:<18} distances off by {row['bias_mm']:.2f} mm on average, spread {row['spread_mm']:.2f} mm"
        )
    for row in report.get("found_by_size", []):
        size = f"{1000 * row['from_m']:g} to {1000 * row['to_m']:g} mm"
        lines.append(f"  of cells that moved {size}: {100 * row['found']:.1f} % found ({row['cells']} cells)")
    return "\n".join(lines)


def _text(value: float | None) -> str:
    """Return a share as text, a dash for none."""
    return "-" if value is None else f"{value:.3f}"


if __name__ == "__main__":
    entry("changes")
