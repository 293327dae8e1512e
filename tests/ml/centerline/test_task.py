"""Training a centreline model: the same bits twice, exact resuming, what it writes, that it learns."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from ml.centerline import task
from ml.centerline.predictor import CenterlinePredictor
from ml.configuration import from_data, load_configuration
from ml.data.batches import Batches, BatchOptions, MeasuredRoad, Roads, read_roads
from ml.data.effects import SequenceEffects
from ml.data.roads import LearningRoad
from ml.data.slices import mirror_batch
from ml.runs import CALIBRATION, METRICS, Run
from ml.tasks import Evaluation, Prediction
from synthroads_addon.base.errors import Cancelled, InputError, MissingFileError, OutputError
from synthroads_addon.base.progress import silent
from tests.helpers.clouds.centerline_batches import SETTINGS
from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.roads import analytic_roads

Trained = Callable[..., Run[Any]]
SMALL = {"cells": 4, "point_width": 8, "width": 16, "context": 16, "layers": 1, "heads": 2}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_data_set(tmp_path_factory.mktemp("roads"))


def configuration(folder: Path, name: str = "transformer", **changes: Any) -> task.CenterlineConfiguration:
    plain = {
        "task": "centerline",
        "threads": 1,
        "data": {"data_sets": [str(folder)], "cache": str(folder / "cache")},
        "slices": {"half_width": 20.0, "points_per_slice": 96},
        "network": SMALL | {"name": name, "dropout": 0.1},
        "batches": {"size": 4, "steps": 4, "passes": 2, "validation": 4},
        "schedule": {"epochs": 2, "learning_rate": 0.003, "warmup": 0.2},
    }
    return from_data(plain | changes, "test")


@pytest.fixture(scope="module")
def trained(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Trained:
    """Return what trains a model, once for all tests, which may read its run but not change it."""
    found: dict[str, Run[Any]] = {}

    def run(name: str = "transformer") -> Run[Any]:
        if name not in found:
            found[name] = Run.start(tmp_path_factory.mktemp(name) / "run", configuration(data, name))
            task.train(found[name])
        return found[name]

    return run


def weights(run: Run[Any]) -> dict[str, torch.Tensor]:
    state = run.last_checkpoint()
    assert state is not None
    return state["model"]


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


class Stop:
    """Interrupts the training in its n-th step, as Ctrl-C would."""

    def __init__(self, after: int) -> None:
        self.left = after

    def __call__(self, stage: str, share: float) -> None:
        if stage == "training":
            self.left -= 1
        if self.left < 0:
            raise Cancelled


@pytest.mark.parametrize(
    "name", ["transformer", *(pytest.param(name, marks=pytest.mark.slow) for name in ("single", "sequence"))]
)
def test_resumed_training_ends_with_the_same_bits(trained: Trained, data: Path, tmp_path: Path, name: str):
    """As another one without a break, too; and a training that was interrupted isn't used."""
    whole = trained(name)
    broken = Run.start(tmp_path / "broken", configuration(data, name))
    with pytest.raises(Cancelled):
        task.train(broken, Stop(6))
    assert int((broken.last_checkpoint() or {})["epoch"]) == 1
    with pytest.raises(InputError, match="isn't finished"):
        task.load_predictor(broken)
    resumed = Run.start(tmp_path / "broken", configuration(data, name), resume=True)
    task.train(resumed)
    assert same(weights(resumed), weights(whole))
    assert [row["loss"] for row in resumed.history] == [row["loss"] for row in whole.history]
    for file in (task.CALIBRATION, METRICS):
        assert (whole.folder / file).read_bytes() == (resumed.folder / file).read_bytes()


def test_another_seed_gives_another_model(trained: Trained, data: Path, tmp_path: Path):
    other = Run.start(tmp_path / "other", configuration(data, seed=2))
    task.train(other)
    assert not same(weights(other), weights(trained()))


def test_what_a_run_writes(trained: Trained):
    run = trained()
    assert {path.name for path in run.folder.iterdir()} == {
        "calibration.json",
        "checkpoint.pt",
        "configuration.json",
        "curves.png",
        "history.json",
        "metrics.json",
    }
    metrics = json.loads((run.folder / METRICS).read_text())
    assert {"validation_mae", "validation_68", "validation_95", "corridor_mae", "calibration"} <= set(metrics)
    assert metrics["calibration"]["center"]["count"] == 160
    assert {"loss", "center_mae", "validation_mae", "validation_68", "validation_95"} <= set(run.history[0])
    ready = task.load_predictor(Run.open(run.folder))
    assert ready.calibration["center"].factor == metrics["calibration"]["center"]["factor"]


