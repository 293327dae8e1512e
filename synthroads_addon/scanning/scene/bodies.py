"""Bounded things of a scene, standing or moving: the boxes that hold their meshes, and places on their surfaces."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ...base.arrays import AnyArray, Float
from ...road.instances import PassNumbers
from .mesh import SceneMesh
from .motion import BodyMotion, LinearMotion, MovingMesh, Pose

PLACES = 64
"""Places on a thing's surface by which it is found out what share of it is in sight: a share is right to some per cent.
Chosen."""
LONGEST = 30.0
"""Edge (m) from which on a thing counts as a part of the road and gets no box, such as a barrier. Chosen: longer than
any vehicle on the road (18.75 m, directive 96/53/EC; 25.25 m in modular combinations)."""
_GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of the sequence that spreads places over triangles: powers of the inverse of the plastic number."""


@dataclass(frozen=True)
class Body:
    """A thing with its box, in a frame of its own.

    Attributes:
        instance: its number.
        class_id: of most of its surface.
        centre: (3,) of the box in the body frame, m.
        size: (3,) of the box, m.
        places: (P, 3) on the surface, evenly spread by area, in the body frame, m.
        normals: (P, 3) unit normals there.
        rotation, position: from the body frame to the local one; of a thing that moves to the frame of its motion,
            whose origin is that of the body.
        motion: None for a thing that stands.
        again: instance numbers of later passes of a vehicle; None if it keeps its own.
        part: number of the moving mesh, in the order of the scene's; -1 for a thing that stands.
    """

    instance: int
    class_id: int
    centre: Float
    size: Float
    places: Float
    normals: Float
    rotation: Float
    position: Float
    motion: BodyMotion | None = None
    again: PassNumbers | None = None
    part: int = -1

    def pose(self, time: float) -> tuple[Float, Float, bool]:
        """Return rotation (3, 3), position (3,), m, and whether the body is there, at a time, s."""
        if self.motion is None:
            return self.rotation, self.position, True
        rotation, position, present = self.poses(np.array([time]))
        return rotation[0], position[0], bool(present[0])

    def poses(self, times: Float) -> Pose:
        """Return rotations (K, 3, 3), positions (K, 3), m, and presence (K,) of a body that moves at times (K,), s."""
        assert self.motion is not None
        rotation, position, present = self.motion.pose(times)
        return rotation @ self.rotation, position, present

    def number(self, time: float) -> int:
        """Return the body's instance number at a time, s: a vehicle has another one each time that it comes in."""
        if self.motion is None or self.again is None:
            return self.instance
        return self.again.number(self.instance, int(self.motion.passes(np.array([time]))[0]))


def standing_bodies(
    mesh: SceneMesh, classes: Collection[int], rotations: Mapping[int, Float] | None = None
) -> Iterator[Body]:
    """Yield a body for each instance number of a mesh whose faces are of some classes, in the order of the numbers.

    Its box stands upright, and is the smallest such box in plan; its x axis lies along its longer side. Of things whose
    rotation is given the box has that one.

    Args:
        mesh: in the local frame.
        classes: ``class_id`` of faces.
        rotations: (3, 3) from the body frame to the local one by instance number, where it is known.
    """
    is_wanted = (mesh.instance_id > 0) & np.isin(mesh.class_id, np.array(sorted(classes), dtype=np.uint8))
    faces = np.flatnonzero(is_wanted)
    faces = faces[np.argsort(mesh.instance_id[faces], kind="stable")]
    numbers, starts = np.unique(mesh.instance_id[faces], return_index=True)
    if not len(numbers):
        return
    for number, rows in zip(numbers.tolist(), np.split(faces, starts[1:]), strict=True):
        corners = mesh.vertices[mesh.triangles[rows]].astype(np.float64)
        rotation = (rotations or {}).get(number)
        if rotation is None:
            rotation = _smallest_in_plan(corners.reshape(-1, 3))
        yield _body(number, mesh.class_id[rows], corners @ rotation, rotation)


