"""Roads that brightness alone doesn't tell: grey medians, collectors, streets without paint, cut strips."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.reconstruction.carriageways import compare, measure, totals
from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.reconstruction.axis import FoundRoad, Options, learned_along, straighten_path
from synthroads_addon.reconstruction.centreline import Centreline, find_centreline
from synthroads_addon.reconstruction.cloud import RoadCloud, read_road_cloud
from synthroads_addon.reconstruction.ground.band import find_band
from synthroads_addon.reconstruction.ground.medians import find_medians
from synthroads_addon.reconstruction.ground.paved import lines_on_pavement
from synthroads_addon.reconstruction.ground.strips import find_strips
from synthroads_addon.reconstruction.judgement import judge, paint_slope
from synthroads_addon.reconstruction.layout import find_layout
from synthroads_addon.reconstruction.lines import Line, find_lines, is_dashed
from synthroads_addon.reconstruction.path import CloudPath
from synthroads_addon.reconstruction.profiles import Profiles, make_profiles
from synthroads_addon.reconstruction.reconstruct import reconstruct
from synthroads_addon.reconstruction.views.look import rule_views
from synthroads_addon.reconstruction.views.pavement import pavement_edges
from synthroads_addon.reconstruction.views.vote import axis_from_lines
from tests.helpers.clouds.foreign_clouds import EAST, NORTH, axis_north
from tests.helpers.clouds.hard_roads import ASPHALT, HardRoad, carriageway, motorway, rural, street
from tests.helpers.clouds.survey_faults import SurveyFaults
from tests.helpers.clouds.thrown_roads import KINDS, MOTORWAYS, thrown_road, true_counts

WINDOW = 50.0
"""Length, m, over which the axis is compared with its views."""
_LEFT_AT = 120.0
"""Station, m, at which a path leaves the axis."""


def found_on(road: HardRoad, folder: Path) -> tuple[Centreline, RoadCloud]:
    """Return the centreline found in a road's cloud, and the cloud."""
    cloud = read_road_cloud(road.write(folder))
    return find_centreline(cloud), cloud


def errors(found: Centreline, cloud: RoadCloud, road: HardRoad) -> tuple[Float, Float]:
    """Return stations (M,) and how far north of the road's axis a centreline's vertices lie, m, less both ends."""
    points = found.path.points + cloud.origin[:2]
    station = points[:, 0] - EAST
    keep = (station > 5.0) & (station < road.length - 5.0)
    return station[keep], (points[:, 1] - NORTH - axis_north(station, road.slant, road.length))[keep]


def profiles_of(road: HardRoad, folder: Path, slope: float = 0.0) -> Profiles:
    """Return profiles along a road's true axis, or along a path that leaves it at `_LEFT_AT` with a slope (m per m)."""
    cloud = read_road_cloud(road.write(folder))
    station = np.arange(0.0, road.length, 1.0)
    north = axis_north(station, road.slant, road.length) + slope * np.clip(station - _LEFT_AT, 0.0, None)
    points = np.column_stack([EAST + station, NORTH + north]) - cloud.origin[:2]
    heading = np.arctan2(*np.gradient(points, axis=0).T[::-1])
    return make_profiles(cloud, CloudPath(points, heading), road.reach, keep_points=True)


@pytest.mark.parametrize(
    "road",
    [
        motorway(11, decibel=2.5),
        motorway(12, decibel=0.8).cut_by(0.4),
        pytest.param(motorway(13, decibel=3.0, exit_from=60.0), marks=pytest.mark.slow),
        pytest.param(motorway(14, third=True).cut_by(0.3), marks=pytest.mark.slow),
    ],
    ids=lambda road: f"{road.name} {road.seed}",
)
def test_a_narrow_grey_median_parts_two_carriageways(tmp_path: Path, road: HardRoad) -> None:
    found, cloud = found_on(road, tmp_path)
    assert found.kind == "dual"
    assert np.abs(errors(found, cloud, road)[1]).max() < 0.3
    assert found.judgement.trusted > 0.85
    figures = compare(found, cloud, road)
    assert figures.main == figures.plain
    assert figures.counted > 0.9 * figures.plain


