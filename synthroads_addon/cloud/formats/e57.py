"""E57 (ASTM E2807) through `pye57`'s binding of libE57, block by block; files of others scan after scan.

pye57's own writer takes whole clouds, in single precision, which at a northing of 5.6 million metres is half a metre.
Here coordinates are scaled integers of 0.1 mm about a pose that carries the offset, so nothing is lost.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import AnyArray
from ...base.errors import InputError
from ...base.rotations import quaternion_matrices
from ..layers import Column, columns, make_points
from ..points import PointBlock
from .base import CloudReader, CloudWriter, check_coordinates, damage_error, header_from_notes

SCALE = 1e-4
"""Size of a coordinate's step, m."""
EXTENSION = "synthroads"
"""Prefix of the columns that the standard has no names for."""
_EXTENSION_URI = "urn:synthroads:e57:1"
NORMALS = {"NormalX": "nor:normalX", "NormalY": "nor:normalY", "NormalZ": "nor:normalZ"}
"""Names of the normal's columns by the standard's extension for normals."""
_NORMALS_URI = "http://www.libe57.org/E57_EXT_surface_normals.txt"
_CAPACITY = 65_536
"""Points that are handed to the library at a time."""
_VALID, _INVALID = 0, 2
"""Values of the field that says whether a point's coordinates mean something: all of them do, none of them does."""
_ENDS = ("Minimum", "Maximum")
_CHANNELS = ("colorRed", "colorGreen", "colorBlue")
_FIXED = {
    **dict.fromkeys(("cartesianX", "cartesianY", "cartesianZ"), "i4"),
    "cartesianInvalidState": "u1",
    "intensity": "f4",
    **dict.fromkeys(_CHANNELS, "u1"),
    "timeStamp": "f8",
    **dict.fromkeys(("returnIndex", "returnCount"), "u1"),
    f"{EXTENSION}:scan_angle": "f4",
    f"{EXTENSION}:strip": "u2",
}


def load_libe57() -> Any:
    """Return the module `pye57.libe57`; raise `InputError` if the package isn't installed."""
    try:
        from pye57 import libe57
    except ModuleNotFoundError:
        raise InputError("e57", None, "needs the package pye57: pip install 'synthroads[e57]'") from None
    return libe57


def e57_name(column: Column) -> str:
    """Return the name of a column in E57: that of the normals' extension, else with the project's prefix."""
    return NORMALS.get(column.name, f"{EXTENSION}:{column.name}")


def _buffer_type(kind: str) -> Any:
    """Return the NumPy type in which pye57 takes values of a type: 64-bit for integers of 32 bits and more."""
    return np.longlong if np.dtype(kind).kind in "iu" and np.dtype(kind).itemsize >= 4 else np.dtype(kind)


