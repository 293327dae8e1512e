"""`CloudWriter` and `CloudReader`: what the writers and the readers of all formats have in common."""

import hashlib
import json
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...base.arrays import AnyArray, Float, UInt8
from ...base.classes import ClassScheme, asprs_scheme, class_scheme, stored_scheme
from ...base.crs import wkt
from ...base.errors import InputError, OutputError
from ...base.files import sync_file
from ...base.scratch.folders import scratch_folder
from ..layers import ATTRIBUTES, DEFAULT_ATTRIBUTES, LAYERS, Attribute, Column, attributes_of, columns
from ..points import PointBlock
from ..strays import FARTHEST


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

    Attributes:
        count: points written so far.
        clipped: points whose intensity exceeded 16 bits.

    Raises:
        InputError: the coordinate system is unknown.
        OutputError: the file can't be written, or a value doesn't fit into its field: nothing ever wraps.
    """

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
        self._scratch = ExitStack()
        if not np.isfinite(self.offset).all() or not (0 < self.intensity_scale < np.inf):
            raise InputError("offset, intensity_scale", [*self.offset, intensity_scale], "must be finite numbers")

    def __enter__(self) -> Self:
        try:
            with self._output_errors():
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
                raise OutputError(str(self.path), column.array, "is to be written, but the points don't have it")
        with self._output_errors():
            self._append(block)
        self.count += len(block)

    def notes(self) -> dict[str, Any]:
        """Return the file's metadata (intensity scale, attributes, classes) as JSON data."""
        return {
            "intensity_scale": self.intensity_scale,
            "attributes": list(self.attributes),
            "classes": self.scheme.to_dict(),
        }

    def placed_notes(self) -> dict[str, Any]:
        """Return `notes` plus offset and coordinate system, for formats that have no fields for these."""
        return {**self.notes(), "offset": self.offset.tolist(), "crs": self.crs_text}

    def to_integers(self, values: AnyArray, kind: str, name: str, scale: float | None = None) -> AnyArray:
        """Return values (N,), divided by the scale and rounded, in the integer type ``kind``.

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

    def check_finite(self, values: AnyArray, name: str) -> AnyArray:
        """Return the values unchanged; raise `OutputError` if one is NaN or infinite."""
        if not np.isfinite(values).all():
            worst = values[~np.isfinite(values).reshape(len(values), -1).all(axis=1)][0]
            raise OutputError(str(self.path), worst.tolist(), f"{name} must be finite")
        return values

    def fit_values(self, values: AnyArray, kind: str, name: str) -> AnyArray:
        """Return values for a field of a type: floats unchanged, integers rounded; `OutputError` if they don't fit."""
        return self.check_finite(values, name) if np.dtype(kind).kind == "f" else self.to_integers(values, kind, name)

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


BLOCK = 500_000
"""Points that are read at a time."""
_LARGEST_SCALE = 1e300


@dataclass(frozen=True)
class CloudHeader:
    """Metadata of a cloud's file, from its header.

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
    offset: Float
    crs_text: str | None = None
    epsg: int | None = None
    intensity_scale: float | None = None
    scheme: ClassScheme = field(default_factory=lambda: asprs_scheme(range(256)))
    labelled: bool = False
    attributes: tuple[Attribute, ...] = ()
    has_color: bool = False
    left_out: tuple[str, ...] = ()


class CloudReader(ABC):
    """Base of readers of one cloud file, block by block; a context manager.

    Attributes:
        header: what the file says of itself.
    """

    header: CloudHeader
    _file: Any
    """Open file, or the library's handle of it."""

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
        done = 0
        for block in self._stored_blocks(size):
            yield _check_block(self.header.path, done, block)
            done += len(block)

    @abstractmethod
    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the file's points as blocks of at most ``size`` points, unchecked."""

    def close(self) -> None:
        """Close the file; closing it twice does no harm."""
        self._file.close()


def epsg_of(text: str | None) -> int | None:
    """Return the EPSG code at the end of a coordinate system's WKT 1 or 2; None if it has none."""
    match = re.search(r'(?:AUTHORITY|ID)\["EPSG",\s*"?(\d+)"?\](?:\]|\s)*$', text.rstrip("\0 \n")) if text else None
    return int(match[1]) if match else None


def header_from_notes(
    path: Path,
    kind: str,
    count: int,
    stored: set[str],
    notes: Any,
    *,
    name_of: Callable[[Column], str],
    usual: set[str],
    has_color: bool,
) -> CloudHeader:
    """Return the header of a PLY, E57 or NPZ file from the names of its columns and its notes.

    Args:
        path: the file.
        kind: of file.
        count: number of points.
        stored: names of what is stored of each point.
        notes: `CloudWriter.placed_notes`; None for a file of others.
        name_of: what the format calls a column.
        usual: names of what is read in any case.
        has_color: whether there are colours.

    Raises:
        InputError: the notes are damaged.
    """
    names = {column.name for layer in LAYERS.values() for column in layer.columns if name_of(column) in stored}
    attributes = attributes_of(names)
    left_out = tuple(sorted(stored - usual - {name_of(column) for column in columns(attributes)}))
    header = CloudHeader(path, kind, count, np.zeros(3), attributes=attributes, has_color=has_color, left_out=left_out)
    if not isinstance(notes, dict):
        return header
    text = notes.get("crs")
    try:
        offset = np.array(notes["offset"], dtype=np.float64).reshape(3)
    except (KeyError, TypeError, ValueError, OverflowError):
        offset = np.full(3, np.nan)
    if not np.isfinite(offset).all() or not isinstance(text, str | None):
        raise InputError(str(path), None, "its notes on offset and coordinate system are damaged")
    return replace(
        header,
        offset=offset,
        crs_text=text,
        epsg=epsg_of(text),
        intensity_scale=intensity_scale(path, notes),
        scheme=stored_scheme(notes.get("classes"), str(path)),
        labelled=True,
    )


def intensity_scale(path: Path, notes: dict[str, Any]) -> float:
    """Return the 16-bit steps per unit of intensity that a file's notes give.

    Raises:
        InputError: they tell none, or it is no finite number above 0.
    """
    scale = notes.get("intensity_scale")
    if not isinstance(scale, int | float) or not 0.0 < scale <= _LARGEST_SCALE:
        raise InputError(f"{path}: intensity_scale", scale, "must be a finite number above 0")
    return float(scale)


def check_coordinates(path: Path, done: int, xyz: Float) -> Float:
    """Return a block's coordinates (N, 3) unchanged; raise `InputError` if one isn't finite.

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


def _check_block(path: Path, done: int, block: PointBlock) -> PointBlock:
    """Return a block unchanged; raise `InputError` if a coordinate is too large or an intensity isn't finite."""
    if not len(block):
        return block
    xyz = check_coordinates(path, done, block.xyz)
    if max(xyz.max(), -xyz.min()) > FARTHEST:
        point, axis = divmod(int(np.abs(xyz).argmax()), 3)
        allowed = f"must be a map coordinate, at most {FARTHEST:g} m"
        raise InputError(f"{path}: {'xyz'[axis]} of point {done + point:,}", float(xyz[point, axis]), allowed)
    if not np.isfinite(block.intensity).all():
        point = int(np.argmin(np.isfinite(block.intensity)))
        raise InputError(f"{path}: intensity of point {done + point:,}", block.intensity[point], "must be finite")
    return block


def damage_error(path: Path, at: int, count: int) -> InputError:
    """Return, without raising, the `InputError` for a file that is damaged from its point number ``at`` on."""
    return InputError(str(path), None, f"is truncated or damaged after {at:,} of {count:,} points")
