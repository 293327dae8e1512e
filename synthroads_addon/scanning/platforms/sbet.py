"""Trajectories as SBET, the binary of Applanix's POSPac that others write too: records of 17 doubles.

They are GPS time, latitude, longitude, altitude, three velocities, roll, pitch, platform heading, wander angle, three
accelerations and three angular rates; radians, m, s (Applanix POSPac, "Smoothed Best Estimate of Trajectory").
"""

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.maps.crs import LONGITUDE_LATITUDE, MapSystem, moved
from ...base.maps.places import HIGHEST, Placement, check_area
from ...base.remarks import assume, warn
from ...base.rotations import wrap_angle

RECORD = 17 * 8
"""Bytes of one pose."""
_NORTHWARD = 1e-5
"""Degrees by which a place is moved north to see where true north points on the map: about a metre."""
_NO_WANDER = 1e-6
"""Wander angles up to this, rad, change nothing. Chosen: 0.2 arc seconds."""


def is_sbet(start: bytes, size: int) -> bool:
    """Return whether a file is SBET, by its first bytes and its size: no text has zero bytes."""
    return b"\0" in start and size % RECORD == 0 and size >= 2 * RECORD


def read_records(name: str, data: bytes) -> Float:
    """Return the records (R, 17) of an SBET file.

    Raises:
        InputError: a value is none of a trajectory, or the time doesn't increase.
    """
    records = np.frombuffer(data, dtype="<f8").reshape(-1, 17)
    requirement = "records of 17 doubles are needed, as SBET has them: time, latitude and longitude in radians, ..."
    limits = {1: np.pi / 2.0, 2: 2.0 * np.pi, 3: 2.0 * HIGHEST, 7: np.pi, 8: np.pi / 2.0, 9: 4.0 * np.pi}
    for column, limit in limits.items():
        is_wrong = ~(np.abs(records[:, column]) <= limit)
        if is_wrong.any():
            row = int(is_wrong.argmax())
            raise InputError(
                f"{name}: value {column + 1} of record {row + 1}", float(records[row, column]), requirement
            )
    late_rows = np.flatnonzero(~(np.diff(records[:, 0]) > 0.0))
    if len(late_rows):
        row = int(late_rows[0]) + 1
        raise InputError(
            f"{name}: time of record {row + 1}", float(records[row, 0]), f"times must increase: {requirement}"
        )
    return records


def poses_on_map(name: str, records: Float, place: Placement) -> tuple[Float, Float]:
    """Return positions (R, 3) on the map, m, and headings (R,), deg clockwise from grid north, of SBET's records.

    Latitudes and longitudes are taken for WGS 84; heights stay those of the file, above the ellipsoid. The platform's
    heading counts from a direction that differs from true north by the wander angle: with the sign by which headings
    lie along the course.

    Raises:
        InputError: the map's coordinate system isn't known, or the poses lie outside of its area.
    """
    system = place.system
    if system is None:
        requirement = "the map's coordinate system must be named (--epsg), as SBET holds longitudes and latitudes"
        raise InputError(name, None, requirement)
    degrees = np.column_stack([np.rad2deg(records[:, [2, 1]]), records[:, 3]])
    source = MapSystem.read(LONGITUDE_LATITUDE)
    points, accuracy = moved(degrees, source, system)
    check_area(name, points, system, may_be_local=False)
    # True north on the map, as an angle clockwise from grid north: the way of a place that is moved a little north.
    north = moved(degrees + (0.0, _NORTHWARD, 0.0), source, system)[0] - points
    north_angle = np.arctan2(north[:, 0], north[:, 1])
    wander = records[:, 10] if np.abs(records[:, 10]).max() > _NO_WANDER else np.zeros(len(records))
    step = np.diff(points[:, :2], axis=0)
    course = np.arctan2(step[:, 0], step[:, 1])
    headings = [records[:, 9] + sign * wander + north_angle for sign in (-1.0, 1.0)]
    heading = min(headings, key=lambda angle: float(np.abs(wrap_angle(angle[:-1] - course)).mean()))
    assume("%s names no datum: WGS 84 is assumed, moved to %s to within %g m", name, system.label, accuracy)
    remark = f": EPSG:{system.height_epsg} counts from another surface" if system.height_epsg else ""
    warn("%s counts heights from the ellipsoid, scan.platform.height_shift moves them%s", name, remark)
    return points, np.rad2deg(heading)
