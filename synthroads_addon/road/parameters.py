"""`RoadParameters`: what a road is. The single source of truth of a scene; everything else is derived from it.

Conventions: lengths in metres, stations and offsets as horizontal distances along and across the centreline (offset
positive to the left), slopes in percent, angles in degrees in JSON (`_deg`). Coordinates are local; adding
``transform.translate`` (float64) gives map coordinates. Crossfall is positive where the surface falls to the right.
"""

from __future__ import annotations

import builtins
import itertools
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

import numpy as np
from pydantic import Field, model_validator

from ..base.errors import InputError
from ..base.maps.crs import MapSystem, compound_code, system_urn
from ..base.schema import Model, quantity, read_json
from .guidelines import DESIGN_CLASSES
from .objects import ObjectT, RoadObject, StrictFinite, width_at, width_kinks
from .other_roads.axis import LONGEST_ROAD, HorizontalElement, VerticalPoint
from .other_roads.guardrail import RampGuardrail
from .other_roads.parts import ConnectingRamp, CrossingRoad
from .section import Arrow, Carriageway, Hatching, LineMarking, Median, Turnout
from .side_roads.side_road import SideRoad
from .streets.street_side import StreetSide
from .structures.bridge import Bridge
from .structures.tunnel import Tunnel
from .surroundings import Environment, Landscape, MaterialVariation, RampVehicle, Terrain, Vegetation, Vehicle
from .things.registry import THINGS

SCHEMA_VERSION: Literal["1.0"] = "1.0"
_EPSG_URI_PATTERN = r"^https://www\.opengis\.net/def/crs/EPSG/0/[0-9]{4,8}$"
_EPOCH = re.compile(r"\+[0-9]+$")
"""Ending of the identifiers of later epochs of a road."""
_DIRECTIONS = ("left", "right")
"""Sides of the two carriageways."""
_OVERLAP = 1e-4
"""Width, m, by which rounding may let the two carriageways' inner edges overlap."""


class Metadata(Model):
    """Who made the set, and in which coordinates it stands."""

    identifier: str = Field(description="Unique name of the set, used in file names.")
    title: str = Field("", description="Title for people.")
    seed: int = quantity(0, ge=0, le=2**63 - 1, unit="1", description="Seed that the set was sampled from.")
    generator: str = Field(description="Program and version that wrote the set.")
    referenceSystem: str = Field(  # noqa: N815 (CityJSON's spelling)
        pattern=_EPSG_URI_PATTERN,
        description="URI of the map coordinate system.",
    )
    heightReferenceSystem: str | None = Field(  # noqa: N815
        None,
        pattern=_EPSG_URI_PATTERN,
        description="URI of the vertical system that heights are counted in; not known if not given.",
    )

    @property
    def road_identifier(self) -> str:
        """Return the identifier that the road has in all its epochs: without the number of a later one."""
        return _EPOCH.sub("", self.identifier)

    @property
    def epsg(self) -> int:
        """Return the EPSG code of the map coordinate system."""
        return int(self.referenceSystem.rsplit("/", 1)[1])

    @property
    def height_epsg(self) -> int | None:
        """Return the EPSG code of the vertical system; None if it isn't named beside the map's own."""
        return int(self.heightReferenceSystem.rsplit("/", 1)[1]) if self.heightReferenceSystem else None

    @property
    def system(self) -> MapSystem:
        """Return the map coordinate system, with the vertical one if it is named."""
        return MapSystem.of(self.epsg, self.height_epsg)

    @property
    def code(self) -> int:
        """Return the one EPSG code of map and vertical system together, or the map's where the pair has none."""
        return compound_code(self.epsg, self.height_epsg) or self.epsg

    @property
    def urn(self) -> str:
        """Return the URN of map and vertical system, as GeoJSON names them."""
        return system_urn(self.epsg, self.height_epsg)


class Transform(Model):
    """The local frame's origin on the map."""

    translate: tuple[StrictFinite, StrictFinite, StrictFinite] = Field(
        description="Map coordinates (east, north, elevation) of the local origin, m.",
        json_schema_extra={"unit": "m"},
    )


class StationEquation(Model):
    """A place from which on the road's kilometres are counted anew."""

    station: float = quantity(ge=0, unit="m", description="Where it is, from the begin of the centreline.")
    ahead: float = quantity(ge=-1e8, le=1e8, unit="m", description="Count from there on.")


