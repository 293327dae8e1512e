"""Print a table: what an airborne scan sees of a closed stand of trees, in leaf and bare.

The scan is as those of the published figures in docs/landscape.md: from 1,450 m above the ground, a beam of 0.25 mrad,
7 rays for each pulse, echoes of 6 % of reflectance and more.

python studies/surfaces/plants.py --species maple spruce
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from synthroads_addon import load_scenario
from synthroads_addon.base.arrays import Float
from synthroads_addon.base.classes import class_id
from synthroads_addon.cloud.points import concatenate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.record import CollectedBlocks, record

_SETTINGS = (
    "road.length=120",
    "road.half_width=70",
    "road.shrubs_per_hectare=0",
    "road.grass_density=0",
    'road.roadside={"fences": 0, "power_line": 0, "hedges_per_km": {"minimum": 0, "maximum": 0}}',
    'road.vegetation.tree_height={"minimum": 16, "maximum": 22}',
    "colour.source=material",
    "vegetation_detail=1",
    "scan.platform.height=1450",
    "scan.pulse_rate_khz=250",
    "scan.rays_per_pulse=7",
)
_STAND = 34.0
"""Distance (m) from the axis from which on a stand is closed."""
_TREES = {"maple": 220, "birch": 450, "poplar": 1100, "spruce": 600, "pine": 400}
"""Trees per hectare of a closed stand: their crowns, at random places, cover about nine tenths of the ground."""


@dataclass(frozen=True)
class CanopyFigures:
    """Returns of a closed stand of trees.

    Attributes:
        to_ground: share of the pulses whose last return is no tree's.
        returns_per_pulse: mean of those whose first return is a tree's.
        return_shares: (4,) share of those pulses with 1, 2, 3 and more returns.
        pulses: number of pulses with a return within the stand.
    """

    to_ground: float
    returns_per_pulse: float
    return_shares: Float
    pulses: int


def measure_canopy(species: str, season: str, seed: int) -> CanopyFigures:
    """Return the figures of a stand that is built in the open file and scanned.

    Args:
        species: of the trees, one of `_TREES`.
        season: "summer" in leaf, "winter" bare.
        seed: of road and scan.
    """
    settings = [*_SETTINGS, f"road.trees_per_hectare={_TREES[species]}", f'road.vegetation.trees=["{species}"]']
    settings += [f"road.environment.winter={int(season == 'winter')}", f"seed={seed}"]
    scenario = load_scenario("airborne-1000m-even", settings)
    parameters = sample_road(scenario.road, seed)
    geometry = RoadGeometry(parameters)
    scene, blocks = RoadScene.of(scenario, geometry), CollectedBlocks()
    scene.build()
    record(scene.plan(), blocks)
    points = concatenate([block.points for block in blocks.results])
    station, offset = geometry.alignment.project(points.xyz[:, :2] - parameters.transform.translate[:2])
    is_inside = (np.abs(offset) > _STAND) & (np.abs(offset) < 66.0) & (station > 6.0) & (station < 114.0)
    is_tree = points.class_id == class_id("vegetation")
    is_first = is_inside & (points.return_number == 1)
    is_last = is_inside & (points.return_number == points.number_of_returns)
    returns = points.number_of_returns[is_first & is_tree]
    shares = np.bincount(np.minimum(returns, 4), minlength=5)[1:] / max(1, len(returns))
    to_ground = float((is_last & ~is_tree).sum()) / float(is_last.sum())
    return CanopyFigures(to_ground, float(returns.mean()), shares, int(is_first.sum()))


def _row(species: str, season: str, seed: int) -> str:
    """Return a line of the table."""
    figures = measure_canopy(species, season, seed)
    shares = " / ".join(f"{100.0 * share:.0f}" for share in figures.return_shares)
    cells = (f"{100.0 * figures.to_ground:.0f}", f"{figures.returns_per_pulse:.2f}", shares, str(figures.pulses))
    return f"| {species} | {season} | {' | '.join(cells)} |"


def main() -> None:
    """Print a line for each species and season."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--species", nargs="+", default=["maple", "birch", "spruce"], choices=list(_TREES))
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    print("| species | season | pulses to the ground (%) | returns per pulse into trees | 1, 2, 3, more (%) | pulses |")
    print("|---|---|---|---|---|---|")
    for species in options.species:
        for season in ("summer", "winter"):
            print(_row(species, season, options.seed), flush=True)


if __name__ == "__main__":
    main()
