"""The command that writes the tables and pictures of docs/centerline.md, on a small road of its own."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest

from ml.centerline import evaluation
from ml.centerline.evaluation import truth_of
from synthroads_addon.core.marked import BEGIN
from tests.ml.centerline_roads import strip_road
from tools import figures_centerline

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "centerline.md"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one "real" road, and a search that tries a single setting."""
    road = strip_road("one")
    las = laspy.LasData(laspy.LasHeader(version="1.4", point_format=7))
    las.xyz = road.xyz.astype(np.float64)
    las.intensity = np.clip(road.intensity * 50_000, 0, 65_535).astype(np.uint16)
    las.classification = np.full(len(road), 2, dtype=np.uint8)
    las.write(tmp_path / "one.laz")
    axis = truth_of(road).axis.points
    np.savetxt(tmp_path / "one_axis.csv", axis, delimiter=",", header="x,y,z", comments="")
    monkeypatch.setattr(figures_centerline, "REAL_ROADS", {"one": ("one, 200 m", "road")})
    monkeypatch.setattr(figures_centerline, "TUNED_ON", "one")
    monkeypatch.setattr(figures_centerline, "PAINTED", "one")
    monkeypatch.setattr(evaluation, "RASTERS", (1.0,))
    monkeypatch.setattr(evaluation, "BRANCHES", (15.0,))
    monkeypatch.setattr(evaluation, "BINS", (5.0,))
    return tmp_path


def test_real_roads_fill_their_tables_and_no_others(folder: Path) -> None:
    document, output = folder / "centerline.md", folder / "output"
    document.write_text(DOCUMENT.read_text(encoding="utf-8"), encoding="utf-8")
    words = ["--real", str(folder), "--output", str(output), "--document", str(document), "--seeds", "1", "2"]
    figures_centerline.main(words)
    before, after = DOCUMENT.read_text(encoding="utf-8"), document.read_text(encoding="utf-8")
    part = after.partition(BEGIN.format("real-slices"))[2].partition("<!--")[0].splitlines()
    assert part[1] == "|  | one, 200 m: MAE (m) | one, 200 m: Chamfer (m) |"
    assert [line.split("|")[1].strip() for line in part[3:6]] == [
        "skeleton, 1 m, 15 m, 5 m (tuned)",
        "skeleton, 1 m, 15 m, 5 m",
        "the displaced path",
    ]
    assert after.partition("## Real roads")[0] == before.partition("## Real roads")[0]
    assert {path.name for path in output.iterdir()} >= {"real-whole.json", "real-whole.md", "centerline-real.png"}
    tried = json.loads((output / "skeleton-real-whole.json").read_text())
    assert tried["road"] == "one"
    assert {row["mask"] for row in tried["tried"]} == {"ground", "dark"}


def test_a_document_without_the_markers_stays_as_it_is(folder: Path) -> None:
    document = folder / "other.md"
    document.write_text("nothing to replace\n")
    with pytest.raises(SystemExit, match="must stand in it once"):
        figures_centerline.main(
            ["--real", str(folder), "--output", str(folder / "o"), "--document", str(document), "--seeds", "1"]
        )
    assert document.read_text() == "nothing to replace\n"
    assert not (folder / "o").exists(), "it is told before the work begins"


def test_a_model_needs_a_run_for_each_seed_or_one_for_all() -> None:
    model = figures_centerline.Model("road", [evaluation.path_itself] * 3)
    assert figures_centerline.of_kind({"m": [model]}, "road", 3) == {"m": model.versions}
    assert figures_centerline.of_kind({"m": [model]}, "carriageway", 3) == {}
    with pytest.raises(SystemExit, match="3 runs for 5 seeds"):
        figures_centerline.of_kind({"m": [model]}, "road", 5)
