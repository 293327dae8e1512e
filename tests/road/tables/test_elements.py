"""The table of elements: exact both ways, and closed after every edit of a row."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.alignment import Alignment, Element
from synthroads_addon.road.other_roads.axis import HorizontalElement
from synthroads_addon.road.tables import elements as table
from synthroads_addon.road.tables.elements import ElementRow, element_rows, elements_of
from synthroads_addon.sampling.road import sample_alignment
from synthroads_addon.scenario.road import RoadScenario

SEEDS = range(200)
DRAWN = range(30)


def drawn(seed: int, length: float = 2500.0) -> table.Elements:
    return sample_alignment(RoadScenario(length=length), seed).horizontal


def stated_rows(seed: int) -> list[ElementRow]:
    """Rows as a person states them: numbers to the millimetre, curves of both hands, eggs and S-curves among them."""
    rng = np.random.default_rng(seed)
    rows, station, radius = [], 0.0, 0.0

    def put(kind: table.Kind, length: float, start: float, end: float, parameter: float = 0.0) -> None:
        nonlocal station
        rows.append(ElementRow(kind, station, length, start, end, parameter))
        station += length

    for _ in range(int(rng.integers(2, 6))):
        following = round(float(rng.uniform(250.0, 5000.0) * rng.choice([-1.0, 1.0])), 3)
        parameter = round(float(rng.uniform(100.0, 900.0)), 3)
        length = parameter**2 * abs(1.0 / following - (1.0 / radius if radius else 0.0))
        put("clothoid", length, radius, following, parameter)
        put("arc", round(float(rng.uniform(20.0, 900.0)), 3), following, following)
        radius = following
        if rng.random() < 0.5:
            parameter = round(float(rng.uniform(100.0, 900.0)), 3)
            put("clothoid", parameter**2 / abs(radius), radius, 0.0, parameter)
            put("line", round(float(rng.uniform(20.0, 2000.0)), 3), 0.0, 0.0)
            radius = 0.0
    return rows


@pytest.mark.parametrize("seed", SEEDS)
def test_a_stated_table_is_read_back_from_its_road_to_the_number(seed: int) -> None:
    rows = stated_rows(seed)
    back = element_rows(elements_of(rows))
    for row, there in zip(rows, back, strict=True):
        assert (there.kind, there.radius_start, there.radius_end) == (row.kind, row.radius_start, row.radius_end)
        assert there.parameter == row.parameter
        if row.kind != "clothoid":
            assert there.length == row.length
        assert there.station == pytest.approx(row.station, abs=1e-5)


def test_tables_of_drawn_roads_state_the_same_roads() -> None:
    """Within the micrometre to which a table's numbers are rounded."""
    for seed in DRAWN:
        elements = drawn(seed)
        again = elements_of(element_rows(elements))
        assert [e.kind for e in again] == [e.kind for e in elements]
        assert np.allclose([e.length for e in again], [e.length for e in elements], rtol=0.0, atol=1e-5)
        radii = [[(row.radius_start, row.radius_end) for row in element_rows(e)] for e in (elements, again)]
        assert radii[0] == radii[1]


def jumps(elements: table.Elements) -> list[float]:
    return [abs(a.curvature_end - b.curvature_start) for a, b in pairwise(elements)]


def axis_of(elements: table.Elements) -> Alignment:
    return Alignment([Element(e.length, e.curvature_start, e.curvature_end) for e in elements])


@pytest.mark.parametrize("seed", range(12))
def test_edits_keep_the_curvature_continuous_and_move_what_follows_along(seed: int) -> None:
    elements = drawn(seed)
    rng = np.random.default_rng(seed)
    for number, element in enumerate(elements):
        if element.kind == "arc":
            radius = round(float(rng.uniform(900.0, 3000.0)) * math.copysign(1.0, element.curvature_start), 3)
            edit = table.with_radius(elements, number, radius)
            assert element_rows(edit.elements)[number].radius == radius
            before, after = element_rows(elements), element_rows(edit.elements)
            for beside in (number - 1, number + 1):  # which keep their A
                if 0 <= beside < len(elements):
                    assert after[beside].parameter == pytest.approx(before[beside].parameter, abs=1e-5)
        elif element.kind == "clothoid":
            parameter = round(float(rng.uniform(300.0, 900.0)), 3)
            edit = table.with_parameter(elements, number, parameter)
            assert element_rows(edit.elements)[number].parameter == parameter
        else:
            length = round(float(rng.uniform(20.0, 1500.0)), 3)
            edit = table.with_length(elements, number, length)
            assert element_rows(edit.elements)[number].length == length
        assert max(jumps(edit.elements)) <= max(jumps(elements)) + 1e-15
        # What follows has its form still: its chords are as long as before.
        first = number + 2
        if first < len(elements):
            axes = [axis_of(elements), axis_of(edit.elements)]
            chords = []
            for axis in axes:
                places = axis.position(axis.element_starts[first:])
                chords.append(np.hypot(*np.diff(places, axis=0).T))
            assert np.allclose(*chords, atol=1e-9)
            border = float(axes[0].element_starts[first])
            assert edit.stations(border) == pytest.approx(float(axes[1].element_starts[first]), abs=1e-6)


