"""Training, testing and predicting from end to end, on toy roads and with a narrow network."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
import torch

from headless import cli, commands
from headless import evaluate as evaluate_command
from headless import predict as predict_command
from headless import train as train_command
from headless.parser import add_shared_options
from ml.configuration import EXPERIMENTS, load_configuration
from ml.data.classes import IGNORED
from ml.data.crops import Seeds
from ml.data.sources import Source, read_tiles
from ml.data.tiles import scalings
from ml.experiments import configurations, load_experiment
from ml.runs import CHECKPOINT, PRETRAINING, Run
from ml.segmentation import experiment, loading, network, scoring, task
from ml.segmentation.experiment import table
from ml.segmentation.loading import CropBatches, adaptation_batches, read_domains
from ml.segmentation.network import build
from ml.segmentation.recipes import Data, SegmentationConfiguration, plan
from ml.segmentation.task import smoothed_loss
from ml.tasks import Evaluation
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.progress import silent
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, same, toy, weights, write_cloud, write_pointcept

torch.set_num_threads(1)
Trained = Callable[..., Path]
FINE_TUNING = {"epochs": 2, "learning_rate": 0.001}


@pytest.fixture(autouse=True)
def _only_this_task(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the other tasks' packages out of what is imported here."""
    monkeypatch.setattr("ml.configuration.TASKS", {"segmentation": "ml.segmentation.task"})


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two data sets of two tiles each, `synthetic` with darker intensities than `real`."""
    folder = tmp_path_factory.mktemp("data")
    for name, gain in (("real", 1.0), ("synthetic", 0.3)):
        for split, seed in (("train", 1), ("test", 3)):
            tiles = [road_tile(500, seed + k, f"{name}{k}", gain, 20.0) for k in range(2)]
            write_pointcept(folder / name, split, tiles)
    return folder


@pytest.fixture(scope="module")
def trained(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Trained:
    """Return what trains with a set-up, once for all tests, which may read its run but not change it."""
    found: dict[str, Path] = {}

    def folder(set_up: str = "real") -> Path:
        if set_up not in found:
            found[set_up] = tmp_path_factory.mktemp(set_up) / "run"
            task.train(Run.start(found[set_up], small(data, set_up=set_up, fine_tuning=FINE_TUNING)))
        return found[set_up]

    return folder


def small(data: Path, **changes: Any) -> SegmentationConfiguration:
    """Return the toy with few small crops."""
    return toy(data, **{"crop_points": 300, "crops_per_tile": 2, **changes})


def test_smoothed_loss_is_cross_entropy_weighed_by_the_points_own_classes() -> None:
    random = torch.Generator().manual_seed(1)
    scores = torch.randn(50, 3, generator=random)
    truth = torch.randint(0, 3, (50,), generator=random)
    truth[::7] = IGNORED
    weight = torch.tensor([0.1, 0.5, 2.4])
    plain = torch.nn.functional.cross_entropy(scores, truth, weight, ignore_index=IGNORED)
    assert smoothed_loss(scores, truth, weight, 0.0) == pytest.approx(plain.item())
    logs = scores.log_softmax(dim=1)
    wanted, total = 0.0, 0.0
    for row, label in zip(logs, truth.tolist(), strict=True):
        if label != IGNORED:
            wanted += weight[label].item() * (0.8 * -row[label].item() + 0.2 * -row.mean().item())
            total += weight[label].item()
    assert smoothed_loss(scores, truth, weight, 0.2).item() == pytest.approx(wanted / total, rel=1e-5)
    nothing = smoothed_loss(scores.requires_grad_(), torch.full((50,), IGNORED), weight, 0.2)
    assert nothing.item() == 0.0
    nothing.backward()  # a batch without labels does no harm


def test_best_answer_to_a_smoothed_label_is_the_label_however_rare_others_are() -> None:
    truth, weight = torch.zeros(1, dtype=torch.int64), torch.tensor([0.1, 0.3, 2.4, 1.0, 1.2])
    scores = torch.zeros(1, 5, requires_grad=True)
    descent = torch.optim.SGD([scores], lr=5.0)
    for _ in range(200):
        descent.zero_grad()
        smoothed_loss(scores, truth, weight, 0.2).backward()
        descent.step()
    assert scores.softmax(dim=1)[0].tolist() == pytest.approx([0.84, 0.04, 0.04, 0.04, 0.04], abs=0.01)


def test_batches_that_are_left_to_a_gpu_give_the_same_network(
    data: Path, trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (loading, network, scoring):
        monkeypatch.setattr(module, "gpu_prepares", lambda *_: True)  # as if this processor were one
    kind = type(small(data).network)
    looked, prepare = [], kind.prepare

    def counted(options: Any, batch: Any) -> Any:
        looked.append("positions0" in batch)
        return prepare(options, batch)

    monkeypatch.setattr(kind, "prepare", counted)
    configuration = small(data, set_up="real", fine_tuning=FINE_TUNING)
    run = Run.start(tmp_path / "run", configuration)
    task.train(run)
    assert same(weights(tmp_path / "run"), weights(trained("real")))
    model, tiles = scoring.trained_model(run), read_domains(configuration)["real"]
    network.adapt_network(model, adaptation_batches(tiles, configuration, torch.device("cpu")), configuration)
    assert looked
    assert not any(looked)  # each batch once


@pytest.mark.parametrize("set_up", ["real", "mixed_mapped"])
def test_another_seed_gives_another_network(data: Path, trained: Trained, tmp_path: Path, set_up: str) -> None:
    task.train(Run.start(tmp_path / "other", small(data, set_up=set_up, fine_tuning=FINE_TUNING, seed=2)))
    assert not same(weights(tmp_path / "other"), weights(trained(set_up)))


@pytest.mark.parametrize(
    ("set_up", "stop_at"), [("real", 1), ("mixed_mapped", 1), ("fine_tuned", 1), ("fine_tuned", 3)]
)
def test_an_interrupted_training_ends_as_an_undisturbed_one(
    data: Path, trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, set_up: str, stop_at: int
) -> None:
    """The same weights and figures to the bit, as those of any two trainings with one seed."""
    configuration = small(data, set_up=set_up, fine_tuning=FINE_TUNING)
    whole = trained(set_up)
    with monkeypatch.context() as patch:
        saved, original = [], Run.save

        def save(self: Run[Any], state: Any) -> None:
            original(self, state)
            saved.append(1)
            if len(saved) == stop_at:
                raise KeyboardInterrupt

        patch.setattr(Run, "save", save)
        with pytest.raises(KeyboardInterrupt):
            task.train(Run.start(tmp_path / "cut", configuration))
    task.train(Run.start(tmp_path / "cut", configuration, resume=True))
    assert same(weights(whole), weights(tmp_path / "cut"))
    assert (tmp_path / "cut" / PRETRAINING).exists() == (set_up == "fine_tuned")
    histories = [json.loads((folder / "history.json").read_text()) for folder in (whole, tmp_path / "cut")]
    assert [len(history) for history in histories] == [2, 2]
    figures = [json.loads((folder / "metrics.json").read_text())["tests"] for folder in (whole, tmp_path / "cut")]
    assert figures[0] == figures[1]


def test_fine_tuning_begins_with_what_synthetic_data_taught(data: Path, tmp_path: Path) -> None:
    short = {"schedule": {"epochs": 1}}
    task.train(Run.start(tmp_path / "synthetic", small(data, set_up="synthetic", **short)))
    nothing = {"epochs": 1, "learning_rate": 1e-12, "final_learning_rate": 0.0}
    task.train(Run.start(tmp_path / "tuned", small(data, set_up="fine_tuned", fine_tuning=nothing, **short)))
    first, tuned = weights(tmp_path / "synthetic"), weights(tmp_path / "tuned")
    assert same(first, weights(tmp_path / "tuned" / PRETRAINING))
    learned = [name for name in first if "running" not in name and "num_batches" not in name]
    assert all(torch.allclose(first[name], tuned[name], atol=1e-6) for name in learned)
    changed = small(data, set_up="fine_tuned", fine_tuning=nothing, seed=5, **short)
    task.train(Run.start(tmp_path / "tuned", changed, overwrite=True))  # nor with what another seed did
    assert not same(first, weights(tmp_path / "tuned" / PRETRAINING))
    begun = Run.start(tmp_path / "tuned", changed, overwrite=True)  # nor with what the same seed learned of other data
    begun.begin()
    assert not (begun.folder / PRETRAINING).exists()


def test_every_set_up_and_option_trains(data: Path, tmp_path: Path) -> None:
    short = {"schedule": {"epochs": 1}, "crops_per_tile": 2}
    cases: list[dict[str, Any]] = [
        {"set_up": "synthetic", "intensity": "robust", "balanced": True, "adaptation": {"adabn": True, "mix3d": 0.5}},
        {"set_up": "mixed", "synthetic_share": 0.7, "features": ["z", "intensity"]},
        {"set_up": "mixed", "effects": {"mirror": True, "dropout": 0.3, "intensity_gain": 0.2}, "class_weights": False},
    ]
    for number, case in enumerate(cases):
        metrics = task.train(Run.start(tmp_path / str(number), small(data, **short, **case)))
        assert 0.0 <= metrics["unseen_mean_iou"] <= 1.0
        assert metrics["tests"]["unseen"]["points"] == 1000
    assert set(metrics["training_points"]) == {"real", "synthetic"}


def test_slivers_are_left_out_of_training_unless_there_is_nothing_else(tmp_path: Path) -> None:
    write_pointcept(tmp_path / "real", "train", [road_tile(count, 1) for count in (3000, 150, 3000)])
    assert [len(tile) > 1000 for tile in read_domains(toy(tmp_path))["real"]] == [True, True]
    assert len(read_domains(toy(tmp_path, crop_points=100_000))["real"]) == 3


def test_scenes_of_one_name_in_two_sources_are_scaled_apart(data: Path) -> None:
    one = Source(path=str(data / "real"), split="train")
    configuration = toy(data).model_copy(update={"data": Data(real=(one, one))})
    tiles = read_domains(configuration)["real"]
    assert len(tiles) == 4
    assert len(scalings(tiles, "robust")) == 4


@pytest.mark.parametrize("name", ["real-synthetic-mixed-small", "gantries-small"])
def test_small_experiments_run_from_end_to_end(tmp_path: Path, name: str) -> None:
    for split in ("train", "test", "test_tripod", "test_gantries"):
        write_pointcept(tmp_path / "real", split, [road_tile(200, 1, split, length=20.0)], scheme="17")
    five = name == "real-synthetic-mixed-small"
    write_pointcept(tmp_path / "synthetic", "train", [road_tile(200, 2, length=20.0)], scheme="5" if five else "17")
    words = ["experiment", name, "--output", str(tmp_path / "out"), "--seeds", "1", "--quiet"]
    words += [f"--data={each}={tmp_path / each}" for each in ("real", "synthetic")]
    changes = ["threads=1", "network.width=8", "voxel=0.4", "crop_points=100", "schedule.epochs=1"]
    changes += ["adaptation.adabn_crops=4"]
    assert cli.main([*words, *(f"--set={change}" for change in changes), "--set=fine_tuning.epochs=1"]) == 0
    text = (tmp_path / "out" / "table.md").read_text()
    variants = load_experiment(name).variants
    assert f"| class | points | {' | '.join(variants)} |" in text
    assert text.count("**") // 2 == (2 if five else 1)
    assert f"Seeds: {', '.join(f'{variant} 1' for variant in variants)}." in text


def test_a_variant_is_tested_anew_when_its_network_or_its_settings_have_changed(
    data: Path, trained: Trained, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    configuration = small(data)
    run = shutil.copytree(trained(), tmp_path / "run")
    tested: list[int] = []
    score = experiment.score_all

    def counted(*arguments: Any) -> Any:
        tested.append(len(tested))
        return score(*arguments)

    monkeypatch.setattr(experiment, "score_all", counted)

    def scores(settings: SegmentationConfiguration) -> Any:
        return experiment._test_variant(settings, run, tmp_path / "seed-1.json", silent)

    first = scores(configuration)
    assert scores(configuration.model_copy(update={"threads": 2})) == first
    assert len(tested) == 1
    scores(configuration.model_copy(update={"crop_points": 200}))
    assert len(tested) == 2
    scores(configuration)
    checkpoint = torch.load(run / CHECKPOINT, weights_only=False)
    torch.save(checkpoint | {"note": 1}, run / CHECKPOINT)
    scores(configuration)
    assert len(tested) == 4


def test_clouds_are_laid_over_as_often_as_asked(data: Path) -> None:
    for share, wanted in ((0.0, [4]), (1.0, [2]), (0.5, [2, 4])):
        configuration = toy(data, adaptation={"mix3d": share}, crops_per_tile=12, crop_points=64)
        batches = CropBatches(configuration, read_domains(configuration).values(), torch.device("cpu"))
        sizes = [len(batch["offset"]) for batch in batches(1)]
        assert sorted(set(sizes)) == wanted
        assert sizes == [len(batch["offset"]) for batch in batches(1)]


def test_commands_train_evaluate_and_predict(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "toy.yaml").write_text(json.dumps(small(data).to_dict()))

    def command(module: Any, *arguments: object) -> dict[str, Any]:
        import argparse

        parser = argparse.ArgumentParser()
        module.add_arguments(parser)
        add_shared_options(parser)
        code = commands.run(module.run, parser.parse_args([*map(str, arguments), "--json"]))
        out = capsys.readouterr()
        assert code == 0, out.err
        result: dict[str, Any] = json.loads(out.out)
        return result

    trained = command(train_command, tmp_path / "toy.yaml", "--output", tmp_path / "run")
    for name in ("configuration.json", "metrics.json", "history.json", "checkpoint.pt", "curves.png"):
        assert (tmp_path / "run" / name).stat().st_size > 0
    again = command(evaluate_command, tmp_path / "run", data / "real", "--output", tmp_path / "scores")
    assert again["tests"]["real-test"] == trained["tests"]["unseen"]
    assert (tmp_path / "scores" / "real-test.png").read_bytes()[:4] == b"\x89PNG"
    assert "road_marking" in (tmp_path / "scores" / "real-test.txt").read_text()
    assert again["files"] == ["real-test.txt", "real-test.png"]
    words = ["evaluate", str(tmp_path / "run"), str(data / "real"), "--output", str(tmp_path / "scores")]
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    scores = again["tests"]["real-test"]
    assert (tmp_path / "scores" / "real-test.txt").read_text() in said
    rows = {line.split()[0]: line.split()[1:] for line in said.splitlines() if line}
    assert rows["mean"][2] == f"{100 * scores['mean_iou']:.1f}"
    assert rows["road_marking"][2] == f"{100 * scores['classes']['road_marking']['iou']:.1f}"
    assert f"{100 * scores['accuracy']:.1f} % of the points are right" in said
    assert said.endswith(f"written to {tmp_path / 'scores'}: real-test.txt, real-test.png\n")
    cloud = write_cloud(tmp_path / "cloud.laz", road_block(1500, 9, 20.0))
    told = command(predict_command, tmp_path / "run", cloud, "--output", tmp_path / "labelled.laz", "--classification")
    assert told["points"] == 1500
    found = np.asarray(laspy.read(tmp_path / "labelled.laz")["predicted_class"])
    assert np.bincount(found, minlength=5).tolist() == list(told["classes"].values())
    _check_usual_output(tmp_path, capsys)


def _check_usual_output(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Label two clouds of one name by a folder's run from elsewhere: each result lies beside its cloud, and says so."""
    run = str(folder / "run")
    for place in ("a", "b"):
        (folder / place).mkdir()
        write_cloud(folder / place / "cloud.laz", road_block(1500, 9, 20.0))
        assert cli.main(["predict", run, str(folder / place / "cloud.laz")]) == 0
        output = folder / place / "cloud-predicted.laz"
        said = capsys.readouterr().out.splitlines()
        assert said[0].startswith(f"written {output}: 1,500 points with the attribute predicted_class (")
        assert said[1].split() == ["class", "points", "share"]
        names = [row.name for row in class_scheme("5").rows]
        rows = [line.split() for line in said[2:-1]]
        assert [row[0] for row in rows] == names
        assert sum(int(row[1].replace(",", "")) for row in rows) == 1500
        assert sum(float(row[2].rstrip("%")) for row in rows) == pytest.approx(100.0, abs=0.3)
        assert said[-1] == f"next: synthroads cloud preview {output} --output {folder / place / 'cloud-predicted'}"
        assert cli.main(said[-1].split()[2:]) == 0, "what it says to do next works"
        shown = capsys.readouterr().out
        assert "preview_predicted.png shows predicted_class" in shown
        assert "preview_class.png shows class_id" in shown
    assert cli.main(["predict", run, str(folder / "a" / "cloud.laz")]) == 2
    refused = capsys.readouterr().err
    assert refused.startswith(f"error: {folder / 'a' / 'cloud-predicted.laz'}: is there already; --overwrite")
    assert "--output is" not in refused
    assert cli.main(["predict", run, str(folder / "a" / "cloud.laz"), "--overwrite", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert cli.main(["predict", run, str(folder / "a" / "cloud.laz"), "--overwrite", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["attribute"], told["output"]) == ("predicted_class", str(folder / "a" / "cloud-predicted.laz"))
    assert told["next"].startswith("synthroads cloud preview ")


def test_a_checkpoint_of_another_network_is_refused(data: Path, tmp_path: Path) -> None:
    run = Run.start(tmp_path / "run", toy(data))
    other = build(toy(data, features=["x", "y", "z"]))
    run.save({"model": other.state_dict(), "epoch": 1})
    with pytest.raises(InputError, match="must belong to the network"):
        task.trained_model(run)


def test_evaluation_with_a_mapping_scores_groups(trained: Trained, tmp_path: Path) -> None:
    run = Run.open(trained())
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    block = road_block(1500, 4, 20.0)
    las.header.scales, las.header.offsets = np.full(3, 0.001), np.array([4e5, 5.6e6, 100.0])
    las.x, las.y, las.z = block.xyz.T
    las.intensity = np.rint(block.intensity * 65535)
    las.classification = np.array([2, 2, 2, 5, 1])[block.class_id]
    las.write(tmp_path / "street.laz")
    found, _ = task.evaluate(run, Evaluation([tmp_path / "street.laz"], "test", tmp_path / "out", mapping="ign"))
    classes = found["tests"]["street"]["classes"]
    assert list(classes) == ["ground", "vegetation", "other"]
    assert classes["other"]["support"] == 0
    assert found["tests"]["street"]["ignored"] == int((block.class_id == 4).sum())


def test_shipped_configurations_and_experiments_are_whole() -> None:
    known = ml_segmentation_configurations()
    assert "segmentation" in known
    for name in known:
        assert load_configuration(name).task == "segmentation"
    for path in EXPERIMENTS.glob("*.yaml"):
        if path.stem.startswith("centerline-"):
            continue
        found = load_experiment(path.stem)
        made = configurations(found, {"real": "a", "synthetic": "b"})
        assert list(made) == list(found.variants)
        for configuration in made.values():
            configuration.scheme()
            configuration.needed_sources()
            assert configuration.data.tests
        with pytest.raises(InputError, match="real=FOLDER"):
            configurations(found, {"synthetic": "b"})


def test_changes_are_of_the_type_of_their_field() -> None:
    changes = ["classes=17", "title=2", "schedule.epochs=3", "voxel=0.5"]
    made = load_configuration("segmentation-small", changes)
    assert (made.classes, made.title, made.schedule.epochs, made.voxel) == ("17", "2", 3, 0.5)
    of_all = configurations(load_experiment("gantries"), {"real": "a", "synthetic": "b"}, ["classes=5"])
    assert {configuration.classes for configuration in of_all.values()} == {"5"}


def ml_segmentation_configurations() -> list[str]:
    """Return the names of the shipped configurations of this task."""
    from ml.configuration import SHIPPED, names_in
    from synthroads_addon.base.schema import read_yaml

    return [name for name in names_in(SHIPPED) if read_yaml(SHIPPED / f"{name}.yaml")["task"] == "segmentation"]


def test_an_experiment_makes_a_table_and_goes_on_where_it_stopped(data: Path, tmp_path: Path) -> None:
    own = {
        "title": "Toy",
        "configuration": str(tmp_path / "toy.yaml"),
        "data": {
            "real": [{"path": "{real}", "split": "train"}],
            "synthetic": [{"path": "{synthetic}", "split": "train"}],
            "tests": {"unseen": [{"path": "{real}", "split": "test"}]},
        },
        "variants": {
            "synthetic": {"set": {"set_up": "synthetic"}},
            "tuned": {"set": {"set_up": "fine_tuned", "fine_tuning.epochs": 1}},
            "adapted": {"of": "synthetic", "set": {"adaptation.adabn": True, "adaptation.adabn_crops": 5}},
        },
        "seeds": [1, 2],
    }
    (tmp_path / "toy.yaml").write_text(json.dumps(small(data, schedule={"epochs": 1}).to_dict()))
    (tmp_path / "own.yaml").write_text(json.dumps(own))
    folders = [f"--data={name}={data / name}" for name in ("real", "synthetic")]
    arguments = ["experiment", str(tmp_path / "own.yaml"), *folders, "--output", str(tmp_path / "out"), "--quiet"]
    assert cli.main([*arguments, "--seeds", "1"]) == 0
    before = (tmp_path / "out" / "synthetic" / "seed-1" / "checkpoint.pt").stat().st_mtime_ns
    assert same(
        weights(tmp_path / "out" / "synthetic" / "seed-1"), weights(tmp_path / "out" / "tuned" / "seed-1" / PRETRAINING)
    )
    assert cli.main(arguments) == 0
    assert (tmp_path / "out" / "synthetic" / "seed-1" / "checkpoint.pt").stat().st_mtime_ns == before
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert {name: sorted(seeds) for name, seeds in results.items()} == {name: ["1", "2"] for name in own["variants"]}
    text = (tmp_path / "out" / "table.md").read_text()
    assert "| class | points | synthetic | tuned | adapted |" in text
    values = [100 * results["tuned"][seed]["unseen"]["mean_iou"] for seed in "12"]
    assert f"{np.mean(values):.1f} ({np.std(values, ddof=1):.1f})" in text


def test_table_shows_undefined_scores_as_such() -> None:
    scores = {
        "classes": {"a": {"iou": 0.5, "support": 9}, "b": {"iou": None, "support": 0}},
        "mean_iou": 0.5,
        "points": 9,
    }
    text = table("T", {"one": {"1": {"unseen": scores}}, "two": {}})
    assert "| a | 9 | 50.0 |" in text
    assert "| b | 0 | - |" in text


def test_an_experiments_faults_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = {"title": "T", "data": {}, "variants": {"a": {"of": "b"}}}
    (tmp_path / "wrong.yaml").write_text(json.dumps(wrong))
    assert cli.main(["experiment", str(tmp_path / "wrong.yaml"), "--output", str(tmp_path / "out")]) == 2
    assert "must be a variant that is trained" in capsys.readouterr().err
    with pytest.raises(InputError, match="gantries"):
        load_experiment("gantrys")
    words = ["--data", "real=a", "--data", "synthetic=b", "--output", str(tmp_path / "out"), "--seeds", "-1"]
    assert cli.main(["experiment", "real-synthetic-mixed-small", *words]) == 2
    assert "--seeds is -1: must be whole numbers from 0" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        cli.main(["experiment", "gantries", "--data", "real", "--output", str(tmp_path / "out")])
    assert "is 'real': must be NAME=FOLDER" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_experiment_tells_its_scores(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tests = {"unseen": [{"path": "{real}", "split": "test"}]}
    own = {
        "title": "Toy",
        "configuration": str(tmp_path / "toy.yaml"),
        "data": {"synthetic": [{"path": "{synthetic}", "split": "train"}], "tests": tests},
        "variants": {"plain": {"set": {"set_up": "synthetic"}}},
        "seeds": [1],
    }
    (tmp_path / "toy.yaml").write_text(json.dumps(small(data, schedule={"epochs": 1}).to_dict()))
    (tmp_path / "own.yaml").write_text(json.dumps(own))
    folders = [f"--data={name}={data / name}" for name in ("real", "synthetic")]
    words = ["experiment", str(tmp_path / "own.yaml"), *folders, "--output", str(tmp_path / "out")]
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "# Toy" in said
    assert "| class | points | plain |" in said
    assert said.rstrip().endswith(f"written to {tmp_path / 'out'}: table.md, results.json and the runs")
    assert cli.main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["results"] == json.loads((tmp_path / "out/results.json").read_text())


def test_clouds_of_one_name_have_results_of_their_own(trained: Trained, tmp_path: Path) -> None:
    run = Run.open(trained())
    clouds = [tmp_path / scene / "cloud.laz" for scene in ("one", "two")]
    for number, cloud in enumerate(clouds):
        cloud.parent.mkdir()
        write_cloud(cloud, road_block(500 + number, 4, 20.0))
    found, _ = task.evaluate(run, Evaluation(clouds, "test", tmp_path / "out"))
    assert list(found["tests"]) == ["one-cloud", "two-cloud"]
    assert {path.name for path in (tmp_path / "out").glob("*.txt")} == {"one-cloud.txt", "two-cloud.txt"}
    for name in ("set.v1", "set.v2"):
        (tmp_path / name).mkdir()
    sets = Evaluation([tmp_path / "set.v1", tmp_path / "set.v2"], "test", tmp_path / "out")
    assert task._names(sets) == ["set.v1-test", "set.v2-test"]
    assert task._names(Evaluation([Path("/")], "test", tmp_path)) == ["-test"]
    with pytest.raises(InputError, match="is given twice"):
        task.evaluate(run, Evaluation([clouds[0], clouds[0]], "test", tmp_path / "out"))


def test_a_cloud_that_is_refused_names_the_tables_before_it(trained: Trained, tmp_path: Path) -> None:
    run = Run.open(trained())
    labelled, broken = tmp_path / "labelled.laz", tmp_path / "broken.laz"
    write_cloud(labelled, road_block(500, 4, 20.0))
    broken.write_bytes(b"no cloud")
    with pytest.raises(InputError, match=r"measured before it is in .*out: labelled\.txt, labelled\.png"):
        task.evaluate(run, Evaluation([labelled, broken], "test", tmp_path / "out"))
    assert (tmp_path / "out/labelled.txt").exists()
    with pytest.raises(InputError) as alone:
        task.evaluate(run, Evaluation([broken], "test", tmp_path / "out"))
    assert "before it" not in str(alone.value)


def test_tests_are_looked_at_before_the_training(data: Path, tmp_path: Path) -> None:
    run = Run.start(tmp_path / "run", toy(data))
    wrong = {"late": [{"path": str(data / "real"), "split": "tset"}]}
    run.configuration = run.configuration.model_copy(
        update={"data": run.configuration.data.model_copy(update={"tests": Data(tests=wrong).tests})}
    )
    with pytest.raises(MissingFileError, match="tset"):
        task.train(run)
    assert not (tmp_path / "run" / "checkpoint.pt").exists()


def test_norms_are_adapted_by_points_and_not_by_tiles(data: Path) -> None:
    large, sliver = road_tile(1900, 1, "large"), road_tile(100, 2, "sliver")
    configuration = toy(data, adaptation={"adabn": True, "adabn_crops": 200}, batch=1, crop_points=64)
    dark = replace(sliver, strength=np.zeros_like(sliver.strength))
    batches = adaptation_batches([large, dark], configuration, torch.device("cpu"))
    of_sliver = [not bool(batch["strength"].any()) for batch in batches]
    assert len(of_sliver) == 200
    assert 0.01 < np.mean(of_sliver) < 0.12  # 5 % of the points


def test_files_have_no_splits(tmp_path: Path) -> None:
    cloud = write_cloud(tmp_path / "cloud.laz", road_block(100, 1))
    with pytest.raises(
        InputError, match=r"split is 'train': must be left out, as cloud.laz is a file and has no splits"
    ):
        list(read_tiles(Source(path=str(cloud), split="train"), class_scheme("5"), 0.1))


@pytest.mark.parametrize("share", [0.25, 0.8])
def test_balanced_crops_of_two_domains_keep_the_stated_share(data: Path, share: float) -> None:
    """And within each domain they are balanced: shrubs are rare, and are in the middle of a fifth of the crops."""
    settings = toy(data, set_up="mixed", synthetic_share=share, balanced=True, crops_per_tile=250, crop_points=64)
    batches = CropBatches(settings, read_domains(settings).values(), torch.device("cpu"))
    draws = plan([len(tiles) for tiles in batches.domains], 250, share, settings.seed, 0)
    own = len(batches.domains[0])
    random = np.random.default_rng(1)
    found = [batches.seeds[0].draw(draw.tile, random) for draw in draws]
    assert sum(tile < own for tile, _ in found) == round(share * len(draws))
    for domain in (range(own), range(own, len(batches.tiles))):
        labels = [batches.tiles[tile].segment[point] for tile, point in found if tile in domain]
        assert np.abs(np.bincount(labels, minlength=5) / len(labels) - 0.2).max() < 0.08
    assert len(next(iter(batches(0)))["offset"]) == settings.batch


def test_a_domain_without_labels_is_drawn_from_as_well(data: Path) -> None:
    plain, bare = road_tile(100, 1), road_tile(100, 2)
    unlabelled = replace(bare, segment=np.full_like(bare.segment, IGNORED))
    seeds = Seeds([plain, unlabelled], 5, True, [1, 1])
    assert {seeds.draw(1, np.random.default_rng(seed))[0] for seed in range(9)} == {1}
