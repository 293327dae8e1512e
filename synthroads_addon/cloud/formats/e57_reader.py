"""E57 files, the project's own and others', block by block, scan after scan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ..layers import COLUMNS, columns, gather
from ..points import PointBlock
from .e57_writer import EXTENSION, e57_name, library
from .reader import BLOCK, CloudHeader, CloudReader, damaged, finite_coordinates, header_from_notes

_STANDARD = {
    *("cartesianX", "cartesianY", "cartesianZ", "intensity", "colorRed", "colorGreen", "colorBlue", "timeStamp"),
    *("returnIndex", "returnCount", "cartesianInvalidState", f"{EXTENSION}:scan_angle", f"{EXTENSION}:strip"),
}


class E57Reader(CloudReader):
    """Reads E57 files with Cartesian coordinates; each scan's pose is applied.

    Args:
        path: an existing file.

    Raises:
        InputError: it is no such file, or damaged, or pye57 isn't installed.
    """

    def __init__(self, path: Path) -> None:
        self._e57 = e57 = library()
        try:
            self._image = e57.ImageFile(str(path), "r")
        except Exception as problem:
            raise InputError(str(path), None, f"is not an E57 file that can be read ({_short(problem)})") from None
        try:
            root = self._image.root()
            self._scans = [root["data3D"][i] for i in range(len(root["data3D"]))]
            self._fields = [_field_names(e57.StructureNode(scan["points"].prototype())) for scan in self._scans]
            counts = [int(scan["points"].childCount()) for scan in self._scans]
            told = f"{EXTENSION}:notes" in _field_names(root)
            notes = json.loads(root[f"{EXTENSION}:notes"].value()) if told else None
        except Exception as problem:
            self.close()
            raise InputError(str(path), None, f"is an E57 file that is damaged ({_short(problem)})") from None
        names = set().union(*self._fields)
        if sum(counts) and not all({"cartesianX", "cartesianY", "cartesianZ"} <= fields for fields in self._fields):
            self.close()
            raise InputError(str(path), None, "has no Cartesian coordinates")
        known = {column.name for group in COLUMNS.values() for column in group if e57_name(column) in names}
        header = header_from_notes(path, "E57", sum(counts), known, notes)
        read = _STANDARD | {e57_name(column) for column in columns(header.attributes)}
        self._counts = counts
        self.header = CloudHeader(
            **{
                **header.__dict__,
                "has_color": "colorRed" in names,
                "left_out": tuple(sorted(names - read)),
            }
        )

    def blocks(self, size: int = BLOCK) -> Iterator[PointBlock]:
        """See `CloudReader`."""
        done = 0
        for scan, fields, count in zip(self._scans, self._fields, self._counts, strict=True):
            wanted = [name for name in sorted(_STANDARD | self._own()) if name in fields]
            room = min(size, count)
            arrays = {name: np.zeros(room) for name in wanted}
            buffers = self._e57.VectorSourceDestBuffer()
            for name, array in arrays.items():
                buffers.append(self._e57.SourceDestBuffer(self._image, name, array, room, True, True))
            left, reader = count, None
            while left:
                try:
                    reader = reader or scan["points"].reader(buffers)
                    got = reader.read()
                except Exception:
                    raise damaged(self.header.path, done, self.header.count) from None
                if got == 0:
                    raise damaged(self.header.path, done, self.header.count)
                block = self._block({name: array[:got] for name, array in arrays.items()}, got, _pose(scan))
                invalid = arrays["cartesianInvalidState"][:got] if "cartesianInvalidState" in arrays else None
                block = block if invalid is None else block.select(invalid == 0)
                finite_coordinates(self.header.path, done, block.xyz)
                yield block
                done, left = done + got, left - got
            if reader:
                reader.close()

    def close(self) -> None:
        """Close the file."""
        self._image.close()

    def _own(self) -> set[str]:
        return {e57_name(column) for column in columns(self.header.attributes)}

    def _block(
        self, arrays: dict[str, NDArray[Any]], count: int, pose: tuple[NDArray[Any], NDArray[Any]]
    ) -> PointBlock:
        def values(name: str, kind: Any) -> NDArray[Any]:
            return arrays[name].astype(kind) if name in arrays else np.zeros(count, dtype=kind)

        rotation, translation = pose
        local = np.stack([arrays[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
        own = columns(self.header.attributes)
        found = gather(
            {c.name: arrays[e57_name(c)].copy() for c in own if e57_name(c) in arrays}, self.header.attributes, count
        )
        return PointBlock(
            xyz=local @ rotation.T + translation,
            intensity=values("intensity", np.float64),
            rgb=np.stack([values(f"color{c}", np.uint16) * np.uint16(257) for c in ("Red", "Green", "Blue")], axis=1),
            return_number=values("returnIndex", np.uint8) + np.uint8(1),
            number_of_returns=values("returnCount", np.uint8),
            gps_time=values("timeStamp", np.float64),
            scan_angle_deg=values(f"{EXTENSION}:scan_angle", np.float32),
            strip=values(f"{EXTENSION}:strip", np.uint16),
            **found,
        )


def _field_names(prototype: Any) -> set[str]:
    return {prototype.get(i).elementName() for i in range(prototype.childCount())}


def _pose(scan: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return rotation matrix (3, 3) and translation (3,) of a scan."""
    if not scan.isDefined("pose"):
        return np.eye(3), np.zeros(3)
    pose = scan["pose"]
    rotation, translation = np.eye(3), np.zeros(3)
    if pose.isDefined("rotation"):
        w, x, y, z = (pose["rotation"][name].value() for name in "wxyz")
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
    if pose.isDefined("translation"):
        translation = np.array([pose["translation"][name].value() for name in "xyz"])
    return rotation, translation


def _short(problem: Exception) -> str:
    return " ".join(str(problem).split())[:80]
