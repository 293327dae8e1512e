"""Figures and numbers of docs/roughness.md: micro-relief beside a smooth model and, if one is given, a real scan.

Usage: python studies/surfaces/roughness.py --output docs/pictures/roughness.png
       python studies/surfaces/roughness.py --real CLOUD.laz --axis AXIS.csv --across LOW HIGH --select NAME=VALUE
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.surfaces.surface_variation import plane_residuals, surface_variation  # noqa: E402
from synthroads_addon.base.arithmetic.noise import noise_field  # noqa: E402
from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.base.random_streams import stream  # noqa: E402
from synthroads_addon.cloud.points import PointBlock  # noqa: E402
from synthroads_addon.scanning.relief.micro_relief import OCTAVES, RELIEF, BeamEnds, MicroRelief, shift_by_relief  # noqa: E402

Float = NDArray[np.float64]
Rows = tuple[list[dict[str, float]], list[dict[str, float]]]

PATCH, RADIUS, GRID = 1.0, 1.0, 0.04
STRENGTHS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
DEVICE_NOISE = 0.010
"""Standard deviation of the default device's range, m."""
SAMPLE = 4000
SEED = 31
# Surfaces across the drawn strip: name in the material table, where it ends (m), colour.
STRIP: tuple[tuple[str, float, str], ...] = (
    ("grass_ground", -2.3, "#6a9a3c"),
    ("verge", -1.9, "#a08a62"),
    ("asphalt", -1.75, "#4d5157"),
    ("paint_white", -1.6, "#2f7fd0"),
    ("asphalt", 4.0, "#4d5157"),
)


@dataclass(frozen=True)
class Cloud:
    """Points on a strip of road, with their surfaces.

    Attributes:
        xyz: (N, 3) along, across and height above the mean surface, m.
        surface: (N,) index into `STRIP`, or -1 where it isn't known.
    """

    xyz: Float
    surface: NDArray[np.intp]
    asphalt: Float = field(default_factory=lambda: np.empty((0, 3)))


def strip_points(lowest: tuple[float, float], highest: tuple[float, float], density: float) -> Cloud:
    """Return uniform random points on a smooth, level strip of several surfaces; density in points/m2."""
    random = stream(SEED, "points", round(density))
    count = round(density * (highest[0] - lowest[0]) * (highest[1] - lowest[1]))
    plan = random.uniform(lowest, highest, (count, 2))
    surface = np.searchsorted([end for _, end, _ in STRIP], plan[:, 1])
    return Cloud(np.column_stack([plan, np.zeros(count)]), surface)


def with_relief(cloud: Cloud, strength: float, noise: float = 0.0, octaves: int = 4) -> Cloud:
    """Return the cloud with its surfaces' relief (times `strength`) and Gaussian noise (m) added to the heights."""
    table = np.array([RELIEF[name] for name, _, _ in STRIP])
    amplitude, wavelength = table[cloud.surface].T
    height = strength * amplitude * noise_field(cloud.xyz, wavelength, SEED, octaves)
    height += stream(SEED, "noise").normal(0.0, noise, len(height))
    return Cloud(cloud.xyz + height[:, None] * np.array([0.0, 0.0, 1.0]), cloud.surface)


def thinned(xyz: Float, size: float = GRID) -> Float:
    """Return the first point of each occupied cell of a cubic grid, in order, (K, 3)."""
    cell = np.floor((xyz - xyz.min(axis=0)) / size).astype(np.int64)
    _, first_rows = np.unique(cell, axis=0, return_index=True)
    return xyz[np.sort(first_rows)]


def measure(xyz: Float) -> dict[str, float]:
    """Return one surface's medians of residual about planes (mm) and surface variation, with points and patches."""
    xyz = thinned(xyz)
    residual, _ = plane_residuals(xyz, PATCH)
    sample_rows = stream(SEED, "chosen").choice(len(xyz), min(SAMPLE, len(xyz)), replace=False)
    variation = surface_variation(xyz, RADIUS, sample_rows)
    return {
        "points": len(xyz),
        "patches": len(residual),
        "residual": 1e3 * float(np.median(residual)) if len(residual) else np.nan,
        "variation": float(np.nanmedian(variation)),
    }


LAGS = np.array([0.0, 0.1, 0.2, 0.4, 0.7, 1.0])


