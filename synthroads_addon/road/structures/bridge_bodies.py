"""The solids of a bridge: deck, caps, railings, barriers, joints, drainage, abutments with wing walls, piers.

Faces that coincide have no first hit: parts reach a little into each other, and into what hides them. Sizes without a
source are chosen after usual ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...base.arrays import Float, Index
from ..things.body import Body, Course, boxes, prism, sweep
from ..things.guardrail import Guardrail
from .kerbed import INNER, LEFT, NAMES, OUTER, PAVED, RIGHT, place_sections, section_rows

if TYPE_CHECKING:
    from .bridge import Bridge

SURFACING = 0.09
"""Asphalt and sealing on the deck, m (Cm: 8 cm on 0.5 to 1 cm)."""
DECK_INSIDE, DECK_EDGE, CANTILEVER = 0.2, 0.25, 2.0
"""From a cap's outer face to the deck's, thickness of the deck there, and length of its cantilevers, m."""
UNDER_CAP = 0.25
"""Depth of the deck's upper side at its edges below the pavement's edge, m: it reaches into the caps."""
FLANGE = 0.3
"""Thickness of the slab of T-beams and boxes, m; webs reach 5 cm into it."""
BEAM_SPACING, BEAM_WIDTH = 3.5, 0.6
"""Distance of T-beams at most, and their width, m."""
BOX_TOP, BOX_BOTTOM = 0.6, 0.45
"""Width of a box at its top and bottom, as shares of the deck's width above it."""
NARROW_MEDIAN, WIDEST_DECK = 1.0, 16.0
"""Width of a median from which each carriageway has a box and piers of its own, m; so they do on wider decks (m)."""
JOINT_GAP, JOINT_FILM, JOINT_DEPTH = 0.05, 0.002, 0.05
"""Gap between deck and back wall; height of a joint's band above the pavement, and depth below it, m."""
STEEL, RUBBER = ("galvanised_steel", 0.3), ("rubber", 0.4)
"""Materials of the three bands of a steel joint, and their shares of its width: steel, rubber, steel."""
SEAT, ABUTMENT, BEARING, BURIED = 0.9, 1.5, 0.1, 0.8
"""Depth of an abutment's seat before the joint and of its body behind it; height of bearings; depth of feet, m."""
BACK_WALL_TOP = 0.12
"""Depth of the back wall's top below the pavement, m."""
WING_THICKNESS, WING_INSIDE, WING_TOP = 0.5, 0.1, 0.2
"""Thickness of wing walls, from the cap's outer face to theirs, and their tops' depth below the pavement's edge, m."""
PIER_ROUND, PIER_SHARE = 8, 0.5
"""Points of a pier's rounded end, and its length as a share of the deck's width above it."""
RAILING_INSIDE, RAILING_POST_SPACING, RAILING_BAR_SPACING = 0.15, 2.0, 0.14
"""From a cap's outer face to the railing's axis, and distance of its posts and bars, m: gaps are below 14 cm."""
RAILING_POST, RAILING_BAR, RAILING_RAIL, RAILING_HAND, RAILING_LOWER = 0.06, 0.02, 0.04, (0.09, 0.06), 0.1
"""Thickness of a railing's posts, bars and lower rail, width and height of its handrail, lower rail's height, m."""
BARRIER_AXIS, BARRIER_TERMINAL = 0.7, 12.0
"""From the kerb to the posts' axis of a barrier, and length of its ramps before the caps' ends, m."""
H2_HEIGHT, H2_POSTS = 0.75, 2.0
"""Top of a guardrail's beam above the cap, and distance of its posts on a bridge, m."""
H4B_BEAM, H4B_POSTS, H4B_BOX = 0.81, 1.33, ((0.12, 0.16), 1.05)
"""Barriers H4b (Super-Rail): top of the W-beam whose middle is at 0.65 m, distance of posts (B: SRBW), section of the
box beam and height of its middle, m."""
GULLY, GULLY_FILM, PIPE, PIPE_DROP = (0.5, 0.3), 0.002, 0.2, 0.35
"""A gully's length and width, its height above the pavement; diameter of pipes, and the collector's depth below the
deck's underside at the cantilever's root, m."""
SLAB_TOP, SLAB_THICKNESS = 0.3, 0.3
"""Depth of an approach slab below the pavement, and its thickness, m."""
_OCTAGON = 8
_CONCRETE, _STEEL = "bridge_concrete", "galvanised_steel"


