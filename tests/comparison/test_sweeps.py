"""Figures of sweeps: on made-up points whose density, noise, thickness and contrast are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.realism.sweeps import (
    RINGS,
    SweepFigures,
    best_accuracy,
    misses,
    number_noise,
    scanner_place,
    sweep_figures,
    table,
    thickness,
)
from synthroads_addon.base.errors import InputError
from synthroads_addon.comparison.clouds import ListedCloud
from tests.helpers.clouds.calibration_cloud import write_las

HEIGHT = 1.7
PLACE = np.array([300.0, 200.0, 50.0 + HEIGHT])


def test_noise_is_the_mean_difference_of_neighbours() -> None:
    rng = np.random.default_rng(1)
    place = rng.uniform(0, 4, (4000, 3)) * [1, 1, 0]
    number = np.exp(rng.normal(0, 0.2, 4000))
    # Of two independent normal variables: 2 / sqrt(pi) sigma.
    assert number_noise(place, number) == pytest.approx(0.2 * 2.0 / np.sqrt(np.pi), rel=0.05)
    assert np.isnan(number_noise(100.0 * place, number))


def test_thickness_is_the_spread_across_the_surface() -> None:
    rng = np.random.default_rng(2)
    place = np.column_stack([rng.uniform(0, 10, (5000, 2)), rng.normal(0, 0.01, 5000)])
    # A plane through 20 points takes three of their degrees of freedom.
    assert thickness(place) == pytest.approx(0.01 * np.sqrt(17.0 / 20.0), rel=0.05)
    assert np.isnan(thickness(place[:5]))


def test_a_thresholds_best_accuracy() -> None:
    rng = np.random.default_rng(3)
    one, other = rng.normal(0, 1, 40_000), rng.normal(1, 1, 40_000)
    # Half way between the means: Phi(1/2).
    assert best_accuracy(one, other) == best_accuracy(other, one) == pytest.approx(0.6915, abs=0.01)
    assert best_accuracy(one, one) == pytest.approx(0.5, abs=0.01)
    assert np.isnan(best_accuracy(one, None))


def test_the_scanners_place_follows_from_ranges() -> None:
    rng = np.random.default_rng(4)
    place = PLACE + np.column_stack([rng.uniform(-20, 20, (3000, 2)), rng.normal(-HEIGHT, 0.02, 3000)])
    found = scanner_place(place, np.linalg.norm(place - PLACE, axis=1))
    np.testing.assert_allclose(found[:2], PLACE[:2], atol=0.05)
    assert found[2] == pytest.approx(PLACE[2], abs=0.3)


def test_figures_of_a_made_up_sweep(tmp_path: Path) -> None:
    """Road of 40 points to the square metre, markings twice as bright, vegetation 1.5 times, one number in ten 0."""
    rng = np.random.default_rng(5)
    side, each = 15.0, (36_000, 800, 900)
    xy = rng.uniform(-side, side, (sum(each), 2))
    label = np.repeat([40, 60, 70], each)
    number = 20_000.0 * np.repeat([1.0, 2.0, 1.5], each) * np.exp(rng.normal(0, 0.1, len(label)))
    number[(label == 40) & (rng.random(len(label)) < 0.1)] = 0.0
    place = PLACE + np.column_stack([xy, np.full(len(xy), -HEIGHT)])
    path = write_las(tmp_path / "sweep.las", place, number, label)
    classes = {"class_field": "label", "road": "40", "marking": "60", "vegetation": "70"}
    row = ListedCloud(cloud=path.name, scanner=tuple(PLACE.tolist()), **classes)
    found = sweep_figures(path, row)
    assert found.density[1:3] == pytest.approx(40.0, rel=0.1)
    assert found.level[1] == pytest.approx(10.0 * np.log10(20_000.0), abs=0.1)
    assert found.values["marking over road"] == pytest.approx(2.0, rel=0.02)
    assert found.values["vegetation over road"] == pytest.approx(1.5, rel=0.02)
    assert found.values["zeros"] == pytest.approx(0.1, abs=0.01)
    ahead, behind = (row.model_copy(update={"azimuth_deg": ends}) for ends in ((-80.0, 80.0), (100.0, -100.0)))
    dim = number * np.where(xy[:, 0] > 0.0, 0.5, 1.0)
    write_las(path, place, dim, label)
    halves = [sweep_figures(path, half) for half in (ahead, behind)]
    assert halves[1].level[1] - halves[0].level[1] == pytest.approx(10.0 * np.log10(2.0), abs=0.1)
    assert [half.values["zeros"] for half in halves] == pytest.approx([0.1, 0.1], abs=0.01)
    assert halves[0].name == "sweep (-80 to 80 deg)"
    with pytest.raises(InputError, match="has no ranges"):
        sweep_figures(path, row.model_copy(update={"scanner": None}))


def test_azimuths_need_a_scanner() -> None:
    with pytest.raises(InputError, match="azimuth_deg needs scanner"):
        ListedCloud.from_dict({"cloud": "sweep.las", "azimuth_deg": [-80, 80]})
    with pytest.raises(InputError, match="180"):
        ListedCloud.from_dict({"cloud": "sweep.las", "scanner": [0, 0, 0], "azimuth_deg": [0, 190]})


def made_up(**changes: float) -> SweepFigures:
    """Return figures that are within all limits, but for changed ones."""
    values = {"marking over road": 1.4, "vegetation over road": 1.2, "noise": 0.25, "zeros": 0.1}
    values |= {"thickness, mm": 0.4, "threshold: road or marking": 0.75, "threshold: road or vegetation": 0.7}
    rings = len(RINGS) - 1
    return SweepFigures("made up", np.full(rings, 10.0), np.full(rings, 40.0), values | changes)


def test_what_is_beyond_its_limit_is_said() -> None:
    real = made_up()
    assert not misses(made_up(), real)
    assert misses(made_up(zeros=0.2), real) == ["zeros: 0.2, 0.03 to 0.15 allowed"]
    assert misses(made_up(**{"threshold: road or marking": 0.81}), real) == [
        "threshold: road or marking: 0.81 against 0.75"
    ]
    thin = replace(made_up(), density=real.density / 1.6)
    assert [miss.split(":")[0] for miss in misses(thin, real)] == [
        f"density at {ring} m" for ring in ("6 to 10", "10 to 15", "15 to 20")
    ]
    dark = replace(made_up(), level=real.level - 3.5)
    assert len(misses(dark, real)) == len(RINGS) - 1
    assert "| zeros | 0.1 | 0.2 |" in table([real, made_up(zeros=0.2)], real)
