"""A made-up real cloud: materials of known spreads, seen through a device of a known gain, with classes and an axis."""

from pathlib import Path

import laspy
import numpy as np

from synthroads_addon.materials.surfaces import mean_over_median

FULL = 65_535.0


def brightness_factors(normal: np.ndarray, below: float, above: float) -> np.ndarray:
    """Return the factors on a material's brightness of normal values (N,), with the spreads to either side."""
    return np.exp(normal * np.where(normal < 0.0, below, above)) / mean_over_median(below, above)


def write_las(
    path: Path,
    xyz: np.ndarray,
    intensity: np.ndarray,
    label: np.ndarray | None = None,
    time: np.ndarray | None = None,
) -> Path:
    """Write points as others do: LAS 1.4 without any notes of ours; ``label`` as an attribute of that name."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 1e-3), np.floor(xyz.min(axis=0))
    if label is not None:
        header.add_extra_dim(laspy.ExtraBytesParams("label", np.uint16))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.intensity = np.clip(np.rint(intensity), 0, FULL).astype(np.uint16)
    if label is not None:
        las.label = label.astype(np.uint16)
    if time is not None:
        las.gps_time = time
    las.write(path)
    return path


def stored(linear: np.ndarray, gain: float, decibels: float | None) -> np.ndarray:
    """Return what a device of a gain writes."""
    return gain * linear if decibels is None else FULL / decibels * 10.0 * np.log10(gain * linear)


def labelled(path: Path, decibels: float | None, gain: float, zeros: int = 50, seed: int = 4) -> Path:
    """Write asphalt (label 40, R 0.2, spreads 0.3 and 0.15) and paint (60, R 0.5, 0.1 and 0.2), struck at 0 degrees."""
    rng = np.random.default_rng(seed)
    kinds = [(40, 0.2, 0.3, 0.15, 30_000), (60, 0.5, 0.1, 0.2, 6_000)]
    label = np.repeat([kind[0] for kind in kinds], [kind[4] for kind in kinds])
    linear = np.concatenate([r * brightness_factors(rng.standard_normal(n), low, high) for _, r, low, high, n in kinds])
    intensity = stored(linear, gain, decibels)
    intensity[:zeros] = 0.0
    xyz = np.column_stack([rng.random((len(label), 2)) * 100.0, np.zeros(len(label))])
    return write_las(path, xyz, intensity, label)


def striped(path: Path, axis: Path, gain: float, shift: float = 0.25) -> tuple[Path, np.ndarray]:
    """Write 300 m of asphalt with a line of 0.2 m at 3 m, moved by ``shift`` over its second half, dashed 6 m in 12 m.

    Returns:
        The cloud, and which of its points are on paint.
    """
    rng = np.random.default_rng(5)
    x, y = rng.random(120_000) * 300.0, rng.random(120_000) * 12.0 - 6.0
    line = 3.0 + np.where(x > 160.0, shift, 0.0)
    paint = (np.abs(y - line) <= 0.1) & (x % 12.0 < 6.0)
    linear = np.where(paint, 0.35, 0.15) * brightness_factors(rng.standard_normal(len(x)), 0.3, 0.3)
    axis.write_text("x,y,z\n" + "".join(f"{s},0,0\n" for s in range(301)), encoding="utf-8")
    return write_las(path, np.column_stack([x, y, np.zeros(len(x))]), stored(linear, gain, 30.0)), paint
