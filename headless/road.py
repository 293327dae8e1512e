"""Turn a road of another program's file (OpenDRIVE, LandXML, IFC) or a measured axis into a parameter set.

The file's elements become the road's axis exactly; what it doesn't say comes from the scenario. Exit code 3: what the
file says of the road's surface was left out.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import (
    AXIS_FILES,
    Outcome,
    add_axis_name_argument,
    add_changes_argument,
    all_changes,
    entry,
)
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.remarks import remarks_so_far
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.base.text.table import text_table
from synthroads_addon.scenario.scenario import load_scenario, scenario_names

PARAMETERS, CENTRELINE, REPORT = "parameters.json", "centerline.geojson", "road.json"
PICTURE = "deviation.png"
_FIELDS = {"seed": "seed"}
_LARGEST = 5.0
"""Largest distance from a kink that a rounding may be asked for, m."""
_SURFACE = ("lanes", "lateral profile")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads road` to its parser."""
    parser.add_argument("file", type=Path, metavar="FILE", help=AXIS_FILES)
    parser.add_argument("--list", action="store_true", help="list the file's roads or alignments, and write nothing")
    parser.add_argument("--output", type=Path, metavar="DIR", help="folder for the files (needed without --list)")
    add_axis_name_argument(parser)
    text = "round kinks between elements by two clothoids at most M metres off (0.05); else they are refused"
    parser.add_argument("--round-kinks", type=_distance, nargs="?", const=0.05, metavar="M", help=text)
    parser.add_argument("--only-axis", action="store_true", help="the axis is all that is wanted: no exit code 3")
    names = ", ".join(scenario_names())
    text = f"what the file doesn't say: {names}, or a .json file (%(default)s)"
    parser.add_argument("--scenario", default="rq31-600m", metavar="NAME_OR_FILE", help=text)
    parser.add_argument("--seed", type=int, metavar="N", help="seed of what is drawn (the scenario's own)")
    add_changes_argument(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads road`; return exit code (3 if surface was left out), report as JSON data and printed text."""
    if arguments.list:
        from synthroads_addon.jobs.axis_source import listed_lines

        rows = listed_lines(arguments.file)
        return 0, {"file": str(arguments.file), "roads": rows}, _table(rows)
    if arguments.output is None:
        raise InputError("--output", None, "is needed: a folder for the files (or --list)")
    scenario = load_scenario(arguments.scenario, all_changes(arguments, _FIELDS))
    with output_folder(arguments.output, [PARAMETERS, CENTRELINE, REPORT, PICTURE], arguments.overwrite) as folder:
        from synthroads_addon.jobs.axis_source import axis_summary
        from synthroads_addon.jobs.generate import RoadSource
        from synthroads_addon.road.axes.centerline import centerline_geojson
        from synthroads_addon.road.geometry import RoadGeometry
        from synthroads_addon.road.tessellation import sample_stations

        source = RoadSource(
            scenario,
            axis=arguments.file,
            axis_name=arguments.axis_name,
            pictures=arguments.output,
            round_kinks=arguments.round_kinks,
            deviations=folder / PICTURE,
        )
        parameters, told = source.read()
        report = told["axis"]
        road = RoadGeometry(parameters)
        (folder / PARAMETERS).write_text(parameters.to_json(), encoding="utf-8")
        line = centerline_geojson(road, sample_stations(road, scenario.settings().tolerance))
        (folder / CENTRELINE).write_text(canonical_json(line), encoding="utf-8")
        report |= {"remarks": remarks_so_far()}
        (folder / REPORT).write_text(canonical_json(report), encoding="utf-8")
    lost = [text for text in report.get("left_out", []) if text.startswith(_SURFACE)]
    lines = [axis_summary(report), *(f"left out: {text}" for text in report.get("left_out", []))]
    text = "\n".join([*lines, f"written to {arguments.output}"])
    return 3 if lost and not arguments.only_axis else 0, report, text


def _distance(text: str) -> float:
    """Return a distance that kinks may be rounded by, m; raise argparse's error for any other."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value <= _LARGEST:
        raise argparse.ArgumentTypeError(f"{text!r}: a distance above 0 and up to {_LARGEST:g} m is needed")
    return value


def _table(rows: list[dict[str, Any]]) -> str:
    cells = []
    for row in rows:
        shown = (("no heights", not row["heights"]), ("in a junction", row["junction"]))
        notes = row["fault"] or ", ".join(text for text, so in shown if so)
        lanes = "" if row["lanes"] is None else str(row["lanes"])
        length = "" if row["fault"] else f"{row['length']:,.1f} m"
        of_what = f"{row['points']} points" if row["points"] else str(row["elements"])
        cells.append((row["name"], length, of_what, lanes, row["system"] or "not named", notes))
    return "\n".join(text_table(("name", "length", "elements", "lanes", "system", ""), cells, (1, 2, 3)))


if __name__ == "__main__":
    entry("road")
