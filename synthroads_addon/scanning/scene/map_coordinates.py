"""Meshes whose vertices stand in map coordinates: too large for the single precision in which Blender holds them.

Text (.obj, .ply, .stl) and doubles (.ply) are moved near the origin before they are read, which loses nothing. What
a file itself holds in single precision is rounded already: that is said.
"""

import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from .extent import body_bounds
from .mesh import SceneMesh
from .mesh_files import read_ply_header

FARTHEST = 131_072.0
"""A scene that lies farther than this, m, from its origin is rounded to steps of more than 1 cm: it is refused."""
_TOLD = 16_384.0
"""From this distance (m) on steps are more than 1 mm, which is told."""
_REMEDY = "--origin auto moves the scene to its place on the map before it is read"
_NEAR = 1000.0
"""Files nearer to their origin than this, m, aren't moved."""
_TEXT = {".obj": b"v", ".stl": b"vertex"}
"""Endings of text formats, and the word before a vertex."""
_DOUBLE_AXIS = re.compile(rb"property[ \t]+(?:double|float64)[ \t]+([xyz])[ \t]*(\r?\n)")
"""Line of a PLY's header about a coordinate in double precision."""
_COPIED = 1 << 22


def distance_from_origin(bounds: Float) -> Float:
    """Return how far (3,), m, a box (2, 3) lies from the origin along each axis; 0 where it spans it."""
    return np.maximum(np.maximum(bounds[0], -bounds[1]), 0.0)


def step_at(coordinate: float) -> float:
    """Return the step, m, between two neighbouring values of single precision at a coordinate."""
    return float(np.spacing(np.float32(abs(coordinate))))


def rounding_warnings(mesh: SceneMesh, name: str, remedy: str = _REMEDY) -> list[str]:
    """Return warnings about the rounding of a scene's coordinates; raise `InputError` if it is too coarse.

    Args:
        mesh: the scene, its local coordinates as they were read.
        name: of its file, for messages.
        remedy: what users can do where the scene is refused.

    Raises:
        InputError: it lies so far from its origin that steps exceed 1 cm.
    """
    if not len(mesh.triangles):
        return []
    bounds = body_bounds(mesh)
    distance = float(distance_from_origin(bounds).max())
    largest_coordinate = float(np.abs(bounds).max())
    if distance > FARTHEST:
        step = step_at(largest_coordinate)
        message = f"single precision, in which meshes are held, has steps of {step:g} m there: "
        message += remedy
        raise InputError(f"{name}: coordinates", [round(value) for value in bounds.mean(axis=0).tolist()], message)
    if distance <= _TOLD:
        return []
    step_mm = 1000.0 * step_at(largest_coordinate)
    return [f"coordinates of up to {largest_coordinate:,.0f} m are held in steps of {step_mm:.0f} mm"]


def shift_of(bounds: Float) -> Float:
    """Return whole metres (3,) by which a box (2, 3) is moved to the origin: 0 along axes on which it lies near."""
    return np.where(distance_from_origin(bounds) > _NEAR, np.floor(bounds.mean(axis=0)), 0.0)


def moved_copy(path: Path, folder: Path) -> tuple[Path, Float]:
    """Return a copy of a mesh file with its vertices near the origin, and what was subtracted (3,), in the file's axes.

    Where the file lies near the origin already, or holds its coordinates in single precision, the file itself and zeros
    are returned. Files beside it, which it may name, are linked into the folder.

    Args:
        path: an existing .obj, .ply or .stl; others are returned as they are.
        folder: an empty one, for the copy.

    Raises:
        InputError: a vertex isn't made of numbers.
    """
    kind = _kind_of(path)
    if kind is None:
        return path, np.zeros(3)
    bounds = kind.bounds()
    shift = shift_of(bounds) if np.isfinite(bounds).all() else np.zeros(3)
    if not shift.any():
        return path, np.zeros(3)
    _link_neighbours(path, folder)
    copy = folder / path.name
    with copy.open("wb") as output:
        kind.write(output, shift)
    return copy, shift


def to_scene_axes(shift: Float, suffix: str, up: str | None) -> Float:
    """Return a vector (3,) of a file's axes in the axes of the scene, whose z points up.

    Args:
        shift: (3,) in the file's axes.
        suffix: of the file; an .obj has y up where ``up`` is None, others z.
        up: the file's axis that points up, ``y`` or ``z``.
    """
    upward = up or ("y" if suffix == ".obj" else "z")
    return np.array([shift[0], -shift[2], shift[1]]) if upward == "y" else shift


