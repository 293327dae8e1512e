"""Documents with places for tables between markers, which the commands that measure fill."""

from __future__ import annotations

from collections.abc import Mapping

from .errors import InputError

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
