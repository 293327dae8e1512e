"""`CloudWriter`: what the writers of all formats have in common."""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...base.classes import ClassScheme, class_scheme
from ...base.crs import wkt
from ...base.errors import InputError, OutputError
from ..layers import ATTRIBUTES, DEFAULT_ATTRIBUTES, Attribute, Column, columns
from ..points import PointBlock


class CloudWriter(ABC):
    """Writes point blocks to one file; a context manager.

    The file appears under its name only when the context ends without an exception.

    Args:
        path: file to write; one that is there is replaced.
        epsg: map coordinate system, or None.
        offset: (3,) map coordinates near the points, m; rounded down to whole metres.
        intensity_scale: 16-bit steps per unit of `PointBlock.intensity`.
        attributes: what is written of each point beyond what every cloud holds.
        scheme: classes that the points' ``class_id`` is turned into; the 17 as they are if not given.
        crs_text: the coordinate system as WKT, in place of ``epsg``.

    Attributes:
        count: points written so far.
        clipped: points whose intensity exceeded 16 bits.

    Raises:
        InputError: the coordinate system is unknown.
        OutputError: the file can't be written, or a value doesn't fit into its field: nothing ever wraps.
    """

    faults: tuple[type[Exception], ...] = (OSError,)
    """What the library beneath raises where it can't write."""

    def __init__(
        self,
        path: Path,
        epsg: int | None,
        offset: NDArray[np.float64],
        intensity_scale: float,
        attributes: tuple[Attribute, ...] = DEFAULT_ATTRIBUTES,
        scheme: ClassScheme | None = None,
        crs_text: str | None = None,
    ) -> None:
        self.path = path
        self.epsg = epsg
        self.crs_text = wkt(epsg) if epsg is not None else crs_text
        self.offset = np.floor(np.asarray(offset, dtype=np.float64))
        self.intensity_scale = float(intensity_scale)
        self.attributes = tuple(name for name in ATTRIBUTES if name in attributes)
        self.columns = columns(self.attributes)
        self.scheme = scheme or class_scheme("17")
        self.count = 0
        self.clipped = 0
        self._temporary = path.with_name(f".{path.name}.partial")
        if not np.isfinite(self.offset).all() or not (0 < self.intensity_scale < np.inf):
            raise InputError("offset, intensity_scale", [*self.offset, intensity_scale], "must be finite numbers")

    def __enter__(self) -> Self:
        try:
            self._open()
        except self.faults as problem:
            self._abandon()
            raise self._unwritable(problem) from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        done = False
        try:
            if kind is None:
                self._finish()
                self._temporary.replace(self.path)
                done = True
        except self.faults as problem:
            raise self._unwritable(problem) from None
        finally:
            if not done:
                self._abandon()

    def write(self, block: PointBlock) -> None:
        """Append a block; raise `OutputError` if a value doesn't fit or the disk is full."""
        if len(block) == 0:
            return
        for column in self.columns:
            if getattr(block, column.array) is None:
                raise OutputError(str(self.path), column.array, "is to be written, but the points don't have it")
        try:
            self._append(block)
        except self.faults as problem:
            raise self._unwritable(problem) from None
        self.count += len(block)

    def notes(self) -> dict[str, Any]:
        """Return what the file says of itself as JSON data."""
        return {
            "intensity_scale": self.intensity_scale,
            "attributes": list(self.attributes),
            "classes": self.scheme.to_dict(),
        }

    def integers(self, values: NDArray[Any], kind: str, name: str, scale: float | None = None) -> NDArray[Any]:
        """Return values (N,) as whole steps, rounded, in the integer type ``kind``.

        Raises:
            OutputError: a value is NaN or doesn't fit.
        """
        if values.dtype == np.dtype(kind) and scale is None:
            return values
        limits = np.iinfo(kind)
        steps = np.asarray(values * (1.0 / scale)) if scale else np.array(values)
        if steps.dtype.kind == "f":
            np.rint(steps, out=steps)
        low, high = steps.min(), steps.max()
        if not (low >= limits.min and high <= limits.max):
            worst = low if not low >= limits.min else high
            step = scale or 1
            allowed = f"{name} must lie from {limits.min * step:g} to {limits.max * step:g}"
            raise OutputError(str(self.path), float(worst * step), allowed)
        return steps.astype(kind)

    def finite(self, values: NDArray[Any], name: str) -> NDArray[Any]:
        """Return values as they are; raise `OutputError` if one is NaN or infinite."""
        if not np.isfinite(values).all():
            worst = values[~np.isfinite(values).reshape(len(values), -1).all(axis=1)][0]
            raise self.refused(worst.tolist(), f"{name} must be finite")
        return values

    def own_class_ids(self, block: PointBlock) -> NDArray[np.uint8]:
        """Return the block's classes (N,) in the file's scheme."""
        return np.take(self.scheme.ids, self.integers(block.class_id, "uint8", "class_id"))

    def stored(self, column: Column, block: PointBlock) -> NDArray[Any]:
        """Return a column (N,) of a block as the integers that LAS and E57 store."""
        if column.array == "class_id":
            return self.own_class_ids(block)
        values = column.of(block)
        if column.local and column.component is not None:
            values = values - self.offset[column.component]
        return self.integers(values, column.dtype, column.name, column.scale)

    def content_id(self, *more: object) -> str:
        """Return 32 hexadecimal digits that depend on the file's description alone: no wall clock, no chance."""
        text = json.dumps([self.notes(), self.crs_text, self.offset.tolist(), self.count, *more], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    @abstractmethod
    def _open(self) -> None:
        """Begin the temporary file."""

    @abstractmethod
    def _append(self, block: PointBlock) -> None:
        """Write a block that isn't empty."""

    @abstractmethod
    def _finish(self) -> None:
        """Complete and close the temporary file."""

    @abstractmethod
    def _abandon(self) -> None:
        """Close and remove the temporary file, in whatever state; must not raise."""

    def refused(self, value: object, allowed: str) -> OutputError:
        """Return the error of a value that the file can't hold."""
        return OutputError(str(self.path), value, allowed)

    def _unwritable(self, problem: Exception) -> OutputError:
        reason = getattr(problem, "strerror", None) or " ".join(str(problem).split())[:120]
        return OutputError(str(self.path), None, f"cannot be written ({reason})")


