"""Free assets out of library files."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .body import Body, Place
from .thing import Block, StandingThing, TwinTypes


class Asset(StandingThing):
    """A free asset out of a library file: a .blend, .glb or .obj."""

    order: ClassVar = 140
    type: Literal["Asset"] = "Asset"
    library: str = Field(description="Built-in library, or a JSON file, absolute or relative to the working directory.")
    name: str = Field(description="Name of the asset in its library.")
    class_name: str = Field(description="Semantic class of its faces.")
    scale: float = quantity(1.0, gt=0, le=100, unit="1", description="Scale of the asset.")

    @property
    def semantic_class(self) -> str:
        """Return the class of its points, which its library chooses."""
        return self.class_name

    def twin(self) -> TwinTypes:
        """Return its types: nothing known."""
        return TwinTypes(opendrive=f"none.{self.name}", kind=self.name)

    def bodies(self, place: Place) -> list[Body]:
        """Return nothing: its shape is its library's."""
        return []

    def footprint(self) -> Iterator[Block]:
        """Yield its place: its size is its library's."""
        yield self.upright(0.0, 0.0)
