"""Pictures of what was found, over the cloud that it was found in: centrelines and corridors, classes from above."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.stats import rankdata

from synthroads_addon.base.arrays import Float, Float32
from synthroads_addon.base.classes import ClassScheme, class_scheme
from synthroads_addon.base.figure import new_figure, save_figure
from synthroads_addon.base.text.literal import literal_texts, shown_text

from ..data.classes import IGNORED
from ..data.corridor import CORRIDOR
from ..data.tiles import CloudTile
from .calibration import DEVIATIONS, LEVELS
from .evaluation import CORRIDOR_COLUMNS, Case

if TYPE_CHECKING:
    from matplotlib.axes import Axes


COLORS = ("#d81b60", "#1e88e5", "#ffc107", "#004d40", "#8e24aa", "#6d4c41")
TRUE = "#00e5a0"
EDGE = "#ff8f00"
CENTER = "#1e88e5"
_PALETTE = 256
_MOST_POINTS = 60_000
_LINEAR = 0.1
"""Offsets from the true axis are drawn to a linear scale up to this and to a logarithmic one beyond, m."""
_APART = 4.0
"""Predictions farther apart than this, m, are not joined."""


def small_png(figure: Any, dpi: float | None = None) -> bytes:
    """Draw a Matplotlib figure; return it as a PNG of at most 256 colours, a fourth as large as with all.

    Args:
        figure: figure to draw.
        dpi: pixels per inch; the figure's own if not given.
    """
    full_png, content = io.BytesIO(), io.BytesIO()
    save_figure(figure, full_png, dpi=dpi or figure.dpi)
    image = Image.open(full_png, formats=("PNG",)).convert("RGB").quantize(_PALETTE, dither=Image.Dither.NONE)
    image.save(content, format="png", optimize=True)
    return content.getvalue()


@dataclass(frozen=True)
class PictureView:
    """Stations along a road's true axis, m, between which the road is drawn."""

    first: float
    last: float


@literal_texts()
def lines_picture(case: Case, lines: Mapping[str, Float], view: PictureView, title: str, height: float = 12.0) -> bytes:
    """Return a PNG of a road straightened: predicted centrelines over the cloud, and their offsets from the true axis.

    Args:
        case: road and frames.
        lines: y (M,) of the centres in the frames, m, by the predictor's name.
        view: what of the road.
        title: of the picture.
        height: of the upper panel to either side of the axis, m.
    """
    figure, panels = _new_panels(title, (2.2, 1.0), view, height)
    _draw_cloud(panels[0], case, view, height)
    _draw_truth(panels[0], case, view)
    panels[1].axhline(0.0, color="black", lw=1.0, label="true axis")
    largest = 0.0
    for (name, y), color in zip(lines.items(), COLORS, strict=False):
        station, offset = _project_points(case, case.frames.at(y), view)
        panels[0].plot(station, offset, color=color, lw=1.2, label=shown_text(name))
        panels[1].plot(station, offset, color=color, lw=1.2)
        largest = max(largest, float(np.nanquantile(np.abs(offset), 0.98)) if np.isfinite(offset).any() else 0.0)
    limit = 1.3 * max(largest, _LINEAR)
    panels[1].set_yscale("symlog", linthresh=_LINEAR, linscale=1.5)
    ticks = [sign * size for size in (0.05, 0.1, 1.0, 10.0) for sign in (-1.0, 1.0) if size <= limit]
    panels[1].set_yticks([0.0, *ticks], [f"{tick:g}" for tick in (0.0, *ticks)])
    panels[1].set(ylabel="offset from it, m", ylim=(-limit, limit))
    panels[0].legend(loc="upper right", ncols=3, fontsize=8, framealpha=0.9)
    return small_png(figure, dpi=110)


