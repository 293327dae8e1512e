"""A road on which nothing changes, surveyed twice: M3C2 finds nothing but what its level of detection allows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.comparison.epochs.detectors import NORMAL_QUANTILE, estimated_registration
from synthroads_addon.comparison.epochs.pairs import stated_registration
from synthroads_addon.jobs.epochs.epochs import EpochsJob, generate_epochs
from synthroads_addon.jobs.generate import Job
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.clouds.plain_m3c2 import m3c2_at

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
SURFACES = {"ground": 0, "road": 1, "roadside": 15}
CORES = 3000
"""Places on each surface that are compared."""


def surveyed_twice(folder: Path, *settings: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the clouds of two surveys of a road on which nothing changes, of other paths and random numbers."""
    generate_epochs(EpochsJob(Job(load_scenario("rq31-600m", [*SETTINGS, *settings]), folder, new_file=True)))
    first, second = (dict(np.load(folder / f"epoch-{number}" / "cloud.npz")) for number in (1, 2))
    return first, second


def compared(first: dict[str, Any], second: dict[str, Any], surface: str) -> tuple[np.ndarray, np.ndarray]:
    """Return distances and levels of detection, m, at unchanged places of a surface that were seen before."""
    rows = (second["class_id"] == SURFACES[surface]) & (second["change"] == 0) & (second["not_seen_before"] == 0)
    chosen = np.random.default_rng(7).choice(np.flatnonzero(rows), CORES, replace=False)
    origin = second["xyz"].mean(axis=0)
    clouds = [cloud["xyz"] - origin for cloud in (first, second)]
    distance, level = m3c2_at(clouds[1][chosen], *clouds)
    is_known = np.isfinite(distance)
    assert is_known.mean() > 0.9
    return distance[is_known], level[is_known]


def within(distance: np.ndarray, level: np.ndarray, registration: float = 0.0) -> float:
    """Return the share of distances within their level of detection with a registration error, m."""
    return float((np.abs(distance) <= level + NORMAL_QUANTILE * registration).mean())


def test_without_systematic_errors_distances_are_centred_and_within_their_level(tmp_path: Path) -> None:
    """A micro-relief of its own in each survey would show on the ground, which is the roughest."""
    first, second = surveyed_twice(tmp_path / "exact", *EXACT)
    parts = [compared(first, second, surface) for surface in SURFACES]
    distance, level = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    assert abs(distance.mean()) < 0.0002
    assert within(distance, level) > 0.95
    # M3C2's quantile is the normal distribution's: of 20 points in a cylinder it holds for less than 95 %.
    assert min(within(*part) for part in parts) > 0.92


def test_surveys_state_the_registration_that_their_clouds_have(tmp_path: Path) -> None:
    """The scenario's boresight, lever arm and drifts displace both clouds by centimetres."""
    folder = tmp_path / "surveyed"
    first, second = surveyed_twice(folder)
    distance, level = compared(first, second, "road")
    assert within(distance, level) < 0.8
    said = json.loads((folder / "epoch-2" / "registration.json").read_text(encoding="utf-8"))
    assert np.median(distance) == pytest.approx(said["since_epoch_before"]["shift"][2], abs=0.006)
    for registration in (stated_registration(folder / "epoch-2"), estimated_registration(distance, level)):
        assert 0.001 < registration < 0.1
        assert within(distance, level, registration) > 0.95
