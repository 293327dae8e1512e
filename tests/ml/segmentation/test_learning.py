"""A small training on roads that Blender made: it must learn."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from ml.configuration import load_configuration
from ml.runs import Run
from ml.segmentation import task
from tests.helpers.relative_speed import quiet_seconds

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("bpy") is None, reason="needs Blender to make roads")
def test_a_small_network_learns_an_unseen_road_within_minutes(tmp_path: Path) -> None:
    """On one core: mean IoU of five classes on all points of an unseen road at least 0.6, in less than 5 minutes."""
    torch.set_num_threads(1)
    data = tmp_path / "roads"
    command = [sys.executable, "-m", "headless.dataset", "small-roads", "--output", str(data), "--quiet"]
    subprocess.run(command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)
    sources = {
        "synthetic": [{"path": str(data), "split": "train"}],
        "tests": {"unseen road": [{"path": str(data), "split": "test"}]},
    }
    changes = [f"data={json.dumps(sources)}", "threads=1", "device=cpu"]
    configuration = load_configuration("segmentation-small", changes)
    trained = []
    seconds = quiet_seconds(lambda: trained.append(task.train(Run.start(tmp_path / "run", configuration))))
    metrics = trained[0]
    scores = metrics["tests"]["unseen road"]
    assert len([row for row in scores["classes"].values() if row["support"] > 1000]) == 5
    assert scores["mean_iou"] >= 0.6, scores
    assert seconds < 300