@pytest.mark.parametrize("decibel", [0.5, 2.5, 3.7])
def test_a_median_is_likely_all_along_by_lines_and_ground(tmp_path: Path, decibel: float) -> None:
    road = motorway(15, decibel=decibel)
    profiles = profiles_of(road, tmp_path)
    (median,) = find_medians(profiles, find_lines(profiles))
    assert 0.5 * (median.low + median.high) == pytest.approx(0.0, abs=0.1)
    assert (median.left.offset - median.right.offset) == pytest.approx(road.marks["median"] + 1.0, abs=0.1)
    assert median.odds.min() > 0.0
    layout = find_layout(profiles, find_lines(profiles))
    assert layout.parted is not None
    assert layout.parted.min() > 0.5


def test_a_single_carriageway_has_no_median(tmp_path: Path) -> None:
    for road in (rural(11), street(11)):
        profiles = profiles_of(road, tmp_path)
        lines = find_lines(profiles)
        layout = find_layout(profiles, lines)
        assert layout.kind == "single"
        assert layout.parted is not None
        assert layout.parted.max() < 0.5


@pytest.mark.parametrize("road", [street(12), street(13).cut_by(0.4)], ids=["whole", "cut"])
def test_a_street_without_paint_is_its_dark_band(tmp_path: Path, road: HardRoad) -> None:
    band = find_band(profiles_of(road, tmp_path))
    assert band.seen > 0.9
    for edge, place in ((band.right, -road.marks["half"]), (band.left, road.marks["half"])):
        assert edge[np.isfinite(edge)] == pytest.approx(place, abs=0.25)
    found, cloud = found_on(road, tmp_path)
    assert found.kind == "single"
    assert np.abs(errors(found, cloud, road)[1]).max() < 0.3
    assert found.judgement.trusted > 0.85


@pytest.mark.parametrize("seed", [1, 11, pytest.param(12, marks=pytest.mark.slow)])
def test_lines_that_agree_are_trusted_where_the_pavement_is_cut_off(tmp_path: Path, seed: int) -> None:
    road = rural(seed).cut_by(0.75)
    found, cloud = found_on(road, tmp_path)
    assert np.abs(errors(found, cloud, road)[1]).max() < 0.3
    assert found.judgement.trusted > 0.85


@pytest.mark.slow
@pytest.mark.parametrize(
    "road",
    [
        motorway(21).cut_by(0.5),
        motorway(22, exit_from=60.0),
        street(21),
        street(22).cut_by(0.5),
        rural(21).cut_by(0.75),
    ],
    ids=lambda road: f"{road.name} {road.seed}",
)
def test_the_axis_is_hardly_worse_than_its_best_view(tmp_path: Path, road: HardRoad) -> None:
    found, cloud = found_on(road, tmp_path)
    station, error = errors(found, cloud, road)
    offset = found.axis.stations - found.axis.stations[0] + station[0]  # to some metres: errors change slowly
    for start in np.arange(5.0, road.length - WINDOW, WINDOW):
        own = np.abs(error[(station >= start) & (station < start + WINDOW)]).mean()
        inside = (offset >= start) & (offset < start + WINDOW)
        views = []
        for view in found.axis.views:
            difference = (view.offsets - found.axis.offsets)[inside]
            if np.isfinite(difference).mean() > 0.8:
                of_view = np.interp(offset[inside], station, error) + difference
                views.append(float(np.nanmean(np.abs(of_view))))
        # 5 cm, half a bin, are no loss: which of several views within a bin is nearest is chance.
        assert own <= 1.1 * min(views) + 0.05


