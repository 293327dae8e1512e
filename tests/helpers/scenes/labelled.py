"""A small labelled scene, made without Blender: ground and road in one mesh, posts that share one, a sign and a car."""

from __future__ import annotations

import numpy as np

from synthroads_addon.base.classes import class_id, class_scheme
from synthroads_addon.twin.scene.labelled import LabelledMesh, LabelledScene, SceneMaterial

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
LARGE = 4_000_000_003
"""Instance number beyond what a whole number with a sign holds in 32 bits, or a float exactly."""


def cuboid(size) -> tuple[np.ndarray, np.ndarray]:
    """Return corners (8, 3) and outward triangles (12, 3) of a cuboid that stands on z = 0."""
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)]) * np.array(size)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])


def at(x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    """Return the matrix (4, 4) of a place."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    matrix[:3, 3] = x, y, z
    return matrix


def thing(name: str, kind: str, size, material: int, matrices, numbers) -> LabelledMesh:
    """Return a cuboid at places, with an instance number each."""
    corners, triangles = cuboid(size)
    return LabelledMesh(
        name,
        corners.astype(np.float32),
        triangles.astype(np.int32),
        np.full(12, material, np.uint16),
        np.full(12, class_id(kind), np.uint8),
        None,
        np.array(matrices),
        np.array(numbers, np.uint32),
    )


def labelled_scene(length: float = 600.0) -> LabelledScene:
    """Return the scene of a straight road to the east."""
    stations = np.arange(0.0, length + 1.0, 20.0)
    offsets = np.array([-30.0, -6.0, 6.0, 30.0])
    vertices = np.array([(x, y, 0.01 * x) for x in stations for y in offsets], np.float32)
    triangles, classes, instances, materials = [], [], [], []
    for row in range(len(stations) - 1):
        for column in range(3):
            a = 4 * row + column
            triangles += [(a, a + 4, a + 5), (a, a + 5, a + 1)]
            classes += [class_id("road") if column == 1 else class_id("ground")] * 2
            instances += [2 if column == 1 else 1] * 2
            materials += [0 if column == 1 else 1] * 2
    ground = LabelledMesh(
        "Road",
        vertices,
        np.array(triangles, np.int32),
        np.array(materials, np.uint16),
        np.array(classes, np.uint8),
        np.array(instances, np.uint32),
        np.eye(4)[None],
        np.zeros(1, np.uint32),
    )
    places = [at(x, 7.0, 0.01 * x) for x in stations[:10]]
    posts = thing("post", "warning_post", (0.12, 0.12, 1.0), 2, places, 10 + np.arange(10))
    sign = thing("sign", "road_sign", (0.05, 1.0, 2.0), 2, [at(300.0, 8.0, 3.0, 0.2)], [LARGE])
    car = thing("car", "vehicle", (4.3, 1.8, 1.5), 3, [at(120.0, -2.0, 1.2)], [31])
    names = {10: "post-1", 31: 'car "one"', LARGE: "sign"}
    colors = {
        "asphalt": (0.1, 0.1, 0.1),
        "grass": (0.1, 0.3, 0.05),
        "steel galvanised": (0.6, 0.6, 0.6),
        "paint": (0.5, 0.0, 0.0),
    }
    return LabelledScene(
        (ground, posts, sign, car),
        tuple(SceneMaterial(name, color) for name, color in colors.items()),
        class_scheme("17").names(),
        ORIGIN,
        25832,
        'a "short" road',
        "SynthRoads",
        names.get,
        lambda plan: np.asarray(plan)[:, 0],
    )
