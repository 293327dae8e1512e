"""Elevation models: heights exact to the cell, and every fault of a file refused by name."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.transform import Affine

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.road.alignment import Alignment, Element
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.ground.elevation_model import Corridor, _cells_needed, read_elevation_model
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, Metadata, RoadParameters, Transform
from synthroads_addon.road.section import Carriageway
from synthroads_addon.road.surroundings import Terrain
from synthroads_addon.road.terrain import fit_to_ground, ground_elevation
from synthroads_addon.sampling.surroundings import origin_on_ground
from synthroads_addon.scenario.road import RoadScenario

WEST, NORTH = 294_000.0, 5_628_400.0
EPSG = 25832
ORIGIN = (WEST + 160.0, NORTH - 200.0)
STRAIGHT = Alignment([Element(100.0, 0.0, 0.0)])


def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A plane whose heights float32 holds exactly at multiples of half a metre."""
    return 180.0 + (x - WEST) / 64.0 + (y - NORTH) / 32.0


def centres(rows: int, columns: int, cell: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """East and north of the centres of cells, each (rows, columns), the first row in the north."""
    return np.meshgrid(WEST + cell * (np.arange(columns) + 0.5), NORTH - cell * (np.arange(rows) + 0.5))


def geotiff(path: Path, heights: np.ndarray, **changes) -> Path:
    """Write heights (rows, columns) or (bands, rows, columns); cells of 1 m unless ``transform`` says otherwise."""
    bands = heights if heights.ndim == 3 else heights[None]
    options = {"crs": f"EPSG:{EPSG}", "transform": Affine(1.0, 0.0, WEST, 0.0, -1.0, NORTH), "dtype": heights.dtype}
    options |= {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2]} | changes
    after = {key: options.pop(key) for key in ("units", "scales", "offsets") if key in options}
    with rasterio.open(path, "w", driver="GTiff", **options) as dataset:
        dataset.write(bands)
        for key, value in after.items():
            setattr(dataset, key, [value] * len(bands))
    return path


def ascii_grid(path: Path, heights: np.ndarray, cell: float = 1.0, nodata: float = -9999.0) -> Path:
    rows, columns = heights.shape
    head = {"ncols": columns, "nrows": rows, "xllcorner": WEST, "yllcorner": NORTH - rows * cell, "cellsize": cell}
    head["NODATA_value"] = nodata
    lines = [f"{key} {value}" for key, value in head.items()]
    lines += [" ".join(repr(float(value)) for value in row) for row in heights]
    path.write_text("\n".join(lines) + "\n")
    return path


def plane_file(path: Path, rows: int = 400, columns: int = 400) -> Path:
    return geotiff(path, plane(*centres(rows, columns)).astype(np.float32))


def corridor(reach: float = 20.0, x: float = 100.0, y: float = -200.0) -> Corridor:
    """The ground around 100 m of straight road to the east, its beginning so far from the north-western corner."""
    return Corridor(STRAIGHT, WEST + x, NORTH + y, reach)


# --- heights -----------------------------------------------------------------------------------------------------


def assert_plane(path: Path, rows: int, columns: int, cell: float = 1.0) -> None:
    model = read_elevation_model(path, EPSG)
    rng = np.random.default_rng(1)
    x = WEST + cell * rng.uniform(0.5, columns - 0.5, 5000)
    y = NORTH - cell * rng.uniform(0.5, rows - 0.5, 5000)
    assert np.abs(model.elevation(x, y) - plane(x, y)).max() < 1e-6


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("shape", [(2, 2), (3, 700), (256, 256), (257, 513)])
def test_plane_in_a_geotiff(tmp_path: Path, dtype: str, shape: tuple[int, int]) -> None:
    path = geotiff(tmp_path / "dem.tif", plane(*centres(*shape)).astype(dtype))
    assert_plane(path, *shape)


def test_plane_in_an_ascii_grid_with_and_without_prj(tmp_path: Path) -> None:
    path = ascii_grid(tmp_path / "dem.asc", plane(*centres(40, 30, 2.0)), cell=2.0)
    assert_plane(path, 40, 30, 2.0)
    path.with_suffix(".prj").write_text(CRS.from_epsg(EPSG).to_wkt(version="WKT1_ESRI"))
    assert_plane(path, 40, 30, 2.0)


