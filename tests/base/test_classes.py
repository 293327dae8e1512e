"""Tables of classes: the 17, the 5, a user's own."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest

from synthroads_addon.base.classes import UNLABELLED, asprs_scheme, class_scheme, classes
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import PRESETS
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.tools.convert import convert
from synthroads_addon.scenario.cloud import CloudScenario
from tests.helpers.page_modules import block_of_page

ROWS = [
    {"id": 3, "name": "paved", "las": 11, "color": [90, 90, 96], "of": ["road", "road_marking", 40]},
    {"id": 9, "name": "rest", "las": 2, "color": [1, 2, 3], "of": ["ground"]},
]


def write_table(path: Path, rows: list) -> str:
    path.write_text(json.dumps({"classes": rows}), encoding="utf-8")
    return str(path)


def test_every_class_of_17_is_in_one_of_5() -> None:
    five = class_scheme("5")
    assert [row.name for row in five.rows] == ["ground", "road", "road_marking", "vegetation", "road_furniture"]
    assert sorted(name for row in five.rows for name in row.of) == sorted(row.name for row in classes())
    names = {row.id: row.name for row in five.rows}
    merged = {row.name: names[int(five.ids[row.id])] for row in classes()}
    assert (merged["roadside"], merged["bridge"], merged["vegetation"]) == ("ground", "road_furniture", "vegetation")
    assert five.ids[17:].tolist() == [UNLABELLED] * 239


def test_own_table_merges_by_name_and_number(tmp_path: Path) -> None:
    scheme = class_scheme(write_table(tmp_path / "mine.json", ROWS))
    assert scheme.name == "mine"
    assert scheme.ids[[1, 2, 40, 0]].tolist() == [3, 3, 3, 9]
    assert scheme.ids[3] == UNLABELLED
    assert scheme.las_codes()[[3, 9, UNLABELLED]].tolist() == [11, 2, 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"las": 300}, "las"),
        ({"las": 40}, "ASPRS reserves 23 to 63"),
        ({"id": 255}, "255 is unlabelled"),
        ({"id": 9}, "two classes have the id 9"),
        ({"name": "rest"}, "two classes have the name 'rest'"),
        ({"of": ["rode"]}, "did you mean 'road'"),
        ({"of": ["ground"]}, "belongs to another class already"),
        ({"of": [300]}, "an id from 0 to 254"),
        ({"color": [1, 2]}, "color"),
        ({"colour": [1, 2, 3]}, "did you mean 'color'"),
    ],
    ids=str,
)
def test_wrong_table_is_refused_by_name(tmp_path: Path, change: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        class_scheme(write_table(tmp_path / "mine.json", [ROWS[0] | change, ROWS[1]]))


def test_the_table_of_the_page_merges_five_classes_into_two(tmp_path: Path) -> None:
    (tmp_path / "paved.json").write_text(block_of_page("extend/class-scheme.md", "json"), encoding="utf-8")
    scheme = class_scheme(str(tmp_path / "paved.json"))
    assert scheme.names() == {0: "paved", 1: "beside", 255: "unlabelled"}
    merged = {row.name: int(scheme.ids[row.id]) for row in classes()}
    assert {name for name, number in merged.items() if number == 0} == {"road", "road_marking"}
    assert {name for name, number in merged.items() if number == 1} == {"ground", "roadside", "vegetation"}


def test_unknown_scheme() -> None:
    with pytest.raises(InputError, match=r"must be one of 17, 5, 19, or a \.json file"):
        class_scheme("six")
    with pytest.raises(InputError, match="no such file"):
        class_scheme("six.json")


def test_codes_of_others_keep_themselves() -> None:
    scheme = asprs_scheme(range(256))
    np.testing.assert_array_equal(scheme.las_codes(), np.arange(256))
    assert (scheme.names()[6], scheme.names()[64]) == ("building", "class_64")


@pytest.mark.parametrize("ending", [".laz", ".ply", ".npz"])
def test_cloud_says_its_classes(tmp_path: Path, points, ending: str) -> None:
    five = class_scheme("5")
    with open_writer(tmp_path / f"five{ending}", None, points.xyz[0], 1e7, scheme=five) as writer:
        writer.write(points)
    with open_cloud(tmp_path / f"five{ending}") as cloud:
        assert (cloud.header.scheme.name, cloud.header.scheme.names()) == ("5", five.names())
        np.testing.assert_array_equal(next(cloud.blocks()).class_id, five.ids[points.class_id])


def test_conversion_merges_classes_and_their_las_codes(tmp_path: Path, points) -> None:
    with open_writer(tmp_path / "all.laz", None, points.xyz[0], 1e7) as writer:
        writer.write(points)
    five = class_scheme("5")
    convert(tmp_path / "all.laz", tmp_path / "five.laz", "5")
    las = laspy.read(tmp_path / "five.laz")
    np.testing.assert_array_equal(las["class_id"], five.ids[points.class_id])
    np.testing.assert_array_equal(las.classification, five.las_codes()[five.ids[points.class_id]])
    convert(tmp_path / "five.laz", tmp_path / "again.laz", "5")
    assert (tmp_path / "again.laz").read_bytes() == (tmp_path / "five.laz").read_bytes()
    with pytest.raises(InputError, match="holds the classes 5: only the 17"):
        convert(tmp_path / "five.laz", tmp_path / "back.laz", "17")


def test_scenario_of_the_cloud() -> None:
    cloud = CloudScenario()
    assert (cloud.file_names(), cloud.arrays()) == (("cloud.laz",), {"range", "incidence_deg"})
    wanted = CloudScenario.from_dict({"formats": ["las", "e57"], "attributes": ["noise_free"], "classes": "5"})
    assert wanted.arrays() == {"true_range", "true_xyz"}
    assert wanted.scheme().name == "5"
    assert CloudScenario.from_dict(wanted.to_dict()) == wanted
    for data, message in (
        ({"formats": ["laz", "laz"]}, "formats names laz twice"),
        ({"formats": []}, "formats"),
        ({"formats": ["laszip"]}, "formats.0"),
        ({"attributes": ["normals"]}, "attributes.0"),
        ({"point_spacing": 0}, "point_spacing"),
        ({"intensity_scale": -1}, "intensity_scale"),
    ):
        with pytest.raises(InputError, match=message):
            CloudScenario.from_dict(data)


def test_documentation_has_every_class() -> None:
    text = (PRESETS.parents[1] / "docs" / "cloud.md").read_text(encoding="utf-8")
    five = class_scheme("5")
    for row in classes():
        merged = five.names()[int(five.ids[row.id])]
        assert f"| {row.id} | {row.name} | {row.las} | {merged} |" in text
    for row in five.rows:
        assert f"| {row.id} | {row.name} | {row.las} |" in text


def test_documentation_has_every_column() -> None:
    from synthroads_addon.cloud.layers import ATTRIBUTES, LABELS, LAYERS

    text = (PRESETS.parents[1] / "docs" / "cloud.md").read_text(encoding="utf-8")
    rows = {cells[2].strip(" `"): cells for line in text.splitlines() if len(cells := line.split("|")) == 8}
    for attribute in (None, *ATTRIBUTES):
        for column in LAYERS[attribute].columns if attribute else LABELS:
            scale = f"{column.scale:g}" if column.scale else "1"
            shown = [rows[column.name][i].strip(" `") for i in (1, 3, 4, 5)]
            assert shown == [attribute or "always", column.dtype, scale, column.unit], column.name
