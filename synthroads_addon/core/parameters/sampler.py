"""From a seed and limits to one road. Rules hold by construction: nothing is drawn and rejected."""

from __future__ import annotations

import math

import numpy as np

from ... import version
from ..errors import InputError
from ..random_streams import stream
from ..scenario import Interval, RoadScenario
from ..schema import rounded
from .alignment import Alignment, Element
from .limits import (
    LEAST_CROSSFALL_PERCENT,
    LIMITS,
    LONGEST_STRAIGHT,
    STANDARD_CROSS_SECTIONS,
    curve_crossfall_percent,
)
from .markings import line_markings
from .model import (
    EPSG_URI,
    AlignmentObject,
    AnyObject,
    Carriageway,
    CrossfallPoint,
    HorizontalElement,
    Lane,
    Median,
    Metadata,
    RoadParameters,
    Terrain,
    Transform,
    Vegetation,
    VerticalPoint,
)
from .placement import SHORTEST_GUARDRAIL, delineators, median_guardrail, roadside_guardrail


def sample_road(
    scenario: RoadScenario, seed: int, title: str = "", axis: AlignmentObject | None = None
) -> RoadParameters:
    """Return the road of a seed.

    Args:
        scenario: limits of what is drawn.
        seed: the same seed and limits give the same road on every machine.
        title: title for people.
        axis: take this alignment (instance 1) instead of drawing one; its coordinates are local.

    Raises:
        InputError: the limits contradict each other; the message names them.
    """
    axis = axis or sample_alignment(scenario, seed)
    length = rounded(axis.length)
    elements = [(e.length, e.curvature_start, e.curvature_end) for e in axis.horizontal]
    alignment = Alignment([Element(*e) for e in elements], 0.0, 0.0, 0.0)
    objects: dict[str, AnyObject] = {"alignment": axis}

    def following() -> int:
        return max(item.instance for item in objects.values()) + 1

    objects["median"] = Median(instance=following())
    sides = {}
    for side in ("right", "left"):
        sides[side] = objects[f"carriageway-{side}"] = _carriageway(scenario, side, elements, following())
    for side, carriageway in sides.items():
        objects |= dict(line_markings(f"carriageway-{side}", carriageway, length, following()))
    rails = []
    if scenario.median_guardrail:
        objects["guardrail-median"] = median_guardrail(length, following())
    for side, carriageway in sides.items():
        span = _guardrail_span(length, stream(seed, "guardrail", side))
        if scenario.roadside_guardrails and span:
            rails.append(roadside_guardrail(carriageway, *span, following()))
            objects[f"guardrail-{side}"] = rails[-1]
    for carriageway in sides.values() if scenario.delineators else ():
        objects |= dict(delineators(carriageway, alignment, rails, following()))
    objects["terrain"] = _terrain(scenario, seed, following())
    for name, plants in _vegetation(scenario, seed).items():
        objects[name] = plants.model_copy(update={"instance": following()})
    return RoadParameters(
        metadata=Metadata(
            identifier=f"{scenario.cross_section.lower()}-{scenario.design_class.lower()}-{seed}",
            title=title,
            seed=seed,
            generator=f"SynthRoads {version()}",
            referenceSystem=EPSG_URI.format(scenario.epsg),
        ),
        transform=Transform(translate=scenario.map_origin),
        design_class=scenario.design_class,
        objects=objects,
    )


def sample_alignment(scenario: RoadScenario, seed: int) -> AlignmentObject:
    """Return an alignment of line, clothoid, arc, clothoid and line (what the length leaves room for)."""
    rng = stream(seed, "alignment")
    horizontal = _horizontal(scenario, rng)
    elements = [Element(e.length, e.curvature_start, e.curvature_end) for e in horizontal]
    heading = rng.uniform(-180.0, 180.0)
    middle = Alignment(elements, 0.0, 0.0, math.radians(heading)).position(scenario.length / 2)
    return AlignmentObject(
        instance=1,
        start_x=rounded(-middle[0]),
        start_y=rounded(-middle[1]),
        start_heading_deg=rounded(heading),
        horizontal=horizontal,
        vertical=_vertical(scenario, rng),
    )


