"""Data sets without Blender: recipes, manifests, and layouts read back by the rules of those who load them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from scipy import stats

from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.dataset.changes import change_recipe
from synthroads_addon.dataset.data_card import data_card
from synthroads_addon.dataset.layouts import layout_descriptions, write_layouts
from synthroads_addon.dataset.manifest import (
    Manifest,
    SceneEntry,
    check_same_recipe,
    faults,
    file_entries,
    make_manifest,
    write_manifest,
)
from synthroads_addon.dataset.recipe import DrawnValue, Recipe, SceneJob, load_recipe, recipe_names, scene_jobs
from synthroads_addon.materials.table import materials
from synthroads_addon.road.things.gantry import Gantry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.clouds.random_points import make_points

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
TINY: dict[str, Any] = {"title": "Tiny", "seed": 5, "groups": [{"name": "a", "scenes": 3}]}


def recipe(**changes: Any) -> Recipe:
    return Recipe.from_dict({**TINY, **changes})


# --- recipes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", recipe_names())
def test_built_in_recipes_load_and_their_scanners_can_do_what_they_ask_for(name: str) -> None:
    jobs = scene_jobs(load_recipe(name))
    assert jobs
    for job in jobs:
        assert scanner_setting(job.scenario.scan), job.name


def test_reference_set_is_what_it_says() -> None:
    jobs = scene_jobs(load_recipe("reference"))
    five = [job.scenario for job in jobs if job.scenario.cloud.classes == "5"]
    rest = [job.scenario for job in jobs if job.scenario.cloud.classes == "17"]
    assert (len(five), len(rest)) == (20, 6)
    assert sorted(scenario.road.length for scenario in five) == [600.0] * 16 + [800.0] * 4
    assert sum(bool(scenario.road.assets) for scenario in five) == 7
    assert all(scenario.road.furniture.gantry_spacing for scenario in rest)
    assert len({job.scenario.seed for job in jobs}) == len(jobs)


def test_stand_in_set_is_of_another_domain_and_trains_without_gantries() -> None:
    jobs = scene_jobs(load_recipe("standin"))
    ours = scene_jobs(load_recipe("reference"))[0].scenario
    splits = {split: [job.scenario for job in jobs if job.split == split] for split in {job.split for job in jobs}}
    assert set(splits) == {"train", "validation", "test", "test_tripod", "test_gantries"}
    for job in jobs:
        assert job.scenario.scan.device != ours.scan.device
        assert job.scenario.own_materials()["asphalt"] != materials()["asphalt"]
        assert bool(job.scenario.road.furniture.gantry_spacing) == (job.split == "test_gantries")
    devices = {split: {scenario.scan.device for scenario in scenarios} for split, scenarios in splits.items()}
    assert devices["train"] == devices["test"] != devices["test_tripod"]
    assert set(jobs[0].scenario.own_materials()) <= set(materials())


def test_every_road_of_the_small_sets_for_gantries_has_some() -> None:
    changes = [("fidelity", "draft"), ("road.length", 240), ("road.half_width", 35)]  # as docs/segmentation.md has it
    small = load_recipe("standin")
    groups = [group.model_copy(update={"set": {**group.set, **dict(changes)}}) for group in small.groups]
    jobs = scene_jobs(load_recipe("small-gantries")) + scene_jobs(small.model_copy(update={"groups": tuple(groups)}))
    kinds: dict[str, set[str]] = {}
    for job in jobs:
        road = sample_road(job.scenario.road, job.scenario.seed)
        found = [item.kind for item in road.objects.values() if isinstance(item, Gantry)]
        assert bool(found) == (job.name.startswith("gantries")), job.name
        kinds.setdefault(job.split, set()).update(found)
    assert kinds["train"] == {"one_sided", "two_sided", "cantilever"}, "what is to be learned"
    assert kinds["test_gantries"] == kinds["train"]


def test_a_scene_does_not_depend_on_the_others() -> None:
    groups = [{"name": "a", "scenes": 3, "variants": [{"road.length": 100.0}, {"road.length": 200.0}]}]
    short = scene_jobs(recipe(groups=groups))
    longer = scene_jobs(recipe(groups=[{"name": "z", "scenes": 2}, {**groups[0], "scenes": 8}]))
    assert [job.scenario for job in short] == [job.scenario for job in longer[2:5]]
    assert [job.name for job in longer[2:5]] == [job.name for job in short]


def test_variants_come_equally_often() -> None:
    variants = [{"road.length": 100.0 + k} for k in range(4)]
    jobs = scene_jobs(recipe(groups=[{"name": "a", "scenes": 12, "variants": variants}]))
    lengths = [job.scenario.road.length for job in jobs]
    assert all(lengths.count(100.0 + k) == 3 for k in range(4))
    assert lengths != sorted(lengths)


def test_another_seed_gives_other_scenes() -> None:
    ours, others = ([job.scenario.seed for job in scene_jobs(recipe(seed=seed))] for seed in (1, 2))
    assert not set(ours) & set(others)


def test_what_every_scene_needs_is_there() -> None:
    job = scene_jobs(recipe(set={"outputs": ["previews"]}))[0]
    assert job.scenario.outputs == ("parameters", "cloud", "centerline", "previews")


WRONG = {
    "two groups": ({"groups": [{"name": "a", "scenes": 1}] * 2}, "two groups are named a"),
    "splits": ({"groups": [{"name": "a", "scenes": 3, "split": {"train": 1}}]}, "must add up to scenes, 3"),
    "a path": ({"set": {"road.lenght": 5}}, r"groups.a: road.*unknown key 'lenght' \(did you mean 'length'\?\)"),
    "a value": ({"set": {"road.length": -5}}, "groups.a: road.length is -5"),
    "a name": ({"groups": [{"name": "../a", "scenes": 1}]}, "groups.0.name"),
    "unstable": ({"set": {"outputs": ["scene"]}}, "a data set can't hold scene"),
    "a key": ({"gruops": []}, "unknown key 'gruops'"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_recipes_are_refused(name: str) -> None:
    changes, message = WRONG[name]
    with pytest.raises(InputError, match=message):
        scene_jobs(recipe(**changes))


@pytest.mark.parametrize("text", ["a: [", "a: !!python/object:os.system {}", "a: &x [*x]", "\x00", "a: .nan"])
def test_what_is_no_yaml_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "recipe.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"must be valid YAML|unknown key"):
        load_recipe(str(file))


def test_missing_and_unknown_recipes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        load_recipe(str(tmp_path / "recipe.yaml"))
    with pytest.raises(InputError, match=r"did you mean 'reference'"):
        load_recipe("referenc")


# --- drawn values ----------------------------------------------------------------------------------------------------

FIXED = {"centerline-airborne-even"}
"""Recipes that draw nothing: of a sensor without errors, for pairs."""
ONLY_WITH = {
    "scan.receiver.range_walk": "scan.noise.speckle",
    "scan.receiver.faint_range_sigma": "scan.noise.range_sigma",
    "scan.receiver.full_scale": "scan.receiver.response",
}
"""Fields that do nothing without another one."""


def value_at(scenario: Any, path: str) -> Any:
    for name in path.split("."):
        scenario = getattr(scenario, name)
    return scenario


def drawn_fields(data: Recipe) -> Iterator[tuple[str, DrawnValue, list[SceneJob]]]:
    """Yield each field that a recipe or a group draws, with its values and the scenes that they are for."""
    jobs = scene_jobs(data)
    yield from ((path, value, jobs) for path, value in data.draw.items())
    for group in data.groups:
        own = [job for job in jobs if job.name.rpartition("-")[0] == group.name]
        yield from ((path, value, own) for path, value in group.draw.items())


@pytest.mark.parametrize("name", sorted(set(recipe_names()) - FIXED))
def test_built_in_recipes_draw_the_sensor_and_every_drawn_value_is_used(name: str) -> None:
    """Each lies in its range, differs from scene to scene, and has what it needs to matter."""
    drawn = list(drawn_fields(load_recipe(name)))
    for part in ("scan.noise.", "scan.receiver.", "scan.platform.", "scan.relief"):
        assert any(path.startswith(part) for path, _, _ in drawn), part
    for path, value, jobs in drawn:
        if value.one_of:
            continue
        found = [value_at(job.scenario, path) for job in jobs if path.split(".")[1] != "platform" or has(job, path)]
        low, high = value.minimum, value.maximum
        assert low is not None
        assert high is not None
        # Some groups have a fixed value instead: tripods don't sway.
        inside = {number for number in found if number is not None and low <= number <= high}
        assert len(inside) >= 0.4 * len(jobs), path
        if needed := ONLY_WITH.get(path):
            assert all(effective(job.scenario, needed) for job in jobs), f"{path} without {needed}"


def has(job: SceneJob, path: str) -> bool:
    return hasattr(job.scenario.scan.platform, path.rpartition(".")[2])


def effective(scenario: Scenario, path: str) -> Any:
    """Return a field's value as the scan has it, the device's included."""
    if path == "scan.receiver.response":
        return scanner_setting(scenario.scan).receiver.response == "range_compensated"
    return value_at(scenario, path)


def values_drawn(**fields: Any) -> list[Any]:
    """Return 400 values that are drawn with seeds of their own, as scenes draw them."""
    value = DrawnValue.from_dict(fields)
    return [value.draw(stream(seed, "draw", "a-01", "scan.relief")) for seed in range(400)]


@pytest.mark.parametrize("scale", ["linear", "logarithmic"])
def test_drawn_numbers_are_uniform_on_their_scale(scale: str) -> None:
    numbers = np.array(values_drawn(minimum=200.0, maximum=800.0, scale=scale))
    share = (numbers - 200.0) / 600.0 if scale == "linear" else np.log(numbers / 200.0) / np.log(4.0)
    counts = np.histogram(share, 10, (0.0, 1.0))[0]
    assert counts.sum() == 400
    assert stats.chisquare(counts).pvalue > 0.001


def test_listed_values_are_drawn_alike_often() -> None:
    found = values_drawn(one_of=["a", "b", "c", "d"])
    assert stats.chisquare([found.count(value) for value in "abcd"]).pvalue > 0.001


RELIEF = {"scan.relief": {"minimum": 0.5, "maximum": 1.5}}


def test_a_scene_draws_the_same_whatever_else_is_drawn() -> None:
    others = {"scan.noise.speckle": {"minimum": 0.1, "maximum": 0.2}}
    alone, beside = (scene_jobs(recipe(draw=draw)) for draw in (RELIEF, others | RELIEF))
    assert [job.scenario.scan.relief for job in alone] == [job.scenario.scan.relief for job in beside]


def test_a_group_overrides_what_the_recipe_draws() -> None:
    groups = [{"name": "a", "scenes": 2, "set": {"scan.relief": 3.0}}, {"name": "b", "scenes": 2, "draw": RELIEF}]
    jobs = scene_jobs(recipe(draw={"scan.relief": {"minimum": 5.0, "maximum": 6.0}}, groups=groups))
    assert [job.scenario.scan.relief for job in jobs[:2]] == [3.0, 3.0]
    assert all(0.5 <= job.scenario.scan.relief <= 1.5 for job in jobs[2:])


WRONG_DRAWS = {
    "both": ({"set": {"scan.relief": 1.0}, "draw": RELIEF}, "set and draw both name scan.relief"),
    "part": ({"set": {"scan.noise.speckle": 0.1}, "draw": {"scan.noise": {"one_of": [{}]}}}, "both name"),
    "half": ({"draw": {"scan.relief": {"minimum": 1.0}}}, "minimum and maximum, or one_of"),
    "turned": ({"draw": {"scan.relief": {"minimum": 2.0, "maximum": 1.0}}}, "must be below maximum, 1"),
    "two": ({"draw": {"scan.relief": {"minimum": 1.0, "one_of": [1.0]}}}, "can't both be given"),
    "ratio": ({"draw": {"scan.relief": {"minimum": 0.0, "maximum": 1.0, "scale": "logarithmic"}}}, "above 0"),
    "field": ({"draw": {"scan.releif": {"minimum": 0.0, "maximum": 1.0}}}, "did you mean 'relief'"),
    "limits": ({"draw": {"scan.relief": {"minimum": -2.0, "maximum": -1.0}}}, r"groups.a: scan.relief is -1\."),
}


@pytest.mark.parametrize("name", WRONG_DRAWS)
def test_wrong_draws_are_refused(name: str) -> None:
    changes, message = WRONG_DRAWS[name]
    with pytest.raises(InputError, match=message):
        scene_jobs(recipe(**changes))


def test_what_the_command_line_sets_is_not_drawn() -> None:
    groups = [{"name": "a", "scenes": 3, "draw": RELIEF}]
    changed = change_recipe(recipe(draw=RELIEF, groups=groups), ["scan.relief=2"])
    assert {job.scenario.scan.relief for job in scene_jobs(changed)} == {2.0}


def test_the_data_card_says_what_is_drawn() -> None:
    data = recipe(draw=RELIEF, groups=[{"name": "a", "scenes": 1, "draw": {"road.length": {"one_of": [100.0, 200.0]}}}])
    card = data_card(data, make_manifest("T", "g", "", [], 0), scene_jobs(data))
    assert "  - `scan.relief`: 0.5 to 1.5\n  - `road.length` (a): one of 100.0, 200.0\n" in card


# --- manifests -------------------------------------------------------------------------------------------------------


def entry(folder: Path) -> SceneEntry:
    data = {"name": "a-01", "split": "train", "seed": 1, "status": "done", "files": file_entries(folder)}
    return SceneEntry.from_dict(data)


def test_faults_are_found(tmp_path: Path) -> None:
    for name in ("same", "gone", "longer", "changed"):
        (tmp_path / name).write_text("content")
    scene = entry(tmp_path)
    assert faults(tmp_path, [scene]) == []
    (tmp_path / "gone").unlink()
    (tmp_path / "longer").write_text("content, and more")
    (tmp_path / "changed").write_text("CONTENT")
    assert faults(tmp_path, [scene]) == [
        "changed has another checksum",
        "gone is missing",
        "longer has 17 bytes, not 7",
    ]
    assert len(faults(tmp_path, [scene], checksums=False)) == 2


def test_another_recipe_or_version_is_not_continued(tmp_path: Path) -> None:
    write_manifest(tmp_path, make_manifest("T", "SynthRoads 1", "recipe", [], 1))
    assert not check_same_recipe(tmp_path, "recipe", "SynthRoads 1").complete
    with pytest.raises(InputError, match="begun with another recipe"):
        check_same_recipe(tmp_path, "other recipe", "SynthRoads 1")
    with pytest.raises(InputError, match="begun with SynthRoads 1; this is SynthRoads 2"):
        check_same_recipe(tmp_path, "recipe", "SynthRoads 2")


def test_card_tells_what_is_there_and_what_failed() -> None:
    jobs = scene_jobs(recipe(description="For a test."))
    scenes = [
        {"name": "a-01", "split": "train", "seed": 1, "status": "done", "points": 1234, "length": 100.0},
        {"name": "a-02", "split": "train", "seed": 2, "status": "failed", "error": "road.length: no room"},
    ]
    scenes[0]["classes"] = {"road": 1000, "ground": 234}
    data = {"title": "T", "generator": "SynthRoads 1", "recipe_sha256": "0" * 64, "complete": False, "scenes": scenes}
    card = data_card(recipe(description="For a test."), Manifest.from_dict(data), jobs)
    wanted = ("# Tiny", "For a test.", "1,234 points", "CC-BY-4.0", "a-02: road.length: no room", "| road | 1,000 |")
    for words in wanted:
        assert words in card


# --- layouts ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def cloud(tmp_path: Path) -> tuple[Path, PointBlock]:
    """A cloud of 20,000 points over 150 m x 90 m, one in fifty of them unlabelled."""
    rng = np.random.default_rng(7)
    points = make_points(20_000)
    low, size = ORIGIN + [-30.0, -20.0, -5.0], np.array([150.0, 90.0, 12.0])
    points.xyz[:] = np.round((low + size * rng.random((20_000, 3))) * 1000.0) / 1000.0
    points.class_id[:] = rng.integers(0, 5, 20_000)
    points.class_id[::50] = 255
    points.instance_id[:] = rng.choice([0, 1, 70_000, 2**31 - 1], 20_000)
    points.intensity[:] = rng.random(20_000)
    points.rgb[:] = rng.integers(0, 256, (20_000, 3)) * 257
    path = tmp_path / "cloud.laz"
    with open_writer(path, 25832, ORIGIN, 65535.0, scheme=class_scheme("5").as_stored()) as writer:
        writer.write(points)
    return path, points


def made(cloud: Path, folder: Path, **changes: Any) -> None:
    whole = recipe(layouts=["pointcept", "semantickitti"], smallest_tile=1, set={"cloud.classes": "5"}, **changes)
    job = scene_jobs(whole)[1]
    folder.mkdir()
    write_layouts(cloud, folder, whole, job, ORIGIN)


def read_pointcept(root: Path, split: str) -> dict[str, dict[str, NDArray[Any]]]:
    """Load as Pointcept's DefaultDataset does: every folder of a split is a sample, its arrays are the .npy files."""
    valid = {"coord", "color", "normal", "strength", "segment", "instance", "pose"}
    samples = {}
    for folder in sorted((root / split).glob("*")):
        data = {path.stem: np.load(path) for path in folder.glob("*.npy") if path.stem in valid}
        data["coord"] = data["coord"].astype(np.float32)
        data["color"] = data["color"].astype(np.float32)
        data["segment"] = data["segment"].reshape([-1]).astype(np.int32)
        data["instance"] = data["instance"].reshape([-1]).astype(np.int32)
        samples[folder.name] = data
    return samples


