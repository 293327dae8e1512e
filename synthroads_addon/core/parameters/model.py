"""`RoadParameters`: what a road is. The single source of truth of a scene; everything else is derived from it.

Conventions: lengths in metres, stations and offsets as horizontal distances along and across the centreline (offset
positive to the left), slopes in percent, angles in degrees in JSON (`_deg`). Coordinates are local; adding
``transform.translate`` (float64) gives map coordinates. Crossfall is positive where the surface falls to the right.
"""

from __future__ import annotations

import builtins
import re
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field, model_validator

from ..errors import InputError
from ..schema import Model, canonical_json, quantity, read_json

SCHEMA_VERSION: Literal["1.0"] = "1.0"
EPSG_URI = "https://www.opengis.net/def/crs/EPSG/0/{}"
StrictFinite = Annotated[float, Field(strict=True, ge=-1e8, le=1e8)]
DESIGN_CLASSES = ("EKA1A", "EKA1B", "EKA2", "EKA3")


class Metadata(Model):
    """Who made the set, and in which coordinates it stands."""

    identifier: str = Field(description="Unique name of the set, used in file names.")
    title: str = Field("", description="Title for people.")
    seed: int = quantity(0, ge=0, unit="1", description="Seed that the set was sampled from.")
    generator: str = Field(description="Program and version that wrote the set.")
    referenceSystem: str = Field(  # noqa: N815 (CityJSON's spelling)
        pattern=r"^https://www\.opengis\.net/def/crs/EPSG/0/\d{4,6}$",
        description="URI of the map coordinate system.",
    )

    @property
    def epsg(self) -> int:
        """Return the EPSG code of the map coordinate system."""
        return int(self.referenceSystem.rsplit("/", 1)[1])


class Transform(Model):
    """The local frame's origin on the map."""

    translate: tuple[StrictFinite, StrictFinite, StrictFinite] = Field(
        description="Map coordinates (east, north, elevation) of the local origin, m.",
        json_schema_extra={"unit": "m"},
    )


class RoadObject(Model):
    """Base of everything in ``objects``: each has a type and a number that its points carry."""

    instance: int = quantity(
        ge=1, le=2**32 - 1, unit="1", description="Number that the object's faces and points carry."
    )


ObjectT = TypeVar("ObjectT", bound=RoadObject)


class HorizontalElement(Model):
    """A line, arc or clothoid; the curvature changes linearly with the station."""

    kind: Literal["line", "arc", "clothoid"] = Field(description="What the two curvatures make it.")
    length: float = quantity(gt=0, unit="m", description="Length along the centreline.")
    curvature_start: float = quantity(ge=-0.1, le=0.1, unit="1/m", description="Positive to the left.")
    curvature_end: float = quantity(ge=-0.1, le=0.1, unit="1/m", description="Positive to the left.")

    @model_validator(mode="after")
    def _kind_fits(self) -> HorizontalElement:
        straight = self.curvature_start == 0.0 == self.curvature_end
        fits = {"line": straight, "arc": self.curvature_start == self.curvature_end and not straight}
        if not fits.get(self.kind, self.curvature_start != self.curvature_end):
            raise ValueError(f"kind '{self.kind}' contradicts its curvatures")
        return self

    @classmethod
    def between(cls, length: float, curvature_start: float, curvature_end: float) -> HorizontalElement:
        """Return the element of these curvatures (1/m), whatever kind that makes it."""
        same = curvature_start == curvature_end
        kind: Literal["line", "arc", "clothoid"] = "clothoid" if not same else "arc" if curvature_start else "line"
        return cls(kind=kind, length=length, curvature_start=curvature_start, curvature_end=curvature_end)


class VerticalPoint(Model):
    """A point of vertical intersection with its parabolic rounding."""

    station: float = quantity(unit="m", description="Where the two tangents intersect.")
    elevation: float = quantity(ge=-500, le=9000, unit="m", description="Local elevation of the intersection.")
    radius: float = quantity(0.0, ge=0, unit="m", description="Radius of the crest or sag; 0 leaves a kink.")


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

    @property
    def length(self) -> float:
        """Return the length of the centreline, m."""
        return sum(element.length for element in self.horizontal)


class Lane(Model):
    """One lane."""

    width: float = quantity(ge=2.0, le=6.0, unit="m", description="Width between the lane's boundaries.")
    kind: Literal["through"] = Field("through", description="Use of the lane.")


