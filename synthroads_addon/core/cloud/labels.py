"""The classes of points: 17 in full, 5 in short, and their codes in LAS. The table is data (`presets/classes.json`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np

from ..schema import read_json

PRESETS = Path(str(resources.files(__package__))).parents[1] / "presets"


@dataclass(frozen=True)
class PointClass:
    """One semantic class.

    Attributes:
        id: 0 to 254; the value of the faces' ``class_id`` and of the cloud's ``class_id``.
        name: as in scenario files and legends.
        five: name of the class that it belongs to in the scheme of five.
        las: code in the LAS field ``classification`` (ASPRS LAS 1.4 R15 table 17; 64 and above are user-defined).
        color: sRGB for previews, 0 to 255.
    """

    id: int
    name: str
    five: str
    las: int
    color: tuple[int, int, int]


UNLABELLED = 255
"""`class_id` of faces that carry no label."""


@cache
def classes() -> tuple[PointClass, ...]:
    """Return all classes ordered by id."""
    table = read_json(PRESETS / "classes.json")["classes"]
    rows = [PointClass(r["id"], r["name"], r["five"], r["las"], tuple(r["color"])) for r in table]
    return tuple(sorted(rows, key=lambda row: row.id))


@cache
def class_id(name: str) -> int:
    """Return the id of the class `name`; KeyError if there is none."""
    return {row.name: row.id for row in classes()}[name]


def las_codes() -> np.ndarray:
    """Return a (256,) uint8 table from ``class_id`` to the LAS classification; unlabelled is 1."""
    table = np.ones(256, dtype=np.uint8)
    for row in classes():
        table[row.id] = row.las
    return table


def class_colors() -> np.ndarray:
    """Return a (256, 3) uint8 table of preview colours by ``class_id``; unlabelled is magenta."""
    table = np.full((256, 3), (255, 0, 255), dtype=np.uint8)
    for row in classes():
        table[row.id] = row.color
    return table