class E57Writer(CloudWriter):
    """Writer of point blocks to an E57 file, with 8-bit colours and unclipped intensities; see `CloudWriter`."""

    def _open(self) -> None:
        self._e57 = e57 = load_libe57()
        self.faults = (OSError, e57.E57Exception)
        with self._temporary.open("wb"):
            pass  # the library's own complaint about a folder that can't be written says nothing
        self._file = e57.ImageFile(str(self._temporary), "w")
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._dimmest, self._brightest = np.inf, -np.inf
        self._held = 0
        self._begin_root()
        self._types = dict(_FIXED) | {e57_name(column): column.dtype for column in self.columns}
        self._arrays = {name: np.zeros(_CAPACITY, dtype=_buffer_type(kind)) for name, kind in self._types.items()}
        self._buffers = e57.VectorSourceDestBuffer()
        for name, array in self._arrays.items():
            self._buffers.append(e57.SourceDestBuffer(self._file, name, array, _CAPACITY, True, False))
        points = e57.CompressedVectorNode(self._file, self._prototype(), e57.VectorNode(self._file, True))
        self._scan.set("points", points)
        self._points = points.writer(self._buffers)

    def _append(self, block: PointBlock) -> None:
        first = 0
        while first < len(block):
            part = block.select(slice(first, first + _CAPACITY - self._held))
            for name, values in self._pack_columns(part).items():
                self._arrays[name][self._held : self._held + len(part)] = values
            self._held += len(part)
            first += len(part)
            self._low = np.minimum(self._low, part.xyz.min(axis=0))
            self._high = np.maximum(self._high, part.xyz.max(axis=0))
            self._dimmest = min(self._dimmest, float(part.intensity.min()))
            self._brightest = max(self._brightest, float(part.intensity.max()))
            if self._held == _CAPACITY:
                self._flush()

    def _flush(self) -> None:
        """Write the points held, always as many at a time, so that the file doesn't depend on the blocks' sizes."""
        if self._held:
            self._points.write(self._held)
            self._held = 0

    def _finish(self) -> None:
        self._flush()
        self._points.close()
        real, whole = self._e57.FloatNode, self._e57.IntegerNode
        if self.count:
            spans = np.round([self._low - self.offset, self._high - self.offset], 4).T.tolist()
            axes = zip("xyz", spans, strict=True)
            bounds = {f"{axis}{end}": at for axis, span in axes for end, at in zip(_ENDS, span, strict=True)}
            self._scan.set("cartesianBounds", self._structure(real, bounds))
            limits = {"intensityMinimum": self._dimmest, "intensityMaximum": self._brightest}
            self._scan.set("intensityLimits", self._structure(real, limits))
        colors = {f"{name}{end}": at for name in _CHANNELS for end, at in zip(_ENDS, (0, 255), strict=True)}
        self._scan.set("colorLimits", self._structure(whole, colors))
        for node, what in ((self._scan, "scan"), (self._file.root(), "file")):
            digits = self.content_id(what, self._low.tolist(), self._high.tolist())
            groups = (digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:])
            node.set("guid", self._text("{" + "-".join(groups) + "}"))
        self._file.close()

    def _close(self) -> None:
        with suppress(Exception):
            self._points.close()
        self._file.close()

    def _pack_columns(self, part: PointBlock) -> dict[str, AnyArray]:
        """Return the stored values (n,) of at most `_CAPACITY` points, by the columns' names in E57."""
        local = part.xyz - self.offset
        packed = {f"cartesian{'XYZ'[i]}": self.to_integers(local[:, i], "int32", "xyz", SCALE) for i in range(3)}
        rgb = self.to_integers(part.rgb, "uint16", "rgb") >> 8
        packed |= dict(zip(_CHANNELS, rgb.T, strict=True))
        number = self.to_integers(part.return_number, "uint8", "return_number")
        packed |= {
            "intensity": self.check_finite(part.intensity, "intensity"),
            "timeStamp": self.check_finite(part.gps_time, "gps_time"),
            "returnIndex": np.maximum(number, 1) - 1,  # counts from 0
            "returnCount": self.to_integers(part.number_of_returns, "uint8", "number_of_returns"),
            f"{EXTENSION}:scan_angle": self.check_finite(part.scan_angle_deg, "scan_angle"),
            f"{EXTENSION}:strip": self.to_integers(part.strip, "uint16", "strip"),
            # Readers such as pye57's `read_scan` insist on it.
            "cartesianInvalidState": np.full(len(part), _VALID, dtype=np.uint8),
        }
        return packed | {e57_name(column): self.stored_integers(column, part) for column in self.columns}

    def _begin_root(self) -> None:
        """Write the file's metadata and those of its one scan, the offset as its pose."""
        e57, image = self._e57, self._file
        image.extensionsAdd("", e57.E57_V1_0_URI)
        image.extensionsAdd(EXTENSION, _EXTENSION_URI)
        if "normal" in self.attributes:
            image.extensionsAdd("nor", _NORMALS_URI)
        root = image.root()
        root.set("formatName", self._text("ASTM E57 3D Imaging Data File"))
        root.set("versionMajor", e57.IntegerNode(image, e57.E57_FORMAT_MAJOR))
        root.set("versionMinor", e57.IntegerNode(image, e57.E57_FORMAT_MINOR))
        root.set("e57LibraryVersion", self._text(e57.E57_LIBRARY_ID))
        root.set("coordinateMetadata", self._text(self.crs_text or ""))
        root.set(f"{EXTENSION}:notes", self._text(json.dumps(self.placed_notes())))
        scans = e57.VectorNode(image, True)
        root.set("data3D", scans)
        root.set("images2D", e57.VectorNode(image, True))
        self._scan = e57.StructureNode(image)
        scans.append(self._scan)
        self._scan.set("name", self._text("SynthRoads"))
        pose = e57.StructureNode(image)
        pose.set("rotation", self._structure(e57.FloatNode, {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}))
        place = dict(zip("xyz", self.offset.tolist(), strict=True))
        pose.set("translation", self._structure(e57.FloatNode, place))
        self._scan.set("pose", pose)

    def _structure(self, kind: Any, values: Mapping[str, float]) -> Any:
        """Return an E57 structure of named numbers, each a node of a kind."""
        structure = self._e57.StructureNode(self._file)
        for name, value in values.items():
            structure.set(name, kind(self._file, value))
        return structure

    def _prototype(self) -> Any:
        """Return the E57 prototype of a point: type, limits and scale of each of its fields."""
        e57, image = self._e57, self._file
        prototype = e57.StructureNode(image)
        scales = {e57_name(column): (column.scale, self._shift(column)) for column in self.columns}
        scales |= {f"cartesian{axis}": (SCALE, 0.0) for axis in "XYZ"}
        for name, kind in self._types.items():
            scale, shift = scales.get(name, (None, 0.0))
            if kind == "f8":
                node = e57.FloatNode(image, 0.0, e57.E57_DOUBLE)
            elif kind == "f4":
                limit = float(np.finfo(np.float32).max)
                node = e57.FloatNode(image, 0.0, e57.E57_SINGLE, -limit, limit)
            elif name == "cartesianInvalidState":
                node = e57.IntegerNode(image, _VALID, _VALID, _INVALID)
            elif scale is None:
                node = e57.IntegerNode(image, 0, int(np.iinfo(kind).min), int(np.iinfo(kind).max))
            else:
                node = e57.ScaledIntegerNode(image, 0, int(np.iinfo(kind).min), int(np.iinfo(kind).max), scale, shift)
            prototype.set(name, node)
        return prototype

    def _shift(self, column: Column) -> float:
        return float(self.offset[column.component]) if column.local and column.component is not None else 0.0

    def _text(self, text: str) -> Any:
        return self._e57.StringNode(self._file, text)


