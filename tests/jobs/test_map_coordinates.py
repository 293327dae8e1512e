"""Scenes of others in map coordinates: refused before the scan, or moved near the origin before they are read."""

import json
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from headless.commands import command
from tests.helpers.files.map_meshes import GROUND, PLACES, write_mesh

KINDS = ["obj", "obj y up", "ply text", "ply double", "ply double big", "ply float", "stl text", "stl", "glb"]
EXACT = {"obj", "obj y up", "ply text", "ply double", "ply double big", "stl text"}
"""Formats with more than single precision."""


def words(folder: Path, kind: str, place: str) -> list[str]:
    path = write_mesh(folder / f"ground.{kind.split(maxsplit=1)[0]}", PLACES[place], kind)
    up = ["--up", "z"] if kind == "obj" else []
    still = ["--set", "scan.noise.range_sigma=0", "--set", "scan.relief=0"]
    settings = ["--height", "15", "--fidelity", "draft", *still]
    return [str(path), "--output", str(folder / "out"), "--epsg", "25832", *up, *settings]


def scanned(folder: Path, arguments: list[str]) -> tuple[Any, dict[str, Any]]:
    assert command("scan", arguments) == 0
    return laspy.read(folder / "out" / "cloud.laz"), json.loads((folder / "out" / "report.json").read_text())


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", ["obj", "stl", "glb"])
def test_map_coordinates_are_refused_before_the_scan(
    kind: str, place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("scan", words(tmp_path, kind, place)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    step = 0.5 if PLACES[place].max() > 4e6 else 0.25 if PLACES[place].max() > 2e6 else 0.0625
    assert f"ground.{kind.split(maxsplit=1)[0]}: coordinates is [" in line
    assert f"has steps of {step:g} m there: --origin auto moves the scene" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("place", ["UTM", "LV95"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_scene_is_moved_to_its_place_before_it_is_read(
    kind: str, place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    las, report = scanned(tmp_path, [*words(tmp_path, kind, place), "--origin", "auto"])
    x, y, z = np.array(las.xyz - PLACES[place]).T
    above = z - 0.123 - 0.05 * (x - 0.123) - 0.02 * (y - 0.123)
    assert [x.min(), x.max()] == pytest.approx([0.123, 20.123], abs=0.8)
    assert [y.min(), y.max()] == pytest.approx([0.123, 10.123], abs=0.8)
    rounded = [text for text in report["warnings"] if "read in single precision" in text]
    if kind in EXACT:
        assert np.abs(above).max() < 0.003
        assert rounded == []
    else:
        assert "its coordinates are rounded to steps of 0.5 m" in rounded[0] or "steps of 0.25 m" in rounded[0]
    (assumed,) = (line for line in capsys.readouterr().err.splitlines() if "is scanned about the map" in line)
    assert report["remarks"] == [assumed]


def test_materials_of_a_moved_obj_are_found(tmp_path: Path) -> None:
    """They stand in a file beside it: without it the ground would be grey."""
    las, _ = scanned(tmp_path, [*words(tmp_path, "obj", "UTM"), "--origin", "auto"])
    assert np.mean(las.red) > 1.1 * np.mean(las.green) > 1.1 * np.mean(las.blue)


@pytest.mark.parametrize(("east", "told"), [(0.0, ""), (40_000.0, "are held in steps of 4 mm"), (100_000.0, "of 8 mm")])
def test_near_scenes_are_scanned_as_they_stand(east: float, told: str, tmp_path: Path) -> None:
    path = write_mesh(tmp_path / "ground.obj", np.array([east, 0.0, 0.0]), "obj")
    arguments = [str(path), "--output", str(tmp_path / "out"), "--up", "z", "--height", "15", "--fidelity", "draft"]
    las, report = scanned(tmp_path, arguments)
    assert np.ptp(las.x) == pytest.approx(np.ptp(GROUND[:, 0]), abs=0.8)
    assert bool(told) == any("are held in steps of" in text for text in report["warnings"])
    assert told in " ".join(report["warnings"])


def test_auto_leaves_a_scene_near_its_origin_where_it_is(tmp_path: Path) -> None:
    path = write_mesh(tmp_path / "ground.obj", np.zeros(3), "obj")
    arguments = [str(path), "--output", str(tmp_path / "out"), "--up", "z", "--height", "15", "--fidelity", "draft"]
    scanned(tmp_path, arguments)
    before = (tmp_path / "out" / "cloud.laz").read_bytes()
    scanned(tmp_path, [*arguments, "--origin", "auto", "--overwrite"])
    assert (tmp_path / "out" / "cloud.laz").read_bytes() == before


def test_a_vertex_that_is_no_number_is_refused_by_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = words(tmp_path, "obj", "UTM")
    path = tmp_path / "ground.obj"
    path.write_text(path.read_text().replace("v ", "v east ", 1))
    assert command("scan", [*arguments, "--origin", "auto"]) == 2
    assert "ground.obj:3 is 'east" in capsys.readouterr().err
