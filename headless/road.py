"""Turn a road of another program's file (OpenDRIVE, LandXML, IFC), of a map, or a measured axis into a parameter set.

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

from headless.commands import Outcome, entry
from headless.options import AXIS_FILES, add_axis_name_argument, add_changes_argument, all_changes, axis_place
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.remarks import remarks_so_far
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.base.text.table import text_table
from synthroads_addon.road_files.kinks import FARTHEST_ROUNDING
from synthroads_addon.scenario.scenario import load_scenario, scenario_names

PARAMETERS, CENTRELINE, REPORT = "parameters.json", "centerline.geojson", "road.json"
PICTURE = "deviation.png"
_FIELDS = {"seed": "seed"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads road` to its parser."""
    parser.add_argument("file", type=Path, metavar="FILE", help=AXIS_FILES)
    parser.add_argument("--list", action="store_true", help="list the file's roads or alignments, and write nothing")
    parser.add_argument("--output", type=Path, metavar="DIR", help="folder for the files (needed without --list)")
    add_axis_name_argument(parser)
    text = "round kinks between elements by two clothoids, at most M metres away (0.05); by default kinks are refused"
    parser.add_argument("--round-kinks", type=_distance, nargs="?", const=0.05, metavar="M", help=text)
    parser.add_argument("--only-axis", action="store_true", help="take only the axis and its heights; no exit code 3")
    text = "print the fields in which the road of OpenDRIVE, or of our own IFC, differs from this parameter set"
    parser.add_argument("--against", type=Path, metavar="PARAMETERS", help=text)
    names = ", ".join(scenario_names())
    text = f"scenario for what the file doesn't say: {names}, or a .json file (%(default)s)"
    parser.add_argument("--scenario", default="rq31-600m", metavar="NAME_OR_FILE", help=text)
    parser.add_argument("--seed", type=int, metavar="N", help="seed of all random choices (the scenario's own)")
    add_changes_argument(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads road`; return exit code (3 if surface was left out), report as JSON data and printed text."""
    if arguments.list:
        from synthroads_addon.jobs.axis_source import listed_lines

        rows = listed_lines(arguments.file)
        return 0, {"file": str(arguments.file), "roads": rows}, _table(rows)
    if arguments.against is not None:
        return _compare(arguments)
    if arguments.output is None:
        raise InputError("--output", None, "is needed: a folder for the files (or --list)")
    scenario = load_scenario(arguments.scenario, all_changes(arguments, _FIELDS))
    with output_folder(arguments.output, [PARAMETERS, CENTRELINE, REPORT, PICTURE], arguments.overwrite) as folder:
        from synthroads_addon.jobs.axis_source import axis_summary
        from synthroads_addon.jobs.generate import RoadSource
        from synthroads_addon.jobs.whole_road import has_whole_road
        from synthroads_addon.road.axes.centerline import centerline_geojson
        from synthroads_addon.road.geometry import RoadGeometry
        from synthroads_addon.road.tessellation import sample_stations

        has_all = has_whole_road(arguments.file) and not arguments.only_axis
        source = RoadSource(
            scenario,
            axis=None if has_all else arguments.file,
            axis_name=arguments.axis_name,
            axis_place=axis_place(arguments),
            pictures=arguments.output,
            road=arguments.file if has_all else None,
            round_kinks=arguments.round_kinks,
            deviations=folder / PICTURE,
        )
        parameters, report_parts = source.read()
        report = report_parts["axis"]
        road = RoadGeometry(parameters)
        (folder / PARAMETERS).write_text(parameters.to_json(), encoding="utf-8")
        line = centerline_geojson(road, sample_stations(road, scenario.settings().tolerance))
        (folder / CENTRELINE).write_text(canonical_json(line), encoding="utf-8")
        report |= {"remarks": remarks_so_far()}
        (folder / REPORT).write_text(canonical_json(report), encoding="utf-8")
    from synthroads_addon.jobs.whole_road import SURFACE

    losses = [text for text in report.get("left_out", []) if text.startswith(SURFACE)]
    losses += ["surface"] if report.get("whole", {}).get("surface_lost") else []
    lines = [axis_summary(report), *report.get("summary", [])]
    lines += [f"left out: {text}" for text in report.get("left_out", [])]
    text = "\n".join([*lines, f"written to {arguments.output}"])
    return 3 if losses and not arguments.only_axis else 0, report, text


def _compare(arguments: argparse.Namespace) -> Outcome:
    """Return the fields in which a file's road differs from a parameter set; nothing is written."""
    if arguments.output is not None:
        raise InputError(
            "--output", str(arguments.output), "can't be given together with --against, which writes nothing"
        )
    from synthroads_addon.jobs.whole_road import differences_from

    scenario = load_scenario(arguments.scenario, all_changes(arguments, _FIELDS))
    differences, _ = differences_from(arguments.file, arguments.against, scenario, arguments.axis_name)
    rows = [difference._asdict() for difference in differences]
    report = {"file": str(arguments.file), "against": str(arguments.against), "differences": rows}
    cells = [
        (
            difference.field,
            str(difference.old),
            str(difference.new),
            "" if difference.station is None else f"at station {difference.station:.1f} m",
        )
        for difference in differences
    ]
    if not cells:
        return 0, report, "no field differs"
    return 0, report, "\n".join(text_table(("field", "old", "new", ""), cells, ()))


def _distance(text: str) -> float:
    """Return a distance that kinks may be rounded by, m; raise argparse's error for any other."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value <= FARTHEST_ROUNDING:
        raise argparse.ArgumentTypeError(f"{text!r}: a distance above 0 and up to {FARTHEST_ROUNDING:g} m is needed")
    return value


def _table(rows: list[dict[str, Any]]) -> str:
    """Return a file's roads as a table of text."""
    cells = []
    for row in rows:
        labels = [("no heights", not row["heights"]), ("in a junction", row["junction"])]
        labels += [("one carriageway", row["carriageway"])]
        notes = row["fault"] or ", ".join(
            [*filter(None, [row["kind"]]), *(text for text, applies in labels if applies)]
        )
        lanes = "" if row["lanes"] is None else str(row["lanes"])
        length = "" if row["fault"] else f"{row['length']:,.1f} m"
        of_what = f"{row['points']} points" if row["points"] else str(row["elements"])
        cells.append((row["name"], length, of_what, lanes, row["system"] or "not named", notes))
    return "\n".join(text_table(("name", "length", "elements", "lanes", "system", ""), cells, (1, 2, 3)))


if __name__ == "__main__":
    entry("road")
