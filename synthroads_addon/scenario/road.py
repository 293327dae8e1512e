"""`RoadScenario`: the limits that a road is sampled within. Every drawn value has its interval here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from ..base.schema import ClosedModel, Finite, notes, quantity
from ..road.guidelines import (
    CLASS_LABELS,
    DESIGN_CLASSES,
    GUIDELINE_OF_CLASS,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    USUAL_SECTION,
    design_class_of,
    is_single,
)
from ..road.section import ASPHALTS, CONCRETES, SHORTEST_DASH
from ..road.surroundings import GRASSES, SHRUBS, TREES
from ..road.things.limits import Interval, interval, share
from ..road.things.registry import limits_model
from .changes import ChangeLimits
from .interchange import InterchangeLimits
from .villages import VillageLimits


class FreeCrossSection(ClosedModel):
    """One direction of a cross-section by hand, lanes from outside to inside."""

    lanes: tuple[Annotated[float, Field(strict=True, ge=2, le=6)], ...] = Field(
        min_length=1, max_length=8, description="Widths of the lanes, m.", json_schema_extra=notes(unit="m")
    )
    hard_shoulder: float = quantity(2.5, "m", "Width of the hard shoulder.", (0, 6))
    outer_edge_strip: float = quantity(0.5, "m", "Width of the outer edge strip.", (0.3, 2))
    inner_edge_strip: float = quantity(0.5, "m", "Width of the inner edge strip.", (0.15, 2))
    median: float = quantity(4.0, "m", "Width of the median.", (0.5, 40))
    verge: float = quantity(1.5, "m", "Width of the verge.", (0.5, 5))


def _form(section: object) -> str | None:
    """Return "name" or "free" by the form of a cross-section, else None; the union's discriminator."""
    if isinstance(section, str):
        return "name"
    return "free" if isinstance(section, dict | FreeCrossSection) else None


CrossSection = Annotated[
    Annotated[str, Tag("name")] | Annotated[FreeCrossSection, Tag("free")],
    Discriminator(_form, "cross_section_type", "must be a standard cross-section's name or a JSON object with lanes"),
]
"""A standard cross-section's name, or one by hand."""


def _merge_below(data: Any, defaults: Mapping[str, Any]) -> Any:
    """Return data with the defaults of what it lacks, part by part; what isn't a dictionary is returned unchanged."""
    if not isinstance(data, Mapping):
        return data
    merged = {
        name: _merge_below(value, defaults[name]) if isinstance(defaults.get(name), Mapping) else value
        for name, value in data.items()
    }
    return {**merged, **{name: value for name, value in defaults.items() if name not in data}}


class LaneChangeLimits(ClosedModel):
    """Lane drops and gains."""

    share: float = share(
        0.25, "Probability that a carriageway of three lanes or more drops or gains one.", title="Lane Drops and Gains"
    )
    taper_length: Interval = interval(80.0, 200.0, "m", "Length over which a lane begins or ends.")


class OvertakingLimits(ClosedModel):
    """Overtaking lanes of country roads with three lanes that change sides (2+1); their lengths weren't found."""

    share: float = share(
        0.0, "Probability that the overtaking lane changes sides along the road.", title="Overtaking Lanes Change"
    )
    section_length: Interval = interval(
        1000.0, 2000.0, "m", "Length of a stretch with an overtaking lane.", title="Section Length"
    )
    critical_length: float = quantity(
        180.0,
        "m",
        "Length over which two overtaking lanes end towards each other.",
        (20, 400),
        title="Critical Change",
    )
    uncritical_length: float = quantity(
        60.0, "m", "Length over which overtaking lanes begin.", (10, 400), title="Uncritical Change"
    )