class AlignmentObject(RoadObject):
    """The centreline: horizontal elements and vertical profile."""

    type: Literal["Alignment"] = "Alignment"
    start_x: float = quantity(unit="m", description="Local x of station 0.")
    start_y: float = quantity(unit="m", description="Local y of station 0.")
    start_heading_deg: float = quantity(
        ge=-360, le=360, unit="deg", description="Direction at station 0, counter-clockwise from east."
    )
    horizontal: tuple[HorizontalElement, ...] = Field(min_length=1, description="Elements in order.")
    vertical: tuple[VerticalPoint, ...] = Field(min_length=1, description="Intersection points in order.")
    first_station: float | None = quantity(
        None, ge=-1e8, le=1e8, unit="m", description="Count of the road's kilometres at its begin; null: not known."
    )
    equations: tuple[StationEquation, ...] = Field((), description="Station equations, in order.")

    @model_validator(mode="after")
    def _equations_in_order(self) -> AlignmentObject:
        """Return the alignment unchanged; ValueError unless the stations of its equations increase."""
        if any(a.station >= b.station for a, b in itertools.pairwise(self.equations)):
            raise ValueError("equations must be in the order of their stations")
        return self

    def counted(self, station: float) -> float:
        """Return the count of the road's kilometres (m) at a station (m): what boards and plans say of the place."""
        begin, count = 0.0, self.first_station or 0.0
        for equation in self.equations:
            if equation.station <= station:
                begin, count = equation.station, equation.ahead
        return count + station - begin

    def counts(self, spacing: float) -> list[tuple[float, int]]:
        """Return the stations (m) at which the count is a multiple of a spacing (m), and which multiple."""
        borders = [0.0, *(equation.station for equation in self.equations), self.length]
        multiples = []
        for border, next_border in itertools.pairwise(borders):
            first_count = self.counted(border)
            for multiple in range(
                math.ceil(first_count / spacing - 1e-9),
                math.floor((first_count + next_border - border) / spacing + 1e-9) + 1,
            ):
                station = border + multiple * spacing - first_count
                if station < next_border or next_border == self.length:
                    multiples.append((min(max(station, 0.0), self.length), multiple))
        return multiples

    @model_validator(mode="after")
    def _no_longer_than_any_road(self) -> AlignmentObject:
        """Return the alignment unchanged; ValueError if it is longer than `LONGEST_ROAD`."""
        if self.length > LONGEST_ROAD:
            raise ValueError(f"horizontal elements must be at most {LONGEST_ROAD:g} m long together")
        return self

    @property
    def length(self) -> float:
        """Return the length of the centreline, m."""
        return math.fsum(element.length for element in self.horizontal)


if TYPE_CHECKING:
    AnyObject = RoadObject
else:
    _PARTS = (
        AlignmentObject,
        Carriageway,
        Median,
        Turnout,
        SideRoad,
        StreetSide,
        LineMarking,
        Hatching,
        Arrow,
        CrossingRoad,
        ConnectingRamp,
        RampGuardrail,
    )
    _AROUND = (Terrain, Vegetation, Vehicle, RampVehicle, Landscape)
    AnyObject = Annotated[Union[(*_PARTS, Bridge, Tunnel, *THINGS.values(), *_AROUND)], Field(discriminator="type")]


_InstanceNumber = Annotated[int, Field(strict=True, ge=1, le=2**32 - 1)]
OBJECT_ID = r"[A-Za-z0-9_.-]{1,64}"


def _at_least_one(kind: str) -> dict[str, Any]:
    """Return the JSON Schema condition that a dictionary holds at least one object of a type."""
    return {"not": {"additionalProperties": {"properties": {"type": {"not": {"const": kind}}}}}}


