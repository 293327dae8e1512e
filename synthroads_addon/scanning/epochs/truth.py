"""`EpochTruth`: the change at each point of a scan, and its distance to the other epoch's surface."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import AnyArray, Float, Index
from ...road.changes.change import KINDS, Change, ChangeList
from ...road.geometry import RoadGeometry
from ...road.section import Carriageway, LineMarking
from ...road.surroundings import Vegetation, Vehicle
from ..scene.mesh import SceneMesh
from ..scene.target import Target
from .nearest import NearestSurface
from .registration import SurveyErrors
from .seen import SeenPlaces, cells_around
from .surface import SurfaceTruth, laid_numbers, marking_ids

UNCHANGED, MOBILE = 0, len(KINDS) + 1
"""Codes of points in the layer ``change``: what hasn't changed, and traffic. The kinds have 1, 2, ... in between."""
CODES: dict[str, int] = {
    "unchanged": UNCHANGED,
    **{kind: number for number, kind in enumerate(KINDS, 1)},
    "mobile": MOBILE,
}
REACH = 5.0
"""Largest distance, m, of things' points to the other epoch that is looked for: those farther off have this."""
LEAST = 0.0005
"""Distance, m, below which a point of the surface is unchanged, unless it is said otherwise."""
_BESIDE = 0.25
"""Margin along the road, m, around a dent or a missing panel in which points of the thing belong to it."""
_ON_SURFACE = 0.08
"""Height above or below the exact surface, m, up to which a point is one of it: the model's own error, and films."""


class ChangePoints(NamedTuple):
    """N points, as their changes are asked for.

    Attributes:
        place: (N, 3) without errors, map coordinates, m.
        measured: (N, 3) with the systematic errors of trajectory and range, map coordinates, m.
        instance: (N,) instance numbers.
        scanner: (3,) a place of the scanner meanwhile, map coordinates, m.
        maximum_range: of the scanner, m.
    """

    place: Float
    measured: Float
    instance: NDArray[np.integer]
    scanner: Float
    maximum_range: float


@dataclass(frozen=True)
class ChangedMesh:
    """Triangles of one epoch's evaluated scene at and around what changes.

    Attributes:
        corners: (T, 3, 3) by the row of the change in the list, in the road's local coordinates, m.
    """

    corners: dict[int, Float]

    @classmethod
    def of(cls, mesh: SceneMesh, road: RoadGeometry, other: RoadGeometry, changes: ChangeList) -> ChangedMesh:
        """Return the triangles of a scene that changed things, in either epoch, are compared with.

        Around what stands at a place it is everything up to `REACH`, of plants and what runs along the road that alone.

        Args:
            mesh: the scene.
            road: of the scene.
            other: of the other epoch.
            changes: between the two.
        """
        shift = mesh.origin - np.array(road.parameters.transform.translate)
        # By corner: all corners at once would take as much memory as the scene.
        in_plan = [mesh.vertices[corner, :2] + shift[:2] for corner in mesh.triangles.T]
        low, high = np.minimum.reduce(in_plan), np.maximum.reduce(in_plan)
        del in_plan
        result = {}
        for row, change in enumerate(changes.changes):
            if not _is_of_things(change, road, other):
                continue
            is_own = np.isin(mesh.instance_id, _instances(change, road))
            middles = [_middles(name, road, other) for name in change.things]
            if places := [place for places in middles for place in places]:
                around = np.array(places)
                near = np.flatnonzero(
                    ((low <= around.max(axis=0) + REACH) & (high >= around.min(axis=0) - REACH)).all(1)
                )
                for place in places:
                    is_own[near] |= ((low[near] <= place + REACH) & (high[near] >= place - REACH)).all(axis=1)
            result[row] = mesh.vertices[mesh.triangles[is_own]].astype(np.float64) + shift
        return cls(result)

    @staticmethod
    def is_needed(road: RoadGeometry, other: RoadGeometry, changes: ChangeList) -> bool:
        """Return whether any change is one of bodies, which alone are compared with triangles."""
        return any(_is_of_things(change, road, other) for change in changes.changes)

    @property
    def cells(self) -> NDArray[np.int64]:
        """Return the cells (K, 3) of space that the triangles lie in; see `seen.cells_around`."""
        return np.unique(
            np.concatenate([np.empty((0, 3), np.int64), *map(cells_around, self.corners.values())]), axis=0
        )


def _is_of_things(change: Change, road: RoadGeometry, other: RoadGeometry) -> bool:
    """Return whether a change is one of bodies: of what stands on and beside the road, not of its surface and paint."""
    items = [geometry.parameters.objects.get(name) for name in change.things for geometry in (road, other)]
    surface = ("road", "road_marking", "roadside", "ground", "")
    return any(item is not None and item.points_class not in surface for item in items)


