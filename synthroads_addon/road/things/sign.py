"""Traffic signs on posts."""

import re
from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.schema import quantity
from .body import BURIED, Body, Place, box, plate, post, prism
from .limits import Limits, share
from .sign_catalogue import sign_type
from .sign_outline import FaceShape, face_outline
from .thing import Block, Signal, StandingThing, TwinTypes

PLATE, RAIL = 0.003, 0.04
"""Thickness of a sign's face, and depth of the rails between it and its posts, m."""
BEHIND = {
    "round": (0.9, 1.0, 0.5),
    "triangle": (0.6, 0.7, 0.4),
    "rectangle": (0.97, 1.0, 0.94),
    "octagon": (0.93, 1.0, 0.6),
    "arrow": (0.9, 1.0, 0.7),
    "arrow_left": (0.9, 1.0, 0.7),
    "triangle_down": (0.97, 1.0, 0.2),
    "diamond": (0.9, 1.0, 0.4),
}
"""Extent of what is behind a face of a shape, so that nothing looks out: height of the posts' top as a share of the
face's, part of the height that rails are spread over, and the rails' length as a share of the width."""
CLAMP = 0.006
"""How far the clamps of the rails stand out of the posts, m."""
LATTICE_CHORD = 0.045
"""Thickness of a lattice post's chords, m."""
_LARGE, _LARGE_POST, _MOST_LATTICES = 8.0, 0.15, 2
"""Area of a board from which it stands on lattice posts (m2), the least diameter of these (m), their number at most."""
_SPEED_LIMIT = "274"
"""Number of the German sign whose subtype is a speed, km/h: also speeds that the catalogue doesn't have."""
_COUNTRY = re.compile(r"([A-Z]{2})\.(.+)")
"""A code that begins with a country."""


class SignLimits(Limits):
    """Whether there are signs."""

    place: ClassVar = 10

    signs: bool = Field(True, description="Traffic signs.")
    town_signs: float = share(
        0.0, "Probability that a town begins at an end of a country road, with its sign.", title="Town Signs"
    )


class TrafficSign(StandingThing):
    """A traffic sign on one or two posts. At rotation 0 it faces traffic with the stations."""

    points_class: ClassVar = "road_sign"
    order: ClassVar = 60
    limits: ClassVar = SignLimits
    obstacle: ClassVar = "sign's post"
    type: Literal["TrafficSign"] = "TrafficSign"
    code: str = Field(
        pattern=r"^[0-9A-Za-z.-]{1,16}$",
        description="Number in the catalogue of signs (VzKat), e.g. 274-120; of another country GB.512-L.",
    )
    shape: FaceShape = Field(description="Outline of its face.")
    text: tuple[str, ...] = Field((), max_length=6, description="Lines of writing on its face.")
    width: float = quantity(gt=0, le=12, unit="m", description="Width of the face.")
    height: float = quantity(gt=0, le=8, unit="m", description="Height of the face.")
    lower_edge: float = quantity(2.0, ge=0.3, le=8, unit="m", description="Lower edge of the face above the surface.")
    posts: int = quantity(1, ge=1, le=4, unit="1", description="Number of posts.")
    post_diameter: float = quantity(0.076, ge=0.03, le=0.4, unit="m", description="Diameter of a post.")

    @property
    def on_lattices(self) -> bool:
        """Return whether its posts are lattices instead of tubes."""
        is_large = self.width * self.height >= _LARGE
        return is_large and self.post_diameter >= _LARGE_POST and self.posts <= _MOST_LATTICES

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a sign, with its code as reference."""
        return TwinTypes("IfcSign.PICTORAL", "pole.signalPost", reference=self.code)

    def signals(self) -> dict[str, Signal]:
        """Return the message of its one face to drivers, "face": code, subtype, speed limit and text."""
        match = _COUNTRY.fullmatch(self.code)
        kind, _, subtype = (match[2] if match else self.code).partition("-")
        number, text = (kind, subtype or "-1"), "\n".join(self.text)
        if match:
            entry = sign_type(self.code)
            speed, unit = (entry.speed, entry.speed_unit) if entry else (None, "km/h")
            return {"face": Signal(*number, country=match[1], speed=speed, speed_unit=unit, text=text)}
        speed = float(subtype) if kind == _SPEED_LIMIT and subtype.isdigit() else None
        return {"face": Signal(*number, speed=speed, text=text)}

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of face and posts, from the ground below each, in its frame; rails are a detail."""
        post_share, rail_spread, rail_length_share = BEHIND[self.shape]
        post_radius, top = self.post_diameter / 2.0, self.lower_edge + self.height * post_share
        outline = face_outline(self.shape, self.width, self.height) + (0.0, self.lower_edge + self.height / 2.0)
        face = plate(outline, -(post_radius + RAIL + PLATE), -(post_radius + RAIL))
        post_x = ((np.arange(self.posts) + 0.5) / self.posts - 0.5) * self.width
        feet = place.ground(post_x, np.zeros(self.posts)) + self.elevation - BURIED
        posts = [
            body
            for x, foot in zip(post_x.tolist(), feet.tolist(), strict=True)
            for body in self._post(x, foot, max(top, foot + 0.1))
        ]
        reach = max(self.width * rail_length_share / 2.0, post_x[-1] + post_radius + CLAMP)
        size = (2.0 * reach, 2.0 * post_radius + RAIL + CLAMP, self.height * rail_spread)
        middle = (0.0, (CLAMP - RAIL) / 2.0, self.lower_edge + self.height * rail_spread / 2.0)
        return [
            Body(face, "board_back", "face"),
            *posts,
            Body(box(size, middle), "board_back", "rails", detail=RAIL),
        ]

    def _post(self, x: float, bottom: float, top: float) -> list[Body]:
        """Return the solid of a tube, or those of the three chords of a lattice and a box for its diagonals."""
        diameter, steel = self.post_diameter, "galvanised_steel"
        if not self.on_lattices:
            return [Body(post(diameter, bottom, top, x), steel)]
        angles = np.pi / 2.0 + 2.0 * np.pi * np.arange(3) / 3.0
        chord_places = (diameter - LATTICE_CHORD) / 2.0 * np.column_stack([np.cos(angles), np.sin(angles)]) + (x, 0.0)
        square = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * LATTICE_CHORD
        diagonals = box((diameter, diameter, top - bottom + LATTICE_CHORD), (x, 0.0, (top + bottom) / 2.0))
        chords = [Body(prism(square + place, bottom, top), steel) for place in chord_places]
        return [*chords, Body(diagonals, steel, "diagonals", detail=LATTICE_CHORD)]

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its posts, then that of its face, in which nothing else may stand."""
        face = self.face(self.width, self.lower_edge, self.height)
        post_radius = self.post_diameter / 2.0
        for i in range(self.posts):
            share = (i + 0.5) / self.posts
            s = face.start + (face.end - face.start) * share
            d = face.low + (face.high - face.low) * share
            yield Block(
                "foot", s - post_radius, s + post_radius, d - post_radius, d + post_radius, self.elevation, face.top
            )
        yield face
