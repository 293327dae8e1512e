"""Print how often views of the axis slip, and what the centreline's intervals hold, on roads of roads.py beside it.

python studies/reconstruction/roads.py out/reconstruction              # makes the roads
python studies/reconstruction/intervals.py out/reconstruction                   # 32 of them
python studies/reconstruction/intervals.py out/reconstruction --roads 0-0 3-3   # some

The clouds lose their classes but for ground, and their sides, cut at random and anew every 50 m, as real ones are.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.reconstruction.roads import without_classes  # noqa: E402
from synthroads_addon.base.arrays import Bool, Float  # noqa: E402
from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.base.random_streams import stream  # noqa: E402
from synthroads_addon.reconstruction.axis import FoundRoad, Options, find_axis, straighten_path  # noqa: E402
from synthroads_addon.reconstruction.cloud import SURFACE, RoadCloud, read_road_cloud  # noqa: E402
from synthroads_addon.reconstruction.views.intervals import half_width  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.road.parameters import read_parameters  # noqa: E402

FIRST = ["0-0", "0-1", "2-1", "3-3", "4-0", "4-1", "5-0", "5-1", "6-0", "6-1", "6-3", "7-0", "7-1", "7-3", "0-4", "4-4"]
"""Roads that the share of slips was first measured on."""
HELD_OUT = ["1-0", "1-1", "2-0", "2-3", "3-0", "3-1", "0-2", "0-3"]
HELD_OUT += ["4-2", "4-3", "5-2", "5-3", "6-2", "6-4", "7-2", "7-4"]
_BESIDE = 3.5  # m of ground beside the pavement that is left before the sides are cut
_SHARE, _LENGTH = 0.5, 50.0  # of a side that is cut off at most, and m along the road over which a cut stays the same
_SLIPPED = 3.0  # deviations


@dataclass(frozen=True)
class Figures:
    """Figures of one road: shares of the offsets of views that slipped, and of centres in intervals; mean error, m."""

    slipped: float
    in_68: float
    in_95: float
    in_95_alone: float
    error: float


def cut(cloud: RoadCloud, offset: Float, station: Float, half_width: float, seed: str) -> RoadCloud:
    """Return the surface's points of a cloud between sides that are cut at random."""
    part = (np.maximum(station, 0.0) // _LENGTH).astype(np.int64)
    rng = stream(1, "cut sides", seed)
    left, right = half_width * (1.0 - _SHARE * rng.random((2, int(part.max()) + 1)))
    is_kept: Bool = cloud.of(*SURFACE) & (offset < left[part]) & (offset > -right[part])
    return replace(cloud, xyz=cloud.xyz[is_kept], intensity=cloud.intensity[is_kept], kind=cloud.kind[is_kept])


def measure(folder: Path) -> Figures:
    """Return the figures of a road that has its parameters and its cloud in a folder.

    Raises:
        InputError: no road can be made out.
    """
    truth = read_parameters(folder / "truth.json")
    road = RoadGeometry(truth)
    cloud = without_classes(read_road_cloud(folder / "cloud.laz"))
    shift = np.array(truth.transform.translate[:2]) - cloud.origin[:2]
    station, offset = road.alignment.project(cloud.xyz[:, :2] - shift)
    edges = [float(section.paved_edge(np.array([0.5 * road.length]))[0]) for section in road.sections.values()]
    cloud = cut(cloud, offset, station, max(edges) + _BESIDE, folder.name)
    path, half_width = straighten_path(cloud, Options())
    return _figures(find_axis(cloud, path, half_width, Options()), road, shift)


def _figures(found_road: FoundRoad, road: RoadGeometry, shift: Float) -> Figures:
    """Return the figures of an axis that was found, beside the true road."""
    axis = found_road.axis
    _, axis_offset = road.alignment.project(found_road.path.place(axis.stations, np.zeros(len(axis.stations))) - shift)
    _, offset_to_left = road.alignment.project(
        found_road.path.place(axis.stations, np.ones(len(axis.stations))) - shift
    )
    true_offsets = -axis_offset * np.sign(np.median(offset_to_left - axis_offset))
    error = np.abs(axis.offsets - true_offsets)
    is_seen = np.array([np.isfinite(view.offsets) for view in axis.views])
    has_slipped = np.array([np.abs(view.offsets - true_offsets) > _SLIPPED * view.std for view in axis.views])
    return Figures(
        slipped=float(has_slipped[is_seen].mean()),
        in_68=float((error < half_width(axis, 0.68, 1.0)).mean()),
        in_95=float((error < half_width(axis, 0.95, 1.96)).mean()),
        in_95_alone=float((error < 1.96 * axis.std).mean()),
        error=float(error.mean()),
    )


def main() -> None:
    """Measure the roads; print the figures of each, and their means."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of studies/reconstruction/roads.py")
    parser.add_argument("--roads", nargs="+", metavar="NAME", help="names of roads in it (32 of them)")
    arguments = parser.parse_args()
    groups = {"some": arguments.roads} if arguments.roads else {"first": FIRST, "held out": HELD_OUT}
    for group, names in groups.items():
        rows = []
        for name in names:
            try:
                figures = measure(arguments.folder / name)
            except InputError as error:
                print(f"{name}: {error}")
                continue
            rows.append(list(vars(figures).values()))
            print(f"{name}: {_text(rows[-1])}", flush=True)
        print(f"{group}: {_text(np.mean(rows, axis=0))}")


def _text(row: list[float] | Float) -> str:
    """Return a row of figures in words."""
    slip_share, share_in_68, share_in_95, share_alone, error = (float(value) for value in row)
    return (
        f"{100.0 * slip_share:.1f} % slipped, {100.0 * share_in_68:.0f} % in 68 %, {100.0 * share_in_95:.0f} % in 95 % "
        f"({100.0 * share_alone:.0f} % by the deviation alone), {error:.3f} m off"
    )


if __name__ == "__main__":
    main()
