"""The XML of OpenDRIVE files: elements with numbers that are short and the same on every machine."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree  # nosec B405 # it writes files and reads none

from ...base.schema import round_value

Element = ElementTree.Element
Value = str | int | float | bool | None

DIGITS = 9
"""Decimals of lengths (m) and angles (rad)."""
PLAN_DIGITS = 7
"""Decimals of what a sine or a logarithm went into: its last bits differ between machines."""
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_VERBATIM = "verbatim:"


def element(parent: Element | None, tag: str, attributes: Mapping[str, Value] | None = None) -> Element:
    """Return a new XML element, added to its parent if given; attributes that are None are left out."""
    texts = {name: attribute_text(value) for name, value in (attributes or {}).items() if value is not None}
    return ElementTree.Element(tag, texts) if parent is None else ElementTree.SubElement(parent, tag, texts)


def attribute_text(value: str | int | float | bool) -> str:
    """Return a value as the text of an OpenDRIVE attribute; floats are rounded, characters XML forbids are removed."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(round_value(value, DIGITS)).removesuffix(".0")
    return _FORBIDDEN.sub("", str(value))


def add_cubic(parent: Element, tag: str, position: Mapping[str, Value], coefficients: Sequence[float]) -> Element:
    """Add and return an element with the coefficients of a cubic a + b u + c u^2 + d u^3, which begins at `position`.

    Coefficients have 12 significant digits: at 100 m a d of 12 digits is exact to less than a nanometre.
    """
    a, *higher_coefficients = coefficients
    texts = {name: f"{value + 0.0:.12g}" for name, value in zip("bcd", higher_coefficients, strict=True)}
    return element(parent, tag, {**position, "a": float(a), **texts})


def add_user_data(parent: Element, code: str, value: Value) -> None:
    """Add a `userData` element with a code and a value, for what OpenDRIVE has no attribute for."""
    element(parent, "userData", {"code": code, "value": value})


def add_object_data(parent: Element, name: str, instance: int, **further_values: Value) -> None:
    """Add `userData` elements with an object's instance number, id and further values; None is left out."""
    for code, value in {"instance": instance, "id": name, **further_values}.items():
        if value is not None:
            add_user_data(parent, code, value)


def add_cdata(parent: Element, tag: str, content: str) -> None:
    """Add an element whose text is to be written as CDATA, as the standard asks for."""
    element(parent, tag).text = _VERBATIM + content


def write_xml(root: Element, path: Path) -> None:
    """Write an element tree to an XML file, indented, in UTF-8 with Unix line ends."""
    ElementTree.indent(root, " ")
    content = ElementTree.tostring(root, encoding="unicode")
    content = re.sub(f">{_VERBATIM}([^<]*)<", _as_cdata, content)
    path.write_text(f'<?xml version="1.0" encoding="UTF-8"?>\n{content}\n', encoding="utf-8", newline="\n")


def _as_cdata(match: re.Match[str]) -> str:
    """Return an element's marked text as a CDATA section, with the XML escapes undone.

    ``]]>`` would end the section, so it is split over two of them.
    """
    content = match[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&").replace("]]>", "]]]]><![CDATA[>")
    return f"><![CDATA[{content}]]><"
