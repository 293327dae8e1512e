"""Read a labelled cloud into NumPy arrays, count its classes, and hand it to Open3D where that is installed."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from synthroads_addon import Job, generate, load_scenario, open_cloud
from synthroads_addon.base.errors import SynthRoadsError

try:
    import open3d
except ImportError:
    open3d = None

SMALL = ["fidelity=draft", "road.length=60", "road.half_width=20", "scan.platform.speed=20"]


def read_arrays(cloud: Path) -> tuple[dict[str, np.ndarray], dict[int, str]]:
    """Return arrays by name and the names of classes: xyz (N, 3) float64, map coordinates in m; rgb (N, 3) uint16."""
    names = ("xyz", "rgb", "class_id", "instance_id", "intensity")
    with open_cloud(cloud) as reader:
        blocks, classes = list(reader.blocks()), reader.header.scheme.names()
    return {name: np.concatenate([getattr(block, name) for block in blocks]) for name in names}, classes


def write_for_open3d(arrays: dict[str, np.ndarray], file: Path) -> None:
    """Write a PLY by Open3D; its viewers have 32-bit floats, so the lowest corner becomes the origin."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(arrays["xyz"] - arrays["xyz"].min(axis=0)))
    cloud.colors = open3d.utility.Vector3dVector(arrays["rgb"] / 65535.0)
    open3d.io.write_point_cloud(str(file), cloud.voxel_down_sample(0.1))


def main(output: Path, cloud: Path | None = None) -> None:
    """Make a small cloud if none is given, print its classes, and write its arrays."""
    if cloud is None:
        generate(Job(load_scenario("rq31-600m", SMALL), output / "road"))
        cloud = output / "road" / "cloud.laz"
    arrays, classes = read_arrays(cloud)
    for number, count in zip(*np.unique(arrays["class_id"], return_counts=True), strict=True):
        height = arrays["xyz"][arrays["class_id"] == number, 2].mean()
        print(f"{classes.get(int(number), 'unlabelled'):14} {count:9,} points, mean height {height:7.2f} m")
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
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
