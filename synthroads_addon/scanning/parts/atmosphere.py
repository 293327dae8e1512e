"""`Atmosphere`: what the air does to a beam and the echoes that it adds."""

from dataclasses import dataclass

from ...base.classes import UNLABELLED
from ..effects import EchoEffect


@dataclass(frozen=True)
class Atmosphere:
    """Air between scanner and scene; clear by default.

    Attributes:
        attenuation: of the beam, 1/m of range.
        extinction: of the light that cameras see, 1/m of path.
        effects: effects that change the echoes of pulses, in the order in which they act.
        air_class: ``class_id`` of the echoes that these add, and of ghosts.
    """

    attenuation: float = 0.0
    extinction: float = 0.0
    effects: tuple[EchoEffect, ...] = ()
    air_class: int = UNLABELLED
