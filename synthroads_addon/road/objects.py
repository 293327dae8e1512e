"""Base of the objects of a parameter set: instance number, place along the road, width by station."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Discriminator, Field, Tag

from ..base.arrays import Float
from ..base.schema import Model, quantity

StrictFinite = Annotated[float, Field(strict=True, ge=-1e8, le=1e8)]
Side = Literal["left", "right"]
Color = Annotated[
    tuple[
        Annotated[float, Field(strict=True, ge=0, le=1)],
        Annotated[float, Field(strict=True, ge=0, le=1)],
        Annotated[float, Field(strict=True, ge=0, le=1)],
    ],
    Field(description="Red, green, blue, 0 to 1, linear.", json_schema_extra={"unit": "1"}),
]
"""A base colour."""


class RoadObject(Model):
    """Base of everything in ``objects``: each has a type, and a number that its points carry.

    Attributes:
        points_class: semantic class of its points; empty for what has none, or chooses it itself.
    """

    conditions: ClassVar[Sequence[dict[str, Any]]] = ({"required": ["type"]},)
    points_class: ClassVar[str] = ""

    instance: int = quantity(
        ge=1, le=2**32 - 1, unit="1", description="Number that the object's faces and points carry."
    )

    @property
    def semantic_class(self) -> str:
        """Return the name of the semantic class of its points."""
        return self.points_class


ObjectT = TypeVar("ObjectT", bound=RoadObject)


class PointObject(RoadObject):
    """Base of what stands at one place, after the logic of IfcLinearPlacement."""

    station: float = quantity(ge=0, unit="m", description="Station of its axis.")
    offset: float = quantity(ge=-1000, le=1000, unit="m", description="Offset of its axis.")
    elevation: float = quantity(
        0.0, ge=-20, le=50, unit="m", description="Height of its foot above the surface (road or ground) below it."
    )
    rotation_deg: float = quantity(
        0.0, ge=-360, le=360, unit="deg", description="About the vertical; 0 faces traffic with the stations."
    )


class LineObject(RoadObject):
    """Base of what runs along the road at one offset."""

    start_station: float = quantity(ge=0, unit="m", description="Beginning, terminal included.")
    end_station: float = quantity(ge=0, unit="m", description="End, terminal included.")
    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its axis.")

    def offset_at(self, station: Float) -> Float:
        """Return the offsets (N,) of its axis at stations (N,), m."""
        return np.full(station.shape, self.offset)


class WidthPoint(Model):
    """A width at a station."""

    station: float = quantity(unit="m", description="Where the width holds.")
    width: float = quantity(ge=0, le=50, unit="m", description="The width there.")


class SignedWidthPoint(WidthPoint):
    """A width at a station; negative where it lies on the other side of the centreline."""

    width: float = quantity(ge=-50, le=50, unit="m", description="The width there.")


def _in_order(points: tuple[WidthPoint, ...]) -> tuple[WidthPoint, ...]:
    """Return width points unchanged; ValueError unless their stations increase."""
    for previous, following in pairwise(points):
        if following.station <= previous.station:
            raise ValueError(f"station {following.station} must be greater than the one before, {previous.station}")
    return points


def _form(width: object) -> str | None:
    """Return "points" or "number" by the form that a width has, None for neither; the union's discriminator."""
    if isinstance(width, list | tuple):
        return "points"
    return "number" if isinstance(width, int | float) and not isinstance(width, bool) else None


_FORM = Discriminator(_form, "width_type", "must be a number or points {station, width}")
_METRES = Field(json_schema_extra={"unit": "m"})
WidthPoints = Annotated[
    tuple[WidthPoint, ...],
    Field(min_length=2, description="Linear in between, constant before the first point and after the last."),
    AfterValidator(_in_order),
    Tag("points"),
]
SignedWidthPoints = Annotated[
    tuple[SignedWidthPoint, ...],
    Field(min_length=2, description="Linear in between, constant before the first point and after the last."),
    AfterValidator(_in_order),
    Tag("points"),
]
AnyWidth = float | tuple[WidthPoint, ...]
"""A width (m), or points of it along the road."""
Width = Annotated[Annotated[float, Field(strict=True, ge=0, le=50), Tag("number")] | WidthPoints, _FORM, _METRES]
SignedWidth = Annotated[
    Annotated[float, Field(strict=True, ge=-50, le=50), Tag("number")] | SignedWidthPoints, _FORM, _METRES
]
LaneWidth = Annotated[Annotated[float, Field(strict=True, ge=2, le=6), Tag("number")] | WidthPoints, _FORM, _METRES]
ShoulderWidth = Annotated[Annotated[float, Field(strict=True, ge=0, le=6), Tag("number")] | WidthPoints, _FORM, _METRES]
StripWidth = Annotated[Annotated[float, Field(strict=True, ge=0, le=2), Tag("number")] | WidthPoints, _FORM, _METRES]


def width_at(width: AnyWidth, station: ArrayLike) -> Float:
    """Return a width (m) at stations of any shape, same shape, interpolated between its points.

    Example:
        >>> taper = (WidthPoint(station=0.0, width=0.0), WidthPoint(station=60.0, width=3.5))
        >>> width_at(taper, [0.0, 30.0, 60.0]).tolist()
        [0.0, 1.75, 3.5]
    """
    station = np.asarray(station, dtype=np.float64)
    if isinstance(width, tuple):
        return np.interp(station, [p.station for p in width], [p.width for p in width])
    return np.full(station.shape, width)


def width_kinks(width: AnyWidth) -> list[float]:
    """Return the stations (m) at which a width's rate of change jumps; none where it is constant."""
    return [point.station for point in width] if isinstance(width, tuple) else []


def nominal_width(width: AnyWidth) -> float:
    """Return a width's value farthest from 0 along the road, m: what it is where nothing is left out."""
    return max((point.width for point in width), key=abs) if isinstance(width, tuple) else width


def least_width(width: AnyWidth) -> float:
    """Return a width's smallest value along the road, m."""
    return min(point.width for point in width) if isinstance(width, tuple) else width
