"""Points of echoes by compiled loops: byte for byte those of NumPy, with what is known of where they were seen."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from synthroads_addon.base.arithmetic.loops import EchoPlaces, loops_by
from synthroads_addon.scanning.kernels.points import CompiledPoints
from synthroads_addon.scanning.noise import Noise
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scan import BlockResult, BlockScan
from tests.helpers.scenes.kernel_scenes import planned, soup

pytestmark = pytest.mark.any_blender

SUN = np.array([0.48, -0.36, 0.8])
LAYERS = frozenset({"normal", "material", "true_range", "true_xyz", "scanner", "damage", "power_db"})
NOISY = Noise(range_bias=0.02, range_sigma=0.01, angle_sigma_mrad=1.0, position_sigma=0.02, heading_sigma_deg=0.05)


def scanned(plan: ScanPlan, loops: CompiledPoints | None) -> BlockResult:
    """Return a block of a plan by these loops, or by NumPy."""
    plan = replace(plan)
    vars(plan)["point_loops"] = loops
    with loops_by(loops):
        return BlockScan(plan).scan_pulses(plan.path.strips[0], 7000, 20_000)


def assert_alike(found: BlockResult, expected: BlockResult) -> None:
    """Assert that two blocks have the same bytes."""
    mine, theirs = found.points.attributes(), expected.points.attributes()
    assert mine.keys() == theirs.keys()
    pairs = [(name, mine[name], theirs[name]) for name in mine]
    assert (found.seen is None) is (expected.seen is None)
    if found.seen is not None and expected.seen is not None:
        pairs += [
            (one.name, getattr(found.seen, one.name), getattr(expected.seen, one.name)) for one in fields(found.seen)
        ]
    for name, one, other in pairs:
        assert (one is None) is (other is None), name
        if one is not None and other is not None:
            assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes()), name


@pytest.mark.parametrize("rays", [1, 7])
@pytest.mark.parametrize("noise", [Noise(), NOISY])
@pytest.mark.parametrize("layers", [LAYERS, frozenset(), frozenset({"material"})])
@pytest.mark.parametrize("seen", [True, False])
def test_points_of_echoes(
    monkeypatch: pytest.MonkeyPatch, loops: CompiledPoints, rays: int, noise: Noise, layers: frozenset[str], seen: bool
) -> None:
    monkeypatch.setattr(ScanPlan, "sun", property(lambda _: SUN))
    changes = {"noise": noise, "measured": layers, "seen_points": seen, "epoch": 1234.5}
    plan = planned(soup(3000), rays, **changes)
    found, expected = (scanned(plan, one) for one in (loops, None))
    assert len(found.points) > 1000
    assert_alike(found, expected)
    if seen:
        assert found.seen is not None
        assert found.seen.sunlit is not None
        assert 0.05 < found.seen.sunlit.mean() < 0.95


def test_echoes_of_beams_side_by_side(loops: CompiledPoints) -> None:
    plan = planned(soup(3000), 7, beam="cylindrical", measured=LAYERS, seen_points=True)
    found, expected = (scanned(plan, one) for one in (loops, None))
    assert len(found.points) > 1000
    assert_alike(found, expected)


@pytest.mark.parametrize("name", ["pulse", "hit", "face"])
@pytest.mark.parametrize("number", [-1, 5])
def test_what_is_not_there_is_refused(loops: CompiledPoints, name: str, number: int) -> None:
    five, vectors, none = np.zeros(5), np.zeros((3, 5)), np.zeros(5, np.int64)
    echoes = EchoPlaces(
        *(none, none, five, none, five, five, vectors, None, five, five, vectors, vectors, vectors),
        *(np.zeros((5, 4)), np.zeros(5, np.uint8), np.zeros(5, np.uint32), np.zeros(5, np.uint16), np.zeros(3), 0.0),
    )
    assert len(loops.placed(echoes, with_seen=True).xyz) == 5
    with pytest.raises(IndexError, match="of 5 isn't there"):
        loops.placed(echoes._replace(**{name: np.full(5, number)}), with_seen=True)
    few = dict.fromkeys(("class_id", "instance_id", "material"), np.zeros(4, np.uint8))
    with pytest.raises(ValueError, match="class_id"):
        loops.placed(echoes._replace(**few), with_seen=True)
