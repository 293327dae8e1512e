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
        material: name of the material.
        start, end: y of its ends, m.
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
        axles: y of the axles whose wheels have arches, m.
        wheel, arch: radii of wheels and arches, m.
        tumble: reduction of the body's width at its belt, as a share (tumblehome).
        patches: regions of other materials, in order; other faces are painted.
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
"""Number of the half cross-section's point at the belt."""
_BANDS = len(_WIDTHS) - 1
_ARCH_STEPS = 6
"""Pieces of a wheel arch; chosen."""


def hull(tree: Tree, materials: VehicleMaterials, patches: Iterable[tuple[Any, ...]], **fields: Any) -> Value:
    """Add nodes for a vehicle's closed body, faces outwards; `fields` are the other fields of `Hull`."""
    shape = Hull(patches=tuple(HullPatch(*patch) for patch in patches), **fields)
    table = _rows(shape)
    mesh, column, row = op.grid(tree, 2 * _BANDS + 1, len(table))
    # Columns run around the section, from the middle of the underside up the left side and down the right one.
    section_point = op.switch(column > _BANDS, column, 2 * _BANDS - column)
    side_sign = op.switch(column > _BANDS, -1.0, 1.0)
    widths, lower_heights, upper_heights, place = (
        op.choose(row, [tuple(triple) for triple in table[:, first_column : first_column + 3].tolist()])
        for first_column in (0, 3, 6, 9)
    )
    # Coordinates of a point are its shares (tables above) of the row's widths and heights.
    x = op.dot(op.choose(section_point, _triples(_widths(shape.tumble))), widths) * side_sign
    height = op.dot(op.choose(section_point, _triples(_LOWER)), lower_heights) + op.dot(
        op.choose(section_point, _triples(_UPPER)), upper_heights
    )
    mesh = op.set_position(mesh, op.vector(tree, x, op.component(place, "X"), height))
    mesh = paint_faces(mesh, materials["paint"])
    # Faces of a grid run column by column.
    face_index = op.index(tree)
    face_row, face_column = face_index % (len(table) - 1), face_index // (len(table) - 1)
    band = op.switch(face_column > _BANDS - 1, face_column, 2 * _BANDS - 1 - face_column)
    for patch in shape.patches:
        selection = _in_patch(patch, table[:, 9], face_row, band)
        mesh = paint_faces(mesh, materials[patch.material], selection)
    return op.delete_degenerate(mesh)


def _widths(tumble: float) -> list[tuple[float, float, float]]:
    """Return the shares of half widths of the half cross-section's points, with the belt narrowed by `tumble`."""
    return [(shares[0] * (1.0 - tumble * (step == _BELT)), shares[1], shares[2]) for step, shares in enumerate(_WIDTHS)]


def _triples(rows: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Return rows as tuples of floats."""
    return [(float(a), float(b), float(c)) for a, b, c in rows]


def _in_patch(patch: HullPatch, places: Float, face_row: Value, band: Value) -> Value:
    """Add nodes that select the faces of a patch: rows of faces between its ends, and its bands."""
    first_row, end_row = np.searchsorted(places, [patch.start - 1e-6, patch.end - 1e-6])
    is_in_rows: Operand = (face_row > int(first_row) - 1) & (face_row < int(end_row))
    is_in_bands = band.equals(patch.bands[0])
    for band_number in patch.bands[1:]:
        is_in_bands = is_in_bands | band.equals(band_number)
    assert isinstance(is_in_rows, Value)
    return is_in_rows & is_in_bands


def _rows(shape: Hull) -> Float:
    """Return the hull's rows (R, 12), m, from rear to front.

    Columns: half widths of body, top and roof; heights of floor, arch floor and belt, of upper edge, roof edge and
    ridge; y and two zeros.
    """
    sections = np.array(shape.sections)
    angles = np.linspace(np.pi, 0.0, _ARCH_STEPS + 1)
    # Rows 1 cm outside of an arch, where the underside is as without it.
    arch_offsets = np.concatenate([[-shape.arch - 0.01], shape.arch * np.cos(angles), [shape.arch + 0.01]])
    arch_rows = np.array(shape.axles)[:, None] + arch_offsets
    borders = [place for patch in shape.patches for place in (patch.start, patch.end)]
    patch_rows = np.array([y for y in borders if sections[0, 0] < y < sections[-1, 0]])
    y = np.unique(np.round(np.concatenate([sections[:, 0], arch_rows.ravel(), patch_rows]), 4))
    body, floor, belt, top, upper, roof, edge, ridge = (
        np.interp(y, sections[:, 0], column) for column in sections.T[1:]
    )
    arch_floor = floor
    for axle in shape.axles:
        axle_distance = np.abs(y - axle)
        arch_height = shape.wheel + np.sqrt(np.maximum(shape.arch**2 - axle_distance**2, 0.0))
        arch_floor = np.where(axle_distance <= shape.arch + 1e-6, np.maximum(arch_floor, arch_height), arch_floor)
    zero = np.zeros(len(y))
    return np.column_stack([body, top, roof, floor, arch_floor, belt, upper, edge, ridge, y, zero, zero])
