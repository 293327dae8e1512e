"""From a seed and limits to one road. Rules hold by construction: nothing is drawn and rejected."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import count
from typing import Any

from ..base.errors import InputError
from ..base.maps.crs import EPSG_URI
from ..base.random_streams import stream
from ..base.schema import round_value
from ..base.version import generator
from ..road.geometry import alignment_of
from ..road.given_road import GivenRoad
from ..road.guidelines import EXIT_SEQUENCE, EXIT_SIGN_ROOM, is_single
from ..road.objects import RoadObject, Side
from ..road.parameters import AlignmentObject, Metadata, RoadParameters, Transform
from ..road.section import Carriageway, LineMarking, Median, Turnout
from ..scenario.road import RoadScenario
from .alignment import HorizontalSampler, sample_profile
from .conflicts import check_conflicts
from .interchanges.clear_ground import clear_of_interchange
from .interchanges.furniture import interchange_furniture
from .interchanges.interchange import sample_interchange, with_room_for_interchange
from .interchanges.traffic import interchange_traffic
from .landscape import sample_landscape
from .markings import place_markings
from .placing.assets import sample_assets
from .placing.draw import draw
from .placing.furniture import place_furniture
from .placing.roadside import place_roadside
from .placing.site import PlacementSite
from .placing.village_plan import BESIDE_VILLAGE, sample_villages
from .section import SIDES, CarriagewaySampler
from .side_roads import sample_side_roads
from .structures import fit_verges, sample_structures
from .surroundings import (
    origin_on_ground,
    sample_environment,
    sample_materials,
    sample_terrain,
    sample_vegetation,
    sample_vehicles,
)
from .villages.islands import widen_at_islands
from .villages.things import outside_villages, place_villages, village_markings
from .villages.trenches import dig_trenches

USUAL_FILM = 0.003
"""Thickness of a marking's film where a road has no other marking, m."""


def sample_road(
    scenario: RoadScenario,
    seed: int,
    title: str = "",
    axis: AlignmentObject | None = None,
    given: GivenRoad | None = None,
) -> RoadParameters:
    """Return the parameter set of a road drawn from a seed within a scenario's limits.

    Args:
        scenario: limits of what is drawn.
        seed: the same seed and limits give the same road on every machine.
        title: title for people.
        axis: take this alignment (instance 1) instead of drawing one; its coordinates are local. It may break the
            rules of its design class.
        given: parts along that alignment that are taken as they are; the rest is drawn around them.

    Raises:
        InputError: limits contradict each other; the message names them all.

    Example:
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> road = sample_road(RoadScenario(length=200.0, cross_section="RQ31"), seed=7)
        >>> [len(road.carriageway(side).lanes) for side in ("left", "right")]
        [2, 2]
        >>> road == sample_road(RoadScenario(length=200.0, cross_section="RQ31"), seed=7)
        True
    """
    if axis:
        scenario = scenario.model_copy(update={"length": round_value(axis.length)})
    check_conflicts(scenario, with_axis=axis is not None)
    if given is not None and scenario.interchange.kind != "none":
        text = "the parts of this road are given, so that no interchange can be drawn: make it none"
        raise InputError("interchange.kind", scenario.interchange.kind, text)
    scenario = with_room_for_interchange(scenario)
    site = _sample_site(scenario, seed, axis or sample_alignment(scenario, seed), given)
    objects: dict[str, Any] = {"alignment": site.alignment}
    numbers = count(2)

    def add(items: Iterable[tuple[str, RoadObject]]) -> None:
        """Add objects under free ids, each with the next instance number."""
        for name, item in list(items):
            objects[_free_id(name, objects)] = item.model_copy(update={"instance": next(numbers)})

    add(_structure(site))
    add(
        outside_villages(site, place_markings(site))
        if given is None or given.markings is None
        else given.markings.items()
    )
    add(village_markings(site, _film_of(objects)) if site.villages else ())
    fixed_things = None if given is None else given.things
    if fixed_things is not None:
        add(fixed_things.items())
    else:
        add(place_villages(site))
        add(outside_villages(site, place_furniture(site)))
        add(outside_villages(site, place_roadside(site, objects)))
    if site.interchange:
        objects = clear_of_interchange(site, objects)
        add(interchange_furniture(site, objects) if fixed_things is None else ())
    add([("terrain", site.terrain)])
    add(sample_vegetation(site))
    add(sample_vehicles(site, objects))
    add(interchange_traffic(site) if site.interchange else ())
    if fixed_things is None:
        add(sample_assets(site))
    add([("landscape", sample_landscape(site))])
    origin = origin_on_ground(scenario, site.alignment, site.terrain)
    section = scenario.cross_section.lower() if isinstance(scenario.cross_section, str) else "free"
    return RoadParameters(
        metadata=Metadata(
            identifier=f"{section}-{scenario.design_class.lower()}-{seed}",
            title=title,
            seed=seed,
            generator=generator(),
            referenceSystem=EPSG_URI.format(scenario.epsg),
            heightReferenceSystem=EPSG_URI.format(scenario.height_epsg) if scenario.height_epsg else None,
        ),
        # A given axis has heights of its own.
        transform=Transform(translate=scenario.map_origin if axis else origin),
        design_class=scenario.design_class,
        environment=sample_environment(scenario, seed),
        materials=sample_materials(scenario, seed),
        objects=objects,
    )


