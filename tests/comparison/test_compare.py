"""`synthroads compare` from files to report and picture."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from PIL import Image

from headless.cli import main
from synthroads_addon.base.progress import exhaust
from synthroads_addon.comparison import classifier
from synthroads_addon.comparison.clouds import find_clouds, read_compared
from synthroads_addon.comparison.job import compare_steps
from tests.helpers.clouds.pavement_points import pavement

REAL = Path(__file__).parents[3] / "shared" / "real"
ROAD, PAINT, DECIBELS = 11, 64, 30.0
LINE = 0.3
"""Width of the painted line, m."""


@pytest.fixture(autouse=True)
def _few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(classifier, "_TREES", 20)


def write(path: Path, **changes: Any) -> None:
    """Write a pavement as LAZ: intensities in steps of dB, a line along one side is paint and 4 dB brighter."""
    road = pavement(**changes)
    file = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
    file.header.scales = (1e-4,) * 3
    file.x, file.y, file.z = road.place.T
    paint = road.place[:, 1] < LINE
    level = 10.0 * np.log10(road.intensity) + 4.0 * paint + 15.0
    file.intensity = np.round(level / DECIBELS * 65535.0).astype(np.uint16)
    file.classification = np.where(paint, PAINT, ROAD)
    file.write(path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a list of one synthetic cloud, a lattice, and one of two real ones."""
    names = {"synthetic": [{"pattern": "lattice", "seed": 1}], "real": [{"seed": 2}, {"seed": 3}]}
    for kind, rows in names.items():
        lines = ["type: CloudList", "clouds:"]
        for number, changes in enumerate(rows):
            write(tmp_path / f"{kind}-{number}.laz", **changes)
            fields = f"class_field: classification, road: '{ROAD}', marking: '{PAINT}', decibels: {DECIBELS}"
            lines.append(f"  - {{cloud: {kind}-{number}.laz, {fields}, scanner: [0, 0, 10]}}")
        (tmp_path / f"{kind}.yaml").write_text("\n".join(lines), encoding="utf-8")
    return tmp_path


def compare(folder: Path, *more: str) -> int:
    """Run the command on the folder's lists."""
    lists = [str(folder / f"{kind}.yaml") for kind in ("synthetic", "real")]
    return main(["compare", *lists, "--output", str(folder / "out"), *more])


def test_report_and_picture_say_what_gives_a_cloud_away(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compare(folder) == 0
    report = json.loads((folder / "out" / "comparison.json").read_text(encoding="utf-8"))
    (synthetic,), real = report["synthetic"], report["real"]
    assert synthetic["auc"]["pattern"] > 0.97
    assert max(row["auc"]["all"] for row in real) < 0.8
    assert report["realism"]["pattern"] < 0.1
    assert report["realism"]["geometry"] > 0.7
    assert next(iter(report["giveaways"])) in ("clark_evans", "spacing_variation", "direction_entropy")
    assert report["discrepancy"] > 10.0
    marking = synthetic["classes"]["marking"]
    assert marking["median_over_road_db"] == pytest.approx(4.0, abs=0.25)
    assert marking["iqr_db"] == pytest.approx(1.35, abs=0.3)
    rings = synthetic["by_range"]
    assert [ring["from"] for ring in rings] == [10.0, 15.0, 20.0, 30.0]
    assert sum(ring["points"] for ring in rings) < synthetic["classes"]["road"]["points"]
    assert Image.open(folder / "out" / "comparison.png").size == (1500, 900)
    text = capsys.readouterr().out
    assert f"synthetic synthetic-0: told from the real ones by all {synthetic['auc']['all']:.2f}" in text
    assert f"gives away {next(iter(report['giveaways'].values()))[0]:.2f}" in text


def test_statistics_alone_need_neither_scikit_learn_nor_matplotlib(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("sklearn", "matplotlib"):
        monkeypatch.setitem(sys.modules, name, None)
    assert compare(folder) == 0
    report = json.loads((folder / "out" / "comparison.json").read_text(encoding="utf-8"))
    assert report["realism"] == {}
    assert [row["auc"] for row in report["synthetic"] + report["real"]] == [{}] * 3
    assert next(iter(report["giveaways"])) in ("clark_evans", "spacing_variation", "direction_entropy")
    assert next(iter(report["giveaways"].values()))[0] > 0.97
    assert report["discrepancy"] > 10.0
    assert [path.name for path in (folder / "out").iterdir()] == ["comparison.json"]
    said = capsys.readouterr()
    assert f"synthetic synthetic-0: {report['synthetic'][0]['patches']} patches" in said.out
    assert "told from" not in said.out
    assert said.err.count("pip install 'synthroads[ml]'") == 2


@pytest.mark.slow
def test_the_same_clouds_give_the_same_report(folder: Path) -> None:
    assert compare(folder, "--overwrite", "--quiet") == 0
    written = (folder / "out" / "comparison.json").read_bytes()
    assert compare(folder, "--overwrite", "--quiet") == 0
    assert (folder / "out" / "comparison.json").read_bytes() == written


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("type: CloudList\nclouds: []", "clouds is "),
        ("type: CloudList\nclouds: [{cloud: none.laz}]", "none.laz"),
        ("type: CloudList\nclouds: [{cloud: real-0.laz, axis: a.csv}]", "axis and paved locate the pavement together"),
        ("type: CloudList\nclouds: [{cloud: real-0.laz, roads: 3}]", "unknown key 'roads' (did you mean 'road'?)"),
        ("type: CloudList\nclouds: [{cloud: real-0.laz, class_field: user_data, road: '7'}]", "real-0.laz: road is 7"),
        (
            f"type: CloudList\nclouds: [{{cloud: real-0.laz, road: '{ROAD}', marking: road_markings}}]",
            "real-0.laz: marking is 'road_markings': must be one of ",
        ),
        (
            (
                "type: CloudList\nclouds: "
                f"[{{cloud: real-0.laz, class_field: classification, road: '{ROAD}', vegetation: tree}}]"
            ),
            "real-0.laz: vegetation is 'tree': must be a number: the attribute has no names",
        ),
    ],
)
def test_wrong_lists_are_refused_by_name(
    folder: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    (folder / "real.yaml").write_text(text, encoding="utf-8")
    assert compare(folder) == 2
    assert message in capsys.readouterr().err
    assert not (folder / "out" / "comparison.json").exists()


def test_an_empty_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(tmp_path), str(tmp_path), "--output", str(tmp_path / "out")]) == 2
    assert "holds no cloud (.laz, .las, .copc.laz, .ply, .pcd, .e57, .npz)" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_dir(), reason="real scans are not there")
