"""Roughness adjustment: points are shifted along their beams to where these meet the material's micro-relief.

The scene's surfaces are smooth; real ones have texture. Its heights are a random field in space (`noise_field`), one
for each wavelength: the same place has the same height in every strip, and pulses near each other have similar ones. A
scanner sees the mean over its beam's footprint, which is all the flatter the larger and the more slanting that is.
Strength 1 is the relief that pavements and soils have been measured to have (`RELIEF`), 0 none, more an exaggeration.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.arithmetic.loops import point_loops
from ...base.arithmetic.noise import noise_field
from ...base.arrays import AnyArray, Float, Index
from ...base.errors import InputError
from ...cloud.points import PointBlock
from ...materials.table import UNKNOWN, Material, entry_of, materials

MAX_STRENGTH = 100.0
OCTAVES = {"draft": 2, "standard": 4, "high": 6}
"""Octaves of the relief by fidelity: each halves the shortest wavelength; the standard deviation is the same."""

_LEAST_COSINE = 0.02
"""Of the incidence angle, below which footprints don't grow on."""
_NEXT_PEAK = 0.5
"""Share of the relief's wavelength, along the surface, within which a beam that grazes it meets some peak."""


class Relief(NamedTuple):
    """A surface's micro-relief: standard deviation and longest wavelength, m."""

    amplitude: float
    wavelength: float


SMOOTH = Relief(0.0, 0.1)
ASPHALT = Relief(0.0008, 0.1)
RELIEF: dict[str, Relief] = {
    "asphalt": ASPHALT,
    "stone_mastic_asphalt": Relief(0.00095, 0.1),
    "porous_asphalt": Relief(0.0015, 0.1),
    "mastic_asphalt": Relief(0.0005, 0.1),
    "concrete": Relief(0.0007, 0.1),
    "exposed_aggregate_concrete": Relief(0.00085, 0.1),
    "paint_white": Relief(0.0003, 0.1),
    "paint_yellow": Relief(0.0003, 0.1),
    "barrier_concrete": Relief(0.0003, 0.1),
    "bridge_concrete": Relief(0.0005, 0.1),
    "noise_concrete": Relief(0.002, 0.1),
    "noise_wood": Relief(0.001, 0.1),
    "plaster": Relief(0.001, 0.05),
    "brick": Relief(0.0015, 0.1),
    "granite": Relief(0.0008, 0.05),
    "setts": Relief(0.003, 0.15),
    "concrete_pavers": Relief(0.0012, 0.1),
    "roof_tiles": Relief(0.002, 0.1),
    "verge": Relief(0.005, 0.15),
    "median": Relief(0.010, 0.4),
    "grass_ground": Relief(0.015, 0.4),
    "soil": Relief(0.010, 0.3),
    "gravel": Relief(0.006, 0.08),
    "bark": Relief(0.004, 0.06),
}
"""Relief of the material table's surfaces; a name such as ``birch_bark`` has that of its last word.

Pavements: so that profiles have the mean profile depth (ISO 13473-1) of their kind with 6 octaves: asphalt concrete
0.85 mm, which is coarse (0.4 to 0.8), stone mastic asphalt 1.0 (0.8 to 1.2), porous asphalt 1.6 (1.3 to 2.0), mastic
asphalt with rolled-in chippings 0.55 (0.4 to 0.7), concrete 0.75, with exposed aggregate 0.9 (0.7 to 1.1).
Paint fills the texture that it lies on, hence the same wavelength: it has the asphalt's relief, flattened. Ground:
random roughness, the standard deviation of heights about the mean plane. `docs/roughness.md` has sources and limits.
Grass blades, leaves and all that is rolled, cast, painted or glazed are smooth, or are shaped by their own geometry.
"""


@dataclass(frozen=True)
class MicroRelief:
    """Relief of a scene's materials, in the order of `SceneMesh.materials`.

    Attributes:
        amplitude: (M,) standard deviation, m; 0 is smooth.
        wavelength: (M,) longest wavelength, m.
    """

    amplitude: Float
    wavelength: Float


