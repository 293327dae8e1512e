"""The programs in `examples`, run as a reader runs them: what they write and print is what they say."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from synthroads_addon.base.classes import class_id, class_scheme
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.road.parameters import read_parameters
from tests.helpers.clouds.random_points import make_points

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = (
    "camera_and_lidar",
    "cloud_to_numpy",
    "own_device",
    "own_scene",
    "own_thing",
    "scan_to_twin",
    "sweep_boxes",
    "torch_dataset",
)
RUN = """
import os, runpy, sys
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
sys.stdout.flush()
os._exit(0) # Blender's own teardown can hang
"""

pytestmark = pytest.mark.any_blender


def run(name: str, *words: str | Path, cwd: Path) -> str:
    """Run an example with these words behind it, in a folder; return what it prints."""
    done = process(name, *words, cwd=cwd)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def process(name: str, *words: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run an example with these words behind it, in a folder; return the process, however it ended."""
    words = (sys.executable, "-c", RUN, EXAMPLES / name / f"{name}.py", *words)
    environment = os.environ | {"PYTHONPATH": str(EXAMPLES.parent)}
    return subprocess.run(
        [*map(str, words)],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )


def points_of(file: Path) -> PointBlock:
    with open_cloud(file) as cloud:
        return concatenate(list(cloud.blocks()))


@pytest.mark.slow
def test_a_cloud_lies_in_a_picture(tmp_path: Path) -> None:
    told = run("camera_and_lidar", tmp_path, cwd=tmp_path)
    counts = re.search(r"([\d,]+) points .* ([\d,]+) of", told).groups()
    seen, visible = (int(count.replace(",", "")) for count in counts)
    assert seen > visible > 10_000
    assert float(re.search(r"([\d.]+)% of these", told)[1]) > 97.0
    with Image.open(tmp_path / "overlay.png") as overlay:
        assert overlay.height > 400


@pytest.mark.slow
def test_a_cloud_becomes_numpy_arrays(tmp_path: Path) -> None:
    told = run("cloud_to_numpy", tmp_path, cwd=tmp_path)
    points, arrays = points_of(tmp_path / "road" / "cloud.laz"), np.load(tmp_path / "arrays.npz")
    np.testing.assert_array_equal(arrays["xyz"], points.xyz)
    np.testing.assert_array_equal(arrays["class_id"], points.class_id)
    counts = {name: int(count.replace(",", "")) for name, count in re.findall(r"(?m)^(\w+) +([\d,]+) points", told)}
    assert counts["road"] == int((points.class_id == class_id("road")).sum()) > 1000
    assert sum(counts.values()) == len(points)


def test_a_cloud_of_five_classes_becomes_numpy_arrays_in_a_new_folder(tmp_path: Path) -> None:
    points = make_points(3).with_arrays({"class_id": np.array([0, 4, 4], dtype=np.uint8)})
    with open_writer(tmp_path / "five.npz", 25832, points.xyz[0], 5e8, scheme=class_scheme("5").as_stored()) as writer:
        writer.write(points)
    told = run("cloud_to_numpy", "new/folder", "five.npz", cwd=tmp_path)
    assert re.findall(r"(?m)^(\w+) +([\d,]+) points", told) == [("ground", "1"), ("road_furniture", "2")]
    np.testing.assert_array_equal(np.load(tmp_path / "new" / "folder" / "arrays.npz")["class_id"], [0, 4, 4])


def test_a_scene_of_ones_own_is_scanned_with_its_classes(tmp_path: Path) -> None:
    told = run("own_scene", tmp_path, cwd=tmp_path)
    points = points_of(tmp_path / "cloud.laz")
    assert told.strip().endswith(f"{len(points):,} points of 6 objects")
    assert set(points.class_id) == {class_id(name) for name in ("road", "noise_barrier", "pole", "vehicle")}
    wall = points.xyz[points.class_id == class_id("noise_barrier")]
    assert wall[:, 1].mean() == pytest.approx(13.85, abs=0.05)  # its side towards the scanner


@pytest.mark.slow
def test_a_sweep_is_drawn_with_its_boxes(tmp_path: Path) -> None:
    told = run("sweep_boxes", tmp_path, cwd=tmp_path)
    number = int(re.findall(r"sweep (\d+):", told)[0])
    frame = json.loads((tmp_path / "openlabel.json").read_text())["openlabel"]["frames"][str(number)]
    points = [int(text.replace(",", "")) for text in re.findall(r"m, +(\d+) points", told)]
    assert len(points) == len(frame["objects"]) > 5
    assert max(points) > 1000
    labels = np.fromfile(tmp_path / "semantickitti/sequences/00/labels" / f"{number:06d}.label", "<u4")
    assert np.count_nonzero((labels & 0xFFFF) == class_id("vehicle")) >= max(points)
    assert Image.open(tmp_path / "sweep.png").getcolors(10_000) is not None


