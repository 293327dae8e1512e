"""Points take their layers from images: the image that fits best, the occlusion test, and the sampling."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.arrays import Bool, Float, Float32, Index, UInt8, UInt16
from .colour import FROM_MATERIAL, NEARBY, LayerValues, MaterialLayers, SeenPoints
from .views import RenderedImage, View

CANDIDATES = 8
"""Images nearest to the scanner that a point can take its values from; all of three places where that is more. Chosen:
others are seldom the best."""
TRIES = 3
"""Of these, how many of the best are looked into. Chosen: most points that three hide every near one hides."""
ALL_CANDIDATES = 24
"""As `CANDIDATES`, of the points that none of the best shows; of these images all are looked into. Chosen: three times
as many."""
DISTANCE_WEIGHT = 0.25
"""Weight of twice the scanner's range in the choice of an image, rad: ln 2 times this."""
TOLERANCE = 0.03
"""Depth that a surface may differ by from the plane through the point, m, beside half a pixel's own width. Chosen:
noise of the range and of the rendered depth."""
_STEEPEST = 0.02
"""Cosine under which a surface is seen too flat to be sampled. Chosen: 89 degrees."""
_LEAST_WEIGHT = 0.05
"""Share of the four pixels around a point that must show its surface. Chosen: with less, rounding says what shows."""
_NOWHERE = np.float32(1e9)
"""Misfit of an image that doesn't show a point. Chosen: beyond that of any that does."""
REACH = 0.3
"""How far away a place may lie that stands for a point, m. Chosen: within the wavelength of most variation."""
_STEPS = 2
"""Pixels are looked at on a square of twice as many steps and one, which is within `REACH` if they are fine enough."""
_ROWS, _COLUMNS = (steps.ravel() for steps in np.mgrid[-_STEPS : _STEPS + 1, -_STEPS : _STEPS + 1])
"""Steps down and to the right, px."""
_LIT = 0.05
"""Share of the sun's full light from which on a place counts as lit. Chosen: below it shade and sun can't be told by a
ratio."""
_NEAREST = 3
"""Places of images, nearest to some points, that `views_near` takes. Chosen: the nearest, and one on either side."""
_MARGIN = 24
"""Border around the points in these, px: what is hidden takes its colour from close by."""


