"""Removing what a data set made, so that another can take its place, and nothing else.

What is to go is written down before the new manifest takes the old one's place. From then on nobody who reads the
manifest finds the old set, and whoever opens the folder after a crash removes the rest of it.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from ..base.errors import InputError, OutputError
from ..base.schema import canonical_json, read_json
from .manifest import MANIFEST, PUBLISHED, Manifest, SceneEntry, read_manifest, write_atomically

REPLACED = ".replaced.json"
"""The paths that are to be removed, as long as they aren't."""
_DESCRIPTIONS = {"pointcept": "classes.json", "semantickitti": "synthroads.yaml"}
"""Description that lies in the root of a layout beside its scenes."""


def made_by(folder: Path, manifest: Manifest) -> list[str]:
    """Return the paths in a data set's folder that the set made, besides its manifest and recipe.

    Args:
        folder: of the data set.
        manifest: its own.

    Returns:
        folders of scenes, and single files; some may not be there.

    Raises:
        InputError: the manifest names a place that no data set writes to.
        OutputError: a scene's folder holds a file that the manifest doesn't name.
    """
    paths = ["DATA_CARD.md"]
    for scene in manifest.scenes:
        if len(PurePosixPath(scene.name).parts) != 1 or scene.name == "..":
            raise InputError(str(folder / MANIFEST), scene.name, "is no name of a scene")
        paths += [f"logs/{scene.name}{ending}" for ending in (".json", ".txt")]
        paths += _folders(folder, scene)
    roots = dict.fromkeys(PurePosixPath(path).parts[:2] for path in paths)
    paths += ["/".join((*root, _DESCRIPTIONS[root[0]])) for root in roots if root[0] in _DESCRIPTIONS]
    return paths


def _folders(folder: Path, scene: SceneEntry) -> Iterator[str]:
    """Yield the folders of a scene, once it is known that all in them is its own."""
    for name in scene.folders or ():
        place = PurePosixPath(name)
        if ".." in place.parts or not any(_fits(place, pattern) for pattern in PUBLISHED):
            raise InputError(str(folder / MANIFEST), name, "is no folder that a data set makes")
        whole = folder / name
        inside = () if whole.is_symlink() else sorted(whole.rglob("*"))  # of a link the link alone goes
        for path in inside:
            file = path.relative_to(folder).as_posix()
            if (path.is_symlink() or not path.is_dir()) and file not in (scene.files or {}):
                raise OutputError("--output", str(folder), f"holds {file}, which is not the data set's; move it away")
        yield name


def _fits(place: PurePosixPath, pattern: str) -> bool:
    return len(place.parts) == len(PurePosixPath(pattern).parts) and place.match(pattern)


def begin_removal(folder: Path, paths: Iterable[str]) -> None:
    """Write down what is to be removed from a folder once another manifest is there."""
    write_atomically(folder / REPLACED, canonical_json(list(paths)))


def finish_removal(folder: Path) -> None:
    """Remove what was written down, unless the manifest is still the one that names it; nothing if nothing was."""
    if not (folder / REPLACED).is_file():
        return
    named = {name for scene in read_manifest(folder).scenes for name in scene.folders or ()}
    paths = read_json(folder / REPLACED)
    if named.isdisjoint(paths):
        for name in paths:
            remove(folder / name)
            for parent in list(PurePosixPath(name).parents)[:-1]:
                with suppress(OSError):  # it isn't empty, or a link
                    (folder / parent).rmdir()
    (folder / REPLACED).unlink()


def remove(path: Path) -> None:
    """Remove a file or a folder with all that is in it, of a link the link alone; nothing if nothing is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
