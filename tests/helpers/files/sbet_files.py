"""Trajectories of a platform along a straight line, as SBET and as CSV in conventions of all kinds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pyproj import Proj, Transformer

from synthroads_addon.base.arrays import Float


@dataclass(frozen=True)
class Flight:
    """A flight on the map, by grid azimuth (deg) and speed (m/s), at 100 Hz.

    Attributes:
        course: deg, clockwise from grid north.
        crab: heading less course, deg.
        begin: first time, s.
        height: m.
    """

    course: float = 53.0
    crab: float = 2.0
    begin: float = 374_512.0
    height: float = 240.0
    count: int = 200

    @property
    def time(self) -> Float:
        return self.begin + 0.01 * np.arange(self.count)

    @property
    def points(self) -> Float:
        way, angle = 8.0 * (self.time - self.begin), np.deg2rad(self.course)
        x, y = 294_000.0 + way * np.sin(angle), 5_628_000.0 + way * np.cos(angle)
        return np.column_stack([x, y, np.full(self.count, self.height)])

    @property
    def heading(self) -> Float:
        return np.full(self.count, self.course + self.crab)

    def csv(self, path: Path, heading: Float, head: str = "time,x,y,z,roll,pitch,heading") -> Path:
        """Write the flight with headings in whatever convention; return the path."""
        rows = np.column_stack([self.time, self.points, 0.4 + 0 * heading, -1.2 + 0 * heading, heading])
        path.write_text("\n".join([head, *(",".join(f"{value:.6f}" for value in row) for row in rows.tolist())]))
        return path

    def sbet(self, path: Path, epsg: int = 25832, wander: float = 0.0, sign: float = 1.0) -> Path:
        """Write the flight as SBET, with a wander angle (rad) of either sign's convention; return the path."""
        x, y, z = self.points.T
        longitude, latitude = Transformer.from_crs(epsg, "OGC:CRS84", always_xy=True).transform(x, y)
        convergence = Proj(epsg).get_factors(longitude, latitude).meridian_convergence
        records = np.zeros((self.count, 17))
        records[:, 0], records[:, 1], records[:, 2], records[:, 3] = (
            self.time,
            np.deg2rad(latitude),
            np.deg2rad(longitude),
            z,
        )
        records[:, 7], records[:, 8] = np.deg2rad(0.4), np.deg2rad(-1.2)
        records[:, 9] = np.deg2rad(self.heading + convergence) + sign * wander
        records[:, 10] = wander
        path.write_bytes(records.astype("<f8").tobytes())
        return path
