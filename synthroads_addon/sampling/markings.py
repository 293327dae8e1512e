"""Line markings, hatching and arrows as the cross-section and the turnouts ask for them (RMS).

Between the two directions of a single carriageway lies the line that its cross-section has: none, a single one that is
dashed where drivers see far enough to overtake, or a line at the inner edge of either direction. How dashes, solid and
warning lines look is the guideline's: its file says so.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..base.schema import round_value
from ..road.axes.sight import DASHED, SOLID, LineSights, line_spans
from ..road.guidelines import LIMITS, EdgeLine, StandardCrossSection, is_single
from ..road.objects import AnyWidth, Side, SignedWidthPoint, WidthPoint, width_at, width_kinks
from ..road.section import Arrow, Carriageway, Hatching, LineMarking, Turnout
from ..road.side_roads.mouth import Mouth
from ..road.turnout_geometry import TurnoutShape
from .overtaking_lanes import OvertakingPlan, barred_stripes, overtaking_plan
from .placing.ranges import Range, Reservations, free_ranges
from .placing.site import PlacementSite
from .section import cross_section_of
from .villages.islands import line_gaps

BLOCK_DASH = BLOCK_GAP = 6.0
MOUTH_DASH = 3.0
"""Dashes and gaps of the edge line across a side road's mouth, m: near junctions both are often 3 m (one page).

A guideline's pattern of edge lines goes before it."""
SOLID_BEFORE_GORE = 30.0
"""The line beside a turnout's lane is solid for so long before (exit) or behind (entry) the gore's tip, m."""
LANE_THERE = 1.0
"""Where a lane is as wide as this (m) or wider, a line parts it from its neighbour."""
LANE_FULL = 3.0
"""Where an overtaking lane is as wide as this (m), or wider, arrows lie on it before its end. Chosen."""
_LEVEL = 1e-9
ARROW_SPACING = 60.0
_ARROWS_AT_LEAST = 3
_MEETING = 1e-3
"""Distance, m, up to which two inner edges are one."""
_FIRST_MERGE_ARROW = 20.0  # from the beginning of the taper, m


def place_markings(site: PlacementSite) -> Iterator[tuple[str, LineMarking | Hatching | Arrow]]:
    """Yield (id, marking) of everything painted on a road, all with instance 1 and films of one thickness."""
    limits = site.scenario.markings.film_thickness
    film = round_value(site.stream("film").uniform(limits.minimum, limits.maximum))
    section = cross_section_of(site.scenario)
    is_meeting = _meet(site.carriageways)
    forward: Side = next((side for side, item in site.carriageways.items() if item.traffic > 0), "right")
    plan = overtaking_plan(site.scenario, site.seed, section, site.length, forward)
    for side, carriageway in site.carriageways.items():
        sampler = Painter(site, side, carriageway, film)
        yield from sampler.lines(section.edge_line, inner_edge=not is_meeting)
        if is_meeting:
            yield from sampler.centre_lines(section)
        for name, turnout in site.turnouts_of(side).items():
            if turnout.ramp:
                yield from sampler.turnout(name, turnout)
        yield from sampler.merge_arrows()
        if plan is not None:
            yield from sampler.stripes(plan)


