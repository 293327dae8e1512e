"""The material table (`presets/materials.json`): the means that renderer and scanner share.

The speculars are calibrated for a laser of 905 nm: with them `Material.reflectivity` gives measured
reflectances (asphalt 0.18, paint 0.65, grass and leaves 0.5), though leaves are dark in visible light.

What only the scanner reads is assumed as follows; `docs/radiometry.md` has the reasons and the sources.

- **Transmission** is what goes on through a surface *and comes back* through it, since a scanner's light does both. A
  leaf or a blade is a flat that stands for a twig's leaves or a few blades, with gaps; the light comes back through the
  gap that it went through, so the share of gaps counts once: 0.2 for leaves, 0.3 for needles, 0.1 for grass. What a
  leaf's tissue lets through is scattered and lost. Panes take their share twice: 0.85 squared for windows, 0.92 squared
  for acrylic glass. `reflectivity` is of the light that doesn't go through.
- **Facet slopes** are given where a renderer's roughness says little about the texture that a laser meets (pavement,
  paint, steel); else they follow from the roughness.
- **Retro-reflection** is the effective reflectance of the retro term alone, pi times the coefficient of
  retro-reflection (cd/lx/m2) at a right angle; a perfect diffuser has 1.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated

from pydantic import Field

from .cloud.labels import PRESETS
from .scanning.radiometry import facet_slope, reflectivity
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
    transmission: float = quantity(
        0.0, ge=0, lt=1, unit="1", description="Share of the laser's light that goes on through and comes back."
    )
    facet_slope: float | None = quantity(
        None, ge=0, le=1.5, unit="rad", description="Facets' slope (one sigma); the roughness's if not given."
    )
    retroreflection: float = quantity(
        0.0, ge=0, le=10_000, unit="1", description="Effective reflectance of the retro-reflection at a right angle."
    )
    retro_lobe_deg: float = quantity(
        45.0, gt=0, le=180, unit="deg", description="Entrance angle at which it has fallen to 1/e."
    )

    @property
    def reflectivity(self) -> float:
        """Return R, see `radiometry.reflectivity`; of the light that doesn't go through."""
        return float(reflectivity(self.base_color, self.metallic, self.specular))

    @property
    def slope(self) -> float:
        """Return the standard deviation of the facets' slope, rad: the given one, else that of the roughness."""
        return float(facet_slope(self.roughness)) if self.facet_slope is None else self.facet_slope


class MaterialTable(Model):
    """The file's content."""

    materials: dict[str, Material]


@cache
def materials() -> dict[str, Material]:
    """Return the shipped table by name."""
    path = PRESETS / "materials.json"
    return MaterialTable.from_dict(read_json(path), source=str(path)).materials
