"""A scan into memory: the points' arrays by name, as a cloud's files hold them, while blocks of points come in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Float
from ...base.classes import ClassScheme
from ...base.errors import InputError
from ...cloud.layers import LAYERS, layer_arrays
from ...cloud.points import POINT_TYPES, PointBlock
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario
from .sink import CloudSink, ScanCounts

_UNITS = {"xyz": "m", "gps_time": "s", "scan_angle_deg": "deg"}
"""Units of the arrays that every cloud has; of the others it is 1."""


@dataclass(frozen=True)
class ScanArrays:
    """The points of a scan as NumPy arrays, in the order in which a cloud's file would hold them.

    Attributes:
        arrays: array by name: ``xyz`` (N, 3) float64 map coordinates, m, and the others (N, ...) that
            `cloud.points.PointBlock` describes. ``class_id`` is of the scenario's scheme. ``intensity`` is 1 for an
            ideal white target, struck at a right angle at 1 m, and neither rounded nor clipped.
        units: unit by name of the array; "1" for what has none.
        classes: class name by ``class_id``, also of classes that no point has; 255 is unlabelled.
        instances: name by ``instance_id`` of what the points are of, ``object`` or ``object/part``; of a scene without
            a road of ours it is empty.
        epsg: map coordinate system; None if unknown.
        crs: map and vertical coordinate system as WKT; None if unknown.
        report: what `generate` and `scan_scene` write to ``report.json``, as JSON data.
    """

    arrays: Mapping[str, AnyArray]
    units: Mapping[str, str]
    classes: Mapping[int, str]
    instances: Mapping[int, str]
    epsg: int | None
    crs: str | None
    report: Mapping[str, Any]

    def __len__(self) -> int:
        """Return the number of points, N."""
        return len(self.arrays["xyz"])

    def __getitem__(self, name: str) -> AnyArray:
        """Return an array by its name.

        Raises:
            InputError: the cloud has no such array; ``cloud.attributes`` of the scenario says which it has.
        """
        if name not in self.arrays:
            raise InputError("array", name, f"must be one of {', '.join(self.arrays)}; see cloud.attributes")
        return self.arrays[name]

    @property
    def xyz(self) -> Float:
        """Return the map coordinates (N, 3), m."""
        return self.arrays["xyz"]

    @property
    def counts(self) -> Mapping[str, Any]:
        """Return the counts of pulses, rays and points, also by class, as JSON data."""
        return dict(self.report["counts"])

    @property
    def remarks(self) -> tuple[str, ...]:
        """Return warnings about the scan, and remarks on its input, as sentences."""
        return (*self.report.get("warnings", ()), *self.report["remarks"])


@dataclass
class ArraySink(CloudSink):
    """Sink that keeps the arrays of the scenario's cloud in memory.

    Attributes:
        scenario: says which attributes the cloud has.
        inputs: what the files that it names hold, its classes among them.
        folder: for files that thinning out takes meanwhile.
        typical_range: usual distance to what is scanned, m.
        counts: what was counted so far.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    folder: Path
    typical_range: float
    counts: ScanCounts = field(default_factory=ScanCounts)
    _count: int = 0

    def __post_init__(self) -> None:
        array_names, layers = self.scenario.cloud.arrays(), layer_arrays()
        self._types = POINT_TYPES | {name: layers[name] for name in layers if name in array_names}
        self._ids = self.scheme.ids
        self._parts: dict[str, list[AnyArray]] = {name: [] for name in self._types}

    @property
    def scheme(self) -> ClassScheme:
        """Return the class scheme of the arrays."""
        return self.inputs.scheme

    @contextmanager
    def _opened(self) -> Iterator[None]:
        """Context in which points are kept; at its end the number of points that stayed is counted."""
        yield
        self.counts.points = self._count

    def _keep(self, points: PointBlock) -> None:
        """Keep a block's arrays, the classes as ids of the scheme; InputError for one that the block lacks."""
        if not len(points):
            return
        for name, parts in self._parts.items():
            values = points.array(name)
            if values is None:
                raise InputError("cloud.attributes", name, "is in cloud.attributes, but the points don't have it")
            parts.append(np.take(self._ids, values) if name == "class_id" else values)
        self._count += len(points)

    def take(self) -> dict[str, AnyArray]:
        """Return the arrays by name, each put together once, and give up the blocks that they came in."""
        return {name: self._joined(self._parts.pop(name), *self._types[name]) for name in self._types}

    def _joined(self, parts: list[AnyArray], kind: str, width: int) -> AnyArray:
        """Return one array (N,) or (N, width) of a type from its parts."""
        array = np.empty((self._count, width) if width > 1 else self._count, dtype=kind)
        return np.concatenate(parts, out=array, casting="same_kind") if parts else array

    def units(self) -> dict[str, str]:
        """Return the unit of each array by its name; "1" for what has none."""
        units = {column.array: column.unit for layer in LAYERS.values() for column in layer.columns} | _UNITS
        return {name: units.get(name, "1") for name in self._types}

    def result(
        self, report: Mapping[str, Any], epsg: int | None, crs: str | None, name_of: Callable[[int], str | None]
    ) -> ScanArrays:
        """Return the arrays with what they mean; the sink's blocks are given up.

        Args:
            report: of the job.
            epsg: map coordinate system; None if unknown.
            crs: the same, with heights, as WKT.
            name_of: returns the name of an instance number; None where it has none.
        """
        arrays = self.take()
        numbers = np.unique(arrays["instance_id"]).tolist()
        names = {number: name for number in numbers if (name := name_of(number)) is not None}
        return ScanArrays(arrays, self.units(), self.scheme.names(), names, epsg, crs, report)