class Painter:
    """Makes the markings of one carriageway as objects of a parameter set."""

    def __init__(self, site: PlacementSite, side: Side, carriageway: Carriageway, film: float) -> None:
        self.site, self.carriageway, self.film = site, carriageway, film
        self.side, self.name = side, f"carriageway-{side}"
        self.section = site.sections[side]
        self.guideline = site.guideline
        self.length = round_value(site.length)
        self.limits = LIMITS[site.design_class]
        self.arrow_length = 7.5 if self.limits.speed > 80.0 else 5.0

    def centre_lines(self, section: StandardCrossSection) -> Iterator[tuple[str, LineMarking]]:
        """Yield (id, marking) of the lines at the inner edge, where both directions meet, that this side has.

        There the line is dashed, but solid on a single carriageway where drivers don't see far enough to overtake. The
        right carriageway has the line; of two solid ones each carriageway has its own.
        """
        if section.single and (
            section.centre_line == "none" or min(section.lanes) < self.limits.narrowest_centre_line_lane
        ):
            return
        limits, spans, is_right = self.limits, [(0.0, self.length, DASHED)], self.side == "right"
        is_double = section.single and limits.solid_lines > 1.0
        if not is_right and not is_double:
            return
        if section.single:
            spans = line_spans(self.site.alignment, section.paved_width, self._line_sights(), self.length)
            spans = list(_dashed_at(spans, [_mouth_span(m) for m in self.site.mouths.values() if _is_marked(m)]))
            islands = Reservations(line_gaps(self.site, limits.solid_line_width or limits.narrow_line))
            spans = [(*piece, kind) for start, end, kind in spans for piece in free_ranges(start, end, islands)]
        solid_width = limits.solid_line_width or limits.narrow_line
        colour = {"color": self.guideline.centre_line_color} if section.single else {}
        stem = "centre-line" if is_right else "centre-line-left"
        for number, (start, end, kind) in enumerate(spans):
            name = stem + (f"-{number + 1}" if number else "")
            offset: Any = self.carriageway.inner_offset
            if kind != SOLID:
                if is_right:
                    dash, gap = self._centre_dashes(kind)
                    pattern = {"dash_length": dash, "gap_length": gap}
                    yield name, self._line("free", (start, end), offset=offset, **pattern, **colour)
                continue
            if is_double:
                offset = round_value(offset + (limits.double_line_gap + solid_width) / 2.0)
            width = solid_width if section.single else limits.narrow_line
            yield name, self._line("free", (start, end), offset=offset, width=width, **colour)

    def _line_sights(self) -> LineSights:
        """Return the sights that decide how the line between the directions is."""
        limits, dashed = self.limits, self._overtaking_sight()
        return LineSights(
            dashed, min(limits.prohibition_sight, dashed), limits.warning_length, limits.warning_dash > 0.0
        )

    def _centre_dashes(self, kind: int) -> tuple[float, float]:
        """Return the lengths (m) of dashes and gaps of a line between the directions, by its kind."""
        limits, scenario = self.limits, self.site.scenario.markings
        if kind != DASHED:
            return limits.warning_dash, limits.warning_gap
        dash, gap = limits.centre_dash or limits.lane_dash, limits.centre_gap or limits.lane_gap
        return scenario.lane_dash or dash, scenario.lane_gap or gap

    def _overtaking_sight(self) -> float:
        """Return how far (m) drivers must see where the line between the directions is dashed."""
        sight = self.site.scenario.markings.overtaking_sight
        return self.limits.overtaking_sight if sight is None else sight

    @property
    def keeps(self) -> Side:
        """Return the side that traffic keeps to: where the outermost lane and exits are for drivers."""
        return self.carriageway.traffic_side or "right"

    @property
    def edge_width(self) -> float:
        """Return the width (m) of the outer edge line: if none is given broad on motorways, else narrow."""
        if self.limits.edge_line_width:
            return self.limits.edge_line_width
        return self.limits.narrow_line if is_single(self.site.design_class) else self.limits.broad_line

    def _dashes(self) -> tuple[float, float]:
        """Return the lengths (m) of a lane line's dashes and gaps: the scenario's, else the usual ones."""
        limits = self.site.scenario.markings
        return limits.lane_dash or self.limits.lane_dash, limits.lane_gap or self.limits.lane_gap

    def lines(self, edge_line: EdgeLine, inner_edge: bool = True) -> Iterator[tuple[str, LineMarking]]:
        """Yield (id, marking) of the lines along lane boundaries: at the edges, and dashed between lanes.

        Args:
            edge_line: how the outer edge line is: solid, dashed, or none.
            inner_edge: whether there is a line at the inner edge.
        """
        lanes = self.carriageway.lanes
        dash, gap = self._dashes()
        blocks = Reservations(block_span(shape) for shape in self.section.turnouts if shape.turnout.ramp)
        edge_dash, edge_gap = self.limits.edge_dash or dash, self.limits.edge_gap or gap
        edge_dashes = {"dash_length": edge_dash, "gap_length": edge_gap} if edge_line == "dashed" else {}
        edge_look = edge_dashes | {"width": self.edge_width, "color": self.guideline.edge_line_color}
        mouths = [_mouth_span(mouth) for mouth in self.site.mouths_of(self.carriageway.side) if _is_marked(mouth)]
        if edge_line != "none":
            yield from self._lines_across(mouths)
            blocks = Reservations([*blocks.stretches, *mouths])
        for number, span in enumerate(free_ranges(0.0, self.length, blocks) if edge_line != "none" else ()):
            name = f"{self.name}-line-0" + (f"-{number + 1}" if number else "")
            yield name, self._line("outer_edge", span, boundary=0, **edge_look)
        for boundary in range(1, len(lanes)):
            # Only an outermost or innermost lane ends: one of the two beside a boundary.
            (outer_start, outer_end), (inner_start, inner_end) = (
                _lane_stretch(lanes[i].width, self.length) for i in (boundary - 1, boundary)
            )
            spans = [(max(outer_start, inner_start), min(outer_end, inner_end))]
            if self.site.scenario.overtaking.share:
                spans = _every_stretch(lanes[boundary].width, self.length)
            for number, span in enumerate(spans):
                if span[1] <= span[0]:
                    continue  # one of both is nowhere
                line = self._line("lane", span, boundary=boundary, dash_length=dash, gap_length=gap)
                yield f"{self.name}-line-{boundary}" + (f"-{number + 1}" if number else ""), line
        if not inner_edge:
            return
        span = (0.0, self.length)
        is_centre = is_single(self.site.design_class)
        colour = self.guideline.centre_line_color if is_centre else self.guideline.edge_line_color
        yield f"{self.name}-line-{len(lanes)}", self._line("inner_edge", span, boundary=len(lanes), color=colour)

    def _lines_across(self, spans: list[Range]) -> Iterator[tuple[str, LineMarking]]:
        """Yield (id, marking) of the dashed edge line across each side road's mouth (m)."""
        look: dict[str, Any] = {"width": self.edge_width, "color": self.guideline.edge_line_color}
        limits = self.limits
        patterns = ((limits.mouth_dash, limits.mouth_gap), (limits.edge_dash, limits.edge_gap))
        dash, gap = next((pattern for pattern in patterns if pattern[0]), (MOUTH_DASH, MOUTH_DASH))
        look |= {"dash_length": dash, "gap_length": gap}
        for number, span in enumerate(spans, 1):
            line = self._line("outer_edge", span, boundary=0, **look)
            yield f"{self.name}-line-mouth-{number}", line

    def turnout(self, name: str, turnout: Turnout) -> Iterator[tuple[str, LineMarking | Hatching | Arrow]]:
        """Yield (id, marking) of an exit or entry: block marking, edge lines, hatching; arrows where traffic leaves."""
        shape = self.site.shape(turnout)
        assert turnout.ramp is not None
        dashes = {"dash_length": BLOCK_DASH, "gap_length": BLOCK_GAP}
        yield f"{name}-block", self._line("block", block_span(shape), width=self.limits.broad_line, **dashes)
        taper, lane = turnout.taper_in_length + turnout.taper_out_length, turnout.lane_length
        # The edge line begins where its strip has become as wide as the line.
        begin = taper * min(1.0, self.limits.broad_line / max(turnout.edge_strip_width, self.limits.broad_line))
        edge = _stations(shape, begin, turnout.length)
        yield f"{name}-edge", self._line("turnout_edge", edge, turnout=name, width=self.limits.broad_line)
        gore = _stations(shape, taper + lane, turnout.length)
        yield f"{name}-gore-edge", self._line("gore_edge", gore, turnout=name, width=self.limits.broad_line)
        yield f"{name}-hatching", Hatching(instance=1, turnout=name, film_thickness=self.film)
        if turnout.kind == "exit":
            count = max(_ARROWS_AT_LEAST, round(lane / ARROW_SPACING))
            stations = [shape.station(taper + lane * (i + 0.5) / count) for i in range(count)]
            inner, outer = self.section.boundaries_of("turnout_lane", stations)
            kind = f"straight_{self.keeps}"
            yield from self._arrows(f"{name}-arrow", kind, stations, (inner + outer) / 2.0)

    def merge_arrows(self) -> Iterator[tuple[str, Arrow]]:
        """Yield (id, arrow) of the arrows on a lane that ends, in front of its taper."""
        lanes, traffic = self.carriageway.lanes, self.carriageway.traffic
        for index, lane in enumerate(lanes):
            if self.site.scenario.overtaking.share and index:
                yield from self._arrows_before_ends(index, lane.width)
                continue
            if not isinstance(lane.width, tuple) or not _changes_once(lane.width):
                continue
            width_before, taper_start, _, width_after = lane.width if traffic > 0 else lane.width[::-1]
            if width_before.width < width_after.width:
                continue
            first_station = taper_start.station - traffic * _FIRST_MERGE_ARROW
            stations = [first_station - traffic * ARROW_SPACING * i for i in range(_ARROWS_AT_LEAST)]
            half_arrow = self.arrow_length / 2.0
            stations = [s for s in stations if half_arrow <= s <= self.length - half_arrow]
            boundaries = self.section.lane_boundaries(stations)
            kind = f"merge_{'left' if (index == 0) == (self.keeps == 'right') else 'right'}"
            lane_middles = boundaries[:, index : index + 2].mean(axis=1)
            yield from self._arrows(f"{self.name}-merge-arrow", kind, stations, lane_middles)

    def _arrows_before_ends(self, index: int, width: AnyWidth) -> Iterator[tuple[str, Arrow]]:
        """Yield (id, arrow) of the arrows on an overtaking lane before each of its ends."""
        traffic, half_arrow = self.carriageway.traffic, self.arrow_length / 2.0
        stretches = _every_stretch(width, self.length, LANE_FULL)
        for number, stretch in enumerate(stretches, 1):
            end = stretch[1] if traffic > 0 else stretch[0]
            if not half_arrow < end < self.length - half_arrow:
                continue  # the road's end, not the lane's
            stations = [end - traffic * (_FIRST_MERGE_ARROW + ARROW_SPACING * i) for i in range(_ARROWS_AT_LEAST)]
            stations = [s for s in stations if stretch[0] + half_arrow <= s <= stretch[1] - half_arrow]
            middles = self.section.lane_boundaries(stations)[:, index : index + 2].mean(axis=1) if stations else []
            kind = f"merge_{'right' if self.keeps == 'right' else 'left'}"
            yield from self._arrows(f"{self.name}-end-{number}-arrow", kind, stations, np.array(middles))

    def stripes(self, plan: OvertakingPlan) -> Iterator[tuple[str, LineMarking]]:
        """Yield (id, line) of the stripes of barred areas on this carriageway, between the directions."""
        for number, stripe in enumerate(barred_stripes(plan, self.carriageway, self.section, self.length), 1):
            offset = tuple(
                SignedWidthPoint(station=s, width=d) for s, d in zip(stripe.stations, stripe.distances, strict=True)
            )
            name = f"barred-{self.side}-{number:03d}"
            yield name, self._line("free", stripe.stations, offset=offset, width=stripe.width)

    def _line(self, kind: Any, span: Range, **values: Any) -> LineMarking:
        """Return a line marking between two stations (m): solid and narrow unless `values` says otherwise."""
        fields = {
            "width": self.limits.narrow_line,
            "dash_length": 0.0,
            "gap_length": 0.0,
            "film_thickness": self.film,
        } | values
        start, end = span
        return LineMarking(instance=1, carriageway=self.name, kind=kind, start_station=start, end_station=end, **fields)

    def _arrows(
        self, name: str, kind: Any, stations: list[float], distances: np.ndarray
    ) -> Iterator[tuple[str, Arrow]]:
        """Yield an arrow with its name for each station, at its distance from the axis."""
        for number, (station, distance) in enumerate(zip(stations, distances.tolist(), strict=True), start=1):
            arrow = Arrow(
                instance=1,
                carriageway=self.name,
                kind=kind,
                station=round_value(station),
                offset=round_value(self.carriageway.sign * distance),
                rotation_deg=0.0 if self.carriageway.traffic > 0 else 180.0,
                length=self.arrow_length,
                film_thickness=self.film,
            )
            yield f"{name}-{number}", arrow


