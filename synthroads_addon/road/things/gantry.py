"""Shield gantries and the boards on them."""

from collections.abc import Iterator
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...base.arrays import Float
from ...base.schema import Model, quantity
from ..guidelines import CLEARANCE
from ..objects import Side
from .body import Body, Place, bar, box, circle, shift
from .limits import Interval, Limits, interval, share
from .thing import Block, Signal, StandingThing, TwinTypes

HANGER = 0.18
"""Distance between a gantry's beam and its boards, m."""
BOARD, DISPLAY = 0.05, 0.28
"""Depth of a painted board and of a display, m."""
HUNG = (0.32, 0.1, 0.01)
"""Where a board's hangers are as a share of its width, how wide they are, and how much longer than the gap, m."""
FACE = 0.006
"""How far a board's face stands before it, m."""
BEAMS = ("box", "truss", "tube")
TUBE_SIDES = 20
JOINT = 0.08
"""Depth of a beam's joints beyond the beam's own, m."""
TRUSS_CHORD = (0.1, 0.06, 0.16)
"""Width of a truss's chords as a share of its height, and its limits, m."""
TRUSS_BAR, TRUSS_BAY = 0.65, (0.5, 1.2)
"""Width of a truss's other bars as a share of the chords'; a bay's length per height of 0.5 m at least."""
TRUSS_BARS = (
    ((0.0, -1.0, 0.0), (0.0, -1.0, 1.0)), ((0.0, 1.0, 0.0), (0.0, 1.0, 1.0)),
    ((0.0, -1.0, 0.0), (0.0, 1.0, 0.0)), ((0.0, -1.0, 1.0), (0.0, 1.0, 1.0)),
    ((0.0, -1.0, 0.0), (1.0, -1.0, 1.0)), ((0.0, 1.0, 0.0), (1.0, 1.0, 1.0)),
    ((0.0, -1.0, 0.0), (1.0, 1.0, 0.0)), ((0.0, -1.0, 1.0), (1.0, 1.0, 1.0)),
)  # fmt: skip
"""Bars of one bay of a truss from x = 0 to 1, y = -1 to 1, z = 0 to 1; the first four are its frame."""
TRUSS_FRAME = 4
POST_ENCLOSES, POST_ENTERS, POST_SHARE = 0.02, 0.05, 0.9
"""How far posts enclose the beam's ends, and the middle one reaches into it (m); its depth as a share of the beam's."""
PLINTH, BURIED, PLINTH_MARGIN = 0.3, 0.6, 0.2
"""Top of a post's plinth above the surface, its depth below it, and what it is wider than the post all around, m."""
BASE_PLATE, PLATE_MARGIN, PLATE_SUNK = 0.04, 0.12, 0.01
"""A base plate's thickness above its plinth and its margin; how far it and the post reach into what is below, m."""
BOLT = 0.06
"""Height of a base plate's bolts, m."""
CATWALK_CLEAR, NARROWEST_CATWALK = 0.05, 0.7
"""From a post to a catwalk, and its least width, m."""
CATWALK_SUPPORT, CATWALK_GRATING, CATWALK_RAIL, CATWALK_BAR = 0.06, 0.04, 1.1, 0.045
"""Heights of a catwalk's supports, grating and handrail above it, and the thickness of its rails, m."""
CATWALK_TOE = (0.01, 0.12, 0.1)
"""Thickness and height of the toe boards, and the height of their middle above the supports, m."""
CATWALK_POST, CATWALK_SPACING = 0.8, 2.0
"""Thickness of a railing's posts as a share of its rails', and their spacing at most, m."""
CATWALK_SUPPORT_SHARE, CATWALK_SUPPORT_EXCESS = 0.96, 0.02
"""Length of a support as a share of the catwalk's width, and by how much it is higher than its place, m: half of that
reaches into the beam below, half into the grating above."""
LADDER_FOOT, LADDER_RAIL, LADDER_HALF, LADDER_AWAY = 2.3, 0.05, 0.2, 0.2
"""Foot of a ladder above the surface, thickness of its rails, half their distance, and from the beam to it, m."""
LADDER_RUNG = (0.4, 0.03, 0.3)
"""Width and thickness of a rung, and their spacing, m."""
OVERHANG = 0.3
"""Share of what a board is higher than a gantry's beam that hangs below it."""


