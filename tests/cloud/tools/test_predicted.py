"""A cloud with predicted classes: figures and pictures of them beside those of its own classes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from PIL import Image

from headless.cli import main
from synthroads_addon.base.classes import asprs_scheme, class_scheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.tools.convert import convert
from tests.helpers.clouds.random_points import make_points

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
FIVE = class_scheme("5")
WRONG = 300
"""Points of 3,000 whose predicted class isn't their own."""


@pytest.fixture
def cloud(tmp_path: Path) -> Path:
    """Write a cloud of the 17 classes on 600 m by 30 m, with the 5 predicted: right but for every tenth point."""
    path = tmp_path / "plain.laz"
    points = make_points(3_000)
    placed = {"xyz": (points.xyz - ORIGIN) * [1.0, 0.05, 0.05] + ORIGIN, "class_id": np.arange(3_000) % 17}
    with open_writer(path, 25832, ORIGIN, 5e8) as writer:
        writer.write(points.with_arrays(placed | {"class_id": placed["class_id"].astype(np.uint8)}))
    return add_predicted(path, tmp_path / "cloud.laz")


def add_predicted(source: Path, target: Path, named: bool = True) -> Path:
    las = laspy.read(source)
    predicted = FIVE.ids[np.asarray(las["class_id"] if "class_id" in las.point_format.dimension_names else 0)]
    las.add_extra_dim(laspy.ExtraBytesParams("predicted_class", "uint8"))
    predicted = np.broadcast_to(predicted, len(las.points)).copy()
    predicted[::10] = (predicted[::10] + 1) % 5
    las["predicted_class"] = predicted
    if named:
        las.header.vlrs.append(laspy.VLR("SynthRoads", 2, "predicted", json.dumps(FIVE.to_dict()).encode()))
    las.write(target)
    return target


def info(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert main(["cloud", "info", str(path), "--samples", "0", "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_info_counts_predicted_classes_and_their_agreement(cloud: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = info(cloud, capsys)
    assert sum(row["points"] for row in found["predicted_classes"].values()) == 3_000
    assert set(found["predicted_classes"]) == {row.name for row in FIVE.rows}
    assert found["agreement"]["points"] == 3_000
    assert found["agreement"]["share"] == pytest.approx(1 - WRONG / 3_000)
    assert "predicted_class" not in found["left_out"]
    assert main(["cloud", "info", str(cloud), "--samples", "0"]) == 0
    said = capsys.readouterr().out
    assert "the same class for 90.0% of 3,000 points" in said
    assert "IoU with class_id" in said


def test_the_iou_is_that_of_the_definition(cloud: Path, capsys: pytest.CaptureFixture[str]) -> None:
    las = laspy.read(cloud)
    truth, predicted = FIVE.ids[np.asarray(las["class_id"])], np.asarray(las["predicted_class"])
    found = info(cloud, capsys)["agreement"]["iou"]
    for row in FIVE.rows:
        both = np.count_nonzero((truth == row.id) & (predicted == row.id))
        either = np.count_nonzero((truth == row.id) | (predicted == row.id))
        assert found[row.name] == pytest.approx(both / either)


def test_points_that_were_not_labelled_agree_with_nothing(cloud: Path, capsys: pytest.CaptureFixture[str]) -> None:
    las = laspy.read(cloud)
    before = info(cloud, capsys)["agreement"]["share"]
    las["predicted_class"][1::5] = 255  # right ones: every tenth from the first on is wrong
    las.write(cloud)
    found = info(cloud, capsys)
    assert found["predicted_classes"]["unlabelled"]["points"] == 600
    assert found["agreement"]["points"] == 2_400
    assert found["agreement"]["share"] == pytest.approx((3_000 * before - 600) / 2_400)


def test_without_names_classes_are_told_by_number(cloud: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = add_predicted(cloud.with_name("plain.laz"), cloud.with_name("bare.laz"), named=False)
    found = info(bare, capsys)
    assert set(found["predicted_classes"]) == {f"class_{number}" for number in range(5)}
    assert found["agreement"] is None


def test_clouds_of_others_have_no_truth_to_agree_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    las.x, las.y, las.z = np.random.default_rng(1).uniform(0.0, 50.0, (3, 500))
    las.classification = np.full(500, 2)
    las.write(tmp_path / "theirs.laz")
    found = info(add_predicted(tmp_path / "theirs.laz", tmp_path / "cloud.laz"), capsys)
    assert (found["agreement"], found["class_field"]) == (None, "classification")
    assert set(found["classes"]) == {asprs_scheme().names()[2]}


def test_damaged_names_are_refused_by_the_files_name(cloud: Path) -> None:
    las = laspy.read(cloud.with_name("plain.laz"))
    las.add_extra_dim(laspy.ExtraBytesParams("predicted_class", "uint8"))
    las.header.vlrs.append(laspy.VLR("SynthRoads", 2, "predicted", b'{"classes": 5}'))
    las.write(cloud)
    with pytest.raises(InputError, match=r"cloud\.laz"), open_cloud(cloud):
        pass


def test_each_picture_says_which_field_it_shows(cloud: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = cloud.parent / "out"
    assert main(["cloud", "preview", str(cloud), "-o", str(folder), "--depth", "20", "--json"]) == 0
    fields = json.loads(capsys.readouterr().out)["fields"]
    assert fields["preview_class.png"] == "class_id"
    assert fields["preview_predicted.png"] == "predicted_class"
    assert sorted(fields) == sorted(path.name for path in folder.iterdir())
    own, predicted = (np.asarray(Image.open(folder / f"preview_{kind}.png")) for kind in ("class", "predicted"))
    shown = {tuple(color) for color in predicted.reshape(-1, 3)}
    assert all(row.color in shown for row in FIVE.rows)
    assert own.shape != predicted.shape or np.any(own != predicted), "they are no copies of each other"


def test_one_picture_goes_to_the_file_that_is_named(cloud: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, words = cloud.parent / "prev.png", ["cloud", "preview", str(cloud), "-o"]
    assert main([*words, str(target)]) == 2
    assert "--picture class, predicted, intensity, rgb or section says which" in capsys.readouterr().err
    assert not target.exists()
    assert main([*words, str(target), "--picture", "predicted", "-q"]) == 0
    assert Image.open(target).format == "PNG"
    assert main([*words, str(target), "--picture", "predicted"]) == 2
    assert "already" in capsys.readouterr().err
    assert main([*words, str(cloud.parent / "one"), "--picture", "section", "--depth", "20", "-q"]) == 0
    assert [path.name for path in (cloud.parent / "one").iterdir()] == ["preview_section.png"]


def test_a_picture_of_what_a_cloud_has_not_is_refused(cloud: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = str(cloud.with_name("plain.laz"))
    assert main(["cloud", "preview", plain, "-o", str(cloud.parent / "a.png"), "--picture", "predicted"]) == 2
    assert "plain.laz has no predicted classes: `synthroads predict` adds them" in capsys.readouterr().err


def test_what_a_conversion_leaves_out_is_said(cloud: Path) -> None:
    assert convert(cloud, cloud.with_name("other.ply"))["left_out"] == ["predicted_class"]
