"""Intensities that a material is expected to give, seen at given incidence angles and ranges.

Everything that a scan does to a point's intensity is done here by the scanner's own functions: the surface
(`materials.surfaces.brightness_of`), its variation (`materials.surfaces`), the footprint's rays
(`scanning.beam`), distance and air (`scanning.receiving.radiometry.received_intensity`). Only the casting is left
out: what is seen is a plane of the material, or a strip of it on another one. Linear intensities are as in
`PointBlock`: a white target struck at a right angle at 1 m gives 1; `ReceiverModel` says what a device writes for that.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from ..base.arrays import Float
from ..base.errors import InputError, MissingFileError
from ..base.pictures import PILLOW_FORMATS
from ..base.random_streams import stream
from ..materials.reflectance import reflectivity
from ..materials.surfaces import Reflection, brightness_of, spread_factors, surfaces_of
from ..materials.table import Material
from ..scanning.beam import RINGS, beam_pattern, beam_radii
from ..scanning.colour.colour import decode_srgb
from ..scanning.devices.device import ScannerSetting
from ..scanning.receiving.radiometry import received_intensity


@dataclass(frozen=True)
class Texture:
    """Factors on a material's reflectivity over a surface, from a picture that repeats beyond its edges.

    Attributes:
        values: (height, width) reflectivity over the picture's mean.
        size: width and height of the surface that it shows, m.
        mean_color: the mean of its linear red, green, blue.
    """

    values: Float
    size: tuple[float, float]
    mean_color: tuple[float, float, float]

    def factor(self, x: Float, y: Float) -> Float:
        """Return the reflectivity factors at places x, y (any shape), m: those of the pixels that they lie in."""
        height, width = self.values.shape
        column = np.floor(x / self.size[0] * width).astype(np.intp) % width
        row = np.floor(y / self.size[1] * height).astype(np.intp) % height
        return np.asarray(self.values[row, column])


def texture_of(pixels: Float, width: float, material: Material) -> Texture:
    """Return the texture that a picture's linear colours give a material.

    Args:
        pixels: (height, width, 3) linear RGB, 0 to 1.
        width: of the surface that it shows, m.
        material: whose metallic and specular it has.
    """
    values = reflectivity(pixels, material.metallic, material.specular)
    mean = pixels.reshape(-1, 3).mean(axis=0)
    return Texture(
        values=values / max(float(values.mean()), 1e-9),
        size=(width, width * pixels.shape[0] / pixels.shape[1]),
        mean_color=(float(mean[0]), float(mean[1]), float(mean[2])),
    )


def read_texture(path: Path, width: float, material: Material) -> Texture:
    """Read an image file in sRGB and return the texture that it gives a material.

    Raises:
        MissingFileError: there is no such file.
        InputError: it is no image of `PILLOW_FORMATS`.
    """
    try:
        with Image.open(path, formats=PILLOW_FORMATS) as image:
            pixels = np.asarray(image.convert("RGB"), dtype=np.float64) / 255.0
    except FileNotFoundError:
        raise MissingFileError(str(path), None, "no such file") from None
    except Exception:  # each of PIL's formats has errors of its own for what is damaged
        raise InputError(str(path), None, f"must be a whole image: {', '.join(PILLOW_FORMATS)}") from None
    return texture_of(decode_srgb(pixels), width, material)


SAMPLES = 20_000
"""Places that are looked at: they leave quantiles of a class uncertain by about 1 % of its interquartile range. Chosen:
that is less than a class of real points leaves open."""
FULL_SCALE = 65_535.0
"""Largest number that a file holds: LAS intensities have 16 bits."""
_RAYS = 61
"""Rays of a footprint. Chosen: the finest of the scanner's own patterns (`scanning.beam.RINGS`)."""
_FIELDS = 2000.0
"""Side of the square over which places are spread, in wavelengths of the variation: far more than samples see. Chosen:
no two samples see the same place."""
_SEED = 1
"""Seed of the samples' places. Chosen: any one; fixed, so that only the material makes a difference."""