class _Text:
    """Vertices in the lines of a text file.

    Args:
        path: the file.
        word: at the beginning of a vertex's line; None for lines of a PLY, counted from ``first``.
        first, count: lines with vertices, of a PLY.
    """

    def __init__(self, path: Path, word: bytes | None, first_line: int = 0, count: int = 0) -> None:
        self._path, self._word = path, word
        self._lines = range(first_line, first_line + count)

    def bounds(self) -> Float:
        """Return the smallest and the largest coordinates (2, 3) of the vertices; inf and -inf without any."""
        least_place, largest_place = np.full(3, np.inf), np.full(3, -np.inf)
        for place, _ in self._vertices():
            if place is not None:
                least_place, largest_place = np.minimum(least_place, place), np.maximum(largest_place, place)
        return np.array([least_place, largest_place])

    def write(self, output: BinaryIO, shift: Float) -> None:
        """Write the file with a vector (3,) subtracted from each vertex."""
        for place, line in self._vertices():
            if place is None:
                output.write(line)
                continue
            words = line.split()
            at = 0 if self._word is None else 1
            words[at : at + 3] = [f"{value:.9g}".encode() for value in (place - shift).tolist()]
            output.write(b" ".join(words) + b"\n")

    def _vertices(self) -> Iterator[tuple[Float | None, bytes]]:
        """Yield each line, and the vertex (3,) in it, None without one."""
        with self._path.open("rb") as file:
            for number, line in enumerate(file):
                words = line.split()
                is_vertex = number in self._lines if self._word is None else words[:1] == [self._word]
                at = 0 if self._word is None else 1
                yield (self._numbers(words[at : at + 3], number) if is_vertex else None), line

    def _numbers(self, words: list[bytes], number: int) -> Float:
        """Return the three numbers of a vertex from its words; raise `InputError` for anything else."""
        try:
            return np.array([float(word) for word in words]).reshape(3)
        except ValueError:
            words_text = b" ".join(words).decode("ascii", "replace")
            raise InputError(f"{self._path}:{number + 1}", words_text, "three numbers of a vertex are needed") from None


class _Doubles:
    """Vertices of a binary PLY in double precision; they are written in single precision, which then is fine enough."""

    def __init__(self, path: Path, start: int, count: int, fields: list[tuple[str, str]]) -> None:
        self._path, self._start = path, start
        self._rows = np.memmap(path, np.dtype([(name, kind) for kind, name in fields]), "r", start, (count,))

    def bounds(self) -> Float:
        """Return the smallest and the largest coordinates (2, 3) of the vertices."""
        columns = [self._rows[axis] for axis in "xyz"]
        return np.array([[float(column.min()) for column in columns], [float(column.max()) for column in columns]])

    def write(self, output: BinaryIO, shift: Float) -> None:
        """Write the file with a vector (3,) subtracted from each vertex, and the coordinates in single precision."""
        with self._path.open("rb") as file:
            header = file.read(self._start)
            output.write(_DOUBLE_AXIS.sub(rb"property float \1\2", header, count=3))
            byte_order = str(self._rows.dtype["x"].byteorder).replace("=", "<")
            types = {name: self._rows.dtype[name] for name in self._rows.dtype.names or ()}
            axis_shift = dict(zip("xyz", shift.tolist(), strict=True))
            rounded_rows = np.zeros(
                len(self._rows),
                [(name, f"{byte_order}f4" if name in axis_shift else kind) for name, kind in types.items()],
            )
            for name in types:
                values = self._rows[name]
                rounded_rows[name] = values - axis_shift[name] if name in axis_shift else values
            output.write(rounded_rows.tobytes())
            # What follows the vertices is copied as it is.
            file.seek(self._start + self._rows.nbytes)
            shutil.copyfileobj(file, output, _COPIED)


def _kind_of(path: Path) -> _Text | _Doubles | None:
    """Return how a file's vertices are read and moved; None where the file holds them in single precision."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        return _ply_kind(path)
    if suffix == ".stl":
        with path.open("rb") as file:
            text, triangles = file.read(5) == b"solid", int.from_bytes(_bytes_at(file, 80), "little")
        if not text or path.stat().st_size == 84 + 50 * triangles:
            return None
    word = _TEXT.get(suffix)
    return None if word is None else _Text(path, word)


def _bytes_at(file: BinaryIO, at: int) -> bytes:
    """Return the four bytes at an offset of a file."""
    file.seek(at)
    return file.read(4)


def _ply_kind(path: Path) -> _Text | _Doubles | None:
    """Return how the vertices of a PLY are read and moved; None where it holds them in single precision.

    Only files whose first element are vertices that begin with x, y and z, without lists, are moved.
    """
    with path.open("rb") as file:
        file_format, elements = read_ply_header(file)
        header_size = file.tell()
        file.seek(0)
        header_lines = file.read(header_size).count(b"\n")
    if not elements or elements[0][0] != "vertex":
        return None
    _, count, properties = elements[0]
    names = [name for _, _, name in properties]
    has_lists = any(length_type for length_type, _, _ in properties)
    if has_lists or names[:3] != ["x", "y", "z"] or not count:
        return None
    if file_format == "ascii":
        return _Text(path, None, header_lines, count)
    byte_order = "<" if file_format == "binary_little_endian" else ">"
    fields = [(byte_order + value_type, name) for _, value_type, name in properties]
    return _Doubles(path, header_size, count, fields) if fields[0][0].endswith("f8") else None


def _link_neighbours(path: Path, folder: Path) -> None:
    """Link the files and folders beside a file into another folder, where a copy of it will look for them."""
    link: Callable[[Path, Path], None] = os.symlink
    for neighbour in path.resolve().parent.iterdir():
        target = folder / neighbour.name
        if neighbour.name == path.name or target.exists():
            continue
        try:
            link(neighbour, target)
        except OSError:  # where links need rights that not everybody has
            if neighbour.suffix.lower() == ".mtl":
                shutil.copyfile(neighbour, target)
