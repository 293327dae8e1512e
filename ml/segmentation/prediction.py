"""Classes for a LAS or LAZ file of any size: read twice, labelled tile by tile between, written with all it held.

First pass: points go into square tiles on disk, but for those that are withheld or noise. Then each tile is labelled,
seeing what lies around it. Second pass: the file is copied record by record, with the class as one more attribute.
Memory holds a tile and its surroundings.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np

from synthroads_addon.base.arrays import AnyArray, Bool, Float, Int, UInt8
from synthroads_addon.base.classes import UNLABELLED, ClassScheme
from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.base.files import check_file_target, sync_file, writable_folder
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import compact_json
from synthroads_addon.base.scratch.folders import scratch_folder
from synthroads_addon.cloud.formats.las import OWN, PREDICTED_CLASSES, open_to_copy
from synthroads_addon.cloud.formats.reader import damage_error
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.layers import PREDICTED
from synthroads_addon.cloud.tools.quantile_mapping import LEVELS

from ..data.classes import IGNORED
from ..data.crops import CropSettings
from ..data.points import voxel_sample
from ..data.sources import FULL
from ..data.tiles import CloudTile, Scaling, eight_bits
from .scoring import Classifier, label_tile

HEADER_TEXTS = range(26, 90)
"""Bytes of a LAS file that hold the system identifier and the generating software, of 32 each."""
BLOCK = 500_000
"""Points that are read or written at once. Chosen: bounds memory."""
TILE = 48.0
"""Edge of the tiles, m. Chosen: two pieces along each edge."""
MARGIN = 6.0
"""Width that a tile sees of the tiles around it, m: at least that of the pieces within."""
_RECORD = np.dtype([("place", "<f4", 3), ("rgb", "<u2", 3), ("intensity", "<u2"), ("index", "<i8")])
"""Fields of a point in a tile's file."""

_COPC = "copc"
"""User id of the records of cloud-optimised files."""


@dataclass(frozen=True)
class Labelling:
    """A trained classifier with the settings by which it labels points.

    Attributes:
        classifier: function that returns the scores of a batch.
        settings: voxel, features and votes.
        scheme: scheme of the classes.
        intensity: scaling of intensities, ``share`` or ``robust``, as in training.
    """

    classifier: Classifier
    settings: CropSettings
    scheme: ClassScheme
    intensity: str