class CrossfallPoint(Model):
    """Crossfall at a station; linear in between, constant before the first and after the last."""

    station: float = quantity(unit="m", description="Where the value holds.")
    crossfall_percent: float = quantity(
        ge=-12, le=12, unit="%", description="Positive where the surface falls to the right."
    )


class Carriageway(RoadObject):
    """One direction's paved surface with its verge."""

    type: Literal["Carriageway"] = "Carriageway"
    side: Literal["left", "right"] = Field(description="Side of the centreline.")
    inner_offset: float = quantity(
        ge=0, le=50, unit="m", description="Distance of the inner paved edge from the centreline."
    )
    hard_shoulder_width: float = quantity(ge=0, le=6, unit="m", description="0 where there is none.")
    outer_edge_strip_width: float = quantity(ge=0, le=2, unit="m", description="Outside the outermost lane.")
    lanes: tuple[Lane, ...] = Field(min_length=1, max_length=8, description="Lanes from outside to inside.")
    inner_edge_strip_width: float = quantity(ge=0, le=2, unit="m", description="Inside the innermost lane.")
    verge_width: float = quantity(ge=0, le=5, unit="m", description="Unpaved strip outside the pavement.")
    verge_slope_percent: float = quantity(
        8.0, ge=0, le=15, unit="%", description="Fall of the verge away from the pavement."
    )
    crossfall: tuple[CrossfallPoint, ...] = Field(min_length=1, description="Crossfall by station.")
    rotation_axis: Literal["carriageway_axis", "inner_edge"] = Field(
        "carriageway_axis", description="Line that keeps the profile's elevation while the crossfall changes."
    )

    @property
    def sign(self) -> int:
        """Return +1 for the left, -1 for the right carriageway: the sign of its offsets."""
        return 1 if self.side == "left" else -1

    @property
    def paved_width(self) -> float:
        """Return the width from the inner edge strip to the hard shoulder, m."""
        lanes = sum(lane.width for lane in self.lanes)
        return self.inner_edge_strip_width + lanes + self.outer_edge_strip_width + self.hard_shoulder_width


class Median(RoadObject):
    """The strip between the carriageways' inner edges, straight from one to the other."""

    type: Literal["Median"] = "Median"


class LineMarking(RoadObject):
    """A marking that follows a lane boundary. It lies on the pavement with the thickness of its film."""

    type: Literal["LineMarking"] = "LineMarking"
    carriageway: str = Field(description="Id of the carriageway that it lies on.")
    kind: Literal["outer_edge", "lane", "inner_edge"] = Field(description="What the line separates.")
    boundary: int = quantity(
        ge=0, le=8, unit="1", description="Lane boundary, counted from the outer edge of the outermost lane."
    )
    width: float = quantity(ge=0.05, le=1.0, unit="m", description="Width of the line.")
    dash_length: float = quantity(ge=0, le=100, unit="m", description="Length of a dash; 0 for a solid line.")
    gap_length: float = quantity(ge=0, le=100, unit="m", description="Length of a gap; 0 for a solid line.")
    start_station: float = quantity(ge=0, unit="m", description="Beginning of the first dash.")
    end_station: float = quantity(ge=0, unit="m", description="End of the line.")
    film_thickness: float = quantity(
        0.003, ge=0.0005, le=0.006, unit="m", description="Height of the film above the pavement."
    )

    @model_validator(mode="after")
    def _dashes_fit(self) -> LineMarking:
        if (self.dash_length == 0) != (self.gap_length == 0):
            raise ValueError("dash_length and gap_length must both be 0 (solid) or both be positive")
        return self


class Guardrail(RoadObject):
    """A steel guardrail: W-beam on posts, ramped down at its terminals."""

    type: Literal["Guardrail"] = "Guardrail"
    start_station: float = quantity(ge=0, unit="m", description="Beginning, terminal included.")
    end_station: float = quantity(ge=0, unit="m", description="End, terminal included.")
    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of the posts' axis.")
    faces: Literal["left", "right", "both"] = Field(description="Side that the beam is mounted on.")
    height: float = quantity(0.75, ge=0.3, le=1.5, unit="m", description="Top of the beam above the surface.")
    post_spacing: float = quantity(4.0, ge=0.5, le=10, unit="m", description="Distance between posts.")
    terminal_length: float = quantity(
        12.0, ge=0, le=50, unit="m", description="Length over which either end is ramped into the ground."
    )


