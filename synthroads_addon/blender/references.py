"""Files that an imported scene or asset names: they lie in its folder, or in one that the user names besides."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import bpy

from ..scanning.scene.mesh_files import refuse_outside

Known = Collection[bpy.types.ID]


def loaded_data() -> set[bpy.types.ID]:
    """Return what the open file holds by now that may name files."""
    return {item for kind in _kinds() for item in kind}


def check_references(path: Path, folders: Sequence[Path], remedy: str, before: Known = ()) -> None:
    """Raise `InputError` if what was imported names a file outside of some folders; none of them is decoded by then.

    Args:
        path: the file that was imported.
        folders: from which may be read.
        remedy: what is said to be done.
        before: data that the open file held already.

    Raises:
        InputError: it does; what was imported stays in the open file.
    """
    for item in (item for kind in _kinds() for item in kind if item not in before):
        if getattr(item, "packed_file", None) is None and item.filepath:
            address = bpy.path.abspath(item.filepath, library=item.library).replace("<UDIM>", "1001")
            refuse_outside(path, address, folders, remedy)


def _kinds() -> Iterator[Sequence[bpy.types.ID]]:
    data = bpy.data
    yield from (data.images, data.volumes, data.movieclips, data.sounds, data.libraries, data.cache_files, data.fonts)