def predict_file(
    source: Path,
    target: Path,
    labelling: Labelling,
    *,
    classification: bool = False,
    overwrite: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Write a copy of a LAS or LAZ file with a class for its points; return counts, seconds and points per second.

    Every attribute, record and header entry stays as it is. The class's id of the scheme is written to the attribute
    ``predicted_class``, which is added unless the file has it from an earlier run; it is 255 of points that are
    withheld or noise, which aren't labelled.

    Args:
        source, target: ending in .las or .laz; the target appears when it is whole.
        labelling: classifier that labels the points, with its settings.
        classification: write the classes' LAS codes to the standard field ``classification`` too.
        overwrite: whether the target may be replaced.
        progress: called with the stage and its share.

    Raises:
        MissingFileError: there is no such file.
        InputError: it is no LAS file, damaged, empty, or all of its points are withheld or noise.
        OutputError: the target is there already or can't be written.
    """
    _check(source, target, overwrite, labelling.scheme, classification)
    start_time = time.perf_counter()
    with writable_folder(target.parent, shown_path=target), scratch_folder(target.parent) as folder:
        store = TileStore(folder)
        count = store.fill(source, progress)
        if not store.count:
            raise InputError(str(source), None, "has no points that can be labelled: all are withheld or noise")
        labels = np.memmap(folder / "labels", dtype=np.uint8, mode="w+", shape=(count,))
        labels[:] = UNLABELLED
        scaling = store.scaling(labelling.intensity, labelling.settings.voxel)
        labelled_count = 0
        for tile, core, index in store.tiles():
            labels[index] = label_tile(tile, scaling, labelling.classifier, labelling.settings, core)
            labelled_count += len(index)
            progress("labelling", labelled_count / store.count)
        counts = write_copy(source, target, labels, labelling.scheme, classification, progress)
        del labels
    seconds = time.perf_counter() - start_time
    names = [row.name for row in labelling.scheme.rows]
    return {
        "attribute": PREDICTED,
        "points": count,
        "left_out": count - store.count,
        "seconds": round(seconds, 3),
        "points_per_second": round(count / seconds),
        "classes": dict(zip(names, counts.tolist(), strict=True)),
    }


def _check(source: Path, target: Path, overwrite: bool, scheme: ClassScheme, classification: bool) -> None:
    """Raise `InputError` or `OutputError` if source or target can't be used."""
    for path, field in ((source, "cloud"), (target, "--output")):
        if path.suffix.lower() not in (".las", ".laz"):
            raise InputError(field, str(path), "must end in .las or .laz")
    check_file_target(target, overwrite=overwrite)
    with open_cloud(source) as cloud:
        if cloud.header.count == 0:
            raise InputError(str(source), None, "has no points")
    with open_to_copy(source) as reader:
        extended_header(reader.header, scheme, classification)


class TileStore:
    """A cloud sorted into square tiles on disk.

    Args:
        folder: folder for the tiles' files.
        edge: edge of a tile, m.

    Attributes:
        count: number of points in the tiles.
    """

    def __init__(self, folder: Path, edge: float = TILE) -> None:
        self._folder, self._edge = folder / "tiles", edge
        self._folder.mkdir()
        self.count = 0
        self._written_tiles: set[tuple[int, int]] = set()
        self._has_intensity = False
        self._colored = False

    def fill(self, source: Path, progress: Progress) -> int:
        """Sort a cloud's usable points into the tiles' files; return the number of all its points."""
        read_count = 0
        with open_cloud(source) as cloud:
            self._origin = np.floor(np.asarray(cloud.header.offset, dtype=np.float64))
            scale = cloud.header.intensity_scale or 1.0
            for file_block in cloud.blocks(BLOCK):
                is_usable = cloud.usable_points(file_block)
                index = read_count + np.flatnonzero(is_usable)
                read_count += len(file_block)
                progress("reading", read_count / cloud.header.count)
                if not len(index):
                    continue
                block = file_block.select(is_usable)
                if self.count == 0:
                    self._origin = np.floor(block.xyz.min(axis=0))
                record = np.empty(len(block), dtype=_RECORD)
                tile = np.floor((block.xyz[:, :2] - self._origin[:2]) / self._edge).astype(np.int64)
                record["place"] = block.xyz - self._corner(tile)
                record["rgb"] = block.rgb
                record["intensity"] = np.clip(np.rint(block.intensity * scale), 0, LEVELS - 1)
                record["index"] = index
                self._has_intensity |= bool(record["intensity"].any())
                self._colored |= bool(block.rgb.any())
                self._append(tile, record)
                self.count += len(block)
        return read_count

    def scaling(self, kind: str, voxel: float) -> Scaling:
        """Return the scaling of the cloud's intensities, ``share`` or ``robust`` over one point per voxel (m)."""
        if kind == "share" or not self._has_intensity:
            return Scaling()
        histogram = np.zeros(LEVELS, dtype=np.int64)
        for row, column in self._written_tiles:
            record = np.fromfile(self._folder / f"{row}_{column}", dtype=_RECORD)
            histogram += np.bincount(record["intensity"][voxel_sample(record["place"], voxel)], minlength=LEVELS)
        share = np.cumsum(histogram) / histogram.sum()
        lower_decile, median, upper_decile = (
            int(np.searchsorted(share, cumulative_share)) / FULL for cumulative_share in (0.1, 0.5, 0.9)
        )
        return Scaling(median, upper_decile - lower_decile if upper_decile > lower_decile else 1.0)

    def tiles(self) -> Iterator[tuple[CloudTile, Bool, Int]]:
        """Yield each tile with its margin, the mask of the points within the tile, and their indices in the file."""
        for row, column in sorted(self._written_tiles):
            parts, cores = [], []
            for north in (-1, 0, 1):
                for east in (-1, 0, 1):
                    record = self._near(row + north, column + east, north, east)
                    parts.append(record)
                    cores.append(np.full(len(record), north == 0 and east == 0))
            record, core = np.concatenate(parts), np.concatenate(cores)
            strength = (record["intensity"] / np.float32(FULL)).astype(np.float32)
            tile = CloudTile(
                "",
                self._corner(np.array([[column, row]]))[0],
                np.ascontiguousarray(record["place"]),
                eight_bits(record["rgb"]) if self._colored else None,
                strength if self._has_intensity else None,
                np.full(len(record), IGNORED, dtype=np.int16),
            )
            yield tile, core, record["index"][core]

    def _near(self, row: int, column: int, north: int, east: int) -> AnyArray:
        """Return a tile's points within `MARGIN` of a neighbouring tile, in that one's coordinates.

        Args:
            row, column: place of the tile.
            north, east: rows and columns by which it lies north and east of the neighbour, -1 to 1.
        """
        if (row, column) not in self._written_tiles:
            return np.empty(0, dtype=_RECORD)
        record = np.fromfile(self._folder / f"{row}_{column}", dtype=_RECORD)
        record["place"][:, 0] += np.float32(east * self._edge)
        record["place"][:, 1] += np.float32(north * self._edge)
        plan = record["place"][:, :2]
        if north == 0 and east == 0:
            return record
        margin_points: AnyArray = record[np.all((plan >= -MARGIN) & (plan < self._edge + MARGIN), axis=1)]
        return margin_points

    def _corner(self, tile: Int) -> Float:
        """Return the map coordinates (N, 3) of the corners of tiles (N, 2): column and row."""
        plan = self._origin[:2] + tile * self._edge
        return np.concatenate([plan, np.full((len(tile), 1), self._origin[2])], axis=1)

    def _append(self, tile: Int, record: AnyArray) -> None:
        """Append records (N,) to the files of their tiles (N, 2: column, row)."""
        order = np.lexsort(tile.T)
        tile, record = tile[order], record[order]
        starts = np.flatnonzero(np.r_[True, np.any(tile[1:] != tile[:-1], axis=1)])
        for begin, end in zip(starts, np.r_[starts[1:], len(tile)], strict=True):
            column, row = int(tile[begin, 0]), int(tile[begin, 1])
            self._written_tiles.add((row, column))
            with (self._folder / f"{row}_{column}").open("ab") as file:
                file.write(record[begin:end].tobytes())


def write_copy(
    source: Path, target: Path, labels: UInt8, scheme: ClassScheme, classification: bool, progress: Progress
) -> Int:
    """Copy a LAS file with the predicted classes as one more attribute; return the number of points per class (C,).

    Args:
        source, target: files.
        labels: (N,) places of the classes, in the file's order; `UNLABELLED` of points that keep what they have.
        scheme: the C classes.
        classification: write their LAS codes to ``classification`` too.
        progress: told the share that is written.
    """
    ids = np.full(256, UNLABELLED, dtype=np.uint8)
    ids[: len(scheme.rows)] = [row.id for row in scheme.rows]
    codes = scheme if classification else None
    counts = np.zeros(256, dtype=np.int64)
    try:
        with ExitStack() as stack:
            temporary = stack.enter_context(scratch_folder(target.parent)) / target.name
            reader = stack.enter_context(open_to_copy(source))
            header = extended_header(reader.header, scheme, classification)
            compress = target.suffix.lower() == ".laz"
            with laspy.open(temporary, "w", header=header, do_compress=compress) as writer:
                written_count = 0
                for source_points in reader.chunk_iterator(BLOCK):
                    class_indices = np.asarray(labels[written_count : written_count + len(source_points)])
                    writer.write_points(extended_record(source_points, header, ids[class_indices], codes))
                    counts += np.bincount(class_indices, minlength=256)
                    written_count += len(source_points)
                    progress("writing", written_count / reader.header.point_count)
                if written_count != len(labels):
                    raise damage_error(source, written_count, len(labels))
                if extended_records := [record for record in reader.evlrs or () if record.user_id != _COPC]:
                    writer.write_evlrs(type(reader.evlrs)(extended_records))
            copy_header_texts(source, temporary)
            sync_file(temporary)
            temporary.replace(target)
    except UnicodeError:
        raise InputError(str(source), None, "has records whose names aren't ASCII, which LAS doesn't allow") from None
    except OSError as error:
        raise OutputError("--output", str(target), f"cannot be written ({error.strerror})") from None
    return counts[: len(scheme.rows)]


def copy_header_texts(source: Path, target: Path) -> None:
    """Copy a LAS file's system identifier and generating software byte by byte into another, in place."""
    with source.open("rb") as source_file, target.open("r+b") as target_file:
        source_file.seek(HEADER_TEXTS.start)
        target_file.seek(HEADER_TEXTS.start)
        target_file.write(source_file.read(len(HEADER_TEXTS)))


def extended_header(source_header: laspy.LasHeader, scheme: ClassScheme, needs_codes: bool) -> laspy.LasHeader:
    """Return a copy of a LAS header with the predicted-class attribute, without COPC records and identifier texts.

    One of its variable-length records names the scheme's classes, in place of one from an earlier run.

    Raises:
        InputError: LAS codes are wanted, and the file's point format holds those up to 31 only.
    """
    header = deepcopy(source_header)
    # An index of the points as they were ordered and compressed in a COPC file; the copy is a plain LAZ file.
    dropped_records = (_COPC, None), (OWN, PREDICTED_CLASSES)
    kept_records = (v for v in header.vlrs if not {(v.user_id, None), (v.user_id, v.record_id)} & set(dropped_records))
    header.vlrs = type(header.vlrs)(kept_records)
    names = compact_json(scheme.to_dict()).encode()
    header.vlrs.append(laspy.VLR(OWN, PREDICTED_CLASSES, "predicted classes", names))
    # laspy gives bytes where they aren't ASCII, and doesn't take them back.
    header.system_identifier = header.generating_software = ""
    if needs_codes and header.point_format.id < 6:
        raise InputError(
            "--classification", header.point_format.id, "needs a point format of 6 or more: older ones end at code 31"
        )
    if PREDICTED not in header.point_format.dimension_names:
        header.add_extra_dim(laspy.ExtraBytesParams(PREDICTED, "uint8", "predicted class"))
    return header


def extended_record(
    source_points: Any, header: laspy.LasHeader, ids: UInt8, codes: ClassScheme | None
) -> laspy.ScaleAwarePointRecord:
    """Return a copy of LAS points with predicted class ids, all else bit for bit.

    With `codes`, points that aren't `UNLABELLED` have the LAS codes of these classes too.
    """
    record = laspy.ScaleAwarePointRecord.zeros(len(source_points), header=header)
    for name in source_points.array.dtype.names:
        record.array[name] = source_points.array[name]
    record.array[PREDICTED] = ids
    if codes is not None:
        has_label = ids != UNLABELLED
        record.array["classification"][has_label] = codes.las_codes()[ids[has_label]]
    return record
