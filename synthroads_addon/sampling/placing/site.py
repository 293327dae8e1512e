"""Site of furniture: what its placement needs to know of a road that is being sampled."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ...base.random_streams import stream
from ...road.guidelines import LIMITS, DesignLimits
from ...road.objects import Side
from ...road.parameters import AlignmentObject
from ...road.section import Carriageway, Turnout
from ...road.section_geometry import CarriagewaySection
from ...road.streets.street_side import StreetSide
from ...road.surroundings import Terrain
from ...road.turnout_geometry import TurnoutShape
from ...scenario.road import RoadScenario
from .village_plan import Village


@dataclass(frozen=True)
class PlacementSite:
    """A sampled road without its furniture: what the placement needs to know of it.

    Attributes:
        scenario, seed: limits, and the seed of everything drawn.
        alignment, terrain: as in the parameter set.
        carriageways: by side; their ids are ``carriageway-left`` and ``carriageway-right``.
        turnouts: by id.
        villages: that it leads through.
    """

    scenario: RoadScenario
    seed: int
    alignment: AlignmentObject
    carriageways: dict[Side, Carriageway]
    turnouts: dict[str, Turnout]
    terrain: Terrain
    villages: tuple[Village, ...] = ()

    @cached_property
    def sections(self) -> dict[Side, CarriagewaySection]:
        """Return the cross-sections of the carriageways by side."""
        sides = self.carriageways.items()
        return {
            side: CarriagewaySection(road, self.turnouts_of(side).values(), self.streets_of(side).values())
            for side, road in sides
        }

    def streets_of(self, side: Side) -> dict[str, StreetSide]:
        """Return the street sides of one carriageway by id."""
        return {f"street-{side}-{n}": v.streets[side] for n, v in enumerate(self.villages, 1) if side in v.streets}

    @cached_property
    def length(self) -> float:
        """Return the length of the centreline, m."""
        return self.alignment.length

    @property
    def design_class(self) -> str:
        """Return the name of the design class of the RAA."""
        return self.scenario.design_class

    @property
    def limits(self) -> DesignLimits:
        """Return the limits of the design class."""
        return LIMITS[self.scenario.design_class]

    def stream(self, *purpose: str | int) -> np.random.Generator:
        """Return the random generator of a purpose, keyed by the road's seed."""
        return stream(self.seed, *purpose)

    def turnouts_of(self, side: Side) -> dict[str, Turnout]:
        """Return the turnouts of one carriageway by id."""
        return {name: item for name, item in self.turnouts.items() if item.carriageway == f"carriageway-{side}"}

    def turnouts_of_kind(self, side: Side, kind: Literal["exit", "entry"]) -> list[Turnout]:
        """Return the exits or the entries of one carriageway."""
        return [item for item in self.turnouts_of(side).values() if item.kind == kind]

    def shape(self, turnout: Turnout) -> TurnoutShape:
        """Return the widths by station (`TurnoutShape`) of one of the road's turnouts."""
        shapes = (shape for section in self.sections.values() for shape in section.turnouts)
        return next(shape for shape in shapes if shape.turnout is turnout)

    def begin(self, turnout: Turnout) -> float:
        """Return the station (m) at which traffic meets a turnout first."""
        is_with_stations = self.shape(turnout).carriageway.traffic > 0
        return turnout.start_station if is_with_stations else turnout.end_station
