"""Predictors that learn nothing: a model counts only where it beats them.

Each looks at the points of one slice, or of `SEQUENCE` metres about it: as many as the models see that take ten slices
at once. As these lie apart, `SPANNED` ones are also taken from every slice of `SPAN` metres, by a parabola through what
each says. Where a slice has fewer than `FEWEST` points there is no prediction.

- `centroid`: the mean of the points;
- `middle of the extent`: between the outermost points;
- `middle of the bright`: between the outermost of the bright points, those above the middle of the intensity's range.
  The range is from the 5 % to the 95 % quantile; "outermost" are the 5 % and 95 % quantiles too, against stray points;
- `between the brightest`: between the brightest strip left of the extent's middle and the brightest right of it, as
  edge lines or verges of a rural road; strips of `STRIP`, with at least `FEWEST_OF_STRIP` points.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from synthroads_addon.base.arrays import Bool, Float, Index, otsu_threshold
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

Rule = Callable[[Float, Float], float]
"""From the points' y (N,), m, and intensities (N,) of one slice to the centre's y, m."""

SEQUENCE = 10.0
"""m."""
SPAN = 37.0
"""Length that ten slices of 1 m span which are 4 m apart, m."""
FEWEST = 5
STRIP = 0.25
"""m."""
FEWEST_OF_STRIP = 2
_TAIL = 0.05


def centroid(y: Float, intensity: Float) -> float:
    """Return the points' mean y, m."""
    return float(y.mean())


def extent_middle(y: Float, intensity: Float) -> float:
    """Return the middle between the smallest and the largest y, m."""
    return float(y.min() + y.max()) / 2.0


def bright_middle(y: Float, intensity: Float) -> float:
    """Return the middle between the 5 % and the 95 % quantile of the bright points' y, m."""
    lower_intensity, upper_intensity = np.quantile(intensity, [_TAIL, 1.0 - _TAIL])
    bright_y = y[intensity >= (lower_intensity + upper_intensity) / 2.0]
    return float(np.quantile(bright_y, [_TAIL, 1.0 - _TAIL]).mean())


def between_brightest(y: Float, intensity: Float) -> float:
    """Return the middle between the brightest strips left and right of the extent's middle, m; NaN without either."""
    middle = extent_middle(y, intensity)
    number = np.floor((y - middle) / STRIP).astype(np.intp)
    first_strip = int(number.min())
    count = np.bincount(number - first_strip)
    mean = np.bincount(number - first_strip, intensity) / np.maximum(count, 1)
    mean[count < FEWEST_OF_STRIP] = -np.inf
    right_strips, left_strips = mean[: max(0, -first_strip)], mean[max(0, -first_strip) :]
    if not np.isfinite(right_strips).any() or not np.isfinite(left_strips).any():
        return float("nan")
    numbers = (int(right_strips.argmax()) + first_strip, int(left_strips.argmax()) + max(0, first_strip))
    return middle + STRIP * (sum(numbers) + 1.0) / 2.0


RULES: dict[str, tuple[Rule, float]] = {
    "centroid": (centroid, 1.0),
    "middle of the extent": (extent_middle, 1.0),
    "middle of the bright": (bright_middle, 1.0),
    "between the brightest": (between_brightest, 1.0),
    "middle of the extent, 10 m": (extent_middle, SEQUENCE),
    "middle of the bright, 10 m": (bright_middle, SEQUENCE),
    "between the brightest, 10 m": (between_brightest, SEQUENCE),
}
"""Predictors by name: rule and length of the slice along the frame, m."""
SPANNED = ("middle of the extent", "middle of the bright")
"""Those that are also taken over `SPAN`."""


def slice_centers(rule: Rule, number: Index, y: Float, intensity: Float, count: int) -> Float:
    """Return each slice's centre y (M,), m, by a rule; NaN where a slice has fewer than `FEWEST` points.

    Args:
        rule: one of `RULES`.
        number: (N,) index of the slice that each point lies in.
        y: (N,) place across, in the slice's frame, m.
        intensity: (N,) of any scale.
        count: number M of slices.
    """
    result = np.full(count, np.nan)
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(np.bincount(number, minlength=count))
    for index, indices in enumerate(np.split(order, ends[:-1])):
        if len(indices) >= FEWEST:
            result[index] = rule(y[indices], intensity[indices])
    return result


