"""COLMAP's own reader loads the text model, and places seen in several images meet in one point."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.scenario.scenario import load_scenario
from tests.jobs.images.test_images import PLATFORMS, RIG, SMALL

pycolmap = pytest.importorskip("pycolmap", reason="the COLMAP reader that judges these files is no requirement")
CHANGES = [*SMALL, *PLATFORMS["vehicle"], "scan.cameras.spacing=3", 'scan.cameras.layers=["depth"]']
CHANGES += ['outputs=["parameters"]']


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the images of four cameras on a vehicle, every 3 m."""
    folder = tmp_path_factory.mktemp("colmap")
    rig = folder / "rig.json"
    rig.write_text(json.dumps(RIG))
    generate(Job(load_scenario("country-mobile-300m", [*CHANGES, f"scan.cameras.rig={rig}"]), folder / "out"))
    return folder / "out" / "images"


def test_colmap_reads_the_model(images: Path) -> None:
    model = pycolmap.Reconstruction()
    model.read_text(str(images / "colmap"))
    notes = json.loads((images / "images.json").read_text())
    assert len(model.images) == len(notes["images"])
    assert len(model.cameras) == 4
    assert len(model.rigs) == 1
    assert len(model.frames) == len(notes["images"]) // 4
    by_name = {image.name: image for image in model.images.values()}
    for entry in notes["images"]:
        image = by_name[f"{entry['camera']}/{entry['exposure']:06d}.png"]
        assert np.abs(image.projection_center() - entry["position_local"]).max() < 1e-6


def test_a_point_of_three_images_is_where_depth_has_it(images: Path) -> None:
    model = pycolmap.Reconstruction()
    model.read_text(str(images / "colmap"))
    errors = []
    random = np.random.default_rng(2)
    for camera_id, camera in model.cameras.items():
        own = sorted((image for image in model.images.values() if image.camera_id == camera_id), key=lambda i: i.name)
        for first, second, third in zip(own, own[1:], own[2:], strict=False):
            depth = np.array(Image.open(images / "depth" / first.name.replace(".png", ".tif")))
            rows, columns = np.nonzero((depth > 2) & (depth < 15))
            for k in random.permutation(len(rows))[:40]:
                place = np.array([columns[k] + 0.5, rows[k] + 0.5])
                along = camera.cam_ray_from_img(place[None])[0]
                point = first.cam_from_world().inverse() * (along * depth[rows[k], columns[k]])
                # Where COLMAP sees the point in the others, to whole hundredths of a pixel as measured.
                centres, directions = [], []
                for image in (first, second, third):
                    seen = image.project_point(point)
                    if seen is None or not (0 <= seen[0] <= camera.width and 0 <= seen[1] <= camera.height):
                        break
                    ray = camera.cam_ray_from_img(np.round(seen, 2)[None])[0]
                    there = image.cam_from_world() * point
                    if not (ray @ there / np.linalg.norm(there) > 0.9999):
                        break  # Brown's formula folds what lies far aside back into the image
                    inverse = image.cam_from_world().inverse()
                    centres.append(image.projection_center())
                    directions.append(inverse.rotation * ray)
                if len(centres) < 3 or directions[0] @ directions[2] > np.cos(np.radians(4)):
                    continue
                errors.append(np.linalg.norm(meeting(np.array(centres), np.array(directions)) - point))
    assert len(errors) > 60
    assert np.max(errors) < 0.02


def meeting(centres: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the point (3,) nearest to rays from centres (N, 3) along unit directions (N, 3), by least squares."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    return np.linalg.solve(across.sum(axis=0), (across @ centres[:, :, None]).sum(axis=0)[:, 0])
