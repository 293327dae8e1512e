"""Instance numbers as fine as things: every dash, plant, damage, strip of grass and pass of a vehicle has its own.

An object has the number that its parameter set says. What it consists of has numbers that follow from the set: blocks
of free numbers, the lowest ones, in the order of the objects. A block's length depends on the kind of object and the
road's length only, so that a line's dashes or a stand's density may change without any other number changing.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Bool
from ..base.errors import InputError
from .damage import DAMAGES, damage_numbers
from .objects import RoadObject
from .parameters import RoadParameters
from .section import Carriageway, LineMarking, Pavement
from .surroundings import Terrain, Vegetation, Vehicle

GRASS_STRIPS = ("left-band", "right-band", "left-verge", "right-verge", "median")
"""Strips that grass of one species grows on, in the order of their numbers."""
SPARE = 1.5
"""Places that are looked at for each plant that is wanted: outside of curves and on slopes there is more ground to a
metre of road. Where it were even more, plants would stand thinner."""
LARGEST = 2**32 - 1
_SHORTEST_PERIOD = 2.0
"""Dashes of a line have room for one in so many metres of road."""
_PLANTS_PER_METRE = 8
"""Places of a stand have room for so many in a metre of road."""


@dataclass(frozen=True)
class Parts:
    """The block of instance numbers of an object's parts.

    Attributes:
        kind: ``dash``, ``damage``, ``strip``, ``tree`` or ``shrub``.
        first: number of the first.
        count: how many there may be: places where none grows, or that lie beyond the road's end, are among them.
        room: numbers that are kept for them, so that the panel's edits can make more of them.
        stated: number of each, where they don't follow each other; empty where they do.
    """

    kind: str
    first: int
    count: int
    room: int
    stated: tuple[int, ...] = ()

    def number(self, part: int) -> int:
        """Return the instance number of a part, counted from 0."""
        return self.stated[part] if self.stated else self.first + part

    def all_numbers(self) -> NDArray[np.int64]:
        """Return the instance numbers (count,) of all parts."""
        return np.array(self.stated, np.int64) if self.stated else self.first + np.arange(self.count)


@dataclass(frozen=True)
class PassNumbers:
    """Instance numbers of a vehicle's later passes: whenever it comes in again after it has left the road.

    Attributes:
        first: number of its second pass; the first has the vehicle's own.
        step: from one pass to the next.
    """

    first: int
    step: int

    def number(self, vehicle_number: int, passes: int) -> int:
        """Return the instance number of a vehicle's pass, 0 the first, which has the number ``vehicle_number``."""
        return vehicle_number if passes <= 0 else self.first + (passes - 1) * self.step


