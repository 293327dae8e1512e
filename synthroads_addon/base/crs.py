"""Well-known text of map coordinate systems: the usual ones are shipped, others need `pyproj`."""

from functools import cache

from .errors import InputError
from .files import PRESETS
from .schema import read_json

_TABLE = PRESETS / "crs.json"


@cache
def wkt(epsg: int) -> str:
    """Return the WKT 1 (OGC 01-009, as LAS 1.4 asks for) of the coordinate system with an EPSG code.

    Raises:
        InputError: the code is unknown, or it isn't shipped and `pyproj` isn't installed.
    """
    shipped = read_json(_TABLE)
    if str(epsg) in shipped:
        return str(shipped[str(epsg)])
    try:
        from pyproj import CRS
        from pyproj.exceptions import CRSError
    except ImportError:
        codes = ", ".join(shipped)
        raise InputError("epsg", epsg, f"must be one of {codes}, or install pyproj for any other") from None
    try:
        return str(CRS.from_epsg(epsg).to_wkt("WKT1_GDAL"))
    except CRSError:
        raise InputError("epsg", epsg, "must be the EPSG code of a coordinate system") from None
