"""Documents with places for tables between markers, which the commands that measure fill."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from .errors import InputError
from .files import write_file

BEGIN, END = "<!-- table: {} -->", "<!-- end of table -->"


def replaced(document: str, tables: Mapping[str, str]) -> str:
    """Return a document with new text between the markers of the named tables; all else stays.

    Raises:
        InputError: a table has no markers in it, or more than one pair.
    """
    for name, text in tables.items():
        begin = BEGIN.format(name)
        if document.count(begin) != 1 or END not in document.partition(begin)[2]:
            raise InputError("document", begin, f"must stand in it once, followed by {END}")
        before, _, rest = document.partition(begin)
        document = f"{before}{begin}\n{text.rstrip()}\n{END}{rest.partition(END)[2]}"
    return document


def fill(document: Path | None, names: Iterable[str], make: Callable[[], Mapping[str, str]]) -> Mapping[str, str]:
    """Make tables and write them into a document, of which it is known before the work that it has room for them.

    Args:
        document: Markdown with markers; None: nothing is written.
        names: of the tables.
        make: returns their texts by name.

    Raises:
        InputError: see `replaced`.
        OutputError: the document can't be written.
    """
    if document is None:
        return make()
    replaced(document.read_text(encoding="utf-8"), dict.fromkeys(names, ""))
    tables = make()
    text = replaced(document.read_text(encoding="utf-8"), tables)
    write_file(document, text.encode(), overwrite=True)
    return tables
