"""Markings as films over the pavement: cracks go through them, as the film breaks with what it lies on.

A patch takes the place of pavement and film together: arrows and hatched areas have no film on it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from ...base.arrays import Bool, Float
from ..geometry import RoadGeometry
from ..objects import Side
from ..paint import arrow_outlines, cut_outline, hatching_outlines
from ..section import Arrow, Hatching, LineMarking
from .clipping import covers, edges_of, split_outline, subtract
from .outlines import patch_outline


def painted_outlines(geometry: RoadGeometry, item: Hatching | Arrow) -> list[Float]:
    """Return the convex parts (K, 2) of a hatched area or an arrow as it is: without what patches took away."""
    parts = hatching_outlines(geometry, item) if isinstance(item, Hatching) else arrow_outlines(item)
    patches = [patch_outline(patch) for patch in geometry.parameters.carriageway_of(item).pavement.patches]
    areas = [patch for patch in patches if len(patch) > 2]
    return [piece for part in parts for piece in subtract(part, areas)]


class MarkingFilms:
    """Films of a carriageway's markings: lines, arrows, hatched areas.

    Args:
        geometry: the road's.
        side: the carriageway's.
        names: ids of the markings that count; all if None.
    """

    def __init__(self, geometry: RoadGeometry, side: Side, names: Collection[str] | None = None) -> None:
        road = geometry.parameters
        chosen = road.objects if names is None else {name: road.objects[name] for name in names if name in road.objects}
        lines = [item for item in chosen.values() if isinstance(item, LineMarking)]
        self._geometry = geometry
        self._lines = [line for line in lines if road.carriageway_of(line).side == side]
        self._dashes = [geometry.dashes(line) for line in self._lines]
        painted: list[Hatching | Arrow] = [item for item in chosen.values() if isinstance(item, Hatching)]
        painted += [item for item in chosen.values() if isinstance(item, Arrow)]
        self._areas = [
            (outline, edges_of(outline), item.film_thickness)
            for item in painted
            if road.carriageway_of(item).side == side
            for outline in painted_outlines(geometry, item)
        ]
        outlines = [outline for outline, _, _ in self._areas]
        self._lows = np.array([outline.min(axis=0) for outline in outlines]).reshape(-1, 2)
        self._highs = np.array([outline.max(axis=0) for outline in outlines]).reshape(-1, 2)

    def thickness(self, station: Float, offset: Float) -> Float:
        """Return the thickness (N,) of the thickest film at places (N,), m; 0 where there is none."""
        result = self._line_thickness(range(len(self._lines)), station, offset)
        for (_, edges, film), start, end in zip(self._areas, self._lows[:, 0], self._highs[:, 0], strict=True):
            nearby = np.flatnonzero((station >= start) & (station <= end))
            covered = nearby[covers(edges, station[nearby], offset[nearby])]
            result[covered] = np.maximum(result[covered], film)
        return result

    def cut(self, outlines: Sequence[Float]) -> Iterator[tuple[Float, float]]:
        """Yield the pieces of short convex outlines (K, 2) on and beside films, with the film's thickness, m."""
        for outline, film in self._cut_by_lines(outlines):
            if film:
                yield outline, film
            else:
                yield from self._cut_by_areas(outline)

    def _areas_near(self, lower: Float, upper: Float) -> list[int]:
        """Return the numbers of the areas whose boxes meet a box (station, offset): a long road has hundreds."""
        numbers: list[int] = np.flatnonzero(((self._lows < upper) & (self._highs > lower)).all(axis=1)).tolist()
        return numbers

    def _cut_by_areas(self, outline: Float) -> Iterator[tuple[Float, float]]:
        """Yield the pieces of an outline on arrows and hatched areas, with the film's thickness, m; then the rest, 0.

        Where areas overlap the first one gives the thickness: only what it leaves is cut by the next.
        """
        remainder = [outline]
        for number in self._areas_near(outline.min(axis=0), outline.max(axis=0)):
            area, _, film = self._areas[number]
            parts, remainder = remainder, []
            for part in parts:
                piece, pieces_beside = split_outline(part, area)
                if piece is None:
                    remainder.append(part)  # whole: the pieces beside it would only be more of them
                else:
                    yield piece, film
                    remainder += pieces_beside
        yield from ((part, 0.0) for part in remainder)

    def _cut_by_lines(self, outlines: Sequence[Float]) -> Iterator[tuple[Float, float]]:
        """Yield the pieces of short convex outlines (K, 2) on line markings and beside them, with the film's thickness.

        A piece is first cut at the ends of the dashes, then, with its columns swapped, at the offsets of the lines'
        edges in the outline's middle; m, 0 beside all lines.
        """
        if not outlines:
            return
        lower, upper = (np.array([extreme(outline, axis=0) for outline in outlines]) for extreme in (np.min, np.max))
        middle_stations = (lower[:, 0] + upper[:, 0]) / 2.0
        is_near = np.zeros((len(self._lines), len(outlines)), bool)
        edges = np.zeros((*is_near.shape, 2))
        for number, (line, dashes) in enumerate(zip(self._lines, self._dashes, strict=True)):
            # Edges cost far more than to see that a line ends before all this or begins behind it.
            if not len(dashes) or dashes[0, 0] > upper[:, 0].max() or dashes[-1, 1] < lower[:, 0].min():
                continue
            edges[number] = np.stack(self._geometry.marking_edges(line, middle_stations), axis=1)
            is_near[number] = (edges[number, :, 1] < upper[:, 1]) & (edges[number, :, 0] > lower[:, 1])
        for number, outline in enumerate(outlines):
            nearby_lines = np.flatnonzero(is_near[:, number])
            if not len(nearby_lines):
                yield outline, 0.0
                continue
            dash_ends = np.concatenate([self._dashes[line].ravel() for line in nearby_lines])
            edge_offsets = edges[nearby_lines, number].ravel()
            for part in _cut(outline, dash_ends):
                for piece in _cut(part[::-1, ::-1], edge_offsets):
                    centre = piece[:, ::-1].mean(axis=0)
                    yield piece[::-1, ::-1], float(self._line_thickness(nearby_lines, centre[:1], centre[1:])[0])

    def _line_thickness(self, lines: Iterable[int], station: Float, offset: Float) -> Float:
        """Return the thickness (N,), m, of the thickest film of some lines, by number, at places (N,); 0 for none."""
        result = np.zeros(len(station))
        for number in lines:
            is_painted = _is_painted(self._dashes[number], station)
            if not is_painted.any():
                continue
            left_edge, right_edge = self._geometry.marking_edges(self._lines[number], station)
            film = self._lines[number].film_thickness
            result = np.where(
                is_painted & (offset <= left_edge) & (offset >= right_edge), np.maximum(result, film), result
            )
        return result


def _is_painted(dashes: Float, station: Float) -> Bool:
    """Return which stations (N,) lie on dashes (D, 2), which are in order."""
    if not len(dashes):
        return np.zeros(len(station), bool)
    dash = np.searchsorted(dashes[:, 0], station, "right") - 1
    return np.asarray((dash >= 0) & (station <= dashes[dash, 1]))


def _cut(outline: Float, places: Float) -> Iterator[Float]:
    """Yield the pieces of a convex outline (K, 2) between some first coordinates."""
    lower, upper = outline[:, 0].min(), outline[:, 0].max()
    inner_places = np.unique(places[(places > lower + 1e-4) & (places < upper - 1e-4)])
    if not len(inner_places):
        yield outline
        return
    yield from cut_outline(outline, np.array([lower, *inner_places, upper]))