def bridge_bodies(bridge: Bridge, course: Course) -> list[Body]:
    """Return the closed solids of all parts of a bridge but its caps, in local coordinates."""
    if bridge.start_station >= course.length:
        return []
    deck = _Deck(bridge, course)
    return [
        *deck.bodies(),
        *(body for number, end in enumerate(_ENDS, 1) for body in _abutment(deck, f"abutment-{number}", end)),
        *(body for number, station in enumerate(bridge.pier_stations, 1) for body in _pier(deck, number, station)),
        *_railings(bridge, course),
        *_barriers(bridge, course),
        *_joints(bridge, course),
        *_drainage(deck),
        *_approach_slabs(bridge, course),
    ]


_ENDS = (-1.0, 1.0)
"""The ends of a bridge, at its lower and its higher station: the direction outwards."""


class _Deck:
    """The deck of a bridge in cross-sections.

    Attributes:
        bridge, course: as given.
        splits: whether each carriageway has a box and piers of its own.
    """

    def __init__(self, bridge: Bridge, course: Course) -> None:
        self.bridge, self.course = bridge, course
        middle = course.edges(np.array([min((bridge.start_station + bridge.end_station) / 2.0, course.length)]))[0]
        width, median = middle[0] - middle[5], middle[2] - middle[3]
        self.splits = bool(median >= NARROW_MEDIAN or width > WIDEST_DECK)

    def columns(self, station: Float) -> Float:
        """Return the offsets (N, 6) of its section's corners from the left, m: edges, cantilevers' roots, middle."""
        edges = self.course.edges(station)
        left, right = edges[:, 0] - DECK_INSIDE, edges[:, 5] + DECK_INSIDE
        root = np.minimum(CANTILEVER, (left - right) / 4.0)
        return np.stack([left, left - root, edges[:, 2], edges[:, 3], right + root, right], axis=1)

    def top(self, station: Float, columns: Float) -> Float:
        """Return the heights (N, 6) of its upper side at its section's corners, m."""
        edges = self.course.edges(station)
        heights = np.stack(
            [self.course.pavement(station, np.clip(columns[:, n], edges[:, 4], edges[:, 1])) for n in range(6)], axis=1
        )
        return heights - np.array([UNDER_CAP, *[SURFACING] * 4, UNDER_CAP])

    def depth(self) -> float:
        """Return the thickness of its slab between the cantilevers, m."""
        return self.bridge.deck_depth - SURFACING if self.bridge.superstructure == "slab" else FLANGE

    def underside(self, station: Float, columns: Float) -> Float:
        """Return the heights (N, 6) of its lower side at its section's corners, webs left out, m."""
        top = self.top(station, columns)
        depth = self.depth()
        return top - np.array([min(DECK_EDGE, depth), depth, depth, depth, depth, min(DECK_EDGE, depth)])

    def lowest(self, station: Float, offset: Float) -> Float:
        """Return the heights (N,) of the lowest underside at stations and offsets (N,), webs included, m."""
        return self.course.pavement(station, offset) - self.bridge.deck_depth

    def rows(self) -> Float:
        """Return the stations (R,) of its sections, m."""
        return section_rows(self.bridge, self.course, self.bridge.start_station, self.bridge.end_station)

    def spans(self, station: Float) -> list[tuple[Float, Float]]:
        """Return the left and right offsets (N,) of what its girders and piers carry: the whole, or each half, m."""
        columns = self.columns(station)
        if not self.splits:
            return [(columns[:, 0], columns[:, 5])]
        middle = (columns[:, 2] + columns[:, 3]) / 2.0
        return [(columns[:, 0], middle), (middle, columns[:, 5])]

    def bodies(self) -> Iterator[Body]:
        """Yield the solids of its slab and girders."""
        station, course = self.rows(), self.course
        if len(station) < 2:
            return
        columns = self.columns(station)
        offset = np.concatenate([columns, columns[:, ::-1]], axis=1)
        height = np.concatenate([self.top(station, columns), self.underside(station, columns)[:, ::-1]], axis=1)
        yield Body(place_sections(course, station, offset, height), _CONCRETE, "deck", "IfcSlab.FLOOR")
        if self.bridge.superstructure == "slab" or self.bridge.deck_depth <= FLANGE + SURFACING:
            return
        for number, (left, right) in enumerate(self._girders(station), 1):
            corners = np.stack([left[0], right[0], right[1], left[1]], axis=1)
            upper = course.pavement(station, (left[0] + right[0]) / 2.0) - SURFACING - FLANGE + 0.05
            lower = self.lowest(station, (left[0] + right[0]) / 2.0)
            heights = np.stack([upper, upper, lower, lower], axis=1)
            kind = "IfcBeam.T_BEAM" if self.bridge.superstructure == "beams" else "IfcBeam.GIRDER_SEGMENT"
            yield Body(place_sections(course, station, corners, heights), _CONCRETE, f"girder-{number}", kind)

    def _girders(self, station: Float) -> Iterator[tuple[tuple[Float, Float], tuple[Float, Float]]]:
        """Yield the left and right offsets (N,) of webs or boxes, each at its top and its bottom, m."""
        for left, right in self.spans(station):
            middle, width = (left + right) / 2.0, left - right
            if self.bridge.superstructure == "box":
                yield tuple(  # type: ignore[misc]
                    (middle + side * width * BOX_TOP / 2.0, middle + side * width * BOX_BOTTOM / 2.0)
                    for side in (1.0, -1.0)
                )
                continue
            inner = width - 2.0 * np.minimum(CANTILEVER, width / 4.0)
            count = max(2, math.ceil(float(inner.max()) / BEAM_SPACING) + 1)
            for number in range(count):
                axis = middle + inner * (0.5 - number / (count - 1.0))
                yield (axis + BEAM_WIDTH / 2.0,) * 2, (axis - BEAM_WIDTH / 2.0,) * 2


