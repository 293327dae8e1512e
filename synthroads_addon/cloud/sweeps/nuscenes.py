"""Tables of nuScenes with ``LIDAR_TOP`` as their only sensor: boxes with tracks; and classes by point beside them.

The ego frame is that of the sweeps; the scanner's own is the same. Global coordinates are map coordinates less the
origin, which the scene's description states. Source: ``docs/schema_nuscenes.md`` and the reader of nuscenes-devkit.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np
from PIL import Image

from .sweep import Box, Sweep, quaternion
from .writer import SweepWriter

VERSION = "v1.0-synthroads"
CLASSES = "point_classes"
"""Table and folder of the points' classes. Not ``lidarseg``: its reader knows the colours of nuScenes' own classes, and
refuses any other."""
_CHANNEL = "LIDAR_TOP"
CATEGORIES = {
    "car": "vehicle.car",
    "estate": "vehicle.car",
    "van": "vehicle.car",
    "truck": "vehicle.truck",
    "semitrailer": "vehicle.truck",
    "bus": "vehicle.bus.rigid",
    "motorcycle": "vehicle.motorcycle",
}
"""nuScenes' categories by the model of a vehicle; other things have those of their classes."""
_LEVELS = ("v0-40", "v40-60", "v60-80", "v80-100")
_STANDING = 0.1
"""Speed up to which a vehicle counts as standing, m/s. Chosen."""
_ATTRIBUTES = ("vehicle.moving", "vehicle.stopped")
_MICRO = 1e6
_MASK = "maps/unknown.png"


