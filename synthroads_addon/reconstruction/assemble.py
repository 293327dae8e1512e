"""Measurements as a parameter set: the same kind that is sampled or written by hand."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.maps.crs import EPSG_URI
from ..base.schema import round_value
from ..base.version import generator
from ..fitting.fit import AxisFit, alignment_object
from ..road.guidelines import DUAL_CLASSES, DUAL_CROSS_SECTIONS, LIMITS, design_class_of
from ..road.objects import RoadObject
from ..road.parameters import RoadParameters
from ..road.section import Carriageway, CrossfallPoint, Lane, LineMarking, Median, Turnout
from ..road.surroundings import Terrain
from ..road.things.concrete_barrier import ConcreteBarrier
from ..road.things.delineator import Delineator
from ..road.things.guardrail import Guardrail
from ..road.things.noise_barrier import NoiseBarrier
from .cloud import RoadCloud
from .country.standards import single_class
from .lines import Line
from .objects import FoundBarrier, FoundPost, GroundShape
from .section import SIDES, LineKind, MeasuredSection, Side, SideSection, line_width
from .widenings import Bay

RotationAxis = Literal["carriageway_axis", "inner_edge", "centreline"]

UNKNOWN_EPSG = 25832
"""Written where a cloud doesn't say its map system: a parameter set must name one (ETRS89 / UTM 32N)."""
_CROSSFALL_TOLERANCE = 0.15
"""Distance that the crossfall's polyline keeps from the measured one, %. Chosen: 5 mm over a lane."""
_TERMINAL = 12.0
"""Length over which a barrier is ramped down at its end, m. Chosen: as usual; it isn't measured."""
_END = 5.0
"""Distance from the road's end within which a barrier goes on beyond it, m. Chosen: a stretch."""

_SHORTEST_BARRIER = 1.0
"""Length up to which a barrier's rest on the road is left out, m."""
_DELINEATOR_HEIGHTS = (0.3, 1.5)
"""Limits of a delineator's height in a parameter set, m."""


@dataclass(frozen=True)
class RoadMeasurements:
    """Measurements of a reconstructed road that a parameter set is made from.

    Attributes:
        fit: the alignment in local coordinates.
        cloud: the points, with their map system and whether classes tell paint from pavement.
        section: the cross-section.
        stations: (K,) stations that the crossfall was measured at.
        crossfall: (K,) m/m by side; NaN where unknown.
        rotation: name of the line about which the crossfall turns.
        barriers, posts: barriers and delineators that stand along the road.
        ground: shape of the ground beside the road.
        title: title of the parameter set.
        bays: emergency bays.
        surface_form: form of a single carriageway's surface, "plane" or "roof"; "" if it is neither.
    """

    fit: AxisFit
    cloud: RoadCloud
    section: MeasuredSection
    stations: Float
    crossfall: dict[Side, Float]
    rotation: RotationAxis
    barriers: list[FoundBarrier]
    posts: list[FoundPost]
    ground: GroundShape
    title: str
    bays: list[Bay] = field(default_factory=list)
    surface_form: str = ""


def assemble_parameters(measurements: RoadMeasurements) -> RoadParameters:
    """Return the parameter set of a measured road, validated against the schema.

    Raises:
        InputError: a value lies beyond what a parameter set allows.
    """
    items: dict[str, RoadObject] = {"alignment": alignment_object(measurements.fit)}
    if measurements.section.kind == "dual":
        items["median"] = Median(instance=1)
    for side in SIDES:
        items[f"carriageway-{side}"] = _carriageway(measurements, measurements.section.sides[side])
    items |= dict(_bays(measurements))
    items |= dict(_markings(measurements))
    items |= dict(_furniture(measurements))
    items["terrain"] = _terrain(measurements.ground)
    metadata = {"identifier": "reconstructed", "title": measurements.title, "generator": generator()}
    data = {
        "metadata": metadata | _systems(measurements.cloud),
        "transform": {"translate": measurements.cloud.origin.tolist()},
        "design_class": _design_class(measurements),
        "objects": {name: item.to_dict() | {"instance": i} for i, (name, item) in enumerate(items.items(), 1)},
    }
    # The whole set is validated once more: each value within its limits, each reference to an existing object.
    return RoadParameters.from_dict(data, source="reconstructed road")


def _systems(cloud: RoadCloud) -> dict[str, str]:
    """Return the metadata fields that name the cloud's map system and height system by their EPSG codes.

    A cloud that names no map system gets `UNKNOWN_EPSG`.

    Raises:
        InputError: the cloud names a map system that has no code, by which a parameter set would name it.
    """
    system = cloud.place.system
    if system is not None and system.epsg is None and not system.local:
        requirement = "has no EPSG code, by which a parameter set names it: convert the cloud to a system that has one"
        raise InputError("cloud: coordinate system", system.name, requirement)
    systems = {"referenceSystem": EPSG_URI.format(cloud.epsg or UNKNOWN_EPSG)}
    if cloud.place.height_epsg:
        systems["heightReferenceSystem"] = EPSG_URI.format(cloud.place.height_epsg)
    return systems


