"""Sweeps of a scan: boxes hold their points, occlusion is what stands between, and each format says the same."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.jobs.scan.sweeps import SweepFiles, box_classes
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scanning.scene.bodies import standing_bodies
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.scan_scenes import ORIGIN, Standing, Strip, altered, mesh_of, scan_of

SPEED = 20.0
CAR, SIGN, WALL = 100_000, 21, 22
SIZE = np.array([4.0, 1.8, 1.5])
DURATION = 0.1
HEIGHT = 20.0


def cuboid(size, middle=(0.0, 0.0, 0.0), yaw: float = 0.0) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    """Return corners and outward triangles of a cuboid."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2.0
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return corners @ turn.T + np.array(middle), triangles


def labelled(parts: list[tuple[tuple, str, int]], origin=ORIGIN) -> SceneMesh:
    """Return a mesh of cuboids and others, each with a class and a number."""
    vertices, triangles, classes, instances = [], [], [], []
    for (corners, faces), name, number in parts:
        first = sum(len(some) for some in vertices)
        vertices.append(np.asarray(corners, dtype=float))
        triangles += [tuple(first + index for index in face) for face in faces]
        classes += [class_id(name)] * len(faces)
        instances += [number] * len(faces)
    mesh = mesh_of(np.concatenate(vertices), triangles)
    changed = {"class_id": np.array(classes, np.uint8), "instance_id": np.array(instances, np.uint32)}
    return SceneMesh(
        **{**{name: getattr(mesh, name) for name in mesh.__dataclass_fields__}, **changed, "origin": origin}
    )


class Short(Standing):
    """A scanner that flies for a second."""

    strips = (Strip(0, 0.0, 1.0),)


GROUND = (np.array([(x, y, 0.0) for x in (-90, 90) for y in (-90, 90)]), [(0, 2, 3), (0, 3, 1)])


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, PointBlock, SweepFiles]:
    """A car of 4 m that drives to the north-east below a scanner that flies east, and a sign behind a wall."""
    folder = tmp_path_factory.mktemp("sweeps")
    yaw = np.pi / 4.0
    car = labelled([(cuboid(SIZE, (0.0, 0.0, SIZE[2] / 2.0 + 0.1), yaw), "vehicle", CAR)], np.zeros(3))
    sign = (cuboid((0.05, 1.0, 2.0), (1.0, -10.0, 1.0), 0.3), "road_sign", SIGN)
    wall = (cuboid((1.0, 4.0, 0.5), (1.0, -9.3, 4.0)), "noise_barrier", WALL)
    static = labelled([(GROUND, "road", 1), sign, wall])
    motion = LinearMotion(SPEED * np.array([np.cos(yaw), np.sin(yaw), 0.0]), (-5.0, -5.0, 0.0))
    plan = altered(scan_of(static, path=Short(HEIGHT, 3.0), moving=[MovingMesh(car, motion)]), chosen_blocks=None)
    formats = ["kitti", "semantickitti", "nuscenes", "openlabel"]
    changes = [f"sweeps.formats={json.dumps(formats)}", f"sweeps.duration={DURATION}"]
    scenario = load_scenario("rq31-600m-even", changes)
    files = SweepFiles(scenario, ScenarioInputs.read(scenario), folder, ORIGIN - 5.0, 65535 * HEIGHT**2, 25832)
    files.open()
    files.begin(plan)
    blocks = CollectedBlocks()
    record(plan, blocks)
    for result in blocks.results:
        files.add(result.points)
    files.close()
    return folder, concatenate([result.points for result in blocks.results]), files


def openlabel(folder: Path) -> dict:
    return json.loads((folder / "openlabel.json").read_text())["openlabel"]


