"""Surroundings of a sampled road: ground, plants, traffic, light and weather, materials. Nothing drawn is rejected."""

import math
from collections.abc import Iterator, Mapping
from itertools import groupby, pairwise
from typing import Literal

import numpy as np

from ..base.arrays import Bool, Float, Index
from ..base.random_streams import stream
from ..base.schema import round_value
from ..materials.textures import texture_sets
from ..road.guidelines import LIMITS, SWALE_DEPTH_SHARE
from ..road.objects import AnyWidth, Color, RoadObject, Side, least_width, nominal_width, width_at, width_kinks
from ..road.parameters import AlignmentObject
from ..road.section_geometry import CarriagewaySection
from ..road.surroundings import Environment, MaterialVariation, Terrain, Vegetation, Vehicle
from ..road.terrain import fit_to_ground, road_elevation_model
from ..road.things.beacon import ConstructionBeacon
from ..road.things.limits import Interval
from ..road.things.temporary_barrier import TemporaryBarrier
from ..road.things.vehicles import COLORS, HEAVY_SPEED, VEHICLE_GAP, VEHICLE_LANE_WIDTH, VEHICLE_ROOM, VEHICLE_TYPES
from ..scenario.road import RoadScenario
from .forest import sample_forest_edges
from .pavement_damage import draw_materials
from .placing.draw import draw
from .placing.site import PlacementSite
from .sun_place import sun_angles

Kind = Literal["grass", "shrub", "tree"]

SHRUB_DISTANCE = 2.0
"""Shrubs stand at least so far (m) behind the verge, so that they don't grow over the pavement."""
MOST_SPECIES = {"grass": 2, "shrub": 3, "tree": 3}
"""Most species of a kind along one road."""
WEATHER = {
    "haze": (4000.0, 0.8),
    "fog": (400.0, 0.2),
    "rain": (7000.0, 0.3),
    "snow": (1500.0, 0.4),
    "dust": (2000.0, 0.6),
}
"""Bad weather -> visibility (m) and strength of the sun."""

_HIGHEST_SEED = 2**31
_MODELS = list(VEHICLE_TYPES)
_LIGHT_SUMS = np.cumsum([0.0 if kind.heavy else kind.weight for kind in VEHICLE_TYPES.values()])
_HEAVY_SUMS = np.cumsum([kind.weight if kind.heavy else 0.0 for kind in VEHICLE_TYPES.values()])
_COLORS = list(COLORS)
NARROWEST_DITCH = 0.5
"""Width of a ditch, m, below which there is none."""
_COLOR_SUMS = np.cumsum(list(COLORS.values()))


def _seed(rng: np.random.Generator) -> int:
    """Return a drawn seed for the random numbers of an object."""
    return int(rng.integers(_HIGHEST_SEED))


def sample_terrain(scenario: RoadScenario, seed: int) -> Terrain:
    """Return the terrain drawn from a seed within the scenario's intervals; its instance number is 1.

    The ground, the batter and the ditch have streams of their own, so that what is drawn for one never depends on how
    many numbers the others take. The order of the names is the order of the draws.
    """
    ground_stream, batter_stream = stream(seed, "terrain"), stream(seed, "terrain", "batter")
    ground_names = ("embankment_height", "undulation", "wavelength", "batter_slope")
    ground_fields = {name: draw(ground_stream, getattr(scenario, name)) for name in ground_names}
    batter_names = ("crest_length", "rounding_length", "swale_width")
    batter_fields = {name: draw(batter_stream, getattr(scenario, name)) for name in batter_names}
    batter_fields["swale_depth"] = round_value(batter_fields["swale_width"] * SWALE_DEPTH_SHARE)
    drawn_ditch_width = draw(stream(seed, "terrain", "ditch"), scenario.ditch_width)
    ditch_width = drawn_ditch_width if drawn_ditch_width >= NARROWEST_DITCH else 0.0
    return Terrain(
        instance=1,
        seed=_seed(ground_stream),
        **ground_fields,
        **batter_fields,
        ditch_width=ditch_width,
        ditch_depth=round_value(ditch_width * SWALE_DEPTH_SHARE),  # as steep as a swale
        half_width=scenario.half_width,
        elevation_model=scenario.elevation_model,
    )