class InstanceNumbers:
    """Instance numbers of everything in a parameter set that points can be of: objects, parts, passes of vehicles.

    Args:
        parameters: the whole road's, not those of a stretch.

    Attributes:
        parts: of objects that consist of parts, by id.
        passes: of the vehicles, by id.

    Raises:
        InputError: there are not enough numbers of 32 bits.
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self._parameters = parameters
        length = math.ceil(parameters.alignment.length)
        sizes = {name: _parts_of(item, parameters, length) for name, item in parameters.objects.items()}
        stated_parts = _stated_parts(parameters, sizes)
        taken = [item.instance for item in parameters.objects.values()]
        taken += [number for parts in stated_parts.values() for number in _numbers_taken(parts)]
        free_numbers = _FreeNumbers(sorted(taken))
        self.parts: dict[str, Parts] = {}
        for name, (kind, count, room) in sizes.items():
            if name in stated_parts:
                self.parts[name] = stated_parts[name]
            elif count:
                self.parts[name] = Parts(kind, free_numbers.block(max(count, room), name), count, max(count, room))
        vehicles = parameters.of_type(Vehicle)
        first_free = free_numbers.rest()
        self.passes = {name: PassNumbers(first_free + number, len(vehicles)) for number, name in enumerate(vehicles)}

    def name_of(self, number: int) -> str | None:
        """Return an instance number's object id, for a part with a slash and the part's name; None if it is unused."""
        if number in self._object_names:
            return self._object_names[number]
        # Parts: the last block that starts at the number or before it, if the number lies within that block.
        starts, names = self._blocks
        block = bisect_right(starts, number) - 1
        if block >= 0:
            name = names[block]
            part = number - self.parts[name].first
            if part < self.parts[name].room and not self.parts[name].stated:
                return f"{name}/{self.part_name(name, part)}"
        if number in self._stated_names:
            return self._stated_names[number]
        if self.passes:
            first_number = next(iter(self.passes.values())).first
            later_pass, vehicle = divmod(number - first_number, len(self.passes))
            if later_pass >= 0:
                return f"{list(self.passes)[vehicle]}/pass-{later_pass + 1}"
        return None

    def part_name(self, name: str, part: int) -> str:
        """Return the name of an object's part, counted from 0, such as "dash-3" or "median"."""
        kind, item = self.parts[name].kind, self._parameters.objects[name]
        if kind == "strip":
            return GRASS_STRIPS[part]
        if isinstance(item, Carriageway):
            return f"{damage_kinds(item.pavement)[part]}-{part}"
        return f"{kind}-{part}"

    def part(self, name: str, part: int) -> tuple[str, int]:
        """Return the name (object/part) and the instance number of an object's part, counted from 0."""
        return f"{name}/{self.part_name(name, part)}", self.parts[name].number(part)

    def damages(self) -> dict[int, int]:
        """Return instance number -> index in `road.damage.DAMAGES` of the damages of all pavements."""
        return {
            self.parts[name].number(part): kind
            for name, item in self._parameters.of_type(Carriageway).items()
            for part, kind in enumerate(damage_numbers(item.pavement))
        }

    def laid_on(self) -> list[int]:
        """Return the instance numbers of the damages that have faces of their own on the pavement."""
        in_the_surface = {DAMAGES.index(name) for name in ("rut", "pothole")}
        return [number for number, kind in self.damages().items() if kind not in in_the_surface]

    def owner(self, number: int) -> str | None:
        """Return the id of the object that an instance number is of, or of a part of; None if it is unused."""
        name = self.name_of(number)
        return None if name is None else name.partition("/")[0]

    def part_attributes(self, instance: int) -> dict[str, int]:
        """Return the first instance numbers and counts of an object's parts and passes, as attributes by name."""
        name = self._object_names[instance]
        parts, later_passes = self.parts.get(name), self.passes.get(name)
        attributes = {"first_part_instance": parts.first, "part_count": parts.count} if parts else {}
        return attributes | (
            {"first_pass_instance": later_passes.first, "pass_step": later_passes.step} if later_passes else {}
        )

    def belong(self, name: str, numbers: NDArray[np.integer]) -> Bool:
        """Return a mask (N,) of the instance numbers that are an object's or its parts', not those of later passes."""
        mask: Bool = numbers == self._parameters.objects[name].instance
        if name in self.parts:
            parts = self.parts[name]
            if parts.stated:
                return mask | np.isin(numbers, parts.stated)
            mask |= (numbers >= parts.first) & (numbers < parts.first + parts.room)
        return mask

    def to_dict(self) -> dict[str, object]:
        """Return the instance numbers of parts and passes as JSON data, as a job's report has them."""
        parts = {
            name: {"instance": self._parameters.objects[name].instance, "part": block.kind, "first": block.first}
            | {"count": block.count}
            for name, block in self.parts.items()
        }
        passes = {name: {"first": block.first, "step": block.step} for name, block in self.passes.items()}
        return {"parts": parts, "passes": passes}

    @cached_property
    def _object_names(self) -> dict[int, str]:
        """Return the id of each object by the instance number that its parameters have."""
        return {item.instance: name for name, item in self._parameters.objects.items()}

    @cached_property
    def _stated_names(self) -> dict[int, str]:
        """Return the names of the parts whose numbers are stated one by one, by these."""
        return {
            number: f"{name}/{self.part_name(name, part)}"
            for name, parts in self.parts.items()
            for part, number in enumerate(parts.stated)
        }

    @cached_property
    def _blocks(self) -> tuple[list[int], list[str]]:
        """Return the sorted first numbers of all blocks of parts, and the ids of the objects that they are of."""
        ordered = sorted((block.first, name) for name, block in self.parts.items())
        return [first_number for first_number, _ in ordered], [name for _, name in ordered]


