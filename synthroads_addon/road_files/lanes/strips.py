"""Which strip of a carriageway each lane of a file is, and which lanes are one along the road."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import InputError
from ...road.turnout_geometry import TURNOUT_STRIPS
from .records import SHORTEST, SIDES, FileLane, FileSection
from .surface import FileSurface, LaneEdges

DRIVEN = frozenset(
    {
        "driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bus", "taxi", "HOV",
        "bidirectional", "mwyEntry", "mwyExit", "special1", "special2", "special3", "roadWorks",
    }
)  # fmt: skip
"""Types of lanes that traffic drives on."""
_TURNING = frozenset({"entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "mwyEntry", "mwyExit"})
"""Types of driven lanes that lead off a road or onto it."""
PAVED = frozenset({"shoulder", "border", "stop", "parking", "biking", "restricted", "shared"})
"""Types of paved lanes beside the lanes that traffic drives on."""
_OWN = frozenset({"median", "inner_edge_strip", "lane", "outer_edge_strip", "hard_shoulder", "verge", *TURNOUT_STRIPS})
_MOST_LANES = 8
"""Lanes of one side that a parameter set can have."""
_MATCH = 0.5
"""Share of the narrower of two lanes that must lie beside the other for them to be one."""


@dataclass
class LaneSlot:
    """A lane of a carriageway along the road.

    Attributes:
        lanes: of the file, by the number of their section.
        kinds: types that they have there.
    """

    lanes: dict[int, FileLane] = field(default_factory=dict)

    @property
    def kinds(self) -> set[str]:
        """Return the types that the file gives it."""
        return {lane.type for lane in self.lanes.values()}


@dataclass
class SideLayout:
    """The lanes of one side of a road's line as strips of its carriageway.

    Attributes:
        sign: of the lanes' ids and offsets.
        slots: its lanes from the inside out.
        strips: of each section, lanes by the strip that they are: ``median``, ``inner_edge_strip``,
            ``outer_edge_strip``, ``hard_shoulder``, ``verge`` or one of the turnouts'; from the inside out.
        across: of each section, lanes of the other side that are paved and belong to its inner edge strip.
        lost: (section, lane, why) of lanes that no strip holds.
    """

    sign: int
    slots: list[LaneSlot] = field(default_factory=list)
    strips: dict[int, list[tuple[str, FileLane]]] = field(default_factory=dict)
    across: dict[int, tuple[FileLane, ...]] = field(default_factory=dict)
    lost: list[tuple[int, FileLane, str]] = field(default_factory=list)

    def of_strip(self, section: int, kind: str) -> list[FileLane]:
        """Return a section's lanes that are one strip, from the inside out."""
        return [lane for name, lane in self.strips.get(section, []) if name == kind]


def is_driven(lane: FileLane) -> bool:
    """Return whether traffic drives on a lane."""
    return lane.notes.get("strip") == "lane" if lane.notes.get("strip") in _OWN else lane.type in DRIVEN


def driven_sides(sections: Sequence[FileSection]) -> list[int]:
    """Return the signs of the sides with lanes that traffic drives on, left first."""
    return [sign for sign in SIDES if any(is_driven(lane) for section in sections for lane in section.lanes[sign])]


def foreign_turnouts(layout: SideLayout, sections: Sequence[FileSection]) -> list[tuple[float, float]]:
    """Return the stretches, stations of the file in m, along which lanes of a carriageway lead off or onto it."""
    stretches: list[tuple[float, float]] = []
    for number, section in enumerate(sections):
        lanes = [slot.lanes[number] for slot in layout.slots if number in slot.lanes]
        if any(lane.type in _TURNING and "strip" not in lane.notes for lane in lanes):
            if stretches and section.start - stretches[-1][1] <= SHORTEST:
                stretches[-1] = (stretches[-1][0], section.end)
            else:
                stretches.append((section.start, section.end))
    return stretches


