"""A picture of a cloud: points gathered into its cells block by block, and its frame of title, legend and axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ...base.arrays import AnyArray, Bool, Float, Index, UInt8
from ...base.classes import PointClass
from ..points import PointBlock


@dataclass(frozen=True)
class Axes:
    """Coordinates along a picture's edges: those of its lower left corner, and a pixel's size.

    Attributes:
        left, low: of the lower left corner, m.
        across, up: of a pixel, m.
    """

    left: float
    low: float
    across: float
    up: float


class Brightness:
    """Intensities as they are drawn: times the squared range where points have one, so that nearness doesn't show.

    Attributes:
        text: what it is.
    """

    text = "intensity as stored"

    def values(self, block: PointBlock) -> Float:
        """Return a block's intensities (N,), times the squared range if it is known; sets `text` to match."""
        if not len(block) or np.isnan(block.range[0]):
            return block.intensity
        self.text = "intensity x squared range (white target = 1)"
        return block.intensity * block.range**2


_FACTORS = (1, 2, 3, 4, 5, 6, 8, 10, 12)
"""Numbers by which a raster's cells may be merged: the last leaves 150 across a picture."""
_GAP = 2
"""How often single empty cells between filled ones are closed."""
_FILLED = 0.8
"""Share of the neighbours of filled cells that are filled where points are as near to each other as cells are."""


