"""`Relief`: how points lie and tilt on surfaces that are rougher than the model's faces."""

from dataclasses import dataclass

from ..relief.micro_relief import MicroRelief
from ..relief.normal_images import NormalImages
from ..relief.pavement import PavementRelief


@dataclass(frozen=True)
class Relief:
    """Relief of the surfaces beyond the model's faces; none by default.

    Attributes:
        micro: micro-relief of the materials; None without.
        strength: factor on it.
        octaves: of it.
        normals: whether normals and incidence angles follow it, and the pavement's heights.
        images: that tilt normals, incidence angles and, with layers, intensities; None where nothing does.
        pavement: heights of the pavement, which points have as well where there is a micro-relief; None without.
    """

    micro: MicroRelief | None = None
    strength: float = 0.0
    octaves: int = 4
    normals: bool = False
    images: NormalImages | None = None
    pavement: PavementRelief | None = None
