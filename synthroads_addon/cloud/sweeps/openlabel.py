"""ASAM OpenLABEL 1.0: objects with cuboids by frame, the poses between, and what is known of each.

A frame is a sweep; its points are named by the files of the other formats, where they are written, by its number.
Source: ASAM OpenLABEL 1.0.0, and its JSON schema.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from .sweep import Box, Sweep, quaternion
from .writer import SweepWriter

VERSION = "1.0.0"
_SENSOR, _MAP = "lidar", "map"
"""Coordinate systems: the frame of a sweep, and the map less the origin."""


class OpenlabelWriter(SweepWriter):
    """Writer of the sweeps' boxes into an OpenLABEL file; see `SweepWriter`."""

    def _open(self) -> None:
        """Begin without frames."""
        self._frames: dict[str, Any] = {}
        self._objects: dict[int, tuple[Box, list[int]]] = {}

    def write(self, sweep: Sweep) -> None:
        """Add a frame."""
        objects = {str(box.instance): {"object_data": _box_data(sweep, box)} for box in sweep.boxes}
        for box in sweep.boxes:
            self._objects.setdefault(box.instance, (box, []))[1].append(sweep.number)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = sweep.rotation, sweep.position
        transform = {
            "src": _SENSOR,
            "dst": _MAP,
            "transform_src_to_dst": {"matrix4x4": [_rounded(value) for value in matrix.ravel()]},
        }
        self._frames[str(sweep.number)] = {
            "frame_properties": {
                "timestamp": f"{sweep.time:.6f}",
                "transforms": {f"{_SENSOR}_to_{_MAP}": transform},
                "streams": {_SENSOR: {"stream_properties": {"sync": {"timestamp": f"{sweep.time:.6f}"}}}},
                "synthroads_strip": sweep.strip,
                "synthroads_points": len(sweep.points),
            },
        } | ({"objects": objects} if objects else {})

    def close(self) -> None:
        """Write the file."""
        origin = self.place.origin.tolist()
        names, ids = self.place.scheme.names(), self.place.scheme.ids
        content: dict[str, Any] = {
            "metadata": {
                "schema_version": VERSION,
                "name": self.place.title,
                "annotator": self.place.generator,
                "synthroads_epsg": self.place.epsg,
                "synthroads_origin": origin,
            },
            "coordinate_systems": {
                _MAP: {"type": "scene_cs", "parent": "", "children": [_SENSOR]},
                _SENSOR: {"type": "sensor_cs", "parent": _MAP, "children": []},
            },
            "streams": {_SENSOR: {"type": "lidar", "description": "the scan's points"}},
            "objects": {
                str(instance): {
                    "name": box.name or str(instance),
                    "type": box.kind or names.get(int(ids[box.class_id]), "unlabelled"),
                    "coordinate_system": _SENSOR,
                    "frame_intervals": _intervals(numbers),
                    "object_data": {
                        "text": [{"name": "class", "val": names.get(int(ids[box.class_id]), "unlabelled")}],
                        "num": [
                            {"name": "class_id", "val": int(ids[box.class_id])},
                            {"name": "instance_id", "val": box.instance},
                        ],
                    },
                }
                for instance, (box, numbers) in self._objects.items()
            },
            "frames": self._frames,
            "frame_intervals": _intervals(sorted(int(number) for number in self._frames)),
        }
        empty = [name for name in ("objects", "frames", "frame_intervals") if not content[name]]
        for name in empty:
            del content[name]
        self.path.write_text(json.dumps({"openlabel": content}, separators=(",", ":")) + "\n", encoding="utf-8")


def _box_data(sweep: Sweep, box: Box) -> dict[str, Any]:
    """Return what a frame says of a box: cuboids of the whole thing and of what was seen, velocity, points, occlusion.

    Velocities have the axes of the frame of the sweep.
    """
    rotation = sweep.rotation.T @ box.rotation
    turn = np.roll(quaternion(rotation), -1)  # x, y, z, w

    def cuboid(name: str, centre: Any, size: Any) -> dict[str, Any]:
        """Return a cuboid of ten numbers: centre, quaternion, size."""
        place = sweep.rotation.T @ (centre - sweep.position)
        values = [_rounded(value) for value in (*place, *turn, *size)]
        return {"name": name, "coordinate_system": _SENSOR, "val": values}

    cuboids = [cuboid("amodal", box.centre, box.size)]
    if box.seen_centre is not None and box.seen_size is not None:
        cuboids.append(cuboid("visible", box.seen_centre, box.seen_size))
    numbers: list[dict[str, Any]] = [{"name": "points", "val": box.points}]
    if box.seen is not None:
        numbers.append({"name": "occlusion", "val": _rounded(1.0 - box.seen)})
    velocity = [_rounded(value) for value in sweep.rotation.T @ box.velocity]
    return {"cuboid": cuboids, "num": numbers, "vec": [{"name": "velocity", "val": velocity}]}


def _rounded(value: float) -> float:
    """Return a number to a nanometre, or a billionth; -0 as 0."""
    return round(float(value), 9) + 0.0


def _intervals(numbers: list[int]) -> list[dict[str, int]]:
    """Return the runs of numbers that follow each other, in ascending order."""
    runs: list[dict[str, int]] = []
    for number in numbers:
        if runs and runs[-1]["frame_end"] == number - 1:
            runs[-1]["frame_end"] = number
        else:
            runs.append({"frame_start": number, "frame_end": number})
    return runs
