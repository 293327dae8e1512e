"""Tables as plain text for people at a terminal, and in Markdown."""

import re
from collections.abc import Collection, Iterable, Sequence

_NUMBER = re.compile(r"[-–+\d.,]*( \([\d.,]+\))?")


def text_table(
    titles: Sequence[str], rows: Sequence[Sequence[str]], right_aligned: Collection[int] | None = None
) -> list[str]:
    """Return the lines of a plain-text table with columns two spaces apart.

    Args:
        titles: titles of the columns.
        rows: cells, as many each as there are titles.
        right_aligned: columns that are right-aligned; None: those behind the first whose cells are numbers.
    """
    if right_aligned is None:
        right_aligned = [i for i in range(1, len(titles)) if all(_NUMBER.fullmatch(row[i]) for row in rows)]
    widths = [max(len(row[column]) for row in (titles, *rows)) for column in range(len(titles))]
    lines = []
    for row in (titles, *rows):
        cells = [
            cell.rjust(width) if column in right_aligned else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return lines


def markdown_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table; each row has as many cells as there are titles."""
    title_row, *body_rows = (f"| {' | '.join(cells)} |" for cells in (titles, *rows))
    return [title_row, "|" + "---|" * len(titles), *body_rows]
