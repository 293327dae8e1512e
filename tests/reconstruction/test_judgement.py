"""A reconstruction says where it isn't to be trusted: on drawn profiles, on thrown clouds, and on real scans."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.arrays import Float
from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError
from synthroads_addon.reconstruction.cloud import read_road_cloud
from synthroads_addon.reconstruction.country.one_sided import OneSided
from synthroads_addon.reconstruction.edges import Pavement
from synthroads_addon.reconstruction.judgement import Judgement, judge
from synthroads_addon.reconstruction.layout import Band, RoadLayout
from synthroads_addon.reconstruction.lines import Line
from synthroads_addon.reconstruction.path import CloudPath
from synthroads_addon.reconstruction.profiles import Profiles
from synthroads_addon.reconstruction.reconstruct import Reconstruction, reconstruct
from synthroads_addon.road.axes.centerline import read_axis
from synthroads_addon.road.geometry import RoadGeometry
from tests.helpers.clouds.road_clouds import block_of, write

REAL = sorted((Path(__file__).resolve().parents[2].parent / "shared" / "real").glob("als_*_axis.csv"))
ROWS = 200
Across = Callable[[Float, Float, np.random.Generator], tuple[Float, Float]]
"""Heights and brightness of points at offsets and stations (N,)."""


# --- drawn profiles --------------------------------------------------------------------------------------------------


def profiles(
    pavement: list[tuple[float, float]], half: float = 15.0, kerb: float = 0.0, grass: float = 0.5
) -> Profiles:
    """Return 200 m of profiles with pavement between some offsets, and ground of a brightness as high as a kerb."""
    offsets = 0.1 * (np.arange(round(20.0 * half)) + 0.5) - half
    rng = np.random.default_rng(1)
    paved = np.any([(offsets > low) & (offsets < high) for low, high in pavement], axis=0)
    shape = (ROWS, len(offsets))
    brightness = np.where(paved, 0.2, grass) + rng.normal(0.0, 0.02, shape)
    height = np.where(paved, 0.0, kerb) + rng.normal(0.0, 0.005, shape)
    path = CloudPath(np.column_stack([np.arange(ROWS + 1.0), np.zeros(ROWS + 1)]), np.zeros(ROWS + 1))
    grids = [np.ones(shape), np.zeros(shape), None, height, brightness]
    return Profiles(path, np.arange(ROWS) + 0.5, offsets, *grids)  # type: ignore[arg-type]


def line(offset: float | Float, width: float = 0.12) -> Line:
    """Return a line, or an edge as a line where it has no width, at an offset or offsets (40,)."""
    measured = np.broadcast_to(np.asarray(offset, dtype=float), (ROWS // 5,))
    zeros = np.zeros(ROWS // 5)
    return Line(5.0 * np.arange(ROWS // 5) + 2.5, measured, measured, zeros, zeros, zeros, 0.0, float(ROWS), width)


def judged(ground: Profiles, *guides: Line) -> Judgement:
    """Return what is said of an axis made from one line in the middle, or from the inner ones of two carriageways."""
    if len(guides) == 1:
        bands = (Band(-4.0, 4.0, [guides[0]], (line(-4.0, 0.0), line(4.0, 0.0))),)
        return judge(RoadLayout("single", bands, Pavement(ground, ground.count), ()), [0.0])
    right, left = guides
    bands = (Band(-12.0, -2.0, [right], (line(-12.0, 0.0), right)), Band(2.0, 12.0, [left], (left, line(12.0, 0.0))))
    return judge(RoadLayout("dual", bands, Pavement(ground, ground.count), ()), [-7.0, 7.0])


def reasons(judgement: Judgement) -> set[str]:
    """Return the beginnings of all that is said against it."""
    return {reason[:19] for doubt in judgement.doubts for reason in doubt.reasons}


@pytest.mark.parametrize(("kerb", "grass"), [(0.0, 0.5), (0.1, 0.2), (0.1, 0.5)])
def test_an_axis_in_the_pavements_middle_is_trusted(kerb: float, grass: float) -> None:
    for shift in (-0.5, 0.0, 0.5):
        found = judged(profiles([(shift - 3.5, shift + 3.5)], kerb=kerb, grass=grass), line(0.0))
        assert (found.doubts, found.trusted) == ([], 1.0)
        assert found.middles == pytest.approx(shift, abs=0.15)


@pytest.mark.parametrize(("kerb", "grass"), [(0.0, 0.5), (0.1, 0.2)])
@pytest.mark.parametrize("shift", [-3.4, -1.0, 1.0, 3.4])
def test_an_axis_beside_the_pavements_middle_is_not(shift: float, kerb: float, grass: float) -> None:
    found = judged(profiles([(shift - 3.5, shift + 3.5)], kerb=kerb, grass=grass), line(0.0))
    assert [(doubt.start, doubt.end) for doubt in found.doubts] == [(0.0, 199.5)]
    assert reasons(found) == {"the pavement's midd"}
    assert found.trusted == 0.0


@pytest.mark.parametrize(("half", "is_trusted"), [(4.0, True), (6.25, False)])
def test_on_pavement_of_three_lanes_the_middle_may_not_be_the_axis(half: float, is_trusted: bool) -> None:
    """Without a line between the directions nothing says which of them has two lanes."""
    ground = profiles([(-half, half)])
    band = Band(-half, half, [line(-half + 0.4), line(half - 0.4)], (line(-half, 0.0), line(half, 0.0)))
    judgement = judge(RoadLayout("single", (band,), Pavement(ground, ground.count), ()), [0.0])
    assert (judgement.trusted > 0.95) == is_trusted
    assert any("three lanes" in reason for doubt in judgement.doubts for reason in doubt.reasons) != is_trusted


@pytest.mark.parametrize(("offset", "is_trusted"), [(0.0, True), (-1.1, False)])
def test_a_line_beside_the_middle_of_such_pavement_parts_no_directions_for_sure(
    offset: float, is_trusted: bool
) -> None:
    """It may as well part two lanes of one direction, or be one of two lines of which the other is worn off."""
    ground = profiles([(-6.25, 6.25)])
    lines = [line(-5.85), line(offset), line(5.85)]
    band = Band(-6.25, 6.25, lines, (line(-6.25, 0.0), line(6.25, 0.0)))
    judgement = judge(RoadLayout("single", (band,), Pavement(ground, ground.count), ()), [0.0])
    assert any("three lanes" in reason for doubt in judgement.doubts for reason in doubt.reasons) != is_trusted


def test_an_edge_must_be_seen_on_both_sides() -> None:
    assert reasons(judged(profiles([(-3.5, 3.5)], half=3.4), line(0.0))) == {"the pavement's edge"}
    assert reasons(judged(profiles([(-3.5, 15.0)]), line(0.0))) == {"the pavement's edge"}
    nothing_differs = judged(profiles([(-3.5, 3.5)], grass=0.2), line(0.0))
    assert reasons(nothing_differs) == {"the pavement's edge"}


def test_where_nothing_is_seen_for_long_the_axis_is_guessed() -> None:
    ground, offsets = profiles([(-3.5, 3.5)]), np.zeros(ROWS // 5)
    offsets[15:22] = np.nan  # 35 m
    assert judged(ground, line(offsets)).doubts == []
    offsets[10:30] = np.nan  # 100 m: what is seen before and behind it is too far away
    (doubt,) = judged(ground, line(offsets)).doubts
    assert (doubt.start, doubt.end) == (60.0, 140.0)
    assert doubt.reasons == ("neither lines nor edges are seen",)


def test_lines_must_agree_with_the_axis() -> None:
    offsets = np.zeros(ROWS // 5)
    offsets[10:20] = 0.6
    (doubt,) = judged(profiles([(-3.5, 3.5)]), line(offsets)).doubts
    assert (doubt.start, doubt.end) == (40.0, 110.0)
    assert doubt.reasons == ("the lines lie more than 0.5 m beside it",)
    offsets[10:20] = 0.4
    assert judged(profiles([(-3.5, 3.5)]), line(offsets)).doubts == []


def test_a_dual_carriageways_axis_lies_in_the_medians_middle() -> None:
    for shift, doubts in ((0.0, set()), (0.6, set()), (1.0, {"the median's middle"})):
        ground = profiles([(-12.0, shift - 2.0), (shift + 2.0, 12.0)])
        assert reasons(judged(ground, line(-2.5), line(2.5))) == doubts


def test_where_the_median_is_paved_the_lines_beside_it_must_do() -> None:
    ground = profiles([(-12.0, 12.0)])
    assert judged(ground, line(-2.5), line(2.5)).doubts == []
    assert reasons(judged(ground, line(-2.5), line(2.5, 0.0))) == {"neither the median'"}


def test_where_the_innermost_line_lies_between_rows_of_points_those_beside_it_carry_the_axis() -> None:
    ground, hidden = profiles([(-12.0, 12.0)]), np.full(ROWS // 5, -2.5)
    hidden[10:30] = np.nan
    inner, beside = line(hidden), line(-6.25)
    assert reasons(judged(ground, inner, line(2.5))) == {"neither the median'"}
    edges = line(-12.0, 0.0), line(-2.0, 0.0)
    right = Band(-12.0, -2.0, [beside, inner], edges)
    left = Band(2.0, 12.0, [line(2.5)], (line(2.0, 0.0), line(12.0, 0.0)))
    layout = RoadLayout("dual", (right, left), Pavement(ground, ground.count), ())
    assert judge(layout, [-7.0, 7.0]).doubts == []


def test_where_brightness_tells_no_edge_the_classes_do() -> None:
    ground = profiles([(-3.5, 3.5)], grass=0.2)
    assert reasons(judged(ground, line(0.0))) == {"the pavement's edge"}
    paved = np.broadcast_to(np.abs(ground.offsets) < 3.5, ground.count.shape).astype(np.float32)
    assert judged(replace(ground, paved=paved), line(0.0)).doubts == []


@pytest.mark.parametrize(("height", "doubts"), [(0.004, set()), (0.15, {"its lines stand abo"})])
def test_lines_that_stand_above_the_ground_are_rails(height: float, doubts: set[str]) -> None:
    ground = profiles([(-12.0, -2.0), (2.0, 12.0)])
    ground.height[:, np.abs(np.abs(ground.offsets) - 2.5) < 0.1] += height
    assert reasons(judged(ground, line(-2.5), line(2.5))) == doubts


def test_ground_that_is_too_rough_is_no_pavement() -> None:
    for sigma, doubts in ((0.02, set()), (0.06, {"the ground on its l"})):
        ground = profiles([(-3.5, 3.5)])
        ground.height[:] += np.random.default_rng(2).normal(0.0, sigma, ground.height.shape)
        assert reasons(judged(ground, line(0.0))) == doubts


def test_where_views_disagree_the_axis_is_open_and_what_lies_between_is_not_trusted() -> None:
    ground, rivals = profiles([(-3.5, 3.5)]), np.zeros(ROWS // 5, dtype=bool)
    rivals[[*range(8, 14), *range(19, 26)]] = True
    bands = (Band(-4.0, 4.0, [line(0.0)], (line(-4.0, 0.0), line(4.0, 0.0))),)
    (doubt,) = judge(RoadLayout("single", bands, Pavement(ground, ground.count), ()), [0.0], rivals).doubts
    assert (doubt.start, doubt.end) == (30.0, 140.0)
    assert doubt.reasons == ("views of it disagree by more than 1 m",)


# --- thrown clouds ---------------------------------------------------------------------------------------------------


def rural(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """A road of 7 m with edge lines and a dashed line in its middle, between grass."""
    away = np.abs(offset)
    paint = ((away < 0.06) & (station % 6.0 < 3.0)) | (np.abs(away - 3.2) < 0.06)
    grass = rng.normal(0.0, 1.0, len(offset))
    height = np.where(away < 3.5, -0.025 * away, -0.0875 - 0.2 * (away - 3.5) + 0.04 * grass)
    return height, np.where(paint, 0.7, np.where(away < 3.5, 0.18, 0.45 + 0.06 * grass))


def ending(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """That road for 80 m, and then grass."""
    height, brightness = rural(offset, station, rng)
    grass = rng.normal(0.0, 1.0, len(offset))
    beyond = station > 80.0
    return np.where(beyond, -0.2 + 0.04 * grass, height), np.where(beyond, 0.45 + 0.06 * grass, brightness)


def village(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """A street of 6 m between kerbs, without lines; its only bright strip is the gutter along one edge."""
    away, grass = np.abs(offset), rng.normal(0.0, 1.0, len(offset))
    height = np.where(away < 3.0, 0.0, np.where(away < 4.8, 0.11, 0.13 + 0.04 * grass))
    brightness = np.where(away < 3.0, 0.2, np.where(away < 4.8, 0.28, 0.45 + 0.06 * grass))
    return height, np.where((offset > 2.7) & (offset < 3.0), 0.6, brightness)


def field(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """Grass without a road."""
    return rng.normal(0.0, 0.06, len(offset)), 0.45 + rng.normal(0.0, 0.08, len(offset))


def thrown(path: Path, across: Across, length: float = 100.0, low: float = -9.0, high: float = 9.0) -> Path:
    """Write a cloud of ground along the map's x axis between two offsets (m), 12 points/m2."""
    rng = np.random.default_rng(3)
    count = int(12.0 * length * (high - low))
    station, offset = rng.uniform(0.0, length, count), rng.uniform(low, high, count)
    height, brightness = across(offset, station, rng)
    xyz = np.column_stack([500_000.0 + station, 5_600_000.0 + offset, 100.0 + height + rng.normal(0.0, 0.01, count)])
    brightness = np.clip(brightness + rng.normal(0.0, 0.02, count), 0.0, 1.0)
    return write(path, block_of(xyz, brightness, np.full(count, class_id("ground"), np.uint8)))


