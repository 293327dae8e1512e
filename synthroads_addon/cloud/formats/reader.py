"""`CloudReader`: what the readers of all formats have in common."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...base.arrays import AnyArray, Bool, Float
from ...base.errors import InputError
from ...base.remarks import assume, warn
from ..colours import SIXTEEN_BITS, brightness_text, full_brightness
from ..flags import noise_points, withheld_points, without_flags
from ..layers import STORED_TYPES, make_points
from ..points import PointBlock
from ..strays import FARTHEST
from .header import CloudHeader

BLOCK = 500_000
"""Points that are read at a time."""
PEEK = 10_000
"""Points that are looked at at a time for the largest colour."""
WITHHELD_REMARK = "points are withheld and left out"
NOISE_REMARK = "points of a class of noise (LAS codes 7 and 18) are left out"
_NOT_WHOLE = 1e-3
"""A number farther from a whole one than this isn't one that was rounded on its way."""


class CloudReader(ABC):
    """Base of readers of one cloud file, block by block; a context manager.

    Attributes:
        header: what the file says of itself.
    """

    header: CloudHeader
    _file: Any
    """Open file, or the library's handle of it."""
    _remarks: Counter[str]
    """Remarks on the points being read, as "points ...", with the number of points each."""
    _brightness: float | None = None
    """Stored value of full brightness where it had to be assumed."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def blocks(self, size: int = BLOCK) -> Iterator[PointBlock]:
        """Yield all points in the file's order, as blocks of at most ``size`` points, and check them.

        What the file doesn't hold is 0, or NaN for range and incidence.

        Raises:
            InputError: the file is truncated or damaged, or holds a coordinate that lies on no map, or an intensity
                that is no number.
        """
        position = 0
        scale = self.header.place.scale
        self._remarks = remarks = Counter[str]()
        for stored in self._stored_blocks(size):
            block = stored if scale is None else replace(stored, xyz=stored.xyz * scale)
            yield _check_block(self.header.path, position, block)
            position += len(block)
        for remark, count in remarks.items():
            warn(f"{self.header.path.name}: {count:,} {remark}")

    def usable_blocks(self, size: int = BLOCK) -> Iterator[PointBlock]:
        """Yield the points that may be worked with, as blocks of at most ``size``: neither withheld nor noise.

        Raises:
            InputError: see `blocks`.
        """
        for block in self.blocks(size):
            is_usable = self.usable_points(block)
            yield without_flags(block if is_usable.all() else block.select(is_usable))

    def usable_points(self, block: PointBlock, *, noise: bool = False) -> Bool:
        """Return a mask (N,) of a block's points that may be worked with; the others are counted in a remark.

        Withheld points count as deleted, and points of a class of noise (LAS codes 7 and 18) lie on nothing.

        Args:
            block: of `blocks`, which is being run through.
            noise: whether points of a class of noise may be worked with: where other numbers tell the classes.
        """
        is_withheld = withheld_points(block)
        is_noise = np.zeros(len(block), dtype=bool) if noise else noise_points(block, self.header.scheme) & ~is_withheld
        for points, remark in ((is_withheld, WITHHELD_REMARK), (is_noise, NOISE_REMARK)):
            if points.any():
                self._remarks[remark] += int(np.count_nonzero(points))
        return ~(is_withheld | is_noise)

    @abstractmethod
    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the file's points as blocks of at most ``size`` points, unchecked."""

    def _points(self, stored: dict[str, AnyArray], count: int, position: int) -> PointBlock:
        """Return the block of N points from stored columns and arrays, whole numbers checked; see `make_points`.

        Args:
            stored: as `make_points` takes them; arrays of `FLAGS` too.
            count: N.
            position: points before them, for messages.

        Raises:
            InputError: a number doesn't fit into its array: nothing wraps.
        """
        checked_arrays = {name: self._fit(values, name, position) for name, values in stored.items()}
        return make_points(checked_arrays, self.header.attributes, count)

    def _fit(self, values: AnyArray, name: str, position: int) -> AnyArray:
        """Return values (N, ...) in the type of whole numbers that their name has in blocks, where it has one.

        NaN, and a class of -1, stand for no value in the files of others: they become 0 and are remarked on.

        Args:
            values: as stored.
            name: of the array or column.
            position: points before these, for messages.

        Raises:
            InputError: a value isn't a whole number of that type.
        """
        kind = np.dtype(STORED_TYPES.get(name, "f8"))
        if kind.kind not in "iu" or values.dtype == kind or not values.size:
            return values
        is_missing = np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, dtype=bool)
        if name == "class_id" and values.dtype.kind != "u":
            is_missing |= values == -1
        if is_missing.any():
            self._remarks[f"points have no {name} (NaN or -1): it is read as 0"] += int(np.count_nonzero(is_missing))
            values = np.where(is_missing, 0, values)
        if values.dtype.kind == "b":
            return values.astype(kind)
        rounded = np.rint(values) if values.dtype.kind == "f" else values
        limits = np.iinfo(kind)
        is_wrong = (rounded < limits.min) | (rounded > limits.max)
        if values.dtype.kind == "f":
            is_wrong |= np.abs(rounded - values) > _NOT_WHOLE
        if is_wrong.any():
            point = int(np.argwhere(is_wrong)[0][0])
            wrong_value = values[is_wrong].flat[0]
            requirement = f"must be a whole number from {limits.min} to {limits.max}"
            raise InputError(f"{self.header.path}: {name} of point {position + point:,}", wrong_value, requirement)
        return rounded.astype(kind)

    def _assumed_brightness(self, colors: Iterable[AnyArray], *, is_integer: bool) -> float:
        """Return the stored value of full brightness, assumed from the largest colour and remarked on; cached.

        Args:
            colors: all that the file holds, in parts; no more of them are looked at than it takes.
            is_integer: whether they are whole numbers.
        """
        if self._brightness is None:
            largest_value = 0.0
            for part in colors:
                largest_value = max(largest_value, float(np.nanmax(part, initial=0.0)))
                if (
                    full_brightness(largest_value, is_integer=is_integer) >= SIXTEEN_BITS
                    and not largest_value > SIXTEEN_BITS
                ):
                    break
            self._brightness = full_brightness(largest_value, is_integer=is_integer) if largest_value else SIXTEEN_BITS
            if largest_value and not (is_integer and self._brightness == SIXTEEN_BITS):
                scale = brightness_text(self._brightness)
                assume(f"{self.header.path.name}: its colours, {largest_value:g} at most, are read as {scale}")
        return self._brightness

    def close(self) -> None:
        """Close the file; closing it twice does no harm."""
        self._file.close()


