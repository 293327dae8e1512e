"""Write the scene that docs/scan.md scans as one of somebody else's: a village street of 150 m x 100 m.

python tools/example_scene.py out/village.glb
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from synthroads_addon.base.random_streams import stream
from synthroads_addon.blender.files import empty_file

Float = NDArray[np.float64]

COLOURS = {
    "Grass": (0.10, 0.22, 0.05),
    "Tar": (0.06, 0.06, 0.065),
    "Paint": (0.8, 0.8, 0.78),
    "Plaster": (0.62, 0.56, 0.45),
    "Tiles": (0.35, 0.09, 0.05),
    "Steel": (0.45, 0.46, 0.48),
    "Bark": (0.13, 0.08, 0.05),
    "Leaves": (0.07, 0.20, 0.04),
    "Lacquer": (0.30, 0.03, 0.03),
}
_STREET = np.array([[-75.0, -6.0], [-30.0, 2.0], [20.0, 2.0], [75.0, -10.0]])


def ground(x: Float, y: Float) -> Float:
    """Return the ground's elevation (m) at x and y (m), arrays of one shape."""
    return np.asarray(1.6 * np.sin(x / 38.0) + 1.1 * np.cos(y / 23.0 + 0.5))


def street(x: Float) -> Float:
    """Return y (m) of the street's middle at x (m), both (N,)."""
    shifts = np.linspace(-6.0, 6.0, 13)[:, None]
    return np.asarray(np.interp(x[None] + shifts, _STREET[:, 0], _STREET[:, 1]).mean(axis=0))


def add(name: str, vertices: Float, faces: list[list[int]], material: str) -> None:
    """Add a mesh object of vertices (V, 3), m, and faces to the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces)
    mesh.materials.append(bpy.data.materials[material])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))


def sheet(name: str, x: Float, y: Float, height_above: float, material: str) -> None:
    """Add a surface ``height_above`` (m) above the ground to the scene, from grids x and y (R, C), m."""
    rows, columns = x.shape
    vertices = np.stack([x, y, ground(x, y) + height_above], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=-1)
    add(name, vertices, faces.tolist(), material)


def strip(
    name: str, first_x: float, last_x: float, offset: float, width: float, height_above: float, material: str
) -> None:
    """Add a strip along the street to the scene, between two x, `offset` and `width` (m) from its middle."""
    x = np.arange(first_x, last_x + 0.25, 0.5)
    offsets = np.linspace(offset - width / 2.0, offset + width / 2.0, max(2, int(width * 2)))
    sheet(name, np.repeat(x[None], len(offsets), axis=0), street(x)[None] + offsets[:, None], height_above, material)


def house(number: int, x: float, y: float, size: tuple[float, float, float], turn: float) -> None:
    """Add a house's walls and gable roof of (length, width, height), m, to the scene, turned by `turn` (rad)."""
    length, width, height = size
    cosine, sine = np.cos(turn), np.sin(turn)
    base = float(ground(np.array(x), np.array(y))) - 0.5

    def place(points: list[tuple[float, float, float]]) -> Float:
        """Return points (m) of the house's own frame in the scene."""
        local = np.array(points)
        return np.column_stack(
            [
                x + cosine * local[:, 0] - sine * local[:, 1],
                y + sine * local[:, 0] + cosine * local[:, 1],
                base + local[:, 2],
            ]
        )

    a, b, top = length / 2.0, width / 2.0, height + 0.45 * width
    corners = [(-a, -b), (a, -b), (a, b), (-a, b)]
    walls = place([(*corner, 0.0) for corner in corners] + [(*corner, height) for corner in corners])
    sides = [[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)]
    add(f"House.{number:02}", walls, sides, "Plaster")
    eave = [(-a - 0.4, -b - 0.5, height - 0.4), (a + 0.4, -b - 0.5, height - 0.4)]
    opposite_eave = [(a + 0.4, b + 0.5, height - 0.4), (-a - 0.4, b + 0.5, height - 0.4)]
    ridge = [(-a - 0.4, 0.0, top), (a + 0.4, 0.0, top)]
    add(f"Roof.{number:02}", place([*eave, *opposite_eave, *ridge]), [[0, 1, 5, 4], [2, 3, 4, 5]], "Tiles")