def sample_environment(scenario: RoadScenario, seed: int) -> Environment:
    """Return the drawn light and weather of a seed."""
    rng, limits = stream(seed, "environment"), scenario.environment
    names = ("sun_azimuth_deg", "sun_elevation_deg", "cloud_cover")
    light = {name: draw(rng, getattr(limits, name)) for name in names}
    if limits.sun_place == "time":
        time_stream = stream(seed, "environment", "time of day")
        hour, day = draw(time_stream, limits.time_of_day), round(draw(time_stream, limits.day_of_year))
        light["sun_azimuth_deg"], light["sun_elevation_deg"] = map(
            round_value, sun_angles(hour, day, limits.latitude_deg)
        )
    is_wet, wetness = rng.random() < limits.wet, draw(rng, limits.wetness)
    if rng.random() < limits.bad_weather:
        weather = list(WEATHER)[rng.integers(len(WEATHER))]
        light["visibility"], light["sun_strength"] = WEATHER[weather]
    else:
        weather = "clear"
    season: Literal["summer", "winter"] = "winter" if rng.random() < limits.winter else "summer"
    wetness = wetness if is_wet or weather == "rain" else 0.0
    return Environment(wetness=wetness, weather=weather, season=season, **light)


def sample_materials(scenario: RoadScenario, seed: int) -> MaterialVariation:
    """Return the drawn variation of a road's materials from the mean ones, with a set of textures where there are any.

    Raises:
        InputError: the folder of textures can't be read, see `materials.textures.texture_sets`.
    """
    draws = draw_materials(scenario.materials, seed)
    values = {name: value for name, value in draws.items() if name in MaterialVariation.model_fields}
    sets = {} if scenario.textures is None else texture_sets(scenario.textures)
    textures = tuple(
        choices[stream(seed, "textures", name).integers(len(choices))] for name, choices in sorted(sets.items())
    )
    return MaterialVariation(**values, textures=textures)


# --- plants ----------------------------------------------------------------------------------------------------------


def sample_vegetation(site: PlacementSite) -> Iterator[tuple[str, Vegetation]]:
    """Yield (id, stand of plants), species by species; their instance numbers are 1.

    Grass grows everywhere beside the road. Shrubs follow behind the verge, one species after the other. Trees mix, and
    grow where they are no obstacle that needed a barrier (RPS). Forest edges stand along parts of the road.
    """
    scenario, limits = site.scenario, site.scenario.vegetation
    room = _room_beside(site)
    mown = draw(site.stream("mown strip"), limits.mown_width)
    for name, grass in _mix_species(site, "grass", limits.grasses, scenario.grass_density, limits.grass_height, 0.0):
        yield name, grass.model_copy(update={"mown_width": mown})
    yield from _shrub_belts(site, room)
    first_tree = _first_tree(site)
    if first_tree < room:
        density = scenario.trees_per_hectare / 10_000.0
        yield from _mix_species(site, "tree", limits.trees, density, limits.tree_height, first_tree)
    yield from sample_forest_edges(site, room, first_tree)


def _room_beside(site: PlacementSite) -> float:
    """Return the largest width (m) of ground between a verge and the terrain's end, where the road has all lanes."""
    edges = []
    for road in site.carriageways.values():
        strips = (road.inner_edge_strip_width, road.outer_edge_strip_width, road.hard_shoulder_width, road.verge_width)
        widths = (road.inner_offset, *strips, *(lane.width for lane in road.lanes))
        edges.append(math.fsum(nominal_width(width) for width in widths))
    return site.terrain.half_width - min(edges)


