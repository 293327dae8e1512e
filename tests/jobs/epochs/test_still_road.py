"""A road on which nothing changes, surveyed twice: M3C2 finds nothing but what its level of detection allows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.comparison.epochs.detectors import DetectorSettings, m3c2
from synthroads_addon.jobs.epochs.epochs import EpochsJob, generate_epochs
from synthroads_addon.jobs.generate import Job
from synthroads_addon.scenario.scenario import load_scenario

SETTINGS = [
    "fidelity=draft",
    "seed=4",
    "colour.source=material",
    "colour.rgb=false",
    "road.length=50",
    "road.half_width=24",
    "road.changes.kinds=[]",
    'outputs=["parameters","cloud"]',
    'cloud.formats=["npz"]',
]
EXACT = ["scan.strip_errors={}", 'scan.noise={"range_sigma":0.005}']
"""No error but the noise of the range."""


def surveyed_twice(folder: Path, *settings: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the clouds of two surveys of a road on which nothing changes, of other paths and random numbers."""
    generate_epochs(EpochsJob(Job(load_scenario("rq31-600m", [*SETTINGS, *settings]), folder, new_file=True)))
    first, second = (dict(np.load(folder / f"epoch-{number}" / "cloud.npz")) for number in (1, 2))
    return first, second


def test_without_systematic_errors_distances_are_centred_and_within_their_level(tmp_path: Path) -> None:
    pytest.importorskip("py4dgeo")
    first, second = surveyed_twice(tmp_path / "still", *EXACT)
    result = m3c2(first["xyz"], second["xyz"], DetectorSettings())
    judged = np.isfinite(result.distance) & (second["change"] == 0) & (second["not_seen_before"] == 0)
    for c in np.unique(second["class_id"]):
        m = judged & (second["class_id"] == c)
        if m.sum() > 100:
            d, l = result.distance[m], result.detection_limit[m]
            print(f"class {c} n {m.sum()} mean {1e3*d.mean():.3f} sd {1e3*d.std():.2f} LoD {1e3*np.median(l):.2f} in {(abs(d)<=l).mean():.4f}")
    distance, limit = result.distance[judged], result.detection_limit[judged]
    print(judged.sum(), distance.mean()*1e3, (np.abs(distance) <= limit).mean())
    assert abs(distance.mean()) < 0.0002
    assert (np.abs(distance) <= limit).mean() > 0.95
