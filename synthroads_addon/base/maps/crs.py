"""Map coordinate systems: read from any of their texts, named again by every format, and points moved between them.

All of it is PROJ's, through `pyproj`, whose import takes a fifth of a second: it waits until a system is looked at.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Bool, Float
from ..errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

EPSG_URI = "https://www.opengis.net/def/crs/EPSG/0/{}"
"""Name of a system by its EPSG code, as OGC's naming authority has it."""
LONGITUDE_LATITUDE = "OGC:CRS84"
"""System of GeoJSON that names none (RFC 7946): WGS 84, longitude first."""
_LONGEST_TEXT = 1 << 20
_SAME_UNIT = 1e-9
"""Units whose lengths differ by no more than this share are one."""
_SAME_PLACE = 0.01
"""Systems that place a point no farther apart than this, m, are one, whatever their names and axes' order."""
_NO_DATUM = "Unknown"
"""How the name of the datum begins that PROJ gives systems which name none."""
_NOTHING_TO_DO = "proj=noop"
"""How PROJ's way between two systems begins whose coordinates are the same."""
_URL = re.compile(r"https?://(?:www\.)?opengis\.net/(?:def/crs/EPSG/[0-9.]+/|gml/srs/epsg\.xml#)(\d+)")
_COMPOUND_URL = re.compile(r"https?://(?:www\.)?opengis\.net/def/crs-compound\?")


class UnknownSystemError(InputError):
    """Raised for a text that names no coordinate system that PROJ knows."""


@dataclass(frozen=True)
class MapSystem:
    """Map coordinate system, a horizontal part and perhaps a vertical one, of coordinates x (east), y (north), z (up).

    Attributes:
        text: what it was read from: WKT, PROJJSON, or a name such as ``EPSG:25832``.
        name: for people.
        epsg: EPSG code of the horizontal part; None if it has none.
        height_epsg: EPSG code of the vertical part; None if none is named, or it has none.
        unit: m per unit of x and y; None where they are degrees.
        height_unit: m per unit of z; None where no vertical part says it.
        ellipsoidal: whether heights are counted from the ellipsoid.
        local: whether x and y are a site's own, of no map.

    Example:
        >>> system = MapSystem.read("EPSG:25832")
        >>> system.name, system.unit
        ('ETRS89 / UTM zone 32N', 1.0)
    """

    text: str
    name: str
    epsg: int | None
    height_epsg: int | None
    unit: float | None
    height_unit: float | None = None
    ellipsoidal: bool = False
    local: bool = False

    @classmethod
    def of(cls, epsg: int, height_epsg: int | None = None) -> MapSystem:
        """Return the system with an EPSG code, and with the vertical one of another code.

        Raises:
            InputError: a code is unknown, is of the wrong kind, or both say what heights are counted from.
        """
        return _of_codes(epsg, height_epsg)

    @classmethod
    def read(cls, text: str) -> MapSystem:
        """Return the system that a text names: WKT 1 or 2, ESRI's, PROJJSON, a code, a URN or a URL.

        Raises:
            UnknownSystemError: the text names none.
            InputError: it names one whose coordinates don't run east, north and up.
        """
        return _read(text.strip("\0 \r\n\t"))

    @property
    def in_metres(self) -> bool:
        """Return whether all of its coordinates are metres, as far as it says."""
        return all(unit is None or abs(unit - 1.0) < _SAME_UNIT for unit in (self.unit or 0.0, self.height_unit))

    @property
    def label(self) -> str:
        """Return codes, or the name where there is none, for people: ``EPSG:25832 + EPSG:7837``."""
        horizontal = f"EPSG:{self.epsg}" if self.epsg else f"{self.name!r}"
        return horizontal + (f" + EPSG:{self.height_epsg}" if self.height_epsg else "")

    @property
    def urn(self) -> str | None:
        """Return its URN, as GeoJSON names systems; None if it has no code."""
        return system_urn(self.epsg, self.height_epsg) if self.epsg else None

    @cached_property
    def scale(self) -> Float:
        """Return metres per unit of x, y and z (3,); heights without a system of their own have the plan's unit."""
        plan_unit = 1.0 if self.unit is None else self.unit
        return np.array([plan_unit, plan_unit, plan_unit if self.height_unit is None else self.height_unit])

    def metric(self) -> MapSystem:
        """Return the same system with metres as its unit, which often has a code of its own; itself if it has them.

        Raises:
            InputError: its coordinates are degrees.
        """
        return self if self.in_metres else _metric(self)

    def same_as(self, other: MapSystem) -> bool:
        """Return whether coordinates in plan mean the same in another system, heights ignored.

        A system that names no datum, as most PROJ strings, has that of the other one if both have one ellipsoid.
        """
        if self.epsg and self.epsg == other.epsg:
            return True
        plan, other_plan = _plan(self.text), _plan(other.text)
        if plan.equals(other_plan, ignore_axis_order=True):
            return True
        names_no_datum = any(
            each.datum is not None and each.datum.name.startswith(_NO_DATUM) for each in (plan, other_plan)
        )
        return names_no_datum and _way(self.text, other.text).definition.startswith(_NOTHING_TO_DO)

    def outside(self, points: Float) -> Float:
        """Return how far (N,), degrees, points (N, 2) lie outside the area that the system is meant for.

        0 within it, and where the system doesn't say what it is meant for; infinite where no map is.
        """
        return _outside(_plan(self.text), self.epsg, points)

    @property
    def area(self) -> str:
        """Return the area that the system is meant for: its longitudes and latitudes; empty if it doesn't say."""
        bounds = _area(_plan(self.text), self.epsg)
        if bounds is None:
            return ""
        west, south, east, north = bounds
        return f"longitudes {west:.1f} to {east:.1f}, latitudes {south:.1f} to {north:.1f}"

    def to_wkt(self) -> str:
        """Return its WKT 1 (OGC 01-009, as LAS 1.4 asks for), or WKT 2 where the older one has no words for it.

        It is that of the system's codes where all of its parts have one.
        """
        return _wkt(self)

    def with_units(self, unit: float | None, height_unit: float | None) -> MapSystem:
        """Return the system with other units of x and y, and of z, than its own (m each); None keeps what it says."""
        return _with_units(self, unit, height_unit)