def semivariogram(xyz: Float) -> Float:
    """Return the root semivariance (mm) of heights about quadratic surfaces of 2 m patches, per bin of `LAGS` (m)."""
    from scipy.spatial import cKDTree

    height = residuals(xyz, 2.0)
    pairs = cKDTree(xyz[:, :2]).query_pairs(LAGS[-1], output_type="ndarray")
    step = np.linalg.norm(xyz[pairs[:, 0], :2] - xyz[pairs[:, 1], :2], axis=1)
    semivariances = 0.5 * (height[pairs[:, 0]] - height[pairs[:, 1]]) ** 2
    is_finite = np.isfinite(semivariances)
    sums, _ = np.histogram(step[is_finite], LAGS, weights=semivariances[is_finite])
    number, _ = np.histogram(step[is_finite], LAGS)
    return 1e3 * np.sqrt(sums / np.maximum(number, 1))


def residuals(xyz: Float, size: float) -> Float:
    """Return heights (N,), m, above the quadratic surface fitted to each patch of `size` (m); NaN below 20 points."""
    cell = np.floor(xyz[:, :2] / size).astype(np.int64)
    _, patch = np.unique(cell, axis=0, return_inverse=True)
    result = np.full(len(xyz), np.nan)
    order = np.argsort(patch.ravel(), kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(patch.ravel()[order])) + 1):
        if len(part) >= 20:
            result[part] = above_surface(xyz[part], xyz[part])
    return result


def above_surface(xyz: Float, base_points: Float) -> Float:
    """Return points' heights (N,), m, above the quadratic surface that fits the points `base_points` best."""
    centre = base_points.mean(axis=0)

    def terms(points: Float) -> Float:
        """Return the terms of the quadratic surface at points."""
        x, y = (points - centre)[:, :2].T
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)

    coefficients = np.linalg.lstsq(terms(base_points), base_points[:, 2], rcond=None)[0]
    return xyz[:, 2] - terms(xyz) @ coefficients


def read_real(arguments: argparse.Namespace) -> Cloud:
    """Read a real cloud as (along, across, height), m, with the points of its asphalt selected.

    Asphalt is what was selected, lies between the offsets (on either side) or distances given, and is no brighter than
    the median of that by a twelfth: paint is. Points of intensity 0 are left out.
    """
    import laspy

    las = laspy.read(arguments.real)
    xyz, intensity = np.array(las.xyz), np.asarray(las.intensity, dtype=np.float64)
    is_kept = intensity > 0
    for name, value in arguments.select:
        is_kept &= np.asarray(las[name]) == float(value)
    if arguments.axis:
        xyz[:, :2] = along_axis(xyz[:, :2], arguments.axis)
        distances = np.abs(xyz[:, 1]) if arguments.both_sides else xyz[:, 1]
    else:
        distances = np.hypot(*xyz[:, :2].T)
    is_asphalt = is_kept & (distances >= arguments.across[0]) & (distances <= arguments.across[1])
    if not is_asphalt.any():
        raise SystemExit(f"{arguments.real}: no points selected")
    is_asphalt &= intensity <= np.median(intensity[is_asphalt]) * (13.0 / 12.0)
    return Cloud(xyz[is_kept], np.full(int(is_kept.sum()), -1), xyz[is_asphalt])


def along_axis(plan: Float, file: Path) -> Float:
    """Return station and offset (N, 2), m, left positive, of points (N, 2) along an axis' CSV with columns s, x, y."""
    table = np.genfromtxt(file, delimiter=",", names=True)
    axis = np.column_stack([table["x"], table["y"]])
    start, run = axis[:-1], np.diff(axis, axis=0)
    length = np.hypot(*run.T)
    start, run, length, stations = (part[length > 0] for part in (start, run, length, table["s"][:-1]))
    result, nearest_distance = np.zeros_like(plan), np.full(len(plan), np.inf)
    for a, d, size, station in zip(start, run / length[:, None], length, stations, strict=True):
        shift = plan - a
        along = shift @ d
        beyond_ends = np.maximum(np.maximum(-along, along - size), 0.0)
        offset = d[0] * shift[:, 1] - d[1] * shift[:, 0]
        is_nearer = np.hypot(beyond_ends, offset) < nearest_distance
        nearest_distance[is_nearer] = np.hypot(beyond_ends, offset)[is_nearer]
        result[is_nearer] = np.column_stack([station + along, offset])[is_nearer]
    return result


