"""A road that is there as a site of the placement: with its turnouts, and what stands beside one carriageway."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count

from ...road.guidelines import BARRIER_DISTANCE, StandardCrossSection
from ...road.objects import RoadObject, Side, least_width, nominal_width
from ...road.parameters import RoadParameters
from ...road.section import Carriageway, LineMarking, Turnout
from ...road.structures.bridge import Bridge
from ...road.structures.tunnel import Tunnel
from ...road.surroundings import Terrain
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.guardrail import Guardrail
from ...road.things.noise_barrier import NoiseBarrier
from ...scenario.road import RoadScenario, TurnoutLimits
from ..placing.layout import BARRIER_AXIS, BarrierPiece, Layout
from ..placing.site import PlacementSite
from ..section import RampLimits

_FLAT = Terrain(instance=1, half_width=60.0, embankment_height=0.0, undulation=0.0, wavelength=100.0, seed=0)
"""Terrain of a road that has none."""
USUAL_FILM = 0.003
"""Thickness of markings on a road that has none, m; a parameter set's."""


def carriageway_ids(parameters: RoadParameters) -> dict[Side, str]:
    """Return the ids of a road's carriageways by side."""
    return {item.side: name for name, item in parameters.of_type(Carriageway).items()}


def scenario_of(parameters: RoadParameters, limits: TurnoutLimits) -> RoadScenario:
    """Return a scenario with a road's class, length and terrain, and with limits of turnouts."""
    terrain = parameters.terrain or _FLAT
    return RoadScenario(
        design_class=parameters.design_class,
        length=parameters.alignment.length,
        half_width=terrain.half_width,
        turnouts=limits,
    )


def site_of(parameters: RoadParameters, scenario: RoadScenario, turnouts: Mapping[str, Turnout]) -> PlacementSite:
    """Return a road with given turnouts as a site of the placement.

    Args:
        parameters: the road.
        scenario: see `scenario_of`.
        turnouts: by id, in place of the road's.
    """
    sides = {name: side for side, name in carriageway_ids(parameters).items()}
    return PlacementSite(
        scenario=scenario,
        seed=parameters.metadata.seed or 0,
        alignment=parameters.alignment,
        carriageways={item.side: item for item in parameters.of_type(Carriageway).values()},
        turnouts={
            name: item.model_copy(update={"carriageway": f"carriageway-{sides[item.carriageway]}"})
            for name, item in turnouts.items()
        },
        terrain=parameters.terrain or _FLAT,
        structures={**parameters.of_type(Bridge), **parameters.of_type(Tunnel)},
    )


def ramp_limits(parameters: RoadParameters, scenario: RoadScenario, carriageway: Carriageway) -> RampLimits:
    """Return the limits of ramps beside a carriageway that is there."""
    inner_offset = abs(least_width(carriageway.inner_offset))
    section = StandardCrossSection(
        lanes=tuple(nominal_width(lane.width) for lane in carriageway.lanes),
        hard_shoulder=nominal_width(carriageway.hard_shoulder_width),
        outer_edge_strip=nominal_width(carriageway.outer_edge_strip_width),
        inner_edge_strip=nominal_width(carriageway.inner_edge_strip_width),
        median=2.0 * inner_offset,
        verge=nominal_width(carriageway.verge_width),
    )
    elements = parameters.alignment.horizontal
    curvature = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in elements)
    return RampLimits(scenario, section, 1.0 / max(curvature, 1e-9))


def furnished_layout(parameters: RoadParameters, site: PlacementSite, side: Side) -> Layout:
    """Return a layout of a site in which the barriers and things beside one carriageway stand already.

    Args:
        parameters: the road, with all that stands on it.
        site: of it.
        side: of the carriageway.
    """
    layout = Layout(site)
    roadside = layout.sides[side]
    for item in parameters.objects.values():
        if not is_outside(item, site, side):
            continue
        if isinstance(item, Guardrail | ConcreteBarrier):
            roadside.pieces.append(piece_of(item, roadside.sign))
        elif isinstance(item, NoiseBarrier):
            roadside.far.add(item.start_station, item.end_station)
        elif hasattr(item, "station"):
            roadside.near.add(item.station - 0.5, item.station + 0.5)
    roadside.pieces.sort()
    return layout


def piece_of(item: Guardrail | ConcreteBarrier, sign: int) -> BarrierPiece:
    """Return the stretch of a barrier, and the line that its place is counted from."""
    axis = item.base_width / 2.0 + BARRIER_DISTANCE if isinstance(item, ConcreteBarrier) else BARRIER_AXIS
    return BarrierPiece(item.start_station, item.end_station, sign * item.offset - axis)


def is_outside(item: RoadObject, site: PlacementSite, side: Side) -> bool:
    """Return whether an object stands on the outer side of a carriageway, outside of its lanes and edge strip."""
    offset = getattr(item, "offset", None)
    station = getattr(item, "station", getattr(item, "start_station", None))
    if not isinstance(offset, float) or not isinstance(station, float) or isinstance(item, LineMarking):
        return False
    carriageway = site.carriageways[side]
    station = min(max(station, 0.0), site.length)
    return carriageway.sign * offset > float(site.sections[side].lane_boundaries(station)[0][0]) + nominal_width(
        carriageway.outer_edge_strip_width
    )


def free_ids(objects: Mapping[str, RoadObject], name: str) -> str:
    """Return an id that none of a road's objects has: the name, or it with a number."""
    return next(key for number in count(1) if (key := name if number == 1 else f"{name}-{number}") not in objects)