@pytest.mark.parametrize("dtype", ["int16", "int32", "uint16"])
def test_whole_numbers(tmp_path: Path, dtype: str) -> None:
    east, north = centres(20, 30)
    path = geotiff(tmp_path / "dem.tif", (east - WEST + 3.0 * (north - NORTH) + 300.0).astype(dtype))
    x, y = np.array([WEST + 3.25]), np.array([NORTH - 7.125])
    # int() cut half metres off: 0.5 of the east, 1.5 of the north.
    expected = (3.25 - 0.5) + 3.0 * (-7.125 + 0.5) + 300.0 - 1.0
    assert read_elevation_model(path, EPSG).elevation(x, y) == pytest.approx(expected, abs=1e-9)


def test_scale_and_offset(tmp_path: Path) -> None:
    centimetres = np.round((plane(*centres(20, 30)) - 100.0) * 3200.0).astype(np.int32)
    path = geotiff(tmp_path / "dem.tif", centimetres, scales=1.0 / 3200.0, offsets=100.0)
    assert_plane(path, 20, 30)


@pytest.mark.parametrize("compress", ["lzw", "deflate", "zstd"])
def test_compressed_and_tiled(tmp_path: Path, compress: str) -> None:
    heights = plane(*centres(300, 400)).astype(np.float32)
    tiling = {"tiled": True, "blockxsize": 64, "blockysize": 64, "predictor": 3}
    assert_plane(geotiff(tmp_path / "dem.tif", heights, compress=compress, **tiling), 300, 400)


def test_rows_from_the_south_and_cells_that_are_not_square(tmp_path: Path) -> None:
    east, north = np.meshgrid(WEST + 2.0 * (np.arange(30) + 0.5), NORTH - 40.0 + 0.5 * (np.arange(80) + 0.5))
    transform = Affine(2.0, 0.0, WEST, 0.0, 0.5, NORTH - 40.0)
    path = geotiff(tmp_path / "dem.tif", plane(east, north).astype(np.float32), transform=transform)
    x, y = np.array([WEST + 1.0, WEST + 33.3, WEST + 59.0]), np.array([NORTH - 39.75, NORTH - 20.2, NORTH - 0.25])
    assert np.abs(read_elevation_model(path, EPSG).elevation(x, y) - plane(x, y)).max() < 1e-6


def test_no_height_outside(tmp_path: Path) -> None:
    model = read_elevation_model(plane_file(tmp_path / "dem.tif", 20, 30), EPSG)
    x = WEST + np.array([[0.49, 29.51, 5.0], [5.0, 5.0, np.nan]])
    y = NORTH - np.array([[5.0, 5.0, 0.49], [19.51, np.inf, 5.0]])
    assert model.elevation(x, y).shape == (2, 3)
    assert np.isnan(model.elevation(x, y)).all()
    assert model.elevation(WEST + 0.5, NORTH - 19.5) == pytest.approx(plane(WEST + 0.5, NORTH - 19.5))


def test_bilinear_between_four_cells(tmp_path: Path) -> None:
    model = read_elevation_model(geotiff(tmp_path / "dem.tif", np.array([[1.0, 2.0], [4.0, 16.0]])), EPSG)
    assert model.elevation(WEST + 0.75, NORTH - 1.0) == pytest.approx((0.75 * 1 + 0.25 * 2 + 0.75 * 4 + 0.25 * 16) / 2)


# --- the corridor ------------------------------------------------------------------------------------------------


