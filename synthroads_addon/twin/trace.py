"""`Trace`: what each instance number of the cloud became in a file, and what the file lacks, as a JSON beside it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..base.schema import compact_json
from ..base.version import generator
from ..road.geometry import RoadGeometry
from ..road.instances import Parts
from ..road.objects import RoadObject
from ..road.section import LineMarking
from ..road.surroundings import Vegetation
from ..road.things.thing import StandingThing
from .plants import PlacedPlant, placed_plants
from .things import PlacedThing
from .vehicles import PlacedVehicle

Entity = dict[str, Any]
"""Where something stands in a file, in the format's own words: JSON data."""
FITTINGS = 0.1
"""Fittings of things that are smaller (m) are left out of all formats."""
LEVEL = f"true shapes, without fittings that stand out by less than {FITTINGS:g} m"


NO_LAND = "its parameters alone: it lies beyond the ground that the road stands on"
"""Reason that formats give for what they leave out of the landscape."""
_NOWHERE = dict.fromkeys(
    ("dash", "strip", "LineMarking", "Hatching", "Arrow", "Turnout", "StreetSide", "LengthwiseThing"),
    "nothing of it is on the road, or it has no area",
)
"""Why any file may have no entity for something."""


class Trace:
    """Report on one twin file: the entities that each instance number became, and what the file lacks.

    Args:
        geometry: the road.
        level: level of detail of the file, for people.
        within: kinds of parts (`InstanceNumbers.parts`) that are within their object's entities and have none of their
            own.
        reasons: why the file has no entity for something, by the type of an object or the kind of a part.
    """

    def __init__(
        self,
        geometry: RoadGeometry,
        level: str = LEVEL,
        within: Iterable[str] = (),
        reasons: Mapping[str, str] | None = None,
    ) -> None:
        self.level = level
        self._geometry = geometry
        self._plants_of_stand: dict[int, list[int]] = {}
        self._kinds_within_others, self._reasons = frozenset(within), {**_NOWHERE, **(reasons or {})}
        self._entities: dict[int, list[Entity]] = {}
        self._reductions: list[tuple[str, str]] = []

    def record_entity(self, instance: int, **entity: str | int) -> None:
        """Record that an instance number became an entity of the file, given by keys to find it with."""
        self._entities.setdefault(instance, []).append(entity)

    def record_plant(self, plant: PlacedPlant) -> None:
        """Record that a plant exists, so that the report lists its instance number."""
        self._plants_of_stand.setdefault(self._geometry.numbers.parts[plant.stand].first, []).append(plant.instance)

    def record_loss(self, name: str, reason: str) -> None:
        """Record why the file shows an object in less detail than the parameter set has it."""
        self._reductions.append((name, reason))

    def record_omissions(self, placed: PlacedThing) -> None:
        """Record the details of a thing that every format omits: fittings, an unknown shape, what the thing names."""
        sizes = [body.detail for body in placed.bodies if body.detail]
        if sizes:
            fittings = "a fitting" if len(sizes) == 1 else f"{len(sizes)} fittings"
            self.record_loss(placed.name, f"without {fittings} of up to {max(sizes):.3g} m")
        if not placed.bodies and isinstance(placed.thing, StandingThing):
            self.record_loss(placed.name, "its place alone: its shape isn't in the parameter set")
        if placed.thing.left_out:
            self.record_loss(placed.name, f"without {placed.thing.left_out}")

    def record_box(self, placed: PlacedVehicle) -> None:
        """Record that a vehicle is written as its bounding box, at time 0 if it moves."""
        moves = ", where it is at the time 0" if placed.vehicle.speed else ""
        self.record_loss(placed.name, f"the box around it{moves}")

    def write(self, path: Path, name: str, file: str) -> None:
        """Write the report as JSON: entities by instance number, and what is missing and why; same road, same bytes.

        Args:
            path: the JSON file.
            name: of the format.
            file: name of its file.
        """
        parameters, numbers = self._geometry.parameters, self._geometry.numbers
        members = {"type": "TwinReport", "version": "1.0", "generator": generator(), "format": name, "file": file}
        members |= {"identifier": parameters.metadata.identifier, "level_of_detail": self.level}
        instance_rows, losses = self._rows()
        instances = {key: item.instance for key, item in parameters.objects.items()}
        reduced = [{"id": key, "instance": instances[key], "reason": reason} for key, reason in self._reductions]
        passes = [
            {
                "id": key,
                "instance": instances[key],
                "first_pass_instance": first_pass.first,
                "pass_step": first_pass.step,
            }
            for key, first_pass in numbers.passes.items()
        ]
        text = compact_json(members)[:-1]
        for key, rows in (("lost", losses), ("reduced", reduced), ("passes", passes), ("instances", instance_rows)):
            text += f',\n"{key}":[' + ",".join("\n" + compact_json(row) for row in rows) + "]"
        path.write_text(text + "}\n", encoding="utf-8", newline="\n")

    def _rows(self) -> tuple[list[Entity], list[Entity]]:
        """Return the report's rows for instance numbers with entities, and for those that are missing with reasons."""
        objects = self._geometry.parameters.objects
        if not self._plants_of_stand:  # the format has no plants, but the report lists them all the same
            for plant in placed_plants(self._geometry):
                self.record_plant(plant)
        instance_rows, losses = [], []
        for number, name, kinds in self._numbers():
            entities = self._entities.get(number)
            if not entities and self._kinds_within_others.intersection(kinds):
                # A part without entities of its own lies in those of its object, whose id is before the slash.
                entities = self._entities.get(objects[name.partition("/")[0]].instance)
            if entities:
                instance_rows.append({"instance": number, "id": name, "entities": entities})
            elif not self._is_only_parts(objects.get(name)):
                reason = next((self._reasons[kind] for kind in kinds if kind in self._reasons), "")
                losses.append({"instance": number, "id": name, "reason": reason})
        return instance_rows, losses

    def _is_only_parts(self, item: RoadObject | None) -> bool:
        """Return whether an object consists of numbered parts only, so that no point has its own number."""
        return isinstance(item, Vegetation) or (isinstance(item, LineMarking) and bool(item.dash_length))

    def _numbers(self) -> Iterator[tuple[int, str, tuple[str, ...]]]:
        """Yield the number, id and type names of every object and part that points can bear, later passes excluded."""
        numbers, objects = self._geometry.numbers, self._geometry.parameters.objects
        for name, item in objects.items():
            yield item.instance, name, tuple(kind.__name__ for kind in type(item).__mro__)
        for name, parts in numbers.parts.items():
            for part in self._parts_of(objects[name], parts):
                text, number = numbers.part(name, part)
                kinds = [kind.__name__ for kind in type(objects[name]).__mro__]
                yield number, text, (text.partition("/")[2].partition("-")[0], parts.kind, *kinds)

    def _parts_of(self, item: RoadObject, parts: Parts) -> Iterable[int]:
        """Return the numbers of an object's parts that exist on the road, counted from 0."""
        if isinstance(item, LineMarking):
            return range(len(self._geometry.dashes(item)) if item.dash_length else 0)
        if isinstance(item, Vegetation) and item.kind != "grass":
            places = self._plants_of_stand.get(parts.first, ())
            return [number - parts.first for number in places]
        return range(parts.count)