def test_pointcept_reads_every_point_back(cloud: tuple[Path, PointBlock], tmp_path: Path) -> None:
    path, points = cloud
    made(path, tmp_path / "set", point_spacing=None)
    root = tmp_path / "set" / "pointcept" / "classes-5"
    samples = read_pointcept(root, "train")
    found = []
    for name, data in samples.items():
        assert name.startswith("a-02-")
        corner = json.loads((root / "train" / name / "tile.json").read_text())["origin"]
        assert data["coord"][:, :2].min() >= 0.0
        assert data["coord"][:, :2].max() < 60.0
        assert data["strength"].shape == (len(data["coord"]), 1)
        found.append(np.column_stack([data["coord"] + np.array(corner), data["segment"], data["instance"],
                                      data["color"], data["strength"]]))  # fmt: skip
    rows = np.concatenate(found)
    segment = np.where(points.class_id == 255, -1, points.class_id.astype(int))
    instance = np.where(points.instance_id == 0, -1, points.instance_id.astype(np.int64))
    truth = np.column_stack([points.xyz, segment, instance, points.rgb / 257, points.intensity])
    assert len(samples) == 9  # 4 columns by 3 rows cut 150 m x 90 m from -30, -20, less those that it doesn't reach
    rows, truth = (array[np.lexsort(np.round(array[:, :3], 3).T)] for array in (rows, truth))
    np.testing.assert_allclose(rows[:, :3], truth[:, :3], atol=1e-5)
    np.testing.assert_array_equal(rows[:, 3:8], truth[:, 3:8])
    np.testing.assert_allclose(rows[:, 8], truth[:, 8], atol=1.0 / 65535.0)