class ImageLayers:
    """Layer source that samples images rendered along the path, else the materials' means; thread-safe.

    A point takes the image whose ray differs least from the scanner's: the angle between both, plus `DISTANCE_WEIGHT`
    times the logarithm of how much farther away the camera is. Where the point is hidden there, the next best, and so
    on, through all images around. What none of them shows takes a place of its material close by, see
    `sample_nearby`; in the end the material's means. Of the four pixels around the point's projection those
    count that show the same material at the depth of the plane through the point, so that neither what stands before
    it nor what lies behind an edge mixes in, and grazing views stay usable.
    """

    calls = None

    def __init__(self, images: Sequence[RenderedImage], channels: dict[str, int], material: MaterialLayers) -> None:
        """Take rendered images, their channels (name -> components, in order), and the source where none shows a point.

        The channels are those of `MATERIAL_LAYERS` that vary, and ``sun`` and ``sky``: the light of each that the
        surface reflects, exposed.
        """
        self.images = list(images)
        self.material = material
        self.report: dict[str, Any] = {}
        starts = np.cumsum([0, *channels.values()])
        self.channels = {
            name: slice(int(a), int(b)) for name, a, b in zip(channels, starts[:-1], starts[1:], strict=True)
        }
        self._locate()

    def _locate(self) -> None:
        """Set the cameras' positions, the numbers of candidate images, and the cell size for scanner positions."""
        self._places = np.array([image.view.position for image in self.images]).reshape(-1, 3)
        places, count = np.unique(self._places, axis=0, return_counts=True)
        most = int(count.max(initial=0))
        self._candidates, self._all = max(CANDIDATES, 3 * most), max(ALL_CANDIDATES, 9 * most)
        # Points whose scanner stood within one such cube share their candidates.
        spacing = np.linalg.norm(np.diff(places, axis=0), axis=1) if len(places) > 1 else np.ones(1)
        self._cell = max(float(np.median(spacing)) / 2.0, 0.5)

    def sample(self, points: SeenPoints, wanted: frozenset[str]) -> LayerValues:
        """Return the wanted layers of N points from the best image that shows each, else nearby, else the means."""
        points = replace(points, time=np.array(points.time, np.float64))  # the images' times are written into it
        source = np.full(len(points), FROM_MATERIAL, np.uint8)
        taken = np.zeros((len(points), sum(part.stop - part.start for part in self.channels.values())), np.float32)
        if len(points) and self.images:
            self._fill_all(points, taken, source)
        return self.material.layer_values(
            points, {name: taken[:, part] for name, part in self.channels.items()}, source, wanted
        )

    def _fill_all(self, points: SeenPoints, taken: Float32, source: UInt8) -> None:
        """Fill in, in place, values, sources and times of the points that an image shows, by scanner position."""
        cube = np.floor(points.scanner / self._cell).astype(np.int64)
        if (cube == cube[0]).all():
            self._fill_group(points, np.arange(len(points)), taken, source)
            return
        _, group = np.unique(cube @ np.array([1, 1 << 20, 1 << 40]), return_inverse=True)
        order = np.argsort(group, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
            self._fill_group(points, rows, taken, source)

    def _fill_group(self, points: SeenPoints, rows: Index, taken: Float32, source: UInt8) -> None:
        """Fill in, in place, the rows of points that the scanner saw from about one place, from their best images."""
        seen = points.select(rows)
        chosen, misfit = self._misfits(seen, self._candidates)
        order = np.argsort(misfit, axis=0, kind="stable")[:TRIES]
        best = np.where(np.take_along_axis(misfit, order, axis=0) >= _NOWHERE, -1, order)
        hidden = np.ones(len(rows), bool)
        for rank in range(best.shape[0]):
            left = np.flatnonzero(hidden & (best[rank] >= 0))
            slots = best[rank, left]
            for slot in np.unique(slots):
                part = left[slots == slot]
                image = self.images[chosen[slot]]
                values, shown = sample_image(image, seen.select(part))
                part = part[shown]
                into = rows[part]
                taken[into], source[into], points.time[into] = values, rank + 1, image.view.time
                hidden[part] = False
        if hidden.any():
            self._fill_hidden(points, rows[hidden], taken, source)

    def _fill_hidden(self, points: SeenPoints, rows: Index, taken: Float32, source: UInt8) -> None:
        """Fill in, in place, rows that the best images don't show: from any image around, else from close by.

        These are few: it is quicker to look at all of them in image by image than to go by their own order.
        """
        seen = points.select(rows)
        chosen, misfit = self._misfits(seen, self._all)
        shows = (misfit < _NOWHERE).any(axis=1)
        chosen, misfit = chosen[shows], misfit[shows]
        rank = np.argsort(np.argsort(misfit, axis=0, kind="stable"), axis=0)
        least = np.full(len(rows), _NOWHERE)
        for slot, number in enumerate(chosen):
            part = np.flatnonzero(misfit[slot] < least)
            image = self.images[number]
            values, shown = sample_image(image, seen.select(part))
            part = part[shown]
            into = rows[part]
            taken[into], source[into], points.time[into] = values, rank[slot, part] + 1, image.view.time
            least[part] = misfit[slot, part]
        away = np.where(source[rows] == FROM_MATERIAL, REACH, 0.0)
        for slot, number in enumerate(chosen):
            part = np.flatnonzero((away > 0.0) & (misfit[slot] < _NOWHERE))
            image = self.images[number]
            values, closer, distance = sample_nearby(image, seen.position[part], seen.material[part], away[part])
            part = part[closer]
            into = rows[part]
            taken[into], source[into], points.time[into] = values, NEARBY, image.view.time
            away[part] = distance
        near = rows[source[rows] == NEARBY]
        taken[near] = relight_nearby(self.material, points.select(near), taken[near], self.channels)

    def _misfits(self, points: SeenPoints, candidates: int) -> tuple[Index, Float32]:
        """Return the indices (C,) of the images nearest to the scanner, and their misfits (C, N) to the points, rad."""
        away = np.linalg.norm(self._places - points.scanner.mean(axis=0), axis=1)
        chosen = np.argsort(away, kind="stable")[:candidates]
        middle = points.position.mean(axis=0)
        at = (points.position - middle).astype(np.float32)
        scanned = (points.scanner - points.position).astype(np.float32)
        reach = np.maximum(_length(scanned), np.float32(1e-6))
        normal = np.asarray(points.normal, np.float32)
        misfit = np.empty((len(chosen), len(points)), np.float32)
        for row, number in enumerate(chosen):
            misfit[row] = _misfit(self.images[number].view, at, middle, scanned, reach, normal)
        return chosen, misfit


def _misfit(view: View, at: Float32, middle: Float, scanned: Float32, reach: Float32, normal: Float32) -> Float32:
    """Return an image's misfit (N,) to points, rad: angle between the rays plus a term of range; 1e9 if not shown."""
    towards = (view.position - middle).astype(np.float32) - at
    away = np.maximum(_length(towards), np.float32(1e-6))
    cosine = np.einsum("nk,nk->n", towards, scanned) / (away * reach)
    misfit = np.arccos(np.clip(cosine, -1.0, 1.0)) + DISTANCE_WEIGHT * np.abs(np.log(away / reach))
    right, up, back = (-towards @ view.rotation.astype(np.float32)).T
    scale = view.focal / np.maximum(-back, np.float32(1e-6))
    x, y = view.centre[0] + right * scale, view.centre[1] - up * scale
    inside = (back < 0.0) & (x > 0.0) & (x < view.size[0]) & (y > 0.0) & (y < view.size[1])
    inside &= np.einsum("nk,nk->n", towards, normal) > _STEEPEST * away
    return np.where(inside, misfit, _NOWHERE)


def sample_image(image: RenderedImage, points: SeenPoints) -> tuple[Float32, Bool]:
    """Return an image's layers (n, C), interpolated, at the n of N points that it shows, and their mask (N,).

    Bilinear over the pixels around a point that show its surface: the same material, at the depth of the plane
    through the point within `TOLERANCE` and half a pixel's width there.
    """
    view = image.view
    x, y, depth = view.project(points.position)
    column, row = np.floor(x - 0.5), np.floor(y - 0.5)
    plane = _plane_depth(view, points)
    slack = TOLERANCE + 0.5 * depth / view.focal
    width, height = view.size
    values = np.zeros((len(points), image.layers.shape[2]), np.float32)
    total = np.zeros(len(points), np.float32)
    for dy in (0, 1):
        for dx in (0, 1):
            i, j = column + dx, row + dy
            weight = (1.0 - np.abs(x - 0.5 - i)) * (1.0 - np.abs(y - 0.5 - j))
            good = (i >= 0) & (i < width) & (j >= 0) & (j < height)
            i, j = np.where(good, i, 0).astype(np.intp), np.where(good, j, 0).astype(np.intp)
            # Where the plane stands edge-on its depth has no meaning, and no pixel agrees with it.
            with np.errstate(divide="ignore", invalid="ignore"):
                expected = plane(i, j)
                good &= image.material[j, i] == points.material + 1
                good &= np.abs(image.depth[j, i] - expected) < slack
            part = np.where(good, weight, 0.0).astype(np.float32)
            values += part[:, None] * image.layers[j, i]
            total += part
    shown = total >= _LEAST_WEIGHT
    return values[shown] / total[shown, None], shown


def _plane_depth(view: View, points: SeenPoints) -> Callable[[Index, Index], Float]:
    """Return a function of pixel indices: depths (N,), m, at which the pixels' rays meet the planes of the points."""
    normal = np.asarray(points.normal, np.float64) @ view.rotation
    constant = np.einsum("nk,nk->n", normal, (points.position - view.position) @ view.rotation)

    def depths(i: Index, j: Index) -> Float:
        right, up = (i + 0.5 - view.centre[0]) / view.focal, (view.centre[1] - j - 0.5) / view.focal
        return np.asarray(constant / (normal[:, 0] * right + normal[:, 1] * up - normal[:, 2]))

    return depths


def _length(vectors: Float32) -> Float32:
    return np.sqrt(np.einsum("nk,nk->n", vectors, vectors))


def sample_nearby(image: RenderedImage, position: Float, material: UInt16, limit: Float) -> tuple[Float32, Bool, Float]:
    """Return an image's layers (n, C) close to points, the mask (N,) of the points that got any, and distances (n,), m.

    Of the pixels around a point's projection those count that show its material, and of these the one that shows the
    nearest place in space. What hides the point is thus never taken, unless it is of the same material and as close.

    Args:
        image: with depths and materials.
        position: (N, 3) points in front of the camera.
        material: (N,) theirs.
        limit: (N,) how far away a place may lie, m; `REACH` at most.
    """
    view = image.view
    x, y, depth = view.project(position)
    step = np.maximum(np.floor(REACH / _STEPS * view.focal / depth), 1.0)
    i = (np.floor(x)[:, None] + step[:, None] * _COLUMNS).astype(np.intp)
    j = (np.floor(y)[:, None] + step[:, None] * _ROWS).astype(np.intp)
    width, height = view.size
    good = (i >= 0) & (i < width) & (j >= 0) & (j < height)
    i, j = np.where(good, i, 0), np.where(good, j, 0)
    good &= image.material[j, i] == material[:, None] + 1
    away = np.linalg.norm(view.unproject(i, j, image.depth[j, i]) - position[:, None, :], axis=2)
    away[~good] = np.inf
    best = np.arange(len(position)), away.argmin(axis=1)
    near = away[best] < limit
    return image.layers[j[best], i[best]][near].astype(np.float32), near, away[best][near]


def relight_nearby(fallback: MaterialLayers, points: SeenPoints, taken: Float32, channels: dict[str, slice]) -> Float32:
    """Return channels (N, C) that were taken close by, their sunlight recomputed for the points' own normals.

    Leaves, blades and sheets that touch lean every way. Whether the sun reaches a place is therefore all that is kept
    of its light; without a base colour there is nothing to shine on, and the light stays as it is.
    """
    if "sun" not in channels or "base_color" not in channels:
        return taken
    result = taken.copy()
    varies = fallback.constants.varies["base_color"][points.material][:, None]
    mean = fallback.constants.values["base_color"][points.material]
    color = np.where(varies, taken[:, channels["base_color"]], mean)
    sun = fallback.light.sun.astype(np.float32)
    lit = taken[:, channels["sun"]].sum(axis=1) > _LIT * (color * sun).sum(axis=1)
    result[:, channels["sun"]] = color * fallback.light.sunlight(points.normal) * lit[:, None]
    return result


def views_near(views: Sequence[View], lines: Sequence[SeenPoints]) -> list[View]:
    """Return the views nearest to each scan line's scanner, each cropped to the part that shows the line's points."""
    parts: list[View | None] = []
    for line in lines:
        away = np.array([np.linalg.norm(view.position - line.scanner.mean(axis=0)) for view in views])
        places = np.unique(np.round(away, 6))[:_NEAREST]
        if not len(places):
            continue
        near = np.flatnonzero(away <= places[-1] + 1e-5)
        parts += [views[number].crop_to(line.position, _MARGIN) for number in near]
    return [part for part in parts if part is not None]
