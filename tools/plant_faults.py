"""Plant small faults in the source, one at a time, and see whether the tests find them.

Cosmic-ray knows where a fault can be planted (another operator, another number, a condition turned round). A seed
draws the same number of places from each area; the tests that a coverage record has seen on a fault's line are run
with the fault, until the first that fails. Three steps, in an environment with the extra `faults`:

    python -m pytest -m "not slow" --cov --cov-context=test --cov-report=    # in both parts: tests of Blender, the rest
    python tools/plant_faults.py draw --seed 1 faults.json
    python tools/plant_faults.py run faults.json --coverage .coverage --output found.json

The source is changed while it runs and put back after each fault: run it in a clone of its own.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from coverage import CoverageData

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.folders import BLENDER_TESTS

ROOT = Path(__file__).resolve().parent.parent
ADDON = "synthroads_addon"
AREAS = {
    "road geometry": [f"{ADDON}/road/*.py"],
    "scanning": [f"{ADDON}/scanning/**/*.py"],
    "twin": [f"{ADDON}/twin/**/*.py"],
    "cloud": [f"{ADDON}/cloud/**/*.py"],
}
HARMLESS = ("BitOr", "RemoveDecorator", "ExceptionReplacer", "Variable")
"""Operators that are left out: most of theirs change an annotation or stop the import."""
SECONDS = 1200.0
"""Tests that run longer with a fault than this have found it: it keeps them from ending."""


@dataclass(frozen=True)
class Fault:
    """A planted fault: one mutation of one expression in a file, by Cosmic-ray's operator and its occurrence."""

    area: str
    file: str
    line: int
    operator: str
    occurrence: int

    def planted(self, code: str) -> str | None:
        """Return a file's source code with the fault in it; None where the operator changes nothing."""
        changed = mutate_code(code, get_operator(self.operator)(), self.occurrence)
        return changed if changed != code else None


def draw_faults(each: int, seed: int) -> list[Fault]:
    """Return `each` random faults of every area: a line is drawn first, then one of its faults."""
    rng = random.Random(seed)
    names = [name for name in sorted(operator_names()) if not any(part in name for part in (*HARMLESS, "NoOp"))]
    drawn = []
    for area, patterns in AREAS.items():
        lines: dict[tuple[str, int], list[Fault]] = defaultdict(list)
        for file in sorted(str(path.relative_to(ROOT)) for pattern in patterns for path in ROOT.glob(pattern)):
            for fault in _faults(area, file, names):
                lines[file, fault.line].append(fault)
        candidates = (rng.choice(lines[place]) for place in rng.sample(sorted(lines), len(lines)))
        real = (fault for fault in candidates if fault.planted((ROOT / fault.file).read_text(encoding="utf-8")))
        drawn += [fault for _, fault in zip(range(each), real, strict=False)]
    return drawn


def _faults(area: str, file: str, names: list[str]) -> Iterator[Fault]:
    tree = get_ast((ROOT / file).read_text(encoding="utf-8"))
    for name in names:
        try:
            operator = get_operator(name)()
        except TypeError:  # an operator that wants arguments
            continue
        places = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        yield from (Fault(area, file, line, name, number) for number, (line, _) in enumerate(places))


def covering_tests(coverage: list[Path], fault: Fault) -> list[str]:
    """Return the ids of the tests that run a fault's line, by coverage records, and of those sharing such a fixture.

    A line that the import alone runs names a constant or a field: the lines that use the name stand in its place, or
    else the whole file.
    """
    code = (ROOT / fault.file).read_text(encoding="utf-8").splitlines()
    name = re.match(r"\s*([A-Za-z_]\w*)\s*(?::[^=]*)?=", code[fault.line - 1])
    uses = {number for number, text in enumerate(code, 1) if name and re.search(rf"\b{name[1]}\b", text)}
    records = []
    for path in coverage:
        data = CoverageData(str(path))
        data.read()
        records += [(data, measured) for measured in data.measured_files() if measured.endswith(fault.file)]
    for lines in ({fault.line}, uses, set(range(1, len(code) + 1))):
        if tests := set().union(*(_tests_on(lines, data, measured) for data, measured in records)):
            return sorted(tests)
    return []


