"""Plant small faults in the source, one at a time, and see whether the tests find them.

Cosmic-ray knows where a fault can be planted (another operator, another number, a condition turned round). A seed
draws the same number of places from each area, and a mark is put at each place that notes the tests that come by;
these are then run with the fault, until the first that fails. Five steps, in an environment with the extra `faults`:

    python tools/plant_faults.py draw --seed 1 faults.json
    python tools/plant_faults.py mark faults.json marks.txt
    python -m pytest -m "not slow"    # in both parts, tests of Blender and the rest
    git checkout synthroads_addon
    python tools/plant_faults.py run faults.json --marks marks.txt --output found.json

The source is changed while it runs and put back after each fault: run it in a clone of its own.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import re
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

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


MARKS = """import os

seen = set()


def reach(number):
    test = os.environ.get("PYTEST_CURRENT_TEST", "")
    if (number, test) not in seen:
        seen.add((number, test))
        with open({path!r}, "a") as marks:
            marks.write(f"{{number}}\\t{{test}}\\n")
"""
"""A module that notes a number and the test that runs, also in the processes that the test has started."""


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
        new_code = mutate_code(code, get_operator(self.operator)(), self.occurrence)
        return new_code if new_code != code else None


def draw_faults(count: int, seed: int) -> list[Fault]:
    """Return `count` random faults of every area: a line is drawn first, then one of its faults."""
    rng = random.Random(seed)
    names = [name for name in sorted(operator_names()) if not any(part in name for part in (*HARMLESS, "NoOp"))]
    faults = []
    for area, patterns in AREAS.items():
        lines: dict[tuple[str, int], list[Fault]] = defaultdict(list)
        for file in sorted(str(path.relative_to(ROOT)) for pattern in patterns for path in ROOT.glob(pattern)):
            for fault in _faults(area, file, names):
                lines[file, fault.line].append(fault)
        candidates = (rng.choice(lines[place]) for place in rng.sample(sorted(lines), len(lines)))
        real_faults = (fault for fault in candidates if fault.planted((ROOT / fault.file).read_text(encoding="utf-8")))
        faults += [fault for _, fault in zip(range(count), real_faults, strict=False)]
    return faults


def _faults(area: str, file: str, names: list[str]) -> Iterator[Fault]:
    """Yield all faults that Cosmic-ray's operators can plant in a file."""
    tree = get_ast((ROOT / file).read_text(encoding="utf-8"))
    for name in names:
        try:
            operator = get_operator(name)()
        except TypeError:  # an operator that wants arguments
            continue
        places = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        yield from (Fault(area, file, line, name, number) for number, (line, _) in enumerate(places))


def marked_places(code: str, line: int) -> list[int]:
    """Return the lines before which a fault's marks go: the first of the statement that its line is part of.

    A line that the import alone runs names a constant or a field: the lines that use the name stand in its place, or
    else the beginnings of all functions of the file.
    """
    lines = code.splitlines()
    tree = ast.parse(code)
    name = re.match(r"\s*([A-Za-z_]\w*)\s*(?::[^=]*)?=", lines[line - 1])
    uses = [number for number, text in enumerate(lines, 1) if name and re.search(rf"\b{name[1]}\b", text)]
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    bodies = [node.body[1:] if ast.get_docstring(node) else node.body for node in functions]
    for numbers in ([line], uses, [body[0].lineno for body in bodies if body]):
        if places := {place for number in numbers if (place := _statement_of(number, functions, lines)) is not None}:
            return sorted(places)
    return []


def _statement_of(line: int, functions: list[ast.FunctionDef], lines: list[str]) -> int | None:
    """Return the first line of the innermost statement of a function that a line is in, where one can go before it."""
    first = None
    for statement in (inner for function in functions for inner in ast.walk(function) if inner is not function):
        if isinstance(statement, ast.stmt) and statement.lineno <= line <= (statement.end_lineno or 0):
            text = lines[statement.lineno - 1]
            stands_alone = not text[: statement.col_offset].strip() and not text.lstrip().startswith(("elif", "@"))
            first = max(first or 0, statement.lineno) if stands_alone else first
    return first


def put_marks(faults: list[Fault], marks: Path) -> None:
    """Change the source so that each test that reaches a fault's place is noted in a file."""
    helper = MARKS.format(path=str(marks.resolve()))
    (ROOT / ADDON / "marks.py").write_text(helper, encoding="utf-8")
    places_of_file: dict[str, list[tuple[int, int]]] = defaultdict(list)
    for number, fault in enumerate(faults):
        code = (ROOT / fault.file).read_text(encoding="utf-8")
        places_of_file[fault.file] += [(place, number) for place in marked_places(code, fault.line)]
    for file, places in places_of_file.items():
        lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
        for place, number in sorted(places, reverse=True):
            indent = lines[place - 1][: -len(lines[place - 1].lstrip())]
            lines.insert(place - 1, f'{indent}__import__("{ADDON}.marks", fromlist=["reach"]).reach({number})')
        (ROOT / file).write_text("\n".join(lines) + "\n", encoding="utf-8")


