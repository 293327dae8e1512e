"""Light that goes straight on through a scene's transparent materials, worked out at the very places that rays meet.

A material of the table lets the same share through everywhere (`materials.surfaces.Surfaces.transmission`). One that
others made may be clear here and solid there: a leaf cut out by its texture, a fence drawn on a card, a pane in its
frame. What its nodes say becomes a function of the place (`blender.materials.transparency`), which needs Blender only
to be made: any thread may ask it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...base.arrays import Float, Index
from ..knots import Track
from ..scene.surface_values import ALONG, POSITION, SurfaceInput
from ..scene.target import Target
from .surfaces import SceneSurfaces


@dataclass(frozen=True)
class Transparency:
    """The share of light that a material lets straight through, as a function of the place.

    Attributes:
        inputs: what it asks of the place.
        share: returns the share (N,), or (1,) for all alike, by the inputs' values (N, 4).
    """

    inputs: frozenset[SurfaceInput]
    share: Callable[[Mapping[SurfaceInput, Float]], Float]


@dataclass(frozen=True)
class SeeThrough:
    """The transparent materials of a scene.

    Attributes:
        surfaces: what the scene's surfaces hold for materials.
        materials: by the material's index.
        frame_origin: (3,) origin of the scene's local frame in that of the whole road, m.
        unit: metres that a unit of the materials' coordinates stands for.
    """

    surfaces: SceneSurfaces
    materials: Mapping[int, Transparency]
    frame_origin: Float = field(default_factory=lambda: np.zeros(3))
    unit: float = 1.0

    def transmitted(
        self,
        target: Target,
        material: Index,
        face: Index,
        cosine: Float,
        place: Float,
        times: Float,
        motions: list[Track],
    ) -> Float:
        """Return the share (N,) of its light that each of N rays keeps behind what it meets, 0 to 1.

        Args:
            target: what is scanned.
            material: (N,) of the faces; transparent ones.
            face: (N,).
            cosine: (N,) n . d of the face's normal and the ray.
            place: (3, N) where the ray meets it, local, m.
            times: (N,) s.
            motions: tracks of the target's moving parts.
        """
        result = np.empty(len(material))
        if target.moving:
            (place,) = target.at_time_zero(face, place, times, motions)
        for number in np.unique(material).tolist():
            rows, entry = np.flatnonzero(material == number), self.materials[number]
            values = self._values(entry.inputs, face[rows], cosine[rows], place[:, rows].T)
            result[rows] = np.clip(np.nan_to_num(entry.share(values)), 0.0, 1.0)
        return result

    def _values(
        self, inputs: frozenset[SurfaceInput], face: Index, cosine: Float, place: Float
    ) -> dict[SurfaceInput, Float]:
        """Return the values (N, 4) of inputs at places on faces, by input.

        Args:
            inputs: that materials ask for.
            face: (N,) that the places are on.
            cosine: (N,) n . d of the face's normal and the ray.
            place: (N, 3) local, m.
        """
        surface_inputs = inputs - {POSITION, ALONG}
        result: dict[SurfaceInput, Float] = {}
        if surface_inputs:
            read_values = self.surfaces.read_places(surface_inputs, face, place)
            result = {what: values.astype(np.float64) for what, values in read_values.items()}
        if POSITION in inputs:
            result[POSITION] = np.pad((place + self.frame_origin) / self.unit, ((0, 0), (0, 1)))
        if ALONG in inputs:
            result[ALONG] = np.repeat(cosine[:, None], 4, axis=1)
        return result
