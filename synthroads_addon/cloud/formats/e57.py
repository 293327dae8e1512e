"""E57 (ASTM E2807) through `pye57`'s binding of libE57, block by block; files of others scan after scan.

pye57's own writer takes whole clouds, in single precision, which at a northing of 5.6 million metres is half a metre.
Here coordinates are scaled integers of 0.1 mm about a pose that carries the offset, so nothing is lost.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import AnyArray
from ...base.errors import InputError, MissingPackageError
from ...base.maps.places import Placement
from ...base.remarks import assume
from ...base.rotations import quaternion_matrices
from ..colours import SIXTEEN_BITS
from ..layers import Column, columns
from ..points import PointBlock
from .header import CloudHeader, header_from_notes, placed, system_of_text
from .reader import CloudReader, check_coordinates, damage_error
from .writer import CloudWriter

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
        raise MissingPackageError("e57", None, "pye57", "e57") from None
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
        """Create the file with its metadata, and the buffers that points are handed to the library in."""
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
        """Collect a block's points in the buffers, which are written whenever they are full."""
        begin = 0
        while begin < len(block):
            part = block.select(slice(begin, begin + _CAPACITY - self._held))
            for name, values in self._pack_columns(part).items():
                self._arrays[name][self._held : self._held + len(part)] = values
            self._held += len(part)
            begin += len(part)
            self._low = np.minimum(self._low, part.xyz.min(axis=0))
            self._high = np.maximum(self._high, part.xyz.max(axis=0))
            self._dimmest = min(self._dimmest, float(part.intensity.min()))
            self._brightest = max(self._brightest, float(part.intensity.max()))
            if self._held == _CAPACITY:
                self._flush()

    def _flush(self) -> None:
        """Write the points in the buffers.

        They are always as many at a time, so that the file doesn't depend on the blocks' sizes.
        """
        if self._held:
            self._points.write(self._held)
            self._held = 0

    def _finish(self) -> None:
        """Write what is left in the buffers, then bounds, limits and identifiers of the scan, and close the file."""
        self._flush()
        self._points.close()
        float_node, integer_node = self._e57.FloatNode, self._e57.IntegerNode
        if self.count:
            spans = np.round([self._low - self.offset, self._high - self.offset], 4).T.tolist()
            axes = zip("xyz", spans, strict=True)
            bounds = {f"{axis}{end}": at for axis, span in axes for end, at in zip(_ENDS, span, strict=True)}
            self._scan.set("cartesianBounds", self._structure(float_node, bounds))
            limits = {"intensityMinimum": self._dimmest, "intensityMaximum": self._brightest}
            self._scan.set("intensityLimits", self._structure(float_node, limits))
        colors = {f"{name}{end}": at for name in _CHANNELS for end, at in zip(_ENDS, (0, 255), strict=True)}
        self._scan.set("colorLimits", self._structure(integer_node, colors))
        for node, what in ((self._scan, "scan"), (self._file.root(), "file")):
            digits = self.content_id(what, self._low.tolist(), self._high.tolist())
            groups = (digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:])
            node.set("guid", self._text("{" + "-".join(groups) + "}"))
        self._file.close()

    def _close(self) -> None:
        """Close the writer of points and the file, in whatever state they are."""
        with suppress(Exception):
            self._points.close()
        self._file.close()

    def _pack_columns(self, part: PointBlock) -> dict[str, AnyArray]:
        """Return the stored values (n,) of at most `_CAPACITY` points, by the columns' names in E57."""
        local_place = part.xyz - self.offset
        columns_of_part = {
            f"cartesian{'XYZ'[i]}": self.to_integers(local_place[:, i], "int32", "xyz", SCALE) for i in range(3)
        }
        rgb = self.to_integers(part.rgb, "uint16", "rgb") >> 8
        columns_of_part |= dict(zip(_CHANNELS, rgb.T, strict=True))
        number, angle = self.to_integers(part.return_number, "uint8", "return_number"), f"{EXTENSION}:scan_angle"
        columns_of_part |= {
            "intensity": self.check_finite(part.intensity, "intensity", self._types["intensity"]),
            "timeStamp": self.check_finite(part.gps_time, "gps_time", self._types["timeStamp"]),
            "returnIndex": np.maximum(number, 1) - 1,  # counts from 0
            "returnCount": self.to_integers(part.number_of_returns, "uint8", "number_of_returns"),
            angle: self.check_finite(part.scan_angle_deg, "scan_angle", self._types[angle]),
            f"{EXTENSION}:strip": self.to_integers(part.strip, "uint16", "strip"),
            # Readers such as pye57's `read_scan` insist on it.
            "cartesianInvalidState": np.full(len(part), _VALID, dtype=np.uint8),
        }
        return columns_of_part | {e57_name(column): self.stored_integers(column, part) for column in self.columns}

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
        """Return the offset, m, that a column's integers are stored less by: the file's for map coordinates, else 0."""
        return float(self.offset[column.component]) if column.local and column.component is not None else 0.0

    def _text(self, text: str) -> Any:
        """Return an E57 node of a text."""
        return self._e57.StringNode(self._file, text)