def test_a_split_road_is_the_same_road() -> None:
    for seed in range(6):
        elements = drawn(seed)
        for number, element in enumerate(elements):
            split = table.with_split(elements, number, 0.37 * element.length).elements
            assert len(split) == len(elements) + 1
            axes = axis_of(elements), axis_of(split)
            station = np.linspace(0.0, axes[0].length, 50)
            assert np.allclose(axes[0].position(station), axes[1].position(station), atol=1e-9)


def test_inserting_and_deleting_moves_what_follows() -> None:
    elements = drawn(3)
    edit = table.with_inserted(elements, 2, "line", "EKA1A")
    new = edit.elements[2]
    assert (new.kind, new.length) == ("line", 72.223)  # two seconds at 130 km/h, rounded up to the millimetre
    border = elements[0].length + elements[1].length
    assert edit.stations(border) == pytest.approx(border)
    assert edit.stations(border + 10.0) == pytest.approx(border + 10.0 + new.length, abs=1e-5)
    back = table.without(edit.elements, 2)
    assert back.elements == elements
    whole = edit.stations.then(back.stations)
    for station in (0.0, 10.0, border, border + 50.0, 2000.0):
        assert whole(station) == pytest.approx(station, abs=2e-6)
    gone = table.without(elements, 1).stations
    assert gone.is_deleted(elements[0].length + 1.0)
    assert not gone.is_deleted(elements[0].length - 1.0)
    assert not gone.is_deleted(border + 1.0)


def test_a_clothoid_is_inserted_where_the_curvature_jumps() -> None:
    straight, arc = HorizontalElement.between(100.0, 0.0, 0.0), HorizontalElement.between(100.0, 1e-3, 1e-3)
    edit = table.with_clothoid_between((straight, arc), 1, "EKA1A")
    assert [e.kind for e in edit.elements] == ["line", "clothoid", "arc"]
    assert max(jumps(edit.elements)) == 0.0
    assert table.clothoid_parameter(edit.elements[1]) == pytest.approx(340.0)  # R / 3, of whole ten metres
    kinked = (straight, HorizontalElement.between(90.0, 0.0, 5e-4), arc)
    fitted = table.with_clothoid_between(kinked, 2, "EKA1A").elements
    assert max(jumps(fitted)) == 0.0
    assert table.clothoid_parameter(fitted[1]) == pytest.approx(table.clothoid_parameter(kinked[1]))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda e: table.with_length(e, 0, 0.0), "Length of Element 1 is 0.0: must be from 0.01 to 1,000,000 m"),
        (lambda e: table.with_radius(e, 2, 5.0), "Radius of Element 3 is 5.0: must be from 10 to 1,000,000 m"),
        (lambda e: table.with_radius(e, 2, 0.0), "Radius of Element 3 is 0.0: an arc needs one"),
        (lambda e: table.with_parameter(e, 0, 100.0), "A of Element 1 is 100.0: only a clothoid has one"),
        (lambda e: table.with_split(e, 0, 100.0), "Distance in Element 1 is 100.0: must be from 0.01 to 99.99 m"),
        (lambda e: table.with_end_radius(e, 1, 900.0, True), "Radius at End of Element 2 is 900.0: the element beside"),
        (lambda e: table.with_kind(e, 0, "clothoid", "EKA1A"), "Kind of Element 1 is 'Clothoid': both neighbours"),
        (lambda e: table.with_inserted(e, 0, "clothoid", "EKA1A"), "Insert Clothoid: both neighbours have the same"),
        (lambda e: table.without(e[:1], 0), "Delete Element: a road needs one element at least"),
    ],
)
def test_refusals_name_the_row_and_what_is_allowed(edit: object, message: str) -> None:
    elements = (
        HorizontalElement.between(100.0, 0.0, 0.0),
        HorizontalElement.between(90.0, 0.0, 1e-3),
        HorizontalElement.between(100.0, 1e-3, 1e-3),
    )
    with pytest.raises(InputError) as caught:
        edit(elements)  # type: ignore[operator]
    assert str(caught.value).startswith(message)