class StatedTurnout(ClosedModel):
    """An exit, entry or emergency bay at a station; sizes that aren't given are the least of limits and guidelines."""

    kind: Literal["exit", "entry", "emergency_bay"] = Field(description="What it is.")
    side: Literal["left", "right"] = Field("right", description="Side of the road, seen along the stations.")
    station: float = quantity(unit="m", description="Its lowest station.", limits=(0, 200_000))
    taper_length: float | None = quantity(None, "m", "Length of its taper, of a bay's either taper.", (1, 200))
    lane_length: float | None = quantity(None, "m", "Length of its lane, or of the bay, at full width.", (5, 1000))
    lane_width: float | None = quantity(None, "m", "Width of its lane, or of the bay.", (2, 6))
    ramp_length: float | None = quantity(None, "m", "Length of its ramp; 85 m where that fits.", (10, 400))
    ramp_clothoid: float | None = quantity(
        None, "m", "Clothoid parameter A of its ramp; the middle of what its length and the terrain allow.", (30, 500)
    )


class TurnoutLimits(ClosedModel):
    """Exits, entries and emergency bays."""

    exits: float = share(0.3, "Probability that a sufficiently long carriageway has an exit.")
    entries: float = share(0.3, "Probability that a sufficiently long carriageway has an entry.")
    emergency_bays: float = share(0.3, "Probability that a sufficiently long carriageway has an emergency bay.")
    lane_length: Interval = interval(150.0, 300.0, "m", "Length of a deceleration or acceleration lane.")
    taper_length: Interval = interval(30.0, 60.0, "m", "Length of the taper of that lane.")
    lane_width: Interval = interval(3.5, 3.75, "m", "Width of a deceleration or acceleration lane.")
    shoulder_width: Interval = interval(0.0, 2.0, "m", "Width of the hard shoulder beside that lane.")
    ramp_length: Interval = interval(65.0, 100.0, "m", "Length of the ramp; at most its clothoid parameter A.")
    ramp_clothoid: Interval = interval(75.0, 120.0, "m", "Clothoid parameter A of the ramp.")
    ramp_crossfall: Interval = interval(
        2.5, 5.0, "%", "Crossfall of the ramp, away from the main road; at most 5 % from the main road's."
    )
    ramp_grade: Interval = interval(-1.5, 1.5, "%", "Grade of the ramp relative to the main road.")
    bay_length: Interval = interval(40.0, 60.0, "m", "Length of an emergency bay at full width.")
    bay_taper_length: Interval = interval(20.0, 30.0, "m", "Length of the tapers of an emergency bay.")
    bay_width: Interval = interval(3.0, 3.5, "m", "Width of emergency bays, bus bays and laybys.")
    bus_bays: float = share(0.0, "Probability that a direction of a country road has a bus bay.", title="Bus Bays")
    laybys: float = share(0.0, "Probability that a direction of a country road has a layby.", title="Laybys")
    bus_bay_length: Interval = interval(18.0, 25.0, "m", "Length of a bus bay at full width.")
    layby_length: Interval = interval(30.0, 60.0, "m", "Length of a layby at full width.")
    side_bay_taper_length: Interval = interval(
        12.0, 25.0, "m", "Length of the tapers of bus bays and laybys.", title="Tapers of These"
    )
    places: tuple[StatedTurnout, ...] = Field(
        (),
        max_length=200,
        title="Places",
        description="Exits, entries and bays at stations; a side with any has no others, and no lane begins or ends.",
    )


class SideRoadLimits(ClosedModel):
    """Side roads that join a country road. No guideline's figures were found: these are chosen."""

    per_km: Interval = interval(
        0.0, 0.0, "1/km", "Side roads per km of a country road, both sides together.", title="Side Roads (per km)"
    )
    angle_deg: Interval = interval(
        75.0, 105.0, "deg", "Angle between the road's direction and the side road.", title="Angle"
    )
    lane_width: Interval = interval(2.5, 3.0, "m", "Width of the lanes of a side road with two of them.")
    tracks: float = share(0.3, "Probability that a side road is a farm road with one lane and no markings.")
    track_width: Interval = interval(3.0, 3.5, "m", "Width of a farm road's pavement.", title="Farm Road Width")
    radius: Interval = interval(6.0, 12.0, "m", "Radii of the corners.", title="Corner Radius")
    length: Interval = interval(
        60.0, 100.0, "m", "Length of its pavement, which ends with the built ground at the latest."
    )
    grade_percent: Interval = interval(-3.0, 3.0, "%", "Grade behind the mouth, away from the road.")
    blend_length: Interval = interval(
        10.0, 16.0, "m", "Length over which its surface leaves the road's plane.", title="Blend"
    )
    stop_lines: float = share(0.1, "Probability of a stop line instead of one for giving way.")


