"""Write a .blend file so that it no longer depends on where its data lay in memory."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

_DATA = b"DATA"
_POINTER = 8
_STEP = 16
"""Distance of the addresses that blocks are given, as if they lay one after the other."""


@dataclass(frozen=True)
class _Block:
    """A block of a .blend file: its header begins at `head`, the address in it at `old_at`, its data at `data`."""

    code: bytes
    struct: int
    old: int
    old_at: int
    data: int
    size: int


class _File:
    """Reader of the blocks of an uncompressed, little-endian .blend file of Blender 4 or 5."""

    def __init__(self, content: bytes) -> None:
        if content[:7] != b"BLENDER":
            raise ValueError("not a .blend file, or a compressed one")
        self.content = content
        # "BLENDER-v405" or "BLENDER17-01v0502": the latter says how long the header is.
        self._has_long_header = content[7:9].isdigit()
        self._begin = int(content[7:9]) if self._has_long_header else 12

    @cached_property
    def blocks(self) -> list[_Block]:
        """All blocks of the file in their order; cached."""
        layout, old_at = ("<4sIQQQ", 8) if self._has_long_header else ("<4siQii", 8)
        blocks, position = [], self._begin
        while position < len(self.content):
            values = struct.unpack_from(layout, self.content, position)
            code, old = values[0], values[2]
            number, size = (values[1], values[3]) if self._has_long_header else (values[3], values[1])
            data = position + struct.calcsize(layout)
            blocks.append(_Block(code, number, old, position + old_at, data, size))
            position = data + size
            if code == b"ENDB":
                break
        return blocks

    def groups(self) -> Iterator[list[_Block]]:
        """Yield the list of blocks of each data-block: its own first, then its data."""
        group: list[_Block] = []
        for block in self.blocks:
            if block.code != _DATA and group:
                yield group
                group = []
            group.append(block)
        yield group


class _Structs:
    """Layouts of the structs that a .blend file describes in its block DNA1."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        names, end = self._strings(self._after(b"NAME", 0))
        types, end = self._strings(self._after(b"TYPE", end))
        start = self._after(b"TLEN", end)
        self._sizes = struct.unpack_from(f"<{len(types)}H", data, start)
        position = self._after(b"STRC", start + 2 * len(types))
        (count,) = struct.unpack_from("<I", data, position)
        position += 4
        self._names, self._types = names, types
        self._structs: list[tuple[int, list[tuple[int, int]]]] = []
        for _ in range(count):
            kind, number = struct.unpack_from("<HH", data, position)
            values = struct.unpack_from(f"<{2 * number}H", data, position + 4)
            self._structs.append((kind, list(zip(values[::2], values[1::2], strict=True))))
            position += 4 + 4 * number
        self._of_type = {kind: number for number, (kind, _) in enumerate(self._structs)}
        self._pointers_of_struct: dict[int, list[int]] = {}

    def size(self, number: int) -> int:
        """Return the size of the struct of a number, bytes."""
        return int(self._sizes[self._structs[number][0]])

    def name(self, number: int) -> str:
        """Return the name of the struct of a number."""
        return self._types[self._structs[number][0]]

    def pointers(self, number: int) -> list[int]:
        """Return the byte offsets of all pointers in a struct, nested ones included; cached."""
        if number not in self._pointers_of_struct:
            self._pointers_of_struct[number] = list(self._find_pointers(number))
        return self._pointers_of_struct[number]

    def field(self, number: int, names_on_path: tuple[str, ...]) -> tuple[int, int]:
        """Return byte offset and size of a struct's field, given by the names on the path to it; KeyError if none."""
        position = 0
        for kind, index in self._structs[number][1]:
            length = self._length(kind, self._names[index])
            if self._names[index] == names_on_path[0]:
                inner_position, size = (
                    self.field(self._of_type[kind], names_on_path[1:]) if names_on_path[1:] else (0, length)
                )
                return position + inner_position, size
            position += length
        raise KeyError(names_on_path[0])

    def _find_pointers(self, number: int) -> Iterator[int]:
        """Yield the byte offsets of all pointers in a struct, those of nested structs included."""
        position = 0
        for kind, index in self._structs[number][1]:
            name = self._names[index]
            length = self._length(kind, name)
            if name.startswith(("*", "(*")):
                yield from range(position, position + length, _POINTER)
            elif kind in self._of_type:
                inner_offsets = self.pointers(self._of_type[kind])
                for first_position in range(position, position + length, self._sizes[kind] or 1):
                    yield from (first_position + inner_offset for inner_offset in inner_offsets)
            position += length

    def _length(self, kind: int, name: str) -> int:
        """Return the bytes that a field takes, by its type and name, which has arrays' sizes and pointers' stars."""
        count = 1
        for size in re.findall(r"\[(\d+)\]", name):
            count *= int(size)
        return count * (_POINTER if name.startswith(("*", "(*")) else int(self._sizes[kind]))

    def _after(self, tag: bytes, start: int) -> int:
        """Return the position behind the next tag from a position on."""
        return self._data.index(tag, start) + len(tag)

    def _strings(self, position: int) -> tuple[list[str], int]:
        """Return the texts of a list that ends each with a null byte, and the position behind it."""
        (count,) = struct.unpack_from("<I", self._data, position)
        position += 4
        texts = []
        for _ in range(count):
            end = self._data.index(b"\0", position)
            texts.append(self._data[position:end].decode())
            position = end + 1
        return texts, position