def _meet(carriageways: Mapping[Side, Carriageway]) -> bool:
    """Return whether the innermost lanes of both directions meet, at an offset that may change, islands left out."""
    if len(carriageways) != 2 or any(_least_width(c.inner_edge_strip_width) > 0.0 for c in carriageways.values()):
        return False
    # Both edges are linear between these stations, so their distance is largest at one of them.
    stations = [0.0, *(s for carriageway in carriageways.values() for s in width_kinks(carriageway.inner_offset))]
    left_edge, right_edge = (
        carriageway.sign * width_at(carriageway.inner_offset, stations) for carriageway in carriageways.values()
    )
    return bool(np.abs(left_edge - right_edge).max() < _MEETING)


def _least_width(width: AnyWidth) -> float:
    """Return the least width along the road, m."""
    return min(point.width for point in width) if isinstance(width, tuple) else float(width)


def _stations(shape: TurnoutShape, begin: float, end: float) -> Range:
    """Return the stations (m), the lower one first, of a stretch between two distances along a turnout."""
    lowest, highest = sorted((shape.station(begin), shape.station(end)))
    return max(0.0, round_value(lowest)), round_value(highest)


def _dashed_at(spans: list[tuple[float, float, int]], gaps: list[Range]) -> Iterator[tuple[float, float, int]]:
    """Yield the spans of a centre line, dashed also where side roads join (m), so that traffic may turn in."""
    for start, end, kind in spans:
        inside = sorted((max(a, start), min(b, end)) for a, b in gaps if b > start and a < end)
        if kind != SOLID or not inside:
            yield start, end, kind
            continue
        position = start
        for a, b in inside:
            if a > position:
                yield position, a, SOLID
            if b > max(a, position):
                yield max(a, position), b, DASHED
            position = max(position, b)
        if position < end:
            yield position, end, SOLID


