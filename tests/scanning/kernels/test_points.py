"""Compiled loops over points: byte for byte those of NumPy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.arithmetic.loops import loops_by, point_loops
from synthroads_addon.base.errors import OutputError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.cloud.formats.las import LasWriter
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.materials.table import materials
from synthroads_addon.road.alignment import Alignment, Element
from synthroads_addon.scanning.colour.colour import (
    FROM_NODES,
    MaterialLayers,
    SeenPoints,
    encode_srgb,
    surface_constants,
)
from synthroads_addon.scanning.colour.reflection import reflected_sunlight
from synthroads_addon.scanning.colour.surfaces import SceneSurfaces
from synthroads_addon.scanning.kernels.points import CompiledPoints
from synthroads_addon.scanning.relief.micro_relief import BeamEnds, micro_relief, shift_by_relief
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.surface_values import (
    MeshValues,
    PartValues,
    SurfaceInput,
    SurfaceValues,
    corner_shares,
)
from tests.helpers.clouds.random_points import make_points

pytestmark = pytest.mark.any_blender

NAMES = ("asphalt", "paint_white", "verge", "car_paint", "galvanised_steel")
COUNTS = [0, 1, 3, 5000]


@pytest.fixture
def kernel(loops: CompiledPoints) -> CompiledPoints:
    """Return the loops, both versions."""
    return loops


def same(mine: object, theirs: object) -> None:
    assert isinstance(mine, np.ndarray)
    assert isinstance(theirs, np.ndarray)
    assert (mine.dtype, mine.shape) == (theirs.dtype, theirs.shape)
    np.testing.assert_array_equal(mine, theirs)
    assert mine[~np.isnan(mine)].tobytes() == theirs[~np.isnan(theirs)].tobytes()


def unit(random: np.random.Generator, count: int) -> np.ndarray:
    vectors = random.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def seen_points(count: int) -> SeenPoints:
    random = stream(count, "seen")
    place, material = random.normal(0, 50, (count, 3)), random.integers(0, len(NAMES), count).astype(np.uint16)
    scanner = place + random.uniform(1, 90, (count, 1)) * unit(random, count)
    scanner[:1] = place[:1]  # no direction at all
    return SeenPoints(place, scanner, unit(random, count), material, random.uniform(0, 9, count))


@pytest.mark.parametrize("count", COUNTS)
def test_directions_to_the_scanner(kernel: CompiledPoints, count: int) -> None:
    expected = seen_points(count).towards_scanner
    with loops_by(kernel):
        same(seen_points(count).towards_scanner, expected)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_directions_that_are_none(kernel: CompiledPoints) -> None:
    odd = np.array([[np.nan, 0.0, 1.0], [np.inf, 0.0, 0.0], [1e30, 1e30, 1e30], [1e-30, 0.0, 0.0], [-0.0, 0.0, 0.0]])
    points = replace(seen_points(len(odd)), scanner=odd, position=np.zeros_like(odd))
    expected = replace(points).towards_scanner
    with loops_by(kernel):
        same(replace(points).towards_scanner, expected)


@pytest.mark.parametrize("count", COUNTS)
def test_reflected_sunlight(kernel: CompiledPoints, count: int) -> None:
    random, sun = stream(count, "light"), np.array([0.35, -0.45, 0.82])
    layers = [random.uniform(0, 1, (count, 3)), *random.uniform(0, 1, (3, count))]
    color, roughness, metallic, specular = (np.asarray(one, np.float32) for one in layers)
    for chosen in (roughness, metallic, specular, color):
        chosen[: count // 8], chosen[count // 8 : count // 4] = 0.0, 1.0
    metallic[::2] = 0.0
    normal, view = (unit(random, count).astype(np.float32) for _ in range(2))
    view[count // 2 :] = normal[count // 2 :]  # seen at a right angle
    surfaces = (color, roughness, metallic, specular, normal, view, sun / np.linalg.norm(sun))
    expected = reflected_sunlight(*surfaces)
    with loops_by(kernel):
        same(reflected_sunlight(*surfaces), expected)


def test_what_reflects_no_number_is_refused_by_both(kernel: CompiledPoints) -> None:
    one, up, sun = np.full(3, 0.5, np.float32), np.tile(np.float32([0, 0, 1]), (3, 1)), np.array([0.0, 0.6, 0.8])
    rough = np.array([0.5, np.nan, 0.5], np.float32)
    for loops in (None, kernel):
        with loops_by(loops), pytest.raises(IndexError), np.errstate(invalid="ignore"):
            reflected_sunlight(np.ones((3, 3), np.float32), rough, one, one, up, up, sun)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("channels", [(), ("base_color", "roughness", "sun")])
def test_colours_and_layers(kernel: CompiledPoints, count: int, channels: tuple[str, ...]) -> None:
    random, points = stream(count, "layers"), seen_points(count)
    varies = {"base_color": [1, 0, 1, 0, 0], "roughness": [0, 1, 1, 0, 0], "metallic": [0] * 5, "specular": [0] * 5}
    constants = surface_constants(
        [materials()[name] for name in NAMES], {name: np.array(flags, bool) for name, flags in varies.items()}
    )
    widths = {"base_color": 3, "roughness": 1, "sun": 3}
    given = {name: random.uniform(-0.1, 1.4, (count, widths[name])).astype(np.float32) for name in channels}
    wanted = frozenset({"rgb", "base_color", "roughness", "metallic"})
    results = []
    for loops in (None, kernel):
        with loops_by(loops):
            source = np.full(count, FROM_NODES, np.uint8)
            results.append(MaterialLayers(constants).layer_values(points, given, source, wanted).arrays)
    assert results[0].keys() == results[1].keys() == wanted
    for name in wanted:
        same(results[1][name], results[0][name])


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_every_colour_as_srgb(kernel: CompiledPoints) -> None:
    random = stream(1, "srgb")
    steps = np.array([0.0, 1.0, 0.0031308, np.nextafter(np.float32(0.0031308), 1), -1.0, 2.0, np.nan, np.inf, -0.0])
    linear = np.concatenate([steps, random.uniform(0, 1, 90_000 - len(steps))]).astype(np.float32).reshape(-1, 3)
    expected = encode_srgb(linear)
    with loops_by(kernel):
        same(encode_srgb(linear), expected)


def soup(faces: int) -> SceneMesh:
    """Return triangles here and there, some of them without area or with one corner twice."""
    random = stream(faces, "soup")
    vertices = random.normal(0, 20, (3 * faces, 3)).astype(np.float32)
    triangles = random.integers(0, len(vertices), (faces, 3)).astype(np.int32)
    triangles[1], vertices[triangles[2, 2]] = triangles[1, 0], vertices[triangles[2, 0]]
    kinds = (np.uint8, np.uint32, np.uint16)
    return SceneMesh(vertices, triangles, *(np.zeros(faces, kind) for kind in kinds), ("",), np.zeros(3))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("count", COUNTS)
def test_values_between_the_corners_of_triangles(kernel: CompiledPoints, count: int) -> None:
    mesh, random = soup(90), stream(count, "places")
    inputs = [SurfaceInput("attribute", "one"), SurfaceInput("uv", "two"), SurfaceInput("attribute", "three")]
    domains, sizes = ("point", "corner", "face"), (60, 40, 20)
    values = {
        what: MeshValues(random.normal(0, 9, (size, 4)).astype(np.float32), domain)
        for what, domain, size in zip(inputs, domains, sizes, strict=True)
    }
    corners, points = (random.integers(0, size, (20, 3)).astype(np.int32) for size in (40, 60))
    # Three places, one of them mirrored, and faces beyond that have no values.
    part = PartValues(10, corners, points, 3, np.array([False, True, False]), None, values)
    mesh = replace(mesh, surface=SurfaceValues((part,)))
    face = random.integers(0, len(mesh), count)
    face[:3] = (1, 2, 12)[:count]
    share = random.dirichlet((1.0, 1.0, 1.0), count)
    place = np.einsum("nc,nck->nk", share, mesh.vertices[mesh.triangles[face]].astype(np.float64))
    place += random.normal(0, 0.2, place.shape)
    place[3:4] = np.nan
    place[4:5], place[5:6] = [np.inf, 0.0, 0.0], [1e200, -1e200, 0.0]
    found = []
    for loops in (None, kernel):
        with loops_by(loops):
            found.append(SceneSurfaces(mesh).read_places(inputs, face, place))
    shares = corner_shares(mesh.vertices[mesh.triangles[face]].astype(np.float64), place)
    same(kernel.corner_shares(mesh.vertices, mesh.triangles, face, place), shares)
    for what in inputs:
        same(found[1][what], found[0][what])
        assert count < 100 or found[0][what].any()


def rough_points(count: int) -> tuple[PointBlock, BeamEnds, np.ndarray]:
    random, seen = stream(count, "rough"), seen_points(count)
    cosine = np.abs(np.einsum("ij,ij->i", seen.normal, seen.towards_scanner))
    cosine[:2] = (0.0, 1.0)[:count]
    points = replace(
        make_points(count),
        xyz=seen.position + [3e5, 5e6, 100.0],
        normal=seen.normal.astype(np.float32),
        material=np.where(random.uniform(size=count) < 0.05, 65535, seen.material).astype(np.uint16),
        range=random.uniform(2, 90, count),
        incidence_deg=np.degrees(np.arccos(np.clip(cosine, 0, 1))).astype(np.float32),
        true_xyz=seen.position,
        true_range=random.uniform(2, 90, count),
    )
    raised = np.where(random.uniform(size=count) < 0.5, 0.0, random.normal(0, 0.02, count))
    return points, BeamEnds(seen.position, seen.towards_scanner, 0.0005), raised


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("pavement", [False, True])
def test_points_on_relief(kernel: CompiledPoints, count: int, pavement: bool) -> None:
    points, ends, raised = rough_points(count)
    relief = micro_relief(NAMES, [materials()[name] for name in NAMES])
    shifted = []
    for loops in (None, kernel):
        with loops_by(loops):
            how = (relief, 1.5, 3, 4, raised if pavement else None)
            shifted.append(shift_by_relief(points, ends, *how).attributes())
    for name, values in shifted[0].items():
        same(shifted[1][name], values)
    assert count < 100 or (shifted[0]["xyz"] != points.xyz).any()


@pytest.mark.parametrize("count", COUNTS)
def test_stations_of_an_alignment(kernel: CompiledPoints, count: int) -> None:
    elements = [Element(120.0, 0.0, 0.0), Element(80.0, 0.0, 0.004), Element(300.0, 0.004, 0.004)]
    axis, random = Alignment(elements, 5e5, 5e6, 0.3), stream(count, "stations")
    station = np.sort(random.uniform(-30.0, 530.0, count))
    station[: count // 5] = random.choice([0.0, 120.0, 200.0, 500.0, np.nextafter(120.0, 0.0)], count // 5)
    beside = random.uniform(-20, 20, count)
    guess, far = station + random.uniform(-9, 9, count), random.normal(0, 400, (count, 2)) + [5e5, 5e6]
    found = []
    for loops in (None, kernel):
        with loops_by(loops):
            places = axis.place(station, beside)
            near = (axis.project_near(places, guess, reach) for reach in (0.5, 8.0))
            found.append([axis.frame(station), axis.project(places), axis.project(far), *near])
    for theirs, mine in zip(*found, strict=True):
        for one, other in zip(mine, theirs, strict=True):
            same(one, other)


def stored_points(count: int, seed: int = 1) -> PointBlock:
    random = stream(seed, "stored")
    points = replace(
        make_points(count),
        xyz=random.uniform(-900, 900, (count, 3)) + [3e5, 5e6, 100.0],
        intensity=random.uniform(0, 1, count) ** 3,
        rgb=random.integers(0, 65536, (count, 3)).astype(np.uint16),
        gps_time=random.normal(0, 1e6, count),
        scan_angle_deg=random.uniform(-180, 180, count).astype(np.float32),
        return_number=random.integers(0, 16, count).astype(np.uint8),
        number_of_returns=random.integers(0, 16, count).astype(np.uint8),
        strip=random.integers(0, 65536, count).astype(np.uint16),
    )
    # Halves go to even steps.
    points.xyz[: count // 3] = np.floor(points.xyz[: count // 3]) + 0.0005
    points.intensity[: count // 3] = (np.arange(count // 3) + 0.5) / 65535.0
    return points


def written(folder: Path, points: PointBlock, loops: CompiledPoints | None) -> tuple[bytes, int]:
    """Return the file of points, and how many intensities were cut."""
    path = folder / "cloud.las"
    with loops_by(loops), LasWriter(path, 25832, np.array([3e5, 5e6, 0.0]), 65535.0) as writer:
        writer.write(points)
    return path.read_bytes(), writer.clipped


@pytest.mark.parametrize("count", [1, 3, 40_000])
def test_las_records(kernel: CompiledPoints, count: int, tmp_path: Path) -> None:
    points = stored_points(count)
    assert written(tmp_path, points, kernel) == written(tmp_path, points, None)
    flagged = points.with_arrays({"withheld": np.ones(count, np.uint8), "user_data": np.full(count, 7, np.uint8)})
    assert written(tmp_path, flagged, kernel) == written(tmp_path, flagged, None)


def test_las_records_whose_values_are_cut_or_refused(kernel: CompiledPoints, tmp_path: Path) -> None:
    points = stored_points(900)
    points.intensity[[5, 700]] = 1.5
    found = written(tmp_path, points, kernel)
    assert found == written(tmp_path, points, None)
    assert found[1] == 2
    faults = {
        "xyz": (np.nan, np.inf, 1e9),
        "intensity": (np.nan, -1.0),
        "gps_time": (np.nan, -np.inf),
        "scan_angle_deg": (np.nan, 181.0),
        "return_number": (16,),
        "number_of_returns": (200,),
    }
    for name, values in faults.items():
        for value in values:
            told = []
            for loops in (None, kernel):
                broken = stored_points(900)
                getattr(broken, name)[17] = value
                with pytest.raises(OutputError) as refused:
                    written(tmp_path, broken, loops)
                told.append(str(refused.value))
            assert told[0] == told[1]


@pytest.mark.parametrize("count", COUNTS)
def test_vectors_that_materials_ask_for(kernel: CompiledPoints, count: int) -> None:
    random = stream(count, "inputs")
    rows, source = random.permutation(count)[: count // 2], random.normal(0, 9, (count, 3))
    shift = np.array([3e5, -7.0, 1.0])
    expected = np.zeros((2, len(rows), 4), np.float32)
    expected[0, :, :3], expected[1, :, :3] = source[rows], (source[rows] + shift) / 0.3048
    same(kernel.inputs(rows, source, None, 0.3048), expected[0])
    same(kernel.inputs(rows, source, shift, 0.3048), expected[1])


@pytest.mark.parametrize("scaled", [False, True])
def test_rows_that_are_spread(kernel: CompiledPoints, scaled: bool) -> None:
    random = stream(1, "spread")
    rows, values = random.permutation(900)[:400], random.normal(size=(400, 3)).astype(np.float32)
    scale, found, expected = np.float32([0.3, 1.7, 9.0]), *np.zeros((2, 900, 3), np.float32)
    kernel.spread(rows, values, found, scale if scaled else None)
    expected[rows] = values * scale if scaled else values
    same(found, expected)


def test_arrays_that_do_not_match_are_refused(kernel: CompiledPoints) -> None:
    rows, values = np.array([0, 5]), np.zeros((2, 3), np.float32)
    with pytest.raises(IndexError, match="rows 0 to 5 of 4"):
        kernel.spread(rows, values, np.zeros((4, 3), np.float32))
    with pytest.raises(IndexError, match="rows 0 to 5 of 4"):
        kernel.inputs(rows, np.zeros((4, 3)), None, 1.0)
    with pytest.raises(ValueError, match=r"result float64 \(9, 3\): must be float32 \(9, 3\)"):
        kernel.spread(rows, values, np.zeros((9, 3)))
    with pytest.raises(ValueError, match=r"seen_from \(4, 3\): must be \(5, 3\)"):
        kernel.towards(np.zeros((5, 3)), np.zeros((4, 3)))
    mesh = soup(9)
    with pytest.raises(IndexError, match="faces 0 to 9 of 9"):
        kernel.corner_shares(mesh.vertices, mesh.triangles, np.array([0, 9]), np.zeros((2, 3)))
    material, means = np.zeros(3, np.uint16), np.zeros((2, 3), np.float32)
    assert kernel.layer(np.array([0, 3]), None, material, np.zeros(2, bool), means) is None
    assert kernel.layer(None, None, material + np.uint16(2), np.zeros(2, bool), means) is None
    assert kernel.layer(np.array([2]), None, material, np.zeros(2, bool), means) is not None


def test_loops_are_in_use_where_a_scan_says_so(kernel: CompiledPoints) -> None:
    assert point_loops() is None
    with loops_by(None):
        assert point_loops() is None
        with loops_by(kernel):
            assert point_loops() is kernel
    assert point_loops() is None
