"""Entrances to fields, and mouths of farm tracks: an apron that joins the pavement, over the ditch, which is piped."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Place, box, circle
from .limits import Interval, Limits, interval, share
from .thing import Block, StandingThing, TwinTypes

SURFACES = {"gravel": "gravel", "asphalt": "asphalt", "concrete": "concrete"}
"""Surface of a track -> its material."""
COVER = 0.04
"""Least height of a track above the ground that it lies on, m. Chosen: above the ground's roughness."""
RISE = 0.6
"""Distance from the pavement's edge, m, over which a track rises to that height. Chosen."""
_ROW, _COLUMNS = 0.5, 12
"""Longest piece of a track along the road, m, and its pieces away from it. Chosen."""
_FLARE_ROWS, _FLARE_COLUMNS = 8, 6
"""Pieces of a rounded corner along the road and away from it. Chosen."""
_SIDE_ROWS = 4
_NARROWEST = 0.02
"""Reach of a corner's last section, m: a solid has no edge without a width."""
BATTER = 1.5
"""Run of the earth beside a track per metre of height."""
_LARGEST_BATTER = 3.0
"""Height of that earth, m, at most."""
_LOWER = 0.03
"""Depth of that earth's top below the track's edge, m."""
LAYER = 0.015
"""Step from the asphalt near the road down to the rest of a track, m. Chosen: half a thin layer."""
PIPE_WALL, PIPE_SIDES = 0.06, 16
"""Thickness of a pipe's wall, m, and corners of its section."""
PIPE_HOLLOW, PIPE_SUNK, PIPE_OUT = 0.6, 0.03, 0.15
"""Depth to which an end is hollow, to which the pipe lies in the ditch's bottom, and length that stands out, m."""
WALL_THICKNESS, WALL_REACH, WALL_BELOW = 0.2, 0.45, 0.05
"""Thickness of a head wall, how far it reaches beside the pipe, and its top below the track's edge, m."""
_WALL_APART = 0.35
"""From the track's edge to the middle of a head wall, m."""


class FieldEntranceLimits(Limits):
    """Limits of field entrances and farm tracks."""

    place: ClassVar = 90
    allowed: ClassVar = {
        "entrances_per_km": (0.0, 40.0),
        "entrance_width": "width",
        "entrance_radius": "radius",
        "entrance_depth": "depth",
        "entrance_pipe": (0.3, 1.5),
    }

    entrances_per_km: Interval = interval(
        0.0, 0.0, "1/km", "Entrances to fields, and farm tracks, per km of either side.", title="Entrances (per km)"
    )
    entrance_width: Interval = interval(3.5, 6.0, "m", "Width of entrances and tracks.", title="Entrances' Width")
    entrance_radius: Interval = interval(2.0, 5.0, "m", "Radius of their corners at the road.", title="Corner Radius")
    entrance_depth: Interval = interval(
        7.0, 25.0, "m", "Length from the pavement that is built of them.", title="Length from the Road"
    )
    entrance_pipe: Interval = interval(0.3, 0.5, "m", "Diameter of the pipe below them.", title="Culverts")
    tracks: float = share(0.3, "Probability that an entrance is the mouth of a paved farm track.", title="Paved Tracks")
    head_walls: float = share(0.4, "Probability that a culvert's ends have walls.", title="Head Walls")


