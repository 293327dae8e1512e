"""Measure each stage of the demo job beside its floor, and hold the job against what it must reach."""

import argparse
import json
import platform
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.benchmark_table import DEMO, QUICK, TABLE, judge_lines, markdown
from headless.commands import Outcome, add_changes_argument, entry
from headless.marked_documents import put_tables
from headless.messages import progress_bar
from headless.waves import CELLS, write_waves
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.machine import available_cores, cores_of_children, machine
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.scenario.scenario import Scenario, load_scenario

_FILES = ["benchmark.json", "benchmark.md"]
_PART = "--part"
_WAVES = (
    "scan.device=generic-polygon", "scan.platform.height=80", "scan.platform.speed=10", "scan.relief=0",
    "colour.source=material", 'cloud.formats=["las"]', 'outputs=["cloud"]',
)  # fmt: skip
_QUICK_CELLS = 60
_QUICK_WAVES = ("scan.platform.speed=100",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads benchmark` to its parser."""
    cores = sorted({1, min(2, available_cores())})
    parser.add_argument("--output", type=Path, metavar="DIR", help=f"folder for {' and '.join(_FILES)}")
    parser.add_argument("--document", type=Path, metavar="FILE", help="fill the tables of this Markdown file as well")
    text = "numbers of cores (1, and 2 where there are so many)"
    parser.add_argument("--cores", nargs="+", type=int, default=cores, metavar="N", help=text)
    text = "scene to measure on (%(default)s)"
    parser.add_argument("--scenario", default="rq31-600m", metavar="NAME_OR_FILE", help=text)
    add_changes_argument(parser)
    parser.add_argument("--quick", action="store_true", help="a small scene: to see that all works, in seconds")
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")
    parser.add_argument(_PART, metavar="JSON", help=argparse.SUPPRESS)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads benchmark`, each part in its own process; return exit code, result as JSON data, printed text."""
    if arguments.part:
        result = _measure_part(json.loads(arguments.part))
        return 0, result, canonical_json(result)
    outputs = _scenario(arguments.scenario, arguments.changes, arguments.quick).outputs
    if "cloud" not in outputs:
        raise InputError("outputs", list(outputs), "must have the cloud, on which writing is measured")
    for cores in arguments.cores:
        if not 1 <= cores <= available_cores():
            raise InputError("--cores", cores, f"must be 1 to {available_cores()}, the cores that are there")
    found: dict[str, Any] = {}

    def measure() -> dict[str, str]:
        found.update(_measure_all(arguments))
        return {TABLE: markdown(found)}

    with ExitStack() as opened:
        folder = None
        if arguments.output:
            folder = opened.enter_context(output_folder(arguments.output, _FILES, arguments.overwrite))
        table = put_tables(arguments.document, [TABLE], measure)[TABLE]
        if folder:
            (folder / _FILES[0]).write_text(canonical_json(found), encoding="utf-8")
            (folder / _FILES[1]).write_text(table, encoding="utf-8")
    return 0, found, table + _verdict(found)


def _measure_all(arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure the demo job and the waves scene on each requested number of cores; return the results for the tables."""
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        scene = Path(folder) / "waves.obj"
        triangles = write_waves(scene, _QUICK_CELLS if arguments.quick else CELLS)
        return _runs(arguments, {"scene": str(scene), "triangles": triangles})


def _runs(arguments: argparse.Namespace, waves: dict[str, Any]) -> dict[str, Any]:
    progress, runs = progress_bar(arguments), []
    about = {"quick": arguments.quick, "scenario": arguments.scenario, "changes": arguments.changes, **waves}
    parts = ["demo", "waves_1", "waves_19"]
    for number, cores in enumerate(arguments.cores):
        measured: dict[str, Any] = {"lines": {}}
        for step, part in enumerate(parts):
            progress(f"{part}, {cores}", (number * len(parts) + step) / (len(parts) * len(arguments.cores)))
            result_of_part = _measure_in_process({**about, "part": part}, cores)
            measured |= result_of_part | {"lines": measured["lines"] | result_of_part["lines"]}
        runs.append(measured | {"cores": cores})
    versions = {"Blender": runs[0]["blender"], "Python": platform.python_version()}
    return {"machine": machine(versions), "quick": arguments.quick, "runs": runs}


def _measure_in_process(part: dict[str, Any], cores: int) -> dict[str, Any]:
    """Measure a part in a new process limited to so many cores, and return its result."""
    command = [sys.executable, str(Path(__file__).resolve()), _PART, json.dumps(part), "--json"]
    with cores_of_children(cores):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{part['part']} failed: {done.stderr.strip()}")
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def _measure_part(part: dict[str, Any]) -> dict[str, Any]:
    """Measure one part (`demo`, `waves_1` or `waves_19`) in this process, and return its figures."""
    if part["part"] == "demo":
        from synthroads_addon.jobs.measure.benchmark import measure_demo

        result = measure_demo(_scenario(part["scenario"], part["changes"], part["quick"]))
    else:
        rays = int(part["part"].removeprefix("waves_"))
        result = {"lines": _measure_waves(rays, part)}
    return result | {"blender": sys.modules["bpy"].app.version_string}


def _measure_waves(rays: int, part: dict[str, Any]) -> dict[str, float]:
    """Scan the waves scene; return pulses or rays per second (millions), bytes per triangle and seconds to open it."""
    from synthroads_addon.base.changes import apply_change
    from synthroads_addon.base.progress import peak_memory_mb
    from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene

    data: Any = Scenario().to_dict()
    for change in (*_WAVES, *(_QUICK_WAVES if part["quick"] else ()), f"scan.rays_per_pulse={rays}"):
        data = apply_change(data, change, Scenario)
    with tempfile.TemporaryDirectory(prefix="synthroads-") as text:
        output = Path(text) / "out"
        before = peak_memory_mb() or 0.0
        report = scan_scene(SceneScan(Scenario.from_dict(data), output, Path(part["scene"]), up="z"))
    stages, counts = report["stages"], report["counts"]
    seconds = stages["scan"]["seconds"]
    if rays > 1:
        # As HELIOS++ counts them: all that the pulses have, also where these are known to meet nothing.
        return {"waves_rays": counts["pulses"] * rays / seconds / 1e6}
    opening = sum(stages[name]["seconds"] for name in ("scene", "scene mesh", "caster"))
    memory = 1e6 * ((stages["caster"]["peak_memory_mb"] or 0.0) - before) / part["triangles"]
    return {"waves_pulses": counts["pulses"] / seconds / 1e6, "waves_memory": memory, "waves_opening": opening}


def _scenario(name: str, changes: list[str], quick: bool) -> Scenario:
    return load_scenario(name, [*DEMO, *(QUICK if quick else ()), *changes])


def _verdict(result: dict[str, Any]) -> str:
    if result["quick"]:
        return ""
    missed = [name for name, _, kept in judge_lines(result) if not kept]
    return f"\nmissed: {', '.join(missed)}" if missed else "\nall limits that were measured are kept"


if __name__ == "__main__":
    entry("benchmark")
