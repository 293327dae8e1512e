"""Read a labelled cloud into NumPy arrays, count its classes, and hand it to Open3D where that is installed."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from synthroads_addon import Job, generate, load_scenario, open_cloud

try:
    import open3d
except ImportError:
    open3d = None

SMALL = ["fidelity=draft", "road.length=60", "road.half_width=20", "scan.platform.speed=20"]


def read_arrays(cloud: Path) -> dict[str, np.ndarray]:
    """Return a cloud's arrays by name: xyz (N, 3) float64, map coordinates in m; rgb (N, 3) uint16; the others (N,)."""
    names = ("xyz", "rgb", "class_id", "instance_id", "intensity")
    with open_cloud(cloud) as reader:
        blocks = list(reader.blocks())
    return {name: np.concatenate([getattr(block, name) for block in blocks]) for name in names}


def write_for_open3d(arrays: dict[str, np.ndarray], file: Path) -> None:
    """Write a PLY by Open3D; its viewers have 32-bit floats, so the lowest corner becomes the origin."""
    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(arrays["xyz"] - arrays["xyz"].min(axis=0))
    cloud.colors = open3d.utility.Vector3dVector(arrays["rgb"] / 65535.0)
    open3d.io.write_point_cloud(str(file), cloud.voxel_down_sample(0.1))


def main(output: Path, cloud: Path | None = None) -> None:
    """Make a small cloud if none is given, print its classes, and write its arrays."""
    if cloud is None:
        generate(Job(load_scenario("rq31-600m", SMALL), output / "road"))
        cloud = output / "road" / "cloud.laz"
    arrays = read_arrays(cloud)
    with open_cloud(cloud) as reader:
        names = reader.header.scheme.names()
    for number, count in zip(*np.unique(arrays["class_id"], return_counts=True), strict=True):
        height = arrays["xyz"][arrays["class_id"] == number, 2].mean()
        print(f"{names.get(int(number), 'unlabelled'):14} {count:9,} points, mean height {height:7.2f} m")
    output.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(output / "arrays.npz", **arrays)
    if open3d is None:
        print("Open3D isn't installed: no open3d.ply is written")
    else:
        write_for_open3d(arrays, output / "open3d.ply")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    parser.add_argument("cloud", type=Path, nargs="?", help="LAZ, LAS, PLY or NPZ; if left out, a small one is made")
    main(**vars(parser.parse_args()))
