"""Noise barriers."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .body import Body, Course, boxes
from .limits import Interval, Limits, interval, share
from .thing import Block, LengthwiseThing, TwinTypes

FLANGE, INSIDE, WEB = 0.475, 0.42, 0.02
"""Section of an HEA profile of width 1: its flanges' outer and inner faces, half its web (HEA 160: 152 mm across the
wall, 160 mm along it)."""
BURIED = 0.4
"""Depth of a noise barrier's posts and plinths below the surface, m."""
PLINTH_SHARE, HIGHEST_PLINTH = 0.25, 0.5
"""Height of the plinth as a share of the wall's, and at most (m)."""
PLAY = 0.005
"""Gap between a panel and a post, m."""
CAP, FRAME, PANE = 0.04, 0.07, 0.02
"""Height of the strip on top of a panel, width of a glass panel's frame, thickness of its pane, m."""
RELIEFS = {"aluminium": 0.025, "concrete": 0.045, "wood": 0.024}
"""How far the slats of a panel stand out, m."""
RELIEF_SHARE = 0.3
"""The slats' share of the panel's thickness at most."""
MATERIALS = {
    "aluminium": ("noise_aluminium", "noise_aluminium"),
    "concrete": ("noise_concrete", "noise_concrete"),
    "wood": ("noise_wood", "noise_wood"),
    "glass": ("acrylic_glass", "galvanised_steel"),
}
"""Materials of a panel, and of its frame or cap."""
_SHORTEST_BAY, _NONE = 0.05, 1e-9  # m


class NoiseBarrierLimits(Limits):
    """Limits of noise barriers."""

    group: ClassVar = "barriers"
    place: ClassVar = 30
    allowed: ClassVar = {"noise_barrier_height": "height", "noise_barrier_length": (0.0, 1e6)}

    noise_barrier: float = share(0.25, "Probability of a noise barrier beside a carriageway.", title="Noise Barriers")
    noise_barrier_height: Interval = interval(2.5, 6.0, "m", "Height of noise barriers.")
    noise_barrier_length: Interval = interval(100.0, 800.0, "m", "Length of noise barriers.")


