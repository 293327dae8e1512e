"""Data sets of analytic roads on disk, as `synthroads dataset` would leave them, without Blender."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ml.data.points import Points
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.points import PointBlock
from tests.helpers.roads import analytic_roads

SPLITS = {"a-01": "train", "a-02": "validation", "a-03": "test"}


def write_data_set(folder: Path) -> Path:
    """Write three roads, one for each split."""
    entries = []
    for number, (name, split) in enumerate(SPLITS.items()):
        scene = folder / "scenes" / name
        scene.mkdir(parents=True)
        road = analytic_roads.parameters(seed=5 + number)
        (scene / "parameters.json").write_text(canonical_json(road.to_dict()))
        write_cloud(scene / "cloud.laz", analytic_roads.points(seed=5 + number))
        entries.append({"name": name, "seed": number, "status": "done", "split": split})
    manifest = {"type": "Manifest", "version": "1.0", "title": "t", "generator": "g", "recipe_sha256": "0"}
    text = json.dumps(manifest | {"complete": True, "scenes": entries})
    (folder / "manifest.json").write_text(text)
    return folder


def write_cloud(path: Path, cloud: Points) -> Path:
    """Write points as a cloud with the project's five classes."""
    zeros = np.zeros(len(cloud))
    block = PointBlock(
        xyz=cloud.xyz + cloud.origin,
        intensity=cloud.intensity.astype(np.float64),
        rgb=(65535.0 * cloud.rgb).astype(np.uint16),
        class_id=cloud.class_id,
        instance_id=zeros.astype(np.uint32),
        return_number=np.ones(len(cloud), dtype=np.uint8),
        number_of_returns=np.ones(len(cloud), dtype=np.uint8),
        gps_time=zeros,
        scan_angle_deg=zeros.astype(np.float32),
        strip=zeros.astype(np.uint16),
        range=zeros + 50.0,
        incidence_deg=zeros.astype(np.float32),
    )
    with open_writer(path, 25832, cloud.origin, 65535.0, (), class_scheme("5").as_stored()) as writer:
        writer.write(block)
    return path
