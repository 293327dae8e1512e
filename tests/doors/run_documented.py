"""Run what users are shown, in small sizes, with an environment's own commands: the outcome of each line.

    python -m tests.doors.run_documented ENVIRONMENT/bin/python FOLDER [EXTRA ...]

Lines are run in the order of the pages, as a reader does: each finds what the ones before it have written. A line that
needs an extra which isn't there must be refused, with exit code 2 and one line that says how to install it.
"""

from __future__ import annotations

import os
import re
import resource
import shlex
import subprocess
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.doors.cluster import cluster
from tests.doors.documented import Documented, documented_lines
from tests.doors.inputs import INPUTS
from tests.doors.small_sizes import EXTRAS, ROWS, Small

_LEAVE = "\nimport os, sys\nsys.stdout.flush(), sys.stderr.flush(), os._exit(0)"
"""End of a snippet: without Blender's teardown, in which a process can hang."""
_LIMIT = 600.0
"""Seconds after which a line is given up."""


@dataclass(frozen=True)
class Outcome:
    """How a line ended.

    Attributes:
        line: of the pages.
        command: what was run for it.
        code: exit code; None if it was not run.
        output: of it.
        errors: what it wrote to standard error.
        seconds: of processor time, that of its own processes included.
        fault: what is wrong; empty if it did what it should.
    """

    line: Documented
    command: str
    code: int | None
    output: str
    errors: str
    seconds: float
    fault: str

    def __str__(self) -> str:
        """Return the outcome as a line of text, with what was printed where something is wrong."""
        told = "not run" if self.code is None else f"code {self.code}, {self.seconds:.1f} s"
        text = f"{'WRONG' if self.fault else 'right'} ({told}) {self.line}"
        return f"{text}\n  {self.fault}\n  ran: {self.command}\n{self.output}{self.errors}" if self.fault else text


def run_documented(
    python: Path, folder: Path, extras: Collection[str] = (), *, only_needing: bool = False
) -> Iterator[Outcome]:
    """Run all documented lines in small sizes with an environment, and yield the outcome of each that is run.

    Args:
        python: the environment's interpreter; its other commands lie beside it.
        folder: working folder of the lines: empty, or one in which all lines were run already.
        extras: extras of pyproject.toml that the environment holds.
        only_needing: run only lines that need an extra, in a folder where those that need none were run before.

    Raises:
        ValueError: an extra is unknown, or a line has no row in the table or a row no line.
    """
    if unknown := set(extras) - set(EXTRAS):
        raise ValueError(f"no such extras: {', '.join(sorted(unknown))}")
    folder.mkdir(parents=True, exist_ok=True)
    for line, row in rows_of(documented_lines()):
        if line.kind == "file":
            (folder / line.name).write_text(line.text + "\n", encoding="utf-8")
        if row is None or row.reason or (only_needing and not row.needs):
            continue
        fault = _input_fault(row.inputs, python, folder)
        yield Outcome(line, "", None, "", "", 0.0, fault) if fault else _outcome(line, row, python, folder, extras)


def rows_of(lines: Sequence[Documented], rows: Iterable[Small] = ROWS) -> list[tuple[Documented, Small | None]]:
    """Return every line with its row of the table, a line that several pages have once; files have none.

    Raises:
        ValueError: a line has no row, or a row no line.
    """
    table = {row.text: row for row in rows}
    typed = {line.key: line for line in reversed(lines) if line.kind != "file"}
    missing = [str(line) for key, line in typed.items() if key not in table]
    idle = [key for key in table if key not in typed]
    if missing or idle:
        raise ValueError(
            f"{len(missing)} lines without a row in tests/doors/small_sizes.py: {'; '.join(missing)}. "
            f"{len(idle)} rows without a line: {'; '.join(idle)}"
        )
    return [(line, table.get(line.key)) for line in lines if line.kind == "file" or typed[line.key] is line]


def _input_fault(names: Iterable[str], python: Path, folder: Path) -> str:
    """Make the files that a line takes for granted; return why one can't be made, empty if all are there."""
    for name in names:
        if not (folder / name).exists():
            try:
                INPUTS[name](python, folder)
            except (OSError, RuntimeError) as error:
                return f"{name} can't be made: {error}"
    return ""


def _outcome(line: Documented, row: Small, python: Path, folder: Path, extras: Collection[str]) -> Outcome:
    """Run a line and return its outcome."""
    command = row.command(line.text)
    lacking = sorted(row.needs - set(extras))
    before = _processor_seconds()
    with cluster(python, folder, command, wanted=row.needs >= {"cluster"} and not lacking) as command:
        answer = subprocess.run(
            [str(python), "-c", command + _LEAVE] if line.kind == "python" else _words(command, python),
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=_LIMIT,
            stdin=subprocess.DEVNULL,
            env=_environment(python),
        )
    seconds = _processor_seconds() - before
    fault = refusal_fault(answer.returncode, answer.stderr, lacking) if lacking else _fault(answer, row)
    program = line.kind == "python" or line.text.startswith("python examples/")
    if lacking and program and "ModuleNotFoundError: No module named" in answer.stderr:
        fault = ""  # a program of the reader's own, or an example of one, which Python itself refuses
    if not fault and seconds > row.seconds:
        fault = f"it took {seconds:.1f} s of processor time instead of {row.seconds:g} s at most"
    return Outcome(line, command, answer.returncode, answer.stdout, answer.stderr, seconds, fault)


def _words(command: str, python: Path) -> list[str]:
    """Return a command's words, its program by its path in the environment."""
    program, *rest = shlex.split(command)
    beside = python.parent / program
    if not beside.exists():
        raise FileNotFoundError(f"{beside}: the environment has no such command")
    return [str(beside), *rest]


def _environment(python: Path) -> dict[str, str]:
    """Return the variables that a line is run with: the environment's commands come first, as if it were activated."""
    return {**os.environ, "PATH": f"{python.parent}{os.pathsep}{os.environ.get('PATH', '')}"}


def _processor_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _fault(answer: subprocess.CompletedProcess[str], row: Small) -> str:
    if "Traceback (most recent call last)" in answer.stderr:
        return "it ended in a traceback, or printed one"
    return "" if answer.returncode == row.code else f"exit code {answer.returncode} instead of {row.code}"


def refusal_fault(code: int, errors: str, lacking: Sequence[str]) -> str:
    """Return what is wrong with how a line that needs extras was refused; empty if nothing is.

    Args:
        code: exit code.
        errors: what stands on standard error.
        lacking: extras that it needs and that aren't there; one of them must be named.
    """
    lines = errors.strip().splitlines()
    if code != 2:
        return f"exit code {code} instead of 2: it needs {', '.join(lacking)}"
    if len(lines) != 1:
        return f"{len(lines)} lines on standard error instead of one"
    named = re.search(r"pip install (?:-e )?'[^'\[]*\[([\w,]+)\]'", lines[0])
    if not named or not set(named[1].split(",")) & set(lacking):
        return f"it doesn't say how to install {', '.join(lacking)}"
    return ""


def main() -> int:
    """Run all lines as the arguments say and print the outcomes; return 1 if one is wrong."""
    python, folder, *extras = sys.argv[1:]
    wrong, seconds = 0, 0.0
    for outcome in run_documented(Path(python).absolute(), Path(folder).absolute(), extras):
        print(outcome, flush=True)
        wrong, seconds = wrong + bool(outcome.fault), seconds + outcome.seconds
    print(f"{wrong} wrong, {seconds:.0f} s of processor time")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