def test_only_what_a_road_needs_is_read(tmp_path: Path) -> None:
    """A model of 400 km2 with cells of 1 m lies sparse on the disk; all of it would take 3 GB."""
    path, rows = tmp_path / "dem.tif", 20_000
    profile = {"width": rows, "height": rows, "count": 1, "dtype": "float32", "crs": "EPSG:25832", "nodata": -9999.0}
    transform = Affine(1.0, 0.0, WEST, 0.0, -1.0, NORTH)
    with rasterio.open(
        path, "w", driver="GTiff", transform=transform, tiled=True, sparse_ok=True, **profile
    ) as dataset:
        window = rasterio.windows.Window(10_000, 10_000, 300, 200)
        dataset.write(np.full((1, 200, 300), 7.0, dtype=np.float32), window=window)
    model = read_elevation_model(path, EPSG, corridor(20.0, 10_100.0, -10_100.0))
    assert model.elevation(WEST + 10_150.0, NORTH - 10_100.0) == 7.0
    assert model._tiles.nbytes < 10e6
    with pytest.raises(InputError, match=r"dem.tif: size: at most 134 million cells; a coarser model is needed"):
        read_elevation_model(path, EPSG)


@pytest.mark.parametrize("cell", [1.0, 5.0, 50.0])
def test_every_height_within_reach_has_its_cells(tmp_path: Path, cell: float) -> None:
    """`Corridor.points` looks at all cells that a height within the reach is interpolated from."""
    elements = [Element(120.0, 0.0, 1 / 300), Element(200.0, 1 / 300, 1 / 300), Element(150.0, 1 / 300, -1 / 280)]
    alignment = Alignment(elements, heading=0.7)
    side = int(1200 / cell)
    transform = Affine(cell, 0.0, WEST, 0.0, -cell, NORTH)
    heights = plane(*centres(side, side, cell))
    needed = Corridor(alignment, WEST + 400.3, NORTH - 700.7, 90.0)
    path = geotiff(tmp_path / "dem.tif", heights, transform=transform)
    grid = read_elevation_model(path, EPSG).grid
    seen = np.zeros((side, side), dtype=bool)
    for points in needed.points(cell):
        row, column = grid.first_of_four(grid.locate(*points))
        seen[row, column] = seen[row + 1, column] = seen[row, column + 1] = seen[row + 1, column + 1] = True
    assert not seen.all()
    assert (np.argwhere(seen) == _cells_needed(read_elevation_model(path, EPSG), needed).T).all()
    only_seen = geotiff(tmp_path / "seen.tif", np.where(seen, heights, np.nan), transform=transform)
    model = read_elevation_model(only_seen, EPSG, needed)
    rng = np.random.default_rng(2)
    station = rng.uniform(-90.0, alignment.length + 90.0, 200_000)
    offset = np.where(
        rng.random(200_000) < 0.5, np.sign(rng.uniform(-1, 1, 200_000)) * 90.0, rng.uniform(-90, 90, 200_000)
    )
    position, heading, _ = alignment.frame(station)
    x, y = (
        position
        + offset[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        + (WEST + 400.3, NORTH - 700.7)
    ).T
    assert np.abs(model.elevation(x, y) - plane(x, y)).max() < 1e-6


def test_too_small_tells_what_there_is_and_what_is_needed(tmp_path: Path) -> None:
    path = plane_file(tmp_path / "dem.tif")
    with pytest.raises(InputError) as caught:
        read_elevation_model(path, EPSG, corridor(20.0, 290.0, -50.0))
    assert str(caught.value) == (
        f"{path}: area: x 294000.5 to 294399.5 m, y 5628000.5 to 5628399.5 m are covered; "
        "the road needs x 294269.0 to 294411.0 m, y 5628329.0 to 5628371.0 m"
    )


# --- holes -------------------------------------------------------------------------------------------------------


def with_hole(path: Path, rows: slice, columns: slice, nodata: float = -9999.0) -> Path:
    heights = plane(*centres(400, 300)).astype(np.float32)
    heights[rows, columns] = nodata
    return geotiff(path, heights, nodata=nodata)


@pytest.mark.parametrize("nodata", [-9999.0, float("nan"), -3.4e38])
def test_small_holes_are_filled_from_around_them(tmp_path: Path, nodata: float) -> None:
    path = with_hole(tmp_path / "dem.tif", slice(195, 205), slice(140, 148), nodata)
    x, y = np.array([WEST + 144.2]), np.array([NORTH - 200.3])
    assert np.abs(read_elevation_model(path, EPSG, corridor(35.0)).elevation(x, y) - plane(x, y)) < 1e-4
    assert np.isnan(read_elevation_model(path, EPSG).elevation(x, y)).all()


def test_a_hole_at_the_edge_of_the_corridor_is_filled_from_inside(tmp_path: Path) -> None:
    path = with_hole(tmp_path / "dem.tif", slice(0, 182), slice(110, 125))
    heights = read_elevation_model(path, EPSG, corridor(20.0)).elevation(WEST + np.arange(90.0, 190.0), NORTH - 181.0)
    assert np.abs(heights - plane(WEST + np.arange(90.0, 190.0), NORTH - 181.0)).max() < 1.0


def test_a_hole_at_the_edge_of_the_raster_is_filled_from_inside(tmp_path: Path) -> None:
    east, north = (part[178:222, 78:222] for part in centres(400, 300))
    heights = plane(east, north).astype(np.float32)
    heights[20:23, -2:] = -9999.0
    transform = Affine(1.0, 0.0, WEST + 78.0, 0.0, -1.0, NORTH - 178.0)
    model = read_elevation_model(
        geotiff(tmp_path / "dem.tif", heights, nodata=-9999.0, transform=transform), EPSG, corridor()
    )
    x, y = np.array([WEST + 221.5]), np.array([NORTH - 199.5])
    assert np.abs(model.elevation(x, y) - plane(x, y)) < 0.1


def test_a_hole_across_two_tiles_is_filled(tmp_path: Path) -> None:
    path = with_hole(tmp_path / "dem.tif", slice(251, 261), slice(251, 261))
    needed = corridor(35.0, 140.0, -256.0)
    x, y = np.array([WEST + 256.0]), np.array([NORTH - 256.0])
    assert np.abs(read_elevation_model(path, EPSG, needed).elevation(x, y) - plane(x, y)) < 1e-4


def test_holes_elsewhere_do_not_matter(tmp_path: Path) -> None:
    path = with_hole(tmp_path / "dem.tif", slice(0, 150), slice(None))
    assert np.isfinite(read_elevation_model(path, EPSG, corridor()).elevation(WEST + 150.0, NORTH - 200.0))


@pytest.mark.parametrize(("side", "east", "north"), [(11, 294145.5, 5628199.5), (12, 294145.5, 5628198.5)])
def test_a_large_hole_is_refused_with_its_place(tmp_path: Path, side: int, east: float, north: float) -> None:
    path = with_hole(tmp_path / "dem.tif", slice(195, 195 + side), slice(140, 140 + side))
    with pytest.raises(InputError) as caught:
        read_elevation_model(path, EPSG, corridor(90.0))
    assert str(caught.value) == (
        f"{path}: height at x {east} m, y {north} m: no height, and the hole there is too large; "
        "holes of up to 1 % of the cells and 10 cells across are filled"
    )


def test_many_small_holes_are_refused(tmp_path: Path) -> None:
    heights = plane(*centres(400, 300)).astype(np.float32)
    heights[::7, ::7] = -9999.0
    path = geotiff(tmp_path / "dem.tif", heights, nodata=-9999.0)
    with pytest.raises(
        InputError, match=r"height at x \d+\.5 m, y \d+\.5 m: no height, and 1\.\d+ % of the cells beneath"
    ):
        read_elevation_model(path, EPSG, corridor())


def test_no_height_at_all_is_refused(tmp_path: Path) -> None:
    path = with_hole(tmp_path / "dem.tif", slice(None), slice(None))
    with pytest.raises(InputError, match="no height, and 100 % of the cells"):
        read_elevation_model(path, EPSG, corridor())
    assert np.isnan(read_elevation_model(path, EPSG).elevation(WEST + 9.0, NORTH - 9.0))


@pytest.mark.parametrize(
    ("height", "shown"), [(-9999.0, "-9999.0"), (1e30, r"1\.\d+e\+30"), (np.inf, "inf"), (-np.inf, "-inf")]
)
@pytest.mark.parametrize("whole", [False, True])
def test_absurd_heights_are_refused_with_their_place(tmp_path: Path, height: float, shown: str, whole: bool) -> None:
    heights = plane(*centres(400, 300)).astype(np.float32)
    heights[300, 260] = height
    path = geotiff(tmp_path / "dem.tif", heights)
    expected = rf"height at x 294260\.5 m, y 5628099\.5 m is {shown}: must be from -500 to 9000 m; is it a nodata value"
    with pytest.raises(InputError, match=expected):
        read_elevation_model(path, EPSG, None if whole else corridor(20.0, 150.0, -300.0))


def test_absurd_heights_elsewhere_do_not_matter(tmp_path: Path) -> None:
    heights = plane(*centres(400, 300)).astype(np.float32)
    heights[10, 10] = -9999.0
    path = geotiff(tmp_path / "dem.tif", heights)
    assert np.isfinite(read_elevation_model(path, EPSG, corridor()).elevation(WEST + 150.0, NORTH - 200.0))


# --- faults of the file ------------------------------------------------------------------------------------------


def heights() -> np.ndarray:
    return plane(*centres(20, 30)).astype(np.float32)


TURNED = Affine(0.8, 0.6, WEST, 0.6, -0.8, NORTH)
FEET_VERTICAL = "EPSG:25832+6360"  # NAVD88 height, US survey feet
LOCAL = 'LOCAL_CS["site grid",UNIT["metre",1]]'

FAULTS = {
    "bands": ({"heights": np.zeros((3, 20, 30), dtype=np.float32)}, "bands is 3: exactly one is needed, of heights"),
    "complex": (
        {"heights": np.zeros((20, 30), dtype=np.complex64)},
        "type of number is 'complex64': integers or floats",
    ),
    "feet": ({"units": "ft"}, "unit of heights is 'ft': metres are needed"),
    "vertical system in feet": ({"crs": FEET_VERTICAL}, "unit of heights is 'US survey foot': metres are needed"),
    "other zone": ({"crs": "EPSG:25833"}, r"coordinate system is 'EPSG:25833': EPSG:25832 is needed, the road's own"),
    "degrees": ({"crs": "EPSG:4326"}, r"coordinate system is 'EPSG:4326': EPSG:25832 is needed"),
    "local system": ({"crs": LOCAL}, "coordinate system is 'site grid': EPSG:25832 is needed"),
    "no system": ({"crs": None}, "coordinate system: the file names none; EPSG:25832 is needed"),
    "rotated": ({"transform": TURNED}, r"rotation is \(0.6, 0.6\): rows must run along the east axis"),
    "no place": ({"transform": Affine.identity()}, "georeference: the file has none"),
    "one row": (
        {"heights": np.zeros((1, 30), dtype=np.float32)},
        r"size is \(30, 1\): at least 2 by 2 cells are needed",
    ),
    "scale 0": ({"scales": 0.0}, r"scale and offset is \(0.0, 0.0\): finite numbers are needed, the scale not 0"),
    "offset nan": ({"offsets": float("nan")}, r"scale and offset is \(1.0, nan\): finite numbers are needed"),
}


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_named(tmp_path: Path, fault: str) -> None:
    changes, message = FAULTS[fault]
    path = geotiff(tmp_path / "dem.tif", **({"heights": heights()} | changes))
    with pytest.raises(InputError, match=f"dem.tif: {message}"):
        read_elevation_model(path, EPSG)


@pytest.mark.parametrize("crs", ["EPSG:25832+7837", "EPSG:5555"])
def test_a_vertical_system_beside_it_is_fine(tmp_path: Path, crs: str) -> None:
    path = geotiff(tmp_path / "dem.tif", heights(), crs=crs)
    assert_plane(path, 20, 30)
    assert np.isfinite(read_elevation_model(path, 5555).elevation(WEST + 5.0, NORTH - 5.0))


def test_coordinates_in_feet_are_refused(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "dem.tif", heights(), crs="EPSG:2272")
    with pytest.raises(InputError, match="unit of coordinates is 'US survey foot': metres are needed"):
        read_elevation_model(path, 2272)


def test_unknown_code_of_the_road_is_named(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "dem.tif", heights())
    with pytest.raises(InputError, match=r"road\.epsg is 99999: must be the EPSG code of a coordinate system"):
        read_elevation_model(path, 99999)


def test_ascii_grid_of_another_system_is_refused(tmp_path: Path) -> None:
    path = ascii_grid(tmp_path / "dem.asc", heights())
    path.with_suffix(".prj").write_text(CRS.from_epsg(31466).to_wkt(version="WKT1_ESRI"))
    with pytest.raises(InputError, match="coordinate system is 'EPSG:31466': EPSG:25832 is needed"):
        read_elevation_model(path, EPSG)


def test_ascii_grid_with_heights_in_feet_is_refused(tmp_path: Path) -> None:
    path = ascii_grid(tmp_path / "dem.asc", heights())
    path.with_suffix(".prj").write_text(CRS.from_user_input(FEET_VERTICAL).to_wkt(version="WKT1_ESRI"))
    with pytest.raises(InputError, match="unit of heights is 'US survey foot': metres are needed"):
        read_elevation_model(path, EPSG)


def test_prj_that_is_not_understood_is_refused(tmp_path: Path) -> None:
    path = ascii_grid(tmp_path / "dem.asc", heights())
    path.with_suffix(".prj").write_text("hello")
    with pytest.raises(InputError, match=r"coordinate system: dem\.prj isn't understood; EPSG:25832 is needed"):
        read_elevation_model(path, EPSG)


@pytest.mark.parametrize("name", ["missing.tif", "."])
def test_missing_file(tmp_path: Path, name: str) -> None:
    with pytest.raises(MissingFileError, match="an elevation model is needed here"):
        read_elevation_model(tmp_path / name, EPSG)


@pytest.mark.parametrize("content", [b"", b"hello", b"II*\0" + bytes(60), b"ncols 3\nnrows"])
@pytest.mark.parametrize("suffix", [".tif", ".asc"])
def test_no_raster(tmp_path: Path, content: bytes, suffix: str) -> None:
    path = tmp_path / f"dem{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match="must be a GeoTIFF or ESRI ASCII grid, and complete"):
        read_elevation_model(path, EPSG)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_another_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "dem.tif"
    with rasterio.open(path, "w", driver="PNG", width=30, height=20, count=1, dtype="uint8") as dataset:
        dataset.write(np.zeros((1, 20, 30), dtype=np.uint8))
    with pytest.raises(InputError, match="must be a GeoTIFF or ESRI ASCII grid"):
        read_elevation_model(path, EPSG)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("make", [geotiff, ascii_grid])
def test_truncated(tmp_path: Path, share: float, make) -> None:
    path = make(tmp_path / f"dem{'.tif' if make is geotiff else '.asc'}", plane(*centres(100, 80)).astype(np.float32))
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match="must be a GeoTIFF or ESRI ASCII grid, and complete"):
        read_elevation_model(path, EPSG)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_no_permission(tmp_path: Path) -> None:
    path = plane_file(tmp_path / "dem.tif", 20, 30)
    path.chmod(0)
    with pytest.raises(MissingFileError, match=r"an elevation model is needed here \(Permission denied\)"):
        read_elevation_model(path, EPSG)


