"""Light and navigation in tunnels: darker colours, lamps, and where there is no GNSS."""

from __future__ import annotations

import numpy as np

from synthroads_addon.jobs.scan.outages import outages_in_tunnels
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.scanning.colour.tunnel_light import TunnelLight
from synthroads_addon.scanning.platforms.path import make_strips
from tests.helpers.roads.structures import with_bridge, with_tunnel


class Straight:
    """A scanner that drives along the road at 20 m/s, 2 m above its axis, or above the hill."""

    knot_spacing, typical_range = 0.1, 10.0

    def __init__(self, geometry: RoadGeometry, height: float = 2.0) -> None:
        self.geometry, self.height = geometry, height
        self.strips = make_strips([geometry.length / 20.0])

    def pose(self, strip, time):
        station = (time - strip.start_time) * 20.0
        plan = self.geometry.alignment.position(station)
        height = self.geometry.profile.elevation(station) + self.height
        return np.column_stack([plan, height]), np.repeat(np.eye(3)[None], len(time), axis=0)


def test_gnss_is_lost_from_portal_to_portal() -> None:
    road = with_tunnel()
    (outage,) = outages_in_tunnels(road, Straight(RoadGeometry(road)))
    np.testing.assert_allclose([20.0 * outage.start, 20.0 * outage.end], [90.0, 170.0], atol=1.1)
    assert outages_in_tunnels(road, Straight(RoadGeometry(road), 40.0)) == ()
    assert outages_in_tunnels(with_bridge(), Straight(RoadGeometry(with_bridge()))) == ()
    assert outages_in_tunnels(None, Straight(RoadGeometry(road))) == ()


def test_colours_are_dark_inside_and_as_before_outside() -> None:
    road = with_tunnel()
    geometry = RoadGeometry(road)
    station = np.array([60.0, 89.0, 95.0, 130.0, 130.0])
    place = np.column_stack([geometry.alignment.position(station), geometry.profile.elevation(station)])
    place[4, 2] += 12.0  # on the hill above
    daylight, lamps = TunnelLight.of(road).light(place)
    np.testing.assert_allclose(daylight[:, 0], [1.0, 1.0, np.exp(-5.0 / 12.0), np.exp(-40.0 / 12.0), 1.0], rtol=1e-5)
    assert (lamps[[0, 1, 4]] == 0.0).all()
    assert (lamps[2] > 0.0).all()
    assert (lamps[2] < lamps[3]).all()
    dark = TunnelLight.of(with_tunnel(lamp_spacing=0.0)).light(place)[1]
    assert (dark == 0.0).all()
    moved = TunnelLight.of(road, (5.0, -3.0, 1.0)).light(place - (5.0, -3.0, 1.0))[0]
    np.testing.assert_allclose(moved, daylight, rtol=1e-5)
    assert TunnelLight.of(with_bridge()) is None
