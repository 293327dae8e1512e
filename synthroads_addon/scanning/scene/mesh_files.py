"""Mesh files looked at before Blender's importers are: what they claim must lie within the file.

Blender's reader of PLY ends the process where a face names a vertex that isn't there, and its reader of STL takes what
is left of a truncated file without a word. Its reader of glTF, in Python, makes room for as many values as a header
says. And its readers read whatever an address in a file names, also outside of its folder.
"""

import json
import os
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote

import numpy as np

from ...base.arrays import AnyArray, UInt8
from ...base.errors import InputError
from ...base.named_paths import file_in_one_of
from ...cloud.formats.ply import PLY_TYPES

_GLB, _JSON = 0x46546C67, 0x4E4F534A  # "glTF", "JSON"
_COMPONENTS = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_LONGEST_HEADER = 1 << 20
_FEW = 16
_FAULTS = (ValueError, LookupError, TypeError, ArithmeticError, AttributeError, RecursionError, struct.error)
"""Errors of looking into a file whose content isn't what it should be."""
_DEEPEST = 256
"""Levels of nodes in a glTF at most: Blender's reader calls itself for each."""
_SHOWN = 100
STAY = "what it names must stay in the file's folder, also where links lead to"
REMEDY = "copy it there, or name its folder by --also-from"
"""Remedy where a scene names a file elsewhere."""
_BLOCK = 1 << 24
_LONGEST_LINE = 1 << 12
"""Bytes of the longest line that names a material library."""
_LIBRARY = re.compile(rb"\n[ \t]*mtllib[ \t]+")
_PICTURES = ("map_", "norm", "bump", "disp", "decal", "refl")
"""Beginnings of the lines of a material that name a picture."""
_MANY = 3
_OPTIONS = {"-o": _MANY, "-s": _MANY, "-t": _MANY, "-mm": 2}
"""Options before the name of a picture that take more than one word, or up to three numbers."""
_NUMBER = re.compile(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?")
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
"""Beginning of an address with a scheme, as of the network, or with a drive's letter."""
_MOST_VALUES = 1 << 24
"""Values of a glTF accessor without a buffer, which are all zero."""

_Property = tuple[str, str, str]
"""Type of a list's length ("" for a scalar), type of the values, name."""


def check_mesh_file(path: Path, also_from: Sequence[Path] = (), remedy: str = REMEDY) -> None:
    """Raise `InputError` if a mesh file is truncated, inconsistent, or points outside of its folder.

    Args:
        path: a .ply, .stl, .obj, .glb or .gltf that exists; files of other kinds aren't looked into.
        also_from: further folders in which files that it names may lie.
        remedy: what users can do where it names a file that lies elsewhere, for the message.

    Raises:
        InputError: it is damaged, or its address of a part leaves its folder or names no regular file.
    """
    reach = _Reach(path, (path.parent, *also_from), remedy)
    look: dict[str, Callable[[Path, _Reach], None]] = {
        ".ply": _check_ply, ".stl": _check_stl, ".glb": _check_glb, ".gltf": _check_gltf, ".obj": _check_obj,
    }  # fmt: skip
    try:
        look.get(path.suffix.lower(), lambda *_: None)(path, reach)
    except RecursionError:
        raise InputError(str(path), None, "is damaged (it is nested too deeply)") from None
    except _FAULTS as problem:
        raise InputError(str(path), None, f"is damaged ({problem})") from None


def refuse_outside(path: Path, address: str, folders: Sequence[Path], remedy: str) -> None:
    """Raise `InputError` if there is something at an address that a file names, and it lies in none of some folders.

    Args:
        path: the file; relative addresses count from its folder.
        address: as it stands in the file.
        folders: from which may be read, links resolved.
        remedy: what users can do about it, for the message.
    """
    if not file_in_one_of(folders, address, path.parent):
        address_text = address if len(address) < _SHOWN else f"{address[:_SHOWN]}..."
        raise InputError(str(path), address_text, f"{STAY}: {remedy}")


@dataclass(frozen=True)
class _Reach:
    """Reach of a file's addresses: it, the folders that they may lead to, and what is to be done about others."""

    path: Path
    folders: tuple[Path, ...]
    remedy: str

    def refuse(self, address: str, source: Path | None = None) -> None:
        """Raise `InputError` if something is at an address that lies outside of the folders.

        Args:
            address: as it stands in a file.
            source: that file; None: the file itself.
        """
        refuse_outside(source or self.path, address, self.folders, self.remedy)


# --- STL ------------------------------------------------------------------------------------------------------------


def _check_stl(path: Path, _: _Reach) -> None:
    """Raise ValueError if a binary STL is shorter than its triangles take: 84 bytes and 50 for each."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
    if head[:5] == b"solid":  # text; Blender says itself what it doesn't understand
        return
    if size < 84 or size < 84 + 50 * int.from_bytes(head[80:], "little"):
        raise ValueError(f"{size:,} bytes are less than its triangles take")


# --- PLY ------------------------------------------------------------------------------------------------------------


def _check_ply(path: Path, _: _Reach) -> None:
    """Raise ValueError if a PLY ends too early, or a face of it names a vertex that it doesn't have."""
    with path.open("rb") as file:
        kind, elements = read_ply_header(file)
        rows = _ply_text(file, elements) if kind == "ascii" else _ply_bytes(path, file, kind, elements)
        vertices = next((count for name, count, _ in elements if name == "vertex"), 0)
        for numbers in rows:
            if numbers.size and not (numbers.min() >= 0 and numbers.max() < vertices):
                raise ValueError(f"a face names a vertex that is none of its {vertices:,}")


def read_ply_header(file: BinaryIO) -> tuple[str, list[tuple[str, int, list[_Property]]]]:
    """Read a PLY's header; return its format, and name, number and properties of each element."""
    kind, elements = "", list[tuple[str, int, list[_Property]]]()
    while (line := file.readline(_LONGEST_HEADER).decode("ascii", errors="replace")) and file.tell() < _LONGEST_HEADER:
        words = line.split()
        if words[:1] == ["format"]:
            kind = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:2] == ["property", "list"]:
            elements[-1][2].append((_ply_type(words[2]), _ply_type(words[3]), words[4]))
        elif words[:1] == ["property"]:
            elements[-1][2].append(("", _ply_type(words[1]), words[2]))
        elif words[:1] == ["end_header"]:
            return kind, elements
    raise ValueError("it ends within its header")


