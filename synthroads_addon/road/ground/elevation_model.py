"""A digital elevation model: heights of the ground on a grid over the map, from a GeoTIFF or an ESRI ASCII grid.

Rasters are read through `rasterio`, and of them only the tiles that a road comes near to, so that a short road can lie
on the fine model of a whole country. Every fault is one line that names the file and what is wrong with it.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Bool, Float, Int
from ...base.errors import InputError, MissingFileError
from ...base.pictures import picture_kind
from ..alignment import Alignment

if TYPE_CHECKING:
    from rasterio.crs import CRS
    from rasterio.io import DatasetReader

Cells = Int
"""Cells (2, ...): their rows and columns."""

LOWEST, HIGHEST = -500.0, 9000.0
"""Heights beyond these (m) are no ground: mostly nodata that the file doesn't declare."""
HOLES_SHARE = 0.01
"""Share of the cells beneath a road that may be without height."""
HOLE_REACH = 5
"""A cell without height up to this far (cells) from one that has one is filled: holes of up to 10 cells across."""

_TILE = 256
_MOST_TILES = 2048  # 1 GiB
_MOST_CELLS = 2**42
"""Cells of a raster, read or not: a table of its tiles is held."""
_MOST_CELLS_OF_A_BLOCK = 2**26
"""Cells that a raster may store in one piece, as they must be unpacked together."""
_CELLS = (0.01, 10_000.0)
"""Shortest and longest side of a cell, m."""
_FARTHEST = 1e8
_METRES = ("", "m", "metre", "metres", "meter", "meters")
_AROUND = np.array([(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if (row, column) != (0, 0)]).T
_BESIDE = np.array([(-1, 1, 0, 0), (0, 0, -1, 1)])
_STILL, _MOST_ROUNDS = 1e-7, 2000  # of the membrane over a hole: m, rounds


@dataclass(frozen=True)
class HeightGrid:
    """Georeference of a raster without rotation: where the centres of its cells lie on the map.

    Attributes:
        east, north: map coordinates of the first cell's centre, m.
        step_east, step_north: from one column, and from one row, to the next, m; rows mostly run southwards.
        columns, rows: how many there are.
    """

    east: float
    north: float
    step_east: float
    step_north: float
    columns: int
    rows: int

    @property
    def cell(self) -> float:
        """Longer side of a cell, m."""
        return max(abs(self.step_east), abs(self.step_north))

    def bounds(self) -> tuple[Float, Float]:
        """Return the least and the greatest (east, north) of the cells' centres, m."""
        corners = self.position(np.array([(0, self.rows - 1), (0, self.columns - 1)]))
        return corners.min(axis=1), corners.max(axis=1)

    def position(self, cells: Cells) -> Float:
        """Return east and north (2, ...) of the centres of cells (2, ...), m."""
        row, column = cells
        return np.stack([self.east + column * self.step_east, self.north + row * self.step_north])

    def locate(self, east: Float, north: Float) -> Float:
        """Return the fractional rows and columns (2, ...) of map coordinates (...), m."""
        return np.stack([(north - self.north) / self.step_north, (east - self.east) / self.step_east])

    def between_centres(self, cells: Float) -> Bool:
        """Return a mask (...): which fractional rows and columns (2, ...) lie within the outermost cells' centres."""
        row, column = cells
        margin = 1e-6  # of a cell, for rounding
        is_inside = (row >= -margin) & (row <= self.rows - 1 + margin)
        return is_inside & (column >= -margin) & (column <= self.columns - 1 + margin)

    def first_of_four(self, cells: Float) -> Cells:
        """Return the cell of least row and column (2, ...) of the four around fractional ones (2, ...), not NaN."""
        row, column = np.floor(cells).astype(np.int64)
        return np.stack([np.clip(row, 0, self.rows - 2), np.clip(column, 0, self.columns - 2)])


@dataclass(frozen=True)
class Corridor:
    """The area beside a centreline over which a road needs an elevation model.

    Attributes:
        alignment: centreline in local coordinates.
        east, north: map coordinates of the local origin, m.
        reach: to all sides of the centreline, m.
    """

    alignment: Alignment
    east: float
    north: float
    reach: float

    def points(self, cell: float) -> Iterator[Float]:
        """Yield blocks of map points (2, N), m, half a cell apart or less, that cover the corridor and a cell more.

        So each cell that a height within the reach is interpolated from is one of the four around some point.
        """
        reach, step = self.reach + cell, cell / 2.0
        offsets = np.linspace(-reach, reach, math.ceil(2.0 * reach / step) + 1)
        largest_curvature = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in self.alignment.elements)
        length = self.alignment.length + 2.0 * reach
        stations = np.linspace(-reach, length - reach, math.ceil(length * (1.0 + reach * largest_curvature) / step) + 1)
        for block in np.array_split(stations, math.ceil(len(stations) * len(offsets) / 250_000)):
            position, heading, _ = self.alignment.frame(block)
            east = self.east + position[:, :1] - np.sin(heading)[:, None] * offsets
            north = self.north + position[:, 1:] + np.cos(heading)[:, None] * offsets
            yield np.stack([east.ravel(), north.ravel()])


