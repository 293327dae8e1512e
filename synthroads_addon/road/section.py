"""The road itself: carriageways with their lanes and pavement, the median, turnouts, and markings."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from ..base.schema import Model, quantity, when
from .objects import LaneWidth, PointObject, RoadObject, ShoulderWidth, SignedWidth, StripWidth


class Lane(Model):
    """One lane. A width of 0 along a stretch is a lane that isn't there: dropped, or not gained yet."""

    width: LaneWidth = Field(description="Width between the lane's boundaries, or points of it.")
    kind: Literal["through", "climbing"] = Field("through", description="Use of the lane.")


class CrossfallPoint(Model):
    """Crossfall at a station; linear in between, constant before the first and after the last."""

    station: float = quantity(unit="m", description="Where the value holds.")
    crossfall_percent: float = quantity(
        ge=-12, le=12, unit="%", description="Positive where the surface falls to the right."
    )


class Rut(Model):
    """Rutting of one lane: two wheel tracks, each a trough of depth * cos^2(pi * distance / width) across.

    Over the first and last ``ramp_length`` the depth grows from 0 as a half cosine.
    """

    lane: int = quantity(ge=0, le=7, unit="1", description="Lane, counted from outside, 0 the outermost.")
    start_station: float = quantity(ge=0, unit="m", description="Beginning.")
    end_station: float = quantity(ge=0, unit="m", description="End.")
    depth: float = quantity(gt=0, le=0.1, unit="m", description="Greatest depth below the undamaged pavement.")
    width: float = quantity(0.8, ge=0.2, le=1.6, unit="m", description="Width of either wheel track.")
    track: float = quantity(1.8, ge=1.0, le=2.6, unit="m", description="Distance between the two wheel tracks.")
    ramp_length: float = quantity(10.0, gt=0, le=200, unit="m", description="Length over which it begins and ends.")


class Pothole(Model):
    """Spalling or a pothole: an elliptic bowl, depth * (1 - r^2) below the undamaged pavement within its edge."""

    station: float = quantity(ge=0, unit="m", description="Station of its centre.")
    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its centre.")
    length: float = quantity(gt=0, le=5, unit="m", description="Diameter along the road.")
    width: float = quantity(gt=0, le=5, unit="m", description="Diameter across the road.")
    depth: float = quantity(gt=0, le=0.3, unit="m", description="Depth at the centre.")


class Settlement(Model):
    """A basin where the ground has settled: depth * cos^2(pi * x / length) * cos^2(pi * y / width) around its centre.

    It reaches as far as the road does: across its lanes, strips and verge, not into the batter.
    """

    station: float = quantity(ge=0, unit="m", description="Station of its centre.")
    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its centre.")
    length: float = quantity(ge=1, le=500, unit="m", description="Extent along the road.")
    width: float = quantity(ge=1, le=60, unit="m", description="Extent across the road.")
    depth: float = quantity(gt=0, le=0.3, unit="m", description="Depth at the centre.")


class Overlay(Model):
    """A stretch with a new course on it, which lies higher by its thickness.

    Over the ramps at both ends, and at both sides over the tapers, it goes down to the pavement in a straight line.
    """

    start_station: float = quantity(ge=0, unit="m", description="Beginning.")
    end_station: float = quantity(ge=0, unit="m", description="End.")
    inner: float = quantity(ge=-50, le=50, unit="m", description="Distance of its inner edge from the centreline.")
    outer: float = quantity(ge=-50, le=50, unit="m", description="Distance of its outer edge from the centreline.")
    thickness: float = quantity(gt=0, le=0.2, unit="m", description="How much higher the surface lies.")
    ramp_length: float = quantity(5.0, gt=0, le=100, unit="m", description="Length over which it begins and ends.")
    taper: float = quantity(0.15, gt=0, le=2, unit="m", description="Width over which it runs out at its sides.")


SurfaceShape = Rut | Pothole | Settlement | Overlay
"""Things that form the surface of a pavement."""

SHORTEST_DASH = 0.05
"""Shortest dash and gap, m: a road has a row of faces for each."""


