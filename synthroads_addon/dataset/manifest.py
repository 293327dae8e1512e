"""The manifest of a data set: each scene's state and the checksum of every file, the same bytes however it was made.

A set that another takes the place of is removed by its manifest, and nothing else. What is to go is written down before
the new manifest takes the old one's place. From then on nobody who reads the manifest finds the old set, and whoever
opens the folder after a crash removes the rest of it.
"""

import hashlib
import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path, PurePath, PurePosixPath
from typing import Any, Literal

from pydantic import Field, field_validator

from ..base.errors import InputError, OutputError
from ..base.files import read_text
from ..base.named_paths import path_inside, stays_below
from ..base.schema import ClosedModel, canonical_json, quantity, read_json

MANIFEST = "manifest.json"
RECORDS = ".scenes.jsonl"
"""Scenes that came to be since the manifest was written, a line for each; gone when the run has ended."""
PUBLISHED = ("scenes/*", "pointcept/*/*/*", "semantickitti/*/sequences/*")
"""Folders of a scene that are published whole: its own, its tiles and its sequence."""
REPLACED = ".replaced.json"
"""The paths that are to be removed, as long as they aren't."""
_DESCRIPTIONS = {"pointcept": "classes.json", "semantickitti": "synthroads.yaml"}
"""Description that lies in the root of a layout beside its scenes."""
_BLOCK = 1 << 20


class FileEntry(ClosedModel):
    """One file of a scene."""

    bytes: int = quantity(..., "B", "Size.", (0, None))
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$", description="Checksum.")


class SceneEntry(ClosedModel):
    """One scene."""

    name: str = Field(description="Name.")
    split: str = Field(description="Split.")
    seed: int = quantity(..., "1", "Seed.", (0, 2**63 - 1))
    status: Literal["done", "failed"] = Field(description="Whether it was made.")
    error: str | None = Field(None, description="What went wrong, in one line.")
    points: int | None = quantity(None, "1", "Points of its cloud.", (0, None))
    length: float | None = quantity(None, "m", "Length of its road.", (0, None))
    classes: dict[str, int] | None = Field(None, description="Points by class.")
    files: dict[str, FileEntry] | None = Field(None, description="Its files, by path in the data set.")
    folders: tuple[str, ...] | None = Field(None, description="Its folders in the data set.")

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        """Refuse a name that leads out of the folder of scenes."""
        if not stays_below(name) or len(PurePosixPath(name).parts) != 1:
            raise ValueError(f"'{name}' can't be the name of a scene")
        return name

    @field_validator("files")
    @classmethod
    def _check_files(cls, files: dict[str, FileEntry] | None) -> dict[str, FileEntry] | None:
        """Refuse a file outside of the data set."""
        if outside_name := next((name for name in files or () if not stays_below(name)), None):
            raise ValueError(
                f"'{outside_name}' is no file in the data set: a relative path with / and without .. is needed"
            )
        return files

    @field_validator("folders")
    @classmethod
    def _check_folders(cls, folders: tuple[str, ...] | None) -> tuple[str, ...] | None:
        """Refuse folders that no scene of a data set has."""
        return None if folders is None else tuple(map(published_name, folders))


class Manifest(ClosedModel):
    """All scenes that were made or tried, in the recipe's order."""

    type: Literal["Manifest"] = "Manifest"
    version: Literal["1.0"] = "1.0"
    title: str = Field(description="The recipe's title.")
    generator: str = Field(description="Program and version that made the set.")
    recipe_sha256: str = Field(description="Checksum of recipe.json.")
    complete: bool = Field(description="Whether every scene of the recipe is done.")
    scenes: tuple[SceneEntry, ...] = Field((), description="Scenes.")


def read_manifest(folder: Path) -> Manifest:
    """Return the manifest of a data set, with the scenes that a run has recorded since it was written.

    Raises:
        InputError: there is none, or it is damaged.
    """
    manifest = Manifest.from_dict(read_json(folder / MANIFEST), source=str(folder / MANIFEST))
    recorded_entries = {entry.name: entry for entry in _read_records(folder)}
    if not recorded_entries:
        return manifest
    entries = {entry.name: entry for entry in manifest.scenes} | recorded_entries
    return manifest.model_copy(update={"scenes": tuple(entries.values())})


