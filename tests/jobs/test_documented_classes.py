"""The page on schemes of classes, followed to the letter: from its JSON to LAS codes and a network that knows them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from tests.helpers.page_modules import ROOT, block_of_page
from tests.packaging.docs_pages import commands

PAGE = "extend/class-scheme.md"
NEW = {"bench": (17, 80), "truck": (18, 81), "concrete_pavement": (19, 82)}
"""Class of the page -> its number and its LAS code."""


@pytest.mark.slow
@pytest.mark.any_blender
def test_the_page_leads_from_a_scheme_to_a_network(tmp_path: Path) -> None:
    # Here, as PyTorch takes seconds to import, in each process that collects tests of Blender.
    from ml.runs import HISTORY
    from ml.segmentation.prediction import PREDICTED

    (tmp_path / "seats").mkdir()
    blocks = {
        "paved.json": block_of_page(PAGE, "json"),
        "fine.json": block_of_page(PAGE, "json", 1),
        "seats/bench.obj": block_of_page(PAGE, "text"),
        "seats/library.json": block_of_page(PAGE, "json", 2),
    }
    for name, text in blocks.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    page = (ROOT / "docs" / PAGE).read_text(encoding="utf-8")
    lines = list(commands(page[page.index("## Splitting") :], "synthroads"))
    assert [words[1] for words in lines] == ["generate", "cloud", "train", "evaluate", "predict"]
    told: dict[str, Any] = {}
    for words in lines:
        run = [sys.executable, "-c", "from synthroads_addon import console; console()", *words[1:], "--quiet", "--json"]
        env = {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "PATH": ""}
        done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False, env=env)
        assert done.returncode == 0, done.stderr
        told[words[1]] = json.loads(done.stdout)
    written = laspy.read(tmp_path / "out" / "fine" / "cloud.laz")
    counts = json.loads((tmp_path / "out" / "fine" / "report.json").read_text())["counts"]["points_by_class"]
    for name, (number, code) in NEW.items():
        of_class = np.asarray(written["class_id"]) == number
        assert of_class.sum() == counts[name] > 0
        assert set(np.asarray(written.classification)[of_class].tolist()) == {code}
    assert counts["road"] < 0.1 * counts["concrete_pavement"], "all of the pavement but patches is of concrete"
    (scores,) = told["evaluate"]["tests"].values()
    by_class = scores["classes"]
    assert {name: by_class[name]["support"] for name in NEW} == {name: counts[name] for name in NEW}
    learned = {name: by_class[name]["iou"] for name in NEW}
    assert min(learned.values()) > 0.05, learned
    losses = [epoch["loss"] for epoch in json.loads((tmp_path / "out" / "fine-net" / HISTORY).read_text())]
    assert losses[-1] < 0.8 * losses[0], "the loss falls"
    labelled = laspy.read(tmp_path / "out" / "labelled.laz")
    assert len(labelled.points) == len(written.points)
    for name, (number, code) in NEW.items():
        predicted = np.asarray(labelled[PREDICTED]) == number
        assert predicted.any(), name
        assert set(np.asarray(labelled.classification)[predicted].tolist()) == {code}
