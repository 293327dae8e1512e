"""`LearningRoad`: one cloud's ground points in the order in which they lie along the road, with the known truth."""

from __future__ import annotations

import hashlib
import json
import shutil
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from synthroads_addon.base.arrays import Bool, Float, Float32, Index
from synthroads_addon.base.errors import InputError, MissingFileError, OutputError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.base.scratch.folders import scratch_folder
from synthroads_addon.cloud.formats.npz import ARCHIVE_FAULTS
from synthroads_addon.cloud.formats.registry import ENDINGS
from synthroads_addon.dataset.manifest import checksum, read_manifest
from synthroads_addon.road.axes.measured_axis import MeasuredAxis
from synthroads_addon.road.parameters import read_parameters

from .corridor import Learned, Truth, truths
from .frames import Frames
from .points import GROUND_CLASSES, Points, read_ground, read_points

REACH = 45.0
"""Distance from the reference line beyond which points are dropped, m."""
CLOUD, PARAMETERS = "cloud.laz", "parameters.json"
STRIP = (6.0, 20.0)
"""Least and largest half width of strips that scans of road networks are cut into, m."""
AXIS_ENDINGS = ("_axis.csv", ".geojson")
"""Endings of the name of a cloud's axis, after the cloud's name."""
_MARGIN = 2.0
"""Stretch of stations before and behind a slice that may hold points of it, beyond what its corners say, m."""
_CACHED = {
    "xyz": ("f4", (3,)),
    "intensity": ("f4", ()),
    "rgb": ("u1", (3,)),
    "class_id": ("u1", ()),
    "station": ("f4", ()),
}
"""Arrays of a `LearningRoad`, with the type and the shape of a point's entry."""
_CACHE_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class LearningRoad(Points):
    """N points of a road and the ground beside it, sorted by station along a line, with the truth where known.

    Arrays may be mapped from files. Coordinates are float32 here (0.25 mm at 4 km), colours 8 bits of sRGB.

    Attributes:
        name: name of the road.
        station: (N,) float32 along ``reference``, m, ascending.
        reference: line along which the points are sorted.
        truth: centreline and corridor; None if unknown.
    """

    name: str
    station: Float32
    reference: MeasuredAxis
    truth: Truth | None = None
    per_point: ClassVar[tuple[str, ...]] = (*Points.per_point, "station")

    @property
    def known_truth(self) -> Truth:
        """Return the road's truth, never None.

        Raises:
            InputError: the road has no known truth.
        """
        if self.truth is None:
            raise InputError("road", self.name, "must have a known centreline to be measured on")
        return self.truth

    @classmethod
    def of_points(
        cls, name: str, points: Points, reference: MeasuredAxis, truth: Truth | None = None, reach: float = REACH
    ) -> LearningRoad:
        """Return the points within ``reach`` (m) of a line, sorted by station along it, as a road."""
        station, offset = reference.project(points.xyz)
        rows_near = np.flatnonzero(np.abs(offset) <= reach)
        order = rows_near[np.argsort(station[rows_near], kind="stable")]
        return cls(
            name=name,
            origin=points.origin,
            xyz=points.xyz[order].astype(np.float32),
            intensity=points.intensity[order],
            rgb=np.rint(255.0 * points.rgb[order]).astype(np.uint8),
            class_id=points.class_id[order],
            class_names=dict(points.class_names),
            has_color=points.has_color,
            station=station[order].astype(np.float32),
            reference=reference,
            truth=truth,
        )

    @cached_property
    def belonging(self) -> Bool:
        """Return the mask (N,) of the points within the truth's `room`, of a carriageway up to the median; cached."""
        if self.truth is None or not np.isfinite(self.truth.room).any():
            return np.ones(len(self), dtype=bool)
        station, offset = self.truth.axis.project(self.xyz)
        nearest_vertex = np.clip(np.searchsorted(self.truth.axis.station, station), 0, len(self.truth.room) - 1)
        room = self.truth.room[nearest_vertex]
        return np.asarray((offset <= room[:, 0]) & (-offset <= room[:, 1]))

    def slices(self, frames: Frames, half_width: float, thickness: float = 1.0) -> Slices:
        """Return the points in the slice across the road at each of M frames, with their places in it.

        A point is in a slice where it lies within half the thickness before or behind the frame's origin and within
        half_width (both m) beside it.
        """
        half_thickness = 0.5 * thickness
        forward = np.column_stack([np.cos(frames.direction), np.sin(frames.direction)])
        corners = [
            replace(frames, position=frames.position + x * forward).at(np.full(len(frames), y))
            for x in (-half_thickness, half_thickness)
            for y in (-half_width, half_width)
        ]
        stations = self.reference.project(np.concatenate(corners))[0].reshape(4, -1)
        first_points = np.searchsorted(self.station, stations.min(axis=0) - _MARGIN)
        end_points = np.searchsorted(self.station, stations.max(axis=0) + _MARGIN)
        index, local_points, counts = [], [], []
        for origin, direction, begin, end in zip(
            frames.position, frames.direction, first_points, end_points, strict=True
        ):
            delta = self.xyz[begin:end, :2] - origin
            cos, sin = np.cos(direction), np.sin(direction)
            x, y = cos * delta[:, 0] + sin * delta[:, 1], cos * delta[:, 1] - sin * delta[:, 0]
            rows = np.flatnonzero((np.abs(x) <= half_thickness) & (np.abs(y) <= half_width))
            index.append(begin + rows)
            local_points.append(np.column_stack([x[rows], y[rows]]))
            counts.append(len(rows))
        number = np.repeat(np.arange(len(frames)), counts)
        return Slices(np.concatenate(index), number, np.concatenate(local_points))


