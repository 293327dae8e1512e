"""XML of other people: read without its document type, by local names, with numbers that are told by their place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser  # nosec B405 (no document type)

from ..base.errors import InputError, MissingFileError

LARGEST = 512 << 20
"""Largest file, bytes."""


def refuse_doctype(name: str) -> None:
    """Raise `InputError` for a document type: it may define entities, and no format of roads has one."""
    raise InputError("document type", name, "must be removed, as entities aren't read")


class _Builder(TreeBuilder):
    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse a document type."""
        refuse_doctype(name)


def read_xml(path: Path) -> Element:
    """Return the root of an XML file; raises what `parse_xml` does."""
    root: Element = parse_xml(path, _Builder())
    return root


def parse_xml(path: Path, target: Any) -> Any:
    """Return the result of a parser's target for an XML file; the target must refuse document types (`refuse_doctype`).

    Args:
        path: the file.
        target: with the methods of `xml.etree.ElementTree.TreeBuilder`.

    Raises:
        MissingFileError: the file can't be read.
        InputError: it is no XML, has a document type, or is larger than `LARGEST`.
    """
    parser = XMLParser(target=target)  # nosec B314 (a document type is refused, so there are no entities)
    try:
        check_size(path)
        with path.open("rb") as file:
            while part := file.read(1 << 20):
                parser.feed(part)
        return parser.close()
    except OSError as error:
        raise MissingFileError(str(path), None, f"cannot be read ({error.strerror})") from None
    except (ParseError, ValueError, LookupError) as error:
        raise InputError(str(path), None, f"must be valid XML ({error})") from None


def check_size(path: Path) -> None:
    """Raise `InputError` for a file larger than `LARGEST`; OSError where no file can be looked at."""
    size = path.stat().st_size
    if size > LARGEST:
        raise InputError(str(path), f"{size / 1e6:,.0f} MB", f"must be at most {LARGEST / 1e6:,.0f} MB")


def on_one_line(text: str) -> str:
    """Return a text with a space in place of each character that isn't printed, so that remarks with it are lines."""
    return text if text.isprintable() else "".join(c if c.isprintable() else " " for c in text)


def local_name(element: Element) -> str:
    """Return an element's name without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def children(element: Element, *names: str) -> list[Element]:
    """Return an element's children of some names, whatever their namespace, in the file's order."""
    return [child for child in element if local_name(child) in names]


def child(element: Element, name: str) -> Element | None:
    """Return an element's first child of a name, None without one."""
    return next(iter(children(element, name)), None)


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return an attribute that is a finite number; `default` where there is none.

    Raises:
        InputError: it is missing, or no finite number.
    """
    text = element.get(name)
    if text is None:
        if default is not None:
            return default
        raise InputError(f"{local_name(element)} {name}", None, "is missing, but must be a number")
    return finite(f"{local_name(element)} {name}", text)


def finite(place: str, text: Any) -> float:
    """Return a text's finite number, at most 1e12 in size; raise `InputError` naming a place for any other text."""
    try:
        value = float(text)
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not abs(value) <= 1e12:
        raise InputError(place, text, "must be a finite number")
    return value
