"""The registry of networks, every network that is in it, and the one that the documentation has its readers write."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import torch
from pydantic import Field

from ml import registry
from ml.configuration import TASKS, from_data
from ml.data.crops import crop_of
from ml.data.effects import CropEffects, SequenceEffects
from ml.data.frames import frames_along
from ml.data.samples import Sample, Stretch
from ml.data.slices import cut_stretch
from ml.data.tiles import Scaling
from ml.networks.base import SegmentationNetwork
from ml.registry import FOLDERS, Change, apply_effects, effect, effect_options, network, networks
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import read_yaml
from tests.helpers.clouds.centerline_batches import SETTINGS
from tests.helpers.clouds.centerline_batches import batch as slices
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import toy, write_pointcept
from tests.helpers.page_modules import module_of_page
from tests.helpers.roads.analytic_roads import roads

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/extend/network.md").read_text(encoding="utf-8")


def test_networks_are_those_of_the_folders() -> None:
    assert list(networks("segmentation")) == ["point-transformer", "pointnext"]
    assert list(networks("centerline")) == ["sequence", "single", "transformer"]
    assert set(FOLDERS) == set(TASKS)


@pytest.mark.parametrize("name", networks("segmentation"))
def test_every_segmentation_network_scores_points_and_learns(name: str) -> None:
    options: Any = networks("segmentation")[name]()
    coord = torch.rand(40, 3, generator=torch.Generator().manual_seed(1))
    batch = options.prepare({"coord": coord, "feat": coord * 2.0, "offset": torch.tensor([25, 39, 40])})
    model = options.build(3, 5)
    scores = model(batch["feat"], batch)
    assert scores.shape == (40, 5)
    scores.square().sum().backward()
    assert any(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in model.parameters())


@pytest.mark.parametrize("name", networks("centerline"))
def test_every_centerline_network_finds_lines_and_learns(name: str) -> None:
    options: Any = networks("centerline")[name]()
    model = options.build(SETTINGS.half_width, SETTINGS.slices)
    output = model(slices(1))
    assert output["center"].shape == (1, SETTINGS.slices)
    output["center"].sum().backward()
    assert any(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in model.parameters())


def test_two_networks_of_one_name_are_refused() -> None:
    class Other(SegmentationNetwork):
        name: Literal["pointnext"] = Field("pointnext")

    with pytest.raises(
        ValueError, match=r"ml\.networks\.segmentation\.pointnext and .*test_registry both have the network 'pointnext'"
    ):
        network("segmentation")(Other)


def test_a_network_takes_its_own_options_only() -> None:
    plain = {"task": "segmentation", "network": {"preset": "S"}}
    assert from_data(plain, "test").network.name == "pointnext"
    with pytest.raises(InputError, match=r"network.name is 'pointnxt': must be one of pointnext"):
        from_data(plain | {"network": {"name": "pointnxt"}}, "test")
    with pytest.raises(InputError, match="unknown key 'cells'"):
        from_data(plain | {"network": {"cells": 4}}, "test")


def test_a_centerlines_model_is_still_read_by_its_old_name() -> None:
    plain: dict[str, Any] = {"task": "centerline", "data": {"data_sets": ["x"]}}
    old = from_data(plain | {"model": {"name": "single", "cells": 7}}, "test")
    assert old == from_data(plain | {"network": {"name": "single", "cells": 7}}, "test")
    with pytest.raises(InputError, match="unknown key 'model'"):
        from_data(plain | {"model": {"cells": 7}, "network": {"cells": 7}}, "test")


def code_of_page(file: str) -> str:
    """Return the code that the page says to save as a file."""
    return re.split(r"```\w+\n|```\n", PAGE[PAGE.index(f"`{file}`") :])[1]


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Change:
    """The effect of the documentation's page, as if its file stood in the folder; gone after the test."""
    monkeypatch.setattr(registry, "_EFFECTS", {task: dict(known) for task, known in registry._EFFECTS.items()})
    found: Change = module_of_page("extend/effect.md", "ml/data/effects/window.py", monkeypatch).dirty_window
    return found


def test_an_effect_is_one_function_for_both_tasks(window: Change) -> None:
    for task, base in (("segmentation", CropEffects), ("centerline", SequenceEffects)):
        options = effect_options(task, base)
        assert options.from_dict({"window": 0.5}).to_dict() == {**base().to_dict(), "window": 0.5}
        with pytest.raises(InputError, match="window is 2"):
            options.from_dict({"window": 2})
        samples = []
        for loss in (0.0, 0.5):
            one: Sample = crop_of(road_tile(50), Scaling()) if task == "segmentation" else cut()
            apply_effects(task, one, options.from_dict({"window": loss}), np.random.default_rng(1))
            samples.append(one)
        plain, faded = samples
        assert plain.strength is not None
        assert faded.strength is not None
        np.testing.assert_array_equal(faded.coord, plain.coord)  # what is drawn for it comes last
        ratio = faded.strength / plain.strength
        assert ratio.min() == pytest.approx(ratio.max(), rel=1e-5)
        assert 0.5 < ratio.min() < 1.0


def test_two_effects_of_one_name_are_refused(window: Change) -> None:
    def other(sample: Sample, effects: Any, random: np.random.Generator) -> None: ...

    other.__name__ = "dirty_window"
    with pytest.raises(ValueError, match=r"effects\.window and .*test_registry both have the effect 'dirty_window'"):
        effect("centerline")(other)


def cut() -> Stretch:
    """Return some slices of a road."""
    road = roads()[0]
    assert road.truth is not None
    return cut_stretch(road, frames_along(road.truth.axis).select(slice(40, 50)), SETTINGS)


@pytest.mark.slow
def test_the_network_of_the_page_is_trained_and_used_by_its_configuration(tmp_path: Path) -> None:
    """The file stands in a folder beside the network's own, as only a new process looks for networks anew."""
    (tmp_path / "pointnet.py").write_text(code_of_page("ml/networks/segmentation/pointnet.py"), encoding="utf-8")
    (tmp_path / "pointnet.yaml").write_text(code_of_page("pointnet.yaml"), encoding="utf-8")
    for split, seed in (("train", 1), ("test", 3)):
        write_pointcept(tmp_path / "real", split, [road_tile(400, seed, split, length=20.0)])
    page, small = read_yaml(tmp_path / "pointnet.yaml"), toy(tmp_path).to_dict()
    assert page["network"] == {"name": "pointnet", "width": 64}
    changes = {"voxel": 0.3, "crop_points": 300, "threads": 1, "set_up": "real", "data": small["data"]}
    words = [f"--set={name}={value if name == 'set_up' else json.dumps(value)}" for name, value in changes.items()]
    train = ["train", str(tmp_path / "pointnet.yaml"), "--output", str(tmp_path / "run"), "--quiet", *words]
    evaluate = [
        "evaluate",
        str(tmp_path / "run"),
        str(tmp_path / "real"),
        "--output",
        str(tmp_path / "scores"),
        "--json",
    ]
    code = "import json, sys; from headless import cli; from ml.networks import segmentation\n"
    code += "segmentation.__path__.append(sys.argv[1])\n"
    code += "sys.exit(any(cli.main(words) for words in json.loads(sys.argv[2])))"
    command = [sys.executable, "-c", code, str(tmp_path), json.dumps([train, evaluate])]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "run/configuration.json").read_text())["network"] == page["network"]
    assert len(json.loads((tmp_path / "run/history.json").read_text())) == 1
    assert '"mean_iou"' in done.stdout