def test_measuring_and_using_a_run(trained: Trained, data: Path, tmp_path: Path):
    run = trained()
    figures, report = task.evaluate(run, Evaluation([data], "test", tmp_path / "measured"), silent)
    assert figures["roads"] == 1
    assert figures["mae"] > 0
    assert {"centroid", "skeleton", "the displaced path"} <= set(figures["tables"])
    assert figures["corridor"]["lanes"]["slices"] > 100
    names = {path.name for path in (tmp_path / "measured").iterdir()}
    assert {"centerline.json", "centerline.md", "corridor.json", "a-03-lines.png", "a-03-corridor.png"} <= names
    json.dumps(figures, allow_nan=False)
    assert names == set(figures["files"])
    rows = [re.split(r"\s{2,}", line.strip()) for line in report.splitlines()]
    assert rows[0] == ["1 road:"]
    assert rows[1][:2] == ["MAE (m)", "95 % (m)"]
    assert rows[1][-3:] == ["in 68 % (%)", "in 95 % (%)", "found (%)"]
    model = next(row for row in rows if row[0].endswith(", seed 1"))
    assert model[1] == f"{figures['mae']:.3f}"
    assert model[-1] == f"{100 * figures['found']:.1f}"
    assert next(row for row in rows if row[0] == "skeleton")[-3:-1] == ["–", "–"], "it says no intervals"
    heading = next(row for row in rows if row[0] == "heading (mrad)")
    assert heading[1] == f"{1000 * figures['corridor']['heading']['mae']:.3f}"

    cloud, output = data / "scenes" / "a-03" / "cloud.laz", tmp_path / "line.geojson"
    metrics = task.predict(run, Prediction(cloud, output), silent)
    assert metrics["found"] > 0.95
    assert (tmp_path / "line.corridor.json").is_file()
    first = output.read_bytes()
    with pytest.raises(OutputError, match="--overwrite"):
        task.predict(run, Prediction(cloud, output), silent)
    task.predict(run, Prediction(cloud, output, overwrite=True), silent)
    assert output.read_bytes() == first
    with pytest.raises(InputError, match=r"must end in \.geojson"):
        task.predict(run, Prediction(cloud, tmp_path / "line.laz"), silent)


def test_a_run_that_is_begun_anew_isnt_finished_by_the_one_before(trained: Trained, data: Path, tmp_path: Path):
    shutil.copytree(trained().folder, tmp_path / "run")
    assert (tmp_path / "run" / CALIBRATION).is_file()
    again = Run.start(tmp_path / "run", configuration(data), overwrite=True)
    again.begin()
    assert not (tmp_path / "run" / CALIBRATION).exists()
    with pytest.raises(Cancelled):
        task.train(again, Stop(6))
    (tmp_path / "run" / CALIBRATION).write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="isn't finished"):
        task.load_predictor(again)


def test_beginning_with_another_run(trained: Trained, data: Path, tmp_path: Path):
    first = trained()
    on = configuration(data, begin_with=str(first.folder), seed=9)
    begun = task._first_model(on).state_dict()
    assert same(begun, weights(first))
    with pytest.raises(InputError, match="must hold a model with the same settings"):
        task._first_model(configuration(data, "single", begin_with=str(first.folder)))
    with pytest.raises(MissingFileError):
        task._first_model(configuration(data, begin_with=str(tmp_path / "none")))


def test_batches_hang_on_seed_and_epoch_alone():
    roads = Roads(analytic_roads.roads(), [], analytic_roads.roads(), [])
    options = BatchOptions(size=3, steps=4, passes=2, validation=1)

    def drawn(seed: int, epoch: int, workers: int = 0) -> list[Any]:
        return list(Batches(roads, SETTINGS, SequenceEffects(), options, seed, 0.5, workers)(epoch))

    one, again, apart, later, other = drawn(1, 4), drawn(1, 4), drawn(1, 4, 2), drawn(1, 5), drawn(2, 4)
    assert len(one) == 4
    for first, second in (*zip(one, again, strict=True), *zip(one, apart, strict=True)):
        assert all(torch.equal(first[name].nan_to_num(), second[name].nan_to_num()) for name in first)
    assert not torch.equal(one[0]["center"], later[0]["center"])
    assert not torch.equal(one[0]["center"], other[0]["center"])
    # The second pass has the mirror images of the first, in another order.
    drawn_once = torch.cat([batch["center"] for batch in one[:2]])
    mirror = torch.cat([mirror_batch(batch)["center"] for batch in one[2:]])
    assert torch.equal(drawn_once.sort(0).values, mirror.sort(0).values)
    assert not torch.equal(drawn_once, mirror)


