"""Heights of the pavement: tracks, joints, patches, cracks and waves are as deep and high as the parameters say."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.surface import PavementSurface
from synthroads_addon.road.pavement.unevenness import unevenness, unevenness_spread
from tests.helpers.effects.road_cases import base_road

LANE = 3.75
"""Width of the right carriageway's lanes, m."""


def surface_of(**pavement: object) -> PavementSurface:
    """Return the surface of a road whose right pavement has these values beside its damage."""
    data = deepcopy(base_road({}))
    data["objects"]["right"]["pavement"] |= pavement
    data["objects"]["left"]["pavement"] |= {"wheel_track_depth": 0.0, "unevenness": 0.0}
    return PavementSurface(RoadGeometry(RoadParameters.from_dict(data)))


def outer_lane(surface: PavementSurface) -> float:
    """Return the offset of the middle of the right carriageway's outer lane, m."""
    return -float(surface.geometry.sections["right"].lane_boundaries(30.0)[0, :2].mean())


def test_wheel_tracks_are_as_deep_as_said_and_keep_the_lane_s_mean() -> None:
    surface = surface_of(unevenness=0.0, joint_depth=0.0, wheel_track_depth=0.004, patches=[], cracks=[])
    middle = outer_lane(surface)
    across = np.linspace(-LANE / 2.0, LANE / 2.0, 401)
    height = surface.height(30.0, middle + across)
    assert np.ptp(height) == pytest.approx(0.004, rel=0.05)
    assert abs(across[np.argmin(height)]) == pytest.approx(0.9, abs=0.05)
    assert height.mean() == pytest.approx(0.0, abs=0.0002)
    # The next lane inwards has less of it.
    inner = surface.height(30.0, middle + LANE + across[1:-1])
    assert np.ptp(inner) == pytest.approx(0.004 / 1.6, rel=0.05)


def test_joints_are_as_deep_as_said() -> None:
    surface = surface_of(unevenness=0.0, wheel_track_depth=0.0, joint_depth=0.003, patches=[], cracks=[])
    seam = outer_lane(surface) - LANE / 2.0 + 0.13
    assert surface.height(30.0, seam) == pytest.approx(-0.003)
    assert surface.height(30.0, seam + 0.03) == pytest.approx(0.0)
    left = surface.geometry.sections["left"]
    slabs = left.carriageway.pavement
    lane = float(left.lane_boundaries(30.0)[0, :2].mean())
    joint, slab = surface.height([30.0, 32.4], lane)
    assert slab - joint == pytest.approx(slabs.joint_depth, abs=2e-4)


def test_patches_and_cracks_have_their_own_heights() -> None:
    patch = {"outline": [[5.0, -5.0], [15.0, -5.0], [15.0, -3.0], [5.0, -3.0]], "height": -0.006}
    crack = {"kind": "transverse", "width": 0.02, "depth": 0.012, "lines": [[[12.0, -8.0], [12.0, -2.5]]]}
    surface = surface_of(unevenness=0.0, wheel_track_depth=0.003, joint_depth=0.002, patches=[patch], cracks=[crack])
    bare = surface_of(unevenness=0.0, wheel_track_depth=0.003, joint_depth=0.0, patches=[], cracks=[])
    assert surface.height([10.0, 12.0], [-4.0, -4.5]) == pytest.approx(-0.006)
    across = np.linspace(-7.5, -5.2, 30)
    assert surface.height(12.0, across) == pytest.approx(bare.height(12.0, across) - 0.012)
    assert surface.height(12.02, across) == pytest.approx(surface_of(
        unevenness=0.0, wheel_track_depth=0.003, joint_depth=0.002, patches=[], cracks=[]
    ).height(12.02, across))  # fmt: skip


def test_nothing_but_pavement_has_heights() -> None:
    surface = surface_of(unevenness=100.0)
    edge = float(surface.geometry.sections["right"].paved_edge(30.0)[0])
    assert surface.height([30.0, 30.0], [-edge - 0.1, 0.0]).tolist() == [0.0, 0.0]
    assert surface.height(30.0, -edge + 0.1) != 0.0


@pytest.mark.parametrize("density", [4.0, 16.0, 64.0])
def test_waves_have_the_density_of_their_class_along_and_across(density: float) -> None:
    """ISO 8608: G(n) = G(0.1) (n / 0.1)^-2, by Welch's method on lines in all directions."""
    step, count, rng = 0.125, 2048, np.random.default_rng(5)
    along, window = np.arange(count) * step, np.hanning(count)
    power = np.zeros(count // 2 + 1)
    for direction in np.linspace(0.0, np.pi, 24, endpoint=False):
        line = rng.uniform(-5000.0, 5000.0, 2) + along[:, None] * [np.cos(direction), np.sin(direction)]
        height = unevenness(line, density, 3)
        power += 2.0 * np.abs(np.fft.rfft(height * window)) ** 2 * step / (window**2).sum() / 24
    frequency = np.fft.rfftfreq(count, step)
    for low, high in ((0.08, 0.16), (0.16, 0.32), (0.32, 0.64), (0.64, 1.28)):
        band = (frequency > low) & (frequency <= high)
        expected = density * 1e-6 * (frequency[band] / 0.1) ** -2
        assert np.mean(power[band] / expected) == pytest.approx(1.0, abs=0.25), (low, high)
    assert unevenness(rng.uniform(-1e4, 1e4, (20_000, 2)), density, 3).std() == pytest.approx(
        unevenness_spread(density), rel=0.03
    )