def wkt(epsg: int, height_epsg: int | None = None) -> str:
    """Return the WKT 1 (OGC 01-009, as LAS 1.4 asks for) of the coordinate system with EPSG codes.

    Raises:
        InputError: see `MapSystem.of`.
    """
    return MapSystem.of(epsg, height_epsg).to_wkt()


def metric_system(epsg: int, height_epsg: int | None = None, field: str = "epsg") -> MapSystem:
    """Return the projected system in metres with EPSG codes: all that is made here is in metres.

    Args:
        epsg: of the map.
        height_epsg: of heights.
        field: name of the first code, for messages.

    Raises:
        InputError: see `MapSystem.of`; or its coordinates are degrees, or aren't metres.

    Example:
        >>> metric_system(25832).name
        'ETRS89 / UTM zone 32N'
    """
    try:
        system = MapSystem.of(epsg, height_epsg)
    except InputError as problem:
        heights = problem.field == "height_epsg"
        name = field.replace("epsg", "height_epsg") if heights else field
        raise InputError(name, height_epsg if heights else epsg, problem.allowed) from None
    if system.unit is None:
        raise InputError(field, epsg, "must be a projected system with coordinates in metres; this one has degrees")
    if not system.in_metres:
        metric_label = system.metric().label
        raise InputError(
            field, epsg, f"must have coordinates in metres, as {metric_label} has; this one has other units"
        )
    return system


def compound_code(epsg: int, height_epsg: int | None) -> int | None:
    """Return the one code of a horizontal and a vertical system together; None if the pair has none."""
    return epsg if height_epsg is None else _compound_code(epsg, height_epsg)


