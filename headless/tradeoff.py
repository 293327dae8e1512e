"""Measure error against time for each knob that trades one for the other."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.cli import Outcome, add_common_arguments, entry, progress_bar
from synthroads_addon.core.errors import InputError
from synthroads_addon.core.scenario import load_scenario
from synthroads_addon.core.schema import canonical_json
from synthroads_addon.core.tradeoff import KNOBS, ROW_TITLES, markdown, rows

_ROW = "--row"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `synthroads tradeoff`."""
    parser.add_argument("--scenario", default="rq31-600m", metavar="NAME_OR_FILE", help="scene to measure on")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for table, JSON and plot")
    parser.add_argument("--knobs", nargs="+", default=list(KNOBS), metavar="KNOB", help=f"any of {', '.join(KNOBS)}")
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")
    parser.add_argument(_ROW, metavar="JSON", help=argparse.SUPPRESS)
    add_common_arguments(parser)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads tradeoff`; each row is measured in a process of its own, so that its memory is its own."""
    load_scenario(arguments.scenario)
    if arguments.row:
        from synthroads_addon.measuring import measure_row

        row = json.loads(arguments.row)
        result = measure_row(arguments.scenario, row["knob"], row["value"])
        return 0, result, json.dumps(result)
    for knob in arguments.knobs:
        if knob not in KNOBS:
            raise InputError("--knobs", knob, f"must be any of {', '.join(KNOBS)}")
    from synthroads_addon.core.files import output_folder

    names = ["tradeoff.json", "tradeoff.md", "tradeoff.png"]
    with output_folder(arguments.output, names, arguments.overwrite) as folder:
        results = _measure_all(arguments)
        table = markdown(results, arguments.scenario)
        (folder / "tradeoff.json").write_text(canonical_json({"rows": results}), encoding="utf-8")
        (folder / "tradeoff.md").write_text(table, encoding="utf-8")
        _plot(results, folder / "tradeoff.png")
    return 0, {"rows": results}, table + f"\nwritten to {arguments.output}"


def _measure_all(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    progress = progress_bar(arguments)
    wanted = list(rows(arguments.knobs))
    results = []
    for number, (knob, value) in enumerate(wanted):
        progress(f"{knob} {value}", number / len(wanted))
        request = json.dumps({"knob": knob, "value": value})
        line = [sys.executable, str(Path(__file__).resolve()), "--scenario", arguments.scenario, "--output", "."]
        done = subprocess.run([*line, _ROW, request, "--json"], capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{knob} = {value} failed: {done.stderr.strip()}")
        results.append(json.loads(done.stdout))
    return results


def _plot(results: list[dict[str, Any]], path: Path) -> None:
    """Draw error against time, one panel per kind of error; the rows of one knob are joined."""
    try:
        import matplotlib as mpl
    except ImportError:
        raise InputError("tradeoff", None, "needs matplotlib for its plot: pip install matplotlib") from None
    mpl.use("Agg")
    from matplotlib import pyplot

    measured = [row for row in results if "left_out" not in row]
    panels = [name for name in ROW_TITLES if any(_varies(measured, knob, name) for knob in _knobs(measured))]
    columns = min(3, max(1, len(panels)))
    lines = -(-max(1, len(panels)) // columns)
    figure, axes = pyplot.subplots(lines, columns, figsize=(5.2 * columns, 4.2 * lines), squeeze=False)
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(False)
    for axis, name in zip(axes.flat, panels, strict=False):
        for knob in _knobs(measured):
            if _varies(measured, knob, name):
                _draw_knob(axis, [row for row in measured if row["knob"] == knob], knob, name)
        axis.set(xlabel="processor time of the whole job (s)", ylabel=ROW_TITLES[name], xscale="log")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("{x:g}")
        axis.tick_params(axis="x", which="both", labelsize=7, rotation=45)
        axis.set_ylim(0, 1.15 * axis.get_ylim()[1])
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _knobs(measured: list[dict[str, Any]]) -> list[str]:
    return list(dict.fromkeys(row["knob"] for row in measured))


def _varies(measured: list[dict[str, Any]], knob: str, name: str) -> bool:
    """Return whether a knob changes a kind of error at all: a flat line says nothing."""
    errors = [row["errors"][name] for row in measured if row["knob"] == knob and name in row["errors"]]
    largest = max(abs(row["errors"].get(name, 0.0)) for row in measured)
    if not errors or (knob != "fidelity" and max(map(abs, errors)) < 0.05 * largest):
        return False
    return knob == "fidelity" or max(errors) - min(errors) > 0.5 * max(map(abs, errors))


def _draw_knob(axis: Any, rows_of_knob: list[dict[str, Any]], knob: str, name: str) -> None:
    preset = knob == "fidelity"
    x, y = [row["seconds"] for row in rows_of_knob], [row["errors"][name] for row in rows_of_knob]
    axis.plot(x, y, "*" if preset else "o-", label=knob.replace("_", " "), markersize=14 if preset else 6)
    for row, a, b in zip(rows_of_knob, x, y, strict=True):
        axis.annotate(
            str(row["value"]), (a, b), textcoords="offset points", xytext=(8, -14 if preset else 5), fontsize=8
        )


if __name__ == "__main__":
    entry("tradeoff")
