"""Furniture on and beside the road: barriers, signs, posts, gantries, equipment, bridges, and free assets."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ...base.schema import Model, quantity
from ..objects import LineObject, PointObject
from .body_shapes import GANTRY_BOARD, GANTRY_DISPLAY, GANTRY_HANGER, GANTRY_OVERHANG

Side = Literal["left", "right"]
Color = Annotated[
    tuple[
        Annotated[float, Field(strict=True, ge=0, le=1)],
        Annotated[float, Field(strict=True, ge=0, le=1)],
        Annotated[float, Field(strict=True, ge=0, le=1)],
    ],
    Field(description="Red, green, blue, 0 to 1, linear.", json_schema_extra={"unit": "1"}),
]
"""A base colour."""


# --- along the road ---------------------------------------------------------------------------------------------


class Guardrail(LineObject):
    """A steel guardrail: W-beam on posts, ramped down at its terminals. Its offset is that of the posts' axis."""

    points_class: ClassVar = "guardrail"
    type: Literal["Guardrail"] = "Guardrail"
    faces: Literal["left", "right", "both"] = Field(description="Side that the beam is mounted on.")
    height: float = quantity(0.75, ge=0.3, le=1.5, unit="m", description="Top of the beam above the surface.")
    post_spacing: float = quantity(4.0, ge=0.5, le=10, unit="m", description="Distance between posts.")
    terminal_length: float = quantity(
        12.0, ge=0, le=50, unit="m", description="Length over which either end is ramped into the ground."
    )


class ConcreteBarrier(LineObject):
    """A concrete barrier, symmetric about its axis."""

    points_class: ClassVar = "barrier"
    type: Literal["ConcreteBarrier"] = "ConcreteBarrier"
    profile: Literal["new_jersey", "step"] = Field("step", description="Shape of its cross-section.")
    height: float = quantity(0.9, ge=0.4, le=2.0, unit="m", description="Top above the surface.")
    base_width: float = quantity(0.54, ge=0.3, le=1.2, unit="m", description="Width of its foot.")
    terminal_length: float = quantity(8.0, ge=0, le=50, unit="m", description="Length over which either end is ramped.")


class NoiseBarrier(LineObject):
    """A noise barrier: panels between posts. Its offset is that of the panels' middle."""

    points_class: ClassVar = "noise_barrier"
    type: Literal["NoiseBarrier"] = "NoiseBarrier"
    height: float = quantity(4.0, ge=1, le=12, unit="m", description="Top above the surface.")
    panel: Literal["aluminium", "concrete", "wood", "glass"] = Field("aluminium", description="Kind of its panels.")
    thickness: float = quantity(0.15, ge=0.02, le=0.6, unit="m", description="Thickness of the panels.")
    post_spacing: float = quantity(4.0, ge=1, le=10, unit="m", description="Distance between posts.")
    post_width: float = quantity(0.16, ge=0.05, le=0.5, unit="m", description="Width of a post (HEA profile).")


