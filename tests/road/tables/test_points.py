"""Tables of vertical points, crossfall and widths: edits of one row, and what moves along with the elements."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.geometry import RoadGeometry, profile_of
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.tables import points as table
from synthroads_addon.road.tables.elements import with_inserted, with_length, without
from synthroads_addon.road.tables.stated import StatedRoad
from synthroads_addon.road.things.thing import Thing
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario


@pytest.fixture(scope="module")
def road() -> RoadParameters:
    return sample_road(RoadScenario(length=2000.0), 7)


@pytest.mark.parametrize("seed", range(6))
def test_a_stated_road_is_kept_exactly(seed: int) -> None:
    parameters = sample_road(RoadScenario(length=900.0), seed)
    stated = StatedRoad.of(parameters)
    assert stated.applied(parameters) == parameters
    edited = stated.with_elements(with_length(stated.alignment.horizontal, 0, 33.333))
    assert StatedRoad.from_json(edited.to_json()) == edited
    once = edited.applied(parameters)
    assert once.alignment == edited.alignment
    assert StatedRoad.of(once).applied(once) == once


def test_inserted_rows_leave_the_road_as_it_is(road: RoadParameters) -> None:
    station = np.linspace(-50.0, 2100.0, 300)
    axis = road.alignment
    for number in range(len(axis.vertical) + 1):
        changed = table.with_vertical_point_inserted(axis, number)
        assert len(changed.vertical) == len(axis.vertical) + 1
        if 0 < number < len(axis.vertical):
            assert np.allclose(profile_of(changed).elevation(station), profile_of(axis).elevation(station), atol=1e-8)
    carriageway = road.carriageway("right")
    assert carriageway
    geometry = RoadGeometry(road)
    for number in range(1, len(carriageway.crossfall)):
        changed_side = table.with_crossfall_point_inserted(carriageway, number)
        before, after = geometry.crossfall(carriageway, station), geometry.crossfall(changed_side, station)
        assert np.allclose(before, after, atol=1e-9)
    varied = table.with_width_inserted(carriageway, "Lane 1", 1)
    assert table.width_rows(varied, "Lane 1") == [(0.0, 3.75), (100.0, 3.75)]
    assert table.without_width(varied, "Lane 1", 1) == carriageway


def test_rows_of_widths_are_the_strips(road: RoadParameters) -> None:
    carriageway = road.carriageway("left")
    assert carriageway
    for strip in table.strip_names(carriageway):
        changed = table.with_width(carriageway, strip, 0, width=2.0)
        assert table.width_rows(changed, strip) == [(0.0, 2.0)]
        others = [name for name in table.strip_names(carriageway) if name != strip]
        assert all(table.width_rows(changed, name) == table.width_rows(carriageway, name) for name in others)


def test_what_stands_on_the_road_moves_along_and_what_was_deleted_is_gone(road: RoadParameters) -> None:
    stated = StatedRoad.of(road)
    elements = stated.alignment.horizontal
    border = elements[0].length + elements[1].length
    longer = stated.with_elements(with_inserted(elements, 2, "line", road.design_class))
    added = longer.alignment.horizontal[2].length
    things = [(name, item) for name, item in road.of_type(Thing).items() if hasattr(item, "station")]
    assert len(things) > 20
    changed = longer.applied(road)
    for name, item in things:
        moved = changed.objects[name]
        behind = added if item.station > border else 0.0
        assert moved.station == pytest.approx(item.station + behind, abs=1e-5)  # type: ignore[attr-defined]
        assert moved.offset == item.offset  # type: ignore[attr-defined]
    # Vertical points keep their stations, run-offs keep their places on the elements.
    assert changed.alignment.vertical == road.alignment.vertical
    shorter = stated.with_elements(without(elements, 2)).applied(road)
    end = border + elements[2].length
    for name, item in things:
        assert (name in shorter.objects) == (not border < item.station < end)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            lambda r: table.with_vertical_point(r.alignment, 1, station=3000.0),
            "Station of Vertical Point 2 is 3000.0: must be above 0 and below",
        ),
        (
            lambda r: table.with_vertical_point(r.alignment, 1, elevation=90.0),
            "Height of Vertical Point 2 is 90.0: the roundings of points 1 and 2 would overlap",
        ),
        (
            lambda r: table.with_vertical_point(r.alignment, 1, radius=-1.0),
            "Radius of Vertical Point 2 is -1.0: must be greater than or equal to 0",
        ),
        (
            lambda r: table.with_crossfall_point(r.carriageway("right"), 0, crossfall_percent=50.0),
            "Crossfall of Crossfall Point 1 is 50.0: must be less than or equal to 12",
        ),
        (
            lambda r: table.with_width(r.carriageway("right"), "Lane 1", 0, width=9.0),
            "Width of Lane 1 is 9.0: must be less than or equal to 6",
        ),
        (
            lambda r: table.with_width(r.carriageway("right"), "Lane 1", 0, station=9.0),
            "Station of Lane 1 is 9.0: its width is the same everywhere: insert a row",
        ),
        (
            lambda r: table.without_width(r.carriageway("right"), "Verge", 0),
            "Delete Row of Verge: a strip needs one width at least",
        ),
    ],
)
def test_refusals_name_the_row_and_what_is_allowed(edit: object, message: str, road: RoadParameters) -> None:
    with pytest.raises(InputError) as caught:
        edit(road)  # type: ignore[operator]
    assert str(caught.value).startswith(message)


def test_a_damaged_statement_is_refused() -> None:
    with pytest.raises(InputError, match="its table in the file is damaged"):
        StatedRoad.from_json("{}")
