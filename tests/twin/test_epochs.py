"""Twins of a road's epochs: what stays has the same ids, what comes and goes is in one of them alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import ifcopenshell
import pytest

from synthroads_addon.road.changes.change import ChangeList
from synthroads_addon.road.instances import InstanceNumbers
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.changes import next_epoch
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.changes import ChangeLimits
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.twin.formats import report_file_name, write_twin

FILES = {"cityjson": "twin.city.json", "ifc": "twin.ifc", "opendrive": "twin.xodr"}
OFTEN: dict[str, Any] = {
    "years": 3.0,
    "settlements": 1.0,
    "overlays": 1.0,
    "marked_anew": 1.0,
    "hits_per_km": {"minimum": 20.0, "maximum": 20.0},
    "patches_per_km": {"minimum": 10.0, "maximum": 20.0},
    "cracks_per_km": {"minimum": 10.0, "maximum": 20.0},
    "things_per_km": {"minimum": 20.0, "maximum": 20.0},
    "parked_per_km": {"minimum": 30.0, "maximum": 30.0},
}
PLACES = {"surface", "road"}
"""Keys of entities that say where in a file something lies, and are no ids: what is new beside it moves it."""


class Epoch(NamedTuple):
    """An epoch: parameter set, folder of its twins, and the reports on them by format."""

    road: RoadParameters
    folder: Path
    reports: dict[str, dict[str, Any]]

    def ids(self, name: str) -> dict[int, frozenset[tuple[str, Any]]]:
        """Return the ids of the entities that each instance number became in a format."""
        return {
            row["instance"]: frozenset(
                pair for entity in row["entities"] for pair in entity.items() if pair[0] not in PLACES
            )
            for row in self.reports[name]["instances"]
        }

    def said(self, name: str) -> set[str]:
        """Return the ids of objects and parts that a format's report has: as entities, or why there are none."""
        return {row["id"] for key in ("instances", "lost") for row in self.reports[name][key]}

    def names(self) -> dict[int, str]:
        """Return the object of each instance number that a cloud's points can have, but for passes of traffic."""
        numbers = InstanceNumbers(self.road)
        rows = {row["instance"] for report in self.reports.values() for row in report["instances"]}
        return {number: str(numbers.name_of(number)).partition("/")[0] for number in rows}


def made(road: RoadParameters, folder: Path) -> Epoch:
    """Return an epoch with its twins written."""
    folder.mkdir()
    write_twin(road, folder, tuple(FILES))
    texts = {name: (folder / report_file_name(name)).read_text(encoding="utf-8") for name in FILES}
    return Epoch(road, folder, {name: json.loads(text) for name, text in texts.items()})


Pair = tuple[Epoch, Epoch, ChangeList]


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    """Return two epochs of a motorway with everything, and the changes between them."""
    folder = tmp_path_factory.mktemp("twins")
    limits = load_scenario("every-class-1500m", ["road.length=300"]).road
    before = sample_road(limits, 3)
    after, changes = next_epoch(before, ChangeLimits.from_dict(OFTEN), 3)
    return made(before, folder / "before"), made(after, folder / "after"), changes


def edited(changes: ChangeList, state: str) -> set[str]:
    """Return the objects that are wholly removed (their ``after`` is none) or added (their ``before`` is none)."""
    return {edit.thing for edit in changes.edits if edit.thing and not edit.path and getattr(edit, state) is None}


@pytest.mark.parametrize("name", FILES)
def test_what_stays_has_the_same_ids_in_both_epochs(pair: Pair, name: str) -> None:
    before, after, changes = pair
    first, second = before.ids(name), after.ids(name)
    altered = {thing for change in changes.changes for thing in change.things}
    stays = {number: thing for number, thing in before.names().items() if after.names().get(number) == thing}
    both = stays.keys() & first.keys() & second.keys()
    assert len(both) > 300
    assert all(first[number] == second[number] for number in both if stays[number] not in altered)
    # What is altered is still itself: a carriageway with one more crack has the entities that it had.
    assert all(first[number] & second[number] for number in both)
    unaltered = {number for number in first if number in stays and stays[number] not in altered}
    assert unaltered <= second.keys()


@pytest.mark.parametrize("name", FILES)
def test_what_comes_and_goes_is_in_one_epoch_alone(pair: Pair, name: str) -> None:
    before, after, changes = pair
    added, removed = edited(changes, "before"), edited(changes, "after")
    assert len(added) > 5
    assert len(removed) > 5
    for epoch, there, elsewhere in ((before, removed, added), (after, added, removed)):
        things = {part.partition("/")[0] for part in epoch.said(name)}
        assert there <= things
        assert not elsewhere & things
    first, second = before.ids(name), after.ids(name)
    for things, own, other in ((removed, first, second), (added, second, first)):
        road = (before if things is removed else after).road
        numbers = {road.objects[thing].instance for thing in things}
        assert not numbers & other.keys()
        assert len(numbers & own.keys()) > 0.5 * len(numbers)


@pytest.mark.parametrize("name", FILES)
def test_the_things_of_each_change_are_found_in_its_epochs(pair: Pair, name: str) -> None:
    before, after, changes = pair
    kinds = set()
    for change in changes.changes:
        for thing in change.things:
            epochs = [epoch for epoch in (before, after) if thing in epoch.road.objects]
            assert epochs
            for epoch in epochs:
                assert thing in {part.partition("/")[0] for part in epoch.said(name)}, (change.kind, thing)
                kinds.add(change.kind)
    assert kinds >= {"added", "moved", "grown", "cracked", "patched", "settled", "construction_zone"}


def test_the_ids_of_the_reports_are_those_in_the_files(pair: Pair) -> None:
    for epoch in pair[:2]:
        city = json.loads((epoch.folder / FILES["cityjson"]).read_text(encoding="utf-8"))
        ids = {value for row in epoch.ids("cityjson").values() for key, value in row if key == "object"}
        assert ids <= city["CityObjects"].keys()
        model = ifcopenshell.open(str(epoch.folder / FILES["ifc"]))
        guids = {value for row in epoch.ids("ifc").values() for key, value in row if key == "GlobalId"}
        assert guids <= {item.GlobalId for item in model.by_type("IfcRoot")}
        tree = ElementTree.parse(epoch.folder / FILES["opendrive"])
        numbers = {value for row in epoch.ids("opendrive").values() for key, value in row if key == "id"}
        assert len(numbers) > 100
        assert {str(number) for number in numbers} <= {item.get("id") for item in tree.iter()}


def test_two_roads_have_no_global_id_in_common(pair: Pair) -> None:
    """GlobalIds are those of a road in all its epochs, and of no other road."""
    before, after, _ = pair
    other = before.road.metadata.model_copy(update={"identifier": "another"})
    road = before.road.model_copy(update={"metadata": other})
    folder = before.folder.parent / "other"
    guids = [made(road, folder), before, after]
    other_ids, *own = [
        {value for row in e.ids("ifc").values() for key, value in row if key == "GlobalId"} for e in guids
    ]
    assert not other_ids & (own[0] | own[1])
