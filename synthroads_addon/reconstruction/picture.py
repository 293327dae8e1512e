"""A picture of a reconstruction: the road's lines over the cloud seen from above, a cross-section, and the heights."""

from pathlib import Path as FilePath
from typing import Any

import numpy as np
from scipy import ndimage

from ..base.arrays import Float
from ..base.figure import new_figure, save_figure
from ..base.text.literal import literal_texts, shown_text
from ..road.geometry import RoadGeometry
from ..road.objects import LineObject
from ..road.section import LineMarking
from ..road.things.delineator import Delineator
from .cloud import RoadCloud
from .profiles import Profiles
from .reconstruct import Reconstruction

AXIS, EDGE, MARK, BARRIER, POST, DOUBT = "#d1006b", "#ff8c00", "#00a2ff", "#7a3cff", "#00b050", "#ff0000"
"""Colours of what is drawn over the cloud's grey."""
_SIZE = (13.0, 9.0)
"""Width and height of the picture, inches. Chosen: fits a screen."""
_DPI = 110
"""Pixels to an inch. Chosen: fits a screen."""
_STRETCH = 150.0
"""Length of the road that is shown large, m. Chosen: dashes can be told."""
_BEYOND = 6.0
"""Distance outside of the pavement that is shown, m. Chosen: barriers stand there."""


@literal_texts()
def draw(reconstruction: Reconstruction, cloud: RoadCloud, path: FilePath) -> None:
    """Draw a reconstruction (plan, detail, cross-section, heights) and write the picture as PNG."""
    figure = new_figure(*_SIZE)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.3, 1.3, 1.0))
    geometry = RoadGeometry(reconstruction.parameters)
    plan(figure.add_subplot(grid[0, :]), reconstruction, geometry, (0.0, geometry.length))
    middle = max(0.0, 0.5 * geometry.length - _STRETCH / 2.0)
    plan(figure.add_subplot(grid[1, :]), reconstruction, geometry, (middle, min(geometry.length, middle + _STRETCH)))
    across(figure.add_subplot(grid[2, 0]), reconstruction, geometry)
    heights(figure.add_subplot(grid[2, 1]), reconstruction, geometry)
    figure.suptitle(f"{shown_text(reconstruction.parameters.metadata.title)}: {cloud.read:,} points", fontsize=10)
    save_figure(figure, path, dpi=_DPI)


def plan(axes: Any, reconstruction: Reconstruction, geometry: RoadGeometry, span: tuple[float, float]) -> None:
    """Draw the road unrolled (offset over station), the reconstruction over the cloud's brightness."""
    profiles = reconstruction.carriageways.profiles
    right_limit, left_limit = _reach(geometry)
    axes.imshow(
        _brightness(profiles).T,
        origin="lower",
        aspect="auto",
        cmap="gray",
        extent=(profiles.stations[0], profiles.stations[-1], profiles.offsets[0], profiles.offsets[-1]),
        interpolation="nearest",
    )
    station = np.linspace(*span, 400)
    axes.plot(station, np.zeros_like(station), color=AXIS, lw=1.0, label="axis")
    for number, side in enumerate(geometry.sections.values()):
        bounds = side.carriageway.sign * side.distances(station)
        for column in (0, bounds.shape[1] - 2):
            label = "pavement's edges" if number == 0 == column else None
            axes.plot(station, bounds[:, column], color=EDGE, lw=0.9, label=label)
    for number, doubt in enumerate(reconstruction.judgement.doubts):
        axes.axvspan(doubt.start, doubt.end, color=DOUBT, alpha=0.25, lw=0, label=None if number else "doubtful")
    _markings(axes, geometry, span)
    _objects(axes, geometry)
    axes.set(xlim=span, ylim=(right_limit, left_limit), xlabel="station, m", ylabel="offset, m")
    axes.legend(loc="upper right", fontsize=7, ncols=5)


