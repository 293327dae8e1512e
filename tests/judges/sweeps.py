"""Sweeps with boxes, judged by readers of others: nuScenes and KITTI, SemanticKITTI, OpenLABEL."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module, metadata
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from synthroads_addon.cloud.sweeps.nuscenes import VERSION
from synthroads_addon.cloud.sweeps.sweep import Box, Sweep
from tests.helpers.clouds.sweeps import CAR, sweeps
from tests.judges import bringing
from tests.judges.samples import Samples

PACKAGES = {
    "nuscenes-devkit": ("nuscenes-devkit==1.2.0", "opencv-python-headless==5.0.0.93", "cachetools==8.0.2", "tqdm"),
    "pykitti": ("pykitti==0.3.1",),
    "vcd": ("vcd==6.0.3",),
}
"""Packages that are installed of each judge, without what it requires besides: the tests' environment has the rest."""
_STEP = 5e-4
"""Half a step of numbers in KITTI's labels and points in single precision, m, with some room."""


def folder(name: str) -> Path:
    """Return the folder that a judge is installed into."""
    return bringing.BUILD / name


def version_of(name: str) -> Callable[[], str | None]:
    """Return a function that returns a judge's version; None if it isn't here."""

    def version() -> str | None:
        found = metadata.distributions(name=name, path=[str(folder(name))])
        return next((item.version for item in found), None)

    return version


def bring(name: str) -> Callable[[], None]:
    """Return a function that downloads a judge."""

    def install() -> None:
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
        bringing.install(folder(name), [*pip, "--target", "{}", *PACKAGES[name]])

    return install


@contextmanager
def modules(name: str, *wanted: str) -> Iterator[list[Any]]:
    """Context with modules of a judge, which are forgotten afterwards."""
    before, path = set(sys.modules), str(folder(name))
    sys.path.insert(0, path)
    try:
        yield [import_module(module) for module in wanted]
    finally:
        sys.path.remove(path)
        for module in set(sys.modules) - before:
            if str(getattr(sys.modules[module], "__file__", "") or "").startswith(path):
                del sys.modules[module]


def _written() -> list[Sweep]:
    return sweeps()


def _car(sweep: Sweep) -> Box:
    return next(box for box in sweep.boxes if box.instance == CAR)


def nuscenes_verdict(samples: Samples) -> list[str]:
    """Return what the reader of nuScenes takes differently, of its tables and of KITTI's files."""
    found: list[str] = []
    names = ("nuscenes.nuscenes", "nuscenes.utils.data_classes", "nuscenes.utils.kitti")
    with modules("nuscenes-devkit", *names) as (nuscenes, classes, kitti):
        root = samples.file(f"nuscenes/{VERSION}/sample.json").parents[1]
        try:
            reader = nuscenes.NuScenes(version=VERSION, dataroot=str(root), verbose=False)
        except (KeyError, AssertionError) as fault:
            return [f"nuScenes: {fault!r}"]
        token = reader.scene[0]["first_sample_token"]
        for sweep in _written():
            sample = reader.get("sample", token)
            path, boxes, _ = reader.get_sample_data(sample["data"]["LIDAR_TOP"])
            points = classes.LidarPointCloud.from_file(path).points[:3].T
            if not np.array_equal(points, sweep.xyz):
                found.append(f"nuScenes: points of sweep {sweep.number} differ")
            car = next(box for box in boxes if box.name == "vehicle.car")
            centre, rotation = sweep.in_frame(_car(sweep))
            width, length, height = car.wlh
            if np.abs(car.center - centre).max() > _STEP or not np.allclose(car.rotation_matrix, rotation, atol=1e-6):
                found.append(f"nuScenes: the car of sweep {sweep.number} lies elsewhere")
            if not np.allclose([length, width, height], _car(sweep).size):
                found.append(f"nuScenes: the car of sweep {sweep.number} has another size")
            speed = np.linalg.norm(reader.box_velocity(car.token))
            inside = classes.Box(car.center, car.wlh, car.orientation)
            held = _points_in(inside, points)
            if held < reader.get("sample_annotation", car.token)["num_lidar_pts"]:
                found.append(f"nuScenes: {held} points in the car of sweep {sweep.number}")
            if not np.isfinite(speed):
                found.append(f"nuScenes: the car of sweep {sweep.number} has no track")
            token = sample["next"]
        if token:
            found.append("nuScenes: more samples than sweeps")
        found += _kitti_faults(samples, kitti)
    return found


def _points_in(box: Any, points: np.ndarray) -> int:
    """Return the number of points (N, 3) in a box of nuScenes', with a millimetre to spare."""
    local = np.abs((points - box.center) @ box.rotation_matrix)
    return int(np.all(local <= np.array(box.wlh)[[1, 0, 2]] / 2.0 + 1e-3, axis=1).sum())


