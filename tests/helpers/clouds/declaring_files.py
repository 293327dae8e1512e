"""Small clouds as other software writes them, which declare flags, limits, scales and names of their own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import laspy
import numpy as np

COUNT = 20
PLACES = np.column_stack([np.arange(COUNT) * 0.5, np.arange(COUNT) * 0.25, np.full(COUNT, 0.1)])
"""Of the points of all these files, m."""
EVERY_FIFTH = np.arange(COUNT) % 5 == 0
_WORDS = {"<f4": "float", "<f8": "double", "u1": "uchar", "<u2": "ushort", "<i4": "int", "i1": "char", "<i2": "short"}


def las_file(
    path: Path,
    kind: int = 6,
    *,
    version: str = "1.4",
    standard_time: bool = False,
    places: np.ndarray = PLACES,
    **dimensions: Any,
) -> Path:
    """Write a LAS or LAZ file with these dimensions, classes being 2 if nothing is said; return its path."""
    header = laspy.LasHeader(version=version, point_format=kind)
    header.offsets, header.scales = np.floor(places.min(axis=0)), [0.001] * 3
    if standard_time:
        header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    las = laspy.LasData(header)
    las.x, las.y, las.z = places.T
    las.classification = np.full(len(places), 2, dtype=np.uint8)
    for name, values in dimensions.items():
        las[name] = np.broadcast_to(values, len(places))
    las.write(path)
    return path


def ply_file(path: Path, columns: Mapping[str, tuple[str, Any]], element: str = "vertex", places: bool = True) -> Path:
    """Write a binary PLY file of x, y, z and properties (NumPy type, values) by name; return its path."""
    every = {axis: ("<f8", PLACES[:, i]) for i, axis in enumerate("xyz")} if places else {}
    every |= columns
    record = np.zeros(COUNT, dtype=[(name, kind) for name, (kind, _) in every.items()])
    for name, (_, values) in every.items():
        record[name] = values
    head = ["ply", "format binary_little_endian 1.0", f"element {element} {COUNT}"]
    head += [f"property {_WORDS[kind]} {name}" for name, (kind, _) in every.items()]
    path.write_bytes("\n".join([*head, "end_header", ""]).encode() + record.tobytes())
    return path


def e57_file(
    path: Path,
    columns: Mapping[str, tuple[Any, str, float, float]],
    limits: Mapping[str, Mapping[str, float]] | None = None,
    scans: int = 1,
    spans: Mapping[int, Mapping[str, Mapping[str, float]]] | None = None,
) -> Path:
    """Write an E57 file of Cartesian points and fields (values, ``int``, ``scaled`` or ``float``, least, largest).

    Args:
        path: file to write.
        columns: by name; a scaled one has steps of a thousandth.
        limits: of all scans, as ``intensityLimits``: whole numbers as such.
        scans: number of scans, all of the same points.
        spans: limits of single scans by their number, in place of those.
    """
    from pye57 import libe57 as e57

    image = e57.ImageFile(str(path), "w")
    image.extensionsAdd("", e57.E57_V1_0_URI)
    root = image.root()
    for name, text in (("formatName", "ASTM E57 3D Imaging Data File"), ("guid", "{1}"), ("coordinateMetadata", "")):
        root.set(name, e57.StringNode(image, text))
    root.set("versionMajor", e57.IntegerNode(image, 1))
    root.set("versionMinor", e57.IntegerNode(image, 0))
    data = e57.VectorNode(image, True)
    root.set("data3D", data)
    root.set("images2D", e57.VectorNode(image, True))
    every = {f"cartesian{axis}": (PLACES[:, i], "float", -np.inf, np.inf) for i, axis in enumerate("XYZ")}
    every |= columns
    for number in range(scans):
        _add_scan(e57, image, data, every, (spans or {}).get(number, limits) or {})
    image.close()
    return path


def _add_scan(e57: Any, image: Any, data: Any, every: Mapping[str, Any], limits: Mapping[str, Any]) -> None:
    scan, prototype = e57.StructureNode(image), e57.StructureNode(image)
    data.append(scan)
    scan.set("guid", e57.StringNode(image, f"{{scan {len(data)}}}"))
    for group, members in limits.items():
        node = e57.StructureNode(image)
        for name, value in members.items():
            node.set(name, e57.IntegerNode(image, value) if isinstance(value, int) else e57.FloatNode(image, value))
        scan.set(group, node)
    buffers, arrays = e57.VectorSourceDestBuffer(), []
    for name, (values, kind, low, high) in every.items():
        if kind == "float":
            bounds = [float(np.clip(bound, -1.7e308, 1.7e308)) for bound in (low, high)]
            node = e57.FloatNode(image, max(bounds[0], 0.0), e57.E57_DOUBLE, *bounds)
        elif kind == "scaled":
            node = e57.ScaledIntegerNode(image, int(low), int(low), int(high), 1e-3, 0.0)
        else:
            node = e57.IntegerNode(image, int(low), int(low), int(high))
        prototype.set(name, node)
        arrays.append(np.full(COUNT, values, dtype=np.float64 if kind == "float" else np.longlong))
        buffers.append(e57.SourceDestBuffer(image, name, arrays[-1], COUNT, True, False))
    points = e57.CompressedVectorNode(image, prototype, e57.VectorNode(image, True))
    scan.set("points", points)
    writer = points.writer(buffers)
    writer.write(COUNT)
    writer.close()
