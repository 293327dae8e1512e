"""Site of furniture: what its placement needs to know of a road that is being sampled."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...base.maps.crs import EPSG_URI
from ...base.random_streams import stream
from ...road.geometry import RoadGeometry, alignment_of, profile_of
from ...road.guidelines import GUIDELINE_OF_CLASS, LIMITS, DesignLimits, Guideline
from ...road.objects import Side
from ...road.parameters import AlignmentObject, Metadata, RoadParameters, Transform
from ...road.section import Carriageway, Turnout
from ...road.section_geometry import CarriagewaySection
from ...road.side_roads.mouth import Mouth
from ...road.side_roads.side_road import SideRoad
from ...road.streets.street_side import StreetSide
from ...road.structures.bridge import Bridge
from ...road.structures.tunnel import Tunnel
from ...road.surroundings import Environment, MaterialVariation, Terrain
from ...road.turnout_geometry import TurnoutShape
from ...scenario.road import RoadScenario
from .village_plan import Village

_BESIDE_STRUCTURE = 1.0
"""Length of the road kept clear before and behind a structure, m; chosen."""
if TYPE_CHECKING:
    from ..interchanges.interchange import Interchange


@dataclass(frozen=True)
class PlacementSite:
    """A sampled road without its furniture: what the placement needs to know of it.

    Attributes:
        scenario, seed: limits, and the seed of everything drawn.
        alignment, terrain: as in the parameter set.
        carriageways: by side; their ids are ``carriageway-left`` and ``carriageway-right``.
        turnouts, side_roads, structures: by id.
        villages: that it leads through.
        interchange: crossing road, bridge and ramps; its turnouts are among the others.
    """

    scenario: RoadScenario
    seed: int
    alignment: AlignmentObject
    carriageways: dict[Side, Carriageway]
    turnouts: dict[str, Turnout]
    terrain: Terrain
    villages: tuple[Village, ...] = ()
    side_roads: dict[str, SideRoad] = field(default_factory=dict)
    structures: dict[str, Bridge | Tunnel] = field(default_factory=dict)
    interchange: Interchange | None = None

    @cached_property
    def sections(self) -> dict[Side, CarriagewaySection]:
        """Return the cross-sections of the carriageways by side."""
        sides = self.carriageways.items()
        return {
            side: CarriagewaySection(
                road, self.turnouts_of(side).values(), self.streets_of(side).values(), self._joined
            )
            for side, road in sides
        }

    @property
    def _joined(self) -> frozenset[int]:
        """Return the instance numbers of the turnouts of an interchange: all of a road that has one."""
        return (
            frozenset(item.instance for item in self.interchange.turnouts.values()) if self.interchange else frozenset()
        )

    @property
    def interchange_stretch(self) -> tuple[float, float] | None:
        """Return the stations (m) between which an interchange's ramps lie beside the road; None without one."""
        if self.interchange is None:
            return None
        ends = [shape.ramp_end() for section in self.sections.values() for shape in section.turnouts]
        return min(ends), max(ends)

    def streets_of(self, side: Side) -> dict[str, StreetSide]:
        """Return the street sides of one carriageway by id."""
        return {f"street-{side}-{n}": v.streets[side] for n, v in enumerate(self.villages, 1) if side in v.streets}

    @cached_property
    def mouths(self) -> dict[str, Mouth]:
        """The mouths of the side roads by id."""
        if not self.side_roads:
            return {}
        alignment, profile = alignment_of(self.alignment), profile_of(self.alignment)
        by_id = {f"carriageway-{side}": section for side, section in self.sections.items()}
        return {
            name: Mouth(item, alignment, profile, by_id[item.carriageway]) for name, item in self.side_roads.items()
        }

    @property
    def bridged(self) -> list[tuple[float, float]]:
        """Return the stations (m) between which bridges carry the road, their wing walls and a metre more included."""
        return [_clear(item) for item in self.structures.values() if isinstance(item, Bridge)]

    @property
    def tunnelled(self) -> list[tuple[float, float]]:
        """Return the stations (m) between which the road is in tunnels, and a metre more."""
        return [_clear(item) for item in self.structures.values() if isinstance(item, Tunnel)]

    def mouths_of(self, side: Side) -> list[Mouth]:
        """Return the mouths of the side roads on one side."""
        return [mouth for mouth in self.mouths.values() if mouth.section.carriageway.side == side]

    @cached_property
    def geometry(self) -> RoadGeometry:
        """Return the geometry of the road and its ground without furniture, around a local origin of its own."""
        parts = {"alignment": self.alignment, **{f"carriageway-{side}": c for side, c in self.carriageways.items()}}
        objects: dict[str, Any] = {**parts, **self.turnouts, **self.structures, "terrain": self.terrain}
        objects |= self.interchange.objects() if self.interchange else {}
        numbered = {name: item.model_copy(update={"instance": n}) for n, (name, item) in enumerate(objects.items(), 1)}
        reference = EPSG_URI.format(self.scenario.epsg)
        metadata = Metadata(identifier="site", generator="site", referenceSystem=reference)
        transform = Transform(translate=self.scenario.map_origin)
        return RoadGeometry(
            RoadParameters(
                metadata=metadata,
                transform=transform,
                design_class=self.design_class,
                environment=Environment(),
                materials=MaterialVariation(),
                objects=numbered,
            )
        )

    @cached_property
    def length(self) -> float:
        """Return the length of the centreline, m."""
        return self.alignment.length

    @property
    def design_class(self) -> str:
        """Return the name of the design class."""
        return self.scenario.design_class

    @property
    def limits(self) -> DesignLimits:
        """Return the limits of the design class."""
        return LIMITS[self.scenario.design_class]

    @property
    def guideline(self) -> Guideline:
        """Return the guideline of the design class."""
        return GUIDELINE_OF_CLASS[self.scenario.design_class]

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


def _clear(structure: Bridge | Tunnel) -> tuple[float, float]:
    """Return the stations (m) between which a structure has caps or walkways, and `_BESIDE_STRUCTURE` more."""
    return structure.cap_start - _BESIDE_STRUCTURE, structure.cap_end + _BESIDE_STRUCTURE
