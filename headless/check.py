"""List every rule of the guidelines that a road breaks. Exit code 0: none; 3: some."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import entry
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.text.table import text_table

if TYPE_CHECKING:
    from synthroads_addon.checking.checker import Violation
    from synthroads_addon.road.parameters import AlignmentObject, RoadParameters


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads check` to its parser."""
    parser.add_argument("file", type=Path, metavar="FILE", help="parameter set (parameters.json)")
    text = "write how far drivers see along a country road, and how far they need to, as CSV"
    parser.add_argument("--sight", type=Path, metavar="FILE", help=text)


def run(arguments: argparse.Namespace) -> tuple[int, dict[str, Any], str]:
    """Run `synthroads check`; return exit code (3 if rules are broken), violations as JSON data, and a text table."""
    from synthroads_addon.checking.checker import check
    from synthroads_addon.road.parameters import read_parameters

    parameters = read_parameters(arguments.file)
    if arguments.sight is not None:
        write_sight(arguments.sight, parameters)
    violations = check(parameters)
    text = table(violations, parameters.alignment)
    return 3 if violations else 0, {"violations": [asdict(item) for item in violations]}, text


def write_sight(path: Path, parameters: RoadParameters) -> None:
    """Write the sight along a road, every 10 m in both directions, as CSV; an infinite one stays empty.

    Raises:
        InputError: the road's guideline asks for no sight, or the file can't be written.
    """
    import numpy as np

    from synthroads_addon.road.axes.sight import STEP, road_sight
    from synthroads_addon.road.geometry import RoadGeometry

    geometry = RoadGeometry(parameters)
    sight = road_sight(geometry, np.arange(0.0, geometry.length + 1e-6, STEP))
    if sight is None:
        text = "must be left out: no sight for stopping is known for this road's design class"
        raise InputError("--sight", parameters.design_class, text)
    rows = ["station,sight_ahead,sight_back,stopping_sight,overtaking_sight"]
    for station, *seen in zip(sight.station.tolist(), sight.ahead.tolist(), sight.back.tolist(), strict=True):
        cells = [f"{value:g}" if np.isfinite(value) else "" for value in seen]
        rows.append(",".join([f"{station:g}", *cells, f"{sight.stopping:.1f}", f"{sight.overtaking:g}"]))
    write_file(path, ("\n".join(rows) + "\n").encode(), "--sight", overwrite=True)


def table(violations: list[Violation], axis: AlignmentObject) -> str:
    """Return violations as a text table, one row with a sentence each, or a line that says there are none.

    Where the road's kilometres count otherwise than its stations, a column says what they count.
    """
    if not violations:
        return "no violations"
    counts_otherwise = bool(axis.first_station or axis.equations)
    head = ("rule", "object", "station", *(["counted"] if counts_otherwise else []), "value", "limit", "")
    rows = [
        (
            *(v.rule, v.object, f"{v.station:.1f} m"),
            *([f"{axis.counted(v.station):,.1f} m"] if counts_otherwise else []),
            *(_number(v.value, v.unit), _number(v.limit, v.unit), v.text),
        )
        for v in violations
    ]
    count = len(violations)
    return "\n".join([*text_table(head, rows, range(2, len(head) - 1)), f"{count} violation{'s' if count > 1 else ''}"])


def _number(value: float, unit: str) -> str:
    """Return a value with its unit as text."""
    return f"{value:.6g}" + (f" {unit}" if unit != "1" else "")


if __name__ == "__main__":
    entry("check")