@dataclass(frozen=True)
class Slices:
    """Membership of points in slices, K pairs; one point may be in several slices.

    Attributes:
        index: (K,) of the point in its road.
        number: (K,) of the frame whose slice it is in, ascending.
        xy: (K, 2) place in that frame, m.
    """

    index: Index
    number: Index
    xy: Float


def scene_folders(data_set: Path, split: str | None) -> list[Path]:
    """Return the folders of a data set's finished scenes, of one split or of all (None).

    Raises:
        MissingFileError: there is no manifest.
        InputError: no scene of the split is finished.
    """
    finished_scenes = [scene for scene in read_manifest(data_set).scenes if scene.status == "done"]
    folders = [data_set / "scenes" / scene.name for scene in finished_scenes if split in (None, scene.split)]
    if not folders:
        splits = ", ".join(sorted({scene.split for scene in finished_scenes}))
        raise InputError(
            f"{data_set}: split", split, f"must be a split with finished scenes; the data set has {splits or 'none'}"
        )
    return folders


def read_scene(folder: Path, kind: Learned, cache: Path | None = None, keep: bool = True) -> list[LearningRoad]:
    """Read a data set's scene as roads: its ground points, with the truth of each road or carriageway of `kind`.

    Args:
        folder: folder of the scene, with ``cloud.laz`` and ``parameters.json``.
        kind: kind of truth. A road with carriageways of two lanes gives a `LearningRoad` for each of them with the kind
            ``carriageway``, perhaps none; with ``either`` the whole road, and each of them that has no shoulders. Names
            of several end with their number.
        cache: folder in which sorted points are kept, to be mapped into memory the next time; None for no cache.
        keep: whether points are written to the cache; if not, it is only read.

    Raises:
        MissingFileError, InputError: a file is missing or damaged.
    """
    for name in (PARAMETERS, CLOUD):
        if not (folder / name).is_file():
            raise MissingFileError(
                str(folder / name), None, "there is no such file, but each scene of a data set needs one"
            )
    parameters = read_parameters(folder / PARAMETERS)
    scene_road = _read_cache(folder, cache) if cache else None
    if scene_road is None:
        points = read_points(folder / CLOUD, GROUND_CLASSES)
        reference = truths(parameters, "road", points.origin)[0].axis
        scene_road = LearningRoad.of_points(folder.name, points, reference)
        if cache and keep:
            _write_cache(scene_road, folder, cache)
    road_truths = truths(parameters, kind, scene_road.origin)
    names = (
        [folder.name]
        if len(road_truths) == 1
        else [f"{folder.name}-{number + 1}" for number in range(len(road_truths))]
    )
    return [replace(scene_road, name=name, truth=truth) for name, truth in zip(names, road_truths, strict=True)]


