"""Pulses over things that move, by compiled loops: byte for byte what NumPy makes of the same rays."""

from __future__ import annotations

import platform
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from synthroads_addon.base.random_streams import stream
from synthroads_addon.scanning.beam import RINGS
from synthroads_addon.scanning.kernels.library import load_kernel
from synthroads_addon.scanning.kernels.pulses import PulseKernel, _load
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh
from tests.helpers.scenes.kernel_scenes import assert_bytes, assert_same, downwards, planned, pulses_of, soup
from tests.helpers.scenes.scan_scenes import altered, upright

pytestmark = pytest.mark.any_blender


class Turning:
    """A body that drives and turns about the vertical, and isn't there for a while."""

    def __init__(self, place: tuple[float, float, float], gone: tuple[float, float] = (9.0, 9.0)) -> None:
        self.place, self.gone = np.array(place), gone

    def pose(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rotations, places, and whether it is there."""
        place = self.place + time[:, None] * np.array([20.0, -7.0, 0.5])
        return upright(3.0 * time + 0.3), place, (time < self.gone[0]) | (time > self.gone[1])

    def passes(self, time: np.ndarray) -> np.ndarray:
        """Return that it never comes in again."""
        return np.zeros(len(time), np.int64)


def traffic(seed: int = 4) -> list[MovingMesh]:
    """Return bodies of all materials: some in the way, one far away, one that is nowhere, one without faces."""
    random, result = stream(seed, "traffic"), list[MovingMesh]()
    for number in range(6):
        place = tuple(random.uniform(-12.0, 12.0, 3))
        result.append(MovingMesh(soup(60, number, 2.5), Turning(place, (0.012, 0.022) if number % 2 else (9.0, 9.0))))
    result.append(MovingMesh(soup(40, 9, 2.0), LinearMotion((0.0, 5.0, 0.0), (1e4, 0.0, 0.0))))
    result.append(MovingMesh(soup(40, 10, 2.0), Turning((0.0, 0.0, 8.0), (-1.0, 9.0))))
    result.append(MovingMesh(soup(0), LinearMotion((0.0, 0.0, 0.0))))
    return result


@pytest.mark.parametrize("rays", RINGS)
@pytest.mark.parametrize("attenuation", [0.0, 0.02])
def test_what_moves_sends_back_the_same_bytes(rays: int, attenuation: float) -> None:
    plan, pulses = planned(soup(1200), rays, moving=traffic(), attenuation=attenuation), downwards(3001)
    echoes = assert_same(plan, pulses)
    still = assert_same(altered(plan, target=planned(soup(1200), rays).target), pulses)
    assert not np.array_equal(echoes.pulse, still.pulse)


@pytest.mark.parametrize("seed", range(8))
def test_random_traffic_and_lengths_of_blocks(seed: int) -> None:
    random = stream(seed, "settings")
    plan = planned(
        soup(int(random.integers(1, 500)), seed, random.uniform(2.0, 30.0)),
        int(random.choice(list(RINGS))),
        {"most_changes": float(random.choice([0.3, 1.0]))},
        traffic(seed),
        divergence=tuple(random.uniform(0.0, 0.3, 2)),
        minimum_range=float(random.choice([0.0, 10.0, 29.0])),
        maximum_range=float(random.choice([28.0, 35.0, 500.0])),
        range_resolution=float(random.choice([0.0, 0.1, 3.0])),
    )
    assert_same(plan, downwards(int(random.integers(2, 3000)), seed))


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 129, 5000])
def test_blocks_of_any_length(count: int) -> None:
    assert_same(planned(soup(500), 7, moving=traffic()), downwards(count))


def test_pulses_in_all_directions() -> None:
    """Bundles whose rays have nothing in common, from among the things."""
    pulses, random = downwards(4000), stream(1, "directions")
    direction = random.normal(0.0, 1.0, (3, 4000))
    direction /= np.linalg.norm(direction, axis=0)
    origin = random.uniform(-10.0, 10.0, (3, 4000))
    pulses = replace(pulses, origin=origin, direction=direction, time=np.sort(random.uniform(0.0, 0.05, 4000)))
    assert_same(planned(soup(300), 19, moving=traffic()), pulses)


def test_bodies_that_are_fast_beside_the_pulses() -> None:
    """Their way is many times their size while a bundle of pulses is fired, which all run to one spot."""
    count = 640
    down = np.repeat([[0.0], [1e-6], [-1.0]], count, axis=1)
    pulses = replace(
        pulses_of(np.repeat([[0.0], [0.0], [30.0]], count, axis=1), down), time=np.linspace(0.0, 5.0, count)
    )
    fast = [MovingMesh(soup(90, 3, 2.5), LinearMotion((90.0, 0.0, 0.0), (x, 0.0, 5.0))) for x in (-225.0, -180.0)]
    echoes = assert_same(planned(soup(5), 7, moving=fast), pulses)
    assert len(echoes.pulse) > 5


def test_only_things_that_move_are_met() -> None:
    """A static scene that no ray meets, and whose rays so go on for kilometres."""
    far = soup(5)
    far = replace(far, vertices=far.vertices + np.float32([5e4, 0, 0]))
    echoes = assert_same(planned(far, 7, moving=traffic()), downwards(3000))
    assert len(echoes.pulse) > 100


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="one version for all processors")
def test_processors_without_wide_instructions_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, pulses = planned(soup(), 7, moving=traffic()), downwards(2000)
    kernel, motions = plan.pulse_kernel, plan.target.motions(0.0, 0.02, 0.01)
    assert isinstance(kernel, PulseKernel)
    assert kernel._moving is not None
    usual, call = kernel.trace(pulses, motions)[1], load_kernel("moving").synthroads_moving_narrow
    call.restype, call.argtypes = None, kernel._moving.call.argtypes
    monkeypatch.setattr(kernel._moving, "call", call)
    narrow = SimpleNamespace(synthroads_group=_load().synthroads_group, synthroads_describe=_load().synthroads_describe)
    for name in ("cast_first", "weigh_first", "cast_behind", "weigh_behind"):
        function, known = (
            getattr(load_kernel("pulses"), f"synthroads_{name}_narrow"),
            getattr(_load(), f"synthroads_{name}"),
        )
        function.restype, function.argtypes = known.restype, known.argtypes
        setattr(narrow, f"synthroads_{name}", function)
    monkeypatch.setattr(kernel, "_kernel", narrow)
    other = kernel.trace(pulses, motions)[1]
    for name in ("pulse", "range", "intensity", "weight"):
        assert_bytes(getattr(other, name), getattr(usual, name))