class ElevationModel:
    """Heights of the ground in memory, by tiles, interpolated bilinearly between the centres of a raster's cells.

    Attributes:
        path: file that it was read from.
        grid: where its cells lie.
    """

    def __init__(self, path: str, grid: HeightGrid) -> None:
        self.path = path
        self.grid = grid
        # Tile 0 has no heights: it stands for all that isn't loaded.
        self._tiles = np.full((1, _TILE, _TILE), np.nan)
        self._number = np.zeros((-(-grid.rows // _TILE), -(-grid.columns // _TILE)), dtype=np.int64)

    def elevation(self, x: ArrayLike, y: ArrayLike) -> Float:
        """Return the ground's height (m) at map coordinates (m, east and north) of any shape, same shape.

        NaN outside the centres of the outermost cells, beside cells without height, and where nothing was loaded.
        """
        x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        cells = self.grid.locate(x, y)
        is_inside = self.grid.between_centres(cells)
        cells = np.where(is_inside, cells, 0.0)
        row, column = first_cell = self.grid.first_of_four(cells)
        row_share, column_share = cells - first_cell
        upper_height = self.at((row, column)) * (1.0 - column_share) + self.at((row, column + 1)) * column_share
        lower_height = self.at((row + 1, column)) * (1.0 - column_share) + self.at((row + 1, column + 1)) * column_share
        return np.where(is_inside, upper_height * (1.0 - row_share) + lower_height * row_share, np.nan)

    def at(self, cells: Cells | tuple[Cells, Cells]) -> Float:
        """Return the heights (...) of cells (2, ...), m; NaN where there is none."""
        row, column = cells
        exists = (row >= 0) & (row < self.grid.rows) & (column >= 0) & (column < self.grid.columns)
        row, column = np.where(exists, row, 0), np.where(exists, column, 0)
        number = np.where(exists, self._number[row // _TILE, column // _TILE], 0)
        return self._tiles[number, row % _TILE, column % _TILE]

    def set(self, cells: Cells, heights: Float) -> None:
        """Set the heights (N,), m, of loaded cells (2, N), in place."""
        row, column = cells
        self._tiles[self._number[row // _TILE, column // _TILE], row % _TILE, column % _TILE] = heights

    def load(self, dataset: DatasetReader, cells: Cells | None) -> None:
        """Replace the heights in memory by the raster's tiles that hold cells (2, N), or by all tiles.

        Raises:
            InputError: that is more than fits into memory.
            rasterio.errors.RasterioIOError: the file is truncated or damaged.
        """
        from rasterio.windows import Window  # the package is optional

        is_needed = (
            np.ones(self._number.shape, dtype=bool) if cells is None else np.zeros(self._number.shape, dtype=bool)
        )
        if cells is not None:
            is_needed[tuple(cells // _TILE)] = True
        tiles = np.argwhere(is_needed)
        if len(tiles) > _MOST_TILES:
            raise _too_fine(self.path)
        scale, offset = dataset.scales[0], dataset.offsets[0]
        self._tiles = np.full((len(tiles) + 1, _TILE, _TILE), np.nan)
        self._number[is_needed] = np.arange(1, len(tiles) + 1)
        for number, (row, column) in enumerate((tiles * _TILE).tolist(), 1):
            height, width = min(_TILE, self.grid.rows - row), min(_TILE, self.grid.columns - column)
            values = dataset.read(1, window=Window(column, row, width, height), masked=True)
            self._tiles[number, :height, :width] = values.astype(np.float64).filled(np.nan) * scale + offset

    def extremes(self) -> Cells:
        """Return a lowest and a highest of the loaded cells as columns of (2, 2); (2, 0) if none has a height."""
        if np.isnan(self._tiles).all():
            return np.empty((2, 0), dtype=np.int64)
        flat_indices = np.nanargmin(self._tiles), np.nanargmax(self._tiles)
        number, row, column = np.unravel_index(np.array(flat_indices), self._tiles.shape)
        tiles = np.array([np.argwhere(self._number == n)[0] for n in number]).T
        return tiles * _TILE + np.stack([row, column])


def read_elevation_model(path: str | os.PathLike[str], epsg: int, corridor: Corridor | None = None) -> ElevationModel:
    """Read a digital elevation model (GeoTIFF, ESRI ASCII grid), which must be in the coordinate system ``epsg``.

    Args:
        path: the file. An ASCII grid without ``.prj`` beside it is taken to be in the map coordinates of ``epsg``.
        epsg: map coordinate system that it must be in. Of a vertical system only the unit is looked at.
        corridor: read only what this road needs, and see that nothing is missing: small holes (`HOLES_SHARE`,
            `HOLE_REACH`) are filled from around them. Without it all is read, and holes stay NaN.

    Raises:
        MissingFileError: the file doesn't exist or cannot be read.
        InputError: it is no such raster, or truncated; it has another coordinate system, a rotation, several bands,
            heights in feet or beyond all mountains; or it doesn't cover the corridor, or has larger holes there.
    """
    name = os.fspath(path)
    try:
        driver = _driver_of(name)
    except (OSError, ValueError) as error:  # ValueError: a null byte is in the name
        reason = getattr(error, "strerror", None) or error
        raise MissingFileError(name, None, f"an elevation model is needed here ({reason})") from None
    try:
        import rasterio
        from rasterio.errors import CRSError, RasterioError
    except ImportError as error:
        is_missing = isinstance(error, ModuleNotFoundError)
        advice = "SynthRoads brings it, install that again" if is_missing else "it doesn't load here"
        raise InputError(name, None, f"an elevation model needs rasterio: {advice} ({error})") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what it warns of is refused below
            with rasterio.open(name, driver=driver) as dataset:
                _check_kind(name, dataset)
                _check_system(name, dataset, epsg)
                model = ElevationModel(name, _grid(name, dataset))
                cells = _cells_needed(model, corridor) if corridor else None
                model.load(dataset, cells)
    except CRSError as error:
        raise InputError(name, None, f"its coordinate system cannot be read ({_reason(error)})") from None
    except (RasterioError, OSError) as error:
        allowed = f"must be a GeoTIFF or ESRI ASCII grid, and complete ({_reason(error)})"
        raise InputError(name, None, allowed) from None
    _check_heights(model, model.extremes() if cells is None else cells)
    if cells is not None:
        _fill_holes(model, cells)
    return model


def _reason(error: BaseException) -> str:
    """Return the message of an error's innermost cause, which says most, in one line."""
    while error.__cause__ is not None:
        error = error.__cause__
    return " ".join(str(error).split())


def _driver_of(name: str) -> str:
    """Return GDAL's name of the one format that it may open a file as.

    It knows others that name further files, or addresses of the network, and tells them by what is in a file.
    """
    return "GTiff" if picture_kind(Path(name)) == "TIFF" else "AAIGrid"


def _check_kind(name: str, dataset: DatasetReader) -> None:
    """Raise InputError unless a raster has one band of heights in metres."""
    if dataset.count != 1:
        raise InputError(f"{name}: bands", dataset.count, "exactly one is needed, of heights")
    if np.dtype(dataset.dtypes[0]).kind not in "iuf":
        raise InputError(f"{name}: type of number", dataset.dtypes[0], "integers or floats are needed, of heights")
    _check_unit(name, "heights", dataset.units[0] or "")
    scale, offset = dataset.scales[0], dataset.offsets[0]
    if not (math.isfinite(scale) and scale != 0.0 and math.isfinite(offset)):
        raise InputError(f"{name}: scale and offset", (scale, offset), "finite numbers are needed, the scale not 0")


def _check_unit(name: str, quantity_name: str, unit: str) -> None:
    """Raise InputError unless the unit of a raster's coordinates or heights is the metre."""
    if unit.lower() not in _METRES:
        raise InputError(f"{name}: unit of {quantity_name}", unit, "metres are needed")


def _check_system(name: str, dataset: DatasetReader, epsg: int) -> None:
    """Raise InputError unless a raster is in the road's map coordinate system and in metres."""
    from rasterio.crs import CRS  # the package is optional
    from rasterio.errors import CRSError

    prj_path = Path(name).with_suffix(".prj")
    if dataset.crs is None and dataset.driver == "AAIGrid" and not prj_path.exists():
        return
    if dataset.crs is None:
        reason = f"{prj_path.name} isn't understood" if prj_path.exists() else "the file names none"
        raise InputError(f"{name}: coordinate system", None, f"{reason}; EPSG:{epsg} is needed")
    horizontal, unit = _horizontal(dataset.crs)
    try:
        road_system, _ = _horizontal(CRS.from_epsg(epsg))
    except CRSError:
        raise InputError("road.epsg", epsg, "must be the EPSG code of a coordinate system") from None
    code = horizontal.to_epsg()
    if code is None or code != road_system.to_epsg():
        system_text = f"EPSG:{code}" if code else horizontal.to_dict(projjson=True).get("name", "unknown")
        raise InputError(
            f"{name}: coordinate system", system_text, f"EPSG:{epsg} is needed, the road's own (road.epsg)"
        )
    _check_unit(name, "coordinates", horizontal.linear_units)
    _check_unit(name, "heights", unit)


def _horizontal(system: CRS) -> tuple[CRS, str]:
    """Return the horizontal part of a coordinate system and its vertical part's unit, empty without such a part."""
    parts: list[dict[str, Any]] = system.to_dict(projjson=True).get("components", [])
    if not parts:
        return system, ""
    unit = parts[1]["coordinate_system"]["axis"][0]["unit"]
    return type(system).from_dict(parts[0]), unit if isinstance(unit, str) else unit["name"]


def _grid(name: str, dataset: DatasetReader) -> HeightGrid:
    """Return where a raster's cells lie; InputError for a rotation, and for sizes and places that aren't plausible."""
    transform = dataset.transform
    if transform.is_identity:
        raise InputError(f"{name}: georeference", None, "the file has none: it doesn't say where its cells lie")
    if transform.b != 0.0 or transform.d != 0.0:
        shear = (transform.b, transform.d)
        raise InputError(f"{name}: rotation", shear, "rows must run along the east axis, columns along the north axis")
    if min(dataset.width, dataset.height) < 2:
        raise InputError(f"{name}: size", (dataset.width, dataset.height), "at least 2 by 2 cells are needed")
    sides = (abs(transform.a), abs(transform.e))
    if not (min(sides) >= _CELLS[0] and max(sides) <= _CELLS[1]):
        raise InputError(f"{name}: sides of a cell", sides, f"from {_CELLS[0]:g} to {_CELLS[1]:g} m are needed")
    if dataset.width * dataset.height > _MOST_CELLS:
        size = (dataset.width, dataset.height)
        raise InputError(f"{name}: size", size, f"at most {_MOST_CELLS / 1e12:.1f} million million cells are possible")
    if math.prod(dataset.block_shapes[0]) > _MOST_CELLS_OF_A_BLOCK:
        allowed = f"at most {_MOST_CELLS_OF_A_BLOCK / 1e6:.0f} million cells; store the raster in tiles"
        raise InputError(f"{name}: size of its blocks", dataset.block_shapes[0], allowed)
    east, north = transform.c + transform.a / 2.0, transform.f + transform.e / 2.0
    if not max(abs(east), abs(north)) <= _FARTHEST:
        raise InputError(f"{name}: place", (east, north), f"must lie within {_FARTHEST:g} m of the map's origin")
    return HeightGrid(east, north, transform.a, transform.e, dataset.width, dataset.height)


def _cells_needed(model: ElevationModel, corridor: Corridor) -> Cells:
    """Return the cells (2, N) that the corridor's heights are interpolated from; InputError if some aren't there."""
    grid, is_uncovered = model.grid, False
    area = 2.0 * corridor.reach * (corridor.alignment.length + 2.0 * corridor.reach)
    if area / abs(grid.step_east * grid.step_north) > _MOST_TILES * _TILE**2:
        raise _too_fine(model.path)
    lower, upper = np.full(2, np.inf), np.full(2, -np.inf)
    numbers = []
    for points in corridor.points(grid.cell):
        fractional_cells = grid.locate(*points)
        is_uncovered = is_uncovered or not grid.between_centres(fractional_cells).all()
        lower, upper = np.minimum(lower, points.min(axis=1)), np.maximum(upper, points.max(axis=1))
        row, column = _four_around(grid.first_of_four(fractional_cells))
        numbers.append(row * grid.columns + column)
    if is_uncovered:
        covered_area = _area(*grid.bounds())
        raise InputError(
            f"{model.path}: area", None, f"{covered_area} are covered; the road needs {_area(lower, upper)}"
        )
    return np.stack(np.divmod(np.unique(np.concatenate(numbers)), grid.columns))


def _too_fine(path: str) -> InputError:
    """Return the error for a raster of which a road needs more cells than fit into memory."""
    largest_count = _MOST_TILES * _TILE**2 / 1e6
    return InputError(f"{path}: size", None, f"at most {largest_count:.0f} million cells; a coarser model is needed")


def _four_around(first_cells: Cells) -> Cells:
    """Return the distinct cells (2, M) of all blocks of 2 by 2 cells whose first cells are given (2, N)."""
    corner = first_cells.min(axis=1, keepdims=True)
    is_needed = np.zeros(first_cells.max(axis=1) - corner[:, 0] + 2, dtype=bool)
    is_needed[tuple(first_cells - corner)] = True
    is_needed[1:] |= is_needed[:-1].copy()
    is_needed[:, 1:] |= is_needed[:, :-1].copy()
    return np.stack(np.nonzero(is_needed)) + corner


def _area(lower: Float, upper: Float) -> str:
    """Return a box on the map as text, by its least and its greatest (east, north), m."""
    return f"x {lower[0]:.1f} to {upper[0]:.1f} m, y {lower[1]:.1f} to {upper[1]:.1f} m"


def _check_heights(model: ElevationModel, cells: Cells) -> None:
    """Raise InputError if a cell (2, N) is lower than `LOWEST` or higher than `HIGHEST`."""
    heights = model.at(cells)
    wrong_cells = np.flatnonzero((heights < LOWEST) | (heights > HIGHEST))
    if len(wrong_cells):
        allowed = f"must be from {LOWEST:g} to {HIGHEST:g} m; is it a nodata value that the file doesn't declare?"
        raise InputError(
            f"{model.path}: {_place(model, cells[:, wrong_cells[0]])}", float(heights[wrong_cells[0]]), allowed
        )


def _fill_holes(model: ElevationModel, cells: Cells) -> None:
    """Fill in place those of the cells (2, N) without height, from around them; InputError if they are too many."""
    needed_count = cells.shape[1]
    cells = cells[:, np.isnan(model.at(cells))]
    if cells.shape[1] > HOLES_SHARE * needed_count:
        share = 100.0 * cells.shape[1] / needed_count
        _refuse(model, cells, f"no height, and {share:.3g} % of the cells beneath the road have none")
    # From the rim inwards: each round fills the cells that have a neighbour with a height by the mean of these.
    unfilled = cells
    for _ in range(HOLE_REACH):
        neighbour_heights = model.at(unfilled[:, :, None] + _AROUND[:, None])
        has_height = ~np.isnan(neighbour_heights)
        count = has_height.sum(axis=1)
        is_at_rim = count > 0
        model.set(
            unfilled[:, is_at_rim],
            np.where(has_height, neighbour_heights, 0.0)[is_at_rim].sum(axis=1) / count[is_at_rim],
        )
        unfilled = unfilled[:, ~is_at_rim]
    if unfilled.size:
        _refuse(model, unfilled, "no height, and the hole there is too large")
    _smooth_filled(model, cells)


def _smooth_filled(model: ElevationModel, cells: Cells) -> None:
    """Smooth filled cells (2, N) in place by Jacobi's iteration of Laplace's equation, which carries a plane on."""
    heights = model.at(cells)
    for _ in range(_MOST_ROUNDS):
        mean = np.nanmean(model.at(cells[:, :, None] + _BESIDE[:, None]), axis=1)
        model.set(cells, mean)
        largest_change, heights = np.abs(mean - heights).max(initial=0.0), mean
        if largest_change < _STILL:
            return


def _refuse(model: ElevationModel, holes: Cells, fault: str) -> NoReturn:
    """Raise the InputError for cells (2, N) whose missing heights aren't filled; it names the middle one's place."""
    allowed = f"holes of up to {100.0 * HOLES_SHARE:g} % of the cells and {2 * HOLE_REACH} cells across are filled"
    raise InputError(f"{model.path}: {_place(model, holes[:, holes.shape[1] // 2])}", None, f"{fault}; {allowed}")


def _place(model: ElevationModel, cell: Cells) -> str:
    """Return the map coordinates of a cell's centre as text for messages."""
    east, north = model.grid.position(cell)
    return f"height at x {east:.1f} m, y {north:.1f} m"
