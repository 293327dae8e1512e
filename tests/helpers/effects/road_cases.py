"""Small roads on which each field of a parameter set matters, and what of it is changed to see that."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import LONGEST
from synthroads_addon.road.things.thing import StandingThing
from tests.helpers.effects.field_paths import value_at, with_value
from tests.helpers.roads.furnished_data import road_data
from tests.helpers.roads.interchanges import diamond
from tests.helpers.roads.parameter_sets import OBJECTS
from tests.helpers.roads.thing_variants import GIVEN

Data = dict[str, Any]

FILES = Path(__file__).parent / "files"
OTHER_LIBRARY, ELEVATIONS = FILES / "library.json", FILES / "elevations.asc"
TEXTURES = FILES / "textures"
LENGTH = 60.0
"""Length of the road, m."""
SIGN = {"shape": "rectangle", "width": 2.0, "height": 1.6, "text": ["Ausfahrt"], "posts": 2}
OFF = {"carriageway": "right", "start_station": 5.0, "lane_width": 3.5, "lane_length": 12.0, "shoulder_width": 1.0}
RAMP: Data = {"length": 25.0, "clothoid_parameter": 40.0, "crossfall_percent": 6.0, "run_off_length": 6.0}
RAMP |= {"grade_percent": 3.0, "rounding_radius": 250.0}
TURNOUTS: Data = {
    "exit": OFF | {"kind": "exit", "taper_in_length": 10.0, "ramp": RAMP},
    "entry": OFF | {"kind": "entry", "start_station": 5.0, "taper_out_length": 10.0, "ramp": {"length": 25.0}},
    "bay": {"carriageway": "left", "kind": "emergency_bay", "start_station": 10.0, "lane_length": 10.0}
    | {"lane_width": 3.0, "taper_in_length": 10.0, "taper_out_length": 10.0},
}
LEFT_ENTRY = TURNOUTS["entry"] | {"carriageway": "left"}
STRAIGHT = {"start_station": 8.0, "end_station": 50.0}
LINE = {"carriageway": "right", "width": 0.15, "dash_length": 0.0, "gap_length": 0.0, **STRAIGHT}
TYPES = {"ifc": "IfcFurniture.USERDEFINED", "cityjson": "CityFurniture", "opendrive": "barrier.fence"}
LAND: Data = {
    "seed": 1,
    "reach": 600.0,
    "villages": [{"x": 200.0, "y": 300.0, "houses": 2}],
    "turbines": [{"x": -200.0, "y": 300.0}],
}
OWN: dict[str, dict[str, Data]] = {
    "Landscape": {"land": LAND},
    "Turnout": TURNOUTS,
    "StreetSide": {
        "it": {"carriageway": "right", "start_station": 3.0, "end_station": 57.0, "transition_length": 3.0}
        | {"footway_width": 4.0, "kerb_levels": [{"station": 15.0}]}
        | {"bays": [{"start_station": 28.0, "end_station": 45.0}]}
    },
    "SideRoad": {
        "it": {"carriageway": "right", "station": 30.0, "near_radius": 6.0, "far_radius": 7.0, "length": 30.0}
    },
    "LineMarking": {
        "dashes": LINE | {"kind": "lane", "boundary": 1, "dash_length": 6.0, "gap_length": 6.0},
        "free": LINE | {"kind": "free", "offset": 8.0},
        "curved": LINE | {"kind": "free", "offset": [{"station": 10.0, "width": 5.0}, {"station": 40.0, "width": 7.0}]},
        "gore": LINE | {"kind": "gore_edge", "turnout": "exit"},
    },
    "Hatching": {"it": {"turnout": "exit"}},
    "Arrow": {"it": {"carriageway": "right", "kind": "left", "station": 25.0, "offset": -8.0}},
    "TemporaryBarrier": {"it": {**STRAIGHT, "offset": -6.0, "end_offset": -8.0}},
    "TrafficSign": {"it": GIVEN["TrafficSign"] | SIGN},
    "Pole": {"it": {}, "camera": {"kind": "surveillance", "station": 40.0, "offset": -17.0}},
    "Gantry": {"it": GIVEN["Gantry"] | {"kind": "cantilever", "offset": -8.5}},
    "Overpass": {"it": GIVEN["Overpass"] | {"offset": 0.0, "pier_offsets": [0.0]}},
    "Cabinet": {"it": {"kind": "utility"}},
    "ConstructionBeacon": {"it": {"pass_side": "left"}},
    "Asset": {"it": GIVEN["Asset"] | {"offset": -18.0, "twin_types": TYPES}},
    "Vegetation": {
        "it": {"kind": "shrub", "species": "hazel", "density": 0.05, "band_start": 1.0, "band_end": 6.0}
        | {"height_min": 1.0, "height_max": 2.0, "seed": 1},
        "grass": {"kind": "grass", "species": "meadow", "density": 1.0, "band_start": 0.0, "band_end": 4.0}
        | {"height_min": 0.2, "height_max": 0.4, "mown_width": 1.0, "seed": 2}
        | {"start_station": 0.0, "end_station": LONGEST},
    },
    "Vehicle": {"it": {"model": "car", "carriageway": "right", "lane": 0, "station": 25.0, "speed": 3.0}},
}
"""Type of object -> objects of it, by id; of the others one with its usual values, see `PLACE`."""
PLACE: Data = {"station": 25.0, "offset": -15.0, **STRAIGHT}
"""Where a thing stands, if nothing else is said; each takes what it has fields for."""
WITH: dict[str, Data] = {kind: {"exit": TURNOUTS["exit"], "entry": LEFT_ENTRY} for kind in ("Hatching", "LineMarking")}
"""Type of object -> turnouts that it needs."""
WIDTHS = {
    "inner_offset": (2.0, 2.5), "hard_shoulder_width": (3.0, 2.5), "outer_edge_strip_width": (0.75, 0.5),
    "inner_edge_strip_width": (0.75, 0.5), "verge_width": (1.5, 2.0),
}  # fmt: skip


def points_of(first: float, second: float) -> list[Data]:
    """Return a width's points, first at 20 m, then at 45 m."""
    return [{"station": 20.0, "width": first}, {"station": 45.0, "width": second}]


