"""Markings over damage: what cracks break, what patches take away, and what is left of lines that were ground off."""

from copy import deepcopy

import numpy as np
import pytest
from shapely import Polygon, box, union_all

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.paint import arrow_outlines, hatching_outlines
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.clipping import split_outline, subtract
from synthroads_addon.road.pavement.cover import MarkingFilms, painted_outlines
from synthroads_addon.road.pavement.outlines import crack_outlines
from synthroads_addon.road.section import Arrow, Hatching
from synthroads_addon.sampling.road import sample_road
from tests.helpers.effects.road_cases import TURNOUTS, base_road
from tests.helpers.roads.damage_outlines import damaged_road
from tests.helpers.roads.sampled_parts import scenario


def area(outlines: list[np.ndarray]) -> float:
    return union_all([Polygon(outline) for outline in outlines]).area


def test_pieces_of_an_outline_make_it_up_and_don_t_overlap() -> None:
    rng, square = np.random.default_rng(3), np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    for _ in range(50):
        turn = np.sort(rng.uniform(0.0, 2.0 * np.pi, 5))
        hole = rng.uniform(-0.5, 2.0, 2) + 0.6 * np.column_stack([np.cos(turn), np.sin(turn)])
        inside, outside = split_outline(square, hole)
        pieces = outside + ([] if inside is None else [inside])
        assert sum(Polygon(piece).area for piece in pieces) == pytest.approx(2.0)
        shared = Polygon(square).intersection(Polygon(hole)).area
        assert (0.0 if inside is None else Polygon(inside).area) == pytest.approx(shared, abs=1e-9)
        assert area(subtract(square, [hole])) == pytest.approx(2.0 - shared)


def test_a_patch_takes_an_arrow_s_film_away() -> None:
    road = damaged_road()
    geometry, (arrow,) = RoadGeometry(road), road.of_type(Arrow).values()
    patches = [Polygon(patch.outline).convex_hull for patch in road.carriageway_of(arrow).pavement.patches]
    whole = union_all([Polygon(part) for part in arrow_outlines(arrow)])
    left = union_all([Polygon(part) for part in painted_outlines(geometry, arrow)])
    assert whole.area - left.area > 0.05
    assert left.symmetric_difference(whole.difference(union_all(patches))).area < 1e-9


def test_a_crack_goes_through_an_arrow_and_a_hatched_area_on_their_films() -> None:
    objects = {"exit": {"type": "Turnout"} | TURNOUTS["exit"], "it": {"type": "Hatching", "turnout": "exit"}}
    objects["arrow"] = {"type": "Arrow", "carriageway": "right", "kind": "straight", "station": 12.0, "offset": -6.0}
    data = deepcopy(base_road(objects))
    line = [[10.0, -6.0], [14.0, -6.02], [58.0, -14.5]]
    data["objects"]["right"]["pavement"]["cracks"] = [{"kind": "transverse", "width": 0.02, "lines": [line]}]
    road = RoadParameters.from_dict(data)
    geometry, films = RoadGeometry(road), MarkingFilms(RoadGeometry(road), "right")
    legs = list(crack_outlines(road.carriageway("right").pavement.cracks[0]))
    pieces = list(films.cut(legs))
    assert sum(Polygon(piece).area for piece, _ in pieces) == pytest.approx(sum(Polygon(leg).area for leg in legs))
    crack = union_all([Polygon(leg) for leg in legs])
    for item in (*road.of_type(Arrow).values(), *road.of_type(Hatching).values()):
        parts = arrow_outlines(item) if isinstance(item, Arrow) else hatching_outlines(geometry, item)
        painted = union_all([Polygon(part) for part in parts]).intersection(crack)
        on_it = [Polygon(piece) for piece, film in pieces if film == item.film_thickness]
        assert painted.area > 0.005
        assert union_all(on_it).intersection(painted).area == pytest.approx(painted.area, rel=1e-6)
    beside = union_all([Polygon(piece) for piece, film in pieces if film == 0.0])
    assert beside.intersection(box(10.0, -7.0, 12.0, -5.0)).area < 0.04
    middle = np.array([12.0, 20.0])
    assert films.thickness(middle, np.array([-6.005, -3.2])).tolist() == [0.003, 0.0]


def test_pieces_of_cracks_have_the_film_that_lies_at_their_middle() -> None:
    limits = scenario(cross_section="RQ31", length=1000.0, turnouts={"exits": 1, "entries": 1, "emergency_bays": 0})
    road = sample_road(limits, 11)
    films = MarkingFilms(RoadGeometry(road), "right")
    pieces = list(
        films.cut([leg for crack in road.carriageway("right").pavement.cracks for leg in crack_outlines(crack)])
    )
    middles = np.array([piece.mean(axis=0) for piece, _ in pieces])
    found = [film for _, film in pieces]
    assert found == films.thickness(middles[:, 0], middles[:, 1]).tolist()
    assert sum(film > 0.0 for film in found) > 10


def test_widths_at_one_station_are_those_among_many() -> None:
    geometry = RoadGeometry(RoadParameters.from_dict(base_road({"exit": {"type": "Turnout"} | TURNOUTS["exit"]})))
    stations = np.linspace(0.0, geometry.length, 301)
    for section in geometry.sections.values():
        alone = np.concatenate([section.distances(station) for station in stations])
        assert np.array_equal(alone, section.distances(stations))
        crossfall = np.linspace(-0.05, 0.05, len(stations))
        heights = [section.elevations(stations[i : i + 1], crossfall[i : i + 1])[0] for i in range(len(stations))]
        assert np.array_equal(heights, section.elevations(stations, crossfall))
        assert np.isnan(section.distances([np.nan, stations[0]])[0, -1]) or not section.turnouts
