"""Record, on a road's root, of the curve that it was built along, and whether the curve has changed since.

The link holds as long as the road is the one that was built along the curve: building it from settings or from a file
ends it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from hashlib import sha256
from typing import Any

import bpy
import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...blender.model.store import BUILT_FROM
from ...blender.scene.curve_points import curve_points, polygon_points
from ...jobs.drawn_axis import DrawnAxis, fitted_axis, rounded_axis, with_drawn_heights
from ...scenario.scenario import Scenario

CURVE = "synthroads_curve"
"""Custom property of a road's root: the curve object that it follows."""
FOLLOWS = "synthroads_follows_curve"
"""Custom property of a road's root: whether it is built again as soon as the curve has changed."""
DRAWN = "synthroads_drawn"
"""Custom property of a road's root: JSON of the curve's state, and sentences on deviation and rules."""
TANGENTS = "synthroads_tangents"
"""Custom property of a curve: its points are those of a tangent polygon, as the drawing tool makes them."""
_FROM_CURVE = "curve"


@dataclass(frozen=True)
class CurveSettings:
    """How a road is built along a curve.

    Attributes:
        tangents: whether the curve's points are those of a tangent polygon; else elements are fitted to the curve.
        tolerance: root mean square distance that the fit aims at, m.
        seed_heights: whether the profile is drawn from the seed; else it is that of the curve.
    """

    tangents: bool = False
    tolerance: float = 0.05
    seed_heights: bool = False


@dataclass(frozen=True)
class CurveLine:
    """The line of a curve at one time, free of Blender: what a thread works on.

    Attributes:
        name: of the curve.
        points: (N, 3) in the scene's coordinates, m.
        radii: of a tangent polygon's N points, m, 0 where none is given; empty where points lie on the curve.
        settings: how the road is built along it.
    """

    name: str
    points: Float
    radii: tuple[float, ...]
    settings: CurveSettings

    @property
    def state(self) -> str:
        """Return a text that changes with the line and its settings."""
        rounded = np.round(self.points, 4).tobytes() + repr((self.radii, self.settings)).encode()
        return sha256(rounded).hexdigest()

    def axis(self, scenario: Scenario) -> DrawnAxis:
        """Return the axis along the line; raise `InputError` if no road follows it."""
        settings = self.settings
        if settings.tangents:
            drawn = rounded_axis(self.points, self.radii[1:-1], scenario.road)
        else:
            drawn = fitted_axis(self.points, scenario.road, settings.tolerance, self.name)
        return with_drawn_heights(drawn, scenario.road, scenario.seed) if settings.seed_heights else drawn


def curve_line(item: bpy.types.Object, settings: CurveSettings) -> CurveLine:
    """Return the line of a curve object now; raise `InputError` if it is none that a road can follow."""
    if settings.tangents:
        points, radii = polygon_points(item)
        return CurveLine(item.name, points, tuple(radii), settings)
    return CurveLine(item.name, curve_points(item), (), settings)


def built_from(name: str, settings: CurveSettings) -> str:
    """Return the text that is kept with a road that was built along a curve."""
    return json.dumps([_FROM_CURVE, name, asdict(settings)])


def _source(root: bpy.types.Object) -> list[Any]:
    """Return what a root keeps of the curve that its road was built along; empty if it was built from others."""
    try:
        source = json.loads(root[BUILT_FROM])
    except (KeyError, TypeError, ValueError):
        return []
    is_curve = isinstance(source, list) and len(source) == 3 and source[0] == _FROM_CURVE
    return source if is_curve else []


def curve_name(root: bpy.types.Object) -> str:
    """Return the name of the curve that a road was built along, as it was then; empty if it was built from others."""
    source = _source(root)
    return str(source[1]) if source else ""


def curve_settings(root: bpy.types.Object) -> CurveSettings:
    """Return how a road was built along its curve."""
    source = _source(root)
    return CurveSettings(**source[2]) if source else CurveSettings()


def linked_curve(root: bpy.types.Object | None, scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the curve of the scene that a road is linked to; None if to none."""
    if root is None or not _source(root):
        return None
    curve = root.get(CURVE)
    return curve if isinstance(curve, bpy.types.Object) and scene.objects.get(curve.name) == curve else None


def keep_link(root: bpy.types.Object, curve: bpy.types.Object | None, line: CurveLine, texts: tuple[str, str]) -> None:
    """Keep what a road was built along.

    Args:
        root: of the road.
        curve: that it stays linked to; None if to none.
        line: as it was.
        texts: sentences on the deviation, and on the rules.
    """
    root[DRAWN] = json.dumps([line.state, *texts])
    if curve is None:
        unlink(root)
    else:
        root[CURVE] = curve


def unlink(root: bpy.types.Object) -> None:
    """End the link of a road with its curve; both stay as they are."""
    for key in (CURVE, FOLLOWS):
        if key in root:
            del root[key]


def drawn_texts(root: bpy.types.Object) -> tuple[str, str]:
    """Return the sentences on deviation and rules of a road along a curve; empty for another road."""
    if not _source(root) or DRAWN not in root:
        return "", ""
    _, deviation, rules = json.loads(root[DRAWN])
    return deviation, rules


def is_outdated(root: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Return whether the curve that a road is linked to has changed since the road was built."""
    curve = linked_curve(root, scene)
    if curve is None or DRAWN not in root:
        return False
    try:
        line = curve_line(curve, curve_settings(root))
    except InputError:  # it can't be followed any more, which Fit Again says
        return True
    return bool(line.state != json.loads(root[DRAWN])[0])
