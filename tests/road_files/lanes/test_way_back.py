"""Our own files come in again: the same surface, and the same objects."""

from __future__ import annotations

from pathlib import Path

import pytest
from scipy.spatial import KDTree

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway, CrossfallPoint
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.roads.sampled_parts import PAIRS, scenario
from tests.helpers.roads.side_roads import roof
from tests.helpers.roads.way_back import TOLERANCE, changed_fields, roads_apart, surface_errors, there_and_back
from tests.judges import libopendrive
from tests.judges.registry import require

MILLIMETRE = 1e-3
FURTHER = {"turnouts": {"exits": 0.7, "entries": 0.7, "emergency_bays": 0.5}, "lane_changes": {"share": 0.5}}


def drawn(seed: int) -> RoadParameters:
    design_class, section = PAIRS[seed % len(PAIRS)]
    length = (600.0, 1500.0, 2500.0)[seed % 3]
    return sample_road(scenario(design_class=design_class, cross_section=section, length=length, **FURTHER), seed)


def check(road: RoadParameters, folder: Path) -> None:
    path, found, report = there_and_back(road, folder)
    across, up = roads_apart(road, found)
    assert across < MILLIMETRE
    assert up < MILLIMETRE
    # A reader of the standard's formulas finds the new road as near to the file as the one that it was written from.
    before, after = surface_errors(path, road), surface_errors(path, found)
    assert after[0] < before[0] + MILLIMETRE
    assert after[1] < before[1] + MILLIMETRE
    # A ramp's crossfall and run-off can't be told apart where it ends before the run-off does: its surface is the same.
    changed = [row for row in changed_fields(road, found) if not row.field.endswith(".ramp")]
    assert changed == []
    assert not report["whole"]["surface_lost"], report["whole"]["approximated"]


@pytest.mark.parametrize("seed", [0, 3, 12, 63, 72])
def test_a_drawn_road_comes_back(tmp_path: Path, seed: int) -> None:
    """The last two have turnouts all along one side."""
    check(drawn(seed), tmp_path)


@pytest.mark.parametrize("section", ["RQ11", "RQ15.5"])
def test_a_country_road_comes_back_as_a_roof_and_as_one_plane(tmp_path: Path, section: str) -> None:
    road = roof(sample_road(RoadScenario.from_dict({"cross_section": section, "length": 400.0}), 3))
    _, found, report = there_and_back(road, tmp_path)
    across, up = roads_apart(road, found)
    assert across < MILLIMETRE
    assert up < MILLIMETRE
    assert changed_fields(road, found) == []
    assert not report["whole"]["surface_lost"]


def test_a_crossfall_that_turns_over_within_two_metres_comes_back(tmp_path: Path) -> None:
    """As where two bends follow each other closely: the reference line then climbs by tens of percent."""
    road = drawn(0)
    objects = dict(road.objects)
    for name, carriageway in road.of_type(Carriageway).items():
        rows = [(0.0, 2.5), (300.0, 2.5), (301.5, -6.0), (600.0, -6.0)]
        points = tuple(CrossfallPoint(station=s, crossfall_percent=percent) for s, percent in rows)
        objects[name] = carriageway.model_copy(update={"crossfall": points})
    twisted = road.model_copy(update={"objects": objects})
    _, found, report = there_and_back(twisted, tmp_path)
    across, up = roads_apart(twisted, found)
    assert across < MILLIMETRE
    assert up < MILLIMETRE
    assert not report["whole"]["surface_lost"], report["whole"]["approximated"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(13, 63))
def test_fifty_drawn_roads_come_back(tmp_path: Path, seed: int) -> None:
    check(drawn(seed), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(63, 113))
def test_fifty_drawn_roads_have_the_same_surface_by_another_reader(tmp_path: Path, seed: int) -> None:
    """Of the file that a road is written to, and of the one that it is written to again after it was read.

    Each border of a lane of either is one of the other: only lanes without any width may be missing.
    """
    require("libOpenDRIVE")
    road = drawn(seed)
    first, found, _ = there_and_back(road, tmp_path)
    second = tmp_path / "again.xodr"
    write_opendrive(found, second, TOLERANCE)
    points = libopendrive.surface(first)[2] + road.transform.translate
    others = libopendrive.surface(second)[2] + found.transform.translate
    apart = max(float(KDTree(a).query(b)[0].max()) for a, b in ((points, others), (others, points)))
    print(f"seed {seed}: {len(points)} points, {1000.0 * apart:.4f} mm apart")  # with pytest -s
    assert apart < MILLIMETRE
    assert [row for row in changed_fields(road, found) if not row.field.endswith(".ramp")] == []
