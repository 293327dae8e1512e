"""Steel guardrails."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .thing import Block, LengthwiseThing

GUARDRAIL_BEAM = (
    (0.010, 0.000), (0.040, -0.006), (0.074, -0.030), (0.081, -0.052), (0.074, -0.080), (0.012, -0.124),
    (0.003, -0.140), (0.003, -0.170), (0.012, -0.186), (0.074, -0.230), (0.081, -0.258), (0.074, -0.280),
    (0.040, -0.304), (0.010, -0.310),
)  # fmt: skip
"""A guardrail's beam, the A profile of 0.31 m: depth towards traffic, height under its top edge (m)."""
GUARDRAIL_POST = (0.10, 0.055)
"""A guardrail's post: across the road, along it (m)."""
GUARDRAIL_POST_TOP = 0.03
"""A guardrail's posts end so far (m) below the top of its beam."""
GUARDRAIL_LOWEST_POST = 0.15
"""Where the beam's top is lower than this (m), a terminal has no posts."""
GUARDRAIL_TIP = -0.02
"""Top of a guardrail's beam at its very ends above the surface, m."""
GUARDRAIL_SPACER = {"left": 0.07, "right": 0.07, "both": 0.20}
"""Distance between posts and beam, m: a single rail's face stands 0.2 m from the posts' axis."""
_FACE, _REAR = 0.2, 0.05
"""From the axis to the face of the beam, and to the rear of the posts, m."""


class Guardrail(LengthwiseThing):
    """A steel guardrail: W-beam on posts, ramped down at its terminals. Its offset is that of the posts' axis."""

    points_class: ClassVar = "guardrail"
    order: ClassVar = 10
    type: Literal["Guardrail"] = "Guardrail"
    faces: Literal["left", "right", "both"] = Field(description="Side that the beam is mounted on.")
    height: float = quantity(0.75, ge=0.3, le=1.5, unit="m", description="Top of the beam above the surface.")
    post_spacing: float = quantity(4.0, ge=0.5, le=10, unit="m", description="Distance between posts.")
    terminal_length: float = quantity(
        12.0, ge=0, le=50, unit="m", description="Length over which either end is ramped into the ground."
    )

    def footprint(self) -> Iterator[Block]:
        """Yield the rail's box, to the face of its beam."""
        right, left = (_REAR if self.faces == other else _FACE for other in ("left", "right"))
        yield self.strip(right, left, self.height)