def side_layouts(surface: FileSurface, with_median: bool = False) -> dict[int, SideLayout]:
    """Return the layout of each side that traffic drives on, by its sign.

    Args:
        surface: the file's.
        with_median: whether another road of the file is the carriageway on the other side, so that what lies there is
            the median.

    Raises:
        InputError: traffic drives on none; or a side has more than 8 lanes.
    """
    sections = surface.road.sections
    sides = driven_sides(sections)
    if not sides:
        place = f"road {surface.road.name!r}: lanes"
        raise InputError(place, None, "has no lane for traffic; --only-axis reads only the line of the road")
    layouts = {sign: SideLayout(sign) for sign in sides}
    for number, section in enumerate(sections):
        for sign, layout in layouts.items():
            driven_lanes = _sort_lanes(layout, number, section.lanes[sign])
            _chain(layout, number, surface, driven_lanes)
            if -sign not in layouts and not with_median:
                _take_across(layout, number, section.lanes[-sign])
    for layout in layouts.values():
        if len(layout.slots) > _MOST_LANES:
            side = "left" if layout.sign > 0 else "right"
            place = f"road {surface.road.name!r}: lanes on the {side}"
            raise InputError(
                place,
                len(layout.slots),
                f"must be at most {_MOST_LANES} lanes; --only-axis reads only the line of the road",
            )
    return layouts


def _sort_lanes(layout: SideLayout, number: int, lanes: Sequence[FileLane]) -> list[FileLane]:
    """Put a section's lanes of one side into strips, and return those that traffic drives on, from the inside out.

    Lanes of our own files say which strip they are; others are sorted by their types.
    """
    strips = layout.strips.setdefault(number, [])
    if any(lane.notes.get("strip") in _OWN for lane in lanes):
        for lane in lanes:
            kind = lane.notes.get("strip", "")
            if kind in _OWN and kind != "lane":
                strips.append((kind, lane))
            elif kind != "lane":
                layout.lost.append((number, lane, f"a {lane.type} lane among strips"))
        return [lane for lane in lanes if lane.notes.get("strip") == "lane"]
    driven_rows = [n for n, lane in enumerate(lanes) if is_driven(lane)]
    if not driven_rows:
        begin, end = len(lanes), len(lanes)
    else:
        begin, end = driven_rows[0], driven_rows[-1] + 1
    inner_lanes = list(lanes[:begin]) if driven_rows else []
    outer_lanes = list(lanes[end:]) if driven_rows else list(lanes)
    paved_from = len(inner_lanes)
    while paved_from and inner_lanes[paved_from - 1].type in PAVED:
        paved_from -= 1
    strips += [("median", lane) for lane in inner_lanes[:paved_from]]
    strips += [("inner_edge_strip", lane) for lane in inner_lanes[paved_from:]]
    strips += _outer_strips(layout, number, outer_lanes)
    return list(lanes[begin:end])


def _outer_strips(layout: SideLayout, number: int, lanes: Sequence[FileLane]) -> list[tuple[str, FileLane]]:
    """Return the strips outside of the lanes that traffic drives on: border, shoulder, verge, in this order.

    A border outside of all that is paved is the verge: other programs write grass as a border.
    """
    strips: list[tuple[str, FileLane]] = []
    outermost = 0  # strip reached so far: 0 edge strip, 1 hard shoulder, 2 verge
    has_stop_lane = False
    last_paved = max((n for n, lane in enumerate(lanes) if lane.type in PAVED - {"border"}), default=-1)
    for n, lane in enumerate(lanes):
        if lane.type == "border" and outermost == 0 and not strips:
            strips.append(("outer_edge_strip", lane))
            continue
        is_paved = lane.type in PAVED and not (has_stop_lane and lane.type == "shoulder")
        is_paved = is_paved and not (lane.type == "border" and n > last_paved)
        if outermost < 2 and is_paved:
            outermost, has_stop_lane = 1, has_stop_lane or lane.type == "stop"
            strips.append(("hard_shoulder", lane))
            continue
        if is_paved:
            layout.lost.append((number, lane, f"a {lane.type} lane outside of the verge"))
            continue
        outermost = 2
        strips.append(("verge", lane))
    return strips


def _take_across(layout: SideLayout, number: int, lanes: Sequence[FileLane]) -> None:
    """Give the paved lanes beyond the line to the inner edge strip of a carriageway without a counterpart there."""
    count = 0
    while count < len(lanes) and lanes[count].type in PAVED and lanes[count].notes.get("strip") != "median":
        count += 1
    layout.across[number] = tuple(lanes[:count])
    for lane in lanes[count:]:
        layout.lost.append((number, lane, f"a {lane.type} lane beside a single carriageway's inner edge"))


