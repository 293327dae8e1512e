"""Experiments with centrelines: real roads left out in turns, and a table of what each variant does on them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch

from headless import cli
from ml.centerline import experiment
from ml.centerline.experiment import table
from ml.configuration import EXPERIMENTS
from ml.data.batches import APART, DataOptions, MeasuredRoad, read_roads
from ml.experiments import RESULTS, TABLE, configurations, load_experiment
from ml.runs import CHECKPOINT, CONFIGURATION
from synthroads_addon.base.errors import InputError, MissingFileError
from tests.helpers.clouds.road_data_sets import write_cloud, write_data_set
from tests.helpers.roads import analytic_roads

torch.set_num_threads(1)
ROADS = ("east", "north", "west")
SMALL = {"cells": 4, "point_width": 8, "width": 16, "context": 16, "layers": 1, "heads": 2, "name": "transformer"}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a data set, and with three real roads beside files that are none."""
    folder = tmp_path_factory.mktemp("data")
    write_data_set(folder / "synthetic")
    (folder / "real").mkdir()
    for number, name in enumerate(ROADS):
        write_real(folder / "real", name, 11 + number)
    write_cloud(folder / "real" / "street.laz", analytic_roads.points(seed=11))
    (folder / "real" / "README.md").write_text("About them.")
    return folder


def write_real(folder: Path, name: str, seed: int) -> None:
    points, (road,) = analytic_roads.points(seed=seed), analytic_roads.roads(seed=seed)
    write_cloud(folder / f"{name}.laz", points)
    rows = (road.known_truth.axis.points + road.origin).tolist()
    text = "".join(f"{x:.4f},{y:.4f},{z:.4f}\n" for x, y, z in rows)
    (folder / f"{name}_axis.csv").write_text(f"x,y,z\n{text}")


@pytest.fixture
def words(data: Path, tmp_path: Path) -> list[str]:
    """Return the command of a toy experiment over three variants."""
    own = {
        "task": "centerline",
        "title": "Toy",
        "configuration": str(tmp_path / "toy.yaml"),
        "set": {"data.measured_validation_share": 0.3},
        "data": {"real": [{"cloud": "{real}"}], "synthetic": ["{synthetic}"]},
        "variants": {
            "real": {"set": {"data.data_sets": []}},
            "synthetic": {"set": {"data.measured": []}},
            "mixed": {"set": {"data.measured_share": 0.25}},
            "narrow": {"of": "synthetic", "set": {"use.step": 5}},
        },
        "seeds": [1],
    }
    toy = {
        "task": "centerline",
        "threads": 1,
        "data": {"data_sets": ["nowhere"]},
        "slices": {"half_width": 20.0, "points_per_slice": 48, "slices": 3},
        "network": SMALL,
        "batches": {"size": 2, "steps": 2, "passes": 2, "validation": 2},
        "schedule": {"epochs": 1},
    }
    (tmp_path / "toy.yaml").write_text(json.dumps(toy))
    (tmp_path / "own.yaml").write_text(json.dumps(own))
    folders = [f"--data={name}={data / name}" for name in ("real", "synthetic")]
    return ["experiment", str(tmp_path / "own.yaml"), *folders, "--output", str(tmp_path / "out"), "--quiet"]


