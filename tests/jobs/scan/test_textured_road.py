"""A folder of textures in the cloud: each point has what the images give where it lies."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.classes import class_id
from synthroads_addon.base.random_streams import stream
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.materials.textures import texture_sets
from synthroads_addon.materials.variation import WET_BASE, WET_ROUGHNESS
from synthroads_addon.road.damage import DAMAGES
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.field import (
    PATCH,
    ArrayCalculus,
    PavementPlace,
    Wear,
    asphalt_look,
    damage_code,
)
from synthroads_addon.road.pavement.places import pavement_places
from synthroads_addon.road.pavement.surface import PavementSurface
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.effects.road_cases import base_road
from tests.helpers.effects.scans import SCAN
from tests.helpers.scenes.texture_folder import (
    BRIGHT,
    DARK,
    ROUGH,
    SIZE,
    SMOOTH,
    checkerboard,
    fields_at,
    halves,
    linear,
    plain,
    write_set,
)

TILE = 4.0


def textured_road(folder: Path) -> RoadParameters:
    """Return a road with a patch whose asphalt is a checkerboard, half smooth, and whose median is of one colour."""
    write_set(folder / "asphalt", TILE, base_color=checkerboard(), roughness=halves())
    write_set(folder / "median" / "red", base_color=plain(*BRIGHT), specular=plain(128, 0, 0))
    data = deepcopy(base_road({}))
    patch = {"outline": [[5, -9.5], [45, -9.5], [45, -6.0], [5, -6.0]], "age": 0.5, "height": 0.0}
    data["objects"]["right"]["pavement"] = {"patches": [patch]}
    sets = texture_sets(str(folder))
    data["materials"] = {"textures": [choices[0].to_dict() for choices in sets.values()]}
    return RoadParameters.from_dict(data)


def scan(parameters: RoadParameters, *, normals: bool = False) -> PointBlock:
    """Return the points of a scan without noise, coloured by the base colour; normals may follow images."""
    cloud = {"attributes": ["damage", "noise_free", "normal", "roughness", "specular"]}
    changes = {
        "relief_normals": normals,
        "relief": 0.0,
        "noise": {"range_sigma": 0.0},
        "platform": SCAN["scan"]["platform"] | {"speed": 4.0},
    }
    colour = {"source": "nodes", "mode": "unlit"}
    settings = {"geometric_tolerance": 0.001, "scan": SCAN["scan"] | changes, "cloud": cloud, "colour": colour}
    scene = RoadScene.of(Scenario.from_dict(SCAN | settings), RoadGeometry(parameters))
    scene.build()
    blocks = CollectedBlocks()
    record(scene.plan(), blocks)
    return concatenate([block.points for block in blocks.results])


def base_color(points: PointBlock) -> Float:
    """Return the linear base colours (N, 3) of points that show these."""
    share = points.array("rgb") / 65535.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


@pytest.mark.any_blender
def test_points_have_the_images_values_at_their_station_and_offset(tmp_path: Path) -> None:
    """Wear and rain stay on top, on a patch as beside it; the image gives the rest."""
    parameters = textured_road(tmp_path)
    geometry, points = RoadGeometry(parameters), scan(parameters)
    place = points.array("true_xyz")[:, :2] - parameters.transform.translate[:2]
    station, offset = geometry.alignment.project(place)
    damage = np.array(DAMAGES)[points.array("damage")]
    paved = PavementSurface(geometry).is_paved("right", station, offset) & (points.array("class_id") == 1)
    dark, smooth, certain = fields_at(station, offset, TILE)
    seed = float(stream(parameters.metadata.seed, "pavement look").integers(1 << 16))
    wear = Wear(parameters.materials.wheel_track_polish, seed)
    look = asphalt_look(ArrayCalculus(), pavement_places(geometry.sections["right"], station, offset), wear)
    of_patch = asphalt_look(
        ArrayCalculus(), PavementPlace(np.zeros(1), np.zeros(1), np.full(1, damage_code(PATCH, 0.5))), wear
    )
    wet = parameters.environment.wetness
    assert wet > 0.1
    darker, smoother = 1.0 - WET_BASE * wet, 1.0 - WET_ROUGHNESS * wet
    color, roughness = base_color(points), points.array("roughness")
    for kind in ("none", "patch"):
        rows = np.flatnonzero(paved & certain & (damage == kind) & (station > 1.0) & (station < 59.0))
        assert min(np.bincount(dark[rows] * 2 + smooth[rows], minlength=4)) > 15, kind
        brightness, rougher = of_patch if kind == "patch" else (look.brightness[rows], look.roughness[rows])
        expected = darker * np.where(dark[rows, None], linear(DARK), linear(BRIGHT)) * np.reshape(brightness, (-1, 1))
        same = np.abs(color[rows] - expected).max(axis=1) < 0.004
        assert same.mean() > 0.97, kind
        expected = smoother * np.where(smooth[rows], SMOOTH, ROUGH) / 255.0 + rougher
        assert (np.abs(roughness[rows] - np.clip(expected, 0.0, 1.0)) < 0.01).mean() > 0.97, kind
    median = np.abs(offset) < 1.5
    assert median.sum() > 100
    assert color[median] == pytest.approx(np.tile(linear(BRIGHT), (median.sum(), 1)), abs=1e-3)
    assert points.array("specular")[median] == pytest.approx(128.0 / 255.0, abs=1e-3)
    rows = np.flatnonzero(paved & certain & (damage == "none"))
    by_field = [float(np.median(points.array("intensity")[rows[dark[rows] == kind]])) for kind in (True, False)]
    assert by_field[0] < 0.75 * by_field[1]


@pytest.mark.any_blender
def test_normals_and_intensities_follow_normal_images_on_request(tmp_path: Path) -> None:
    lean = np.array([0.25, -0.4])
    code = np.append(lean, 1.0) / np.linalg.norm(np.append(lean, 1.0)) / 2.0 + 0.5
    image = np.tile(np.uint8([128, 128, 255]), (SIZE, SIZE, 1))
    image[: SIZE // 2, : SIZE // 2] = np.round(code * 255.0)
    write_set(tmp_path / "asphalt", TILE, normal=image)
    data = deepcopy(base_road({}))
    data["materials"] = {"textures": [choices[0].to_dict() for choices in texture_sets(str(tmp_path)).values()]}
    parameters = RoadParameters.from_dict(data)
    geometry = RoadGeometry(parameters)
    smooth, turned = scan(parameters), scan(parameters, normals=True)
    assert np.array_equal(smooth.xyz, turned.xyz)
    place = smooth.array("true_xyz")[:, :2] - parameters.transform.translate[:2]
    station, offset = geometry.alignment.project(place)
    dark, first, _ = fields_at(station, offset, TILE)
    halves_at = np.column_stack([station, offset]) / (TILE / 2.0)
    # A beam's footprint takes the mean of pixels.
    certain = np.abs(halves_at - np.round(halves_at)).min(axis=1) * TILE / 2.0 > 0.4
    right = parameters.carriageway("right")
    assert right is not None
    rows = (smooth.instance_id == right.instance) & (smooth.class_id == class_id("road")) & certain
    leaning = (dark & first)[rows]  # the lower left quarter of the image
    assert min(leaning.sum(), (~leaning).sum()) > 500
    heading = geometry.alignment.heading(station[rows])
    forwards = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(rows.sum())])
    before, after = (block.array("normal")[rows].astype(np.float64) for block in (smooth, turned))
    left = np.cross(before, forwards)
    expected = before + leaning[:, None] * (lean[0] * forwards + lean[1] * left)
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    # A byte of the image is 0.4 % of a slope.
    assert np.quantile(np.abs(after - expected).max(axis=1), 0.99) < 0.012
    others = ~np.isin(smooth.class_id, [1, 2])
    assert np.array_equal(smooth.array("normal")[others], turned.array("normal")[others])
    assert np.array_equal(smooth.intensity[others], turned.intensity[others])
    cosine = [np.cos(np.radians(block.incidence_deg[rows].astype(np.float64))) for block in (smooth, turned)]
    assert np.abs(cosine[1] / cosine[0] - 1.0).max() > 0.1
    brighter = turned.intensity[rows] / smooth.intensity[rows]
    assert np.quantile(np.abs(brighter / (cosine[1] / cosine[0]) - 1.0), 0.95) < 0.02
