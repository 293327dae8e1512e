"""Emergency bays come back, whatever else makes the pavement wider is marked: on drawn edges and generated roads."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.cloud import read_road_cloud
from synthroads_addon.reconstruction.comparison import compare
from synthroads_addon.reconstruction.reconstruct import reconstruct
from synthroads_addon.reconstruction.section import _usual_stretches
from synthroads_addon.reconstruction.widenings import Bay, find_widenings
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import width_at
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway, Turnout
from tests.helpers.clouds.road_clouds import cloud_of, road, write

STATIONS: Float = 5.0 * np.arange(80) + 2.5
USUAL = 11.5


def trapezoid(start: float, low: float, length: float, high: float, width: float) -> Float:
    """Return how much wider the pavement of a bay is at the stations, m."""
    rising, falling = (STATIONS - start) / low, (start + low + length + high - STATIONS) / high
    return width * np.clip(np.minimum(rising, falling), 0.0, 1.0)


def section(wider: Float, solid: bool = True, side: str = "right", noise: float = 0.02) -> Any:
    """Return a dual carriageway's section of one side, its edge as far outside as usual and some more."""
    edge = USUAL + wider + np.random.default_rng(3).normal(0.0, noise, len(wider))
    line = SimpleNamespace(solid=solid, cover=np.full(len(wider), 0.9 if solid else 0.5))
    usual = np.abs(wider) < 0.1
    one = SimpleNamespace(side=side, outer_edge=SimpleNamespace(offsets=edge), usual=usual, lines=[None, line])
    return SimpleNamespace(kind="dual", sides={side: one})


def test_two_widenings_between_which_the_pavement_never_closes_are_one() -> None:
    edge = trapezoid(100.0, 40.0, 40.0, 20.0, 3.5) + trapezoid(205.0, 20.0, 40.0, 40.0, 3.5)
    edge = np.where((STATIONS > 140.0) & (STATIONS < 260.0), np.maximum(edge, 0.4), edge)
    bays, (one,) = find_widenings(section(edge, solid=False), STATIONS)
    assert bays == []
    assert (one.start, one.end) == pytest.approx((100.0, 305.0), abs=10.0)
    assert one.wider_by > 2.5
    apart = np.where((STATIONS > 195.0) & (STATIONS < 210.0), 0.0, edge)
    assert len(find_widenings(section(apart, solid=False), STATIONS)[1]) == 2


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_bay_is_measured(side: str) -> None:
    ((bay,), others) = find_widenings(section(trapezoid(150.0, 20.0, 45.0, 30.0, 3.0), side=side), STATIONS)
    assert others == []
    assert bay.side == side
    assert bay.width == pytest.approx(3.0, abs=0.03)
    assert bay.width_std < 0.03
    assert (bay.start, bay.end) == pytest.approx((150.0, 245.0), abs=1.5)
    assert (bay.low_taper, bay.high_taper) == pytest.approx((20.0, 30.0), abs=2.0)


@pytest.mark.parametrize(
    ("wider", "solid", "by"),
    [
        (np.where(STATIONS > 200.0, 3.5, 0.0), True, 3.5),
        (np.where(STATIONS < 120.0, -3.5, 0.0), True, -3.5),
        (trapezoid(150.0, 20.0, 45.0, 30.0, 3.0), False, 3.0),
        (trapezoid(100.0, 60.0, 1.0, 1.0, 6.0), True, 3.3),
    ],
    ids=["a lane is gained", "a lane is missing", "beside a dashed line", "an exit"],
)
def test_whatever_else_is_wider_is_marked(wider: Float, solid: bool, by: float) -> None:
    bays, (other,) = find_widenings(section(wider, solid), STATIONS)
    assert bays == []
    assert other.wider_by == pytest.approx(by, abs=0.6)
    inside = np.abs(wider) > 0.1  # with its tapers, and a stretch more to either side
    assert other.start == pytest.approx(max(STATIONS[inside][0] - 7.5, 0.0), abs=7.5)
    assert other.end == pytest.approx(min(STATIONS[inside][-1] + 7.5, 400.0), abs=7.5)
    assert np.isin(np.flatnonzero(inside), np.flatnonzero((other.start < STATIONS) & (other.end > STATIONS))).all()


def test_an_entrys_lane_is_no_bay_however_solid_the_line_beside_it() -> None:
    bays, (other,) = find_widenings(section(trapezoid(60.0, 30.0, 250.0, 30.0, 3.0)), STATIONS)
    assert bays == []
    assert other.wider_by == pytest.approx(3.0, abs=0.1)


