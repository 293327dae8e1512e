"""Measure each stage of the demo job, and scans of meshes, and compare with third-party code alone in the same run."""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.benchmark_table import DEMO, QUICK, TABLE, add_scaling, beside_lines, join_runs, judge_lines, markdown
from headless.commands import Outcome, entry
from headless.marked_documents import put_tables
from headless.options import add_changes_argument
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.machine import available_cores, cores_of_children, machine
from synthroads_addon.base.progress import Progress
from synthroads_addon.base.schema import canonical_json, read_json
from synthroads_addon.jobs.measure.waves import CELLS, write_waves
from synthroads_addon.jobs.mesh_scans import measure_mesh_scans, scans_beside, write_road
from synthroads_addon.scenario.scenario import Scenario, load_scenario

PARTS = ("demo", "waves", "road", "start")
"""Parts that are measured: the demo job, scans of waves and a road as meshes, and another version's first scan too."""
_FILES = ["benchmark.json", "benchmark.md"]
_PART = "--part"
_BESIDE = "--beside"
_QUICK_CELLS = 60
_PAIRS = 3
"""Times that both versions scan in turn."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads benchmark` to its parser."""
    cores = sorted({1, min(2, available_cores())})
    parser.add_argument("--output", type=Path, metavar="DIR", help=f"folder for {' and '.join(_FILES)}")
    parser.add_argument("--document", type=Path, metavar="FILE", help="also fill the tables of this Markdown file")
    text = "numbers of cores to measure with (1, and 2 where available)"
    parser.add_argument("--cores", nargs="+", type=int, default=cores, metavar="N", help=text)
    text = f"parts to measure: {', '.join(PARTS)} (all; start, a new process's first scan, needs {_BESIDE})"
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=text)
    text = "folder of another version (checkout or installation), whose scans are measured alternately with this one's"
    parser.add_argument(_BESIDE, type=Path, metavar="FOLDER", help=text)
    text = "scene to measure on (%(default)s)"
    parser.add_argument("--scenario", default="rq31-600m-even", metavar="NAME_OR_FILE", help=text)
    add_changes_argument(parser)
    parser.add_argument("--quick", action="store_true", help="use a small scene, to check that everything works")
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")
    text = "keep results of other parts and numbers of cores that this machine has already written to the folder"
    parser.add_argument("--resume", action="store_true", help=text)
    parser.add_argument(_PART, metavar="JSON", help=argparse.SUPPRESS)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads benchmark`, each part in its own process; return exit code, result as JSON data, printed text."""
    if arguments.part:
        result = _measure_part(json.loads(arguments.part))
        return 0, result, canonical_json(result)
    _check(arguments)
    figures: dict[str, Any] = {}
    former_figures = _read_kept(arguments)

    def measure() -> dict[str, str]:
        figures.update(_measure_all(arguments))
        if former_figures:
            figures["runs"] = join_runs(former_figures["runs"], figures["runs"])
        add_scaling(figures["runs"])
        return {TABLE: markdown(figures)}

    with ExitStack() as stack:
        folder = None
        if arguments.output:
            folder = stack.enter_context(
                output_folder(arguments.output, _FILES, arguments.overwrite or arguments.resume)
            )
        table = put_tables(arguments.document, [TABLE], measure)[TABLE]
        if folder:
            (folder / _FILES[0]).write_text(canonical_json(figures), encoding="utf-8")
            (folder / _FILES[1]).write_text(table, encoding="utf-8")
    return 0, figures, table + _verdict(figures)


def _check(arguments: argparse.Namespace) -> None:
    """Raise an InputError for what can't be measured, before anything is."""
    outputs = _scenario(arguments.scenario, arguments.changes, arguments.quick).outputs
    if "cloud" not in outputs:
        raise InputError("outputs", list(outputs), "must have the cloud, on which writing is measured")
    for cores in arguments.cores:
        if not 1 <= cores <= available_cores():
            raise InputError("--cores", cores, f"must be 1 to {available_cores()}, the cores that are there")
    version_folder = arguments.beside
    if version_folder and not (version_folder / "synthroads_addon" / "__init__.py").is_file():
        raise InputError(_BESIDE, str(version_folder), "must be a folder that holds the package synthroads_addon")
    if arguments.parts == ["start"] and not version_folder:
        raise InputError("--parts", arguments.parts, f"start is measured beside another version: {_BESIDE} names it")


def _measure_all(arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure the wanted parts on each requested number of cores; return the results for the tables."""
    request = {"quick": arguments.quick, "scenario": arguments.scenario, "changes": arguments.changes}
    with tempfile.TemporaryDirectory(prefix="synthroads-") as text:
        folder = Path(text)
        write_waves(folder / "waves.obj", _QUICK_CELLS if arguments.quick else CELLS)
        write_waves(folder / "start.obj", _QUICK_CELLS)
        if "road" in arguments.parts:
            _measure_in_process({**request, "part": "road file", "scene": str(folder / "road.obj")}, arguments.cores[0])
        return _runs(arguments, request, folder)


def _runs(arguments: argparse.Namespace, request: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Measure the parts on each number of cores; return the machine and the figures of each run."""
    progress, runs = progress_bar(arguments), []
    measured_parts = [part for part in arguments.parts if part != "start"]
    for number, cores in enumerate(arguments.cores):
        run: dict[str, Any] = {"cores": cores, "lines": {}, "floors": [], "stages": {}, "scans": {}, "beside": []}
        for step, part in enumerate(measured_parts):
            progress(f"{part}, {cores}", (number + step / len(arguments.parts)) / len(arguments.cores))
            figures = _measure_in_process({**request, "part": part, "scene": str(folder / f"{part}.obj")}, cores)
            run["floors"] += figures["floors"]
            for name in ("lines", "stages", "scans"):
                run[name] |= figures.get(name, {})
        if arguments.beside:
            run["beside"] = _measure_beside(arguments, folder, cores, progress)
            run["lines"] |= beside_lines(run["beside"])
        runs.append(run)
    return {"machine": _machine(), "quick": arguments.quick, "runs": runs}


def _machine() -> str:
    """Return the machine in words, with the versions of Blender and Python."""
    return machine({"Blender": version("bpy"), "Python": platform.python_version()})


def _read_kept(arguments: argparse.Namespace) -> dict[str, Any] | None:
    """Return the result in the output's folder that this one is to be joined with; None without one.

    Raises:
        InputError: it is of another machine, or of a small scene and this one isn't, or the other way round.
    """
    if not arguments.resume:
        return None
    if not arguments.output:
        raise InputError("--resume", None, "needs --output, the folder whose result is kept")
    path = arguments.output / _FILES[0]
    if arguments.overwrite:
        raise InputError("--resume", None, "can't be given with --overwrite, which keeps nothing")
    if not path.is_file():
        return None
    former_figures: dict[str, Any] = read_json(path)
    for name, current_value in (("machine", _machine()), ("quick", arguments.quick)):
        if former_figures.get(name) != current_value:
            raise InputError(
                f"{path}: {name}",
                former_figures.get(name),
                f"must be {current_value!r}, as now; --overwrite replaces it",
            )
    return former_figures


def _measure_in_process(part: dict[str, Any], cores: int) -> dict[str, Any]:
    """Measure a part in a new process limited to so many cores, and return its result."""
    command = [sys.executable, str(Path(__file__).resolve()), _PART, json.dumps(part), "--json"]
    return _json_of(command, part["part"], cores)


def _json_of(command: Sequence[str], name: str, cores: int, path: Path | None = None) -> dict[str, Any]:
    """Run a command on so many cores, with a folder on Python's path; return the JSON that it prints last."""
    environment = os.environ | ({"PYTHONPATH": str(path)} if path else {})
    with cores_of_children(cores):
        process = subprocess.run(
            command, capture_output=True, text=True, encoding="utf-8", errors="replace", check=False, env=environment
        )
    if process.returncode:
        raise RuntimeError(f"{name} failed: {process.stderr.strip()}")
    result: dict[str, Any] = json.loads(process.stdout[process.stdout.index("{") :])
    return result


def _measure_beside(
    arguments: argparse.Namespace, folder: Path, cores: int, progress: Progress
) -> list[dict[str, Any]]:
    """Scan with this version and the other in turn, each scan in a process of its own; return rows of both's figures.

    Processor times are medians. Each row: ``name``, and ``ours`` and ``other`` with what
    `headless.benchmark_beside.measure` returns.
    """
    root, script = Path(__file__).resolve().parents[1], str(Path(__file__).with_name("benchmark_beside.py"))
    versions = {"ours": root, "other": arguments.beside.resolve()}
    rows = []
    for name, scene, changes in scans_beside(arguments.parts, arguments.quick):
        scans: dict[str, list[dict[str, Any]]] = {side: [] for side in versions}
        for turn in range(1 if arguments.quick else _PAIRS):
            for side in list(versions)[:: -1 if turn % 2 else 1]:
                progress(f"{name}, {side}, {cores}", 0.0)
                command = [sys.executable, script, str(folder / f"{scene}.obj"), *changes]
                scans[side].append(_json_of(command, f"{name} by {versions[side]}", cores, versions[side]))
        rows.append({"name": name, "scene": scene} | {side: _medians(side_scans) for side, side_scans in scans.items()})
    return rows


def _medians(measurements: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return each figure's median over several measurements, of an odd number."""
    return {
        name: sorted(measurement[name] or 0.0 for measurement in measurements)[len(measurements) // 2]
        for name in measurements[0]
    }


def _measure_part(part: dict[str, Any]) -> dict[str, Any]:
    """Measure one part in this process, and return its figures; ``road file`` writes the road as a mesh."""
    name, quick = part["part"], part["quick"]
    if name == "demo":
        from synthroads_addon.jobs.measure.benchmark import measure_demo  # in this process alone: it starts Blender

        result = measure_demo(_scenario(part["scenario"], part["changes"], quick))
    elif name == "road file":
        write_road(Path(part["scene"]), quick)
        result = {}
    else:
        result = measure_mesh_scans(name, Path(part["scene"]), quick)
    return result


def _scenario(name: str, changes: list[str], quick: bool) -> Scenario:
    """Return the scenario to measure on: the demo's changes, those of a quick run, and the user's."""
    return load_scenario(name, [*DEMO, *(QUICK if quick else ()), *changes])


def _verdict(result: dict[str, Any]) -> str:
    """Return a line on the limits that aren't kept; empty for a quick run."""
    if result["quick"]:
        return ""
    missed_names = [name for name, _, is_kept in judge_lines(result) if not is_kept]
    return f"\nmissed: {', '.join(missed_names)}" if missed_names else "\nall limits that were measured are kept"


if __name__ == "__main__":
    entry("benchmark")
