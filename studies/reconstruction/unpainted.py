"""Print how near the axis of a real road is once its lines are painted out, and where it is doubted.

    python studies/reconstruction/unpainted.py rural.laz --axis rural_axis.csv --paved=-3.2,3.4
    ... --seeds 1 2 3 --keep-lines

The bright points of the pavement get the brightness of other pavement beside them, and both sides are cut at random and
anew every 50 m, since strips are mostly cut around the axis. What is found is compared with the axis that lies beside
the cloud. A road that is refused counts as doubted.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.reconstruction.intervals import cut  # noqa: E402
from synthroads_addon.base.arrays import Bool, Float  # noqa: E402
from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.base.random_streams import stream  # noqa: E402
from synthroads_addon.reconstruction.centreline import centreline_report, find_centreline  # noqa: E402
from synthroads_addon.reconstruction.cloud import SURFACE, RoadCloud, read_road_cloud  # noqa: E402
from synthroads_addon.reconstruction.reconstruct import reconstruct  # noqa: E402
from synthroads_addon.road.axes.measured_axis import MeasuredAxis  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402

_LENGTH = 10.0
"""Length, m, of the pavement that a brightness is compared with, and that another one is taken from."""
_FENCE = 1.0
"""Interquartile ranges above the third quartile from which a point is a line's. Tukey's inner fence is 1.5; lines that
are only partly hit are to go as well."""
_BESIDE = 0.25
"""Distance, m, within which points beside a bright one go too: a footprint is as wide."""
_ENDS = 5.0
"""Length at either end that doesn't count, m."""
_RIGHT, _SILENT = 0.3, 1.0
"""Errors, m, below which an axis is right, and above which it must be doubted."""


Doubts = list[tuple[float, float]]


@dataclass(frozen=True)
class Figures:
    """Shares of a road's length in %, and the mean error of its axis, m.

    Attributes:
        near: on which the axis is within 0.3 m.
        near_or_doubted: on which it is, or is doubted.
        silent: on which it is over 1 m off and not doubted.
        error: mean distance; NaN for a road that is refused.
    """

    near: float
    near_or_doubted: float
    silent: float
    error: float