def hillshade(axes: Any, xyz: Float, lowest: Float, highest: Float, cell: float, exaggeration: float) -> None:
    """Draw a hillshade of the mean height per cell into the axes, lit from the upper left at 45 degrees."""
    shape = np.round((highest - lowest) / cell).astype(int)
    place = np.floor((xyz[:, :2] - lowest) / cell).astype(int)
    is_inside = ((place >= 0) & (place < shape)).all(axis=1)
    cell_numbers = np.ravel_multi_index(tuple(place[is_inside].T), tuple(shape))
    number = np.bincount(cell_numbers, minlength=shape.prod())
    with np.errstate(invalid="ignore"):
        height = filled((np.bincount(cell_numbers, xyz[is_inside, 2], shape.prod()) / number).reshape(shape))
    along_slopes, across_slopes = np.gradient(exaggeration * height, cell)
    # One light for all panels, without a stretch by panel: a smooth surface is one grey, a rough one isn't.
    light = (along_slopes - across_slopes + 2.0**0.5) / (2.0 * np.sqrt(along_slopes**2 + across_slopes**2 + 1.0))
    extent = (lowest[0], highest[0], lowest[1], highest[1])
    axes.imshow(light.T, cmap="gray", vmin=0, vmax=1, extent=extent, origin="lower", aspect="equal")


def filled(raster: Float) -> Float:
    """Return the raster with NaN cells set to the mean of their 8 neighbours; larger holes stay NaN inside."""
    padded_raster = np.pad(raster, 1, constant_values=np.nan)
    neighbours = np.lib.stride_tricks.sliding_window_view(padded_raster, (3, 3)).reshape(*raster.shape, 9)
    number = np.isfinite(neighbours).sum(axis=2)
    mean = np.nansum(neighbours, axis=2) / np.maximum(number, 1)
    return np.where(np.isnan(raster) & (number > 0), mean, raster)


def section(axes: Any, cloud: Cloud, station: float, depth: float) -> None:
    """Draw the heights (mm) across the road of the points within `depth` (m) about a station into the axes."""
    is_near = np.abs(cloud.xyz[:, 0] - station) < 0.5 * depth
    colors = np.array([color for _, _, color in STRIP] + ["#c9c9c9"])[cloud.surface[is_near]]
    axes.scatter(cloud.xyz[is_near, 1], 1e3 * cloud.xyz[is_near, 2], s=5, c=colors, linewidths=0)


def print_statistics(real: Cloud | None) -> Rows:
    """Print the roughness by relief strength and of the real asphalt; return it without and with range noise."""
    asphalt_cloud = strip_points((0.0, -1.6), (400.0, 4.0), 18.0)
    asphalt_cloud = Cloud(asphalt_cloud.xyz, np.full(len(asphalt_cloud.xyz), 2))
    rows: Rows = ([], [])
    print(f"asphalt, 18 points/m2: residual about planes of {PATCH:g} m patches, surface variation within {RADIUS:g} m")
    for strength in STRENGTHS:
        for column, noise in zip(rows, (0.0, DEVICE_NOISE), strict=True):
            column.append(measure(with_relief(asphalt_cloud, strength, noise).xyz))
            values = column[-1]
            print(
                f"  strength {strength:4g}  noise {1e3 * noise:4.0f} mm:"
                f"  {values['residual']:6.2f} mm  {values['variation']:.6f}"
            )
    for name in dict.fromkeys(name for name, _, _ in STRIP):
        index = [row[0] for row in STRIP].index(name)
        values = measure(with_relief(Cloud(asphalt_cloud.xyz, np.full(len(asphalt_cloud.xyz), index)), 1.0).xyz)
        print(f"  strength 1, {name:12s}: {values['residual']:6.2f} mm  {values['variation']:.6f}")
    print(f"  root semivariance at lags up to {LAGS[1:]} m, mm:")
    print("   relief, strength 30 ", semivariogram(with_relief(asphalt_cloud, 30.0).xyz).round(1))
    print("   noise, 25 mm        ", semivariogram(with_relief(asphalt_cloud, 0.0, 0.025).xyz).round(1))
    if real is not None:
        values = measure(real.asphalt)
        print(f"  real, {values['points']} points, {values['patches']} patches:", end="")
        print(f"  {values['residual']:6.2f} mm  {values['variation']:.6f}")
        print("   real                ", semivariogram(real.asphalt).round(1))
    return rows