class Delineator(RoadObject):
    """A delineator post (Leitpfosten) beside the road."""

    type: Literal["Delineator"] = "Delineator"
    station: float = quantity(ge=0, unit="m", description="Station of its axis.")
    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its axis.")
    rotation_deg: float = quantity(
        0.0, ge=-360, le=360, unit="deg", description="About the vertical; 0 faces traffic with the stations."
    )
    height: float = quantity(1.0, ge=0.3, le=1.5, unit="m", description="Top above the surface.")


class Terrain(RoadObject):
    """The ground beside the road: generated undulation that the batter meets."""

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
    seed: int = quantity(ge=0, unit="1", description="Seed of the undulation.")


class Vegetation(RoadObject):
    """Plants of one kind in a band on both sides of the road, measured from the outer edge of the verge."""

    type: Literal["Vegetation"] = "Vegetation"
    kind: Literal["grass", "tree"] = Field(description="What grows.")
    density: float = quantity(ge=0, le=50, unit="1/m2", description="Plants (tufts of grass, trees) per area.")
    band_start: float = quantity(ge=-5, le=1000, unit="m", description="Beginning of the band.")
    band_end: float = quantity(ge=-5, le=1000, unit="m", description="End of the band.")
    height_min: float = quantity(gt=0, le=60, unit="m", description="Height of the smallest plant.")
    height_max: float = quantity(gt=0, le=60, unit="m", description="Height of the tallest plant.")
    seed: int = quantity(ge=0, unit="1", description="Seed of places, sizes and turns.")

    @model_validator(mode="after")
    def _in_order(self) -> Vegetation:
        if self.band_end < self.band_start or self.height_max < self.height_min:
            raise ValueError("band_end and height_max must not be less than band_start and height_min")
        return self


AnyObject = Annotated[
    AlignmentObject | Carriageway | Median | LineMarking | Guardrail | Delineator | Terrain | Vegetation,
    Field(discriminator="type"),
]


class RoadParameters(Model):
    """One road. ``objects`` maps ids to objects; exactly one is the alignment."""

    type: Literal["RoadParameters"] = "RoadParameters"
    version: Literal["1.0"] = SCHEMA_VERSION
    metadata: Metadata
    transform: Transform
    design_class: Literal["EKA1A", "EKA1B", "EKA2", "EKA3"] = Field(description="Design class of the RAA.")
    objects: dict[str, AnyObject]

    @model_validator(mode="after")
    def _consistent(self) -> RoadParameters:
        for name in self.objects:
            if not re.fullmatch(r"[A-Za-z0-9_.-]{1,64}", name):
                raise ValueError(f"object id {name!r}: letters, digits, '_', '-' and '.' are allowed, at most 64")
        numbers = [item.instance for item in self.objects.values()]
        if len(set(numbers)) != len(numbers):
            raise ValueError("two objects have the same instance number")
        if len(self.of_type(AlignmentObject)) != 1:
            raise ValueError("objects must contain exactly one Alignment")
        for kind in (Median, Terrain):
            if len(self.of_type(kind)) > 1:
                raise ValueError(f"objects may contain one {kind.__name__} at most")
        sides = [item.side for item in self.of_type(Carriageway).values()]
        if len(set(sides)) != len(sides) or not sides:
            raise ValueError("objects must contain one Carriageway per side at most, and at least one")
        for name, line in self.of_type(LineMarking).items():
            carriageway = self.objects.get(line.carriageway)
            if not isinstance(carriageway, Carriageway) or line.boundary > len(carriageway.lanes):
                raise ValueError(f"objects.{name}: carriageway and boundary must name a lane boundary that exists")
        return self

    def of_type(self, kind: builtins.type[ObjectT]) -> dict[str, ObjectT]:
        """Return the objects of one class by id, in the order of the file."""
        return {name: item for name, item in self.objects.items() if isinstance(item, kind)}

    @property
    def alignment(self) -> AlignmentObject:
        """Return the alignment object."""
        return next(iter(self.of_type(AlignmentObject).values()))

    @property
    def terrain(self) -> Terrain | None:
        """Return the terrain, if the road has one."""
        return next(iter(self.of_type(Terrain).values()), None)

    def carriageway(self, side: Literal["left", "right"]) -> Carriageway | None:
        """Return the carriageway of one side, if there is one."""
        return next((c for c in self.of_type(Carriageway).values() if c.side == side), None)


def read_parameters(path: Path | str) -> RoadParameters:
    """Read a parameter set from a file; raise `InputError` naming file, field, value and what is allowed."""
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


def write_schema(path: Path) -> None:
    """Write the JSON Schema in the canonical layout."""
    path.write_text(canonical_json(parameters_schema()), encoding="utf-8")