@dataclass(frozen=True)
class Views:
    """Incidence angles and ranges at which N places are seen.

    Attributes:
        incidence: angle between beam and surface normal, rad.
        distance: range, m.
    """

    incidence: Float
    distance: Float


@dataclass(frozen=True)
class ReceiverModel:
    """Model of a device's response: divergence, attenuation, range correction, pedestal, and how numbers are stored.

    Attributes:
        divergence: full angles of the beam at 1/e^2, rad.
        attenuation: of the air, 1/m of range.
        range_corrected: whether the device takes the fall-off with the distance out of its intensities.
        decibels: what the 16 bits of its files span, dB; None where they grow in proportion to the light.
        compression: exponent to which numbers, as shares of the full scale, are raised; 1 for none.
        pedestal: power that is taken off before the number is made, a white target at 1 m giving 1.
    """

    divergence: tuple[float, float] = (0.0, 0.0)
    attenuation: float = 0.0
    range_corrected: bool = False
    decibels: float | None = None
    compression: float = 1.0
    pedestal: float = 0.0

    def at_range(self, brightness: Float, distance: Float) -> Float:
        """Return the linear intensities (N,) that the device gives for surfaces of a brightness (N,) at ranges (N,), m.

        They are the power above the pedestal p: b / d^2 exp(-a d) - p for the brightness b, the range d and the air's
        attenuation a. A device that corrects the range gives the squared range times that, as it doesn't know the air:
        b exp(-a d) - p d^2.
        """
        linear_values = received_intensity(brightness, distance, self.attenuation) - self.pedestal
        if self.range_corrected:
            linear_values = linear_values * distance**2
        return np.maximum(linear_values, 0.0)

    def to_stored(self, linear_values: Float) -> Float:
        """Return the unrounded intensities that the device stores for linear ones times its gain.

        Of decibels they are -inf for a linear intensity of 0.
        """
        if self.decibels is not None:
            with np.errstate(divide="ignore"):
                return FULL_SCALE / self.decibels * 10.0 * np.log10(linear_values)
        if self.compression == 1.0:
            return linear_values
        return FULL_SCALE * (linear_values / FULL_SCALE) ** self.compression

    def to_linear(self, stored_values: Float) -> Float:
        """Return the linear intensities, times the gain, of stored ones: the inverse of `to_stored`."""
        if self.decibels is not None:
            return np.asarray(10.0 ** (stored_values * self.decibels / (10.0 * FULL_SCALE)))
        if self.compression == 1.0:
            return stored_values
        return FULL_SCALE * (stored_values / FULL_SCALE) ** (1.0 / self.compression)


def receiver_of_device(setting: ScannerSetting, attenuation: float) -> ReceiverModel:
    """Return the response model of a device's own receiver, as its file has it.

    Raises:
        InputError: of a gradual saturation: its numbers don't lead back to the power.
    """
    receiver, threshold = setting.receiver, setting.threshold
    if receiver.soft_saturation:
        raise InputError("--device-response", receiver.soft_saturation, "can't be undone with a gradual saturation")
    pedestal = (receiver.pedestal or 0.0) * threshold
    return ReceiverModel(
        divergence=setting.divergence,
        attenuation=attenuation,
        range_corrected=receiver.response == "range_compensated",
        decibels=setting.device.dynamic_range_db if receiver.response == "logarithmic" else None,
        compression=receiver.compression or 1.0,
        pedestal=threshold if receiver.response == "over_threshold" else pedestal,
    )


