"""Heights of a road's pavement above its analytic surface, as the parameters say: tracks, joints, waves, damage."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Bool, Float, Index
from ...base.random_streams import stream
from ..geometry import RoadGeometry
from ..objects import Side
from ..section import Crack, Patch, Pavement, RemovedMarking
from .clipping import covers, edges_of
from .field import ArrayCalculus, Shape, asphalt_height, concrete_height
from .outlines import crack_outlines, patch_outline, removed_outlines
from .places import pavement_places
from .unevenness import unevenness

_CELL = 10.0
"""Length of the stretches that damage is looked up by, m."""


@dataclass(frozen=True)
class _DamageArea:
    """A convex face of a patch, crack or removed marking.

    Attributes:
        edges: (K, 3) normal and distance of each edge in stations and offsets, inside where all are below 0.
        low, high: lowest and highest station, m.
        height: above the pavement, m.
        levels: whether wheel tracks end at it, as joints do.
    """

    edges: Float
    low: float
    high: float
    height: float
    levels: bool

    def covers(self, station: Float, offset: Float) -> Bool:
        """Return which places (N,) lie within."""
        return covers(self.edges, station, offset)


class PavementSurface:
    """Heights of a road's pavement above `RoadGeometry.elevation`.

    Args:
        geometry: the road's.
    """

    def __init__(self, geometry: RoadGeometry) -> None:
        self.geometry = geometry
        self._seed = int(stream(geometry.parameters.metadata.seed, "pavement unevenness").integers(1 << 31))

    def height(self, station: ArrayLike, offset: ArrayLike, waves: bool = True) -> Float:
        """Return the heights (N,) of places, m: of damage where there is any; 0 beside the pavement.

        Args:
            station, offset: (N,) m.
            waves: whether the unevenness is part of them.
        """
        station, offset = (np.asarray(value, np.float64).ravel() for value in np.broadcast_arrays(station, offset))
        result = np.zeros(len(station))
        for side, section in self.geometry.sections.items():
            on_carriageway = np.flatnonzero(self.is_paved(side, station, offset))
            if len(on_carriageway):
                result[on_carriageway] = self.worn_height(side, station[on_carriageway], offset[on_carriageway])
                self._lay_damage(side, station, offset, on_carriageway, result)
                if waves:
                    places = self.geometry.alignment.place(station[on_carriageway], offset[on_carriageway])
                    result[on_carriageway] += self.waves(section.carriageway.pavement, places)
        return result

    def is_paved(self, side: Side, station: Float, offset: Float) -> Bool:
        """Return which places (N,) lie on a carriageway's pavement."""
        section = self.geometry.sections[side]
        distance, constant_distances = section.carriageway.sign * offset, section.constant_distances
        # One row stands for all where widths are the same everywhere.
        distances = section.distances(station) if constant_distances is None else constant_distances[None]
        # Gutters, bays and footways of street sides have no part in its waves and wheel tracks.
        outer_edge = section.kinds.index("gutter") if "gutter" in section.kinds else -2
        is_paved = (distance >= distances[:, 0]) & (distance <= distances[:, outer_edge])
        if "island" in section.kinds:
            island_start, island_end = section.boundaries_of("island", station)
            is_paved &= (distance <= island_start) | (distance >= island_end)
        return np.asarray(is_paved)

    def worn_height(self, side: Side, station: Float, offset: Float, joints: bool = True) -> Float:
        """Return the heights (N,) of a carriageway's wheel tracks and joints, m, as if there were no damage.

        Args:
            side: the carriageway's.
            station, offset: (N,) places on it.
            joints: whether there are joints.
        """
        section = self.geometry.sections[side]
        pavement, place = section.carriageway.pavement, pavement_places(section, station, offset)
        shape = Shape(pavement.wheel_track_depth, pavement.joint_depth if joints else 0.0)
        calculus = ArrayCalculus()
        if pavement.is_concrete:
            return np.asarray(concrete_height(calculus, place, shape, pavement.slab_length))
        return np.asarray(asphalt_height(calculus, place, shape))

    def waves(self, pavement: Pavement, place: Float) -> Float:
        """Return the heights (N,) of the unevenness at places (N, 2 or 3) in the road's local frame, m."""
        if pavement.unevenness == 0.0:
            return np.zeros(len(place))
        return unevenness(place, pavement.unevenness, self._seed)

    def _lay_damage(self, side: Side, station: Float, offset: Float, rows: Index, result: Float) -> None:
        """Set, in place, the heights of the points (rows) that lie on damage; of several the last one counts.

        Patches come after cracks and removed markings.
        """
        cell = np.floor(station[rows] / _CELL).astype(np.int64)
        for number in np.unique(cell).tolist():
            rows_of_cell = rows[cell == number]
            for area in self._areas[side].get(number, ()):
                covered_rows = rows_of_cell[area.covers(station[rows_of_cell], offset[rows_of_cell])]
                result[covered_rows] = area.height + (
                    0.0 if area.levels else self._tracks(side, station, offset, covered_rows)
                )

    def _tracks(self, side: Side, station: Float, offset: Float, rows: Index) -> Float:
        """Return the heights (R,) of wheel tracks without joints, m, at the given rows of the places."""
        return self.worn_height(side, station[rows], offset[rows], joints=False)

    @cached_property
    def _areas(self) -> dict[Side, dict[int, list[_DamageArea]]]:
        """The faces of removed markings, of cracks, then of patches, of each side by the stretch that they lie on."""
        result: dict[Side, dict[int, list[_DamageArea]]] = {}
        for side, section in self.geometry.sections.items():
            cells: dict[int, list[_DamageArea]] = {}
            for area in _faces(section.carriageway.pavement, self.geometry.length):
                for cell in range(int(area.low // _CELL), int(area.high // _CELL) + 1):
                    cells.setdefault(cell, []).append(area)
            result[side] = cells
        return result


def _faces(pavement: Pavement, length: float) -> Iterator[_DamageArea]:
    """Yield the faces of removed markings, then cracks, then patches: a later one covers an earlier one."""
    for marking in pavement.removed_markings:
        for outline in removed_outlines(marking, pavement, length):
            yield _area(outline, damage_height(marking), levels=False)
    for crack in pavement.cracks:
        for outline in crack_outlines(crack):
            yield _area(outline, damage_height(crack), levels=False)
    for patch in pavement.patches:
        outline = patch_outline(patch)
        if len(outline) > 2:
            yield _area(outline, damage_height(patch), levels=True)


def damage_height(item: Patch | Crack | RemovedMarking) -> float:
    """Return the height (m) above the pavement around of a patch; of a crack or old marking minus its depth."""
    return item.height if isinstance(item, Patch) else -item.depth


def laid_height(
    item: Patch | Crack | RemovedMarking, pavement: Pavement, length: float, station: Float, offset: Float
) -> Float:
    """Return how much (N,), m, one patch, crack or old marking alone raises the surface at stations and offsets (N,).

    Args:
        item: what lies there.
        pavement: that it lies on.
        length: of the road, m.
        station, offset: m.
    """
    name = "patches" if isinstance(item, Patch) else "cracks" if isinstance(item, Crack) else "removed_markings"
    emptied = {"patches": (), "cracks": (), "removed_markings": ()}
    result = np.zeros(station.shape)
    for area in _faces(pavement.model_copy(update={**emptied, name: (item,)}), length):
        nearby = np.flatnonzero((station >= area.low) & (station <= area.high))
        result[nearby[area.covers(station[nearby], offset[nearby])]] = area.height
    return result


def _area(outline: Float, height: float, levels: bool) -> _DamageArea:
    """Return the face of a convex outline (K, 2) that goes against the clock."""
    lowest, highest = outline[:, 0].min(), outline[:, 0].max()
    return _DamageArea(edges_of(outline), float(lowest), float(highest), height, levels)