def _design_class(measurements: RoadMeasurements) -> str:
    """Return the design class that the radii and the nearest standard cross-section allow, the fastest first."""
    # Curvature (1/m) times the class' least radius (m) is at most 1; 2 % more are allowed for the fit's error.
    largest_curvature = max(
        max(abs(e.curvature_start), abs(e.curvature_end)) for e in measurements.fit.alignment.elements
    )
    if measurements.section.kind == "single":
        return single_class(measurements.section.nearest, largest_curvature)
    possible_classes = [name for name in DUAL_CLASSES if largest_curvature * LIMITS[name].radius <= 1.02]
    preferred = possible_classes[0] if possible_classes else "EKA3"
    standard_name = measurements.section.nearest
    return design_class_of(standard_name, preferred) if standard_name in DUAL_CROSS_SECTIONS else preferred


def _carriageway(measurements: RoadMeasurements, side: SideSection) -> Carriageway:
    """Return one side's measured cross-section as the carriageway of a parameter set, lengths in m."""
    return Carriageway(
        instance=1,
        side=side.side,
        inner_offset=_length(side.inner_offset.value),
        hard_shoulder_width=_length(side.shoulder.value),
        outer_edge_strip_width=_length(side.strip.value, 0.0, 2.0),
        lanes=tuple(Lane(width=_length(lane.value, 2.0, 6.0)) for lane in reversed(side.lanes)),
        inner_edge_strip_width=_length(side.inner_strip.value),
        verge_width=_length(measurements.ground.verge_width),
        crossfall=crossfall_points(measurements.stations, measurements.crossfall[side.side]),
        rotation_axis=measurements.rotation,
    )


def crossfall_points(stations: Float, fall: Float) -> tuple[CrossfallPoint, ...]:
    """Return the corners, in percent, of a polyline within `_CROSSFALL_TOLERANCE` of a crossfall (K,), m/m."""
    is_measured = np.isfinite(fall)
    if not is_measured.any():
        return (CrossfallPoint(station=0.0, crossfall_percent=0.0),)
    station, percent = stations[is_measured], np.clip(100.0 * fall[is_measured], -12.0, 12.0)
    corners = _corners(station, percent, _CROSSFALL_TOLERANCE)
    if len(corners) == 2 and abs(percent[corners[0]] - percent[corners[1]]) <= _CROSSFALL_TOLERANCE:
        return (CrossfallPoint(station=0.0, crossfall_percent=round(float(np.median(percent)), 3)),)
    rows = [(_length(station[i]), round(float(percent[i]), 3)) for i in corners]
    return tuple(CrossfallPoint(station=corner_station, crossfall_percent=value) for corner_station, value in rows)


def _corners(station: Float, value: Float, tolerance: float) -> list[int]:
    """Return the indices, ascending, of the corners that Douglas and Peucker (1973) keep of a line value(station)."""
    corners, stack = {0, len(station) - 1}, [(0, len(station) - 1)]
    while stack:
        start, end = stack.pop()
        if end - start < 2:
            continue
        inner_rows = slice(start + 1, end)
        chord = np.interp(station[inner_rows], station[[start, end]], value[[start, end]])
        deviation = np.abs(value[inner_rows] - chord)
        if deviation.max() > tolerance:
            middle = start + 1 + int(deviation.argmax())
            corners.add(middle)
            stack += [(start, middle), (middle, end)]
    return sorted(corners)


def _bays(measurements: RoadMeasurements) -> Iterator[tuple[str, Turnout]]:
    """Yield (id, turnout) of each emergency bay; its tapers are named in the direction of traffic."""
    for number, bay in enumerate(measurements.bays, 1):
        with_stations = bay.side == "right"
        tapers = (bay.low_taper, bay.high_taper) if with_stations else (bay.high_taper, bay.low_taper)
        yield (
            f"emergency-bay-{number}",
            Turnout(
                instance=1,
                carriageway=f"carriageway-{bay.side}",
                kind="emergency_bay",
                start_station=_length(bay.start),
                taper_in_length=_length(tapers[0]),
                lane_length=_length(bay.end - bay.start - bay.low_taper - bay.high_taper, 5.0),
                taper_out_length=_length(tapers[1]),
                lane_width=_length(bay.width, 2.0, 6.0),
                edge_strip_width=0.0,
            ),
        )


