"""Map coordinate systems from PROJ's strings, as OpenDRIVE names them, by a list of keys: none opens a file.

A string may also name grids and tables, which PROJ would look for on the disk and in the net: these are left out.
"""

from __future__ import annotations

import re

from ..remarks import warn
from .crs import MapSystem, UnknownSystemError

_NUMBERS = frozenset(
    [
        "lat_0",
        "lon_0",
        "lat_1",
        "lat_2",
        "lat_ts",
        "lonc",
        "alpha",
        "gamma",
        "k",
        "k_0",
        "x_0",
        "y_0",
        "zone",
        "a",
        "b",
        "rf",
        "f",
        "to_meter",
        "vto_meter",
    ]
)
_WORDS = frozenset(["proj", "ellps", "datum", "units", "vunits", "type", "pm", "axis"])
_FLAGS = frozenset(["no_defs", "south", "north", "over", "wktext"])
_LEFT_OUT = frozenset(["geoidgrids", "nadgrids", "towgs84", "geoid_crs"])
"""Keys of shifts between datums, and of geoids: they say how to leave the system, not what it is."""
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_WORD = re.compile(r"[A-Za-z0-9_-]{1,24}")
_LONGEST = 4096
_ZONE_WIDTH = 6.0
"""Degrees of longitude that a zone of UTM covers."""


def is_proj_string(text: str) -> bool:
    """Return whether a text is a PROJ string, or seems meant for one."""
    return bool(re.search(r"(^|\s)\+?proj\s*=", text))


def read_proj_string(text: str) -> MapSystem:
    """Return the system that a PROJ string describes.

    Raises:
        UnknownSystemError: it has no ``+proj``, a key that isn't known, or contradicts itself.
        InputError: see `MapSystem.read`.
    """
    from pyproj import CRS  # takes a fifth of a second, and few commands need it
    from pyproj.exceptions import CRSError

    if len(text) > _LONGEST:
        raise UnknownSystemError("coordinate system", text[:80], f"must be at most {_LONGEST:,} characters long")
    parameters: dict[str, str] = {}
    for word in text.split():
        key, sign, value = word.lstrip("+").partition("=")
        if key in _LEFT_OUT:
            continue
        is_known = (
            (key in _NUMBERS and _NUMBER.fullmatch(value))
            or (key in _WORDS and _WORD.fullmatch(value))
            or (key in _FLAGS and not sign)
        )
        if not is_known:
            raise UnknownSystemError("coordinate system", word, "isn't known: keys of plain projections are")
        parameters[key] = value
    _refuse_contradiction(text, parameters)
    parameters.setdefault("no_defs", "")
    parameters.pop("type", None)
    proj_string = " ".join(f"+{key}={value}" if value else f"+{key}" for key, value in parameters.items())
    try:
        return MapSystem.read(CRS.from_proj4(f"{proj_string} +type=crs").to_wkt())
    except CRSError as error:
        reason = " ".join(str(error).split())[-100:]
        raise UnknownSystemError("coordinate system", text[:80], f"must be one that PROJ knows ({reason})") from None


def _refuse_contradiction(text: str, parameters: dict[str, str]) -> None:
    """Raise an error for a zone of UTM whose meridian lies elsewhere than the origin that is named beside it."""
    if parameters.get("proj") != "utm" or "zone" not in parameters or "lon_0" not in parameters:
        return
    meridian = _ZONE_WIDTH * float(parameters["zone"]) - 183.0
    degrees_away = abs((float(parameters["lon_0"]) - meridian + 180.0) % 360.0 - 180.0)
    if degrees_away > 0.5 * _ZONE_WIDTH:
        contradiction = (
            f"contradicts itself: the meridian of zone {parameters['zone']} is {meridian:g}, "
            f"{degrees_away:.0f} degrees away"
        )
        raise UnknownSystemError("coordinate system", text[:80], contradiction)
    warn("lon_0 and lat_0 beside a zone of UTM mean nothing and are ignored")
