"""Instance numbers of parts and passes: unique, stable, and named."""

from __future__ import annotations

from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.instances import LARGEST, InstanceNumbers
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.roads.parameter_sets import SMALL_ROAD

HOLE = {"station": 20.0, "offset": -6.0, "length": 0.5, "width": 0.4, "depth": 0.03}
RUT = {"lane": 0, "start_station": 10.0, "end_station": 60.0, "depth": 0.01}
GROUND = {"half_width": 50.0, "embankment_height": 0.0, "undulation": 0.1, "wavelength": 50.0, "seed": 1}
PLANTS = {"band_start": 1.0, "band_end": 40.0, "height_min": 1.0, "height_max": 2.0, "seed": 2}
CAR = {"type": "Vehicle", "model": "car", "carriageway": "road", "lane": 0, "station": 10.0, "speed": 20.0}
LONG = {"kind": "line", "length": 99_000.0, "curvature_start": 0.0, "curvature_end": 0.0}
EXTRA: dict[str, Any] = {
    "ground": {"type": "Terrain", **GROUND},
    "meadow": {"type": "Vegetation", "kind": "grass", "species": "meadow", "density": 0.5, **PLANTS},
    "birch": {"type": "Vegetation", "kind": "tree", "species": "birch", "density": 0.02, **PLANTS},
    "car": CAR,
    "bus": CAR | {"model": "bus", "station": 60.0},
}


def numbers(first: int = 5, **changes: Any) -> InstanceNumbers:
    objects = {name: dict(item) for name, item in SMALL_ROAD["objects"].items()}
    objects["road"]["pavement"] = {"ruts": [RUT], "potholes": [HOLE, HOLE]}
    for number, (name, item) in enumerate(EXTRA.items()):
        objects[name] = item | {"instance": first + number}
    for path, value in changes.items():
        name, field = path.split("__")
        objects[name][field] = value
    return InstanceNumbers(RoadParameters.from_dict(SMALL_ROAD | {"objects": objects}))


def test_every_part_and_pass_has_a_number_and_a_name_of_its_own() -> None:
    made = numbers()
    named: dict[int, str | None] = {}
    for name, parts in made.parts.items():
        for part in range(parts.count):
            text, number = made.part(name, part)
            assert number not in named
            named[number] = text
            assert made.name_of(number) == text
            assert made.owner(number) == name
    assert min(named) == 10, "the lowest free number"
    expected = ["road/rut-0", "road/pothole-1", "road/pothole-2", "line/dash-0", "line/dash-5"]
    assert [name for name in named.values() if name in expected] == expected
    assert {f"meadow/{strip}" for strip in ("left-band", "right-verge", "median")} <= set(named.values())
    assert made.parts["birch"].count == 300, "100 m with 100 x 0.02 x 1.5 places each"
    passes = [made.passes[name].number(own, n) for name, own in (("car", 8), ("bus", 9)) for n in range(3)]
    assert len({*passes, *named}) == len(named) + 6
    told = [made.name_of(number) for number in passes]
    assert told == ["car", "car/pass-1", "car/pass-2", "bus", "bus/pass-1", "bus/pass-2"]
    assert made.owner(passes[2]) == "car"
    assert made.name_of(10**7 + 1 + passes[0]) is not None, "vehicles come again for ever"
    assert InstanceNumbers(RoadParameters.from_dict(SMALL_ROAD)).name_of(10**7) is None


@pytest.mark.parametrize(
    "change",
    [{"line__dash_length": 2.0, "line__gap_length": 2.0}, {"birch__density": 0.04}, {"line__start_station": 30.0}],
    ids=str,
)
def test_what_is_edited_in_the_panel_leaves_the_numbers_of_all_else(change: dict[str, float]) -> None:
    before, after = numbers(), numbers(**change)
    assert {name: one.first for name, one in before.parts.items()} == {
        name: one.first for name, one in after.parts.items()
    }
    assert before.passes == after.passes


def test_objects_may_have_the_largest_numbers() -> None:
    made = numbers(LARGEST - 4)
    assert made.parts["road"].first == 5
    assert made.name_of(LARGEST) == "bus"


def test_too_many_parts_are_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"objects.birch is \d+: consists of so many parts"):
        numbers(birch__density=50.0, ground__half_width=1000.0, alignment__horizontal=[LONG])


def test_the_report_names_where_the_numbers_begin() -> None:
    told = numbers().to_dict()
    assert told["parts"]["line"] == {"instance": 3, "part": "dash", "first": 13, "count": 6}  # type: ignore[index]
    assert set(told["passes"]) == {"car", "bus"}  # type: ignore[call-overload]
