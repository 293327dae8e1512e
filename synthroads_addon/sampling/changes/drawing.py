"""`Epoch`: a road while its changes are drawn: which of its things and stretches are taken, and the edits so far."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import numpy as np

from ...base.schema import round_value
from ...road.changes.change import Change, Edit, Kind
from ...road.changes.diff import make_change
from ...road.changes.numbers import first_unused
from ...road.geometry import RoadGeometry
from ...road.objects import RoadObject, Side
from ...road.parameters import RoadParameters
from ...road.section import Carriageway
from ...road.things.limits import Interval
from ...scenario.changes import ChangeLimits
from ..placing.draw import draw
from ..placing.ranges import Reservations, draw_start, free_ranges

DIGITS = 4
"""Decimals of drawn lengths: tenths of millimetres."""
CLEAR = 2.0
"""Distance along the road, m, that changes of one carriageway's pavement keep from each other; chosen."""
T = TypeVar("T", bound=RoadObject)


class Epoch:
    """A road while the changes to its next epoch are drawn.

    Args:
        before: the road.
        limits: of what is drawn.
        rng: random numbers of these changes alone.

    Attributes:
        objects: data of its objects by id, with those that are added.
        changes: drawn so far.
    """

    def __init__(self, before: RoadParameters, limits: ChangeLimits, rng: np.random.Generator) -> None:
        self.before, self.limits, self.rng = before, limits, rng
        self.geometry = RoadGeometry(before)
        self.length = self.geometry.length
        self.objects: dict[str, Any] = dict(before.to_dict()["objects"])
        self.changes: list[Change] = []
        self._used: set[str] = set()
        self._taken: dict[str, Reservations] = {}
        self._elements: dict[tuple[str, str], tuple[int, int, int]] = {}
        self._next_number = first_unused(before)
        self._added = 0
        self._removed: set[str] = set()
        self._pending: list[tuple[Kind, str, list[Edit]]] = []

    # --- numbers ----------------------------------------------------------------------------------------------------

    def value(self, limits: Interval, factor: float = 1.0) -> float:
        """Return a number drawn uniformly from an interval, times a factor, rounded to tenths of millimetres."""
        return round_value(draw(self.rng, limits) * factor, DIGITS)

    def count(self, per_km: Interval, factor: float = 1.0) -> int:
        """Return how many there are on the road at a drawn rate (1/km), times a factor."""
        return int(draw(self.rng, per_km) * self.length / 1000.0 * factor + self.rng.random())

    def sometimes(self, share: float) -> bool:
        """Return whether something with a probability happens."""
        return bool(self.rng.random() < share)

    # --- what is there ----------------------------------------------------------------------------------------------

    def choose(self, kinds: type[T] | tuple[type[T], ...], where: Iterable[str] | None = None) -> str | None:
        """Return the id of a thing of some kinds that nothing has happened to, and take it; None if there is none."""
        names = [
            name
            for name, item in self.before.objects.items()
            if isinstance(item, kinds) and name not in self._used and (where is None or name in where)
        ]
        if not names:
            return None
        name = names[int(self.rng.random() * len(names))]
        self._used.add(name)
        return name

    def use(self, name: str) -> None:
        """Take a thing, so that nothing else happens to it."""
        self._used.add(name)

    def is_used(self, name: str) -> bool:
        """Return whether something has happened to a thing."""
        return name in self._used

    def carriageways(self) -> dict[str, Carriageway]:
        """Return the carriageways by id."""
        return self.before.of_type(Carriageway)

    def stretch(self, owner: str, length: float, start: float = 0.0, end: float = math.inf) -> float | None:
        """Return a drawn start (m) of a free stretch of a length (m) of a carriageway, and take it; None: no room."""
        taken = self._taken.setdefault(owner, Reservations())
        ranges = free_ranges(start, min(end, self.length), taken)
        begin = draw_start(self.rng, ranges, length)
        if begin is None:
            return None
        begin = round_value(begin, DIGITS)
        taken.add(begin - CLEAR, begin + length + CLEAR)
        return begin

    def take(self, owner: str, start: float, end: float) -> bool:
        """Return whether a stretch (m) of a carriageway is free, and take it then."""
        taken = self._taken.setdefault(owner, Reservations())
        is_free = taken.is_free(start, end)
        if is_free:
            taken.add(start - CLEAR, end + CLEAR)
        return is_free

    def lane_middle(self, side: Side, lane: int, station: float) -> float:
        """Return the offset of a lane's middle at a station, m; lanes count from outside."""
        section = self.geometry.sections[side]
        boundaries = section.lane_boundaries(station)[0]
        return round_value(section.carriageway.sign * float(boundaries[lane] + boundaries[lane + 1]) / 2.0, DIGITS)

    # --- edits ------------------------------------------------------------------------------------------------------

    def field(self, thing: str, path: str, after: Any) -> Edit:
        """Return the edit that gives a thing's field another value; ``thing`` empty: of the whole set."""
        value: Any = self.objects[thing] if thing else self.before.to_dict()
        for name in path.split("."):
            value = value.get(name) if isinstance(value, dict) else None
        return Edit(thing=thing, path=path, before=value, after=after)

    def add_thing(self, name: str, item: RoadObject) -> Edit:
        """Return the edit that adds a thing, under a free id and with a new number, behind all others."""
        free_name, count = name, 1
        while free_name in self.objects:
            count += 1
            free_name = f"{name[:56]}-{count}"
        data = item.model_copy(update={"instance": self._next_number}).to_dict()
        self.objects[free_name] = data
        self._next_number += 1
        self._added += 1
        return Edit(thing=free_name, after=data, place=len(self.before.objects) + self._added - 1)

    def remove_thing(self, name: str) -> Edit:
        """Return the edit that takes a thing away."""
        self._removed.add(name)
        return Edit(thing=name, before=self.objects[name])

    def elements(self, owner: str, name: str) -> list[dict[str, Any]]:
        """Return the data of a list of a carriageway's pavement; empty where it has none."""
        return list(self.objects[owner]["pavement"].get(name, ()))

    def add_element(self, owner: str, name: str, data: dict[str, Any]) -> Edit:
        """Return the edit that adds an element behind the others of a list of a carriageway's pavement."""
        count, removed, added = self._counts(owner, name)
        self._elements[owner, name] = count, removed, added + 1
        return Edit(thing=owner, path=f"pavement.{name}.{count + added}", after=data)

    def change_element(self, owner: str, name: str, number: int, data: dict[str, Any]) -> Edit:
        """Return the edit that replaces an element of a list of a carriageway's pavement."""
        return Edit(
            thing=owner, path=f"pavement.{name}.{number}", before=self.elements(owner, name)[number], after=data
        )

    def remove_element(self, owner: str, name: str, number: int) -> Edit:
        """Return the edit that takes an element of a list of a carriageway's pavement away."""
        count, removed, added = self._counts(owner, name)
        self._elements[owner, name] = count, removed + 1, added
        return Edit(thing=owner, path=f"pavement.{name}.{number}", before=self.elements(owner, name)[number])

    def _counts(self, owner: str, name: str) -> tuple[int, int, int]:
        """Return how many elements a list has, and how many were taken away and added."""
        return self._elements.get((owner, name)) or (len(self.elements(owner, name)), 0, 0)

    def note(self, kind: Kind, edits: Sequence[Edit], detail: str = "") -> None:
        """Note a change of a kind that consists of edits."""
        self._pending.append((kind, detail, list(edits)))

    def finish(self) -> list[Change]:
        """Return the drawn changes, with the places of what is added as they are once other things are taken away."""
        removed = len(self._removed)
        for kind, detail, edits in self._pending:
            placed = [self._placed(edit, removed) for edit in edits]
            self.changes.append(make_change(kind, detail, placed, self.objects, self.length))
        return self.changes

    def _placed(self, edit: Edit, removed: int) -> Edit:
        """Return an edit with its place less what is taken away before it."""
        if edit.before is not None:
            return edit
        if edit.path == "" and edit.place is not None:
            return edit.model_copy(update={"place": edit.place - removed})
        parts = edit.path.split(".")
        counts = self._elements.get((edit.thing, parts[1])) if len(parts) == 3 else None
        if counts is None:
            return edit
        return edit.model_copy(update={"path": ".".join([*parts[:2], str(int(parts[2]) - counts[1])])})
