"""The material table (`presets/materials.json`): the means that renderer and scanner share.

The speculars are calibrated for a laser of 905 nm: with them `Material.reflectivity` gives measured
reflectances (asphalt 0.18, paint 0.65, grass and leaves 0.5), though leaves are dark in visible light.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated

from pydantic import Field

from .cloud.labels import PRESETS
from .scanning.radiometry import reflectivity
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
    def reflectivity(self) -> float:
        """Return R, see `radiometry.reflectivity`."""
        return float(reflectivity(self.base_color, self.metallic, self.specular))


class MaterialTable(Model):
    """The file's content."""

    materials: dict[str, Material]


@cache
def materials() -> dict[str, Material]:
    """Return the shipped table by name."""
    path = PRESETS / "materials.json"
    return MaterialTable.from_dict(read_json(path), source=str(path)).materials