def system_urn(epsg: int, height_epsg: int | None = None) -> str:
    """Return the OGC's URN of a system (07-092r1): of the one code of a pair, or of both codes.

    Example:
        >>> system_urn(25832), system_urn(25832, 7837)
        ('urn:ogc:def:crs:EPSG::25832', 'urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837')
    """
    code = compound_code(epsg, height_epsg)
    if code is not None:
        return f"urn:ogc:def:crs:EPSG::{code}"
    return f"urn:ogc:def:crs,crs:EPSG::{epsg},crs:EPSG::{height_epsg}"


def moved(points: Float, source: MapSystem, target: MapSystem) -> tuple[Float, float]:
    """Return points (N, 3), m or degrees of a system, in plan moved to another one, heights unchanged.

    Returns:
        the points, and how exact the way is by the EPSG registry, m; NaN if it doesn't say.

    Raises:
        InputError: there is no way between the systems for a point.

    Example:
        >>> import numpy as np
        >>> cities = np.array([[6.96, 50.94, 55.0], [8.68, 50.11, 112.0]])  # degrees east and north, m
        >>> points, _ = moved(cities, MapSystem.read("EPSG:4258"), MapSystem.of(25832))
        >>> points.round().tolist()
        [[356676.0, 5645134.0, 55.0], [477119.0, 5550910.0, 112.0]]
    """
    from pyproj.exceptions import ProjError  # takes a fifth of a second, and few commands need it

    try:
        transformer = _way(source.text, target.text)
        x, y = transformer.transform(points[:, 0], points[:, 1], errcheck=True)
        # PROJ has no last operation where it has nothing to do.
        nothing_to_do = transformer.definition.startswith(_NOTHING_TO_DO)
        accuracy = float((transformer if nothing_to_do else transformer.get_last_used_operation()).accuracy)
    except ProjError as problem:
        reason = " ".join(str(problem).split())[:100]
        raise InputError(
            "coordinates", points[0, :2].tolist(), f"can't be moved to {target.label} ({reason})"
        ) from None
    return np.column_stack([x, y, points[:, 2]]), accuracy if accuracy >= 0.0 else np.nan


@cache
def _of_codes(epsg: int, height_epsg: int | None) -> MapSystem:
    """Return the system of a horizontal and perhaps a vertical EPSG code; InputError names the wrong one. Cached."""
    from pyproj.exceptions import CRSError  # takes a fifth of a second, and few commands need it

    try:
        system = _read(f"EPSG:{epsg}")
    except (CRSError, InputError) as problem:
        reason = problem.allowed if isinstance(problem, InputError) and "EPSG" not in problem.allowed else ""
        allowed = "must be the EPSG code of a coordinate system" + (f": this one {reason}" if reason else "")
        raise InputError("epsg", epsg, allowed) from None
    if height_epsg is None:
        return system
    if system.height_unit is not None:
        raise InputError("height_epsg", height_epsg, f"EPSG:{epsg} already names the vertical coordinate system")
    try:
        vertical = _crs(f"EPSG:{height_epsg}")
    except CRSError:
        vertical = None
    if vertical is None or not vertical.is_vertical:
        raise InputError("height_epsg", height_epsg, "must be the EPSG code of a vertical coordinate system")
    try:
        return _read(f"EPSG:{epsg}+{height_epsg}")
    except InputError as problem:
        raise InputError("height_epsg", height_epsg, f"{problem.value} {problem.allowed}") from None


@lru_cache(256)
def _crs(text: str) -> CRS:
    """Return PROJ's system of a text; raises its error where it knows none."""
    from pyproj import CRS  # takes a fifth of a second, and few commands need it
    from pyproj.exceptions import CRSError

    if text.startswith(("{", "[")):
        return CRS.from_json(text)
    if re.match(r"\w+\s*[\[(]", text):
        return CRS.from_wkt(text)
    if "=" in text and not _COMPOUND_URL.match(text):  # a PROJ string, which may name files that PROJ then reads
        raise CRSError("PROJ strings are no names")
    return CRS.from_user_input(_named(text))


