"""The formats of clouds by the endings of their files: `open_cloud` reads any of them, `open_writer` writes any."""

import importlib.util
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from ...base.arrays import Float
from ...base.classes import ClassScheme
from ...base.errors import InputError, MissingFileError, nearest_name
from ...base.remarks import warn
from ..layers import DEFAULT_ATTRIBUTES, Attribute
from .reader import CloudReader
from .writer import CloudWriter

_FORMATS = {
    ".laz": "Las",
    ".las": "Las",
    ".copc.laz": "Copc",
    ".ply": "Ply",
    ".pcd": "Pcd",
    ".e57": "E57",
    ".npz": "Npz",
}
"""Beginnings of the names of the classes, by ending; their module has the same name in small letters."""
ENDINGS = tuple(_FORMATS)
"""Endings of the files that can be written and read."""
_PACKAGES = {".e57": "pye57"}
"""Package that a format needs and that not every installation has, by ending."""


def missing_package(ending: str) -> str | None:
    """Return the package that files of this ending need and that isn't installed; None if nothing is missing."""
    package = _PACKAGES.get(ending)
    return package if package and importlib.util.find_spec(package) is None else None


def installed_endings() -> tuple[str, ...]:
    """Return the endings of the files that can be written and read with the packages that are installed."""
    return tuple(ending for ending in ENDINGS if not missing_package(ending))


def check_ending(path: Path, field: str = "file") -> str:
    """Return a cloud file's ending in small letters; raise `InputError` if it is of no format known here."""
    name = path.name.lower()
    ending = max((ending for ending in ENDINGS if name.endswith(ending)), key=len, default=path.suffix.lower())
    if ending not in ENDINGS:
        raise InputError(field, str(path), f"must end in {', '.join(ENDINGS)}{nearest_name(ending, ENDINGS)}")
    return ending


def with_ending(path: Path, ending: str) -> Path:
    """Return a cloud file's path with another ending in place of its own, `.copc.laz` being one."""
    name = path.name
    known = [known_ending for known_ending in ENDINGS if name.lower().endswith(known_ending)]
    length = len(max(known, key=len)) if known else len(path.suffix)
    return path.with_name(name[: len(name) - length] + ending)


def open_writer(
    path: Path,
    epsg: int | None,
    offset: Float,
    intensity_scale: float,
    attributes: tuple[Attribute, ...] = DEFAULT_ATTRIBUTES,
    scheme: ClassScheme | None = None,
    crs_text: str | None = None,
    standard_time: bool = False,
) -> CloudWriter:
    """Return the writer that suits a file's ending, not yet entered as a context; arguments as `CloudWriter`.

    Example:
        >>> from pathlib import Path
        >>> import laspy
        >>> las = laspy.create(point_format=6, file_version="1.4")
        >>> las.x, las.y, las.z = [294000.5, 294001.0], [5628000.5, 5628000.0], [180.25, 181.5]
        >>> las.write("scan.las")
        >>> with open_cloud(Path("scan.las")) as cloud:
        ...     with open_writer(Path("scan.ply"), 25832, [294e3, 5628e3, 0.0], 1.0, attributes=()) as writer:
        ...         for block in cloud.blocks():
        ...             writer.write(block)
        >>> writer.count
        2
    """
    make: type[CloudWriter] = _format_class(check_ending(path), "Writer")
    return make(path, epsg, offset, intensity_scale, attributes, scheme, crs_text, standard_time)


def writer_file(ending: str) -> Path:
    """Return the source file of the reader and the writer of an ending."""
    return Path(__file__).with_name(f"{_FORMATS[ending].lower()}.py")


def _format_class(ending: str, role: Literal["Reader", "Writer"]) -> Any:
    """Return the reader or writer class of an ending, importing only that format's library."""
    name = _FORMATS[ending]
    return getattr(import_module(f".{name.lower()}", __package__), f"{name}{role}")


def open_cloud(path: Path) -> CloudReader:
    """Open a LAS, LAZ, PLY, E57 or NPZ file, by its ending, and return its reader; log what it has to say of itself.

    Raises:
        MissingFileError: there is no such file, or it can't be read.
        InputError: it is no cloud, or truncated, or of a kind that isn't read here.

    Example:
        >>> from pathlib import Path
        >>> import laspy
        >>> las = laspy.create(point_format=6, file_version="1.4")
        >>> las.x, las.y, las.z = [294000.5, 294001.0], [5628000.5, 5628000.0], [180.25, 181.5]
        >>> las.write("scan.las")
        >>> with open_cloud(Path("scan.las")) as cloud:
        ...     print([block.xyz.tolist() for block in cloud.blocks()])
        [[[294000.5, 5628000.5, 180.25], [294001.0, 5628000.0, 181.5]]]
    """
    ending = check_ending(path)
    if not path.is_file():
        raise MissingFileError(str(path), None, "is a folder, not a cloud" if path.is_dir() else "no such file")
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise InputError(str(path), None, "is empty, not a cloud")
    except OSError as problem:
        raise MissingFileError(str(path), None, f"cannot be read ({problem.strerror})") from None
    reader: CloudReader = _format_class(ending, "Reader")(path)
    for note in reader.header.place.notes:
        warn("%s: %s", path.name, note)
    return reader
