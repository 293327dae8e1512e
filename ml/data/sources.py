"""Where labelled points come from: packed files, data sets in Pointcept's layout, and clouds of any kind."""

import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from synthroads_addon.base.arrays import AnyArray, Bool, Float
from synthroads_addon.base.classes import UNLABELLED, ClassScheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import files_below
from synthroads_addon.base.schema import quantity, read_json
from synthroads_addon.cloud.flags import without_flags
from synthroads_addon.cloud.formats.npz import ARCHIVE_FAULTS
from synthroads_addon.cloud.formats.reader import BLOCK, CloudReader
from synthroads_addon.cloud.formats.registry import ENDINGS, open_cloud
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.cloud.tools.quantile_mapping import levels, steps_per_unit
from synthroads_addon.dataset.tiles import TileSorter
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from ..configuration import Part
from .classes import IGNORED, LabelMapping, class_names, load_mapping, table_between
from .packed import PackReader
from .points import voxel_sample
from .tiles import CloudTile, eight_bits
from .yardsticks import load_yardstick, numbered_blocks

FULL = 65535.0
"""Largest 16-bit intensity."""
_PAST = 1.0
"""Distance past an end or a gap of an axis to which offsets count, m: axes are given about every metre."""


class Source(Part):
    """Where labelled points are read from, with their class mapping and tiling."""

    path: str = Field(min_length=1, description="A packed file, a data set, a folder of tiles or clouds, or a cloud.")
    split: str | None = Field(
        None, description="Split of a data set, or sub-folder; if not given, all points are used."
    )
    mapping: str | None = Field(
        None, description="Mapping of the classes of other people's clouds: a built-in mapping or a JSON file."
    )
    yardstick: str | None = Field(
        None, description="Public data set in the folder: a built-in description or a JSON file."
    )
    tile: float = quantity(60.0, ge=5, le=1000, unit="m", description="Edge of the tiles that clouds are cut into.")

    def label_mapping(self) -> LabelMapping | None:
        """Load the source's class mapping; None where its files name their classes themselves."""
        if self.yardstick:
            return load_yardstick(self.yardstick).mapping_in(Path(self.path))
        return load_mapping(self.mapping) if self.mapping else None

    def targets(self, scheme: ClassScheme) -> tuple[str, ...]:
        """Return the names of the classes, or the mapping's groups, that the source's truth distinguishes, in order."""
        mapping, names = self.label_mapping(), class_names(scheme)
        return mapping.targets(names) if mapping else names


def read_tiles(source: Source, scheme: ClassScheme, voxel: float | None, *, labels: bool = True) -> Iterator[CloudTile]:
    """Yield the tiles of a source of labelled points, thinned to one point per voxel, ordered by name.

    Args:
        source: source of the tiles.
        scheme: classes that are learned.
        voxel: edge of the cells of which one point each is kept, m; None for all points.
        labels: whether labels are read; if not, all are `IGNORED`, and clouds need none.

    Raises:
        MissingFileError: there is no such file or folder.
        InputError: a file is damaged or has no labels, or its classes don't fit the scheme.
    """
    path = Path(source.path)
    if source.yardstick and source.mapping:
        raise InputError("mapping", source.mapping, "must be left out, as a yardstick has its own mapping")
    if source.split and path.is_file():
        raise InputError("split", source.split, f"must be left out, as {path.name} is a file and has no splits")
    if source.yardstick:
        tiles = yardstick_tiles(path, scheme, source)
    elif path.is_file() and path.suffix.lower() == ".npz" and _is_pack(path):
        tiles = _packed_tiles(path, scheme, voxel)
    elif path.is_file():
        tiles = cloud_tiles(path, scheme, source, labels=labels)
    elif path.is_dir():
        tiles = _folder_tiles(path, scheme, source, labels=labels)
    else:
        hint = "" if path.suffix else f"; synthroads dataset RECIPE --output {path} makes one"
        raise MissingFileError(str(path), None, f"must be a file or folder of labelled points{hint}")
    for tile in tiles:
        try:
            sample = slice(None) if voxel is None else voxel_sample(tile.coord, voxel)
        except ValueError:
            raise InputError(str(path), None, f"a tile of {tile.scene} is too large for cells of {voxel:g} m") from None
        thinned_tile = tile.select(sample)
        yield (
            thinned_tile
            if labels
            else replace(thinned_tile, segment=np.full(len(thinned_tile), IGNORED, dtype=np.int16))
        )