def _chain(layout: SideLayout, number: int, surface: FileSurface, lanes: Sequence[FileLane]) -> None:
    """Give each lane of a section to the slot that it continues, or to a free or new slot between its neighbours'."""
    slots_before = [(n, slot) for n, slot in enumerate(layout.slots) if number - 1 in slot.lanes]
    pairs = _matches(surface, number, layout.sign, [slot.lanes[number - 1] for _, slot in slots_before], lanes)
    slot_of_lane = {lane_row: slots_before[row][0] for row, lane_row in pairs}
    slot_number = -1
    for n, lane in enumerate(lanes):
        if n in slot_of_lane:
            slot_number = slot_of_lane[n]
        else:
            later_slots = [slot_of_lane[m] for m in range(n + 1, len(lanes)) if m in slot_of_lane]
            end = later_slots[0] if later_slots else len(layout.slots)
            free_slots = [m for m in range(slot_number + 1, end) if number not in layout.slots[m].lanes]
            if free_slots:
                slot_number = free_slots[0]
            else:
                slot_number += 1
                layout.slots.insert(slot_number, LaneSlot())
                slot_of_lane = {m: slot_row + (slot_row >= slot_number) for m, slot_row in slot_of_lane.items()}
        layout.slots[slot_number].lanes[number] = lane


def _matches(
    surface: FileSurface, number: int, sign: int, lanes_before: Sequence[FileLane], lanes_after: Sequence[FileLane]
) -> list[tuple[int, int]]:
    """Return pairs of rows (of `lanes_before`, of `lanes_after`) of lanes that go on over a section's start.

    Two lanes are one where most of the narrower lies beside the other. The pairs keep the lanes' order and have the
    largest sum of widths in common.
    """
    if not lanes_before or not lanes_after:
        return []
    section, section_before = surface.road.sections[number], surface.road.sections[number - 1]
    start_station = np.array([section.start])
    end_before = np.array([max(section.start - SHORTEST, section_before.start)])
    edges_before = {
        edges.lane.number: edges for edges in surface.lanes(section_before, start_station, end_before)[sign]
    }
    edges_after = {edges.lane.number: edges for edges in surface.lanes(section, start_station, start_station)[sign]}
    common_width = np.array(
        [[_common_width(edges_before[a.number], edges_after[b.number]) for b in lanes_after] for a in lanes_before]
    )
    # Longest common subsequence, weighted by the widths in common (Needleman and Wunsch, without gap costs).
    best_sum = np.zeros((len(lanes_before) + 1, len(lanes_after) + 1))
    for i in range(len(lanes_before)):
        for j in range(len(lanes_after)):
            best_sum[i + 1, j + 1] = max(best_sum[i, j] + common_width[i, j], best_sum[i, j + 1], best_sum[i + 1, j])
    # Traced back from the end of both.
    pairs, i, j = [], len(lanes_before), len(lanes_after)
    while i and j:
        if common_width[i - 1, j - 1] > 0.0 and np.isclose(
            best_sum[i, j], best_sum[i - 1, j - 1] + common_width[i - 1, j - 1]
        ):
            i, j = i - 1, j - 1
            pairs.append((i, j))
        elif best_sum[i - 1, j] >= best_sum[i, j - 1]:
            i -= 1
        else:
            j -= 1
    return pairs[::-1]


def _common_width(lane_edges: LaneEdges, other_edges: LaneEdges) -> float:
    """Return the width, m, that two lanes have in common; 0 where that is half of the narrower lane or less."""
    first_span, second_span = (
        sorted((float(edges.inner.offset[0]), float(edges.outer.offset[0]))) for edges in (lane_edges, other_edges)
    )
    overlap = min(first_span[1], second_span[1]) - max(first_span[0], second_span[0])
    narrower = min(first_span[1] - first_span[0], second_span[1] - second_span[0])
    return overlap if narrower > 1e-3 and overlap > _MATCH * narrower else 0.0
