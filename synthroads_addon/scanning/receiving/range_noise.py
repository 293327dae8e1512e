"""Standard deviation of measured ranges: larger for faint echoes and inclined surfaces, with heavy tails if wanted.

The time of an echo of the rms length p (as a range: pulse length x c / 2 / 2.355) is known to p / SNR at best, by the
bound of Cramer and Rao, and an inclined surface lengthens the echo by the rms depth of the beam's footprint along the
beam, d = r g / 4 tan t, with the full beam angle g at 1/e^2 and the incidence t. Speckle within that footprint shifts
the echo's middle by a share k of d, the inverse root of the number of speckles (Gardner 1992, Ranging performance of
satellite laser altimeters, IEEE Trans. Geosci. Remote Sens. 30, has both terms). So

    sigma^2 = sigma_0^2 + sigma_T^2 (T / S)^2 (1 + d^2 / p^2) + (k d)^2

with sigma_0 that of a strong echo at a right angle and sigma_T what an echo at the threshold T has besides. Errors
follow a normal distribution, or Student's t of the same standard deviation (Lange, Little and Taylor 1989, Robust
statistical modeling using the t distribution, JASA 84). Pulses rise faster than they fall (Chauve et al. 2007,
Processing full-waveform lidar data: modelling raw signals, ISPRS Archives 36), so that more echoes are ranged late than
early: a share q of sigma may be an exponential delay less its mean, which gives the errors the skewness 2 q^3. None of
them has a mean: ranges stay unbiased. All of it is left out where sigma_0 is 0.

A bright echo passes a fixed threshold earlier than a faint one and is ranged nearer: range walk (Amann et al. 2001,
Laser ranging: a critical review of usual techniques for distance measurement, Opt. Eng. 40). Scanners correct for it
by the power that a surface usually gives; what is left follows what nobody knows of the power: its noise, and how much
more or less a strip's laser and air let through than usual. So a part of the error goes with the logarithm of the
speckle, which has its mean taken off, and of the strip's gain.
"""

import numpy as np

from ...base.arrays import Float, Float32
from ..devices.device import ScannerSetting
from ..noise import Noise, mean_log_factor
from .waveform import FULL_WIDTH

_LEAST_COSINE = 1e-3
_DECIBELS = 10.0 / np.log(10.0)


def footprint_depth(setting: ScannerSetting, distance: Float, cosine: Float) -> Float:
    """Return the rms depth (N,) of footprints along the beam, m: at most the range resolution.

    Args:
        setting: the scanner's.
        distance: (N,) m.
        cosine: (N,) of the incidence angle.
    """
    cosine = np.clip(np.abs(cosine), _LEAST_COSINE, 1.0)
    depth = distance * (setting.beam_angle / 4.0) * np.sqrt(1.0 - cosine**2) / cosine
    return np.asarray(np.minimum(depth, setting.range_resolution))


def range_sigma(setting: ScannerSetting, distance: Float, cosine: Float, intensity: Float) -> Float | float:
    """Return the standard deviations (N,) of ranges, m, or the one that all have.

    Args:
        setting: the scanner's.
        distance: (N,) m.
        cosine: (N,) of the incidence angle.
        intensity: (N,) received power.
    """
    strong_sigma = setting.range_sigma
    faint_sigma, slant_share = (
        setting.receiver.faint_range_sigma or 0.0,
        setting.receiver.incidence_range_noise or 0.0,
    )
    if not strong_sigma or not (faint_sigma or slant_share):
        return strong_sigma
    depth = footprint_depth(setting, distance, cosine)
    pulse_length = setting.range_resolution / FULL_WIDTH
    weakness = setting.threshold / np.maximum(intensity, max(setting.threshold, 1e-300))  # T / S, at most 1
    faint_variance = (faint_sigma * weakness) ** 2 * (1.0 + (depth / pulse_length) ** 2)
    variance = strong_sigma**2 + faint_variance + (slant_share * depth) ** 2
    return np.asarray(np.sqrt(variance))


def range_walk(setting: ScannerSetting, speckle: Float | None, noise: Noise, gain: float) -> Float | float:
    """Return by how much farther echoes (N,) are ranged, m, as their power differs from what the scanner expects.

    Args:
        setting: the scanner's.
        speckle: (N,) factors on the power, of mean 1; None without.
        noise: by which they were drawn.
        gain: factor on the power of the strip's echoes.
    """
    walk = (setting.receiver.range_walk or 0.0) * _DECIBELS
    if speckle is None:
        return float(-walk * np.log(gain))
    mean = mean_log_factor(noise.speckle, noise.speckle_normal)
    return np.asarray(walk * (mean - np.log(gain) - np.log(np.maximum(speckle, 1e-12))))


def tail_factors(random: np.random.Generator, count: int, freedom: float) -> Float32:
    """Return factors (N,) that make normal errors Student's t of the same standard deviation.

    A normal number over sqrt(chi^2 / n), of n degrees of freedom, follows Student's t, whose variance is n / (n - 2).

    Args:
        random: the stream.
        count: N.
        freedom: degrees of freedom n.
    """
    squares = np.float32(2.0) * random.standard_gamma(freedom / 2.0, count, dtype=np.float32)
    return np.asarray(np.sqrt(np.float32(freedom - 2.0) / squares), dtype=np.float32)
