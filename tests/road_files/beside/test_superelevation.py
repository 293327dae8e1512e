"""Superelevation of LandXML as crossfall: against slopes that are linear between the stations that the file has."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.whole_road import road_from_file
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road_files.read import read_lines
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.roads.written_lines import Walk, landxml, linear, xml_alignment, xml_points

PLAN = [(200.0, 0.0, 0.0), (120.0, 0.0, 1.0), (200.0, 1.0, 1.0), (120.0, 1.0, 0.0), (260.0, 0.0, 0.0)]
"""Length and curvature at both ends of each element, in that of the arc."""
LENGTH = sum(row[0] for row in PLAN)
RADIUS = 700.0
NAMES = ("BeginRunoutSta", "BeginRunoffSta", "FullSuperSta", "RunoffSta", "StartofRunoutSta", "EndofRunoutSta")
STATIONS = (155.0, 210.0, 320.0, 520.0, 630.0, 685.0)
"""At 5 % and 110 m of run-off the 55 m of run-out are for 2.5 %."""
AT = np.linspace(0.0, LENGTH, 181)
SCENARIO = Scenario.from_dict({"road": {"half_width": 40.0}})


def superelevation(stations: tuple[float, ...] = STATIONS, full: float = 5.0, more: str = "", unit: float = 1.0) -> str:
    rows = [f"<{name}>{s / unit!r}</{name}>" for name, s in zip(NAMES, stations, strict=True)]
    return f"<Superelevation>{''.join(rows)}<FullSuperelev>{full!r}</FullSuperelev>{more}</Superelevation>"


def written(
    folder: Path, rest: str, left: bool = False, start: float = 0.0, unit: float = 1.0, roads: str = ""
) -> Path:
    """Write a road with one bend, to the right if it isn't to the left, lengths in a unit (m)."""
    bend = 1.0 / RADIUS if left else -1.0 / RADIUS
    walk = Walk([(d, linear(d, a * bend, b * bend)) for d, a, b in PLAN], 350_000.0, 5_600_000.0, 0.7)
    rot, rows = "ccw" if left else "cw", []
    for n, (d, a, b) in enumerate(PLAN):
        places = {name: tuple(v / unit for v in walk.poses[k][:2]) for name, k in (("Start", n), ("End", n + 1))}
        if a == b == 0.0:
            rows.append(f"<Line>{xml_points(**places)}</Line>")
        elif a == b:
            x, y, heading = walk.poses[n]
            centre = ((x - np.sin(heading) / bend) / unit, (y + np.cos(heading) / bend) / unit)
            rows.append(f"<Curve rot='{rot}'>{xml_points(**places, Center=tuple(map(float, centre)))}</Curve>")
        else:
            radii = ["INF" if k == 0.0 else repr(RADIUS / unit) for k in (a, b)]
            words = f"length='{d / unit!r}' radiusStart='{radii[0]}' radiusEnd='{radii[1]}' rot='{rot}'"
            rows.append(f"<Spiral {words}>{xml_points(**places)}</Spiral>")
    profile = f"<PVI>{start / unit!r} 50</PVI><PVI>{(start + LENGTH) / unit!r} 58</PVI>"
    alignment = xml_alignment("".join(rows), profile, start / unit, LENGTH / unit, rest)
    units = ("Metric", "meter") if unit == 1.0 else ("Imperial", "foot")
    return landxml(folder / "bend.xml", [alignment], *units, roads)


def taken(path: Path) -> tuple[RoadParameters, dict[str, np.ndarray], dict, list[str]]:
    """Return the road, its crossfall by side (%), the report and the remarks."""
    with collected_remarks() as remarks:
        parameters, report = road_from_file(path, SCENARIO)
    geometry = RoadGeometry(parameters)
    found = {side: 100.0 * geometry.crossfall(parameters.carriageway(side), AT) for side in ("left", "right")}
    return parameters, found, report, remarks


def wanted(left: bool, full: float = 5.0, straight: float = 2.5) -> dict[str, np.ndarray]:
    """Return the crossfall (%) by side that the stations mean, positive where it falls to the right."""
    # The outer side turns at one rate from the usual crossfall to the full one. The inner one waits for it.
    turning = np.interp(AT, STATIONS, (-straight, 0.0, full, full, 0.0, -straight))
    inner = np.maximum(turning, straight)
    return {"left": -inner, "right": -turning} if left else {"left": turning, "right": inner}


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("full", [5.0, -5.0, 0.05])
def test_the_road_falls_to_the_inside_of_the_bend(tmp_path: Path, left: bool, full: float) -> None:
    """Whatever sign the file has, and as a ratio or a percentage."""
    _, found, report, remarks = taken(written(tmp_path, superelevation(full=full), left))
    for side, values in wanted(left).items():
        assert np.abs(found[side] - values).max() < 1e-4, side
    assert report["whole"]["read"] == {"superelevations": 1}
    assert not report["whole"]["surface_lost"]
    assert any("2.5 % follow from the lengths of its run-outs" in text for text in remarks)


@pytest.mark.parametrize(("start", "unit"), [(12_000.0, 1.0), (-300.0, 1.0), (0.0, 0.3048)])
def test_stations_count_as_the_alignment_does(tmp_path: Path, start: float, unit: float) -> None:
    stations = tuple(s + start for s in STATIONS)
    _, found, _, _ = taken(written(tmp_path, superelevation(stations, unit=unit), start=start, unit=unit))
    for side, values in wanted(False).items():
        assert np.abs(found[side] - values).max() < 1e-3, side


