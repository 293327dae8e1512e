"""Reading the reports beside twins, and looking in each format's file for what they tell."""

from __future__ import annotations

import csv
import json
import sqlite3
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.surroundings import Vegetation
from synthroads_addon.twin.formats import FORMATS, report_file_name
from synthroads_addon.twin.plants import placed_plants

Entity = dict[str, Any]


@dataclass(frozen=True)
class TwinReport:
    """A report: what became of each instance number of a file."""

    data: dict[str, Any]

    @property
    def entities(self) -> dict[int, list[Entity]]:
        return {row["instance"]: row["entities"] for row in self.data["instances"]}

    @property
    def lost(self) -> dict[int, str]:
        return {row["instance"]: row["reason"] for row in self.data["lost"]}

    @property
    def ids(self) -> dict[int, str]:
        return {row["instance"]: row["id"] for key in ("instances", "lost") for row in self.data[key]}

    def knows(self, number: int) -> bool:
        """Return whether the report tells a number, or its vehicle's whose later pass it is, or says why it doesn't."""
        known = self.entities.keys() | self.lost.keys()
        passes = (
            row["instance"]
            for row in self.data["passes"]
            if number >= row["first_pass_instance"] and (number - row["first_pass_instance"]) % row["pass_step"] == 0
        )
        return number in known or any(vehicle in known for vehicle in passes)


def read_report(folder: Path, name: str) -> TwinReport:
    return TwinReport(json.loads((folder / report_file_name(name)).read_text(encoding="utf-8")))


def numbers_of(road: RoadParameters) -> dict[int, str]:
    """Return every number that points can have at the first pass, and its id."""
    geometry = RoadGeometry(road)
    numbers = geometry.numbers
    found = {plant.instance: plant.name for plant in placed_plants(geometry)}
    for name, item in road.objects.items():
        dashed = isinstance(item, LineMarking) and item.dash_length
        if not isinstance(item, Vegetation) and not dashed:
            found[item.instance] = name
        if name in numbers.parts and not (isinstance(item, Vegetation) and item.kind != "grass"):
            count = len(geometry.dashes(item)) * bool(dashed) if isinstance(item, LineMarking) else None
            parts = range(numbers.parts[name].count if count is None else count)
            found |= dict(reversed(numbers.part(name, part)) for part in parts)
    return found


def numbers_in(folder: Path, name: str) -> Callable[[Entity], int]:
    """Return what looks an entity of a report up in its format's file, and returns the instance number there."""
    path = folder / FORMATS[name].file
    lookers = {"cityjson": _city, "ifc": _ifc, "opendrive": _opendrive, "geojson": _geojson, "opencrg": _opencrg}
    return (lookers | {"geopackage": _geopackage, "inventory": _inventory, "lanelet2": _lanelet2})[name](path)


def _city(path: Path) -> Callable[[Entity], int]:
    objects = json.loads(path.read_text(encoding="utf-8"))["CityObjects"]

    def look(entity: Entity) -> int:
        item = objects[entity["object"]]
        if "surface" not in entity:
            return int(item["attributes"]["instance"])
        (shape,) = item["geometry"]
        return int(shape["semantics"]["surfaces"][entity["surface"]]["instance"])

    return look


def _ifc(path: Path) -> Callable[[Entity], int]:
    import ifcopenshell
    from ifcopenshell.util.element import get_pset

    file = ifcopenshell.open(str(path))

    def look(entity: Entity) -> int:
        item = file.by_guid(entity["GlobalId"])
        assert item.is_a() == entity["entity"]
        return int(get_pset(item, "SynthRoads")["instance"])

    return look


def _opendrive(path: Path) -> Callable[[Entity], int]:
    roads = {int(road.get("id", "")): road for road in ElementTree.parse(path).getroot().iter("road")}

    def look(entity: Entity) -> int:
        element = roads[entity["road"]]
        if entity["element"] in ("object", "signal", "tunnel"):
            (element,) = [e for e in element.iter(entity["element"]) if int(e.get("id", "")) == entity["id"]]
        if "section" in entity:
            (section,) = [e for e in element.iter("laneSection") if float(e.get("s", "")) == entity["section"]]
            (element,) = [e for e in section.iter("lane") if int(e.get("id", "")) == entity["lane"]]
        if "mark" in entity:
            element = element.findall("roadMark")[entity["mark"]]
        (number,) = [d.get("value", "") for d in element.findall("userData") if d.get("code") == "instance"]
        return int(number)

    return look


def _geojson(path: Path) -> Callable[[Entity], int]:
    features = json.loads(path.read_text(encoding="utf-8"))["features"]
    return lambda entity: int(features[entity["feature"]]["properties"]["instance"])


def _geopackage(path: Path) -> Callable[[Entity], int]:
    database = sqlite3.connect(path)

    def look(entity: Entity) -> int:
        ((number,),) = database.execute(f"SELECT instance FROM {entity['layer']} WHERE fid = ?", (entity["fid"],))
        return int(number)

    return look


def _inventory(path: Path) -> Callable[[Entity], int]:
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return lambda entity: int(rows[entity["row"] - 1]["instance"])


def _opencrg(path: Path) -> Callable[[Entity], int]:
    header = path.read_bytes().partition(b"$" * 72)[0].decode("ascii").splitlines()
    comments = [line for line in header if line.startswith("instance ")]
    return lambda entity: int(comments[entity["comment"]].partition(":")[0].removeprefix("instance "))


def _lanelet2(path: Path) -> Callable[[Entity], int]:
    lanelets = {int(item.get("id", "")): item for item in ElementTree.parse(path).getroot().iter("relation")}

    def look(entity: Entity) -> int:
        tags = {tag.get("k"): tag.get("v") for tag in lanelets[entity["lanelet"]].iter("tag")}
        return int(tags["synthroads_instance"] or 0)

    return look