@dataclass(frozen=True)
class RoadScene:
    """A parameter set in which a field matters.

    Attributes:
        data: the set, as JSON data.
        owner: id of the object that has the field; empty if it is one of the set's own.
    """

    data: Data
    owner: str


@dataclass(frozen=True)
class Case:
    """Where a field matters, as far as that doesn't follow from its type.

    Attributes:
        owner: id of the object that has the field; the first one that has a value there if empty.
        value: another value of the field; if None what `other_values` takes.
        given: values of other fields of the set, by path: ``environment.weather``, ``objects.it.kind``.
        also: values of other fields that change with it, as it can't change alone.
        at: path of one entry of a list that has the field, where the first one won't do.
        scan: changes of the scenario that it is looked at with, by path.
    """

    owner: str = ""
    value: Any = None
    given: Data = field(default_factory=dict)
    also: Data = field(default_factory=dict)
    at: str = ""
    scan: Data = field(default_factory=dict)


CHECKS = {"material": "asphalt", "folder": str(TEXTURES / "asphalt" / "checks")}
NODES = {"colour.source": "nodes"}
CHECKERED = {"materials.textures": [CHECKS]}
OTHER_ROAD = Case(value="left")
OTHER_TURNOUT = Case(value="entry")
COUNTED = {"objects.axis.equations": [{"station": 40.0, "ahead": 5000.0}]}
BAY = TURNOUTS["bay"]
CUTTING = {
    "objects.terrain.embankment_height": -3.0,
    "objects.terrain.swale_width": 2.0,
    "objects.terrain.swale_depth": 0.4,
}
BANK = {
    "objects.terrain.embankment_height": 2.0,
    "objects.terrain.ditch_width": 2.0,
    "objects.terrain.ditch_depth": 0.4,
}
PLANTED: Data = {"type": "Vegetation", "instance": 900, "kind": "shrub", "species": "hazel", "density": 0.05}
PLANTED |= {"band_start": 1.0, "band_end": 6.0, "height_min": 1.0, "height_max": 2.0, "seed": 1}
NEAR_POLE: Data = {"type": "Pole", "instance": 901, "station": 32.0, "offset": -18.0}
CAR: Data = {"type": "Vehicle", "instance": 902, "model": "car", "carriageway": "right", "lane": 0, "station": 25.0}
CAR |= {"speed": 3.0}
LEANING: Data = {"objects.it.lean_deg": 10.0}
DENTED: Data = {"objects.it.dents": [{"station": 25.0, "length": 4.0, "depth": 0.5}]}
SETTLED: Data = {
    "objects.right.pavement.settlements": [
        {"station": 30.0, "offset": -7.0, "length": 20.0, "width": 6.0, "depth": 0.1},
    ]
}
LAID: Data = {
    "objects.right.pavement.overlays": [
        {"start_station": 12.0, "end_station": 45.0, "inner": 4.0, "outer": 10.0, "thickness": 0.1},
    ]
}
PARTS: Data = {"objects.hazel": PLANTED}
OTHER_CROSSING: Data = {
    "objects.other-bridge": {"type": "Overpass", "instance": 901, "station": 900.0, "offset": 0.0}
    | {"left_abutment": 19.0, "right_abutment": -19.0}
}
OTHER_ROAD_ABOVE: Data = {
    "objects.other-road": {"type": "CrossingRoad", "instance": 902, "station": 900.0, "bridge": "other-bridge"}
    | {"start_x": 80.0, "start_y": 126.0, "start_heading_deg": 237.0, "vertical": [{"station": 0.0, "elevation": 6.0}]}
    | {"horizontal": [{"kind": "line", "length": 300.0, "curvature_start": 0.0, "curvature_end": 0.0}]}
}
AXIS_CASES: dict[str, dict[str, Case]] = {
    "CrossingRoad": {
        "horizontal": Case(
            value=[{"kind": "line", "length": 290.0, "curvature_start": 0.0, "curvature_end": 0.0}],
        ),
        **{
            f"horizontal[].curvature_{end}": Case(
                value=0.0001, also={"objects.crossing-road.horizontal[].kind": "clothoid"}
            )
            for end in ("start", "end")
        },
        "horizontal[].length": Case(value=290.0),
        "bridge": Case(given=OTHER_CROSSING, value="other-bridge"),
        "station": Case(value=651.0),
    },
    "ConnectingRamp": {
        "horizontal[].curvature_start": Case(value=-0.007),
        "horizontal[].curvature_end": Case(value=-0.001),
        "horizontal[].length": Case(value=34.0),
        "turnout": Case(owner="ramp-exit-right", value="exit-left"),
        "crossing_road": Case(given=OTHER_CROSSING | OTHER_ROAD_ABOVE, value="other-road"),
    },
}
"""Type of road with an axis of its own -> field -> how it is looked at."""