def test_one_real_scan_is_not_told_from_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    name = "als_dual6lane_t370-473"
    fields = f"axis: {REAL / name}_axis.csv, paved: [[-10.9, -3.6], [3.6, 10.9]], lines: [-10.6, -6.35, 6.65, 10.4]"
    text = f"type: CloudList\nclouds: [{{cloud: {REAL / name}.laz, {fields}, decibels: 30}}]"
    (tmp_path / "real.yaml").write_text(text, encoding="utf-8")
    result = exhaust(compare_steps(tmp_path / "real.yaml", tmp_path / "real.yaml"), lambda share: None)
    (dealt,) = result.yardstick
    assert dealt.auc["all"] == pytest.approx(0.5, abs=0.05)
    assert max(dealt.features.values()) < 0.55


def test_classes_beside_an_axis(tmp_path: Path) -> None:
    """A cloud without labels has its pavement where the list's offsets say."""
    write(tmp_path / "road.laz")
    (tmp_path / "axis.csv").write_text("x,y,z\n" + "\n".join(f"{x},4.5,0" for x in range(121)), encoding="utf-8")
    rows = "{cloud: road.laz, axis: axis.csv, paved: [[-3, 3]], decibels: 30}"
    (tmp_path / "list.yaml").write_text(f"type: CloudList\nclouds: [{rows}]", encoding="utf-8")
    ((path, row),) = find_clouds(tmp_path / "list.yaml")
    cloud = read_compared(path, row)
    assert set(cloud.classes) == {"road"}
    assert np.abs(cloud.classes["road"].place[:, 1] - 4.5).max() < 3.0


def test_pavement_beside_a_marking_is_left_out(tmp_path: Path) -> None:
    """As beside an axis: the gap that a marking leaves says nothing about the scanner."""
    write(tmp_path / "road.laz")
    row = f"{{cloud: road.laz, class_field: classification, road: '{ROAD}', marking: '{PAINT}', decibels: 30}}"
    (tmp_path / "list.yaml").write_text(f"type: CloudList\nclouds: [{row}]", encoding="utf-8")
    cloud = read_compared(*find_clouds(tmp_path / "list.yaml")[0])
    # Gaps between the line's points let some of the pavement come nearer.
    assert LINE + 0.4 < cloud.classes["road"].place[:, 1].min() < LINE + 1.0
    assert len(cloud.classes["marking"].place) > 100


def test_a_cloud_without_the_class_of_the_road_is_named_with_the_remedy(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No option says which class is meant: a list does."""
    words = ["compare", str(folder / "real-0.laz"), str(folder / "real.yaml"), "--output", str(folder / "out")]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: real-0.laz: road is 'road': must be one of")
    assert "a list of clouds (.yaml)" in line
    assert "--class" not in line


def test_a_name_that_is_no_text_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Bytes that aren't UTF-8, as names of files may have on Linux."""
    assert [row.cloud for _, row in find_clouds(Path("\udcff.las"))] == ["\\udcff.las"]
    assert main(["compare", "\udcff.las", "\udcff.las", "--output", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
