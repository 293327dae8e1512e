"""Line markings as road marks of the lanes whose outer borders they follow."""

from dataclasses import dataclass

from ...road.geometry import RoadGeometry
from ...road.guidelines import is_single
from ...road.objects import Side
from ...road.section import LineMarking
from .pieces import CLOSE
from .sections import LanePlan, LaneSection
from .xml import Element, add_object_data, element

_OUTWARDS = {"outer_edge": 0.5, "block": 0.5, "turnout_edge": 0.5, "inner_edge": -0.5, "gore_edge": -0.5}
"""Kind of a line -> where its axis lies from its border, outwards, in widths."""


@dataclass(frozen=True)
class _Stretch:
    """The stretch of a line marking along one lane's outer border within one lane section.

    Attributes:
        name, line: its id and itself.
        start, end: stations, m.
        side: of the carriageway.
    """

    name: str
    line: LineMarking
    start: float
    end: float
    side: Side

    @property
    def cut_dash(self) -> tuple[float, float]:
        """Return the length of the dash that is cut at the start (0: none) and the distance to the next dash, m."""
        line = self.line
        period = line.dash_length + line.gap_length
        if period == 0.0:
            return self.end - self.start, 0.0
        position_in_period = (self.start - line.start_station) % period
        if period - position_in_period < CLOSE or position_in_period < CLOSE:
            return 0.0, 0.0
        return max(0.0, line.dash_length - position_in_period), period - position_in_period


class RoadMarks:
    """Line markings of a road's carriageways, assigned to the lanes whose outer borders they follow.

    Attributes:
        loose: (id, line, start, end) of lines, or parts of them, that follow no lane's border or one that has a line.
    """

    def __init__(self, plan: LanePlan) -> None:
        self._plan = plan
        self._of: dict[tuple[int, int], list[_Stretch]] = {}
        self.loose: list[tuple[str, LineMarking, float, float]] = []
        for name, line in plan.geometry.parameters.of_type(LineMarking).items():
            side = plan.geometry.parameters.carriageway_of(line).side
            if side in plan.frame.sides:
                self._place(name, line, side)
        for stretches in self._of.values():
            stretches.sort(key=lambda item: item.start)

    def _place(self, name: str, line: LineMarking, side: Side) -> None:
        """Divide a line among the lane sections, each stretch to the lane it borders or else to the loose lines."""
        start, end = line.start_station, min(line.end_station, self._plan.geometry.length)
        if end - start <= CLOSE:
            return
        index = _border_strip(self._plan.geometry, side, line)
        for number, section in enumerate(self._plan.sections):
            stretch_start, stretch_end = max(start, section.start), min(end, section.end)
            if stretch_end - stretch_start <= CLOSE:
                continue
            if index is None or not self._assign(_Stretch(name, line, stretch_start, stretch_end, side), number, index):
                self._let_loose(name, line, stretch_start, stretch_end)

    def _assign(self, stretch: _Stretch, number: int, index: int) -> bool:
        """Assign a stretch to the outer border of a strip; return False if another line is there already."""
        section: LaneSection = self._plan.sections[number]
        sign = 1 if stretch.side == "left" else -1
        stretches = self._of.setdefault((number, sign * section.lane_number(stretch.side, index)), [])
        if any(stretch.start < other.end - CLOSE and other.start < stretch.end - CLOSE for other in stretches):
            return False
        stretches.append(stretch)
        return True

    def _let_loose(self, name: str, line: LineMarking, start: float, end: float) -> None:
        """Add a stretch (stations, m) to the loose lines, joined to the stretch of the same line that ends there."""
        if self.loose and self.loose[-1][0] == name and start - self.loose[-1][3] <= CLOSE:
            start = self.loose.pop()[2]
        self.loose.append((name, line, start, end))

    def write(self, lane: Element, number: int, lane_id: int) -> None:
        """Add the `roadMark` elements of one lane in a lane section, with type `none` in gaps between lines."""
        section = self._plan.sections[number]
        end_so_far = section.start
        for stretch in self._of.get((number, lane_id), []):
            if stretch.start - end_so_far > CLOSE and end_so_far > section.start:
                _nothing(lane, end_so_far - section.start)
            _write_stretch(lane, stretch, section.start)
            end_so_far = stretch.end
        if section.start < end_so_far < section.end - CLOSE:
            _nothing(lane, end_so_far - section.start)


def _border_strip(geometry: RoadGeometry, side: Side, line: LineMarking) -> int | None:
    """Return the index of the strip whose outer border a line follows: -1 for the inner edge, None for no border.

    On a single carriageway, a free line between the directions, at their inner edges, is a mark of the centre lane.
    """
    section = geometry.sections[side]
    if line.kind == "free":
        is_between = is_single(geometry.parameters.design_class) and line.offset == section.carriageway.inner_offset
        return -1 if is_between else None
    if line.kind == "turnout_edge":
        return section.kinds.index("turnout_lane")
    if line.kind == "gore_edge":
        return section.kinds.index("turnout_lane") - 1
    return section.kinds.index("lane") + len(section.carriageway.lanes) - line.boundary - 1


def _nothing(lane: Element, offset: float) -> None:
    """Add a `roadMark` of type none at an offset (m) in the lane section, which ends the mark before it."""
    element(lane, "roadMark", {"sOffset": offset, "type": "none", "color": "white", "width": 0.0})


def _write_stretch(lane: Element, stretch: _Stretch, section_start: float) -> None:
    """Add a stretch's road marks; a dash that the section's start cuts is solid, the rest is broken."""
    line, start = stretch.line, stretch.start - section_start
    if line.dash_length == 0.0:
        _mark(lane, stretch, start, (stretch.end - stretch.start, 0.0, 0.0))
        return
    cut_length, next_dash = stretch.cut_dash
    if cut_length > CLOSE:
        _mark(lane, stretch, start, (min(cut_length, stretch.end - stretch.start), 0.0, 0.0))
    if stretch.start + cut_length < stretch.end - CLOSE:
        pattern = (line.dash_length, line.gap_length, next_dash - cut_length)
        _mark(lane, stretch, start + cut_length, pattern)


def _mark(lane: Element, stretch: _Stretch, offset: float, pattern: tuple[float, float, float]) -> None:
    """Add one `roadMark` at an offset (m) in its lane section; the pattern is dash, gap and first gap (m)."""
    line = stretch.line
    dash, gap, first_gap = pattern
    is_broken = line.dash_length > 0.0
    weight = "bold" if line.width > 0.2 else "standard"
    attributes = {"sOffset": offset, "type": "broken" if gap > 0.0 else "solid", "weight": weight, "color": line.color}
    attributes |= {"width": line.width, "height": line.film_thickness, "laneChange": "both" if is_broken else "none"}
    mark = element(lane, "roadMark", attributes)
    kind = element(mark, "type", {"name": line.kind, "width": line.width})
    sign = 1.0 if stretch.side == "left" else -1.0
    rule = "none" if is_broken else "no passing"
    shape = {"length": dash, "space": gap, "tOffset": sign * _OUTWARDS.get(line.kind, 0.0) * line.width}
    element(kind, "line", {**shape, "sOffset": first_gap, "rule": rule, "width": line.width, "color": line.color})
    add_object_data(mark, stretch.name, line.instance)
