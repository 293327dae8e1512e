"""Kilometre boards."""

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .body import BURIED, Body, Place, plate, post
from .limits import Limits
from .sign_outline import face_outline
from .thing import Block, Signal, StandingThing, TwinTypes

POST = 0.042
"""Diameter of a kilometre board's post, m."""
BOARD = 0.024
"""Thickness of either half of a board, m."""
_POST_REACH = 0.03
"""Half of what a post is given room for, m."""


class KilometreBoardLimits(Limits):
    """Whether there are kilometre boards."""

    place: ClassVar = 60

    kilometre_boards: bool = Field(True, description="Kilometre boards every 500 m.")


class KilometreBoard(StandingThing):
    """A kilometre board: blue, white writing."""

    points_class: ClassVar = "road_sign"
    order: ClassVar = 100
    limits: ClassVar = KilometreBoardLimits
    type: Literal["KilometreBoard"] = "KilometreBoard"
    text: str = Field(max_length=12, description="Its kilometre, as written.")
    width: float = quantity(0.55, ge=0.1, le=2, unit="m", description="Width of the board.")
    height: float = quantity(0.26, ge=0.1, le=2, unit="m", description="Height of the board.")
    lower_edge: float = quantity(1.2, ge=0.2, le=4, unit="m", description="Lower edge above the surface.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a marker, with its kilometre as reference."""
        return TwinTypes("IfcSign.MARKER", "pole.signalPost", reference=self.text)

    def signals(self) -> dict[str, Signal]:
        """Return its kilometre as the message of its one part, "face"."""
        return {"face": Signal("kilometreBoard", text=self.text)}

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of the board, and of its post up into it, in its frame."""
        middle = self.lower_edge + self.height / 2.0
        outline = face_outline("rectangle", self.width, self.height) + (0.0, middle)
        return [
            Body(plate(outline, -BOARD, BOARD), "sheeting_blue", "face"),
            Body(post(POST, -BURIED, middle), "galvanised_steel"),
        ]

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its post and of the board, in which nothing else may stand."""
        yield self.upright(_POST_REACH, self.lower_edge + self.height)
        yield self.face(self.width, self.lower_edge, self.height)
