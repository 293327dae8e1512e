"""`ScanConditions`: what a scan takes of the road besides its geometry."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

from ...base.maps.crs import MapSystem
from ...road.geometry import RoadGeometry
from ...road.network.places import RoadPlaces
from ...road.parameters import RoadParameters
from ...road.surroundings import Environment, MaterialVariation
from ..relief.pavement import PavementRelief


@dataclass(frozen=True)
class ScanConditions:
    """Properties of the road that a scan depends on besides its geometry; clear and dry weather if there is no road.

    Attributes:
        environment: light and weather.
        variation: of the road's materials.
        epsg: map coordinate system; None if unknown.
        road: what stands on and beside it, for classes by things; None if there is no road.
        height_epsg: vertical coordinate system; None if it isn't named.
    """

    environment: Environment = field(default_factory=Environment)
    variation: MaterialVariation = field(default_factory=MaterialVariation)
    epsg: int | None = None
    road: RoadParameters | None = None
    height_epsg: int | None = None

    @classmethod
    def of(cls, road: RoadParameters | None) -> Self:
        """Return the conditions that a road's parameters set; the defaults, clear and dry, for None."""
        if road is None:
            return cls()
        about = road.metadata
        return cls(road.environment, road.materials, about.epsg, road, about.height_epsg)

    @property
    def system(self) -> MapSystem | None:
        """Return the map coordinate system, with the vertical one if it is named; None if it is unknown."""
        return None if self.epsg is None else MapSystem.of(self.epsg, self.height_epsg)

    @cached_property
    def geometry(self) -> RoadGeometry | None:
        """Return the road's geometry; None if there is no road."""
        return None if self.road is None else RoadGeometry(self.road)

    @cached_property
    def pavement(self) -> PavementRelief | None:
        """Return the heights of the road's pavement; None if there is no road."""
        return None if self.geometry is None else PavementRelief(self.geometry)

    @cached_property
    def places(self) -> RoadPlaces | None:
        """Return what tells places along the road and those that join it; None if there is no road."""
        return None if self.geometry is None else RoadPlaces(self.geometry)