class TemporaryBarrier(LineObject):
    """A movable barrier of a construction zone, straight from its start offset to its end offset."""

    points_class: ClassVar = "construction_barrier"
    type: Literal["TemporaryBarrier"] = "TemporaryBarrier"
    end_offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its axis at its end station.")
    height: float = quantity(0.55, ge=0.2, le=1.2, unit="m", description="Top above the surface.")
    base_width: float = quantity(0.4, ge=0.1, le=1.0, unit="m", description="Width of its foot.")
    segment_length: float = quantity(4.0, ge=1, le=12, unit="m", description="Length of one element.")

    def offset_at(self, station: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the offsets of its axis at stations of any shape, m."""
        share = (station - self.start_station) / max(self.end_station - self.start_station, 1e-3)
        return self.offset + (self.end_offset - self.offset) * share


# --- at one place -----------------------------------------------------------------------------------------------


class Delineator(PointObject):
    """A delineator post (Leitpfosten) beside the road."""

    points_class: ClassVar = "warning_post"
    type: Literal["Delineator"] = "Delineator"
    height: float = quantity(1.0, ge=0.3, le=1.5, unit="m", description="Top above the surface.")


class TrafficSign(PointObject):
    """A traffic sign on one or two posts. At rotation 0 it faces traffic with the stations."""

    points_class: ClassVar = "road_sign"
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


class GantrySign(Model):
    """A sign or display on a gantry."""

    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its middle.")
    width: float = quantity(gt=0, le=12, unit="m", description="Width of the face.")
    height: float = quantity(gt=0, le=8, unit="m", description="Height of the face.")
    kind: Literal["destination", "display"] = Field("destination", description="Painted sign, or variable display.")
    text: tuple[str, ...] = Field((), max_length=6, description="Lines of writing on its face.")

    @property
    def depth(self) -> float:
        """Return the depth of its body along the road, m."""
        return GANTRY_DISPLAY if self.kind == "display" else GANTRY_BOARD

    @property
    def facing(self) -> float:
        """Return 1 for a sign that faces traffic with the stations: on the right of the centreline; else -1."""
        return 1.0 if self.offset < 0.0 else -1.0


class Gantry(PointObject):
    """A shield gantry across one carriageway (one_sided), across both (two_sided), or on one post (cantilever).

    Station and offset are those of the middle of its beam, which reaches from ``left_offset`` to ``right_offset``. A
    cantilever has its post at the end named by ``post_side``, the others have posts at both ends, a two-sided one also
    in the median. Its signs face the traffic of the carriageway that they hang over.
    """

    points_class: ClassVar = "shield_gantry"
    type: Literal["Gantry"] = "Gantry"
    kind: Literal["one_sided", "two_sided", "cantilever"] = Field(description="What it spans.")
    left_offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its left end.")
    right_offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its right end.")
    post_side: Side = Field("right", description="End that a cantilever's post stands at.")
    clearance: float = quantity(
        5.2, ge=3, le=10, unit="m", description="Lowest part above the pavement's highest point below it."
    )
    beam: Literal["box", "truss", "tube"] = Field("box", description="Shape of the beam.")
    beam_height: float = quantity(0.8, ge=0.2, le=3, unit="m", description="Height of the beam.")
    beam_depth: float = quantity(0.6, ge=0.2, le=3, unit="m", description="Depth of the beam along the road.")
    post_width: float = quantity(0.5, ge=0.1, le=1.5, unit="m", description="Width of a post.")
    shade: float = quantity(
        0.5, ge=0.05, le=1, unit="1", description="Base colour of the steel: dark paint to bright zinc."
    )
    signs: tuple[GantrySign, ...] = Field((), max_length=16, description="Signs and displays on it.")

    @model_validator(mode="after")
    def _spans(self) -> Gantry:
        if self.left_offset <= self.right_offset:
            raise ValueError("left_offset must be greater than right_offset")
        return self

    def reach(self, facing: float) -> float:
        """Return how far the beam, and the signs on one side of it (1 or -1), reach along the road from its middle."""
        signs = [GANTRY_HANGER + sign.depth for sign in self.signs if sign.facing == facing]
        return self.beam_depth / 2.0 + max(signs, default=0.0)

    def beam_bottom(self, low: float) -> float:
        """Return the height (m) of the beam's lower edge, from that of the lowest part: taller signs hang below it."""
        tallest = max((sign.height for sign in self.signs), default=0.0)
        return low + max(tallest - self.beam_height, 0.0) * GANTRY_OVERHANG

    def ends_in_beam(self, sign: GantrySign, low: float) -> bool:
        """Return whether a sign whose lower edge is at the lowest part (m) would end below the beam's top."""
        return low + sign.height < self.beam_bottom(low) + self.beam_height


class Pole(PointObject):
    """A lighting pole, or one for surveillance cameras; its arm points away from rotation 0's traffic to the left."""

    points_class: ClassVar = "pole"
    type: Literal["Pole"] = "Pole"
    kind: Literal["lighting", "surveillance"] = Field("lighting", description="What it carries.")
    height: float = quantity(12.0, ge=2, le=30, unit="m", description="Top above the surface.")
    diameter: float = quantity(0.2, ge=0.05, le=0.6, unit="m", description="Diameter at its foot.")
    arm_length: float = quantity(1.5, ge=0, le=6, unit="m", description="Length of its arm; 0 for none.")


class TrafficLight(PointObject):
    """A traffic light on its post, e.g. where an entry is metered."""

    points_class: ClassVar = "traffic_light"
    type: Literal["TrafficLight"] = "TrafficLight"
    height: float = quantity(3.2, ge=1.5, le=8, unit="m", description="Top above the surface.")
    lights: int = quantity(3, ge=1, le=4, unit="1", description="Number of lights.")
    light_diameter: float = quantity(0.2, ge=0.1, le=0.4, unit="m", description="Diameter of a light.")


class KilometreBoard(PointObject):
    """A kilometre board: blue, white writing."""

    points_class: ClassVar = "road_sign"
    type: Literal["KilometreBoard"] = "KilometreBoard"
    text: str = Field(max_length=12, description="Its kilometre, as written.")
    width: float = quantity(0.55, ge=0.1, le=2, unit="m", description="Width of the board.")
    height: float = quantity(0.26, ge=0.1, le=2, unit="m", description="Height of the board.")
    lower_edge: float = quantity(1.2, ge=0.2, le=4, unit="m", description="Lower edge above the surface.")


class Cabinet(PointObject):
    """An emergency phone or a utility cabinet."""

    points_class: ClassVar = "utility"
    type: Literal["Cabinet"] = "Cabinet"
    kind: Literal["emergency_phone", "utility"] = Field(description="What it is.")
    width: float = quantity(0.3, ge=0.1, le=3, unit="m", description="Width, seen by the traffic beside it.")
    depth: float = quantity(0.3, ge=0.1, le=3, unit="m", description="Depth.")
    height: float = quantity(1.6, ge=0.4, le=3, unit="m", description="Top above the surface.")


class ConstructionBeacon(PointObject):
    """A beacon (Leitbake) of a construction zone, red and white, its stripes falling to the side to pass it on."""

    points_class: ClassVar = "construction_barrier"
    type: Literal["ConstructionBeacon"] = "ConstructionBeacon"
    pass_side: Side = Field(description="Side, seen along the stations, on which traffic passes it.")
    width: float = quantity(0.25, ge=0.1, le=0.6, unit="m", description="Width of its blade.")
    height: float = quantity(1.0, ge=0.5, le=2, unit="m", description="Height of its blade.")


class Overpass(PointObject):
    """A bridge that crosses over the road. Station and offset are those of its middle.

    At rotation 0 it crosses at right angles. Piers stand at ``pier_offsets``; it ends at abutments at both
    ``abutment`` offsets, from which its embankments fall to the ground.
    """

    points_class: ClassVar = "bridge"
    type: Literal["Overpass"] = "Overpass"
    width: float = quantity(10.0, ge=2, le=60, unit="m", description="Width of its deck along the road.")
    left_abutment: float = quantity(ge=5, le=200, unit="m", description="Offset of the left abutment's face.")
    right_abutment: float = quantity(ge=-200, le=-5, unit="m", description="Offset of the right abutment's face.")
    clearance: float = quantity(
        4.9, ge=3, le=20, unit="m", description="Its underside above the pavement's highest point below it."
    )
    deck_thickness: float = quantity(1.2, ge=0.3, le=5, unit="m", description="Height of its deck.")
    parapet_height: float = quantity(1.1, ge=0, le=3, unit="m", description="Height of its parapets above the deck.")
    pier_offsets: tuple[Annotated[float, Field(strict=True, ge=-100, le=100)], ...] = Field(
        (0.0,), max_length=8, description="Offsets of its piers."
    )
    pier_width: float = quantity(1.0, ge=0.2, le=4, unit="m", description="Width of a pier across the road.")


class Asset(PointObject):
    """A free asset out of a library file: a .blend, .glb or .obj."""

    type: Literal["Asset"] = "Asset"
    library: str = Field(description="Built-in library, or a JSON file, absolute or relative to the working directory.")
    name: str = Field(description="Name of the asset in its library.")
    class_name: str = Field(description="Semantic class of its faces.")
    scale: float = quantity(1.0, gt=0, le=100, unit="1", description="Scale of the asset.")