def bright_points(intensity: Float, station: Float, offset: Float) -> Bool:
    """Return which points (N,) of a pavement are bright, as lines are, or lie within `_BESIDE` of one that is.

    Args:
        intensity: (N,) in any unit.
        station, offset: (N,) place along and across the road, m.
    """
    part = (station // _LENGTH).astype(np.int64)
    is_bright = np.zeros(len(part), dtype=bool)
    for number in np.unique(part):
        here = part == number
        first, third = np.percentile(intensity[here], [25.0, 75.0])
        is_bright[here] = intensity[here] > third + _FENCE * (third - first)
    if not is_bright.any():
        return is_bright
    place = np.column_stack([station, offset])
    distance, _ = cKDTree(place[is_bright]).query(place, distance_upper_bound=_BESIDE)
    near: Bool = np.isfinite(distance)
    return near


def painted_out(cloud: RoadCloud, station: Float, offset: Float, paved: tuple[float, float], seed: int) -> RoadCloud:
    """Return a cloud whose lines have the brightness of random other points of the pavement within `_LENGTH`.

    Args:
        cloud: N points.
        station, offset: (N,) place along and across the road, m.
        paved: smallest and largest offset of the pavement, m.
        seed: seed of the choice.
    """
    pavement = np.flatnonzero(cloud.of(*SURFACE) & (offset >= paved[0]) & (offset <= paved[1]))
    is_line = bright_points(cloud.intensity[pavement].astype(np.float64), station[pavement], offset[pavement])
    intensity: NDArray[np.float32] = cloud.intensity.copy()
    random = stream(seed, "painted out")
    part = (station[pavement] // _LENGTH).astype(np.int64)
    for number in np.unique(part[is_line]):
        here = part == number
        lines, others = pavement[here & is_line], pavement[here & ~is_line]
        if len(others):
            intensity[lines] = cloud.intensity[random.choice(others, len(lines))]
    return replace(cloud, intensity=intensity)


def figures_of(points: Float, stations: Float, doubtful: Doubts, axis: MeasuredAxis) -> Figures:
    """Return the figures of a line that was found, beside the true axis.

    Args:
        points: (M, 2) line, in the axis's coordinates, m.
        stations: (M,) the line's own stations, m.
        doubtful: begin and end of the doubted stretches in these stations, m.
        axis: the true one.
    """
    place, error = axis.project(points)
    order = np.argsort(place)
    station = axis.stations()
    station = station[(station > _ENDS) & (station < axis.length - _ENDS)]
    gap = np.abs(np.interp(station, place[order], error[order], left=np.nan, right=np.nan))
    along = np.interp(station, place[order], stations[order])
    is_doubted = np.isnan(gap)  # where no line is given, none is trusted
    for start, end in doubtful:
        is_doubted |= (along >= start) & (along <= end)
    is_near = gap < _RIGHT
    return Figures(
        near=100.0 * float(is_near.mean()),
        near_or_doubted=100.0 * float((is_near | is_doubted).mean()),
        silent=100.0 * float(((gap > _SILENT) & ~is_doubted).mean()),
        error=float(np.nanmean(gap)),
    )


def line_of_centreline(cloud: RoadCloud) -> tuple[Float, Float, Doubts]:
    """Return the points (M, 2) and stations (M,) of the line that `synthroads centerline` finds by rules, its doubts.

    Raises:
        InputError: no road can be made out.
    """
    found = find_centreline(cloud)
    doubts = centreline_report(found, cloud)["judgement"]["doubtful"]
    return (
        found.path.points + cloud.origin[:2],
        found.path.stations - found.path.start,
        [(doubt["start"], doubt["end"]) for doubt in doubts],
    )


def line_of_reconstruction(cloud: RoadCloud) -> tuple[Float, Float, Doubts]:
    """Return the points (M, 2) and stations (M,) of the axis that `synthroads reconstruct` finds, and its doubts.

    Raises:
        InputError: no road can be made out.
    """
    found = reconstruct(cloud)
    alignment = RoadGeometry(found.parameters).alignment
    stations = np.arange(0.0, alignment.length)
    doubts = [(doubt["start"], doubt["end"]) for doubt in found.judgement.to_dict()["doubtful"]]
    return alignment.position(stations) + np.array(found.parameters.transform.translate[:2]), stations, doubts


COMMANDS = {"centerline": line_of_centreline, "reconstruct": line_of_reconstruction}


def measure(cloud: RoadCloud, axis: MeasuredAxis, command: str) -> Figures:
    """Return the figures of a command on a cloud; one that is refused is doubted over its whole length."""
    try:
        return figures_of(*COMMANDS[command](cloud), axis)
    except InputError:
        return Figures(0.0, 100.0, 0.0, np.nan)


def main() -> None:
    """Print a row for each seed and command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cloud", type=Path, metavar="CLOUD")
    parser.add_argument("--axis", type=Path, required=True, metavar="FILE", help="true axis beside it, CSV or GeoJSON")
    parser.add_argument("--paved", required=True, metavar="FROM,TO", help="offsets of the pavement's edges, m")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3], help="of cuts and brightness (1 2 3)")
    parser.add_argument(
        "--commands", nargs="+", choices=COMMANDS, default=list(COMMANDS), help="what is measured (both)"
    )
    parser.add_argument("--keep-lines", action="store_true", help="paint nothing out, for comparison")
    arguments = parser.parse_args()
    first, last = map(float, arguments.paved.split(","))
    cloud = read_road_cloud(arguments.cloud)
    axis = MeasuredAxis.read(arguments.axis, place=cloud.place)
    station, offset = axis.project(cloud.xyz + cloud.origin)
    reach = float(np.percentile(np.abs(offset), 99.0))
    print("| command | seed | within 0.3 m (%) | or doubted (%) | over 1 m off, not doubted (%) | error (m) |")
    print("|---|--:|--:|--:|--:|--:|")
    for command in arguments.commands:
        for seed in arguments.seeds:
            shown = cloud if arguments.keep_lines else painted_out(cloud, station, offset, (first, last), seed)
            figures = measure(cut(shown, offset, station, reach, f"{arguments.cloud.stem} {seed}"), axis, command)
            cells = [f"{share:.0f}" for share in (figures.near, figures.near_or_doubted, figures.silent)]
            print(f"| {command} | {seed} | " + " | ".join([*cells, f"{figures.error:.2f}"]) + " |", flush=True)


if __name__ == "__main__":
    main()