def test_a_bays_width_is_surest_where_it_is_full_and_its_tapers_are_as_unsure_as_their_stations() -> None:
    ((bay,), _) = find_widenings(section(trapezoid(150.0, 20.0, 45.0, 30.0, 3.0)), STATIONS)
    std = bay.std_at(np.array([100.0, 160.0, 190.0, 230.0]))
    assert std[0] == 0.0
    assert std[2] == pytest.approx(bay.width_std, abs=1e-6)
    assert min(std[1], std[3]) > 2.0 * std[2]
    off = bay_error(bay, trapezoid(150.0, 20.0, 45.0, 30.0, 3.0))
    assert np.mean(off < 3.0 * np.maximum(bay.std_at(STATIONS), 1e-9)) > 0.98


def bay_error(bay: Bay, true: Float) -> Float:
    """Return how far a bay's width is from the true one at the stations, m."""
    found = trapezoid(bay.start, bay.low_taper, bay.end - bay.start - bay.low_taper - bay.high_taper, bay.high_taper, 1)
    return np.abs(bay.width * found - true)


def test_a_short_fault_or_a_slight_one_is_nothing() -> None:
    fault = np.where(np.abs(STATIONS - 200.0) < 7.0, 3.0, 0.0)
    for wider in (fault, np.full(80, 0.0), trapezoid(100.0, 20.0, 60.0, 20.0, 0.5)):
        assert find_widenings(section(wider), STATIONS) == ([], [])


def test_the_usual_width_is_that_beside_turnouts_even_where_these_are_longer() -> None:
    outside = np.where((STATIONS > 80.0) & (STATIONS < 330.0), 6.5, 3.5)
    usual = _usual_stretches(outside, None)
    assert np.array_equal(usual, outside < 4.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_generated_bays_and_lane_changes_come_back_or_are_marked(tmp_path: Path, seed: int) -> None:
    limits = {"turnouts": {"exits": 0.0, "entries": 0.0, "emergency_bays": 1.0}, "lane_changes": {"share": 0.5}}
    truth = road(("RQ31", "RQ36", "RQ31")[seed - 1], "EKA1A", 500.0, seed, **limits)
    found = reconstruct(read_road_cloud(write(tmp_path / "cloud.laz", cloud_of(truth, 12.0, seed))))
    off = compare(found.parameters, truth)
    assert off["centreline"]["largest"] < 0.10
    turned = _runs_backwards(found.parameters, truth)  # a road found in a cloud runs to the east
    marked = {_side(doubt.reasons[0].split(":")[0], turned) for doubt in found.judgement.sections}
    true = {item.carriageway.partition("-")[2]: item for item in truth.of_type(Turnout).values()}
    bays = {
        _side(item.carriageway.partition("-")[2], turned): item for item in found.parameters.of_type(Turnout).values()
    }
    for one in truth.of_type(Carriageway).values():
        changes = any(np.ptp(width_at(lane.width, np.array([0.0, 1e5]))) > 1.0 for lane in one.lanes)
        if changes:
            assert one.side in marked
            continue
        side = found.measured.section.sides["left" if _side(one.side, turned) == "left" else "right"]
        assert side.shoulder.value == pytest.approx(float(width_at(one.hard_shoulder_width, 0.0)), abs=0.15)
        if one.side in true and one.side not in marked:
            assert bays[one.side].lane_width == pytest.approx(true[one.side].lane_width, abs=0.05)
            lengths = ("taper_in_length", "lane_length", "taper_out_length")
            assert sum(getattr(bays[one.side], name) for name in lengths) == pytest.approx(
                true[one.side].length, abs=6.0
            )


def _runs_backwards(found: RoadParameters, truth: RoadParameters) -> bool:
    """Return whether a found road begins where the true one ends."""
    there, here = RoadGeometry(truth), RoadGeometry(found)
    ends = there.alignment.position(np.array([0.0, there.length])) + truth.transform.translate[:2]
    begin = here.alignment.position(np.array([0.0]))[0] + found.transform.translate[:2]
    away = np.hypot(*(ends - begin).T)
    return bool(away[1] < away[0])


def _side(side: str, turned: bool) -> str:
    """Return a found road's side as the true one's."""
    return {"left": "right", "right": "left"}[side] if turned else side
