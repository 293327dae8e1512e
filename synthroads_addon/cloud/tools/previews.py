"""Pictures of a cloud, gathered block by block: from above by class, intensity and colour, and a cross-section."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Self

import numpy as np

from ...base.arrays import AnyArray, Float
from ...base.classes import ClassScheme, class_scheme
from ...road.geometry import RoadGeometry
from ..points import PointBlock
from .picture import PAPER, Axes, Legend, Raster, add_frame, class_legend, grays, nice_step

WIDTH = 1800
"""Width of the pictures, pixels."""
_LOWEST = 320
"""Height (pixels), more or less, that a cross-section is exaggerated to, if it is lower."""
_MOST_PIXELS = 1600
_BORDER = 2.0
"""Border beside what a raster from above is meant to hold, m."""
_SECTION_PAPER = (172, 187, 204)
"""White markings and dark pavement, both only points here, stand out from it."""


class TopView:
    """Top view of a cloud, rasterised block by block and rotated so that the road runs from left to right.

    Args:
        start, end: (2,) map coordinates of the road's ends.
        low, high: reach to the right and to the left of the line between them, m; what lies beyond is left out.
        scheme: what the points' classes are; the 17 if not given.
    """

    def __init__(
        self, start: Float, end: Float, right_reach: float, left_reach: float, scheme: ClassScheme | None = None
    ) -> None:
        chord = np.asarray(end) - np.asarray(start)
        length = max(float(np.hypot(*chord)), 1.0)
        self.along = chord / length if length > 1.0 else np.array([1.0, 0.0])
        self.start = np.asarray(start, dtype=np.float64)
        border = 0.02 * length + 1.0
        pixel = max(length + 2 * border, left_reach - right_reach) / WIDTH
        size = (
            max(1, int(np.ceil((length + 2 * border) / pixel))),
            max(1, int(np.ceil((left_reach - right_reach) / pixel))),
        )
        self.raster = Raster(Axes(-border, right_reach, pixel, pixel), size)
        self.scheme = scheme or class_scheme("17")
        # A line is thinner than a pixel: let it win over the pavement.
        self._lift = np.zeros(256)
        self._lift[[row.id for row in self.scheme.rows if row.name == "road_marking"]] = 0.3

    @classmethod
    def over_road(cls, geometry: RoadGeometry, scheme: ClassScheme | None = None) -> Self:
        """Return an empty view that holds the whole swath of a road."""
        origin = np.array(geometry.parameters.transform.translate)[:2]
        stations = np.linspace(0.0, geometry.length, 50)
        terrain = geometry.parameters.terrain
        reach = terrain.half_width if terrain else float(np.abs(geometry.offsets(stations)).max())
        plan, heading, _ = geometry.alignment.frame(stations)
        leftward = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        chord = plan[-1] - plan[0]
        normal = np.array([-chord[1], chord[0]]) / max(np.hypot(*chord), 1e-9)
        edges = np.concatenate([plan + reach * leftward, plan - reach * leftward])
        offsets = (edges - plan[0]) @ normal
        right_reach, left_reach = float(offsets.min()) - _BORDER, float(offsets.max()) + _BORDER
        return cls(plan[0] + origin, plan[-1] + origin, right_reach, left_reach, scheme)

    @classmethod
    def over_box(cls, lowest_corner: Float, highest_corner: Float, scheme: ClassScheme | None = None) -> Self:
        """Return an empty view that holds a box (corners in map coordinates), its longer side from left to right."""
        start, end = lowest_corner[:2].copy(), highest_corner[:2].copy()
        axis = int(np.argmax(end - start))
        reach = float((end - start)[1 - axis]) / 2.0 + _BORDER
        start[1 - axis] = end[1 - axis] = (start + end)[1 - axis] / 2.0
        return cls(start, end, -reach, reach, scheme)

    def add(self, block: PointBlock) -> None:
        """Add a block's points to the view; higher points hide lower ones."""
        relative = block.xyz[:, :2] - self.start
        offset = relative @ np.array([-self.along[1], self.along[0]])
        height = block.xyz[:, 2] + self._lift[block.class_id]
        self.raster.add(block, (relative @ self.along, offset), height)

    def save(
        self,
        folder: Path,
        epsg: int | None,
        kinds: Sequence[str] = ("class", "intensity", "rgb"),
        fields: Mapping[str, str] = MappingProxyType({}),
    ) -> list[Path]:
        """Write PNGs of these kinds, with the EPSG code in their title; return their paths.

        Cells are merged until they are as wide as the points are apart, so that sparse clouds show surfaces.

        Args:
            folder: for the pictures, ``preview_KIND.png``.
            epsg: of the coordinates, or None.
            kinds: by what they are coloured: ``class``, ``intensity``, ``rgb``, or another name by class.
            fields: by kind, the file's field that its title names; the kind itself where there is none.
        """
        factor = self.raster.density_factor()
        raster = self.raster.merged(factor) if factor > 1 else self.raster
        system = f"   EPSG:{epsg}" if epsg else ""
        north = (float(self.along[1]), float(self.along[0]))
        paths = []
        for kind in kinds:
            colors, legend = self._colors(raster, kind)
            counts_text = f"{int(raster.count.sum()):,} points{system}   pixel {raster.axes.across:.3g} m"
            title = f"{fields.get(kind, kind)}   {counts_text}"
            paths.append(folder / f"preview_{kind}.png")
            pixels = raster.picture(colors, PAPER).repeat(factor, axis=0).repeat(factor, axis=1)
            add_frame(pixels, title, legend, self.raster.axes, north).save(paths[-1])
        return paths

    def _colors(self, raster: Raster, kind: str) -> tuple[AnyArray, Legend]:
        """Return the colours (cells, 3) of a raster by class, intensity or colour, with their legend."""
        if kind == "intensity":
            return _grays(raster)
        return (raster.rgb(), None) if kind == "rgb" else _class_colors(raster, self.scheme)