def test_without_rasterio_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = plane_file(tmp_path / "dem.tif", 20, 30)
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(InputError, match="an elevation model needs rasterio: SynthRoads brings it"):
        read_elevation_model(path, EPSG)


def test_rasterio_is_loaded_for_elevation_models_alone() -> None:
    code = "import sys, synthroads_addon.road.terrain; sys.exit('rasterio' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2], check=False).returncode == 0


# --- roads on it -------------------------------------------------------------------------------------------------


def road(path: Path | None, embankment: float = 2.5, half_width: float = 60.0) -> RoadParameters:
    curve = HorizontalElement.between(150.0, 0.0, 1.0 / 900.0)
    axis = AlignmentObject(
        instance=1,
        start_x=-50.0,
        start_y=20.0,
        start_heading_deg=-30.0,
        horizontal=(curve,),
        vertical=(VerticalPoint(station=0.0, elevation=1.0), VerticalPoint(station=150.0, elevation=4.0)),
    )
    terrain = Terrain(
        instance=2,
        half_width=half_width,
        embankment_height=embankment,
        undulation=0.5,
        wavelength=40.0,
        seed=1,
        elevation_model=None if path is None else str(path),
    )
    carriageway = Carriageway(
        instance=3,
        side="right",
        inner_offset=2.0,
        hard_shoulder_width=3.0,
        outer_edge_strip_width=0.75,
        lanes=({"width": 3.75},),
        inner_edge_strip_width=0.75,
        verge_width=1.5,
        crossfall=({"station": 0.0, "crossfall_percent": 2.5},),
    )
    return RoadParameters(
        metadata=Metadata(
            identifier="a", generator="b", referenceSystem="https://www.opengis.net/def/crs/EPSG/0/25832"
        ),
        transform=Transform(translate=(*ORIGIN, 177.0)),
        design_class="EKA1A",
        objects={"axis": axis, "terrain": terrain, "road": carriageway},
    )


