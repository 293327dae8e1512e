"""Our own IFC comes in again with carriageways, turnouts, markings and things; parts of others are counted."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.whole_road import differences_from, road_from_file
from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway, Turnout
from synthroads_addon.road_files.read import read_lines
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import Scenario
from synthroads_addon.twin.formats import write_twin
from tests.helpers.roads.sampled_parts import PAIRS, scenario
from tests.helpers.roads.way_back import TYPES, changed_fields, roads_apart
from tests.judges.registry import require

OFTEN = {"turnouts": {"exits": 0.5, "entries": 0.5, "emergency_bays": 0.5}, "lane_changes": {"share": 0.5}}
FURTHER = {"turnouts": {"exits": 1.0, "entries": 1.0, "emergency_bays": 1.0}, "lane_changes": {"share": 1.0}}


@pytest.fixture(scope="module", autouse=True)
def _library() -> None:
    require("ifcopenshell")


@pytest.fixture(scope="module")
def road() -> RoadParameters:
    return sample_road(scenario(length=1800.0, **FURTHER), 4)


@pytest.fixture(scope="module")
def file(road: RoadParameters, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ifc")
    write_twin(road, folder, ("ifc",), 0.2)
    return folder / "twin.ifc"


def taken(path: Path, road: RoadParameters) -> tuple[RoadParameters, dict]:
    with collected_remarks():
        return road_from_file(path, Scenario.from_dict({"road": {"epsg": road.metadata.epsg}}))


def test_widths_crossfall_and_turnouts_are_the_sets(road: RoadParameters, file: Path) -> None:
    found, report = taken(file, road)
    for name, before in road.of_type(Carriageway).items():
        after = found.objects[name]
        changes = {"instance": before.instance, "pavement": before.pavement}
        assert after.model_copy(update=changes) == before
    assert len(road.of_type(Turnout)) > 2
    assert changed_fields(road, found) == []
    across, up = roads_apart(road, found)
    assert max(across, up) < 1e-6
    numbers = report["whole"]["read"]
    assert numbers["Carriageway"] == 2
    assert sum(numbers.values()) == len([item for item in road.objects.values() if item.type in TYPES]) - 1
    assert report["left_out"] == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_fifty_drawn_roads_come_back(tmp_path: Path, seed: int) -> None:
    """The same axis, surface and objects."""
    design_class, section = PAIRS[seed % len(PAIRS)]
    drawn = sample_road(scenario(design_class=design_class, cross_section=section, length=500.0, **OFTEN), seed)
    write_twin(drawn, tmp_path, ("ifc",), 0.1)
    found, report = taken(tmp_path / "twin.ifc", drawn)
    across, up = roads_apart(drawn, found)
    shift = np.array(found.transform.translate) - drawn.transform.translate
    station = np.linspace(0.0, drawn.alignment.length, 300)
    axes = [alignment_of(road.alignment).position(station) for road in (drawn, found)]
    along = np.hypot(*(axes[1] + shift[:2] - axes[0]).T).max()
    print(f"seed {seed}: axis {1e3 * along:.5f} mm, across {1e3 * across:.5f} mm, up {1e3 * up:.5f} mm")  # pytest -s
    assert max(across, up, along) < 1e-3
    assert changed_fields(drawn, found) == []
    assert report["left_out"] == []


def test_the_command_takes_them_and_tells_edits(road: RoadParameters, file: Path, tmp_path: Path) -> None:
    assert main(["road", str(file), "--output", str(tmp_path / "out")]) == 0
    (tmp_path / "parameters.json").write_text(road.to_json(), encoding="utf-8")
    text = file.read_text(encoding="utf-8")
    strip = f"IFCLENGTHMEASURE({road.carriageway('right').hard_shoulder_width!r}"
    assert text.count("'hard_shoulder_width'") == 2
    first = text.index("'hard_shoulder_width'")
    at = text.index("IFC", first)
    changed = text[:at] + "IFCLENGTHMEASURE(3.125" + text[text.index(")", at) :]
    assert strip.partition("(")[0] in changed
    (tmp_path / "edited.ifc").write_text(changed, encoding="utf-8")
    with collected_remarks():
        rows, _ = differences_from(tmp_path / "edited.ifc", tmp_path / "parameters.json", Scenario.from_dict({}))
    assert [(row.field.rpartition(".")[2], row.new) for row in rows] == [("hard_shoulder_width", 3.125)]


def test_the_axis_alone_draws_a_section_of_the_scenarios(file: Path, tmp_path: Path) -> None:
    assert main(["road", str(file), "--output", str(tmp_path / "out"), "--only-axis"]) == 0
    report = json.loads((tmp_path / "out" / "road.json").read_text())
    assert "whole" not in report


def test_parts_of_other_programs_are_counted_as_lost(file: Path, tmp_path: Path) -> None:
    text = file.read_text(encoding="utf-8").replace("'SynthRoads',", "'Others',")
    (tmp_path / "a.ifc").write_text(text, encoding="utf-8")
    (line,) = read_lines(tmp_path / "a.ifc")
    assert line.given is None
    heads = [text.partition(":")[0] for text in line.left_out]
    assert heads == ["lanes", "objects", "crossfall", "lanes"]
    assert "IfcRoadPart" in line.left_out[0]
    assert main(["road", str(tmp_path / "a.ifc"), "--output", str(tmp_path / "out")]) == 3


def test_a_part_with_impossible_values_is_counted_as_lost(file: Path, tmp_path: Path) -> None:
    text = file.read_text(encoding="utf-8")
    at = text.index("IFC", text.index("'taper_in_length'"))
    (tmp_path / "a.ifc").write_text(text[:at] + "IFCLENGTHMEASURE(-5." + text[text.index(")", at) :], encoding="utf-8")
    (line,) = read_lines(tmp_path / "a.ifc")
    assert line.given is not None
    assert "lanes: 1 Turnout with other values than ours" in line.left_out
    assert sum(text.startswith("lanes") for text in line.left_out) == 1, "what is painted beside it is no surface"
    assert main(["road", str(tmp_path / "a.ifc"), "--output", str(tmp_path / "out")]) == 3


def test_carriageways_that_overlap_are_one_line(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = file.read_text(encoding="utf-8")
    at = text.index("IFC", text.index("'inner_offset'"))
    (tmp_path / "a.ifc").write_text(text[:at] + "IFCLENGTHMEASURE(-40." + text[text.index(")", at) :], encoding="utf-8")
    assert main(["road", str(tmp_path / "a.ifc"), "--output", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "its parts must fit together" in said
    assert said.count("\n") == 1
