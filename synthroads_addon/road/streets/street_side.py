"""One side of a built-up stretch: what lies between a carriageway's pavement and the ground."""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar, Literal

from pydantic import Field, model_validator

from ...base.schema import Model, quantity
from ..objects import RoadObject

SETT_ROW = 0.16
"""Width of one row of setts with its joint, m: setts of 15 to 17 cm, the usual size for gutters. Chosen."""
KERB_END = 0.5
"""Length over which gutter and kerb open from nothing at either end of a stretch, m. Chosen."""
LEAST_FOOTWAY = 0.5
"""Width of the footway that a parking bay must leave, m. Chosen."""

Surface = Literal["asphalt", "concrete_pavers", "setts", "concrete"]


class KerbLevel(Model):
    """A place where the kerb is lower, as at an entrance or a crossing, or higher, as at a bus stop."""

    station: float = quantity(ge=0, unit="m", description="Station of its middle.")
    length: float = quantity(3.0, ge=0.5, le=200, unit="m", description="Length with that height.")
    height: float = quantity(0.03, ge=0, le=0.3, unit="m", description="Height of the kerb there.")
    ramp_length: float = quantity(1.0, ge=0.1, le=5, unit="m", description="Length over which it comes to that height.")

    @property
    def start_station(self) -> float:
        """Return the station at which the kerb begins to change, m."""
        return self.station - self.length / 2.0 - self.ramp_length

    @property
    def end_station(self) -> float:
        """Return the station from which the kerb is as before, m."""
        return self.station + self.length / 2.0 + self.ramp_length


class ParkingBay(Model):
    """A bay for vehicles that stand along the road, between gutter and kerb; it takes its width from the footway."""

    start_station: float = quantity(ge=0, unit="m", description="Beginning of its first taper.")
    end_station: float = quantity(ge=0, unit="m", description="End of its last taper.")
    width: float = quantity(2.0, ge=0.5, le=6, unit="m", description="Width.")
    taper_length: float = quantity(1.0, ge=0.2, le=10, unit="m", description="Length over which it opens and closes.")

    @model_validator(mode="after")
    def _tapers_fit(self) -> ParkingBay:
        """Return the bay unchanged; ValueError if it is shorter than its tapers."""
        if self.end_station - self.start_station < 2.0 * self.taper_length:
            raise ValueError("end_station must be at least two taper_lengths after start_station")
        return self


class StreetSide(RoadObject):
    """One side of a built-up stretch: gutter, parking bays, kerb and footway beside a carriageway.

    Gutter and kerb begin and end over half a metre, the footway over its transition; the verge behind it comes to its
    own width there. The kerb's face leans back by ``kerb_batter`` per metre of height. Bays and footway rise outwards
    by ``crossfall_percent``; where the kerb is lowered, the footway's outer edge keeps its height.
    """

    points_class: ClassVar = "roadside"
    type: Literal["StreetSide"] = "StreetSide"
    carriageway: str = Field(description="Id of the carriageway that it lies beside.")
    start_station: float = quantity(ge=0, unit="m", description="Beginning.")
    end_station: float = quantity(ge=0, unit="m", description="End.")
    transition_length: float = quantity(
        5.0,
        ge=1,
        le=50,
        unit="m",
        description="Length over which the footway opens at the beginning, closes at the end.",
    )
    gutter_rows: int = quantity(2, ge=0, le=3, unit="1", description="Rows of the gutter, 16 cm each; 0 for none.")
    gutter_material: Literal["setts", "concrete"] = Field("setts", description="What the gutter is of.")
    bay_material: Surface = Field("setts", description="Surface of the parking bays.")
    kerb_height: float = quantity(0.12, ge=0.02, le=0.25, unit="m", description="Height of the kerb.")
    kerb_width: float = quantity(0.15, ge=0.08, le=0.4, unit="m", description="Width of the kerb, its face included.")
    kerb_batter: float = quantity(
        0.15, ge=0.05, le=0.5, unit="m/m", description="By how much the kerb's face leans back per metre of height."
    )
    kerb_material: Literal["granite", "concrete"] = Field("granite", description="What the kerb is of.")
    footway_width: float = quantity(
        2.5, ge=LEAST_FOOTWAY, le=12, unit="m", description="Width of the footway where there is no bay."
    )
    footway_material: Surface = Field("concrete_pavers", description="Surface of the footway.")
    crossfall_percent: float = quantity(
        2.5, ge=0, le=8, unit="%", description="Rise of bays, kerb and footway away from the road."
    )
    verge_width: float = quantity(0.5, ge=0.1, le=6, unit="m", description="Unpaved strip behind the footway.")
    kerb_levels: tuple[KerbLevel, ...] = Field((), description="Where the kerb is lower or higher, in order.")
    bays: tuple[ParkingBay, ...] = Field((), description="Parking bays, in order.")

    @model_validator(mode="after")
    def _parts_fit(self) -> StreetSide:
        """Return the side unchanged; ValueError for parts that overlap, reach beyond it or don't fit its kerb."""
        first, last = self.start_station + self.transition_length, self.end_station - self.transition_length
        if last < first:
            raise ValueError("end_station must be at least two transition_lengths after start_station")
        parts_by_name: dict[str, tuple[KerbLevel | ParkingBay, ...]] = {
            "kerb_levels": self.kerb_levels,
            "bays": self.bays,
        }
        for name, parts in parts_by_name.items():
            if any(part.start_station < first or part.end_station > last for part in parts):
                raise ValueError(f"{name} must lie between the transitions, from {first:g} to {last:g} m")
            if any(a.end_station > b.start_station for a, b in pairwise(parts)):
                raise ValueError(f"{name} must be in order and must not overlap")
        if any(bay.width > self.footway_width - LEAST_FOOTWAY for bay in self.bays):
            raise ValueError(f"bays must leave at least {LEAST_FOOTWAY:g} m of footway_width, {self.footway_width:g} m")
        highest = max([self.kerb_height, *(level.height for level in self.kerb_levels)])
        if self.kerb_batter * highest > self.kerb_width - 0.02:
            raise ValueError("kerb_width must be at least 2 cm more than its face leans back")
        return self

    @property
    def gutter_width(self) -> float:
        """Return the gutter's width, m."""
        return self.gutter_rows * SETT_ROW
