"""Line markings as road marks of the lanes whose outer borders they follow."""

from dataclasses import dataclass

from ...road.geometry import RoadGeometry
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
        within = (self.start - line.start_station) % period
        if period - within < CLOSE or within < CLOSE:
            return 0.0, 0.0
        return max(0.0, line.dash_length - within), period - within


class RoadMarks:
    """Line markings of one carriageway, assigned to the lanes whose outer borders they follow.

    Attributes:
        loose: (id, line, start, end) of lines, or parts of them, that follow no lane's border or one that has a line.
    """

    def __init__(self, plan: LanePlan) -> None:
        self._plan = plan
        self._of: dict[tuple[int, int], list[_Stretch]] = {}
        self.loose: list[tuple[str, LineMarking, float, float]] = []
        for name, line in plan.geometry.parameters.of_type(LineMarking).items():
            if plan.geometry.parameters.carriageway_of(line).side == plan.side:
                self._place(name, line)
        for stretches in self._of.values():
            stretches.sort(key=lambda item: item.start)

    def _place(self, name: str, line: LineMarking) -> None:
        start, end = line.start_station, min(line.end_station, self._plan.geometry.length)
        if end - start <= CLOSE:
            return
        side = self._plan.side
        index = _border_strip(self._plan.geometry, side, line)
        for number, section in enumerate(self._plan.sections):
            low, high = max(start, section.start), min(end, section.end)
            if high - low <= CLOSE:
                continue
            if index is None or not self._assign(_Stretch(name, line, low, high, side), number, index):
                self._let_loose(name, line, low, high)

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
        if self.loose and self.loose[-1][0] == name and start - self.loose[-1][3] <= CLOSE:
            start = self.loose.pop()[2]
        self.loose.append((name, line, start, end))

    def write(self, lane: Element, number: int, lane_id: int) -> None:
        """Add the `roadMark` elements of one lane in a lane section, with type `none` in gaps between lines."""
        section = self._plan.sections[number]
        reached = section.start
        for stretch in self._of.get((number, lane_id), []):
            if stretch.start - reached > CLOSE and reached > section.start:
                _nothing(lane, reached - section.start)
            _write_stretch(lane, stretch, section.start)
            reached = stretch.end
        if section.start < reached < section.end - CLOSE:
            _nothing(lane, reached - section.start)


def _border_strip(geometry: RoadGeometry, side: Side, line: LineMarking) -> int | None:
    """Return the index of the strip whose outer border a line follows: -1 for the inner edge, None for no border."""
    section = geometry.sections[side]
    if line.kind == "free":
        return None
    if line.kind == "turnout_edge":
        return section.kinds.index("turnout_lane")
    if line.kind == "gore_edge":
        return section.kinds.index("turnout_lane") - 1
    return section.kinds.index("lane") + len(section.carriageway.lanes) - line.boundary - 1


def _nothing(lane: Element, offset: float) -> None:
    element(lane, "roadMark", {"sOffset": offset, "type": "none", "color": "white", "width": 0.0})


def _write_stretch(lane: Element, stretch: _Stretch, section_start: float) -> None:
    """Add a stretch's road marks; a dash that the section's start cuts is solid, the rest is broken."""
    line, start = stretch.line, stretch.start - section_start
    if line.dash_length == 0.0:
        _mark(lane, stretch, start, (stretch.end - stretch.start, 0.0, 0.0))
        return
    rest, following = stretch.cut_dash
    if rest > CLOSE:
        _mark(lane, stretch, start, (min(rest, stretch.end - stretch.start), 0.0, 0.0))
    if stretch.start + rest < stretch.end - CLOSE:
        pattern = (line.dash_length, line.gap_length, following - rest)
        _mark(lane, stretch, start + rest, pattern)


def _mark(lane: Element, stretch: _Stretch, offset: float, pattern: tuple[float, float, float]) -> None:
    """Add one `roadMark` at an offset (m) in its lane section; the pattern is dash, gap and first gap (m)."""
    line = stretch.line
    dash, gap, first = pattern
    broken = line.dash_length > 0.0
    weight = "bold" if line.width > 0.2 else "standard"
    attributes = {"sOffset": offset, "type": "broken" if gap > 0.0 else "solid", "weight": weight, "color": line.color}
    attributes |= {"width": line.width, "height": line.film_thickness, "laneChange": "both" if broken else "none"}
    mark = element(lane, "roadMark", attributes)
    kind = element(mark, "type", {"name": line.kind, "width": line.width})
    sign = 1.0 if stretch.side == "left" else -1.0
    rule = "none" if broken else "no passing"
    shape = {"length": dash, "space": gap, "tOffset": sign * _OUTWARDS.get(line.kind, 0.0) * line.width}
    element(kind, "line", {**shape, "sOffset": first, "rule": rule, "width": line.width, "color": line.color})
    add_object_data(mark, stretch.name, line.instance)
