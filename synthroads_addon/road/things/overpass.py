"""Bridges over the road."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from ..guidelines import CLEARANCE
from .body import Body, Place, Point2, Point3, box, prism, shift
from .limits import Interval, Limits, interval, share
from .thing import Block, StandingThing, TwinTypes

DECK = ((0.18, 0.6), (0.24, 0.0), (0.52, 0.0), (0.6, 0.62), (0.985, 0.78), (0.985, 1.0))
"""Half of a deck's section, from the middle of the lower side to the top: shares of half its width, of its height."""
WEB = (DECK[1][0], DECK[2][0])
"""Where the webs begin and end beside the middle, as shares of half the deck's width."""
PAVEMENT = 0.05
"""Thickness of the asphalt on a bridge, m; the deck reaches into it by half of it."""
EDGE, CURB, NOSE, HANG = 0.1, 0.15, 0.3, (0.6, 0.45)
"""Edge beams: width as a share of the deck's; height above the pavement and thickness of the outer face (m); how far
this hangs below the pavement, as a share of the deck's height and at most (m)."""
LOWEST_PARAPET = 0.5
"""Bridges with lower parapets have no railings, m."""
RAILING_INSIDE, RAILING_SPACING = 0.2, 2.0
"""From a railing's axis to the deck's edge, and between its posts at most, m."""
RAILING_POST, RAILING_BAR, RAILING_RAIL, RAILING_HAND, RAILING_LOWER = 0.06, 0.016, 0.04, (0.09, 0.06), 0.1
"""Thickness of a railing's posts, bars and rails, its handrail's width and height, its lower rail's height, m."""
WALL, WALL_INSIDE = 0.5, 0.06
"""Thickness of wing walls, and from the deck's edge to them, m."""
WINGS = (3.0, 12.0)
"""Shortest and longest wing walls, m."""
BACK_WALL = (0.04, 0.01)
"""From the seat to the back wall, and from this to the abutment's back, m."""
PIER_ROUND = 8
"""Points of a pier's rounded end."""
SEAT = 0.9
"""Depth of an abutment's bearing seat, m."""
ABUTMENT = 1.5
"""Depth of an abutment, m."""
BEARING = 0.1
"""Height of a bridge's bearings, m."""
PIER_LENGTH = 0.5
"""Length of a pier as a share of the deck's width."""
BURIED = 0.8
"""Depth of a bridge's walls and piers below the ground, m."""
_FAR = 1000.0
"""How far abutments reach, m: their embankments go on to the ground."""


class OverpassLimits(Limits):
    """Limits of overpasses."""

    place: ClassVar = 80
    allowed: ClassVar = {"overpass_width": "width", "overpass_clearance": (CLEARANCE, 20.0)}

    overpass: float = share(0.15, "Probability of an overpass.")
    overpass_clearance: Interval = interval(4.7, 5.6, "m", "Clearance under an overpass.")
    overpass_width: Interval = interval(6.0, 14.0, "m", "Width of an overpass.")


