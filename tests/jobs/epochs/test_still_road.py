"""A road on which nothing changes, surveyed twice: M3C2 finds nothing but what its level of detection allows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.comparison.epochs.detectors import DetectorSettings, Distances, m3c2
from synthroads_addon.comparison.epochs.pairs import stated_registration
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


def judged(second: dict[str, Any], result: Distances, least: float = 0.9) -> tuple[np.ndarray, np.ndarray]:
    """Return distances and levels of detection, m, of the unchanged points that a detector is judged by."""
    rows = np.isfinite(result.distance) & (second["change"] == 0) & (second["not_seen_before"] == 0)
    assert rows.sum() > least * len(rows)
    return result.distance[rows], result.detection_limit[rows]


def within(distance: np.ndarray, level: np.ndarray) -> float:
    """Return the share of distances within their level of detection."""
    return float((np.abs(distance) <= level).mean())


def test_without_systematic_errors_distances_are_centred_and_within_their_level(tmp_path: Path) -> None:
    pytest.importorskip("py4dgeo")
    first, second = surveyed_twice(tmp_path / "exact", *EXACT)
    distance, level = judged(second, m3c2(first["xyz"], second["xyz"], DetectorSettings()))
    assert abs(distance.mean()) < 0.0002
    assert within(distance, level) > 0.95
    # Ground, road and roadside each: a relief of its own in each survey would show on the roughest of them.
    for number in (0, 1, 15):
        rows = second["class_id"] == number
        part = {name: array[rows] for name, array in second.items() if array.shape[:1] == rows.shape}
        result = m3c2(first["xyz"], part["xyz"], DetectorSettings())
        assert within(*judged(part, result)) > 0.92, number


def test_surveys_state_the_registration_that_their_clouds_have(tmp_path: Path) -> None:
    """The scenario's boresight, lever arm and drifts displace both clouds by centimetres."""
    pytest.importorskip("py4dgeo")
    folder = tmp_path / "surveyed"
    first, second = surveyed_twice(folder)
    shift = json.loads((folder / "epoch-2" / "registration.json").read_text(encoding="utf-8"))["since_epoch_before"]
    plain = m3c2(first["xyz"], second["xyz"], DetectorSettings())
    distance, level = judged(second, plain)
    assert within(distance, level) < 0.7
    paved = judged({**second, "change": np.where(second["class_id"] == 1, second["change"], 1)}, plain, 0.3)
    assert np.median(paved[0]) == pytest.approx(shift["shift"][2], abs=0.004)
    for registration in (stated_registration(folder / "epoch-2"), None):
        result = m3c2(first["xyz"], second["xyz"], DetectorSettings(registration=registration))
        assert result.registration is not None
        assert 0.001 < result.registration < 0.1
        assert within(*judged(second, result)) > 0.95
