"""Pictures and tables of the scanner for the documentation: platforms, reflection models, rays per pulse.

python studies/scanner/scanner.py --output docs/pictures
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.classes import classes  # noqa: E402
from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.jobs.generate import Job, generate  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.sampling.road import sample_road  # noqa: E402
from synthroads_addon.scanning.beam import RINGS, beam_pattern  # noqa: E402
from synthroads_addon.scenario.scenario import load_scenario  # noqa: E402

REACH, ASIDE, PIXEL = 105.0, 42.0, 0.15
"""Half the length and width that a picture shows, and its pixel, m."""
SHORT = ["road.half_width=40"]
PLATFORMS = {
    "UAV, rotating mirror": ("rq31-600m-even", ["road.length=200"]),
    "mobile mapping, two heads": ("mobile-mapping-300m-even", ["road.length=200"]),
    "tripod, panoramic": ("tripod-200m-even", []),
    "aircraft": ("airborne-1000m-even", []),
    "trajectory file": ("rq31-600m-even", ["road.length=200"]),
}


def main() -> None:
    """Write the figures that the command line names (all if none) to its folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--only", choices=FIGURES, nargs="+", default=list(FIGURES))
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for name in arguments.only:
        FIGURES[name](arguments.output)


def scan(scenario: str, changes: list[str], folder: Path) -> laspy.LasData:
    """Generate a scenario's cloud in draft fidelity into a folder; return its points."""
    scan_changes = ["fidelity=draft", 'outputs=["cloud"]', *changes]
    generate(Job(load_scenario(scenario, scan_changes), folder, overwrite=True, new_file=True))
    return laspy.read(folder / "cloud.laz")


def draw_platforms(output: Path) -> None:
    """Write a picture of each platform's cloud from above, coloured by class."""
    figure = new_figure(9, 3.9 * len(PLATFORMS))
    axes = figure.subplots(len(PLATFORMS), 1)
    with tempfile.TemporaryDirectory() as folder:
        for axis, (title, (name, changes)) in zip(axes, PLATFORMS.items(), strict=True):
            path = _trajectory(Path(folder), name, changes) if title == "trajectory file" else []
            cloud = scan(name, [*SHORT, *changes, *path], Path(folder) / "scan")
            _draw(axis, cloud, title)
    save_figure(figure, output / "scan-platforms.png", dpi=100)