def _middles(name: str, road: RoadGeometry, other: RoadGeometry) -> list[Float]:
    """Return the places x, y (2,), m, around which what is near a changed thing lies: where it stands in either epoch.

    None of plants, and of what runs along the road in both epochs: they are compared with themselves alone.
    """
    items = [geometry.parameters.objects.get(name) for geometry in (road, other)]
    is_lengthwise = any(hasattr(item, "start_station") for item in items)
    if any(isinstance(item, Vegetation) for item in items) or (is_lengthwise and None not in items):
        return []
    result: list[Float] = []
    for geometry, item in zip((road, other), items, strict=True):
        station = _stations(item, geometry.length)
        if len(station):
            offset = np.full(len(station), getattr(item, "offset", 0.0) if not isinstance(item, LineMarking) else 0.0)
            result += list(geometry.alignment.place(station, offset))
    return result


def _stations(item: object, length: float) -> Float:
    """Return the stations (N,), m, of a thing: one, or every `REACH` along it."""
    if isinstance(item, LineMarking) or item is None:
        return np.empty(0)
    if hasattr(item, "start_station"):
        start, end = max(item.start_station, 0.0), min(item.end_station, length)  # type: ignore[attr-defined]
        return np.linspace(start, end, 2 + int(max(end - start, 0.0) / REACH))
    station = getattr(item, "station", None)
    return np.empty(0) if station is None else np.array([station])


def _instances(change: Change, road: RoadGeometry) -> NDArray[np.int64]:
    """Return the instance numbers (K,) of a change's things and their parts."""
    numbers = [np.empty(0, np.int64)]
    for name in change.things:
        item = road.parameters.objects.get(name)
        if item is None or isinstance(item, Carriageway):
            continue
        numbers.append(np.array([item.instance]))
        if name in road.numbers.parts:
            parts = road.numbers.parts[name]
            numbers.append(np.array(parts.stated) if parts.stated else parts.first + np.arange(parts.room))
    return np.concatenate(numbers)