def micro_relief(names: Sequence[str], rows: Sequence[Material]) -> MicroRelief:
    """Return the micro-relief of M materials: `RELIEF`'s, or by their roughness if the material table lacks them.

    Args:
        names: of the M materials.
        rows: their properties.
    """
    pairs = [_relief(name, row) for name, row in zip(names, rows, strict=True)]
    values = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    return MicroRelief(amplitude=values[:, 0], wavelength=values[:, 1])


def _relief(name: str, row: Material) -> Relief:
    """Return the relief of a material: `RELIEF`'s by its name or the name's last word, else that of its roughness."""
    name = entry_of(name)
    relief = RELIEF.get(name) or RELIEF.get(name.rpartition("_")[2])
    if relief is not None:
        return relief
    return SMOOTH if name in materials() and name != UNKNOWN else relief_of_roughness(row)


def relief_of_roughness(row: Material) -> Relief:
    """Return a relief estimated from a material's roughness.

    It is smooth up to a roughness of 0.5, then its amplitude grows with the square of the excess and is asphalt's at
    asphalt's roughness. Metals and materials that let light through are smooth.
    """
    if row.metallic > 0.5 or row.transmission > 0.0:
        return SMOOTH
    excess = max(0.0, row.roughness - 0.5) / (materials()["asphalt"].roughness - 0.5)
    return ASPHALT._replace(amplitude=ASPHALT.amplitude * excess**2)


class BeamEnds(NamedTuple):
    """Places where the beams of N points meet the surface.

    Attributes:
        position: (N, 3) local coordinates of the points without noise, m. The measured ones will do, but then the
            heights of neighbours are less alike than they should be, by as much as noise moves the points.
        towards: (N, 3) unit vectors to the scanner.
        divergence: full angle of the beam at 1/e^2, rad, over whose footprint the relief is averaged; 0: points.
    """

    position: Float
    towards: AnyArray
    divergence: float = 0.0


def shift_by_relief(
    points: PointBlock,
    ends: BeamEnds,
    relief: MicroRelief,
    strength: float,
    seed: int,
    octaves: int = 4,
    surface_heights: Float | None = None,
) -> PointBlock:
    """Return the points with `xyz` shifted along their beams, and `range` to match; all else is kept.

    A scanner's points lie on its beams: a beam meets a surface that is higher by h nearer by h over the cosine of the
    incidence angle, and one that grazes it meets some peak within half a wavelength along it. `true_xyz` and
    `true_range` are without the relief; intensity, normal and incidence angle stay. With strength 0, or if nothing has
    relief, the very same block is returned.

    Args:
        points: needs `normal` and `material`.
        ends: where their beams end.
        relief: of the scene's materials.
        strength: factor on every amplitude, 0 to `MAX_STRENGTH`.
        seed: the surfaces': the road's own.
        octaves: see `OCTAVES`.
        surface_heights: (N,) heights of the surface by which points move along its normal, whatever the strength, m;
            the range is then the distance to there, less by the height times the cosine of the incidence angle.
            `true_xyz` and `true_range` have these as well.

    Raises:
        InputError: strength out of range.
        ValueError: the points lack `normal` or `material`.
    """
    if not 0.0 <= strength <= MAX_STRENGTH:
        raise InputError("roughness strength", strength, f"must be 0 to {MAX_STRENGTH:g}")
    if strength == 0.0 or not relief.amplitude.any():
        return points
    if points.normal is None or points.material is None:
        raise ValueError("the roughness adjustment needs the points' normals and materials")
    rough_rows = ReliefField(points, ends, relief, strength, seed, octaves).rough_rows
    # Angles stay as they are while points move.
    cosine = np.cos(np.radians(points.incidence_deg.astype(np.float64)))
    if surface_heights is not None:
        for arrays in (("xyz", "range"), ("true_xyz", "true_range")):
            points = _shift_along_normals(points, surface_heights, cosine, arrays)
    if not len(rough_rows):
        return points
    assert points.material is not None
    cosine = np.take(cosine, rough_rows)
    height = ReliefField(points, ends, relief, strength, seed, octaves).heights(rough_rows, cosine=cosine)
    if (loops := point_loops()) is not None:
        reach = _NEXT_PEAK * relief.wavelength
        place, distance = loops.approached(
            *(rough_rows, height, cosine, points.material, reach, ends.towards, points.xyz, points.range)
        )
        return points.with_arrays({"xyz": place, "range": distance})
    wavelength = np.take(relief.wavelength, np.take(points.material, rough_rows))
    # The sine times the height over the way to the next peak.
    least_cosine = np.sqrt(1.0 - cosine**2)
    least_cosine *= np.abs(height)
    least_cosine /= _NEXT_PEAK * wavelength
    beam_shift = np.zeros(len(points))
    beam_shift[rough_rows] = height / np.maximum(cosine, least_cosine, out=least_cosine)
    # Rows of three numbers are slow to choose: all points are moved, smooth ones by nothing.
    place = beam_shift[:, None] * ends.towards
    place += points.xyz
    return points.with_arrays({"xyz": place, "range": points.range - beam_shift})