def _markings(measurements: RoadMeasurements) -> Iterator[tuple[str, LineMarking]]:
    """Yield (id, marking) of each line of the carriageways, and of a single carriageway's middle line.

    Lines that weren't seen are left out at a side's borders, as are those of assumed cross-sections.
    """
    section = measurements.section
    length = round_value(measurements.fit.alignment.length)
    limits = LIMITS[_design_class(measurements)]
    pattern = (limits.lane_dash, limits.lane_gap)
    is_pair = section.middle is not None and section.middle.pair is not None
    for side in SIDES:
        measured_side = section.sides[side]
        outermost = len(measured_side.lines) - 1
        for number, line in enumerate(measured_side.lines):
            if number == 0 and section.kind == "single" and not is_pair:
                continue
            if line is None and (number in (0, outermost) or measured_side.assumed) and not measured_side.mirrored:
                continue
            kind = _line_kind(number, outermost, measured_side.closed)
            marking = LineMarking(
                instance=1,
                carriageway=f"carriageway-{side}",
                kind=kind,
                boundary=outermost - number,
                width=line_width(line, kind, section.kind, measurements.cloud.marked),
                **_dashes(line, length, pattern, kind == "outer_edge"),
            )
            yield f"carriageway-{side}-line-{outermost - number}", marking
    if section.middle is not None and not is_pair:
        period = section.middle.dash + section.middle.gap
        fields = {"carriageway": "carriageway-right", **_dashes(section.middle, length, pattern, hidden=period)}
        width = line_width(section.middle, "lane", "single", measurements.cloud.marked)
        yield "middle-line", LineMarking(instance=1, kind="free", width=width, **fields)


def _line_kind(number: int, outermost: int, is_edge_line: bool) -> LineKind:
    """Return the kind of a carriageway's line by its number, 0 for the innermost."""
    if number == outermost:
        return "outer_edge" if is_edge_line else "lane"
    return "lane" if number else "inner_edge"


def _dashes(
    line: Line | None, length: float, usual: tuple[float, float], edge: bool = False, hidden: float = 0.0
) -> dict[str, float]:
    """Return dash and gap lengths and start and end stations, m, of a marking as fields of `LineMarking`.

    Args:
        line: as measured; None if it wasn't seen.
        length: of the road, m.
        usual: dash and gap, m, of a line that wasn't seen, which runs along the whole road; an edge line has none.
        edge: whether it is an edge line.
        hidden: length, m, at either end of the road on which it may be unseen and still goes on.
    """
    dash, gap, start, end = (0.0, 0.0, 0.0, length) if edge else (*usual, 0.0, length)
    if line is not None:
        dash, gap, start, end = line.dash, line.gap, max(0.0, line.start), min(length, line.end)
        start = 0.0 if start < 2.0 * _END + hidden else start
        end = length if end > length - 2.0 * _END - hidden else end
        if not line.solid:
            period = line.dash + line.gap
            start = max(0.0, line.first_dash - period * np.floor((line.first_dash - start) / period))
        start, end = _length(start), _length(end)
    return {"dash_length": dash, "gap_length": gap, "start_station": start, "end_station": end}


def _furniture(measurements: RoadMeasurements) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of the barriers, and of a delineator for each post beside the road."""
    length = round_value(measurements.fit.alignment.length)
    for number, barrier in enumerate(measurements.barriers, 1):
        start = 0.0 if barrier.start < _END else _length(barrier.start)
        end = length if barrier.end > length - _END else _length(barrier.end)
        if end - start > _SHORTEST_BARRIER:
            yield f"barrier-{number}", barrier_object(barrier, start, end, length)
    posts = [post for post in measurements.posts if 0.0 <= post.station <= length]
    for number, post in enumerate(posts, 1):
        delineator = Delineator(
            instance=1,
            station=_length(post.station),
            offset=_length(post.offset),
            rotation_deg=0.0 if post.offset < 0.0 else 180.0,  # its front towards the traffic of its side
            height=_length(post.height, *_DELINEATOR_HEIGHTS),
        )
        yield f"delineator-{number:04d}", delineator


def barrier_object(barrier: FoundBarrier, start: float, end: float, length: float) -> RoadObject:
    """Return a found barrier between two stations as an object of the road; ramped down where it ends on the road."""
    common_fields = {"instance": 1, "start_station": start, "end_station": end, "offset": _length(barrier.offset)}
    ends_on_road = start > 0.0 or end < length
    terminal = round(min(_TERMINAL, (end - start) / 4.0), 2) if ends_on_road else 0.0
    if barrier.kind == "noise":
        return NoiseBarrier(**common_fields, height=_length(barrier.height, 1.0, 12.0))
    if barrier.kind == "concrete":
        return ConcreteBarrier(**common_fields, height=_length(barrier.height, 0.4, 2.0), terminal_length=terminal)
    height = _length(barrier.height, 0.3, 1.5)
    return Guardrail(**common_fields, height=height, faces=barrier.faces, terminal_length=terminal)


def _terrain(ground: GroundShape) -> Terrain:
    """Return the terrain of a parameter set by the measured shape of the ground; its wavelength is chosen."""
    return Terrain(
        instance=1,
        half_width=_length(ground.half_width, 5.0, 1000.0),
        embankment_height=_length(ground.embankment_height, -20.0, 20.0),
        undulation=_length(ground.undulation, 0.0, 20.0),
        wavelength=40.0,
        seed=0,
    )


def _length(value: float, lower_limit: float = -np.inf, upper_limit: float = np.inf) -> float:
    """Return a length (m) between two limits, rounded to a tenth of a millimetre."""
    return round(float(np.clip(value, lower_limit, upper_limit)), 4)
