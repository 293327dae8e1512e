"""The island's rounded nose between main road and ramp."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from synthroads_addon.checking.rules.edges import Edges
from synthroads_addon.road.section import Carriageway, CrossfallPoint, Lane, Ramp, Turnout
from synthroads_addon.road.section_geometry import CarriagewaySection

EXIT = {"taper_in_length": 30.0}
ENTRY = {"taper_out_length": 30.0}


def carriageway(side: Any) -> Carriageway:
    widths = {"inner_offset": 2.0, "outer_edge_strip_width": 0.5, "inner_edge_strip_width": 0.75, "verge_width": 1.5}
    fall = (CrossfallPoint(station=0.0, crossfall_percent=2.5),)
    lanes = (Lane(width=3.75), Lane(width=3.75))
    return Carriageway(instance=1, side=side, lanes=lanes, hard_shoulder_width=2.5, crossfall=fall, **widths)


@pytest.mark.parametrize(("kind", "side", "taper"), [("exit", "right", EXIT), ("entry", "left", ENTRY)])
def test_the_nose_is_half_an_ellipse(kind: Any, side: Any, taper: dict[str, float]) -> None:
    ramp = Ramp(length=90.0, clothoid_parameter=80.0)
    place: dict[str, Any] = {"instance": 2, "carriageway": side, "kind": kind, "start_station": 100.0}
    turnout = Turnout(**place, **taper, lane_length=150.0, lane_width=3.5, ramp=ramp)
    road = carriageway(side)
    section = CarriagewaySection(road, [turnout])
    (shape,) = section.turnouts
    assert shape.nose == pytest.approx((6.0 * 80.0**2 * 3.5) ** (1.0 / 3.0))
    behind = np.linspace(0.0, 3.0, 301)
    station = np.array([shape.nose_station(at) for at in behind.tolist()])
    inner, outer = section.boundaries_of("island", station)
    wedge = (shape.nose + behind) ** 3 / (6.0 * 80.0**2)
    length = 0.05 / (1.0 - np.cos(np.deg2rad(18.0)))
    turn = np.arccos(np.clip(1.0 - behind / length, -1.0, 1.0))
    exact = (wedge - 2.5) * np.where(behind < length, np.sin(turn), 1.0)
    # Ten sides stay within the ellipse.
    assert (outer - inner <= exact + 1e-9).all()
    assert np.abs(outer - inner - exact).max() < 0.05 * 3.1
    assert (outer - inner)[behind >= length] == pytest.approx(wedge[behind >= length] - 2.5)
    # Its middle is the ground's behind it, and no pavement is lost beside it.
    main, rounded = 2.0 + 0.75 + 7.5 + 0.5, (behind > 0.05) & (behind < length)
    middle = main + 2.5 + (wedge - 2.5) / 2.0
    assert ((inner + outer) / 2.0)[rounded] == pytest.approx(middle[rounded])
    assert section.boundaries_of("ramp_inner_strip", station)[0] == pytest.approx(main + wedge)
    edges = Edges(side, road, {"turnout": turnout}, 500.0).at(station)
    assert edges.gap_low[rounded] == pytest.approx(inner[rounded])
    assert edges.gap_high[rounded] == pytest.approx(outer[rounded])
