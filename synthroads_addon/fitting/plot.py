"""A fitted axis as a picture: how far the points are from the road along it, across and in height."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ..base.arrays import Float
from ..base.files import write_file
from ..cloud.tools.diagram import (
    INK,
    LINES,
    SCALE,
    SOFT,
    Color,
    PlotFrame,
    draw_grid,
    draw_levels,
    draw_picture,
    draw_text,
)
from ..cloud.tools.picture import nice_step
from .fit import REFUSED_BEYOND, AxisFit, AxisRefusedError, Deviations

FILE = "axis-fit.png"
"""Name of the picture beside a job's files."""
_WIDTH, _PANEL, _ROW, _MARGIN, _LEFT = 1200, 200, 290, 16, 90
"""Sizes in pixels. Chosen: fit a page."""
_FINE = 1e-4
"""Least reach of a picture of a file's line, m. Chosen: below it all files lie on one line."""
_RED: Color = (200, 30, 40)
"""Red, green, blue of what is refused."""


@contextmanager
def draw_refused_fit(folder: Path | None) -> Iterator[None]:
    """Write the picture of a fit that is refused within the context to a folder, if given, and name it in the error.

    Raises:
        AxisRefusedError: the one that was raised, with the picture's path.
    """
    try:
        yield
    except AxisRefusedError as error:
        if folder is None:
            raise
        data = io.BytesIO()
        axis_picture(error.fit, error.name).save(data, "PNG")
        write_file(folder / FILE, data.getvalue(), overwrite=True)
        raise error.with_picture(folder / FILE) from None


def axis_picture(fit: AxisFit, name: str) -> Image.Image:
    """Return the picture of a fit: lines of the deviations over the station, the limits, and the worst place in red.

    Args:
        fit: the alignment and profile with the points' deviations.
        name: name of the file with the points.
    """
    title = f"{name}: distance of {fit.points:,} points from the fitted road"
    first_station = float(min(fit.stations.min(), 0.0))
    last_station = float(max(fit.stations.max(), fit.alignment.length))
    bounds = f"; refused beyond {REFUSED_BEYOND:g} times the tolerance of {fit.tolerance:g} m: {fit.limit:g} m"
    rows = [
        _Row(fit.stations, fit.across, fit.horizontal, 2.0 * fit.tolerance, fit.limit, bounds),
        _Row(fit.stations, fit.above, fit.height, 2.0 * fit.tolerance, fit.limit, bounds),
    ]
    return _picture(title, rows, first_station, last_station)


def deviation_picture(
    name: str, length: float, station: Float, lateral_error: Float, height_error: Float | None
) -> Image.Image:
    """Return the picture of a file's line's distances from the axis taken from it, in plan and in height.

    Args:
        name: name of the file.
        length: length of the axis, m.
        station, across: (N,) of places of the file's line, and their distance to the left of the axis, m.
        height_error: (N,) their heights above the axis', m; None without heights.
    """
    title = f"{name}: distance of the file's line from the axis taken from it"
    values = [lateral_error] if height_error is None else [lateral_error, height_error]
    rows = [_Row(station, row_values, Deviations.of(station, row_values), _FINE, np.inf, "") for row_values in values]
    return _picture(title, rows, 0.0, length)


@dataclass(frozen=True)
class _Row:
    """One diagram: values over stations, their statistics, least extent of the axis, limit (m) and its text."""

    station: Float
    values: Float
    deviations: Deviations
    reach: float
    limit: float
    bounds: str


def _picture(title: str, rows: Sequence[_Row], first_station: float, last_station: float) -> Image.Image:
    """Return the picture of one or two diagrams below each other, between two stations, m."""
    names = ("across, m (left of the line is up)", "height, m")

    def paint(draw: ImageDraw.ImageDraw) -> None:
        """Draw the title and the diagrams."""
        draw_text(draw, (_MARGIN, _MARGIN), title, 19)
        for number, row in enumerate(rows):
            _draw_row(draw, 2 * _MARGIN + 50 + number * _ROW, names[number], row, first_station, last_station)

    return draw_picture((_WIDTH, len(rows) * _ROW + 3 * _MARGIN + 20), paint)


def _draw_row(
    draw: ImageDraw.ImageDraw, top: float, title: str, row: _Row, first_station: float, last_station: float
) -> None:
    """Draw one diagram of deviations over the station, with their limits where the points come near them."""
    deviations = row.deviations
    reach = 1.15 * max(deviations.worst, row.reach)
    box = (_LEFT * SCALE, top * SCALE, (_WIDTH - _MARGIN) * SCALE, (top + _PANEL) * SCALE)
    frame = PlotFrame(draw, box, (first_station, -reach), (last_station, reach))
    draw_grid(frame, "station, m")
    draw_levels(frame, nice_step(reach / 2.0))
    order = np.argsort(row.station, kind="stable")
    draw.line(frame.at(row.station[order], row.values[order]), fill=LINES[0], width=SCALE, joint="curve")
    ends = np.array([first_station, last_station])
    for limit in (-row.limit, row.limit) if row.limit < reach else ():
        draw.line(frame.at(ends, np.full(2, limit)), fill=_RED, width=SCALE)
    worst_index = int(np.abs(row.values).argmax())
    ((x, y),) = frame.at(row.station[worst_index : worst_index + 1], row.values[worst_index : worst_index + 1])
    size = 5.0 * SCALE
    draw.ellipse([x - size, y - size, x + size, y + size], outline=_RED, width=2 * SCALE)
    draw_text(draw, (_LEFT, top - 26), title, 15, INK)
    caption = f"worst {deviations.worst:.3g} m at station {deviations.worst_station:,.1f} m, rms {deviations.rms:.3g} m"
    draw_text(draw, (_WIDTH - _MARGIN, top - 24), caption + row.bounds, 13, SOFT, anchor="ra")