def check_dashes(dash_length: float, gap_length: float) -> None:
    """Raise ValueError unless a line's dashes and gaps (m) are both 0 or both long enough."""
    if (dash_length == 0) != (gap_length == 0):
        raise ValueError("dash_length and gap_length must both be 0 (solid) or both be positive")
    if 0 < min(dash_length, gap_length) < SHORTEST_DASH:
        raise ValueError(f"dash_length and gap_length must be 0 (solid) or at least {SHORTEST_DASH:g} m")


Corner = tuple[
    Annotated[float, Field(strict=True, ge=0, le=1e6)],
    Annotated[float, Field(strict=True, ge=-100, le=100)],
]
"""Station and offset of a place on the pavement, m."""


class Patch(Model):
    """A repaired place: asphalt of its own age all between its corners, which is their convex hull."""

    outline: tuple[Corner, ...] = Field(
        min_length=3, max_length=32, description="Stations and offsets (m) of its corners; it is convex."
    )
    age: float = quantity(0.5, ge=0, le=1, unit="1", description="0 new and black, 1 as old as what is around it.")
    height: float = quantity(
        0.001, ge=-0.03, le=0.03, unit="m", description="Height above the pavement; negative where it has sunk."
    )


class Crack(Model):
    """A crack, or a net of cracks, as lines with a width; open, or sealed by a band of bitumen."""

    kind: Literal["longitudinal", "transverse", "alligator"] = Field(description="How it runs; alligator is a net.")
    width: float = quantity(ge=0.001, le=0.2, unit="m", description="Width of the gap, or of the band that seals it.")
    sealed: bool = Field(False, strict=True, description="Whether it is sealed.")
    depth: float = quantity(
        0.005, ge=-0.01, le=0.2, unit="m", description="Depth below the pavement; negative where its seal stands out."
    )
    lines: tuple[Annotated[tuple[Corner, ...], Field(min_length=2, max_length=1000)], ...] = Field(
        min_length=1, max_length=1000, description="Stations and offsets (m) along each of its lines."
    )


_DASHES_FIT = when(
    {"dash_length": {"const": 0}},
    {"gap_length": {"const": 0}},
    otherwise={"dash_length": {"minimum": SHORTEST_DASH}, "gap_length": {"minimum": SHORTEST_DASH}},
)
"""JSON Schema of `check_dashes`."""


class RemovedMarking(Model):
    """A line marking that was ground off: its dashes are left as a brighter, shallow groove beside today's lines."""

    conditions = (_DASHES_FIT,)
    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of the line's axis.")
    width: float = quantity(ge=0.05, le=1.0, unit="m", description="Width that was ground.")
    dash_length: float = quantity(ge=0, le=100, unit="m", description="Length of a dash; 0 for a solid line.")
    gap_length: float = quantity(ge=0, le=100, unit="m", description="Length of a gap; 0 for a solid line.")
    start_station: float = quantity(ge=0, unit="m", description="Beginning of the first dash.")
    end_station: float = quantity(ge=0, unit="m", description="End of the line.")
    depth: float = quantity(0.002, ge=0, le=0.02, unit="m", description="Depth below the pavement.")

    @model_validator(mode="after")
    def _dashes_fit(self) -> RemovedMarking:
        """Return the marking unchanged; ValueError for dashes without gaps, or too short ones."""
        check_dashes(self.dash_length, self.gap_length)
        return self


ASPHALTS = ("asphalt", "stone_mastic_asphalt", "porous_asphalt", "mastic_asphalt")
CONCRETES = ("concrete", "exposed_aggregate_concrete")
SurfaceCourse = Literal[
    "asphalt",
    "stone_mastic_asphalt",
    "porous_asphalt",
    "mastic_asphalt",
    "concrete",
    "exposed_aggregate_concrete",
]
"""Kinds of pavement, each a material of the table; ``asphalt`` is dense asphalt concrete."""
_Age = Annotated[float, Field(strict=True, ge=0, le=1)]


