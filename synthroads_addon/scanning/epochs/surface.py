"""`SurfaceTruth`: distances between the exact surfaces of two epochs of a road, pavement and ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.arrays import Float, Index
from ...road.alignment import clip_offset
from ...road.changes.change import Change, Edit
from ...road.damage import shape_height
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.pavement.cover import MarkingFilms
from ...road.pavement.surface import PavementSurface, laid_height
from ...road.section import (
    Carriageway,
    Crack,
    LineMarking,
    Overlay,
    Patch,
    Pothole,
    RemovedMarking,
    Rut,
    Settlement,
)
from ...road.terrain import known_elevation

_STEP = 0.05
"""Distance, m, over which the slope of the surface as it was built is taken."""
_ROUNDS = 4
"""Rounds in which a normal's way to the other surface is found: each leaves a share of the slope between the two of what
the one before was off."""
_AROUND = 0.05
"""Margin, m, around a change's extent in which points are looked at."""
_LISTS = {
    "ruts": Rut,
    "potholes": Pothole,
    "settlements": Settlement,
    "overlays": Overlay,
    "patches": Patch,
    "cracks": Crack,
    "removed_markings": RemovedMarking,
}
_LAID = (Patch, Crack, RemovedMarking)


class ExactSurface:
    """Exact height of one epoch's surface: road, batters and ground, with damage, pavement relief and marking films.

    Args:
        geometry: the road's.
        strength: factor on the relief of the pavement, as the scan has it: 0 leaves it out.
    """

    def __init__(self, geometry: RoadGeometry, strength: float) -> None:
        self.geometry, self._strength = geometry, strength
        self._pavement = PavementSurface(geometry)
        self._films = [MarkingFilms(geometry, side) for side in geometry.sections]

    def height(self, station: Float, offset: Float) -> Float:
        """Return the local elevations (N,), m, at stations and offsets (N,), m."""
        result = known_elevation(self.geometry, station, offset)
        if self._strength:
            result = result + self._strength * self._pavement.height(station, offset)
        for films in self._films:
            result = result + films.thickness(station, offset)
        return result


class _Influence(NamedTuple):
    """A surface change's share in the height of a place.

    Attributes:
        row: of the change in the list.
        before, after: the carriageway and what lies on it, in either epoch; None where it has nothing.
    """

    row: int
    before: tuple[Carriageway, object] | None
    after: tuple[Carriageway, object] | None


class SurfaceTruth:
    """Changes of a road's surface between two epochs: which of them a place has, and how far apart the surfaces are.

    Args:
        before, after: the first epoch's geometry, the second's.
        changes: that lead from the one to the other.
        is_second: whether the points are of the second epoch; else of the first.
        strength: factor on the pavement's relief.
    """

    def __init__(
        self,
        before: RoadGeometry,
        after: RoadGeometry,
        changes: tuple[Change, ...],
        is_second: bool,
        strength: float,
    ) -> None:
        self._roads = before, after
        self._influences = [
            influence for row, change in enumerate(changes) for influence in _influences(row, change, before, after)
        ]
        self._films = _film_changes(before, after, changes)
        self.rows = sorted({influence.row for influence in self._influences} | self._films.keys())
        self._extents = [
            (extent.start_station, extent.end_station, extent.low_offset, extent.high_offset)
            for extent in (changes[row].extent for row in self.rows)
        ]
        own, other = (after, before) if is_second else (before, after)
        self._own, self._other = ExactSurface(own, strength), ExactSurface(other, strength)
        self._built = _as_built(before)

    def near(self, station: Float, offset: Float) -> Index:
        """Return the indices (K,) of the places (N,) within the extent of any change of the surface."""
        is_near = np.zeros(len(station), bool)
        for start, end, low, high in self._extents:
            within = (station >= start - _AROUND) & (station <= end + _AROUND)
            if low is not None and high is not None:
                within &= (offset >= low - _AROUND) & (offset <= high + _AROUND)
            is_near |= within
        return np.flatnonzero(is_near)

    def strongest(self, station: Float, offset: Float) -> Index:
        """Return the row (N,) in the list of the change that moves each place (N,) most; -1 where none does."""
        result, largest = np.full(len(station), -1), np.full(len(station), 1e-9)
        steps = [(row, _film_step(films, station, offset)) for row, films in self._films.items()]
        for row, before, after in self._influences:
            steps.append((row, self._height(after, 1, station, offset) - self._height(before, 0, station, offset)))
        for row, step in steps:
            stronger = np.abs(step) > largest
            result[stronger], largest[stronger] = row, np.abs(step[stronger])
        return result

    def _height(self, item: tuple[Carriageway, object] | None, epoch: int, station: Float, offset: Float) -> Float:
        """Return how much (N,), m, what lies on a carriageway in one epoch raises places (N,)."""
        if item is None:
            return np.zeros(len(station))
        carriageway, thing = item
        geometry = self._roads[epoch]
        if isinstance(thing, _LAID):
            return laid_height(thing, carriageway.pavement, geometry.length, station, offset)
        section = geometry.sections[carriageway.side]
        return shape_height(section, thing, station, offset)  # type: ignore[arg-type]

    def own_height(self, station: Float, offset: Float) -> Float:
        """Return the local elevations (N,), m, of the points' own epoch."""
        return self._own.height(station, offset)

    def distance(self, station: Float, offset: Float) -> Float:
        """Return the signed distances (N,), m, from places of the own epoch's surface to that of the other epoch.

        They are measured along the normal of the road as it was built, without damage. The sign is that of the second
        epoch over the first: positive where the own surface lies above the other one.

        Args:
            station, offset: (N,) places, m.
        """
        built = self._built
        axis_curvature = built.alignment.curvature(station)
        stretch = 1.0 - axis_curvature * clip_offset(offset, axis_curvature)
        along = known_elevation(built, station + _STEP, offset) - known_elevation(built, station - _STEP, offset)
        across = known_elevation(built, station, offset + _STEP) - known_elevation(built, station, offset - _STEP)
        normal = np.stack([-along / (2.0 * _STEP) / stretch, -across / (2.0 * _STEP), np.ones(len(station))])
        normal /= np.sqrt(np.einsum("ij,ij->j", normal, normal))
        height = self._own.height(station, offset)
        way = (height - self._other.height(station, offset)) * normal[2]
        for _ in range(_ROUNDS):
            place = station - way * normal[0] / stretch, offset - way * normal[1]
            rest = height - way * normal[2] - self._other.height(*place)
            way = way + rest * normal[2]
        return np.asarray(way)