class Expectation:
    """Simulated samples of one class, with fixed random places, so that only the material makes a difference.

    Args:
        views: in an order of chance, again and again or only some of them: `SAMPLES` are taken.
        receiver: the device.
        reflection: as in a scenario.
        texture: what the material's colour is like; None where the table's mean holds everywhere.
        strip: width of the strip that the material covers, m; its places are seen with footprints that reach beyond
            it. None for a plane of it.

    Attributes:
        incidence, distance: (`SAMPLES`,) rad, m.
    """

    def __init__(
        self,
        views: Views,
        receiver: ReceiverModel,
        reflection: Reflection = "lambert",
        texture: Texture | None = None,
        strip: float | None = None,
    ) -> None:
        rng = stream(_SEED, "calibration")
        order = np.resize(rng.permutation(len(views.incidence)), SAMPLES)
        self.incidence, self.distance = views.incidence[order], views.distance[order]
        self._cosine = np.cos(self.incidence)
        self._receiver, self._reflection = receiver, reflection
        self._place = np.column_stack([rng.random((SAMPLES, 2)), np.zeros(SAMPLES)]) * _FIELDS
        self._across = rng.random(SAMPLES) - 0.5
        self._share = None if strip is None else self._share_on_strip(strip)
        self._texture = None if texture is None else self._texture_factors(texture, rng)

    def linear_intensities(self, material: Material, side_material: Material | None = None) -> Float:
        """Return the linear intensities (`SAMPLES`,) that a material gives at the sampled places.

        Args:
            material: of the class.
            side_material: what lies beside its strip; not needed for a plane.
        """
        surfaces = surfaces_of([material] if side_material is None else [material, side_material], self._reflection)
        material_index = np.zeros(SAMPLES, dtype=np.intp)
        brightness = brightness_of(surfaces, material_index, self._cosine)
        if self._texture is not None:
            brightness = brightness * self._texture
        if self._share is not None and side_material is not None:
            side_brightness = brightness_of(surfaces, material_index + 1, self._cosine)
            brightness = self._share * brightness + (1.0 - self._share) * side_brightness
        if surfaces.uneven[0]:
            place = self._place * material.spread_wavelength
            brightness = brightness * spread_factors(surfaces, material_index, place, _SEED)
        return self._receiver.at_range(brightness * (1.0 - material.transmission), self.distance)

    def _rays(self) -> tuple[Float, Float, Float]:
        """Return the places of a footprint's K rays about its middle, and the rays' shares of the energy.

        The scan line runs across the strip, where a slanting beam's footprint is longest.

        Returns:
            offsets along the scan line and across it (`SAMPLES`, K), m; weights (K,).
        """
        pattern = beam_pattern(RINGS[_RAYS])
        radius = [np.asarray(r * self.distance)[:, None] for r in beam_radii(self._receiver.divergence)]
        line_offset = pattern.across[:, 0] * radius[0] / np.maximum(self._cosine, 0.05)[:, None]
        return line_offset, pattern.across[:, 1] * radius[1], pattern.weights

    def _share_on_strip(self, width: float) -> Float:
        """Return the share (`SAMPLES`,) of each pulse's energy that falls on a strip.

        Args:
            width: of the strip, m, over which the pulses' middles are spread.
        """
        line_offset, _, weight = self._rays()
        is_on_strip = np.abs(line_offset + width * self._across[:, None]) <= width / 2.0
        return np.asarray((is_on_strip * weight).sum(axis=1))

    def _texture_factors(self, texture: Texture, rng: np.random.Generator) -> Float:
        """Return the texture's mean factor (`SAMPLES`,) over each footprint, at random places of the picture."""
        line_offset, cross_offset, weight = self._rays()
        centre = rng.random((2, SAMPLES, 1)) * np.array(texture.size)[:, None, None]
        return np.asarray((texture.factor(centre[0] + line_offset, centre[1] + cross_offset) * weight).sum(axis=1))


def chosen_views(incidence_deg: tuple[float, ...], ranges: tuple[float, ...]) -> Views:
    """Return the views at all combinations of incidence angles (deg) and ranges (m)."""
    incidence, distance = np.meshgrid(np.deg2rad(incidence_deg), np.array(ranges, dtype=np.float64))
    return Views(incidence.ravel(), distance.ravel())
