"""Random points with every attribute."""

import numpy as np

from synthroads_addon.cloud.points import PointBlock


def make_points(count: int, seed: int = 0, origin=(294_000.0, 5_628_000.0, 180.0)) -> PointBlock:
    """Return random points with every attribute in its allowed range."""
    rng = np.random.default_rng(seed)
    returns = rng.integers(1, 6, count).astype(np.uint8)
    return PointBlock(
        xyz=rng.uniform(-300, 300, (count, 3)) + np.array(origin),
        intensity=rng.uniform(0, 1e-4, count),
        rgb=rng.integers(0, 65536, (count, 3)).astype(np.uint16),
        class_id=rng.integers(0, 17, count).astype(np.uint8),
        instance_id=rng.integers(0, 2**32, count).astype(np.uint32),
        return_number=np.minimum(returns, rng.integers(1, 6, count)).astype(np.uint8),
        number_of_returns=returns,
        gps_time=np.sort(rng.uniform(0, 160, count)),
        scan_angle_deg=rng.uniform(-90, 90, count).astype(np.float32),
        strip=rng.integers(0, 2, count).astype(np.uint16),
        range=rng.uniform(3, 150, count),
        incidence_deg=rng.uniform(0, 90, count).astype(np.float32),
    )