def append_record(folder: Path, entry: SceneEntry) -> None:
    """Record one more scene beside the manifest, on the disk, at a cost that doesn't grow with their number."""
    # In ASCII, so that a line that was cut off is text all the same, and no character in it ends a line.
    line = json.dumps(entry.to_dict(), separators=(",", ":"))
    records = path_inside(folder, RECORDS, folder, follow=True)
    with records.open("a", encoding="utf-8", newline="\n") as file:
        file.write(f"{line}\n")
        file.flush()
        os.fsync(file.fileno())


def fold_records(folder: Path) -> None:
    """Write what was recorded into the manifest, and remove the records; nothing if there are none."""
    if (folder / RECORDS).exists():
        write_manifest(folder, read_manifest(folder))


def _read_records(folder: Path) -> Iterator[SceneEntry]:
    """Yield the recorded scenes, up to a line that isn't whole: its run was killed meanwhile."""
    if not (folder / RECORDS).is_file():
        return
    for line in read_text(folder / RECORDS, "must be text in UTF-8").splitlines():
        try:
            yield SceneEntry.from_dict(json.loads(line), "scene")
        except (ValueError, InputError):
            return


def published_name(name: object) -> str:
    """Return the name of a folder of a scene that is published whole; ValueError for any other."""
    place = PurePosixPath(str(name))
    if not isinstance(name, str) or not stays_below(name) or not any(_fits(place, pattern) for pattern in PUBLISHED):
        raise ValueError(f"'{name}' is not a folder of a data set")
    return name


def write_atomically(path: Path, text: str) -> None:
    """Write a text file so that it is there wholly or not at all, even after a power cut; never through a link."""
    partial_file = path.with_name(f".{path.name}.part")
    try:
        partial_file.unlink(missing_ok=True)  # a link would be written through
        with partial_file.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        partial_file.replace(path)
    except BaseException:
        with suppress(OSError):
            partial_file.unlink(missing_ok=True)
        raise


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, read in blocks."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def file_entries(folder: Path) -> dict[str, dict[str, Any]]:
    """Return size (bytes) and SHA-256 of every file below a folder, by its path relative to it, sorted."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {
        path.relative_to(folder).as_posix(): {"bytes": path.stat().st_size, "sha256": checksum(path)} for path in files
    }


def faults(folder: Path, scenes: Iterable[SceneEntry], checksums: bool = True) -> list[str]:
    """Return a sentence for each file of scenes that is missing or has another size or (if asked) checksum."""
    sentences = []
    for scene in scenes:
        for name, entry in (scene.files or {}).items():
            path = folder / name
            if not path.is_file():
                sentences.append(f"{name} is missing")
            elif path.stat().st_size != entry.bytes:
                sentences.append(f"{name} has {path.stat().st_size:,} bytes, not {entry.bytes:,}")
            elif checksums and checksum(path) != entry.sha256:
                sentences.append(f"{name} has another checksum")
    return sentences


def check_same_recipe(folder: Path, recipe_text: str, generator: str) -> Manifest:
    """Return the manifest of a set to be continued; InputError if recipe or program was another one."""
    manifest = read_manifest(folder)
    if manifest.recipe_sha256 != hashlib.sha256(recipe_text.encode()).hexdigest():
        raise InputError("--resume", str(folder), "was begun with another recipe; choose another folder")
    if manifest.generator != generator:
        versions = f"was begun with {manifest.generator}; this is {generator}"
        raise InputError("--resume", str(folder), f"{versions}: only the same version gives the same bytes")
    return manifest


def make_manifest(
    title: str, generator: str, recipe_text: str, scenes: Iterable[SceneEntry], scene_count: int
) -> Manifest:
    """Return the manifest of some scenes; it is complete if there are as many as expected and all are done."""
    entries = tuple(scenes)
    return Manifest(
        title=title,
        generator=generator,
        recipe_sha256=hashlib.sha256(recipe_text.encode()).hexdigest(),
        complete=len(entries) == scene_count and all(entry.status == "done" for entry in entries),
        scenes=entries,
    )


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write the manifest atomically and remove the records, which it has from then on."""
    write_atomically(folder / MANIFEST, canonical_json(manifest.to_dict()))
    (folder / RECORDS).unlink(missing_ok=True)


