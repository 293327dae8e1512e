"""Files made wrong by chance: each reader takes or refuses them in one line; nothing hangs, nothing else comes out.

Few cases run with the fast tests, thousands by `make fuzz`. What was found once stands at the end as a test of its
own.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.changes import apply_change, parse_change
from synthroads_addon.base.class_mapping import ClassMapping
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.schema import read_json, read_yaml
from synthroads_addon.checking.checker import check
from synthroads_addon.cloud.tools.convert import read_centerline
from synthroads_addon.dataset.manifest import faults, read_manifest
from synthroads_addon.dataset.recipe import RECIPES, load_recipe, scene_jobs
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.materials.table import read_material_table
from synthroads_addon.road.axes.centerline import read_axis
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters, read_parameters
from synthroads_addon.road.things.sign_catalogue import SignCatalogue
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.devices.device import load_device, setting_of
from synthroads_addon.scanning.platforms.polyline import PolylineGuide
from synthroads_addon.scanning.platforms.registry import make_platform
from synthroads_addon.scenario.assets import LIBRARIES, read_asset_library
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from tests.helpers.files.mutations import accepted, damaged, for_all, fuzz, json_files, wrong_values, yaml_files
from tests.helpers.roads.checker_full_road import full

ROOT = Path(__file__).parents[2]
PRESETS = ROOT / "synthroads_addon" / "presets"
LINE = [(294_000.0 + s, 5_628_000.0 + 0.001 * s * s, 100.0 + 0.01 * s) for s in np.arange(0.0, 300.0, 20.0)]
AXES = (
    "x,y,z\n" + "".join(f"{x:.3f},{y:.3f},{z:.3f}\n" for x, y, z in LINE),
    "".join(f"{x:.3f} {y:.3f}\n" for x, y, _ in LINE),
    "# measured\nid;Y;X\n" + "".join(f"1;{y:.3f};{x:.3f}\n" for x, y, _ in LINE),
)
STRING = {"type": "LineString", "coordinates": [list(point) for point in LINE]}
LINES = [STRING, {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": STRING}]}]
TRAJECTORY = "time,x,y,z,roll,pitch,heading\n" + "".join(
    f"{0.5 * i},{294_000 + 4 * i},5628000,{160 + i},0.1,-1,{88 + i}\n" for i in range(12)
)
MANIFEST = {
    "title": "t", "generator": "g", "recipe_sha256": "0" * 64, "complete": True,
    "scenes": [
        {"name": "a-01", "split": "train", "seed": 1, "status": "done", "points": 9, "length": 40.0,
         "classes": {"road": 9},
         "files": {"scenes/a-01/cloud.laz": {"bytes": 10, "sha256": "0" * 64}}, "folders": ["scenes/a-01"]}
    ],
}  # fmt: skip


def every(pattern: str, read: Callable[[Path], Any] = read_json) -> list[Any]:
    return [read(path) for path in sorted(PRESETS.glob(pattern))]


@pytest.fixture
def put(tmp_path: Path) -> Callable[[str, Callable[[Path], object]], Callable[[bytes], bool]]:
    """Return what turns a reader of a file into one of its content."""

    def make(name: str, read: Callable[[Path], object]) -> Callable[[bytes], bool]:
        path = tmp_path / name

        def body(content: bytes) -> bool:
            path.write_bytes(content)
            return accepted(lambda: read(path))

        return body

    return make


Put = Callable[[str, Callable[[Path], object]], Callable[[bytes], bool]]


# --- by chance ------------------------------------------------------------------------------------------------------


def use_road(path: Path) -> None:
    parameters = read_parameters(path)
    check(parameters)
    RoadGeometry(parameters)
    again = RoadParameters.from_dict(json.loads(parameters.to_json()))
    assert again == parameters


@fuzz(40, 5000)
def test_roads(put: Put, count: int) -> None:
    for_all(json_files([full(), read_json(PRESETS / "classes.json")]), count, put("road.json", use_road))


def use_scenario(path: Path) -> None:
    scenario = load_scenario(str(path))
    setting_of(load_device(scenario.scan.device), scenario.scan)
    scenario.own_materials()
    scenario.settings()
    scenario.cloud.scheme()
    assert Scenario.from_dict(json.loads(scenario.to_json())) == scenario


@fuzz(40, 4000)
def test_scenarios(put: Put, count: int) -> None:
    documents = [*every("scenarios/*.json"), Scenario().to_dict()]
    for_all(json_files(documents), count, put("scenario.json", use_scenario))


@fuzz(10, 1000)
def test_roads_sampled_from_scenarios(count: int) -> None:
    """Limits that pass the checks are sampled, or refused because they contradict each other."""
    documents = [
        {"length": 150.0, **scenario.get("road", {}), "elevation_model": None} for scenario in every("scenarios/*.json")
    ]
    documents = [{**document, "length": min(document["length"], 300.0)} for document in documents]

    def body(data: Any) -> None:
        def sample() -> None:
            road = RoadScenario.from_dict(data, "road")
            if road.length <= 2000.0:  # longer ones take their time
                RoadGeometry(sample_road(road, 3))

        accepted(sample)

    for_all(wrong_values(documents), count, body)


def use_device(path: Path) -> None:
    setting = setting_of(load_device(str(path)), Scenario().scan)
    assert setting.pulses_per_line >= 0
    assert setting.angle_step > 0.0


@fuzz(40, 3000)
def test_devices(put: Put, count: int) -> None:
    for_all(json_files(every("devices/*.json")), count, put("device.json", use_device))


@fuzz(20, 3000)
def test_recipes(put: Put, count: int) -> None:
    small = {"title": "t", "set": {"fidelity": "draft", "road.length": 40}, "layouts": ["pointcept"], "tile": 30.0}
    small["groups"] = [
        {"name": "a", "scenes": 3, "split": {"train": 2, "val": 1}, "variants": [{"seed": 1}, {"seed": 2}]}
    ]
    documents = [small, read_yaml(RECIPES / "small-roads.yaml")]
    for_all(yaml_files(documents), count, put("recipe.yaml", lambda path: scene_jobs(load_recipe(str(path)))))


@fuzz(20, 1500)
def test_axes_in_csv(put: Put, count: int) -> None:
    road = RoadScenario()
    files = [text.encode() for text in AXES]
    for_all(damaged(files), count, put("axis.csv", lambda path: axis_from_file(path, road, 1)))


@fuzz(20, 1500)
def test_axes_in_geojson(put: Put, count: int) -> None:
    road = RoadScenario()
    for_all(json_files(LINES), count, put("axis.geojson", lambda path: axis_from_file(path, road, 1)))


def use_trajectory(path: Path) -> None:
    guide = PolylineGuide(np.array(LINE)[:, :2] - LINE[0][:2], [*LINE[0][:2], 0.0])
    route = make_platform(kind="trajectory", file=str(path)).make_path(guide, [*LINE[0][:2], 0.0])
    for strip in route.strips:
        place, _ = route.pose(strip, np.linspace(strip.start_time, strip.start_time + strip.duration, 9))
        assert np.isfinite(place).all()


@fuzz(20, 1500)
def test_trajectories(put: Put, count: int) -> None:
    for_all(damaged([TRAJECTORY.encode()]), count, put("trajectory.csv", use_trajectory))


@fuzz(10, 1000)
def test_asset_libraries(put: Put, tmp_path: Path, count: int) -> None:
    documents = every("assets/*/library.json")
    body = put("library.json", lambda path: read_asset_library(str(path)))
    for file in LIBRARIES.glob("*/*.*"):
        (tmp_path / file.name).write_bytes(b"something")
    for_all(json_files(documents), count, body)


@fuzz(10, 1000)
def test_material_tables(put: Put, count: int) -> None:
    documents = [read_json(PRESETS / "materials.json"), *every("material_tables/*.json")]
    for_all(json_files(documents), count, put("materials.json", read_material_table))


@fuzz(10, 1000)
def test_tables_of_classes(put: Put, count: int) -> None:
    documents = [read_json(PRESETS / "classes_5.json"), {"objects": {"Pillar*": "pole"}, "materials": {"Tar": "road"}}]

    def use(path: Path) -> None:
        with suppress(InputError):
            class_scheme(str(path))
        ClassMapping.from_dict(read_json(path), source=str(path))

    for_all(json_files(documents), count, put("classes.json", use))


@fuzz(10, 500)
def test_catalogues_of_signs(put: Put, count: int) -> None:
    documents = [read_json(PRESETS / "signs.json")]
    for_all(
        json_files(documents), count, put("signs.json", lambda path: SignCatalogue.from_dict(read_json(path), "signs"))
    )


@fuzz(10, 1000)
def test_manifests(put: Put, count: int) -> None:
    def use(path: Path) -> None:
        faults(path.parent, read_manifest(path.parent).scenes)

    for_all(json_files([MANIFEST]), count, put("manifest.json", use))


@fuzz(10, 1000)
def test_centrelines(put: Put, count: int) -> None:
    for_all(json_files(LINES), count, put("line.geojson", read_centerline))


@fuzz(20, 1000)
def test_changes_on_the_command_line(count: int) -> None:
    texts = [b"road.length=800", b'scan.platform={"kind": "vehicle"}', b"outputs=[]", b"seed=3"]

    def body(content: bytes) -> None:
        text = content.decode("utf-8", errors="surrogateescape")
        data = Scenario().to_dict()
        accepted(lambda: Scenario.from_dict(apply_change(data, text, Scenario)))
        accepted(lambda: parse_change(text, Scenario))

    for_all(damaged(texts), count, body)


# --- found so ------------------------------------------------------------------------------------------------------


def refused(action: Callable[[], object], match: str, error: type[InputError] = InputError) -> None:
    with pytest.raises(error, match=match) as caught:
        action()
    assert str(caught.value).isprintable()


def test_numbers_of_thousands_of_digits_and_brackets_within_brackets(tmp_path: Path) -> None:
    path = tmp_path / "axis.geojson"
    for text in ('{"type": "LineString", "coordinates": [[' + "9" * 5000 + ", 0]]}", "[" * 200_000):
        path.write_text(text)
        refused(lambda: read_axis(path), r"axis\.geojson: valid JSON is needed")
    path.write_text('{"type": "LineString", "coordinates": [[1' + "0" * 400 + ", 0], [0, 0]]}")
    refused(lambda: read_axis(path), r"coordinates\[0\] x is 10+\.\.\.0+: a finite number of at most 1e\+08 m")


@pytest.mark.parametrize(
    ("row", "x", "y", "said"),
    [
        (7, 0.0, 5000.0, "point 8 .*turns back after a step of more than 500 m: is a digit of a point missing"),
        (0, 5000.0, 0.0, "point 2 .*turns back"),
        (7, 0.0, -5e6, "point [89] .*is 5000 km from the point before, at most 20 km"),
        (14, -265_000.0, 0.0, "point 15 .*is 265 km from the point before"),
    ],
)
def test_points_of_an_axis_that_lost_a_digit(tmp_path: Path, row: int, x: float, y: float, said: str) -> None:
    """The fit took minutes to find a road through them."""
    points = np.array(LINE)
    points[row, :2] += x, y
    np.savetxt(tmp_path / "axis.csv", points, delimiter=",", header="x,y,z", comments="")
    refused(lambda: read_axis(tmp_path / "axis.csv"), said)


def test_points_that_no_road_runs_through(tmp_path: Path) -> None:
    """The elevations of a file whose columns are another's were told by a traceback."""
    points = np.array(LINE)
    points[:, 2] += np.linspace(0.0, 40_000.0, len(points))
    np.savetxt(tmp_path / "axis.csv", points, delimiter=",", header="x,y,z", comments="")
    refused(
        lambda: axis_from_file(tmp_path / "axis.csv", RoadScenario(), 1),
        r"z of point \d+ is 40\d\d\d.*: no land lies higher than 9,000 m",
    )