def _first_tree(site: PlacementSite) -> float:
    """Return the distance (m) behind the verge from which trees may stand beside either carriageway."""
    narrowest_verge = min(least_width(road.verge_width) for road in site.carriageways.values())
    return round_value(max(0.0, LIMITS[site.design_class].obstacle_distance - narrowest_verge))


def _draw_species(rng: np.random.Generator, kind: Kind, names: tuple[str, ...]) -> list[str]:
    """Return some drawn species of a kind in random order; reed is not the first of several."""
    distinct = list(dict.fromkeys(names))
    shuffled = [distinct[i] for i in rng.permutation(len(distinct))]
    if shuffled[0] == "reed":
        shuffled[:2] = shuffled[1::-1]
    return shuffled[: rng.integers(1, min(len(shuffled), MOST_SPECIES[kind]) + 1)]


def _mix_species(
    site: PlacementSite, kind: Kind, names: tuple[str, ...], density: float, heights: Interval, band_start: float
) -> Iterator[tuple[str, Vegetation]]:
    """Yield (id, stand) of species that share a density (1/m2), the first most of it, from ``band_start`` (m) on."""
    if density <= 0.0:
        return
    rng = site.stream(kind)
    species = _draw_species(rng, kind, names)
    shares = sorted(rng.uniform(0.5, 1.5, len(species)).tolist(), reverse=True)
    for name, part in zip(species, shares, strict=True):
        band = (band_start, site.terrain.half_width)
        yield _plants(rng, kind, name, round_value(density * part / math.fsum(shares)), band, heights)


def _shrub_belts(site: PlacementSite, room: float) -> Iterator[tuple[str, Vegetation]]:
    """Yield (id, stand) of the shrubs, each species in a belt of its own behind that of the one before."""
    limits, density = site.scenario.vegetation, round_value(site.scenario.shrubs_per_hectare / 10_000.0)
    if density <= 0.0 or room <= SHRUB_DISTANCE:
        return
    rng = site.stream("shrub")
    species = _draw_species(rng, "shrub", limits.shrubs)
    inner_borders = np.sort(rng.uniform(SHRUB_DISTANCE, room, len(species) - 1))
    borders = [SHRUB_DISTANCE, *map(round_value, inner_borders), site.terrain.half_width]
    for name, band in zip(species, pairwise(borders), strict=True):
        yield _plants(rng, "shrub", name, density, band, limits.shrub_height)


def _plants(
    rng: np.random.Generator, kind: Kind, species: str, density: float, band: tuple[float, float], heights: Interval
) -> tuple[str, Vegetation]:
    """Return the plants of a species in a band beside the road, with heights drawn within limits, and their name."""
    least_height, largest_height = sorted((draw(rng, heights), draw(rng, heights)))
    plants = Vegetation(
        instance=1,
        kind=kind,
        species=species,
        density=density,
        band_start=band[0],
        band_end=band[1],
        height_min=least_height,
        height_max=largest_height,
        seed=_seed(rng),
    )
    return f"{kind}-{species}", plants


# --- traffic ---------------------------------------------------------------------------------------------------------


