"""Print how carriageways are counted and where the axis lies on thrown roads that are hard to tell.

python studies/reconstruction/carriageways.py out/carriageways                          # seeds 1 to 40 of each kind
python studies/reconstruction/carriageways.py out/carriageways --kinds exit --seeds 1 10   # some
python studies/reconstruction/carriageways.py out/carriageways --document docs/centerline.md

Motorways with narrow medians, with exits, with three carriageways, with two that differ in lanes, shoulders, heights
and crossfalls, rural roads, streets without paint; with worn paint,
patches, gain steps between strips, guardrails that were cut out, and sides cut anew every 50 m, also within the
pavement. Each road has a file with its figures; what is there already isn't measured again.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from headless.marked_documents import put_tables  # noqa: E402
from synthroads_addon.base.arrays import Float  # noqa: E402
from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.reconstruction.centreline import Centreline, centreline_report, find_centreline  # noqa: E402
from synthroads_addon.reconstruction.cloud import RoadCloud, read_road_cloud  # noqa: E402
from synthroads_addon.reconstruction.profiles import STRETCH  # noqa: E402
from tests.helpers.clouds.foreign_clouds import EAST, NORTH, axis_north  # noqa: E402
from tests.helpers.clouds.hard_roads import HardRoad  # noqa: E402
from tests.helpers.clouds.thrown_roads import KINDS, MOTORWAYS, thrown_road, true_counts  # noqa: E402

WINDOW = 50.0
"""Length, m, over which the axis is compared with its views."""
_ENDS = 5.0
"""Length at either end that doesn't count, m."""
_RIGHT, _SILENT = 0.3, 1.0
"""Errors, m, below which an axis is right, and above which it must be doubted."""
_SEEN = 0.8
"""Share of a window in which a view must see the axis to be compared."""
_SLACK = 0.05
"""Difference of the axis and its best view that is none, m: half a bin."""


@dataclass(frozen=True)
class Figures:
    """Lengths of one road, m, and windows of its axis.

    Attributes:
        length: that counts.
        plain: on which the number of carriageways is plain.
        counted: of it, on which carriageways and ramps are counted right.
        main: of it, on which it is told right whether the road has one carriageway or two and more.
        near: on which the axis is within 0.3 m.
        near_or_doubted: on which it is, or is doubted.
        silent: on which it is over 1 m off and not doubted.
        doubted: on which it is doubted though it is within 0.3 m.
        windows: of 50 m that were compared with their views.
        tenth: of these, those in which the axis is at most 1.1 times as far off as the best view.
        bounded: of these, those in which it is so but for 0.05 m.
        error: mean error, m.
    """

    length: float
    plain: float
    counted: float
    main: float
    near: float
    near_or_doubted: float
    silent: float
    doubted: float
    windows: float
    tenth: float
    bounded: float
    error: float


def measure(road: HardRoad, folder: Path) -> Figures:
    """Return the figures of a thrown road; one that is refused is doubted and counted wrong over its whole length."""
    cloud = read_road_cloud(road.write(folder))
    length = road.length - 2.0 * _ENDS
    try:
        found = find_centreline(cloud)
    except InputError:
        return Figures(length, length, 0.0, 0.0, 0.0, length, 0.0, 0.0, 0.0, 0.0, 0.0, np.nan)
    return compare(found, cloud, road)


def compare(found: Centreline, cloud: RoadCloud, road: HardRoad) -> Figures:
    """Return the figures of the centreline that was found in a thrown road's cloud."""
    points = found.path.points + cloud.origin[:2]
    place, own = points[:, 0] - EAST, found.path.stations - found.path.start
    # One place for each metre of the road; where the line doesn't reach it isn't right, but no silent error either.
    station = np.arange(_ENDS + 0.5, road.length - _ENDS)
    order = np.argsort(place)
    north = np.interp(station, place[order], points[order, 1] - NORTH, left=np.nan, right=np.nan)
    along = np.interp(station, place[order], own[order])
    error = np.abs(north - axis_north(station, road.slant, road.length))
    report = centreline_report(found, cloud)
    doubtful = np.zeros(len(station), dtype=bool)
    for doubt in report["judgement"]["doubtful"]:
        doubtful |= (along >= doubt["start"]) & (along <= doubt["end"])
    carriageways, ramps = np.full(len(station), -1), np.zeros(len(station), dtype=np.int64)
    for stretch in report["carriageways"]:
        inside = (along >= stretch["start"]) & (along <= stretch["end"])
        carriageways[inside], ramps[inside] = stretch["number"], stretch.get("ramps", 0)
    true_carriageways, true_ramps, plain = true_counts(road, station)
    is_near = error < _RIGHT
    windows = window_errors(found, cloud, road)
    return Figures(
        length=float(len(station)),
        plain=float(plain.sum()),
        counted=float((plain & (carriageways == true_carriageways) & (ramps == true_ramps)).sum()),
        main=float((plain & (np.minimum(carriageways, 2) == np.minimum(true_carriageways, 2))).sum()),
        near=float(is_near.sum()),
        near_or_doubted=float((is_near | doubtful).sum()),
        silent=float(((error > _SILENT) & ~doubtful).sum()),
        doubted=float((is_near & doubtful).sum()),
        windows=float(len(windows)),
        tenth=float((windows[:, 0] <= 1.1 * windows[:, 1]).sum()),
        bounded=float((windows[:, 0] <= 1.1 * windows[:, 1] + _SLACK).sum()),
        error=float(np.nanmean(error)),
    )


