"""SemanticKITTI: points, labels and poses by sequence; a sequence is a strip.

A label has the class in its lower 16 bits, as the cloud's ``class_id``, and in the upper ones the number of the
instance in its sequence, which ``instances.csv`` joins with the cloud's ``instance_id`` of 32 bits. Poses are the
camera's, as in KITTI's odometry benchmark, relative to the first one. Source: semantic-kitti.org, "Dataset", and the
code of ``semantic-kitti-api``.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Float
from ...base.errors import OutputError
from .pinhole import PROJECTION, TO_CAMERA
from .sweep import Sweep
from .writer import SweepWriter, numbers_text, write_velodyne

CONFIGURATION = "classes.yaml"
"""Names, colours and numbers of the classes, as ``semantic-kitti-api`` reads them with ``--config``."""
_MOST_INSTANCES = 65_535


class SemanticKittiWriter(SweepWriter):
    """Writer of sweeps into a folder as SemanticKITTI has it; see `SweepWriter`."""

    def _open(self) -> None:
        """Make the folder."""
        self.path.mkdir()
        self._sequence = -1
        self._numbers: dict[int, int] = {}
        self._of: dict[int, tuple[int, str]] = {}
        self._poses: list[str] = []
        self._times: list[str] = []
        self._first = (np.eye(3), np.zeros(3))

    @property
    def _folder(self) -> Path:
        """Return the folder of the sequence that is being written."""
        return self.path / "sequences" / f"{self._sequence:02d}"

    def write(self, sweep: Sweep) -> None:
        """Write points and labels of a sweep; another strip begins another sequence."""
        if sweep.strip != self._sequence:
            self._end_sequence()
            self._sequence = sweep.strip
            self._first = (sweep.rotation, sweep.position)
            self._start = sweep.time
            for name in ("velodyne", "labels"):
                (self._folder / name).mkdir(parents=True)
        name = f"{len(self._poses):06d}"
        write_velodyne(self._folder / "velodyne" / f"{name}.bin", sweep)
        labels = sweep.class_id.astype("<u4") | (self._instances(sweep) << np.uint32(16))
        labels.astype("<u4").tofile(self._folder / "labels" / f"{name}.label")
        self._poses.append(numbers_text(self._camera_pose(sweep)))
        self._times.append(f"{sweep.time - self._start:.6e}")

    def close(self) -> None:
        """Write the last sequence's poses, and the classes."""
        self._end_sequence()
        rows = self.place.scheme.rows
        names = self.place.scheme.names()
        numbers = sorted(names)
        colors = self.place.scheme.colors()
        configuration: dict[str, Any] = {
            "name": "synthroads",
            "labels": {number: names[number] for number in numbers},
            "color_map": {number: colors[number][::-1].tolist() for number in numbers},  # blue, green, red
            "learning_map": {number: index for index, number in enumerate(numbers)},
            "learning_map_inv": dict(enumerate(numbers)),
            "learning_ignore": {index: number not in {row.id for row in rows} for index, number in enumerate(numbers)},
            "split": {"train": list(range(self._sequence + 1)), "valid": [], "test": []},
        }
        (self.path / CONFIGURATION).write_text(_yaml(configuration), encoding="utf-8")

    def _instances(self, sweep: Sweep) -> Any:
        """Return the numbers (N,) of the points' instances in the sequence, uint32; new ones are numbered on."""
        instances, index = np.unique(sweep.points.instance_id, return_inverse=True)
        first_rows = np.zeros(len(instances), dtype=np.int64)
        first_rows[index[::-1]] = np.arange(len(index))[::-1]
        for instance, row in zip(instances.tolist(), first_rows.tolist(), strict=True):
            if instance and instance not in self._numbers:
                self._numbers[instance] = len(self._numbers) + 1
                self._of[instance] = (int(sweep.class_id[row]), self.place.name_of(instance))
        if len(self._numbers) > _MOST_INSTANCES:
            requirement = f"must be at most {_MOST_INSTANCES} in a sequence, as SemanticKITTI has 16 bits for them"
            raise OutputError(f"{self.path.name}: instances", len(self._numbers), requirement)
        table = np.array([self._numbers.get(instance, 0) for instance in instances.tolist()], dtype=np.uint32)
        return table[index] if len(table) else np.zeros(0, dtype=np.uint32)

    def _camera_pose(self, sweep: Sweep) -> Float:
        """Return the pose (3, 4) of the camera in its first frame, as KITTI's odometry benchmark has it."""
        rotation, position = self._first
        turn, shift = rotation.T @ sweep.rotation, rotation.T @ (sweep.position - position)
        return np.column_stack([TO_CAMERA @ turn @ TO_CAMERA.T, TO_CAMERA @ shift])

    def _end_sequence(self) -> None:
        """Write what belongs to a whole sequence, and begin anew; nothing if none has begun."""
        if self._sequence < 0:
            return
        folder = self._folder
        (folder / "poses.txt").write_text("".join(f"{line}\n" for line in self._poses), encoding="ascii")
        (folder / "times.txt").write_text("".join(f"{line}\n" for line in self._times), encoding="ascii")
        entries = {f"P{number}": PROJECTION for number in range(4)}
        entries["Tr"] = np.column_stack([TO_CAMERA, np.zeros(3)])
        text = "".join(f"{name}: {numbers_text(values)}\n" for name, values in entries.items())
        (folder / "calib.txt").write_text(text, encoding="ascii")
        names = self.place.scheme.names()
        with (folder / "instances.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file)
            table.writerow(("number", "instance_id", "class_id", "class", "name"))
            for instance, number in self._numbers.items():
                class_id, name = self._of[instance]
                table.writerow((number, instance, class_id, names.get(class_id, ""), name))
        self._numbers, self._of, self._poses, self._times = {}, {}, [], []


def _yaml(data: dict[str, Any]) -> str:
    """Return data of two levels as YAML: values are written as JSON, which YAML contains; keys are plain."""
    lines = []
    for name, value in data.items():
        if isinstance(value, dict):
            lines += [f"{name}:", *(f"  {key}: {json.dumps(item)}" for key, item in value.items())]
        else:
            lines.append(f"{name}: {json.dumps(value)}")
    return "\n".join(lines) + "\n"