class BridgeLimits(ClosedModel):
    """Bridges that carry the road. Figures without a source in their names are usual ones: these are chosen."""

    per_km: Interval = interval(0.0, 0.0, "1/km", "Bridges that carry the road, per km.", title="Bridges (per km)")
    length: Interval = interval(30.0, 90.0, "m", "Length of a bridge's deck.")
    span: Interval = interval(18.0, 40.0, "m", "Largest distance between its supports.")
    valley_depth: Interval = interval(
        6.0, 12.0, "m", "Depth of the generated ground below the road in a bridge's middle.", title="Valley"
    )
    clearance: Interval = interval(4.5, 4.7, "m", "Least height of a bridge's deck above the ground in its middle.")
    cap_width: Interval = interval(2.0, 2.1, "m", "Width of the verges, and so of the caps, on bridges.")
    kerb_height: Interval = interval(0.075, 0.15, "m", "Height of the caps above the pavement's edge.")
    wing_length: Interval = interval(5.0, 8.0, "m", "Length of wing walls; longer where the deck is deep.")
    high_railings: float = share(0.2, "Probability that railings may be 1.3 m high instead of 1.0 m.")
    h4b: float = share(
        0.5, "Probability of barriers H4b instead of H2 on bridges of roads without barriers.", title="H4b"
    )


class TunnelLimits(ClosedModel):
    """Tunnels that lead the road through the ground. What guidelines ask for wasn't found: these are chosen."""

    per_km: Interval = interval(0.0, 0.0, "1/km", "Tunnels per km.", title="Tunnels (per km)")
    length: Interval = interval(80.0, 200.0, "m", "Length from portal to portal.")
    vaults: float = share(0.5, "Probability of a vaulted tunnel, instead of a rectangular one.")
    height: Interval = interval(5.8, 6.5, "m", "Height of the ceiling above the pavement; of a vault its crown's.")
    cover: Interval = interval(2.0, 6.0, "m", "Height of the generated ground above the roof.")
    walkway_width: Interval = interval(1.0, 1.2, "m", "Width of the emergency walkways.")
    fans: float = share(0.7, "Probability of jet fans.", title="Jet Fans")


class PavementLimits(ClosedModel):
    """Pavement of the carriageways, and its damage."""

    concrete: float = share(0.2, "Probability of a concrete pavement.", title="Concrete Pavement")
    asphalts: tuple[Literal[ASPHALTS], ...] = Field(  # type: ignore[valid-type]
        ASPHALTS, min_length=1, description="Kinds of asphalt that a road may have; asphalt is asphalt concrete."
    )
    concretes: tuple[Literal[CONCRETES], ...] = Field(  # type: ignore[valid-type]
        CONCRETES,
        min_length=1,
        description="Kinds of concrete that a road may have.",
        json_schema_extra=notes(labels={"concrete": "Concrete", "exposed_aggregate_concrete": "Exposed Aggregate"}),
    )
    renewed: float = share(
        0.3,
        "Probability that a carriageway's outermost lane, all its lanes, or its hard shoulder are newer than the rest.",
        title="Lanes Renewed",
    )
    rutted: float = share(0.3, "Probability that a carriageway's outer lane is rutted.", title="Ruts in the Outer Lane")
    rut_depth: Interval = interval(0.004, 0.025, "m", "Depth of ruts.")
    rut_width: Interval = interval(0.6, 1.0, "m", "Width of a wheel track.")
    wheel_track_depth: Interval = interval(
        0.0025, 0.005, "m", "Depth of the outermost lane's wheel tracks where it has no ruts."
    )
    joint_depth: Interval = interval(0.001, 0.004, "m", "Depth of joints below the pavement.")
    unevenness: Interval = interval(
        2.0, 20.0, "cm3", "Spectral density of the heights at 0.1 cycles/m (ISO 8608: class A to 32)."
    )
    potholes_per_km: Interval = interval(0.0, 8.0, "1/km", "Potholes per km of carriageway.", title="Potholes (per km)")
    pothole_size: Interval = interval(0.1, 0.8, "m", "Diameters of potholes.")
    pothole_depth: Interval = interval(0.01, 0.06, "m", "Depth of potholes.")