def _draw(rng: np.random.Generator, limits: Interval) -> float:
    return rounded(rng.uniform(limits.minimum, limits.maximum))


def _horizontal(scenario: RoadScenario, rng: np.random.Generator) -> tuple[HorizontalElement, ...]:
    """Draw the curve so that both clothoids, two seconds of arc and the lines fit into the length."""
    limits = LIMITS[scenario.design_class]
    if scenario.radius.minimum < limits.radius:
        raise InputError(
            "road.radius.minimum",
            scenario.radius.minimum,
            f"{scenario.design_class} allows {limits.radius} m and more",
        )
    radius = _draw(rng, scenario.radius)
    sign = 1.0 if rng.random() < 0.5 else -1.0
    shortest_arc = limits.speed / 3.6 * 2.0
    least = max(limits.clothoid, radius / 3.0, _run_off_clothoid(scenario, radius)) ** 2 / radius
    room = (scenario.length - shortest_arc) / 2.0
    if room < least:
        # Too short for a whole curve with its transitions: part of one, at full curvature.
        curvature = rounded(sign / radius, 12)
        return (HorizontalElement.between(scenario.length, curvature, curvature),)
    transition = rounded(rng.uniform(least, max(least, min(radius, 0.6 * room + 0.4 * least))))
    lines = scenario.length - shortest_arc - 2.0 * transition
    arc = rounded(shortest_arc + lines * rng.uniform(0.2, 0.6))
    before = rounded((scenario.length - 2.0 * transition - arc) * rng.uniform(0.3, 0.7))
    after = rounded(scenario.length - 2.0 * transition - arc - before)
    if max(before, after) > LONGEST_STRAIGHT:
        raise InputError("road.length", scenario.length, f"one curve leaves a straight over {LONGEST_STRAIGHT:.0f} m")
    curvature = rounded(sign / radius, 12)
    return (
        HorizontalElement.between(before, 0.0, 0.0),
        HorizontalElement.between(transition, 0.0, curvature),
        HorizontalElement.between(arc, curvature, curvature),
        HorizontalElement.between(transition, curvature, 0.0),
        HorizontalElement.between(after, 0.0, 0.0),
    )


def _run_off_clothoid(scenario: RoadScenario, radius: float) -> float:
    """Return the smallest A (m) whose length suffices for the crossfall's run-off."""
    section = STANDARD_CROSS_SECTIONS[scenario.cross_section]
    half = (sum(section.lanes) + section.hard_shoulder + section.outer_edge_strip + section.inner_edge_strip) / 2.0
    change = LEAST_CROSSFALL_PERCENT + curve_crossfall_percent(scenario.design_class, 1.0 / radius)
    return math.sqrt(radius * half * change / LIMITS[scenario.design_class].run_off_percent)


def _vertical(scenario: RoadScenario, rng: np.random.Generator) -> tuple[VerticalPoint, ...]:
    """Draw two grades with one crest or sag in the middle third; its radius fills most of the room it has."""
    limits = LIMITS[scenario.design_class]
    steepest = max(abs(scenario.grade_percent.minimum), abs(scenario.grade_percent.maximum))
    if steepest > limits.grade_percent:
        raise InputError("road.grade_percent", steepest, f"{scenario.design_class} allows {limits.grade_percent} %")
    first = _draw(rng, scenario.grade_percent)
    length = scenario.length
    middle = rounded(length * rng.uniform(0.4, 0.6))
    room = min(middle, length - middle)
    # The tangent T = H |g2 - g1| / 2 must fit: the second grade is drawn as near to the first as that asks.
    change = 2.0 * room / max(limits.crest, limits.sag)
    low = max(scenario.grade_percent.minimum, first - 100.0 * change)
    high = min(scenario.grade_percent.maximum, first + 100.0 * change)
    second = rounded(rng.uniform(low, high))
    least = limits.crest if second < first else limits.sag
    difference = abs(second - first) / 100.0
    largest = max(least, min(2.0 * room / max(difference, 1e-9), 5.0 * least))
    radius = rounded(rng.uniform(least, largest)) if difference > 0 else 0.0
    return (
        VerticalPoint(station=0.0, elevation=rounded(-first / 100.0 * middle)),
        VerticalPoint(station=middle, elevation=0.0, radius=radius),
        VerticalPoint(station=length, elevation=rounded(second / 100.0 * (length - middle))),
    )


