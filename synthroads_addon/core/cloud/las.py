"""LAS 1.4 / LAZ, point format 7, written block by block under a temporary name.

Besides the standard fields each point has these extra bytes: ``class_id`` (see `labels`; the standard field
``classification`` holds its LAS code), ``instance_id``, ``range`` (m) and ``incidence`` (deg). The scale of the 16-bit
intensity stands as JSON in the VLR ``SynthRoads`` 1.
"""

from __future__ import annotations

from datetime import date
from pathlib import Path
from types import TracebackType

import laspy
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray

from ..crs import wkt
from ..errors import OutputError
from ..schema import canonical_json
from .labels import las_codes
from .points import PointBlock

SCALE = 0.001
"""Size of a coordinate's step, m."""
SCAN_ANGLE_STEP = 0.006
"""Degrees per step of the scan angle (LAS 1.4 R15, table 14)."""
_EXTRA = (
    laspy.ExtraBytesParams("class_id", "uint8", "SynthRoads class"),
    laspy.ExtraBytesParams("instance_id", "uint32", "object's instance number"),
    laspy.ExtraBytesParams("range", "uint32", "measured range, m", offsets=[0.0], scales=[0.0001]),
    laspy.ExtraBytesParams("incidence", "uint16", "incidence angle, deg", offsets=[0.0], scales=[0.01]),
)


class LasWriter:
    """Writes point blocks to a LAZ (or, by its ending, LAS) file; a context manager.

    The file appears under its name only when the context ends without an exception.

    Args:
        path: file to write.
        epsg: map coordinate system, or None.
        offset: (3,) LAS offsets, map coordinates near the points, m.
        intensity_scale: 16-bit steps per unit of `PointBlock.intensity`.

    Attributes:
        count: points written so far.
        clipped: points whose intensity exceeded 16 bits.
    """

    def __init__(self, path: Path, epsg: int | None, offset: NDArray[np.float64], intensity_scale: float) -> None:
        self.path = path
        self.intensity_scale = intensity_scale
        self.count = 0
        self.clipped = 0
        self._codes = las_codes()
        self._header = self._make_header(epsg, np.floor(np.asarray(offset, dtype=np.float64)))
        self._temporary = path.with_name(f".{path.name}.partial")

    def __enter__(self) -> LasWriter:
        self._file = self._temporary.open("wb")
        self._writer = laspy.LasWriter(
            self._file,
            self._header,
            do_compress=self.path.suffix.lower() == ".laz",
            laz_backend=laspy.LazBackend.LazrsParallel,
            closefd=False,
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._writer.close()
        except OSError as problem:
            kind = type(problem)
            raise OutputError(str(self.path), None, f"cannot be written ({problem.strerror})") from None
        finally:
            self._file.close()
            if kind is None:
                self._temporary.replace(self.path)
            else:
                self._temporary.unlink(missing_ok=True)

    def write(self, block: PointBlock) -> None:
        """Append a block; raise `OutputError` if a coordinate doesn't fit into LAS integers or the disk is full."""
        if len(block) == 0:
            return
        record = laspy.ScaleAwarePointRecord.zeros(len(block), header=self._header)
        steps = np.rint((block.xyz - self._header.offsets) / self._header.scales)
        if not np.all(np.abs(steps) < 2**31):
            worst = block.xyz[np.abs(steps).max(axis=1).argmax()]
            raise OutputError(str(self.path), worst.tolist(), "coordinates must lie within 2147 km of the offset")
        record.X, record.Y, record.Z = steps.astype(np.int32).T
        brightness = np.rint(block.intensity * self.intensity_scale)
        self.clipped += int(np.count_nonzero(brightness > 65535))
        record.intensity = np.clip(brightness, 0, 65535).astype(np.uint16)
        record.red, record.green, record.blue = block.rgb.T
        record.classification = self._codes[block.class_id]
        record.return_number = block.return_number
        record.number_of_returns = block.number_of_returns
        record.gps_time = block.gps_time
        record.scan_angle = np.rint(block.scan_angle_deg / SCAN_ANGLE_STEP).astype(np.int16)
        record.point_source_id = block.strip + 1
        record["class_id"] = block.class_id
        record["instance_id"] = block.instance_id
        record["range"] = block.range
        record["incidence"] = block.incidence_deg
        try:
            self._writer.write_points(record)
        except OSError as problem:
            raise OutputError(str(self.path), None, f"cannot be written ({problem.strerror})") from None
        self.count += len(block)

    def _make_header(self, epsg: int | None, offset: NDArray[np.float64]) -> laspy.LasHeader:
        header = laspy.LasHeader(point_format=7, version="1.4")
        header.offsets, header.scales = offset, np.full(3, SCALE)
        header.system_identifier = "SynthRoads simulation"
        header.generating_software = "SynthRoads"
        # No wall clock in files: the same seed gives the same bytes on any day.
        header.creation_date = date(2000, 1, 1)
        header.global_encoding.wkt = True
        header.add_extra_dims(list(_EXTRA))
        for extra in header.vlrs.get("ExtraBytesVlr")[0].extra_bytes_structs:
            # laspy 2.7 takes the smallest and largest value from the first point of each block only; both are optional.
            extra.options &= ~(extra.MIN_BIT_MASK | extra.MAX_BIT_MASK)
        notes = canonical_json({"intensity_scale": self.intensity_scale, "classes": "extra byte class_id"})
        header.vlrs.append(laspy.VLR("SynthRoads", 1, "intensity scale", notes.encode()))
        if epsg is not None:
            header.vlrs.append(WktCoordinateSystemVlr(wkt(epsg)))
        return header
