"""Movable barriers of construction zones."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ...base.arrays import Float
from ...base.schema import quantity
from .body import Body, Course, box
from .thing import Block, LengthwiseThing, TwinTypes

FLANKS = {
    "steel": (
        (1.0, -0.02), (1.0, 0.05), (0.5, 0.17), (0.3, 0.3), (0.3, 0.62), (0.5, 0.72), (0.5, 0.92), (0.36, 1.0),
    ),
    "plastic": (
        (1.0, -0.02), (1.0, 0.16), (0.66, 0.4), (0.58, 0.62), (0.62, 0.66), (0.62, 0.78), (0.55, 0.82), (0.45, 1.0),
    ),
}  # fmt: skip
"""One flank of a movable barrier's element, as those of concrete barriers; a little sunk."""
GAP = 0.03
"""Gap between two elements of a movable barrier, m."""
REFLECTOR = (0.12, 0.02, 0.06)
"""A reflector on an element of steel: along it, across, height, m."""
_SHORTEST, _NONE = 0.05, 1e-9  # m
LONGEST_PLASTIC = 2.5
"""Elements up to this length (m) are of plastic, by turns red and white; longer ones are of steel."""


class TemporaryBarrier(LengthwiseThing):
    """A movable barrier of a construction zone, straight from its start offset to its end offset."""

    points_class: ClassVar = "construction_barrier"
    order: ClassVar = 40
    type: Literal["TemporaryBarrier"] = "TemporaryBarrier"
    end_offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its axis at its end station.")
    height: float = quantity(0.55, ge=0.2, le=1.2, unit="m", description="Top above the surface.")
    base_width: float = quantity(0.4, ge=0.1, le=1.0, unit="m", description="Width of its foot.")
    segment_length: float = quantity(4.0, ge=1, le=12, unit="m", description="Length of one element.")

    def offset_at(self, station: Float) -> Float:
        """Return the offsets of its axis at stations of any shape, m."""
        share = (station - self.start_station) / max(self.end_station - self.start_station, 1e-3)
        return self.offset + (self.end_offset - self.offset) * share

    @property
    def plastic(self) -> bool:
        """Return whether its elements are of plastic, else of steel."""
        return self.segment_length <= LONGEST_PLASTIC

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a guardrail, marked as temporary."""
        return TwinTypes("IfcRailing.GUARDRAIL", "barrier.temporaryBarrier", temporary=True)

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: half its foot's width."""
        return self.base_width / 2.0, self.base_width / 2.0

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of its straight elements, and of their reflectors, in local coordinates."""
        if self.end_on(course.length) is None:
            return []
        half_gap = GAP / 2.0
        station = np.clip(
            self.element_ends(self.segment_length, course.length) + (half_gap, -half_gap), 0.0, course.length
        )
        elements = np.flatnonzero(station[:, 1] - station[:, 0] >= _SHORTEST)
        ends = station[elements].ravel()
        feet = course.feet(ends, self.offset_at(ends)).reshape(-1, 2, 3)
        directions = _unit(feet[:, 1] - feet[:, 0])
        left_vectors = _unit(np.stack([-directions[:, 1], directions[:, 0], np.zeros(len(directions))], axis=1))
        up_vectors = np.cross(directions, left_vectors)
        flank = np.array(FLANKS["plastic" if self.plastic else "steel"]) * (
            self.base_width / 2.0,
            self.height,
        )
        outline = np.concatenate([flank, flank[::-1] * (-1.0, 1.0)])
        corners = outline[:, :1] * left_vectors[:, None, None] + outline[:, 1:] * up_vectors[:, None, None]
        colours = ("plastic_red", "plastic_white") if self.plastic else ("galvanised_steel", "galvanised_steel")
        shapes = feet[:, :, None] + corners
        bodies = [Body(shape, colours[i % 2]) for i, shape in zip(elements.tolist(), shapes, strict=True)]
        return (
            bodies
            if self.plastic
            else [*bodies, *self._reflectors(feet.mean(axis=1), np.stack([directions, left_vectors, up_vectors], 1))]
        )

    def _reflectors(self, middle: Float, axes: Float) -> list[Body]:
        """Return the solids of reflectors on both flanks of elements: middles (E, 3), axes (E, 3, 3) as rows."""
        lateral = self.base_width / 2.0 * FLANKS["steel"][5][0] + REFLECTOR[1] / 4.0
        shapes = [box(REFLECTOR, (0.0, side * lateral, self.height * 0.82)) for side in (1.0, -1.0)]
        pairs = ((shape, place, frame) for shape in shapes for place, frame in zip(middle, axes, strict=True))
        return [Body(place + shape @ frame, "reflector", detail=REFLECTOR[1]) for shape, place, frame in pairs]

    def footprint(self) -> Iterator[Block]:
        """Yield no box: it stands on the pavement and runs obliquely."""
        yield from ()


def _unit(vectors: Float) -> Float:
    """Return vectors (N, 3) scaled to length 1; those of length 0 stay 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1), _NONE)[:, None]