def _abutment(deck: _Deck, name: str, end: float) -> Iterator[Body]:
    """Yield the solids of an abutment: its body with the seat, its back wall, and both wing walls."""
    bridge, course = deck.bridge, deck.course
    joint = bridge.start_station if end < 0.0 else bridge.end_station
    tip = bridge.cap_start if end < 0.0 else bridge.cap_end
    station = np.sort([joint - end * SEAT, joint, joint + end * ABUTMENT])
    tip, station = float(np.clip(tip, 0.0, course.length)), np.unique(np.clip(station, 0.0, course.length))
    if len(station) < 2:
        return
    columns = deck.columns(station)
    ground = np.stack([course.ground(station, columns[:, n]) for n in range(6)], axis=1)
    foot = np.full(columns.shape, float(ground.min()) - BURIED)
    lowest = np.stack([deck.lowest(station, columns[:, n]) for n in range(6)], axis=1)
    seat = np.minimum(lowest, deck.underside(station, columns)) - BEARING
    offset = np.concatenate([columns, columns[:, ::-1]], axis=1)

    def body(rows: Index, top: Float) -> Body:
        """Return a solid between two rows of the stations with a top (N, 6), down to the foot."""
        heights = np.concatenate([np.maximum(top, foot + 0.1), foot], axis=1)[rows]
        shape = place_sections(course, station[rows], offset[rows], heights)
        return Body(shape, _CONCRETE, name, "IfcWall.RETAININGWALL")

    yield body(np.arange(len(station)), seat)
    back = np.sort(np.clip([joint + end * JOINT_GAP, joint + end * (ABUTMENT - JOINT_GAP)], 0.0, course.length))
    columns = deck.columns(back)
    top = np.stack([course.pavement(back, columns[:, n]) for n in range(6)], axis=1) - BACK_WALL_TOP
    top[:, [0, 5]] = deck.top(back, columns)[:, [0, 5]]
    bottom = np.full(top.shape, float(seat.min()) - 0.05)
    offset = np.concatenate([columns, columns[:, ::-1]], axis=1)
    shape = place_sections(course, back, offset, np.concatenate([top, bottom], axis=1))
    if back[1] > back[0]:
        yield Body(shape, _CONCRETE, name, "IfcWall.RETAININGWALL")
    yield from _wings(deck, name, (tip, float(np.clip(joint + end * JOINT_GAP, 0.0, course.length))))


def _wings(deck: _Deck, name: str, ends: tuple[float, float]) -> Iterator[Body]:
    """Yield the solids of both wing walls of an abutment between two stations (m)."""
    bridge, course = deck.bridge, deck.course
    station = section_rows(bridge, course, *sorted(ends))
    if len(station) < 2:
        return
    edges = course.edges(station)
    for side in (LEFT, RIGHT):
        face = edges[:, OUTER[side]] - side * WING_INSIDE
        rear = face - side * WING_THICKNESS
        edge = course.pavement(station, edges[:, PAVED[side]])
        top = edge - WING_TOP
        foot = np.minimum(course.ground(station, edges[:, OUTER[side]] + side * 0.01), top) - BURIED
        offset = np.stack([face, face, rear, rear], axis=1)
        shape = place_sections(course, station, offset, np.stack([foot, top, top, foot], axis=1))
        yield Body(shape, _CONCRETE, name, "IfcWall.RETAININGWALL")


