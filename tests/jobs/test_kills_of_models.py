"""Commands with trained networks, and those that render or measure, ended by a signal in the middle."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.clouds.road_clouds import cloud_of, road, write
from tests.helpers.ended_commands import SIGNALS, WORKER, EndedTool, unchanged
from tests.jobs.test_faults import SMALL
from tests.jobs.test_kills import SEED

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="signals as Linux has them"),
]
ENDS = (*SIGNALS, WORKER)
OF_NETWORKS = {
    "predict": ["predict", "segmentation-overhead", "CLOUD", "--output", "out/labelled.laz"],
    "predict a line": ["predict", "centerline-airborne", "CLOUD", "--output", "out/line.geojson"],
    "evaluate": ["evaluate", "segmentation-overhead", "CLOUD", "--output", "out"],
    "evaluate lines": ["evaluate", "centerline-airborne", "ROADS", "--output", "out"],
    "forecast": ["forecast", "SEGMENTATION", "--output", "out/forecast.json"],
    "pack": ["pack", "TILES", "--split", "train", "--output", "out/packed.npz"],
    "export": ["export", "centerline-airborne", "--output", "out/network.onnx"],
    "experiment": ["experiment", "EXPERIMENT", "--leave-out", "north", "--output", "out"],
}
"""Words of each, with its inputs; all that it writes is in a folder ``out`` that it makes."""
OF_SCENES = {
    "gallery": ["gallery", "--only", "materials-", "--width", "64", "--samples", "1", "--output", "out"],
    "tradeoff": ["tradeoff", "--scenario", "SCENARIO", "--knobs", "rays_per_pulse", "--output", "out"],
    "benchmark": ["benchmark", "--quick", "--cores", "1", "--output", "out"],
}
GOES_ON = ("evaluate", "evaluate lines", "forecast", "experiment", "gallery")
"""Those that replace files, or go on with them, without being told so."""
TIMED = {
    "forecast": ("forecast.json",),
    "tradeoff": (".json", ".md", ".svg", ".png"),
    "benchmark": ("benchmark.json", "benchmark.md"),
    "experiment": ("history.json", "curves.png", "checkpoint.pt", "seed-1.json"),
}
"""Names or ends of files that hold times, or a checksum of what holds them."""


@pytest.fixture(scope="module")
def clouds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("inputs")
    cloud = write(folder / "cloud.laz", cloud_of(road("RQ31", "EKA1A", 120.0, 4), 10.0, 4))
    (folder / "small.json").write_text(json.dumps(_scenario()))
    return {"CLOUD": str(cloud), "SCENARIO": str(folder / "small.json")}


def _scenario() -> dict[str, Any]:
    from synthroads_addon.scenario.scenario import load_scenario

    changes = [f"{name}={value}" for name, value in SMALL.items()]
    return load_scenario("rq31-600m-even", changes).to_dict()


@pytest.fixture(scope="module")
def inputs(clouds: dict[str, str]) -> dict[str, str]:
    """Inputs of networks' commands: beside the cloud a data set, tiles, a training and an experiment."""
    pytest.importorskip("torch")
    from tests.helpers.clouds.road_data_sets import write_data_set
    from tests.helpers.clouds.road_tiles import road_tile
    from tests.helpers.clouds.segmentation_data import write_pointcept
    from tests.ml.centerline.test_experiment import write_real
    from tests.ml.test_training_faults import configuration

    folder = Path(clouds["CLOUD"]).parent
    for split, seed in (("train", 1), ("test", 3)):
        tiles = write_pointcept(folder / "real", split, [road_tile(3000, seed + k, f"real{k}") for k in range(2)])
    files = {"SEGMENTATION": configuration("segmentation", folder), "LINE": configuration("centerline", folder)}
    files["EXPERIMENT"] = {
        "task": "centerline",
        "title": "Toy",
        "configuration": str(folder / "line.yaml"),
        "set": {"data.data_sets": [], "data.measured_validation_share": 0.3, "schedule.epochs": 3},
        "data": {"real": [{"cloud": str(folder / "measured")}], "synthetic": []},
        "variants": {"usual": {}, "wide": {"set": {"use.step": 5}}},
        "seeds": [1],
    }
    (folder / "measured").mkdir()
    for number, name in enumerate(("east", "north", "west")):
        write_real(folder / "measured", name, 11 + number)
    for name, content in files.items():
        (folder / f"{name.lower()}.yaml").write_text(json.dumps(content))
    named = {name: str(folder / f"{name.lower()}.yaml") for name in files}
    return clouds | named | {"ROADS": str(write_data_set(folder / "roads")), "TILES": str(tiles)}


def end(tool: str, words: list[str], inputs: dict[str, str], folder: Path, patch: pytest.MonkeyPatch) -> None:
    """End runs of a tool in the middle; KILL_SEED=N ends them at other moments than usual."""
    (temporary := folder / "temporary").mkdir()
    patch.setenv("TMPDIR", str(temporary))
    filled = [inputs.get(word, str(folder / word) if word.startswith("out") else word) for word in words]
    again = () if tool in GOES_ON else ("--overwrite",)
    ended = EndedTool(filled, folder / "out", temporary, again, TIMED.get(tool, ()), tool == "experiment")
    with unchanged(Path(inputs["CLOUD"]).parent):
        ended.end_in_the_middle(ENDS, f"{SEED} {tool}")
    print(tool, dict(ended.ended))


@pytest.mark.parametrize("tool", OF_NETWORKS)
def test_a_command_with_a_network_that_is_ended_leaves_nothing_after_the_next_run(
    tool: str, inputs: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    end(tool, OF_NETWORKS[tool], inputs, tmp_path, monkeypatch)


@pytest.mark.parametrize("tool", OF_SCENES)
def test_a_command_that_renders_or_measures_leaves_nothing_after_the_next_run(
    tool: str, clouds: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    end(tool, OF_SCENES[tool], clouds, tmp_path, monkeypatch)