def _axis_cases() -> dict[str, Case]:
    cases = {f"{kind}.{name}": case for kind, given in AXIS_CASES.items() for name, case in given.items()}
    return cases | {f"{kind}.vertical[].radius": Case(at=f"{kind}.vertical[1].radius") for kind in AXIS_CASES}


def _lean_cases() -> dict[str, Case]:
    cases = {}
    for kind, model in OBJECTS.items():
        if issubclass(model, StandingThing) and "lean_deg" in model.model_fields:
            cases[f"{kind}.lean_deg"] = Case(owner="it", value=10.0)
            cases[f"{kind}.lean_direction_deg"] = Case(owner="it", value=90.0, given=LEANING)
    return cases


CASES: dict[str, Case] = {
    **_lean_cases(),
    **_axis_cases(),
    "Guardrail.dents": Case(value=[{"station": 25.0, "depth": 0.5}]),
    **{f"Guardrail.dents[].{name}": Case(given=DENTED) for name in ("station", "length", "depth")},
    "NoiseBarrier.missing_panels": Case(value=[2]),
    "Bridge.pier_stations": Case(value=[24.0]),
    "Carriageway.pavement.overlays": Case(owner="right", value=[], given=LAID),
    **{
        f"Carriageway.pavement.overlays[].{name}": Case(owner="right", given=LAID)
        for name in ("start_station", "end_station", "inner", "outer", "thickness", "ramp_length", "taper")
    },
    "Carriageway.pavement.settlements": Case(owner="right", value=[], given=SETTLED),
    **{
        f"Carriageway.pavement.settlements[].{name}": Case(owner="right", given=SETTLED)
        for name in ("station", "offset", "length", "width", "depth")
    },
    "part_numbers": Case(value={"hazel": [2000]}, given=PARTS),
    "StreetSide.carriageway": Case(value="left"),
    "SideRoad.carriageway": OTHER_ROAD,
    "SideRoad.length": Case(given={"objects.terrain.half_width": 60.0}, value=40.0),
    "Building.at_street": Case(given={"objects.it.rotation_deg": 20.0, "objects.pole": NEAR_POLE}, value=True),
    "Carriageway.traffic_side": Case(
        owner="right", value="left", given={"objects.car": CAR}, also={"objects.left.traffic_side": "left"}
    ),
    "Gantry.signs[].traffic_side": Case(value="left"),
    "Landscape.forest_share": Case(value=0.5),
    "Landscape.meadow_share": Case(value=0.5),
    "environment.season": Case(given={"objects.hazel": PLANTED}),
    "environment.visibility": Case(given={"environment.weather": "fog", "environment.visibility": 300.0}),
    "materials.textures": Case(value=[CHECKS]),
    "materials.textures[].material": Case(given=CHECKERED, value="concrete"),
    "materials.textures[].folder": Case(given=CHECKERED, value=str(TEXTURES / "asphalt" / "red")),
    "materials.textures[].tile": Case(given=CHECKERED, value=3.0, scan={"colour.source": "nodes"}),
    "metadata.identifier": Case(value="another"),
    "metadata.title": Case(value="Another"),
    "metadata.generator": Case(value="another hand"),
    "metadata.referenceSystem": Case(value="https://www.opengis.net/def/crs/EPSG/0/25833"),
    "metadata.heightReferenceSystem": Case(value="https://www.opengis.net/def/crs/EPSG/0/7837"),
    "Alignment.vertical[].radius": Case(at="Alignment.vertical[1].radius"),
    "Alignment.first_station": Case(value=12_000.0),
    "Alignment.equations": Case(value=[{"station": 40.0, "ahead": 5000.0}]),
    "Alignment.equations[].station": Case(given=COUNTED, value=50.0),
    "Alignment.equations[].ahead": Case(given=COUNTED, value=7000.0),
    "Carriageway.side": Case(owner="right", value="left", also={"objects.left.side": "right"}),
    **{f"Carriageway.{name}": Case(owner="right") for name in (*WIDTHS, "lanes[].width")},
    "Carriageway.lanes[].kind": Case(scan={"scan.platform": {"kind": "vehicle", "speed": 10.0}}),
    "Turnout.carriageway": OTHER_ROAD,
    "Turnout.kind": Case(
        value="entry", also={"objects.exit.taper_in_length": 0.0, "objects.exit.taper_out_length": 10.0}
    ),
    "Turnout.taper_out_length": Case(owner="bay"),
    "LineMarking.carriageway": OTHER_ROAD,
    "Arrow.carriageway": OTHER_ROAD,
    "Vehicle.carriageway": OTHER_ROAD,
    "RampGuardrail.road": Case(value="ramp-exit-left"),
    "RampVehicle.carriageway": Case(value="ramp-entry-right"),
    "RampVehicle.lane": Case(owner="vehicle-crossing-road-0-1", value=1),
    "LineMarking.kind": Case(owner="free", value="lane"),
    "LineMarking.turnout": Case(owner="gore", value="entry"),
    "LineMarking.dash_length": Case(owner="dashes"),
    "LineMarking.offset": Case(owner="free"),
    "Hatching.turnout": OTHER_TURNOUT,
    "Vegetation.mown_width": Case(owner="grass"),
    "Vegetation.side": Case(value="left"),
    "Vegetation.start_station": Case(value=20.0),
    "Vegetation.end_station": Case(value=20.0),
    "Vegetation.kind": Case(value="tree", also={"objects.it.species": "birch"}),
    "TrafficSign.code": Case(given={"objects.it.code": "449"}, value="448"),
    "TrafficSign.text": Case(value=["Abfahrt"]),
    "KilometreBoard.text": Case(value="124,0"),
    "Gantry.signs[].text": Case(value=["B"]),
    "Asset.twin_types.ifc": Case(value="IfcSign.MARKER"),
    "Asset.twin_types.opendrive": Case(value="building.shed"),
    "Asset.name": Case(value="grit_bin"),
    "Asset.class_name": Case(value="barrier"),
    "Asset.library": Case(value=str(OTHER_LIBRARY)),
    "Guardrail.reflector_spacing": Case(value=6.0),
    "Terrain.swale_width": Case(given=CUTTING),
    "Terrain.ditch_width": Case(given=BANK, value=2.5),
    "Terrain.ditch_depth": Case(given=BANK, value=0.8),
    "Terrain.swale_depth": Case(given=CUTTING),
    "Terrain.elevation_model": Case(value=str(ELEVATIONS)),
    "Carriageway.pavement.ruts": Case(owner="right"),
    "Carriageway.pavement.potholes": Case(owner="right"),
    "Carriageway.pavement.patches": Case(owner="right", value=[]),
    "Carriageway.pavement.patches[].outline": Case(
        owner="right", value=[[5.0, -5.0], [15.0, -5.0], [15.0, -3.5], [5.0, -3.5]]
    ),
    "Carriageway.pavement.cracks": Case(owner="right", value=[]),
    "Carriageway.pavement.cracks[].lines": Case(owner="right", value=[[[8.0, -6.0], [55.0, -7.0]]]),
    "Carriageway.pavement.cracks[].kind": Case(
        owner="right", scan={"cloud.attributes": ["range", "incidence", "damage"]}
    ),
    "Carriageway.pavement.lane_ages": Case(owner="right", value=[0.02], scan=NODES),
    "Carriageway.pavement.shoulder_age": Case(owner="right", value=0.02, scan=NODES),
    "Carriageway.pavement.removed_markings": Case(owner="right", value=[]),
    "Carriageway.pavement.removed_markings[].dash_length": Case(owner="right", value=8.0),
    "LineMarking.instance": Case(owner="free"),
}
"""Path of a field -> how it is looked at; see `Case`. A field that isn't here is looked at on the usual objects."""