class GantrySign(Model):
    """A sign or display on a gantry."""

    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its middle.")
    width: float = quantity(gt=0, le=12, unit="m", description="Width of the face.")
    height: float = quantity(gt=0, le=8, unit="m", description="Height of the face.")
    kind: Literal["destination", "display"] = Field("destination", description="Painted sign, or variable display.")
    text: tuple[str, ...] = Field((), max_length=6, description="Lines of writing on its face.")
    traffic_side: Literal["right", "left"] | None = Field(
        None, description="Side that the road's traffic keeps to; right if not given."
    )

    @property
    def depth(self) -> float:
        """Return the depth of its body along the road, m."""
        return DISPLAY if self.kind == "display" else BOARD

    @property
    def facing(self) -> float:
        """Return 1 for a sign that faces traffic with the stations, else -1: by its side of the centreline."""
        is_with_stations = (self.offset < 0.0) != (self.traffic_side == "left")
        return 1.0 if is_with_stations else -1.0


class GantryLimits(Limits):
    """Limits of gantries."""

    place: ClassVar = 30
    allowed: ClassVar = {"gantry_clearance": (CLEARANCE, 10.0)}

    gantries: float = share(0.3, "Probability of a gantry, where no spacing is given.")
    gantry_spacing: float | None = quantity(
        None, "m", "Spacing of gantries, which then stand along the whole road.", (1, 10_000), unset="Single ones"
    )
    gantry_clearance: Interval = interval(5.0, 5.8, "m", "Clearance under gantries.")