_CHANGING: dict[str, list[tuple[str, ...]]] = {
    "bNodeTree": [("id", "session_uid")],
    "AssetMetaData": [("catalog_simple_name[64]",), ("_pad[4]",)],
}
"""Fields by struct, the ways to them, that hold a running number, or memory that nothing was written to."""


def make_stable(content: bytes) -> bytes:
    """Return a .blend file's bytes with sequential addresses and node numbers, independent of memory layout.

    Pointers to what isn't in the file become 0, as Blender takes them when it reads it. The numbers by which nodes are
    known from outside of their tree are random ones; nothing in a library refers to them.

    Raises:
        ValueError: the file is compressed, or none of Blender's.
    """
    file = _File(content)
    (struct_block,) = (block for block in file.blocks if block.code == b"DNA1")
    structs = _Structs(content[struct_block.data : struct_block.data + struct_block.size])
    result = bytearray(content)
    places = {block.old: _STEP * number for number, block in enumerate(file.blocks, 1) if block.code != _DATA}
    number, nodes = 0, 0
    for group in file.groups():
        # The blocks of a data-block are its own: others may have had their addresses before.
        places_in_group = {block.old: _STEP * (number + place) for place, block in enumerate(group, 1)}
        number += len(group)
        for block in group:
            nodes = _rewrite(result, structs, block, places | places_in_group, nodes)
    return bytes(result)


def _rewrite(result: bytearray, structs: _Structs, block: _Block, places: dict[int, int], nodes: int) -> int:
    """Rewrite one block's addresses and node numbers in `result`, in place; return the count of nodes so far."""
    if block.old:
        struct.pack_into("<Q", result, block.old_at, places[block.old])
    if block.code in (b"DNA1", b"ENDB"):
        return nodes
    size, end = structs.size(block.struct), block.data + block.size
    if block.struct == 0 or not size or block.size % size:
        # Arrays of pointers, or bare numbers: of these none is an address.
        _readdress(result, places, range(block.data, end - _POINTER + 1, _POINTER), keeps_unknown=True)
        return nodes
    for struct_position in range(block.data, end, size):
        _readdress(
            result, places, (struct_position + place for place in structs.pointers(block.struct)), keeps_unknown=False
        )
        name = structs.name(block.struct)
        if name == "bNode":
            nodes += 1
            struct.pack_into("<i", result, struct_position + structs.field(block.struct, ("identifier",))[0], nodes)
        for names_on_path in _CHANGING.get(name, ()):
            place, length = structs.field(block.struct, names_on_path)
            result[struct_position + place : struct_position + place + length] = bytes(length)
    return nodes


def _readdress(result: bytearray, places: dict[int, int], positions: Iterable[int], *, keeps_unknown: bool) -> None:
    """Replace the addresses at some byte positions, in place; unknown ones stay if `keeps_unknown`, else become 0."""
    for position in positions:
        (address,) = struct.unpack_from("<Q", result, position)
        if address:
            struct.pack_into("<Q", result, position, places.get(address, address if keeps_unknown else 0))