def _free_id(name: str, objects: Mapping[str, Any]) -> str:
    """Return an id, with a number where what is given has it already."""
    free_name, count = name, 1
    while free_name in objects:
        count += 1
        free_name = f"{name[:56]}-{count}"
    return free_name


def sample_alignment(scenario: RoadScenario, seed: int) -> AlignmentObject:
    """Return a drawn alignment within the limits of its design class, its middle at the local origin.

    Example:
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> axis = sample_alignment(RoadScenario(length=500.0), seed=1)
        >>> round(sum(element.length for element in axis.horizontal), 3)
        500.0
    """
    rng = stream(seed, "alignment")
    heading = round_value(rng.uniform(-180.0, 180.0), 6)
    axis = AlignmentObject(
        instance=1,
        start_x=0.0,
        start_y=0.0,
        start_heading_deg=heading,
        horizontal=HorizontalSampler(scenario, rng).draw(),
        vertical=sample_profile(scenario, stream(seed, "profile")),
    )
    x, y = alignment_of(axis).position(scenario.length / 2.0).tolist()
    return axis.model_copy(update={"start_x": round_value(-x, 3), "start_y": round_value(-y, 3)})


def _sample_site(
    scenario: RoadScenario, seed: int, axis: AlignmentObject, fixed_parts: GivenRoad | None
) -> PlacementSite:
    """Return a drawn road without what stands on and beside it: axis, carriageways, turnouts and terrain."""
    sampler = CarriagewaySampler(scenario, seed, axis)
    carriageways: dict[Side, Carriageway] = {}
    turnouts: dict[str, Turnout] = {}
    if fixed_parts is not None and fixed_parts.carriageways:
        carriageways = {
            side: sampler.pave(fixed_parts.carriageways[side]) for side in SIDES if side in fixed_parts.carriageways
        }
        return PlacementSite(
            scenario, seed, axis, carriageways, dict(fixed_parts.turnouts), sample_terrain(scenario, seed)
        )
    for side in SIDES:
        crossfall = None if fixed_parts is None else fixed_parts.crossfall.get(side)
        carriageways[side], turnouts_of_side = sampler.draw(side, crossfall)
        turnouts |= turnouts_of_side
    terrain = sample_terrain(scenario, seed)
    villages = sample_villages(scenario, seed, axis.length, carriageways) if fixed_parts is None else ()
    carriageways = widen_at_islands(villages, dig_trenches(scenario, seed, villages, carriageways))
    # A carriageway has street sides or turnouts: drawn bays give way.
    streets = {street.carriageway for village in villages for street in village.streets.values()}
    turnouts = {name: item for name, item in turnouts.items() if item.carriageway not in streets}
    taken: dict[Side, list[tuple[float, float]]] = {
        side: [
            *((item.start_station, item.end_station) for item in turnouts.values() if item.carriageway == road_id),
            *((village.start - BESIDE_VILLAGE, village.end + BESIDE_VILLAGE) for village in villages),
        ]
        for side, road_id in ((side, f"carriageway-{side}") for side in carriageways)
    }
    side_roads = sample_side_roads(scenario, seed, axis, carriageways, taken) if fixed_parts is None else {}
    site = PlacementSite(scenario, seed, axis, carriageways, turnouts, terrain, villages, side_roads)
    spans = [stretch for stretches in taken.values() for stretch in stretches]
    if scenario.interchange.kind == "none":
        return _with_structures(site, spans, carriageways)
    interchange = sample_interchange(scenario, seed, site.geometry, _cap_width(scenario, seed))
    if interchange is None:
        return _with_structures(site, spans, carriageways)
    site = replace(
        site,
        turnouts=interchange.turnouts,
        interchange=interchange,
        carriageways=interchange.carriageways,
        structures=dict(interchange.structures),
    )
    return _with_structures(site, [*spans, interchange.stretch], carriageways)