def _named(text: str) -> str:
    """Return a system's name in a form that PROJ knows: it doesn't know OGC's URLs of pairs, nor those of GML."""
    codes = _URL.findall(text)
    if _COMPOUND_URL.match(text) and len(codes) == 2:
        return f"EPSG:{codes[0]}+{codes[1]}"
    return f"EPSG:{codes[0]}" if len(codes) == 1 and _URL.fullmatch(text) else text


@lru_cache(64)
def _read(text: str) -> MapSystem:
    """Return the system that a text names; UnknownSystemError if PROJ knows none. Cached."""
    from pyproj.exceptions import CRSError  # takes a fifth of a second, and few commands need it

    if not text or len(text) > _LONGEST_TEXT:
        raise UnknownSystemError("coordinate system", text[:80] or None, "must be named by a text of at most 1 MB")
    try:
        parts = list(_parts(_crs(text)))
        return _described(text, _crs(text), parts)
    except (CRSError, ValueError, RecursionError) as problem:
        reason = " ".join(str(problem).split())[-100:]
        allowed = f"must be WKT, a code or a name that PROJ knows ({reason})"
        raise UnknownSystemError("coordinate system", text[:80], allowed) from None


def _parts(crs: CRS) -> Iterator[CRS]:
    """Yield the parts of a system: those of a pair one by one, without what a text says of ways to other systems."""
    if crs.is_bound and crs.source_crs is not None:
        yield from _parts(crs.source_crs)
    elif crs.sub_crs_list:
        for part in crs.sub_crs_list:
            yield from _parts(part)
    else:
        yield crs


def _described(text: str, crs: CRS, parts: list[CRS]) -> MapSystem:
    """Return a system by its parts: codes, units, heights; InputError if axes don't run east, north and up."""
    horizontal, vertical = parts[0], parts[1] if len(parts) > 1 else None
    if horizontal.is_vertical:
        raise InputError("coordinate system", horizontal.name, "has heights only: a system with x and y is needed")
    if horizontal.is_geocentric:
        raise InputError("coordinate system", horizontal.name, "is geocentric: a projected system is needed")
    directions = [axis.direction.lower() for axis in horizontal.axis_info[:2]]
    if set(directions) & {"west", "south"} and directions[0] != directions[-1]:  # the two axes of a polar one run alike
        direction_text = " and ".join(directions)
        raise InputError(
            "coordinate system", horizontal.name, f"has axes {direction_text}: axes east and north are needed"
        )
    unit = (
        None
        if horizontal.is_geographic
        else float(horizontal.axis_info[0].unit_conversion_factor)
        if horizontal.axis_info
        else 1.0
    )
    height_unit, ellipsoidal = None, False
    if vertical is not None:
        axis = vertical.axis_info[0]
        if axis.direction.lower() == "down":
            raise InputError("coordinate system", vertical.name, "has depths, counted downwards: heights are needed")
        height_unit = float(axis.unit_conversion_factor)
    elif len(horizontal.axis_info) == 3:
        height_unit, ellipsoidal = float(horizontal.axis_info[2].unit_conversion_factor), True
        horizontal = horizontal.to_2d()
    return MapSystem(
        text,
        crs.name,
        None if horizontal.is_engineering else _code(horizontal),
        None if vertical is None else _code(vertical),
        unit,
        height_unit,
        ellipsoidal,
        horizontal.is_engineering,
    )


@lru_cache(256)
def _plan(text: str) -> CRS:
    """Return the horizontal part of a system, with two axes."""
    horizontal = next(_parts(_crs(text)))
    return horizontal.to_2d() if len(horizontal.axis_info) == 3 else horizontal


def _code(part: CRS) -> int | None:
    """Return the EPSG code of one part of a system: the one it names if that means the same, else one that does."""
    named_id = part.to_json_dict().get("id", {})
    codes = [int(named_id["code"])] if named_id.get("authority") == "EPSG" else []
    epsg = part.to_epsg()
    codes += [epsg] if epsg else []
    return next((code for code in codes if _means(part, code)), None)


