"""How names and units of the schema are written in the panel."""

from __future__ import annotations

from pydantic.fields import FieldInfo

from ...base.schema import note_of, unit_of
from ...cloud.layers import LAYERS
from ...twin.formats import FORMATS

NAMES = {
    "oren_nayar": "Oren–Nayar",
    "bvhtree": "BVH Tree",
    "eevee": "EEVEE",
    "EKA1A": "EKA 1 A",
    "EKA1B": "EKA 1 B",
    "EKA2": "EKA 2",
    "EKA3": "EKA 3",
    "laz": "LAZ",
    "las": "LAS",
    "ply": "PLY",
    "e57": "E57",
    "npz": "NPZ",
    "rules": "By the Rules",
    "random": "At Random",
    "auto": "Automatic",
    "images": "Images Along the Path",
    "returns": "A Pixel per Return",
    "material": "Material",
    "lit": "Sun and Sky",
    "unlit": "Base Colour",
    "false_colour": "Material Layers",
    "direct": "Direct",
    "path": "Whole Light Paths",
    "scene": "Blender File",
    "parameters": "Parameter Set",
    "cloud": "Point Cloud",
    "centerline": "Centreline",
    "previews": "Pictures",
    "range": "Range",
}
"""Values of choices that are written otherwise than with capitals."""

UNITS = {
    "deg": "°",
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
    """Return a unit as people write it."""
    return UNITS.get(unit, unit)


def label(path: str, info: FieldInfo) -> str:
    """Return a field's name in the panel: its title in the schema, or its name there and the unit."""
    if info.title:
        return info.title
    unit = unit_of(info)
    name = path.rpartition(".")[2].removesuffix(_ENDINGS.get(unit, " "))
    text = title_case(name)
    return text if unit in _SILENT else f"{text} ({written_unit(unit)})"


def value_name(path: str, value: str, info: FieldInfo | None = None) -> str:
    """Return what the panel calls a value of a choice, by its declaration in the schema if that says it."""
    labels = (note_of(info, "labels") or {}) if info else {}
    if value in labels:
        return str(labels[value])
    if path == "cloud.attributes":
        return LAYERS[value].label
    if path == "twin":
        return FORMATS[value].label
    return NAMES.get(value) or title_case(value)


def title_case(name: str) -> str:
    """Return a name of the schema with capitals, as Blender writes its labels."""
    words = name.replace("_", " ").split()
    return " ".join(w if i and w in _SMALL_WORDS else w[:1].upper() + w[1:] for i, w in enumerate(words))
