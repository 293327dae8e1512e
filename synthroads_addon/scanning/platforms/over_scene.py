"""Paths over a scene that nobody prepared: along a line, its road or its middle, or at given places."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ...base.errors import InputError
from ...base.maps.places import Placement
from ...road.axes.centerline import AxisContent
from ...road.geometry import RoadGeometry
from ..scene.extent import elevation_at, middle_line
from ..scene.mesh import SceneMesh
from .guides import RoadGuide
from .path import Path
from .platform import Platform
from .polyline import MEASURED, PolylineGuide
from .trajectory import RecordedTrajectory
from .tripod import Tripod, TripodPath


@dataclass(frozen=True)
class SceneRoute:
    """Route of a scanner over a scene: its kind, and points in the scene's local coordinates.

    Attributes:
        kind: ``extent``, straight over the scene's middle; ``line``, along points that a platform keeps its height
            above; ``flight``, through places of the scanner itself; ``places``, where a tripod's scanner stands.
        points: (N, 3) m; empty for the extent.
    """

    kind: Literal["extent", "line", "flight", "places"]
    points: list[list[float]] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return the route's kind and points as JSON data."""
        return {"kind": self.kind, "points": self.points}

    def path(self, platform: Platform, mesh: SceneMesh) -> Path:
        """Return a platform's path along the route, over or through a scene.

        Raises:
            InputError: the platform is no tripod and is to stand at places, or see `Platform.make_path`.
        """
        if self.kind == "places":
            return TripodPath(as_tripod(platform), self.points)
        if self.kind == "extent" or isinstance(platform, RecordedTrajectory):
            return path_over(platform, mesh)
        origin, points = mesh.origin.tolist(), np.array(self.points, dtype=np.float64)
        if self.kind == "flight":
            points[:, 2] -= platform.value("height")
        guide = PolylineGuide(points, origin, MEASURED)
        return platform.as_single_strip().make_path(guide, origin)


def path_over(
    platform: Platform,
    mesh: SceneMesh,
    road: RoadGeometry | None = None,
    line: AxisContent | None = None,
    places: Sequence[Sequence[float]] = (),
    map_place: Placement | None = None,
) -> Path:
    """Return the scanner's path: at places, along a line or the scene's road, or straight over the scene's middle.

    Along a line or over the middle it has one strip unless the platform has lateral offsets.

    Args:
        platform: the scanner's.
        mesh: the scene.
        road: that the scene shows.
        line: of a file, in map coordinates.
        places: of a tripod, (x, y) or (x, y, z) in map coordinates; z is that of the scanner itself.
        map_place: the map's coordinate system, which the line is moved into; unknown if None.

    Raises:
        InputError: places are given and the platform is no tripod, or there is nothing below one; or see
            `Platform.make_path`.
    """
    origin = mesh.origin.tolist()
    if places:
        tripod = as_tripod(platform)
        return TripodPath(tripod, [_scanner_place(tripod, place, mesh) for place in places])
    if road and not line:
        return platform.make_path(RoadGuide(road))
    guide = PolylineGuide.along(line, origin, place=map_place) if line else PolylineGuide(middle_line(mesh), origin)
    guide.place = map_place or Placement()
    return platform.as_single_strip().make_path(guide, origin)


def as_tripod(platform: Platform) -> Tripod:
    """Return the same platform, typed as a tripod; raise `InputError` if it is of another kind."""
    if not isinstance(platform, Tripod):
        raise InputError("scan.platform.kind", platform.kind, "must be tripod where its positions are given")
    return platform


def _scanner_place(tripod: Tripod, place: Sequence[float], mesh: SceneMesh) -> list[float]:
    """Return the local position (3,), m, of a tripod's scanner: above the highest surface unless z is given."""
    local_place = [value - base for value, base in zip(place, mesh.origin, strict=False)]
    if len(local_place) == 3:
        return local_place
    ground = elevation_at(mesh, *local_place)
    if ground is None:
        place_text = ",".join(f"{value:g}" for value in place)
        raise InputError("--tripod", place_text, "there is no surface below: give the scanner's elevation, X,Y,Z")
    return [*local_place, ground + tripod.value("height")]
