"""Kilometre boards."""

from __future__ import annotations

from ...road.parameters import KilometreBoard
from ..materials import material
from ..things.kilometre_board import kilometre_board_group
from ..things.model_builder import ModelBuilder
from ..things.sign.looks import FaceStyle, face_inputs

_STYLE = FaceStyle("blue", "white", "white")
_THICKNESS = 0.024
"""Thickness of either half of a board, m."""


def build_kilometre_boards(builder: ModelBuilder) -> None:
    """Make one object per kilometre board."""
    for name, board in builder.parameters.of_type(KilometreBoard).items():
        inputs = {
            **builder.surfaces(),
            **face_inputs(_STYLE, "rectangle", board.width, board.height, (board.text,)),
            "Thickness": _THICKNESS,
            "Lower Edge": board.lower_edge,
            "Post Material": material("galvanised_steel"),
            "Instance": board.instance,
        }
        builder.add(name, builder.points(name, [board], {}), kilometre_board_group(), inputs)