class FieldEntrance(StandingThing):
    """A field's entrance, or a track's mouth. Its offset is that of the paved edge; it lies to its traffic's right."""

    points_class: ClassVar = "roadside"
    order: ClassVar = 148
    limits: ClassVar = FieldEntranceLimits
    clearing: ClassVar = 0.6
    type: Literal["FieldEntrance"] = "FieldEntrance"
    surface: Literal["gravel", "asphalt", "concrete"] = Field("gravel", description="Surface of the track.")
    width: float = quantity(4.5, "m", "Width of the track.", (2, 12))
    radius: float = quantity(3.0, "m", "Radius of its corners at the road.", (0.5, 15))
    depth: float = quantity(10.0, "m", "Length from the pavement that is built.", (3, 40))
    paved_depth: float = quantity(3.0, "m", "Length from the pavement that has a surface of asphalt.", (0, 40))
    curvature: float = quantity(
        0.0, "1/m", "Curvature of the paved edge, positive where its ends lie farther from the track.", (-0.1, 0.1)
    )
    curvature_change: float = quantity(
        0.0, "1/m2", "Change of that curvature for each metre along its traffic.", (-0.01, 0.01)
    )
    pipe_diameter: float = quantity(0.4, "m", "Inner diameter of the pipe in the ditch; 0 for none.", (0, 1.5))
    pipe_distance: float = quantity(3.0, "m", "From the paved edge to the pipe.", (0.5, 30))
    head_walls: Annotated[bool, Field(strict=True)] = Field(False, description="Its pipe's ends are in walls.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a part of the roadside."""
        return TwinTypes("IfcPavement.FLEXIBLE", "none.fieldEntrance", kind="field entrance")

    def reach(self) -> float:
        """Return how far it reaches along the road to either side of its station, m, its earth left out."""
        return self.width / 2.0 + self.radius

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of track, corners, earth beside it, pipe and head walls, in its frame."""
        half, material = self.width / 2.0, SURFACES[self.surface]
        paved = min(self.paved_depth, self.depth)
        if self.surface == "asphalt" or paved < RISE or paved > self.depth - RISE:
            parts = [(0.0, self.depth, "asphalt" if paved > self.depth - RISE else material)]
        else:
            parts = [(0.0, paved, "asphalt"), (paved, self.depth, material)]
        rows = np.linspace(-half, half, max(2, int(np.ceil(self.width / _ROW)) + 1))
        columns = np.linspace(0.0, self.depth, _COLUMNS + 1)
        bodies = []
        for number, (start, end, name) in enumerate(parts):
            distances = np.unique(np.concatenate([[start], columns[(columns > start) & (columns < end)], [end]]))
            reaches = np.broadcast_to(distances, (len(rows), len(distances)))
            slab = self._slab(place, rows, reaches, -LAYER if number else 0.0)
            bodies.append(Body(slab, name, ("track", "field track")[number]))
        bodies += [Body(self._corner(place, side), parts[0][2], "corner") for side in (-1.0, 1.0)]
        bodies += [Body(solid, "grass_ground", "earth") for side in (-1.0, 1.0) for solid in self._earth(place, side)]
        if self.pipe_diameter > 0.0:
            bodies += self._culvert(place)
        return bodies

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its track and its corners, in which nothing else may stand."""
        s, d, z, half = self.station, self.offset, self.elevation, self.width / 2.0
        outwards = 1.0 if abs(self.rotation_deg) > _ACROSS else -1.0
        corner = half + self.radius
        for reach, depth in ((half, self.depth), (corner, self.radius)):
            low, high = sorted((d, d + outwards * depth))
            yield Block("foot", s - reach, s + reach, low, high, z, z + 0.1)

    def top(self, place: Place, y: Float, distance: Float) -> Float:
        """Return the heights (N,) of the track's surface, m, in its frame.

        From the pavement's edge it runs straight to the ground at its end, but never below the ground on its way.

        Args:
            place: ground and pavement around it.
            y: (N,) along the road, m.
            distance: (N,) from the paved edge, m.
        """
        edge_x = self._edge(y)
        edge = place.ground(edge_x, y)
        far_end = float(place.ground(np.array([self.depth]), np.zeros(1))[0]) + COVER
        foot = float(place.ground(np.zeros(1), np.zeros(1))[0])
        line = edge + (far_end - foot) * distance / self.depth
        lying = place.ground(edge_x + distance, y) + COVER * np.clip(distance / RISE, 0.0, 1.0)
        return np.where(distance > 0.0, np.maximum(line, lying), edge)

    def _edge(self, y: Float) -> Float:
        """Return the x (N,) of the pavement's edge at y (N,), m."""
        return -self.curvature * y**2 / 2.0 - self.curvature_change * y**3 / 6.0

    def _slab(self, place: Place, y: Float, distance: Float, raised: float = 0.0) -> Float:
        """Return the sections (R, 2 C, 3) of a track at y (R,), whose corners lie at distances (R, C), raised, m."""
        y_grid = np.broadcast_to(y[:, None], distance.shape)
        x_grid = self._edge(y_grid) + distance
        flat = y_grid.ravel(), distance.ravel()
        top = self.top(place, *flat).reshape(distance.shape) + raised
        ground = place.ground(x_grid.ravel(), flat[0]).reshape(distance.shape)
        bottom = np.minimum(top, ground) - BURIED
        upper, lower = (np.stack([x_grid, y_grid, z], axis=-1) for z in (top, bottom))
        return np.concatenate([upper, lower[:, ::-1]], axis=1)

    def _corner(self, place: Place, side: float) -> Float:
        """Return the sections of a rounded corner: as deep as its radius beside the track, and 0 at its end."""
        share = np.linspace(0.0, 1.0, _FLARE_ROWS + 1)
        angle = share * np.pi / 2.0
        beside, reach = self.radius * (1.0 - np.cos(angle)), self.radius * (1.0 - np.sin(angle))
        order = np.argsort(side * beside)
        y = side * (self.width / 2.0 + beside)
        distance = np.maximum(reach, _NARROWEST)[:, None] * np.linspace(0.0, 1.0, _FLARE_COLUMNS + 1)
        return self._slab(place, y[order], distance[order])

    def _earth(self, place: Place, side: float) -> Iterator[Float]:
        """Yield the sections of the earth that falls from a track's side to the ground, beside a head wall in two."""
        edge_y, first = side * self.width / 2.0, 2.0 * RISE
        spans = [(first, self.depth)]
        if self.pipe_diameter > 0.0 and self.head_walls:
            half_wall = self.pipe_diameter / 2.0 + WALL_REACH
            spans = [(first, self.pipe_distance - half_wall), (self.pipe_distance + half_wall, self.depth)]
        for start, end in spans:
            if end - start < RISE:
                continue
            distance = np.linspace(start, end, _COLUMNS + 1)
            y_edge = np.full(distance.shape, edge_y)
            top = self.top(place, y_edge, distance) - _LOWER
            x = self._edge(y_edge) + distance
            height = float(np.max(top - place.ground(x, y_edge)))
            if height <= 0.0:
                continue
            beside = np.linspace(0.0, BATTER * min(height, _LARGEST_BATTER) + BURIED, _SIDE_ROWS + 1)
            rows = []
            for distance_beside in beside.tolist():
                y = y_edge + side * distance_beside
                upper = top - distance_beside / BATTER
                lower = np.minimum(place.ground(x, y), upper) - BURIED
                section = [np.column_stack([x, y, upper]), np.column_stack([x, y, lower])[::-1]]
                rows.append(np.concatenate(section))
            yield np.stack(rows if side > 0.0 else rows[::-1])

    def pipe_end(self, place: Place) -> float:
        """Return how far from its station the pipe's ends lie along the road, m: where the earth leaves them free."""
        half = self.width / 2.0
        if self.head_walls:
            return half + _WALL_APART + WALL_THICKNESS / 2.0 + PIPE_OUT
        y = np.array([-half, half])
        distance = np.full(2, self.pipe_distance)
        top = self.top(place, y, distance)
        bottom = place.ground(self._edge(y) + distance, y) + self.pipe_diameter / 2.0
        return half + BATTER * float(np.clip(np.max(top - bottom), 0.0, _LARGEST_BATTER)) + PIPE_OUT

    def _culvert(self, place: Place) -> list[Body]:
        """Return the pipe, hollow at its ends, and its head walls."""
        end = self.pipe_end(place)
        y = np.array([-end, end])
        x = self._edge(y) + self.pipe_distance
        z = place.ground(x, y) + self.pipe_diameter / 2.0 - PIPE_SUNK
        inner, outer = self.pipe_diameter, self.pipe_diameter + 2.0 * PIPE_WALL
        hollow = min(PIPE_HOLLOW, 0.4 * end)
        rings = [
            (inner, -end + hollow),
            (inner, -end),
            (outer, -end),
            (outer, end),
            (inner, end),
            (inner, end - hollow),
        ]
        sections = []
        for diameter, at in rings:
            share = (at + end) / (2.0 * end)
            ring = circle(diameter, PIPE_SIDES)
            middle_x, middle_z = x[0] + share * (x[1] - x[0]), z[0] + share * (z[1] - z[0])
            sections.append(np.column_stack([middle_x + ring[:, 0], np.full(len(ring), at), middle_z - ring[:, 1]]))
        bodies = [Body(np.stack(sections), "concrete", "pipe")]
        if not self.head_walls:
            return bodies
        half_wall = inner / 2.0 + WALL_REACH
        for side, foot in ((-1.0, z[0]), (1.0, z[1])):
            middle_y = side * (self.width / 2.0 + _WALL_APART)
            edge = np.array([side * self.width / 2.0])
            top = float(self.top(place, edge, np.array([self.pipe_distance]))[0]) - WALL_BELOW
            top = max(top, float(foot) + outer / 2.0 + WALL_BELOW)
            low = float(foot) - outer / 2.0 - BURIED
            middle = (float(self._edge(edge)[0]) + self.pipe_distance, middle_y, (top + low) / 2.0)
            bodies.append(Body(box((2.0 * half_wall, WALL_THICKNESS, top - low), middle), "concrete", "head wall"))
        return bodies


_ACROSS = 90.0
"""Rotation (deg) beyond which a thing's right is the road's left."""