def read_semantickitti(root: Path, sequence: str) -> list[tuple[NDArray[Any], ...]]:
    """Load as semantic-kitti-api does: N x 4 float32, uint32 labels of the same number, poses in calibrated frames."""
    folder = root / "sequences" / sequence
    calibration = {}
    for line in (folder / "calib.txt").read_text().splitlines():
        key, content = line.strip().split(":")
        pose = np.eye(4)
        pose[:3] = np.array([float(value) for value in content.split()]).reshape(3, 4)
        calibration[key] = pose
    inverse = np.linalg.inv(calibration["Tr"])
    frames = []
    lines = (folder / "poses.txt").read_text().splitlines()
    for number, line in enumerate(lines):
        pose = np.eye(4)
        pose[:3] = np.array([float(value) for value in line.split()]).reshape(3, 4)
        pose = inverse @ pose @ calibration["Tr"]
        scan = np.fromfile(folder / "velodyne" / f"{number:06d}.bin", dtype=np.float32).reshape((-1, 4))
        label = np.fromfile(folder / "labels" / f"{number:06d}.label", dtype=np.uint32).reshape(-1)
        assert len(label) == len(scan)
        frames.append((pose, scan[:, :3], scan[:, 3], label & 0xFFFF, label >> 16))
    assert len(list((folder / "velodyne").iterdir())) == len(lines)
    return frames


