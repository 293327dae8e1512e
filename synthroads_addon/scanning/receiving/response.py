"""From received power to the number that a scanner gives, and back as far as that is possible.

Power S is in the unit of an ideal white target struck at a right angle at 1 m; T is the detection threshold, M the
power that saturates the receiver, r the measured range. A number is a share of the full scale, 0 to 1, in steps of
1 / (2^bits - 1); `power` alone is as it arrives, and isn't rounded.

- ``linear``: S / M
- ``range_compensated``: S r^2 / full-scale reflectance, as heads for vehicles give
- ``logarithmic``: 10 lg(S / T) over 10 lg(M / T)
- ``over_threshold``: (S - T) / (M - T)

The logarithmic one is the amplitude above the detection limit in dB (Pfennigbauer and Ullrich 2010, Improving quality
of laser scanning data acquisition through calibrated amplitude and pulse deviation measurement, Proc. SPIE 7684).

With a pedestal p the S of these is S - p T, at least 0: echoes are detected that are too faint for a number other
than 0. The share of the full scale may be raised to an exponent below 1, as heads compress their numbers that turn
their lasers down where echoes are strong: ratios of powers then become the exponent's powers of themselves.

The power before that is what is left of it where laser and receiver don't see the same place yet, times
(r - r1) / (r2 - r1) between two ranges (Rasshofer, Spies and Spies 2011, Influences of weather phenomena on automotive
laser radar systems, Adv. Radio Sci. 9); times the gain of the laser; and saturated: clipped, or gradually, S / (1 +
(S / M)^(2 p))^(1 / (2 p)) (Rapp 1991, Effects of HPA-nonlinearity on a 4-DPSK/OFDM-signal for a digital sound
broadcasting system).
"""

import numpy as np

from ...base.arrays import Float, Index, UInt8
from ...base.random_streams import stream
from ..devices.device import ScannerSetting
from .radiometry import saturate

MOST_CHANNELS = 256


def laser_gains(setting: ScannerSetting, seed: int) -> Float:
    """Return the gains (256,) of a scanner's lasers, log-normal with a median of 1."""
    sigma = setting.receiver.gain_sigma_db or 0.0
    if not sigma:
        return np.ones(MOST_CHANNELS)
    return np.asarray(10.0 ** (sigma / 10.0 * stream(seed, "laser gains").standard_normal(MOST_CHANNELS)))


def overlap_share(setting: ScannerSetting, distance: Float) -> Float | None:
    """Return the share (N,) of the power that the receiver sees at ranges (N,), m; None if it is all."""
    begin_range, full_range = setting.receiver.overlap_begin or 0.0, setting.receiver.overlap_full
    if not full_range:
        return None
    return np.clip((distance - begin_range) / max(full_range - begin_range, 1e-9), 0.0, 1.0)


def read_power(
    power: Float, distance: Float, channel: UInt8 | Index | None, gains: Float, setting: ScannerSetting
) -> tuple[Float, int]:
    """Return the numbers (N,) that a receiver makes of powers, and how many of these saturated it.

    Args:
        power: (N,) with the receiver's noise.
        distance: (N,) measured ranges, m.
        channel: (N,) lasers; None where all are alike.
        gains: (256,) of the lasers.
        setting: the scanner's.
    """
    if channel is not None:
        power = power * np.take(gains, channel)
    power, clipped = _saturated(power, setting)
    receiver, limit = setting.receiver, setting.saturation
    if receiver.response in (None, "power"):
        return power, clipped
    threshold = setting.threshold
    if receiver.pedestal:
        power = np.maximum(power - receiver.pedestal * threshold, 0.0)
    if receiver.response == "linear":
        share = power / limit
    elif receiver.response == "range_compensated":
        share = power * distance**2 / _full_scale(setting)
    elif receiver.response == "logarithmic":
        share = np.log(np.maximum(power / threshold, 1.0)) / np.log(limit / threshold)
    else:
        share = (power - threshold) / (limit - threshold)
    share, steps = np.clip(share, 0.0, 1.0), _steps(setting)
    if receiver.compression:
        share = share**receiver.compression
    return np.rint(share * steps) / steps, clipped


def range_corrected(number: Float, distance: Float, setting: ScannerSetting) -> Float:
    """Return the power times squared range, m^2, that numbers (N,) of the receiver stand for.

    It undoes `read_power` as far as that is possible.

    Args:
        number: (N,).
        distance: (N,) measured ranges, m.
        setting: the scanner's.
    """
    receiver, limit, threshold = setting.receiver, setting.saturation, setting.threshold
    if receiver.response in (None, "power"):
        return np.asarray(number * distance**2)
    if receiver.compression:
        number = number ** (1.0 / receiver.compression)
    pedestal = (receiver.pedestal or 0.0) * threshold
    if receiver.response == "range_compensated":
        return np.asarray(number * _full_scale(setting) + pedestal * distance**2)
    if receiver.response == "linear":
        number = number * limit
    elif receiver.response == "logarithmic":
        number = threshold * (limit / threshold) ** number
    else:
        number = threshold + number * (limit - threshold)
    return np.asarray((number + pedestal) * distance**2)


def _saturated(power: Float, setting: ScannerSetting) -> tuple[Float, int]:
    """Return powers (N,) as the receiver passes them on, and how many lie above its saturation.

    They are clipped, or, with a softness p, saturate as S / (1 + (S / M)^(2 p))^(1 / (2 p)) (Rapp 1991).
    """
    softness, limit = setting.receiver.soft_saturation, setting.saturation
    if not softness:
        return saturate(power, limit)
    share = power / limit
    # For smaller shares (S / M)^(2 p) is lost beside 1.
    bright_rows = np.flatnonzero(share > (np.finfo(np.float64).eps / 4.0) ** (0.5 / softness))
    result = np.array(power)
    result[bright_rows] /= (1.0 + share[bright_rows] ** (2.0 * softness)) ** (0.5 / softness)
    return result, int(np.count_nonzero(power > limit))


def _full_scale(setting: ScannerSetting) -> float:
    """Return the power times squared range, m^2, that fills the scale of a range-compensated response."""
    return 1.0 if setting.receiver.full_scale is None else setting.receiver.full_scale


def _steps(setting: ScannerSetting) -> float:
    """Return the number of steps of the full scale, 2^bits - 1."""
    return float(2 ** (setting.receiver.bits or 16) - 1)
