"""Small clouds of others that declare a coordinate system in one of the ways that are in use."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from laspy.vlrs.known import GeoDoubleParamsVlr, GeoKeyDirectoryVlr, WktCoordinateSystemVlr
from pyproj import CRS

METRES = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.5], [10.0, 20.0, 1.0], [0.0, 20.0, 1.5]])
"""Points relative to a corner, m."""
FOOT = 1200.0 / 3937.0
"""US survey foot, m."""


def gdal(text: object) -> str:
    """Return WKT 1 of a system as GDAL writes it."""
    return str(CRS.from_user_input(text).to_wkt("WKT1_GDAL"))


def esri(text: object) -> str:
    """Return a system's WKT as ESRI writes it: without codes."""
    return str(CRS.from_user_input(text).to_wkt("WKT1_ESRI"))


@dataclass(frozen=True)
class Declared:
    """Declarations of a LAS file.

    Attributes:
        text: WKT.
        behind: whether the WKT stands behind the points (EVLR).
        keys: GeoTIFF keys, number -> value; a float goes to the record of doubles.
        bit: whether the header says that WKT counts.
        unit: m per unit of x, y, z of the coordinates that are stored.
        corner: of the points, m.
    """

    text: str = ""
    behind: bool = False
    keys: tuple[tuple[int, float], ...] = ()
    bit: bool = True
    unit: tuple[float, float, float] = (1.0, 1.0, 1.0)
    corner: tuple[float, float, float] = (294_000.0, 5_628_000.0, 180.0)

    @property
    def points(self) -> Any:
        """Return the points (4, 3) in metres."""
        return METRES + self.corner

    def write(self, path: Path) -> Path:
        """Write the points as LAS 1.4, point format 6, by laspy alone; return the path."""
        header = laspy.LasHeader(point_format=6, version="1.4")
        stored = self.points / self.unit
        header.offsets, header.scales = np.floor(stored.min(axis=0)), np.full(3, 1e-5)
        header.global_encoding.wkt = self.bit and bool(self.text)
        if self.text and not self.behind:
            header.vlrs.append(WktCoordinateSystemVlr(self.text))
        if self.keys:
            self._add_keys(header)
        las = laspy.LasData(header)
        las.x, las.y, las.z = stored.T
        las.classification = np.full(len(stored), 2, np.uint8)
        if self.behind:
            header.evlrs = laspy.vlrs.vlrlist.VLRList()
            other = laspy.VLR("someone", 7, "", b"x" * 300)
            header.evlrs.extend([other, laspy.VLR("LASF_Projection", 2112, "", self.text.encode() + b"\0")])
        las.write(path)
        return path

    def _add_keys(self, header: laspy.LasHeader) -> None:
        doubles = [value for _, value in self.keys if isinstance(value, float)]
        rows = [
            (number, 34736, 1, doubles.index(value)) if isinstance(value, float) else (number, 0, 1, int(value))
            for number, value in self.keys
        ]
        record = GeoKeyDirectoryVlr()
        record.parse_record_data(
            struct.pack("<4H", 1, 1, 0, len(rows)) + b"".join(struct.pack("<4H", *r) for r in rows)
        )
        header.vlrs.append(record)
        if doubles:
            numbers = GeoDoubleParamsVlr()
            numbers.parse_record_data(struct.pack(f"<{len(doubles)}d", *doubles))
            header.vlrs.append(numbers)


def write_e57(path: Path, text: str, corner: tuple[float, float, float]) -> Path:
    """Write the points as an E57 file of others, with a text as its ``coordinateMetadata``; return the path."""
    from pye57 import libe57 as e57

    image = e57.ImageFile(str(path), "w")
    image.extensionsAdd("", e57.E57_V1_0_URI)
    root = image.root()
    for name, value in (
        ("formatName", "ASTM E57 3D Imaging Data File"),
        ("guid", "{1}"),
        ("coordinateMetadata", text),
    ):
        root.set(name, e57.StringNode(image, value))
    root.set("versionMajor", e57.IntegerNode(image, 1))
    root.set("versionMinor", e57.IntegerNode(image, 0))
    scans, scan = e57.VectorNode(image, True), e57.StructureNode(image)
    root.set("data3D", scans)
    root.set("images2D", e57.VectorNode(image, True))
    scans.append(scan)
    scan.set("guid", e57.StringNode(image, "{2}"))
    prototype, buffers, kept = e57.StructureNode(image), e57.VectorSourceDestBuffer(), []
    for column, axis in enumerate("XYZ"):
        prototype.set(f"cartesian{axis}", e57.FloatNode(image, 0.0, e57.E57_DOUBLE, -1e30, 1e30))
        kept.append(np.ascontiguousarray((METRES + corner)[:, column]))
        buffers.append(e57.SourceDestBuffer(image, f"cartesian{axis}", kept[-1], len(METRES), True, False))
    points = e57.CompressedVectorNode(image, prototype, e57.VectorNode(image, True))
    scan.set("points", points)
    writer = points.writer(buffers)
    writer.write(len(METRES))
    writer.close()
    image.close()
    return path
