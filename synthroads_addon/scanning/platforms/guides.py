"""Guides of paths: the centreline of a road, any polyline (`platforms.polyline`), or polynomials fitted to either.

A guide is a curve in plan, evaluated by station (m) in float64, with an elevation along it and a ground around it. Its
offsets count to the left.
"""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.maps.places import Placement
from ...road.alignment import Alignment
from ...road.damage import damage_depth
from ...road.geometry import RoadGeometry
from ...road.profile import Profile
from ...road.section_geometry import CarriagewaySection
from ...road.terrain import surface_elevation

_SAMPLES = 201
"""Stations at which a lane's place is looked up. Chosen: half a percent of the road from one to the next."""
_FULL_LANE = 1.99
"""Width of a lane that is whole, m. Chosen: a narrower one begins or ends; schemas allow 2 m and more."""


class Guide:
    """Line that a path follows: an alignment with a profile; what lies beneath is level across and as high as the line.

    A vehicle drives along the line, and a tripod stands on it, unless a guide says otherwise.

    Args:
        alignment: the line in plan.
        profile: its elevation.
        origin: (3,) map coordinates of the local origin, m.

    Attributes:
        length: the largest station, m; the first is 0.
        origin: (3,) map coordinates of the local origin, m.
        breaks: (B,) stations at which the curvature may jump or bend.
        place: the map's coordinate system, as far as it is known.
    """

    place: Placement = Placement()

    def __init__(self, alignment: Alignment, profile: Profile, origin: ArrayLike) -> None:
        self.alignment, self.profile = alignment, profile
        self.origin = np.array(origin, dtype=np.float64)
        self.length, self.breaks = alignment.length, alignment.element_starts

    def frame(self, station: Float) -> tuple[Float, Float, Float, Float]:
        """Return plan position (K, 2), heading (K,), curvature (K,) 1/m, and plan length per station (K,)."""
        plan, heading, curvature = self.alignment.frame(station)
        return plan, heading, curvature, np.ones(len(station))

    def elevation(self, station: Float) -> Float:
        """Return the local elevation (K,), m, of the line itself at stations (K,), m."""
        return self.profile.elevation(station)

    def ground(self, station: Float, offset: Float, damaged: bool) -> Float:
        """Return the ground's local elevation (K,), m, at stations and offsets (K,), m; NaN where it is unknown.

        Args:
            station, offset: (K,) m.
            damaged: whether ruts and potholes lower it.
        """
        return self.elevation(station)

    def known_ground(self, station: Float, offset: Float, damaged: bool) -> Float:
        """Return the ground's local elevation (K,), m, at stations and offsets (K,), m.

        Raises:
            InputError: it is unknown at one of them; the message names the offset.
        """
        ground = self.ground(station, offset, damaged)
        unknown_rows = np.flatnonzero(~np.isfinite(ground))
        if len(unknown_rows):
            row = unknown_rows[0]
            requirement = f"there is no ground known at station {station[row]:.1f} m; a smaller one is needed"
            raise InputError("scan.platform.lateral_offsets", float(offset[row]), requirement)
        return ground

    def project(self, plan: Float) -> tuple[Float, Float]:
        """Return stations (K,) and offsets (K,), m, of local plan points (K, 2) beside the alignment."""
        return self.alignment.project(plan)

    def driving_offsets(self) -> tuple[float, ...]:
        """Return the offsets, m, in which a vehicle drives, one per carriageway: here the line itself."""
        return (0.0,)

    def roadside_offsets(self, station: Float) -> Float:
        """Return the offsets (K,), m, at which a tripod stands at stations (K,), m: here on the line itself."""
        return np.zeros(len(station))


class RoadGuide(Guide):
    """Guide along a road's centreline; it knows the road's surface, its lanes and its pavement's edges."""

    def __init__(self, geometry: RoadGeometry) -> None:
        super().__init__(geometry.alignment, geometry.profile, geometry.parameters.transform.translate)
        self.geometry = geometry

    @cached_property
    def place(self) -> Placement:  # type: ignore[override]
        """Return the road's map coordinate system."""
        return Placement.of(self.geometry.parameters.metadata.system)

    def ground(self, station: Float, offset: Float, damaged: bool) -> Float:
        """Return the local elevation (K,), m, of the road, its batter or the ground; NaN beyond an elevation model.

        Args:
            station, offset: (K,) m.
            damaged: whether ruts and potholes lower it.
        """
        height = surface_elevation(self.geometry, station, offset)
        if not damaged:
            for section in self.geometry.sections.values():
                height += damage_depth(section, station, offset)
        return height

    def driving_offsets(self) -> tuple[float, ...]:
        """Return the offset of the outermost through lane's middle, m, first where traffic runs with the stations.

        It is the median along the road of the outermost lane that is there along at least half of it.
        """
        sections = sorted(self.geometry.sections.values(), key=lambda section: -section.carriageway.traffic)
        return tuple(_lane_middle(section, self.length) for section in sections)

    def roadside_offsets(self, station: Float) -> Float:
        """Return the offsets (K,) of the pavement's outer edges at stations (K,): by turns right and left."""
        sections = [section for _, section in sorted(self.geometry.sections.items(), reverse=True)]
        edges = [section.carriageway.sign * section.paved_edge(station) for section in sections]
        return np.choose(np.arange(len(station)) % len(edges), edges)