def _trajectory(folder: Path, name: str, changes: list[str]) -> list[str]:
    """Write a trajectory file that weaves about the road; return the scenario changes that fly it."""
    scenario = load_scenario(name, changes)
    geometry = RoadGeometry(sample_road(scenario.road, scenario.seed))
    station = np.linspace(0.0, geometry.length, 400)
    plan, heading, _ = geometry.alignment.frame(station)
    sway = 25.0 * np.sin(station / 30.0)
    turn = heading + np.arctan(25.0 / 30.0 * np.cos(station / 30.0))
    place = plan + sway[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    origin = np.array(geometry.parameters.transform.translate)
    x, y, z = np.column_stack([place, geometry.profile.elevation(station) + 50.0]).T + origin[:, None]
    rows = zip(station / 10.0, x, y, z, 90.0 - np.rad2deg(turn), strict=True)
    lines = [f"{t:.4f},{a:.4f},{b:.4f},{c:.4f},0,0,{h:.6f}" for t, a, b, c, h in rows]
    file = folder / "flight.csv"
    file.write_text("\n".join(["time,x,y,z,roll,pitch,heading", *lines]), encoding="utf-8")
    return ["scan.platform.kind=trajectory", f"scan.platform.file={file}"]


def _draw(axis: Any, cloud: laspy.LasData, title: str) -> None:
    """Draw a cloud from above along its longer side into the axes, coloured by each pixel's highest point's class."""
    colors = np.full((256, 3), 128, dtype=np.uint8)
    for row in classes():
        colors[row.id] = row.color
    all_points = np.ones(len(cloud), dtype=bool)
    _draw_colors(axis, cloud, all_points, colors[np.asarray(cloud["class_id"])], f"{title}: {len(cloud):,} points")


def _draw_colors(
    axis: Any, cloud: laspy.LasData, mask: NDArray[np.bool_], color: NDArray[np.uint8], title: str
) -> None:
    """Draw a mask's points from above along the cloud's longer side into the axes, the highest on top.

    Args:
        mask: mask of the cloud's points.
        color: (N, 3) of those chosen.
    """
    plan = np.column_stack([cloud.x, cloud.y])
    plan = plan - plan.mean(axis=0)
    _, _, turn = np.linalg.svd(plan[:: max(1, len(plan) // 10_000)], full_matrices=False)
    along, across = (plan[mask] @ turn.T).T
    rows_inside = np.flatnonzero((np.abs(along) < REACH) & (np.abs(across) < ASIDE))
    order = rows_inside[np.argsort(np.asarray(cloud.z)[mask][rows_inside], kind="stable")]
    picture = np.full((int(2 * ASIDE / PIXEL) + 1, int(2 * REACH / PIXEL) + 1, 3), 255, dtype=np.uint8)
    place = ((across[order] + ASIDE) / PIXEL).astype(int), ((along[order] + REACH) / PIXEL).astype(int)
    picture[place] = color[order]
    axis.imshow(picture, extent=(-REACH, REACH, -ASIDE, ASIDE), origin="lower", interpolation="nearest")
    axis.set_title(title, fontsize=10, loc="left")
    axis.set(ylabel="across (m)")


def draw_cloud_shadows(output: Path) -> None:
    """Write a picture of two strips of one scan, between which the clouds' shadows have drifted."""
    changes = ["road.length=200", "road.half_width=40", "scan.lines_per_second=50"]
    changes += ['road.environment.cloud_cover={"minimum":0.45,"maximum":0.45}']
    with tempfile.TemporaryDirectory() as folder:
        cloud = scan("rq31-600m-even", changes, Path(folder) / "scan")
    figure = new_figure(9, 7.6)
    axes = figure.subplots(2, 1)
    time = np.asarray(cloud.gps_time)
    strips = np.asarray(cloud.point_source_id)
    for axis, strip in zip(axes, (1, 2), strict=True):
        is_in_strip = strips == strip
        title = f"strip {strip}, {time[is_in_strip].min():.0f} to {time[is_in_strip].max():.0f} s"
        rgb = np.column_stack([cloud.red, cloud.green, cloud.blue])[is_in_strip] >> 8
        _draw_colors(axis, cloud, is_in_strip, rgb.astype(np.uint8), title)
    save_figure(figure, output / "cloud-shadows.png", dpi=100)


def intensity_histograms(output: Path) -> None:
    """Write histograms of range-corrected intensity by reflection model, for road, markings and vegetation."""
    figure = new_figure(13, 3.6, layout=None)
    axes = figure.subplots(1, 3)
    clouds = {}
    with tempfile.TemporaryDirectory() as folder:
        for model in ("lambert", "oren_nayar"):
            changes = ["road.length=100", f"scan.reflection={model}"]
            clouds[model] = scan("rq31-600m-even", changes, Path(folder) / model)
    names = {row.name: row.id for row in classes()}
    for axis, name in zip(axes, ("road", "road_marking", "vegetation"), strict=True):
        for model, cloud in clouds.items():
            is_of_class = np.asarray(cloud["class_id"]) == names[name]
            # Times the squared range: what is left is the surface and the angle.
            value = cloud.intensity[is_of_class] * np.asarray(cloud["range"])[is_of_class] ** 2 / cloud_scale(cloud)
            axis.hist(value, bins=120, range=(0.0, np.quantile(value, 0.999) * 1.3), histtype="step", label=model)
        axis.set(title=name.replace("_", " "), xlabel="intensity x range squared", ylabel="points")
        axis.legend()
    figure.tight_layout()
    save_figure(figure, output / "intensity-models.png", dpi=100)


def cloud_scale(cloud: laspy.LasData) -> float:
    """Return a cloud's 16-bit steps per unit of intensity, from its LAS header's note."""
    import json

    note = next(vlr for vlr in cloud.header.vlrs if vlr.user_id == "SynthRoads")
    return float(json.loads(note.record_data)["intensity_scale"])


def print_convergence(output: Path) -> None:
    """Print a Markdown table: errors of mean range and spread on a slanted plane (mm) by rays per pulse."""
    print("| rays per pulse | error of the mean range (mm) | of the spread within the pulse (mm) |\n|---|---|---|")
    distance, tilt, sigma = 300.0, np.deg2rad(75.0), np.tan(1e-3) / 2.0
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    x, y = (axis.ravel() * sigma for axis in np.meshgrid(nodes, nodes))
    truth = _moments(distance, tilt, x, y, np.outer(weights, weights).ravel() / weights.sum() ** 2)
    for rays, rings in RINGS.items():
        pattern = beam_pattern(rings)
        x, y = (pattern.across * np.tan(1e-3)).T
        mean, spread = _moments(distance, tilt, x, y, pattern.weights)
        print(f"| {rays} | {1e3 * (mean - truth[0]):.6f} | {1e3 * (spread - truth[1]):.4f} |")


def _moments(distance: float, tilt: float, x: Any, y: Any, weights: Any) -> tuple[float, float]:
    """Return mean and standard deviation of the range of rays (x, y) on a plane tilted against their axis."""
    reach = distance * np.sqrt(1.0 + x * x + y * y) / (1.0 - x * np.tan(tilt))
    mean = float((weights * reach).sum())
    return mean, float(np.sqrt((weights * (reach - mean) ** 2).sum()))


FIGURES: dict[str, Callable[[Path], None]] = {
    "platforms": draw_platforms,
    "intensity_histograms": intensity_histograms,
    "convergence": print_convergence,
    "clouds": draw_cloud_shadows,
}

if __name__ == "__main__":
    main()
