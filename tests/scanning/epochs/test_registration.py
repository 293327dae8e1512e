"""Displacements of clouds by the errors of their trajectories, against displacements that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from synthroads_addon.scanning.epochs.registration import CELL, SurveyErrors

SHIFT = np.array([0.03, -0.02, 0.05])
TURN = np.array([2e-5, -3e-5, 1e-4])
"""Turns about the axes, rad."""


def places(count: int = 40_000) -> np.ndarray:
    """Return places on a hilly strip of ground, m."""
    rng = np.random.default_rng(8)
    x, y = rng.uniform(0.0, 200.0, count), rng.uniform(-20.0, 20.0, count)
    return np.column_stack([x, y, 0.1 * x + 2.0 * np.sin(y / 9.0)])


def survey(place: np.ndarray, measured: np.ndarray) -> SurveyErrors:
    """Return the errors of a survey whose points come in three blocks."""
    result = SurveyErrors()
    for start in range(3):
        result.add(place[start::3], measured[start::3])
    return result


def turned(place: np.ndarray) -> np.ndarray:
    """Return places turned about the middle of the strip's cells and shifted."""
    middle = survey(place, place).displacement().place.mean(axis=0)
    return Rotation.from_rotvec(TURN).apply(place - middle) + middle + SHIFT


def test_a_rigid_motion_is_found_and_leaves_no_rest() -> None:
    place = places()
    report = survey(place, turned(place)).displacement().report()
    assert report["cells"] == 200 * 40 / CELL**2
    assert report["shift"] == pytest.approx(SHIFT, abs=1e-6)
    assert np.deg2rad(report["rotation_deg"]) == pytest.approx(TURN, abs=1e-7)
    assert max(report["rest"]) < 2e-6


def test_waves_are_a_rest_and_the_largest_direction_is_the_error() -> None:
    place = places()
    wave = 0.01 * np.sin(place[:, 0] / 8.0)[:, None] * np.array([0.0, 0.6, 0.8])
    displacement = survey(place, place + wave).displacement()
    rest = displacement.report()["rest"]
    assert rest[0] < 3e-4  # the turn that fits the wave best takes heights along
    assert rest[1:] == pytest.approx([0.006 / np.sqrt(2.0), 0.008 / np.sqrt(2.0)], rel=0.05)
    assert displacement.registration_error == pytest.approx(0.01 / np.sqrt(2.0), rel=0.05)


def test_two_surveys_are_compared_where_both_have_points() -> None:
    place = places()
    first = survey(place, place + SHIFT).displacement()
    far = place[:, 0] > 100.0
    second = survey(place[far], place[far] - SHIFT).displacement()
    since = second.since(first)
    assert since.report()["cells"] == 100 * 40 / CELL**2
    assert since.report()["shift"] == pytest.approx(-2.0 * SHIFT, abs=1e-6)
    assert since.registration_error == pytest.approx(2.0 * np.linalg.norm(SHIFT), abs=1e-6)


def test_the_order_of_blocks_has_no_influence() -> None:
    place, whole = places(3000), SurveyErrors()
    measured = place + np.random.default_rng(1).normal(0.0, 0.01, place.shape)
    for start in (2, 0, 1):
        whole.add(place[start::3], measured[start::3])
    assert whole.displacement().report() == survey(place, measured).displacement().report()


def test_without_points_there_is_no_error_to_state() -> None:
    nothing = SurveyErrors().displacement()
    assert nothing.report() == {"cells": 0}
    assert np.isnan(nothing.registration_error)
