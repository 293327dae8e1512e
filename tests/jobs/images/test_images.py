"""Images of twelve cameras on three platforms against scene and cloud, by the files alone and formulas written anew."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import bpy  # noqa: F401 (mathutils comes with it)
import numpy as np
import pytest
from mathutils.bvhtree import BVHTree
from PIL import Image

from synthroads_addon.blender.scene.evaluated import scanned_scene
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import concatenate
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.scenario import load_scenario

pytestmark = pytest.mark.any_blender

PINHOLE = {"model": "pinhole", "pixel_size_um": 20.0, "width": 200, "height": 150, "exposure_ms": 2.0}
RIG = {
    "type": "CameraRig",
    "title": "Test",
    "source": "Made up.",
    "cameras": [
        PINHOLE
        | {"name": "bent", "focal_length_mm": 3.0, "radial": [-0.22, 0.07, -0.01], "tangential": [0.002, -0.001]}
        | {"position": [0.4, 0.3, -0.1], "yaw_deg": 20.0, "pitch_deg": -35.0, "roll_deg": 4.0},
        PINHOLE
        | {"name": "aside", "focal_length_mm": 3.5, "principal_point": [93.0, 80.5], "yaw_deg": -90.0}
        | {"pitch_deg": -30.0},
        {"name": "fish", "model": "fisheye", "width": 200, "height": 200, "pixel_size_um": 20.0, "focal_length_mm": 1.3}
        | {"radial": [0.02, -0.004], "pitch_deg": -60.0, "position": [-0.2, 0.0, -0.2], "roll_deg": -10.0},
        {"name": "sphere", "model": "equirectangular", "width": 280, "height": 140, "yaw_deg": 30.0},
    ],
}
VLP = "scan.device=velodyne-vlp-32c"
PLATFORMS = {
    "vehicle": ["scan.platform.kind=vehicle", "scan.platform.speed=20", "scan.motion.attitude_sigma_deg=1", VLP],
    "uav": [
        "scan.platform.kind=uav",
        "scan.platform.height=25",
        "scan.platform.lateral_offsets=[6]",
        "scan.device=riegl-minivux-3uav",
    ],
    "tripod": ["scan.platform.kind=tripod", "scan.platform.station_spacing=20", "scan.platform.turn_seconds=2", VLP],
}
SMALL = ["fidelity=draft", "road.length=40", "road.half_width=25", "colour.source=material", "scan.relief=0"]
SMALL += [
    'scan.noise={"range_sigma":0}',
    "scan.strip_errors={}",
    "scan.traffic_speed_factor=0",
    'outputs=["cloud"]',
    "vegetation_detail=0",
]
SMALL += ["scan.cameras.spacing=15", "scan.cameras.samples=1"]
POINTS = 10_000
GRID = np.stack(np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5)), axis=-1).reshape(-1, 2)
"""Places in a pixel at which it is looked whether an edge goes through it."""
WIDEST = 0.4
"""Largest extent of what a pixel shows, m, so that no marking lies between those places."""
FARTHEST = 40.0
"""Distance, m, beyond which pixels are wider anyway."""


@dataclass
class Taken:
    """Images of a job, as its files tell them."""

    folder: Path
    tree: BVHTree
    mesh: SceneMesh

    @cached_property
    def notes(self) -> dict:
        """Return what ``images.json`` says."""
        return json.loads((self.folder / "images" / "images.json").read_text())

    @property
    def shift(self) -> np.ndarray:
        """Return what local coordinates of the files are from those of the tree, m."""
        return np.array(self.notes["origin"]) - self.mesh.origin

    @cached_property
    def cameras(self) -> dict[int, list[str]]:
        """Return COLMAP's parameters of the cameras by number."""
        lines = (self.folder / "images" / "colmap" / "cameras.txt").read_text().splitlines()
        rows = [line.split() for line in lines if not line.startswith("#")]
        return {int(row[0]): row[1:] for row in rows}

    @cached_property
    def images(self) -> list[tuple[str, int, np.ndarray, np.ndarray]]:
        """Return name, camera, rotation from the world and translation of each image."""
        lines = (self.folder / "images" / "colmap" / "images.txt").read_text().splitlines()
        result = []
        for line in [line for line in lines if line and not line.startswith("#")]:
            row = line.split()
            result.append((row[9], int(row[8]), turn(np.array(row[1:5], float)), np.array(row[5:8], float)))
        return result

    def lets_through(self, face: int) -> bool:
        """Return whether a face of the scene is glass, behind which a camera sees what is there."""
        return "glass" in self.mesh.materials[self.mesh.material[face]]

    def alike(self, centre: np.ndarray, directions: np.ndarray) -> bool:
        """Return whether rays (25, 3) over all of a pixel meet one instance of one class, near each other."""
        hits = [self.tree.ray_cast(centre.tolist(), direction.tolist()) for direction in directions]
        if any(face is None or self.lets_through(face) for _, _, face, _ in hits):
            return False
        if np.ptp([list(place) for place, _, _, _ in hits], axis=0).max() > WIDEST:
            return False
        return len({(self.mesh.class_id[face], self.mesh.instance_id[face]) for _, _, face, _ in hits}) == 1

    def layer(self, layer: str, name: str) -> np.ndarray:
        """Return the pixels of a layer of an image."""
        ending = {"depth": ".tif"}.get(layer, ".png")
        return np.array(Image.open(self.folder / "images" / layer / Path(name).with_suffix(ending)))