class MarkingLimits(ClosedModel):
    """Line markings; what isn't given follows the RMS."""

    lane_dash: float | None = quantity(
        None,
        "m",
        "Dash of lane lines; 6 m on motorways, 4 m on country roads.",
        (SHORTEST_DASH, 100),
        inherits="design_class.lane_dash",
    )
    lane_gap: float | None = quantity(
        None,
        "m",
        "Gap of lane lines; 12 m on motorways, 8 m on country roads.",
        (SHORTEST_DASH, 100),
        inherits="design_class.lane_gap",
    )
    overtaking_sight: float | None = quantity(
        None,
        "m",
        "Sight from which the line between the directions of one carriageway is dashed; the class's if not given.",
        (50, 2000),
        title="Overtaking Sight",
        inherits="design_class.overtaking_sight",
    )
    film_thickness: Interval = interval(0.0015, 0.004, "m", "Thickness of the film.")
    removed: float = share(
        0.2, "Probability that a carriageway shows where former lines were ground off.", title="Ground-Off Lines"
    )


class _BarrierLimits(ClosedModel):
    """Guardrails, concrete barriers and noise barriers."""

    median: bool = Field(True, title="In the Median", description="A barrier in the median.")
    roadside: bool = Field(True, title="At the Edges", description="Barriers at the edges, by the safety rules.")
    unneeded: float = share(
        0.6, "Probability of a barrier that no rule asks for, in each 1.5 km of a side.", title="Where No Rule Asks"
    )


class _FurnitureLimits(ClosedModel):
    """Signs, gantries and equipment."""


class _RoadsideLimits(ClosedModel):
    """Fences, hedges, buildings and the like beside the road, as far as its ground reaches."""


if TYPE_CHECKING:
    BarrierLimits: TypeAlias = Any
    FurnitureLimits: TypeAlias = Any
    RoadsideLimits: TypeAlias = Any
else:
    BarrierLimits = limits_model("BarrierLimits", "barriers", _BarrierLimits)
    FurnitureLimits = limits_model("FurnitureLimits", "furniture", _FurnitureLimits)
    RoadsideLimits = limits_model("RoadsideLimits", "roadside", _RoadsideLimits)


class VehicleLimits(ClosedModel):
    """Traffic."""

    per_km: Interval = interval(0.0, 25.0, "1/km", "Vehicles per km of carriageway.", title="Vehicles (per km)")
    trucks: Interval = interval(0.1, 0.35, "1", "Share of trucks, semitrailers and buses.", title="Share of Trucks")
    speed: Interval = interval(22.0, 36.0, "m/s", "Speed of cars; trucks drive at most 25 m/s.")


class VegetationLimits(ClosedModel):
    """Species and sizes of plants; their densities stand beside."""

    trees: tuple[Literal[TREES], ...] = Field(TREES, min_length=1, description="Species of trees.")  # type: ignore[valid-type]
    shrubs: tuple[Literal[SHRUBS], ...] = Field(SHRUBS, min_length=1, description="Species of shrubs.")  # type: ignore[valid-type]
    grasses: tuple[Literal[GRASSES], ...] = Field(GRASSES, min_length=1, description="Species of grass.")  # type: ignore[valid-type]
    tree_height: Interval = interval(4.0, 16.0, "m", "Height of trees.")
    shrub_height: Interval = interval(0.5, 3.0, "m", "Height of shrubs.")
    grass_height: Interval = interval(0.08, 0.5, "m", "Height of grass.")
    mown_width: Interval = interval(1.0, 4.0, "m", "Width of the strip behind the verge that is mown.", "Mown Strip")
    forest_edges_per_km: Interval = interval(
        0.0, 0.0, "1/km", "Forest edges per km of either side.", title="Forest Edges (per km)"
    )
    forest_edge_length: Interval = interval(60.0, 200.0, "m", "Length of forest edges.")
    forest_depth: Interval = interval(12.0, 25.0, "m", "Depth of the modelled part of a forest.")
    forest_height: Interval = interval(12.0, 22.0, "m", "Height of a forest's trees.")