_FIELDS = {
    "intensity": "intensity",
    "number_of_returns": "returnCount",
    "gps_time": "timeStamp",
    "scan_angle_deg": f"{EXTENSION}:scan_angle",
    "strip": f"{EXTENSION}:strip",
}
"""Names of the arrays that every block has."""


class E57Reader(CloudReader):
    """Reader of E57 files with Cartesian coordinates; each scan's pose is applied.

    Args:
        path: an existing file.

    Raises:
        InputError: it is no such file, or damaged, or pye57 isn't installed.
    """

    def __init__(self, path: Path) -> None:
        self._e57 = e57 = load_libe57()
        try:
            self._file = e57.ImageFile(str(path), "r")
        except Exception as problem:
            raise InputError(str(path), None, f"is not an E57 file that can be read ({_error_text(problem)})") from None
        try:
            root = self._file.root()
            self._scans = [root["data3D"][i] for i in range(len(root["data3D"]))]
            self._fields = [_field_names(e57.StructureNode(scan["points"].prototype())) for scan in self._scans]
            counts = [int(scan["points"].childCount()) for scan in self._scans]
            noted = f"{EXTENSION}:notes" in _field_names(root)
            notes = json.loads(root[f"{EXTENSION}:notes"].value()) if noted else None
        except Exception as problem:
            self.close()
            raise InputError(str(path), None, f"is an E57 file that is damaged ({_error_text(problem)})") from None
        names: set[str] = set().union(*self._fields)
        if sum(counts) and not all({"cartesianX", "cartesianY", "cartesianZ"} <= fields for fields in self._fields):
            self.close()
            raise InputError(str(path), None, "has no Cartesian coordinates")
        self._counts = counts
        self.header = header_from_notes(
            path, "E57", sum(counts), names, notes, name_of=e57_name, usual=set(_FIXED), has_color="colorRed" in names
        )

    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the points of one scan after the other, in map coordinates, without invalid ones."""
        done = 0
        for scan, fields, count in zip(self._scans, self._fields, self._counts, strict=True):
            names = [name for name in sorted(_FIXED.keys() | self._layer_names()) if name in fields]
            room = min(size, count)
            arrays = {name: np.zeros(room) for name in names}
            buffers = self._e57.VectorSourceDestBuffer()
            for name, array in arrays.items():
                buffers.append(self._e57.SourceDestBuffer(self._file, name, array, room, True, True))
            left, reader = count, None
            while left:
                try:
                    reader = reader or scan["points"].reader(buffers)
                    got = reader.read()
                except Exception:
                    raise damage_error(self.header.path, done, self.header.count) from None
                if got == 0:
                    raise damage_error(self.header.path, done, self.header.count)
                block = self._block({name: array[:got] for name, array in arrays.items()}, got, _pose(scan))
                invalid = arrays["cartesianInvalidState"][:got] if "cartesianInvalidState" in arrays else None
                block = block if invalid is None else block.select(invalid == 0)
                check_coordinates(self.header.path, done, block.xyz)
                yield block
                done, left = done + got, left - got
            if reader:
                reader.close()

    def _layer_names(self) -> set[str]:
        return {e57_name(column) for column in columns(self.header.attributes)}

    def _block(self, arrays: dict[str, AnyArray], count: int, pose: tuple[AnyArray, AnyArray]) -> PointBlock:
        rotation, translation = pose
        present = [column for column in columns(self.header.attributes) if e57_name(column) in arrays]
        stored = {column.name: arrays[e57_name(column)].copy() for column in present}
        stored |= {name: arrays[field].copy() for name, field in _FIELDS.items() if field in arrays}
        stored["xyz"] = np.stack([arrays[f"cartesian{axis}"] for axis in "XYZ"], axis=1) @ rotation.T + translation
        index = arrays.get("returnIndex", np.zeros(count))  # counts from 0
        stored["return_number"] = index.astype(np.uint8) + np.uint8(1)
        dark = np.zeros(count)
        channels = [arrays.get(name, dark).astype(np.uint16) for name in _CHANNELS]
        stored["rgb"] = np.stack(channels, axis=1) * np.uint16(257)
        return make_points(stored, self.header.attributes, count)


def _field_names(prototype: Any) -> set[str]:
    return {prototype.get(i).elementName() for i in range(prototype.childCount())}


def _pose(scan: Any) -> tuple[AnyArray, AnyArray]:
    """Return the rotation matrix (3, 3) and translation (3,), m, of a scan's pose; identity and 0 without one."""
    if not scan.isDefined("pose"):
        return np.eye(3), np.zeros(3)
    pose = scan["pose"]
    rotation, translation = np.eye(3), np.zeros(3)
    if pose.isDefined("rotation"):
        rotation = quaternion_matrices(np.array([[pose["rotation"][name].value() for name in "wxyz"]]))[0]
    if pose.isDefined("translation"):
        translation = np.array([pose["translation"][name].value() for name in "xyz"])
    return rotation, translation


def _error_text(problem: Exception) -> str:
    return " ".join(str(problem).split())[:80]