class Pavement(Model):
    """Pavement of a carriageway, and its damage, which is exact geometry."""

    kind: SurfaceCourse = Field("asphalt", description="Surface course; asphalt is dense asphalt concrete.")
    lane_ages: tuple[_Age, ...] = Field(
        (),
        max_length=8,
        description="Ages of the lanes from outside, 0 new, 1 old; of a lane without one the road's asphalt_age.",
    )
    shoulder_age: float | None = quantity(
        None, ge=0, le=1, unit="1", description="Age of the hard shoulder; the road's asphalt_age if not given."
    )
    slab_length: float = quantity(5.0, ge=2, le=20, unit="m", description="Distance of a concrete pavement's joints.")
    joint_depth: float = quantity(0.002, ge=0, le=0.05, unit="m", description="Depth of joints below the pavement.")
    wheel_track_depth: float = quantity(
        0.003, ge=0, le=0.02, unit="m", description="Depth of the outermost lane's wheel tracks where it has no ruts."
    )
    unevenness: float = quantity(
        8.0,
        ge=0,
        le=512,
        unit="cm3",
        description="Spectral density of the heights at 0.1 cycles/m (ISO 8608: class A to 32, B to 128, C to 512).",
    )
    ruts: tuple[Rut, ...] = Field((), description="Rutting.")
    potholes: tuple[Pothole, ...] = Field((), description="Spalling and potholes.")
    patches: tuple[Patch, ...] = Field((), description="Repaired places.")
    cracks: tuple[Crack, ...] = Field((), description="Cracks.")
    removed_markings: tuple[RemovedMarking, ...] = Field((), description="Line markings that were ground off.")
    settlements: tuple[Settlement, ...] | None = Field(None, description="Basins where the ground has settled.")
    overlays: tuple[Overlay, ...] | None = Field(None, description="Stretches with a new course on the old one.")

    @property
    def is_concrete(self) -> bool:
        """Return whether it is of concrete, in slabs, else of asphalt."""
        return self.kind in CONCRETES

    @property
    def is_shaped(self) -> bool:
        """Return whether something changes the form of its surface: ruts, potholes, settlements, new courses."""
        return bool(self.ruts or self.potholes or self.settlements or self.overlays)


class Carriageway(RoadObject):
    """One direction's paved surface with its verge. Every width is a number, or points of it along the road."""

    points_class: ClassVar = "road"
    type: Literal["Carriageway"] = "Carriageway"
    side: Literal["left", "right"] = Field(description="Side of the centreline.")
    inner_offset: SignedWidth = Field(
        description="Distance of the inner paved edge from the centreline; negative where it lies beyond it."
    )
    hard_shoulder_width: ShoulderWidth = Field(description="0 where there is none.")
    outer_edge_strip_width: StripWidth = Field(description="Outside the outermost lane.")
    lanes: tuple[Lane, ...] = Field(min_length=1, max_length=8, description="Lanes from outside to inside.")
    inner_edge_strip_width: StripWidth = Field(description="Inside the innermost lane.")
    verge_width: ShoulderWidth = Field(description="Unpaved strip outside the pavement.")
    verge_slope_percent: float = quantity(
        8.0, ge=0, le=15, unit="%", description="Fall of the verge away from the pavement."
    )
    crossfall: tuple[CrossfallPoint, ...] = Field(min_length=1, description="Crossfall by station.")
    rotation_axis: Literal["carriageway_axis", "inner_edge", "centreline"] = Field(
        "carriageway_axis", description="Line that keeps the profile's elevation while the crossfall changes."
    )
    pavement: Pavement = Field(Pavement(), description="Surface course and damage.")
    traffic_side: Literal["right", "left"] | None = Field(
        None, description="Side that traffic keeps to, seen by drivers; right if not given."
    )

    @property
    def sign(self) -> int:
        """Return +1 for the left, -1 for the right carriageway: the sign of its offsets."""
        return 1 if self.side == "left" else -1

    @property
    def traffic(self) -> int:
        """Return +1 where traffic runs with the stations, -1 where against them.

        It is +1 on the right carriageway where traffic keeps right, and on the left one where it keeps left.
        """
        return self.sign if self.traffic_side == "left" else -self.sign


class Median(RoadObject):
    """The strip between the carriageways' inner edges, straight from one to the other."""

    points_class: ClassVar = "roadside"
    type: Literal["Median"] = "Median"