def _mouth_span(mouth: Mouth) -> Range:
    """Return the stations (m) between which a side road's corners leave the road's edge."""
    return round_value(mouth.low.start_station), round_value(mouth.high.start_station)


def _is_marked(mouth: Mouth) -> bool:
    """Return whether a side road's mouth interrupts the road's edge line: a farm road's doesn't."""
    return mouth.side_road.lanes > 1


def block_span(shape: TurnoutShape) -> Range:
    """Return the stations (m) between which an exit's or entry's lane is parted from the road by a block marking."""
    turnout = shape.turnout
    taper = turnout.taper_in_length + turnout.taper_out_length
    return _stations(shape, 0.0, taper + max(0.0, turnout.lane_length - SOLID_BEFORE_GORE))


def _lane_stretch(width: AnyWidth, length: float) -> Range:
    """Return the stations (m) between which a lane is there that at most once begins or ends."""
    if not isinstance(width, tuple):
        return 0.0, length
    widths, stations = [p.width for p in width], [p.station for p in width]
    if not _changes_once(width):
        return _longest_stretch(np.array(stations), np.array(widths), length)
    if widths[0] < widths[-1]:
        return round_value(float(np.interp(LANE_THERE, widths, stations))), length
    return 0.0, round_value(float(np.interp(LANE_THERE, widths[::-1], stations[::-1])))


