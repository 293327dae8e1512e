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

    Two kinds of places are left out. At noses and ends of ramps the pavement changes at once, and faces go slantwise
    from one cross-section to quite another one: that is a matter of centimetres along the road. Patches and cracks are
    thin faces that lie on the surface as paint does; the heights of points on them come from the pavement itself.

    Args:
        mesh: scene mesh in local coordinates.
        geometry: the analytic road.
        samples: points, drawn evenly by area with a fixed seed.
        names: classes of the faces that belong to the analytic surface.
    """
    rng = stream(0, "mesh height errors")
    film_instances = geometry.numbers.laid_on()
    of_class = np.isin(mesh.class_id, [class_id(name) for name in names])
    faces = np.flatnonzero(of_class & ~np.isin(mesh.instance_id, film_instances))
    area = mesh.areas()[faces]
    sample_faces = faces[rng.choice(len(faces), size=samples, p=area / area.sum())]
    corners = mesh.vertices[mesh.triangles[sample_faces]].astype(np.float64)
    # Even in a triangle: points of the square's upper half are folded back onto the lower one.
    u, v = rng.random((2, samples))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
    station, offset = geometry.alignment.project(points[:, :2])
    keep_mask = (station >= 0) & (station <= geometry.length)
    for step_begin, step_end in (step for section in geometry.sections.values() for step in section.steps()):
        keep_mask &= (station < step_begin - _BESIDE_STEPS) | (station > step_end + _BESIDE_STEPS)
    error = points[keep_mask, 2] - geometry.elevation(station[keep_mask], offset[keep_mask])
    return np.asarray(error[np.isfinite(error)])