def sample_vehicles(site: PlacementSite, objects: Mapping[str, RoadObject]) -> Iterator[tuple[str, Vehicle]]:
    """Yield (id, vehicle) of the drawn traffic; their instance numbers are 1.

    They are `VEHICLE_GAP` apart at the time 0 and remain so: in each lane the faster drive ahead of the slower.

    Args:
        site: the road.
        objects: what stands on it: lanes that beacons or temporary barriers cross are closed.
    """
    limits = site.scenario.vehicles
    for side, section in site.sections.items():
        rng = site.stream("vehicles", side)
        per_km, heavy_share = draw(rng, limits.per_km), draw(rng, limits.trucks)
        stretches = _open_stretches(section, site.length, _closures(side, objects))
        number = int(per_km * site.length / 1000.0 + rng.random())
        traffic = _traffic(rng, stretches, rng.random(number) < heavy_share, limits.speed)
        colors = iter(_draw_indices(rng, _COLOR_SUMS, number).tolist())
        count = 0
        for lane, queue in groupby(traffic, key=lambda vehicle: vehicle[0]):
            vehicles = list(queue)
            stretch, lengths = stretches[lane].tolist(), [VEHICLE_TYPES[model].length for _, _, model in vehicles]
            stations = queue_vehicles(rng, lengths, stretch, section.carriageway.traffic)
            for station, (_, speed, model) in zip(stations, vehicles, strict=False):
                count += 1
                vehicle = Vehicle(
                    instance=1,
                    model=model,
                    carriageway=f"carriageway-{side}",
                    lane=lane,
                    station=round_value(station),
                    speed=speed,
                    color=_COLORS[next(colors)],
                )
                yield f"vehicle-{side}-{count}", vehicle


def _closures(side: Side, objects: Mapping[str, RoadObject]) -> Float:
    """Return stations and distances from the centreline (N, 2), m, of what closes lanes of a carriageway."""
    places = []
    for item in objects.values():
        if isinstance(item, ConstructionBeacon):
            places.append((item.station, item.offset))
        elif isinstance(item, TemporaryBarrier):
            places += [(item.start_station, item.offset), (item.end_station, item.end_offset)]
    closures = np.array(places, dtype=np.float64).reshape(-1, 2) * (1.0, 1.0 if side == "left" else -1.0)
    return closures[closures[:, 1] > 0.0]


def _open_stretches(section: CarriagewaySection, length: float, closures: Float) -> Float:
    """Return begin and end (lanes, 2), m, of the longest drivable part of each lane, the outermost lane first.

    A lane is open where it is wide enough, and closed altogether if anything that closes lanes, or the ground between
    two such things, is in the way of its vehicles. Beginning and end are the same where there is no open part.
    """
    lanes = section.carriageway.lanes
    stretches = np.array([_wide_stretch(lane.width, length) for lane in lanes])
    if len(closures):
        boundaries = section.lane_boundaries(closures[:, 0])
        centres = (boundaries[:, :-1] + boundaries[:, 1:]) / 2.0
        nearest, farthest = closures[:, 1].min() - VEHICLE_ROOM, closures[:, 1].max() + VEHICLE_ROOM
        stretches[((centres > nearest) & (centres < farthest)).any(axis=0)] = 0.0
    return stretches


def _wide_stretch(width: AnyWidth, length: float) -> tuple[float, float]:
    """Return begin and end, m, of the longest part of a lane that is wide enough to drive on; 0, 0 without."""
    if not isinstance(width, tuple):
        return 0.0, length if width >= VEHICLE_LANE_WIDTH else 0.0
    kinks = np.unique([0.0, length, *(s for s in width_kinks(width) if 0.0 < s < length)])
    spare_width = width_at(width, kinks) - VEHICLE_LANE_WIDTH
    crossing_intervals = np.flatnonzero(spare_width[:-1] * spare_width[1:] < 0.0)
    share = spare_width[crossing_intervals] / (spare_width[crossing_intervals] - spare_width[crossing_intervals + 1])
    borders = np.unique([*kinks, *(kinks[crossing_intervals] + share * np.diff(kinks)[crossing_intervals])])
    is_wide = width_at(width, (borders[:-1] + borders[1:]) / 2.0) >= VEHICLE_LANE_WIDTH
    changes = np.flatnonzero(np.diff(np.concatenate([[False], is_wide, [False]]).astype(np.int8)))
    starts, ends = borders[changes[0::2]], borders[changes[1::2]]
    if not len(starts):
        return 0.0, 0.0
    longest = np.argmax(ends - starts)
    return float(starts[longest]), float(ends[longest])