def test_semantickitti_reads_every_point_back(cloud: tuple[Path, PointBlock], tmp_path: Path) -> None:
    path, points = cloud
    made(path, tmp_path / "set", point_spacing=None)
    root = tmp_path / "set" / "semantickitti" / "classes-5"
    folder = root / "sequences" / "01"
    origin = np.array(json.loads((folder / "sequence.json").read_text())["origin"])
    numbers = {0: 0} | {int(k): v for k, v in json.loads((folder / "instances.json").read_text()).items()}
    rows = [
        np.column_stack([(pose @ np.c_[xyz, np.ones(len(xyz))].T).T[:, :3] + origin, remission, semantic,
                         [numbers[int(value)] for value in instance]])
        for pose, xyz, remission, semantic, instance in read_semantickitti(root, "01")
    ]  # fmt: skip
    found = np.concatenate(rows)
    semantic = np.where(points.class_id == 255, 0, points.class_id.astype(int) + 1)
    truth = np.column_stack([points.xyz, points.intensity, semantic, points.instance_id])
    found, truth = (array[np.lexsort(np.round(array[:, :3], 3).T)] for array in (found, truth))
    np.testing.assert_allclose(found[:, :3], truth[:, :3], atol=1e-5)
    np.testing.assert_allclose(found[:, 3], truth[:, 3], atol=1.0 / 65535.0)
    np.testing.assert_array_equal(found[:, 4:], truth[:, 4:])