def _ply_type(word: str) -> str:
    """Return the NumPy type code, without byte order, of a PLY type's name."""
    return PLY_TYPES[word].lstrip("<")


def _ply_text(file: BinaryIO, elements: list[tuple[str, int, list[_Property]]]) -> Iterator[AnyArray]:
    """Yield the vertex indices of each face of a text PLY."""
    for name, count, properties in elements:
        for _ in range(count):
            words = file.readline().split()
            if not words:
                raise ValueError("it ends before its elements do")
            if name == "face":
                list_position = next(position for position, (length, _, _) in enumerate(properties) if length)
                yield np.array(words[list_position + 1 : list_position + 1 + int(words[list_position])], dtype=np.int64)


def _ply_bytes(
    path: Path, file: BinaryIO, kind: str, elements: list[tuple[str, int, list[_Property]]]
) -> Iterator[AnyArray]:
    """Yield the vertex indices of a binary PLY's faces, as one array for each run of faces of equal size."""
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}[kind]
    data, offset = np.memmap(path, np.uint8, "r"), file.tell()
    for name, count, properties in elements:
        lists = [position for position, (length, _, _) in enumerate(properties) if length]
        if count < 0 or (len(lists) > 1 and name == "face"):
            raise ValueError(f"its element {name} isn't understood")
        if not lists:
            offset += count * sum(np.dtype(kind).itemsize for _, kind, _ in properties)
        else:
            ordered_properties = [(length and order + length, order + kind, name) for length, kind, name in properties]
            for numbers, end_offset in _ply_lists(data, offset, count, ordered_properties):
                offset = end_offset
                if name == "face":
                    yield numbers
        if offset > len(data):
            raise ValueError("it ends before its elements do")


