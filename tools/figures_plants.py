"""Print a table: what an airborne scan sees of a closed stand of trees, in leaf and bare.

The scan is as those of the published figures in docs/landscape.md: from 1,450 m above the ground, a beam of 0.25 mrad,
7 rays for each pulse, echoes of 6 % of reflectance and more.

python tools/figures_plants.py --species maple spruce
"""

from __future__ import annotations

import argparse

import numpy as np

from synthroads_addon import load_scenario
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


def row(species: str, season: str, seed: int) -> str:
    """Return a line of the table, of a stand that is built in the open file and scanned."""
    settings = [*_SETTINGS, f"road.trees_per_hectare={_TREES[species]}", f'road.vegetation.trees=["{species}"]']
    settings += [f"road.environment.winter={int(season == 'winter')}", f"seed={seed}"]
    scenario = load_scenario("airborne-1000m", settings)
    parameters = sample_road(scenario.road, seed)
    geometry = RoadGeometry(parameters)
    scene, blocks = RoadScene(scenario, geometry), CollectedBlocks()
    scene.build()
    record(scene.plan(), blocks)
    points = concatenate([block.points for block in blocks.results])
    station, offset = geometry.alignment.project(points.xyz[:, :2] - parameters.transform.translate[:2])
    inside = (np.abs(offset) > _STAND) & (np.abs(offset) < 66.0) & (station > 6.0) & (station < 114.0)
    tree = points.class_id == class_id("vegetation")
    first = inside & (points.return_number == 1)
    last = inside & (points.return_number == points.number_of_returns)
    on_ground = 100.0 * float((last & ~tree).sum()) / float(last.sum())
    returns = points.number_of_returns[first & tree]
    shares = 100.0 * np.bincount(np.minimum(returns, 4), minlength=5)[1:] / max(1, len(returns))
    counted = " / ".join(f"{share:.0f}" for share in shares)
    return f"| {species} | {season} | {on_ground:.0f} | {returns.mean():.2f} | {counted} | {int(first.sum())} |"


def main() -> None:
    """Print a line for each species and season."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--species", nargs="+", default=["maple", "birch", "spruce"], choices=list(_TREES))
    parser.add_argument("--seed", type=int, default=5)
    given = parser.parse_args()
    print("| species | season | pulses to the ground (%) | returns per pulse into trees | 1, 2, 3, more (%) | pulses |")
    print("|---|---|---|---|---|---|")
    for species in given.species:
        for season in ("summer", "winter"):
            print(row(species, season, given.seed), flush=True)


if __name__ == "__main__":
    main()