def test_ground_is_the_elevation_model(tmp_path: Path) -> None:
    parameters = road(plane_file(tmp_path / "dem.tif"))
    geometry, terrain = RoadGeometry(parameters), parameters.terrain
    rng = np.random.default_rng(3)
    station, offset = rng.uniform(-12.0, 162.0, 1000), rng.uniform(-72.0, 72.0, 1000)
    position, heading, _ = geometry.alignment.frame(station)
    x, y = (position + offset[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=-1)).T
    expected = plane(x + ORIGIN[0], y + ORIGIN[1]) - 177.0
    assert np.abs(ground_elevation(geometry, terrain, station, offset) - expected).max() < 1e-6


def test_generated_ground_does_not_need_one() -> None:
    parameters = road(None)
    geometry = RoadGeometry(parameters)
    station = np.linspace(0.0, 150.0, 5000)
    ground = ground_elevation(geometry, parameters.terrain, station, np.full(5000, 30.0))
    below = geometry.profile.elevation(station) - ground
    assert 0.0 < np.std(below) < 1.5
    assert abs(np.mean(below) - 2.5) < 1.5


def test_road_is_put_at_its_mean_height_above_the_ground(tmp_path: Path) -> None:
    path = plane_file(tmp_path / "dem.tif")
    parameters = road(path, embankment=-1.75)
    scenario = RoadScenario(map_origin=(*ORIGIN, 0.0))
    origin = origin_on_ground(scenario, parameters.alignment, parameters.terrain)
    assert origin[:2] == scenario.map_origin[:2]
    assert origin[2] == round(origin[2], 9)
    moved = RoadParameters.from_dict(parameters.to_dict() | {"transform": {"translate": list(origin)}})
    geometry = RoadGeometry(moved)
    station = (np.arange(3000) + 0.5) / 20.0
    above = geometry.profile.elevation(station) - ground_elevation(geometry, moved.terrain, station, np.zeros(3000))
    assert abs(np.mean(above) + 1.75) < 1e-4
    model = read_elevation_model(path, EPSG)
    assert fit_to_ground(parameters.alignment, origin[:2], model, -1.75) == pytest.approx(origin)


