"""Extinction of the air by visibility, 1/m of path.

Absorption by gases is left out (905, 1064 and 1550 nm lie in windows of the atmosphere), and so is the light that
droplets scatter back into the receiver.

Sources: Kruse, McGlauchlin, McQuistan: Elements of Infrared Technology (1962); Kim, McArthur, Korevaar: Comparison of
laser beam propagation at 785 nm and 1550 nm in fog and haze, Proc. SPIE 4214 (2001); Pierce, Ramaprasad, Eisenberg:
Optical attenuation in fog and clouds, Proc. SPIE 4530 (2001); Carbonneau, Wisely: Opportunities and challenges for
optical wireless, Proc. SPIE 3532 (1998); Recommendation ITU-R P.1814 (2007), for snow.
"""

import math

CONTRAST = 0.02
"""Contrast at which a black object is still seen against the horizon: what defines the visibility (Koschmieder)."""
REFERENCE = 550.0
"""Wavelength (nm) for which the visibility holds."""
_PER_DECIBEL = math.log(10.0) / 10.0
_PER_KILOMETRE = 1e-3


def visibility_extinction(visibility: float, wavelength_nm: float, exponent: float) -> float:
    """Return the extinction -ln(0.02) / V (wavelength / 550 nm)^-q, 1/m (3.912 / V or 17.0 dB at 550 nm).

    Args:
        visibility: V, m.
        wavelength_nm: of the laser.
        exponent: q, see `kim_exponent` and `kruse_exponent`; 0 for drops that are larger than the wavelength.

    Example:
        >>> fog = visibility_extinction(200.0, wavelength_nm=1550.0, exponent=kim_exponent(200.0))
        >>> round(fog, 4)
        0.0196
    """
    return -math.log(CONTRAST) / visibility * (wavelength_nm / REFERENCE) ** -exponent


def visible_extinction(visibility: float) -> float:
    """Return the extinction of visible light, 1/m, at a visibility, m: 3.912 / V, whatever the exponent.

    Example:
        >>> round(visible_extinction(400.0), 5)
        0.00978
    """
    return visibility_extinction(visibility, REFERENCE, 0.0)


def kim_exponent(visibility: float) -> float:
    """Return Kim's exponent q at a visibility (m): 0 below 500 m, growing to 1.3 at 6 km; 1.6 above 50 km.

    Example:
        >>> [round(kim_exponent(visibility), 2) for visibility in (200.0, 3_000.0, 23_000.0)]
        [0.0, 0.82, 1.3]
    """
    kilometres = visibility * _PER_KILOMETRE
    if kilometres < 0.5:
        return 0.0
    if kilometres < 1.0:
        return kilometres - 0.5
    if kilometres < 6.0:
        return 0.16 * kilometres + 0.34
    return _clear_exponent(kilometres)


def kruse_exponent(visibility: float) -> float:
    """Return Kruse's exponent q at a visibility V (m): 0.585 (V in km)^(1/3) below 6 km, 1.3, 1.6 above 50 km."""
    kilometres = visibility * _PER_KILOMETRE
    return 0.585 * kilometres ** (1.0 / 3.0) if kilometres < 6.0 else _clear_exponent(kilometres)


def _clear_exponent(kilometres: float) -> float:
    """Return the exponent q above 6 km, by Kruse and Kim alike: 1.3, and 1.6 above 50 km."""
    return 1.6 if kilometres > 50.0 else 1.3


def per_metre(decibels_per_kilometre: float) -> float:
    """Return the extinction coefficient, 1/m, of an attenuation in dB/km.

    Example:
        >>> round(per_metre(20.0), 5)
        0.00461
    """
    return decibels_per_kilometre * _PER_DECIBEL * _PER_KILOMETRE


def snow_extinction(rate_mm_h: float, wavelength_nm: float, *, wet: bool = True) -> float:
    """Return the extinction of falling snow, 1/m: a S^b dB/km of ITU-R P.1814, S in mm/h of water.

    Wet snow, near 0 degrees C as snow on German motorways mostly is, has a = 1.023e-4 L + 3.786 and b = 0.72, dry
    snow a = 5.42e-5 L + 5.496 and b = 1.38, with the wavelength L in nm.

    Example:
        >>> wet, dry = snow_extinction(2.0, wavelength_nm=1550.0), snow_extinction(2.0, wavelength_nm=1550.0, wet=False)
        >>> round(wet, 5), round(dry, 5)
        (0.0015, 0.00334)
    """
    if wet:
        return per_metre((1.023e-4 * wavelength_nm + 3.7855466) * rate_mm_h**0.72)
    return per_metre((5.42e-5 * wavelength_nm + 5.4958776) * rate_mm_h**1.38)
