"""Ruts and potholes: how deep they are where, and where a mesh needs points to follow them."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.road.damage import (
    damage_columns,
    damage_depth,
    damaged_strips,
    deepest_damage,
    space_shares,
)
from synthroads_addon.road.section import Carriageway, CrossfallPoint, Lane, Pavement, Pothole, Rut
from synthroads_addon.road.section_geometry import CarriagewaySection


def section_with(**damage: tuple[Rut | Pothole, ...]) -> CarriagewaySection:
    """Return a right carriageway of two lanes, from 2 to 5.75 and to 9.5 m beside the axis, with some damage."""
    carriageway = Carriageway(
        instance=1, side="right", inner_offset=1.5, hard_shoulder_width=2.5, outer_edge_strip_width=0.5,
        lanes=(Lane(width=3.75), Lane(width=3.75)), inner_edge_strip_width=0.5, verge_width=1.5,
        crossfall=(CrossfallPoint(station=0.0, crossfall_percent=2.5),), pavement=Pavement(**damage),
    )  # fmt: skip
    return CarriagewaySection(carriageway)


def test_a_rut_is_two_troughs_that_begin_and_end_gently() -> None:
    rut = Rut(lane=0, start_station=10.0, end_station=50.0, depth=0.02, width=0.8, track=1.8, ramp_length=8.0)
    section = section_with(ruts=(rut,))
    middle = (5.75 + 9.5) / 2.0
    for track in (middle - 0.9, middle + 0.9):
        beside = np.array([-0.4, -0.2, 0.0, 0.1, 0.2, 0.4, 0.6])
        depth = damage_depth(section, np.full(7, 30.0), -(track + beside))
        # Depth * cos^2(pi * distance / width), and nothing beyond half the width.
        wanted = 0.02 * np.where(np.abs(beside) <= 0.4, (1.0 + np.cos(2.0 * np.pi * beside / 0.8)) / 2.0, 0.0)
        assert depth == pytest.approx(wanted, abs=1e-12)
    along = np.array([10.0, 12.0, 14.0, 18.0, 42.0, 46.0, 50.0, 55.0])
    depth = damage_depth(section, along, np.full(8, -(middle + 0.9)))
    assert depth == pytest.approx(
        0.02 * np.array([0.0, 0.5 - 0.5 / np.sqrt(2), 0.5, 1.0, 1.0, 0.5, 0.0, 0.0]), abs=1e-12
    )


def test_a_pothole_is_a_bowl_and_the_deeper_damage_counts() -> None:
    rut = Rut(lane=0, start_station=0.0, end_station=100.0, depth=0.03, width=0.8, track=1.8, ramp_length=8.0)
    hole = Pothole(station=50.0, offset=-8.525, length=0.8, width=0.4, depth=0.04)
    section = section_with(ruts=(rut,), potholes=(hole,))
    place = np.array([[50.0, -8.525], [50.2, -8.525], [50.3, -8.525], [50.0, -8.625], [51.0, -8.525]])
    # In the middle of the wheel track: depth * (1 - r^2), but where the rut is deeper.
    across = 0.03 * np.cos(np.pi * 0.1 / 0.8) ** 2
    assert damage_depth(section, *place.T) == pytest.approx([0.04, 0.03, 0.03, max(0.03, across), 0.03], abs=1e-12)
    assert deepest_damage(section, *place.T).tolist() == [1, 0, 0, 1, 0]


@pytest.mark.parametrize("tolerance", [0.02, 0.005, 0.001])
def test_a_narrow_pothole_has_columns_as_close_as_its_slope_needs(tolerance: float) -> None:
    pothole = Pothole(station=50.0, offset=-5.0, length=0.4, width=0.17, depth=0.05)
    section = section_with(potholes=(pothole,))
    (strip,) = damaged_strips(section)
    inner, outer = section.distances(50.0)[0, strip : strip + 2]
    across = inner + damage_columns(section, strip, tolerance) * (outer - inner)
    inside = across[(across > 5.0 - 0.0851) & (across < 5.0 + 0.0851)]
    assert inside[[0, -1]] == pytest.approx([5.0 - 0.085, 5.0 + 0.085], abs=0.001)
    # Between two columns h apart the bowl bends by depth (h / width)^2, and at the rim its slope breaks by h / 4 of it.
    slope = 4.0 * pothole.depth / pothole.width
    assert np.diff(inside).max() * slope / 4.0 < tolerance


def test_columns_keep_their_ends_and_a_distance() -> None:
    shares = np.unique(np.concatenate([[0.0, 1.0], np.linspace(0.4, 0.41, 1001), [1e-5, 1.0 - 1e-5]]))
    kept = space_shares(shares)
    assert (kept[0], kept[-1]) == (0.0, 1.0)
    assert np.diff(kept).min() > 2e-4
    assert np.diff(kept[(kept >= 0.4) & (kept <= 0.41)]).max() < 2.2e-4
