"""Count the points that differ between two clouds of one job, such as with kernels and without, by what differs.

    python studies/scanner/compare_clouds.py out/off out/auto

Each is a folder that `synthroads generate` or `synthroads scan` has written. Points are the same if they have the same
time and return number. How far apart two of them are is told in metres and in widths of the beam's footprint there.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import laspy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import Scenario

PLACE = ("x", "y", "z")


def read_points(folder: Path) -> tuple[laspy.LasData, np.ndarray]:
    """Return a folder's cloud, and the keys (N,) of its points: the bytes of time and return number."""
    cloud = laspy.read(folder / "cloud.laz")
    keys = np.stack([np.asarray(cloud.gps_time), np.asarray(cloud.return_number, np.float64)], axis=1)
    return cloud, np.ascontiguousarray(keys).view("V16").ravel()


def comparison(folders: tuple[Path, Path]) -> dict[str, Any]:
    """Return how many points both clouds have, how many differ in each dimension, and by how much at most."""
    (first_cloud, keys), (second_cloud, second_keys) = (read_points(folder) for folder in folders)
    _, first_rows, second_rows = np.intersect1d(keys, second_keys, return_indices=True)
    result: dict[str, Any] = {
        "points": len(keys),
        "in one cloud alone": len(keys) + len(second_keys) - 2 * len(first_rows),
    }
    distances = np.sqrt(
        sum(np.square(np.asarray(first_cloud[i])[first_rows] - np.asarray(second_cloud[i])[second_rows]) for i in PLACE)
    )
    scenario = json.loads((folders[0] / "report.json").read_text(encoding="utf-8"))["scenario"]
    width = (
        scanner_setting(Scenario.model_validate(scenario).scan).beam_angle * np.asarray(first_cloud.range)[first_rows]
    )
    result["place"] = int(np.count_nonzero(distances))
    result["place, by at most, m"] = float(distances.max(initial=0.0))
    result["outside of the footprint"] = int(np.count_nonzero(distances > np.maximum(width, 1e-3)))
    for name in first_cloud.point_format.dimension_names:
        a, b = np.asarray(first_cloud[name])[first_rows], np.asarray(second_cloud[name])[second_rows]
        if name.lower() not in PLACE and (differs := a != b).any():
            result[name] = int(np.count_nonzero(differs))
            result[f"{name}, by at most"] = float(np.abs(a[differs].astype(float) - b[differs]).max())
    return result


def main() -> int:
    """Print the comparison of the two folders of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs=2, type=Path, metavar="DIR", help="folder of a cloud and its report")
    result = comparison(tuple(parser.parse_args().folders))
    points = result["points"]
    for name, value in result.items():
        share = f" ({value / max(points, 1):.1e})" if isinstance(value, int) and name != "points" else ""
        print(f"{name:>34}: {value:,}{share}" if isinstance(value, int) else f"{name:>34}: {value:.3g}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