@pytest.mark.parametrize("kind", MOTORWAYS)
def test_carriageways_and_ramps_are_counted_by_stretch(tmp_path: Path, kind: str) -> None:
    for seed in (2, 6):
        road = thrown_road(kind, seed)
        profiles = profiles_of(road, tmp_path)
        layout = find_layout(profiles, find_lines(profiles))
        assert layout.kind == "dual"
        strips = find_strips(layout.pavement, layout.bands[0].low, layout.bands[-1].high)
        carriageways, ramps, plain = true_counts(road, profiles.middles)
        zeros = np.zeros(profiles.stretches, dtype=np.int64)
        more, other = (
            sum((strip.present for strip in strips if (strip.ramp > 0.5) == is_ramp), zeros)
            for is_ramp in (False, True)
        )
        assert ((2 + more == carriageways) & (other == ramps))[plain].mean() > 0.95
        for strip in strips:
            assert strip.probability[strip.present].mean() > 0.6


def test_of_three_carriageways_alike_neither_pair_is_trusted(tmp_path: Path) -> None:
    sides = [carriageway(-1.5, 2, 3.5, 1.5, -1), carriageway(1.5, 2, 3.5, 1.5, 1), carriageway(12.5, 2, 3.5, 1.5, 1)]
    grounds, lines = tuple(side[0] for side in sides), tuple(line for side in sides for line in side[1])
    alike = HardRoad("three alike", grounds, lines, 25.0, carriageways=3, seed=4)
    profiles = profiles_of(alike, tmp_path)
    layout = find_layout(profiles, find_lines(profiles))
    assert layout.has_rival
    assert judge(layout, [0.5 * (band.low + band.high) for band in layout.bands]).trusted == 0.0
    profiles = profiles_of(thrown_road("narrow median", 2), tmp_path)
    assert not find_layout(profiles, find_lines(profiles)).has_rival


@pytest.mark.parametrize("seed", [41, 44, 50])
def test_of_three_carriageways_those_with_lanes_alike_are_the_road(tmp_path: Path, seed: int) -> None:
    profiles = profiles_of(thrown_road("three carriageways", seed), tmp_path)
    layout = find_layout(profiles, find_lines(profiles))
    assert 0.5 * (layout.bands[0].high + layout.bands[1].low) == pytest.approx(0.0, abs=0.2)
    assert not layout.has_rival


def test_symmetry_of_three_carriageways_is_unsure(tmp_path: Path) -> None:
    profiles = profiles_of(thrown_road("three carriageways", 41), tmp_path)
    layout = find_layout(profiles, find_lines(profiles))
    (view,) = [view for view in rule_views(layout, axis_from_lines(layout)) if view.name == "cross-profile"]
    seen = np.isfinite(view.offsets)
    assert seen.any()
    assert view.std[seen].min() > 4.0


def test_a_carriageway_that_begins_beside_the_road_is_counted(tmp_path: Path) -> None:
    road = thrown_road("three carriageways", 43)
    found, cloud = found_on(road, tmp_path)
    figures = compare(found, cloud, road)
    assert figures.counted > 0.9 * figures.plain


def test_a_path_is_laid_beside_lines_to_its_ends(tmp_path: Path) -> None:
    # The cloud is cut anew at 100 m: the first path follows its middle and leaves the road at an angle of 0.4.
    road = thrown_road("exit", 41)
    cloud = read_road_cloud(road.write(tmp_path))
    path, _ = straighten_path(cloud, Options())
    points = path.points + cloud.origin[:2]
    station = points[:, 0] - EAST
    beside = points[:, 1] - NORTH - axis_north(station, road.slant, road.length)
    assert np.ptp(beside[(station > 5.0) & (station < 145.0)]) < 1.0


