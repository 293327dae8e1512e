"""Look of a sign's face: inputs of SR Sign Face for its shape, colours, writing and pictogram."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....road.things.sign import TrafficSign
from ....road.things.sign_catalogue import sign_type
from ....road.things.sign_outline import corner_radius
from .outline import SHAPES
from .pictograms import NAMES
from .writing import LINES

Box = tuple[float, float, float, float]
"""Left, right, bottom and top as shares of the face."""


@dataclass(frozen=True)
class FaceStyle:
    """Colours and pictogram of a sign's face.

    Attributes:
        ground, border, writing: colours, as `presets/signs.json` names them.
        pictogram: name of the drawing, see `road.things.sign_catalogue.Pictogram`.
    """

    ground: str
    border: str
    writing: str
    pictogram: str = "none"


_OF_SHAPE = {
    "round": FaceStyle("white", "red", "black"),
    "triangle": FaceStyle("white", "red", "black"),
    "rectangle": FaceStyle("blue", "white", "white"),
    "octagon": FaceStyle("red", "white", "white"),
    "arrow": FaceStyle("blue", "white", "white", "arrow"),
    "arrow_left": FaceStyle("yellow", "black", "black"),
    "triangle_down": FaceStyle("white", "red", "black"),
    "diamond": FaceStyle("white", "black", "yellow", "priority_road"),
}
"""Styles by shape of signs that the catalogue lacks."""

_RING, _RIM, _LINE = 0.1, 0.012, 0.022
"""Widths of a red border, of the white edge around it, and of another border, as shares of the face's smaller side."""
_LINE_LIMITS = (0.008, 0.04)
"""Limits of the width of a border that isn't red, m."""

_WHOLE: Box = (0.08, 0.92, 0.06, 0.94)
"""Box of a rectangular face's content. Boxes here are chosen by eye."""
_TEXT: dict[str, Box] = {
    "round": (0.17, 0.83, 0.22, 0.78),
    "triangle": (0.35, 0.65, 0.0, 0.72),
    "rectangle": _WHOLE,
    "octagon": (0.12, 0.88, 0.2, 0.8),
    "arrow": (0.06, 0.82, 0.44, 0.96),
    "arrow_left": (0.2, 0.94, 0.16, 0.84),
    "triangle_down": (0.22, 0.78, 0.56, 0.84),
    "diamond": (0.25, 0.75, 0.25, 0.75),
}
"""Box of the writing by shape."""
_DRAWING: dict[str, Box] = {
    "round": (0.16, 0.84, 0.16, 0.84),
    "triangle": (0.28, 0.72, 0.13, 0.64),
    "rectangle": _WHOLE,
    "octagon": _WHOLE,
    "arrow": (0.36, 0.64, 0.1, 0.46),
    "arrow_left": (0.36, 0.64, 0.1, 0.46),
    "triangle_down": (0.28, 0.72, 0.36, 0.87),
    "diamond": (0.08, 0.92, 0.08, 0.92),
}
"""Box of the pictogram by shape."""
# Pictograms that share a rectangular board with writing: the writing's box, and the pictogram's.
_SHARED: dict[str, tuple[Box, Box]] = {
    "down_arrow": ((0.06, 0.94, 0.36, 0.96), (0.38, 0.62, 0.05, 0.34)),
    "exit_arrow": ((0.06, 0.68, 0.06, 0.94), (0.72, 0.95, 0.1, 0.9)),
    "crossed": ((0.08, 0.92, 0.06, 0.94), (0.02, 0.98, 0.04, 0.96)),
    "town_end": ((0.1, 0.9, 0.06, 0.94), (0.06, 0.94, 0.08, 0.46)),
    **dict.fromkeys(("bars_1", "bars_2", "bars_3"), ((0.08, 0.92, 0.68, 0.97), (0.12, 0.88, 0.05, 0.66))),
}
_DESTINATIONS = ("449", "453")
"""Codes of signs with a list of places, whose lines begin on the left."""
_BARE_ARROW: Box = (0.06, 0.8, 0.16, 0.84)
"""Box of the writing on an arrow without a pictogram."""
_WITHOUT_RING = ("town_end", "crossed")
"""Pictograms of rectangular signs whose red border is a line, not a ring."""
_OF_PICTOGRAM: dict[str, Box] = {
    "end": (0.02, 0.98, 0.02, 0.98),
    **dict.fromkeys(("pass_left", "pass_right"), (0.19, 0.81, 0.19, 0.81)),
}
"""Box of pictograms that reach over the whole face, or with a tip into a corner of their box."""


def sign_face_inputs(sign: TrafficSign) -> dict[str, Any]:
    """Return the face inputs by name for a traffic sign, from the catalogue if it has the code, else by shape."""
    catalogue_type = sign_type(sign.code)
    style = (
        FaceStyle(catalogue_type.ground, catalogue_type.border, catalogue_type.writing, catalogue_type.pictogram)
        if catalogue_type
        else _OF_SHAPE[sign.shape]
    )
    inputs = face_inputs(style, sign.shape, sign.width, sign.height, sign.text)
    return inputs | {"Flush Left": sign.code in _DESTINATIONS}


def face_inputs(style: FaceStyle, shape: str, width: float, height: float, text: Sequence[str]) -> dict[str, Any]:
    """Return the inputs by name of a node group with a sign's face.

    Args:
        style: colours and pictogram.
        shape: outline, one of `things.sign.outline.SHAPES`.
        width, height: size of the face, m.
        text: lines of writing.
    """
    smaller_side = min(width, height)
    has_red_border = style.border == "red" and style.pictogram not in _WITHOUT_RING
    line_width = float(np.clip(_LINE * smaller_side, *_LINE_LIMITS))
    writing, drawing = _boxes(style.pictogram, shape)
    lines = [*text, *([""] * LINES)][:LINES]
    return {
        "Shape": SHAPES.index(shape),
        "Width": width,
        "Height": height,
        "Corner Radius": corner_radius(shape, width, height),
        "Edge Width": _RIM * smaller_side if has_red_border else 0.0,
        "Border Width": _RING * smaller_side if has_red_border else line_width,
        **{f"Line {number}": line for number, line in enumerate(lines, 1)},
        **_box_inputs("Text", writing),
        "Flush Left": False,
        "Pictogram": NAMES.index(style.pictogram) if style.pictogram in NAMES else 0,
        **_box_inputs("Pictogram", drawing),
        "Ground Material": f"sheeting_{style.ground}",
        "Border Material": f"sheeting_{style.border}",
        "Edge Material": "sheeting_white",
        "Writing Material": f"sheeting_{style.writing}",
        "Back Material": "board_back",
    }


def _boxes(pictogram: str, shape: str) -> tuple[Box, Box]:
    """Return the boxes of writing and pictogram on a face of a shape."""
    if shape == "rectangle" and pictogram in _SHARED:
        return _SHARED[pictogram]
    if shape == "arrow" and pictogram == "none":
        return _BARE_ARROW, _DRAWING[shape]
    return _TEXT[shape], _OF_PICTOGRAM.get(pictogram, _DRAWING[shape])


def _box_inputs(prefix: str, box: Box) -> dict[str, float]:
    """Return the four inputs of a box by name."""
    return {f"{prefix} {side}": share for side, share in zip(("Left", "Right", "Bottom", "Top"), box, strict=True)}
