"""Heights of a road's mesh against the analytic surface that it was made from."""

import numpy as np

from ...base.arrays import Float
from ...base.classes import class_id
from ...base.random_streams import stream
from ...road.geometry import RoadGeometry
from .mesh import SceneMesh

_BESIDE_STEPS = 0.01
"""To either side of a step, m: faces at it may begin a little aside."""


def mesh_height_errors(
    mesh: SceneMesh, geometry: RoadGeometry, samples: int = 100_000, names: tuple[str, ...] = ("road", "roadside")
) -> Float:
    """Return signed height errors (N,), m, of random points of a mesh's road against the analytic surface.

    Without the centimetres along which the pavement changes at once, at noses and ends of ramps: faces there go
    slantwise from one cross-section to quite another one. And without patches and cracks, thin faces that lie on the
    surface as paint does; the heights of points on them come from the pavement itself.

    Args:
        mesh: scene mesh in local coordinates.
        geometry: the analytic road.
        samples: points, drawn evenly by area with a fixed seed.
        names: classes of the faces that belong to the analytic surface.
    """
    rng = stream(0, "mesh height errors")
    laid_on = geometry.numbers.laid_on()
    of_surface = np.isin(mesh.class_id, [class_id(name) for name in names]) & ~np.isin(mesh.instance_id, laid_on)
    faces = np.flatnonzero(of_surface)
    area = mesh.areas()[faces]
    chosen = faces[rng.choice(len(faces), size=samples, p=area / area.sum())]
    corners = mesh.vertices[mesh.triangles[chosen]].astype(np.float64)
    u, v = rng.random((2, samples))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
    station, offset = geometry.alignment.project(points[:, :2])
    inside = (station >= 0) & (station <= geometry.length)
    for low, high in (step for section in geometry.sections.values() for step in section.steps()):
        inside &= (station < low - _BESIDE_STEPS) | (station > high + _BESIDE_STEPS)
    error = points[inside, 2] - geometry.elevation(station[inside], offset[inside])
    return np.asarray(error[np.isfinite(error)])
