"""`CloudWriter`: what the writers of all formats have in common."""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...base.arrays import AnyArray, Float, UInt8
from ...base.classes import ClassScheme, class_scheme
from ...base.errors import InputError, OutputError
from ...base.files import made_folder, sync_file
from ...base.maps.crs import wkt
from ...base.scratch.folders import scratch_folder
from ..flags import FLAGS, WITHHELD, withheld_points, without_flags
from ..layers import ATTRIBUTES, DEFAULT_ATTRIBUTES, Attribute, Column, columns
from ..points import PointBlock


class CloudWriter(ABC):
    """Base of writers of point blocks to one cloud file; a context manager.

    The file appears under its name only when the context ends without an exception.

    Args:
        path: file to write; one that is there is replaced.
        epsg: map coordinate system, or None.
        offset: (3,) map coordinates near the points, m; rounded down to whole metres.
        intensity_scale: 16-bit steps per unit of `PointBlock.intensity`.
        attributes: what is written of each point beyond what every cloud holds.
        scheme: classes that the points' ``class_id`` is turned into; the 17 as they are if not given.
        crs_text: the coordinate system as WKT, in place of ``epsg``.
        standard_time: whether ``gps_time`` counts from the epoch of GPS, less 1e9 s (LAS 1.4 R15, table 4), rather
            than from the scan's start or the week's.

    Attributes:
        count: points written so far.
        clipped: points whose intensity exceeded 16 bits.
        lost: number of points by flag that the format has no field for; withheld ones aren't written at all then.

    Raises:
        InputError: the coordinate system is unknown.
        OutputError: the file can't be written, or a value doesn't fit into its field: nothing ever wraps.
    """

    source_id = 0
    """Number of the flight line that a file is of, for formats that hold it; 0 for several."""
    keeps_flags = False
    """Whether the format has fields for `FLAGS`."""
    faults: tuple[type[Exception], ...] = (OSError,)
    """Errors that the library beneath raises where it can't write."""
    _file: Any
    """Open temporary file, or the library's handle of it."""
    _temporary: Path
    """File that is written, in a scratch folder beside the final place."""

    def __init__(
        self,
        path: Path,
        epsg: int | None,
        offset: Float,
        intensity_scale: float,
        attributes: tuple[Attribute, ...] = DEFAULT_ATTRIBUTES,
        scheme: ClassScheme | None = None,
        crs_text: str | None = None,
        standard_time: bool = False,
    ) -> None:
        self.path = path
        self.epsg = epsg
        self.crs_text = wkt(epsg) if epsg is not None else crs_text
        self.offset = np.floor(np.asarray(offset, dtype=np.float64))
        self.intensity_scale = float(intensity_scale)
        self.attributes = tuple(name for name in ATTRIBUTES if name in attributes)
        self.columns = columns(self.attributes)
        self.scheme = scheme or class_scheme("17")
        self.standard_time = standard_time
        self.count = 0
        self.clipped = 0
        self.lost: dict[str, int] = {}
        self._scratch = ExitStack()
        if not np.isfinite(self.offset).all() or not (0 < self.intensity_scale < np.inf):
            raise InputError("offset, intensity_scale", [*self.offset, intensity_scale], "must be finite numbers")

    def __enter__(self) -> Self:
        try:
            with self._output_errors():
                self._scratch.enter_context(made_folder(self.path.parent))
                self._temporary = self._scratch.enter_context(scratch_folder(self.path.parent)) / self.path.name
                self._open()
        except BaseException:
            self._abandon()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                with self._output_errors():
                    self._finish()
                    sync_file(self._temporary)
                    self._temporary.replace(self.path)
        finally:
            self._abandon()

    @contextmanager
    def _output_errors(self) -> Iterator[None]:
        """Return a context that turns the errors of the library beneath into `OutputError`."""
        try:
            yield
        except self.faults as problem:
            reason = getattr(problem, "strerror", None) or " ".join(str(problem).split())[:120]
            raise OutputError(str(self.path), None, f"cannot be written ({reason})") from None

    def write(self, block: PointBlock) -> None:
        """Append a block to the file; raise `OutputError` if a value doesn't fit or the disk is full."""
        if len(block) == 0:
            return
        for column in self.columns:
            if block.array(column.array) is None:
                raise OutputError(str(self.path), column.array, "can't be written: the points don't have it")
        if not self.keeps_flags:
            block = self._without_flags(block)
            if not len(block):
                return
        with self._output_errors():
            self._append(block)
        self.count += len(block)

    def _without_flags(self, block: PointBlock) -> PointBlock:
        """Return the block without flags and withheld points, for which the format has no fields; count them."""
        for name in FLAGS:
            if name in block.more and (marked_count := int(np.count_nonzero(block.more[name]))):
                self.lost[name] = self.lost.get(name, 0) + marked_count
        if WITHHELD in block.more and block.more[WITHHELD].any():
            block = block.select(~withheld_points(block))
        return without_flags(block)

    def notes(self) -> dict[str, Any]:
        """Return the file's metadata (intensity scale, attributes, classes) as JSON data."""
        notes: dict[str, Any] = {
            "intensity_scale": self.intensity_scale,
            "attributes": list(self.attributes),
            "classes": self.scheme.to_dict(),
        }
        return notes | ({"standard_time": True} if self.standard_time else {})

    def placed_notes(self) -> dict[str, Any]:
        """Return `notes` plus offset and coordinate system, for formats that have no fields for these."""
        return {**self.notes(), "offset": self.offset.tolist(), "crs": self.crs_text}

    def to_integers(self, values: AnyArray, kind: str, name: str, scale: float | None = None) -> AnyArray:
        """Return values (N,), divided by the scale and rounded, in an integer type.

        Args:
            values: to be stored.
            kind: name of the type.
            name: of the values, for messages.
            scale: value of one step; None for whole numbers.

        Raises:
            OutputError: a value is NaN or doesn't fit.
        """
        if values.dtype == np.dtype(kind) and scale is None:
            return values
        limits = np.iinfo(kind)
        # Both are copies: they are rounded in place.
        quotients = np.asarray(values * (1.0 / scale)) if scale else np.array(values)
        if quotients.dtype.kind == "f":
            np.rint(quotients, out=quotients)
        minimum, maximum = quotients.min(), quotients.max()
        # Negated, since no comparison with NaN holds: a NaN is refused too.
        if not (minimum >= limits.min and maximum <= limits.max):
            culprit = minimum if not minimum >= limits.min else maximum
            unit = scale or 1
            requirement = f"{name} must lie from {limits.min * unit:g} to {limits.max * unit:g}"
            raise OutputError(str(self.path), float(culprit * unit), requirement)
        return quotients.astype(kind)

    def check_finite(self, values: AnyArray, name: str, kind: str = "f8") -> AnyArray:
        """Return the values unchanged.

        Args:
            values: (N, ...).
            name: of the values, for messages.
            kind: type of the floats that they are stored in.

        Raises:
            OutputError: one isn't finite, or is too large for that type.
        """
        largest_value = float(np.finfo(kind).max)
        fits = np.abs(values) <= largest_value  # NaN isn't
        if not fits.all():
            wrong_value = values[~fits.reshape(len(values), -1).all(axis=1)][0]
            allowed_range = (
                "finite"
                if not np.isfinite(wrong_value).all()
                else f"at most {largest_value:.2g}, as the format stores it"
            )
            raise OutputError(str(self.path), wrong_value.tolist(), f"{name} must be {allowed_range}")
        return values

    def fit_values(self, values: AnyArray, kind: str, name: str) -> AnyArray:
        """Return values for a field of a type: floats unchanged, others rounded to integers.

        Raises:
            OutputError: a value doesn't fit into the type.
        """
        if np.dtype(kind).kind == "f":
            return self.check_finite(values, name, kind)
        return self.to_integers(values, kind, name)

    def file_class_ids(self, block: PointBlock) -> UInt8:
        """Return the ids (N,) of the block's classes in the file's class scheme."""
        return np.take(self.scheme.ids, self.to_integers(block.class_id, "uint8", "class_id"))

    def stored_integers(self, column: Column, block: PointBlock) -> AnyArray:
        """Return the integers (N,) that LAS and E57 store for a column of a block."""
        if column.array == "class_id":
            return self.file_class_ids(block)
        values = column.values(block)
        if column.local and column.component is not None:
            values = values - self.offset[column.component]
        return self.to_integers(values, column.dtype, column.name, column.scale)

    def content_id(self, *more: object) -> str:
        """Return 32 hexadecimal digits, a hash of the file's notes and point count: the same on any day."""
        text = json.dumps([self.notes(), self.crs_text, self.offset.tolist(), self.count, *more], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    @abstractmethod
    def _open(self) -> None:
        """Create the temporary file and write what precedes the points."""

    @abstractmethod
    def _append(self, block: PointBlock) -> None:
        """Write the points of a block that isn't empty."""

    @abstractmethod
    def _finish(self) -> None:
        """Complete and close the temporary file."""

    def _close(self) -> None:
        """Close what is open, in whatever state; what it raises is ignored."""
        self._file.close()

    def _abandon(self) -> None:
        """Close what is open and remove the temporary file; doesn't raise."""
        with suppress(Exception):
            self._close()
        self._scratch.close()