def _means(part: CRS, code: int) -> bool:
    """Return whether a part of a system means what an EPSG code does: a text may name one and describe another."""
    from pyproj import CRS, Transformer  # takes a fifth of a second, and few commands need it
    from pyproj.exceptions import CRSError, ProjError

    try:
        registered = CRS.from_epsg(code)
    except CRSError:
        return False
    if part.equals(registered, ignore_axis_order=True):
        return True
    factors, registered_factors = (
        [axis.unit_conversion_factor for axis in crs.axis_info] for crs in (part, registered)
    )
    if part.type_name != registered.type_name or not np.allclose(
        factors, registered_factors, rtol=_SAME_UNIT, atol=0.0
    ):
        return False
    if part.is_vertical:
        return bool(part.name == registered.name or part.to_epsg() == code)
    if registered.area_of_use is None:
        return False
    west, south, east, north = registered.area_of_use.bounds
    area_middle = 0.5 * (west + east if west <= east else west + east + 360.0), 0.5 * (south + north)
    try:
        place, registered_place = (
            Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True).transform(*area_middle)
            for crs in (part, registered)
        )
    except ProjError:
        return False
    same_shape = part.ellipsoid == registered.ellipsoid and part.prime_meridian == registered.prime_meridian
    return same_shape and bool(np.allclose(place, registered_place, rtol=0.0, atol=_SAME_PLACE))


@lru_cache(64)
def _compound_code(epsg: int, height_epsg: int) -> int | None:
    """Return the EPSG code of a pair of a horizontal and a vertical system; None if it has none. Cached."""
    code = _crs(f"EPSG:{epsg}+{height_epsg}").to_epsg()
    return None if code is None else int(code)


@lru_cache(64)
def _wkt(system: MapSystem) -> str:
    """Return a system's WKT 1, or WKT 2 where the older one can't say it; InputError if neither can. Cached."""
    from pyproj.exceptions import CRSError  # takes a fifth of a second, and few commands need it

    crs = _crs(system.text)
    if system.epsg and not system.ellipsoidal and (system.height_epsg or system.height_unit is None):
        code = compound_code(system.epsg, system.height_epsg)
        crs = _crs(f"EPSG:{code}" if code else f"EPSG:{system.epsg}+{system.height_epsg}")
    for version in ("WKT1_GDAL", "WKT2_2019"):
        with suppress(CRSError):
            if text := crs.to_wkt(version):
                return str(text)
    raise InputError("coordinate system", system.name, "can't be written as WKT")


def _metric(system: MapSystem) -> MapSystem:
    """Return a projected system with metres as the unit of all its coordinates."""
    if system.unit is None:
        raise InputError("coordinate system", system.label, "is in degrees: one in metres is needed")
    return _with_units(system, 1.0, 1.0)


@lru_cache(64)
def _with_units(system: MapSystem, unit: float | None, height_unit: float | None) -> MapSystem:
    """Return a system with other units (m) of x and y, and of z; None keeps a unit. Cached."""
    parts = list(_parts(_crs(system.text)))
    if len(parts[0].axis_info) == 3:
        parts[0] = _with_unit(parts[0], unit)  # of all its axes
    else:
        units = (unit, height_unit)
        parts = [
            part if new_unit is None else _with_unit(part, new_unit)
            for part, new_unit in zip(parts, units, strict=False)
        ]
    if len(parts) == 1:
        base_system = _read(_json(parts[0]))
        return (
            base_system
            if height_unit in (None, 1.0) or base_system.height_unit
            else replace(base_system, height_unit=height_unit)
        )
    from pyproj.crs import CompoundCRS  # takes a fifth of a second, and few commands need it

    return _read(_json(CompoundCRS(" + ".join(part.name for part in parts), parts)))