@pytest.mark.parametrize("slope", [0.0, 0.2, 0.4])
def test_an_axis_that_leaves_the_lines_is_doubted(tmp_path: Path, slope: float) -> None:
    road = thrown_road("exit", 41)
    profiles = profiles_of(road, tmp_path, slope)
    layout = find_layout(profiles, find_lines(profiles))
    beyond = profiles.middles > _LEFT_AT + 15.0
    assert paint_slope(layout)[~beyond & (profiles.middles < _LEFT_AT - 10.0)] == pytest.approx(0.0)
    assert paint_slope(layout)[beyond] == pytest.approx(-slope, abs=0.03)
    doubts = judge(layout, [0.5 * (band.low + band.high) for band in layout.bands]).doubts
    assert any("paint runs" in reason for doubt in doubts for reason in doubt.reasons) == (slope > 0.0)


def test_only_dashes_with_a_lane_on_either_side_speak_against_a_median(tmp_path: Path) -> None:
    profiles = profiles_of(motorway(15, decibel=1.5), tmp_path)
    lines = find_lines(profiles)
    (median,) = find_medians(profiles, lines)
    dashed = next(line for line in lines if is_dashed(line))
    fault = replace(dashed, offsets=median.left.offsets - 0.9, measured=median.left.measured - 0.9)
    assert len(find_medians(profiles, [*lines, fault])) == 1
    framed = next(line for line in lines if line.offset > 2.0 and is_dashed(line))
    others = [line for line in lines if line is not framed]
    (unframed,) = find_medians(profiles, [*others, replace(framed, dash=8.2, gap=8.7)])
    assert unframed.total < median.total - 3.0
    wide = replace(median.left, offsets=median.right.offsets + 7.2, measured=median.right.measured + 7.2)
    between = replace(dashed, offsets=median.right.offsets + 3.6, measured=median.right.measured + 3.6)
    beyond = replace(dashed, offsets=wide.offsets + 3.6, measured=wide.measured + 3.6)
    right_lines = [line for line in lines if line.offset <= median.right.offset]
    assert find_medians(profiles, [*right_lines, between, wide, beyond]) == []


def test_each_kind_of_evidence_moves_a_medians_odds(tmp_path: Path) -> None:
    road = motorway(15, decibel=0.0)
    profiles = profiles_of(road, tmp_path)
    lines = find_lines(profiles)
    (median,) = find_medians(profiles, lines)
    left_dashes = next(line for line in lines if line.offset > 2.0 and is_dashed(line))
    others = [line for line in lines if line is not left_dashes]

    def odds(profiles: Profiles, lines: list[Line]) -> float:
        return sum(one.total for one in find_medians(profiles, lines) if abs(one.low.mean() + one.high.mean()) < 1.0)

    assert odds(profiles, lines) == pytest.approx(median.total)
    shifted = replace(left_dashes, first_dash=left_dashes.first_dash + 5.0)
    assert odds(profiles, [*others, shifted]) == pytest.approx(median.total + 1.0)
    longer = replace(left_dashes, dash=4.0, gap=8.0)
    assert odds(profiles, [*others, longer]) == pytest.approx(median.total + 1.5)
    unlike = replace(left_dashes, offsets=left_dashes.offsets + 0.6)
    assert odds(profiles, [*others, unlike]) < median.total - 0.2
    inside = (profiles.offsets > -1.0) & (profiles.offsets < 1.0)
    unpaved, paved = (np.where(inside, share, 1.0) * np.ones(profiles.count.shape) for share in (0.2, 1.0))
    by_class, against = (replace(profiles, paved=share.astype(np.float32)) for share in (unpaved, paved))
    assert odds(by_class, lines) > median.total + 2.0
    assert odds(against, lines) < median.total - 2.0