MASKS = ("classes", "ground", "dark")
WINDOW = 100
"""Slices of a window."""
MARGIN = 40
"""Slices before and behind a window that are thinned with it, so that a window's end is no end of the road."""
REACH = 5.0
"""Bins farther apart than this, m, and than three bins are not joined by a line."""
_AROUND = np.ones((3, 3), dtype=bool)


@dataclass(frozen=True)
class SkeletonSettings:
    """Settings of the skeleton baseline, as a grid search chooses them.

    Attributes:
        raster: width of a pixel, m.
        branch: branches shorter than this are cut off, m.
        mask: out of `MASKS`.
        bin: width of the bins along the principal axis, m.
    """

    raster: float = 1.0
    branch: float = 15.0
    mask: str = "classes"
    bin: float = 5.0


def skeleton_centers(
    xy: Float, intensity: Float | None, origin: Float, direction: Float, settings: SkeletonSettings = SkeletonSettings()
) -> Float:
    """Return y (M,), m, where the road's morphological skeleton crosses each frame's y axis; NaN where it doesn't.

    Args:
        xy: (N, 2) the road's points, m.
        intensity: (N,) of any scale; needed for the mask ``dark`` only.
        origin: (M, 2) origins of the slices' frames, m, about a metre apart, in their order along the path.
        direction: (M,) directions of the frames, rad.
        settings: raster, branches, mask, bins.
    """
    return centers_on(skeletons(xy, intensity, origin, settings), origin, direction, settings.bin)


def skeletons(xy: Float, intensity: Float | None, origin: Float, settings: SkeletonSettings) -> list[Float]:
    """Return per window of 100 slices the points (K, 2), m, of the pruned skeleton of the road's raster."""
    frame_tree = cKDTree(origin)
    slice_of = frame_tree.query(xy)[1]
    order = np.argsort(slice_of, kind="stable")
    sorted_slices = slice_of[order]
    result = []
    for first_slice in range(0, len(origin), WINDOW):
        end_slice = min(first_slice + WINDOW, len(origin))
        begin, end = np.searchsorted(sorted_slices, [first_slice - MARGIN, end_slice + MARGIN])
        indices = order[begin:end]
        line = np.empty((0, 2))
        if len(indices):
            line = skeleton_points(xy[indices], None if intensity is None else intensity[indices], settings)
        nearest_slice = frame_tree.query(line)[1] if len(line) else np.empty(0, dtype=np.intp)
        result.append(line[(nearest_slice >= first_slice) & (nearest_slice < end_slice)])
    return result


def centers_on(lines: Sequence[Float], origin: Float, direction: Float, width: float) -> Float:
    """Return y (M,), m, where windows' skeletons (K, 2), averaged in bins of `width` (m), cross the frames; or NaN."""
    result = np.full(len(origin), np.nan)
    parts = [slice(first_slice, first_slice + WINDOW) for first_slice in range(0, len(origin), WINDOW)]
    chains = [average_along(line, width, direction[part]) for line, part in zip(lines, parts, strict=True)]
    for number, part in enumerate(parts):
        # With its neighbours, as the line goes on from window to window.
        chain = np.concatenate(chains[max(0, number - 1) : number + 2])
        result[part] = crossings(chain, origin[part], direction[part], max(REACH, 3.0 * width))
    return result


def skeleton_points(xy: Float, intensity: Float | None, settings: SkeletonSettings) -> Float:
    """Return the centres (K, 2), m, of the pixels of the pruned morphological skeleton of points (N, 2)."""
    corner = np.floor(xy.min(axis=0) / settings.raster) - 1.0
    cell = (np.floor(xy / settings.raster) - corner).astype(np.intp)
    shape = tuple(cell.max(axis=0) + 2)
    mask = np.zeros(shape, dtype=bool)
    if settings.mask == "dark" and intensity is not None:
        cell = cell[_in_dark_pixels(cell, shape, intensity)]
    mask[cell[:, 0], cell[:, 1]] = True
    pixels = np.argwhere(prune_skeleton(skeletonize(mask), settings.branch / settings.raster))
    return (pixels + corner + 0.5) * settings.raster


def _in_dark_pixels(cell: Index, shape: tuple[int, ...], intensity: Float) -> Bool:
    """Return a mask (N,) of the points in pixels whose median intensity is at most Otsu's threshold of the medians."""
    number = np.ravel_multi_index((cell[:, 0], cell[:, 1]), shape)
    pixels, owner = np.unique(number, return_inverse=True)
    median = ndimage.median(intensity, owner, np.arange(len(pixels)))
    return (median <= otsu_threshold(median))[owner]


