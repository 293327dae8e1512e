"""From a seed and limits to one road. Rules hold by construction: nothing is drawn and rejected."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from ... import version
from ..random_streams import stream
from ..scenario import Interval, RoadScenario
from ..schema import rounded
from .alignment import Alignment, Element
from .crossfall import crossfall_points
from .limits import (
    STANDARD_CROSS_SECTIONS,
)
from .markings import line_markings
from .model import (
    EPSG_URI,
    AlignmentObject,
    AnyObject,
    Carriageway,
    Lane,
    Median,
    Metadata,
    RoadParameters,
    Terrain,
    Transform,
    Vegetation,
)
from .placement import (
    SHORTEST_GUARDRAIL,
    delineator_stations,
    delineators,
    median_guardrail,
    needs_guardrail,
    roadside_guardrail,
)
from .sampler_alignment import HorizontalSampler, sample_profile

_SIDES: tuple[Literal["left", "right"], ...] = ("right", "left")


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
    objects: dict[str, AnyObject] = {"alignment": axis}

    def following() -> int:
        return max(item.instance for item in objects.values()) + 1

    objects["median"] = Median(instance=following())
    sides: dict[Literal["left", "right"], Carriageway] = {}
    for side in _SIDES:
        sides[side] = objects[f"carriageway-{side}"] = _carriageway(scenario, side, axis, following())
    for side, carriageway in sides.items():
        objects |= dict(line_markings(f"carriageway-{side}", carriageway, length, following()))
    terrain = _terrain(scenario, seed)
    rails = []
    if scenario.median_guardrail:
        objects["guardrail-median"] = median_guardrail(length, following())
    for side, carriageway in sides.items():
        span = _guardrail_span(terrain, length, stream(seed, "guardrail", side))
        if scenario.roadside_guardrails and span:
            rails.append(roadside_guardrail(carriageway, *span, needs_guardrail(terrain), following()))
            objects[f"guardrail-{side}"] = rails[-1]
    posts = delineator_stations(axis.horizontal)
    for carriageway in sides.values() if scenario.delineators else ():
        objects |= dict(delineators(carriageway, posts, rails, following()))
    objects["terrain"] = terrain.model_copy(update={"instance": following()})
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
    """Return an alignment within the limits of its class, its middle at the local origin."""
    horizontal = HorizontalSampler(scenario, stream(seed, "alignment")).draw()
    elements = [Element(e.length, e.curvature_start, e.curvature_end) for e in horizontal]
    heading = stream(seed, "heading").uniform(-180.0, 180.0)
    middle = Alignment(elements, 0.0, 0.0, math.radians(heading)).position(scenario.length / 2)
    return AlignmentObject(
        instance=1,
        start_x=rounded(-middle[0]),
        start_y=rounded(-middle[1]),
        start_heading_deg=rounded(heading),
        horizontal=horizontal,
        vertical=sample_profile(scenario, stream(seed, "profile")),
    )


def _draw(rng: np.random.Generator, limits: Interval) -> float:
    return rounded(rng.uniform(limits.minimum, limits.maximum))


def _carriageway(
    scenario: RoadScenario, side: Literal["left", "right"], axis: AlignmentObject, instance: int
) -> Carriageway:
    section = STANDARD_CROSS_SECTIONS[scenario.cross_section]
    half_width = section.paved_width / 2.0
    return Carriageway(
        instance=instance,
        side=side,
        inner_offset=section.median / 2.0,
        hard_shoulder_width=section.hard_shoulder,
        outer_edge_strip_width=section.outer_edge_strip,
        lanes=tuple(Lane(width=width) for width in section.lanes),
        inner_edge_strip_width=section.inner_edge_strip,
        verge_width=section.verge,
        crossfall=crossfall_points(scenario.design_class, side, half_width, axis.horizontal),
    )


def _guardrail_span(terrain: Terrain, length: float, rng: np.random.Generator) -> tuple[float, float] | None:
    """Return stations between which a roadside guardrail stands, or None where the road is too short for one.

    A high and steep embankment needs it all along (RPS); elsewhere it stands along a part.
    """
    if needs_guardrail(terrain):
        return 0.0, length
    if length < 1.5 * SHORTEST_GUARDRAIL:
        return None
    start = rounded(length * rng.uniform(0.05, 0.2))
    return start, rounded(max(start + SHORTEST_GUARDRAIL, length * rng.uniform(0.75, 0.95)))


def _terrain(scenario: RoadScenario, seed: int) -> Terrain:
    rng = stream(seed, "terrain")
    return Terrain(
        instance=1,
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