def _traffic(
    rng: np.random.Generator, stretches: Float, is_heavy: Bool, limits: Interval
) -> list[tuple[int, float, str]]:
    """Return sorted (lane, speed in m/s, model) of drawn vehicles; none where every lane is closed.

    The outer lanes have most. Heavy vehicles drive in the outermost, and of three or more in the second as well; where
    these are closed there are none.
    """
    count = len(stretches)
    sums = np.cumsum(np.arange(count, 0, -1) * (stretches[:, 1] - stretches[:, 0]))
    outer_sums = sums[: 2 if count > 2 else 1]
    if sums[-1] == 0.0:
        return []
    if outer_sums[-1] == 0.0:
        is_heavy = np.zeros_like(is_heavy)
    lanes = np.where(is_heavy, _draw_indices(rng, outer_sums, len(is_heavy)), _draw_indices(rng, sums, len(is_heavy)))
    models = np.where(
        is_heavy, _draw_indices(rng, _HEAVY_SUMS, len(is_heavy)), _draw_indices(rng, _LIGHT_SUMS, len(is_heavy))
    )
    highest_speeds = np.where(is_heavy, min(HEAVY_SPEED, limits.maximum), limits.maximum)
    speeds = limits.minimum + (highest_speeds - limits.minimum) * rng.random(len(is_heavy))
    rows = zip(lanes.tolist(), speeds.tolist(), models.tolist(), highest_speeds.tolist(), strict=True)
    return sorted(
        (lane, min(round_value(speed), highest_speed), _MODELS[model]) for lane, speed, model, highest_speed in rows
    )


def draw_looks(rng: np.random.Generator, is_heavy: Bool) -> list[tuple[str, Color]]:
    """Return the models and colours of vehicles, of which some are heavy (N,)."""
    count = len(is_heavy)
    models = np.where(is_heavy, _draw_indices(rng, _HEAVY_SUMS, count), _draw_indices(rng, _LIGHT_SUMS, count))
    colors = _draw_indices(rng, _COLOR_SUMS, count)
    return [(_MODELS[model], _COLORS[color]) for model, color in zip(models.tolist(), colors.tolist(), strict=True)]


def _draw_indices(rng: np.random.Generator, sums: Float, number: int) -> Index:
    """Return drawn indices (number,) from 0 to N - 1, whose weights have the running sums (N,)."""
    return sums.searchsorted(rng.random(number) * sums[-1], side="right")


def queue_vehicles(
    rng: np.random.Generator, lengths: list[float], stretch: list[float], traffic: int
) -> Iterator[float]:
    """Yield the stations (m) of the middles of vehicles that follow each other, the hindmost first.

    Between them is the least gap and their shares of what it leaves free. Those that find no room are left out.

    Args:
        lengths: of the vehicles, m.
        stretch: stations between which they are, m.
        traffic: 1 where they drive with the stations, -1 against them.
    """
    start, end = stretch
    middles, front_end = [], -VEHICLE_GAP
    for length in lengths:
        if front_end + VEHICLE_GAP + length > end - start:
            break
        middles.append(front_end + VEHICLE_GAP + length / 2.0)
        front_end += VEHICLE_GAP + length
    for middle, share in zip(middles, sorted(rng.random(len(middles)).tolist()), strict=True):
        driven_distance = middle + share * (end - start - front_end)
        yield start + driven_distance if traffic > 0 else end - driven_distance


def origin_on_ground(scenario: RoadScenario, axis: AlignmentObject, terrain: Terrain) -> tuple[float, float, float]:
    """Return the local origin's map coordinates, m: the scenario's, the height fitted to its elevation model.

    Raises:
        InputError: the elevation model is missing, unreadable or unfit for this road.
    """
    east, north, height = scenario.map_origin
    if terrain.elevation_model is None:
        return east, north, height
    model = road_elevation_model(terrain.elevation_model, scenario.epsg, axis, (east, north), terrain.half_width)
    return fit_to_ground(axis, (east, north), model, terrain.embankment_height)