def prune_skeleton(skeleton: Bool, shortest: float) -> Bool:
    """Return a skeleton mask without free branches shorter than ``shortest`` pixels, thinned again after each cut.

    Args:
        skeleton: (rows, columns), one pixel wide.
        shortest: length in pixels along the branch, a diagonal step being the root of two.
    """
    while True:
        number, free_labels = _branches(skeleton)
        short_labels = [label for label, length in _lengths(number, free_labels) if length < shortest]
        if not short_labels:
            return skeleton
        skeleton = skeletonize(skeleton & ~np.isin(number, short_labels))


def _branches(skeleton: Bool) -> tuple[NDArray[np.int32], list[int]]:
    """Return an image of the skeleton's lines labelled 1, 2, ..., 0 elsewhere, and the labels that have a free end.

    Lines meet at junctions: connected pixels with three or more neighbours that three or more lines touch. Pixels of a
    step in a line have three neighbours as well, but only two lines: they join them.
    """
    neighbours = ndimage.convolve(skeleton.astype(np.int8), _AROUND.astype(np.int8), mode="constant") - 1
    knot_pixels = skeleton & (neighbours > 2)
    line_labels, _ = ndimage.label(skeleton & ~knot_pixels, structure=_AROUND)
    knot_labels, _ = ndimage.label(knot_pixels, structure=_AROUND)
    # A knot is a junction if more than two lines touch it.
    junction = np.zeros_like(skeleton)
    for knot, knot_box in enumerate(ndimage.find_objects(knot_labels), 1):
        box = tuple(slice(max(0, side.start - 1), side.stop + 1) for side in knot_box)
        knot_mask = knot_labels[box] == knot
        touching_labels = np.unique(line_labels[box][ndimage.binary_dilation(knot_mask, _AROUND)])
        junction[box] |= knot_mask & (np.count_nonzero(touching_labels) > 2)
    # Label again: the other knots join the lines they lie on.
    line_labels, _ = ndimage.label(skeleton & ~junction, structure=_AROUND)
    ends = skeleton & ~junction & (neighbours <= 1)
    return line_labels, [int(label) for label in np.unique(line_labels[ends])]


def _lengths(line_labels: NDArray[np.int32], labels: list[int]) -> Iterator[tuple[int, float]]:
    """Yield label and length in pixels of each of the chosen lines, a diagonal step counting the root of two."""
    boxes = ndimage.find_objects(line_labels)
    for label in labels:
        mask = line_labels[boxes[label - 1]] == label
        diagonal = np.count_nonzero(mask[1:, 1:] & mask[:-1, :-1]) + np.count_nonzero(mask[1:, :-1] & mask[:-1, 1:])
        yield label, np.count_nonzero(mask) + (2.0**0.5 - 1.0) * diagonal


def average_along(points: Float, width: float, direction: Float) -> Float:
    """Return the means (J, 2), m, of points (K, 2) in bins along their principal axis, ordered along the path.

    Args:
        points: (K, 2) points of a window's skeleton, m.
        width: width of a bin, m.
        direction: (M,) directions of the window's frames, rad, which tell the way of the path.
    """
    if len(points) < 2:
        return np.empty((0, 2))
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2]
    if axes[0] @ (np.cos(direction).sum(), np.sin(direction).sum()) < 0.0:
        axes = -axes
    local = (points - middle) @ axes.T
    _, owner = np.unique(np.floor(local[:, 0] / width).astype(np.intp), return_inverse=True)
    count = np.bincount(owner)
    mean = np.column_stack([np.bincount(owner, local[:, side]) / count for side in (0, 1)])
    return mean @ axes + middle


def crossings(chain: Float, origin: Float, direction: Float, reach: float = REACH) -> Float:
    """Return y (M,), m, where a chain of points (J, 2) crosses each frame's y axis; NaN where it doesn't.

    Points farther than ``reach`` (m) apart are not joined; of several crossings the one nearest to the frame counts.
    """
    spacing = np.hypot(*np.diff(chain, axis=0).T)
    if not (spacing > 0.0).any():
        return np.full(len(origin), np.nan)
    return MeasuredAxis(chain, spacing <= reach).crossing(origin, direction)[0]
