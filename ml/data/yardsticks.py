"""Public labelled data sets as yardsticks: their files found in a user's folder, read, and mapped to classes.

Nothing is downloaded, and nothing of these data sets comes with the package. A yardstick is a JSON file that says which
files are which split, where they keep labels and intensities, and which of their numbers is which class.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, Self

import laspy
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from synthroads_addon.base.arrays import AnyArray, Float
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.named_paths import stays_below
from synthroads_addon.base.remarks import assume, warn
from synthroads_addon.base.schema import read_json
from synthroads_addon.cloud.formats.ply import read_ply_header
from synthroads_addon.cloud.formats.reader import BLOCK
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import PointBlock

from ..configuration import SHIPPED, Part, names_in, shipped_file
from .classes import LabelMapping

YARDSTICKS = SHIPPED / "yardsticks"
"""Folder of the shipped yardsticks."""
Form = Literal["sweeps", "ply", "las", "any"]
_SWEEP = np.dtype([("xyz", "<f4", 3), ("remission", "<f4")])
_FULL = 65535.0


class Yardstick(Part):
    """A public data set: its files by split, and where they keep what."""

    title: str = Field(min_length=1, description="Title of the data set.")
    source: str = Field(min_length=1, description="Address, licence and authors of the data set.")
    form: Form = Field(
        description="Format of the files; sweeps: SemanticKITTI's .bin and .label; any: by the file's ending."
    )
    splits: dict[str, tuple[str, ...]] = Field(min_length=1, description="Patterns of the file paths of each split.")
    mapping: LabelMapping = Field(description="Attribute of the labels, and the class of each label.")
    intensity: str = Field(
        "intensity", min_length=1, description="Attribute of the intensities; points without it have the intensity 0."
    )
    names: str = Field(
        "", description="JSON file in the folder with the name of each number, if classes are mapped by name."
    )
    numbers: dict[str, str] = Field(
        {}, description="Name of each number in arrays (.npy), if the folder doesn't have this file."
    )

    @model_validator(mode="after")
    def _check_paths(self) -> Self:
        """Refuse paths and patterns that lead out of the data set's folder."""
        for name in (
            *([self.names] if self.names else []),
            *(pattern for patterns in self.splits.values() for pattern in patterns),
        ):
            if not stays_below(name):
                raise ValueError(f"'{name}' must lie in the data set's folder: a relative path with / and without ..")
        return self

    def files(self, folder: Path, split: str | None) -> list[Path]:
        """Return the files of a split, or of all, in a folder, sorted.

        Raises:
            InputError: there is no such split.
            MissingFileError: the folder holds none of its files.
        """
        if split is not None and split not in self.splits:
            raise InputError("split", split, f"must be one of {', '.join(self.splits)}")
        patterns = [
            pattern
            for name, split_patterns in self.splits.items()
            if split in (None, name)
            for pattern in split_patterns
        ]
        readable = (".bin", ".ply", ".las", ".laz", ".npy")
        paths = {path for pattern in patterns for path in folder.glob(pattern) if path.suffix.lower() in readable}
        if not paths:
            raise MissingFileError(str(folder), None, f"holds no file like {' or '.join(patterns[:4])}")
        return sorted(paths)

    def mapping_in(self, folder: Path) -> LabelMapping:
        """Return the mapping of numbers, made from names by the file in the folder where classes have names.

        Raises:
            MissingFileError, InputError: that file is missing, or isn't numbers and names.
        """
        if not self.names:
            return self.mapping
        path = folder / self.names
        if not path.is_file() and self.numbers and next(folder.rglob("*.npy"), None):
            listed = ", ".join(f"{number} {name}" for number, name in self.numbers.items())
            assume(f"{folder.name} has no {self.names}: the numbers of its classes are read as {listed}")
            return self.mapping.model_copy(update={"classes": self._named(self.numbers)})
        if not path.is_file():
            class_names = ", ".join(self.mapping.classes)
            raise MissingFileError(
                str(path), None, f'must say which number is which class: {{"1": "NAME", ...}}, of {class_names}'
            )
        name_data = read_json(path)
        if not isinstance(name_data, dict) or not all(isinstance(name, str) for name in name_data.values()):
            raise InputError(
                str(path), None, 'must be an object of numbers as text and names, e.g. {"1": "RoadSurface"}'
            )
        return self.mapping.model_copy(update={"classes": self._named(name_data)})

    def _named(self, names: Mapping[str, str]) -> dict[str, str]:
        """Return number -> class, by the names of the numbers."""
        return {number: self.mapping.classes[name] for number, name in names.items() if name in self.mapping.classes}


