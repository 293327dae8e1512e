"""The material table (`presets/materials.json`): the means that renderer and scanner share.

The speculars are calibrated for a laser of 905 nm: with them `Material.reflectivity` gives measured
reflectances (asphalt 0.18, paint 0.65, grass and leaves 0.5), though leaves are dark in visible light.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated

from pydantic import Field

from .cloud.labels import PRESETS
from .schema import Model, quantity, read_json

UNKNOWN = "unknown"
"""Material of faces that have none."""

_Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]


class Material(Model):
    """Mean properties of one material."""

    base_color: tuple[_Share, _Share, _Share] = Field(description="Linear red, green, blue.")
    roughness: float = quantity(ge=0, le=1, unit="1", description="Roughness as a renderer means it.")
    metallic: float = quantity(0.0, ge=0, le=1, unit="1", description="Share of metal.")
    specular: float = quantity(ge=0, le=1, unit="1", description="Specular share of the reflectivity.")

    @property
    def luminance(self) -> float:
        """Return L = 0.3 r + 0.59 g + 0.11 b of the linear base colour."""
        red, green, blue = self.base_color
        return 0.3 * red + 0.59 * green + 0.11 * blue

    @property
    def reflectivity(self) -> float:
        """Return R = (1 - m)(s + 0.5 L) + m L."""
        metal = self.metallic
        return (1.0 - metal) * (self.specular + 0.5 * self.luminance) + metal * self.luminance


class MaterialTable(Model):
    """The file's content."""

    materials: dict[str, Material]


@cache
def materials() -> dict[str, Material]:
    """Return the shipped table by name."""
    path = PRESETS / "materials.json"
    return MaterialTable.from_dict(read_json(path), source=str(path)).materials