class SmoothedGuide(Guide):
    """Polynomials of the station fitted to a guide's x and y by least squares; elevations stay the guide's.

    They are Chebyshev sums of the station scaled to -1 ... 1, about the guide's mean, so that a high degree on a long
    road stays well conditioned.

    Args:
        guide: what to fit.
        degree: of the polynomials.

    Raises:
        InputError: the polynomials turn back on themselves.
    """

    def __init__(self, guide: Guide, degree: int) -> None:
        super().__init__(guide.alignment, guide.profile, guide.origin)
        self._guide, self.breaks = guide, np.zeros(0)
        count = int(np.clip(np.ceil(self.length), 20 * degree, 20_000))
        station = np.arange(count + 1) * (self.length / count)
        plan = guide.frame(station)[0]
        self._mean = plan.mean(axis=0)
        fit = np.polynomial.chebyshev
        coefficients = fit.chebfit(self._fit_variable(station), plan - self._mean, degree)
        self._derivatives = [coefficients]
        for _ in range(2):
            self._derivatives.append(fit.chebder(self._derivatives[-1]) * (2.0 / self.length))
        stretch = self.frame(station)[3]
        if stretch.min() < 0.02:
            turning_station = float(station[stretch.argmin()])
            raise InputError(
                "scan.platform.polynomial_degree",
                degree,
                f"the smoothed path turns back at station {turning_station:.1f} m",
            )

    def _fit_variable(self, station: Float) -> Float:
        """Return stations (K,), m, scaled to -1 to 1."""
        return 2.0 * station / self.length - 1.0

    def frame(self, station: Float) -> tuple[Float, Float, Float, Float]:
        """Return plan position (K, 2), heading (K,), curvature (K,) 1/m, and plan length per station (K,)."""
        u = self._fit_variable(station)
        (x, y), (dx, dy), (ddx, ddy) = (np.polynomial.chebyshev.chebval(u, part) for part in self._derivatives)
        stretch = np.hypot(dx, dy)
        # Curvature of a curve in plan: (x' y'' - y' x'') / (x'^2 + y'^2)^(3/2).
        curvature = (dx * ddy - dy * ddx) / np.maximum(stretch, 1e-12) ** 3
        return np.stack([x, y], axis=1) + self._mean, np.arctan2(dy, dx), curvature, stretch

    def ground(self, station: Float, offset: Float, damaged: bool) -> Float:
        """Return the guide's ground elevation (K,), m, below points at offsets from the smoothed line.

        Args:
            station, offset: (K,) m, of the smoothed line.
            damaged: whether ruts and potholes lower it.
        """
        plan, heading, _, _ = self.frame(station)
        leftward = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        return self._guide.ground(*self._guide.project(plan + offset[:, None] * leftward), damaged)

    def driving_offsets(self) -> tuple[float, ...]:
        """Return the driving offsets of the guide that is smoothed, m."""
        return self._guide.driving_offsets()

    def roadside_offsets(self, station: Float) -> Float:
        """Return the roadside offsets (K,), m, of the guide that is smoothed, at stations (K,)."""
        return self._guide.roadside_offsets(station)


def _lane_middle(section: CarriagewaySection, length: float) -> float:
    """Return the offset, m, of the middle of a carriageway's outermost usual lane, as the median along the road.

    A usual lane is one for through traffic that is as wide as a lane along half of the road or more; if there is none,
    the lane that comes nearest to that is taken.

    Args:
        section: the carriageway.
        length: of the road, m.
    """
    station = np.arange(_SAMPLES) * (length / (_SAMPLES - 1))
    boundaries = section.lane_boundaries(station)  # (stations, lanes + 1), the outermost lane first
    is_full = boundaries[:, :-1] - boundaries[:, 1:] >= _FULL_LANE
    is_through = [lane.kind == "through" for lane in section.carriageway.lanes]
    # Other lanes count so little that any through lane comes before them.
    share = is_full.mean(axis=0) * np.where(is_through, 1.0, 1e-3)
    usual_lanes = np.flatnonzero(share >= 0.5)
    lane = int(usual_lanes[0]) if len(usual_lanes) else int(share.argmax())
    middle = (boundaries[:, lane] + boundaries[:, lane + 1]) / 2.0
    rows = is_full[:, lane] if is_full[:, lane].any() else np.ones(len(station), dtype=bool)
    return section.carriageway.sign * float(np.median(middle[rows]))
