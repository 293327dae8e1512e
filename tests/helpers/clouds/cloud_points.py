"""Points for the tests of cloud files."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.cloud.layers import layer_arrays
from synthroads_addon.cloud.points import FIELDS, PointBlock


def with_every_attribute(points: PointBlock, seed: int = 1) -> PointBlock:
    """Return points with every optional array."""
    rng, count = np.random.default_rng(seed), len(points)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return replace(
        points,
        normal=normal.astype(np.float32),
        material=rng.integers(0, 65_536, count).astype(np.uint16),
        scanner=points.xyz + rng.uniform(-99, 99, (count, 3)),
        true_range=points.range + 0.01,
        true_xyz=points.xyz + 0.01,
        roughness=rng.uniform(0, 1, count).astype(np.float32),
        metallic=rng.uniform(0, 1, count).astype(np.float32),
        specular=rng.uniform(0, 1, count).astype(np.float32),
        color_source=rng.integers(0, 256, count).astype(np.uint8),
        more=dict(_other_layers(count, rng)),
    )


def _other_layers(count: int, rng: np.random.Generator) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield arrays of the layers that have no field of their own in `PointBlock`: 0 or 1, which every file can hold."""
    for name, (kind, width) in layer_arrays().items():
        if name not in FIELDS:
            yield name, rng.integers(0, 2, (count, width) if width > 1 else count).astype(kind)
