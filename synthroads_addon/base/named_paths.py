"""Paths that files name: whether they stay in the folder that they may lead to, links resolved.

A file may come from somebody else: a data set, a scene, what a killed process left behind. `path_inside` is what every
path goes through that was read from one, before something is written, moved or removed there.
"""

import os
from collections.abc import Iterable
from pathlib import Path, PurePath, PurePosixPath

from .errors import InputError


def path_inside(folder: Path, name: str | PurePath, source: str | Path, *, follow: bool = False) -> Path:
    """Return the place in a folder that a file names, which lies in it; the folder itself is no such place.

    Args:
        folder: in which it must lie; it may be a link itself.
        name: relative to it.
        source: file that names it, for the message.
        follow: whether a link in this very place counts as where it leads, as for what is opened. What is removed,
            moved or replaced is the link itself: links above it count all the same.

    Raises:
        InputError: it lies elsewhere.
    """
    if not is_inside(folder, name, follow=follow):
        allowed = f"must name a place in {folder}, also where links lead to; nothing was touched: remove what is wrong"
        raise InputError(str(source), str(name), allowed)
    return folder / name


def is_inside(folder: Path, name: str | PurePath, *, follow: bool = False) -> bool:
    """Return whether a place that a file names lies in a folder; see `path_inside`."""
    try:
        place, root = folder / name, Path(os.path.realpath(folder))
        if ".." in place.relative_to(folder).parts:
            return False
        real_path = Path(os.path.realpath(place)) if follow else Path(os.path.realpath(place.parent), place.name)
        return real_path != root and real_path.is_relative_to(root)
    except (OSError, ValueError, TypeError):  # a null byte, no text, another drive, an absolute path
        return False


def stays_below(name: str) -> bool:
    """Return whether a name is a relative path with / that leads to no folder above, links aside; also on Windows."""
    parts = PurePosixPath(name).parts
    return bool(parts) and ".." not in parts and not any(sign in name for sign in "\\:\0") and parts[0] != "/"


def file_in_one_of(folders: Iterable[Path], address: str, base_folder: Path) -> bool:
    """Return whether nothing is at an address, or a file or folder in one of some folders, links resolved.

    Args:
        folders: that may be read from.
        address: as a file has it, with / or \\; an absolute one counts as such.
        base_folder: folder that relative addresses count from.
    """
    name = address.replace("\\", "/")
    if name.startswith("//"):  # another machine's: looking whether it is there would call it
        return False
    try:
        real_path = Path(os.path.realpath(base_folder / name))
        if not os.path.lexists(real_path):
            return True
        is_usual = real_path.is_file() or real_path.is_dir()  # no pipe or device
        return is_usual and any(real_path.is_relative_to(os.path.realpath(folder)) for folder in folders)
    except (OSError, ValueError):  # no name of a file
        return True
