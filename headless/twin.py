"""Write the geometric-semantic model of a road: CityJSON, IFC, OpenDRIVE and GeoJSON. Needs no Blender."""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import logger
from headless.options import add_formats_argument, add_renamed_argument, add_twin_argument
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.progress import duration
from synthroads_addon.base.schema import read_json
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.twin.formats import (
    FORMATS,
    TOLERANCE,
    TWIN_FORMATS,
    IfcPlacement,
    IfcSettings,
    check_formats,
    report_file_name,
    twin_file_names,
    write_twin,
)

_LIMITS = (1e-4, 1.0)
_LONG = 30.0
"""Seconds from which it is said beforehand how long the work takes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads twin` to its parser."""
    parser.add_argument("parameters", type=Path, metavar="PARAMETERS", help="parameter set (parameters.json)")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the files")
    add_twin_argument(parser, TWIN_FORMATS)
    text = f"largest distance between a chord and the curved line or surface, m ({TOLERANCE:g})"
    parser.add_argument("--max-deviation", type=float, default=TOLERANCE, metavar="M", help=text)
    add_renamed_argument(parser, "--tolerance", "--max-deviation")
    text = "placement of IFC objects: along the alignment, or local, for viewers without alignments (%(default)s)"
    placements = get_args(IfcPlacement)
    parser.add_argument("--ifc-placement", choices=placements, default=IfcSettings().placement, help=text)
    text = "write OpenDRIVE in a local projection without offset, for programs that read lat_0 and lon_0 only"
    parser.add_argument("--local-projection", action="store_true", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")
    add_formats_argument(parser, "twin")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads twin`; return exit code, files and losses as JSON data, and printed text."""
    deviation = arguments.max_deviation
    if not _LIMITS[0] <= deviation <= _LIMITS[1]:
        raise InputError("--max-deviation", deviation, f"must be from {_LIMITS[0]:g} to {_LIMITS[1]:g} m")
    formats, has_local_projection = arguments.twin, arguments.local_projection
    check_formats(formats)
    if has_local_projection and "opendrive" not in formats:
        raise InputError("--local-projection", None, f"is for opendrive, which isn't among {', '.join(formats)}")
    parameters = read_parameters(arguments.parameters)
    names = twin_file_names(formats)
    with output_folder(arguments.output, names, arguments.overwrite) as folder:
        if forecast_text := forecast(parameters.alignment.length, formats):
            logger.info(forecast_text)
        ifc = IfcSettings(placement=arguments.ifc_placement)
        write_twin(parameters, folder, formats, deviation, ifc, has_local_projection, progress_bar(arguments))
    files = {name: arguments.output / FORMATS[name].file for name in formats}
    reports = {name: arguments.output / report_file_name(name) for name in formats}
    losses = {name: _read_losses(path) for name, path in reports.items()}
    result = {"files": _texts(files), "reports": _texts(reports), "lost": losses}
    return (
        0,
        result,
        "\n".join(f"{_written(path)}\n{_line(reports[name], losses[name])}" for name, path in files.items()),
    )


def forecast(length: float, formats: Sequence[str]) -> str:
    """Return a line on what models of a road of a length (m) roughly take; empty for less than `_LONG` seconds."""
    entries = [FORMATS[name] for name in formats]
    seconds, megabytes = (
        sum(getattr(entry, of) for entry in entries) * length / 1e3 for of in ("seconds", "megabytes")
    )
    if seconds < _LONG:
        return ""
    need_text = f"take about {duration(seconds)} and {megabytes:,.0f} MB"
    models = f"models of {length / 1e3:,.0f} km ({', '.join(formats)})"
    return f"{models} {need_text}, with what stands beside the demo's motorway"


def _texts(paths: dict[str, Path]) -> dict[str, str]:
    """Return paths as texts, by the same names."""
    return {name: str(path) for name, path in paths.items()}


def _read_losses(report: Path) -> dict[str, int]:
    """Return the number of instance numbers without an entity in a file, by reason, from its report."""
    return Counter(row["reason"] for row in read_json(report)["lost"])


def _written(path: Path) -> str:
    """Return a line on a file that was written, with its size."""
    return f"written {path} ({path.stat().st_size / 1e6:.2f} MB)"


def _line(report: Path, reasons: dict[str, int]) -> str:
    """Return a line of text on a format's report: its file name, and how many instances are missing and why."""
    losses_text = "; ".join(f"{count} aren't in the file: {reason}" for reason, count in reasons.items())
    return f"        {report.name}: what became of each instance number{f'; {losses_text}' if losses_text else ''}"


if __name__ == "__main__":
    entry("twin")
