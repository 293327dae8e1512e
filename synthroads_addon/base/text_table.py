"""Tables as plain text, for people at a terminal."""

from __future__ import annotations

import re
from collections.abc import Sequence

_NUMBER = re.compile(r"[-–+\d.,]*( \([\d.,]+\))?")


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table with columns two spaces apart; behind the first, those of numbers are right-aligned.

    Args:
        head: titles of the columns.
        rows: cells, as many each as there are titles.
    """
    right = [column > 0 and all(_NUMBER.fullmatch(row[column]) for row in rows) for column in range(len(head))]
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    lines = []
    for row in (head, *rows):
        cells = [
            cell.rjust(width) if numbers else cell.ljust(width)
            for cell, width, numbers in zip(row, widths, right, strict=True)
        ]
        lines.append("  ".join(cells).rstrip())
    return lines