def _pier(deck: _Deck, number: int, station: float) -> Iterator[Body]:
    """Yield the solids of the piers at a station, one below each carriageway or one in all, and their bearings."""
    bridge, course = deck.bridge, deck.course
    if station > course.length:
        return
    at = np.array([station])
    left_vector = course.left(at)[0]
    forward = np.array([left_vector[1], -left_vector[0], 0.0])
    for left, right in deck.spans(at):
        middle, width = (left + right) / 2.0, float((left - right)[0])
        half, thickness = max(width * PIER_SHARE / 2.0 - bridge.pier_width / 2.0, 0.05), bridge.pier_width
        angles = np.pi * np.arange(PIER_ROUND) / (PIER_ROUND - 1.0)
        end = thickness / 2.0 * np.column_stack([np.cos(angles), np.sin(angles)]) + (0.0, half)
        outline = np.concatenate([end, -end])
        ends = middle + np.array([-1.0, 0.0, 1.0]) * (half + thickness / 2.0)
        at_ends = np.full(3, station)
        top = float(deck.lowest(at_ends, ends).min()) - BEARING
        foot = float(course.ground(at_ends, ends).min()) - BURIED
        if top - foot < BURIED:
            continue
        origin = course.feet(at, middle)[0] * (1.0, 1.0, 0.0)

        def local(sections: Float, origin: Float = origin) -> Float:
            """Return sections of a pier's frame, x along the road and y to its left, in local coordinates."""
            return (
                origin
                + sections[..., :1] * forward
                + sections[..., 1:2] * left_vector
                + sections[..., 2:] * (0.0, 0.0, 1.0)
            )

        name = f"pier-{number}"
        yield Body(local(prism(outline, foot, top)), _CONCRETE, name, "IfcColumn.PIERSTEM")
        for y in (-half, half):
            # A bearing reaches from the pier's top to the underside above it.
            under = float(deck.lowest(at, middle + y)[0])
            pad = np.array([(-0.3, y - 0.3), (0.3, y - 0.3), (0.3, y + 0.3), (-0.3, y + 0.3)])
            yield Body(local(prism(pad, top - 0.02, under + 0.02)), _STEEL, name, "IfcColumn.PIERSTEM", BEARING)


def _railings(bridge: Bridge, course: Course) -> Iterator[Body]:
    """Yield the solids of the railings along both edges; infill bars are fittings."""
    height = bridge.railing_height
    station = section_rows(bridge, course, bridge.cap_start, bridge.cap_end)
    if height <= RAILING_LOWER + RAILING_HAND[1] or len(station) < 2:
        return
    (hand_width, hand_height), bar_top = RAILING_HAND, height - RAILING_HAND[1] / 2.0
    for side in (LEFT, RIGHT):
        name = f"railing-{NAMES[side]}"

        def axis(at: Float, side: float = side) -> tuple[Float, Float]:
            """Return the points below the railing at stations (N,), and the vectors to the left there."""
            offset = course.edges(at)[:, OUTER[side]] - side * RAILING_INSIDE
            return course.feet(at, offset), course.left(at)

        feet, left = axis(station)
        for width, low, high in (
            (hand_width, height - hand_height, height),
            (RAILING_RAIL, RAILING_LOWER - RAILING_RAIL, RAILING_LOWER),
        ):
            across = np.array([0.5, 0.5, -0.5, -0.5]) * width
            shape = sweep(feet, left, across, np.array([low, high, high, low]))
            yield Body(shape, _STEEL, name, "IfcRailing.BALUSTRADE")
        start, end = float(station[0]) + RAILING_POST, float(station[-1]) - RAILING_POST
        posts = np.linspace(start, end, max(2, math.ceil((end - start) / RAILING_POST_SPACING) + 1))
        size = (RAILING_POST, RAILING_POST, bar_top + RAILING_LOWER)
        for shape in boxes(*axis(posts), size, -RAILING_LOWER):
            yield Body(shape, _STEEL, name, "IfcRailing.BALUSTRADE")
        bars = np.linspace(start, end, max(2, math.ceil((end - start) / RAILING_BAR_SPACING) + 1))[1:-1]
        size = (RAILING_BAR, RAILING_BAR, bar_top - RAILING_LOWER + RAILING_RAIL / 2.0)
        for shape in boxes(*axis(bars), size, RAILING_LOWER - RAILING_RAIL / 2.0):
            yield Body(shape, _STEEL, name, "IfcRailing.BALUSTRADE", RAILING_BAR)