def moving_bodies(parts: tuple[MovingMesh, ...], classes: Collection[int]) -> Iterator[Body]:
    """Yield a body for each moving mesh that has faces of some classes, with its motion.

    Vehicles' boxes have the axes of their motion; of things that move straight on the box is the smallest upright one,
    and its x axis is the one of its longer side that looks ahead.
    """
    for part, item in enumerate(parts):
        mesh = item.mesh
        rows = np.flatnonzero(np.isin(mesh.class_id, np.array(sorted(classes), dtype=np.uint8)))
        if not len(rows):
            continue
        numbers, counts = np.unique(mesh.instance_id[rows], return_counts=True)
        corners = mesh.vertices[mesh.triangles[rows]].astype(np.float64)
        number = int(numbers[counts.argmax()])
        turn = np.eye(3)
        if isinstance(item.motion, LinearMotion):
            turn = _smallest_in_plan(corners.reshape(-1, 3))
            if turn[:, 0] @ item.motion.velocity < 0.0:
                turn = turn * [-1.0, -1.0, 1.0]
        yield _body(number, mesh.class_id[rows], corners @ turn, turn, item.motion, item.again, part)


def _body(
    number: int,
    class_ids: AnyArray,
    corners: Float,
    rotation: Float,
    motion: BodyMotion | None = None,
    again: PassNumbers | None = None,
    part: int = -1,
) -> Body:
    """Return the body of triangles with corners (T, 3, 3) in its own frame, m; see `Body`."""
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    by_class = np.bincount(class_ids, weights=area)
    places, normals = _spread(corners, cross, area)
    class_id = int(by_class.argmax())
    return Body(
        number, class_id, (low + high) / 2.0, high - low, places, normals, rotation, np.zeros(3), motion, again, part
    )


def _spread(corners: Float, cross: Float, area: Float) -> tuple[Float, Float]:
    """Return `PLACES` places on triangles, evenly spread by area, and their unit normals; always the same ones."""
    until = np.cumsum(area)
    steps = (np.arange(PLACES) + 0.5) / PLACES * until[-1]
    face = np.minimum(np.searchsorted(until, steps), len(area) - 1)
    u, v = (np.mod((np.arange(PLACES) + 1) * step, 1.0) for step in _GOLDEN)
    is_beyond = u + v > 1.0
    u, v = np.where(is_beyond, 1.0 - u, u), np.where(is_beyond, 1.0 - v, v)
    a, b, c = (corners[face, i] for i in range(3))
    places = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return places, cross[face] / np.maximum(area[face], np.finfo(np.float64).tiny)[:, None]


def _smallest_in_plan(points: Float) -> Float:
    """Return the rotation (3, 3) about the vertical of the smallest rectangle around points (N, 3) in plan.

    Its x axis lies along the longer side, and looks to positive x. One side of it lies on a side of the hull.
    """
    plan = points[:, :2] - points[:, :2].mean(axis=0)
    try:
        hull = plan[ConvexHull(plan).vertices]
    except QhullError:  # upright and flat, or a line: along it
        direction = np.linalg.svd(plan, full_matrices=False)[2][0]
        angles = np.array([np.arctan2(direction[1], direction[0])])
        hull = plan
    else:
        sides = np.roll(hull, -1, axis=0) - hull
        angles = np.unique(np.mod(np.arctan2(sides[:, 1], sides[:, 0]), np.pi / 2.0))
    cosine, sine = np.cos(angles), np.sin(angles)
    along = np.outer(cosine, hull[:, 0]) + np.outer(sine, hull[:, 1])
    across = np.outer(cosine, hull[:, 1]) - np.outer(sine, hull[:, 0])
    lengths, widths = np.ptp(along, axis=1), np.ptp(across, axis=1)
    best = int((lengths * widths).argmin())
    angle = float(angles[best]) + (np.pi / 2.0 if widths[best] > lengths[best] else 0.0)
    angle = (angle + np.pi / 2.0) % np.pi - np.pi / 2.0
    return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