@literal_texts()
def corridor_picture(case: Case, prediction: Float, view: PictureView, title: str, height: float = 16.0) -> bytes:
    """Return a PNG of a corridor: centre and edges with 95 % bands over the cloud, the centre's error, the lanes.

    Args:
        case: road and frames.
        prediction: (M, 2 to 4 + 2 K) columns `CORRIDOR_COLUMNS`; panels of what isn't there stay away.
        view: what of the road.
        title: of the picture.
        height: of the upper panel to either side of the axis, m.
    """
    column = {name: prediction[:, i] for i, name in enumerate(CORRIDOR_COLUMNS[: prediction.shape[1]])}
    with_lanes = "lanes" in column and bool(np.isfinite(column["lanes"]).any())
    figure, panels = _new_panels(title, (2.4, 1.0, 0.8) if with_lanes else (2.4, 1.0), view, height)
    _draw_cloud(panels[0], case, view, height)
    _draw_truth(panels[0], case, view, edges=True)
    for name, color, label in (("center", CENTER, "centre"), ("left_edge", EDGE, "edges"), ("right_edge", EDGE, None)):
        if name in column:
            _draw_band(panels[0], case, view, column[name], _interval_half_width(column, name, 95), color, label)
    panels[0].legend(loc="upper right", ncols=4, fontsize=8, framealpha=0.9)
    _draw_center_error(panels[1], case, view, column)
    if with_lanes:
        _draw_lanes(panels[2], case, view, column)
    return small_png(figure, dpi=110)


def _new_panels(title: str, heights: Sequence[float], view: PictureView, height: float) -> tuple[Any, Sequence[Any]]:
    """Return a figure and its panels below each other, the upper one with the view's limits."""
    figure = new_figure(13.0, 1.6 + 2.0 * sum(heights))
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    figure.suptitle(shown_text(title), fontsize=11)
    panels[0].set(xlim=(view.first, view.last), ylim=(-height, height), ylabel="offset from the true axis, m")
    panels[-1].set(xlabel="station along the true axis, m")
    for panel in panels[1:]:
        panel.grid(alpha=0.3)
    return figure, panels


