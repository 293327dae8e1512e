"""Coordinates that a file brings along, compared with the coordinate system they are wanted in.

What a file declares is used or refused; what it can't declare is logged as an assumption.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float
from ..errors import InputError
from ..remarks import assume, warn
from .crs import LONGITUDE_LATITUDE, MapSystem, UnknownSystemError, moved

HIGHEST = 9000.0
"""Largest height of a place on land, m."""
_LOCAL = 1e5
"""Coordinates up to this, m, may be a site's own; those of maps are larger."""
_BESIDE, _FAR = 0.5, 4.0
"""Degrees outside of the area that a system is meant for: from the first on it is told, from the second on refused."""
_EXACT = 1e-3
"""Ways between systems as exact as this, m, are conversions."""
_METRES = "metres of a projected system are needed, not degrees"


@dataclass(frozen=True)
class Placement:
    """The coordinate system of a file, and the way from its units to metres.

    Attributes:
        system: of what is read from it, in metres; None if the file names none.
        declared: as the file declares it, whose unit may be feet.
        notes: what is to be said about it, as sentences that follow on the file's name.
    """

    system: MapSystem | None = None
    declared: MapSystem | None = None
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, system: MapSystem | None) -> Placement:
        """Return the placement of what is in a system in metres."""
        return cls(system, system)

    @property
    def scale(self) -> Float | None:
        """Return metres per unit of the file's x, y and z (3,); None where all are metres."""
        return None if self.declared is None or self.declared.in_metres else self.declared.scale

    @property
    def epsg(self) -> int | None:
        """Return the EPSG code of the horizontal system, None if it isn't named or has none."""
        return self.system.epsg if self.system else None

    @property
    def height_epsg(self) -> int | None:
        """Return the EPSG code of the vertical system, None if it isn't named or has none."""
        return self.system.height_epsg if self.system else None

    def in_metres(self, xyz: Float) -> Float:
        """Return coordinates (N, 3) or (3,) of the file in metres."""
        return xyz if self.scale is None else xyz * self.scale


def bring(name: str, points: Float, declared: MapSystem | None, place: Placement, geojson: bool = False) -> Float:
    """Return a file's points (N, 3) in the system, in metres, that they are wanted in.

    Args:
        name: of the file, for messages.
        points: in the file's own units.
        declared: the system that the file declares; None if it declares none.
        place: what they are wanted in; a file that declares nothing is taken to be in what that declares.
        geojson: whether degrees without a system are longitudes and latitudes of WGS 84, as RFC 7946 has it.

    Raises:
        InputError: there is no way, a height is none, or the points lie far outside of the system's area.
    """
    system, source = place.system, declared or place.declared
    if declared is None and _seem_degrees(points):
        if system is None or not geojson:
            raise InputError(f"{name} coordinates", points[0, :2].tolist(), _METRES)
        source = MapSystem.read(LONGITUDE_LATITUDE)
        assume("%s names no system: longitudes and latitudes of WGS 84 are assumed (RFC 7946)", name)
    if source is None:
        return check_heights(name, points)
    if system is None:
        return check_heights(name, _metres_without_target(name, points, source))
    _check_heights_alike(name, source, system)
    points = check_heights(name, points * (1.0, 1.0, source.scale[2]))
    if source.unit is not None and source.metric().same_as(system):
        points = points * (source.unit, source.unit, 1.0)
    else:
        points = _moved(name, points, source, system)
    if declared is None and source.unit is not None:
        assume("%s names no system: its coordinates are read as %s", name, source.label)
    check_area(name, points, system, may_be_local=declared is None)
    return points


def bring_plan(name: str, lines: list[Float], document: Any, place: Placement) -> list[Float]:
    """Return a GeoJSON document's lines (N, 2) transformed to the coordinate system of a placement; see `bring`."""
    points = np.concatenate(lines)
    target_points = bring(
        name, np.column_stack([points, np.zeros(len(points))]), geojson_system(name, document), place, True
    )
    return np.split(target_points[:, :2], np.cumsum([len(line) for line in lines])[:-1])


def check_heights(name: str, points: Float) -> Float:
    """Return points (N, 3), m, unchanged; raise `InputError` for a height where no land is."""
    if points.shape[1] > 2 and len(points):
        row = int(np.abs(points[:, 2]).argmax())
        if abs(points[row, 2]) > HIGHEST:
            allowed = f"no land lies higher than {HIGHEST:,.0f} m: is z another column, or in another unit?"
            raise InputError(f"{name}: z of point {row + 1}", float(points[row, 2]), allowed)
    return points


