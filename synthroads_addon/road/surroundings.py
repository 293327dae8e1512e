"""Surroundings of the road: terrain, plants, vehicles, the landscape beyond; light and weather, and materials."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from ..base.schema import Model, first_repeated, quantity, when
from .objects import Color, RoadObject

TREES = ("maple", "birch", "poplar", "spruce", "pine")
SHRUBS = ("hawthorn", "hazel", "blackthorn")
GRASSES = ("meadow", "ryegrass", "reed")
SPECIES = {"tree": TREES, "shrub": SHRUBS, "grass": GRASSES}
"""Kind of vegetation -> its species."""


class Terrain(RoadObject):
    """The ground beside the road, which the batter meets: generated undulation, or a digital elevation model."""

    points_class: ClassVar = "ground"
    type: Literal["Terrain"] = "Terrain"
    half_width: float = quantity(ge=5, le=1000, unit="m", description="Reach to either side of the centreline.")
    embankment_height: float = quantity(
        ge=-20, le=20, unit="m", description="Mean height of the centreline above the ground; negative in a cutting."
    )
    undulation: float = quantity(ge=0, le=20, unit="m", description="Standard deviation of the ground's height.")
    wavelength: float = quantity(
        ge=10, le=2000, unit="m", description="Shortest wavelength of the ground's undulation."
    )
    batter_slope: float = quantity(
        1.5, ge=0.5, le=10, unit="m/m", description="Horizontal run of the batter per metre of height."
    )
    crest_length: float = quantity(
        0.0, ge=0, le=5, unit="m", description="Tangent length of the rounded crest of embankments."
    )
    rounding_length: float = quantity(
        0.0, ge=0, le=10, unit="m", description="Tangent length of the rounding of batter and ground; on low ones less."
    )
    swale_width: float = quantity(
        0.0, ge=0, le=5, unit="m", description="Width of the swale between verge and batter of a cutting; 0 for none."
    )
    swale_depth: float = quantity(
        0.0, ge=0, le=1, unit="m", description="Depth of that swale's middle below the verge's edge."
    )
    ditch_width: float = quantity(
        0.0, ge=0, le=5, unit="m", description="Width of the ditch at the foot of an embankment; 0 for none."
    )
    ditch_depth: float = quantity(
        0.0, ge=0, le=1, unit="m", description="Depth of that ditch's middle below the ground."
    )
    seed: int = quantity(ge=0, le=2**63 - 1, unit="1", description="Seed of the undulation.")
    elevation_model: str | None = Field(
        None, description="File of a digital elevation model that takes the undulation's place."
    )


LONGEST = 1e6
"""Station, m, that no road reaches."""


class Vegetation(RoadObject):
    """Plants of one species in a band beside the road, measured from the outer edge of the verge."""

    conditions = (
        *(when({"kind": {"const": k}}, {"species": {"enum": list(s)}}) for k, s in SPECIES.items()),
        when(
            {"kind": {"const": "grass"}},
            {"side": {"const": "both"}, "start_station": {"const": 0}, "end_station": {"const": LONGEST}},
        ),
    )

    points_class: ClassVar = "vegetation"
    type: Literal["Vegetation"] = "Vegetation"
    kind: Literal["grass", "shrub", "tree"] = Field(description="What grows.")
    species: Literal[
        "maple",
        "birch",
        "poplar",
        "spruce",
        "pine",
        "hawthorn",
        "hazel",
        "blackthorn",
        "meadow",
        "ryegrass",
        "reed",
    ] = Field(description="Species, which must be of the kind.")
    density: float = quantity(ge=0, le=50, unit="1/m2", description="Plants (tufts of grass, trees) per area.")
    band_start: float = quantity(ge=-5, le=1000, unit="m", description="Beginning of the band.")
    band_end: float = quantity(ge=-5, le=1000, unit="m", description="End of the band.")
    side: Literal["both", "left", "right"] = Field(
        "both", description="Sides of the road, looking with the stations, that shrubs and trees grow on."
    )
    start_station: float = quantity(
        0.0, ge=0, le=LONGEST, unit="m", description="Station from which on shrubs and trees grow."
    )
    end_station: float = quantity(
        LONGEST, ge=0, le=LONGEST, unit="m", description="Station up to which shrubs and trees grow."
    )
    height_min: float = quantity(gt=0, le=60, unit="m", description="Height of the smallest plant.")
    height_max: float = quantity(gt=0, le=60, unit="m", description="Height of the tallest plant.")
    mown_width: float = quantity(
        0.0, ge=0, le=20, unit="m", description="Grass so near behind the verge is mown as the verge is."
    )
    seed: int = quantity(ge=0, le=2**63 - 1, unit="1", description="Seed of places, sizes and turns.")

    @model_validator(mode="after")
    def _fits(self) -> Vegetation:
        """Return the plants unchanged; ValueError for a range that ends before its begin or a species of other kind."""
        ends = (self.band_end, self.height_max, self.end_station)
        begins = (self.band_start, self.height_min, self.start_station)
        if any(end < begin for begin, end in zip(begins, ends, strict=True)):
            raise ValueError(
                "band_end, height_max and end_station must not be less than band_start, height_min and start_station"
            )
        if self.kind == "grass" and (self.side, self.start_station, self.end_station) != ("both", 0.0, LONGEST):
            raise ValueError("side, start_station and end_station are for shrubs and trees: grass grows all along")
        if self.species not in SPECIES[self.kind]:
            raise ValueError(f"species '{self.species}' is no {self.kind}: {', '.join(SPECIES[self.kind])} are")
        return self


class Vehicle(RoadObject):
    """A vehicle on the centre of a lane. It drives with its carriageway's traffic."""

    points_class: ClassVar = "vehicle"
    type: Literal["Vehicle"] = "Vehicle"
    model: Literal["car", "estate", "van", "truck", "semitrailer", "bus", "motorcycle"] = Field(
        description="Type of vehicle."
    )
    carriageway: str = Field(description="Id of the carriageway that it drives on.")
    lane: int = quantity(ge=0, le=7, unit="1", description="Lane, counted from outside, 0 the outermost.")
    station: float = quantity(ge=0, unit="m", description="Station of its middle at the time 0.")
    speed: float = quantity(ge=0, le=80, unit="m/s", description="Speed along its lane; 0 stands.")
    color: Color = (0.4, 0.4, 0.4)