def column(name: str, x: float, y: float, radius: float, height: float, material: str) -> None:
    """Add an upright cylinder (m) on the ground to the scene."""
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    base = float(ground(np.array(x), np.array(y)))
    vertices = np.concatenate([np.column_stack([ring, np.full(12, base + z)]) for z in (0.0, height)])
    faces = [[i, (i + 1) % 12, 12 + (i + 1) % 12, 12 + i] for i in range(12)]
    add(name, vertices, [*faces, list(range(12, 24))], material)


def tree(number: int, x: float, y: float, height: float, random: np.random.Generator) -> None:
    """Add a trunk and a crown of 900 random triangles as leaves to the scene."""
    column(f"Trunk.{number:02}", x, y, 0.16, 0.5 * height, "Bark")
    count = 900
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    distances = random.uniform(0.5, 1.0, (count, 1)) ** 0.5
    top = float(ground(np.array(x), np.array(y))) + 0.65 * height
    middles = [x, y, top] + distances * directions * [0.3 * height, 0.3 * height, 0.36 * height]
    leaves = middles[:, None] + random.normal(0.0, 0.16, (count, 3, 3))
    add(f"Crown.{number:02}", leaves.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3).tolist(), "Leaves")


def box(name: str, x: float, y: float, size: tuple[float, float, float], height_above: float, material: str) -> None:
    """Add a box of (length, width, height), m, standing ``height_above`` (m) above the ground, to the scene."""
    length, width, height = size
    base = float(ground(np.array(x), np.array(y))) + height_above
    corners = [[x + i * length / 2, y + j * width / 2] for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    vertices = np.array([[*corner, base + z] for z in (0.0, height) for corner in corners])
    sides = [[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)]
    add(name, vertices, [*sides, [4, 5, 6, 7]], material)


def village() -> None:
    """Add the whole village, with its materials, to the open file."""
    random = stream(3, "village")
    for name, colour in COLOURS.items():
        new_material = bpy.data.materials.new(name)
        new_material.diffuse_color = (*colour, 1.0)
        if new_material.node_tree is None:
            new_material.use_nodes = True
        new_material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*colour, 1.0)
    x, y = np.meshgrid(np.arange(-75.0, 75.5, 1.0), np.arange(-50.0, 50.5, 1.0))
    sheet("Meadow", x, y, 0.0, "Grass")
    strip("Street", -75.0, 75.0, 0.0, 7.0, 0.06, "Tar")
    for number, x_along in enumerate(np.arange(-73.0, 73.0, 9.0)):
        strip(f"Line.{number:02}", x_along, x_along + 3.0, 0.0, 0.15, 0.075, "Paint")
    for number, x_along in enumerate(np.arange(-66.0, 70.0, 17.0)):
        middle = float(street(np.array([x_along]))[0])
        house(number, x_along, middle + (21.0 if number % 2 else -20.0), (13.0, 9.0, 5.5), 0.25 * random.normal())
        column(f"Lamp.{number:02}", x_along + 8.0, middle + (4.6 if number % 2 else -4.6), 0.09, 6.5, "Steel")
    for number, place in enumerate(random.uniform([-72.0, -47.0], [72.0, 47.0], (80, 2))):
        if abs(place[1] - float(street(place[:1])[0])) > 31.0:
            east, north = place.tolist()
            tree(number, east, north, float(random.uniform(6.0, 12.0)), random)
    for number, x_along in enumerate((-52.0, -20.0, 13.0, 47.0)):
        middle = float(street(np.array([x_along]))[0]) + (1.75 if number % 2 else -1.75)
        box(f"Car.{number}.body", x_along, middle, (4.4, 1.8, 0.75), 0.35, "Lacquer")
        box(f"Car.{number}.cabin", x_along - 0.3, middle, (2.3, 1.6, 0.6), 1.1, "Lacquer")


def main() -> None:
    """Write the scene to the file named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("file", type=Path)
    target = parser.parse_args().file.resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    empty_file()
    village()
    bpy.ops.export_scene.gltf(filepath=str(target), export_format="GLB")
    sys.stdout.flush()
    os._exit(0)  # Blender's own way out can crash


if __name__ == "__main__":
    main()
