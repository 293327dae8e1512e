"""The command that writes the tables and pictures of docs/centerline.md, on a small road of its own."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import laspy
import numpy as np
import pytest
from numpy.typing import NDArray

from ml.centerline import evaluation
from ml.centerline.calibration import DEVIATIONS
from ml.centerline.evaluation import truth_of
from ml.centerline.frames import Frames
from ml.centerline.roads import Road
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


class Sure:
    """Predicts 0.1 m beside the truth of `strip_road` with some deviation, and finds that it should be 0.1 m."""

    def __init__(self, deviation: float) -> None:
        self.deviation = deviation

    def __call__(self, road: Road, frames: Frames) -> NDArray[np.float64]:
        true, _ = truth_of(road).axis.crossing(frames.position, frames.direction)
        return np.column_stack([true + 0.1, np.full(len(frames), self.deviation)])

    def calibrated_on(self, shown: Iterable[tuple[Road, Frames]]) -> tuple[Sure, None]:
        assert [road.name for road, _ in shown] == ["further"]
        return Sure(0.1 * 1.01 / DEVIATIONS[0]), None


def test_other_scanners_stand_side_by_side(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures_centerline, "synthetic_roads", lambda texts, kind: [strip_road(text) for text in texts])
    monkeypatch.setattr(figures_centerline, "measure_corridor", lambda *arguments: {})
    words = ["--other", "air=first", "--other", "car=second", "--other", "car=third", "--recalibrate", "car=further"]
    arguments = figures_centerline.arguments_of(
        [*words, "--truths", "road", "--seeds", "1", "--output", str(folder / "o")]
    )
    trained = {"m": [figures_centerline.Model("road", [Sure(0.01)])]}
    found = figures_centerline.other_scanners(arguments, trained, "road")
    assert list(found) == ["other-scanner-road", "coverage-other-scanner-road", "corridor-other-scanner-road"]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in found["other-scanner-road"].splitlines()]
    assert rows[0] == ["", "air: MAE (m)", "air: Chamfer (m)", "car: MAE (m)", "car: Chamfer (m)"]
    assert rows[2][0] == "m"
    assert [float(cell) for cell in rows[2][1:]] == pytest.approx([0.1, 0.2, 0.1, 0.2], abs=0.002)
    assert not any("recalibrated" in row[0] for row in rows)
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in found["coverage-other-scanner-road"].splitlines()
    ]
    assert rows[2:] == [["m", "0.0", "0.0", "0.0", "0.0"], ["m, recalibrated", "–", "–", "100.0", "100.0"]]
    with pytest.raises(SystemExit, match="out/x: must be TITLE=FOLDER"):
        figures_centerline.by_title(["out/x"])
