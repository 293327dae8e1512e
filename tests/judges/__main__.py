"""Has every judge judge one small road's files and prints what it says: python -m tests.judges [NAME...]"""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.judges.registry import JUDGES, REQUIRED, Judge
from tests.judges.samples import Samples

_SHOWN = 5
"""Issues of a judge that are printed."""


@dataclass(frozen=True)
class Verdict:
    """Verdict of a judge.

    Attributes:
        name, manager, install, judges: as in `Judge`.
        version: None if it isn't here.
        issues: what it found; None if it isn't here.
        required: whether it should be here.
    """

    name: str
    manager: str
    install: str
    judges: str
    version: str | None
    issues: list[str] | None
    required: bool

    def summary(self) -> str:
        """Return the verdict in a few words."""
        if self.issues is None:
            return f"not here: {self.install}"
        return f"{len(self.issues)} issues" if self.issues else "valid"


def judged(judge: Judge, samples: Samples) -> Verdict:
    """Have a judge that is here, or can be brought, judge."""
    if judge.version() is None and judge.bring:
        judge.bring()
    version, issues = judge.version(), None
    if version is not None:
        try:
            with _quiet():
                issues = judge.verdict(samples)
        except Exception as fault:  # whatever a program of others makes of a wrong file
            issues = [f"{type(fault).__name__}: {fault}"]
    required = bool(os.environ.get(REQUIRED)) and judge.comes_with_pip()
    return Verdict(judge.name, judge.manager, judge.install, judge.judges, version, issues, required)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what judges log, warn of and print, also beside Python, off the terminal."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(number) for number in (1, 2)]
    with Path(os.devnull).open("wb") as nowhere:
        try:
            for number in (1, 2):
                os.dup2(nowhere.fileno(), number)
            with warnings.catch_warnings(action="ignore"):
                yield
        finally:
            for number, copy in zip((1, 2), kept, strict=True):
                os.dup2(copy, number)
                os.close(copy)
            logging.disable(before)


def table(verdicts: Iterable[Verdict]) -> str:
    """Return verdicts as a table, and the first issues of each below."""
    rows = [("judge", "version", "judges", "verdict")]
    below = []
    for verdict in verdicts:
        rows.append((verdict.name, verdict.version or "-", verdict.judges, verdict.summary()))
        below += [f"{verdict.name}: {issue}" for issue in (verdict.issues or [])[:_SHOWN]]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([*lines, *below])


def exit_code(verdicts: Iterable[Verdict]) -> int:
    """Return 1 if a judge found something, or isn't here though it should."""
    return int(any(verdict.issues or (verdict.required and verdict.issues is None) for verdict in verdicts))


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.judges", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(JUDGES)}; all if none is given")
    parser.add_argument("--quick", action="store_true", help="without those that have to be downloaded or built")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    if unknown := set(options.names) - set(JUDGES):
        parser.error(f"no judge is called {', '.join(sorted(unknown))}")
    chosen = [JUDGES[name] for name in options.names] or list(JUDGES.values())
    with tempfile.TemporaryDirectory(prefix="synthroads-judges-") as name:
        samples = Samples(Path(name))
        verdicts = [judged(judge, samples) for judge in chosen if not (options.quick and judge.slow)]
    print(json.dumps([asdict(verdict) for verdict in verdicts], indent=2) if options.json else table(verdicts))
    return exit_code(verdicts)


if __name__ == "__main__":
    sys.exit(main())