class NuscenesWriter(SweepWriter):
    """Writer of sweeps into a folder as nuScenes has it; see `SweepWriter`."""

    def _open(self) -> None:
        """Make the folders, and begin the tables."""
        for folder in (f"samples/{_CHANNEL}", CLASSES, VERSION):
            (self.path / folder).mkdir(parents=True)
        self._tables: dict[str, list[dict[str, Any]]] = {
            name: [] for name in ("sample", "sample_data", "ego_pose", "sample_annotation", CLASSES, "scene")
        }
        self._last: dict[int, dict[str, Any]] = {}
        self._instances: dict[int, dict[str, Any]] = {}

    def write(self, sweep: Sweep) -> None:
        """Write points and classes of a sweep, and add its rows to the tables."""
        key, time = f"{sweep.number:06d}", round(sweep.time * _MICRO)
        scene = f"scene-{sweep.strip + 1:04d}"
        file = f"samples/{_CHANNEL}/{key}.pcd.bin"
        channel = sweep.points.array("channel")
        ring = np.zeros(len(sweep.xyz)) if channel is None else channel
        full = 255.0  # nuScenes' intensities are 0 to 255
        np.column_stack([sweep.xyz, sweep.remission * full, ring]).astype("<f4").tofile(self.path / file)
        sample, data = _token("sample", key), _token("data", key)
        self._tables["ego_pose"].append(
            {
                "token": _token("pose", key),
                "timestamp": time,
                "rotation": quaternion(sweep.rotation).tolist(),
                "translation": sweep.position.tolist(),
            }
        )
        self._chain("sample", scene, {"token": sample, "timestamp": time, "scene_token": _token("scene", scene)})
        self._chain(
            "sample_data",
            scene,
            {
                "token": data,
                "sample_token": sample,
                "ego_pose_token": _token("pose", key),
                "calibrated_sensor_token": _token("calibration", _CHANNEL),
                "timestamp": time,
                "fileformat": "pcd",
                "is_key_frame": True,
                "height": 0,
                "width": 0,
                "filename": file,
            },
        )
        segmentation = f"{CLASSES}/{key}.bin"
        sweep.class_id.astype(np.uint8).tofile(self.path / segmentation)
        self._tables[CLASSES].append({"token": data, "sample_data_token": data, "filename": segmentation})
        self._note_scene(scene, sample)
        for box in sweep.boxes:
            self._annotate(sample, key, box)

    def _chain(self, table: str, scene: str, row: dict[str, Any]) -> None:
        """Add a row to a table whose rows name the one before and the next one of the same scene."""
        rows = self._tables[table]
        linked = bool(rows) and rows[-1]["_scene"] == scene
        if linked:
            rows[-1]["next"] = row["token"]
        rows.append(row | {"prev": rows[-1]["token"] if linked else "", "next": "", "_scene": scene})

    def _note_scene(self, scene: str, sample: str) -> None:
        """Count a sample to its scene, which is a strip."""
        scenes = self._tables["scene"]
        if not scenes or scenes[-1]["name"] != scene:
            origin = ", ".join(f"{value:.3f}" for value in self.place.origin.tolist())
            system = f"EPSG:{self.place.epsg}" if self.place.epsg else "an unnamed map"
            scenes.append(
                {
                    "token": _token("scene", scene),
                    "log_token": _token("log", VERSION),
                    "nbr_samples": 0,
                    "first_sample_token": sample,
                    "name": scene,
                    "description": f"{self.place.title}; global coordinates: {system} less ({origin}) m".strip("; "),
                }
            )
        scenes[-1] |= {"last_sample_token": sample, "nbr_samples": scenes[-1]["nbr_samples"] + 1}

    def _annotate(self, sample: str, key: str, box: Box) -> None:
        """Add the row of a box, and count it to its track."""
        token = _token("annotation", f"{key}-{box.instance}")
        length, width, height = box.size.tolist()
        category = self._category(box)
        moves = float(np.linalg.norm(box.velocity)) > _STANDING
        before = self._last.get(box.instance)
        if before:
            before["next"] = token
        row = {
            "token": token,
            "sample_token": sample,
            "instance_token": _token("instance", str(box.instance)),
            "visibility_token": str(box.visibility),
            "attribute_tokens": [_token("attribute", _ATTRIBUTES[not moves])] if box.kind else [],
            "translation": box.centre.tolist(),
            "size": [width, length, height],
            "rotation": quaternion(box.rotation).tolist(),
            "prev": before["token"] if before else "",
            "next": "",
            "num_lidar_pts": box.points,
            "num_radar_pts": 0,
        }
        self._tables["sample_annotation"].append(row)
        self._last[box.instance] = row
        track = self._instances.setdefault(
            box.instance,
            {
                "token": row["instance_token"],
                "category_token": _token("category", category),
                "nbr_annotations": 0,
                "first_annotation_token": token,
                "synthroads_instance_id": box.instance,
                "synthroads_name": box.name,
            },
        )
        track |= {"last_annotation_token": token, "nbr_annotations": track["nbr_annotations"] + 1}

    def _category(self, box: Box) -> str:
        """Return the name of a box's category."""
        scheme = self.place.scheme
        return CATEGORIES.get(box.kind) or scheme.names().get(int(scheme.ids[box.class_id]), "unlabelled")

    def close(self) -> None:
        """Write the tables."""
        names = self.place.scheme.names()
        free = [number for number in range(255, -1, -1) if number not in names]
        indices = {name: number for number, name in names.items()}
        for name in dict.fromkeys(CATEGORIES.values()):
            indices.setdefault(name, free.pop(0))
        tables = {name: [_without_notes(row) for row in rows] for name, rows in self._tables.items()}
        tables["instance"] = list(self._instances.values())
        tables["category"] = [
            {"token": _token("category", name), "name": name, "description": "", "index": index}
            for name, index in indices.items()
        ]
        tables["attribute"] = [
            {"token": _token("attribute", name), "name": name, "description": ""} for name in _ATTRIBUTES
        ]
        tables["visibility"] = [
            {"token": str(number), "level": level, "description": "share of the side that faces the scanner, %"}
            for number, level in enumerate(_LEVELS, 1)
        ]
        tables["sensor"] = [{"token": _token("sensor", _CHANNEL), "channel": _CHANNEL, "modality": "lidar"}]
        tables["calibrated_sensor"] = [
            {
                "token": _token("calibration", _CHANNEL),
                "sensor_token": _token("sensor", _CHANNEL),
                "translation": [0.0, 0.0, 0.0],
                "rotation": [1.0, 0.0, 0.0, 0.0],
                "camera_intrinsic": [],
            }
        ]
        # A reader needs a mask of where vehicles may drive. Points don't tell: it is one black pixel, nothing known.
        (self.path / "maps").mkdir()
        Image.new("L", (1, 1)).save(self.path / _MASK)
        log = _token("log", VERSION)
        tables["log"] = [
            {"token": log, "logfile": "", "vehicle": "", "date_captured": "", "location": self.place.title}
        ]
        tables["map"] = [
            {"token": _token("map", VERSION), "log_tokens": [log], "category": "semantic_prior", "filename": _MASK}
        ]
        for name, rows in tables.items():
            (self.path / VERSION / f"{name}.json").write_text(json.dumps(rows, indent=0) + "\n", encoding="utf-8")


def _without_notes(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row without what was only noted while it was written."""
    return {name: value for name, value in row.items() if not name.startswith("_")}


def _token(kind: str, name: str) -> str:
    """Return a token of 32 hexadecimal digits, always the same for a kind of row and a name."""
    return hashlib.md5(f"{kind}/{name}".encode(), usedforsecurity=False).hexdigest()