def test_semantickitti_configuration_names_every_label() -> None:
    whole = recipe(
        layouts=["semantickitti"],
        groups=[{"name": "a", "scenes": 3, "split": {"train": 2, "validation": 1}}],
        set={"cloud.classes": "5"},
    )
    (text,) = layout_descriptions(whole, scene_jobs(whole)).values()
    data = yaml.safe_load(text)
    assert data["labels"] == {0: "unlabeled"} | {row.id + 1: row.name for row in class_scheme("5").rows}
    assert data["split"] == {"train": [0, 1], "valid": [2], "test": []}
    for key, value in data["learning_map"].items():
        assert data["learning_map_inv"][value] == key


def test_points_are_thinned_and_small_tiles_left_out(cloud: tuple[Path, PointBlock], tmp_path: Path) -> None:
    path, _ = cloud
    made(path, tmp_path / "thin", point_spacing=5.0)
    thin = read_pointcept(tmp_path / "thin" / "pointcept" / "classes-5", "train")
    for data in thin.values():
        assert len(np.unique(np.floor(data["coord"] / 5.0), axis=0)) == len(data["coord"])
    whole = recipe(layouts=["pointcept"], smallest_tile=3000, set={"cloud.classes": "5"}, point_spacing=None)
    write_layouts(path, tmp_path, whole, scene_jobs(whole)[0], ORIGIN)
    kept = read_pointcept(tmp_path / "pointcept" / "classes-5", "train")
    assert 0 < len(kept) < len(thin)
    assert all(len(data["coord"]) >= 3000 for data in kept.values())