def _carriageway(
    scenario: RoadScenario, side: str, elements: list[tuple[float, float, float]], instance: int
) -> Carriageway:
    section = STANDARD_CROSS_SECTIONS[scenario.cross_section]
    return Carriageway(
        instance=instance,
        side=side,
        inner_offset=section.median / 2.0,
        hard_shoulder_width=section.hard_shoulder,
        outer_edge_strip_width=section.outer_edge_strip,
        lanes=tuple(Lane(width=width) for width in section.lanes),
        inner_edge_strip_width=section.inner_edge_strip,
        verge_width=section.verge,
        crossfall=tuple(_crossfall(scenario.design_class, side, elements)),
    )


def _crossfall(design_class: str, side: str, elements: list[tuple[float, float, float]]) -> list[CrossfallPoint]:
    """Return the crossfall at the elements' borders: outwards on straights and in wide curves, else to the inside.

    Where the curvature changes the crossfall runs off linearly along the clothoid.
    """
    outwards = LEAST_CROSSFALL_PERCENT if side == "right" else -LEAST_CROSSFALL_PERCENT

    def wanted(curvature: float) -> float:
        if abs(curvature) * LIMITS[design_class].radius_outwards < 1.0:
            return outwards
        return rounded(-math.copysign(curve_crossfall_percent(design_class, curvature), curvature))

    points: list[CrossfallPoint] = []
    station = 0.0
    for length, start, end in elements:
        for at, curvature in ((station, start), (station + length, end)):
            if not points or at > points[-1].station:
                points.append(CrossfallPoint(station=rounded(at), crossfall_percent=wanted(curvature)))
        station += length
    return points


def _guardrail_span(length: float, rng: np.random.Generator) -> tuple[float, float] | None:
    """Return stations between which a roadside guardrail stands, or None where the road is too short for one."""
    if length < 1.5 * SHORTEST_GUARDRAIL:
        return None
    start = rounded(length * rng.uniform(0.05, 0.2))
    return start, rounded(max(start + SHORTEST_GUARDRAIL, length * rng.uniform(0.75, 0.95)))


def _terrain(scenario: RoadScenario, seed: int, instance: int) -> Terrain:
    rng = stream(seed, "terrain")
    return Terrain(
        instance=instance,
        half_width=scenario.half_width,
        embankment_height=_draw(rng, scenario.embankment_height),
        undulation=scenario.undulation,
        wavelength=rounded(rng.uniform(30.0, 60.0)),
        batter_slope=scenario.batter_slope,
        seed=int(rng.integers(2**31)),
    )


def _vegetation(scenario: RoadScenario, seed: int) -> dict[str, Vegetation]:
    """Return the plants: grass everywhere beside the road, trees well clear of it."""
    plants = {}
    if scenario.grass_density > 0:
        plants["grass"] = Vegetation(
            instance=1,
            kind="grass",
            density=scenario.grass_density,
            band_start=0.0,
            band_end=scenario.half_width,
            height_min=0.10,
            height_max=0.45,
            seed=int(stream(seed, "grass").integers(2**31)),
        )
    if scenario.trees_per_hectare > 0 and scenario.half_width > 30.0:
        plants["trees"] = Vegetation(
            instance=1,
            kind="tree",
            density=rounded(scenario.trees_per_hectare / 10_000.0),
            band_start=12.0,
            band_end=scenario.half_width,
            height_min=5.0,
            height_max=14.0,
            seed=int(stream(seed, "trees").integers(2**31)),
        )
    return plants