class Overpass(StandingThing):
    """A bridge that crosses over the road. Station and offset are those of its middle.

    At rotation 0 it crosses at right angles. Piers stand at ``pier_offsets``; it ends at abutments at both
    ``abutment`` offsets, from which its embankments fall to the ground.
    """

    points_class: ClassVar = "bridge"
    order: ClassVar = 130
    limits: ClassVar = OverpassLimits
    obstacle: ClassVar = "pier"
    left_out: ClassVar = "its embankments"
    former_fields: ClassVar = frozenset({"elevation"})
    elevation: ClassVar[float] = 0.0  # type: ignore[misc]  # its height is its clearance
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

    @property
    def turn(self) -> float:
        """Return 0: the frame of a skewed bridge isn't rotated, its solids are sheared."""
        return 0.0

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a bridge."""
        return TwinTypes("IfcBridge.NOTDEFINED", "building.overpass", "Bridge", "BridgeConstructiveElement")

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of deck, edge beams, railings, piers and abutments, in its frame.

        The deck is level, its underside `clearance` above the pavement's highest point below it. A skewed bridge is
        sheared: its faces stay parallel to the road, as its piers do.
        """
        shear, half_width = float(np.tan(np.deg2rad(self.rotation_deg))), self.width / 2.0
        abutment_x = self.offset - self.left_abutment, self.offset - self.right_abutment
        underside = place.pavement(abutment_x, (-half_width, half_width), shear) + self.clearance
        abutments, ends = [], []
        for number, (side, x) in enumerate(zip((-1.0, 1.0), abutment_x, strict=True), 1):
            ground_below_deck = (
                float(np.min(place.ground([x, x], np.array([half_width, -half_width]) + x * shear))) - underside
            )
            wing_length = float(np.clip((self.deck_thickness - ground_below_deck) * place.slope, *WINGS))
            ends.append(x + side * wing_length)
            for body in self._abutment(f"abutment-{number}", ground_below_deck - BURIED, wing_length):
                abutments.append(replace(body, sections=shift(body.sections, (x, 0.0, 0.0), (side, 1.0, 1.0))))
        deck = self._deck((abutment_x[0] - SEAT, abutment_x[1] + SEAT), (ends[0], ends[1]))
        placed_bodies = [
            replace(body, sections=_shear_sections(body.sections, shear, underside)) for body in (*deck, *abutments)
        ]
        for number, offset in enumerate(self.pier_offsets, 1):
            x = self.offset - offset
            foot = float(place.ground([x], [x * shear])[0]) - BURIED - underside
            for body in self._pier(f"pier-{number}", foot):
                placed_bodies.append(replace(body, sections=shift(body.sections, (x, x * shear, underside))))
        return placed_bodies

    def _deck(self, ends: Point2, reach: Point2) -> list[Body]:
        """Return the solids of the deck between two x, and of pavement, edge beams and railings between two others."""
        width, height, (start, end) = self.width, self.deck_thickness, reach
        half_section = np.array(DECK) * (width / 2.0, height - PAVEMENT / 2.0)
        slab = half_section[[0, *range(3, len(half_section))]]
        shapes = [_extrude(np.concatenate([slab, slab[::-1] * (-1.0, 1.0)]), ends)]
        shapes += [_extrude(half_section[:4] * (side, 1.0), ends) for side in (1.0, -1.0)]
        size = (end - start, width * (1.0 - 1.96 * EDGE), PAVEMENT)
        shapes.append(box(size, ((start + end) / 2.0, 0.0, height - PAVEMENT / 2.0)))
        materials = (*["bridge_concrete"] * 3, "asphalt")
        bodies = [Body(shape, m, "deck", "IfcSlab.USERDEFINED") for shape, m in zip(shapes, materials, strict=True)]
        inner_y, nose_y = width / 2.0 - width * EDGE, width / 2.0 - NOSE
        top_z, seat_z, hang_depth = height + CURB, height - PAVEMENT, min(height * HANG[0], HANG[1])
        lower_z = height - hang_depth
        edge_beam = [
            (width / 2.0, lower_z),
            (width / 2.0, top_z),
            (inner_y, top_z),
            (inner_y, seat_z),
            (nose_y, seat_z),
            (nose_y, lower_z),
        ]
        for number, side in enumerate((-1.0, 1.0), 1):
            outline = np.array(edge_beam) * (side, 1.0)
            bodies.append(Body(_extrude(outline, reach), "barrier_concrete", f"edge-beam-{number}", "IfcBeam.EDGEBEAM"))
            if self.parapet_height > LOWEST_PARAPET:
                place = (start, side * (width / 2.0 - RAILING_INSIDE), top_z)
                bodies += self._railing(f"parapet-{number}", place, end - start)
        return bodies

    def _railing(self, name: str, place: Point3, length: float) -> list[Body]:
        """Return the solids of a railing that runs along x from a place on for a length, m."""
        height, middle, (handrail_width, handrail_height) = self.parapet_height - CURB, length / 2.0, RAILING_HAND
        upper_rail_z, rail_size = height - handrail_height - RAILING_LOWER, (length, RAILING_RAIL, RAILING_RAIL)
        shapes = [
            box((length, handrail_width, handrail_height), (middle, 0.0, height - handrail_height / 2.0)),
            box(rail_size, (middle, 0.0, RAILING_LOWER)),
            box(rail_size, (middle, 0.0, upper_rail_z)),
        ]
        bays, post_height = int(np.ceil(length / RAILING_SPACING)), height - handrail_height / 2.0
        post_x = RAILING_POST / 2.0 + np.arange(bays + 1) * (length - RAILING_POST) / bays
        shapes += [box((RAILING_POST, RAILING_POST, post_height), (x, 0.0, post_height / 2.0)) for x in post_x.tolist()]
        bars = box(
            (length, 1.4 * RAILING_BAR, upper_rail_z - RAILING_LOWER),
            (middle, 0.0, (upper_rail_z + RAILING_LOWER) / 2.0),
        )
        steel = [Body(shift(shape, place), "galvanised_steel", name, "IfcRailing.BALUSTRADE") for shape in shapes]
        return [*steel, Body(shift(bars, place), "galvanised_steel", name, detail=RAILING_BAR)]

    def _abutment(self, name: str, foot: float, wing: float) -> list[Body]:
        """Return the solids of an abutment with its face on x = 0 towards -x; the deck's underside is z = 0.

        Bearing seat, back wall, two wing walls, then the bearings as a detail. The shares of the pavement's thickness
        and the centimetres by which walls reach into each other are chosen: faces that coincide have no first hit.

        Args:
            name: of the part.
            foot: height of the walls' foot, m.
            wing: x at which the wing walls end, m.
        """
        abutment_width, height, (gap_to_seat, gap_to_back) = (
            self.width - 2.0 * WALL_INSIDE,
            self.deck_thickness,
            BACK_WALL,
        )
        back_wall_end = ABUTMENT - gap_to_back

        def wall(x_range: Point2, top: float, thickness: float, y: float = 0.0) -> Float:
            """Return the sections of a wall from the foot up to a top, between two x, with its middle at y, m."""
            size = (x_range[1] - x_range[0], thickness, top - foot)
            return box(size, (sum(x_range) / 2.0, y, (top + foot) / 2.0))

        shapes = [wall((0.0, ABUTMENT), -BEARING, abutment_width)]
        shapes.append(wall((SEAT + gap_to_seat, back_wall_end), height - PAVEMENT * 0.5, abutment_width - 0.02))
        for side in (1.0, -1.0):
            y = (abutment_width - WALL) / 2.0 * side
            shapes.append(wall((ABUTMENT - 0.02, wing), height - PAVEMENT * 0.6, WALL, y))
        web_distance = self.width * sum(WEB) / 4.0
        pads = box((0.5, 2.0 * web_distance + 0.6, BEARING + 0.02), (SEAT / 2.0, 0.0, -BEARING / 2.0))
        bodies = [Body(shape, "bridge_concrete", name, "IfcWall.RETAININGWALL") for shape in shapes]
        return [*bodies, Body(pads, "galvanised_steel", name, detail=BEARING)]

    def _pier(self, name: str, foot: float) -> list[Body]:
        """Return the solids of a pier along y with rounded ends, and its bearings; the deck's underside is z = 0."""
        pier_width = self.pier_width
        half_straight = max((self.width * PIER_LENGTH - pier_width) / 2.0, 0.01 * pier_width)
        angles = np.pi * np.arange(PIER_ROUND) / (PIER_ROUND - 1.0)
        rounded_end = pier_width / 2.0 * np.column_stack([np.cos(angles), np.sin(angles)]) + (0.0, half_straight)
        body = prism(np.concatenate([rounded_end, -rounded_end]), foot, -BEARING)
        bearing_distance = min(self.width * sum(WEB) / 4.0, half_straight)
        size = (min(pier_width * 0.8, 0.6), 2.0 * bearing_distance + 0.5, BEARING + 0.02)
        pads = box(size, (0.0, 0.0, -BEARING / 2.0))
        return [
            Body(body, "bridge_concrete", name, "IfcColumn.PIERSTEM"),
            Body(pads, "galvanised_steel", name, detail=BEARING),
        ]

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its piers, its deck and what lies behind its abutments: nothing else may stand there."""
        start, end, half_pier = self.station - self.width / 2.0, self.station + self.width / 2.0, self.pier_width / 2.0
        for d in self.pier_offsets:
            yield Block("foot", start, end, d - half_pier, d + half_pier, 0.0, self.clearance)
        left_end, right_end, top = self.left_abutment, self.right_abutment, self.clearance + self.deck_thickness
        yield Block("beam", start, end, right_end, left_end, self.clearance, top)
        yield Block("wall", start, end, left_end, _FAR, 0.0, top)
        yield Block("wall", start, end, -_FAR, right_end, 0.0, top)


def _extrude(outline: Float, ends: Point2) -> Float:
    """Return the sections (2, K, 3) of an outline (K, 2) in y, z extruded between two x, m."""
    return np.stack([np.column_stack([np.full(len(outline), x), outline]) for x in ends])


def _shear_sections(sections: Float, shear: float, height: float) -> Float:
    """Return sections sheared, y growing by ``shear`` times x, and moved up by ``height`` (m)."""
    return sections + sections[..., :1] * np.array([0.0, shear, 0.0]) + (0.0, 0.0, height)
