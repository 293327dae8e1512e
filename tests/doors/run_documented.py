"""Run what users are shown, in small sizes, with an environment's own commands: the outcome of each line.

    python -m tests.doors.run_documented ENVIRONMENT/bin/python FOLDER [EXTRA ...]

Each line finds what those before it have written, as a reader's does: it waits for those that write what it names, and
lines that have nothing to do with each other run side by side. A line that needs an extra which isn't there must be
refused, with exit code 2 and one line that says how to install it.
"""

from __future__ import annotations

import os
import re
import resource
import shlex
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from tests.doors.cluster import cluster
from tests.doors.documented import Documented, documented_lines
from tests.doors.inputs import INPUTS, MADE_FROM
from tests.doors.small_sizes import EXTRAS, ROWS, Small

_LEAVE = "\nimport os, sys\nsys.stdout.flush(), sys.stderr.flush(), os._exit(0)"
"""End of a snippet: without Blender's teardown, in which a process can hang."""
_LIMIT = 600.0
"""Seconds after which a line is given up."""
_AT_ONCE = 2
"""Lines that run side by side."""
_PATH = re.compile(r"(?<![\w/.-])(?:out/[\w./-]*\w|[\w-]+\.(?:csv|glb|json|laz|osm|xodr|yaml))(?![\w/])")
"""File or folder of the reader's own in a line."""
_WRITTEN = re.compile(r"--(?:output|save)[= ](\S+)")
"""Path behind the options that name what a command writes."""


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
    python: Path, folder: Path, extras: Collection[str] = (), chosen: Callable[[Small], object] = lambda row: True
) -> Iterator[Outcome]:
    """Run all documented lines in small sizes with an environment, and yield the outcome of each that is run.

    Args:
        python: the environment's interpreter; its other commands lie beside it.
        folder: working folder of the lines: empty, or one in which lines were run already.
        extras: extras of pyproject.toml that the environment holds.
        chosen: says of a row whether its line is run; what it reads must be there then, or be written by one that is.

    Raises:
        ValueError: an extra is unknown, or a line has no row in the table or a row no line.
    """
    if unknown := set(extras) - set(EXTRAS):
        raise ValueError(f"no such extras: {', '.join(sorted(unknown))}")
    folder.mkdir(parents=True, exist_ok=True)
    lines = [
        (line, row)
        for line, row in rows_of(documented_lines())
        if line.kind == "file" or (row and not row.reason and chosen(row))
    ]
    steps = list(_steps(lines, python, folder, extras))
    before = [{n for n in range(number) if step.waits_for(steps[n])} for number, step in enumerate(steps)]
    done: set[int] = set()
    waiting, running = list(range(len(steps))), dict[Future[Outcome | None], int]()
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        while waiting or running:
            for number in [n for n in waiting if before[n] <= done][: _AT_ONCE - len(running)]:
                running[pool.submit(steps[number].run)] = number
                waiting.remove(number)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                done.add(running.pop(future))
                if outcome := future.result():
                    yield outcome


@dataclass(frozen=True)
class Step:
    """Something that is done on the way through the pages: a file is saved or made, or a line is run.

    Attributes:
        run: does it; returns the outcome of a line, and of a file that can't be made.
        reads: files and folders that must be there before.
        writes: those that it makes or changes.
        alone: whether nothing may run beside it.
    """

    run: Callable[[], Outcome | None]
    reads: frozenset[str] = frozenset()
    writes: frozenset[str] = frozenset()
    alone: bool = False

    def waits_for(self, earlier: Step) -> bool:
        """Return whether it comes after an earlier one: that writes what this one reads, or they write the same."""
        shared = _meet(earlier.writes, self.reads | self.writes) or _meet(earlier.reads, self.writes)
        return shared or self.alone or earlier.alone


def _meet(some: Iterable[str], others: Iterable[str]) -> bool:
    """Return whether a path is one of others, lies in one of them, or holds one."""
    return any(f"{a}/".startswith(f"{b}/") or f"{b}/".startswith(f"{a}/") for a in some for b in others)


