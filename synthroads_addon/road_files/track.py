"""The path of a vehicle as a line of points: SBET, and CSV that has a column of times."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..base.errors import MissingFileError
from ..base.files import read_text
from ..scanning.platforms.sbet import is_sbet, read_records
from .points import PointLine
from .xml_text import check_size

__all__ = ["has_times", "is_sbet", "read_sbet"]
_ELLIPSOIDAL = (
    "its heights count from the ellipsoid of WGS 84: --height-above-road takes the geoid's height off as well"
)


def read_sbet(path: Path) -> list[PointLine]:
    """Return the path in an SBET file (radians; heights above the ellipsoid) as one line in degrees.

    Raises:
        MissingFileError, InputError: the file can't be read, or holds what is no trajectory.
    """
    try:
        check_size(path)
        data = path.read_bytes()
    except OSError as error:
        raise MissingFileError(str(path), None, f"cannot be read ({error.strerror})") from None
    records = read_records(path.name, data)
    points = np.column_stack([np.rad2deg(records[:, [2, 1]]), records[:, 3]])
    is_flat = not points[:, 2].any()
    return [
        PointLine(path.stem, points, not is_flat, "SBET path", driven=True, remarks=() if is_flat else (_ELLIPSOIDAL,))
    ]


def has_times(path: Path) -> bool:
    """Return whether a file is CSV with columns ``time``, ``x`` and ``y``: the path of a vehicle, and no axis."""
    text = read_text(str(path), "must be CSV or GeoJSON", "must be a readable axis file", encoding="utf-8-sig")
    lines = (line for line in text[: 1 << 16].splitlines() if line.strip() and not line.lstrip().startswith("#"))
    header = next(lines, "").lower()
    for separator in ";,\t":
        header = header.replace(separator, " ")
    names = [word.strip("\"'") for word in header.split()]
    return "time" in names and {"x", "y"} <= set(names)