def axis_offset(found: Reconstruction) -> Float:
    """Return the offsets (N,) of the axis in such a cloud, m."""
    geometry = RoadGeometry(found.parameters)
    place = geometry.alignment.position(np.arange(10.0, geometry.length - 10.0, 5.0))
    return place[:, 1] + found.parameters.transform.translate[1] - 5_600_000.0


def test_a_road_between_grass_is_trusted(tmp_path: Path) -> None:
    found = reconstruct(read_road_cloud(thrown(tmp_path / "rural.laz", rural)))
    assert np.abs(axis_offset(found)).max() < 0.1
    assert found.judgement.doubts == []


def test_a_street_with_a_bright_gutter_has_its_axis_in_its_middle_and_is_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = thrown(tmp_path / "village.laz", village, low=-12.0, high=12.0)
    assert main(["reconstruct", str(cloud), "--output", str(tmp_path / "out"), "--no-picture"]) == 3
    assert "the lines lie more than 0.5 m beside it" in capsys.readouterr().out
    report = json.loads((tmp_path / "out/reconstruction.json").read_text())
    assert report["judgement"]["trusted"] == 0.0
    line = json.loads((tmp_path / "out/centerline.geojson").read_text())["features"][0]
    assert np.array(line["geometry"]["coordinates"])[:, 1] == pytest.approx(5_600_000.0, abs=0.3)  # not the gutter
    (stretch,) = line["properties"]["doubtful"]
    assert stretch == report["judgement"]["doubtful"][0]
    assert stretch["end"] - stretch["start"] > 0.95 * report["length"]