class RoadParameters(Model):
    """One road. ``objects`` maps ids to objects; exactly one is the alignment."""

    type: Literal["RoadParameters"] = "RoadParameters"
    version: Literal["1.0"] = SCHEMA_VERSION
    metadata: Metadata
    transform: Transform
    design_class: Literal[DESIGN_CLASSES] = Field(  # type: ignore[valid-type]
        description="Design class: of motorways (RAA) or country roads (RAL)."
    )
    environment: Environment = Field(Environment(), description="Light and weather.")
    materials: MaterialVariation = Field(MaterialVariation(), description="How the materials differ from the mean.")
    objects: dict[str, AnyObject] = Field(
        description="Objects by id.",
        json_schema_extra={
            "propertyNames": {"pattern": f"^{OBJECT_ID}$"},
            "allOf": [_at_least_one("Alignment"), _at_least_one("Carriageway")],
        },
    )
    part_numbers: dict[str, tuple[_InstanceNumber, ...]] | None = Field(
        None,
        description="Instance numbers of objects' parts by the object's id, as an earlier epoch of this road has them: "
        "of a carriageway one for each damage, of others the first. They follow from the set if not given.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> RoadParameters:
        """Return the set unchanged; ValueError for a bad id, doubled numbers, or missing or unknown objects."""
        for name in self.objects:
            if not re.fullmatch(OBJECT_ID, name):
                raise ValueError(f"object id {name!r}: letters, digits, '_', '-' and '.' are allowed, at most 64")
        numbers = [item.instance for item in self.objects.values()]
        if len(set(numbers)) != len(numbers):
            raise ValueError("two objects have the same instance number")
        if len(self.of_type(AlignmentObject)) != 1:
            raise ValueError("objects must contain exactly one Alignment")
        for kind in (Median, Terrain):
            if len(self.of_type(kind)) > 1:
                raise ValueError(f"objects may contain one {kind.__name__} at most")
        self._check_carriageways()
        self._check_streets()
        self._check_structures()
        for name, item in self.objects.items():
            if fault := self._missing_reference(item):
                raise ValueError(f"objects.{name}: {fault}")
        return self

    def _check_carriageways(self) -> None:
        """Raise ValueError unless there are one or two, on different sides, apart, with traffic on the same side."""
        sides = [item.side for item in self.of_type(Carriageway).values()]
        if len({item.traffic_side or "right" for item in self.of_type(Carriageway).values()}) > 1:
            raise ValueError("traffic_side must be the same for both carriageways: right or left")
        if len(set(sides)) != len(sides) or not sides:
            raise ValueError("objects must contain one Carriageway per side at most, and at least one")
        if len(sides) == 2 and self._least_median() < -_OVERLAP:
            raise ValueError("the carriageways' inner_offset must add up to 0 or more: their pavements overlap")

    def _check_streets(self) -> None:
        """Raise ValueError if street sides of one carriageway overlap, or it has turnouts too."""
        streets = sorted(self.of_type(StreetSide).values(), key=lambda item: (item.carriageway, item.start_station))
        for a, b in itertools.pairwise(streets):
            if a.carriageway == b.carriageway and a.end_station > b.start_station:
                raise ValueError(f"two StreetSides of {a.carriageway} overlap from station {b.start_station:g} m on")
        both = {item.carriageway for item in streets} & {t.carriageway for t in self.of_type(Turnout).values()}
        if both:
            raise ValueError(f"{min(both)} has a StreetSide and a Turnout: only one kind of them is allowed")

    def _check_structures(self) -> None:
        """Raise ValueError if a bridge or tunnel stands with one direction alone, or a tunnel with crossing roads."""
        tunnels, crossings = list(self.of_type(Tunnel)), list(self.of_type(CrossingRoad))
        if tunnels and crossings:
            raise ValueError(
                f"{tunnels[0]} and {crossings[0]}: a road has tunnels, or crossing roads with ramps; remove one of both"
            )
        if len(self.of_type(Carriageway)) == len(_DIRECTIONS):
            return
        for kind in (Bridge, Tunnel):
            if self.of_type(kind):
                word = kind.__name__
                raise ValueError(f"a {word} needs a Carriageway on both sides: add the other one, or remove it")

    def _least_median(self) -> float:
        """Return the least distance of the two carriageways' inner edges along the road, m."""
        inner_offsets = [item.inner_offset for item in self.of_type(Carriageway).values()]
        station = [0.0, *(s for width in inner_offsets for s in width_kinks(width))]
        return float(sum((width_at(width, station) for width in inner_offsets), np.zeros(len(station))).min())

    def _missing_reference(self, item: RoadObject) -> str:
        """Return a message if an object names a carriageway, lane or turnout that isn't there, else an empty string."""
        if isinstance(item, RampVehicle):
            return self._missing_other(item.carriageway, "carriageway")
        if isinstance(item, LineMarking | Arrow | Vehicle | Turnout | SideRoad | StreetSide):
            carriageway = self.objects.get(item.carriageway)
            if not isinstance(carriageway, Carriageway):
                return f"carriageway '{item.carriageway}' must name a Carriageway"
            if isinstance(item, LineMarking) and item.boundary > len(carriageway.lanes):
                return "carriageway and boundary must name a lane boundary that exists"
            if isinstance(item, Vehicle) and item.lane >= len(carriageway.lanes):
                return f"lane {item.lane} must be less than the number of lanes, {len(carriageway.lanes)}"
        if isinstance(item, LineMarking | Hatching) and item.turnout is not None:
            turnout = self.objects.get(item.turnout)
            if not isinstance(turnout, Turnout) or turnout.ramp is None:
                return f"turnout '{item.turnout}' must name an exit or entry"
        return self._missing_road(item)

    def _missing_road(self, item: RoadObject) -> str:
        """Return a message if a crossing road, a ramp or a rail there names what isn't there, else an empty string."""
        if isinstance(item, RampGuardrail):
            return self._missing_other(item.road, "road")
        kind = type(self.objects.get(item.bridge)).__name__ if isinstance(item, CrossingRoad) else "Bridge"
        if isinstance(item, CrossingRoad) and kind not in ("Overpass", "Bridge"):
            return f"bridge '{item.bridge}' must name an Overpass or a Bridge"
        if isinstance(item, ConnectingRamp):
            turnout = self.objects.get(item.turnout)
            if not isinstance(turnout, Turnout) or turnout.ramp is None:
                return f"turnout '{item.turnout}' must name an exit or entry"
            if not isinstance(self.objects.get(item.crossing_road), CrossingRoad):
                return f"crossing_road '{item.crossing_road}' must name a CrossingRoad"
        return ""

    def _missing_other(self, name: str, field: str) -> str:
        """Return a message if a field doesn't name a ramp or a crossing road, else an empty string."""
        if isinstance(self.objects.get(name), CrossingRoad | ConnectingRamp):
            return ""
        return f"{field} '{name}' must name a ConnectingRamp or a CrossingRoad"

    def of_type(self, kind: builtins.type[ObjectT]) -> dict[str, ObjectT]:
        """Return the objects of one class by id, in the order of the file."""
        return {name: item for name, item in self.objects.items() if isinstance(item, kind)}

    @property
    def joined_turnouts(self) -> frozenset[int]:
        """Return the instance numbers of the exits and entries whose ramps go on as roads of their own."""
        ramps = self.of_type(ConnectingRamp).values()
        # A stretch has only what lies on it.
        return frozenset(self.objects[ramp.turnout].instance for ramp in ramps if ramp.turnout in self.objects)

    def carriageway_of(
        self, item: LineMarking | Arrow | Hatching | Turnout | SideRoad | StreetSide | Vehicle
    ) -> Carriageway:
        """Return the carriageway that an object is on or beside; a hatching's is its turnout's."""
        carriageway: Any = self.objects[item.turnout if isinstance(item, Hatching) else item.carriageway]
        return self.carriageway_of(carriageway) if isinstance(item, Hatching) else carriageway

    @property
    def alignment(self) -> AlignmentObject:
        """Return the alignment object."""
        return next(iter(self.of_type(AlignmentObject).values()))

    @property
    def terrain(self) -> Terrain | None:
        """Return the terrain, or None if the road has none."""
        return next(iter(self.of_type(Terrain).values()), None)

    @property
    def traffic_side(self) -> Literal["left", "right"]:
        """Return the side that traffic keeps to."""
        return next(iter(self.of_type(Carriageway).values())).traffic_side or "right"

    def carriageway(self, side: Literal["left", "right"]) -> Carriageway | None:
        """Return the carriageway of one side, or None if there is none."""
        return next((c for c in self.of_type(Carriageway).values() if c.side == side), None)


def read_parameters(path: Path | str) -> RoadParameters:
    """Read a parameter set from a JSON file; InputError names file, field, value and what is allowed.

    Example:
        >>> from pathlib import Path
        >>> from synthroads_addon import sample_road
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> road = sample_road(RoadScenario(length=100.0), seed=1)
        >>> _ = Path("road.json").write_text(road.to_json(), encoding="utf-8")
        >>> read_parameters("road.json") == road
        True
    """
    data = read_json(path)
    if isinstance(data, dict) and data.get("type") not in (None, "RoadParameters"):
        raise InputError(f"{path}: type", data["type"], "must be 'RoadParameters'")
    if isinstance(data, dict) and data.get("version") not in (None, SCHEMA_VERSION):
        raise InputError(f"{path}: version", data["version"], f"this program reads version '{SCHEMA_VERSION}'")
    return RoadParameters.from_dict(data, source=str(path))


def parameters_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a parameter set."""
    schema = RoadParameters.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
