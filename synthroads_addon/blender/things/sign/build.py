"""Traffic signs."""

from __future__ import annotations

from ....road.parameters import TrafficSign
from ..model_builder import ModelBuilder
from .looks import sign_face_inputs
from .sign import sign_group

_LARGE = 8.0
"""Area of a board from which it stands on lattice posts, m2."""
_LARGE_POST, _MOST_LATTICES = 0.15, 2
"""Least diameter of lattice posts, m, and their number at most."""


def build_signs(builder: ModelBuilder) -> None:
    """Make one object per traffic sign."""
    for name, sign in builder.parameters.of_type(TrafficSign).items():
        builder.add_thing(
            name,
            sign,
            sign_group(),
            **sign_face_inputs(sign),
            lattice=_stands_on_lattices(sign),
            post_material="galvanised_steel",
        )


def _stands_on_lattices(sign: TrafficSign) -> bool:
    large = sign.width * sign.height >= _LARGE
    return large and sign.post_diameter >= _LARGE_POST and sign.posts <= _MOST_LATTICES
