"""`SurfaceTruth`: distances between the exact surfaces of two epochs of a road, pavement and ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.arrays import Float, Index
from ...base.schema import Model
from ...road.alignment import clip_offset
from ...road.changes.change import Change, Edit
from ...road.damage import damage_depth, shape_height
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

_STEP = 0.02
"""Distance, m, over which the slope of the surface as it was built is taken."""
_ROUNDS, _NEGLIGIBLE = 6, 1e-7
"""Rounds in which a normal's way to the other surface is found at most: each leaves a share, as large as the slope of
that surface, of what the one before was off; and what may be left, m."""
_AROUND = 0.05
"""Margin, m, around a change's extent in which points are looked at."""
_LISTS: dict[str, type[Model]] = {
    "ruts": Rut,
    "potholes": Pothole,
    "settlements": Settlement,
    "overlays": Overlay,
    "patches": Patch,
    "cracks": Crack,
    "removed_markings": RemovedMarking,
}
_LAID = (Patch, Crack, RemovedMarking)


class EpochLayers:
    """The layers of one epoch on the road as it was built: damage, pavement relief and marking films.

    Args:
        geometry: the road's.
        strength: factor on the relief of the pavement, as the scan has it: 0 leaves it out.
    """

    def __init__(self, geometry: RoadGeometry, strength: float) -> None:
        self._sections, self._strength = list(geometry.sections.values()), strength
        self._pavement = PavementSurface(geometry)
        self._films = [MarkingFilms(geometry, side) for side in geometry.sections]

    def height(self, station: Float, offset: Float) -> Float:
        """Return the heights (N,), m, above the road as it was built at stations and offsets (N,), m.

        The pavement's waves aren't in it: no change alters them.
        """
        result = np.zeros(len(station))
        for section in self._sections:
            if section.carriageway.pavement.is_shaped:
                result -= damage_depth(section, station, offset)
        if self._strength:
            result += self._strength * self._pavement.height(station, offset, waves=False)
        for films in self._films:
            result += films.thickness(station, offset)
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
            for extent in (changes[row].extent for row in self.rows if changes[row].kind != "worn")
        ]
        own, other = (after, before) if is_second else (before, after)
        self._own, self._other = EpochLayers(own, strength), EpochLayers(other, strength)
        self._built = _as_built(before)

    def near(self, station: Float, offset: Float) -> Index:
        """Return the indices (K,) of the places (N,) within the extent of any change of the surface but worn paint.

        That is only where paint is, which instance numbers say.
        """
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

    def measure(self, station: Float, offset: Float) -> tuple[Float, Float]:
        """Return the elevations (N,) of the own epoch's surface, and its signed distances (N,) to the other one, m.

        Distances are measured along the normal of the road as it was built, without damage: a normal of the own
        surface would turn with it. They are positive where the own surface lies above the other one. Beside the road
        the elevation is NaN and the distance 0.

        Args:
            station, offset: (N,) places, m.
        """
        height = self._own.height(station, offset)
        built = self._built.main_elevation(station, offset)
        way = height - self._other.height(station, offset)
        apart = np.flatnonzero(np.isfinite(built) & (way != 0.0))
        result = np.zeros(len(station))
        if len(apart):
            places = station[apart], offset[apart], built[apart], height[apart]
            result[apart] = self._way_along_normal(way[apart], *places)
        return built + height, result

    def _way_along_normal(self, way: Float, station: Float, offset: Float, built: Float, height: Float) -> Float:
        """Return the distances (K,), m, along the built road's normals to the other surface.

        Args:
            way: (K,) upright distances, m.
            station, offset: (K,) places, m.
            built: (K,) elevations of the road as it was built there, m.
            height: (K,) of the own surface above it, m.
        """
        slope_along, slope_across = self._built_slopes(station, offset, built)
        norm = np.sqrt(1.0 + slope_along**2 + slope_across**2)
        curvature = self._built.alignment.curvature(station)
        stretch = 1.0 - curvature * clip_offset(offset, curvature)
        way = way / norm
        rows = np.flatnonzero(np.isfinite(way))
        for _ in range(_ROUNDS):
            # The plane that the normal is of rises by as much as the way along the normal leads down it.
            step = way[rows] / norm[rows]
            moved = station[rows] + step * slope_along[rows] / stretch[rows], offset[rows] + step * slope_across[rows]
            rest = height[rows] - way[rows] * norm[rows] - self._other.height(*moved)
            way[rows] += rest / norm[rows]
            rows = rows[np.abs(rest) > _NEGLIGIBLE]
            if not len(rows):
                break
        return np.where(np.isfinite(way), way, 0.0)

    def _built_slopes(self, station: Float, offset: Float, height: Float) -> tuple[Float, Float]:
        """Return the slopes (N,) of the road as it was built, along and across, by its elevation (N,), m."""
        boundaries = self._built.boundaries(station)
        inner = np.clip(offset - _STEP, boundaries[0][:, -1], None)
        across = (height - self._built.main_elevation(station, inner, boundaries)) / np.maximum(offset - inner, 1e-9)
        ahead = self._built.main_elevation(station + _STEP, offset)
        along = np.where(np.isnan(ahead), 0.0, (ahead - height) / _STEP)
        curvature = self._built.alignment.curvature(station)
        return along / (1.0 - curvature * clip_offset(offset, curvature)), across


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
