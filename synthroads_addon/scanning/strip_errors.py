"""Systematic errors of strips: boresight, lever arm, and the drift of GNSS. They change what is measured, not what is.

A point's place is that of the platform, plus the platform's rotation times boresight and lever arm (Skaloud and Lichti
2006, Rigorous approach to bore-sight self-calibration in airborne laser scanning, ISPRS J. 61). Errors of these two are
constant in the scanner's frame and the same in all strips, so that strips flown to and fro disagree; a strip's position
errs by an offset that changes evenly from its beginning to its end, other ones in each strip. All are normally
distributed and drawn from the scan's seed, and the report says them. A strip's echoes have a gain as well, as the
laser's power and the air differ from strip to strip. Where strips overlap one sees a road from nearly above and the
next one aslant, so that raw numbers go with the cube of the angle's cosine (two squares by the range, one by Lambert's
law): every second strip may be brighter by a step of its own.
"""

from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.random_streams import stream
from ..base.rotations import rotation_matrix
from ..base.schema import ClosedModel, quantity
from .platforms.path import Strip


class StripErrors(ClosedModel):
    """Systematic errors of strips, one sigma each; 0 is none."""

    boresight_sigma_deg: float = quantity(
        0.0, "deg", "Roll, pitch and yaw of the scanner against its navigation.", (0, 5), title="Boresight (°)"
    )
    lever_arm_sigma: float = quantity(
        0.0, "m", "Place of the scanner against its navigation, each axis.", (0, 5), title="Lever Arm"
    )
    drift_sigma: float = quantity(
        0.0, "m", "Position at a strip's beginning and at its end, each axis.", (0, 10), title="Drift"
    )

    gain_sigma_db: float = quantity(0.0, "dB", "Brightness of each strip's echoes.", (0, 10), title="Gain (dB)")
    gain_step_db: float = quantity(
        0.0,
        "dB",
        "How much brighter the first, third and so on are than the others: seen from nearly above, not aslant.",
        (0, 10),
        title="Gain Step (dB)",
    )

    @property
    def moves_points(self) -> bool:
        """Return whether any of the errors changes positions, and not only brightness."""
        return any((self.boresight_sigma_deg, self.lever_arm_sigma, self.drift_sigma))


def boresight(errors: StripErrors, seed: int) -> Float:
    """Return the errors (3,) of roll, pitch and yaw of the scanner against its navigation, rad, drawn from a seed."""
    return np.asarray(np.deg2rad(errors.boresight_sigma_deg) * stream(seed, "boresight").standard_normal(3))


def lever_arm(errors: StripErrors, seed: int) -> Float:
    """Return the errors (3,) of the scanner's place along its own axes, m, drawn from a seed."""
    return np.asarray(errors.lever_arm_sigma * stream(seed, "lever arm").standard_normal(3))


def drift(errors: StripErrors, seed: int, strip: int) -> tuple[Float, Float]:
    """Return the errors of the position at a strip's beginning and at its end, (3,) each, along the local axes, m."""
    begin, end = errors.drift_sigma * stream(seed, "strip drift", strip).standard_normal((2, 3))
    return begin, end


def strip_gain(errors: StripErrors, seed: int, strip: int) -> float:
    """Return the factor on the power of a strip's echoes, drawn from a seed.

    It is log-normal. Its median in dB is half of ``gain_step_db`` above 0 for strips of even index, the first among
    them, and as much below 0 for those of odd index.
    """
    decibels = (0.5 - strip % 2) * errors.gain_step_db
    if errors.gain_sigma_db:
        decibels += errors.gain_sigma_db * stream(seed, "strip gain", strip).standard_normal()
    return float(10.0 ** (decibels / 10.0)) if decibels else 1.0


def with_strip_errors(
    errors: StripErrors, seed: int, strip: Strip, time: Float, pose: tuple[Float, Float]
) -> tuple[Float, Float]:
    """Return poses at times (K,) of a strip as they are measured.

    Args:
        errors: standard deviations.
        seed: of the scan.
        strip: the strip.
        time: (K,) s since the first strip's start.
        pose: positions (K, 3), m, and rotations (K, 3, 3) from the scanner's frame.
    """
    if not errors.moves_points:
        return pose
    position, rotation = pose
    begin, end = drift(errors, seed, strip.index)
    share = np.clip((time - strip.start_time) / max(strip.duration, 1e-9), 0.0, 1.0)[:, None]
    roll, pitch, yaw = boresight(errors, seed)
    measured_position = position + begin + share * (end - begin) + rotation @ lever_arm(errors, seed)
    return measured_position, rotation @ rotation_matrix(np.array([yaw]), np.array([pitch]), np.array([roll]))[0]


def strip_error_report(errors: StripErrors, seed: int, strips: tuple[Strip, ...]) -> dict[str, Any]:
    """Return the errors of a scan as JSON data; empty without any."""
    if not errors.moves_points and not errors.gain_sigma_db and not errors.gain_step_db:
        return {}
    rows = []
    for strip in strips:
        begin, end = drift(errors, seed, strip.index)
        gain = round(float(10.0 * np.log10(strip_gain(errors, seed, strip.index))), 7)
        rows.append({"strip": strip.index, "begin": _rounded(begin), "end": _rounded(end), "gain_db": gain})
    angles = np.rad2deg(boresight(errors, seed))
    return {"boresight_deg": _rounded(angles), "lever_arm": _rounded(lever_arm(errors, seed)), "strips": rows}


def _rounded(values: Float) -> list[float]:
    """Return values as a list of numbers with 7 digits after the point, for reports."""
    return [round(float(value), 7) for value in values]