class Ramp(Model):
    """The first part of an exit ramp or the last of an entry ramp: in plan a clothoid away from the main road.

    At the distance x (m, along the centreline) from the gore's tip its inner edge has moved x^3 / (6 A^2) away. Up to
    the nose it lies in the main road's plane; from there on it turns about its inner edge to a crossfall of its own,
    and that edge leaves the plane by a vertical curve to a grade of its own.
    """

    length: float = quantity(85.0, ge=10, le=400, unit="m", description="Along the centreline, from the gore's tip.")
    clothoid_parameter: float = quantity(90.0, ge=30, le=500, unit="m", description="A of the clothoid.")
    lane_width: float = quantity(4.5, ge=3, le=8, unit="m", description="Width of the ramp's lane.")
    edge_strip_width: float = quantity(0.75, ge=0, le=2, unit="m", description="Width of either edge strip.")
    crossfall_percent: float | None = quantity(
        None,
        ge=-12,
        le=12,
        unit="%",
        description="Positive where it falls to the right; that of the main road if not given.",
    )
    run_off_length: float = quantity(
        20.0, ge=5, le=200, unit="m", description="Over which the crossfall comes to that, from the nose on."
    )
    grade_percent: float = quantity(
        0.0, ge=-8, le=8, unit="%", description="Against the main road's; positive where it rises behind the nose."
    )
    rounding_radius: float = quantity(
        1000.0, ge=200, le=50_000, unit="m", description="Radius of the vertical curve that begins at the nose."
    )


BAYS = ("emergency_bay", "bus_bay", "layby")
"""Kinds of turnouts that are bays: without a ramp, and with tapers at both ends. The first is a motorway's."""


class Turnout(RoadObject):
    """A widening of the pavement on the outer side: a bay, an exit with its lane and ramp, or an entry.

    It takes taper_in_length + lane_length + taper_out_length (+ ramp.length) along the centreline, named in the
    direction of traffic, from its lowest station on. An exit has no taper_out, an entry no taper_in: their ramps are in
    its place. Beside an exit's or entry's lane the hard shoulder gives way to ``shoulder_width``; an emergency bay lies
    outside the hard shoulder.
    """

    conditions = tuple(
        when(
            {"kind": {"const": kind}},
            {
                "ramp": {"type": "null" if kind in BAYS else "object"},
                "taper_in_length": {"const": 0} if kind == "entry" else {"exclusiveMinimum": 0},
                "taper_out_length": {"const": 0} if kind == "exit" else {"exclusiveMinimum": 0},
            },
        )
        for kind in (*BAYS, "exit", "entry")
    )
    points_class: ClassVar = "road"
    type: Literal["Turnout"] = "Turnout"
    carriageway: str = Field(description="Id of the carriageway that it widens.")
    kind: Literal["emergency_bay", "bus_bay", "layby", "exit", "entry"] = Field(description="What it is for.")
    start_station: float = quantity(unit="m", description="Its lowest station.")
    taper_in_length: float = quantity(0.0, ge=0, le=200, unit="m", description="Over which the width opens.")
    lane_length: float = quantity(ge=5, le=1000, unit="m", description="Length at full width.")
    taper_out_length: float = quantity(0.0, ge=0, le=200, unit="m", description="Over which the width closes.")
    lane_width: float = quantity(ge=2, le=6, unit="m", description="Width of the additional lane or bay.")
    edge_strip_width: float = quantity(
        0.5, ge=0, le=2, unit="m", description="Outside the additional lane; a bay has none."
    )
    shoulder_width: float = quantity(0.0, ge=0, le=4, unit="m", description="Hard shoulder beside the additional lane.")
    ramp: Ramp | None = Field(None, description="Ramp of an exit or entry.")

    @model_validator(mode="after")
    def _parts_fit(self) -> Turnout:
        """Return the turnout unchanged; ValueError if its kind doesn't go with its ramp or its tapers."""
        if (self.ramp is None) != (self.kind in BAYS):
            raise ValueError("ramp must be given for an exit or entry, and only there")
        tapers = {"exit": (True, False), "entry": (False, True)}.get(self.kind, (True, True))
        if (self.taper_in_length > 0, self.taper_out_length > 0) != tapers:
            needed = {"exit": "taper_in only", "entry": "taper_out only"}.get(self.kind, "both tapers")
            article = "an" if self.kind[0] == "e" else "a"
            raise ValueError(f"taper_in_length and taper_out_length: {article} {self.kind} has {needed}")
        return self

    @property
    def length(self) -> float:
        """Return its whole length along the centreline, m."""
        own_length = self.taper_in_length + self.lane_length + self.taper_out_length
        return own_length + (self.ramp.length if self.ramp else 0.0)

    @property
    def end_station(self) -> float:
        """Return its highest station, m."""
        return self.start_station + self.length