def test_roads_held_out_calibrate_in_the_place_of_the_validations(
    trained: Trained, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Each whole and as a strip cut unevenly; the calibration is that of their errors."""
    model = task.load_predictor(trained()).model
    known, held = analytic_roads.roads(), analytic_roads.roads(seed=6)
    shown: list[list[LearningRoad]] = []
    whole = CenterlinePredictor.calibrate

    def calibrate(self: CenterlinePredictor, cases: Any) -> Any:
        kept = list(cases)
        shown.append([road for road, _ in kept])
        return whole(self, kept)

    monkeypatch.setattr(CenterlinePredictor, "calibrate", calibrate)
    factors = []
    for number, roads in enumerate((Roads([], [], known, []), Roads([], [], known, [], held))):
        run = Run.start(tmp_path / str(number), configuration(data))
        factors.append(task.calibrate(run, model, roads)["calibration_factor"])
    axes = [[road.known_truth.axis for road in roads] for roads in (known, held)]
    assert [road.known_truth.axis for road in shown[0]] == axes[0]
    assert [road.known_truth.axis for road in shown[1]] == axes[1] * 2
    assert len(shown[1][1]) < 0.9 * len(held[0])
    assert factors[0] != factors[1]


def test_a_split_to_calibrate_on_is_read(data: Path):
    options = configuration(data).data
    assert not read_roads(options, "road").held_out
    apart = options.model_copy(update={"calibration_split": "validation"})
    assert [road.name for road in read_roads(apart, "road").held_out] == [
        road.name for road in read_roads(options, "road").validation
    ]


def test_synthetic_and_measured_roads_are_mixed():
    synthetic, real = analytic_roads.roads(), analytic_roads.roads(seed=6)
    options = BatchOptions(size=50, steps=1, passes=1, validation=1)
    for share, expected in ((0.0, 0), (0.3, 15), (1.0, 50)):
        batches = Batches(Roads(synthetic, real, [], real), SETTINGS, SequenceEffects(), options, 1, share)
        kinds = batches.kinds(0)
        assert int((kinds == 1).sum()) == pytest.approx(expected, abs=7 if 0 < share < 1 else 0)
    only = Batches(Roads([], real, [], real), SETTINGS, SequenceEffects(), options, 1, 0.3)
    assert (only.kinds(0) == 0).all()


def test_measured_roads_by_stations(data: Path, tmp_path: Path):
    scene = data / "scenes" / "a-01"
    axis = str(scene / "axis.csv")
    points = analytic_roads.roads()[0]
    assert points.truth is not None
    rows = (points.truth.axis.points + points.origin).tolist()
    Path(axis).write_text("x,y,z\n" + "".join(f"{x:.4f},{y:.4f},{z:.4f}\n" for x, y, z in rows))
    cloud = str(scene / "cloud.laz")
    parts = (
        MeasuredRoad(cloud=cloud, axis=axis, last=100.0),
        MeasuredRoad(cloud=cloud, axis=axis, first=110.0),
    )
    options = configuration(data).data.model_copy(
        update={"data_sets": (), "measured": parts[:1], "measured_validation": parts[1:]}
    )
    roads = read_roads(options, "road")
    assert not roads.train
    lengths = [road.truth.axis.length for road in (*roads.measured, *roads.measured_validation) if road.truth]
    assert lengths == pytest.approx([100.0, 50.0], abs=1.1)
    beyond = options.model_copy(update={"measured": (MeasuredRoad(cloud=cloud, axis=axis, first=500.0),)})
    with pytest.raises(InputError, match="first and last must select a part of the axis"):
        read_roads(beyond, "road")


@pytest.mark.parametrize(
    ("message", "changes"),
    [
        ("name data_sets, or measured", {"data": {"data_sets": []}}),
        ("steps is 3: must be a multiple of passes", {"batches": {"steps": 3, "passes": 2}}),
        ("network.name", {"network": {"name": "lstm"}}),
        ("kernel_point", {"network": {"kernel_point": 25}}),
        (
            "last must be larger than first, 5",
            {"data": {"measured": [{"cloud": "a", "axis": "b", "first": 5.0, "last": 1.0}]}},
        ),
    ],
)
def test_wrong_configurations_are_refused(data: Path, message: str, changes: dict[str, Any]):
    with pytest.raises(InputError, match=message):
        configuration(data, **changes)


def test_missing_splits_are_refused(data: Path):
    with pytest.raises(InputError, match="the data set has test, train, validation"):
        read_roads(configuration(data).data.model_copy(update={"train_split": "none"}), "road")


@pytest.mark.parametrize("name", ["single", "sequence", "transformer"])
def test_shipped_configurations(name: str):
    shipped = load_configuration(f"centerline-{name}")
    assert shipped.network.name == name
    assert shipped.network.kernel_points == 25
    assert shipped.slices.slices == 10


def _trained(data: Path, folder: Path, name: str) -> dict[str, Any]:
    settings = configuration(
        data,
        name,
        slices={"half_width": 20.0, "points_per_slice": 192},
        network={"name": name, "cells": 6, "width": 32, "context": 32, "layers": 2},
        batches={"size": 16, "steps": 50, "passes": 2, "validation": 32},
        schedule={"epochs": 6, "learning_rate": 0.004, "warmup": 0.1, "weight_decay": 0.001},
        # What other scanners and roads look like takes thousands of steps to learn.
        effects=dict.fromkeys(("falloff", "footprint", "stripes", "repaint"), 0.0),
    )
    return task.train(Run.start(folder, settings))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "most"), [("single", 1.0), ("sequence", 0.5), ("transformer", 0.5)])
def test_models_learn_where_the_middle_is(data: Path, tmp_path: Path, name: str, most: float):
    """300 steps on one road, 160 m: the centre of another one is found; guessing the frame's origin is 3 m off."""
    metrics = _trained(data, tmp_path / name, name)
    assert metrics["validation_mae"] < most
