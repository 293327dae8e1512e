"""Valid LAS files with odd content, as real data have it: strays, single points, times that are no numbers."""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from headless.commands import command
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from tests.helpers.clouds.random_points import make_points
from tests.helpers.process_memory import STATUS, memory_mb, reset_peak

COUNT = 6000
GIGABYTES = 4


def strip() -> np.ndarray:
    """Return places (N, 3) on 60 m of a flat strip."""
    rng = np.random.default_rng(1)
    return rng.uniform((0.0, -8.0, 0.0), (60.0, 8.0, 0.02), (COUNT, 3))


def write(path: Path, xyz: np.ndarray, scale: float = 0.001, offset: float = 0.0, **fields: Any) -> Path:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, scale), np.full(3, offset)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.intensity = np.random.default_rng(2).integers(0, 60_000, len(xyz))
    for name, value in fields.items():
        setattr(las, name, np.full(len(xyz), value))
    las.write(path)
    return path


def with_strays(*strays: tuple[float, float, float]) -> np.ndarray:
    return np.concatenate([strip(), np.array(strays)])


ODD: dict[str, Callable[[Path], Path]] = {
    "a stray": lambda path: write(path, with_strays((1e6, 0.0, 0.0))),
    "two strays apart": lambda path: write(path, with_strays((2e7, -2e7, 0.0), (-2e7, 0.0, 0.0)), scale=0.01),
    "a stray above": lambda path: write(path, with_strays((30.0, 0.0, 1e6))),
    "a stray below": lambda path: write(path, with_strays((30.0, 0.0, -1e6))),
    "a stray on no map": lambda path: write(path, with_strays((2e9, 0.0, 0.0)), scale=1.0),
    "ground and a stray": lambda path: write(path, with_strays((1e6, 0.0, 0.0)), classification=2),
    "scattered": lambda path: write(path, np.random.default_rng(3).uniform(-1e6, 1e6, (3000, 3))),
    "one point": lambda path: write(path, strip()[:1]),
    "two points far apart": lambda path: write(path, np.array([[0.0, 0.0, 0.0], [1e6, 1e6, 0.0]])),
    "one place": lambda path: write(path, np.repeat(strip()[:1], 500, axis=0)),
    "a line": lambda path: write(path, np.linspace((0.0, 0.0, 0.0), (100.0, 0.0, 0.0), 5000)),
    "a plumb line": lambda path: write(path, np.linspace((0.0, 0.0, 0.0), (0.0, 0.0, 100.0), 5000)),
    "no points": lambda path: write(path, strip()[:0]),
    "no intensity": lambda path: write(path, strip(), intensity=0),
    "times that are no numbers": lambda path: write(path, strip(), gps_time=np.nan),
    "endless times": lambda path: write(path, strip(), gps_time=np.inf),
    "kilometres": lambda path: write(path, 1e6 * strip(), scale=1e3),
    "nanometres": lambda path: write(path, 1e-6 * strip(), scale=1e-9),
    "an offset on no map": lambda path: write(path, strip() + 1e9, offset=1e9),
    "a far offset": lambda path: write(path, strip() + 5e7, offset=5e7),
    "scan angles beyond 180 degrees": lambda path: write(path, strip(), scan_angle=30_001),
    "returns of none": lambda path: write(path, strip(), return_number=15, number_of_returns=0),
}


QUICK = ("a stray below", "ground and a stray", "two points far apart")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in ODD])
def test_each_command_works_or_says_in_a_line_what_is_wrong(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud, plain = ODD[name](tmp_path / "cloud.las"), write(tmp_path / "plain.las", strip())
    commands: list[list[str | Path]] = [
        ["cloud", "info", cloud],
        ["cloud", "subsample", cloud, "--grid", "0.1", "--output", tmp_path / "thin.laz"],
        ["cloud", "convert", cloud, "--output", tmp_path / "other.ply"],
        ["cloud", "convert", cloud, "--output", tmp_path / "other.laz"],
        ["cloud", "map-intensity", cloud, "--target", plain, "--output", tmp_path / "mapped.laz"],
        ["cloud", "preview", cloud, "--output", tmp_path / "pictures"],
    ]
    if sys.platform != "win32":
        pytest.importorskip("scipy", reason="reconstruction needs SciPy")
        commands.append(["reconstruct", cloud, "--output", tmp_path / "road", "--no-picture"])
    before = 0.0
    if STATUS.exists():
        reset_peak()
        before = memory_mb()
    for first, *words in commands:
        code = command(str(first), [*map(str, words), "--quiet"])
        told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error:")]
        assert (code, len(told)) in ((0, 0), (2, 1)), (first, words[0], code, told)
    if STATUS.exists():
        assert memory_mb("VmHWM") - before < 1000.0 * GIGABYTES


def test_pictures_show_the_cloud_and_not_what_strays_from_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, xyz in (("plain", strip()), ("stray", with_strays((1e6, 0.0, 1e5)))):
        cloud = write(tmp_path / f"{name}.las", xyz)
        assert command("cloud", ["preview", str(cloud), "--output", str(tmp_path / name), "--quiet", "--json"]) == 0
    assert '"strays_left_out":1' in capsys.readouterr().out.replace(" ", "")
    for picture in (tmp_path / "plain").iterdir():
        assert picture.read_bytes() == (tmp_path / "stray" / picture.name).read_bytes()


@pytest.mark.parametrize("ending", [".ply", ".npz"])
@pytest.mark.parametrize(("field", "value"), [("xyz", 2e9), ("intensity", np.nan), ("intensity", np.inf)])
def test_the_gate_names_the_point(ending: str, field: str, value: float, tmp_path: Path) -> None:
    """Where a cloud is opened, whatever is done with it."""
    points = make_points(300)
    with open_writer(tmp_path / f"cloud{ending}", None, np.zeros(3), 1.0) as writer:
        writer.check_finite = lambda values, *_: values  # type: ignore[method-assign] # a writer of others
        getattr(points, field)[123] = value
        writer.write(points)
    with open_cloud(tmp_path / f"cloud{ending}") as cloud, pytest.raises(InputError, match=r"of point 123 is"):
        list(cloud.blocks(100))


def test_heights_above_ground_take_memory_for_the_cells_that_hold_points() -> None:
    pytest.importorskip("scipy", reason="reconstruction needs SciPy")
    from synthroads_addon.reconstruction import cloud as ground

    near, far = strip(), strip() + (3e6, 4e6, 0.0)
    tracemalloc.start()
    heights = ground.above_ground(np.concatenate([near, far]))
    assert tracemalloc.get_traced_memory()[1] < 2e8
    tracemalloc.stop()
    np.testing.assert_allclose(heights[:COUNT], ground.above_ground(near), atol=1e-9)


def test_ground_in_tiles_is_the_ground_in_one_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("scipy", reason="reconstruction needs SciPy")
    from synthroads_addon.reconstruction import cloud as ground

    rng = np.random.default_rng(4)
    xyz = rng.uniform((0.0, 0.0, 0.0), (180.0, 160.0, 0.02), (200_000, 3))
    xyz[:, 2] += 0.05 * xyz[:, 0] + np.where(rng.random(len(xyz)) < 0.1, 1.5, 0.0)
    whole = ground.above_ground(xyz)
    monkeypatch.setattr(ground, "_MOST_CELLS", 1)
    monkeypatch.setattr(ground, "_TILE", 96)
    np.testing.assert_allclose(ground.above_ground(xyz), whole, atol=1e-9)