def print_footprints() -> None:
    """Print the share of the relief's deviation that is left of its means over Gaussian footprints, by diameters."""
    random = stream(SEED, "footprint")
    centres = np.column_stack([random.uniform(-300, 300, (1500, 2)), np.zeros(1500)])
    for name in ("asphalt", "verge", "grass_ground"):
        relief, text = RELIEF[name], []
        for diameters in ((0.007, 0.007), (0.030, 0.030), (0.096, 0.030), (0.25, 0.25)):
            spread = random.normal(0.0, 0.25, (1500, 400, 3)) * (*diameters, 0.0)
            place = (centres[:, None] + spread).reshape(-1, 3)
            height = relief.amplitude * noise_field(place, relief.wavelength, SEED, 6)
            seen_deviation = height.reshape(1500, 400).mean(axis=1).std()
            percent = 100 * seen_deviation / relief.amplitude
            text.append(f"{1e3 * diameters[0]:.0f} x {1e3 * diameters[1]:.0f} mm {percent:.0f} %")
        print(f"  of the relief of {name}, a footprint sees: " + ", ".join(text))


def print_timing(count: int = 1_000_000) -> None:
    """Print the micro-relief's processor seconds per million points, by fidelity."""
    size = 2**15  # points that a scan works on at once
    blocks = [
        point_block(stream(SEED, "timing", part).uniform(-300, 300, (size, 3)) * np.array([1.0, 0.25, 0.01]))
        for part in range(count // size)
    ]
    relief = MicroRelief(np.array([RELIEF["asphalt"].amplitude]), np.array([RELIEF["asphalt"].wavelength]))
    directions = np.tile([0.0, 0.0, 1.0], (size, 1))
    for fidelity, octaves in OCTAVES.items():
        best_seconds = np.inf
        for _ in range(3):
            begin = time.process_time()
            for block in blocks:
                shift_by_relief(block, BeamEnds(block.xyz, directions), relief, 1.0, SEED, octaves)
            best_seconds = min(best_seconds, (time.process_time() - begin) * 1e6 / (size * len(blocks)))
        print(
            f"{fidelity}: {octaves} octaves, {best_seconds:.3f} s of one core per million points, all on rough surfaces"
        )


def point_block(position: Float) -> PointBlock:
    """Return a block of points (N, 3) of one material on level ground, seen from straight above."""
    count = len(position)
    return PointBlock(
        xyz=position,
        intensity=np.ones(count),
        rgb=np.zeros((count, 3), dtype=np.uint16),
        class_id=np.zeros(count, dtype=np.uint8),
        instance_id=np.zeros(count, dtype=np.uint32),
        return_number=np.ones(count, dtype=np.uint8),
        number_of_returns=np.ones(count, dtype=np.uint8),
        gps_time=np.zeros(count),
        scan_angle_deg=np.zeros(count, dtype=np.float32),
        strip=np.zeros(count, dtype=np.uint16),
        range=np.full(count, 60.0),
        incidence_deg=np.zeros(count, dtype=np.float32),
        normal=np.tile(np.array([0.0, 0.0, 1.0], dtype=np.float32), (count, 1)),
        material=np.zeros(count, dtype=np.uint16),
    )


def draw(output: Path, real: Cloud | None, station: float | None, rows: Rows) -> None:
    """Write the picture: hillshaded close-ups, roughness curves, then top views and sections of sparse points."""
    noise = DEVICE_NOISE if real is None else 1e-3 * measure(real.asphalt)["residual"]
    figure = new_figure(18, 11.5)
    axes = figure.subplots(3, 4)
    lowest, highest = np.array([0.0, -2.8]), np.array([2.0, -1.0])
    dense_cloud = strip_points((0.0, -2.8), (2.0, -1.0), 120_000)
    for panel, strength in zip(axes[0, :3], (0.0, 1.0, 4.0), strict=True):
        hillshade(panel, with_relief(dense_cloud, strength, octaves=6).xyz, lowest, highest, 0.005, 2.0)
        panel.set_title(f"close-up, no noise, strength {strength:g} (heights × 2)")
        panel.set(xlabel="along, m", ylabel="across, m")
        for (name, end, color), start in zip(STRIP, (lowest[1], *(row[1] for row in STRIP)), strict=False):
            label = "paint" if name == "paint_white" else name.split("_")[0]
            label_place = 0.5 * (max(start, lowest[1]) + min(end, highest[1]))
            panel.text(1.97, label_place, label, color=color, va="center", ha="right", fontsize=8, backgroundcolor="w")
    draw_residuals(axes[0, 3], rows, None if real is None else measure(real.asphalt)["residual"])
    columns = sparse_columns(real, noise, station)
    for column in range(4):
        if column >= len(columns):
            axes[1, column].set_axis_off()
            axes[2, column].set_axis_off()
            continue
        title, cloud = columns[column]
        hillshade(axes[1, column], cloud.xyz, np.array([0.0, -4.0]), np.array([8.0, 4.0]), 0.4, 5.0)
        axes[1, column].set(title=title, xlabel="along, m (heights × 5)", ylabel="across, m")
        section(axes[2, column], cloud, 4.0, 2.0)
        axes[2, column].set(ylim=(-100, 100), xlim=(-4, 4), xlabel="across, m", ylabel="height, mm")
        axes[2, column].set_title("section, 2 m deep")
        axes[2, column].grid(alpha=0.3)
    output.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, output, dpi=75)