def _cap_width(scenario: RoadScenario, seed: int) -> float:
    """Return the drawn width of the caps of a road's bridges, m."""
    return draw(stream(seed, "bridges", "caps"), scenario.bridges.cap_width)


def _with_structures(
    site: PlacementSite, taken: list[tuple[float, float]], plain: Mapping[Side, Carriageway]
) -> PlacementSite:
    """Return a site with drawn bridges and tunnels, whose caps' and walkways' widths its verges have there.

    Args:
        site: a road without any but an interchange's.
        taken: stations (m) between which there are bays, villages or an interchange.
        plain: its carriageways, their verges as they are without structures.
    """
    mouths = [(mouth.start, mouth.end) for mouth in site.mouths.values()]
    taken = [*taken, *mouths, *_exit_signs(site)]
    structures = sample_structures(site.scenario, site.seed, site.alignment, site.carriageways, taken)
    if not structures:
        return site
    structures = site.structures | structures
    cap_width = _cap_width(site.scenario, site.seed)
    walkway_width = draw(stream(site.seed, "tunnels", "walkways"), site.scenario.tunnels.walkway_width)
    carriageways = {
        side: fit_verges(item, structures.values(), cap_width, walkway_width) for side, item in plain.items()
    }
    return replace(site, carriageways=carriageways, structures=structures)


def _exit_signs(site: PlacementSite) -> Iterator[tuple[float, float]]:
    """Yield the stations (m) between which the signs that announce an exit have room enough."""
    for side, carriageway in site.carriageways.items():
        for turnout in site.turnouts_of_kind(side, "exit"):
            for distance in EXIT_SEQUENCE:
                station = site.begin(turnout) - carriageway.traffic * distance
                yield station - EXIT_SIGN_ROOM / 2.0, station + EXIT_SIGN_ROOM / 2.0


def _structure(site: PlacementSite) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of the median, the carriageways and the turnouts."""
    if len(site.carriageways) > 1 and not is_single(site.design_class):
        yield "median", Median(instance=1)
    for side, carriageway in site.carriageways.items():
        yield f"carriageway-{side}", carriageway
    yield from site.turnouts.items()
    yield from site.side_roads.items()
    yield from site.structures.items()
    if site.interchange:
        yield from site.interchange.objects().items()
    for side in site.carriageways:
        yield from site.streets_of(side).items()


def _film_of(objects: Mapping[str, Any]) -> float:
    """Return the thickness (m) of the films of a road's markings, which are all alike; the usual one without any."""
    films = (item.film_thickness for item in objects.values() if isinstance(item, LineMarking))
    return next(films, USUAL_FILM)
