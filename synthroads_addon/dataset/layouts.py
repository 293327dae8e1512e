"""The layouts that training code reads, written from a scene's cloud: Pointcept's and SemanticKITTI's.

Both cut the cloud into square tiles with coordinates relative to the tile's corner: they store 32-bit floats, which
hold map coordinates to half a metre only. Where a tile lies stands beside it.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from ..base.arrays import AnyArray, Float, Float32
from ..base.classes import UNLABELLED, ClassScheme
from ..base.errors import InputError
from ..base.schema import canonical_json
from ..cloud.formats.registry import open_cloud
from ..cloud.points import PointBlock
from ..cloud.tools.subsample import GridSubsampler
from .recipe import Layout, Recipe, SceneJob
from .tiles import Tile, TileSorter

_LARGEST_INSTANCE = 2**31 - 1
_FULL = 65535.0
"""Largest 16-bit intensity."""


def layout_root(folder: Path, layout: Layout, scheme: ClassScheme) -> Path:
    """Return the folder that a loader takes as its root: one for each scheme of classes, as ids differ."""
    return folder / layout / f"classes-{scheme.name}"


class LayoutWriter(ABC):
    """Base of writers of one scene's tiles in a layout for training.

    Args:
        folder: for the scene's folders.
        job: the scene.
        scheme: classes of its points.
        intensity_scale: 16-bit steps per unit of intensity.
    """

    def __init__(self, folder: Path, job: SceneJob, scheme: ClassScheme, intensity_scale: float) -> None:
        self.folder = folder
        self.job = job
        self.scheme = scheme
        self._scale = intensity_scale

    @abstractmethod
    def write(self, tile: Tile) -> None:
        """Write one tile's points and labels."""

    @abstractmethod
    def close(self) -> None:
        """Write what can only be known after all tiles."""

    def strength(self, points: PointBlock) -> Float32:
        """Return intensities (N,) from 0 to 1, float32: the 16 bits of the cloud's file as a share."""
        return np.clip(np.rint(points.intensity * self._scale) / _FULL, 0.0, 1.0).astype(np.float32)


class PointceptWriter(LayoutWriter):
    """Writes ``classes-N/SPLIT/SCENE-TILE/coord.npy`` and so on, as Pointcept's ``DefaultDataset`` loads them.

    coord float32 m, color uint8, strength float32 (N, 1) from 0 to 1, segment int32 (-1 ignored), instance int32 (-1
    none), normal float32 where the cloud has them. ``tile.json`` says where the tile lies.
    """

    def write(self, tile: Tile) -> None:
        """Write one tile's folder of arrays; InputError for instance numbers above 31 bits."""
        points = tile.points
        folder = layout_root(self.folder, "pointcept", self.scheme) / self.job.split / f"{self.job.name}-{tile.name}"
        folder.mkdir(parents=True)
        instance = points.instance_id.astype(np.int64)
        if instance.max(initial=0) > _LARGEST_INSTANCE:
            raise InputError("instance", int(instance.max()), f"Pointcept holds numbers up to {_LARGEST_INSTANCE}")
        arrays: dict[str, AnyArray] = {
            "coord": (points.xyz - tile.corner).astype(np.float32),
            "color": np.round(points.rgb / 257.0).astype(np.uint8),
            "strength": self.strength(points)[:, None],
            "segment": np.where(points.class_id == UNLABELLED, -1, points.class_id.astype(np.int32)),
            "instance": np.where(instance == 0, -1, instance).astype(np.int32),
        }
        if points.normal is not None:
            arrays["normal"] = points.normal
        for name, array in arrays.items():
            np.save(folder / f"{name}.npy", array, allow_pickle=False)
        (folder / "tile.json").write_text(_tile_text(self.job, tile), encoding="utf-8")

    def close(self) -> None:
        """Do nothing: all is written with the tiles."""


class SemanticKittiWriter(LayoutWriter):
    """Writes ``classes-N/sequences/NN/velodyne/000000.bin`` with labels, poses and calibration; a tile is a frame.

    x y z remission as float32; labels as uint32: the class in the lower 16 bits (its id + 1; 0 is unlabelled), the
    instance in the upper ones, numbered from 1 within the sequence (``instances.json`` has the set's own numbers).
    A pose shifts a frame into the sequence's own frame, whose map coordinates are in ``sequence.json``.
    """

    def __init__(self, folder: Path, job: SceneJob, scheme: ClassScheme, intensity_scale: float) -> None:
        super().__init__(folder, job, scheme, intensity_scale)
        self._sequence = layout_root(folder, "semantickitti", scheme) / "sequences" / f"{job.number:02d}"
        self._corners: list[Float] = []
        self._numbers: dict[int, int] = {}
        for name in ("velodyne", "labels"):
            (self._sequence / name).mkdir(parents=True)

    def write(self, tile: Tile) -> None:
        """Write one tile as the sequence's next frame: points and labels."""
        points, frame = tile.points, len(self._corners)
        values = np.empty((len(points), 4), dtype="<f4")
        values[:, :3] = points.xyz - tile.corner
        values[:, 3] = self.strength(points)
        values.tofile(self._sequence / "velodyne" / f"{frame:06d}.bin")
        instances, inverse = np.unique(points.instance_id, return_inverse=True)
        short_numbers = np.array([self._number(int(value)) for value in instances], dtype=np.uint32)[inverse]
        class_numbers = np.where(points.class_id == UNLABELLED, 0, points.class_id.astype(np.uint32) + 1)
        labels = class_numbers.astype("<u4") | (short_numbers.astype("<u4") << 16)
        labels.tofile(self._sequence / "labels" / f"{frame:06d}.label")
        self._corners.append(tile.corner)

    def close(self) -> None:
        """Write poses, times, calibration, the sequence's place and what its instance numbers stand for."""
        origin = self._corners[0] if self._corners else np.zeros(3)
        shifts = [(corner - origin).tolist() for corner in self._corners]
        poses = [f"1 0 0 {x!r} 0 1 0 {y!r} 0 0 1 {z!r}" for x, y, z in shifts]
        identity = "1 0 0 0 0 1 0 0 0 0 1 0"
        place = {"scene": self.job.name, "split": self.job.split, "origin": [float(value) for value in origin]}
        texts = {
            "poses.txt": "".join(f"{line}\n" for line in poses),
            "times.txt": "".join(f"{frame:.6e}\n" for frame in range(len(poses))),
            "calib.txt": "".join(f"{name}: {identity}\n" for name in ("P0", "P1", "P2", "P3", "Tr")),
            "sequence.json": canonical_json(place),
            "instances.json": canonical_json({str(number): value for value, number in self._numbers.items()}),
        }
        for name, text in texts.items():
            (self._sequence / name).write_text(text, encoding="utf-8", newline="\n")

    def _number(self, instance: int) -> int:
        """Return an instance's 16-bit number in the sequence, given on first use; 0 for none, and after 65,535."""
        if instance == 0:
            return 0
        if instance not in self._numbers and len(self._numbers) >= 0xFFFF:
            return 0
        return self._numbers.setdefault(instance, len(self._numbers) + 1)