class RampVehicle(Vehicle):
    """A vehicle on a ramp or a crossing road.

    On a ramp it drives from the exit's lane to the mouth, or from the mouth to the entry's lane; stations count from
    beside the main road. On a crossing road lane 0 is that of the traffic with its stations, lane 1 that against them.
    """

    type: Literal["RampVehicle"] = "RampVehicle"  # type: ignore[assignment]
    carriageway: str = Field(description="Id of the ramp or crossing road that it drives on.")
    lane: int = quantity(0, ge=0, le=1, unit="1", description="Lane; 1 against the stations of a crossing road.")
    station: float = quantity(
        ge=0, unit="m", description="Where its middle is at the time 0, along the way of that road's traffic."
    )


class Village(Model):
    """A village of simple houses around a church."""

    x: float = quantity(ge=-1e6, le=1e6, unit="m", description="Local x of its church.")
    y: float = quantity(ge=-1e6, le=1e6, unit="m", description="Local y of its church.")
    houses: int = quantity(30, ge=1, le=500, unit="1", description="Number of houses.")
    radius: float = quantity(140.0, ge=20, le=2000, unit="m", description="Radius within which they stand.")


class WindTurbine(Model):
    """A wind turbine with three blades."""

    x: float = quantity(ge=-1e6, le=1e6, unit="m", description="Local x of its tower.")
    y: float = quantity(ge=-1e6, le=1e6, unit="m", description="Local y of its tower.")
    hub_height: float = quantity(120.0, ge=20, le=200, unit="m", description="Height of its hub.")
    rotor_diameter: float = quantity(110.0, ge=10, le=220, unit="m", description="Diameter of its rotor.")
    azimuth_deg: float = quantity(
        240.0, ge=0, le=360, unit="deg", description="Where its rotor looks to, clockwise from north."
    )
    rotor_deg: float = quantity(0.0, ge=0, le=120, unit="deg", description="Turn of the rotor from a blade upright.")


class Landscape(RoadObject):
    """The land beyond the terrain's reach. Pictures show it; it is no part of the scene that is scanned."""

    type: Literal["Landscape"] = "Landscape"
    reach: float = quantity(3000.0, ge=300, le=20_000, unit="m", description="Distance to which there is land.")
    hill_height: float = quantity(18.0, ge=0, le=300, unit="m", description="Standard deviation of the hills.")
    hill_length: float = quantity(900.0, ge=100, le=10_000, unit="m", description="Shortest wavelength of the hills.")
    parcel_size: float = quantity(
        150.0, ge=30, le=1000, unit="m", description="Usual width of fields near the road; far ones are larger."
    )
    forest_share: float = quantity(0.25, ge=0, le=1, unit="1", description="Share of the land under forest.")
    meadow_share: float = quantity(0.25, ge=0, le=1, unit="1", description="Share of the land under meadow.")
    villages: tuple[Village, ...] = Field((), description="Villages.")
    turbines: tuple[WindTurbine, ...] = Field((), description="Wind turbines.")
    seed: int = quantity(ge=0, le=2**63 - 1, unit="1", description="Seed of hills, parcels, trees and houses.")

    @model_validator(mode="after")
    def _fits(self) -> Landscape:
        """Return the landscape unchanged; ValueError if forest and meadow have more than all of the land."""
        if self.forest_share + self.meadow_share > 1.0:
            raise ValueError("forest_share and meadow_share must not be more than 1 together")
        return self


