"""Systematic errors of strips: boresight, lever arm, and the drift of GNSS. They change what is measured, not what is.

A point's place is that of the platform, plus the platform's rotation times boresight and lever arm (Skaloud and Lichti
2006, Rigorous approach to bore-sight self-calibration in airborne laser scanning, ISPRS J. 61). Errors of these two are
constant in the scanner's frame and the same in all strips, so that strips flown to and fro disagree; a strip's position
errs by an offset that changes evenly from its beginning to its end, other ones in each strip. All are normally
distributed and drawn from the scan's seed, and the report says them. A strip's echoes have a gain as well, as the
laser's power and the air differ from strip to strip. Where strips overlap one sees a road from nearly above and the
next one aslant, so that raw numbers go with the cube of the angle's cosine (two squares by the range, one by Lambert's
law): every second strip may be brighter by a step of its own.

In a tunnel there is no GNSS. The inertial unit carries the position on; computed forwards and backwards it errs most in
the middle, and the more, the longer the stretch lasted: with the power 1.5 of its duration, as an integrated random
walk does. Size and law of it are chosen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.random_streams import stream
from ..base.rotations import rotation_matrix
from ..base.schema import ClosedModel, quantity
from .platforms.path import Strip

_OUTAGE, _OUTAGE_POWER = 60.0, 1.5
"""Duration of an outage that `StripErrors.outage_sigma` is given for, s, and the power with which errors grow."""


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

    outage_sigma: float = quantity(
        0.0,
        "m",
        "Position in the middle of a minute in a tunnel, without GNSS, each axis; less in shorter ones.",
        (0, 100),
        title="In Tunnels (m)",
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
        return any((self.boresight_sigma_deg, self.lever_arm_sigma, self.drift_sigma, self.outage_sigma))


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


@dataclass(frozen=True)
class Outage:
    """A stretch of a strip without GNSS.

    Attributes:
        strip: index of the strip.
        start, end: times since the first strip's start, s.
    """

    strip: int
    start: float
    end: float


def outage_peak(errors: StripErrors, seed: int, outage: Outage) -> Float:
    """Return the error (3,) of the position in the middle of an outage, along the local axes, m."""
    # The start in whole milliseconds tells a strip's outages apart.
    draw = stream(seed, "outage", outage.strip, round(1000.0 * outage.start)).standard_normal(3)
    share = ((outage.end - outage.start) / _OUTAGE) ** _OUTAGE_POWER
    return np.asarray(errors.outage_sigma * share * draw)


def outage_error(errors: StripErrors, seed: int, outages: Sequence[Outage], strip: int, time: Float) -> Float:
    """Return the errors (K, 3) of the position at times (K,) of a strip by its outages, m: 0 at the ends of each."""
    error = np.zeros((len(time), 3))
    for outage in outages if errors.outage_sigma else ():
        if outage.strip == strip and outage.end > outage.start:
            share = np.clip((time - outage.start) / (outage.end - outage.start), 0.0, 1.0)
            error += (16.0 * (share * (1.0 - share)) ** 2)[:, None] * outage_peak(errors, seed, outage)
    return error


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
    errors: StripErrors,
    seed: int,
    strip: Strip,
    time: Float,
    pose: tuple[Float, Float],
    outages: Sequence[Outage] = (),
) -> tuple[Float, Float]:
    """Return poses at times (K,) of a strip as they are measured.

    Args:
        errors: standard deviations.
        seed: of the scan.
        strip: the strip.
        time: (K,) s since the first strip's start.
        pose: positions (K, 3), m, and rotations (K, 3, 3) from the scanner's frame.
        outages: stretches of strips without GNSS.
    """
    if not errors.moves_points:
        return pose
    position, rotation = pose
    begin, end = drift(errors, seed, strip.index)
    share = np.clip((time - strip.start_time) / max(strip.duration, 1e-9), 0.0, 1.0)[:, None]
    roll, pitch, yaw = boresight(errors, seed)
    measured_position = position + begin + share * (end - begin) + rotation @ lever_arm(errors, seed)
    measured_position = measured_position + outage_error(errors, seed, outages, strip.index, time)
    return measured_position, rotation @ rotation_matrix(np.array([yaw]), np.array([pitch]), np.array([roll]))[0]


def strip_error_report(
    errors: StripErrors, seed: int, strips: tuple[Strip, ...], outages: Sequence[Outage] = ()
) -> dict[str, Any]:
    """Return the errors of a scan as JSON data; empty without any."""
    if not errors.moves_points and not errors.gain_sigma_db and not errors.gain_step_db:
        return {}
    rows = []
    for strip in strips:
        begin, end = drift(errors, seed, strip.index)
        gain = round(float(10.0 * np.log10(strip_gain(errors, seed, strip.index))), 7)
        rows.append({"strip": strip.index, "begin": _rounded(begin), "end": _rounded(end), "gain_db": gain})
    angles = np.rad2deg(boresight(errors, seed))
    report = {"boresight_deg": _rounded(angles), "lever_arm": _rounded(lever_arm(errors, seed)), "strips": rows}
    if outages and errors.outage_sigma:
        report["outages"] = [
            {
                "strip": outage.strip,
                "start_time": round(outage.start, 3),
                "end_time": round(outage.end, 3),
                "peak": _rounded(outage_peak(errors, seed, outage)),
            }
            for outage in outages
        ]
    return report


def _rounded(values: Float) -> list[float]:
    """Return values as a list of numbers with 7 digits after the point, for reports."""
    return [round(float(value), 7) for value in values]