def objects_of(kind: str) -> dict[str, Data]:
    """Return the objects of a type that its fields are looked at on, and what they need, by id."""
    own = OWN.get(kind, {"it": GIVEN.get(kind, {})})
    fields = OBJECTS[kind].model_fields
    place = {name: value for name, value in PLACE.items() if name in fields and kind != "LineMarking"}
    choices = {"faces": "left"} if "faces" in fields else {}
    made = {name: {"type": kind} | place | choices | data for name, data in own.items()}
    return {name: {"type": "Turnout"} | data for name, data in WITH.get(kind, {}).items()} | made


def base_road(objects: dict[str, Data]) -> Data:
    """Return a road with damage, widths that change and a line, and these objects."""
    line = {"type": "LineMarking", **OWN["LineMarking"]["dashes"]}
    data = road_data({"line": line} | objects, length=LENGTH)
    made = data["objects"]
    made["terrain"]["half_width"] = 30.0
    falls = [{"station": 5.0, "crossfall_percent": -2.5}, {"station": 40.0, "crossfall_percent": -5.0}]
    made["left"] |= {name: points_of(*widths) for name, widths in WIDTHS.items()} | {"crossfall": falls}
    made["left"]["lanes"] = [{"width": points_of(3.5, 3.75)}, {"width": 3.75}]
    made["left"]["pavement"] = {"kind": "concrete", "slab_length": 5.0}
    made["right"] |= {"crossfall": falls, "pavement": DAMAGE, "rotation_axis": "carriageway_axis"}
    made["axis"]["horizontal"] = [
        {"kind": "clothoid", "length": 30.0, "curvature_start": 0.0005, "curvature_end": 0.001},
        {"kind": "arc", "length": 30.0, "curvature_start": 0.001, "curvature_end": 0.001},
    ]
    made["axis"]["vertical"] = [
        {"station": 0.0, "elevation": 0.0},
        {"station": 30.0, "elevation": 0.5, "radius": 300.0},
        {"station": 60.0, "elevation": 0.2},
    ]
    data["environment"] = {"cloud_cover": 0.5, "cloud_size": 20.0, "wetness": 0.2}
    return data


