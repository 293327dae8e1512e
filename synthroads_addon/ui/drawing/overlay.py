"""Drawn over the 3D view while a road is drawn: tangents, elements by kind, handles, radii, and a line of text."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from textwrap import wrap

import blf
import bpy
import gpu
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ...base.text.labels import apart
from ..translations.blender import said
from ..work.view import draw_lines
from .sketch import Handle, ShownElement

COLORS = {"line": (0.95, 0.95, 0.95, 1.0), "arc": (1.0, 0.55, 0.1, 1.0), "clothoid": (0.25, 0.75, 1.0, 1.0)}
"""Colours of straights, arcs and clothoids: told apart in grey as well."""
_TANGENT, _REFUSED = (0.6, 0.6, 0.6, 0.8), (1.0, 0.2, 0.2, 1.0)
_POINT, _RADIUS, _HOVERED = (1.0, 1.0, 1.0, 1.0), (1.0, 0.55, 0.1, 1.0), (1.0, 1.0, 0.2, 1.0)
_TEXT = (1.0, 1.0, 1.0, 1.0)
_TEXT_LEFT = 70.0
"""Distance of the lines of text from the view's left edge, pixels at a resolution scale of 1: beside the toolbar."""
_DOT = 10.0
"""Size of a handle, pixels at a resolution scale of 1."""
_LONGEST = 70
"""Letters of a line of the text."""
_LETTERS, _LINE, _MARGIN = 13.0, 18.0, 18.0
"""Size of letters, distance of lines, and of a text from its place, pixels at a resolution scale of 1."""


class SketchView:
    """Contents of a sketch's overlay, and the handlers that draw it.

    Attributes:
        tangents: (x, y, z) of the polygon's points, the one under the mouse included.
        elements: of the axis.
        height: of the axis, m.
        handles: what the mouse can take hold of.
        hovered: the one under the mouse.
        labels: texts at places.
        text: lines at the bottom of the view.
        is_refused: whether the point under the mouse can't be taken.
    """

    def __init__(self) -> None:
        self.tangents: list[tuple[float, float, float]] = []
        self.elements: list[ShownElement] = []
        self.height = 0.0
        self.handles: list[Handle] = []
        self.hovered: Handle | None = None
        self.labels: list[tuple[tuple[float, float], str]] = []
        self.text = ""
        self.is_refused = False
        self._handlers: list[object] = []

    def show(self) -> None:
        """Begin to draw in all 3D views."""
        add = bpy.types.SpaceView3D.draw_handler_add
        self._handlers = [
            add(self._draw_lines, (), "WINDOW", "POST_VIEW"),
            add(self._draw_texts, (), "WINDOW", "POST_PIXEL"),
        ]

    def hide(self) -> None:
        """End to draw."""
        for handler in self._handlers:
            bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
        self._handlers = []

    def _draw_lines(self) -> None:
        gpu.state.blend_set("ALPHA")
        gpu.state.depth_test_set("NONE")
        color = _REFUSED if self.is_refused else _TANGENT
        _draw_polyline(self.tangents, color, 1.5)
        for element in self.elements:
            points = [(float(x), float(y), self.height) for x, y in element.points]
            _draw_polyline(points, COLORS[element.kind], 4.0)
        gpu.state.blend_set("NONE")

    def _draw_texts(self) -> None:
        context = bpy.context
        region, space = context.region, context.space_data
        if region is None or not isinstance(space, bpy.types.SpaceView3D):
            return
        scale = context.preferences.system.ui_scale
        for handle in self.handles:
            at = location_3d_to_region_2d(region, space.region_3d, Vector((*handle.place, self.height)))
            if at is not None:
                color = _HOVERED if handle == self.hovered else _POINT if handle.kind == "point" else _RADIUS
                draw_square((at.x, at.y), _DOT * scale, color)
        shown = [
            ((at.x + _MARGIN * scale, at.y), said(text))
            for place, text in self.labels
            if (at := location_3d_to_region_2d(region, space.region_3d, Vector((*place, self.height)))) is not None
        ]
        draw_labels(shown, scale)
        if self.text:
            lines = [part for line in self.text.splitlines() for part in wrap(said(line), _LONGEST)]
            draw_label((_TEXT_LEFT * scale, 0.0), "\n".join(lines), scale)


def _draw_polyline(points: Sequence[tuple[float, float, float]], color: Sequence[float], width: float) -> None:
    if len(points) > 1:
        draw_lines([corner for pair in pairwise(points) for corner in pair], color, width)


def draw_square(middle: tuple[float, float], size: float, color: Sequence[float]) -> None:
    """Draw a filled square, in a draw handler of pixels."""
    x, y, half = *middle, size / 2.0
    corners = [(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)]
    _draw_face(corners, color)


def _draw_face(corners: Sequence[tuple[float, float]], color: Sequence[float]) -> None:
    """Draw a quadrilateral."""
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", color)
    places = [(*corners[i], 0.0) for i in (0, 1, 2, 0, 2, 3)]
    gpu.state.blend_set("ALPHA")
    batch_for_shader(shader, "TRIS", {"pos": places}).draw(shader)
    gpu.state.blend_set("NONE")


def _free_width(region: bpy.types.Region) -> float:
    """Return how far from its left edge a region isn't covered by the area's sidebar, pixels."""
    sides = [item for item in bpy.context.area.regions if item.type == "UI" and item.width > 1 and item.height > 1]
    return float(min([region.width, *(item.x - region.x for item in sides if item.x > region.x)]))


def label_size(text: str, scale: float) -> tuple[float, float]:
    """Return the width and height (pixels) of a label's ground at a resolution scale of the interface."""
    blf.size(0, _LETTERS * scale)
    lines = text.splitlines()
    pad = 4.0 * scale
    return max(blf.dimensions(0, line)[0] for line in lines) + 2.0 * pad, _LINE * scale * len(lines)


def draw_labels(labels: Sequence[tuple[tuple[float, float], str]], scale: float) -> None:
    """Draw texts at places (lower left corners, pixels), each moved up until it covers none of those before it."""
    sizes = [label_size(text, scale) for _, text in labels]
    for place, (_, text) in zip(apart([place for place, _ in labels], sizes), labels, strict=True):
        draw_label(place, text, scale)


def draw_label(place: tuple[float, float], text: str, scale: float) -> None:
    """Draw a text on a dark ground, in a draw handler of pixels; it is moved to where the region, and no sidebar, is.

    Args:
        place: lower left corner, pixels; that of the first line.
        text: one line or several.
        scale: resolution scale of the interface.
    """
    region = bpy.context.region
    blf.size(0, _LETTERS * scale)
    lines = text.splitlines()
    width, pad, step = max(blf.dimensions(0, line)[0] for line in lines), 4.0 * scale, _LINE * scale
    below = step * (len(lines) - 1)
    x = min(place[0], max(_free_width(region) - width - 2.0 * pad, pad))
    y = min(max(place[1], below + 2.0 * pad), region.height - step - pad)
    left, right, low, high = x - pad, x + width + pad, y - below - pad, y + step - pad
    _draw_face([(left, low), (right, low), (right, high), (left, high)], (0.0, 0.0, 0.0, 0.65))
    blf.color(0, *_TEXT)
    for number, line in enumerate(lines):
        blf.position(0, x, y - number * step, 0.0)
        blf.draw(0, line)