def test_where_the_road_ends_the_rest_is_marked(tmp_path: Path) -> None:
    (doubt,) = reconstruct(read_road_cloud(thrown(tmp_path / "ending.laz", ending, 130.0))).judgement.doubts
    assert 60.0 < doubt.start < 85.0


def test_half_a_road_is_marked_all_along(tmp_path: Path) -> None:
    found = reconstruct(read_road_cloud(thrown(tmp_path / "half.laz", rural, low=0.3)))
    assert found.judgement.trusted == 0.0


def test_a_field_is_no_road(tmp_path: Path) -> None:
    cloud = read_road_cloud(thrown(tmp_path / "field.laz", field, low=0.0))
    with pytest.raises(InputError, match="neither lines nor edges of a carriageway"):
        reconstruct(cloud)


@pytest.mark.slow
@pytest.mark.skipif(not REAL, reason="the real scans aren't here")
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_what_is_trusted_of_a_real_road_lies_within_a_metre_of_its_axis(path: Path) -> None:
    found = reconstruct(read_road_cloud(path.with_name(path.name.replace("_axis.csv", ".laz"))))
    geometry = RoadGeometry(found.parameters)
    known = read_axis(path)[:, :2] - found.parameters.transform.translate[:2]
    station, offset = geometry.alignment.project(known)
    trusted = (station > 0.0) & (station < geometry.length)
    for doubt in found.judgement.doubts:
        trusted &= (station < doubt.start) | (station > doubt.end)
    assert trusted.sum() > 200
    assert np.abs(offset[trusted]).max() < 1.0


@pytest.mark.parametrize(("left", "painted", "is_trusted"), [(4.0, True, True), (7.3, True, True), (4.0, False, False)])
def test_a_bay_beside_a_line_is_no_doubt_whether_it_looks_like_the_road_or_not(
    left: float, painted: bool, is_trusted: bool
) -> None:
    """By class the bay on the left is pavement, by brightness where it is of the same stone; edges alone must agree."""
    ground, count = profiles([(-4.0, left)]), ROWS // 5
    bay = OneSided(np.zeros(count), np.full(count, 3.3), np.zeros(count), 8.0, np.zeros(count, dtype=bool))
    band = Band(-4.0, 4.0, [line(0.0)] if painted else [], (line(-4.0, 0.0), line(4.0, 0.0)))
    found = judge(RoadLayout("single", (band,), Pavement(ground, ground.count), (), one_sided=bay), [0.0])
    assert (found.trusted > 0.95) == is_trusted