def test_entries_of_csv_that_are_too_long(tmp_path: Path) -> None:
    (tmp_path / "axis.csv").write_text("x,y\n1," + "2" * 200_000 + "\n")
    refused(lambda: read_axis(tmp_path / "axis.csv"), r"axis\.csv:2 is '1,22.*: a line of CSV is needed")


@pytest.mark.parametrize(
    "field", ["road.elevation_model", "road.textures", "materials_table", "scan.device", "road.assets"]
)
def test_null_bytes_in_the_names_of_files(field: str) -> None:
    value = json.dumps(["a\0.json"] if field == "road.assets" else "a\0.json")
    scenario = load_scenario("rq31-600m-even", [f"{field}={value}", "road.length=40", "road.surroundings=true"][:2])

    def use() -> None:
        scenario.own_materials()
        load_device(scenario.scan.device)
        sample_road(scenario.road, 1)

    refused(use, "null (byte|character)", MissingFileError)


def test_a_key_twice(tmp_path: Path) -> None:
    """The usual reading keeps the last one, and an object of the road is gone."""
    path = tmp_path / "a.json"
    path.write_text('{"objects": {"a": 1, "b": 2, "a": 3}}')
    refused(lambda: read_json(path), "an object has the key 'a' twice")
    path.write_text("a:\n  b: 1\n  b: 2\n")
    refused(lambda: read_yaml(path), "the key 'b' is there twice")


