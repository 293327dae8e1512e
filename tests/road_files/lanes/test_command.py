"""The command on whole roads: exit codes, files, the axis alone, and what an edit has changed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from headless.cli import main
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.roads.lane_files import lane, lanes, road_file, section, width
from tests.helpers.roads.sampled_parts import scenario

TWO_WAYS = section(0.0, lane(1, width(0.0, 3.5)), lane(-1, width(0.0, 3.25)))
KERB = '<height sOffset="0" inner="0.1" outer="0.1"/>'


def test_a_whole_road_is_written_with_its_report(tmp_path: Path) -> None:
    path = road_file(tmp_path, lanes(TWO_WAYS) + '<objects><object id="1" s="50" t="-9" type="guide-post"/></objects>')
    assert main(["road", str(path), "--output", str(tmp_path / "out")]) == 0
    parameters = read_parameters(tmp_path / "out" / "parameters.json")
    assert [parameters.carriageway(side).lanes[0].width for side in ("left", "right")] == [3.5, 3.25]
    report = json.loads((tmp_path / "out" / "road.json").read_text())
    assert report["whole"]["read"]["Delineator"] == 1
    assert report["left_out"] == []
    assert report["surface"]["right"]["pavement_offset"] < 1e-3


def test_surface_that_is_lost_gives_exit_code_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    raised = section(0.0, "", lane(-1, width(0.0, 3.5)) + lane(-2, width(0.0, 2.0) + KERB, "shoulder"))
    path = road_file(tmp_path, lanes(raised))
    assert main(["road", str(path), "--output", str(tmp_path / "out")]) == 3
    assert "right pavement: its heights" in capsys.readouterr().out
    assert main(["road", str(path), "--output", str(tmp_path / "axis"), "--only-axis"]) == 0


def test_the_axis_alone_is_another_road(tmp_path: Path) -> None:
    path = road_file(tmp_path, lanes(TWO_WAYS))
    assert main(["road", str(path), "--output", str(tmp_path / "out"), "--only-axis"]) == 0
    parameters = read_parameters(tmp_path / "out" / "parameters.json")
    assert len(parameters.carriageway("right").lanes) == 2
    report = json.loads((tmp_path / "out" / "road.json").read_text())
    assert "whole" not in report
    assert report["left_out"] == ["lanes of 1 lane sections"]


def test_a_road_without_lanes_is_its_line(tmp_path: Path) -> None:
    assert main(["road", str(road_file(tmp_path, "")), "--output", str(tmp_path / "out")]) == 0
    report = json.loads((tmp_path / "out" / "road.json").read_text())
    assert "whole" not in report
    assert report["length"] == 200.0


def test_an_edit_is_shown_as_fields(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    road = sample_road(scenario(length=400.0), 4)
    (tmp_path / "parameters.json").write_text(road.to_json())
    path = tmp_path / "own.xodr"
    write_opendrive(road, path, 0.005)
    against = ["--against", str(tmp_path / "parameters.json")]
    assert main(["road", str(path), *against]) == 0
    assert capsys.readouterr().out.strip() == "no field differs"
    text = path.read_text()
    first = text.index('<width sOffset="0" a="3.75')
    end = text.index("/>", first)
    wider = text[:first] + text[first:end].replace('a="3.75', 'a="4.00') + text[end:]
    path.write_text(wider)
    assert main(["road", str(path), *against, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["differences"]
    fields = {row["field"]: (row["old"], row["new"]) for row in rows}
    lanes_changed = [name for name in fields if name.endswith(".width") and ".lanes." in name]
    assert lanes_changed
    assert fields[lanes_changed[0]] == (pytest.approx(3.75), pytest.approx(4.0, abs=1e-3))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["road", "FILE", "--against", "FILE", "--output", "out"], "can't be given together with --against"),
        (["generate", "--road", "FILE", "--axis", "FILE", "--output", "out"], "can't be given together with --axis"),
        (["generate", "--road", "FILE", "--set", "road.lanes=3", "--output", "out"], "has no effect with --road"),
    ],
)
def test_options_that_contradict_are_refused(
    tmp_path: Path, arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = road_file(tmp_path, lanes(TWO_WAYS))
    given = [str(path) if word == "FILE" else str(tmp_path / "out") if word == "out" else word for word in arguments]
    assert main(given) == 2
    assert text in capsys.readouterr().err