def test_a_networks_axis_is_one_view_of_a_median(tmp_path: Path) -> None:
    road = motorway(15, decibel=0.0)
    profiles = profiles_of(road, tmp_path)
    lines = find_lines(profiles)
    (median,) = find_medians(profiles, lines)
    along = profiles.path.place(profiles.path.stations, np.zeros(len(profiles.path.points)))
    beside = profiles.path.place(profiles.path.stations, np.full(len(profiles.path.points), 6.0))
    for points, change in ((along, 1.5), (beside, -0.7)):
        (seen,) = find_medians(profiles, lines, learned_along(points, profiles))
        assert seen.total == pytest.approx(median.total + change, abs=0.01)
    half = learned_along(along[: len(along) // 2], profiles)
    assert half is not None
    assert half[0] == pytest.approx(0.0, abs=0.01)
    assert np.isnan(half[-1])
    (seen,) = find_medians(profiles, lines, half)
    assert seen.odds[-1] == pytest.approx(median.odds[-1])
    # What it sees along the first path counts in every look.
    cloud = read_road_cloud(road.write(tmp_path))

    def predict(_: RoadCloud, path: CloudPath) -> tuple[Float, Float]:
        offsets = path.project(profiles.path.points)
        return np.interp(path.stations, *offsets), np.full(len(path.points), 0.1)

    parted, by_network = (find_centreline(cloud, Options(predictor=predictor)).parted for predictor in (None, predict))
    assert parted is not None
    assert by_network is not None
    assert by_network.min() > parted.min()


def test_a_median_whose_guardrail_was_cut_out_is_one(tmp_path: Path) -> None:
    # Without verges, whose brightness would hide the median's.
    road = replace(motorway(18, decibel=2.5), faults=SurveyFaults(rails=((-0.3, 0.3),)), reach=11.0)
    right, left = pavement_edges(profiles_of(road, tmp_path), [-6.0, 6.0], True)
    assert 0.5 * (right + left) == pytest.approx(np.zeros(len(right)), abs=0.3)


def test_a_kerb_alone_is_no_median(tmp_path: Path) -> None:
    # A raised median as bright as the pavement: kerbs on both sides of it, the left one nearer to the profiles' middle.
    road = motorway(18, decibel=0.0)
    raised = replace(road.grounds[2], low=-2.5, high=1.2, level=ASPHALT, rough=0.004, height=0.1)
    profiles = profiles_of(replace(road, name="raised", grounds=(*road.grounds[:2], raised), reach=11.0), tmp_path)
    right, left = pavement_edges(profiles, [-6.0, 6.0], True)
    assert not np.any(np.abs(0.5 * (right + left) - 1.2) < 0.3)


def test_bright_strips_in_rough_ground_are_no_lines(tmp_path: Path) -> None:
    profiles = profiles_of(thrown_road("street", 1), tmp_path)
    lines = find_lines(profiles)
    kept = lines_on_pavement(profiles, lines)
    assert max(abs(line.offset) for line in lines) > 8.0
    assert max(abs(line.offset) for line in kept) < 6.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_thrown_roads_are_told_or_doubted(tmp_path: Path, kind: str) -> None:
    shares = totals([measure(thrown_road(kind, seed), tmp_path) for seed in (201, 202)])
    assert shares["counted"] > 90.0
    assert shares["near_or_doubted"] > 95.0
    assert shares["silent"] <= 0.2


def test_an_error_names_only_what_was_given(tmp_path: Path) -> None:
    profiles = profiles_of(rural(11), tmp_path)
    lines = find_lines(profiles)
    with pytest.raises(InputError, match="--road is 'dual'"):
        find_layout(profiles, lines, "dual")
    with pytest.raises(InputError, match=r"^road: two carriageways .* --road single or --road dual"):
        find_layout(profiles, lines, "dual", asked=False)


@pytest.mark.slow
def test_a_motorway_with_an_exit_and_a_grey_median_is_reconstructed(tmp_path: Path) -> None:
    cloud = read_road_cloud(motorway(16, decibel=3.0, exit_from=60.0).write(tmp_path))
    reconstruction = reconstruct(cloud)
    road: FoundRoad = reconstruction.carriageways.course.road
    assert road.asked is None
    assert road.layout.kind == "dual"