@dataclass
class EpochTruth:
    """Truth of the changes between two epochs of a road, for the points of one of them.

    Attributes:
        before, after: geometry of the first epoch, and of the second.
        changes: between them.
        is_second: whether the points are of the second epoch.
        other: triangles of the other epoch.
        strength: factor on the pavement's relief, as the scan has it.
        least: distance, m, below which a point of the surface is unchanged.
        earlier: what the first epoch's scan saw; None where that isn't known.
        seen: gets what this scan sees.
        errors: gets how far its points are displaced.
        later: cells (K, 3) that the next epoch has something in; whether this scan looks into them is noted too.
    """

    before: RoadGeometry
    after: RoadGeometry
    changes: ChangeList
    is_second: bool
    other: ChangedMesh
    strength: float = 1.0
    least: float = LEAST
    earlier: SeenPlaces | None = None
    seen: SeenPlaces = field(default_factory=SeenPlaces)
    errors: SurveyErrors = field(default_factory=SurveyErrors)
    later: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        """Work out which instance numbers belong to which change."""
        own = self.after if self.is_second else self.before
        self.origin = np.array(own.parameters.transform.translate)
        self._alignment = own.alignment
        changes = self.changes.changes
        self._surface = SurfaceTruth(self.before, self.after, changes, self.is_second, self.strength)
        self._code = np.array([0, *(CODES[change.kind] for change in changes)], np.uint8)
        self._number = np.array([0, *(change.number for change in changes)], np.uint16)
        rows: dict[int, int] = {}
        self._paint: set[int] = set()
        for row, change in enumerate(changes):
            laid = laid_numbers(change, own, self.is_second)
            self._paint.update(laid)
            rows.update(dict.fromkeys(laid, row))
            for name in marking_ids(change, own.parameters):
                numbers = _instances(change.model_copy(update={"things": (name,)}), own).tolist()
                self._paint.update(numbers)
                for number in numbers:
                    # What is painted anew isn't worn, and a line's own wear counts more than that of all.
                    if number not in rows or (changes[rows[number]].kind == "worn" and change.things):
                        rows[number] = row
            if _is_of_things(change, self.before, self.after):
                rows.update(dict.fromkeys(_instances(change, own).tolist(), row))
        self._instances = np.array(sorted(rows), np.int64)
        self._rows = np.array([rows[number] for number in sorted(rows)], np.int64)
        self._mobile = own.parameters.of_type(Vehicle)
        self._numbers = own.numbers
        self._nearest = {row: NearestSurface(corners) for row, corners in self.other.corners.items()}

    def arrays(self, points: ChangePoints) -> dict[str, AnyArray]:
        """Return the arrays of a block's points, by name: see the layer ``change`` in `cloud.layers`."""
        place = points.place - self.origin
        count = len(place)
        row, distance = np.full(count, -1), np.zeros(count)
        listed = self._listed(points.instance)
        is_thing = (listed >= 0) & ~np.isin(points.instance, list(self._paint))
        station, offset = self._alignment.project(place[:, :2])
        is_thing[is_thing] = self._is_there(listed[is_thing], station[is_thing])
        listed[(listed >= 0) & ~is_thing & ~np.isin(points.instance, list(self._paint))] = -1
        row[listed >= 0] = listed[listed >= 0]
        for number in np.unique(listed[is_thing]).tolist():
            rows = np.flatnonzero(is_thing & (listed == number))
            if number in self._nearest:
                distance[rows] = self._nearest[number].distance(place[rows], REACH)
        self._fill_surface((place, station, offset), listed, is_thing, row, distance)
        code = self._code[row + 1]
        code[self._is_traffic(points.instance)] = MOBILE
        hidden = np.zeros(count, np.uint8)
        if self.earlier is not None:
            hidden[:] = ~self.earlier.has(place)
        if count:
            self.seen.add(place, points.scanner - self.origin, points.maximum_range)
            self.errors.add(place, points.measured - self.origin)
        return {
            "change": code,
            "change_id": self._number[row + 1],
            "change_distance": distance.astype(np.float32),
            "not_seen_before": hidden,
        }

    def finish(self, target: Target) -> None:
        """Note what the scan of a target looked into without a return, once it is over."""
        if self.later is not None:
            self.seen.look(self.later, target, self.origin - target.origin)

    def _listed(self, instance: NDArray[np.integer]) -> Index:
        """Return the row (N,) of the change that instance numbers (N,) are listed with; -1 for none."""
        if not len(self._instances):
            return np.full(len(instance), -1)
        place = np.minimum(np.searchsorted(self._instances, instance), len(self._instances) - 1)
        return np.where(self._instances[place] == instance, self._rows[place], -1)

    def _is_traffic(self, instance: NDArray[np.integer]) -> NDArray[np.bool_]:
        """Return which instance numbers (N,) are those of vehicles and their later passes."""
        numbers = [item.instance for item in self._mobile.values()]
        result = np.isin(instance, numbers)
        firsts = [passes.first for passes in self._numbers.passes.values()]
        return result | (instance >= min(firsts)) if firsts else result

    def _is_there(self, listed: Index, station: Float) -> NDArray[np.bool_]:
        """Return which points (K,) of things with changes are where the change is: a rail is bent at its dent alone."""
        result = np.ones(len(listed), bool)
        for number in np.unique(listed).tolist():
            change = self.changes.changes[number]
            if change.detail in ("bent", "panel_missing"):
                low, high = change.extent.start_station - _BESIDE, change.extent.end_station + _BESIDE
                result[listed == number] = ((station >= low) & (station <= high))[listed == number]
        return result

    def _fill_surface(
        self,
        places: tuple[Float, Float, Float],
        listed: Index,
        is_thing: NDArray[np.bool_],
        row: Index,
        distance: Float,
    ) -> None:
        """Set rows and distances of the points of the surface, in place.

        Args:
            places: (N, 3) local coordinates, stations and offsets (N,), m.
            listed: (N,) row of the change that a point is listed with by its instance number.
            is_thing: (N,) whether that is one of things.
            row, distance: (N,) of all points.
        """
        is_painted = (listed >= 0) & ~is_thing
        if not self._surface.rows and not is_painted.any():
            return
        place, station, offset = places
        near = self._surface.near(station, offset)
        chosen = np.union1d(near[~is_thing[near]], np.flatnonzero(is_painted))
        if not len(chosen):
            return
        own_height, step = self._surface.measure(station[chosen], offset[chosen])
        is_on = np.abs(place[chosen, 2] - own_height) < _ON_SURFACE
        chosen, step = chosen[is_on], step[is_on]
        if not len(chosen):
            return
        distance[chosen] = step
        strongest = self._surface.strongest(station[chosen], offset[chosen])
        moved = np.abs(step) >= self.least
        # What was laid or painted anew stays that; worn paint on a surface that moved is part of the surface.
        listed_here = listed[chosen]
        is_worn = self._code[listed_here + 1] == CODES["worn"]
        is_free = moved & (strongest >= 0) & ((listed_here < 0) | is_worn)
        row[chosen[is_free]] = strongest[is_free]
