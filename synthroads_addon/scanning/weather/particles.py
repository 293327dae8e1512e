"""Echoes of falling drops and flakes.

Particles of the diameter D (mm, flakes as melted) are N0 exp(-s D) to the m^3 and mm (Marshall and Palmer 1948, The
distribution of raindrops with size; Gunn and Marshall 1958, The distribution with size of aggregate snowflakes). One at
the range r takes the share (D / b)^2 of a beam as wide as b = divergence x r, at most all of it, and sends back what
its surface reflects at a right angle (Kilic et al. 2021, Lidar light scattering augmentation, arXiv:2107.07004). So the
echoes of a pulse that are at least as intense as I are a Poisson process along the beam, of

    pi / 4 b^2 N0 / s exp(-s D(r)),   D(r) = max(0.05 mm, b r sqrt(I / reflectance))

to the metre without attenuation, and diameters beyond D(r) are exponential.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...base.arrays import Float
from ..devices.device import ScannerSetting
from ..effects import EchoChanges, PulseHits
from ..receiving.detector import PROVISIONAL_THRESHOLD

SMALLEST = 0.05
"""Diameter of the smallest particles, mm."""
_STEPS = 4096
"""Ranges at which the number of echoes up to there is worked out."""
_NEAREST = 0.05
_MILLIMETRES = 1e3


@dataclass(frozen=True)
class ParticleSpectrum:
    """Falling particles in the air.

    Attributes:
        intercept: N0, 1/(m^3 mm).
        slope: s, 1/mm.
        reflectance: of a particle's surface at a right angle.
    """

    intercept: float
    slope: float
    reflectance: float


def fresnel_reflectance(refractive_index: float) -> float:
    """Return the share of light that a surface reflects at a right angle: Fresnel's ((n - 1) / (n + 1))^2."""
    return ((refractive_index - 1.0) / (refractive_index + 1.0)) ** 2


def rain_spectrum(rate_mm_h: float) -> ParticleSpectrum:
    """Return Marshall and Palmer's drops at a rate of rain, mm/h: N0 = 8000, s = 4.1 R^-0.21."""
    return ParticleSpectrum(8000.0, 4.1 * rate_mm_h**-0.21, fresnel_reflectance(1.328))


def snow_spectrum(rate_mm_h: float) -> ParticleSpectrum:
    """Return Gunn and Marshall's flakes at a rate of snow, mm/h of water: N0 = 3800 R^-0.87, s = 2.55 R^-0.48."""
    return ParticleSpectrum(3800.0 * rate_mm_h**-0.87, 2.55 * rate_mm_h**-0.48, fresnel_reflectance(1.3031))


def smallest_diameters(spectrum: ParticleSpectrum, setting: ScannerSetting, distance: Float, intensity: float) -> Float:
    """Return the diameters (N,), mm, of the smallest particles that give an intensity; inf where none does.

    Args:
        spectrum: of the particles.
        setting: the scanner's.
        distance: (N,) ranges, m.
        intensity: without attenuation.
    """
    brightness = intensity * distance**2
    beam = _beam_width(setting, distance)
    diameter = beam * np.sqrt(brightness / spectrum.reflectance)
    diameter[brightness > spectrum.reflectance] = np.inf
    return np.maximum(diameter, SMALLEST)


def echoes_per_metre(spectrum: ParticleSpectrum, setting: ScannerSetting, distance: Float, intensity: float) -> Float:
    """Return the number (N,) of a pulse's echoes per metre that are at least as intense as ``intensity``.

    Args:
        spectrum: of the particles.
        setting: the scanner's.
        distance: (N,) ranges, m.
        intensity: without attenuation.
    """
    area = np.pi / 4.0 * (_beam_width(setting, distance) / _MILLIMETRES) ** 2
    smallest = smallest_diameters(spectrum, setting, distance, intensity)
    return np.asarray(area * spectrum.intercept / spectrum.slope * np.exp(-spectrum.slope * smallest))


def particle_echoes(spectrum: ParticleSpectrum, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
    """Return the echoes of particles before what a block of pulses meets first.

    Those are drawn that the receiver might detect; it decides itself.
    """
    setting = hits.setting
    faintest = PROVISIONAL_THRESHOLD * setting.threshold
    ranges, echoes_before = _echoes_before(spectrum, setting, faintest)
    free_range = hits.distance.min(axis=0)
    # A Poisson process of all pulses as far as the freest one goes, thinned to those that lie before what is met: its
    # cost grows with the echoes, not with the pulses.
    mean_count = np.interp(free_range.max(initial=0.0), ranges, echoes_before)  # of the freest pulse
    count = random.poisson(mean_count * len(free_range))
    pulse = random.integers(max(len(free_range), 1), size=count)
    # Ranges by inversion of the number of echoes before each range.
    distance = np.interp(mean_count * random.random(count), echoes_before, ranges)
    # Diameters beyond the smallest one that is seen are exponential.
    diameter = smallest_diameters(spectrum, setting, distance, faintest)
    diameter += random.exponential(1.0 / spectrum.slope, count)
    beam_share = np.minimum(diameter / np.maximum(_beam_width(setting, distance), 1e-9), 1.0) ** 2
    rows = np.flatnonzero(distance < free_range[pulse])
    first_ray = np.zeros(len(rows), dtype=np.intp)
    return EchoChanges(pulse[rows], first_ray, distance[rows], spectrum.reflectance * beam_share[rows])


@lru_cache(maxsize=8)
def _echoes_before(spectrum: ParticleSpectrum, setting: ScannerSetting, faintest: float) -> tuple[Float, Float]:
    """Return ranges (N,), m, and the mean number (N,) of a pulse's echoes before each, by the trapezium rule.

    Args:
        spectrum: of the particles.
        setting: the scanner's.
        faintest: least intensity of an echo.
    """
    ranges = np.geomspace(max(setting.minimum_range, _NEAREST), setting.maximum_range, _STEPS)
    density = echoes_per_metre(spectrum, setting, ranges, faintest)
    return ranges, np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(ranges))])


def _beam_width(setting: ScannerSetting, distance: Float) -> Float:
    """Return the geometric mean of the beam's widths at 1/e^2 (N,) at ranges (N,), mm."""
    return np.asarray(distance * np.sqrt(setting.divergence[0] * setting.divergence[1]) * _MILLIMETRES)