def paths_of_set(folder: Path, manifest: Manifest) -> list[str]:
    """Return the relative paths that a data set wrote into its folder, besides its manifest and recipe.

    Args:
        folder: of the data set.
        manifest: its own.

    Returns:
        folders of scenes, and single files; some may not be there.

    Raises:
        OutputError: a scene's folder holds a file that the manifest doesn't name.
    """
    paths = ["DATA_CARD.md"]
    for scene in manifest.scenes:
        paths += [f"logs/{scene.name}{ending}" for ending in (".json", ".txt")]
        paths += _folders(folder, scene)
    roots = dict.fromkeys(PurePosixPath(path).parts[:2] for path in paths)
    paths += ["/".join((*root, _DESCRIPTIONS[root[0]])) for root in roots if root[0] in _DESCRIPTIONS]
    return paths


def _folders(folder: Path, scene: SceneEntry) -> Iterator[str]:
    """Yield the folders of a scene; OutputError where one holds a file that isn't the scene's."""
    for name in scene.folders or ():
        scene_folder = path_inside(folder, name, folder / MANIFEST)
        paths_inside = (
            () if scene_folder.is_symlink() else sorted(scene_folder.rglob("*"))
        )  # of a link the link alone goes
        for path in paths_inside:
            file = path.relative_to(folder).as_posix()
            if (path.is_symlink() or not path.is_dir()) and file not in (scene.files or {}):
                raise OutputError("--output", str(folder), f"holds {file}, not a part of the data set; move it away")
        yield name


def _fits(place: PurePosixPath, pattern: str) -> bool:
    """Return whether a path has as many parts as a pattern and matches it."""
    return len(place.parts) == len(PurePosixPath(pattern).parts) and place.match(pattern)


def begin_removal(folder: Path, paths: Iterable[str]) -> None:
    """Record the paths that `finish_removal` is to remove from a folder once another manifest is there."""
    write_atomically(folder / REPLACED, canonical_json(list(paths)))


def finish_removal(folder: Path) -> None:
    """Remove the paths that `begin_removal` recorded, unless the manifest still names them; else do nothing.

    Raises:
        InputError: the record isn't a list of names, or one of them leads out of the folder: nothing is removed then.
    """
    if not (folder / REPLACED).is_file():
        return
    names_in_manifest = {name for scene in read_manifest(folder).scenes for name in scene.folders or ()}
    names_to_remove = read_json(folder / REPLACED)
    if not isinstance(names_to_remove, list) or not all(isinstance(name, str) for name in names_to_remove):
        raise InputError(str(folder / REPLACED), None, "must be a list of paths to remove; delete this file")
    for name in names_to_remove:
        path_inside(folder, name, folder / REPLACED)
    if names_in_manifest.isdisjoint(names_to_remove):
        for name in names_to_remove:
            remove(folder, name, folder / REPLACED)
            for parent in list(PurePosixPath(name).parents)[:-1]:
                with suppress(OSError):  # it isn't empty, or a link
                    (folder / parent).rmdir()
    (folder / REPLACED).unlink()


def remove(folder: Path, name: str | PurePath, source: Path) -> None:
    """Remove a file in a folder, or a folder with all that is in it; of a link the link alone; nothing without any.

    Args:
        folder: in which it must lie, see `path_inside`.
        name: relative to it.
        source: file that names it.

    Raises:
        InputError: it lies elsewhere.
    """
    path = path_inside(folder, name, source)
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
