"""Print how the axes of roads through villages come back from their clouds, on the stretch within the village.

python studies/reconstruction/village_roads.py out/villages                      # 8 roads, told by class
python studies/reconstruction/village_roads.py out/villages --without-classes    # the same told by brightness

Each road is 300 m of the scenario village-300m: kerbs, gutters, bays and footways, 220 to 240 m long, of the
cross-sections RQ 10.5, 9.5, 7.5 and W5.5 by turns; onto it points are thrown evenly, 12 per m2.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.reconstruction.country_roads import axis_errors, throw, without_classes  # noqa: E402
from synthroads_addon.base.errors import SynthRoadsError  # noqa: E402
from synthroads_addon.reconstruction.cloud import read_road_cloud  # noqa: E402
from synthroads_addon.reconstruction.reconstruct import reconstruct  # noqa: E402
from synthroads_addon.road.guidelines import design_class_of  # noqa: E402
from synthroads_addon.road.parameters import RoadParameters, read_parameters  # noqa: E402
from synthroads_addon.road.streets.street_side import StreetSide  # noqa: E402
from synthroads_addon.sampling.road import sample_road  # noqa: E402
from synthroads_addon.scenario.scenario import load_scenario  # noqa: E402

_SECTIONS = ("RQ10.5", "RQ9.5", "RQ7.5", "W5.5")
_FIRST_SEED = 4200
_RIGHT = 0.3
"""Error of the axis, m, up to which it is right."""


def make(number: int, folder: Path) -> tuple[RoadParameters, Path]:
    """Return a road's true parameters and its cloud, sampled and thrown if that wasn't done."""
    truth, cloud = folder / "truth.json", folder / "thrown.laz"
    if not cloud.exists():
        folder.mkdir(parents=True, exist_ok=True)
        section = _SECTIONS[number % len(_SECTIONS)]
        settings = [f'road.cross_section="{section}"', f'road.design_class="{design_class_of(section, "EKL3")}"']
        scenario = load_scenario("village-300m", [*settings, f"seed={_FIRST_SEED + number}"])
        road = sample_road(scenario.road, scenario.seed)
        truth.write_text(road.to_json(), encoding="utf-8")
        throw(road, number, False, cloud)
    return read_parameters(truth), cloud


def main() -> None:
    """Make and measure the roads; print a line for each, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="for roads and clouds")
    parser.add_argument("--roads", type=int, default=8, metavar="N", help="number of roads (8)")
    parser.add_argument("--without-classes", action="store_true", help="pavement and paint are told by brightness")
    arguments = parser.parse_args()
    all_errors, all_doubts = [], []
    for number in range(arguments.roads):
        truth, cloud = make(number, arguments.folder / f"{number:03d}")
        sides = truth.of_type(StreetSide).values()
        points = read_road_cloud(cloud)
        name = _SECTIONS[number % len(_SECTIONS)]
        try:
            result = reconstruct(without_classes(points) if arguments.without_classes else points)
        except SynthRoadsError as refusal:
            print(f"{number} {name}: refused, {refusal}", flush=True)
            continue
        error, is_doubted = axis_errors(result, truth)
        station = np.arange(0.5, 0.5 + len(error))
        within = (station > min(side.start_station for side in sides)) & (
            station < max(side.end_station for side in sides)
        )
        all_errors.append(error[within])
        all_doubts.append(is_doubted[within])
        reasons = sorted({reason for doubt in result.judgement.doubts for reason in doubt.reasons})
        print(f"{number} {name}: {_figures(error[within], is_doubted[within])}; {'; '.join(reasons)}", flush=True)
    print(f"all: {_figures(np.concatenate(all_errors), np.concatenate(all_doubts))}")


def _figures(error: np.ndarray, is_doubted: np.ndarray) -> str:
    """Return the figures of metres of axes in words, by their errors (N,), m, and whether they are doubted (N,)."""
    near, far = error < _RIGHT, ~(error < _RIGHT)
    shares = (100.0 * mask.mean() for mask in (near, near & is_doubted, far & ~is_doubted))
    texts = ("within 0.3 m", "doubted of it", "farther off and not doubted")
    counts = ", ".join(f"{text} {share:.1f} %" for text, share in zip(texts, shares, strict=True))
    return f"axis {np.nanmean(error):.3f} m on average, {np.nanmax(error):.3f} m at most, {counts}"


if __name__ == "__main__":
    main()
