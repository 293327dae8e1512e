"""Figures of commands that were run on wrong files: how many, refused or not, the longest, the largest; as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

FIGURES = "figures of commands"
"""Property of a test's report."""


@dataclass
class Figures:
    """Figures of the cases of a target: a command and what is made wrong for it."""

    target: str
    cases: int = 0
    taken: int = 0
    refused: int = 0
    seconds: float = 0.0
    memory_mb: float = 0.0

    def add(self, code: int, seconds: float, memory: float) -> None:
        """Count a case by its exit code, processor's seconds and memory, MB."""
        self.cases += 1
        self.taken += code != 2
        self.refused += code == 2
        self.seconds, self.memory_mb = max(self.seconds, round(seconds, 2)), max(self.memory_mb, round(memory))


def figures_table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the figures of all targets as lines, and their sum."""
    form = "{:<40} {:>6} {:>6} {:>8} {:>10} {:>10}"
    lines = [form.format("command and what is made wrong", "cases", "taken", "refused", "longest s", "most MB")]
    lines += [form.format(*row.values()) for row in sorted(rows, key=lambda row: row["target"])]
    sums = [sum(row[name] for row in rows) for name in ("cases", "taken", "refused")]
    most = [max(row[name] for row in rows) for name in ("seconds", "memory_mb")]
    return [*lines, form.format("all", *sums, *most)]
