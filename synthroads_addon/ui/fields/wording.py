"""How names and units of the schema are written in the panel."""

from __future__ import annotations

import re

from pydantic.fields import FieldInfo

from ...base.schema import LARGEST, note_of, unit_of

UNITS = {
    "deg": "°",
    "cm3": "cm³",
    "1/km": "per km",
    "1/m2": "per m²",
    "1/ha": "per ha",
    "1/100 m": "per 100 m",
    "1/m": "per m",
    "1/s": "per s",
    "m/m": "1 : n",
}
"""Units that are written otherwise than in the schema."""
BLENDERS = {"m": "LENGTH", "m/s": "VELOCITY", "s": "TIME_ABSOLUTE"}
"""Units that Blender itself writes beside the number, in the scene's system of units."""
_SILENT = ("", "1", "px", *BLENDERS)
_ENDINGS = {"deg": "_deg", "mrad": "_mrad", "kHz": "_khz", "%": "_percent", "mm/h": "_mm_h", "1/s": "_per_second"}
_SMALL_WORDS = {"and", "at", "by", "from", "in", "of", "per", "the", "to"}


def written_unit(unit: str) -> str:
    """Return a schema unit as it is written in the panel."""
    return UNITS.get(unit, unit)


def label(path: str, info: FieldInfo) -> str:
    """Return a field's label in the panel: its title in the schema, else its name in title case with the unit."""
    if info.title:
        return info.title
    unit = unit_of(info)
    name = path.rpartition(".")[2].removesuffix(_ENDINGS.get(unit, " "))
    text = title_case(name)
    return text if unit in _SILENT else f"{text} ({written_unit(unit)})"


def tooltip(info: FieldInfo) -> str:
    """Return a field's description with its unit, its limits and a usual value as an example, where it has them.

    Without a full stop at the end, as Blender adds one.
    """
    text = (info.description or "").removesuffix(".")
    unit = "" if unit_of(info) in ("", "1") else f" {written_unit(unit_of(info))}"
    low, high = (_limit(info, names) for names in (("ge", "gt"), ("le", "lt")))
    if low is not None and high is not None:
        text += f". Allowed: {low:g} to {high:g}{unit}"
    elif low is not None or high is not None:
        text += f". Allowed: {f'from {low:g}' if low is not None else f'up to {high:g}'}{unit}"
    if isinstance(info.default, int | float) and not isinstance(info.default, bool):
        text += f", e.g. {info.default:g}{unit}"
    return text


def _limit(info: FieldInfo, names: tuple[str, ...]) -> float | None:
    """Return a field's limit by the names of its constraint; None if it has none but the schema's own."""
    values = (getattr(entry, name, None) for entry in info.metadata for name in names)
    return next((float(value) for value in values if value is not None and abs(value) < LARGEST), None)


def value_name(value: str, info: FieldInfo) -> str:
    """Return the panel's text for a value of a choice: its label in the schema, else its name in title case."""
    return str((note_of(info, "labels") or {}).get(value) or title_case(value))


def title_case(name: str) -> str:
    """Return a schema name in title case, as Blender writes labels: underscores become blanks."""
    words = name.replace("_", " ").split()
    return " ".join(w if i and w in _SMALL_WORDS else w[:1].upper() + w[1:] for i, w in enumerate(words))


def thing_name(kind: str) -> str:
    """Return a type of thing as people say it: ``TrafficSign`` becomes Traffic Sign."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind)
