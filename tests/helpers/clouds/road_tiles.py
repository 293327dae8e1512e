"""A straight labelled road with verge, shrubs and posts as a tile, without PyTorch: it takes seconds to import."""

from __future__ import annotations

import numpy as np

from ml.data.tiles import CloudTile


def road_points(count: int, seed: int, length: float = 60.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return xyz (N, 3), rgb (N, 3) 0 to 255, intensity (N,) 0 to 1 and class (N,) of a road along x."""
    random = np.random.default_rng(seed)
    xyz = random.uniform([0.0, 0.0, 0.0], [length, 40.0, 0.02], (count, 3))
    label = np.where(np.abs(xyz[:, 1] - 20.0) < 6.0, 1, 0)
    label[(label == 1) & (np.abs(np.abs(xyz[:, 1] - 20.0) - 5.0) < 0.3)] = 2
    shrub = (label == 0) & (random.random(count) < 0.3)
    xyz[shrub, 2] += random.uniform(0.3, 3.0, shrub.sum())
    label[shrub] = 3
    post = (np.abs(xyz[:, 1] - 26.3) < 0.25) & (label == 0)
    xyz[post, 2] += random.uniform(0.0, 1.0, post.sum())
    label[post] = 4
    bright = np.array([0.3, 0.15, 0.6, 0.4, 0.5])[label] + random.normal(0.0, 0.03, count)
    color = np.array([(120, 100, 70), (90, 90, 95), (220, 220, 220), (60, 130, 50), (150, 160, 170)])[label]
    color = np.clip(color + random.normal(0.0, 12.0, (count, 3)), 1, 255)
    return xyz, color.astype(np.uint8), np.clip(bright, 0.01, 1.0), label


def road_tile(
    count: int = 6000, seed: int = 1, scene: str = "road", gain: float = 1.0, length: float = 60.0
) -> CloudTile:
    """Return the points as a tile; intensities times ``gain``."""
    xyz, rgb, intensity, label = road_points(count, seed, length)
    strength = np.clip(intensity * gain, 0.0, 1.0).astype(np.float32)
    return CloudTile(
        scene, np.array([4e5, 5.6e6, 100.0]), xyz.astype(np.float32), rgb, strength, label.astype(np.int16)
    )