def check_coordinates(path: Path, position: int, xyz: Float) -> Float:
    """Return a block's coordinates (N, 3) unchanged; raise `InputError` if one isn't finite.

    Args:
        path: the file.
        position: points before them.
        xyz: the coordinates, m.

    Raises:
        InputError: one is NaN or infinite; the message names the point.
    """
    if not np.isfinite(xyz).all():
        point, axis = np.argwhere(~np.isfinite(xyz))[0]
        raise InputError(f"{path}: {'xyz'[axis]} of point {position + point:,}", xyz[point, axis], "must be finite")
    return xyz


def _check_block(path: Path, position: int, block: PointBlock) -> PointBlock:
    """Return a block unchanged; raise `InputError` if a coordinate is too large or an intensity isn't finite."""
    if not len(block):
        return block
    xyz = check_coordinates(path, position, block.xyz)
    if max(xyz.max(), -xyz.min()) > FARTHEST:
        point, axis = divmod(int(np.abs(xyz).argmax()), 3)
        requirement = f"must be a map coordinate, at most {FARTHEST:g} m"
        raise InputError(f"{path}: {'xyz'[axis]} of point {position + point:,}", float(xyz[point, axis]), requirement)
    if not np.isfinite(block.intensity).all():
        point = int(np.argmin(np.isfinite(block.intensity)))
        raise InputError(f"{path}: intensity of point {position + point:,}", block.intensity[point], "must be finite")
    return block


def damage_error(path: Path, position: int, count: int) -> InputError:
    """Return, without raising, the `InputError` for a file that is damaged from its point number ``position`` on."""
    return InputError(str(path), None, f"is truncated or damaged after {position:,} of {count:,} points")
