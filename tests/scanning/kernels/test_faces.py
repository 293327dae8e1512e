"""studies/costs/loops.py: the share of pulses whose rays all meet one face."""

from __future__ import annotations

import numpy as np
import pytest

from studies.costs import loops as measure_loops
from tests.helpers.scenes.kernel_scenes import planned
from tests.helpers.scenes.scan_scenes import mesh_of, plane

pytestmark = pytest.mark.any_blender


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure_loops, "RUNS", 1)
    monkeypatch.setattr(measure_loops, "PULSES", 2000)


@pytest.mark.parametrize("rays", [7, 19])
def test_pulses_on_a_plane_meet_one_face(rays: int) -> None:
    found = measure_loops.faces(planned(plane(), rays))
    assert found["one face"] > 0.99  # but for those on the edge between the plane's two triangles
    assert found["believed"] >= found["one face"]
    assert found["wrong"] < 0.01
    assert all(found[name] > 0.0 for name in ("cast", "four", "axis", "pulses", "blocks"))


def test_a_wire_between_the_rays_that_are_asked_is_missed() -> None:
    """Of pulses that four rays let believe that they meet one face alone, some meet a wire as well."""
    flat, edges = plane(), np.arange(-300.0, 300.0, 0.2)
    corners = [[(x, -300.0, 1.0), (x + 0.02, -300.0, 1.0), (x, 300.0, 1.0)] for x in edges]
    vertices = np.concatenate([flat.vertices, np.array(corners, np.float32).reshape(-1, 3)])
    wires = len(flat.vertices) + np.arange(3 * len(edges)).reshape(-1, 3)
    found = measure_loops.faces(planned(mesh_of(vertices, np.concatenate([flat.triangles, wires])), 19))
    assert found["wrong"] > 0.01
    assert found["one face"] < found["believed"]