class Raster:
    """A picture's cells, row 0 at the top: mean intensity and colour of each, and the class of its foremost point.

    Args:
        axes: coordinates of the cells.
        size: number of cells across and up.

    Attributes:
        count: (cells,) points in each cell.
        brightness: what the mean intensity is of.
        label: (cells,) class of the foremost point; 255 where there is none.
    """

    def __init__(self, axes: Axes, size: tuple[int, int]) -> None:
        self.axes, self.brightness = axes, Brightness()
        self.width, self.height = size
        cells = self.width * self.height
        self.count = np.zeros(cells)
        self.label = np.full(cells, 255, dtype=np.uint8)
        self._intensity = np.zeros(cells)
        self._rgb = np.zeros((3, cells))
        self._front = np.full(cells, -np.inf)

    def add(self, block: PointBlock, place: tuple[Float, Float], depth: Float) -> None:
        """Add a block's points to the cells that they lie in; what lies outside is left out.

        Args:
            block: N points.
            place: their two coordinates (N,) in the picture, m.
            depth: (N,) the larger, the further in front.
        """
        brightness = self.brightness.values(block)
        column = np.floor((place[0] - self.axes.left) / self.axes.across)
        row = self.height - 1 - np.floor((place[1] - self.axes.low) / self.axes.up)
        rows_inside = np.flatnonzero((column >= 0) & (column < self.width) & (row >= 0) & (row < self.height))
        if len(rows_inside) == 0:
            return
        cell = (row[rows_inside] * self.width + column[rows_inside]).astype(np.intp)
        # Sums over the cells from the first to the last that the block touches: `bincount` needs no larger arrays.
        first_cell, end_cell = int(cell.min()), int(cell.max()) + 1
        window, size, cell_in_window = slice(first_cell, end_cell), end_cell - first_cell, cell - first_cell
        self.count[window] += np.bincount(cell_in_window, minlength=size)
        self._intensity[window] += np.bincount(cell_in_window, brightness[rows_inside], size)
        for channel in range(3):
            self._rgb[channel, window] += np.bincount(cell_in_window, block.rgb[rows_inside, channel], size)
        self._keep_foremost(cell, depth[rows_inside], block.class_id[rows_inside])

    def intensity(self) -> Float:
        """Return the mean intensity of each cell (cells,); 0 where there are no points."""
        return self._intensity / np.maximum(self.count, 1)

    def rgb(self) -> Float:
        """Return the mean colour of each cell (cells, 3), 0 to 255; black where there are no points."""
        return (self._rgb / np.maximum(self.count, 1) / 257.0).T

    def merged(self, factor: int) -> Raster:
        """Return a raster whose cells are ``factor`` times as wide and high; points in them are counted together."""
        size = (-(-self.width // factor), -(-self.height // factor))
        axes = Axes(self.axes.left, self.axes.low, self.axes.across * factor, self.axes.up * factor)
        result = Raster(axes, size)
        result.brightness = self.brightness
        result.count = self._blocks(self.count, factor).sum(axis=1)
        result._intensity = self._blocks(self._intensity, factor).sum(axis=1)
        result._rgb = np.stack([self._blocks(channel, factor).sum(axis=1) for channel in self._rgb])
        front = self._blocks(self._front, factor, -np.inf)
        foremost_index = front.argmax(axis=1)[:, None]
        result._front = np.take_along_axis(front, foremost_index, axis=1)[:, 0]
        result.label = np.take_along_axis(self._blocks(self.label, factor, 255), foremost_index, axis=1)[:, 0]
        return result

    def density_factor(self) -> int:
        """Return the factor by which cells must be merged so that points are hardly farther apart than cells.

        That is the smallest of `_FACTORS` with which four of five neighbours of filled cells are filled, along both
        axes: lines of a scanner are near each other in one direction only.
        """
        for factor in _FACTORS:
            is_filled = self._blocks(self.count, factor).any(axis=1).reshape(-1, -(-self.width // factor))
            if min(_shared(is_filled, axis) for axis in (0, 1)) >= _FILLED:
                return factor
        return _FACTORS[-1]

    def _blocks(self, cells: AnyArray, factor: int, fill_value: float = 0) -> AnyArray:
        """Return values of cells (cells,) as (merged cells, factor ** 2).

        Args:
            cells: (cells,) values.
            factor: cells along each edge of a merged one.
            fill_value: of cells beyond the raster's edge.
        """
        up, right = -self.height % factor, -self.width % factor  # row 0 is the highest: the lowest stay where they are
        padded_cells = np.pad(cells.reshape(self.height, self.width), ((up, 0), (0, right)), constant_values=fill_value)
        parts = padded_cells.reshape(padded_cells.shape[0] // factor, factor, padded_cells.shape[1] // factor, factor)
        return parts.swapaxes(1, 2).reshape(-1, factor**2)

    def picture(self, colors: AnyArray, paper: tuple[int, int, int]) -> UInt8:
        """Return cell colours as an image (height, width, 3).

        Dots are enlarged where few cells are filled; else single empty cells are closed.

        Args:
            colors: (cells, 3), 8 bits.
            paper: colour of cells without points.
        """
        shape = (self.height, self.width)
        is_filled = (self.count > 0).reshape(shape)
        result = np.where(self.count[:, None] > 0, colors, paper).astype(np.uint8).reshape(*shape, 3)
        growth = self._dot_growth(is_filled)
        for _ in range(growth):
            result, is_filled = _grow_cells(result, is_filled)
        for _ in range(0 if growth else _GAP):
            result, is_filled = _close_gaps(result, is_filled)
        return result

    def _dot_growth(self, is_filled: Bool) -> int:
        """Return the number of cells, 0 to 2, by which the points' dots are enlarged; 0 where most cells are filled.

        Args:
            is_filled: (height, width) whether a cell holds points.
        """
        rows, columns = is_filled.any(axis=1), is_filled.any(axis=0)
        occupied_part = is_filled[rows][:, columns]
        if not occupied_part.size:
            return 0
        share = float(occupied_part.mean())
        neighbours = float((occupied_part[:, 1:] & occupied_part[:, :-1]).sum() / max(1, occupied_part.sum()))
        # Chosen: dots grow where hardly any cells are filled, the more the fewer of them are next to each other.
        if share > 0.35 or neighbours > 0.8:
            return 0
        return 1 if neighbours > 0.4 else 2

    def _keep_foremost(self, cell: Index, depth: Float, label: UInt8) -> None:
        """Set the classes of cells whose foremost point is among new ones.

        Args:
            cell: (N,) of the new points.
            depth: (N,) the larger, the further in front.
            label: (N,) classes.
        """
        np.maximum.at(self._front, cell, depth)
        foremost = depth == self._front[cell]
        self.label[cell[foremost]] = label[foremost]


def _shared(is_filled: Bool, axis: int) -> float:
    """Return the share of filled cells whose next neighbour along an axis is filled as well.

    Args:
        is_filled: (rows, columns).
        axis: 0 or 1.
    """
    cells = is_filled[:-1] if axis == 0 else is_filled[:, :-1]
    next_cells = is_filled[1:] if axis == 0 else is_filled[:, 1:]
    return float((cells & next_cells).sum() / max(1, cells.sum()))


def _close_gaps(picture: UInt8, is_filled: Bool) -> tuple[UInt8, Bool]:
    """Return copies of a picture and its mask in which empty cells between two filled ones take the colour of one.

    Args:
        picture: (height, width, 3).
        is_filled: (height, width) whether a cell holds points.
    """
    result, mask = picture.copy(), is_filled.copy()
    for axis in (0, 1):
        # All cells but the outermost along the axis, the cells before these, and those behind.
        whole: list[slice] = [slice(None), slice(None)]
        before, middle, behind = (
            tuple(whole[:axis] + [part] + whole[axis + 1 :]) for part in (slice(-2), slice(1, -1), slice(2, None))
        )
        gap = is_filled[before] & is_filled[behind] & ~mask[middle]
        result[middle][gap] = picture[before][gap]
        mask[middle] |= gap
    return result, mask


def _grow_cells(picture: UInt8, is_filled: Bool) -> tuple[UInt8, Bool]:
    """Return copies of a picture and its mask in which empty cells beside filled ones take their colours.

    Args:
        picture: (height, width, 3).
        is_filled: (height, width) whether a cell holds points.
    """
    result, mask = picture.copy(), is_filled.copy()
    for axis, step in ((1, 1), (1, -1), (0, 1), (0, -1)):
        beside_filled, color = np.roll(is_filled, step, axis), np.roll(picture, step, axis)
        edge: list[slice | int] = [slice(None), slice(None)]
        edge[axis] = 0 if step == 1 else -1
        beside_filled[tuple(edge)] = False  # nothing comes round from the other side
        grown_mask = beside_filled & ~mask
        result[grown_mask] = color[grown_mask]
        mask |= grown_mask
    return result, mask


PAPER, INK = (226, 231, 238), (40, 40, 44)
_MARGIN, _LINE, _SMALL = 14, 26, 15
_GRID = (200, 206, 214)

Color = tuple[int, int, int]


@dataclass(frozen=True)
class GrayBar:
    """Legend of a grey picture: the values that black and white stand for, and their quantity.

    Attributes:
        low, high: values of black and white.
        text: of what.
    """

    low: float
    high: float
    text: str


Legend = Sequence[tuple[str, Color]] | GrayBar | None
"""Names and colours, or values of grays, that stand below a picture."""


def class_legend(rows: Sequence[PointClass], labels: UInt8) -> list[tuple[str, Color]]:
    """Return (name, colour) of the classes that occur among labels, in the scheme's order."""
    ids = set(np.unique(labels).tolist())
    return [(row.name.replace("_", " "), row.color) for row in rows if row.id in ids]


def grays(values: Float, is_filled: Bool, text: str) -> tuple[Float, GrayBar]:
    """Return values as grays (N, 3), 0 to 255, stretched between their 0.5 and 99.5 % quantiles, with a legend.

    Args:
        values: (N,).
        is_filled: (N,) of which values the quantiles are.
        text: name of the quantity.
    """
    black_value, white_value = np.quantile(values[is_filled], [0.005, 0.995]) if is_filled.any() else (0.0, 1.0)
    shade = np.clip((values - black_value) / max(white_value - black_value, 1e-300), 0, 1) * 255
    return np.repeat(shade[:, None], 3, axis=1), GrayBar(float(black_value), float(white_value), text)


def add_frame(
    pixels: UInt8, title: str, legend: Legend, axes: Axes, north: tuple[float, float] | None = None, ticks: bool = False
) -> Image.Image:
    """Return an image (height, width, 3) framed with title, legend, and scale bar or ticks.

    Args:
        axes: the picture's coordinates; of its scale, and of its ticks if there are to be any.
        north: direction of the north in picture axes (right, up), for an arrow.
        ticks: mark heights and distances at the edges, in place of the scale.
    """
    height, width = pixels.shape[:2]
    left_margin = _MARGIN + (52 if ticks else 0)
    size = (max(width + left_margin, 900) + _MARGIN, height + 2 * _MARGIN + (_LINE if ticks else 0))
    lines = _wrap_entries(legend, size[0] - 2 * _MARGIN) if isinstance(legend, Sequence) else [[]] if legend else []
    picture = Image.new("RGB", (size[0], size[1] + _LINE * (1 + len(lines)) + 10), PAPER)
    picture.paste(Image.fromarray(pixels), (left_margin, _MARGIN))
    draw = ImageDraw.Draw(picture)
    y = float(size[1])
    if ticks:
        _draw_ticks(draw, axes, (left_margin, _MARGIN, width, height))
        x = float(left_margin)
    else:
        x = _draw_scale(draw, axes.across, width, (_MARGIN, y))
    if north is not None:
        _draw_north(draw, north, (x + 20, y + 12))
        x += 62
    draw.text((x, y + 2), title, fill=INK, font=_font(17))
    y += _LINE + 2
    if isinstance(legend, GrayBar):
        _draw_bar(draw, legend, (_MARGIN, y))
    for number, line in enumerate(lines):
        _draw_swatches(draw, line, y + number * _LINE)
    return picture


def nice_step(reach: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is at most ``reach``."""
    power = 10.0 ** np.floor(np.log10(reach))
    return float(max(factor * power for factor in (1, 2, 5) if factor * power <= reach * (1 + 1e-9)))


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return the font of a size, pixels."""
    return ImageFont.load_default(size=size)


def _wrap_entries(legend: Sequence[tuple[str, Color]], width: float) -> list[list[tuple[str, Color]]]:
    """Return the legend's entries, broken into lines no wider than ``width`` (pixels)."""
    lines: list[list[tuple[str, Color]]] = []
    line_width = np.inf
    for entry in legend:
        entry_width = 40 + _font(_SMALL).getlength(entry[0])
        if line_width + entry_width > width:
            lines.append([])
            line_width = 0.0
        lines[-1].append(entry)
        line_width += entry_width
    return lines


def _draw_swatches(draw: ImageDraw.ImageDraw, entries: list[tuple[str, Color]], y: float) -> None:
    """Draw a line of a legend: a square of its colour and the name of each entry.

    Args:
        draw: where to.
        entries: names and colours.
        y: top of the line, pixels.
    """
    x = float(_MARGIN)
    for text, color in entries:
        draw.rectangle([x, y + 2, x + 16, y + 18], fill=color, outline=INK)
        draw.text((x + 22, y + 2), text, fill=INK, font=_font(_SMALL))
        x += 40 + draw.textlength(text, font=_font(_SMALL))


def _draw_bar(draw: ImageDraw.ImageDraw, bar: GrayBar, corner: tuple[float, float]) -> None:
    """Draw the legend of a grey picture: a bar from black to white between its two values.

    Args:
        draw: where to.
        bar: the legend.
        corner: upper left corner, pixels.
    """
    x, y = corner
    lowest_text, highest_text = (
        f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}" for value in (bar.low, bar.high)
    )
    draw.text((x, y + 2), lowest_text, fill=INK, font=_font(_SMALL))
    x += draw.textlength(lowest_text, font=_font(_SMALL)) + 8
    for step in range(160):
        shade = round(step / 159 * 255)
        draw.line([(x + step, y + 3), (x + step, y + 18)], fill=(shade, shade, shade))
    draw.rectangle([x - 1, y + 2, x + 160, y + 19], outline=INK)
    draw.text((x + 168, y + 2), f"{highest_text}   {bar.text}", fill=INK, font=_font(_SMALL))


def _draw_scale(draw: ImageDraw.ImageDraw, pixel: float, width: int, corner: tuple[float, float]) -> float:
    """Draw a scale bar with its length; return the x, pixels, at which it ends."""
    x, y = corner
    step = nice_step(pixel * min(max(width, 40), 160))
    draw.rectangle([x, y + 8, x + step / pixel, y + 13], fill=INK)
    text = f"{step:g} m" if step < 1000 else f"{step / 1000:g} km"
    x += step / pixel + 8
    draw.text((x, y + 2), text, fill=INK, font=_font(_SMALL))
    return x + draw.textlength(text, font=_font(_SMALL)) + 24


def _draw_north(draw: ImageDraw.ImageDraw, north: tuple[float, float], centre: tuple[float, float]) -> None:
    """Draw a north arrow in a picture that is rotated by the road's direction."""
    right, up = north
    x, y = centre
    tip = (x + 13 * right, y - 13 * up)
    draw.line([(x - 13 * right, y + 13 * up), tip], fill=INK, width=2)
    for side in (-1, 1):
        draw.line([tip, (x + 5 * right + side * 5 * up, y - 5 * up + side * 5 * right)], fill=INK, width=2)
    draw.text((x + 26, y), "N", fill=INK, font=_font(_SMALL), anchor="mm")


def _draw_ticks(draw: ImageDraw.ImageDraw, axes: Axes, box: tuple[int, int, int, int]) -> None:
    """Draw ticks with distances below and heights to the left of the picture in ``box`` (x, y, width, height)."""
    x0, y0, width, height = box
    draw.rectangle([x0 - 1, y0 - 1, x0 + width, y0 + height], outline=_GRID)
    step = nice_step(width * axes.across / 6)
    for number in range(int(np.ceil(axes.left / step)), int(axes.left / step + width * axes.across / step) + 1):
        x = x0 + (number * step - axes.left) / axes.across
        draw.line([(x, y0 + height), (x, y0 + height + 5)], fill=INK)
        draw.text((x, y0 + height + 7), f"{number * step:g} m", fill=INK, font=_font(13), anchor="ma")
    step = nice_step(max(height * axes.up / 3, 1e-6))
    for number in range(int(np.ceil(axes.low / step)), int(axes.low / step + height * axes.up / step) + 1):
        y = y0 + height - (number * step - axes.low) / axes.up
        draw.line([(x0 - 5, y), (x0, y)], fill=INK)
        draw.text((x0 - 8, y), f"{number * step:g}", fill=INK, font=_font(13), anchor="rm")
