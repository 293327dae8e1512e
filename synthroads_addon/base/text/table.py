"""Tables as plain text for people at a terminal, and in Markdown."""

import re
from collections.abc import Collection, Iterable, Sequence

_NUMBER = re.compile(r"[-–+\d.,]*( \([\d.,]+\))?")


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]], right: Collection[int] | None = None) -> list[str]:
    """Return the lines of a plain-text table with columns two spaces apart.

    Args:
        head: titles of the columns.
        rows: cells, as many each as there are titles.
        right: columns that are right-aligned; None: those behind the first whose cells are numbers.
    """
    if right is None:
        right = [i for i in range(1, len(head)) if all(_NUMBER.fullmatch(row[i]) for row in rows)]
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    lines = []
    for row in (head, *rows):
        cells = [
            cell.rjust(width) if column in right else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return lines


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table; each row has as many cells as there are titles."""
    first, *rest = (f"| {' | '.join(cells)} |" for cells in (head, *rows))
    return [first, "|" + "---|" * len(head), *rest]