class LandscapeLimits(ClosedModel):
    """The land beyond the terrain, which pictures show and no scan meets."""

    reach: float = quantity(3000.0, "m", "Distance to which there is land.", (300, 20_000))
    hill_height: Interval = interval(6.0, 26.0, "m", "Standard deviation of the hills.")
    hill_length: Interval = interval(800.0, 1500.0, "m", "Shortest wavelength of the hills.")
    parcel_size: Interval = interval(110.0, 200.0, "m", "Usual width of fields near the road.", title="Width of Fields")
    forest_share: Interval = interval(0.12, 0.4, "1", "Share of the land under forest.", title="Forest")
    meadow_share: Interval = interval(0.12, 0.35, "1", "Share of the land under meadow.", title="Meadow")
    villages: Interval = interval(0.0, 2.0, "1", "Number of villages.")
    turbines: Interval = interval(0.0, 5.0, "1", "Number of wind turbines.", title="Wind Turbines")


class EnvironmentLimits(ClosedModel):
    """Light and weather."""

    sun_place: Literal["angles", "time"] = Field(
        "angles",
        title="Sun Follows From",
        description="Whether the sun's place is drawn as two angles, or follows from time of day, day and latitude.",
        json_schema_extra=notes(labels={"angles": "Two Angles", "time": "Time of Day"}),
    )
    sun_azimuth_deg: Interval = interval(
        0.0, 360.0, "deg", "Direction of the sun, clockwise from north.", only_with={"sun_place": ("angles",)}
    )
    sun_elevation_deg: Interval = interval(
        20.0,
        62.0,
        "deg",
        "Height of the sun above the horizon; negative at dusk and at night.",
        only_with={"sun_place": ("angles",)},
    )
    time_of_day: Interval = interval(
        9.0,
        17.0,
        "h",
        "Time of the day by the sun, which is in the south at 12; 22 is night in Central Europe.",
        only_with={"sun_place": ("time",)},
    )
    day_of_year: Interval = interval(
        1.0, 365.0, "d", "Day of the year; 1 is the first of January.", only_with={"sun_place": ("time",)}
    )
    latitude_deg: float = quantity(
        51.0, "deg", "Latitude; negative in the south.", (-90, 90), only_with={"sun_place": ("time",)}
    )
    cloud_cover: Interval = interval(0.0, 0.6, "1", "Share of the ground in clouds' shadow.")
    wet: float = share(0.15, "Probability of a wet road.", title="Wet Road")
    wetness: Interval = interval(0.3, 1.0, "1", "Wetness of a wet road.")
    bad_weather: float = share(0.15, "Probability of haze, fog, rain, snow or dust.")
    winter: float = share(0.2, "Probability that broadleaved plants are bare.")


class MaterialLimits(ClosedModel):
    """How much roads' materials differ."""

    former_fields: ClassVar = frozenset({"soil_brightness"})

    asphalt_age: Interval = interval(0.0, 1.0, "1", "0 new and black, 1 old and bright.")
    asphalt_brightness: Interval = interval(0.9, 1.1, "1", "Factor on the base colour.")
    patch_density: Interval = interval(0.0, 2.0, "1/100 m", "Repaired patches per 100 m of each carriageway.")
    crack_density: Interval = interval(0.0, 0.6, "1", "0 no cracks, 1 cracked all over.")
    wheel_track_polish: Interval = interval(0.15, 0.6, "1", "Polish of the wheel tracks.")
    concrete_brightness: Interval = interval(0.85, 1.2, "1", "Factor on the base colour.")
    paint_wear: Interval = interval(0.1, 0.35, "1", "Share of the markings' film worn off.")
    grass_dryness: Interval = interval(0.0, 0.8, "1", "0 green, 1 dry.")
    paint_renewed: Interval = interval(0.0, 0.4, "1", "Share of the lines' length that was painted anew.")
    paint_dirt: Interval = interval(0.0, 0.2, "1", "Share of the old markings' brightness that dirt takes.")
    paint_rubber: Interval = interval(
        0.0, 0.15, "1", "Share of the most crossed lines' length that rubber has blackened."
    )


