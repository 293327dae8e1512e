"""Colours of points from images, as mobile and airborne systems make them: without asking what hides a point.

A point is looked up in the images of the exposures nearest to it, at its measured place, by the cameras' measured
poses. What stands before it, what has moved since, and errors of calibration give it the colour of another thing; the
images' own truth tells how many points that befalls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...base.arrays import Bool, Float, Index, UInt8, UInt16
from .lens import Lens

EXPOSURES_TRIED = 4
"""Nearest exposures in which a point is looked for, one after the other."""
_NEARER = 0.3
"""Distance, m, by which what a pixel shows must lie before a point to count as hiding it. Chosen: more than plants'
leaves and a road's crossfall make within a pixel."""
_NEARER_SHARE = 0.05
"""The same as a share of the distance, for pixels that are far and wide."""
_TO_16_BITS = 257
"""Factor from 8-bit colours to 16-bit ones."""


class Pixels(NamedTuple):
    """Pixels of one image.

    Attributes:
        rgb: (H, W, 3) uint8.
        depth: (H, W) distance along the ray, m, 0 where nothing is met; None where it isn't known.
        instance_id: (H, W); None where it isn't known.
    """

    rgb: UInt8
    depth: NDArray[np.floating] | None = None
    instance_id: NDArray[np.integer] | None = None


@dataclass(frozen=True)
class View:
    """One image of which points take colours.

    Attributes:
        exposure: number of the exposure.
        lens: of the camera.
        position: (3,) measured place of its optical centre, m.
        rotation: (3, 3) measured, from its frame to the axes of the points.
        pixels: returns what the image shows.
    """

    exposure: int
    lens: Lens
    position: Float
    rotation: Float
    pixels: Callable[[], Pixels]


@dataclass
class ColourCounts:
    """Counts of points coloured from images.

    Attributes:
        coloured: that an image shows.
        unseen: that no image of those tried shows: they keep the colours of their own places.
        hidden: of the coloured ones, those before which the image shows something nearer.
        other_instance: of the coloured ones, those whose pixel shows another instance.
    """

    coloured: int = 0
    unseen: int = 0
    hidden: int = 0
    other_instance: int = 0

    def to_dict(self) -> dict[str, int]:
        """Return the counts as JSON data."""
        return asdict(self)


class ImageColours:
    """Colours that images give to points.

    Args:
        views: the images.
        counts: to which those of the points are added.

    Attributes:
        counts: of the points so far.
    """

    def __init__(self, views: Sequence[View], counts: ColourCounts | None = None) -> None:
        self.counts = ColourCounts() if counts is None else counts
        self._by_exposure: dict[int, list[View]] = {}
        for view in views:
            self._by_exposure.setdefault(view.exposure, []).append(view)
        self._numbers = sorted(self._by_exposure)
        places = [np.mean([view.position for view in self._by_exposure[n]], axis=0) for n in self._numbers]
        self._tree = cKDTree(np.array(places)) if places else None

    def colours(self, place: Float, rgb: UInt16, instance_id: NDArray[np.integer]) -> UInt16:
        """Return the colours (N, 3), 16 bits, that points have in the images; adds to `counts`.

        Args:
            place: (N, 3) measured, in the frame of the views, m.
            rgb: (N, 3) uint16 colours that points keep which no image shows.
            instance_id: (N,) of the points, by which wrong colours are counted.
        """
        result = rgb.copy()
        if self._tree is None or not len(place):
            self.counts.unseen += len(place)
            return result
        tried = min(EXPOSURES_TRIED, len(self._numbers))
        nearest = np.reshape(self._tree.query(place, k=tried)[1], (len(place), tried))
        left = np.arange(len(place))
        for rank in range(tried):
            seen = np.zeros(len(left), bool)
            exposures = nearest[left, rank]
            for exposure in np.unique(exposures):
                rows = np.flatnonzero(exposures == exposure)
                views = self._by_exposure[self._numbers[int(exposure)]]
                seen[rows] = self._take(views, place, instance_id, left[rows], result)
            left = left[~seen]
        self.counts.unseen += len(left)
        return result

    def _take(
        self, views: list[View], place: Float, instance_id: NDArray[np.integer], rows: Index, result: UInt16
    ) -> Bool:
        """Give rows of points the colours of the cameras of one exposure, in place; return which (K,) any sees.

        Of several that see a point the one counts nearest to whose axis it is.
        """
        cosine, chosen = np.full(len(rows), -2.0), np.full(len(rows), -1)
        pixel = np.zeros((2, len(rows)), np.intp)
        distances = np.zeros(len(rows))
        for number, view in enumerate(views):
            point = view.rotation.T @ (place[rows] - view.position).T
            distance = np.sqrt((point**2).sum(axis=0))
            seen_at = view.lens.project(point)
            is_seen = ~np.isnan(seen_at[0])
            better = np.flatnonzero(is_seen & (point[2] / np.maximum(distance, 1e-9) > cosine))
            cosine[better] = point[2, better] / np.maximum(distance[better], 1e-9)
            chosen[better], distances[better] = number, distance[better]
            limits = np.array([[view.lens.width - 1], [view.lens.height - 1]])
            pixel[:, better] = np.minimum(np.floor(seen_at[:, better]), limits).astype(np.intp)
        for number in np.unique(chosen[chosen >= 0]):
            mine = np.flatnonzero(chosen == number)
            pixels, (column, row) = views[number].pixels(), pixel[:, mine]
            result[rows[mine]] = pixels.rgb[row, column].astype(np.uint16) * np.uint16(_TO_16_BITS)
            self.counts.coloured += len(mine)
            if pixels.depth is not None:
                depth, distance = pixels.depth[row, column], distances[mine]
                margin = np.maximum(_NEARER, _NEARER_SHARE * distance)
                self.counts.hidden += int(((depth > 0.0) & (depth < distance - margin)).sum())
            if pixels.instance_id is not None:
                self.counts.other_instance += int((pixels.instance_id[row, column] != instance_id[rows[mine]]).sum())
        return np.asarray(chosen >= 0)
