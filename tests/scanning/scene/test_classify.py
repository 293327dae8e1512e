"""Classes that a scheme adds, splits and merges by thing, type, material and asset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.classes import ClassScheme, class_id, class_scheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.tools.convert import convert
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scanning.scene.classify import check_asset_classes, classify_scene
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh, ScannedScene
from synthroads_addon.scenario.cloud import CloudScenario
from tests.helpers.roads.parameter_sets import SMALL_ROAD
from tests.helpers.scenes.scan_scenes import mesh_of

BENCH = {"type": "Asset", "library": "l.json", "name": "bench.002", "class_name": "utility"}
BIN = BENCH | {"name": "grit_bin"}
PLACE = {"station": 1.0, "offset": -15.0}
DRIVES = {"type": "Vehicle", "carriageway": "road", "lane": 0, "station": 1.0, "speed": 0.0}
ROWS = [
    {"name": "bench", "of": [{"asset": "bench.*"}]},
    {"name": "truck", "of": [{"thing": "Vehicle", "where": {"model": "truck"}}]},
    {"name": "heavy", "of": [{"thing": "Vehicle", "where": {"model": "[bt]*"}}, {"asset": "grit_bin"}]},
    {"name": "concrete_pavement", "of": [{"class": "road", "material": "concrete"}]},
    {"name": "waymark"},
]


def road() -> RoadParameters:
    objects: dict[str, Any] = {"bench": BENCH | PLACE, "bin": BIN | PLACE}
    objects |= {model: DRIVES | {"model": model} for model in ("truck", "bus", "car")}
    numbered = {name: item | {"instance": 10 + number} for number, (name, item) in enumerate(objects.items())}
    return RoadParameters.from_dict(SMALL_ROAD | {"objects": {**SMALL_ROAD["objects"], **numbered}})


def scheme(folder: Path, rows: list[dict[str, Any]], **table: Any) -> ClassScheme:
    full = [{"id": 20 + n, "las": 100 + n, "color": [n, n, n]} | row for n, row in enumerate(rows)]
    (folder / "mine.json").write_text(json.dumps(table | {"classes": full}), encoding="utf-8")
    return class_scheme(str(folder / "mine.json"))


def faces(*rows: tuple[str, int, str]):
    """Return a mesh with a triangle for each class, instance and material."""
    mesh = mesh_of(np.eye(3), [(0, 1, 2)] * len(rows))
    names = tuple(dict.fromkeys(material for _, _, material in rows))
    arrays = {
        "class_id": np.array([class_id(name) for name, _, _ in rows], np.uint8),
        "instance_id": np.array([number for _, number, _ in rows], np.uint32),
        "material": np.array([names.index(material) for _, _, material in rows], np.uint16),
    }
    return type(mesh)(**(vars(mesh) | arrays | {"materials": names}))


def test_things_types_materials_and_assets_have_classes_of_their_own(tmp_path: Path) -> None:
    mine = scheme(tmp_path, ROWS, extends="17")
    static = faces(
        ("utility", 10, "wood"),
        ("utility", 11, "steel"),
        ("road", 2, "concrete"),
        ("road", 2, "asphalt"),
        ("barrier", 4, "concrete"),
        ("guardrail", 4, "steel"),
    )
    driving = faces(("vehicle", 12, "paint"), ("vehicle", 13, "paint"), ("vehicle", 14, "paint"))
    scene = ScannedScene(static, (MovingMesh(driving, LinearMotion((1.0, 0.0, 0.0))),))
    found = classify_scene(scene, mine, road())
    names = mine.names()
    assert [names[i] for i in mine.ids[found.static.class_id].tolist()] == [
        *("bench", "heavy", "concrete_pavement", "road", "barrier", "guardrail")
    ]
    assert [names[i] for i in mine.ids[found.moving[0].mesh.class_id].tolist()] == ["truck", "heavy", "vehicle"]
    assert mine.las_codes()[mine.ids[found.static.class_id[:3]]].tolist() == [100, 102, 103]
    # Without a road nothing is a thing, but a material is one.
    alone = classify_scene(scene, mine, None)
    assert [names[i] for i in mine.ids[alone.static.class_id[:3]].tolist()] == [
        *("utility", "utility", "concrete_pavement")
    ]
    assert classify_scene(scene, class_scheme("17"), road()) is scene


def test_names_of_new_classes_can_be_given_to_objects(tmp_path: Path) -> None:
    mine = scheme(tmp_path, ROWS, extends="17")
    ids = mine.source_ids()
    assert mine.names()[int(mine.ids[ids["waymark"]])] == "waymark"
    assert ids["road"] == class_id("road")
    shown = mine.sources()
    assert {shown.names()[ids[row["name"]]] for row in ROWS} == {row["name"] for row in ROWS}
    taken = scheme(tmp_path, [{"name": "a", "of": [254, "road"]}, {"name": "b"}])
    assert taken.source_ids()["b"] == 253
    assert taken.ids[[254, 253, 1]].tolist() == [20, 21, 20]


def test_assets_have_classes_of_the_scheme(tmp_path: Path) -> None:
    objects = {**SMALL_ROAD["objects"], "bench": BENCH | PLACE | {"instance": 9, "class_name": "bench"}}
    seats = RoadParameters.from_dict(SMALL_ROAD | {"objects": objects})
    check_asset_classes(scheme(tmp_path, [{"name": "bench"}], extends="5"), seats)
    with pytest.raises(InputError, match=r"objects.bench.class_name is 'bench': bench.002 of l.json: .* scheme 17 "):
        check_asset_classes(class_scheme("17"), seats)


@pytest.mark.parametrize(
    ("member", "message"),
    [
        ({}, "at least one of class, material, thing, asset"),
        ({"where": {"model": "truck"}, "asset": "a"}, "where needs thing"),
        ({"class": "rode"}, "did you mean 'road'"),
        ({"thing": "Vehicel"}, "did you mean 'Vehicle'"),
        ({"thing": "Vehicle", "where": {"modle": "truck"}}, "must be a field of Vehicle.*did you mean 'model'"),
        ({"materail": "wood"}, "did you mean 'material'"),
    ],
    ids=str,
)
def test_wrong_selectors_are_refused_by_name(tmp_path: Path, member: dict, message: str) -> None:
    row = {"id": 0, "las": 100, "color": [1, 2, 3], "name": "mine", "of": [member]}
    (tmp_path / "mine.json").write_text(json.dumps({"classes": [row]}), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        CloudScenario(classes=str(tmp_path / "mine.json")).scheme()


def test_a_cloud_that_is_there_cannot_be_split(tmp_path: Path, points) -> None:
    with open_writer(tmp_path / "all.npz", None, points.xyz[0], 1e7) as writer:
        writer.write(points)
    scheme(tmp_path, ROWS, extends="17")
    with pytest.raises(InputError, match="has bench, truck, heavy, concrete_pavement, which the cloud doesn't"):
        convert(tmp_path / "all.npz", tmp_path / "mine.npz", str(tmp_path / "mine.json"))
