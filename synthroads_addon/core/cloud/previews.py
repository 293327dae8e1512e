"""Pictures of a cloud from above, gathered block by block: by class, by intensity, in colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from .labels import class_colors, class_id, classes
from .points import PointBlock

WIDTH = 1800
_MARGIN, _FOOTER = 12, 72
_PAPER, _INK = (226, 231, 238), (40, 40, 44)


class TopView:
    """A raster over the cloud, turned so that the road runs from left to right.

    Args:
        start, end: (2,) map coordinates of the road's ends.
        half_width: reach to either side of the line between them, m; what lies beyond is left out.
    """

    def __init__(self, start: NDArray[np.float64], end: NDArray[np.float64], low: float, high: float) -> None:
        chord = np.asarray(end) - np.asarray(start)
        length = max(float(np.hypot(*chord)), 1.0)
        self.along = chord / length if length > 1.0 else np.array([1.0, 0.0])
        self.start = np.asarray(start, dtype=np.float64)
        border = 0.02 * length + 1.0
        self.left, self.low = -border, low
        self.pixel = max(length + 2 * border, high - low) / WIDTH
        self.width = max(1, int(np.ceil((length + 2 * border) / self.pixel)))
        self.height = max(1, int(np.ceil((high - low) / self.pixel)))
        cells = self.width * self.height
        self.count = np.zeros(cells)
        self.intensity = np.zeros(cells)
        self.rgb = np.zeros((3, cells))
        self.top = np.full(cells, -np.inf)
        self.label = np.full(cells, 255, dtype=np.uint8)
        self._lift = np.zeros(256)
        self._lift[class_id("road_marking")] = 0.3  # a line is thinner than a pixel: let it win over the pavement

    def add(self, block: PointBlock) -> None:
        """Add a block's points."""
        relative = block.xyz[:, :2] - self.start
        across = relative @ np.array([-self.along[1], self.along[0]])
        column = np.floor((relative @ self.along - self.left) / self.pixel).astype(np.intp)
        row = self.height - 1 - np.floor((across - self.low) / self.pixel).astype(np.intp)
        inside = (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        cell = (row * self.width + column)[inside]
        if len(cell) == 0:
            return
        first, last = int(cell.min()), int(cell.max()) + 1
        window, size = slice(first, last), last - first

        def total(weights: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
            return np.bincount(cell - first, weights, size).astype(np.float64)

        self.count[window] += total()
        self.intensity[window] += total((block.intensity * block.range**2)[inside])
        for channel in range(3):
            self.rgb[channel, window] += total(block.rgb[inside, channel].astype(np.float64))
        self._keep_highest(cell, block.xyz[inside, 2], block.class_id[inside])

    def save(self, folder: Path, epsg: int) -> list[Path]:
        """Write ``preview_class.png``, ``preview_intensity.png`` and ``preview_rgb.png``; return their paths."""
        filled = self.count > 0
        number = np.maximum(self.count, 1)
        pictures = {
            "class": (class_colors()[self.label], [(c.name.replace("_", " "), c.color) for c in self._present()]),
            "intensity": self._gray(self.intensity / number, filled),
            "rgb": ((self.rgb / number / 256).T, []),
        }
        paths = []
        for name, (pixels, legend) in pictures.items():
            canvas = np.where(filled[:, None], pixels, _PAPER).astype(np.uint8)
            paths.append(folder / f"preview_{name}.png")
            self._draw(canvas.reshape(self.height, self.width, 3), name, legend, epsg).save(paths[-1])
        return paths

    def _keep_highest(self, cell: NDArray[np.intp], z: NDArray[np.float64], label: NDArray[np.uint8]) -> None:
        height = z + self._lift[label]
        higher = height > self.top[cell]
        cell, height, label = cell[higher], height[higher], label[higher]
        order = np.argsort(height, kind="stable")
        self.top[cell[order]] = height[order]
        self.label[cell[order]] = label[order]

    def _present(self) -> list:
        seen = set(np.unique(self.label).tolist())
        return [row for row in classes() if row.id in seen]

    def _gray(self, values: NDArray[np.float64], filled: NDArray[np.bool_]) -> tuple[NDArray[np.float64], list]:
        low, high = np.quantile(values[filled], [0.005, 0.995]) if filled.any() else (0.0, 1.0)
        gray = np.clip((values - low) / max(high - low, 1e-12), 0, 1) * 255
        legend = [
            (f"{low:.2f}", (0, 0, 0)),
            (f"{high:.2f}  intensity x squared range (white target = 1)", (255, 255, 255)),
        ]
        return np.repeat(gray[:, None], 3, axis=1), legend

    def _draw(self, pixels: NDArray[np.uint8], name: str, legend: list, epsg: int) -> Image.Image:
        font = ImageFont.load_default(size=17)
        size = (max(self.width, WIDTH // 2) + 2 * _MARGIN, self.height + 2 * _MARGIN + _FOOTER)
        picture = Image.new("RGB", size, _PAPER)
        picture.paste(Image.fromarray(pixels), (_MARGIN, _MARGIN))
        draw = ImageDraw.Draw(picture)
        line = self.height + 2 * _MARGIN + 4
        step = 50 if self.pixel < 0.5 else 10 ** np.ceil(np.log10(self.pixel * 100))
        draw.rectangle([_MARGIN, line + 8, _MARGIN + step / self.pixel, line + 13], fill=_INK)
        draw.text((_MARGIN, line + 18), f"{step:g} m", fill=_INK, font=font)
        self._north(draw, (_MARGIN + step / self.pixel + 45, line + 26))
        x = _MARGIN + step / self.pixel + 90
        title = f"{name}   {int(self.count.sum()):,} points   EPSG:{epsg}   pixel {self.pixel:.2f} m"
        draw.text((x, line), title, fill=_INK, font=font)
        for text, color in legend:
            draw.rectangle([x, line + 30, x + 16, line + 46], fill=color, outline=_INK)
            draw.text((x + 22, line + 28), text, fill=_INK, font=font)
            x += 40 + draw.textlength(text, font=font)
        return picture

    def _north(self, draw: ImageDraw.ImageDraw, centre: tuple[float, float]) -> None:
        """Draw an arrow to the north: the picture is turned by the road's direction."""
        right, up = self.along[1], self.along[0]  # north in picture axes
        x, y = centre
        tip = (x + 20 * right, y - 20 * up)
        draw.line([(x - 20 * right, y + 20 * up), tip], fill=_INK, width=2)
        for side in (-1, 1):
            draw.line([tip, (x + 10 * right + side * 6 * up, y - 10 * up + side * 6 * right)], fill=_INK, width=2)
        beside = (x + 30 * right, y - 30 * up)
        draw.text(beside, "N", fill=_INK, font=ImageFont.load_default(size=14), anchor="mm")
