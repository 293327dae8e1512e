"""Shield gantries."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ....road.parameters import Gantry
from ....road.things.furniture import GantrySign
from ...materials import material
from ..meshes import attribute, fill
from ..model_builder import ModelBuilder
from ..sign.looks import FaceStyle, face_inputs
from .beam import KINDS
from .board import gantry_sign_group
from .gantry import gantry_group

_LIT = 0.9
"""Share of a display's sides that lights up."""
_MATERIALS = {
    "steel_material": "gantry_steel",
    "concrete_material": "bridge_concrete",
    "board_material": "board_back",
    "display_material": "display",
}


def build_gantries(builder: ModelBuilder) -> None:
    """Make one object per gantry, and one per face of its signs."""
    for name, gantry in builder.parameters.of_type(Gantry).items():
        cantilever = gantry.kind == "cantilever"
        builder.add_thing(
            name,
            gantry,
            gantry_group(),
            _signs_mesh(gantry),
            left_end=gantry.left_offset - gantry.offset,
            right_end=gantry.right_offset - gantry.offset,
            left_post=not cantilever or gantry.post_side == "left",
            right_post=not cantilever or gantry.post_side == "right",
            middle_post=gantry.kind == "two_sided",
            middle_post_place=-gantry.offset,
            beam=KINDS.index(gantry.beam),
            # Displays are looked after from above; boards are not.
            catwalk=any(sign.kind == "display" for sign in gantry.signs),
            **_MATERIALS,
        )
        builder.stand(name, gantry, gantry.rotation_deg)
        for number, sign in enumerate(gantry.signs, 1):
            _add_face(builder, name, gantry, number, sign)


def _add_face(builder: ModelBuilder, name: str, gantry: Gantry, number: int, sign: GantrySign) -> None:
    """Make the face of one sign; a display that shows nothing has none."""
    shown = any(line.strip() for line in sign.text)
    if sign.kind == "display" and not shown:
        return
    inputs = {
        "Gantry": builder.objects[name],
        "Number": number,
        "Instance": gantry.instance,
        **(_display_inputs(sign) if sign.kind == "display" else _board_inputs(sign)),
    }
    role = f"{name}/sign-{number}"
    builder.add(role, None, gantry_sign_group(), inputs)
    builder.stand(role, gantry, gantry.rotation_deg)


def _board_inputs(sign: GantrySign) -> dict[str, Any]:
    return face_inputs(FaceStyle("blue", "white", "white"), "rectangle", sign.width, sign.height, sign.text)


def _display_inputs(sign: GantrySign) -> dict[str, Any]:
    """Return the lights of a display: a speed limit's ring if it shows a number, else lines of writing."""
    side = _LIT * min(sign.width, sign.height)
    if "".join(sign.text).isdigit():
        inputs = face_inputs(FaceStyle("black", "red", "white"), "round", side, side, sign.text)
    else:
        size = (_LIT * sign.width, _LIT * sign.height)
        inputs = face_inputs(FaceStyle("black", "black", "white"), "rectangle", *size, sign.text)
    dark = dict.fromkeys(("Ground Material", "Edge Material", "Back Material"), material("display"))
    ring = material("led_red" if "".join(sign.text).isdigit() else "display")
    return inputs | dark | {"Border Material": ring, "Writing Material": material("led_white")}


def _signs_mesh(gantry: Gantry) -> bpy.types.Mesh:
    """Return one vertex per sign in the gantry's frame, with the attributes that its group reads."""
    mesh = bpy.data.meshes.new("SR Gantry")
    across = np.array([gantry.offset - sign.offset for sign in gantry.signs])
    fill(mesh, np.column_stack([across, np.zeros((len(across), 2))]))
    # Traffic on the right carriageway comes from -y.
    facing = np.array([1.0 if sign.offset < 0.0 else -1.0 for sign in gantry.signs])
    values = {
        "width": np.array([sign.width for sign in gantry.signs]),
        "height": np.array([sign.height for sign in gantry.signs]),
        "facing": facing,
        "display": np.array([int(sign.kind == "display") for sign in gantry.signs], dtype=np.int32),
        "number": np.arange(1, len(gantry.signs) + 1, dtype=np.int32),
    }
    for key, value in values.items():
        attribute(mesh, key, value)
    return mesh