_FIELDS = {
    "intensity": "intensity",
    "number_of_returns": "returnCount",
    "gps_time": "timeStamp",
    "scan_angle_deg": f"{EXTENSION}:scan_angle",
    "strip": f"{EXTENSION}:strip",
}
"""Names of the arrays that every block has."""
_FLAGGED = {
    "isIntensityInvalid": ("intensity",),
    "isColorInvalid": _CHANNELS,
    "isTimeStampInvalid": ("timeStamp",),
}
"""Fields that say whether others of a point mean something, and the others."""
_PLAIN = {"isIntensityInvalid": "intensity", "isColorInvalid": "colour", "isTimeStampInvalid": "time"}
_SANE = 1e30
"""Limits beyond this aren't those of any instrument, but of the number's type."""
Limits = tuple[float, float]


class E57Reader(CloudReader):
    """Reader of E57 files with Cartesian coordinates; each scan's pose is applied.

    Args:
        path: an existing file.

    Raises:
        InputError: it is no such file, or damaged, or pye57 isn't installed.
    """

    def __init__(self, path: Path) -> None:
        self._e57 = load_libe57()
        try:
            self._file = self._e57.ImageFile(str(path), "r")
        except Exception as problem:
            raise InputError(str(path), None, f"is not an E57 file that can be read ({_error_text(problem)})") from None
        try:
            notes, system_text = self._read_structure(path)
            self.header = self._header(path, notes, system_text)
        except InputError:
            self.close()
            raise
        self._intensities = self._intensity_limits()
        if any(self._intensities):
            self.header = replace(self.header, intensity_scale=SIXTEEN_BITS)

    def _read_structure(self, path: Path) -> tuple[dict[str, Any] | None, str | None]:
        """Find the scans with their fields and counts; return our notes, and the coordinate system that others declare.

        Raises:
            InputError: the file is damaged.
        """
        try:
            root = self._file.root()
            self._scans = [root["data3D"][i] for i in range(len(root["data3D"]))]
            prototypes = [self._e57.StructureNode(scan["points"].prototype()) for scan in self._scans]
            self._fields = [_field_names(prototype) for prototype in prototypes]
            self._counts = [int(scan["points"].childCount()) for scan in self._scans]
            names = _field_names(root)
            if f"{EXTENSION}:notes" in names:
                return json.loads(root[f"{EXTENSION}:notes"].value()), None
            return None, str(root["coordinateMetadata"].value()) if "coordinateMetadata" in names else None
        except Exception as problem:
            raise InputError(str(path), None, f"is an E57 file that is damaged ({_error_text(problem)})") from None

    def _header(self, path: Path, notes: dict[str, Any] | None, system_text: str | None) -> CloudHeader:
        """Return the file's header; raise `InputError` if it has no Cartesian coordinates, or its notes are wrong.

        Args:
            path: of the file.
            notes: ours; None if other software wrote the file.
            system_text: coordinate system that the file declares.
        """
        count, names = sum(self._counts), set[str]().union(*self._fields)
        if count and not all({"cartesianX", "cartesianY", "cartesianZ"} <= fields for fields in self._fields):
            raise InputError(str(path), None, "has no Cartesian coordinates")
        usual, has_color = {*_FIXED, *_FLAGGED}, "colorRed" in names
        header = header_from_notes(path, "E57", count, names, notes, name_of=e57_name, usual=usual, has_color=has_color)
        return replace(header, place=_declared_place(path, system_text)) if system_text else header

    def _intensity_limits(self) -> list[Limits | None]:
        """Return the limits of each scan's intensities; None where they are read as they are stored.

        Ours are in the unit of the notes, whatever the limits. Those of other software are scaled only if all scans
        that have intensities name their limits.
        """
        unscaled: list[Limits | None] = [None] * len(self._scans)
        if self.header.labelled:
            return unscaled
        limits = [self._limits(scan, "intensity", fields) for scan, fields in self._scanned()]
        known = [limit is not None for limit, fields in zip(limits, self._fields, strict=True) if "intensity" in fields]
        if any(known) and not all(known):
            text = "only some of its scans name the limits of intensities: intensities are read unscaled"
            assume(f"{self.header.path.name}: {text}")
            return unscaled
        return limits

    def _stored_blocks(self, size: int) -> Iterator[PointBlock]:
        """Yield the points of one scan after the other, in map coordinates, without invalid ones."""
        position = 0
        for number, (scan, fields, count) in enumerate(zip(self._scans, self._fields, self._counts, strict=True)):
            names = [name for name in sorted(_FIXED.keys() | _FLAGGED.keys() | self._layer_names()) if name in fields]
            intensities, colors = self._intensities[number], self._color_limits(scan, fields)
            buffer_size = min(size, count)
            arrays = {name: np.zeros(buffer_size) for name in names}
            buffers = self._buffers(arrays)
            remaining, reader = count, None
            while remaining:
                try:
                    reader = reader or scan["points"].reader(buffers)
                    count_read = reader.read()
                except Exception:
                    raise damage_error(self.header.path, position, self.header.count) from None
                if count_read == 0:
                    raise damage_error(self.header.path, position, self.header.count)
                part = {name: array[:count_read] for name, array in arrays.items()}
                self._scale(part, intensities, colors)
                block = self._block(part, count_read, _pose(scan), position)
                if "cartesianInvalidState" in part and (invalid := part["cartesianInvalidState"] != _VALID).any():
                    self._remarks["points have no valid coordinates and are left out"] += int(np.count_nonzero(invalid))
                    block = block.select(~invalid)
                check_coordinates(self.header.path, position, block.xyz)
                yield block
                position, remaining = position + count_read, remaining - count_read
            if reader:
                reader.close()

    def _layer_names(self) -> set[str]:
        """Return the names, in E57, of the columns of all layers that the file holds."""
        return {e57_name(column) for column in columns(self.header.attributes)}

    def _scanned(self) -> Iterator[tuple[Any, set[str]]]:
        """Yield each scan with the names of its fields."""
        return zip(self._scans, self._fields, strict=True)

    def _limits(self, scan: Any, name: str, fields: set[str]) -> Limits | None:
        """Return the least and the largest value that a field can have, by the scan's limits or else the field's own.

        None where the scan lacks the field, or where neither are limits of a quantity.
        """
        if name not in fields:
            return None
        group = "colorLimits" if name in _CHANNELS else f"{name}Limits"
        limits: Limits | None = None
        try:
            if scan.isDefined(group) and all(scan[group].isDefined(f"{name}{end}") for end in _ENDS):
                minimum, maximum = (_number_of(scan[group][f"{name}{end}"]) for end in _ENDS)
                limits = (minimum, maximum)
            if not _are_limits(limits):
                limits = _field_limits(self._e57.StructureNode(scan["points"].prototype())[name])
        except Exception as problem:
            raise InputError(
                str(self.header.path), None, f"is an E57 file that is damaged ({_error_text(problem)})"
            ) from None
        return limits if _are_limits(limits) else None

    def _color_limits(self, scan: Any, fields: set[str]) -> dict[str, Limits]:
        """Return the limits of a scan's colour channels; where none are declared, by the largest value there is."""
        limits = {name: self._limits(scan, name, fields) for name in _CHANNELS if name in fields}
        if None in limits.values():
            brightness = self._assumed_brightness(self._colors(), is_integer=False)
            return {name: bounds or (0.0, brightness) for name, bounds in limits.items()}
        return {name: bounds for name, bounds in limits.items() if bounds}

    def _colors(self) -> Iterator[AnyArray]:
        """Yield the stored colours of all scans, in parts, invalid ones as NaN."""
        for (scan, fields), count in zip(self._scanned(), self._counts, strict=True):
            names = [name for name in (*_CHANNELS, "isColorInvalid") if name in fields]
            if not count or "colorRed" not in names:
                continue
            arrays = {name: np.zeros(min(_CAPACITY, count)) for name in names}
            try:
                reader = scan["points"].reader(self._buffers(arrays))
                while got := reader.read():
                    invalid = arrays["isColorInvalid"][:got] != 0 if "isColorInvalid" in arrays else False
                    parts = (array[:got] for name, array in arrays.items() if name in _CHANNELS)
                    yield np.where(invalid, np.nan, np.stack(list(parts)))
                reader.close()
            except self._e57.E57Exception:
                return  # damage is found where the points are read

    def _buffers(self, arrays: dict[str, AnyArray]) -> Any:
        """Return the buffers by which the library reads fields into arrays (n,) of their names."""
        buffers = self._e57.VectorSourceDestBuffer()
        for name, array in arrays.items():
            buffers.append(self._e57.SourceDestBuffer(self._file, name, array, len(array), True, True))
        return buffers

    def _scale(self, part: dict[str, AnyArray], intensities: Limits | None, colors: dict[str, Limits]) -> None:
        """Bring a part's intensities to shares of their limits and colours to 16 bits, in place; invalid ones to 0."""
        is_invalid = {name: part[flag] != 0 for flag, names in _FLAGGED.items() if flag in part for name in names}
        for flag, (name, *_) in _FLAGGED.items():
            if name in is_invalid and (count := int(np.count_nonzero(is_invalid[name]))):
                self._remarks[f"points have an invalid {_PLAIN[flag]}: it is read as 0"] += count
        spans = colors if intensities is None else {**colors, "intensity": intensities}
        for name in (*_CHANNELS, "intensity", "timeStamp"):
            if name not in part:
                continue
            values = np.where(is_invalid[name], np.nan, part[name]) if name in is_invalid else part[name]
            if name in spans:
                values = self._share_of(values, spans[name], "an intensity" if name == "intensity" else "a colour")
                values = np.rint(np.nan_to_num(values) * SIXTEEN_BITS) if name in _CHANNELS else values
            part[name] = np.where(is_invalid[name], 0.0, values) if name in is_invalid else values

    def _share_of(self, values: AnyArray, limits: Limits, quantity: str) -> AnyArray:
        """Return values (n,) as shares, 0 to 1, of the span between limits; values beyond are clipped with a remark.

        Args:
            values: as stored.
            limits: least and largest value.
            quantity: what they are, for the remark.
        """
        share = (values - limits[0]) / (limits[1] - limits[0])
        if count := int(np.count_nonzero((share < 0.0) | (share > 1.0))):
            self._remarks[f"points have {quantity} beyond the file's limits: they are clipped to these limits"] += count
        return np.clip(share, 0.0, 1.0)

    def _block(
        self, arrays: dict[str, AnyArray], count: int, pose: tuple[AnyArray, AnyArray], position: int
    ) -> PointBlock:
        """Return the block of points from the arrays of a scan's fields.

        Args:
            arrays: (n,) or more by the fields' names, brought to scale.
            count: n.
            pose: rotation (3, 3) and translation (3,), m, of the scan.
            position: points before these, for messages.
        """
        rotation, translation = pose
        present = [column for column in columns(self.header.attributes) if e57_name(column) in arrays]
        stored = {column.name: arrays[e57_name(column)].copy() for column in present}
        stored |= {name: arrays[field].copy() for name, field in _FIELDS.items() if field in arrays}
        stored["xyz"] = np.stack([arrays[f"cartesian{axis}"] for axis in "XYZ"], axis=1) @ rotation.T + translation
        if "returnIndex" in arrays:  # counts from 0
            stored["return_number"] = arrays["returnIndex"] + 1.0
        else:
            stored["return_number"] = np.ones(count, dtype=np.uint8)
        no_light = np.zeros(count)
        stored["rgb"] = np.stack([arrays.get(name, no_light) for name in _CHANNELS], axis=1)
        return self._points(stored, count, position)


