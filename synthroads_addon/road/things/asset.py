"""Free assets out of library files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import ClassVar, Literal

from pydantic import Field

from ...base.files import PRESETS
from ...base.schema import Model, quantity, read_json
from .body import Body, Place
from .thing import Block, StandingThing, TwinTypes

_IFC = r"^Ifc[A-Za-z]+\.[A-Z_]+$"
_OBJECTS = "none|obstacle|pole|tree|vegetation|barrier|building|patch|trafficIsland|streetLamp|gantry|soundBarrier"
_OPENDRIVE = rf"^({_OBJECTS})(\.[A-Za-z0-9_]+)?$"


class AssetTypes(Model):
    """Types of an asset in the formats of the geometric-semantic model; those of its class where one isn't given."""

    ifc: str | None = Field(
        None, pattern=_IFC, description="Element and predefined type in IFC 4.3, as IfcFurniture.USERDEFINED."
    )
    cityjson: Literal["CityFurniture", "SolitaryVegetationObject", "OtherConstruction", "GenericCityObject"] | None = (
        Field(None, description="City object in CityJSON.")
    )
    opendrive: str | None = Field(
        None, pattern=_OPENDRIVE, description="Type and subtype of the object in OpenDRIVE, as barrier.fence."
    )


class Asset(StandingThing):
    """A free asset out of a library file: a .blend, .glb or .obj."""

    order: ClassVar = 140
    type: Literal["Asset"] = "Asset"
    library: str = Field(description="Built-in library, or a JSON file, absolute or relative to the working directory.")
    name: str = Field(description="Name of the asset in its library.")
    class_name: str = Field(description="Semantic class of its faces.")
    scale: float = quantity(1.0, gt=0, le=100, unit="1", description="Scale of the asset.")
    twin_types: AssetTypes | None = Field(None, description="What it is in the twin formats, as its library says.")

    @property
    def semantic_class(self) -> str:
        """Return the name of the semantic class of its points, which its library chooses."""
        return self.class_name

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: those that its library gives, else those of its semantic class."""
        types_of_library = (
            {name: getattr(self.twin_types, name) for name in AssetTypes.model_fields} if self.twin_types else {}
        )
        types = {"opendrive": f"none.{self.name}"} | class_types().get(self.class_name, {})
        return TwinTypes(kind=self.name, **(types | {key: value for key, value in types_of_library.items() if value}))

    def bodies(self, place: Place) -> list[Body]:
        """Return an empty list: its shape is in its library's file."""
        return []

    def footprint(self) -> Iterator[Block]:
        """Yield one box without extent at its place: its size is in its library's file."""
        yield self.upright(0.0, 0.0)


@cache
def class_types() -> dict[str, dict[str, str]]:
    """Return semantic class -> twin format -> type of assets, read once from the presets."""
    types: dict[str, dict[str, str]] = read_json(PRESETS / "twin_types.json")
    return types