def axis_beside(cloud: Path) -> Path:
    """Return the file with a cloud's axis that lies beside it.

    Raises:
        MissingFileError: there is no such cloud, or no axis beside it.
    """
    if not cloud.exists():
        raise MissingFileError(str(cloud), None, "must be a cloud, or the folder of a data set; there is no such file")
    candidates = [cloud.with_name(cloud.stem + ending) for ending in AXIS_ENDINGS]
    axis_file = next((path for path in candidates if path.is_file()), None)
    if axis_file is None:
        names = " or ".join(path.name for path in candidates)
        raise MissingFileError(str(cloud), None, f"needs its axis in the same folder, {names}")
    return axis_file


def clouds_with_axes(folder: Path) -> list[Path]:
    """Return a folder's clouds that have an axis beside them, by name; other files in it don't matter.

    Raises:
        MissingFileError: the folder holds no such cloud.
    """
    clouds = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS and path.is_file())
    clouds_with_axis = [
        path for path in clouds if any(path.with_name(path.stem + end).is_file() for end in AXIS_ENDINGS)
    ]
    if not clouds_with_axis:
        fault = f"must hold a cloud and its axis, NAME{' or NAME'.join(AXIS_ENDINGS)}"
        raise MissingFileError(str(folder), None, fault)
    return clouds_with_axis


def read_measured(cloud: Path, axis: Path, kind: Learned, gap: float | None = None) -> LearningRoad:
    """Read a real cloud's ground points as a road whose truth is a measured axis in the same map coordinates.

    Args:
        cloud: the cloud.
        axis: CSV with columns x, y, z (``s`` and others aren't used) or GeoJSON.
        kind: road or carriageway whose middle the axis is; ``either`` counts as a whole road.
        gap: see `MeasuredAxis.read`.

    Raises:
        MissingFileError, InputError: a file is missing or damaged.
    """
    points = read_ground(cloud)
    line = MeasuredAxis.read(axis, gap, points.place).translate(-points.origin)
    truth = Truth.of_axis(line, "carriageway" if kind == "carriageway" else "road")
    return LearningRoad.of_points(cloud.stem, points, line, truth)


def crop_road(road: LearningRoad, share: float, seed: int, length: float = 1.0) -> LearningRoad:
    """Return a road with both sides of every slice cropped at random, each by itself, around the true axis.

    Slices are each metre (``length``) of the station along the truth's axis. On either side of the axis a slice reaches
    to the point farthest from it, at the distance R; points farther than R (1 - ``share`` u) are left out, u uniform
    from 0 to 1, drawn for the slice and the side from the seed and the road's name. So the axis stays inside what is
    left, but may lie anywhere from (1 - share) / (2 - share) of its width on, where both sides reached as far.

    Args:
        road: road with a known truth, from whose axis the sides are measured.
        share: largest part of R that is cut off, below 1.
        seed: seed of the cuts.
        length: length along the axis that shares its cuts, m; cuts of single slices average out over many.

    Raises:
        InputError: the road has no truth, or the share is out of its limits.
    """
    if road.truth is None or not 0.0 <= share < 1.0:
        raise InputError("crop", share, "must be a share from 0 to below 1, and the road must have a known centreline")
    station, offset = road.truth.axis.project(road.xyz)
    number = np.floor((station - station.min()) / length).astype(np.intp)
    shares = share * stream(seed, "crop", road.name).random((int(number.max()) + 1, 2))
    keep = np.ones(len(road), dtype=bool)
    for side, sign in enumerate((1.0, -1.0)):
        reach = np.zeros(len(shares))
        np.maximum.at(reach, number, sign * offset)
        keep &= sign * offset <= (reach * (1.0 - shares[:, side]))[number]
    return road.select(keep)