@pytest.mark.slow
def test_each_variant_is_tested_on_roads_that_it_has_not_learned_from(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And goes on where it was stopped: nothing is trained or measured twice."""
    out = tmp_path / "out"
    turns = ["--leave-out", "east,west", "--leave-out", "north"]
    assert cli.main([*words, *turns]) == 0, capsys.readouterr().err
    results = json.loads((out / RESULTS).read_text())
    variants = ["real", "synthetic", "mixed", "narrow"]
    assert {"views", "skeleton", "middle of the bright"} <= set(results)
    for name in variants:
        assert sorted(results[name]["1"]) == sorted(ROADS)
        assert all(results[name]["1"][road]["mae"] > 0 for road in ROADS)
    learned = {
        path.parent.relative_to(out).as_posix(): json.loads(path.read_text())["data"]
        for path in out.rglob(CONFIGURATION)
    }
    assert sorted(learned) == [
        "mixed/without-east+west/seed-1",
        "mixed/without-north/seed-1",
        "real/without-east+west/seed-1",
        "real/without-north/seed-1",
        "synthetic/seed-1",
    ]
    left_out = {name: [road["left_out"] for road in data["measured"]] for name, data in learned.items()}
    assert left_out["real/without-east+west/seed-1"] == left_out["mixed/without-east+west/seed-1"] == [["east", "west"]]
    assert left_out["synthetic/seed-1"] == []
    text = (out / TABLE).read_text()
    assert "| | east | west | north | all |".replace("| |", "|  |") in text
    assert text.count("| best of the rules |") == 2, "of errors, not of intervals"
    value = results["real"]["1"]["north"]["mae"]
    assert f"{value:.3f}" in next(line for line in text.splitlines() if line.startswith("| real |"))
    assert f"{100 * results['mixed']['1']['east']['coverage_68']:.1f}" in text.partition("in 68 %")[2]
    stamps = {path: path.stat().st_mtime_ns for path in out.rglob(CHECKPOINT)}
    with monkeypatch.context() as patch:
        patch.setattr(experiment, "evaluate", None)
        assert cli.main([*words, *turns]) == 0, capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in out.rglob(CHECKPOINT)} == stamps
    assert json.loads((out / RESULTS).read_text()) == results


def test_by_default_each_road_is_left_out_by_itself(words: list[str], data: Path, tmp_path: Path) -> None:
    roads = experiment._real_roads(
        configurations(load_experiment(words[1]), {"real": f"{data}/real", "synthetic": "b"})
    )
    assert list(roads) == list(ROADS), "street.laz has no axis"
    assert experiment._turns((), roads) == [["east"], ["north"], ["west"]]
    for wrong, told in (
        ([["south"]], "must be one of the real roads: east, north, west"),
        ([["east", "east"]], "twice"),
    ):
        with pytest.raises(InputError, match=told):
            experiment._turns(wrong, roads)


def test_what_cannot_be_compared_is_told(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*words, "--leave-out", ",".join(ROADS)]) == 2
    assert "must leave at least one real road for the training" in capsys.readouterr().err
    assert cli.main([*words, "--leave-out", "south"]) == 2
    assert "left_out is 'south': must be one of the real roads: east, north, west" in capsys.readouterr().err
    folders = ["--data", "real=a", "--data", "synthetic=b", "--output", "out", "--leave-out", "a"]
    assert cli.main(["experiment", "gantries", *folders]) == 2
    assert "--leave-out is 'a': is for experiments with centrelines" in capsys.readouterr().err


def test_the_end_of_each_real_road_is_kept_to_validate_with(data: Path) -> None:
    folder = MeasuredRoad(cloud=str(data / "real"), left_out=("north",))
    roads = read_roads(DataOptions(measured=(folder,), measured_validation_share=0.3), "road")
    assert (
        [road.name for road in roads.measured] == [road.name for road in roads.measured_validation] == ["east", "west"]
    )
    for learned, kept in zip(roads.measured, roads.measured_validation, strict=True):
        whole = analytic_roads.roads(seed=11 if learned.name == "east" else 13)[0].known_truth.axis
        assert learned.known_truth.axis.length == pytest.approx(0.7 * whole.length, abs=1.1)
        assert kept.known_truth.axis.length == pytest.approx(0.3 * whole.length - APART, abs=1.1)
        ends = learned.known_truth.axis.points[-1], kept.known_truth.axis.points[0]
        assert float(((ends[0] - ends[1]) ** 2).sum() ** 0.5) == pytest.approx(APART, abs=1.1)
    named = DataOptions(measured=(folder,), measured_validation=(folder,), measured_validation_share=0.3)
    assert read_roads(named, "road").measured[0].known_truth.axis.length > 150


def test_folders_of_real_roads_that_do_not_fit_are_refused(data: Path, tmp_path: Path) -> None:
    real, cases = str(data / "real"), []
    cases += [
        ({"roads": ("south",)}, "roads is 'south': must be one of the roads of"),
        ({"left_out": ROADS}, "must leave at least one road"),
    ]
    cases += [({"axis": "a.csv"}, "is a folder: each of its clouds has its axis in the same folder")]
    for fields, told in cases:
        with pytest.raises(InputError, match=told):
            MeasuredRoad(cloud=real, **fields).files()
    with pytest.raises(MissingFileError, match="must hold a cloud and its axis"):
        MeasuredRoad(cloud=str(tmp_path)).files()
    with pytest.raises(
        MissingFileError, match=r"needs its axis in the same folder, street_axis\.csv or street\.geojson"
    ):
        MeasuredRoad(cloud=f"{real}/street.laz").files()


def test_the_table_has_the_best_rule_of_each_road() -> None:
    def figures(mae: float, **more: float | None) -> dict[str, Any]:
        return {"slices": 100, "mae": mae, "chamfer_windows": 1, "chamfer_full": 2 * mae, **more}

    results = {
        "mixed": {
            str(seed): {"a": figures(0.1 * seed, coverage_68=0.7), "b": figures(0.5, coverage_68=None)}
            for seed in (1, 2)
        },
        "views": {"1": {"a": figures(0.2, coverage_68=0.6), "b": figures(0.2, coverage_68=0.5)}},
        "one": {"1": {"a": figures(0.3), "b": figures(0.9)}},
        "other": {"1": {"a": figures(0.4), "b": figures(0.8)}},
        "the displaced path": {"1": {"a": figures(0.0), "b": figures(0.0)}},
    }
    lines = table("Title", results, ["mixed", "real"]).splitlines()
    assert "| mixed | 0.150 (0.071) | 0.500 | 0.325 (0.035) |" in lines
    assert "| best of the rules | 0.300 | 0.800 | 0.600 |" in lines
    assert "| mixed | 70.0 | – | – |" in lines
    assert lines[-1] == "Seeds: mixed 2."


@pytest.mark.parametrize("path", sorted(EXPERIMENTS.glob("centerline-*.yaml")), ids=lambda path: path.stem)
def test_shipped_experiments_are_whole(path: Path) -> None:
    made = configurations(load_experiment(path.stem), {"real": "a", "synthetic": "b"})
    assert list(made) == ["real", "synthetic", "mixed"]
    assert [made[name].data.data_sets for name in made] == [(), ("b",), ("b",)]
    assert [[road.cloud for road in made[name].data.measured] for name in made] == [["a"], [], ["a"]]
    assert all(one.data.measured_validation_share == 0.2 for one in made.values())
    with pytest.raises(InputError, match="real=FOLDER"):
        configurations(load_experiment(path.stem), {"synthetic": "b"})