def turn(quaternion: np.ndarray) -> np.ndarray:
    """Return the matrix of a quaternion (w, x, y, z), by v' = v + 2 w (q x v) + 2 q x (q x v)."""
    w, q = quaternion[0], quaternion[1:]
    columns = [v + 2 * w * np.cross(q, v) + 2 * np.cross(q, np.cross(q, v)) for v in np.eye(3)]
    return np.column_stack(columns)


def seen_at(camera: list[str], points: np.ndarray) -> np.ndarray:
    """Return the places (N, 2), px, of points (N, 3) of the camera's frame, by COLMAP's documentation of its models."""
    model, values = camera[0], np.array(camera[3:], float)
    x, y, z = points.T
    if model == "EQUIRECTANGULAR":
        width, height = values
        azimuth, depression = np.arctan2(x, z), np.arcsin(y / np.linalg.norm(points, axis=1))
        return np.column_stack([(azimuth / (2 * np.pi) + 0.5) * width, (depression / np.pi + 0.5) * height])
    fx, fy, cx, cy = values[:4]
    if model == "OPENCV_FISHEYE":
        radius = np.hypot(x, y)
        angle = np.arctan2(radius, z)
        bent = angle * (1 + sum(k * angle ** (2 * n) for n, k in enumerate(values[4:], 1)))
        return np.column_stack([fx * bent * x / radius + cx, fy * bent * y / radius + cy])
    k1, k2, p1, p2, k3, k4, k5, k6 = values[4:]
    u, v = x / z, y / z
    r2 = u * u + v * v
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    du, dv = 2 * p1 * u * v + p2 * (r2 + 2 * u * u), 2 * p2 * u * v + p1 * (r2 + 2 * v * v)
    return np.column_stack([fx * (u * radial + du) + cx, fy * (v * radial + dv) + cy])


def looks_to(camera: list[str], places: np.ndarray) -> np.ndarray:
    """Return the unit directions (N, 3) that places (N, 2), px, see, by inverting `seen_at` step by step."""
    model = camera[0]
    if model == "EQUIRECTANGULAR":
        width, height = (float(value) for value in camera[3:])
        azimuth, depression = (places[:, 0] / width - 0.5) * 2 * np.pi, (places[:, 1] / height - 0.5) * np.pi
        level = np.cos(depression)
        return np.column_stack([level * np.sin(azimuth), np.sin(depression), level * np.cos(azimuth)])
    focal, centre = np.array(camera[3:5], float), np.array(camera[5:7], float)
    target = (places - centre) / focal

    def direction(flat: np.ndarray) -> np.ndarray:
        """Return directions by places without distortion: in the plane, or of an even fisheye."""
        if model != "OPENCV_FISHEYE":
            return np.column_stack([flat, np.ones(len(flat))])
        angle = np.linalg.norm(flat, axis=1, keepdims=True)
        return np.column_stack([flat * np.sinc(angle / np.pi), np.cos(angle)])

    flat = target.copy()
    for _ in range(60):
        flat += target - (seen_at(camera, direction(flat)) - centre) / focal
    result = direction(flat)
    return result / np.linalg.norm(result, axis=1, keepdims=True)


@pytest.fixture(scope="module", params=PLATFORMS)
def taken(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Taken:
    """Return the images of four cameras on a platform, with the scene as a tree."""
    folder = tmp_path_factory.mktemp(request.param)
    rig = folder / "rig.json"
    rig.write_text(json.dumps(RIG))
    changes = [*SMALL, f"scan.cameras.rig={rig}", *PLATFORMS[request.param]]
    generate(Job(load_scenario("country-mobile-300m", changes), folder / "out"))
    mesh = scanned_scene().static
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles.tolist())
    return Taken(folder / "out", tree, mesh)