def cut_strip(road: LearningRoad, seed: int) -> LearningRoad:
    """Return a road's points within a distance of its true axis that is drawn from the seed and the road's name.

    The distance lies in `STRIP`, all ratios as likely. A road without a known truth stays as it is.
    """
    if road.truth is None:
        return road
    log_least, log_largest = np.log(STRIP)
    reach = float(np.exp(stream(seed, "strip", road.name).uniform(log_least, log_largest)))
    _, offset = road.truth.axis.project(road.xyz)
    return road.select(np.abs(offset) <= reach)


def cut_beside_median(road: LearningRoad, error: float, rng: np.random.Generator) -> LearningRoad:
    """Return the road with its truth's `room` shifted by a random distance up to `error` (m); points stay.

    Thus the place where the other carriageway is cut off doesn't reveal the place of this one.

    Args:
        road: road with a truth; only a carriageway's room is finite and changes.
        error: largest distance of the cut from the middle of the median, m.
        rng: random stream of the uniform shift.
    """
    shift = rng.uniform(-error, error)
    return road if road.truth is None else replace(road, truth=replace(road.truth, room=road.truth.room + shift))


def _cache_folder(folder: Path, cache: Path) -> Path:
    """Return the cache folder of a scene's sorted points, named by a hash of the files they were made from."""
    made_from = f"{_CACHE_VERSION} {REACH} {checksum(folder / CLOUD)} {checksum(folder / PARAMETERS)}"
    return cache / f"{folder.name}-{hashlib.sha256(made_from.encode()).hexdigest()[:16]}"


def _write_cache(road: LearningRoad, folder: Path, cache: Path) -> None:
    """Write a road's arrays to its folder in the cache, replacing damaged ones, atomically.

    Raises:
        OutputError: the cache can't be written.
    """
    cache_folder = _cache_folder(folder, cache)
    notes = {"origin": road.origin.tolist(), "classes": road.class_names, "has_color": road.has_color}
    try:
        cache.mkdir(parents=True, exist_ok=True)
        with scratch_folder(cache) as scratch:
            new_folder = scratch / cache_folder.name
            new_folder.mkdir()
            for array in _CACHED:
                np.save(new_folder / f"{array}.npy", getattr(road, array))
            np.save(new_folder / "reference.npy", road.reference.points)
            (new_folder / "notes.json").write_text(json.dumps(notes), encoding="utf-8")
            shutil.rmtree(cache_folder, ignore_errors=True)
            with suppress(OSError):  # another training has just kept the same
                new_folder.replace(cache_folder)
    except OSError as error:
        raise OutputError("data.cache", str(cache), f"cannot be written ({error.strerror})") from None


def _read_cache(folder: Path, cache: Path) -> LearningRoad | None:
    """Return a scene's road from the cache, arrays memory-mapped; None if it isn't there or damaged."""
    cache_folder = _cache_folder(folder, cache)
    try:
        notes = json.loads((cache_folder / "notes.json").read_text(encoding="utf-8"))
        arrays = {name: np.load(cache_folder / f"{name}.npy", mmap_mode="r") for name in _CACHED}
        count = len(arrays["xyz"])
        if any(
            arrays[name].dtype != type_and_shape[0] or arrays[name].shape != (count, *type_and_shape[1])
            for name, type_and_shape in _CACHED.items()
        ):
            return None
        return LearningRoad(
            name=folder.name,
            origin=np.array(notes["origin"], dtype=np.float64).reshape(3),
            class_names={int(number): str(name) for number, name in notes["classes"].items()},
            has_color=bool(notes["has_color"]),
            reference=MeasuredAxis(np.load(cache_folder / "reference.npy")),
            **arrays,
        )
    except (*ARCHIVE_FAULTS, TypeError, AttributeError, InputError):
        return None
