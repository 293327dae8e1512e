"""XML files whose elements and attributes are taken out, doubled, moved, renamed or given other values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from hypothesis import strategies as st

VALUES = (
    *(
        "",
        " ",
        "0",
        "-0.0",
        "-1",
        "1e-300",
        "1e-9",
        "1e-6",
        "0.1",
        "1e5",
        "1e6",
        "-1e5",
        "1e12",
        "-1e12",
        "1e300",
        "nan",
    ),
    *("inf", "x", "3.14159", "400", "9" * 400, "true", "none", "both", "{}", "[1, 2]", "null", "\u2028", "\u202e", "é"),
)
"""Values that an attribute is given."""


def wrong_xml(files: Sequence[bytes]) -> st.SearchStrategy[bytes]:
    """Return well-formed files that differ from one of some files in one to three elements."""
    change = st.tuples(st.integers(0, 2**31), st.integers(0, 2**31), st.sampled_from(_CHANGES), st.sampled_from(VALUES))
    return st.builds(_changed, st.sampled_from(list(files)), st.lists(change, min_size=1, max_size=3))


def _changed(file: bytes, changes: list[tuple[int, int, Callable[..., None], str]]) -> bytes:
    root = ElementTree.fromstring(file)  # nosec B314 (our own files)
    for number, other, change, value in changes:
        places = [(parent, child) for parent in root.iter() for child in parent]
        if places:
            parent, child = places[number % len(places)]
            change(parent, child, other, value, places)
    return ElementTree.tostring(root)


def _take_out(parent: Element, child: Element, *_: Any) -> None:
    parent.remove(child)


def _empty(_: Element, child: Element, *__: Any) -> None:
    child[:] = []
    child.text = None


def _double(parent: Element, child: Element, *_: Any) -> None:
    parent.insert(list(parent).index(child), child)


def _rename(_: Element, child: Element, other: int, __: str, places: list[tuple[Element, Element]]) -> None:
    child.tag = places[other % len(places)][1].tag


def _move(parent: Element, child: Element, other: int, _: str, places: list[tuple[Element, Element]]) -> None:
    """Put an element below another one, but not below itself."""
    there = places[other % len(places)][1]
    if there not in list(child.iter()):
        parent.remove(child)
        there.append(child)


def _reverse(parent: Element, *_: Any) -> None:
    parent[:] = list(parent)[::-1]


def _lose(_: Element, child: Element, other: int, *__: Any) -> None:
    if child.attrib:
        del child.attrib[sorted(child.attrib)[other % len(child.attrib)]]


def _set(_: Element, child: Element, other: int, value: str, *__: Any) -> None:
    if child.attrib:
        child.set(sorted(child.attrib)[other % len(child.attrib)], value)


def _exchange(_: Element, child: Element, other: int, __: str, places: list[tuple[Element, Element]]) -> None:
    """Give an attribute the value of one of another element."""
    values = [value for _, one in places for value in one.attrib.values()]
    if child.attrib and values:
        child.set(sorted(child.attrib)[other % len(child.attrib)], values[(other // 7) % len(values)])


def _scale(_: Element, child: Element, other: int, *__: Any) -> None:
    factor = (-1.0, 0.0, 0.5, 1.001, 3.0, 100.0, 1e4, 1e-3, 1e-6)[other % 9]
    for name, text in child.attrib.items():
        try:
            child.set(name, repr(float(text) * factor))
        except ValueError:
            continue


_CHANGES = (_take_out, _empty, _double, _rename, _move, _reverse, _lose, _set, _set, _set, _exchange, _exchange, _scale)