def test_the_rate_says_the_crossfall_of_straights(tmp_path: Path) -> None:
    """At 5 % over 110 m the 44 m of run-out are for 2 %."""
    stations = (166.0, 210.0, 320.0, 520.0, 630.0, 674.0)
    _, found, _, _ = taken(written(tmp_path, superelevation(stations)))
    assert found["right"][0] == pytest.approx(2.0)
    assert found["left"][0] == pytest.approx(-2.0)
    turning = np.interp(AT, stations, (-2.0, 0.0, 5.0, 5.0, 0.0, -2.0))
    assert np.abs(found["left"] - turning).max() < 1e-4


def test_run_outs_of_several_rates_have_the_guidelines_crossfall(tmp_path: Path) -> None:
    stations = (190.0, 210.0, 320.0, 520.0, 630.0, 685.0)
    _, found, _, remarks = taken(written(tmp_path, superelevation(stations)))
    assert found["right"][0] == 2.5
    assert found["left"][0] == -2.5
    assert any("run-outs have several rates, and 2.5 % are taken" in text for text in remarks)


def test_a_bend_that_begins_before_the_road_does(tmp_path: Path) -> None:
    """The road begins within its run-off: the bend is the first 320 m, of which the stations are moved."""
    stations = tuple(s - 180.0 for s in STATIONS[:2]) + (320.0, 520.0, 810.0, 955.0)
    _, found, _, _ = taken(written(tmp_path, superelevation(stations)))
    turning = np.interp(AT, stations, (-2.5, 0.0, 5.0, 5.0, 0.0, -2.5))
    assert found["left"][0] == pytest.approx(np.interp(0.0, (-25.0, 30.0), (-2.5, 0.0)))
    assert np.abs(found["left"] - turning).max() < 1e-4


def test_all_else_is_drawn_as_without_it(tmp_path: Path) -> None:
    with_it, found, _, _ = taken(written(tmp_path, superelevation()))
    (tmp_path / "none").mkdir()
    without, usual, report, _ = taken(written(tmp_path / "none", ""))
    assert "whole" not in report
    assert np.abs(found["left"] - usual["left"]).max() > 0.5
    for side in ("left", "right"):
        plain = without.carriageway(side)
        assert with_it.carriageway(side).model_copy(update={"crossfall": plain.crossfall}) == plain


LOST = {
    "without a station": (superelevation().replace("BeginRunoutSta", "Other"), "BeginRunoutSta is missing"),
    "adverse": (superelevation(more="<AdverseSE>adverse</AdverseSE>"), "it is adverse"),
    "back": (superelevation((155.0, 210.0, 320.0, 300.0, 630.0, 685.0)), "its stations don't grow"),
    "beyond": (superelevation(tuple(s + 1000.0 for s in STATIONS)), "it lies beyond the alignment's ends"),
    "neither": (superelevation(full=0.5), "FullSuperelev is neither a ratio nor a percentage"),
    "steep": (superelevation(full=15.0), "FullSuperelev is neither a ratio nor a percentage"),
    "no number": (superelevation().replace("5.0</Full", "five</Full"), "a number is none"),
    "no bend": (superelevation((10.0, 60.0, 90.0, 110.0, 140.0, 190.0)), "the alignment doesn't bend one way"),
    "twice": (superelevation(more="<FullSuperSta>330.0</FullSuperSta>"), "a station comes twice"),
    "small": (superelevation(full=1.5), "below the 2.5 % of straights"),
    "overlap": (superelevation() + superelevation(), "it overlaps that of another curve"),
    "equations": (
        superelevation() + "<StaEquation staInternal='100' staBack='100' staAhead='500'/>",
        "beside station equations",
    ),
}


@pytest.mark.parametrize(("rest", "why"), LOST.values(), ids=LOST)
def test_what_no_crossfall_holds_is_told_and_exit_code_3(
    tmp_path: Path, rest: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, rest)
    assert main(["road", str(path), "--output", str(tmp_path / "out")]) == 3
    assert why in capsys.readouterr().out
    report = json.loads((tmp_path / "out" / "road.json").read_text())
    assert [text for text in report["left_out"] if text.startswith("crossfall: ") and why in text]
    assert main(["road", str(path), "--output", str(tmp_path / "axis"), "--only-axis"]) == 0


def test_one_bend_of_two_is_taken(tmp_path: Path) -> None:
    adverse = superelevation((700.0, 710.0, 720.0, 730.0, 740.0, 750.0), more="<AdverseSE>adverse</AdverseSE>")
    _, found, report, _ = taken(written(tmp_path, superelevation() + adverse))
    assert np.abs(found["left"] - wanted(False)["left"]).max() < 1e-4
    assert report["whole"]["surface_lost"]


def test_cross_sections_lanes_and_speeds_are_counted(tmp_path: Path) -> None:
    sections = "<CrossSects><CrossSect sta='0'/><CrossSect sta='50'/></CrossSects>"
    lanes = "<Lanes><ThruLane width='3.5'/><ThruLane width='3.5'/><ClimbLane/></Lanes><Speeds><DesignSpeed/></Speeds>"
    roads = f"<Roadways><Roadway alignmentRefs='other main'>{lanes}</Roadway></Roadways>"
    path = written(tmp_path, sections, roads=roads)
    (line,) = read_lines(path)
    assert line.left_out == (
        "crossfall: 2 cross-sections, which don't say what of them is paved",
        "lanes: 1 ClimbLane, 2 ThruLane",
        "speed limits: 1 of the roadway",
    )
    assert main(["road", str(path), "--output", str(tmp_path / "out")]) == 3