class Environment(Model):
    """Light, weather and season."""

    sun_azimuth_deg: float = quantity(
        180.0, ge=0, le=360, unit="deg", description="Direction of the sun, clockwise from north."
    )
    sun_elevation_deg: float = quantity(
        45.0,
        ge=-90,
        le=90,
        unit="deg",
        description="Height of the sun above the horizon; negative at dusk and at night.",
    )
    sun_strength: float = quantity(1.0, ge=0, le=2, unit="1", description="Strength of the sunlight; 1 on a clear day.")
    cloud_cover: float = quantity(0.0, ge=0, le=1, unit="1", description="Share of the ground in clouds' shadow.")
    cloud_size: float = quantity(120.0, ge=10, le=2000, unit="m", description="Size of a cloud's shadow.")
    cloud_speed: float = quantity(5.0, ge=0, le=50, unit="m/s", description="Speed at which the shadows drift.")
    cloud_direction_deg: float = quantity(
        90.0, ge=0, le=360, unit="deg", description="Where the shadows drift to, clockwise from north."
    )
    wetness: float = quantity(0.0, ge=0, le=1, unit="1", description="0 dry, 1 wet.")
    season: Literal["summer", "winter"] = Field(
        "summer", description="In winter broadleaved trees, shrubs and hedges are bare."
    )
    weather: Literal["clear", "haze", "fog", "rain", "snow", "dust"] = Field(
        "clear", description="Weather, for the attenuation of the beam."
    )
    visibility: float = quantity(23_000.0, ge=20, le=100_000, unit="m", description="Meteorological visibility.")


class MaterialTexture(Model):
    """A set of images in place of a material's layers."""

    material: str = Field(min_length=1, description="Name of the material in the table.")
    folder: str = Field(min_length=1, description="Folder of the images, each named after the layer that it gives.")
    tile: float = quantity(2.0, gt=0, le=1000, unit="m", description="Length that an image's width covers.")


class MaterialVariation(Model):
    """How this road's materials differ from the mean ones."""

    former_fields: ClassVar = frozenset({"soil_brightness", "seed", "patch_density", "crack_density"})

    asphalt_age: float = quantity(0.4, ge=0, le=1, unit="1", description="0 new and black, 1 old and bright.")
    asphalt_brightness: float = quantity(1.0, ge=0.5, le=2, unit="1", description="Factor on the base colour.")
    wheel_track_polish: float = quantity(0.3, ge=0, le=1, unit="1", description="Polish of the wheel tracks.")
    concrete_brightness: float = quantity(1.0, ge=0.5, le=2, unit="1", description="Factor on the base colour.")
    paint_wear: float = quantity(0.2, ge=0, le=1, unit="1", description="Share of the markings' film worn off.")
    paint_renewed: float = quantity(
        0.0, ge=0, le=1, unit="1", description="Share of the lines' length that was painted anew."
    )
    paint_dirt: float = quantity(
        0.0, ge=0, le=1, unit="1", description="Share of the old markings' brightness that dirt takes."
    )
    paint_rubber: float = quantity(
        0.0, ge=0, le=1, unit="1", description="Share of the most crossed lines' length that rubber has blackened."
    )
    grass_dryness: float = quantity(0.3, ge=0, le=1, unit="1", description="0 green, 1 dry.")
    textures: tuple[MaterialTexture, ...] = Field(
        (), description="Images in place of materials' layers, at most one set for each material."
    )

    @model_validator(mode="after")
    def _name_materials_once(self) -> MaterialVariation:
        """Return the variation unchanged; ValueError if two sets of images are for the same material."""
        repeated_name = first_repeated([texture.material for texture in self.textures])
        if repeated_name is not None:
            raise ValueError(f"textures has '{repeated_name}' twice: one set of images is allowed for each material")
        return self

    def texture(self, material: str) -> MaterialTexture | None:
        """Return the set of images of a material; None if it has none."""
        return next((texture for texture in self.textures if texture.material == material), None)