def _ply_lists(data: UInt8, offset: int, count: int, properties: list[_Property]) -> Iterator[tuple[AnyArray, int]]:
    """Yield runs of an element's lists of equal length (n, length), and the byte offset at which each run ends.

    Args:
        data: bytes of the file.
        offset: at which the element begins.
        count: rows of the element.
        properties: of a row, one of which is a list.
    """
    list_position = next(position for position, (length, _, _) in enumerate(properties) if length)
    bytes_before = sum(np.dtype(kind).itemsize for _, kind, _ in properties[:list_position])
    bytes_after = sum(np.dtype(kind).itemsize for _, kind, _ in properties[list_position + 1 :])
    length_type, value_type = np.dtype(properties[list_position][0]), np.dtype(properties[list_position][1])
    # Rows are read as if all had lists as long as the next one's: few at first, the more the longer that holds.
    row_limit = _FEW
    while count:
        length_bytes = data[offset + bytes_before : offset + bytes_before + length_type.itemsize]
        list_length = int(np.frombuffer(length_bytes, length_type)[0])
        row_type = np.dtype(
            [
                ("before", np.uint8, bytes_before),
                ("length", length_type),
                ("values", value_type, (list_length,)),
                ("after", np.uint8, bytes_after),
            ]
        )
        row_count = min(count, row_limit, (len(data) - offset) // row_type.itemsize)
        if row_count == 0:
            raise ValueError("it ends before its elements do")
        rows = np.frombuffer(data[offset : offset + row_count * row_type.itemsize], row_type)
        other_rows = np.flatnonzero(rows["length"] != list_length)
        run_length = int(other_rows[0]) if len(other_rows) else row_count
        row_limit = 2 * row_limit if run_length == row_count else _FEW
        offset, count = offset + run_length * row_type.itemsize, count - run_length
        yield rows["values"][:run_length], offset


# --- OBJ ------------------------------------------------------------------------------------------------------------


def material_libraries(path: Path) -> Iterator[str]:
    """Yield the names of an .obj's material libraries, of the whole file, which may be large."""
    with path.open("rb") as file:
        remainder = b"\n"
        while block := file.read(_BLOCK):
            text, _, remainder = (remainder + block).rpartition(b"\n")
            yield from _libraries_in(text)
            remainder = b"\n" + remainder
        yield from _libraries_in(remainder)


def _libraries_in(text: bytes) -> Iterator[str]:
    """Yield the names of material libraries in whole lines of an .obj, each with the line's end before it."""
    for match in _LIBRARY.finditer(text):
        line = text[match.end() : match.end() + _LONGEST_LINE].split(b"\n", 1)[0]
        yield line.decode("utf-8", errors="replace").strip().strip('"')


def _check_obj(path: Path, reach: _Reach) -> None:
    """Raise `InputError` if a material library of an .obj, or a picture that one names, is there and lies elsewhere."""
    for name in dict.fromkeys((path.with_suffix(".mtl").name, *material_libraries(path))):
        reach.refuse(name)
        library = path.parent / name.replace("\\", "/")
        if not library.is_file():
            continue
        for line in library.read_text(encoding="utf-8", errors="replace").splitlines():
            statement, _, arguments = line.strip().partition(" ")
            if statement.lower().startswith(_PICTURES):
                for address in _addresses(arguments):
                    reach.refuse(address, library)


def _addresses(statement: str) -> Iterator[str]:
    """Yield what may be the address in a material's line about a picture: all of it, then it without options."""
    words = statement.split()
    yield statement.strip().strip('"')
    while words and words[0].startswith("-"):
        count = _OPTIONS.get(words[0].lower(), 1)
        words = words[1:]
        while words[1:] and count and (count < _MANY or _NUMBER.fullmatch(words[0])):
            words, count = words[1:], count - 1
        yield " ".join(words).strip('"')


# --- glTF -----------------------------------------------------------------------------------------------------------


def _check_glb(path: Path, reach: _Reach) -> None:
    """Raise an error if a binary glTF is shorter than it says, or its content can't be read: see `_check_content`."""
    size = path.stat().st_size
    with path.open("rb") as file:
        magic, _, length, chunk, kind = struct.unpack("<5I", file.read(20))
        if magic != _GLB or kind != _JSON:
            raise ValueError("it is no binary glTF")
        if length > size or chunk > size - 20:
            raise ValueError(f"{size:,} bytes are left of {length:,}")
        text = file.read(chunk)
    _check_content(reach, json.loads(text), max(0, size - 20 - chunk - 8))


def _check_gltf(path: Path, reach: _Reach) -> None:
    """Raise an error if the content of a glTF can't be read: see `_check_content`."""
    _check_content(reach, json.loads(path.read_bytes()), 0)


def _check_content(reach: _Reach, content: dict[str, Any], binary: int) -> None:
    """Raise an error if a glTF's buffers, images, views, accessors or nodes can't be read.

    Args:
        reach: of the file.
        content: what its JSON holds.
        binary: bytes of the file's own buffer.
    """
    for number, buffer in enumerate(content.get("buffers", [])):
        if "uri" in buffer:
            available_bytes = _part_size(reach, buffer["uri"])
        elif number == 0:  # only the first buffer may be the file's own
            available_bytes = binary
        else:
            continue
        if buffer["byteLength"] > available_bytes:
            raise ValueError(f"its buffer has {available_bytes:,} bytes of {buffer['byteLength']:,}")
    for image in content.get("images", []):
        if "uri" in image:
            _part_size(reach, image["uri"], optional=True)
    _check_views(content)
    _check_nodes(content.get("nodes", []))


def _part_size(reach: _Reach, address: str, optional: bool = False) -> int:
    """Return the size, bytes, of a glTF's data URI or of the file that it names; 0 if missing and optional.

    Raises:
        InputError: it leaves the folder, links that are followed included, or names no regular file.
    """
    if address[:5].lower() == "data:":
        return 3 * len(address.partition(",")[2]) // 4
    address_text = address if len(address) < _SHOWN else f"{address[:_SHOWN]}..."
    name = unquote(address).replace("\\", "/")
    folders = [Path(os.path.realpath(folder)) for folder in reach.folders]
    place = Path(os.path.realpath(folders[0] / name))
    if _SCHEME.match(name) or name.startswith("//") or not any(place.is_relative_to(folder) for folder in folders):
        raise InputError(str(reach.path), address_text, f"{STAY}: {reach.remedy}")
    if not place.exists() and optional:
        return 0
    if not place.is_file():
        raise InputError(str(reach.path), address_text, "a regular file is needed at this address")
    return place.stat().st_size


def _check_views(content: dict[str, Any]) -> None:
    """Raise ValueError if a glTF's view exceeds its buffer or an accessor its view."""
    buffers, views = content.get("buffers", []), content.get("bufferViews", [])
    for view in views:
        if view.get("byteOffset", 0) + view["byteLength"] > buffers[view["buffer"]]["byteLength"]:
            raise ValueError("a view lies beyond its buffer")
    for accessor in content.get("accessors", []):
        width = _COMPONENTS[accessor["componentType"]] * _WIDTHS[accessor["type"]]
        if "bufferView" not in accessor:
            fits = 0 <= accessor["count"] <= _MOST_VALUES
        else:
            view = views[accessor["bufferView"]]
            step = max(view.get("byteStride", 0), width)
            end_byte = accessor.get("byteOffset", 0) + step * (accessor["count"] - 1) + width
            fits = accessor["count"] > 0 and end_byte <= view["byteLength"]
        if not fits:
            raise ValueError(f"an accessor claims {accessor['count']:,} values")


def _check_nodes(nodes: list[dict[str, Any]]) -> None:
    """Raise ValueError if a glTF's nodes form cycles, have several parents, or are nested too deeply."""
    parents: dict[int, int] = {}
    for number, node in enumerate(nodes):
        for child in node.get("children", []):
            if child in parents or not 0 <= child < len(nodes):
                raise ValueError(f"node {child} isn't the child of exactly one")
            parents[child] = number
    depths: dict[int, int] = {}
    for number in range(len(nodes)):
        # From a node up to the root, or to the first ancestor whose depth is known already.
        lineage = [number]
        while lineage[-1] in parents and lineage[-1] not in depths:
            if len(lineage) > len(nodes):
                raise ValueError(f"node {number} lies below itself")
            lineage.append(parents[lineage[-1]])
        top_depth = depths.get(lineage[-1], 0)
        for levels_down, ancestor in enumerate(reversed(lineage)):
            depths[ancestor] = top_depth + levels_down
        if depths[number] > _DEEPEST:
            raise ValueError(f"its nodes lie more than {_DEEPEST} deep")