def _barriers(bridge: Bridge, course: Course) -> Iterator[Body]:
    """Yield the solids of the bridge's own barriers on its outer caps, from wing wall to wing wall."""
    if bridge.barrier == "none":
        return
    height, spacing = (H2_HEIGHT, H2_POSTS) if bridge.barrier == "h2" else (H4B_BEAM, H4B_POSTS)
    for side in (LEFT, RIGHT):
        name = f"barrier-{NAMES[side]}"

        def axis(station: Float, side: float = side) -> Float:
            """Return the offsets (N,) of the posts' axis at stations (N,), m."""
            return course.edges(station)[:, PAVED[side]] + side * BARRIER_AXIS

        def feet(station: Float, offset: Float, axis: Callable[[Float], Float] = axis) -> Float:
            """Return surface points (N, 3) at distances (N,) from the axis."""
            return course.feet(station, offset + axis(station))

        rail = Guardrail(
            instance=1,
            start_station=max(bridge.cap_start - BARRIER_TERMINAL, 0.0),
            end_station=min(bridge.cap_end + BARRIER_TERMINAL, course.length),
            offset=0.0,
            faces="right" if side > 0.0 else "left",
            height=height,
            post_spacing=spacing,
            terminal_length=BARRIER_TERMINAL,
        )
        for body in rail.bodies(replace(course, feet=feet)):
            yield replace(body, part=name, ifc="IfcRailing.GUARDRAIL")
        if bridge.barrier == "h4b":
            yield from _box_beam(bridge, course, name, axis)


def _box_beam(bridge: Bridge, course: Course, name: str, axis: Callable[[Float], Float]) -> Iterator[Body]:
    """Yield the solids of a box beam above a barrier's posts, and of the posts that carry it."""
    (width, depth), middle = H4B_BOX
    start, end = max(bridge.cap_start, 0.0), min(bridge.cap_end, course.length)
    station = section_rows(bridge, course, start, end)
    across = np.array([0.5, 0.5, -0.5, -0.5]) * width
    shape = sweep(
        course.feet(station, axis(station)),
        course.left(station),
        across,
        middle + np.array([-0.5, 0.5, 0.5, -0.5]) * depth,
    )
    yield Body(shape, _STEEL, name, "IfcRailing.GUARDRAIL")
    first = max(bridge.cap_start - BARRIER_TERMINAL, 0.0)
    posts = first + H4B_POSTS * np.arange(
        math.ceil((start - first) / H4B_POSTS), math.floor((end - first) / H4B_POSTS) + 1
    )
    low = H4B_BEAM - 0.1
    size = (0.08, 0.05, middle - depth / 2.0 + 0.02 - low)
    for shape in boxes(course.feet(posts, axis(posts)), course.left(posts), size, low):
        yield Body(shape, _STEEL, name, "IfcRailing.GUARDRAIL")


def _joints(bridge: Bridge, course: Course) -> Iterator[Body]:
    """Yield the bands of the expansion joints across the pavements at both ends, a film above the pavement."""
    if bridge.joint == "none":
        return
    bands = [("mastic_asphalt", 1.0)] if bridge.joint == "asphalt" else [STEEL, RUBBER, STEEL]
    for number, joint in enumerate((bridge.start_station, bridge.end_station), 1):
        begin = joint - bridge.joint_width / 2.0
        for material, share in bands:
            end = begin + share * bridge.joint_width
            for left, right in ((PAVED[LEFT], INNER[LEFT]), (INNER[RIGHT], PAVED[RIGHT])):
                shape = _film(course, (begin, end), (left, right))
                if shape is not None:
                    kind = "IfcDiscreteAccessory.EXPANSION_JOINT_DEVICE"
                    yield Body(shape, material, f"joint-{number}", kind)
            begin = end


