"""The command `synthroads cloud`: results, and one line with exit code 2 for whatever is wrong."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from headless.commands import command
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.points import PointBlock
from tests.helpers.clouds.random_points import make_points

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
REAL = Path(__file__).parents[3] / "shared" / "real"
QUICK = ("semkitti_seq00_000000", "als_dual4lane_t338-369")
"""One file of each producer; the others are larger."""


@pytest.fixture
def cloud(tmp_path: Path) -> Path:
    path = tmp_path / "cloud.laz"
    with open_writer(path, 25832, ORIGIN, 5e8) as writer:
        writer.write(along_a_road(make_points(3_000)))
    return path


def along_a_road(points: PointBlock) -> PointBlock:
    """Return points of 600 m by 30 m by 30 m: pictures of a square as wide would take most of the tests' time."""
    return replace(points, xyz=(points.xyz - ORIGIN) * [1.0, 0.05, 0.05] + ORIGIN)


def failed(capsys, *arguments: object) -> str:
    """Run a tool that must fail; return its one line."""
    try:
        code = command("cloud", [str(argument) for argument in arguments])
    except SystemExit as stop:  # argparse's own way
        code = stop.code
    out, err = capsys.readouterr()
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    return err


def test_info(capsys, cloud: Path) -> None:
    assert command("cloud", ["info", str(cloud)]) == 0
    text = capsys.readouterr().out
    assert text.startswith("cloud.laz: LAS 1.4, point format 7, LAZ, 3,000 points\ncoordinate system EPSG:25832\n")
    assert "\nvertical coordinate system not named\n" in text
    assert "\nfurther attributes: range, incidence\n" in text
    assert command("cloud", ["info", str(cloud), "--json", "--samples", "0"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["points"], figures["epsg"], figures["class_scheme"]) == (3_000, 25832, "17")
    assert sum(values["points"] for values in figures["classes"].values()) == 3_000
    assert figures["all"]["roughness"] is None


@pytest.mark.parametrize("ending", [".las", ".ply", ".npz"])
def test_convert(capsys, cloud: Path, ending: str) -> None:
    output = cloud.with_name(f"five{ending}")
    assert command("cloud", ["convert", str(cloud), "--output", str(output), "--classes", "5"]) == 0
    assert "3,000 points written" in capsys.readouterr().out
    with open_cloud(output) as reader:
        assert (reader.header.count, reader.header.scheme.name) == (3_000, "5")


def test_subsample_map_and_preview(capsys, cloud: Path, tmp_path: Path) -> None:
    thin, mapped = tmp_path / "thin.laz", tmp_path / "mapped.laz"
    assert command("cloud", ["subsample", str(cloud), "--grid", "3", "--output", str(thin), "--json"]) == 0
    done = json.loads(capsys.readouterr().out)
    assert done["points_read"] == 3_000 > done["points"] > 1_000
    assert command("cloud", ["map-intensity", str(cloud), "--target", str(thin), "--output", str(mapped)]) == 0
    assert "Kolmogorov-Smirnov" in capsys.readouterr().out
    assert command("cloud", ["preview", str(cloud), "--output", str(tmp_path / "out"), "--depth", "20"]) == 0
    assert len(list((tmp_path / "out").glob("preview_*.png"))) == 4


def test_stations_along_a_centreline(capsys, cloud: Path, tmp_path: Path) -> None:
    line = tmp_path / "centerline.geojson"
    coordinates = [[294_000.0 + x, 5_628_000.0, 180.0] for x in (-300.0, 0.0, 300.0)]
    line.write_text(json.dumps({"type": "LineString", "coordinates": coordinates}))
    arguments = ["preview", str(cloud), "--output", str(tmp_path / "out"), "--centerline", str(line), "--depth", "50"]
    assert command("cloud", [*arguments, "--station", "100", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["section_points"] == pytest.approx(3_000 * 50 / 600, rel=0.3)
    assert "must be 0 to 600.0 m" in failed(capsys, *arguments, "--station", 601, "--overwrite")
    line.write_text("{}")
    assert "must be GeoJSON with a LineString" in failed(capsys, *arguments, "--overwrite")


def test_whatever_is_wrong_is_one_line(capsys, cloud: Path, tmp_path: Path) -> None:
    there, text, cut = tmp_path / "there.laz", tmp_path / "text.laz", tmp_path / "cut.laz"
    there.write_bytes(b"old")
    text.write_text("no cloud")
    cut.write_bytes(cloud.read_bytes()[:-2_000])
    new = tmp_path / "new.laz"
    cases = {
        ("info", tmp_path / "none.laz"): "no such file",
        ("info", text): "is not a LAS file",
        ("info", cut): "is truncated",
        ("info", tmp_path): "must end in .laz",
        ("info", tmp_path / "cloud.laz2"): "did you mean '.laz'",
        ("info", cloud, "--radius", "0"): "must be above 0",
        ("info", cloud, "--samples", "-1"): "whole number",
        ("convert", cloud, "--output", there): "is there already; --overwrite replaces it",
        ("convert", cloud, "--output", cloud): "must be another file than the input",
        ("convert", cloud, "--output", cloud, "--overwrite"): "must be another file than the input",
        ("convert", cloud, "--output", tmp_path / "new.xyz"): "must end in",
        ("convert", cloud, "--output", cloud / "no" / "new.laz"): "cannot be written (Not a directory)",
        ("convert", cloud, "--output", new, "--classes", "6"): "must be one of 17, 5",
        ("convert", cut, "--output", new): "is truncated",
        ("subsample", cloud, "--output", new, "--grid", "0"): "grid is 0.0",
        ("subsample", cloud, "--output", new, "--grid", "nan"): "grid is nan",
        ("map-intensity", cloud, "--target", text, "--output", new): "is not a LAS file",
        ("map-intensity", cloud, "--target", there, "--output", there, "--overwrite"): "another file than the input",
        ("preview", cloud, "--output", tmp_path / "out", "--station", "1e9"): "--station",
        ("preview", cloud, "--output", tmp_path / "out", "--line", "1", "2", "1", "2"): "two different points",
        ("turn", cloud): "invalid choice",
    }
    before = sorted(path.name for path in tmp_path.iterdir())
    for arguments, message in cases.items():
        assert message in failed(capsys, *arguments), arguments
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert there.read_bytes() == b"old"


def test_overwrite_replaces(capsys, cloud: Path, tmp_path: Path) -> None:
    there = tmp_path / "there.laz"
    there.write_bytes(b"old")
    assert command("cloud", ["convert", str(cloud), "--output", str(there), "--overwrite", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert there.read_bytes() == cloud.read_bytes()


@pytest.mark.skipif(not REAL.is_dir(), reason="no real scans here")
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.slow)
        for path in sorted(REAL.glob("*.laz"))
    ],
)
def test_plain_real_files(capsys, tmp_path: Path, path: Path) -> None:
    """Files of others have neither class_id nor range."""
    assert command("cloud", ["info", str(path), "--json", "--samples", "200"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["class_scheme"] == "asprs"
    assert figures["all"]["points"] == figures["points"] > 100_000
    assert figures["all"]["density"] > 10
    assert command("cloud", ["convert", str(path), "--output", str(tmp_path / "a.ply"), "--quiet"]) == 0
    assert command("cloud", ["preview", str(path), "--output", str(tmp_path / "out"), "--quiet"]) == 0
    assert "LAS codes only" in failed(capsys, "convert", path, "--output", tmp_path / "b.laz", "--classes", "5")