def matrix_of(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of x, y, z, w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_every_point_of_a_thing_lies_in_its_box(written) -> None:
    folder, points, files = written
    assert files.counts["points_in_boxes"] == np.count_nonzero(np.isin(points.instance_id, (CAR, SIGN)))
    assert files.counts["points_in_boxes"] > 300
    assert files.counts["farthest_outside_mm"] < 20.0
    # By the file alone: a point of the car, where the car was when it was measured, lies in the box of its sweep.
    frames = openlabel(folder)["frames"]
    outside = []
    for number, frame in frames.items():
        data = frame["objects"][str(CAR)]["object_data"]
        values = np.array(next(item["val"] for item in data["cuboid"] if item["name"] == "amodal"))
        pose = np.array(frame["frame_properties"]["transforms"]["lidar_to_map"]["transform_src_to_dst"]["matrix4x4"])
        pose = pose.reshape(4, 4)
        time = float(frame["frame_properties"]["timestamp"])
        velocity = np.array(data["vec"][0]["val"])
        rows = (np.floor(points.gps_time / DURATION + 1e-9) == int(number)) & (points.instance_id == CAR)
        local = (points.xyz[rows] - (ORIGIN - 5.0) - pose[:3, 3]) @ pose[:3, :3]
        local -= (points.gps_time[rows] - time)[:, None] * velocity
        inside = np.abs((local - values[:3]) @ matrix_of(values[3:7])) - values[7:] / 2.0
        outside.append(inside.max(initial=-1.0))
        assert data["num"][0] == {"name": "points", "val": int(rows.sum())}
        assert np.allclose(values[7:], SIZE, atol=1e-5)
    assert len(outside) == 10
    assert max(outside) < 0.002


def test_speeds_and_ways_of_tracks(written) -> None:
    folder, _, _ = written
    places, times = [], []
    for frame in openlabel(folder)["frames"].values():
        data = frame["objects"][str(CAR)]["object_data"]
        assert np.linalg.norm(data["vec"][0]["val"]) == pytest.approx(SPEED, abs=1e-6)
        pose = frame["frame_properties"]["transforms"]["lidar_to_map"]["transform_src_to_dst"]["matrix4x4"]
        place = np.array(pose).reshape(4, 4) @ [*data["cuboid"][0]["val"][:3], 1.0]
        places.append(place[:3])
        times.append(float(frame["frame_properties"]["timestamp"]))
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times)
    assert np.allclose(speeds, SPEED, atol=1e-5)


def test_what_a_wall_hides_is_occluded(written) -> None:
    folder, _, _ = written
    first = openlabel(folder)["frames"]["0"]["objects"]
    occlusion = {
        int(number): next(item["val"] for item in data["object_data"]["num"] if item["name"] == "occlusion")
        for number, data in first.items()
    }
    assert occlusion[CAR] == 0.0
    assert occlusion[SIGN] > 0.9
    assert str(WALL) not in first
    assert "1" not in first


