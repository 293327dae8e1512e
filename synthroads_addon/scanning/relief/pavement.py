"""Heights of the pavement at points: wheel tracks, joints, waves, patches and cracks, as the parameters say."""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float, Index
from ...road.geometry import RoadGeometry
from ...road.instances import Parts
from ...road.objects import Side
from ...road.pavement.cover import MarkingFilms
from ...road.pavement.outlines import CRACK_FILM, PATCH_FILM, REMOVED_FILM
from ...road.pavement.surface import PavementSurface, damage_height
from ...road.section import Arrow, Carriageway, Hatching, LineMarking, Turnout


class _Kind(NamedTuple):
    """How the pavement goes on in what lies on it.

    Attributes:
        side: of the carriageway.
        tracks, joints: whether there are wheel tracks, and joints as well.
        lifted: whether its faces lie on the films of markings where these are.
    """

    side: Side
    tracks: bool = True
    joints: bool = True
    lifted: bool = False


_KINDS = tuple(_Kind(*fields) for fields in product(get_args(Side), *((False, True),) * 3))
"""Every kind there can be."""


class _Block(NamedTuple):
    """Instance numbers side by side of what lies on a carriageway.

    Attributes:
        first, end: the numbers; ``end`` isn't among them.
        kind: what it is.
        height: of its faces above the pavement around it, m; what of it the mesh has already is taken off.
    """

    first: int
    end: int
    kind: _Kind
    height: float = 0.0


class PavementRelief:
    """Heights of pavements above their mesh.

    Args:
        geometry: the whole road's.
    """

    def __init__(self, geometry: RoadGeometry) -> None:
        self._surface = PavementSurface(geometry)
        self._films = {side: MarkingFilms(geometry, side) for side in geometry.sections}
        blocks = sorted(_blocks(geometry))
        self._first = np.array([block.first for block in blocks], np.int64)
        self._end = np.array([block.end for block in blocks], np.int64)
        self._height = np.array([block.height for block in blocks])
        self._kind = np.array([_KINDS.index(block.kind) for block in blocks], np.int64)
        self._origin = np.array(geometry.parameters.transform.translate[:2])

    def heights(self, instance: NDArray[np.integer], place: Float) -> Float:
        """Return the heights (N,) of points on pavements and on what is painted there, m; 0 of others.

        Args:
            instance: (N,) their instance numbers.
            place: (N, 3) where they are, map coordinates, m.
        """
        result = np.zeros(len(instance))
        block, paved_rows = self._blocks_of(instance)
        kinds = np.take(self._kind, np.take(block, paved_rows)) if len(paved_rows) else paved_rows
        for number in np.flatnonzero(np.bincount(kinds)).tolist():
            rows = paved_rows[kinds == number]
            # By columns: choosing rows of three numbers takes several times as long.
            road_place = np.column_stack([np.take(place[:, axis], rows) for axis in (0, 1)]) - self._origin
            result[rows] = self._height[block[rows]] + self._kind_heights(_KINDS[number], road_place)
        return result

    def on_pavement(self, instance: NDArray[np.integer]) -> Index:
        """Return the rows (K,) of instance numbers (N,) of pavements and of what is painted there."""
        return self._blocks_of(instance)[1]

    def along_road(self, place: Float) -> tuple[Float, Float, Float]:
        """Return station (N,), offset (N,), m, and unit vector forwards (N, 3), level, at map places (N, 3), m."""
        alignment = self._surface.geometry.alignment
        station, offset = alignment.project(place[:, :2] - self._origin)
        heading = alignment.heading(station)
        return station, offset, np.column_stack([np.cos(heading), np.sin(heading), np.zeros(len(station))])

    def _blocks_of(self, instance: NDArray[np.integer]) -> tuple[Index, Index]:
        """Return the block (N,) that each instance number may be in, and the rows (K,) of those that are in one."""
        if not len(self._first):
            return np.zeros(len(instance), np.intp), np.zeros(0, np.intp)
        block = np.searchsorted(self._first, instance, "right") - 1
        return block, np.flatnonzero((block >= 0) & (instance < self._end[block]))

    def _kind_heights(self, kind: _Kind, place: Float) -> Float:
        """Return the heights (K,), m, of the pavement under things of a kind, as far as these follow it.

        Args:
            kind: see `_Kind`.
            place: (K, 2) in the road's local frame, m.
        """
        surface = self._surface
        waves = surface.waves(surface.geometry.sections[kind.side].carriageway.pavement, place)
        if not kind.tracks:
            return waves
        station, offset = surface.geometry.alignment.project(place)
        height = surface.worn_height(kind.side, station, offset, kind.joints)
        if kind.lifted:
            height = height - self._films[kind.side].thickness(station, offset)
        return np.where(surface.is_paved(kind.side, station, offset), waves + height, 0.0)


def _blocks(geometry: RoadGeometry) -> Iterator[_Block]:
    """Yield the blocks of instance numbers of carriageways, turnouts and markings, and of what lies on these."""
    parameters, parts = geometry.parameters, geometry.numbers.parts
    for name, item in parameters.objects.items():
        if isinstance(item, Carriageway):
            yield _Block(item.instance, item.instance + 1, _Kind(item.side))
            if name in parts:
                yield from _damage_blocks(item, parts[name])
        elif isinstance(item, Turnout | Arrow | Hatching | LineMarking):
            side = parameters.carriageway_of(item).side
            # Traffic seldom drives along lines, and paint fills joints.
            kind = _Kind(side, tracks=isinstance(item, Turnout | Arrow), joints=isinstance(item, Turnout))
            yield _Block(item.instance, item.instance + 1, kind)
            if name in parts:
                yield _Block(parts[name].first, parts[name].first + parts[name].room, kind)


def _damage_blocks(carriageway: Carriageway, parts: Parts) -> Iterator[_Block]:
    """Yield the blocks of a carriageway's damages: ruts and potholes, then each patch, crack and removed marking.

    Args:
        carriageway: the carriageway.
        parts: instance numbers of its damages.
    """
    pavement, side = carriageway.pavement, carriageway.side
    in_the_surface = len(pavement.ruts) + len(pavement.potholes)
    kinds = [(_Kind(side), 0.0)] * in_the_surface
    kinds += [
        (_Kind(side, tracks=False, joints=False), damage_height(patch) - PATCH_FILM) for patch in pavement.patches
    ]
    kinds += [(_Kind(side, joints=False, lifted=True), damage_height(crack) - CRACK_FILM) for crack in pavement.cracks]
    kinds += [
        (_Kind(side, joints=False), damage_height(marking) - REMOVED_FILM) for marking in pavement.removed_markings
    ]
    for part, (kind, height) in enumerate(kinds):
        yield _Block(parts.number(part), parts.number(part) + 1, kind, height)