def test_aliases_of_aliases_are_counted_and_not_followed(tmp_path: Path) -> None:
    """Ten lines that stand for 9^10 values; aliases as people use them are taken."""
    path = tmp_path / "bomb.yaml"
    lines = ["a0: &a0 [x,x,x,x,x,x,x,x,x]", *(f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 11))]
    path.write_text("\n".join(lines))
    refused(lambda: read_yaml(path), r"more than 100,000 values, with aliases")
    path.write_text("\n".join(["b: &b {x: 1}", *(f"c{n}: &c{n} {{<<: [*b, *b]}}" for n in range(9))]))
    assert read_yaml(path)["c8"] == {"x": 1}


@pytest.mark.parametrize("text", ["!!int ''", "!!float ''", "!!bool x", "!!timestamp x"])
def test_tags_before_what_they_do_not_fit(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.yaml").write_text(f"title: {text}")
    refused(lambda: read_yaml(tmp_path / "a.yaml"), "a value is not what its tag says")


def test_half_a_surrogate_pair_in_yaml(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text('title: "\\ud800"')
    refused(lambda: read_yaml(tmp_path / "a.yaml"), "surrogates not allowed")


def test_keys_of_any_length_are_shown_in_part() -> None:
    with pytest.raises(InputError, match="unknown key 'xxx") as caught:
        Scenario.from_dict({"x" * 200_000: 1}, "s" * 5000)
    assert len(str(caught.value)) < 1500
    assert str(InputError("a\nb\0", "c\x1b", "d\u2028e")) == r"a b\x00 is 'c\x1b': d e"


def test_alignments_longer_than_any_road_are_refused(tmp_path: Path) -> None:
    """Their tables would fill the memory."""
    data = full()
    element = {"kind": "arc", "length": 1e9, "curvature_start": 0.1, "curvature_end": 0.1}
    data["objects"]["axis"]["horizontal"] = [element]
    refused(
        lambda: RoadParameters.from_dict(data),
        r"horizontal\.0\.length is 1000000000\.0: .* less than or equal to 1000000",
    )
    data["objects"]["axis"]["horizontal"] = [{**element, "length": 9e5}] * 2
    refused(lambda: RoadParameters.from_dict(data), r"must be at most 1e\+06 m long together")


def test_dashes_shorter_than_any_paint_are_refused() -> None:
    data = full()
    line = next(item for item in data["objects"].values() if item["type"] == "LineMarking" and item["dash_length"])
    line["dash_length"] = line["gap_length"] = 1e-300
    refused(lambda: RoadParameters.from_dict(data), r"must be 0 \(solid\) or at least 0\.05 m")


def test_changes_nested_beyond_reason() -> None:
    refused(lambda: apply_change({}, "a." * 5000 + "b=1", Scenario), "--set is 'a.a.*must be path=value")
    assert parse_change("a=" + "[" * 100_000, Scenario)[1] == "[" * 100_000
