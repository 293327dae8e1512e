"""Limits on which each field of `RoadScenario` matters, and what of it is changed to see that."""

from dataclasses import dataclass, field
from typing import Any

from synthroads_addon.road.things.limits import Interval
from synthroads_addon.scenario.changes import ChangeLimits
from tests.helpers.effects.road_cases import ELEVATIONS, FILES, TEXTURES

Data = dict[str, Any]

NO_CHANGES = FILES / "no_changes.json"
ENDS = ("minimum", "maximum")
SEEDS = range(30)
"""Seeds that a limit may show itself with: what has a small share is drawn with few."""
LIMITS: Data = {
    "length": 1300.0,
    "cross_section": "RQ36",
    "half_width": 40.0,
    "radius": {"minimum": 1000.0, "maximum": 3000.0},
    "grade_percent": {"minimum": -3.0, "maximum": 3.0},
    "lane_changes": {"share": 1.0},
    "turnouts": {"exits": 1.0, "entries": 1.0, "emergency_bays": 1.0},
    "pavement": {"rutted": 1.0},
    "barriers": {"noise_barrier": 1.0},
    "furniture": {
        "gantries": 1.0,
        "lighting": 1.0,
        "surveillance": 1.0,
        "traffic_lights": 1.0,
        "overpass": 1.0,
        "gantry_spacing": 400.0,
    },
    "roadside": {"fences": 1.0, "power_line": 1.0, "hedges_per_km": {"minimum": 4.0, "maximum": 8.0}},
    "environment": {"wet": 1.0},
    "grass_density": 0.01,
}
"""Limits of roads on which nearly everything is; as JSON data."""
PLAIN: Data = {"length": 2500.0, "turnouts": {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0}}
"""Limits of roads on which there is room for long things."""
YARDS: Data = PLAIN | {
    "half_width": 100.0,
    "roadside": {
        "buildings_per_km": {"minimum": 4.0, "maximum": 8.0},
        "walls": 1.0,
        "parked_per_building": {"minimum": 1.0, "maximum": 3.0},
    },
}
"""Limits of roads with buildings beside them."""
FORESTS: Data = PLAIN | {
    "length": 1300.0,
    "vegetation": {"forest_edges_per_km": {"minimum": 2.0, "maximum": 4.0}},
    "grass_density": 0.01,
}
"""Limits of roads with forest edges beside them."""
VILLAGE: Data = {"cross_section": "RQ11", "length": 500.0, "villages": {"share": 1.0}}
"""Limits of roads that lead through a village."""
ISLANDS: Data = VILLAGE | {"villages": {"share": 1.0, "islands": 1.0, "length": {"minimum": 350.0, "maximum": 400.0}}}
"""Limits of roads with traffic islands at the ends of their village."""
ISLAND_INTERVALS = ("island_width", "island_length", "island_taper")
VILLAGE_LIMITS = ("gutters", "parking", "occupied", "crossing", "bus_stop", "trenches", "slow")
OVERTAKING: Data = {
    "cross_section": "RQ15.5",
    "length": 1500.0,
    "overtaking": {"share": 1.0, "section_length": {"minimum": 300.0, "maximum": 500.0}},
    "grass_density": 0.01,
}
"""Limits of roads whose overtaking lanes change sides."""
VILLAGE_INTERVALS = ("length", "kerb_height", "footway_width", "bay_width", "plot_length", "house_distance")
LIGHT_INTERVALS = ("light_spacing", "light_height")
ZONE = PLAIN | {"furniture": {"construction_zone": 1.0}}
COUNTRY: Data = {
    "cross_section": "RQ11",
    "length": 1300.0,
    "half_width": 40.0,
    "turnouts": {"bus_bays": 1.0, "laybys": 1.0},
    "furniture": {"entrances_per_km": {"minimum": 6.0, "maximum": 12.0}, "tracks": 0.5, "town_signs": 0.5},
    "roadside": {"avenues": 1.0, "avenue_unprotected": 0.5},
    "ditch_width": {"minimum": 1.5, "maximum": 2.0},
    "embankment_height": {"minimum": 0.8, "maximum": 1.5},
    "grass_density": 0.01,
}
"""Limits of country roads on which nearly everything is."""
PLACES = PLAIN | {
    "turnouts": PLAIN["turnouts"]
    | {
        "places": [
            {"kind": "exit", "side": "right", "station": 500.0, "taper_length": 40.0, "lane_length": 260.0}
            | {"lane_width": 3.6, "ramp_length": 90.0, "ramp_clothoid": 95.0}
        ]
    },
}
"""Limits of roads with a stated exit."""
SIDE_ROADS: Data = {
    "cross_section": "RQ11",
    "length": 1300.0,
    "half_width": 80.0,
    "side_roads": {"per_km": {"minimum": 3.0, "maximum": 5.0}, "tracks": 0.5, "stop_lines": 0.5},
    "grass_density": 0.01,
}
"""Limits of country roads that side roads join."""
SIDE_ROAD_INTERVALS = ("angle_deg", "lane_width", "track_width", "radius", "length", "grade_percent", "blend_length")
INTERCHANGE: Data = {
    "length": 1800.0,
    "interchange": {"kind": "diamond", "design_speed": {"minimum": 30.0, "maximum": 40.0}},
    "grass_density": 0.01,
}
"""Limits of motorways with an interchange."""
INTERCHANGE_INTERVALS = (
    *("design_speed", "radius", "grade", "crest_radius", "distance", "lane_width", "corner_radius", "clearance"),
    "vehicles_per_km",
    *("edge_strip_width", "curve_crossfall"),
)
HALF_CLOVER: Data = {**INTERCHANGE, "interchange": {**INTERCHANGE["interchange"], "kind": "half_clover"}}
"""Limits of motorways with a half clover."""
CLOVER_INTERVALS = ("loop_radius", "loop_crossfall", "ramp_spacing")
ONE_OR_TWO = {"minimum": 1.0, "maximum": 2.0}
BRIDGES: Data = {
    "cross_section": "RQ11",
    "length": 1300.0,
    "bridges": {"per_km": ONE_OR_TWO, "high_railings": 0.5},
    "grass_density": 0.01,
}
"""Limits of country roads with bridges."""
TUNNELS: Data = {"cross_section": "RQ11", "length": 1300.0, "tunnels": {"per_km": ONE_OR_TWO}, "grass_density": 0.01}
"""Limits of country roads with tunnels."""
BRIDGE_INTERVALS = ("per_km", "length", "span", "valley_depth", "clearance", "cap_width", "kerb_height", "wing_length")
TUNNEL_INTERVALS = ("per_km", "length", "height", "cover", "walkway_width")
OFTEN = {"minimum": 10.0, "maximum": 20.0}
CHANGING: Data = {
    "length": 400.0,
    "barriers": {"noise_barrier": 1.0},
    "changes": {
        **dict.fromkeys(("settlements", "overlays", "marked_anew", "construction_zones"), 1.0),
        **dict.fromkeys(("things_per_km", "hits_per_km", "cracks_per_km", "patches_per_km", "parked_per_km"), OFTEN),
        "cut_back": 0.5,
        "worn_lines": 0.5,
    },
}
"""Limits of roads to which much happens."""
CHANGE_INTERVALS = tuple(name for name, info in ChangeLimits.model_fields.items() if info.annotation is Interval)
CHANGE_SHARES = ("cut_back", "settlements", "overlays", "marked_anew", "construction_zones", "worn_lines")
FREE = {"cross_section": {"lanes": [3.75, 3.75, 3.75], "hard_shoulder": 2.5}}


