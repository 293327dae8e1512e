"""Bodies of vehicles: a skin over cross-sections from rear to front, with wheel arches and windows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...nodes import operations as op
from ...nodes.builder import Operand, Tree, Value
from ...nodes.solids import paint_faces
from .details import VehicleMaterials

Float = NDArray[np.float64]


class HullPatch(NamedTuple):
    """Region of a hull's faces with another material than the paint.

    Attributes:
        material: its name.
        start, end: where it begins and ends along y, m.
        bands: bands of faces, counted from the middle of the underside to the middle of the roof: 0 underside, 1 and 2
            the arches' inside, 3 and 4 the side below the belt, 5 the windows, 6 above them, 7 the roof.
    """

    material: str
    start: float
    end: float
    bands: tuple[int, ...]


class Hull(NamedTuple):
    """Shape of a vehicle's body: cross-sections, wheel arches and patches of other materials.

    Attributes:
        sections: cross-sections (S, 9), symmetric about x = 0, from rear to front; the first and the last have no
            width, so that they close the body. In order: y, positive to the front; half widths of the body, then with
            its heights of underside and belt (the windows' lower edges), of the windows' upper edges, with their
            height, and of the roof's flat part, with the heights of the roof's edges and its middle. Where there are
            no windows the heights above the belt make the bonnet or the boot.
        axles: places of the axles whose wheels have arches, m.
        wheel, arch: radii of wheels and arches, m.
        tumble: how much narrower the body is at its belt, as a share.
        patches: in order; what no patch has is painted.
    """

    sections: tuple[tuple[float, ...], ...]
    axles: tuple[float, ...]
    wheel: float
    arch: float
    tumble: float
    patches: tuple[HullPatch, ...]


# The half cross-section from the middle of the underside to that of the roof. Shares of the half widths (body, top,
# roof), of the lower heights (floor, low, belt), and of the upper ones (upper, edge, ridge).
_WIDTHS = [(0, 0, 0), (0.7, 0, 0), (0.7, 0, 0), (0.98, 0, 0), (1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)]
_LOWER = [(1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1, 0), (0, 0.45, 0.55), (0, 0, 1), (0, 0, 0), (0, 0, 0), (0, 0, 0)]
_UPPER = [(0, 0, 0)] * 6 + [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
_BELT = 5
_BANDS = len(_WIDTHS) - 1
_ARCH_STEPS = 6


def hull(tree: Tree, materials: VehicleMaterials, patches: Iterable[tuple[Any, ...]], **fields: Any) -> Value:
    """Add nodes for a vehicle's closed body, faces outwards; `fields` are the other fields of `Hull`."""
    shape = Hull(patches=tuple(HullPatch(*patch) for patch in patches), **fields)
    table = _rows(shape)
    mesh, column, row = op.grid(tree, 2 * _BANDS + 1, len(table))
    # Columns go round, from the middle of the underside up the left side and down the right one.
    step = op.switch(column > _BANDS, column, 2 * _BANDS - column)
    side = op.switch(column > _BANDS, -1.0, 1.0)
    widths, lower, upper, place = (
        op.choose(row, [tuple(triple) for triple in table[:, first : first + 3].tolist()]) for first in (0, 3, 6, 9)
    )
    across = op.dot(op.choose(step, _triples(_widths(shape.tumble))), widths) * side
    height = op.dot(op.choose(step, _triples(_LOWER)), lower) + op.dot(op.choose(step, _triples(_UPPER)), upper)
    mesh = op.set_position(mesh, op.vector(tree, across, op.component(place, "X"), height))
    mesh = paint_faces(mesh, materials["paint"])
    # Faces of a grid run column by column.
    number = op.index(tree)
    face_row, face_column = number % (len(table) - 1), number // (len(table) - 1)
    band = op.switch(face_column > _BANDS - 1, face_column, 2 * _BANDS - 1 - face_column)
    for patch in shape.patches:
        chosen = _in_patch(patch, table[:, 9], face_row, band)
        mesh = paint_faces(mesh, materials[patch.material], chosen)
    return op.delete_degenerate(mesh)


def _widths(tumble: float) -> list[tuple[float, float, float]]:
    return [(w[0] * (1.0 - tumble * (step == _BELT)), w[1], w[2]) for step, w in enumerate(_WIDTHS)]


def _triples(rows: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    return [(float(a), float(b), float(c)) for a, b, c in rows]


def _in_patch(patch: HullPatch, places: Float, face_row: Value, band: Value) -> Value:
    first, last = np.searchsorted(places, [patch.start - 1e-6, patch.end - 1e-6])
    within: Operand = (face_row > int(first) - 1) & (face_row < int(last))
    chosen = band.equals(patch.bands[0])
    for other in patch.bands[1:]:
        chosen = chosen | band.equals(other)
    assert isinstance(within, Value)
    return within & chosen


def _rows(shape: Hull) -> Float:
    """Return the hull's rows (R, 12), m: half widths; floor, low, belt; upper, edge, ridge; y and two zeros."""
    sections = np.array(shape.sections)
    angles = np.linspace(np.pi, 0.0, _ARCH_STEPS + 1)
    # Just outside an arch the underside is where it would be without it.
    around = np.concatenate([[-shape.arch - 0.01], shape.arch * np.cos(angles), [shape.arch + 0.01]])
    extra = np.array(shape.axles)[:, None] + around
    borders = [place for patch in shape.patches for place in (patch.start, patch.end)]
    inside = np.array([y for y in borders if sections[0, 0] < y < sections[-1, 0]])
    y = np.unique(np.round(np.concatenate([sections[:, 0], extra.ravel(), inside]), 4))
    body, floor, belt, top, upper, roof, edge, ridge = (np.interp(y, sections[:, 0], c) for c in sections.T[1:])
    low = floor
    for axle in shape.axles:
        beside = np.abs(y - axle)
        rise = shape.wheel + np.sqrt(np.maximum(shape.arch**2 - beside**2, 0.0))
        low = np.where(beside <= shape.arch + 1e-6, np.maximum(low, rise), low)
    zero = np.zeros(len(y))
    return np.column_stack([body, top, roof, floor, low, belt, upper, edge, ridge, y, zero, zero])