@dataclass(frozen=True)
class ReliefField:
    """The micro-relief that a scanner sees at N points: the mean over each beam's footprint.

    Attributes:
        points, ends, relief, strength, seed, octaves: as `shift_by_relief` takes them.
    """

    points: PointBlock
    ends: BeamEnds
    relief: MicroRelief
    strength: float
    seed: int
    octaves: int

    @property
    def rough_rows(self) -> Index:
        """Return the rows (K,) of the points whose material has a relief; points in the air have none."""
        assert self.points.material is not None
        return np.flatnonzero(np.take(np.append(self.relief.amplitude, 0.0), self.points.material, mode="clip"))

    def heights(self, rows: Index, offset: Float | None = None, cosine: Float | None = None) -> Float:
        """Return the heights (K,), m, above the smooth surface at rough points, or at places beside them.

        Args:
            rows: (K,) of the points.
            offset: (K, 3) from the points to these places, m; None for the points themselves.
            cosine: (K,) of the points' incidence angles, where it has been worked out.
        """
        assert self.points.material is not None
        material, footprint = np.take(self.points.material, rows), None
        if self.ends.divergence:
            if cosine is None:
                cosine = np.cos(np.radians(np.take(self.points.incidence_deg, rows).astype(np.float64)))
            footprint = _footprint(np.take(self.points.range, rows), cosine, self.ends.divergence)
        # Choosing rows of three numbers by `take` is several times as fast as by indexing.
        place = np.take(self.ends.position, rows, axis=0)
        if offset is not None:
            place += offset
        wavelength = np.take(self.relief.wavelength, material)
        height = noise_field(place, wavelength, self.seed, self.octaves, footprint)
        return np.asarray(height * (self.strength * np.take(self.relief.amplitude, material)))


def _footprint(distance: Float, cosine: Float, divergence: float) -> tuple[Float, Float]:
    """Return the standard deviations (K,) of footprints on the surface along and across the slant, m."""
    across_sigma = distance * (divergence / 4.0)
    return across_sigma / np.maximum(cosine, _LEAST_COSINE), across_sigma


def _shift_along_normals(points: PointBlock, height: Float, cosine: Float, arrays: tuple[str, str]) -> PointBlock:
    """Return the points with arrays of places and ranges shifted along their normals.

    Args:
        points: N points.
        height: (N,) by how much, m; 0 for those that stay.
        cosine: (N,) of their incidence angles.
        arrays: names of places and ranges.
    """
    place, distance = (points.array(name) for name in arrays)
    if place is None or distance is None or not height.any():
        return points
    assert points.normal is not None
    if (loops := point_loops()) is not None:
        shifted_arrays = loops.raised(height, cosine, points.normal, place, distance)
        return points.with_arrays(dict(zip(arrays, shifted_arrays, strict=True)))
    rows = np.flatnonzero(height)
    place, distance = place.copy(), distance.copy()
    height, cosine, old_distance = (np.take(values, rows) for values in (height, cosine, distance))
    place[rows] = np.take(place, rows, axis=0) + height[:, None] * np.take(points.normal, rows, axis=0)
    # Law of cosines: the beam and the normal, along which the point moves, enclose the incidence angle.
    distance[rows] = np.sqrt(old_distance**2 - 2.0 * old_distance * height * cosine + height**2)
    return points.with_arrays({arrays[0]: place, arrays[1]: distance})
