"""OpenDRIVE in a projection of its own: a transverse Mercator about the site, without an offset in the header.

For readers that take ``lat_0`` and ``lon_0`` from the header alone (CARLA), or leave its offset out or subtract it. The
plan is turned by the angle between grid north and true north, and the projection's scale is the map's at the site, so
that lengths stay those of the road. Both are exact at the site; a kilometre off they are some millimetres off.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from .xml import PLAN_DIGITS, Element, attribute_text

_ARM = 50.0
"""Half the distance over which turn and scale are measured, m."""


@dataclass(frozen=True)
class LocalProjection:
    """A transverse Mercator about a place of a map.

    Attributes:
        latitude, longitude: of the place, degrees (WGS 84).
        scale: of the projection at the place, which is the map's there.
        turn: angle from the map's axes to the projection's own, rad counter-clockwise, by which headings grow.
        height: of the place, m.
    """

    latitude: float
    longitude: float
    scale: float
    turn: float
    height: float

    @classmethod
    def about(cls, epsg: int, place: Float) -> LocalProjection:
        """Return the projection about a place (3,) in map coordinates, m.

        Raises:
            InputError: the place lies where the system has no longitudes and latitudes.
        """
        from pyproj import Transformer  # takes a fifth of a second, and few roads need it

        x, y, z = (float(value) for value in place)
        longitude, latitude = Transformer.from_crs(epsg, 4326, always_xy=True).transform(x, y)
        if not (math.isfinite(longitude) and math.isfinite(latitude)):
            raise InputError("transform.translate", [x, y], f"must lie within EPSG:{epsg}")
        longitude, latitude = round(longitude, 12), round(latitude, 12)
        text = _text(latitude, longitude, 1.0)
        transformer = Transformer.from_crs(epsg, text, always_xy=True)
        east, north = transformer.transform([x + _ARM, x - _ARM, x, x], [y, y, y + _ARM, y - _ARM])
        # The map's x axis in the projection, and its y axis turned back by 90 degrees: equal for conformal projections
        # but for the finite arm, so their mean is taken.
        x_axis = np.array([east[0] - east[1], north[0] - north[1]])
        y_axis = np.array([north[2] - north[3], -(east[2] - east[3])])
        mean_axis = (x_axis + y_axis) / (4.0 * _ARM)
        return cls(
            latitude, longitude, 1.0 / float(np.hypot(*mean_axis)), float(np.arctan2(mean_axis[1], mean_axis[0])), z
        )

    @property
    def text(self) -> str:
        """Return the projection as a PROJ string."""
        return _text(self.latitude, self.longitude, self.scale)

    def turned(self, points: Float) -> Float:
        """Return local coordinates (N, 2), m, of the road in the projection."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return np.asarray(points) @ np.array([[cos, sin], [-sin, cos]])

    def turn_plan(self, root: Element, corners: Float) -> None:
        """Turn an OpenDRIVE file's lines and bounds, and raise its roads to their heights, in place.

        Args:
            root: of the file.
            corners: (N, 2) local coordinates, m, of places on the road's edges.
        """
        for piece in root.iter("geometry"):
            ((x, y),) = self.turned(np.array([[float(piece.attrib["x"]), float(piece.attrib["y"])]]))
            piece.set("x", _plan_text(x))
            piece.set("y", _plan_text(y))
            piece.set("hdg", f"{float(piece.attrib['hdg']) + self.turn + 0.0:.13g}")
        for piece in _elevations(root):
            piece.set("a", attribute_text(float(piece.attrib["a"]) + self.height))
        turned_corners = self.turned(corners)
        lower, upper = np.floor(turned_corners.min(axis=0)) - 1.0, np.ceil(turned_corners.max(axis=0)) + 1.0
        bounds = {"north": upper[1], "south": lower[1], "east": upper[0], "west": lower[0]}
        for header in root.iter("header"):
            for name, value in bounds.items():
                header.set(name, attribute_text(float(value)))


def _elevations(root: Element) -> Iterable[Element]:
    """Return the `elevation` elements of all roads in a file."""
    return (piece for profile in root.iter("elevationProfile") for piece in profile.iter("elevation"))


def _plan_text(value: float) -> str:
    """Return the text of a plan coordinate (m), rounded to `PLAN_DIGITS` decimals and without a negative zero."""
    return attribute_text(round(float(value), PLAN_DIGITS) + 0.0)


def _text(latitude: float, longitude: float, scale: float) -> str:
    """Return the PROJ string of a transverse Mercator about a place (degrees, WGS 84) with a scale there."""
    place = f"+lat_0={latitude:.12f} +lon_0={longitude:.12f}"
    return f"+proj=tmerc {place} +k={scale:.12f} +x_0=0 +y_0=0 +ellps=WGS84 +units=m +vunits=m +no_defs"
