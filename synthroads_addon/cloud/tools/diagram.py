"""Diagrams drawn with Pillow alone, so that they look the same in Blender: frames with a grid, lines, texts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ...base.arrays import Float
from .picture import nice_step

Color = tuple[int, int, int]
Box = tuple[float, float, float, float]

PAPER, INK, GRID, SOFT = (255, 255, 255), (40, 40, 44), (222, 226, 232), (110, 114, 122)
LINES: tuple[Color, ...] = ((30, 96, 170), (214, 104, 20), (30, 135, 90), (150, 60, 150))
SCALE = 2
"""A picture is drawn this many times larger than it is saved, which smooths its lines."""


@dataclass(frozen=True)
class PlotFrame:
    """A diagram's box in an enlarged picture, and the values at its edges.

    Attributes:
        draw: where to.
        box: left, top, right and bottom edge, pixels of the enlarged picture.
        low, high: x and y at the lower left corner, and at the upper right one.
    """

    draw: ImageDraw.ImageDraw
    box: Box
    low: tuple[float, float]
    high: tuple[float, float]

    def at(self, x: Float, y: Float) -> list[tuple[float, float]]:
        """Return values as (x, y) pixels of the enlarged picture; what lies above the box is cut at its top."""
        left_edge, top_edge, right_edge, bottom_edge = self.box
        columns = left_edge + (np.asarray(x) - self.low[0]) / (self.high[0] - self.low[0]) * (right_edge - left_edge)
        rows = bottom_edge - (np.asarray(y) - self.low[1]) / (self.high[1] - self.low[1]) * (bottom_edge - top_edge)
        return list(zip(columns.tolist(), np.maximum(rows, top_edge).tolist(), strict=True))


def draw_picture(size: tuple[int, int], paint: Callable[[ImageDraw.ImageDraw], None]) -> Image.Image:
    """Return a picture of a size (pixels), painted by a function at `SCALE` times that size and reduced."""
    picture = Image.new("RGB", (size[0] * SCALE, size[1] * SCALE), PAPER)
    paint(ImageDraw.Draw(picture))
    return picture.resize(size, Image.Resampling.LANCZOS)


def draw_grid(frame: PlotFrame, text: str) -> None:
    """Draw a frame with vertical grid lines, their values, and the axis label below."""
    left_edge, top_edge, right_edge, bottom_edge = frame.box
    step = nice_step((frame.high[0] - frame.low[0]) / 6.0)
    for value in _multiples(np.ceil(frame.low[0] / step), frame.high[0], step):
        (x, _), *_ = frame.at(np.array([value]), np.array([0.0]))
        frame.draw.line([(x, top_edge), (x, bottom_edge)], fill=GRID, width=SCALE)
        value_text = f"{value:,.0f}" if step >= 1 else f"{value:.3g}"
        draw_text(frame.draw, (x / SCALE, bottom_edge / SCALE + 6), value_text, 13, SOFT, anchor="ma")
    frame.draw.rectangle([left_edge, top_edge, right_edge, bottom_edge], outline=SOFT, width=SCALE)
    draw_text(frame.draw, (right_edge / SCALE, bottom_edge / SCALE + 24), text, 13, SOFT, anchor="ra")


def draw_levels(frame: PlotFrame, step: float) -> None:
    """Draw a frame's horizontal grid lines at multiples of ``step`` above its low edge, with their values."""
    for value in _multiples(np.floor(frame.low[1] / step) + 1.0, frame.high[1], step):
        (left_edge, y), (right_edge, _) = frame.at(np.array([frame.low[0], frame.high[0]]), np.array([value, value]))
        frame.draw.line([(left_edge, y), (right_edge, y)], fill=GRID, width=SCALE)
        draw_text(frame.draw, (left_edge / SCALE - 6, y / SCALE), f"{value:.3g}", 13, SOFT, anchor="rm")


def _multiples(first_multiple: float, end: float, step: float) -> list[float]:
    """Return the multiples of a step that are below an end, from ``first_multiple`` times the step on, with an exact 0.

    Sums of steps would miss 0 by some 1e-17, which would be written beside its line.
    """
    return (np.arange(first_multiple, end / step) * step + 0.0).tolist()


def draw_text(
    draw: ImageDraw.ImageDraw, place: tuple[float, float], text: str, size: int, color: Color = INK, anchor: str = "la"
) -> None:
    """Draw text of a size (pixels) at a place, both counted in the picture as saved."""
    font = ImageFont.load_default(size=size * SCALE)
    draw.text((place[0] * SCALE, place[1] * SCALE), text, fill=color, font=font, anchor=anchor)
