"""Every thing of the registry in several variants, as libraries and plain JSON read it back from each format."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things import body
from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.road.things.thing import LengthwiseThing, StandingThing, Thing
from synthroads_addon.twin.cityjson.writer import write_cityjson
from synthroads_addon.twin.opendrive.writer import write_opendrive
from synthroads_addon.twin.things import PlacedThing, placed_things
from tests.helpers.files.cityjson_files import read_city
from tests.helpers.files.ifc_reading import body as ifc_body
from tests.helpers.files.ifc_reading import parts, written
from tests.helpers.files.opendrive_reader import Roads, corners_local, number
from tests.helpers.roads.furnished_data import road_data
from tests.helpers.roads.thing_variants import placed, straight_road

MILLIMETRE = 1.1e-3
TOLERANCE = 0.005
READERS: dict[str, Callable[[RoadParameters, Path], dict[str, Float]]] = {}


def road(most: int) -> RoadParameters:
    return RoadParameters.from_dict(road_data(straight_road(placed(most=most)), 300.0))


def reads(name: str) -> Callable[[Any], Any]:
    """Register what reads the corners (N, 3) of every thing, local, from a format's file."""

    def register(read: Any) -> Any:
        READERS[name] = read
        return read

    return register


@reads("cityjson")
def read_cityjson(parameters: RoadParameters, folder: Path) -> dict[str, Float]:
    write_cityjson(parameters, folder / "a.city.json", TOLERANCE)
    city, found = read_city(folder / "a.city.json"), {}
    for name, item in json.loads((folder / "a.city.json").read_text())["CityObjects"].items():
        for shape in item.get("geometry", ()):
            if "Solid" in shape["type"]:
                corners = city.vertices[list(set(_flat(shape["boundaries"])))] - parameters.transform.translate
                found.setdefault(name.split("/")[0], []).append(corners)
    return {name: np.concatenate(pieces) for name, pieces in found.items()}


def _flat(nested: Any) -> Iterator[int]:
    if isinstance(nested, int):
        yield nested
    else:
        for inner in nested:
            yield from _flat(inner)


@reads("ifc")
def read_ifc(parameters: RoadParameters, folder: Path) -> dict[str, Float]:
    file, found = written(parameters, folder), {}
    for item in file.by_type("IfcProduct"):
        if isinstance(parameters.objects.get(item.Name or ""), Thing):
            shown = [part for part in _elements(item) if part.Representation]
            if shown:
                found[item.Name] = np.concatenate([ifc_body(part)[0] for part in shown])
    return found


def _elements(item: Any) -> Iterable[Any]:
    """Yield an element's parts, and of a bridge's parts what they contain."""
    for part in parts(item):
        yield part
        for relation in getattr(part, "ContainsElements", ()):
            yield from relation.RelatedElements


@reads("opendrive")
def read_opendrive(parameters: RoadParameters, folder: Path) -> dict[str, Float]:
    write_opendrive(parameters, folder / "a.xodr", TOLERANCE)
    read, found = Roads.read(folder / "a.xodr"), {}
    for item in read.objects().values():
        outlines = corners_local(item)
        if outlines:
            heading = float(item.attrib["hdg"]) + np.deg2rad(30.0)
            ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
            left = np.array([-ahead[1], ahead[0], 0.0])
            u, v, low, tall = np.concatenate(outlines).T
            foot = read.place(item) - parameters.transform.translate
            plan = foot + u[:, None] * ahead + v[:, None] * left
            up = np.array([0.0, 0.0, 1.0])
            found[item.attrib["name"]] = np.concatenate([plan + low[:, None] * up, plan + (low + tall)[:, None] * up])
    return found


def _extent(thing: PlacedThing, points: Float) -> Float:
    """Return the box (2, 3) around local points in a thing's frame."""
    if thing.frame:
        away = points - thing.frame.origin
        points = np.column_stack([away[:, :2] @ thing.frame.right, away[:, :2] @ thing.frame.along, away[:, 2]])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def differences(name: str, parameters: RoadParameters, folder: Path) -> dict[str, float]:
    """Return how far the boxes around the bodies that a format has are off those of the things, m."""
    found, off = READERS[name](parameters, folder), {}
    for thing in placed_things(RoadGeometry(parameters), TOLERANCE):
        left_out = thing.thing.signals() if name == "opendrive" and isinstance(thing.thing, StandingThing) else {}
        bodies = [item for item in thing.bodies if not item.detail and item.part not in left_out]
        if name == "opendrive" and isinstance(thing.thing, LengthwiseThing):
            continue
        if bodies:
            corners = np.concatenate([thing.local_sections(item).reshape(-1, 3) for item in bodies])
            off[thing.name] = float(np.abs(_extent(thing, corners) - _extent(thing, found[thing.name])).max())
    return off


@pytest.mark.parametrize("name", list(READERS))
@pytest.mark.parametrize("most", [1, pytest.param(100, marks=pytest.mark.slow)])
def test_bodies_read_back_are_the_things(name: str, most: int, tmp_path: Path) -> None:
    off = differences(name, road(most), tmp_path)
    shaped = [kind for kind in THINGS if kind != "Asset"]
    standing = [kind for kind in shaped if issubclass(THINGS[kind], StandingThing)]
    assert len(off) >= len(standing if name == "opendrive" else shaped)
    assert {thing: away for thing, away in off.items() if away > MILLIMETRE} == {}


@pytest.mark.parametrize("most", [1, pytest.param(100, marks=pytest.mark.slow)])
def test_barriers_read_back_from_opendrive(most: int, tmp_path: Path) -> None:
    parameters = road(most)
    write_opendrive(parameters, tmp_path / "a.xodr", TOLERANCE)
    known = {item.attrib["name"]: item for item in Roads.read(tmp_path / "a.xodr").objects().values()}
    for name, item in parameters.of_type(LengthwiseThing).items():
        (first, *_), right, left = known[name].findall("repeat"), *item.reach()
        assert number(first, "widthStart") == pytest.approx(right + left, abs=1e-9)
        highest = max(number(repeat, "heightStart") for repeat in known[name].findall("repeat"))
        assert highest == pytest.approx(item.height, abs=MILLIMETRE)
        corners = np.concatenate([body_.sections.reshape(-1, 3) for body_ in _bodies(parameters, name)])
        _, offset = RoadGeometry(parameters).alignment.project(corners[:, :2])
        if item.type != "TemporaryBarrier":
            assert offset.max() - item.offset == pytest.approx(left, abs=MILLIMETRE)
            assert item.offset - offset.min() == pytest.approx(right, abs=MILLIMETRE)


def _bodies(parameters: RoadParameters, name: str) -> list[body.Body]:
    things = placed_things(RoadGeometry(parameters), TOLERANCE)
    return next([item for item in thing.bodies if not item.detail] for thing in things if thing.name == name)


@pytest.mark.parametrize("name", list(READERS))
def test_two_millimetres_are_seen(name: str, tmp_path: Path) -> None:
    """A file of posts that are taller is not the things'."""
    parameters = RoadParameters.from_dict(road_data(straight_road(placed(["Pole"], most=1)), 300.0))
    data = parameters.to_dict()
    data["objects"]["pole-0"]["height"] += 0.002
    read = READERS[name]
    READERS[name] = lambda _, folder: read(RoadParameters.from_dict(data), folder)
    try:
        assert differences(name, parameters, tmp_path)["pole-0"] > MILLIMETRE
    finally:
        READERS[name] = read
