"""Echo of a fog's droplets, which are too many and too small to be told apart: a soft target.

The power that comes back at the time of the range R is the pulse spread over the air before it,

    pi b int sin^2(pi t / (2 T)) xi(r) exp(-2 a r) / r^2 dr,   r = R - c t / 2,

for 0 < t < 2 T, with the half-power width T of the pulse, the extinction a, the backscatter b and the overlap xi of the
fields of view (Rasshofer, Spies and Spies 2011, Influences of weather phenomena on automotive laser radar systems, Adv.
Radio Sci. 9; Hahner et al. 2021, Fog simulation on real LiDAR point clouds for 3D object detection in adverse weather),
in units of an ideal white target at 1 m, which sends back 1 / pi of the light to the steradian. b is 0.046 / MOR, with
the meteorological optical range MOR = ln 20 / a. The peak lies near the scanner; the receiver decides on it.
"""

import math
from functools import lru_cache

import numpy as np

from ...base.arrays import Float
from ..devices.device import ScannerSetting
from ..effects import EchoChanges, PulseHits
from ..receiving.radiometry import received_intensity
from ..receiving.response import overlap_share

_BACKSCATTER = 0.046
"""Backscatter times the meteorological optical range, 1/sr."""
_STEPS = 2048
_PULSE_STEPS = 64
_FARTHEST = 60.0
"""Beyond this, m, the light of a fog falls off whatever the scanner."""


def backscatter(extinction: float) -> float:
    """Return the backscatter of a fog, 1/(m sr), by its extinction, 1/m."""
    return _BACKSCATTER * extinction / math.log(20.0)


def soft_power(setting: ScannerSetting, extinction: float, distance: Float) -> Float:
    """Return the power (N,) that a fog sends back at the times of ranges, counted from the middle of the pulse.

    Args:
        setting: the scanner's.
        extinction: of the fog, 1/m.
        distance: (N,) ranges, m.
    """
    width = setting.range_resolution  # as a range, the pulse's full width at half height
    # The integral above by the midpoint rule, over the pulse's length 2 T, which is 2 widths as a range.
    pulse_place = (np.arange(_PULSE_STEPS) + 0.5) / _PULSE_STEPS * 2.0 * width
    pulse_shape = np.sin(0.5 * np.pi * pulse_place / width) ** 2
    place = distance[:, None] + width - pulse_place
    is_recorded = place >= max(setting.minimum_range, 1e-2)
    place = np.maximum(place, 1e-2)
    share = overlap_share(setting, place)
    returned_light = received_intensity(1.0, place, 2.0 * extinction) * is_recorded * (1.0 if share is None else share)
    total = (returned_light * pulse_shape).sum(axis=1)
    return np.asarray(np.pi * backscatter(extinction) * total * 2.0 * width / _PULSE_STEPS)


@lru_cache(maxsize=8)
def soft_peak(setting: ScannerSetting, extinction: float) -> tuple[float, float]:
    """Return the range (m) at which the light of a fog peaks, and its power there."""
    grid = np.geomspace(max(setting.minimum_range, 1e-2), max(_FARTHEST, 2.0 * setting.minimum_range), _STEPS)
    power = soft_power(setting, extinction, grid)
    peak = int(power.argmax())
    return float(grid[peak]), float(power[peak])


def soft_echoes(extinction: float, hits: PulseHits) -> EchoChanges:
    """Return the echo of a fog for each of a block's pulses that meets nothing before the fog's peak.

    Its brightness is that of a surface at the peak's range that would send back the peak's power.
    """
    distance, power = soft_peak(hits.setting, extinction)
    share = overlap_share(hits.setting, np.array([distance]))
    seen_share = 1.0 if share is None else max(float(share[0]), 1e-9)
    white_power = received_intensity(1.0, distance, 2.0 * extinction) * seen_share
    pulse = np.flatnonzero(hits.distance.min(axis=0) > distance + hits.setting.range_resolution)
    first_ray = np.zeros(len(pulse), dtype=np.intp)
    brightness = np.full(len(pulse), power / float(white_power))
    return EchoChanges(pulse, first_ray, np.full(len(pulse), distance), brightness)
