"""Axes that are written come in again as they were: our own IFC, and a small writer of LandXML."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters, StationEquation
from synthroads_addon.road_files.axis import road_axis
from synthroads_addon.sampling.road import sample_alignment, sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.formats import write_twin
from tests.judges.registry import require

EAST, NORTH = 500_000.0, 5_700_000.0
EQUATIONS = (StationEquation(station=150.0, ahead=20_000.0), StationEquation(station=300.0, ahead=900.0))


def drawn(seed: int) -> AlignmentObject:
    return sample_alignment(RoadScenario(length=1500.0), seed)


def landxml(path: Path, axis: AlignmentObject, first: float = 0.0, equations: str = "") -> Path:
    """Write an axis as an alignment of LandXML 1.2, metres, north before east."""
    alignment = alignment_of(axis)
    rows = []

    def point(name: str, place: np.ndarray) -> str:
        return f"<{name}>{float(place[1]) + NORTH!r} {float(place[0]) + EAST!r}</{name}>"

    for n, element in enumerate(alignment.elements):
        borders = alignment.element_starts[n : n + 2]
        ends = alignment.position(borders)
        places = point("Start", ends[0]) + point("End", ends[1])
        k = element.curvature_start, element.curvature_end
        rot = "ccw" if sum(k) > 0.0 else "cw"
        if element.kind == "line":
            rows.append(f"<Line>{places}</Line>")
        elif element.kind == "arc":
            heading = float(alignment.heading(borders[0]))
            centre = ends[0] + np.array([-np.sin(heading), np.cos(heading)]) / k[0]
            rows.append(f'<Curve rot="{rot}">{places}{point("Center", centre)}</Curve>')
        else:
            radii = ["INF" if each == 0.0 else repr(1.0 / abs(each)) for each in k]
            about = f'length="{element.length!r}" radiusStart="{radii[0]}" radiusEnd="{radii[1]}" rot="{rot}"'
            rows.append(f'<Spiral {about} spiType="clothoid">{places}</Spiral>')
    heights = []
    for n, row in enumerate(axis.vertical):
        place = f"{row.station + first!r} {row.elevation!r}"
        if row.radius and 0 < n < len(axis.vertical) - 1:
            before, after = axis.vertical[n - 1], axis.vertical[n + 1]
            rise = (row.elevation - before.elevation) / (row.station - before.station)
            fall = (after.elevation - row.elevation) / (after.station - row.station)
            heights.append(f'<ParaCurve length="{row.radius * abs(fall - rise)!r}">{place}</ParaCurve>')
        else:
            heights.append(f"<PVI>{place}</PVI>")
    profile = f'<Profile><ProfAlign name="p">{"".join(heights)}</ProfAlign></Profile>'
    text = f'<Alignment name="a" length="{axis.length!r}" staStart="{first!r}"><CoordGeom>{"".join(rows)}</CoordGeom>'
    head = '<LandXML version="1.2"><Units><Metric linearUnit="meter"/></Units><CoordinateSystem epsgCode="25832"/>'
    path.write_text(f"{head}<Alignments>{text}{equations}{profile}</Alignment></Alignments></LandXML>")
    return path


SEEDS = [*range(20), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(20, 50))]


@pytest.mark.parametrize("seed", SEEDS)
def test_drawn_axes_come_back_from_landxml_within_a_millimetre(tmp_path: Path, seed: int) -> None:
    truth = drawn(seed)
    axis, scenario, report = road_axis(landxml(tmp_path / "a.xml", truth, 1200.0), RoadScenario())
    station = np.linspace(0.0, truth.length, 200)
    shift = np.array(scenario.map_origin[:2]) - [EAST, NORTH]
    assert axis.length == pytest.approx(truth.length, abs=1e-3)
    off = alignment_of(axis).position(station) + shift - alignment_of(truth).position(station)
    assert np.hypot(*off.T).max() < 1e-3
    assert [e.kind for e in axis.horizontal] == [e.kind for e in truth.horizontal]
    assert axis.first_station == pytest.approx(1200.0)
    assert report["joints"]["drift"] < 1e-3


def test_our_own_ifc_comes_in_again_as_the_same_axis_with_its_stations(tmp_path: Path) -> None:
    require("ifcopenshell")
    scenario = RoadScenario(length=400.0)
    axis = sample_alignment(scenario, 3).model_copy(update={"first_station": 12_340.0, "equations": EQUATIONS})
    road = sample_road(scenario, 3, axis=axis)
    write_twin(road, tmp_path, ("ifc",), 0.02)
    again, there, _ = road_axis(tmp_path / "twin.ifc", RoadScenario())
    station = np.linspace(0.0, axis.length, 200)
    shift = np.array(there.map_origin[:2]) - road.transform.translate[:2]
    found = alignment_of(again).position(station) + shift
    assert np.hypot(*(found - alignment_of(road.alignment).position(station)).T).max() < 1e-3
    assert again.first_station == pytest.approx(12_340.0, abs=1e-6)
    assert [(e.station, e.ahead) for e in again.equations] == [
        (pytest.approx(e.station, abs=1e-6), pytest.approx(e.ahead)) for e in EQUATIONS
    ]


def test_station_equations_of_landxml_are_kept(tmp_path: Path) -> None:
    rows = '<StaEquation staAhead="5000" staBack="1400" staInternal="1400"/>'
    axis, _, _ = road_axis(landxml(tmp_path / "a.xml", drawn(1), 1200.0, rows), RoadScenario())
    assert [(e.station, e.ahead) for e in axis.equations] == [(200.0, 5000.0)]
    assert axis.counted(150.0) == pytest.approx(1350.0)
    assert axis.counted(250.0) == pytest.approx(5050.0)


def test_kilometre_boards_stand_where_the_count_says() -> None:
    scenario = RoadScenario(length=1500.0)
    base = sample_alignment(scenario, 3)
    equation = (StationEquation(station=700.0, ahead=3400.0),)
    road = sample_road(scenario, 3, axis=base.model_copy(update={"first_station": 12_340.0, "equations": equation}))
    assert boards(road) == {(160.0, "12,5"), (660.0, "13,0"), (800.0, "3,5"), (1300.0, "4,0")}
    assert boards(sample_road(scenario, 3, axis=base)) != boards(road)


def boards(road: RoadParameters) -> set[tuple[float, str]]:
    return {(round(item.station, 3), item.text) for item in road.objects.values() if item.type == "KilometreBoard"}


def test_sets_without_stations_read_as_before() -> None:
    data = drawn(2).model_dump()
    del data["first_station"], data["equations"]
    axis = AlignmentObject.model_validate(data)
    assert axis.first_station is None
    assert axis.counted(37.0) == 37.0