def _film(course: Course, ends: tuple[float, float], columns: tuple[int, int]) -> Float | None:
    """Return the sections of a film between two stations from one of the pavement's edges to another, None off it."""
    if ends[0] < 0.0 or ends[1] > course.length:
        return None
    edges = course.edges(np.array(ends))[:, columns]
    count = max(2, math.ceil(float((edges[:, 0] - edges[:, 1]).max()) / 0.25) + 1)
    share = np.linspace(0.0, 1.0, count)
    corners = []
    for row in (0, 1):
        station = np.full(count, ends[row])
        offset = edges[row, 0] + share * (edges[row, 1] - edges[row, 0])
        corners.append(course.feet(station, offset))
    up = np.array([0.0, 0.0, 1.0])
    first, last = corners
    return np.stack(
        [first - JOINT_DEPTH * up, first + JOINT_FILM * up, last + JOINT_FILM * up, last - JOINT_DEPTH * up], axis=1
    )


def _drainage(deck: _Deck) -> Iterator[Body]:
    """Yield gullies beside the kerbs, the pipes below them, and the collector along the cantilever of either side."""
    bridge, course = deck.bridge, deck.course
    if not bridge.drain_spacing:
        return
    start, end = bridge.start_station + SEAT + 1.0, min(bridge.end_station, course.length) - SEAT - 1.0
    if end - start < 2.0:
        return
    count = max(1, round((end - start) / bridge.drain_spacing))
    station = start + (np.arange(count) + 0.5) * (end - start) / count
    along = section_rows(bridge, course, start, end)
    angle = 2.0 * np.pi * np.arange(_OCTAGON) / _OCTAGON
    for side in (LEFT, RIGHT):

        def axis(at: Float, side: float = side) -> Float:
            """Return the offsets (N,) of the gullies' middles at stations (N,), m."""
            return course.edges(at)[:, PAVED[side]] - side * (GULLY[1] / 2.0 + 0.02)

        def pipe_height(at: Float, side: float = side) -> Float:
            """Return the heights (N,) of the collector's axis at stations (N,), m."""
            columns = deck.columns(at)
            root = 1 if side > 0.0 else 4
            return np.minimum(
                deck.underside(at, columns)[:, root], deck.underside(at, columns)[:, 0 if side > 0 else 5]
            )

        feet, left = course.feet(station, axis(station)), course.left(station)
        for shape in boxes(feet, left, (GULLY[1], GULLY[0], GULLY_FILM + JOINT_DEPTH), -JOINT_DEPTH):
            yield Body(shape, _STEEL, f"drainage-{NAMES[side]}", "IfcWasteTerminal.GULLYSUMP")
        low = pipe_height(station) - PIPE_DROP
        size = (PIPE / 2.0, PIPE / 2.0, feet[:, 2] - JOINT_DEPTH + 0.01 - low)
        for shape in boxes(feet, left, size, low - feet[:, 2]):
            yield Body(shape, _STEEL, f"pipes-{NAMES[side]}", "IfcPipeSegment.RIGIDSEGMENT")
        axis_points = course.feet(along, axis(along))
        axis_points[:, 2] = pipe_height(along) - PIPE_DROP
        across, rise = PIPE / 2.0 * np.cos(angle), PIPE / 2.0 * np.sin(angle)
        # Corner i faces the last but i: half a step between the first and the last.
        half = np.pi / _OCTAGON
        across, rise = PIPE / 2.0 * np.cos(angle + half), PIPE / 2.0 * np.sin(angle + half)
        shape = sweep(axis_points, course.left(along), across, rise)
        yield Body(shape, _STEEL, f"pipes-{NAMES[side]}", "IfcPipeSegment.RIGIDSEGMENT")


def _approach_slabs(bridge: Bridge, course: Course) -> Iterator[Body]:
    """Yield the slabs that lie below the pavement before both ends."""
    length = bridge.approach_slab_length
    if not length:
        return
    for number, (joint, end) in enumerate(((bridge.start_station, -1.0), (bridge.end_station, 1.0)), 1):
        ends = sorted((joint + end * ABUTMENT, joint + end * (ABUTMENT + length)))
        station = section_rows(bridge, course, *ends)
        if len(station) < 2:
            continue
        edges = course.edges(station)[:, 1:5]
        top = np.stack([course.pavement(station, edges[:, n]) for n in range(4)], axis=1) - SLAB_TOP
        offset = np.concatenate([edges, edges[:, ::-1]], axis=1)
        height = np.concatenate([top, top[:, ::-1] - SLAB_THICKNESS], axis=1)
        shape = place_sections(course, station, offset, height)
        yield Body(shape, _CONCRETE, f"approach-slab-{number}", "IfcSlab.APPROACH_SLAB")
