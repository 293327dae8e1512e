"""Lines, hatching and arrows of sampled roads."""

from itertools import pairwise

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import width_at
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Arrow, Hatching, LineMarking
from synthroads_addon.sampling.road import sample_road
from tests.helpers.roads.sampled_parts import at, changed_lane, full_roads, sampled_roads, scenario, sides, tip


@pytest.fixture(scope="module")
def roads() -> list[RoadParameters]:
    return sampled_roads()


@pytest.fixture(scope="module")
def furnished() -> list[RoadParameters]:
    return full_roads()


def test_a_lane_line_runs_while_the_lane_beside_it_is_a_metre_wide(furnished) -> None:
    seen = 0
    for road in furnished:
        for name, carriageway, _ in sides(road):
            if (index := changed_lane(carriageway)) is None:
                continue
            boundary = 1 if index == 0 else index
            line = road.objects[f"{name}-line-{boundary}"]
            ends = np.array([line.start_station, line.end_station])
            widths = width_at(carriageway.lanes[index].width, ends)
            assert sorted(widths) == pytest.approx([1.0, max(p.width for p in carriageway.lanes[index].width)])
            others = [b for b in range(1, len(carriageway.lanes)) if b != boundary]
            for other in (road.objects[f"{name}-line-{b}"] for b in others):
                assert (other.start_station, other.end_station) == pytest.approx((0.0, road.alignment.length))
            seen += 1
    assert seen == 2 * len(furnished)


def lines(road: RoadParameters, carriageway: str, *kinds: str) -> list[LineMarking]:
    found = [m for m in road.of_type(LineMarking).values() if m.carriageway == carriageway and m.kind in kinds]
    return sorted(found, key=lambda line: line.start_station)


def test_outer_edge_and_block_take_turns_all_along(roads, furnished) -> None:
    for road in roads + furnished:
        for name, _, turnouts in sides(road):
            edge = lines(road, name, "outer_edge", "block")
            reached = 0.0
            for line in edge:
                assert line.start_station == pytest.approx(reached, abs=1e-6)
                assert line.width == 0.3
                assert (line.dash_length, line.gap_length) == ((6.0, 6.0) if line.kind == "block" else (0.0, 0.0))
                reached = line.end_station
            assert reached == pytest.approx(road.alignment.length)
            blocks = [line for line in edge if line.kind == "block"]
            ramped = [turnout for _, turnout in turnouts if turnout.ramp]
            assert len(blocks) == len(ramped)
            for block, turnout in zip(blocks, ramped, strict=True):
                span = sorted((at(turnout, 0.0), at(turnout, tip(turnout) - 30.0)))
                assert (block.start_station, block.end_station) == pytest.approx(tuple(span), abs=1e-6)


def test_exits_and_entries_have_their_lines_hatching_and_arrows(furnished) -> None:
    for road in furnished:
        geometry = RoadGeometry(road)
        hatched = [hatching.turnout for hatching in road.of_type(Hatching).values()]
        for _, carriageway, turnouts in sides(road):
            section = geometry.sections[carriageway.side]
            for key, turnout in turnouts:
                assert hatched.count(key) == (turnout.ramp is not None)
                own = {line.kind: line for line in road.of_type(LineMarking).values() if line.turnout == key}
                arrows = [item for name, item in road.of_type(Arrow).items() if name.startswith(f"{key}-arrow-")]
                if turnout.ramp is None:
                    assert not own
                    continue
                gore = sorted((at(turnout, tip(turnout)), at(turnout, turnout.length)))
                span = (own["gore_edge"].start_station, own["gore_edge"].end_station)
                assert span == pytest.approx(tuple(gore), abs=1e-6)
                taper = turnout.taper_in_length + turnout.taper_out_length
                edge = sorted((at(turnout, 0.6 * taper), at(turnout, turnout.length)))  # strip 0.5 m, line 0.3 m
                span = (own["turnout_edge"].start_station, own["turnout_edge"].end_station)
                assert span == pytest.approx(tuple(edge), abs=1e-6)
                for line in own.values():
                    stations = np.linspace(line.start_station + 0.02, line.end_station - 0.02, 50)
                    edges = np.abs(geometry.marking_edges(line, stations))
                    assert (edges.max(axis=0) <= section.paved_edge(stations) + 1e-6).all()
                assert len(arrows) >= 3 if turnout.kind == "exit" else not arrows
                for arrow in arrows:
                    inner, outer = section.boundaries_of("turnout_lane", [arrow.station])
                    assert carriageway.sign * arrow.offset == pytest.approx((inner[0] + outer[0]) / 2)
                    assert outer[0] - inner[0] == pytest.approx(turnout.lane_width)
                    assert arrow.rotation_deg == (0.0 if carriageway.traffic > 0 else 180.0)
                    assert arrow.kind == "straight_right"
                assert all(40.0 <= b - a <= 80.0 for a, b in pairwise(sorted(arrow.station for arrow in arrows)))


def test_arrows_lead_out_of_a_lane_before_it_ends(furnished) -> None:
    ends = 0
    for road in furnished:
        for name, carriageway, _ in sides(road):
            arrows = [arrow for key, arrow in road.of_type(Arrow).items() if key.startswith(f"{name}-merge")]
            index = changed_lane(carriageway)
            points = carriageway.lanes[index].width
            before, start = (points[0], points[1]) if carriageway.traffic > 0 else (points[3], points[2])
            if before.width == 0.0:
                assert not arrows
                continue
            room = abs(start.station - before.station) - 3.75
            assert len(arrows) == min(3, max(0, int((room - 20.0) // 60.0) + 1))
            section = RoadGeometry(road).sections[carriageway.side]
            for arrow in arrows:
                assert arrow.kind == ("merge_left" if index == 0 else "merge_right")
                assert carriageway.traffic * (start.station - arrow.station) >= 19.9
                boundaries = section.lane_boundaries([arrow.station])[0]
                assert boundaries[index] > carriageway.sign * arrow.offset > boundaries[index + 1]
            ends += 1
    assert ends > 10


def test_lane_lines_follow_the_scenario_and_films_are_alike() -> None:
    films = set()
    for seed in range(10):
        road = sample_road(scenario(length=900.0, markings={"lane_dash": 4.0, "lane_gap": 8.0}), seed)
        painted = [item for item in road.objects.values() if isinstance(item, LineMarking | Arrow | Hatching)]
        markings = [item for item in painted if item.color == "white"]
        assert len({item.film_thickness for item in markings}) == 1
        films.add(markings[0].film_thickness)
        for line in markings:
            if isinstance(line, LineMarking) and line.kind == "lane":
                assert (line.dash_length, line.gap_length) == (4.0, 8.0)
    assert len(films) == 10