class Marking(Model):
    """Base of all markings: colour and the thickness of the film."""

    color: Literal["white", "yellow"] = Field("white", description="Yellow is temporary and overrides white (RMS).")
    film_thickness: float = quantity(
        0.003, ge=0.0005, le=0.006, unit="m", description="Height of the film above the pavement."
    )


class LineMarking(Marking, RoadObject):
    """A marking that follows a boundary. It lies on the pavement with the thickness of its film.

    ``outer_edge`` and ``block`` lie on the outer edge strip beside lane boundary 0, ``inner_edge`` on the inner one,
    ``lane`` is centred on its boundary; ``turnout_edge`` lies on the edge strip outside a turnout's lane and ramp,
    ``gore_edge`` on the ramp's inner edge strip. ``free`` is centred on ``offset``.
    """

    conditions = (
        _DASHES_FIT,
        when(
            {"kind": {"enum": ["turnout_edge", "gore_edge"]}},
            {"turnout": {"type": "string"}},
            otherwise={"turnout": {"type": "null"}},
        ),
    )
    points_class: ClassVar = "road_marking"
    type: Literal["LineMarking"] = "LineMarking"
    carriageway: str = Field(description="Id of the carriageway that it lies on.")
    kind: Literal["outer_edge", "lane", "inner_edge", "block", "turnout_edge", "gore_edge", "free"] = Field(
        description="What the line separates."
    )
    boundary: int = quantity(
        0, ge=0, le=8, unit="1", description="Lane boundary, counted from the outer edge of the outermost lane."
    )
    turnout: str | None = Field(None, description="Id of the turnout, for turnout_edge and gore_edge.")
    offset: SignedWidth = Field(
        0.0,
        description="Distance of the line's axis from the centreline, for free lines only; negative beyond it.",
    )
    width: float = quantity(ge=0.05, le=1.0, unit="m", description="Width of the line.")
    dash_length: float = quantity(ge=0, le=100, unit="m", description="Length of a dash; 0 for a solid line.")
    gap_length: float = quantity(ge=0, le=100, unit="m", description="Length of a gap; 0 for a solid line.")
    start_station: float = quantity(ge=0, unit="m", description="Beginning of the first dash.")
    end_station: float = quantity(ge=0, unit="m", description="End of the line.")

    @model_validator(mode="after")
    def _dashes_fit(self) -> LineMarking:
        """Return the marking unchanged; ValueError for dashes without gaps, or a turnout with the wrong kind."""
        check_dashes(self.dash_length, self.gap_length)
        if (self.turnout is not None) != (self.kind in ("turnout_edge", "gore_edge")):
            raise ValueError("turnout must be given for turnout_edge and gore_edge, and only there")
        return self


class Hatching(Marking, RoadObject):
    """The hatched area of a gore (Sperrflaeche): stripes across the pavement between main road and ramp."""

    points_class: ClassVar = "road_marking"
    type: Literal["Hatching"] = "Hatching"
    turnout: str = Field(description="Id of the turnout whose gore it fills.")
    stripe_width: float = quantity(1.0, ge=0.2, le=3, unit="m", description="Width of a stripe along the road.")
    gap_width: float = quantity(2.0, ge=0.2, le=6, unit="m", description="Gap between stripes along the road.")
    angle_deg: float = quantity(63.0, ge=15, le=90, unit="deg", description="Of the stripes against the centreline.")


class Arrow(Marking, PointObject):
    """An arrow on a lane. Its rotation is 0 where it points with the stations."""

    points_class: ClassVar = "road_marking"
    former_fields: ClassVar = frozenset({"elevation"})
    elevation: ClassVar[float] = 0.0  # type: ignore[misc]  # it lies on the pavement
    type: Literal["Arrow"] = "Arrow"
    carriageway: str = Field(description="Id of the carriageway that it lies on.")
    kind: Literal["straight", "left", "right", "straight_left", "straight_right", "merge_left", "merge_right"] = Field(
        description="Where it points."
    )
    length: float = quantity(5.0, ge=1, le=10, unit="m", description="Length of the arrow.")
