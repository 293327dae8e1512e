"""Points on the pavement of a scanned road: heights and intensities are those that the parameters say."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.damage import DAMAGES
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.outlines import CRACK_FILM, PATCH_FILM
from synthroads_addon.road.pavement.surface import PavementSurface
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.effects.road_cases import base_road
from tests.helpers.effects.scans import SCAN

FILMS = {"patch": PATCH_FILM, "longitudinal crack": CRACK_FILM, "sealed longitudinal crack": CRACK_FILM}


def damaged_road() -> RoadParameters:
    """Return a road whose right pavement has a sunken dark patch, an open and a sealed crack, wide enough to see."""
    data = deepcopy(base_road({}))
    data["objects"]["right"]["pavement"] = {
        "patches": [{"outline": [[5, -5.0], [25, -5.0], [25, -3.5], [5, -3.5]], "age": 0.0, "height": -0.006}],
        "cracks": [
            {"kind": "longitudinal", "width": 0.15, "depth": 0.012, "lines": [[[8, -5.4], [55, -6.4]]]},
            {
                "kind": "longitudinal",
                "width": 0.15,
                "depth": -0.002,
                "sealed": True,
                "lines": [[[8, -7.4], [55, -8.6]]],
            },
        ],
    }
    return RoadParameters.from_dict(data)


def scan(parameters: RoadParameters, relief: float) -> PointBlock:
    """Return the points of a scan without noise, in the same order whatever the relief."""
    colour = {"source": "nodes"}
    platform = SCAN["scan"]["platform"] | {"speed": 4.0}
    changes = {"relief": relief, "noise": {"range_sigma": 0.0}, "platform": platform}
    cloud = {"attributes": ["damage", "noise_free", "normal"], "intensity": "range_corrected"}
    scenario = Scenario.from_dict(SCAN | {"scan": SCAN["scan"] | changes, "colour": colour, "cloud": cloud})
    scene = RoadScene.of(scenario, RoadGeometry(parameters))
    scene.build()
    blocks = CollectedBlocks()
    record(scene.plan(), blocks)
    return concatenate([block.points for block in blocks.results])


@pytest.mark.any_blender
def test_points_on_cracks_joints_and_patches_are_as_deep_and_as_dark_as_said() -> None:
    parameters = damaged_road()
    geometry = RoadGeometry(parameters)
    surface, smooth, points = PavementSurface(geometry), scan(parameters, 0.0), scan(parameters, 1.0)
    flat, true = smooth.array("true_xyz"), points.array("true_xyz")
    station, offset = geometry.alignment.project(flat[:, :2] - parameters.transform.translate[:2])
    raised = np.einsum("ij,ij->i", true - flat, smooth.array("normal"))
    paved = surface.is_paved("right", station, offset)
    damage = np.array(DAMAGES)[points.array("damage")]
    medians = {}
    for kind in ("none", *FILMS):
        rows = np.flatnonzero(paved & (damage == kind) & (station > 1.0) & (station < 59.0))
        assert len(rows) > 40, kind
        expected = surface.height(station[rows], offset[rows])
        # Edges of faces and of polygons are up to 2 cm apart.
        same = np.abs(raised[rows] + FILMS.get(kind, 0.0) - expected) < 2e-5
        assert same.mean() > 0.97, kind
        medians[kind] = float(np.median(points.intensity[rows]))
    lane = -float(geometry.sections["right"].lane_boundaries(30.0)[0, :2].mean())
    beside = np.abs(offset - (lane + 0.9)) < 0.3
    assert (
        raised[beside & paved & (damage == "none")].mean()
        < raised[paved & (np.abs(offset - lane) < 0.2) & (damage == "none")].mean()
        - 0.5 * parameters.carriageway("right").pavement.wheel_track_depth
    )
    # Factors of the field, by what the laser sees of them; a new patch is under its film, of a mix brighter or darker.
    assert medians["patch"] / medians["none"] == pytest.approx(0.38, abs=0.14)
    assert medians["longitudinal crack"] / medians["none"] == pytest.approx(0.45, abs=0.1)
    assert medians["sealed longitudinal crack"] / medians["none"] == pytest.approx(0.40, abs=0.1)
