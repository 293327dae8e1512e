"""Trees that stand alone, or in the rows of an avenue."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from ..surroundings import TREES
from .body import Body, Place, shift
from .limits import Interval, Limits, interval, share
from .plant_shape import PlantShape, species_shapes
from .thing import Block, StandingThing, TwinTypes


class AvenueLimits(Limits):
    """Limits of avenues: trees in rows beside the road."""

    group: ClassVar = "roadside"
    place: ClassVar = 15
    allowed: ClassVar = {
        "avenue_length": (20.0, 1e4),
        "avenue_spacing": (3.0, 100.0),
        "avenue_distance": (1.25, 30.0),
        "avenue_height": "height",
        "avenue_trunk": "trunk_diameter",
        "avenue_gaps": (0.0, 0.9),
    }

    avenues: float = share(0.0, "Probability that trees stand in a row along a side of the road.")
    both_sides: float = share(0.7, "Probability that an avenue has a row on either side.", title="Rows on Both Sides")
    avenue_length: Interval = interval(150.0, 600.0, "m", "Length of avenues.")
    avenue_spacing: Interval = interval(8.0, 14.0, "m", "Distance from one tree of an avenue to the next.")
    avenue_distance: Interval = interval(1.75, 4.5, "m", "From the pavement to the nearest side of an avenue's trunks.")
    avenue_height: Interval = interval(10.0, 20.0, "m", "Height of an avenue's trees.")
    avenue_trunk: Interval = interval(0.25, 0.8, "m", "Diameter of their trunks.", title="Avenue Trunks")
    avenue_gaps: Interval = interval(0.0, 0.25, "1", "Share of an avenue's trees that were felled.")
    avenue_unprotected: float = share(
        0.6,
        "Probability that an avenue has stood since before the rules of 2009, with no barrier before its trees.",
        title="Without Barriers",
    )


class Tree(StandingThing):
    """A tree that stands alone, or in the row of an avenue."""

    points_class: ClassVar = "vegetation"
    order: ClassVar = 152
    limits: ClassVar = AvenueLimits
    obstacle: ClassVar = "tree"
    left_out: ClassVar = "leaves and branches: the crown that they end on stands for them"
    type: Literal["Tree"] = "Tree"
    species: Literal[TREES] = Field("maple", description="Species.")  # type: ignore[valid-type]
    height: float = quantity(14.0, "m", "Top above the surface.", (2, 50))
    trunk_diameter: float = quantity(0.4, "m", "Diameter of the trunk at its foot.", (0.05, 2.5))
    crown_diameter: float = quantity(8.0, "m", "Diameter of the crown where it is widest.", (0.5, 30))
    crown_bottom: float = quantity(3.0, "m", "Height at which the crown begins.", (0.3, 40))
    stock: bool = Field(
        False,
        strict=True,
        description="It has stood since before the rules of 2009, which ask for no barrier before it.",
    )
    seed: int = quantity(0, ge=0, le=2**30, unit="1", description="Seed of its branches and leaves.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: vegetation, with its species as reference."""
        return TwinTypes(
            "IfcGeographicElement.VEGETATION", "vegetation.tree", "SolitaryVegetationObject", reference=self.species
        )

    @property
    def breadth(self) -> float:
        """Return the factor (m) by which the shape of a tree of height 1 is scaled across."""
        return self.crown_diameter / 2.0 / float(species_shapes()["tree"][self.species]["crown_radius"])

    def shape(self) -> PlantShape:
        """Return the measures of the tree scaled to a height of 1 and to its species' crown."""
        shape = species_shapes()["tree"][self.species]
        bottom = min(self.crown_bottom / self.height, 0.9)
        widest, fullness = shape["crown_widest"], shape["crown_fullness"]
        return PlantShape(shape["crown_radius"], bottom, widest, fullness, self.trunk_diameter / 2.0 / self.breadth)

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of its trunk, up into the crown, and of the crown, in its frame."""
        shape, scale = self.shape(), (self.breadth, self.breadth, self.height)
        trunk = shape.trunk()
        assert trunk is not None
        return [
            Body(shift(trunk, (0.0, 0.0, 0.0), scale), f"{self.species}_bark", "trunk"),
            Body(shift(shape.crown(), (0.0, 0.0, 0.0), scale), f"{self.species}_leaves", "crown"),
        ]

    def footprint(self) -> Iterator[Block]:
        """Yield the box around its trunk, in which nothing else may stand."""
        yield self.upright(self.trunk_diameter / 2.0, self.height)
