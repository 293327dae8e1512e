"""Documents with places for tables between markers, which the commands that measure fill."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_file_target, write_file

BEGIN, END = "<!-- table: {} -->", "<!-- end of table -->"


FIELD = "--document"
"""Option by which the commands name the document."""


def replace_tables(document: str, tables: Mapping[str, str]) -> str:
    """Return a document's text with the text between the markers of the named tables replaced.

    Raises:
        InputError: a table has no markers in it, or more than one pair.
    """
    for name, text in tables.items():
        begin = BEGIN.format(name)
        if document.count(begin) != 1 or END not in document.partition(begin)[2]:
            raise InputError(FIELD, begin, f"must stand in it once, followed by {END}")
        before, _, rest = document.partition(begin)
        document = f"{before}{begin}\n{text.rstrip()}\n{END}{rest.partition(END)[2]}"
    return document


def put_tables(document: Path | None, names: Iterable[str], make: Callable[[], Mapping[str, str]]) -> Mapping[str, str]:
    """Make tables and write them between a document's markers, which are checked first; return the tables by name.

    Args:
        document: Markdown with markers; None: nothing is written.
        names: of the tables.
        make: returns their texts by name.

    Raises:
        InputError: the document can't be read, or see `replace_tables`.
        OutputError: the document can't be written.
    """
    if document is None:
        return make()
    replace_tables(_read_document(document), dict.fromkeys(names, ""))
    check_file_target(document, FIELD, overwrite=True)
    tables = make()
    write_file(document, replace_tables(_read_document(document), tables).encode(), FIELD, overwrite=True)
    return tables


def _read_document(document: Path) -> str:
    """Return a document's text; InputError if it can't be read."""
    try:
        return document.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(FIELD, str(document), f"cannot be read ({error.strerror})") from None
