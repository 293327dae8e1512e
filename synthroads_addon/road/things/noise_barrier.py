"""Noise barriers."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

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
    missing_panels: tuple[Annotated[int, Field(strict=True, ge=0, le=100_000)], ...] | None = Field(
        None, description="Bays without a panel, counted from 0 at its beginning."
    )

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a wall, for which IFC has no predefined type."""
        return TwinTypes("IfcWall.USERDEFINED", "barrier.noiseBarrier")

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: to the panels' or the posts' faces."""
        panel_reach = self.thickness / 2.0
        post_reach = FLANGE * self.post_width  # to the outer face of the profile's flanges
        reach = max(panel_reach, post_reach)
        return reach, reach

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of panels, plinths and posts in local coordinates; none off the road."""
        end = self.end_on(course.length)
        if end is None:
            return []
        bays = self.model_copy(update={"end_station": end}).element_ends(self.post_spacing, end)
        station = np.append(bays[:, 0], end)
        feet, left_vectors, post_width = (
            course.feet(station, self.offset_at(station)),
            course.left(station),
            self.post_width,
        )
        post_height = self.height + BURIED
        post_shapes = boxes(
            feet, left_vectors, (2.0 * INSIDE * post_width, 2.0 * WEB * post_width, post_height), -BURIED
        )
        flange_thickness, flange_offset = (FLANGE - INSIDE) * post_width, (FLANGE + INSIDE) / 2.0 * post_width
        for side in (1.0, -1.0):
            post_shapes += boxes(
                feet, left_vectors, (flange_thickness, post_width, post_height), -BURIED, side * flange_offset
            )
        pairs = feet[np.column_stack([np.arange(len(bays)), np.arange(len(bays)) + 1])]
        is_filled = bays[:, 1] - bays[:, 0] >= _SHORTEST_BAY
        is_filled &= ~np.isin(np.arange(len(bays)), self.missing_panels or ())
        pairs = pairs[is_filled]
        return [*self._walls(pairs), *(Body(shape, "galvanised_steel") for shape in post_shapes)]

    def _walls(self, pairs: Float) -> list[Body]:
        """Return the solids of panels and plinths between the feet (B, 2, 3) of posts, level at the lower one."""
        level_vectors = (pairs[:, 1] - pairs[:, 0]) * (1.0, 1.0, 0.0)
        bay_lengths = np.maximum(np.linalg.norm(level_vectors, axis=1), _NONE)
        left_vectors = (
            np.stack([-level_vectors[:, 1], level_vectors[:, 0], level_vectors[:, 2]], axis=1) / bay_lengths[:, None]
        )
        bay_middles = pairs.mean(axis=1)
        bay_middles[:, 2] = pairs[..., 2].min(axis=1)
        is_between_flanges = self.thickness < 2.0 * INSIDE * self.post_width
        post_gap = self.post_width * (WEB if is_between_flanges else 0.5) + PLAY
        panel_lengths = np.maximum(bay_lengths - 2.0 * post_gap, 0.02)
        plinth_height = min(self.height * PLINTH_SHARE, HIGHEST_PLINTH)
        panel_material, frame_material = MATERIALS[self.panel]

        def filled(depth: float, bottom: float, upper_edge: float, material: str, lateral: float = 0.0) -> list[Body]:
            """Return a solid in each bay, `depth` (m) thick, between two heights, moved to the left by `lateral`."""
            shapes = boxes(bay_middles, left_vectors, (depth, panel_lengths, upper_edge - bottom), bottom, lateral)
            return [Body(shape, material) for shape in shapes]

        bodies = filled(self.thickness, -BURIED, plinth_height, "noise_concrete")
        if self.panel == "glass":
            return [
                *bodies,
                *self._glazing(
                    bay_middles,
                    left_vectors,
                    panel_lengths,
                    (plinth_height, panel_lengths / (self.post_spacing - 2.0 * post_gap)),
                ),
            ]
        relief = min(self.thickness * RELIEF_SHARE, RELIEFS[self.panel])
        panel_top = self.height - (CAP if self.panel != "concrete" else 0.0)
        # The slats look towards the road; the wall stands behind them.
        wall_offset = -relief / 2.0 if self.offset < 0.0 else relief / 2.0
        walls = filled(self.thickness - relief, plinth_height, panel_top, panel_material, wall_offset)
        if panel_top < self.height:
            bodies += filled(self.thickness, panel_top, self.height, frame_material)
        slat_offset = wall_offset - np.copysign(self.thickness / 2.0, wall_offset)
        slats = boxes(
            bay_middles, left_vectors, (relief, panel_lengths, panel_top - plinth_height), plinth_height, slat_offset
        )
        return [*walls, *bodies, *(Body(shape, panel_material, detail=relief) for shape in slats)]

    def _glazing(
        self, bay_middles: Float, left_vectors: Float, panel_lengths: Float, levels: tuple[float, Float]
    ) -> list[Body]:
        """Return the solids of glass panes and their frames in B bays.

        Args:
            bay_middles, left_vectors: (B, 3) middles of the bays, and unit vectors to the left.
            panel_lengths: (B,) m.
            levels: height of the panes' lower edge, m, and the factors (B,) on the frames' width: less than 1 in
                shorter bays.
        """
        bottom, frame_factors = levels
        panel_height = self.height - bottom
        forward_vectors = np.stack([left_vectors[:, 1], -left_vectors[:, 0], left_vectors[:, 2]], axis=1)
        shapes = [
            *boxes(bay_middles, left_vectors, (self.thickness, panel_lengths, FRAME), bottom),
            *boxes(bay_middles, left_vectors, (self.thickness, panel_lengths, FRAME), self.height - FRAME),
        ]
        for side in (1.0, -1.0):
            ends = bay_middles + forward_vectors * (side * (panel_lengths - FRAME * frame_factors) / 2.0)[:, None]
            size = (self.thickness, FRAME * frame_factors, panel_height - 2.0 * FRAME)
            shapes += boxes(ends, left_vectors, size, bottom + FRAME)
        pane = (
            min(self.thickness * 0.6, PANE),
            panel_lengths - 1.9 * FRAME * frame_factors,
            panel_height - 1.9 * FRAME,
        )
        glass, frame = MATERIALS["glass"]
        panes = boxes(bay_middles, left_vectors, pane, bottom + 0.95 * FRAME)
        return [*(Body(shape, glass) for shape in panes), *(Body(shape, frame) for shape in shapes)]

    def footprint(self) -> Iterator[Block]:
        """Yield the box around panels and posts, in which nothing else may stand."""
        half_width = max(self.thickness, self.post_width) / 2.0
        yield self.strip(half_width, half_width, self.height)
