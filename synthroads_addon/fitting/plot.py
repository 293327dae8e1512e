"""A fitted axis as a picture: how far the points are from the road along it, across and in height."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
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
_RED: Color = (200, 30, 40)


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
        fit: what was fitted.
        name: of the file with the points.
    """
    rows = (("across, m (left of the line is up)", fit.across, fit.horizontal), ("height, m", fit.above, fit.height))

    def paint(draw: ImageDraw.ImageDraw) -> None:
        draw_text(draw, (_MARGIN, _MARGIN), f"{name}: distance of {fit.points:,} points from the fitted road", 19)
        for number, (title, values, deviations) in enumerate(rows):
            _draw_row(draw, 2 * _MARGIN + 50 + number * _ROW, fit, title, values, deviations)

    return draw_picture((_WIDTH, 2 * _ROW + 3 * _MARGIN + 20), paint)


def _draw_row(
    draw: ImageDraw.ImageDraw, top: float, fit: AxisFit, title: str, values: Float, deviations: Deviations
) -> None:
    """Draw one diagram of deviations over the station, with their limits where the points come near them."""
    reach = 1.15 * max(deviations.worst, 2.0 * fit.tolerance)
    box = (_LEFT * SCALE, top * SCALE, (_WIDTH - _MARGIN) * SCALE, (top + _PANEL) * SCALE)
    first, last = float(min(fit.stations.min(), 0.0)), float(max(fit.stations.max(), fit.alignment.length))
    frame = PlotFrame(draw, box, (first, -reach), (last, reach))
    draw_grid(frame, "station, m")
    draw_levels(frame, nice_step(reach / 2.0))
    order = np.argsort(fit.stations, kind="stable")
    draw.line(frame.at(fit.stations[order], values[order]), fill=LINES[0], width=SCALE, joint="curve")
    ends = np.array([first, last])
    for limit in (-fit.limit, fit.limit) if fit.limit < reach else ():
        draw.line(frame.at(ends, np.full(2, limit)), fill=_RED, width=SCALE)
    worst = int(np.abs(values).argmax())
    ((x, y),) = frame.at(fit.stations[worst : worst + 1], values[worst : worst + 1])
    size = 5.0 * SCALE
    draw.ellipse([x - size, y - size, x + size, y + size], outline=_RED, width=2 * SCALE)
    draw_text(draw, (_LEFT, top - 26), title, 15, INK)
    told = f"worst {deviations.worst:.3g} m at station {deviations.worst_station:,.1f} m, rms {deviations.rms:.3g} m; "
    told += f"refused beyond {REFUSED_BEYOND:g} times the tolerance of {fit.tolerance:g} m: {fit.limit:g} m"
    draw_text(draw, (_WIDTH - _MARGIN, top - 24), told, 13, SOFT, anchor="ra")
