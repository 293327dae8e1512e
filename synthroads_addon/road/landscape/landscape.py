"""What the landscape around a road is: relief, land use, villages and wind turbines, as a parameter set holds it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from ...base.schema import Model, quantity
from ..objects import RoadObject


class Village(Model):
    """A village of simple houses around a church."""

    x: float = quantity(ge=-2e4, le=2e4, unit="m", description="Local x of its church.")
    y: float = quantity(ge=-2e4, le=2e4, unit="m", description="Local y of its church.")
    houses: int = quantity(30, ge=1, le=500, unit="1", description="Number of houses.")
    radius: float = quantity(140.0, ge=20, le=2000, unit="m", description="Radius within which they stand.")


class WindTurbine(Model):
    """A wind turbine with three blades."""

    x: float = quantity(ge=-2e4, le=2e4, unit="m", description="Local x of its tower.")
    y: float = quantity(ge=-2e4, le=2e4, unit="m", description="Local y of its tower.")
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
        if self.forest_share + self.meadow_share > 1.0:
            raise ValueError("forest_share and meadow_share must not be more than 1 together")
        return self
