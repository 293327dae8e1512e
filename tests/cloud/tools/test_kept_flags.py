"""Copies of a cloud keep the flags of its points, or the user is told what is lost; work leaves withheld ones out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pytest

from ml.data.classes import class_names
from ml.data.points import read_ground, read_points
from ml.data.sources import Source, read_tiles
from ml.data.strips import find_ground
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.cloud.flags import FLAGS
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.selection.classes import read_real_cloud
from synthroads_addon.cloud.tools.convert import convert, map_intensity, subsample
from synthroads_addon.cloud.tools.divide import crop, merge, tile
from synthroads_addon.cloud.tools.statistics import cloud_statistics
from synthroads_addon.reconstruction.cloud import read_road_cloud
from tests.helpers.clouds.declaring_files import COUNT, EVERY_FIFTH, PLACES, las_file
from tests.judges import require

MARKED = {
    "withheld": EVERY_FIFTH,
    "synthetic": np.arange(COUNT) % 3 == 0,
    "key_point": np.arange(COUNT) % 4 == 1,
    "edge_of_flight_line": np.arange(COUNT) % 7 == 0,
    "scan_direction_flag": np.arange(COUNT) % 2,
    "user_data": np.arange(COUNT) * 12,
    "gps_time": 3.9e8 + np.arange(COUNT),
}
"""Of every point format; those of 6 and above have more."""
MORE = {"overlap": np.arange(COUNT) % 2, "scanner_channel": np.arange(COUNT) % 4}


def tiled(source: Path, output: Path) -> None:
    tile(source, output.parent / "tiles", 1000.0, kind=output.suffix.strip("."))
    (output.parent / f"tiles/cloud_0_0{output.suffix}").replace(output)


def merged(source: Path, output: Path) -> None:
    same = source.with_name(f"same{source.suffix}")
    same.write_bytes(source.read_bytes())
    merge([source, same], output)


COPIES: dict[str, Callable[[Path, Path], object]] = {
    "convert": convert,
    "crop": lambda source, output: crop(source, output, box=(-1.0, -1.0, 100.0, 100.0)),
    "merge": merged,
    "tile": tiled,
}


@pytest.mark.parametrize("ending", [".las", ".laz"])
@pytest.mark.parametrize(("kind", "version"), [(1, "1.2"), (3, "1.3"), (6, "1.4"), (7, "1.4")])
@pytest.mark.parametrize("name", COPIES)
def test_a_copy_in_las_keeps_flags_and_the_epoch_of_time(
    tmp_path: Path, name: str, kind: int, version: str, ending: str
) -> None:
    marks = MARKED | (MORE if kind >= 6 else {})
    path = las_file(tmp_path / "cloud.laz", kind, version=version, standard_time=True, **marks)
    with collected_remarks() as remarks:
        COPIES[name](path, tmp_path / f"copy{ending}")
    copy = laspy.read(tmp_path / f"copy{ending}")
    order = np.argsort(copy.gps_time[:COUNT])
    for field, values in marks.items():
        np.testing.assert_array_equal(np.asarray(copy[field])[:COUNT][order], values, err_msg=field)
    assert copy.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD
    assert remarks == []


@pytest.mark.parametrize("ending", [".ply", ".pcd", ".npz", ".e57"])
@pytest.mark.parametrize("name", COPIES)
def test_what_another_format_has_no_field_for_is_told(tmp_path: Path, name: str, ending: str) -> None:
    if ending == ".e57":
        require("pye57")
    path = las_file(tmp_path / "cloud.laz", standard_time=True, **MARKED)
    with collected_remarks() as remarks:
        COPIES[name](path, tmp_path / f"copy{ending}")
    times = 2 if name == "merge" else 1
    format_name = ending.strip(".").upper()
    counts = {"synthetic": 7, "key_point": 5, "scan_direction_flag": 10, "edge_of_flight_line": 3, "user_data": 19}
    listed = ", ".join(f"{flag} of {count * times} points" for flag, count in counts.items())
    assert remarks == [
        f"cloud.laz: {4 * times} withheld points left out: {format_name} has no field for the flag",
        f"cloud.laz: {listed} lost: {format_name} has no field for them",
    ]
    with open_cloud(tmp_path / f"copy{ending}") as cloud:
        assert (cloud.header.count, cloud.header.standard_time) == (16 * times, True)
    convert(tmp_path / f"copy{ending}", tmp_path / "back.laz")
    assert laspy.read(tmp_path / "back.laz").header.global_encoding.gps_time_type == 1


def test_nothing_is_told_of_flags_that_no_point_has(tmp_path: Path) -> None:
    path = las_file(tmp_path / "cloud.laz")
    with collected_remarks() as remarks:
        done = convert(path, tmp_path / "copy.npz")
    assert (remarks, done["lost"], done["points"]) == ([], {}, COUNT)


def test_clouds_whose_times_count_from_elsewhere_are_not_merged(tmp_path: Path) -> None:
    one, two = las_file(tmp_path / "a.las"), las_file(tmp_path / "b.las", standard_time=True)
    with pytest.raises(Exception, match="has a different epoch of GPS time from"):
        merge([one, two], tmp_path / "both.las")


GROUND = np.column_stack(
    [*(np.stack(np.meshgrid(np.arange(60) * 0.5, np.arange(60) * 0.5)).reshape(2, -1)), np.zeros(3600)]
)
BELOW = np.arange(len(GROUND)) % 20 == 0


def survey(path: Path, kind: str) -> Path:
    """Write a field of ground points of which 5 % lie 4 m too low, withheld or of a class of noise; return its path."""
    places = GROUND - np.outer(BELOW, [0.0, 0.0, 4.0])
    marks = {
        "withheld": {"withheld": BELOW},
        "noise": {"classification": np.where(BELOW, 7, 2)},
        "high noise": {"classification": np.where(BELOW, 18, 2)},
    }[kind]
    return las_file(path, places=places, intensity=100 + np.arange(len(places)) % 900, **marks)


def lowest_of_tiles(path: Path) -> tuple[int, float]:
    source = Source(path=str(path), mapping="ign")
    tiles = list(read_tiles(source, class_scheme("5"), None))
    places = np.concatenate([tile.coord[tile.segment >= 0, 2] + tile.origin[2] for tile in tiles])
    assert class_names(class_scheme("5"))
    return len(places), float(places.min())


def lowest_of_subsample(path: Path) -> tuple[int, float]:
    subsample(path, path.with_name("thin.laz"), 0.1)
    return lowest(path.with_name("thin.laz"))


def lowest_of_mapped(path: Path) -> tuple[int, float]:
    map_intensity(path, survey(path.with_name("target.laz"), "noise"), path.with_name("mapped.laz"))
    return lowest(path.with_name("mapped.laz"))


def lowest(path: Path) -> tuple[int, float]:
    found = laspy.read(path)
    return len(found.z), float(found.z.min())


def of_points(count: int, heights: np.ndarray) -> tuple[int, float]:
    return count, float(np.min(heights))


WORK: dict[str, Callable[[Path], tuple[int, float]]] = {
    "points": lambda path: of_points(len(read_points(path)), read_points(path).xyz[:, 2] + read_points(path).origin[2]),
    "ground": lambda path: of_points(len(read_ground(path)), read_ground(path).xyz[:, 2] + read_ground(path).origin[2]),
    "road cloud": lambda path: of_points(
        len(read_road_cloud(path).xyz), read_road_cloud(path).xyz[:, 2] + read_road_cloud(path).origin[2]
    ),
    "real cloud": lambda path: of_points(len(read_real_cloud(path).xyz), read_real_cloud(path).xyz[:, 2]),
    "labelled tiles": lowest_of_tiles,
    "subsample": lowest_of_subsample,
    "map-intensity": lowest_of_mapped,
}


@pytest.mark.parametrize("kind", ["withheld", "noise", "high noise"])
@pytest.mark.parametrize("name", WORK)
def test_work_leaves_withheld_points_and_noise_out(tmp_path: Path, name: str, kind: str) -> None:
    path = survey(tmp_path / "cloud.laz", kind)
    with collected_remarks() as remarks:
        count, low = WORK[name](path)
    assert (count, low) == (len(GROUND) - BELOW.sum(), pytest.approx(0.0, abs=1e-3))
    if name != "labelled tiles" or kind == "withheld":  # a mapping says itself what numbers mean
        assert any(f"{BELOW.sum()} points" in remark for remark in remarks)


def test_the_first_look_for_a_road_leaves_noise_out(tmp_path: Path) -> None:
    """Noise among points that nobody has sorted, which made the classes seem sorted."""
    path = survey(tmp_path / "cloud.laz", "noise")
    las = laspy.read(path)
    las.classification = np.where(BELOW, 7, 1)
    las.write(path)
    found = find_ground(path)
    assert found.classes.all()
    assert read_ground(path).xyz[:, 2].min() == pytest.approx(0.0, abs=1e-3)


def test_withheld_points_are_counted_and_not_described(tmp_path: Path) -> None:
    with open_cloud(survey(tmp_path / "cloud.laz", "withheld")) as cloud:
        figures = cloud_statistics(cloud, samples=0)
    assert (figures["points"], figures["withheld"]) == (len(GROUND), BELOW.sum())
    assert figures["all"]["points"] == len(GROUND) - BELOW.sum()
    assert figures["bounds"]["low"][2] == pytest.approx(0.0, abs=1e-3)


def test_flags_of_las_are_those_of_the_standard() -> None:
    assert set(FLAGS) <= set(laspy.PointFormat(7).dimension_names)
    assert len(PLACES) == COUNT