def numbers_of(pixels: np.ndarray) -> np.ndarray:
    """Return the instance numbers (H, W) of a picture's three bytes."""
    return pixels.astype(np.int64) @ [1, 256, 65_536]


def test_pixels_lie_on_the_scene_and_are_seen_where_they_are(taken: Taken) -> None:
    random = np.random.default_rng(3)
    for number, camera in taken.cameras.items():
        errors, ranges = [], []
        for name, owner, rotation, translation in taken.images:
            depth = taken.layer("depth", name)
            rows, columns = np.nonzero(depth > 0)
            if owner != number or not len(rows):
                continue
            chosen = random.permutation(len(rows))[:POINTS]
            places = np.column_stack([columns, rows])[chosen] + 0.5
            along = looks_to(camera, places)
            assert np.abs(seen_at(camera, along) - places).max() < 1e-6, "the inversion of this test itself"
            world = (depth[rows[chosen], columns[chosen], None] * along - translation) @ rotation
            errors.append(np.linalg.norm(seen_at(camera, world @ rotation.T + translation) - places, axis=1))
            centre, directions = -rotation.T @ translation + taken.shift, along @ rotation
            for i in range(0, len(chosen), 4):
                _, _, face, cast = taken.tree.ray_cast(centre.tolist(), directions[i].tolist())
                if face is None or not taken.lets_through(face):
                    ranges.append(abs((np.inf if cast is None else cast) - depth[rows[chosen[i]], columns[chosen[i]]]))
        assert len(errors) >= 2
        assert sum(map(len, errors)) >= POINTS
        assert np.concatenate(errors).max() < 1 / 3
        assert np.mean(np.array(ranges) < 1e-3) > 0.999, camera


def test_the_cloud_in_the_images_has_their_labels(taken: Taken) -> None:
    with open_cloud(taken.folder / "cloud.laz") as cloud:
        points = concatenate(list(cloud.blocks()))
    local = points.xyz - np.array(taken.notes["origin"])
    compared = wrong_class = wrong_instance = 0
    range_errors = []
    for name, owner, rotation, translation in taken.images:
        camera = taken.cameras[owner]
        width, height = int(camera[1]), int(camera[2])
        in_camera = local @ rotation.T + translation
        ahead = in_camera[:, 2] > 0.1 if camera[0] == "FULL_OPENCV" else np.ones(len(local), bool)
        rows = np.flatnonzero(ahead)
        places = seen_at(camera, in_camera[rows])
        inside = (places >= 0).all(axis=1) & (places < (width, height)).all(axis=1)
        rows, places = rows[inside], places[inside]
        # Brown's formula folds what lies far aside back into the image, where no ray of the lens goes.
        true = in_camera[rows] / np.linalg.norm(in_camera[rows], axis=1, keepdims=True)
        folded = np.linalg.norm(looks_to(camera, places) - true, axis=1) > 1e-4
        rows, places = rows[~folded], places[~folded]
        if not len(rows):
            continue
        column, row = np.floor(places).astype(int).T
        depth = taken.layer("depth", name)
        numbers, classes = numbers_of(taken.layer("instance", name)), taken.layer("class", name)
        distance = np.linalg.norm(in_camera[rows], axis=1)
        keep = np.flatnonzero(depth[row, column] > 0)
        centre = -rotation.T @ translation + taken.shift
        chosen = np.random.default_rng(5).permutation(keep[distance[keep] < FARTHEST])[:400]
        if not len(chosen):
            continue
        corners = np.column_stack([column, row])[chosen, None] + GRID
        directions = (looks_to(camera, corners.reshape(-1, 2)) @ rotation).reshape(len(chosen), -1, 3)
        for i, over_pixel in zip(chosen, directions, strict=True):
            # What hides the point, in truth: whatever the way from it to the camera meets.
            towards = centre - (local[rows[i]] + taken.shift)
            length = float(np.linalg.norm(towards))
            start = local[rows[i]] + taken.shift + towards / length * 0.01
            if taken.tree.ray_cast(start.tolist(), towards.tolist(), length - 0.02)[0] is not None:
                continue
            if not taken.alike(centre, over_pixel):
                continue
            compared += 1
            wrong_class += int(classes[row[i], column[i]] != points.class_id[rows[i]])
            wrong_instance += int(numbers[row[i], column[i]] != points.instance_id[rows[i]])
            range_errors.append(abs(depth[row[i], column[i]] - distance[i]) / distance[i])
    assert compared > 1000
    assert wrong_class <= 1e-3 * compared, (wrong_class, compared)
    assert wrong_instance <= 1e-3 * compared, (wrong_instance, compared)
    assert np.median(range_errors) < 0.01
