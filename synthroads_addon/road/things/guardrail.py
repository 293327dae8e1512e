"""Steel guardrails."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from ...base.arrays import Float
from ...base.schema import quantity, when
from .body import Body, Course, boxes, sweep
from .deformation import Dent, dent_offsets, dent_stations
from .limits import Interval, Limits, interval
from .thing import Block, LengthwiseThing, TwinTypes

BEAM = (
    (0.010, 0.000), (0.040, -0.006), (0.074, -0.030), (0.081, -0.052), (0.074, -0.080), (0.012, -0.124),
    (0.003, -0.140), (0.003, -0.170), (0.012, -0.186), (0.074, -0.230), (0.081, -0.258), (0.074, -0.280),
    (0.040, -0.304), (0.010, -0.310),
)  # fmt: skip
"""A guardrail's beam, the A profile of 0.31 m: depth towards traffic, height under its top edge (m)."""
POST = (0.10, 0.055)
"""A guardrail's post: across the road, along it (m)."""
BURIED = 0.35
"""Depth to which a guardrail's posts are modelled below the surface, m."""
POST_TOP = 0.03
"""A guardrail's posts end so far (m) below the top of its beam."""
LOWEST_POST = 0.15
"""Where the beam's top is lower than this (m), a terminal has no posts."""
TIP = -0.02
"""Top of a guardrail's beam at its very ends above the surface, m."""
SPACER = {"left": 0.07, "right": 0.07, "both": 0.20}
"""Distance between posts and beam, m: a single rail's face stands 0.2 m from the posts' axis."""
SHEET = 0.003
"""Thickness of a guardrail's beam, m."""
BLOCK = (0.96, 0.10, 0.22, 0.155)
"""A spacer: its share of the gap, as faces that coincide have no first hit; length and height; how far its middle is
below the beam's top (m)."""
LAP, LAP_SHEET = 0.32, SHEET
"""A splice: length over which two sheets of the beam lie over each other, and how far the upper one is proud, m."""
BOLT_ROWS = (-0.1, 0.1)
"""Where the bolts of a splice are along the beam, from its middle, m: three one below the other in each row."""
BOLTS = ((0.043, -0.102, -0.9535), (0.003, -0.155, 0.0), (0.043, -0.208, 0.9535))
"""Bolts of a row: depth and height under the beam's top edge of their middles (m), and by how much they are turned
upwards (rad), as the flanks are that they sit on."""
BOLT_HEAD = (0.017, 0.009)
"""Radius and height of a bolt's head, m."""
REFLECTOR = ((0.008, 0.034), (0.08, 0.09))
"""A reflector's inner and outer edge, upright across the beam's trough: depth and height of each, m."""
REFLECTOR_MIDDLE, REFLECTOR_PLATE = -0.155, 0.008
"""Height of a reflector's middle under the beam's top edge, and its thickness along the road, m."""
SHORTEST_REFLECTOR_SPACING = 1.0
"""Shortest distance of reflectors, m."""
_STEEPEST = 0.1
"""Slope of a usual terminal, m/m."""
_FACE, _REAR = 0.2, 0.05
"""From the axis to the face of the beam, and to the rear of the posts, m."""


class GuardrailLimits(Limits):
    """Limits of guardrails."""

    group: ClassVar = "barriers"
    place: ClassVar = 20
    allowed: ClassVar = {"guardrail_height": "height"}

    guardrail_height: Interval = interval(0.75, 0.9, "m", "Top of guardrails.")