def yardstick_names() -> list[str]:
    """Return the names of the shipped yardsticks, sorted."""
    return names_in(YARDSTICKS)


def load_yardstick(name_or_file: str) -> Yardstick:
    """Return a shipped yardstick or one from a JSON file.

    Raises:
        MissingFileError, InputError: there is no such file, or it is no yardstick.
    """
    path = shipped_file("yardstick", YARDSTICKS, name_or_file, [".json"])
    return Yardstick.from_dict(read_json(path), str(name_or_file))


def numbered_blocks(path: Path, yardstick: Yardstick) -> Iterator[tuple[PointBlock, NDArray[np.int64]]]:
    """Yield a file's points in blocks, intensities as shares of what the file can hold, with their label numbers (N,).

    Raises:
        MissingFileError: there is no such file, or no labels beside a sweep.
        InputError: it is damaged, or lacks the labels.
    """
    form = path.suffix.lower().removeprefix(".") if yardstick.form == "any" else yardstick.form
    if form == "sweeps":
        yield _sweep(path)
    elif form == "npy":
        yield from _array(path)
    elif form == "ply":
        yield from _ply(path, yardstick)
    else:
        yield from _las(path, yardstick.mapping.field)


def _sweep(path: Path) -> tuple[PointBlock, NDArray[np.int64]]:
    """Return a sweep of SemanticKITTI: float32 x, y, z, remission; labels as uint32, the class in the lower 16 bits."""
    labels = path.parent.parent / "labels" / f"{path.stem}.label"
    if not labels.is_file():
        raise MissingFileError(str(labels), None, f"there is no such file, so {path.name} has no labels")
    if path.stat().st_size % _SWEEP.itemsize:
        raise InputError(
            str(path),
            path.stat().st_size,
            f"must hold {_SWEEP.itemsize} bytes for each point, so its size must be a multiple of that",
        )
    points, numbers = np.fromfile(path, dtype=_SWEEP), np.fromfile(labels, dtype="<u4")
    if len(points) != len(numbers):
        raise InputError(str(labels), len(numbers), f"must hold a label for each of the {len(points)} points")
    xyz = _finite(path, points["xyz"].astype(np.float64))
    return _block(xyz, points["remission"].astype(np.float64), None), (numbers & 0xFFFF).astype(np.int64)


def _array(path: Path) -> Iterator[tuple[PointBlock, NDArray[np.int64]]]:
    """Yield the points of an array (N, 4 or more) in a .npy file: x, y, z, number of the class; the rest is ignored.

    Raises:
        InputError: it is no such array, or a coordinate isn't finite.
    """
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError):
        raise InputError(str(path), None, "must be an array in NumPy's format (.npy)") from None
    if not isinstance(array, np.ndarray) or array.ndim != 2 or array.shape[1] < 4 or array.dtype.kind not in "fiu":
        shape = getattr(array, "shape", None)
        raise InputError(str(path), shape, "must be numbers of shape (N, 4): x, y, z, class")
    if array.shape[1] > 4:
        warn(f"{path.name}: its columns after the fourth (x, y, z, class) are ignored")
    for rows_done in range(0, len(array), BLOCK):
        rows = np.asarray(array[rows_done : rows_done + BLOCK], dtype=np.float64)
        xyz = _finite(path, rows[:, :3])
        label = np.where(np.isfinite(rows[:, 3]), rows[:, 3], -1.0)
        yield _block(xyz, np.zeros(len(rows)), None), np.rint(label).astype(np.int64)