def window_errors(found: Centreline, cloud: RoadCloud, road: HardRoad) -> Float:
    """Return the mean errors (W, 2), m, of the axis and of its best view in windows of 50 m.

    Args:
        found: the centreline.
        cloud: in which it was found.
        road: the thrown road.
    """
    axis, points = found.axis, found.path.points + cloud.origin[:2]
    place = points[:, 0] - EAST
    north = points[:, 1] - NORTH - axis_north(place, road.slant, road.length)
    # The path may run either way; the line was laid out from the views' own path, so that its stations are theirs to
    # some centimetres.
    to_left = 1.0 if place[-1] > place[0] else -1.0
    station = np.interp(axis.stations, found.path.stations, place, left=np.nan, right=np.nan)
    own = to_left * np.interp(axis.stations, found.path.stations, north)
    rows = []
    for start in np.arange(_ENDS, road.length - _ENDS - WINDOW + 1.0, WINDOW):
        inside = (station >= start) & (station < start + WINDOW)
        if STRETCH * inside.sum() < _SEEN * WINDOW:
            continue
        views = []
        for view in axis.views:
            error = own[inside] + (view.offsets - axis.offsets)[inside]
            if np.isfinite(error).mean() > _SEEN:
                views.append(float(np.nanmean(np.abs(error))))
        if views:
            rows.append((float(np.abs(own[inside]).mean()), min(views)))
    return np.array(rows).reshape(-1, 2)


def totals(figures: list[Figures]) -> dict[str, float]:
    """Return the figures of several roads in per cent of their lengths and windows, and their mean error, m."""
    total = {field.name: float(sum(getattr(one, field.name) for one in figures)) for field in fields(Figures)}
    length, windows = total["length"], max(total["windows"], 1.0)
    shares = {name: 100.0 * total[name] / length for name in ("near", "near_or_doubted", "silent", "doubted")}
    shares |= {name: 100.0 * total[name] / total["plain"] for name in ("counted", "main")}
    shares |= {name: 100.0 * total[name] / windows for name in ("tenth", "bounded")}
    return shares | {"error": float(np.nanmean([one.error for one in figures])), "roads": float(len(figures))}


def table(groups: dict[str, list[Figures]]) -> str:
    """Return the table of the documentation: a row for each kind of road, and one for the motorways together."""
    heads = {
        "roads": "roads",
        "counted": "counted right (%)",
        "near": "within 0.3 m (%)",
        "near_or_doubted": "within 0.3 m or doubted (%)",
        "silent": "over 1 m off, not doubted (%)",
        "doubted": "doubted though within 0.3 m (%)",
        "tenth": "at most 1.1 times the best view (% of windows)",
        "bounded": "the same but for 0.05 m (% of windows)",
    }
    lines = ["| roads of the kind | " + " | ".join(heads.values()) + " |", "|---|" + "--:|" * len(heads)]
    motorways = [one for kind in MOTORWAYS for one in groups.get(kind, [])]
    rows = {**groups, "all motorways": motorways} if len(motorways) > len(groups.get(MOTORWAYS[0], [])) else groups
    for name, figures in rows.items():
        shares = totals(figures)
        cells = [f"{shares[key]:.0f}" if key == "roads" else f"{shares[key]:.1f}" for key in heads]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Measure the roads; print the figures of each, and the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="for the clouds and the figures of each road")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), help="kinds of roads (all)")
    parser.add_argument(
        "--seeds", nargs=2, type=int, default=(1, 40), metavar=("FIRST", "LAST"), help="of each kind (1 40)"
    )
    parser.add_argument("--document", type=Path, help="Markdown file whose table between its markers is rewritten")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    groups: dict[str, list[Figures]] = {kind: [] for kind in arguments.kinds}
    for seed in range(arguments.seeds[0], arguments.seeds[1] + 1):
        for kind in arguments.kinds:
            path = arguments.folder / f"{kind.replace(' ', '-')}-{seed}.json"
            if not path.exists():
                figures = measure(thrown_road(kind, seed), arguments.folder)
                path.write_text(json.dumps(asdict(figures)))
            groups[kind].append(Figures(**json.loads(path.read_text())))
            shares = totals(groups[kind][-1:])
            print(f"{kind} {seed}: " + ", ".join(f"{name} {value:.3g}" for name, value in shares.items()), flush=True)
    text = table(groups)
    print(text)
    if arguments.document:
        put_tables(arguments.document, ["carriageways"], lambda: {"carriageways": text})


if __name__ == "__main__":
    main()