def _are_limits(limits: Limits | None) -> bool:
    """Return whether limits are those of a quantity: not the extremes of a number's type, and not equal."""
    return limits is not None and -_SANE < limits[0] < limits[1] < _SANE


def _number_of(node: Any) -> float:
    """Return the value of an E57 node of any kind of number."""
    return float(node.scaledValue() if hasattr(node, "scaledValue") else node.value())


def _field_limits(node: Any) -> Limits:
    """Return the least and the largest value that the prototype of an E57 field allows."""
    if hasattr(node, "scaledMinimum"):
        return float(node.scaledMinimum()), float(node.scaledMaximum())
    return float(node.minimum()), float(node.maximum())


def _declared_place(path: Path, text: str) -> Placement:
    """Return the placement that a file of others declares, whose coordinates are metres by the standard."""
    place = placed(path, *system_of_text(text))
    if place.declared is not None and place.scale is not None:
        requirement = "isn't in metres, the unit of coordinates in the E57 standard: it is unclear which one is right"
        raise InputError(f"{path}: coordinate system", place.declared.label, requirement)
    return place


def _field_names(prototype: Any) -> set[str]:
    """Return the names of the elements of an E57 structure."""
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
    """Return an error's message in one line of 80 characters at most."""
    return " ".join(str(problem).split())[:80]