def _steps(
    lines: Iterable[tuple[Documented, Small | None]], python: Path, folder: Path, extras: Collection[str]
) -> Iterator[Step]:
    """Yield the steps of lines with their rows, in order: a file that a line takes for granted is made before it."""
    made: set[str] = set()
    for line, row in lines:
        if row is None:
            text = line.text + "\n"
            yield Step(partial(_save, folder / line.name, text), writes=frozenset({line.name}))
            continue
        for name in row.inputs:
            if name not in made:
                made.add(name)
                reads = frozenset(MADE_FROM.get(name, ()))
                yield Step(partial(_make_input, line, name, python, folder), reads, frozenset({name}))
        reads, writes = paths_of(line, row)
        runs = partial(_outcome, line, row, python, folder, extras)
        yield Step(runs, reads | set(row.inputs), writes, alone=_wants_cluster(row, extras))


def paths_of(line: Documented, row: Small) -> tuple[frozenset[str], frozenset[str]]:
    """Return the files and folders that a line names: those that it reads, and those that it writes.

    What a program of the reader's own does with a path can't be seen: it is taken to write all that it names.
    """
    command = row.command(line.text)
    named = frozenset(_PATH.findall(command))
    if line.kind == "python" or command.startswith("python "):
        return frozenset(), named
    writes = frozenset(_WRITTEN.findall(command))
    return named - writes, writes


def _save(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8")


def _make_input(line: Documented, name: str, python: Path, folder: Path) -> Outcome | None:
    """Make a file that a line takes for granted; return an outcome with the reason where it can't be made."""
    if not (folder / name).exists():
        try:
            INPUTS[name](python, folder)
        except (OSError, RuntimeError) as error:
            return Outcome(line, "", None, "", "", 0.0, f"{name} can't be made: {error}")
    return None


def _wants_cluster(row: Small, extras: Collection[str]) -> bool:
    return "cluster" in row.needs and row.needs <= set(extras)


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


def _outcome(line: Documented, row: Small, python: Path, folder: Path, extras: Collection[str]) -> Outcome:
    """Run a line and return its outcome."""
    command = row.command(line.text)
    lacking = sorted(row.needs - set(extras))
    begun = _processor_seconds()
    with cluster(python, folder, command, wanted=_wants_cluster(row, extras)) as command:
        words = [str(python), "-c", command + _LEAVE] if line.kind == "python" else _words(command, python)
        answer, seconds = _answer(words, folder, _environment(python))
    if _wants_cluster(row, extras):  # the cluster's own counts as well
        seconds = _processor_seconds() - begun
    fault = refusal_fault(answer.returncode, answer.stderr, lacking) if lacking else _fault(answer, row)
    program = line.kind == "python" or line.text.startswith("python examples/")
    if lacking and program and "ModuleNotFoundError: No module named" in answer.stderr:
        fault = ""  # a program of the reader's own, or an example of one, which Python itself refuses
    if not fault and seconds > row.seconds:
        fault = f"it took {seconds:.1f} s of processor time instead of {row.seconds:g} s at most"
    return Outcome(line, command, answer.returncode, answer.stdout, answer.stderr, seconds, fault)


def _answer(
    words: list[str], folder: Path, environment: dict[str, str]
) -> tuple[subprocess.CompletedProcess[str], float]:
    """Run a command; return how it ended, and its processor time, that of its own processes included."""
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            words, cwd=folder, stdin=subprocess.DEVNULL, stdout=output, stderr=errors, env=environment
        )
        limit = threading.Timer(_LIMIT, process.kill)
        limit.start()
        _, status, used = os.wait4(process.pid, 0)
        limit.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        said = []
        for file in (output, errors):
            file.seek(0)
            said.append(file.read().decode("utf-8", "replace"))
    return subprocess.CompletedProcess(words, process.returncode, *said), used.ru_utime + used.ru_stime


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