def _is_pack(path: Path) -> bool:
    """Return whether an NPZ file holds packed tiles."""
    try:
        with zipfile.ZipFile(path) as archive:
            return "notes.json" in archive.namelist()
    except ARCHIVE_FAULTS:
        return False


def _packed_tiles(path: Path, scheme: ClassScheme, voxel: float | None) -> Iterator[CloudTile]:
    """Yield the tiles of a file of packed tiles with the scheme's class indices."""
    pack = PackReader(path)
    if voxel is not None and pack.voxel > voxel * (1.0 + 1e-9):
        raise InputError("voxel", voxel, f"must be at least {pack.voxel:g} m, as the points of {path} were thinned")
    table = table_between(dict(enumerate(class_names(pack.scheme))), scheme, str(path))
    for tile_index in range(len(pack)):
        tile = pack.tile(tile_index)
        yield replace(tile, segment=_class_indices(tile.segment, tile.segment != IGNORED, table))


def _class_indices(numbers: AnyArray, is_known: Bool, table: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return the scheme's class indices (N,) of a source's numbers by a table; `IGNORED` where `is_known` is False."""
    return np.where(is_known, table[np.where(is_known, numbers, 0)], IGNORED).astype(np.int16)


def _folder_tiles(path: Path, scheme: ClassScheme, source: Source, *, labels: bool) -> Iterator[CloudTile]:
    """Yield the tiles of a folder: in Pointcept's layout, or of the clouds in it and below it."""
    root = pointcept_root(path)
    if root is not None:
        yield from pointcept_tiles(root, scheme, source.split)
        return
    folder = path / source.split if source.split else path
    for cloud in clouds_below(folder):
        name = cloud.relative_to(folder).with_suffix("").as_posix()
        yield from cloud_tiles(cloud, scheme, source, name, labels=labels)


def clouds_below(folder: Path) -> list[Path]:
    """Return the clouds in a folder and those below it, sorted; raise `MissingFileError` if there are none."""
    clouds = sorted(file for file in files_below(folder) if file.suffix.lower() in ENDINGS and file.is_file())
    if not clouds:
        raise MissingFileError(str(folder), None, "must hold tiles of a data set, or clouds")
    return clouds


def pointcept_root(path: Path) -> Path | None:
    """Return the folder with ``classes.json``: the given one or the only one of a data set; None if there is none."""
    if (path / "classes.json").is_file():
        return path
    roots = sorted(file.parent for file in path.glob("pointcept/*/classes.json"))
    if len(roots) > 1:
        names = ", ".join(str(root.relative_to(path)) for root in roots)
        raise InputError(
            "path", str(path), f"must have one set of classes, but has several: name one of the folders {names}"
        )
    return roots[0] if roots else None


def pointcept_tiles(root: Path, scheme: ClassScheme, split: str | None) -> Iterator[CloudTile]:
    """Yield the tiles of a folder in Pointcept's layout (``SPLIT/TILE/coord.npy`` ...), of one split or all, unthinned.

    Raises:
        MissingFileError: there is no such split, or it is empty.
        InputError: an array is missing or of another length.
    """
    class_data = read_json(root / "classes.json")
    try:
        names = dict(zip((int(number) for number in class_data["ids"]), map(str, class_data["classes"]), strict=True))
    except (KeyError, TypeError, ValueError):
        raise InputError(str(root / "classes.json"), None, "must hold lists of classes and their ids") from None
    table = table_between(names, scheme, str(root))
    for folder in pointcept_folders(root, split):
        yield _pointcept_tile(folder, table)


def pointcept_folders(root: Path, split: str | None) -> list[Path]:
    """Return the folders of the tiles of a split, or of all, by name.

    Raises:
        MissingFileError: there is no such split, or it is empty.
    """
    folders = sorted(file.parent for file in root.glob(f"{split or '*'}/*/coord.npy"))
    if not folders:
        splits = ", ".join(sorted(path.name for path in root.iterdir() if path.is_dir())) or "none"
        raise MissingFileError(f"{root}: split", split, f"must be a split with tiles; there are {splits}")
    return folders


def _pointcept_tile(folder: Path, table: NDArray[np.int16]) -> CloudTile:
    """Return the tile of a folder of arrays, its classes by a table of the scheme's indices."""
    coord, segment = _array(folder, "coord", (3,), "f4"), _array(folder, "segment", (), "i8")
    color = _array(folder, "color", (3,), "u1") if (folder / "color.npy").exists() else None
    strength = _array(folder, "strength", (), "f4") if (folder / "strength.npy").exists() else None
    for name, array in (("segment", segment), ("color", color), ("strength", strength)):
        if array is not None and len(array) != len(coord):
            raise InputError(
                str(folder / f"{name}.npy"), len(array), f"must hold {len(coord)} points, as coord.npy does"
            )
    notes = read_json(folder / "tile.json") if (folder / "tile.json").is_file() else {}
    try:
        origin = np.array(notes.get("origin", [0.0, 0.0, 0.0]), dtype=np.float64).reshape(3)
    except (AttributeError, TypeError, ValueError):
        raise InputError(str(folder / "tile.json"), None, "must be an object whose origin is three numbers") from None
    is_known = (segment >= 0) & (segment < UNLABELLED)
    return CloudTile(
        str(notes.get("scene", folder.name)),
        origin,
        coord,
        color if color is not None and color.any() else None,
        strength if strength is not None and strength.any() else None,
        _class_indices(segment, is_known, table),
    )


def _array(folder: Path, name: str, entry: tuple[int, ...], kind: str) -> AnyArray:
    """Read the array `name`.npy of a folder as (N, *entry) of dtype `kind`; raise `InputError` unless all is finite."""
    path = folder / f"{name}.npy"
    try:
        with np.errstate(invalid="ignore", over="ignore"):
            array = np.load(path, mmap_mode="r", allow_pickle=False).reshape(-1, *entry).astype(kind)
    except (*ARCHIVE_FAULTS, TypeError):
        raise InputError(str(path), None, "must be an array in NumPy's format (.npy)") from None
    if not np.isfinite(array).all():
        raise InputError(str(path), None, "must hold finite numbers")
    return np.asarray(array)


def cloud_tiles(
    path: Path, scheme: ClassScheme, source: Source, scene: str | None = None, *, labels: bool = True
) -> Iterator[CloudTile]:
    """Yield one cloud's labelled points as square tiles of edge `source.tile`, in bounded memory.

    The classes are those of the project's own clouds, or of another's attribute by the source's mapping.

    Args:
        path: the cloud.
        scheme: classes that are learned.
        source: mapping, and edge of the tiles.
        scene: name that tells the cloud from the source's others; the file's if not given.
        labels: whether labels are read; else all are `IGNORED`.

    Raises:
        InputError: the cloud has no points, or no labels of its own and there is no mapping, or it is damaged.
    """
    with open_cloud(path) as cloud, tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        if not cloud.header.count:
            raise InputError(str(path), 0, "must hold points for the training")
        scale = steps_per_unit(cloud)
        lowest = np.min([block.xyz.min(axis=0) for block in cloud.blocks() if len(block)], axis=0)
        origin = np.floor(lowest)
        with TileSorter(source.tile, origin, Path(folder)) as sorter:
            sorter.add(labelled_blocks(cloud, scheme, source) if labels else unlabelled_blocks(cloud))
            for part in sorter.tiles():
                yield tile_of(part.points, scene or path.stem, part.corner, scale)


def unlabelled_blocks(cloud: CloudReader) -> Iterator[PointBlock]:
    """Yield a cloud's blocks with all labels replaced by `IGNORED`."""
    for block in cloud.usable_blocks():
        yield _with_class_indices(block, np.full(len(block), IGNORED, dtype=np.int16))


def yardstick_tiles(folder: Path, scheme: ClassScheme, source: Source) -> Iterator[CloudTile]:
    """Yield the labelled points of a public data set in a folder, file by file, as square tiles, in bounded memory.

    Args:
        folder: folder of the data set.
        scheme: classes that are learned.
        source: yardstick, split, and edge of the tiles; a sweep is one tile.

    Raises:
        MissingFileError, InputError: see `yardsticks.numbered_blocks`.
    """
    if not folder.is_dir():
        raise MissingFileError(str(folder), None, "must be the folder of a public data set")
    yardstick, names = load_yardstick(str(source.yardstick)), class_names(scheme)
    mapping = yardstick.mapping_in(folder)
    edge = 1000.0 if yardstick.form == "sweeps" else source.tile
    for path in yardstick.files(folder, source.split):
        scene = path.relative_to(folder).with_suffix("").as_posix()
        lowest = np.min([block.xyz.min(axis=0) for block, _ in numbered_blocks(path, yardstick) if len(block)], axis=0)
        with tempfile.TemporaryDirectory() as scratch, TileSorter(edge, np.floor(lowest), Path(scratch)) as sorter:
            for block, numbers in numbered_blocks(path, yardstick):
                class_indices = mapping.label(numbers, names)
                if mapping.ignore_zero_intensity:
                    class_indices = np.where(block.intensity > 0, class_indices, IGNORED).astype(np.int16)
                sorter.add([_with_class_indices(block, class_indices)])
            for part in sorter.tiles():
                yield tile_of(part.points, scene, part.corner, FULL)


def tile_of(points: PointBlock, scene: str, origin: Float, scale: float) -> CloudTile:
    """Return a block as a tile: local float32 coordinates, 8-bit colours, intensities as shares of 16 bits.

    Args:
        points: N points; ``class_id`` is the class's index in the scheme, 255: ignored.
        scene: name of the scene.
        origin: (3,) map coordinates of the tile's local origin, m.
        scale: 16-bit steps per unit of intensity.
    """
    strength = (levels(points.intensity, scale) / FULL).astype(np.float32)
    return CloudTile(
        scene,
        origin,
        (points.xyz - origin).astype(np.float32),
        eight_bits(points.rgb) if points.rgb.any() else None,
        strength if strength.any() else None,
        np.where(points.class_id == UNLABELLED, IGNORED, points.class_id.astype(np.int16)),
    )


def labelled_blocks(cloud: CloudReader, scheme: ClassScheme, source: Source) -> Iterator[PointBlock]:
    """Yield a cloud's blocks with ``class_id`` replaced by the class's index in the scheme; 255: ignored."""
    mapping, names = source.label_mapping(), class_names(scheme)
    if mapping is None:
        if not cloud.header.labelled:
            fault = "has no SynthRoads classes: set `mapping`, which gives the class of each number in the file"
            raise InputError(str(cloud.header.path), None, fault)
        table = table_between({row.id: row.name for row in cloud.header.scheme.rows}, scheme, str(cloud.header.path))
        for block in cloud.usable_blocks():
            yield _with_class_indices(block, table[block.class_id])
        return
    all_numbers = _paved_numbers(cloud, mapping) if mapping.paved else _numbers(cloud, mapping.field)
    for file_block, file_numbers in zip(cloud.blocks(), all_numbers, strict=True):
        is_usable = cloud.usable_points(file_block, noise=True)  # it is for the mapping to say what numbers mean
        block, numbers = without_flags(file_block.select(is_usable)), file_numbers[is_usable]
        class_indices = mapping.label(numbers, names)
        if mapping.ignore_zero_intensity:
            class_indices = np.where(block.intensity > 0, class_indices, IGNORED).astype(np.int16)
        yield _with_class_indices(block, class_indices)


def _with_class_indices(block: PointBlock, class_indices: NDArray[np.int16]) -> PointBlock:
    """Return a block with class indices (N,) as its class ids, 255 where they are `IGNORED`."""
    return replace(block, class_id=np.where(class_indices == IGNORED, UNLABELLED, class_indices).astype(np.uint8))


def _paved_numbers(cloud: CloudReader, mapping: LabelMapping) -> Iterator[AnyArray]:
    """Yield 1 for a cloud's points on a pavement beside the mapping's axis, else 0; -1 beside its gaps and ends."""
    axis = MeasuredAxis.read(cloud.header.path.parent / mapping.axis, place=cloud.header.place)
    for block in cloud.blocks():
        _, offset = axis.beside(block.xyz, np.inf, past=_PAST)
        is_paved = np.any([(offset >= low) & (offset <= high) for low, high in mapping.paved], axis=0)
        yield np.where(np.isfinite(offset), is_paved, -1).astype(np.int64)


def _numbers(cloud: CloudReader, field: str) -> Iterator[AnyArray]:
    """Yield the attribute `field` of a LAS or LAZ cloud, in blocks of the size of `CloudReader.blocks`."""
    path = cloud.header.path
    if not cloud.header.kind.startswith("LAS"):
        raise InputError(str(path), None, "a mapping of classes is for LAS and LAZ files")
    with laspy.open(path, read_evlrs=False) as file:
        names = list(file.header.point_format.dimension_names)
        if field not in names:
            raise InputError(f"{path}: mapping.field", field, f"must be one of {', '.join(names)}")
        for record in file.chunk_iterator(BLOCK):
            yield np.asarray(record[field])
