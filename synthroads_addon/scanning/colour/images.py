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
        # Several images may be taken from one place, in different directions: candidates are all images of the nearest
        # three places, or of nine, if that is more than the usual number.
        images_per_place = int(count.max(initial=0))
        self._candidates, self._all = max(CANDIDATES, 3 * images_per_place), max(ALL_CANDIDATES, 9 * images_per_place)
        # Points whose scanner stood within one cube, half as wide as two places lie apart, share their candidates.
        spacing = np.linalg.norm(np.diff(places, axis=0), axis=1) if len(places) > 1 else np.ones(1)
        self._cell = max(float(np.median(spacing)) / 2.0, 0.5)

    def sample(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the named layers of N points from the best image that shows each, else from nearby, else the means."""
        points = replace(points, time=np.array(points.time, np.float64))  # the images' times are written into it
        source = np.full(len(points), FROM_MATERIAL, np.uint8)
        values = np.zeros((len(points), sum(part.stop - part.start for part in self.channels.values())), np.float32)
        if len(points) and self.images:
            self._fill_all(points, values, source)
        return self.material.layer_values(
            points, {name: values[:, part] for name, part in self.channels.items()}, source, names
        )

    def _fill_all(self, points: SeenPoints, values: Float32, source: UInt8) -> None:
        """Fill in, in place, values and sources of the points that an image shows, and the images' times in the points.

        Points that the scanner saw from about one place are looked up together.

        Args:
            points: N points.
            values: (N, C) channels.
            source: (N,) of `LayerValues`.
        """
        cube = np.floor(points.scanner / self._cell).astype(np.int64)
        if (cube == cube[0]).all():
            self._fill_group(points, np.arange(len(points)), values, source)
            return
        _, group = np.unique(cube @ np.array([1, 1 << 20, 1 << 40]), return_inverse=True)
        order = np.argsort(group, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
            self._fill_group(points, rows, values, source)

    def _fill_group(self, points: SeenPoints, rows: Index, values: Float32, source: UInt8) -> None:
        """Fill in, in place, the rows of points that the scanner saw from about one place, from their best images.

        Args:
            points: N points, whose times are those of the images afterwards.
            rows: (G,) of the points.
            values: (N, C) channels.
            source: (N,) of `LayerValues`.
        """
        group = points.select(rows)
        candidates, misfit = self._misfits(group, self._candidates)
        # By rank, the candidate (slot) that fits each point; -1 where the image doesn't show it.
        order = np.argsort(misfit, axis=0, kind="stable")[:TRIES]
        slot_by_rank = np.where(np.take_along_axis(misfit, order, axis=0) >= _NOWHERE, -1, order)
        is_hidden = np.ones(len(rows), bool)
        for rank, slot_of_point in enumerate(slot_by_rank):
            members = np.flatnonzero(is_hidden & (slot_of_point >= 0))
            slots = slot_of_point[members]
            for slot in np.unique(slots):
                members_of_image = members[slots == slot]
                image = self.images[candidates[slot]]
                channels, is_shown = sample_image(image, group.select(members_of_image))
                shown_members = members_of_image[is_shown]
                self._write(points, rows[shown_members], values, source, image, channels, rank + 1)
                is_hidden[shown_members] = False
        if is_hidden.any():
            self._fill_hidden(points, rows[is_hidden], values, source)

    def _fill_hidden(self, points: SeenPoints, rows: Index, values: Float32, source: UInt8) -> None:
        """Fill in, in place, rows that the best images don't show: from any image around, else from close by.

        These are few: it is quicker to look at all of them in image by image than to go by their own order.

        Args:
            points, values, source: see `_fill_group`.
            rows: (G,) of the points.
        """
        group = points.select(rows)
        candidates, misfit = self._misfits(group, self._all)
        shows_any = (misfit < _NOWHERE).any(axis=1)
        candidates, misfit = candidates[shows_any], misfit[shows_any]
        rank = np.argsort(np.argsort(misfit, axis=0, kind="stable"), axis=0)
        least_misfit = np.full(len(rows), _NOWHERE)
        for slot, number in enumerate(candidates):
            better = np.flatnonzero(misfit[slot] < least_misfit)
            image = self.images[number]
            channels, is_shown = sample_image(image, group.select(better))
            shown_members = better[is_shown]
            self._write(points, rows[shown_members], values, source, image, channels, rank[slot, shown_members] + 1)
            least_misfit[shown_members] = misfit[slot, shown_members]
        # Points that no image shows: the nearest place of their material within `REACH`; 0 for those that one shows.
        nearest_distance = np.where(source[rows] == FROM_MATERIAL, REACH, 0.0)
        for slot, number in enumerate(candidates):
            members = np.flatnonzero((nearest_distance > 0.0) & (misfit[slot] < _NOWHERE))
            image = self.images[number]
            channels, is_nearer, distance = sample_nearby(
                image, group.position[members], group.material[members], nearest_distance[members]
            )
            nearer = members[is_nearer]
            self._write(points, rows[nearer], values, source, image, channels, NEARBY)
            nearest_distance[nearer] = distance
        nearby_rows = rows[source[rows] == NEARBY]
        nearby_points = points.select(nearby_rows)
        values[nearby_rows] = relight_nearby(self.material, nearby_points, values[nearby_rows], self.channels)

    @staticmethod
    def _write(
        points: SeenPoints,
        rows: Index,
        values: Float32,
        source: UInt8,
        image: RenderedImage,
        channels: Float32,
        code: Index | int,
    ) -> None:
        """Write what an image gives some rows (K,) of points into values, sources and times, in place.

        Args:
            points, values, source: see `_fill_group`.
            rows: (K,) of the points.
            image: the image.
            channels: (K, C) channels.
            code: (K,) or one, of `LayerValues.source`.
        """
        values[rows], source[rows], points.time[rows] = channels, code, image.view.time

    def _misfits(self, points: SeenPoints, count: int) -> tuple[Index, Float32]:
        """Return the indices (C,) of the images nearest to the scanner, and their misfits (C, N) to the points, rad.

        Args:
            points: N points that the scanner saw from about one place.
            count: of the images, at most.
        """
        camera_distance = np.linalg.norm(self._places - points.scanner.mean(axis=0), axis=1)
        image_numbers = np.argsort(camera_distance, kind="stable")[:count]
        # Offsets from the points' middle, so that float32 is fine enough.
        middle = points.position.mean(axis=0)
        offset = (points.position - middle).astype(np.float32)
        scanner_offset = (points.scanner - points.position).astype(np.float32)
        scanner_range = np.maximum(_length(scanner_offset), np.float32(1e-6))
        normal = np.asarray(points.normal, np.float32)
        misfit = np.empty((len(image_numbers), len(points)), np.float32)
        for row, number in enumerate(image_numbers):
            misfit[row] = _misfit(self.images[number].view, offset, middle, scanner_offset, scanner_range, normal)
        return image_numbers, misfit


def _misfit(
    view: View, offset: Float32, middle: Float, scanner_offset: Float32, scanner_range: Float32, normal: Float32
) -> Float32:
    """Return an image's misfit (N,) to points, rad: the angle between the rays plus a term of range.

    It is `_NOWHERE` where the point isn't in the image, or its surface is seen from behind or too flat.

    Args:
        view: the image's camera.
        offset: (N, 3) of the points from their middle, m.
        middle: (3,) local, m.
        scanner_offset: (N, 3) from the points to the scanner, m.
        scanner_range: (N,) lengths of these, m.
        normal: (N, 3) unit normals of the surface.
    """
    camera_offset = (view.position - middle).astype(np.float32) - offset
    camera_range = np.maximum(_length(camera_offset), np.float32(1e-6))
    cosine = np.einsum("nk,nk->n", camera_offset, scanner_offset) / (camera_range * scanner_range)
    range_term = DISTANCE_WEIGHT * np.abs(np.log(camera_range / scanner_range))
    misfit = np.arccos(np.clip(cosine, -1.0, 1.0)) + range_term
    right, up, backward = (-camera_offset @ view.rotation.astype(np.float32)).T
    scale = view.focal / np.maximum(-backward, np.float32(1e-6))
    x, y = view.centre[0] + right * scale, view.centre[1] - up * scale
    is_shown = (backward < 0.0) & (x > 0.0) & (x < view.size[0]) & (y > 0.0) & (y < view.size[1])
    is_shown &= np.einsum("nk,nk->n", camera_offset, normal) > _STEEPEST * camera_range
    return np.where(is_shown, misfit, _NOWHERE)


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
    total_weight = np.zeros(len(points), np.float32)
    for dy in (0, 1):
        for dx in (0, 1):
            i, j = column + dx, row + dy
            weight = (1.0 - np.abs(x - 0.5 - i)) * (1.0 - np.abs(y - 0.5 - j))
            shows_surface = (i >= 0) & (i < width) & (j >= 0) & (j < height)
            i, j = np.where(shows_surface, i, 0).astype(np.intp), np.where(shows_surface, j, 0).astype(np.intp)
            # Where the plane stands edge-on its depth has no meaning, and no pixel agrees with it.
            with np.errstate(divide="ignore", invalid="ignore"):
                plane_depth = plane(i, j)
                shows_surface &= image.material[j, i] == points.material + 1
                shows_surface &= np.abs(image.depth[j, i] - plane_depth) < slack
            pixel_weight = np.where(shows_surface, weight, 0.0).astype(np.float32)
            values += pixel_weight[:, None] * image.layers[j, i]
            total_weight += pixel_weight
    is_shown = total_weight >= _LEAST_WEIGHT
    return values[is_shown] / total_weight[is_shown, None], is_shown


def _plane_depth(view: View, points: SeenPoints) -> Callable[[Index, Index], Float]:
    """Return a function of pixel indices: depths (N,), m, at which the pixels' rays meet the planes of the points."""
    normal = np.asarray(points.normal, np.float64) @ view.rotation
    constant = np.einsum("nk,nk->n", normal, (points.position - view.position) @ view.rotation)

    def depths(i: Index, j: Index) -> Float:
        """Return the depths (N,), m, in pixels of columns i and rows j (N,)."""
        right, up = (i + 0.5 - view.centre[0]) / view.focal, (view.centre[1] - j - 0.5) / view.focal
        return np.asarray(constant / (normal[:, 0] * right + normal[:, 1] * up - normal[:, 2]))

    return depths


def _length(vectors: Float32) -> Float32:
    """Return the lengths (N,) of vectors (N, 3)."""
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
    # Pixels (N, 25) on a square around the projection, up to about `REACH` away at the point's depth.
    step = np.maximum(np.floor(REACH / _STEPS * view.focal / depth), 1.0)
    i = (np.floor(x)[:, None] + step[:, None] * _COLUMNS).astype(np.intp)
    j = (np.floor(y)[:, None] + step[:, None] * _ROWS).astype(np.intp)
    width, height = view.size
    counts = (i >= 0) & (i < width) & (j >= 0) & (j < height)
    i, j = np.where(counts, i, 0), np.where(counts, j, 0)
    counts &= image.material[j, i] == material[:, None] + 1
    distance = np.linalg.norm(view.unproject(i, j, image.depth[j, i]) - position[:, None, :], axis=2)
    distance[~counts] = np.inf
    nearest_pixel = np.arange(len(position)), distance.argmin(axis=1)
    in_limit = distance[nearest_pixel] < limit
    return (
        image.layers[j[nearest_pixel], i[nearest_pixel]][in_limit].astype(np.float32),
        in_limit,
        distance[nearest_pixel][in_limit],
    )


def relight_nearby(
    fallback: MaterialLayers, points: SeenPoints, values: Float32, channels: dict[str, slice]
) -> Float32:
    """Return channels (N, C) that were taken close by, their sunlight recomputed for the points' own normals.

    Leaves, blades and sheets that touch lean every way. Of the light of a place nearby only whether the sun reaches it
    is therefore kept. Without a base colour there is nothing to shine on, and the light stays as it is.

    Args:
        fallback: the materials' means, and sun and sky.
        points: N points.
        values: (N, C) channels of the places nearby.
        channels: columns of each channel, by name.
    """
    if "sun" not in channels or "base_color" not in channels:
        return values
    result = values.copy()
    varies = fallback.constants.varies["base_color"][points.material][:, None]
    mean = fallback.constants.values["base_color"][points.material]
    color = np.where(varies, values[:, channels["base_color"]], mean)
    sun = fallback.light.sun.astype(np.float32)
    is_sunlit = values[:, channels["sun"]].sum(axis=1) > _LIT * (color * sun).sum(axis=1)
    result[:, channels["sun"]] = color * fallback.light.sunlight(points.normal) * is_sunlit[:, None]
    return result


def views_near(views: Sequence[View], lines: Sequence[SeenPoints]) -> list[View]:
    """Return the views nearest to each scan line's scanner, each cropped to the part that shows the line's points."""
    parts: list[View | None] = []
    for line in lines:
        scanner = line.scanner.mean(axis=0)
        distance = np.array([np.linalg.norm(view.position - scanner) for view in views])
        # Several views may stand in one place: it is the places that are counted.
        nearest_places = np.unique(np.round(distance, 6))[:_NEAREST]
        if not len(nearest_places):
            continue
        nearest_views = np.flatnonzero(distance <= nearest_places[-1] + 1e-5)
        parts += [views[number].crop_to(line.position, _MARGIN) for number in nearest_views]
    return [part for part in parts if part is not None]
