"""Widths come back within what they say of themselves, and elements in number: on thrown clouds of sampled roads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.reconstruction.cloud import read_road_cloud
from synthroads_addon.reconstruction.reconstruct import reconstruct
from synthroads_addon.reconstruction.width_comparison import WidthErrors, compare_widths
from tests.helpers.clouds.road_clouds import QUIET, cloud_of, road, write

TIGHT = {"radius": {"minimum": 280.0, "maximum": 500.0}}
TURNOUTS: Any = QUIET["turnouts"]
ROADS: list[tuple[str, str, float, dict[str, Any]]] = [
    ("RQ31", "EKA1A", 350.0, {}),
    ("RQ31", "EKA1A", 400.0, {"turnouts": TURNOUTS | {"emergency_bays": 1.0}}),
    ("RQ31", "EKA1A", 600.0, {"turnouts": TURNOUTS | {"entries": 1.0}}),
    ("RQ36", "EKA1A", 450.0, {"lane_changes": {"share": 1.0}}),
    ("RQ25", "EKA3", 400.0, TIGHT),
]


def test_errors_are_counted_in_deviations_and_guesses_never_off() -> None:
    error = np.array([0.02, -0.02, np.inf, np.nan])
    off = WidthErrors("right", "lane 1", error, np.full(4, 0.01), np.zeros(4, dtype=bool)).off
    assert off[:3].tolist() == pytest.approx([2.0, 2.0, np.inf])
    assert np.isnan(off[3])
    guess = WidthErrors("right", "lane 1", error, np.full(4, np.inf), np.zeros(4, dtype=bool)).off
    assert guess[:3].tolist() == [0.0, 0.0, np.inf]  # a wrong number of lanes isn't excused


@pytest.mark.slow
def test_widths_of_sampled_roads_are_as_sure_as_they_say(tmp_path: Path) -> None:
    off, sections, elements, trusted = 0, 0, [], []
    for number, (section, design_class, length, limits) in enumerate(ROADS):
        truth = road(section, design_class, length, 20 + number, **limits)
        found = reconstruct(read_road_cloud(write(tmp_path / f"{number}.laz", cloud_of(truth, 12.0, number))))
        trusted.append(found.judgement.trusted)
        elements.append(abs(len(found.parameters.alignment.horizontal) - len(truth.alignment.horizontal)))
        for width in compare_widths(found, truth):
            kept = ~np.isnan(width.off) & ~width.marked
            sections += int(kept.sum())
            off += int((width.off[kept] > 3.0).sum())
    assert np.mean(trusted) > 0.95
    assert off <= 0.02 * sections
    assert sections > 2000
    assert sum(apart <= 1 for apart in elements) >= 4