@pytest.mark.slow
def test_a_scanner_of_ones_own_does_what_its_file_says(tmp_path: Path) -> None:
    run("own_device", tmp_path, cwd=tmp_path)
    device = json.loads((EXAMPLES / "own_device" / "robot.json").read_text(encoding="utf-8"))
    points = points_of(tmp_path / "cloud.laz")
    assert points.number_of_returns.max() == device["maximum_returns"]
    assert points.range.min() >= device["minimum_range"]
    assert len(points) > 10_000


@pytest.mark.slow
@pytest.mark.first_python
def test_a_data_set_is_learned_from(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    told = run("torch_dataset", tmp_path, cwd=tmp_path)
    right = float(re.search(r"([\d.]+)% of the unseen", told)[1])
    labels = np.concatenate([np.load(file) for file in (tmp_path / "roads").rglob("test/*/segment.npy")])
    assert 100.0 >= right > 100.0 * np.bincount(labels[labels >= 0]).max() / (labels >= 0).sum(), "a guess is as good"


@pytest.mark.slow
def test_a_scan_becomes_a_twin(tmp_path: Path) -> None:
    told = run("scan_to_twin", tmp_path, cwd=tmp_path)
    off = json.loads(re.search(r"true centreline: (.*)", told)[1].replace("'", '"'))
    assert off["largest"] < 0.1
    found = read_parameters(tmp_path / "parameters.json")
    city = json.loads((tmp_path / "twin" / "twin.city.json").read_text(encoding="utf-8"))
    assert set(found.objects) & set(city["CityObjects"])
    assert (tmp_path / "twin" / "twin.xodr").stat().st_size > 1000


@pytest.mark.slow
def test_a_thing_of_ones_own_is_in_cloud_and_twin(tmp_path: Path) -> None:
    told = run("own_thing", tmp_path, cwd=tmp_path)
    benches = re.findall(r"(?m)^(bench-\S+): instance (\d+), ([\d,]+) points, (in|not in) CityJSON", told)
    points = points_of(tmp_path / "cloud.laz")
    assert len(benches) >= 2
    for _, instance, count, there in benches:
        chosen = points.instance_id == int(instance)
        assert int(chosen.sum()) == int(count.replace(",", "")) > 20
        assert set(points.class_id[chosen]) == {class_id("utility")}
        assert there == "in"


HELP = """
import contextlib, os, runpy, sys
for script in sys.argv[1:]:
    sys.argv = [script, "--help"]
    with contextlib.suppress(SystemExit):
        runpy.run_path(script, run_name="__main__")
sys.stdout.flush()
os._exit(0) # Blender's own teardown can hang
"""


def test_help_says_what_to_give_and_makes_nothing(tmp_path: Path) -> None:
    """All in one process, as each takes seconds to load Blender."""
    names = [name for name in NAMES if name != "torch_dataset"]
    words = [sys.executable, "-c", HELP, *(str(EXAMPLES / name / f"{name}.py") for name in names)]
    environment = os.environ | {"PYTHONPATH": str(EXAMPLES.parent)}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    told = re.findall(r"usage: (\w+)\.py \[-h\] output(?: \[\w+\])?\n", done.stdout)
    assert told == names, done.stderr[-2000:]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", [name for name in NAMES if name != "torch_dataset"])
def test_an_output_that_is_a_file_ends_in_one_line(name: str, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    done = process(name, "out", cwd=tmp_path)
    assert done.returncode == 2
    assert re.fullmatch(r"error: .*out.*\n", done.stderr.splitlines(keepends=True)[-1])
    assert "Traceback" not in done.stderr
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize("name", ["cloud_to_numpy", "scan_to_twin"])
def test_a_cloud_that_is_missing_ends_in_one_line(name: str, tmp_path: Path) -> None:
    done = process(name, "out", "none.laz", cwd=tmp_path)
    assert done.returncode == 2
    assert "none.laz" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("name", NAMES)
def test_each_folder_is_complete_and_small(name: str) -> None:
    """A script of at most 60 lines, a README that says how to run it, and a picture."""
    folder = EXAMPLES / name
    script = (folder / f"{name}.py").read_text(encoding="utf-8")
    assert len(script.splitlines()) <= 60
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert f"python examples/{name}/{name}.py out/" in readme
    picture = folder / re.search(r"!\[[^\]]+\]\((\S+)\)", readme)[1]
    assert picture.stat().st_size < 150_000
    with Image.open(picture) as image:
        assert min(image.size) > 100


def test_every_folder_is_tried() -> None:
    assert {folder.name for folder in EXAMPLES.iterdir() if folder.is_dir()} == set(NAMES)