@dataclass(frozen=True)
class LimitCase:
    """How a limit is looked at, as far as that doesn't follow from its type.

    Attributes:
        value: another value; if None what `other_values` takes, and the middle of an interval for either of its ends.
        given: limits in place of `LIMITS`.
    """

    value: Any = None
    given: Data = field(default_factory=lambda: LIMITS)


CASES: dict[str, LimitCase] = {
    "cross_section": LimitCase(value="RQ36", given=PLAIN),
    **{
        f"cross_section.{name}": LimitCase(given=FREE)
        for name in ("lanes", "hard_shoulder", "outer_edge_strip", "inner_edge_strip", "median", "verge")
    },
    "design_class": LimitCase(value="EKA2", given=FREE | {"length": 3000.0}),
    "lanes": LimitCase(value=2, given=PLAIN),
    "interchange.kind": LimitCase(value="diamond", given=PLAIN),
    **{f"interchange.{name}": LimitCase(given=INTERCHANGE) for name in ("stop_lines", "lighting", "waiting")},
    "interchange.crossing": LimitCase(value="under", given=INTERCHANGE),
    "interchange.loops": LimitCase(value="entries", given=HALF_CLOVER),
    **{f"interchange.{name}.{end}": LimitCase(given=HALF_CLOVER) for name in CLOVER_INTERVALS for end in ENDS},
    **{f"interchange.{name}.{end}": LimitCase(given=INTERCHANGE) for name in INTERCHANGE_INTERVALS for end in ENDS},
    **{f"bridges.{name}": LimitCase(given=BRIDGES) for name in ("high_railings", "h4b")},
    **{f"bridges.{name}.{end}": LimitCase(given=BRIDGES) for name in BRIDGE_INTERVALS for end in ENDS},
    **{f"tunnels.{name}": LimitCase(given=TUNNELS) for name in ("vaults", "fans")},
    **{f"tunnels.{name}.{end}": LimitCase(given=TUNNELS) for name in TUNNEL_INTERVALS for end in ENDS},
    "changes.list_of": LimitCase(value=str(NO_CHANGES), given=CHANGING),
    "changes.kinds": LimitCase(value=["moved"], given=CHANGING),
    "changes.years": LimitCase(given=CHANGING),
    **{f"changes.{name}": LimitCase(given=CHANGING) for name in CHANGE_SHARES},
    **{f"changes.{name}.{end}": LimitCase(given=CHANGING) for name in CHANGE_INTERVALS for end in ENDS},
    "villages.share": LimitCase(value=0.0, given=VILLAGE),
    **{f"villages.{name}": LimitCase(given=VILLAGE) for name in VILLAGE_LIMITS},
    **{
        f"villages.{name}.{end}": LimitCase(given=VILLAGE)
        for name in (*VILLAGE_INTERVALS, *LIGHT_INTERVALS)
        for end in ENDS
    },
    "villages.islands": LimitCase(value=1.0, given=VILLAGE),
    "villages.one_sided_islands": LimitCase(value=0.0, given=ISLANDS),
    "villages.shelters": LimitCase(value=1.0, given=VILLAGE | {"villages": {"share": 1.0, "bus_stop": 1.0}}),
    **{f"villages.{name}.{end}": LimitCase(given=ISLANDS) for name in ISLAND_INTERVALS for end in ENDS},
    "overtaking.share": LimitCase(value=0.0, given=OVERTAKING),
    "overtaking.section_length.minimum": LimitCase(value=350.0, given=OVERTAKING),
    "overtaking.section_length.maximum": LimitCase(value=450.0, given=OVERTAKING),
    "overtaking.critical_length": LimitCase(value=120.0, given=OVERTAKING),
    "overtaking.uncritical_length": LimitCase(value=90.0, given=OVERTAKING),
    "lane_width": LimitCase(value=3.6, given=PLAIN),
    "median_width": LimitCase(value=3.5, given=PLAIN),
    "markings.overtaking_sight": LimitCase(value=100.0, given={"cross_section": "RQ11", "length": 2500.0}),
    **{
        f"environment.{name}": LimitCase(given=PLAIN | {"environment": {"sun_place": "time"}})
        for name in ("latitude_deg", *(f"{limit}.{end}" for limit in ("time_of_day", "day_of_year") for end in ENDS))
    },
    "turnouts.lane_length.maximum": LimitCase(value=280.0),
    "turnouts.lane_length.minimum": LimitCase(value=280.0),
    "turnouts.places": LimitCase(value=[{"kind": "emergency_bay", "station": 500.0}], given=PLAIN),
    "turnouts.places[].kind": LimitCase(value="entry", given=PLACES),
    "turnouts.places[].side": LimitCase(value="left", given=PLACES),
    "turnouts.places[].station": LimitCase(value=600.0, given=PLACES),
    "turnouts.places[].taper_length": LimitCase(value=50.0, given=PLACES),
    "turnouts.places[].lane_length": LimitCase(value=300.0, given=PLACES),
    "turnouts.places[].lane_width": LimitCase(value=3.75, given=PLACES),
    "turnouts.places[].ramp_length": LimitCase(value=95.0, given=PLACES),
    "turnouts.places[].ramp_clothoid": LimitCase(value=100.0, given=PLACES),
    "markings.lane_dash": LimitCase(value=4.0),
    "markings.lane_gap": LimitCase(value=8.0),
    "furniture.gantries": LimitCase(value=0.0, given=PLAIN | {"furniture": {"gantries": 1.0}}),
    "furniture.construction_zone": LimitCase(value=0.0, given=ZONE),
    "furniture.construction_length.minimum": LimitCase(given=ZONE),
    "furniture.construction_length.maximum": LimitCase(given=ZONE),
    "elevation_model": LimitCase(value=str(ELEVATIONS), given={"length": 60.0, "half_width": 30.0}),
    "barriers.noise_barrier_length.maximum": LimitCase(given=PLAIN | {"barriers": {"noise_barrier": 1.0}}),
    **{
        f"roadside.{name}": LimitCase(given=YARDS)
        for name in (
            "walls",
            *(f"{part}.{end}" for part in ("buildings_per_km", "wall_height", "parked_per_building") for end in ENDS),
        )
    },
    **{
        f"vegetation.forest_{part}.{end}": LimitCase(given=FORESTS)
        for part in ("edges_per_km", "edge_length", "depth", "height")
        for end in ENDS
    },
    **{
        path: LimitCase(given=COUNTRY)
        for path in (
            *("turnouts.bus_bays", "turnouts.laybys"),
            *("furniture.town_signs", "furniture.tracks", "furniture.head_walls"),
            *("roadside.avenues", "roadside.both_sides", "roadside.avenue_unprotected"),
            *(f"turnouts.{part}_length.{end}" for part in ("bus_bay", "layby", "side_bay_taper") for end in ENDS),
            *(f"furniture.entrances_per_km.{end}" for end in ENDS),
            *(f"furniture.entrance_{part}.{end}" for part in ("width", "radius", "depth", "pipe") for end in ENDS),
            *(
                f"roadside.avenue_{part}.{end}"
                for part in ("length", "spacing", "distance", "height", "trunk", "gaps")
                for end in ENDS
            ),
        )
    },
    **{
        path: LimitCase(given=SIDE_ROADS)
        for path in (
            *("side_roads.tracks", "side_roads.stop_lines"),
            *(f"side_roads.{name}.{end}" for name in ("per_km", *SIDE_ROAD_INTERVALS) for end in ENDS),
        )
    },
    "traffic_side": LimitCase(value="left"),
    "landscape.forest_share.maximum": LimitCase(value=0.3),
    "landscape.meadow_share.maximum": LimitCase(value=0.3),
    "epsg": LimitCase(value=25833),
    "height_epsg": LimitCase(value=7837),
    "textures": LimitCase(value=str(TEXTURES)),
    "assets": LimitCase(value=["roadside"]),
}
"""Path of a limit -> how it is looked at; see `LimitCase`."""
SAYS = {"epsg", "height_epsg"}
"""Limits that only say something: in which coordinates the road stands."""