def _stated_parts(parameters: RoadParameters, sizes: dict[str, tuple[str, int, int]]) -> dict[str, Parts]:
    """Return the parts whose numbers a set states itself, by the object's id.

    Args:
        parameters: the set.
        sizes: of all objects' parts, see `_parts_of`.

    Raises:
        InputError: a carriageway has another count of damages than numbers for them.
    """
    result = {}
    for name, numbers in (parameters.part_numbers or {}).items():
        kind, count, room = sizes.get(name, ("", 0, 0))
        if not count:
            continue
        one_by_one = kind == "damage"
        if len(numbers) != (count if one_by_one else 1):
            text = f"must have {count if one_by_one else 1} instance numbers: one for each damage, of others the first"
            raise InputError(f"part_numbers.{name}", list(numbers), text)
        room = max(count, room)
        result[name] = Parts(kind, numbers[0], count, room, numbers if one_by_one else ())
    return result


def _numbers_taken(parts: Parts) -> Sequence[int]:
    """Return the numbers that parts with stated numbers take, the room for more of them included."""
    return parts.stated or range(parts.first, parts.first + parts.room)


class _FreeNumbers:
    """Instance numbers that no object has, lowest first.

    Args:
        object_numbers: numbers of the objects, in order.
    """

    def __init__(self, object_numbers: list[int]) -> None:
        ends = [*object_numbers, LARGEST + 1]
        self._gaps = [(a + 1, b) for a, b in zip([0, *object_numbers], ends, strict=True) if b > a + 1]

    def block(self, count: int, name: str) -> int:
        """Take the lowest ``count`` consecutive free numbers and return the first; InputError if there are none."""
        for place, (start, end) in enumerate(self._gaps):
            if end - start >= count:
                self._gaps[place] = (start + count, end)
                return start
        raise InputError(f"objects.{name}", count, f"consists of so many parts: no numbers up to {LARGEST} are left")

    def rest(self) -> int:
        """Return the first number of the last gap: what follows it is free."""
        return self._gaps[-1][0] if self._gaps else LARGEST


def _parts_of(item: RoadObject, parameters: RoadParameters, length: int) -> tuple[str, int, int]:
    """Return the kind of an object's parts, their count and the least count of numbers to keep; "", 0, 0 without."""
    if isinstance(item, Carriageway):
        return "damage", len(damage_kinds(item.pavement)), 0
    if isinstance(item, LineMarking):
        return "dash", dash_count(item, parameters.alignment.length), math.ceil(length / _SHORTEST_PERIOD) + 1
    if isinstance(item, Vegetation) and item.kind == "grass":
        return "strip", len(GRASS_STRIPS), 0
    if isinstance(item, Vegetation) and parameters.terrain is not None:
        return item.kind, places_per_metre(item, parameters.terrain) * length, _PLANTS_PER_METRE * length
    return "", 0, 0


def damage_kinds(pavement: Pavement) -> list[str]:
    """Return "rut", "pothole", "patch", "crack" or "removed-marking" for each of a pavement's damages, in order."""
    names = ("rut", "pothole", "patch", "crack", "removed-marking")
    items = (pavement.ruts, pavement.potholes, pavement.patches, pavement.cracks, pavement.removed_markings)
    return [name for name, damages in zip(names, items, strict=True) for _ in damages]


def places_per_metre(plants: Vegetation, terrain: Terrain) -> int:
    """Return the number of places for plants per metre of road, rounded by float32 as in the nodes."""
    per_metre = np.float32(np.float32(terrain.half_width) * np.float32(2.0)) * np.float32(plants.density)
    return max(1, math.ceil(np.float32(per_metre * np.float32(SPARE))))


def dash_count(line: LineMarking, length: float) -> int:
    """Return how many dashes a line has on a road of a length (m); 1 for a solid line, which is its own dash."""
    period = line.dash_length + line.gap_length
    reach = min(line.end_station, length) - line.start_station
    return max(1, math.ceil(reach / period)) if period else 1