def _tests_on(lines: set[int], data: CoverageData, measured: str) -> set[str]:
    tests = set()
    for contexts in (contexts for line, contexts in data.contexts_by_lineno(measured).items() if line in lines):
        for test, _, phase in (context.rpartition("|") for context in contexts if context):
            shared = f"{test.partition('::')[0]}::"
            every = (context.rpartition("|")[0] for context in data.measured_contexts() if context.startswith(shared))
            tests |= set(every) if phase == "setup" else {test}
    return tests


def run_tests(tests: list[str], options: list[str]) -> tuple[bool, str]:
    """Run tests with pytest, Blender's in their own process; return whether one fails, and the first one's line."""
    blender = [test for test in tests if test.split("/")[1] in BLENDER_TESTS]
    for part in ([test for test in tests if test not in blender], blender):
        if not part:
            continue
        fixed = ["-x", "-q", "-p", "no:cacheprovider", "--tb=no", "--no-header"]
        command = [sys.executable, "-m", "pytest", *fixed, *options, *part]
        try:
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired:
            return True, "does not end"
        if done.returncode not in (0, 5):
            words = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
            return True, words[0] if words else f"pytest's code {done.returncode}: {done.stdout[-200:]}"
    return False, ""


def judge(fault: Fault, coverage: list[Path], options: list[str]) -> dict[str, object]:
    """Plant a fault, run the tests that reach it and restore the file; return the outcome as JSON data."""
    tests = covering_tests(coverage, fault)
    path = ROOT / fault.file
    code = path.read_text(encoding="utf-8")
    changed = fault.planted(code)
    assert changed is not None, f"{fault.file}:{fault.line} has another source than when the faults were drawn"
    begun = time.perf_counter()
    path.write_text(changed, encoding="utf-8")
    try:
        found, by = run_tests(tests, options)
    finally:
        path.write_text(code, encoding="utf-8")
    seconds = round(time.perf_counter() - begun, 1)
    return {**asdict(fault), "tests": len(tests), "found": found, "by": by, "seconds": seconds}


def main() -> int:
    """Draw faults, or plant them one by one and record what the tests find, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    steps = parser.add_subparsers(dest="step", required=True)
    drawing = steps.add_parser("draw", help="draw the faults")
    drawing.add_argument("faults", type=Path, help="file to write them to (JSON)")
    drawing.add_argument("--seed", type=int, required=True)
    drawing.add_argument("--each", type=int, default=10, help="faults of each area (10)")
    running = steps.add_parser("run", help="plant them one at a time and run the tests that reach them")
    running.add_argument("faults", type=Path, help="file that they were written to")
    running.add_argument("--coverage", type=Path, nargs="+", required=True, help="records with the tests as contexts")
    running.add_argument("--markers", default="not slow", help="which tests, as pytest's -m takes it ('not slow')")
    running.add_argument("--deselect", nargs="+", default=[], metavar="TEST", help="that fail without a fault too")
    running.add_argument("--numbers", type=int, nargs="+", help="plant these alone, counted from 0")
    running.add_argument("--output", type=Path, required=True, help="what was found (JSON lines)")
    arguments = parser.parse_args()
    if arguments.step == "draw":
        faults = draw_faults(arguments.each, arguments.seed)
        arguments.faults.write_text(json.dumps([asdict(fault) for fault in faults], indent=1), encoding="utf-8")
        return 0
    options = ["-m", arguments.markers, *(f"--deselect={test}" for test in arguments.deselect)]
    faults = [Fault(**fault) for fault in json.loads(arguments.faults.read_text(encoding="utf-8"))]
    with arguments.output.open("a", encoding="utf-8") as output:
        for number in arguments.numbers or range(len(faults)):
            result = {"number": number, **judge(faults[number], arguments.coverage, options)}
            print(json.dumps(result), file=output, flush=True)
            outcome = "found" if result["found"] else "NOT FOUND"
            print(number, faults[number].file, faults[number].line, outcome, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
