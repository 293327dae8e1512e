"""Where a mesh needs points to follow ruts and potholes."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.road.damage import damage_columns, damaged_strips, space_shares
from synthroads_addon.road.section import Carriageway, CrossfallPoint, Lane, Pavement, Pothole
from synthroads_addon.road.section_geometry import CarriagewaySection


@pytest.mark.parametrize("tolerance", [0.02, 0.005, 0.001])
def test_a_narrow_pothole_has_columns_as_close_as_its_slope_needs(tolerance: float) -> None:
    pothole = Pothole(station=50.0, offset=-5.0, length=0.4, width=0.17, depth=0.05)
    lanes = (Lane(width=3.75), Lane(width=3.75))
    section = CarriagewaySection(
        Carriageway(
            instance=1, side="right", inner_offset=1.5, hard_shoulder_width=2.5, outer_edge_strip_width=0.5,
            lanes=lanes, inner_edge_strip_width=0.5, verge_width=1.5, crossfall=(CrossfallPoint(station=0.0,
            crossfall_percent=2.5),), pavement=Pavement(potholes=(pothole,)),
        )
    )  # fmt: skip
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