class Gantry(StandingThing):
    """A shield gantry across one carriageway (one_sided), across both (two_sided), or on one post (cantilever).

    Station and offset are those of the middle of its beam, which reaches from ``left_offset`` to ``right_offset``. A
    cantilever has its post at the end named by ``post_side``, the others have posts at both ends, a two-sided one also
    in the median. Its signs face the traffic of the carriageway that they hang over.
    """

    points_class: ClassVar = "shield_gantry"
    order: ClassVar = 70
    limits: ClassVar = GantryLimits
    obstacle: ClassVar = "gantry's post"
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
    def _spans(self) -> Self:
        """Return the gantry unchanged; ValueError unless its left end lies to the left of its right one."""
        if self.left_offset <= self.right_offset:
            raise ValueError("left_offset must be greater than right_offset")
        return self

    def reach(self, facing: float) -> float:
        """Return how far (m) the beam, and the signs on one side of it (1 or -1), reach along the road."""
        signs = [HANGER + sign.depth for sign in self.signs if sign.facing == facing]
        return self.beam_depth / 2.0 + max(signs, default=0.0)

    def beam_bottom(self, lowest: float) -> float:
        """Return the height (m) of the beam's lower edge from that of the lowest part: taller signs hang below it."""
        largest_height = max((sign.height for sign in self.signs), default=0.0)
        return lowest + max(largest_height - self.beam_height, 0.0) * OVERHANG

    def ends_in_beam(self, sign: GantrySign, lowest: float) -> bool:
        """Return whether a sign with its lower edge at the height ``lowest`` (m) would end below the beam's top."""
        return lowest + sign.height < self.beam_bottom(lowest) + self.beam_height

    def post_offsets(self) -> list[float]:
        """Return the offsets of its posts, m."""
        if self.kind == "cantilever":
            return [self.left_offset if self.post_side == "left" else self.right_offset]
        return [self.left_offset, self.right_offset, *([0.0] if self.kind == "two_sided" else [])]

    @property
    def foot_offset(self) -> float:
        """Return the offset of the beam's end that it counts as standing at, m: that of ``post_side``."""
        return self.left_offset if self.post_side == "left" else self.right_offset

    @property
    def catwalk(self) -> bool:
        """Return whether it has a catwalk: displays are looked after from above; boards are not."""
        return any(sign.kind == "display" for sign in self.signs)

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: an assembly that signs hang on."""
        return TwinTypes("IfcElementAssembly.SIGNALASSEMBLY.SITE", f"gantry.{self.kind}", kind=f"Gantry {self.kind}")

    def part_models(self) -> dict[str, GantrySign]:
        """Return the parameters of its signs by name: sign-1, sign-2, ..."""
        return {f"sign-{number}": sign for number, sign in enumerate(self.signs, 1)}

    def signals(self) -> dict[str, Signal]:
        """Return the messages of its boards and displays to drivers, by the name of the sign."""
        return {
            name: Signal(sign.kind, text="\n".join(sign.text), dynamic=sign.kind == "display", facing=sign.facing)
            for name, sign in self.part_models().items()
        }

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of beam, posts, boards with their hangers, catwalk and ladder, in its frame."""
        left_x, right_x = self.offset - self.left_offset, self.offset - self.right_offset
        lowest = place.pavement((left_x, right_x), (-self.reach(1.0), self.reach(-1.0)), 0.0) + self.clearance
        bottom = self.beam_bottom(lowest)
        shapes = [shift(shape, (left_x, 0.0, bottom)) for shape in self._beam(right_x - left_x)]
        bodies = [Body(shape, "gantry_steel", "beam", "IfcBeam.BEAM") for shape in shapes]
        size = (right_x - left_x, self.beam_depth + JOINT, self.beam_height)
        joints = box(size, ((left_x + right_x) / 2.0, 0.0, bottom + self.beam_height / 2.0))
        bodies.append(Body(joints, "gantry_steel", "joints", detail=JOINT / 2.0))
        for number, offset in enumerate(self.post_offsets(), 1):
            bodies += self._post(place, f"post-{number}", offset, bottom)
        for name, sign in self.part_models().items():
            bodies += self._board(name, sign, (lowest, bottom))
        return (
            [*bodies, *self._catwalk(place, (left_x, right_x), bottom + self.beam_height)] if self.catwalk else bodies
        )

    def _beam(self, length: float) -> list[Float]:
        """Return the sections of the beam's shapes (one, or a truss's bars) from x = 0 on, its lower edge on z = 0."""
        depth, height = self.beam_depth, self.beam_height
        middle = (length / 2.0, 0.0, height / 2.0)
        if self.beam == "box":
            return [box((length, depth, height), middle)]
        if self.beam == "tube":
            section = circle(1.0, TUBE_SIDES)[:, ::-1] * (depth, height) + (0.0, height / 2.0)
            return [np.stack([np.column_stack([np.full(TUBE_SIDES, x), section]) for x in (0.0, length)])]
        share, least_width, largest_width = TRUSS_CHORD
        chord_width = min(max(height * share, least_width), largest_width)
        chord_y, chord_z = (depth - chord_width) / 2.0, (height - chord_width) / 2.0
        chords = [
            box((length, chord_width, chord_width), (length / 2.0, y * chord_y, height / 2.0 + z * chord_z))
            for y in (-1.0, 1.0)
            for z in (-1.0, 1.0)
        ]
        bays = int(np.ceil(length / (max(height, TRUSS_BAY[0]) * TRUSS_BAY[1])))
        first_corner, half_height = np.array([chord_width / 2.0, 0.0, height / 2.0]), np.array([0.0, 0.0, 0.5])
        for number in range(bays * len(TRUSS_BARS) + TRUSS_FRAME):
            bay, kind = divmod(number, len(TRUSS_BARS))
            alternation = 1.0 - 2.0 * (bay % 2)
            size = ((length - chord_width) / bays, chord_y * alternation, 2.0 * chord_z * alternation)
            start, end = first_corner + (np.array(TRUSS_BARS[kind]) + (bay, 0.0, 0.0) - half_height) * size
            chords.append(bar(start, end, chord_width * TRUSS_BAR))
        return chords

    def _post(self, place: Place, name: str, offset: float, bottom: float) -> list[Body]:
        """Return the solids of a post: one at an end encloses the beam's end, the middle one ends in it."""
        x, is_at_end = self.offset - offset, offset in (self.left_offset, self.right_offset)
        foot = float(place.ground([x], [0.0])[0]) + self.elevation
        top = bottom + (self.beam_height + POST_ENCLOSES if is_at_end else POST_ENTERS)
        depth = self.beam_depth + 2.0 * POST_ENCLOSES if is_at_end else self.beam_depth * POST_SHARE

        def block(margin: float, bottom: float, block_top: float) -> Float:
            """Return a block around the post, wider by a margin (m) on all sides, from a height to another."""
            size = (self.post_width + 2.0 * margin, depth + 2.0 * margin, block_top - bottom)
            return box(size, (x, 0.0, (bottom + block_top) / 2.0))

        plate_top = foot + PLINTH + BASE_PLATE
        if plate_top >= top:
            return []
        parts = (
            (block(0.0, plate_top - PLATE_SUNK, top), "gantry_steel", 0.0),
            (block(PLINTH_MARGIN, foot - BURIED, foot + PLINTH), "bridge_concrete", 0.0),
            (block(PLATE_MARGIN, foot + PLINTH - PLATE_SUNK, plate_top), "gantry_steel", 0.0),
            (block(PLATE_MARGIN, plate_top, plate_top + BOLT), "gantry_steel", BOLT),
        )
        return [Body(shape, material, name, "IfcColumn.COLUMN", detail) for shape, material, detail in parts]

    def _board(self, name: str, sign: GantrySign, levels: tuple[float, float]) -> list[Body]:
        """Return the solids of a board, in front of the beam as the traffic below sees it, and of its hangers."""
        lowest, bottom = levels
        beam_middle = bottom + self.beam_height / 2.0
        z = beam_middle if self.ends_in_beam(sign, lowest) else lowest + sign.height / 2.0
        x, half_depth = self.offset - sign.offset, self.beam_depth / 2.0
        share, hanger_width, hanger_excess = HUNG

        def block(
            size: tuple[float, float, float], front_distance: float, lateral: float = 0.0, middle_z: float = z
        ) -> Float:
            """Return the sections of a box whose middle is so far (m) before the beam's axis as its traffic sees it."""
            return box(size, (x + lateral, -sign.facing * front_distance, middle_z))

        board = block((sign.width, sign.depth, sign.height), half_depth + HANGER + sign.depth / 2.0)
        face = block((sign.width, FACE, sign.height), half_depth + HANGER + sign.depth + FACE / 2.0)
        kind, material = (
            ("IfcSignal.VISUAL", "display") if sign.kind == "display" else ("IfcSign.PICTORAL", "board_back")
        )
        bodies = [Body(board, material, name, kind), Body(face, material, name, detail=FACE)]
        hanger_height, clamp_distance = max(sign.height - 0.2, sign.height / 2.0), half_depth - self.beam_depth * 0.1
        for lateral in (-share * sign.width, share * sign.width):
            hanger = block((hanger_width, HANGER + hanger_excess, hanger_height), half_depth + HANGER / 2.0, lateral)
            clamp = block(
                (0.16, self.beam_depth * 0.3 + 0.05, self.beam_height * 0.3), clamp_distance, lateral, beam_middle
            )
            bodies += [Body(shape, "gantry_steel", "beam", "IfcBeam.BEAM") for shape in (hanger, clamp)]
        return bodies

    def _catwalk(self, place: Place, ends: tuple[float, float], level: float) -> list[Body]:
        """Return the solids of the catwalk on the beam and of the ladder at the right post, else at the left one."""
        # Heights z are above the beam's top, which lies at `level`.
        gap = self.post_width / 2.0 + CATWALK_CLEAR  # from a post's axis to the catwalk
        length, width = max(ends[1] - ends[0] - 2.0 * gap, 1.0), max(self.beam_depth, NARROWEST_CATWALK)
        start, middle, railing_y = ends[0] + gap, ends[0] + gap + length / 2.0, (width - CATWALK_BAR) / 2.0
        toe_thickness, toe_height, toe_z = CATWALK_TOE
        floor_z = CATWALK_SUPPORT + CATWALK_GRATING
        rail_top = floor_z + CATWALK_RAIL
        shapes = [box((length, width, CATWALK_GRATING), (middle, 0.0, floor_z - CATWALK_GRATING / 2.0))]
        bays = int(np.ceil(length / CATWALK_SPACING))
        post_x = start + CATWALK_BAR / 2.0 + np.arange(bays + 1) * (length - CATWALK_BAR) / bays
        post_height = rail_top - CATWALK_BAR - CATWALK_SUPPORT
        for y in (-railing_y, railing_y):
            shapes.append(box((length, toe_thickness, toe_height), (middle, y, CATWALK_SUPPORT + toe_z)))
            shapes += [
                box((length, CATWALK_BAR, CATWALK_BAR), (middle, y, z))
                for z in (rail_top - CATWALK_BAR / 2.0, rail_top - CATWALK_RAIL / 2.0)
            ]
            size = (CATWALK_BAR * CATWALK_POST, CATWALK_BAR * CATWALK_POST, post_height)
            shapes += [box(size, (x, y, CATWALK_SUPPORT + post_height / 2.0)) for x in post_x.tolist()]
        # One box around all supports, from that at the first post to that at the last: they are fittings.
        size = (
            length + CATWALK_SUPPORT - CATWALK_BAR,
            width * CATWALK_SUPPORT_SHARE,
            CATWALK_SUPPORT + CATWALK_SUPPORT_EXCESS,
        )
        supports = box(size, (middle, 0.0, CATWALK_SUPPORT / 2.0))
        walk = [shift(shape, (0.0, 0.0, level)) for shape in shapes]
        ladder, rungs = self._ladder(place, ends, level)
        return [
            *(Body(shape, "gantry_steel", "catwalk", "IfcPlate.USERDEFINED") for shape in walk),
            *(Body(shape, "gantry_steel", "ladder", "IfcStair.LADDER") for shape in ladder),
            Body(shift(supports, (0.0, 0.0, level)), "gantry_steel", "catwalk", detail=CATWALK_SUPPORT),
            Body(rungs, "gantry_steel", "rungs", detail=LADDER_RUNG[1]),
        ]

    def _ladder(self, place: Place, ends: tuple[float, float], level: float) -> tuple[list[Float], Float]:
        """Return the sections of a ladder's two rails, and of the box around its rungs."""
        is_right = self.kind != "cantilever" or self.post_side == "right"
        # Behind the boards of the carriageway that the post stands beside.
        x, y = ends[is_right], (self.beam_depth / 2.0 + LADDER_AWAY) * (1.0 if is_right else -1.0)
        foot = float(place.ground([x], [0.0])[0]) + self.elevation + LADDER_FOOT
        top = level + CATWALK_RAIL
        rails = [
            box((LADDER_RAIL, LADDER_RAIL, top - foot), (x + side, y, (top + foot) / 2.0))
            for side in (-LADDER_HALF, LADDER_HALF)
        ]
        rung_width, rung_thickness, _ = LADDER_RUNG
        return rails, box((rung_width, rung_thickness, top - foot), (x, y, (top + foot) / 2.0))

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its posts, then that of its beam, in which nothing else may stand."""
        half_width, s, top = self.post_width / 2.0, self.station, self.clearance + self.beam_height
        for d in self.post_offsets():
            yield Block("foot", s - half_width, s + half_width, d - half_width, d + half_width, 0.0, top)
        half_depth = self.beam_depth / 2.0
        yield Block("beam", s - half_depth, s + half_depth, self.right_offset, self.left_offset, self.clearance, top)