WRITERS: dict[Layout, type[LayoutWriter]] = {"pointcept": PointceptWriter, "semantickitti": SemanticKittiWriter}


def write_layouts(cloud: Path, folder: Path, recipe: Recipe, job: SceneJob, origin: Float) -> None:
    """Write all layouts that a recipe asks for from one scene's cloud, in memory that doesn't grow with it.

    Args:
        cloud: the scene's cloud, of any format.
        folder: gets ``pointcept/`` and ``semantickitti/``.
        recipe: says which layouts, tiles and spacing.
        job: the scene.
        origin: (3,) map coordinates of a tile's corner, m.
    """
    if not recipe.layouts:
        return
    with open_cloud(cloud) as source, TileSorter(recipe.tile, origin, folder) as sorter:
        sorter.add(_thin_out(source.blocks(), recipe.point_spacing, folder))
        header = source.header
        writers = [WRITERS[name](folder, job, header.scheme, header.intensity_scale or 1.0) for name in recipe.layouts]
        for tile in sorter.tiles():
            if len(tile.points) >= recipe.smallest_tile:
                for writer in writers:
                    writer.write(tile)
        for writer in writers:
            writer.close()


def _thin_out(blocks: Iterator[PointBlock], spacing: float | None, folder: Path) -> Iterator[PointBlock]:
    """Yield the points of blocks, of which each cell of a grid of ``spacing`` (m) keeps one; all if it is None."""
    if spacing is None:
        yield from blocks
        return
    with GridSubsampler(spacing, folder) as grid:
        for block in blocks:
            grid.add(block)
        yield from grid.blocks()


def _tile_text(job: SceneJob, tile: Tile) -> str:
    """Return the JSON text that says where a tile lies, of which scene it is, and how many points it has."""
    data = {"scene": job.name, "origin": [float(value) for value in tile.corner], "points": len(tile.points)}
    return canonical_json(data)


def layout_descriptions(recipe: Recipe, jobs: Sequence[SceneJob]) -> dict[str, str]:
    """Return path -> text of the files that describe whole layouts: classes, and the scenes of each split."""
    texts: dict[str, str] = {}
    clouds = {job.scenario.cloud.classes: job.scenario.cloud for job in jobs}
    scheme_of_classes = {
        classes: cloud.scheme() for classes, cloud in clouds.items()
    }  # each file once, of however many scenes
    schemes = {scheme.name: scheme for scheme in (scheme_of_classes[job.scenario.cloud.classes] for job in jobs)}
    for layout, scheme in product(recipe.layouts, schemes.values()):
        root = layout_root(Path(), layout, scheme)
        if layout == "pointcept":
            names, ids = [row.name for row in scheme.rows], [row.id for row in scheme.rows]
            table = {"classes": names, "ids": ids, "ignore_index": -1}
            texts[f"{root.as_posix()}/classes.json"] = canonical_json(table)
        else:
            jobs_with_scheme = [
                job for job in jobs if scheme_of_classes[job.scenario.cloud.classes].name == scheme.name
            ]
            texts[f"{root.as_posix()}/synthroads.yaml"] = _kitti_configuration(scheme, jobs_with_scheme)
    return texts


def _kitti_configuration(scheme: ClassScheme, jobs: Sequence[SceneJob]) -> str:
    """Return the YAML text of a configuration like SemanticKITTI's: labels, color_map in BGR, learning maps, split."""
    import yaml  # only this layout has a YAML file: all others work without PyYAML

    ids = {row.id + 1: row for row in scheme.rows}
    order = {file_label: place for place, file_label in enumerate(sorted(ids), 1)}
    splits: dict[str, list[int]] = {"train": [], "valid": [], "test": []}
    for job in jobs:
        splits.setdefault({"validation": "valid", "val": "valid"}.get(job.split, job.split), []).append(job.number)
    data = {
        "labels": {0: "unlabeled", **{file_label: row.name for file_label, row in ids.items()}},
        "color_map": {0: [0, 0, 0], **{file_label: list(reversed(row.color)) for file_label, row in ids.items()}},
        "learning_map": {0: 0, **order},
        "learning_map_inv": {0: 0, **{place: file_label for file_label, place in order.items()}},
        "learning_ignore": {0: True, **dict.fromkeys(order.values(), False)},
        "split": splits,
    }
    return str(yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=120))
