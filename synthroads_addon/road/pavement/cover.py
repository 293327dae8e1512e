"""Line markings as films over the pavement: cracks go through them, as the film breaks with what it lies on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...base.arrays import Bool, Float
from ..geometry import RoadGeometry
from ..objects import Side
from ..paint import cut_outline
from ..section import LineMarking


class LineFilms:
    """Films of a carriageway's line markings.

    Args:
        geometry: the road's.
        side: the carriageway's.
    """

    def __init__(self, geometry: RoadGeometry, side: Side) -> None:
        lines = geometry.parameters.of_type(LineMarking).values()
        self._geometry = geometry
        self._lines = [line for line in lines if geometry.parameters.carriageway_of(line).side == side]
        self._dashes = [geometry.dashes(line) for line in self._lines]

    def thickness(self, station: Float, offset: Float) -> Float:
        """Return the thickness (N,) of the thickest film at places (N,), m; 0 where there is none."""
        result = np.zeros(len(station))
        for line, dashes in zip(self._lines, self._dashes, strict=True):
            left, right = self._geometry.marking_edges(line, station)
            covered = _is_painted(dashes, station) & (offset <= left) & (offset >= right)
            result = np.where(covered, np.maximum(result, line.film_thickness), result)
        return result

    def cut(self, outlines: Sequence[Float]) -> Iterator[tuple[Float, float]]:
        """Yield the pieces of short convex outlines (K, 2) on and beside films, with the film's thickness, m."""
        if not outlines:
            return
        low, high = (np.array([pick(outline, axis=0) for outline in outlines]) for pick in (np.min, np.max))
        middle = (low[:, 0] + high[:, 0]) / 2.0
        near = np.zeros((len(self._lines), len(outlines)), bool)
        edges = np.zeros((*near.shape, 2))
        for number, line in enumerate(self._lines):
            edges[number] = np.stack(self._geometry.marking_edges(line, middle), axis=1)
            near[number] = (edges[number, :, 1] < high[:, 1]) & (edges[number, :, 0] > low[:, 1])
        for number, outline in enumerate(outlines):
            met = np.flatnonzero(near[:, number])
            if not len(met):
                yield outline, 0.0
                continue
            ends = np.concatenate([self._dashes[line].ravel() for line in met])
            across = edges[met, number].ravel()
            for part in _cut(outline, ends):
                for piece in _cut(part[::-1, ::-1], across):
                    centre = piece[:, ::-1].mean(axis=0)
                    film = float(self.thickness(centre[:1], centre[1:])[0])
                    yield piece[::-1, ::-1], film


def _is_painted(dashes: Float, station: Float) -> Bool:
    """Return which stations (N,) lie on dashes (D, 2), which are in order."""
    if not len(dashes):
        return np.zeros(len(station), bool)
    dash = np.searchsorted(dashes[:, 0], station, "right") - 1
    return np.asarray((dash >= 0) & (station <= dashes[dash, 1]))


def _cut(outline: Float, places: Float) -> Iterator[Float]:
    """Yield the pieces of a convex outline (K, 2) between some first coordinates."""
    low, high = outline[:, 0].min(), outline[:, 0].max()
    inside = np.unique(places[(places > low + 1e-4) & (places < high - 1e-4)])
    if not len(inside):
        yield outline
        return
    yield from cut_outline(outline, np.array([low, *inside, high]))