def _ply(path: Path, yardstick: Yardstick) -> Iterator[tuple[PointBlock, NDArray[np.int64]]]:
    """Yield the points of a PLY file with their label numbers, by the yardstick's names of attributes."""
    with path.open("rb") as file:
        count, kind, _ = read_ply_header(path, file)
        names = kind.names or ()
        for name in ("x", "y", "z", yardstick.mapping.field):
            if name not in names:
                raise InputError(f"{path}: attribute", name, f"must be one of {', '.join(names)}")
        full_intensity = _largest(kind, yardstick.intensity) if yardstick.intensity in names else 1.0
        for points_done in range(0, count, BLOCK):
            rows = min(BLOCK, count - points_done)
            data = file.read(rows * kind.itemsize)
            if len(data) != rows * kind.itemsize:
                raise InputError(str(path), None, f"is truncated: {count} points are in its header")
            record = np.frombuffer(data, dtype=kind)
            xyz = _finite(path, np.stack([record[axis].astype(np.float64) for axis in "xyz"], axis=1))
            intensity = (
                record[yardstick.intensity].astype(np.float64) if yardstick.intensity in names else np.zeros(rows)
            )
            rgb = np.stack([record[name] for name in ("red", "green", "blue")], axis=1) if "red" in names else None
            yield (
                _block(xyz, intensity / full_intensity, rgb),
                np.rint(record[yardstick.mapping.field]).astype(np.int64),
            )


def _largest(kind: np.dtype[Any], name: str) -> float:
    """Return the full intensity of an attribute: the largest number of 8 bits, or of 16 bits for all wider types."""
    part = kind[name]
    return float(np.iinfo(part).max) if part.itemsize == 1 else _FULL


def _las(path: Path, field: str) -> Iterator[tuple[PointBlock, NDArray[np.int64]]]:
    """Yield the points of a LAS or LAZ file with the numbers of an attribute."""
    with open_cloud(path) as cloud, laspy.open(path, read_evlrs=False) as file:
        names = list(file.header.point_format.dimension_names)
        if field not in names:
            raise InputError(f"{path}: attribute", field, f"must be one of {', '.join(names)}")
        scale = cloud.header.intensity_scale or 1.0
        for file_block, record in zip(cloud.blocks(), file.chunk_iterator(BLOCK), strict=True):
            is_usable = cloud.usable_points(file_block, noise=True)  # the mapping says what the numbers mean
            block = file_block.select(is_usable)
            yield (
                _block(block.xyz, block.intensity * scale / _FULL, block.rgb),
                np.asarray(record[field])[is_usable].astype(np.int64),
            )


def _finite(path: Path, xyz: Float) -> Float:
    """Return coordinates; InputError unless all are finite."""
    if not np.isfinite(xyz).all():
        raise InputError(str(path), None, "must hold finite coordinates")
    return xyz


def _block(xyz: Float, intensity: Float, rgb: AnyArray | None) -> PointBlock:
    """Return a block of N points with intensities as shares and, if there are any, colours of 8 or 16 bits."""
    count = len(xyz)
    zeros = np.zeros(count)
    colors = np.zeros((count, 3), dtype=np.uint16) if rgb is None else rgb.astype(np.uint16)
    if rgb is not None and rgb.dtype.itemsize == 1:
        colors = colors * np.uint16(257)
    return PointBlock(
        xyz=xyz,
        intensity=np.clip(intensity, 0.0, 1.0),
        rgb=colors,
        class_id=np.zeros(count, dtype=np.uint8),
        instance_id=np.zeros(count, dtype=np.uint32),
        return_number=np.ones(count, dtype=np.uint8),
        number_of_returns=np.ones(count, dtype=np.uint8),
        gps_time=zeros,
        scan_angle_deg=zeros.astype(np.float32),
        strip=np.zeros(count, dtype=np.uint16),
        range=zeros,
        incidence_deg=zeros.astype(np.float32),
    )