def test_without_elevation_model_the_origin_is_the_scenarios() -> None:
    parameters = road(None)
    assert origin_on_ground(RoadScenario(), parameters.alignment, parameters.terrain) == RoadScenario().map_origin


def test_a_changed_file_is_read_anew(tmp_path: Path) -> None:
    path = plane_file(tmp_path / "dem.tif")
    parameters = road(path)
    geometry, here = RoadGeometry(parameters), (np.array([75.0]), np.array([3.0]))
    before = ground_elevation(geometry, parameters.terrain, *here)
    geotiff(path, plane(*centres(400, 400)).astype(np.float32) + 8.0)
    os.utime(path, ns=(1, 1))
    assert ground_elevation(geometry, parameters.terrain, *here) == pytest.approx(before + 8.0)
    path.unlink()
    with pytest.raises(MissingFileError, match="an elevation model is needed here"):
        ground_elevation(geometry, parameters.terrain, *here)


def test_a_road_that_leaves_the_elevation_model_is_refused(tmp_path: Path) -> None:
    parameters = road(plane_file(tmp_path / "dem.tif"), half_width=75.0)
    with pytest.raises(InputError, match=r"dem.tif: area: x .* are covered; the road needs x "):
        ground_elevation(RoadGeometry(parameters), parameters.terrain, np.zeros(1), np.zeros(1))
