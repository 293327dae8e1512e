"""Clouds, judged by readers that share no code with the writers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.judges.samples import Samples

_LAS_STEP, _E57_STEP = 5e-4, 5e-5
"""Half a step of stored coordinates, m."""
_PCD_STEP = 5e-4
"""Largest error of coordinates in single precision less an offset near the road, m."""


def _compared(samples: Samples, xyz: np.ndarray, step: float, exact: Mapping[str, tuple[Any, Any]]) -> list[str]:
    """Return what differs from the points that were written: coordinates by more than a step, others at all."""
    wanted = samples.points.xyz
    if xyz.shape != wanted.shape:
        return [f"{len(xyz)} points of {len(wanted)}"]
    found = []
    away = float(np.abs(xyz - wanted).max())
    if away > step + 1e-9:
        found.append(f"coordinates are up to {away:.3g} m off")
    for name, (have, want) in exact.items():
        if not np.array_equal(have, want):
            found.append(f"{name} differs")
    return found


def laszip_verdict(samples: Samples) -> list[str]:
    """Return what LASzip's own code reads differently."""
    import laspy

    with laspy.open(samples.file("cloud.laz"), laz_backend=laspy.LazBackend.Laszip) as reader:
        las = reader.read()
    points = samples.points
    exact = {
        "gps_time": (las.gps_time, points.gps_time),
        "red": (las.red, points.rgb[:, 0]),
        "class_id": (las["class_id"], points.class_id),
        "instance_id": (las["instance_id"], points.instance_id),
        "return_number": (las.return_number, points.return_number),
    }
    return _compared(samples, np.asarray(las.xyz), _LAS_STEP, exact)


def with_another_scale(samples: Samples) -> Samples:
    """Return files with a LAZ whose steps of x are said to be twice as long."""
    data = bytearray(samples.file("cloud.laz").read_bytes())
    data[131:139] = (2.0 * np.frombuffer(data[131:139], "<f8")).tobytes()
    return samples.with_file("cloud.laz", bytes(data))


def copclib_verdict(samples: Samples) -> list[str]:
    """Return what copclib reads differently, node by node, and whether a point lies outside its node's box."""
    import copclib

    reader = copclib.FileReader(str(samples.file("cloud.copc.laz")))
    info = reader.copc_config.copc_info
    root = np.array([info.center_x, info.center_y, info.center_z]) - info.halfsize
    rows = []
    for node in reader.GetAllNodes():
        inside = [(point.gps_time, point.x, point.y, point.z, point.red) for point in reader.GetPoints(node)]
        edge = 2.0 * info.halfsize / 2**node.key.d
        places = (np.array(inside)[:, 1:4] - root) / edge - [node.key.x, node.key.y, node.key.z]
        if places.min() < 0.0 or places.max() >= 1.0:
            return [f"a point lies outside the box of node {node.key}"]
        rows += inside
    points = samples.points
    if len(rows) != len(points):
        return [f"{len(rows)} points of {len(points)}"]
    order = np.argsort(points.gps_time, kind="stable")
    found = np.array(sorted(rows))
    exact = {
        "gps_time": (found[:, 0], points.gps_time[order]),
        "red": (found[:, 4], points.rgb[order, 0]),
    }
    return _compared(samples, found[np.argsort(order, kind="stable"), 1:4], _LAS_STEP, exact)


def with_a_smaller_root(samples: Samples) -> Samples:
    """Return files with a COPC whose octree is said to be a tenth smaller."""
    data = bytearray(samples.file("cloud.copc.laz").read_bytes())
    half = 429 + 24  # of the record of information, behind the header and the record's own
    data[half : half + 8] = (0.9 * np.frombuffer(data[half : half + 8], "<f8")).tobytes()
    return samples.with_file("cloud.copc.laz", bytes(data))


def plyfile_verdict(samples: Samples) -> list[str]:
    """Return what plyfile reads differently."""
    import plyfile

    vertex = plyfile.PlyData.read(samples.file("cloud.ply"))["vertex"]
    points = samples.points
    exact = {
        "red": (vertex["red"], points.rgb[:, 0] >> 8),
        "class_id": (vertex["scalar_class_id"], points.class_id),
        "instance_id": (vertex["scalar_instance_id"], points.instance_id),
        "gps_time": (vertex["scalar_gps_time"], points.gps_time),
    }
    return _compared(samples, np.stack([vertex[axis] for axis in "xyz"], axis=1), 0.0, exact)


def with_another_point(samples: Samples) -> Samples:
    """Return files with a PLY in which a bit of the first point is another."""
    data = bytearray(samples.file("cloud.ply").read_bytes())
    data[data.index(b"end_header\n") + 11 + 6] ^= 1
    return samples.with_file("cloud.ply", bytes(data))


def pypcd4_verdict(samples: Samples) -> list[str]:
    """Return what pypcd4 reads differently; coordinates count from the file's offset."""
    import pypcd4

    path = samples.file("cloud.pcd")
    fields = pypcd4.PointCloud.from_path(path).pc_data
    line = next(line for line in path.read_bytes().split(b"\n") if line.startswith(b"# map coordinates: "))
    offset = [float(part.split()[-1]) for part in line.decode().split(",")]
    points = samples.points
    exact = {
        "class_id": (fields["class_id"], points.class_id),
        "instance_id": (fields["instance_id"], points.instance_id),
        "gps_time": (fields["gps_time"], points.gps_time),
        "red": (fields["rgb"].view("<u4") >> 16, points.rgb[:, 0] >> 8),
    }
    xyz = np.stack([fields[axis].astype(np.float64) for axis in "xyz"], axis=1) + offset
    return _compared(samples, xyz, _PCD_STEP, exact)


def with_another_label(samples: Samples) -> Samples:
    """Return files with a PCD in which a bit of the last point is another."""
    data = bytearray(samples.file("cloud.pcd").read_bytes())
    data[-17] ^= 1  # of its instance_id: range and incidence, 12 bytes, are behind it
    return samples.with_file("cloud.pcd", bytes(data))


def pye57_verdict(samples: Samples) -> list[str]:
    """Return what libE57 reads differently, by pye57."""
    import pye57

    with pye57.E57(str(samples.file("cloud.e57"))) as file:
        scan = file.read_scan(0, intensity=True, colors=True)
    xyz = np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    return _compared(samples, xyz, _E57_STEP, {"red": (scan["colorRed"], samples.points.rgb[:, 0] >> 8)})


def with_a_broken_page(samples: Samples) -> Samples:
    """Return files with an E57 in which a bit of the points is another: its pages have checksums."""
    data = bytearray(samples.file("cloud.e57").read_bytes())
    data[len(data) // 2] ^= 1
    return samples.with_file("cloud.e57", bytes(data))