class RoadScenario(ClosedModel):
    """Limits that the road is sampled within."""

    design_class: Literal[DESIGN_CLASSES] = Field(  # type: ignore[valid-type]
        "EKA1A",
        description="Design class, of motorways or country roads; if not given, the first with the section.",
        json_schema_extra=notes(labels=CLASS_LABELS),
    )
    cross_section: CrossSection = Field(
        "RQ31",
        title="Cross-Section",
        description="Standard cross-section, or a custom one; if not given, the usual one of the class.",
    )
    traffic_side: Literal["right", "left"] | None = Field(
        None,
        title="Traffic Keeps",
        description="Side that traffic keeps to; that of the class's guideline if not given.",
        json_schema_extra=notes(unset="By the Class", labels={"right": "Right", "left": "Left"}),
    )
    lanes: int | None = quantity(
        None,
        "1",
        "Lanes per direction; the cross-section's if not given.",
        (1, 8),
        title="Lanes Each Way",
        inherits="section.lanes",
    )
    lane_width: float | None = quantity(
        None, "m", "Width of every lane; the cross-section's if not given.", (2, 6), inherits="section.lane_width"
    )
    median_width: float | None = quantity(
        None, "m", "Width of the median; the cross-section's if not given.", (0.5, 40), inherits="section.median_width"
    )
    length: float = quantity(600.0, "m", "Length of the centreline.", (1, 200_000))
    radius: Interval | None = Field(
        None,
        description="Radii of curves; from the class's smallest to 5000 m if not given.",
        json_schema_extra=notes(unit="m", inherits="design_class.radius"),
    )
    grade_percent: Interval | None = Field(
        None,
        description="Longitudinal grades; the class's if not given.",
        json_schema_extra=notes(unit="%", inherits="design_class.grade_percent"),
    )
    placement: Literal["rules", "random"] = Field(
        "rules",
        description="Furniture by the safety rules, or at random within its limits.",
        json_schema_extra=notes(labels={"rules": "By the Rules", "random": "At Random"}),
    )
    lane_changes: LaneChangeLimits = Field(LaneChangeLimits(), description="Lane drops and gains.")
    overtaking: OvertakingLimits = Field(OvertakingLimits(), description="Overtaking lanes of 2+1 roads.")
    turnouts: TurnoutLimits = Field(TurnoutLimits(), description="Exits, entries, emergency bays.")
    side_roads: SideRoadLimits = Field(SideRoadLimits(), description="Side roads that join a country road.")
    bridges: BridgeLimits = Field(BridgeLimits(), description="Bridges that carry the road.")
    tunnels: TunnelLimits = Field(TunnelLimits(), description="Tunnels that lead the road through the ground.")
    interchange: InterchangeLimits = Field(InterchangeLimits(), description="An interchange of a motorway.")
    pavement: PavementLimits = Field(PavementLimits(), description="Pavement and its damage.")
    markings: MarkingLimits = Field(MarkingLimits(), description="Line markings.")
    villages: VillageLimits = Field(VillageLimits(), description="Villages that the road leads through.")
    barriers: BarrierLimits = Field(BarrierLimits(), description="Guardrails and other barriers.")
    furniture: FurnitureLimits = Field(FurnitureLimits(), description="Signs, gantries, equipment.")
    roadside: RoadsideLimits = Field(RoadsideLimits(), description="Fences, hedges, buildings, power lines.")
    vehicles: VehicleLimits = Field(VehicleLimits(), description="Traffic.")
    embankment_height: Interval = interval(
        -4.0, 5.0, "m", "Mean height of the road above the ground.", title="Embankment"
    )
    undulation: Interval = interval(0.05, 0.8, "m", "Standard deviation of the ground.")
    wavelength: Interval = interval(30.0, 60.0, "m", "Shortest wavelength of the ground's undulation.")
    batter_slope: Interval = interval(1.5, 2.5, "m/m", "Run of the batter per height.")
    crest_length: Interval = interval(0.5, 1.0, "m", "Tangent length of embankments' rounded crest.", title="Crest")
    rounding_length: Interval = interval(2.0, 3.0, "m", "Tangent length of toes' rounding.", title="Rounded Toe")
    swale_width: Interval = interval(
        1.0, 2.5, "m", "Width of swales in cuttings, whose depth is a fifth of it; 0 for none.", title="Swale"
    )
    ditch_width: Interval = interval(
        0.0, 2.0, "m", "Width of ditches at the foot of embankments, a fifth of it deep; 0 for none.", title="Ditch"
    )
    half_width: float = quantity(
        78.0, "m", "Distance to either side that is built.", (5, 1000), title="Reach Each Side"
    )
    elevation_model: str | None = Field(
        None,
        description="File of a digital elevation model (GeoTIFF, ESRI ASCII grid) instead of generated ground.",
        json_schema_extra=notes(unset="Generated"),
    )
    epsg: int = quantity(25832, "1", "Map coordinate system.", (1024, 99_999_999), title="EPSG Code")
    height_epsg: int | None = quantity(
        None,
        "1",
        "Vertical coordinate system of the heights; unnamed if not given.",
        (1024, 99_999_999),
        title="EPSG Code of Heights",
        unset="Not Named",
    )
    map_origin: tuple[Finite, Finite, Finite] = Field(
        (294_000.0, 5_628_000.0, 180.0),
        title="Map Origin",
        description="Map coordinates (east, north, elevation) of the local origin, m.",
    )
    grass_density: float = quantity(0.8, "1/m2", "Tufts of grass per area.", (0, 50), title="Grass (per m²)")
    shrubs_per_hectare: float = quantity(60.0, "1/ha", "Shrubs per hectare.", (0, 5000), title="Shrubs (per ha)")
    trees_per_hectare: float = quantity(40.0, "1/ha", "Trees per hectare.", (0, 2000), title="Trees (per ha)")
    vegetation: VegetationLimits = Field(VegetationLimits(), description="Species and sizes of plants.")
    landscape: LandscapeLimits = Field(LandscapeLimits(), description="Land beyond the terrain, for pictures.")
    environment: EnvironmentLimits = Field(EnvironmentLimits(), description="Light and weather.")
    materials: MaterialLimits = Field(MaterialLimits(), description="Variation of materials.")
    textures: str | None = Field(
        None,
        title="Folder of Textures",
        description="Folder of images that replace layers of materials, with a subfolder for each material.",
        json_schema_extra=notes(unset="None"),
    )
    assets: tuple[str, ...] = Field((), description="Libraries of assets to place: roadside, or JSON files.")
    changes: ChangeLimits = Field(ChangeLimits(), description="What happens to the road between two epochs.")

    @model_validator(mode="before")
    @classmethod
    def _fill_in_what_fits(cls, data: Any) -> Any:
        """Return data with the missing one of design class and cross-section filled in so that it fits the other."""
        if not isinstance(data, dict):
            return data
        design_class, section = str(data.get("design_class")), data.get("cross_section")
        if "cross_section" not in data and design_class in USUAL_SECTION:
            data = {**data, "cross_section": USUAL_SECTION[design_class]}
        elif "design_class" not in data and isinstance(section, str) and section in STANDARD_CROSS_SECTIONS:
            design_class = design_class_of(section, next(iter(USUAL_SECTION)))
            data = {**data, "design_class": design_class}
        guideline = GUIDELINE_OF_CLASS.get(design_class)
        return _merge_below(data, guideline.defaults) if guideline else data

    @model_validator(mode="after")
    def _check_cross_section(self) -> RoadScenario:
        """Refuse a cross-section that isn't a standard one, or that the design class doesn't allow."""
        if not isinstance(self.cross_section, str):
            if is_single(self.design_class):
                names = ", ".join(SECTIONS_OF_CLASS[self.design_class])
                raise ValueError(
                    f"cross_section is by hand, of two carriageways: {self.design_class} allows {names}, which "
                    "lane_width and lanes change"
                )
            return self
        if self.cross_section not in STANDARD_CROSS_SECTIONS:
            names = ", ".join(STANDARD_CROSS_SECTIONS)
            raise ValueError(f"cross_section is '{self.cross_section}': must be one of {names}")
        class_sections = SECTIONS_OF_CLASS[self.design_class]
        if self.cross_section not in class_sections:
            names = ", ".join(class_sections)
            raise ValueError(f"cross_section is '{self.cross_section}': {self.design_class} allows {names}")
        return self