def _kitti_faults(samples: Samples, kitti: Any) -> list[str]:
    """Return what nuScenes' reader of KITTI takes differently."""
    root = samples.file("kitti/ImageSets/train.txt").parents[1]
    images = root / "training" / "image_2"  # it lists the samples by their images
    images.mkdir(exist_ok=True)
    for name in (root / "ImageSets" / "train.txt").read_text().split():
        (images / f"{name}.png").touch()
    reader = kitti.KittiDB(root=str(root), splits=("training",))
    found = []
    for token, sweep in zip(reader.tokens, _written(), strict=True):
        points = reader.get_pointcloud(token, root=str(root)).points
        if not np.array_equal(points[:3].T, sweep.xyz) or not np.array_equal(points[3], sweep.remission):
            found.append(f"KITTI: points of {token} differ")
        cars = [box for box in reader.get_boxes(token) if box.name == "Car"]
        centre, _ = sweep.in_frame(_car(sweep))
        for car in cars:
            car.rotate(reader.kitti_to_nu_lidar_inv)
            if np.abs(car.center - centre).max() > _STEP:
                found.append(f"KITTI: the car of {token} lies elsewhere")
            if _points_in(car, points[:3].T) < _car(sweep).points:
                found.append(f"KITTI: the car of {token} doesn't hold its points")
        if len(cars) != 1:
            found.append(f"KITTI: {len(cars)} cars in {token}")
    return found


def with_a_turned_car(samples: Samples) -> Samples:
    """Return files in which a box of nuScenes is turned."""
    name = f"nuscenes/{VERSION}/sample_annotation.json"
    rows = json.loads(samples.text(name))
    rows[0]["rotation"] = [0.0, 1.0, 0.0, 0.0]
    return samples.with_file(name, json.dumps(rows).encode())


def pykitti_verdict(samples: Samples) -> list[str]:
    """Return what pykitti reads differently of SemanticKITTI's files."""
    sequence = samples.file("semantickitti/sequences/00/poses.txt").parent
    root = sequence.parents[1]
    (root / "poses").mkdir(exist_ok=True)  # where KITTI's odometry benchmark has them
    (root / "poses" / "00.txt").write_bytes((sequence / "poses.txt").read_bytes())
    # The reader of the odometry benchmark alone: that of another one needs pandas and OpenCV.
    package = ModuleType("pykitti")
    package.__path__ = [str(folder("pykitti") / "pykitti")]
    sys.modules["pykitti"] = package
    try:
        data = import_module("pykitti.odometry").odometry(str(root), "00")
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] == "pykitti"]:
            del sys.modules[name]
    to_camera = data.calib.T_cam0_velo
    found = []
    first = _written()[0]
    for sweep, pose, velodyne, time in zip(_written(), data.poses, data.velo, data.timestamps, strict=True):
        if not np.array_equal(velodyne[:, :3], sweep.xyz) or not np.array_equal(velodyne[:, 3], sweep.remission):
            found.append(f"points of sweep {sweep.number} differ")
        moved = np.linalg.inv(to_camera) @ pose @ to_camera
        wanted = first.rotation.T @ (sweep.position - first.position)
        if np.abs(moved[:3, 3] - wanted).max() > 1e-6:
            found.append(f"sweep {sweep.number} is {np.abs(moved[:3, 3] - wanted).max():.3g} m off")
        if not np.allclose(moved[:3, :3], first.rotation.T @ sweep.rotation, atol=1e-9):
            found.append(f"sweep {sweep.number} is turned")
        if abs(time.total_seconds() - (sweep.time - first.time)) > 1e-6:
            found.append(f"sweep {sweep.number} has another time")
    return found


def with_another_pose(samples: Samples) -> Samples:
    """Return files in which a pose of SemanticKITTI is a metre off."""
    name = "semantickitti/sequences/00/poses.txt"
    lines = samples.text(name).splitlines()
    words = lines[2].split()
    words[3] = str(float(words[3]) + 1.0)
    return samples.with_file(name, "\n".join([*lines[:2], " ".join(words), *lines[3:]]).encode())


def openlabel_verdict(samples: Samples) -> list[str]:
    """Return what contradicts the JSON schema of OpenLABEL 1.0, or what its own toolkit reads differently."""
    from jsonschema import Draft7Validator

    data = json.loads(samples.text("openlabel.json"))
    # The module of the schema alone: the toolkit's others draw pictures.
    source = (folder("vcd") / "vcd" / "schema.py").read_text(encoding="utf-8")
    scope: dict[str, Any] = {}
    exec(compile(source, "schema.py", "exec"), scope)
    validator = Draft7Validator(scope["openlabel_schema"])
    found = [f"{list(fault.absolute_path)}: {fault.message[:200]}" for fault in validator.iter_errors(data)]
    frames = data["openlabel"]["frames"]
    if len(frames) != len(_written()):
        found.append(f"{len(frames)} frames")
    return found


def with_an_empty_cuboid(samples: Samples) -> Samples:
    """Return files in which a cuboid of OpenLABEL has no numbers."""
    data = json.loads(samples.text("openlabel.json"))
    objects = data["openlabel"]["frames"]["1"]["objects"]
    objects[str(CAR)]["object_data"]["cuboid"][0].pop("val")
    return samples.with_file("openlabel.json", json.dumps(data).encode())