class Guardrail(LengthwiseThing):
    """A steel guardrail: W-beam on posts, ramped down at its terminals. Its offset is that of the posts' axis.

    The beam is of sheets that are bolted to each other with an overlap of `LAP`, the first splice ``beam_length`` after
    its start. Reflectors stand in its trough from the end of the first terminal on.
    """

    conditions = (
        when(
            {"reflector_spacing": {"exclusiveMinimum": 0}},
            {"reflector_spacing": {"minimum": SHORTEST_REFLECTOR_SPACING}},
        ),
    )
    points_class: ClassVar = "guardrail"
    order: ClassVar = 10
    limits: ClassVar = GuardrailLimits
    type: Literal["Guardrail"] = "Guardrail"
    faces: Literal["left", "right", "both"] = Field(description="Side that the beam is mounted on.")
    height: float = quantity(0.75, ge=0.3, le=1.5, unit="m", description="Top of the beam above the surface.")
    post_spacing: float = quantity(4.0, ge=0.5, le=10, unit="m", description="Distance between posts.")
    terminal_length: float = quantity(
        12.0, ge=0, le=50, unit="m", description="Length over which either end is ramped into the ground."
    )
    beam_length: float = quantity(
        4.0, ge=1, le=20, unit="m", description="Distance between the splices of the beam's sheets."
    )
    reflector_spacing: float = quantity(
        50.0, ge=0, le=1000, unit="m", description="Distance between the reflectors in the beam; 0 for none."
    )
    dents: tuple[Dent, ...] | None = Field(None, description="Places at which it was hit and is bent.")

    @model_validator(mode="after")
    def _reflectors_fit(self) -> Guardrail:
        """Return the guardrail unchanged; ValueError for reflectors closer than `SHORTEST_REFLECTOR_SPACING`."""
        if 0 < self.reflector_spacing < SHORTEST_REFLECTOR_SPACING:
            raise ValueError(f"reflector_spacing must be 0 (none) or at least {SHORTEST_REFLECTOR_SPACING:g} m")
        return self

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a guardrail."""
        return TwinTypes("IfcRailing.GUARDRAIL", "barrier.guardRail")

    def offset_at(self, station: Float) -> Float:
        """Return the offsets (N,) of its axis at stations (N,), m, bent at its dents."""
        return super().offset_at(station) + (dent_offsets(self.dents, station) if self.dents else 0.0)

    def reach(self) -> tuple[float, float]:
        """Return how far its beams and posts reach to the right and to the left, m."""
        rear_reach = POST[0] / 2.0
        face_reach = rear_reach + SPACER[self.faces] + max(depth for depth, _ in BEAM)
        return rear_reach if self.faces == "left" else face_reach, rear_reach if self.faces == "right" else face_reach

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of beams, posts, spacers and reflectors in local coordinates; none off the road.

        Details are the splices with their bolts.
        """
        end = self.end_on(course.length)
        if end is None:
            return []
        sides = {"left": (1.0,), "right": (-1.0,), "both": (1.0, -1.0)}[self.faces]
        shapes = [*self._beams(course, end, sides), *self._posts(course, end, sides)]
        bodies = [Body(shape, "galvanised_steel") for shape in shapes]
        bodies += [Body(shape, "galvanised_steel", detail=LAP) for shape in self._splices(course, end, sides)]
        return bodies + [Body(shape, "reflector") for shape in self._reflectors(course, end, sides)]

    def _beams(self, course: Course, end: float, sides: tuple[float, ...]) -> Iterator[Float]:
        """Return the sections (N, K, 3) of the beam on each side (1 left, -1 right): a sheet swept along the road."""
        ramp = self.ramp_length(end)
        kinks = [self.start_station + ramp, end - ramp, *dent_stations(self.dents or (), self.start_station, end)]
        station = course.rows(self.offset_at, self.start_station, end, kinks)
        feet, left_vectors = course.feet(station, self.offset_at(station)), course.left(station)
        profile = np.array([*BEAM, *((x - SHEET, z) for x, z in reversed(BEAM))])
        profile_offsets = profile[:, 0] + POST[0] / 2.0 + SPACER[self.faces]
        profile_heights = self._top(end, station)[:, None] + profile[:, 1]
        return (sweep(feet, left_vectors, side * profile_offsets, profile_heights) for side in sides)

    def _posts(self, course: Course, end: float, sides: tuple[float, ...]) -> list[Float]:
        """Return the sections of the posts, wherever the beam is high enough for one, and of their spacers."""
        count = int((end - self.start_station) / self.post_spacing + 1e-4) + 1
        station = self.start_station + np.arange(count) * self.post_spacing
        station = station[(self._top(end, station) >= LOWEST_POST) & (station <= end + 1e-9)]
        feet, left_vectors = course.feet(station, self.offset_at(station)), course.left(station)
        top = self._top(end, station)
        size = (*POST, top - POST_TOP + BURIED)
        shapes = boxes(feet, left_vectors, size, -BURIED)
        spacer, (share, spacer_length, spacer_height, middle_depth) = SPACER[self.faces], BLOCK
        for side in sides:
            lateral = side * (POST[0] + spacer) / 2.0
            shapes += boxes(
                feet,
                left_vectors,
                (spacer * share, spacer_length, spacer_height),
                top - middle_depth - spacer_height / 2.0,
                lateral,
            )
        return shapes

    def splice_stations(self, end: float) -> Float:
        """Return the stations (N,), m, of the splices' middles if it ends at ``end`` (m)."""
        count = max(math.ceil((end - self.start_station) / self.beam_length - 1e-4) - 1, 0)
        return self.start_station + (1.0 + np.arange(count)) * self.beam_length

    def reflector_stations(self, end: float) -> Float:
        """Return the stations (N,), m, of the reflectors if it ends at ``end`` (m); none on its terminals."""
        if not self.reflector_spacing:
            return np.empty(0)
        ramp = self.ramp_length(end)
        count = int((end - self.start_station - 2.0 * ramp) / self.reflector_spacing + 1e-4) + 1
        return self.start_station + ramp + np.arange(count) * self.reflector_spacing

    def _splices(self, course: Course, end: float, sides: tuple[float, ...]) -> Iterator[Float]:
        """Yield the sections of what a splice adds in front of a beam: the upper sheet, and the bolts' heads on it."""
        # A head stands upright on its flank, so in depth it reaches farther; on a terminal it stays level.
        least_cosine = min(math.cos(turn) for _, _, turn in BOLTS)
        protrusion = (LAP_SHEET + BOLT_HEAD[1] + BOLT_HEAD[0] * _STEEPEST) / least_cosine
        profile = np.array([*((x + protrusion, z) for x, z in BEAM), *reversed(BEAM)])
        profile_offsets = profile[:, 0] + POST[0] / 2.0 + SPACER[self.faces]
        splice_middles = self.splice_stations(end)
        station = np.add.outer(splice_middles, (-LAP / 2.0, LAP / 2.0)).ravel().clip(self.start_station, end)
        feet, left_vectors = course.feet(station, self.offset_at(station)), course.left(station)
        profile_heights = self._top(end, station)[:, None] + profile[:, 1]
        for side in sides:
            yield from sweep(feet, left_vectors, side * profile_offsets, profile_heights).reshape(
                len(splice_middles), 2, len(profile), 3
            )

    def _reflectors(self, course: Course, end: float, sides: tuple[float, ...]) -> Iterator[Float]:
        """Yield the sections of the reflectors' plates, one behind and one before each station."""
        station = self.reflector_stations(end)
        feet, left_vectors = course.feet(station, self.offset_at(station)), course.left(station)
        half_plate = np.stack([left_vectors[:, 1], -left_vectors[:, 0], left_vectors[:, 2]], axis=1) * (
            REFLECTOR_PLATE / 2.0
        )
        corners = np.array(
            [
                (x, sign * edge_height / 2.0)
                for sign, order in ((-1, 1), (1, -1))
                for x, edge_height in REFLECTOR[::order]
            ]
        )
        corner_offsets = corners[:, 0] + POST[0] / 2.0 + SPACER[self.faces]
        corner_heights = (self._top(end, station) + REFLECTOR_MIDDLE)[:, None] + corners[:, 1]
        for side in sides:
            yield from np.stack(
                [
                    sweep(feet + direction * half_plate, left_vectors, side * corner_offsets, corner_heights)
                    for direction in (-1.0, 1.0)
                ],
                axis=1,
            )

    def _top(self, end: float, station: Float) -> Float:
        """Return the height (N,) of the beam's top above the surface, m."""
        share = self.height_share(end, station)
        return self.height * share + TIP * (1.0 - share)

    def footprint(self) -> Iterator[Block]:
        """Yield the rail's box, to the face of its beam; nothing else may stand there."""
        right_reach, left_reach = (_REAR if self.faces == rear_side else _FACE for rear_side in ("left", "right"))
        yield self.strip(right_reach, left_reach, self.height)
