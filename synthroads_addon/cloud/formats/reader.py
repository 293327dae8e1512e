"""`CloudReader`: what the readers of all formats have in common."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...base.classes import ClassScheme, asprs_scheme, stored_scheme
from ...base.errors import InputError
from ..layers import Attribute, attributes_of
from ..points import PointBlock

BLOCK = 500_000
"""Points that are read at a time."""
_LARGEST_SCALE = 1e300


@dataclass(frozen=True)
class CloudHeader:
    """What a cloud's file says of itself.

    Attributes:
        path: the file.
        kind: ``LAS 1.4, point format 7, LAZ`` and the like.
        count: number of points.
        offset: (3,) map coordinates near the points, m.
        crs_text: coordinate system as WKT, or None.
        epsg: its EPSG code, or None.
        intensity_scale: 16-bit steps per unit of `PointBlock.intensity`; None if the file doesn't say, whose
            intensities are then as they stand.
        scheme: the classes that ``class_id`` counts.
        labelled: whether the file has the project's ``class_id``; else ``class_id`` holds LAS codes.
        attributes: what the file holds of each point, of those known here.
        has_color: whether it holds colours.
        left_out: names of what it holds beyond that, which isn't read.
    """

    path: Path
    kind: str
    count: int
    offset: NDArray[np.float64]
    crs_text: str | None = None
    epsg: int | None = None
    intensity_scale: float | None = None
    scheme: ClassScheme = field(default_factory=lambda: asprs_scheme(range(256)))
    labelled: bool = False
    attributes: tuple[Attribute, ...] = ()
    has_color: bool = False
    left_out: tuple[str, ...] = ()


class CloudReader(ABC):
    """An open cloud; a context manager.

    Attributes:
        header: what the file says of itself.
    """

    header: CloudHeader

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @abstractmethod
    def blocks(self, size: int = BLOCK) -> Iterator[PointBlock]:
        """Yield all points in the file's order, at most ``size`` at a time.

        What the file doesn't hold is 0, or NaN for range and incidence.

        Raises:
            InputError: the file is truncated or damaged.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the file; it may be closed already."""


def epsg_of(text: str | None) -> int | None:
    """Return the EPSG code that WKT 1 or 2 ends with, or None."""
    found = re.search(r'(?:AUTHORITY|ID)\["EPSG",\s*"?(\d+)"?\](?:\]|\s)*$', text.rstrip("\0 \n")) if text else None
    return int(found[1]) if found else None


def header_from_notes(path: Path, kind: str, count: int, names: set[str], notes: Any) -> CloudHeader:
    """Return the header of a file of the project's own: PLY, E57 or NPZ with notes as JSON data.

    Args:
        names: of what is stored of each point.
        notes: `CloudWriter.notes` with ``offset`` and ``crs``; None for a file of others.
    """
    if not isinstance(notes, dict):
        return CloudHeader(path, kind, count, np.zeros(3), attributes=attributes_of(names))
    text = notes.get("crs")
    try:
        offset = np.array(notes["offset"], dtype=np.float64).reshape(3)
    except (KeyError, TypeError, ValueError, OverflowError):
        offset = np.full(3, np.nan)
    if not np.isfinite(offset).all() or not isinstance(text, str | None):
        raise InputError(str(path), None, "its notes on offset and coordinate system are damaged")
    return CloudHeader(
        path,
        kind,
        count,
        offset,
        crs_text=text,
        epsg=epsg_of(text),
        intensity_scale=intensity_scale(path, notes),
        scheme=stored_scheme(notes.get("classes"), str(path)),
        labelled=True,
        attributes=attributes_of(names),
        has_color=True,
    )


def intensity_scale(path: Path, notes: dict[str, Any]) -> float:
    """Return the 16-bit steps per unit of intensity that a file's notes tell.

    Raises:
        InputError: they tell none, or it is no finite number above 0.
    """
    scale = notes.get("intensity_scale")
    if not isinstance(scale, int | float) or not 0.0 < scale <= _LARGEST_SCALE:
        raise InputError(f"{path}: intensity_scale", scale, "must be a finite number above 0")
    return float(scale)


def finite_coordinates(path: Path, done: int, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coordinates (N, 3) of a block as they are.

    Args:
        path: the file.
        done: points before them.
        xyz: the coordinates, m.

    Raises:
        InputError: one is NaN or infinite; the message names the point.
    """
    if not np.isfinite(xyz).all():
        point, axis = np.argwhere(~np.isfinite(xyz))[0]
        raise InputError(f"{path}: {'xyz'[axis]} of point {done + point:,}", xyz[point, axis], "must be finite")
    return xyz


def damaged(path: Path, at: int, count: int) -> InputError:
    """Return the error of a file whose points can be read up to the one numbered ``at`` only."""
    return InputError(str(path), None, f"is truncated or damaged after {at:,} of {count:,} points")
