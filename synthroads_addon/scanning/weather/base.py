"""Base of all weathers: fields in a scenario, attenuation of the beam, and echoes of their own if they have any."""

from collections.abc import Mapping
from typing import ClassVar

from ...base.schema import ClosedModel, quantity
from ..effects import EchoEffect
from .extinction import visibility_extinction


class Weather(ClosedModel):
    """Weather that attenuates the beam. Its field ``condition`` is the name that scenarios call it by.

    Attributes:
        order: place among the weathers in lists, if it has one; else they are listed by name.
        usual: values of fields while they aren't given, by name: the ``visibility``, m, as of sampled roads.
    """

    usual: ClassVar[Mapping[str, float]]

    condition: str
    visibility: float | None = quantity(None, "m", "Visibility; usual for the condition if not given.", (20, 200_000))

    def attenuation(self, wavelength_nm: float) -> float:
        """Return the attenuation per metre of range, 1/m: the light goes there and back, so twice the extinction."""
        return 2.0 * self.extinction(wavelength_nm)

    def extinction(self, wavelength_nm: float) -> float:
        """Return the extinction coefficient of the air at a wavelength of the laser, 1/m of path."""
        visibility = self.usual["visibility"] if self.visibility is None else self.visibility
        return visibility_extinction(visibility, wavelength_nm, self.exponent(visibility))

    def exponent(self, visibility: float) -> float:
        """Return the exponent by which extinction falls with the wavelength, at a visibility (m).

        0, the same at every wavelength, for drops that are larger than the wavelength.
        """
        return 0.0

    def effects(self) -> tuple[EchoEffect, ...]:
        """Return the effects that the weather has on echoes besides attenuation: here none."""
        return ()