def test_semantickitti_keeps_every_points_class_and_instance(written) -> None:
    folder, points, _ = written
    sequence = folder / "semantickitti" / "sequences" / "00"
    rows = [line.split(",") for line in (sequence / "instances.csv").read_text().splitlines()[1:]]
    instance_of = {0: 0} | {int(row[0]): int(row[1]) for row in rows}
    poses = np.loadtxt(sequence / "poses.txt").reshape(-1, 3, 4)
    times = np.loadtxt(sequence / "times.txt")
    to_camera = next(line for line in (sequence / "calib.txt").read_text().splitlines() if line.startswith("Tr:"))
    to_camera = np.vstack([np.array(to_camera.split()[1:], float).reshape(3, 4), [0, 0, 0, 1]])
    scans = sorted((sequence / "velodyne").glob("*.bin"))
    assert len(scans) == len(poses) == len(times) == 10
    assert np.allclose(np.diff(times), DURATION)
    first = json.loads((folder / "sweeps.json").read_text())["sweeps"][0]
    assert first["points"] == len(np.fromfile(scans[0], "<f4")) // 4
    classes, instances, xyz = [], [], []
    for scan, pose in zip(scans, poses, strict=True):
        data = np.fromfile(scan, "<f4").reshape(-1, 4)
        label = np.fromfile(sequence / "labels" / f"{scan.stem}.label", "<u4")
        classes.append(label & 0xFFFF)
        instances.append([instance_of[number] for number in (label >> 16).tolist()])
        # As semantic-kitti-api does it: inv(Tr) pose Tr, to the frame of the first sweep.
        to_first = np.linalg.inv(to_camera) @ np.vstack([pose, [0, 0, 0, 1]]) @ to_camera
        xyz.append(data[:, :3] @ to_first[:3, :3].T + to_first[:3, 3])
        assert data[:, 3].min() >= 0.0
        assert data[:, 3].max() <= 1.0
    order = np.lexsort((points.gps_time, np.floor(points.gps_time / DURATION + 1e-9)))
    assert np.array_equal(np.concatenate(classes), points.class_id[order])
    assert np.array_equal(np.concatenate(instances), points.instance_id[order])
    ahead = points.xyz[order] - (ORIGIN - 5.0) - np.array(first["position"])  # the scanner flies to the east
    assert np.abs(np.concatenate(xyz) - ahead).max() < 2e-5


def test_nuscenes_tables_refer_to_each_other(written) -> None:
    folder, points, _ = written
    root = folder / "nuscenes"
    tables = {path.stem: json.loads(path.read_text()) for path in (root / "v1.0-synthroads").glob("*.json")}
    tokens = {name: {row["token"]: row for row in rows} for name, rows in tables.items()}
    for row in tables["sample_annotation"]:
        assert row["sample_token"] in tokens["sample"]
        assert row["instance_token"] in tokens["instance"]
        assert row["visibility_token"] in tokens["visibility"]
        for link, back in (("prev", "next"), ("next", "prev")):
            if row[link]:
                assert tokens["sample_annotation"][row[link]][back] == row["token"]
    tracks = {row["synthroads_instance_id"]: row for row in tables["instance"]}
    assert tracks[CAR]["nbr_annotations"] == 10
    counted = sum(
        row["num_lidar_pts"] for row in tables["sample_annotation"] if row["instance_token"] == tracks[CAR]["token"]
    )
    assert counted == np.count_nonzero(points.instance_id == CAR)
    data = tables["sample_data"][4]
    cloud = np.fromfile(root / data["filename"], "<f4").reshape(-1, 5)
    segmentation = next(row for row in tables["point_classes"] if row["sample_data_token"] == data["token"])
    classes = np.fromfile(root / segmentation["filename"], np.uint8)
    names = {row["index"]: row["name"] for row in tables["category"]}
    assert len(classes) == len(cloud)
    assert {names[value] for value in np.unique(classes)} <= {
        "road",
        "vehicle",
        "road_sign",
        "noise_barrier",
    }


def test_a_standing_box_is_the_smallest_in_plan() -> None:
    mesh = labelled([(cuboid((3.0, 1.0, 2.0), (5.0, 6.0, 1.0), 0.4), "road_sign", 5)])
    (body,) = standing_bodies(mesh, {class_id("road_sign")})
    assert np.allclose(body.size, (3.0, 1.0, 2.0), atol=1e-5)
    assert np.allclose(body.rotation @ body.centre, (5.0, 6.0, 1.0), atol=1e-5)
    assert np.arctan2(body.rotation[1, 0], body.rotation[0, 0]) == pytest.approx(0.4, abs=1e-5)
    assert list(standing_bodies(mesh, {class_id("vehicle")})) == []


def test_an_unknown_class_of_boxes_is_refused() -> None:
    scenario = load_scenario("rq31-600m-even", ["sweeps.box_classes=road_sign, vehicel"])
    with pytest.raises(InputError, match=r"sweeps\.box_classes.*vehicle"):
        box_classes(scenario, ScenarioInputs.read(scenario))