def _every_stretch(width: AnyWidth, length: float, least_width: float = LANE_THERE) -> list[Range]:
    """Return the stretches (m), in order, on which a lane is at least so wide (m)."""
    if not isinstance(width, tuple):
        return [(0.0, length)]
    stations = np.array([0.0, *(p.station for p in width if 0.0 < p.station < length), length])
    spare = np.interp(stations, [p.station for p in width], [p.width for p in width]) - least_width
    crossing = np.flatnonzero(spare[:-1] * spare[1:] < 0.0)
    share = spare[crossing] / (spare[crossing] - spare[crossing + 1])
    crossed = stations[crossing] + share * np.diff(stations)[crossing]
    marks = np.unique(np.concatenate([stations, crossed]))
    there = np.interp((marks[:-1] + marks[1:]) / 2.0, stations, spare) >= -_LEVEL
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    return [(round_value(float(marks[a])), round_value(float(marks[b]))) for a, b in edges.reshape(-1, 2)]


def _changes_once(width: tuple[WidthPoint, ...]) -> bool:
    """Return whether a drawn lane begins or ends by this width: two widths, and a taper between them."""
    return len(width) == 4 and width[0].width == width[1].width != width[2].width == width[3].width


def _longest_stretch(station: np.ndarray, width: np.ndarray, length: float) -> Range:
    """Return the longest stretch (m) on which a lane of any widths (K,) by station is there; of none an empty one."""
    samples = np.unique(np.concatenate([np.linspace(0.0, length, 2001), station.clip(0.0, length)]))
    exists = np.interp(samples, station, width) >= LANE_THERE
    edges = np.flatnonzero(np.diff(np.concatenate([[False], exists, [False]]).astype(int)))
    if not len(edges):
        return 0.0, 0.0
    starts, ends = samples[edges[::2]], samples[edges[1::2] - 1]
    longest = int(np.argmax(ends - starts))
    return round_value(float(starts[longest])), round_value(float(ends[longest]))