def crossed_road(kind: str) -> Data:
    """Return a motorway with a diamond, and nothing beside it but the roads and objects of one type."""
    data: Data = diamond().to_dict()
    objects = data["objects"]
    return data | {"objects": {name: item for name, item in objects.items() if item["type"] in {*OF_ROADS, kind}}}


OF_ROADS = {*("Alignment", "Carriageway", "Median", "Terrain", "Turnout"), *AXIS_CASES, "Overpass"}
"""Types of what `crossed_road` keeps."""
ON_OTHERS = {"RampGuardrail", "RampVehicle"}
"""Types of what is on ramps and crossing roads alone."""
DAMAGE = {
    "ruts": [{"lane": 0, "start_station": 10.0, "end_station": 50.0, "depth": 0.03}],
    "potholes": [{"station": 20.0, "offset": -5.0, "length": 1.0, "width": 0.8, "depth": 0.05}],
    "patches": [{"outline": [[5.0, -5.0], [15.0, -5.0], [15.0, -3.0], [5.0, -3.0]], "age": 0.1}],
    "lane_ages": [0.8],
    "removed_markings": [
        {"offset": -4.4, "width": 0.6, "dash_length": 6.0, "gap_length": 6.0, "start_station": 9.0, "end_station": 50.0}
    ],
    "cracks": [{"kind": "longitudinal", "width": 0.15, "lines": [[[8.0, -6.0], [30.0, -6.2], [55.0, -6.0]]]}],
}


def scene_of(path: str, case: Case) -> RoadScene:
    """Return the road on which a field matters; LookupError if none has it."""
    kind, _, rest = path.partition(".")
    if kind not in OBJECTS:
        return RoadScene(RoadParameters.from_dict(_given(base_road({}), case)).to_dict(), "")
    base = (
        crossed_road(kind)
        if kind in {*AXIS_CASES, *ON_OTHERS}
        else base_road({} if kind in STANDARD else objects_of(kind))
    )
    data = _given(base, case)
    data = RoadParameters.from_dict(data).to_dict()
    for name, item in data["objects"].items():
        if item["type"] == kind and case.owner in ("", name) and _has(item, rest, case):
            return RoadScene(data, name)
    raise LookupError(path)


STANDARD = {"Alignment", "Carriageway", "Median", "Terrain"}
"""Types of which every road has one."""


def _given(data: Data, case: Case) -> Data:
    for path, value in case.given.items():
        data = with_value(data, path, value)
    return data


def _has(item: Data, path: str, case: Case) -> bool:
    """Return whether an object has a value at a path, in the form that can be changed."""
    try:
        value = value_at(item, path)
    except LookupError:
        return False
    return case.value is not None or value is not None