def reaching_tests(fault: Fault, number: int, marks: Iterable[str]) -> list[str]:
    """Return the ids of the tests that a file of marks names for a fault, those of the fault's own folder first.

    Where a fixture has reached the place, all tests of its file may rest on it.
    """
    tests: set[str] = set()
    for place, _, entry in (line.partition("\t") for line in marks):
        test, _, phase = entry.rpartition(" (")
        if int(place) == number and test:
            tests.add(test.partition("::")[0] if phase.startswith("setup") else test)
    return sorted(tests, key=lambda test: (-_parts_in_common(test, fault.file), test))


def _parts_in_common(test: str, file: str) -> int:
    """Return how many of the parts of a source file's path a test file's path has too, as tests mirror the source."""
    words = {re.sub(r"^test_|\.py$", "", part) for part in Path(test.partition("::")[0]).parts}
    return len(words & {part.removesuffix(".py") for part in Path(file).parts})


def run_tests(tests: list[str], options: list[str]) -> tuple[bool, str]:
    """Run tests with pytest, Blender's in their own process; return whether one fails, and the first one's line."""
    blender = [test for test in tests if test.split("/")[1] in BLENDER_TESTS]
    for part in ([test for test in tests if test not in blender], blender):
        if not part:
            continue
        fixed_options = ["-x", "-q", "-p", "no:cacheprovider", "--tb=no", "--no-header"]
        command = [sys.executable, "-m", "pytest", *fixed_options, *options, *part]
        try:
            answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired:
            return True, "does not end"
        if answer.returncode not in (0, 5):
            words = [line for line in answer.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
            return True, words[0] if words else f"pytest's code {answer.returncode}: {answer.stdout[-200:]}"
    return False, ""


def judge(fault: Fault, tests: list[str], options: list[str]) -> dict[str, object]:
    """Plant a fault, run the tests that reach it and restore the file; return the outcome as JSON data."""
    path = ROOT / fault.file
    code = path.read_text(encoding="utf-8")
    new_code = fault.planted(code)
    assert new_code is not None, f"{fault.file}:{fault.line} has another source than when the faults were drawn"
    begin = time.perf_counter()
    path.write_text(new_code, encoding="utf-8")
    try:
        is_found, first_failure = run_tests(tests, options)
    finally:
        path.write_text(code, encoding="utf-8")
    seconds = round(time.perf_counter() - begin, 1)
    return {**asdict(fault), "tests": len(tests), "found": is_found, "by": first_failure, "seconds": seconds}


def main() -> int:
    """Draw faults, or plant them one by one and record what the tests find, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    steps = parser.add_subparsers(dest="step", required=True)
    drawing = steps.add_parser("draw", help="draw the faults")
    drawing.add_argument("faults", type=Path, help="file to write them to (JSON)")
    drawing.add_argument("--seed", type=int, required=True)
    drawing.add_argument("--each", type=int, default=10, help="faults of each area (10)")
    marking = steps.add_parser("mark", help="change the source so that it notes which tests reach the faults' places")
    marking.add_argument("faults", type=Path, help="file that they were written to")
    marking.add_argument("marks", type=Path, help="file that the tests are noted in")
    running = steps.add_parser("run", help="plant them one at a time and run the tests that reach them")
    running.add_argument("faults", type=Path, help="file that they were written to")
    running.add_argument("--marks", type=Path, required=True, help="file that the tests were noted in")
    running.add_argument("--markers", default="not slow", help="which tests, as pytest's -m takes it ('not slow')")
    running.add_argument("--deselect", nargs="+", default=[], metavar="TEST", help="that fail without a fault too")
    running.add_argument("--numbers", type=int, nargs="+", help="plant these alone, counted from 0")
    running.add_argument("--output", type=Path, required=True, help="what was found (JSON lines)")
    arguments = parser.parse_args()
    if arguments.step == "draw":
        faults = draw_faults(arguments.each, arguments.seed)
        arguments.faults.write_text(json.dumps([asdict(fault) for fault in faults], indent=1), encoding="utf-8")
        return 0
    faults = [Fault(**fault) for fault in json.loads(arguments.faults.read_text(encoding="utf-8"))]
    if arguments.step == "mark":
        put_marks(faults, arguments.marks)
        return 0
    options = ["-m", arguments.markers, *(f"--deselect={test}" for test in arguments.deselect)]
    marks = arguments.marks.read_text(encoding="utf-8").splitlines()
    with arguments.output.open("a", encoding="utf-8") as output:
        for number in arguments.numbers or range(len(faults)):
            result = {"number": number, **judge(faults[number], reaching_tests(faults[number], number, marks), options)}
            print(json.dumps(result), file=output, flush=True)
            outcome = "found" if result["found"] else "NOT FOUND"
            print(number, faults[number].file, faults[number].line, outcome, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
