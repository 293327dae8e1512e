"""Where the scanner is at any time: `make_path` for every kind of platform, and what paths follow."""

from __future__ import annotations

from collections.abc import Sequence

from ...base.errors import InputError
from .base import KNOT_ERROR, KNOT_RANGE, TURNAROUND, USUAL, Path, Strip, Usual
from .guides import Guide, RoadGuide, SmoothedGuide
from .moving import MovingPath
from .platform import Platform
from .polyline import PolylineGuide
from .trajectory import TrajectoryPath
from .tripod import TripodPath

__all__ = [
    "KNOT_ERROR",
    "KNOT_RANGE",
    "TURNAROUND",
    "USUAL",
    "Guide",
    "MovingPath",
    "Path",
    "PolylineGuide",
    "RoadGuide",
    "SmoothedGuide",
    "Strip",
    "TrajectoryPath",
    "TripodPath",
    "Usual",
    "make_path",
]


def make_path(platform: Platform, guide: Guide, origin: Sequence[float] | None = None) -> Path:
    """Return the path of a platform.

    Args:
        platform: what carries the scanner, and where; what it leaves open is usual for its kind (`USUAL`).
        guide: the centreline that it follows.
        origin: map coordinates of the local origin (m), for a trajectory's file; the guide's if not given.

    Raises:
        InputError: the path would turn back on itself, a station isn't on the guide, the ground below isn't known, or
            the trajectory's file is missing or wrong.
    """
    if platform.kind == "trajectory":
        return TrajectoryPath(platform, guide, origin)
    if platform.file is not None:
        raise InputError("scan.platform.file", platform.file, f"only a trajectory has one, not a {platform.kind}")
    if platform.kind == "tripod":
        return TripodPath(platform, guide)
    return MovingPath(platform, guide)