class NoiseBarrier(LengthwiseThing):
    """A noise barrier: panels between posts. Its offset is that of the panels' middle."""

    points_class: ClassVar = "noise_barrier"
    order: ClassVar = 30
    limits: ClassVar = NoiseBarrierLimits
    type: Literal["NoiseBarrier"] = "NoiseBarrier"
    height: float = quantity(4.0, ge=1, le=12, unit="m", description="Top above the surface.")
    panel: Literal["aluminium", "concrete", "wood", "glass"] = Field("aluminium", description="Kind of its panels.")
    thickness: float = quantity(0.15, ge=0.02, le=0.6, unit="m", description="Thickness of the panels.")
    post_spacing: float = quantity(4.0, ge=1, le=10, unit="m", description="Distance between posts.")
    post_width: float = quantity(0.16, ge=0.05, le=0.5, unit="m", description="Width of a post (HEA profile).")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a wall, for which IFC has no predefined type."""
        return TwinTypes("IfcWall.USERDEFINED", "barrier.noiseBarrier")

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: half of panels or posts."""
        half = max(self.thickness / 2.0, self.post_width * FLANGE)
        return half, half

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of panels, plinths and posts in local coordinates; none off the road."""
        end = self.end_on(course.length)
        if end is None:
            return []
        bays = self.model_copy(update={"end_station": end}).element_ends(self.post_spacing, end)
        station = np.append(bays[:, 0], end)
        feet, left, width = course.feet(station, self.offset_at(station)), course.left(station), self.post_width
        tall = self.height + BURIED
        web = boxes(feet, left, (2.0 * INSIDE * width, 2.0 * WEB * width, tall), -BURIED)
        flange, beside = (FLANGE - INSIDE) * width, (FLANGE + INSIDE) / 2.0 * width
        for side in (1.0, -1.0):
            web += boxes(feet, left, (flange, width, tall), -BURIED, side * beside)
        pairs = feet[np.column_stack([np.arange(len(bays)), np.arange(len(bays)) + 1])]
        pairs = pairs[bays[:, 1] - bays[:, 0] >= _SHORTEST_BAY]
        return [*self._walls(pairs), *(Body(shape, "galvanised_steel") for shape in web)]

    def _walls(self, pairs: Float) -> list[Body]:
        """Return the solids of panels and plinths between the feet (B, 2, 3) of posts, level at the lower one."""
        along = (pairs[:, 1] - pairs[:, 0]) * (1.0, 1.0, 0.0)
        length = np.maximum(np.linalg.norm(along, axis=1), _NONE)
        left = np.stack([-along[:, 1], along[:, 0], along[:, 2]], axis=1) / length[:, None]
        middle = pairs.mean(axis=1)
        middle[:, 2] = pairs[..., 2].min(axis=1)
        inside = self.thickness < 2.0 * INSIDE * self.post_width
        gap = self.post_width * (WEB if inside else 0.5) + PLAY
        long = np.maximum(length - 2.0 * gap, 0.02)
        plinth = min(self.height * PLINTH_SHARE, HIGHEST_PLINTH)
        face, frame = MATERIALS[self.panel]

        def filled(depth: float, low: float, high: float, material: str, beside: float = 0.0) -> list[Body]:
            shapes = boxes(middle, left, (depth, long, high - low), low, beside)
            return [Body(shape, material) for shape in shapes]

        made = filled(self.thickness, -BURIED, plinth, "noise_concrete")
        if self.panel == "glass":
            return [*made, *self._glazing(middle, left, long, (plinth, long / (self.post_spacing - 2.0 * gap)))]
        out = min(self.thickness * RELIEF_SHARE, RELIEFS[self.panel])
        top = self.height - (CAP if self.panel != "concrete" else 0.0)
        # The slats look towards the road; the wall stands behind them.
        rear = -out / 2.0 if self.offset < 0.0 else out / 2.0
        walls = filled(self.thickness - out, plinth, top, face, rear)
        if top < self.height:
            made += filled(self.thickness, top, self.height, frame)
        before = rear - np.copysign(self.thickness / 2.0, rear)
        slats = boxes(middle, left, (out, long, top - plinth), plinth, before)
        return [*walls, *made, *(Body(shape, face, detail=out) for shape in slats)]

    def _glazing(self, middle: Float, left: Float, long: Float, levels: tuple[float, Float]) -> list[Body]:
        """Return the solids of glass panes and their frames; those of shorter bays are squeezed."""
        low, squeezed = levels
        tall = self.height - low
        ahead = np.stack([left[:, 1], -left[:, 0], left[:, 2]], axis=1)
        shapes = [
            *boxes(middle, left, (self.thickness, long, FRAME), low),
            *boxes(middle, left, (self.thickness, long, FRAME), self.height - FRAME),
        ]
        for side in (1.0, -1.0):
            ends = middle + ahead * (side * (long - FRAME * squeezed) / 2.0)[:, None]
            size = (self.thickness, FRAME * squeezed, tall - 2.0 * FRAME)
            shapes += boxes(ends, left, size, low + FRAME)
        pane = (min(self.thickness * 0.6, PANE), long - 1.9 * FRAME * squeezed, tall - 1.9 * FRAME)
        glass, frame = MATERIALS["glass"]
        panes = boxes(middle, left, pane, low + 0.95 * FRAME)
        return [*(Body(shape, glass) for shape in panes), *(Body(shape, frame) for shape in shapes)]

    def footprint(self) -> Iterator[Block]:
        """Yield the box around panels and posts, in which nothing else may stand."""
        half = max(self.thickness, self.post_width) / 2.0
        yield self.strip(half, half, self.height)