def _as_built(geometry: RoadGeometry) -> RoadGeometry:
    """Return a road's geometry without anything that forms the surfaces of its pavements."""
    road = geometry.parameters
    names = {"ruts": (), "potholes": (), "settlements": None, "overlays": None}
    objects = {
        name: item.model_copy(update={"pavement": item.pavement.model_copy(update=names)})
        if isinstance(item, Carriageway)
        else item
        for name, item in road.objects.items()
    }
    return RoadGeometry(road.model_copy(update={"objects": objects}))


def _influences(row: int, change: Change, before: RoadGeometry, after: RoadGeometry) -> list[_Influence]:
    """Return the shares of a change's edits of pavements in the height of the surface."""
    result = []
    for edit in change.edits:
        if (name := _list_of(edit)) is None:
            continue
        kind = _LISTS[name]
        values = [None if value is None else kind.model_validate(value) for value in (edit.before, edit.after)]
        roads = before.parameters, after.parameters
        first, second = (_with_owner(road, edit.thing, value) for road, value in zip(roads, values, strict=True))
        result.append(_Influence(row, first, second))
    return result


def _film_changes(
    before: RoadGeometry, after: RoadGeometry, changes: tuple[Change, ...]
) -> dict[int, tuple[list[MarkingFilms], list[MarkingFilms]]]:
    """Return the films of the markings that changes are about, in both epochs, by the row of the change."""
    result = {}
    for row, change in enumerate(changes):
        names = {*marking_ids(change, before.parameters), *marking_ids(change, after.parameters)}
        if names and change.things:
            first, second = (
                [MarkingFilms(geometry, side, names) for side in geometry.sections] for geometry in (before, after)
            )
            result[row] = (first, second)
    return result


def _film_step(films: tuple[list[MarkingFilms], list[MarkingFilms]], station: Float, offset: Float) -> Float:
    """Return how much (N,), m, the films of markings are thicker at places in the second epoch."""
    first, second = (sum(film.thickness(station, offset) for film in epoch) for epoch in films)
    return np.asarray(second - first)


def _list_of(edit: Edit) -> str | None:
    """Return the name of a pavement's list of which an edit has an element; None for another edit."""
    parts = edit.path.split(".")
    return parts[1] if len(parts) == 3 and parts[0] == "pavement" and parts[1] in _LISTS else None


def _with_owner(road: RoadParameters, name: str, value: object) -> tuple[Carriageway, object] | None:
    """Return a carriageway and what lies on it; None for nothing."""
    item = road.objects.get(name)
    return (item, value) if isinstance(item, Carriageway) and value is not None else None


def laid_numbers(change: Change, road: RoadGeometry, is_second: bool) -> list[int]:
    """Return the instance numbers of what a change lays on pavements, or takes from them, in one of its epochs.

    Args:
        change: the change.
        road: of the epoch.
        is_second: whether that is the second one.
    """
    numbers = []
    for edit in change.edits:
        name, value = _list_of(edit), edit.after if is_second else edit.before
        if name is None or value is None or _LISTS[name] not in _LAID or edit.thing not in road.numbers.parts:
            continue
        pavement = road.parameters.of_type(Carriageway)[edit.thing].pavement
        damages = [*pavement.ruts, *pavement.potholes, *pavement.patches, *pavement.cracks, *pavement.removed_markings]
        parts, thing = road.numbers.parts[edit.thing], _LISTS[name].model_validate(value)
        numbers += [parts.number(place) for place, item in enumerate(damages) if item == thing]
    return numbers


def marking_ids(change: Change, road: RoadParameters) -> list[str]:
    """Return the ids of the markings that a change is about: all of them where paint is worn everywhere."""
    if change.kind == "worn" and not change.things:
        return [name for name, item in road.objects.items() if item.points_class == "road_marking"]
    return [name for name in change.things if isinstance(road.objects.get(name), LineMarking)]
