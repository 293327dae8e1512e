"""The report beside each twin: every instance number is found in the file, or is said to be lost, with the reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.surroundings import Vegetation
from synthroads_addon.twin.formats import TWIN_FORMATS, write_twin
from tests.helpers.files.twin_reports import TwinReport, numbers_in, numbers_of, read_report
from tests.helpers.roads.damage_outlines import damaged_road
from tests.helpers.roads.parameter_sets import OBJECTS
from tests.helpers.roads.twin_roads import one_of_many

PARTS = {"dash", "strip", "rut", "pothole", "patch", "crack", "removed", "tree", "shrub"}
LOST = {
    "cityjson": set(),
    "ifc": set(),
    "opendrive": {"Terrain", "Landscape", "Vehicle", "strip", "rut", "pothole", "patch", "crack", "removed"},
    "geojson": {"Terrain", "Landscape", "strip", "rut", "pothole", "patch", "crack", "removed"},
    "geopackage": {"Terrain", "Landscape", "strip"},
    "inventory": {*OBJECTS, "AlignmentObject"} | PARTS,
    "lanelet2": ({*OBJECTS, "AlignmentObject"} | PARTS) - {"Carriageway"},
    "opencrg": {*OBJECTS, "dash", "strip", "tree", "shrub"} - {"Alignment", "Carriageway", "Turnout"},
}
"""Kinds of objects and parts that a format has nothing of."""
NOT_ON_THE_ROAD = "nothing of it is on the road, or it has no area"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the twins of a road of 40 m."""
    folder = tmp_path_factory.mktemp("reports")
    write_twin(one_of_many(3), folder, TWIN_FORMATS)
    return folder


def faults(road: RoadParameters, report: TwinReport) -> list[str]:
    """Return the numbers that a report doesn't tell, those that nothing has, and losses without a reason."""
    wanted = numbers_of(road)
    told = report.entities.keys() | report.lost.keys()
    found = [f"{name} isn't told" for number, name in wanted.items() if number not in told]
    found += [f"{report.ids[number]} is lost without a reason" for number, why in report.lost.items() if not why]
    return found + [f"{number} is nothing's" for number in report.lost if number not in wanted]


@pytest.mark.parametrize("name", TWIN_FORMATS)
def test_every_number_is_in_the_file_or_lost_with_a_reason(name: str, written: Path) -> None:
    road, report = one_of_many(3), read_report(written, name)
    assert faults(road, report) == []
    numbers = RoadGeometry(road).numbers
    assert all(numbers.name_of(number) == told for number, told in report.ids.items())
    for number, why in report.lost.items():
        kind = type(road.objects[str(numbers.owner(number))]).__name__
        part = str(numbers.name_of(number)).partition("/")[2].partition("-")[0]
        assert LOST[name] & {kind, part, "strip" if kind == "Vegetation" else ""} or why == NOT_ON_THE_ROAD, why


@pytest.mark.parametrize("name", TWIN_FORMATS)
def test_what_a_report_tells_is_in_the_file(name: str, written: Path) -> None:
    """Each entity bears the number, or the one of the object whose part has none of its own."""
    road, report, look = one_of_many(3), read_report(written, name), numbers_in(written, name)
    numbers = RoadGeometry(road).numbers
    assert len(report.entities) > {"opencrg": 5, "inventory": 5, "lanelet2": 1}.get(name, 50)
    for number, entities in report.entities.items():
        if isinstance(road.objects[str(numbers.owner(number))], AlignmentObject) and name == "opendrive":
            continue
        assert entities
        for entity in entities:
            found = look(entity)
            assert found == number or numbers.owner(found) == numbers.owner(number), entity


def test_a_number_that_is_left_out_is_seen(written: Path) -> None:
    report = read_report(written, "cityjson")
    gone = next(row for row in report.data["instances"] if "/tree-" in row["id"])
    data = report.data | {"instances": [row for row in report.data["instances"] if row is not gone]}
    assert faults(one_of_many(3), TwinReport(data)) == [f"{gone['id']} isn't told"]


def test_passes_are_told_by_their_first_and_their_step(written: Path) -> None:
    numbers, report = RoadGeometry(one_of_many(3)).numbers, read_report(written, "cityjson")
    assert len(numbers.passes) > 1
    for name, one in numbers.passes.items():
        own = one_of_many(3).objects[name].instance
        assert all(report.knows(one.number(own, passes)) for passes in range(4))
    assert not report.knows(min(one.first for one in numbers.passes.values()) - 1)


def test_what_is_simpler_is_told(written: Path) -> None:
    """Boxes around vehicles, plants without leaves, fittings that are left out."""
    road = one_of_many(3)
    for name in ("cityjson", "ifc"):
        reduced = {row["id"]: row["reason"] for row in read_report(written, name).data["reduced"]}
        assert {item for item in road.objects if item.startswith("vehicle")} <= set(reduced)
        assert set(road.of_type(Vegetation)) <= set(reduced)
        assert any("fitting" in reason for reason in reduced.values())
    assert "fittings" in read_report(written, "opendrive").data["level_of_detail"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 5, 9])
def test_roads_with_everything_are_told(number: int, tmp_path: Path) -> None:
    """Damage, turnouts, gantries, overpasses and construction zones."""
    road = one_of_many(number)
    write_twin(road, tmp_path, TWIN_FORMATS)
    for name in TWIN_FORMATS:
        assert faults(road, read_report(tmp_path, name)) == []
        look = numbers_in(tmp_path, name)
        for entities in read_report(tmp_path, name).entities.values():
            for entity in entities:
                if entity.get("element") != "planView":
                    look(entity)


def test_damage_of_every_kind_is_told(tmp_path: Path) -> None:
    road = damaged_road()
    write_twin(road, tmp_path, TWIN_FORMATS)
    for name in TWIN_FORMATS:
        assert faults(road, read_report(tmp_path, name)) == []
