"""The scene that other simulators are compared on: waves over 100 m x 100 m, as a mesh and as an .obj file."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CELLS = 1000
"""Cells along either side: two million triangles."""


def wave_mesh(cells: int = CELLS) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return vertices (V, 3) of z = 0.2 sin x cos y over 100 m x 100 m, m, and triangles (2 cells^2, 3)."""
    x = np.linspace(-50.0, 50.0, cells + 1)
    grid = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    vertices = np.column_stack([grid, 0.2 * np.sin(grid[:, 0]) * np.cos(grid[:, 1])]).astype(np.float32)
    row_length = cells + 1
    corner = (np.arange(cells)[:, None] * row_length + np.arange(cells)).ravel()
    first_triangles, second_triangles = (
        (corner, corner + 1, corner + row_length + 1),
        (corner, corner + row_length + 1, corner + row_length),
    )
    return vertices, np.stack([*first_triangles, *second_triangles], axis=-1).reshape(-1, 3).astype(np.int32)


def write_waves(path: Path, cells: int = CELLS) -> int:
    """Write the mesh of waves as an .obj file with z up; return the number of triangles."""
    vertices, triangles = wave_mesh(cells)
    write_obj(path, vertices, triangles)
    return len(triangles)


def write_obj(path: Path, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
    """Write vertices (V, 3), m, and triangles (T, 3) as an .obj file."""
    with path.open("w", encoding="ascii") as file:
        np.savetxt(file, vertices, fmt="v %.6f %.6f %.6f")
        np.savetxt(file, triangles + 1, fmt="f %d %d %d")
