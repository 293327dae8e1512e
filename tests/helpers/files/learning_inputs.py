"""Sound inputs of the commands that learn: a run of each task, a shipped model, data, configurations, tiny all."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import ml.cards
from ml.configuration import from_data
from ml.data.classes import MAPPINGS
from ml.data.packed import pack_tile, write_pack
from ml.data.yardsticks import YARDSTICKS
from ml.runs import Run
from ml.shipped import ship
from ml.tasks import task
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.files import PRESETS
from tests.helpers.clouds.road_data_sets import write_data_set
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, write_cloud, write_two_domains

NAMES = {"segmentation": "tiny-classes", "centerline": "tiny-line"}
"""The shipped models."""


def write_inputs(folder: Path) -> Path:
    """Write all inputs into a folder."""
    write_cloud(folder / "cloud.laz", road_block(400, 1, 20.0))
    write_two_domains(folder / "data")
    write_pack(folder / "pack.npz", [pack_tile(road_tile(300, 1, "a", 1.0, 20.0))], class_scheme("5"), 0.1)
    roads = write_data_set(folder / "roads")
    shutil.copy(roads / "scenes" / "a-03" / "cloud.laz", folder / "road.laz")
    line = json.loads((roads / "scenes" / "a-03" / "parameters.json").read_text())
    _write_axis(folder / "axis.csv", line)
    (folder / "measured").mkdir()
    for name in "ab":
        shutil.copy(folder / "road.laz", folder / "measured" / f"{name}.laz")
        shutil.copy(folder / "axis.csv", folder / "measured" / f"{name}_axis.csv")
    shutil.copy(PRESETS / "classes_5.json", folder / "classes.json")
    shutil.copy(MAPPINGS / "ign.json", folder / "mapping.json")
    shutil.copy(YARDSTICKS / "dales.json", folder / "yardstick.json")
    for name, data in configurations(folder).items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
        run: Run[Any] = Run.start(folder / name, from_data(data, name))
        task(name).train(run)
    for name, data in experiments(folder).items():
        (folder / f"{name}-experiment.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    return folder


def ship_models(folder: Path) -> None:
    """Make models like those that come with the package of the runs, in ``weights``, which stands in for theirs."""
    weights = folder / "weights"
    weights.mkdir()
    for kind, name in NAMES.items():
        ship(Run.open(folder / kind), weights / f"{name}.safetensors")
        told = next(json.loads(path.read_text()) for path in sorted(ml.cards.WEIGHTS.glob(f"{kind}*.json")))
        (weights / f"{name}.json").write_text(json.dumps(told | {"name": name}))


def _write_axis(path: Path, road: Any) -> None:
    from synthroads_addon.road.geometry import RoadGeometry
    from synthroads_addon.road.parameters import RoadParameters

    parameters = RoadParameters.from_dict(road)
    geometry = RoadGeometry(parameters)
    station = np.arange(0.0, geometry.length, 5.0)
    xyz = geometry.point(station, np.zeros(len(station))) + np.array(parameters.transform.translate)
    np.savetxt(path, xyz, delimiter=",", header="x,y,z", comments="", fmt="%.3f")


def configurations(folder: Path) -> dict[str, Any]:
    """Return the configuration of a training of each task that takes less than a second."""
    data = folder / "data"
    segmentation = {
        "task": "segmentation",
        "threads": 1,
        "device": "cpu",
        "voxel": 0.5,
        "crop_points": 200,
        "crops_per_tile": 2,
        "batch": 2,
        "set_up": "mixed_mapped",
        "classes": "5",
        "network": {"preset": "S", "width": 4, "radius": 1.5, "neighbours": 4, "dropout": 0.1},
        "schedule": {"epochs": 1, "learning_rate": 0.01},
        "fine_tuning": {"epochs": 1, "learning_rate": 0.001},
        "data": {
            "real": [{"path": str(data / "real"), "split": "train"}],
            "synthetic": [{"path": str(data / "synthetic"), "split": "train"}],
            "tests": {"unseen": [{"path": str(data / "real"), "split": "test"}]},
        },
    }
    centerline = {
        "task": "centerline",
        "threads": 1,
        "device": "cpu",
        "data": {"data_sets": [str(folder / "roads")], "cache": str(folder.parent / "cache")},
        "slices": {"half_width": 20.0, "points_per_slice": 32, "spacing": 8.0},
        "network": {
            "name": "transformer",
            "cells": 4,
            "point_width": 8,
            "width": 16,
            "context": 16,
            "layers": 1,
            "heads": 2,
        },
        "batches": {"size": 2, "steps": 1, "passes": 1, "validation": 2},
        "schedule": {"epochs": 1, "learning_rate": 0.003, "warmup": 0.2},
    }
    return {"segmentation": segmentation, "centerline": centerline}


def experiments(folder: Path) -> dict[str, Any]:
    """Return an experiment of each task with one training."""
    segmentation = {
        "task": "segmentation",
        "title": "t",
        "configuration": str(folder / "segmentation.yaml"),
        "set": {"schedule.epochs": 1},
        "data": {
            "real": [{"path": "{real}", "split": "train"}],
            "synthetic": [{"path": "{synthetic}", "split": "train"}],
            "tests": {"unseen": [{"path": "{real}", "split": "test"}]},
        },
        "variants": {"real": {"set": {"set_up": "real"}}, "AdaBN": {"of": "real", "set": {"adaptation.adabn": True}}},
        "seeds": [1],
    }
    centerline = {
        "task": "centerline",
        "title": "t",
        "configuration": str(folder / "centerline.yaml"),
        "set": {"slices.truth": "either"},
        "data": {"real": [{"cloud": "{real}"}], "synthetic": ["{synthetic}"], "left_out": [["a"]]},
        "variants": {"mixed": {"set": {"data.measured_share": 0.5}}},
        "seeds": [1],
    }
    return {"segmentation": segmentation, "centerline": centerline}
