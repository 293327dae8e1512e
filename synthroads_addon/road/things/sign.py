"""Traffic signs on posts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .thing import Block, StandingThing

_OCTAGON = 0.20710678118654752
SIGN_OUTLINES = {
    "rectangle": ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)),
    "triangle": ((0.0, 0.5), (-0.5, -0.5), (0.5, -0.5)),
    "octagon": (
        (0.5, _OCTAGON), (_OCTAGON, 0.5), (-_OCTAGON, 0.5), (-0.5, _OCTAGON),
        (-0.5, -_OCTAGON), (-_OCTAGON, -0.5), (_OCTAGON, -0.5), (0.5, -_OCTAGON),
    ),
    "arrow": ((0.5, 0.0), (0.3, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.3, -0.5)),
}  # fmt: skip
"""Corners of a sign's face, anticlockwise, in shares of its width and height around the middle; others are round."""
SIGN_RAIL = 0.04
"""Depth of the rails between a sign's face and its posts, m."""


class TrafficSign(StandingThing):
    """A traffic sign on one or two posts. At rotation 0 it faces traffic with the stations."""

    points_class: ClassVar = "road_sign"
    order: ClassVar = 60
    obstacle: ClassVar = "sign's post"
    type: Literal["TrafficSign"] = "TrafficSign"
    code: str = Field(
        pattern=r"^[0-9A-Za-z.-]{1,16}$", description="Number in the catalogue of signs (VzKat), e.g. 274-120."
    )
    shape: Literal["round", "triangle", "rectangle", "octagon", "arrow"] = Field(description="Outline of its face.")
    text: tuple[str, ...] = Field((), max_length=6, description="Lines of writing on its face.")
    width: float = quantity(gt=0, le=12, unit="m", description="Width of the face.")
    height: float = quantity(gt=0, le=8, unit="m", description="Height of the face.")
    lower_edge: float = quantity(2.0, ge=0.3, le=8, unit="m", description="Lower edge of the face above the surface.")
    posts: int = quantity(1, ge=1, le=4, unit="1", description="Number of posts.")
    post_diameter: float = quantity(0.076, ge=0.03, le=0.4, unit="m", description="Diameter of a post.")

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its posts, then that of its face."""
        face = self.face(self.width, self.lower_edge, self.height)
        half = self.post_diameter / 2.0
        for i in range(self.posts):
            share = (i + 0.5) / self.posts
            s = face.start + (face.end - face.start) * share
            d = face.low + (face.high - face.low) * share
            yield Block("foot", s - half, s + half, d - half, d + half, self.elevation, face.top)
        yield face