def _with_unit(part: CRS, unit: float | None) -> CRS:
    """Return a part of a system with another unit of its axes, m: the registered one if there is one."""
    from pyproj import CRS  # takes a fifth of a second, and few commands need it

    if unit is None or all(abs(axis.unit_conversion_factor / unit - 1.0) < _SAME_UNIT for axis in part.axis_info):
        return part
    data: dict[str, Any] = part.to_json_dict()
    data.pop("id", None)
    name, is_metre = _UNIT_IN_NAME.sub("", data["name"]), abs(unit - 1.0) < _SAME_UNIT
    for axis in data["coordinate_system"]["axis"]:
        axis["unit"] = "metre" if is_metre else {"type": "LinearUnit", "name": f"{unit!r} m", "conversion_factor": unit}
    # By its name PROJ would take it for the one in the former unit again.
    code = CRS.from_json_dict(data | {"name": "unknown"}).to_epsg()
    if code is None and part.is_vertical and is_metre:
        code = _code_of_heights(_registered_name(part))
    if code is not None:
        return CRS.from_epsg(code)
    return CRS.from_json_dict(data | {"name": f"{name} ({'m' if is_metre else f'unit {unit:.9g} m'})"})


_UNIT_IN_NAME = re.compile(r"\s*\((m|ft|ftUS|unit [0-9.]+ m)\)$")


def _registered_name(part: CRS) -> str:
    """Return the EPSG registry's name of a part of a system, or its own, without a unit at the end."""
    code = _code(part)
    return _UNIT_IN_NAME.sub("", (_crs(f"EPSG:{code}") if code else part).name)


def _code_of_heights(name: str) -> int | None:
    """Return the code of the vertical system of a name, such as ``NAVD88 height``: PROJ finds none by its datum."""
    from pyproj.database import query_crs_info  # takes a fifth of a second, and few commands need it
    from pyproj.enums import PJType

    registered = query_crs_info("EPSG", PJType.VERTICAL_CRS, allow_deprecated=False)
    return next((int(entry.code) for entry in registered if entry.name == name), None)


def _json(crs: CRS) -> str:
    """Return a text that `_read` takes for a system: its code if that means the same, else PROJJSON."""
    code = crs.to_epsg()
    return f"EPSG:{code}" if code and crs.equals(_crs(f"EPSG:{code}")) else json.dumps(crs.to_json_dict())


@lru_cache(64)
def _way(source: str, target: str) -> Transformer:
    """Return the transformer between two systems' horizontal parts, x east and y north. Cached."""
    from pyproj import Transformer  # takes a fifth of a second, and few commands need it

    return Transformer.from_crs(_plan(source), _plan(target), always_xy=True)


def _area(horizontal: CRS, epsg: int | None) -> tuple[float, float, float, float] | None:
    """Return west, south, east and north (degrees) of the area that a system is for; None if it isn't known."""
    area = horizontal.area_of_use or (_crs(f"EPSG:{epsg}").area_of_use if epsg else None)
    return None if area is None else area.bounds


def _outside(horizontal: CRS, epsg: int | None, points: Float) -> Float:
    """Return how far (N,), degrees, points (N, 2) lie outside of a system's area; see `MapSystem.outside`."""
    from pyproj import Transformer  # takes a fifth of a second, and few commands need it

    bounds = _area(horizontal, epsg)
    if bounds is None or horizontal.is_engineering:
        return np.zeros(len(points))
    west, south, east, north = bounds
    to_degrees = Transformer.from_crs(horizontal, horizontal.geodetic_crs, always_xy=True)
    longitude, latitude = to_degrees.transform(points[:, 0], points[:, 1])
    is_defined: Bool = np.isfinite(longitude) & np.isfinite(latitude)
    area_width = (east - west) % 360.0
    degrees_east = np.mod(np.where(is_defined, longitude, west) - west, 360.0)  # how far east of the western edge
    degrees_beside = np.where(
        degrees_east <= area_width, 0.0, np.minimum(degrees_east - area_width, 360.0 - degrees_east)
    )
    degrees_above = np.maximum(np.maximum(south - latitude, latitude - north), 0.0)
    return np.where(is_defined, np.maximum(degrees_beside, degrees_above), np.inf)
