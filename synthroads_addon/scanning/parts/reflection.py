"""`Reflection`: what the scene's materials make of light that meets them."""

from dataclasses import dataclass, field

import numpy as np

from ...base.arrays import Float
from ...materials.surfaces import Surfaces
from ..colour.transparency import SeeThrough
from ..multipath import Multipath


@dataclass(frozen=True)
class Reflection:
    """Surfaces of a scene as the beam meets them.

    Attributes:
        surfaces: means of the scene's materials.
        transparency: of materials that are clear in one place and solid in another; None without any.
        multipath: ghost echoes over surfaces that mirror; None without.
        frame_origin: (3,) origin of the scene's local frame in the coordinates of the surfaces' random fields, m: those
            of the whole road where only a section of it is scanned.
        surface_seed: of these fields, which are the surfaces' own: every survey of a road meets the same ones.
    """

    surfaces: Surfaces
    transparency: SeeThrough | None = None
    multipath: Multipath | None = None
    frame_origin: Float = field(default_factory=lambda: np.zeros(3))
    surface_seed: int = 0