def geojson_system(name: str, document: Any) -> MapSystem | None:
    """Return the system that a GeoJSON document names by its members ``crs`` (GeoJSON 2008); None if it names none.

    Raises:
        InputError: a member names no system that is known, or two name different ones.
    """
    systems = [_system_of_member(name, member) for member in _members(document)]
    for other_system in systems[1:]:
        if other_system.label != systems[0].label:
            raise InputError(
                f"{name} crs", other_system.label, f"one system is needed, {systems[0].label} is named as well"
            )
    return systems[0] if systems else None


def _members(node: Any) -> Iterator[Any]:
    """Yield the members ``crs`` of a GeoJSON document, of its features and their geometries."""
    if isinstance(node, dict):
        if node.get("crs"):
            yield node["crs"]
        features = node.get("features")
        for inner_node in (*(features if isinstance(features, list) else ()), node.get("geometry")):
            yield from _members(inner_node)


def _system_of_member(name: str, member: Any) -> MapSystem:
    """Return the system that a member ``crs`` of a GeoJSON document names, by its name or code."""
    properties = member.get("properties") if isinstance(member, dict) else None
    system_name = properties.get("name", properties.get("code")) if isinstance(properties, dict) else member
    if isinstance(system_name, int) and not isinstance(system_name, bool):
        system_name = f"EPSG:{system_name}"
    if not isinstance(system_name, str):
        raise InputError(f"{name} crs", str(member)[:80], "a system's name or code is needed: links aren't followed")
    try:
        return MapSystem.read(system_name)
    except UnknownSystemError:
        raise InputError(
            f"{name} crs", system_name, "a coordinate system that PROJ knows is needed, e.g. EPSG:25832"
        ) from None


def _seem_degrees(points: Float) -> bool:
    """Return whether points look like longitudes and latitudes, by their size and extent."""
    xy = points[:, :2]
    return bool((np.abs(xy) <= (180.0, 90.0)).all()) and float(np.ptp(xy, axis=0).max()) < 2.0


def _metres_without_target(name: str, points: Float, source: MapSystem) -> Float:
    """Return points in metres of the file's own system, with a warning; InputError for degrees."""
    if source.unit is None:
        raise InputError(f"{name} coordinates", points[0, :2].tolist(), _METRES)
    warn("%s is in %s: the data beside it name no system, and are read in the same system", name, source.label)
    return points * source.scale


def _check_heights_alike(name: str, source: MapSystem, system: MapSystem) -> None:
    """Raise `InputError` if heights are counted from two different surfaces; log it where only one is known."""
    height_surface = (
        "the ellipsoid" if source.ellipsoidal else f"EPSG:{source.height_epsg}" if source.height_epsg else None
    )
    if height_surface is None:
        return
    metric_source = source if source.unit is None else source.metric()
    if system.height_epsg and (source.ellipsoidal or metric_source.height_epsg != system.height_epsg):
        allowed = f"EPSG:{system.height_epsg} is needed: heights can't be converted from one to the other"
        raise InputError(
            f"{name}: heights", f"counted from {height_surface}" if source.ellipsoidal else height_surface, allowed
        )
    if source.ellipsoidal:
        warn("%s has ellipsoidal heights: they are kept as they are", name)


def _moved(name: str, points: Float, source: MapSystem, system: MapSystem) -> Float:
    """Return points (N, 3) moved from one system to another, and log how exactly that is known."""
    try:
        target_points, accuracy = moved(points, source, system)
    except InputError as problem:
        raise InputError(f"{name} coordinates", problem.value, problem.allowed) from None
    accuracy_text = (
        "how exactly isn't known"
        if np.isnan(accuracy)
        else "exactly"
        if accuracy < _EXACT
        else f"to within {accuracy:g} m"
    )
    assume("%s is moved from %s to %s, %s", name, source.label, system.label, accuracy_text)
    return target_points


def check_area(name: str, points: Float, system: MapSystem, may_be_local: bool) -> None:
    """Raise `InputError` for points (N, 2 or 3), m, far outside of the area that a system is meant for; warn of others.

    Args:
        name: of the file, for messages.
        points: in the system.
        system: that they are in.
        may_be_local: whether small coordinates may be a site's own, of no map.
    """
    degrees_outside = system.outside(points[:, :2])
    row = int(degrees_outside.argmax())
    if degrees_outside[row] <= _BESIDE:
        return
    place = [round(float(value), 3) for value in points[row, :2]]
    if may_be_local and np.abs(points[:, :2]).max() <= _LOCAL:
        text = "%s: coordinates such as %s lie outside of the area of %s: they are read as a site's own"
        warn(text, name, place, system.label)
    elif degrees_outside[row] > _FAR:
        allowed = f"{system.label} is for {system.area}: is it the file's coordinate system, and is x east and y north?"
        raise InputError(f"{name}: point {row + 1}", place, f"lies outside of the system's area of use: {allowed}")
    else:
        warn("%s: point %s lies outside of the area of %s (%s)", name, place, system.label, system.area)