def across(axes: Any, reconstruction: Reconstruction, geometry: RoadGeometry) -> None:
    """Draw a cross-section at mid-length: heights of the cloud's bins and the reconstructed surface."""
    profiles = reconstruction.carriageways.profiles
    row = len(profiles.stations) // 2
    rows = slice(max(0, row - 5), row + 5)
    station = profiles.stations[rows]
    height = profiles.height[rows].astype(np.float64)
    profile_height = geometry.profile.elevation(station)
    axes.plot(profiles.offsets, (height - profile_height[:, None]).T, ".", ms=1.5, color="0.55")
    right_limit, left_limit = _reach(geometry)
    offset = np.linspace(right_limit, left_limit, 600)
    model = geometry.elevation(np.full_like(offset, profiles.stations[row]), offset) - geometry.profile.elevation(
        profiles.stations[row]
    )
    axes.plot(offset, model, color=AXIS, lw=1.2)
    finite_heights = model[np.isfinite(model)]
    axes.set(
        xlim=(right_limit, left_limit),
        ylim=(finite_heights.min() - 0.6, finite_heights.max() + 0.6),
        xlabel="offset, m",
        ylabel="height above the profile, m",
        title=f"cross-section at {profiles.stations[row]:.0f} m",
    )


def heights(axes: Any, reconstruction: Reconstruction, geometry: RoadGeometry) -> None:
    """Draw the measured heights of the carriageways, cm, less the reconstructed profile's."""
    stations = reconstruction.measured.stations
    profile_height = geometry.profile.elevation(stations)
    for name, surface in reconstruction.carriageways.surfaces.items():
        axes.plot(stations, 100.0 * (surface.height - profile_height), ".", ms=3, label=f"{name} carriageway")
    axes.axhline(0.0, color=AXIS, lw=1.0, label="profile")
    axes.set(xlabel="station, m", ylabel="height above the profile, cm", title="pavement at its pivot line")
    axes.legend(fontsize=7)


def _brightness(profiles: Profiles) -> Float:
    """Return the profiles' brightness (S, U) as grey, 0 to 1, equalised by percentiles; NaN far from any point."""
    has_points = np.isfinite(profiles.brightness)
    weight = ndimage.gaussian_filter(has_points.astype(np.float64), (0.3, 1.0))
    mean = ndimage.gaussian_filter(np.where(has_points, profiles.brightness, 0.0).astype(np.float64), (0.3, 1.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        blurred = np.where(weight > 0.02, mean / weight, np.nan)
    levels = np.nanpercentile(blurred, [1, 20, 40, 60, 80, 90, 95, 98, 99.5])
    return np.asarray(np.interp(blurred, np.maximum.accumulate(levels), np.linspace(0.1, 1.0, len(levels))))


def _reach(geometry: RoadGeometry) -> tuple[float, float]:
    """Return the rightmost and leftmost offset, m, to draw: the pavement's edges and `_BEYOND`."""
    offsets = geometry.offsets(np.linspace(0.0, geometry.length, 50))
    return float(offsets.min()) - _BEYOND, float(offsets.max()) + _BEYOND


def _markings(axes: Any, geometry: RoadGeometry, span: tuple[float, float]) -> None:
    """Draw the middles of the markings' dashes between two stations, m."""
    label: str | None = "markings"
    for line in geometry.parameters.of_type(LineMarking).values():
        for start, end in geometry.dashes(line):
            if end < span[0] or start > span[1]:
                continue
            station = np.linspace(start, end, 2 if end - start < 20.0 else 100)
            left_edge, right_edge = geometry.marking_edges(line, station)
            axes.plot(station, 0.5 * (left_edge + right_edge), color=MARK, lw=1.2, label=label)
            label = None


def _objects(axes: Any, geometry: RoadGeometry) -> None:
    """Draw barriers as lines and delineators as symbols, by station and offset."""
    label: str | None = "barriers"
    for item in geometry.parameters.objects.values():
        if isinstance(item, LineObject):
            axes.plot([item.start_station, item.end_station], [item.offset] * 2, color=BARRIER, lw=1.6, label=label)
            label = None
    posts = list(geometry.parameters.of_type(Delineator).values())
    if posts:
        stations_and_offsets = [post.station for post in posts], [post.offset for post in posts]
        axes.plot(*stations_and_offsets, "^", ms=5, color=POST, mec="white", mew=0.5, label="delineators")
