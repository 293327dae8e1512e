"""Polygons of a side road: its pavement, its verges and its markings."""

from __future__ import annotations

import numpy as np

from ..road.geometry import RoadGeometry
from ..road.network.patches import side_road_paint_points, side_road_patches
from ..road.side_roads.mouth import Mouth
from .faces import Faces, drop_unused_points, join_faces, quad_faces


def side_road_faces(geometry: RoadGeometry, mouth: Mouth, kind: str) -> Faces:
    """Return the polygons of a side road's ``pavement`` or ``verge``."""
    parts = [
        quad_faces(patch.points.reshape(-1, 3), patch.quads(mouth.sign))
        for patch in side_road_patches(geometry, mouth, geometry.terrain)
        if patch.kind == kind
    ]
    return drop_unused_points(join_faces(parts))


def side_road_paint_faces(geometry: RoadGeometry, mouth: Mouth) -> Faces:
    """Return the polygons of a side road's markings."""
    points = side_road_paint_points(geometry, mouth).reshape(-1, 3)
    return quad_faces(points, np.arange(len(points)).reshape(-1, 4)) if len(points) else join_faces([])
