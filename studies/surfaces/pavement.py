"""Print the table of docs/pavement.md: how a pavement looks to an airborne scan, by offset.

python studies/surfaces/pavement.py --seeds 5 6 7
python studies/surfaces/pavement.py --seeds 5 6 --rays 7
"""

from __future__ import annotations

import argparse

import numpy as np

from synthroads_addon import load_scenario
from synthroads_addon.base.arrays import Float
from synthroads_addon.base.classes import class_id
from synthroads_addon.cloud.points import concatenate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.record import CollectedBlocks, record

_STEP = 0.25
"""Width of a bin of offsets, m."""
_SETTINGS = (
    "road.length=200",
    "road.half_width=20",
    "road.pavement.concrete=0",
    'road.pavement.asphalts=["asphalt"]',
    "road.pavement.renewed=0",
    "road.markings.removed=0",
    'road.environment.wetness={"minimum": 0, "maximum": 0}',
    "road.trees_per_hectare=0",
    "road.shrubs_per_hectare=0",
    "road.grass_density=0",
    "scan.noise.range_sigma=0",
    'cloud.attributes=["noise_free"]',
    "cloud.intensity=range_corrected",
)


def row(seed: int, rays: int) -> str:
    """Return a line of the table, of a road that is built in the open file and scanned."""
    scenario = load_scenario("airborne-1000m-even", [*_SETTINGS, f"seed={seed}", f"scan.rays_per_pulse={rays}"])
    parameters = sample_road(scenario.road, seed)
    geometry = RoadGeometry(parameters)
    scene, blocks = RoadScene.of(scenario, geometry), CollectedBlocks()
    scene.build()
    record(scene.plan(), blocks)
    points = concatenate([block.points for block in blocks.results])
    local = points.xyz - parameters.transform.translate
    station, offset = geometry.alignment.project(local[:, :2])
    height, level = local[:, 2] - geometry.elevation(station, offset), 10.0 * np.log10(points.intensity)
    is_road, is_paint = (points.class_id == class_id(name) for name in ("road", "road_marking"))
    spreads, reaches, waves = [], [], []
    for side in ("left", "right"):
        section = geometry.sections[side]
        distance, edges = section.carriageway.sign * offset, section.distances(100.0)[0, [0, -2]]
        is_on_road = is_road & (station > 2.0) & (station < 198.0)
        profile = _medians(distance[is_on_road], level[is_on_road], *edges)
        spreads.append(f"{np.nanstd(profile):.2f}")
        reaches.append(f"{np.nanmax(profile) - np.nanmin(profile):.1f}")
        lanes = section.lane_boundaries(100.0)[0]
        profile = 1e3 * _medians(distance[is_on_road], height[is_on_road], lanes.min(), lanes.max())
        filled_bins = np.flatnonzero(~np.isnan(profile))
        line = np.polyval(np.polyfit(filled_bins, profile[filled_bins], 1), filled_bins)
        waves.append(f"{(profile[filled_bins] - line).std():.2f}")
    paint_over_road = np.median(level[is_paint]) - np.median(level[is_road])
    cells = [
        str(seed),
        *(" / ".join(side_texts) for side_texts in (spreads, reaches, waves)),
        f"{paint_over_road:.1f}",
        f"{level[is_paint].std():.2f}",
    ]
    return f"| {' | '.join(cells)} |"


def _medians(distance: Float, values: Float, first_distance: float, last_distance: float) -> Float:
    """Return the medians of values by bins of distances between two; NaN where there are none."""
    number = np.floor((distance - first_distance) / _STEP)
    bins = [values[number == place] for place in range(int((last_distance - first_distance) / _STEP + 1e-9))]
    return np.array([np.median(values) if len(values) else np.nan for values in bins])


def main() -> None:
    """Print a line for each seed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[5, 6, 7])
    parser.add_argument("--rays", type=int, default=1, help="rays per pulse")
    options = parser.parse_args()
    for seed in options.seeds:
        print(row(seed, options.rays), flush=True)


if __name__ == "__main__":
    main()
