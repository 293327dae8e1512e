"""The material table (`presets/materials.json`): the means that renderer and scanner share.

The speculars are calibrated for a laser of 905 nm: with them `Material.reflectivity` gives measured
reflectances (asphalt 0.22, markings in use 0.36, grass and leaves 0.5), though leaves are dark in visible light.

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
- **Spread** says how the brightness differs from place to place of one material, see `materials.surfaces`. The
  shipped table has none; `synthroads calibrate` fits it to real clouds.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated

from pydantic import Field

from ..base.errors import InputError
from ..base.files import PRESETS, preset_path, write_file
from ..base.schema import Model, quantity, read_json
from .reflectance import facet_slope, reflectivity

UNKNOWN = "unknown"
"""Material of faces that have none."""

_Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]


class Material(Model):
    """Mean properties of one material, for renderer and scanner."""

    base_color: tuple[_Share, _Share, _Share] = Field(description="Linear red, green, blue.")
    roughness: float = quantity(..., "1", "Roughness as a renderer means it.", (0, 1))
    metallic: float = quantity(0.0, "1", "Share of metal.", (0, 1))
    specular: float = quantity(..., "1", "Specular share of the reflectivity.", (0, 1))
    transmission: float = quantity(
        0.0, "1", "Share of the laser's light that goes on through and comes back.", ge=0, lt=1
    )
    gap_size: float = quantity(
        0.0,
        "m",
        "Size of the leaves and gaps that a surface with transmission stands for: a beam that narrow meets the one or "
        "passes through the other. 0: all of the beam is weakened alike, as by a pane.",
        (0, 10),
    )
    facet_slope: float | None = quantity(
        None, "rad", "Facets' slope (one sigma); the roughness's if not given.", (0, 1.5)
    )
    retroreflection: float = quantity(
        0.0, "1", "Effective reflectance of the retro-reflection at a right angle.", (0, 10_000)
    )
    retro_lobe_deg: float = quantity(45.0, "deg", "Entrance angle at which it has fallen to 1/e.", gt=0, le=180)
    spread_below: float = quantity(
        0.0, "1", "Spread (one sigma of the logarithm) of the brightness below its median.", (0, 2)
    )
    spread_above: float = quantity(
        0.0, "1", "Spread (one sigma of the logarithm) of the brightness above its median.", (0, 2)
    )
    spread_wavelength: float = quantity(1.0, "m", "Longest wavelength of the brightness's variation.", (0.01, 1000))

    @property
    def reflectivity(self) -> float:
        """Return the reflectivity of the light that isn't transmitted, see `materials.reflectance.reflectivity`."""
        return float(reflectivity(self.base_color, self.metallic, self.specular))

    @property
    def slope(self) -> float:
        """Return the standard deviation of the facets' slope, rad: as given, else derived from the roughness."""
        return float(facet_slope(self.roughness)) if self.facet_slope is None else self.facet_slope


class MaterialTable(Model):
    """Content of a material table file."""

    materials: dict[str, Material] = Field(description="Materials by name.")


@cache
def materials() -> dict[str, Material]:
    """Return the shipped materials by name, read once.

    Example:
        >>> round(float(materials()["asphalt"].reflectivity), 3)
        0.219
    """
    path = PRESETS / "materials.json"
    return MaterialTable.from_dict(read_json(path), source=str(path)).materials


def entry_of(name: str) -> str:
    """Return the table's entry that a scene's material is of, ``asphalt`` of ``asphalt (SR asphalt.001)``.

    A name that is of no entry is returned as it is.
    """
    entry = name.partition(" (")[0]
    return entry if entry in materials() else name


def material_table_path(name_or_file: str) -> Path:
    """Return the path of a shipped material table, given by its name (``shifted``), or of a ``.json`` file.

    Raises:
        InputError: it is neither a shipped table's name nor ends in ``.json``.
    """
    return preset_path(PRESETS / "material_tables", name_or_file, "materials_table")


def read_material_table(name_or_file: str | Path) -> dict[str, Material]:
    """Read the materials of a user's table, by name; those that it doesn't name aren't in the result.

    Args:
        name_or_file: a file, or a text that `material_table_path` takes.

    Raises:
        MissingFileError: there is no such file, or it can't be read.
        InputError: it isn't a material table, or a text that names none.
    """
    path = material_table_path(name_or_file) if isinstance(name_or_file, str) else name_or_file
    return MaterialTable.from_dict(read_json(path), source=str(path)).materials


def write_material_table(path: Path, rows: Mapping[str, Material], overwrite: bool = False) -> None:
    """Write a material table file, one line per material, atomically; the same rows give the same bytes.

    Args:
        path: ends in ``.json``; its folder is there.
        rows: materials by name.
        overwrite: whether the file may be replaced.

    Raises:
        OutputError: it is there already, or can't be written.
        InputError: the name doesn't end in ``.json``.
    """
    if path.suffix != ".json":
        raise InputError("--save", str(path), "must end in .json")
    lines = ",\n".join(f"  {json.dumps(name)}: {_json_line(row)}" for name, row in rows.items())
    write_file(path, f'{{\n "materials": {{\n{lines}\n }}\n}}\n'.encode(), "--save", overwrite)


def _json_line(row: Material) -> str:
    """Return a material as a line of JSON: its required fields and those that differ from the defaults."""
    row_data = {
        name: value
        for name, value in row.to_dict().items()
        if name not in Material.model_fields or value != Material.model_fields[name].default
    }
    return json.dumps(row_data)