def sparse_columns(real: Cloud | None, noise: float, station: float | None) -> list[tuple[str, Cloud]]:
    """Return (title, cloud) of 18 points/m2: smooth, with relief, with relief and noise, and the real one if given."""
    sparse_cloud = strip_points((0.0, -4.0), (8.0, 4.0), 18.0)
    columns = [
        ("18 points/m², smooth, no noise", sparse_cloud),
        ("18 points/m², strength 1, no noise", with_relief(sparse_cloud, 1.0)),
        (f"18 points/m², strength 1, noise {1e3 * noise:.0f} mm", with_relief(sparse_cloud, 1.0, noise)),
    ]
    if real is not None:
        columns.append(("real scan, its range noise included", window(real, station)))
    return columns


def window(real: Cloud, station: float | None) -> Cloud:
    """Return 8 m x 8 m of a real road about a station, asphalt in the middle, heights above its asphalt's surface."""
    stations = real.asphalt[:, 0]
    middle = np.array([np.median(stations) if station is None else station, np.median(real.asphalt[:, 1])])
    part, asphalt = (xyz[(np.abs(xyz[:, :2] - middle) < 4.0).all(axis=1)] for xyz in (real.xyz, real.asphalt))
    if len(asphalt) < 20:
        raise SystemExit("too few points of asphalt about --at")
    is_asphalt = (part[:, None, :2] == asphalt[None, :, :2]).all(axis=2).any(axis=1)
    local_points = np.column_stack([part[:, :2] - middle + (4.0, 0.0), above_surface(part, asphalt)])
    return Cloud(local_points, np.where(is_asphalt, [row[0] for row in STRIP].index("asphalt"), -1))


def draw_residuals(axes: Any, rows: Rows, real: float | None) -> None:
    """Draw the residual in patches against the relief's strength into the axes."""
    labels = ("relief alone", f"relief and range noise, {1e3 * DEVICE_NOISE:.0f} mm")
    for row, label, style in zip(rows, labels, ("o-", "s--"), strict=True):
        axes.loglog(STRENGTHS[1:], [values["residual"] for values in row[1:]], style, color="#1f4e79", label=label)
    if real is not None:
        axes.axhline(real, color="#b03a2e", label="real asphalt")
    axes.set(xlabel="strength", ylabel=f"residual in {PATCH:g} m patches, mm", title="asphalt: roughness by strength")
    axes.grid(alpha=0.3, which="both")
    axes.legend()


def main() -> None:
    """Print the roughness, and write the picture or time the relief, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, help="picture to write; none if not given")
    parser.add_argument("--real", type=Path, help="LAS or LAZ file of a real road")
    parser.add_argument("--axis", type=Path, help="CSV with columns s, x, y: the road's axis; else distance from 0, 0")
    parser.add_argument("--across", type=float, nargs=2, default=(0.5, 2.8), help="offsets or distances of asphalt, m")
    parser.add_argument("--both-sides", action="store_true", help="offsets count on either side of the axis")
    parser.add_argument(
        "--select", type=lambda text: tuple(text.split("=")), action="append", default=[], help="NAME=VALUE of points"
    )
    parser.add_argument("--at", type=float, help="where along the road the real scan is drawn, m")
    parser.add_argument("--timing", action="store_true", help="measure the time as well")
    parser.add_argument("--footprints", action="store_true", help="what of the relief a laser's footprint sees")
    arguments = parser.parse_args()
    real = read_real(arguments) if arguments.real else None
    rows = print_statistics(real)
    if arguments.timing:
        print_timing()
    if arguments.footprints:
        print_footprints()
    if arguments.output:
        draw(arguments.output, real, arguments.at, rows)


if __name__ == "__main__":
    main()
