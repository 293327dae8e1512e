"""KITTI's object detection benchmark: ``velodyne``, ``label_2`` and ``calib`` by sweep.

Labels are of the things that the camera of `pinhole` would have in its image. A box stands upright around the whole
thing, as these files hold a yaw only. Source: ``readme.txt`` of KITTI's development kit for objects.
"""

from __future__ import annotations

import numpy as np

from .pinhole import PROJECTION, TO_CAMERA, image_box
from .sweep import Box, Sweep, upright
from .writer import SweepWriter, numbers_text, write_velodyne

TYPES = {"car": "Car", "estate": "Car", "van": "Van", "truck": "Truck", "semitrailer": "Truck", "bus": "Truck"}
"""KITTI's types by the model of a vehicle; it has none for motorcycles. Others have their classes' names."""
SEEN = (0.8, 0.5)
"""Shares of the side that faces the scanner from which a thing is fully visible (0) or partly occluded (1), else
largely (2). Chosen: KITTI's annotators judged by eye."""
_UNKNOWN = 3


class KittiWriter(SweepWriter):
    """Writer of sweeps into a folder as KITTI's object detection benchmark has it; see `SweepWriter`."""

    def _open(self) -> None:
        """Make the folders."""
        self._names: list[str] = []
        for name in ("velodyne", "label_2", "calib"):
            (self.path / "training" / name).mkdir(parents=True)
        (self.path / "ImageSets").mkdir()

    def write(self, sweep: Sweep) -> None:
        """Write points, labels and calibration of a sweep."""
        name, folder = f"{sweep.number:06d}", self.path / "training"
        write_velodyne(folder / "velodyne" / f"{name}.bin", sweep)
        lines = [line for box in sweep.boxes if (line := self._label(sweep, box))]
        (folder / "label_2" / f"{name}.txt").write_text("".join(f"{line}\n" for line in lines), encoding="ascii")
        (folder / "calib" / f"{name}.txt").write_text(_calibration(), encoding="ascii")
        self._names.append(name)

    def close(self) -> None:
        """Write the list of sweeps."""
        text = "".join(f"{name}\n" for name in self._names)
        (self.path / "ImageSets" / "train.txt").write_text(text, encoding="ascii")

    def _label(self, sweep: Sweep, box: Box) -> str | None:
        """Return the line of a box; None if it isn't in the image."""
        shown = image_box((box.corners() - sweep.position) @ sweep.rotation)
        if shown is None:
            return None
        centre, size, yaw = upright(*sweep.in_frame(box), box.size)
        length, width, height = size.tolist()
        bottom = TO_CAMERA @ (centre - [0.0, 0.0, height / 2.0])
        turn = _half_turn(-yaw - np.pi / 2.0)
        alpha = _half_turn(turn - np.arctan2(bottom[0], bottom[2]))
        occluded = _UNKNOWN if box.seen is None else sum(box.seen < share for share in SEEN)
        kind = TYPES.get(box.kind) or self.place.scheme.names().get(
            int(self.place.scheme.ids[box.class_id]), "Misc"
        ).replace(" ", "_")
        numbers = [alpha, *shown[:4], height, width, length, *bottom, turn]
        return f"{kind} {shown.truncated:.2f} {occluded} " + " ".join(f"{number:.4f}" for number in numbers)


def _half_turn(angle: float) -> float:
    """Return an angle, rad, within -pi and pi."""
    return float(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi)


def _calibration() -> str:
    """Return the calibration: all four projections are that of the one camera, at the scanner's place."""
    to_camera = np.column_stack([TO_CAMERA, np.zeros(3)])
    entries = {f"P{number}": PROJECTION for number in range(4)}
    entries |= {"R0_rect": np.eye(3), "Tr_velo_to_cam": to_camera, "Tr_imu_to_velo": np.eye(4)[:3]}
    return "".join(f"{name}: {numbers_text(values)}\n" for name, values in entries.items())