class CrossSection:
    """Cross-section of a cloud, seen along the road: distances from the cut's middle, to the left negative.

    Args:
        middle: (2,) map coordinates of the cut's middle.
        right: (2,) direction of the cut, to the right as one looks along the road.
        reach: length of the cut to either side, m.
        depth: thickness of the slab whose points are drawn, m.
        heights: lowest and highest height, m.
        scheme: what the points' classes are; the 17 if not given.
        by_class: colour by class, else by intensity.
    """

    def __init__(
        self,
        middle: Float,
        right: Float,
        reach: float,
        depth: float,
        heights: tuple[float, float],
        scheme: ClassScheme | None = None,
        by_class: bool = True,
    ) -> None:
        self.middle = np.asarray(middle, dtype=np.float64)
        self.right = np.asarray(right, dtype=np.float64) / np.hypot(*right)
        self.depth = depth
        self.by_class = by_class
        pixel = 2 * reach / WIDTH
        bottom_height, top_height = heights[0] - 0.5, heights[1] + 0.5
        usual_exaggeration = _LOWEST * pixel / (top_height - bottom_height)
        self.exaggeration = 1.0 if usual_exaggeration <= 1 else min(10.0, nice_step(1.4 * usual_exaggeration))
        row_height = max(pixel / self.exaggeration, (top_height - bottom_height) / _MOST_PIXELS)
        self.exaggeration = pixel / row_height
        size = (WIDTH, max(1, int(np.ceil((top_height - bottom_height) / row_height))))
        self.raster = Raster(Axes(-reach, bottom_height, pixel, row_height), size)
        self.scheme = scheme or class_scheme("17")

    def add(self, block: PointBlock) -> None:
        """Add a block's points to the section; those outside the slab are left out."""
        relative = block.xyz[:, :2] - self.middle
        distance = np.abs(relative @ np.array([-self.right[1], self.right[0]]))
        inside_rows = np.flatnonzero(distance <= self.depth / 2)
        if len(inside_rows):
            part = block.select(inside_rows)
            place = (relative[inside_rows] @ self.right, part.xyz[:, 2])
            self.raster.add(part, place, -distance[inside_rows])

    def save(self, path: Path, field: str = "") -> Path:
        """Write the section as a picture to a path and return the path; its title names the field that it shows."""
        raster = self.raster
        colors, legend = _class_colors(raster, self.scheme) if self.by_class else _grays(raster)
        scale = "" if abs(self.exaggeration - 1) < 0.01 else f"   heights x {self.exaggeration:.3g}"
        name = f"cross-section by {field}" if field else "cross-section"
        title = f"{name}   {int(raster.count.sum()):,} points in {self.depth:g} m{scale}"
        add_frame(raster.picture(colors, _SECTION_PAPER), title, legend, raster.axes, ticks=True).save(path)
        return path


def _class_colors(raster: Raster, scheme: ClassScheme) -> tuple[AnyArray, Legend]:
    """Return the class colours (cells, 3) of a raster's foremost points, with their legend."""
    labels = raster.label[raster.count > 0]
    return scheme.colors()[raster.label], class_legend(scheme.rows, labels)


def _grays(raster: Raster) -> tuple[AnyArray, Legend]:
    """Return a raster's mean intensities as grays (cells, 3), with their legend."""
    return grays(raster.intensity(), raster.count > 0, raster.brightness.text)