def _draw_cloud(axes: Axes, case: Case, view: PictureView, height: float) -> None:
    """Draw a road's points by intensity rank, straightened along the true axis, into the axes.

    Where only an axis is known, as of real scans that may not be passed on, means of cells are drawn and no points.
    """
    indices = np.flatnonzero(case.road.belonging)
    station, offset = case.road.known_truth.axis.project(case.road.xyz[indices])
    visible_points = np.flatnonzero((station >= view.first) & (station <= view.last) & (np.abs(offset) <= height))
    intensity = case.road.intensity[indices[visible_points]]
    # By their ranks: a scanner beside the road sees its near side a hundred times as bright as the far one.
    intensity = rankdata(intensity) / max(1, len(visible_points))
    style: dict[str, Any] = {"cmap": "gray", "vmin": -0.5, "vmax": 1.0, "rasterized": True}
    axes.set_facecolor("#101418")
    if case.road.known_truth.left is None:
        station_edges, offset_edges = np.arange(view.first, view.last + 0.5), np.arange(-height, height + 0.125, 0.25)
        plan_points = np.column_stack([station[visible_points], offset[visible_points]])
        count, _ = np.histogramdd(plan_points, bins=[station_edges, offset_edges])
        total, _ = np.histogramdd(plan_points, bins=[station_edges, offset_edges], weights=intensity)
        axes.pcolormesh(
            station_edges, offset_edges, np.where(count > 0, total / np.maximum(count, 1), np.nan).T, **style
        )
        return
    sample = slice(None, None, max(1, len(visible_points) // _MOST_POINTS))
    size = float(np.clip(60_000 / max(len(visible_points), 1), 0.4, 6.0))
    axes.scatter(
        station[visible_points][sample], offset[visible_points][sample], c=intensity[sample], s=size, lw=0, **style
    )


def _draw_truth(axes: Axes, case: Case, view: PictureView, edges: bool = False) -> None:
    """Draw the true axis, and if asked the true edges, into the axes."""
    truth = case.road.known_truth
    station = np.arange(view.first, view.last, 0.5)
    axes.plot(station, np.where(truth.axis.inside(station), 0.0, np.nan), color=TRUE, lw=2.5, label="true axis")
    if edges:
        lines = [line for line in (truth.left, truth.right) if line is not None]
        for line, label in zip(lines, ("true edges", None), strict=False):
            line_station, line_offset = truth.axis.project(line.points)
            order = np.argsort(line_station)
            axes.plot(line_station[order], line_offset[order], color=TRUE, lw=2.0, ls="--", label=label)


def _project_points(case: Case, points: Float, view: PictureView) -> tuple[Float, Float]:
    """Return ascending stations and offsets (m) of the points (M, 2) in the view; NaN rows separate stretches."""
    truth = case.road.known_truth
    is_finite = np.isfinite(points).all(axis=1)
    station, offset = truth.axis.project(points[is_finite])
    in_view = (station >= view.first) & (station <= view.last) & truth.axis.inside(station)
    return _by_station(station[in_view], offset[in_view])


def _by_station(station: Float, offset: Float) -> tuple[Float, Float]:
    """Return stations and offsets sorted by station, with NaN inserted between those over `_APART` (m) apart."""
    order = np.argsort(station)
    station, offset = station[order], offset[order]
    breaks = np.flatnonzero(np.diff(station) > _APART) + 1
    return np.insert(station, breaks, np.nan), np.insert(offset, breaks, np.nan)


def _interval_half_width(column: Mapping[str, Float], name: str, level: int) -> Float:
    """Return half-widths (M,) of a column's `level` % interval: predicted, else by its standard deviation, else 0."""
    if f"{name}_{level}" in column:
        width = column[f"{name}_{level}"]
    else:
        width = DEVIATIONS[LEVELS.index(level / 100.0)] * column.get(f"{name}_std", np.zeros(len(column[name])))
    return np.nan_to_num(width)


def _draw_band(
    axes: Axes, case: Case, view: PictureView, y: Float, width: Float, color: str, label: str | None
) -> None:
    """Draw a predicted line and the band of its 95 % interval into the axes."""
    station, offset = _project_points(case, case.frames.at(y), view)
    _, lower_offset = _offsets_at_frames(case, y - width, view)
    band_station, upper_offset = _offsets_at_frames(case, y + width, view)
    axes.fill_between(
        band_station,
        lower_offset,
        upper_offset,
        color=color,
        alpha=0.35,
        lw=0,
        label=None if label is None else f"{label}, 95 %",
    )
    axes.plot(station, offset, color=color, lw=1.3, label=label)


def _offsets_at_frames(case: Case, y: Float, view: PictureView) -> tuple[Float, Float]:
    """Return ascending stations where frames cross the true axis and the offsets of their points y (m), NaN at gaps."""
    axis, frames = case.road.known_truth.axis, case.frames
    _, station = axis.crossing(frames.position, frames.direction)
    in_view = (station >= view.first) & (station <= view.last) & np.isfinite(y)
    return _by_station(station[in_view], axis.project(frames.at(y)[in_view])[1])


def _draw_center_error(axes: Axes, case: Case, view: PictureView, column: Mapping[str, Float]) -> None:
    """Draw the predicted centre's offset from the true axis with its 68 % and 95 % bands."""
    y = column["center"]
    station, offset = _offsets_at_frames(case, y, view)
    for level, alpha in ((95, 0.2), (68, 0.35)):
        width = _interval_half_width(column, "center", level)
        if width.any():
            band_station, lower_offset = _offsets_at_frames(case, y - width, view)
            _, upper_offset = _offsets_at_frames(case, y + width, view)
            axes.fill_between(
                band_station, lower_offset, upper_offset, color=CENTER, alpha=alpha, lw=0, label=f"{level} %"
            )
    axes.plot(station, offset, color=CENTER, lw=1.2, label="predicted centre")
    axes.axhline(0.0, color="black", lw=1.0)
    axes.set(ylabel="centre, m")
    axes.legend(loc="upper right", ncols=3, fontsize=8)


def _draw_lanes(axes: Axes, case: Case, view: PictureView, column: Mapping[str, Float]) -> None:
    """Draw the predicted and true number and width of lanes over the station."""
    truth = case.road.known_truth.at(case.frames)
    in_view = np.flatnonzero((truth.station >= view.first) & (truth.station <= view.last))
    in_view = in_view[np.argsort(truth.station[in_view])]
    station = truth.station[in_view]
    for name, color in (("lanes", CENTER), ("lane_width", EDGE)):
        value, label = column[name][in_view], name.replace("_", " ") + (", m" if name == "lane_width" else "")
        spread = _interval_half_width(column, name, 95)[in_view]
        axes.fill_between(station, value - spread, value + spread, color=color, alpha=0.25, lw=0)
        axes.plot(station, value, color=color, lw=1.2, label=label)
        true_value = truth.corridor[in_view, CORRIDOR.index(name)]
        axes.plot(station, true_value, color="black", lw=1.0, ls="--", label="true" if name == "lanes" else None)
    axes.set(ylabel="lanes")
    axes.legend(loc="upper right", ncols=3, fontsize=8)


_PIXELS = 490
"""Of a view's longer side: as many as it has in the picture, so that none is lost."""
_OUTSIDE = (0.5, 99.5)
"""Percentiles of x and of y that a view goes from and to: a sweep's few far points would make all others tiny."""
_UNKNOWN = (0.07, 0.07, 0.09)
"""Dark, as road markings are drawn white."""
_WRONG = np.array([[0.75, 0.75, 0.75], [0.9, 0.1, 0.1]])


@literal_texts()
def comparison(
    tile: CloudTile, prediction: NDArray[np.int16], names: Sequence[str], scheme: ClassScheme | None = None
) -> bytes:
    """Return a PNG with three top views of a tile: true classes, predicted classes, and where they differ.

    Args:
        tile: tile with its true classes.
        prediction: (N,) classes.
        names: names of the classes.
        scheme: scheme of the classes, for their colours; None for a built-in one.
    """
    from matplotlib.patches import Patch  # takes half a second, which only pictures need

    colors = class_colors(names, scheme)
    is_wrong = np.where(tile.segment == IGNORED, IGNORED, (prediction != tile.segment).astype(np.int16))
    panels = ((tile.segment, colors, "truth"), (prediction, colors, "predicted"), (is_wrong, _WRONG, "wrong"))
    labelled_points = tile.coord[tile.segment != IGNORED, :2] if (tile.segment != IGNORED).any() else tile.coord[:, :2]
    extent = np.percentile(labelled_points, _OUTSIDE, axis=0)
    views = [top_view(tile.coord, labels, table, extent) for labels, table, _ in panels]
    figure = new_figure(15, 0.8 + 4.9 * views[0].shape[0] / _PIXELS)
    for axes, view, (_, _, title) in zip(figure.subplots(1, 3), views, panels, strict=True):
        axes.imshow(view, origin="lower", interpolation="nearest")
        axes.set(title=title, xticks=[], yticks=[])
    patches = [
        Patch(facecolor=color, edgecolor="0.5", label=shown_text(name))
        for name, color in zip(names, colors, strict=True)
    ]
    figure.legend(handles=patches, loc="outside lower center", ncols=min(len(patches), 9), frameon=False)
    return small_png(figure)


def class_colors(names: Sequence[str], scheme: ClassScheme | None = None) -> Float:
    """Return the display colours (C, 3), 0 to 1, of class names; grey for a name that no scheme has."""
    schemes = (class_scheme("17"), class_scheme("5"), *([scheme] if scheme else []))
    color_by_name = {row.name: row.color for scheme_row_source in schemes for row in scheme_row_source.rows}
    return np.array([color_by_name.get(name, (150, 150, 150)) for name in names]) / 255.0


def top_view(coord: Float32, labels: NDArray[np.int16], colors: Float, extent: NDArray[np.floating]) -> Float:
    """Return a top-view image (H, W, 3), row 0 in the south: each pixel has its highest point's class colour.

    Args:
        coord: (N, 3) m.
        labels: (N,) rows of ``colors``; those of `IGNORED` aren't drawn.
        colors: (C, 3).
        extent: (2, 2) smallest and largest x and y shown, m.
    """
    lower_corner, upper_corner = extent
    cell = max(float((upper_corner - lower_corner).max()) / _PIXELS, 0.05)
    size = np.floor((upper_corner - lower_corner) / cell).astype(int) + 1
    image = np.full((size[1], size[0], 3), _UNKNOWN, dtype=np.float64)
    order = np.argsort(coord[:, 2], kind="stable")
    in_view = ((coord[:, :2] >= lower_corner) & (coord[:, :2] <= upper_corner)).all(axis=1)
    order = order[in_view[order] & (labels[order] != IGNORED)]
    column, row = np.floor((coord[order, :2] - lower_corner) / cell).astype(int).T
    image[row, column] = colors[labels[order]]
    return image
