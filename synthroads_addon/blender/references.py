"""Files that an imported scene or asset refers to: they must be in its folder, or in another that the user names."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import bpy

from ..scanning.scene.mesh_files import refuse_outside

Known = Collection[bpy.types.ID]


def loaded_data() -> set[bpy.types.ID]:
    """Return the data-blocks of the open file that may refer to files."""
    return {item for kind in _kinds() for item in kind}


def check_references(path: Path, folders: Sequence[Path], remedy: str, earlier_data: Known = ()) -> None:
    """Raise `InputError` if imported data refers to a file outside of some folders, before any such file is decoded.

    Args:
        path: the file that was imported.
        folders: folders from which files may be read.
        remedy: remedy that the error's text names.
        earlier_data: data-blocks that the open file had before the import.

    Raises:
        InputError: a file is outside; the imported data stays in the open file.
    """
    for item in (item for kind in _kinds() for item in kind if item not in earlier_data):
        if getattr(item, "packed_file", None) is None and item.filepath:
            address = bpy.path.abspath(item.filepath, library=item.library).replace("<UDIM>", "1001")
            refuse_outside(path, address, folders, remedy)


def _kinds() -> Iterator[Sequence[bpy.types.ID]]:
    """Yield the open file's collections of data-blocks that may refer to files."""
    data = bpy.data
    yield from (data.images, data.volumes, data.movieclips, data.sounds, data.libraries, data.cache_files, data.fonts)
