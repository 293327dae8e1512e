"""Scenes of a recipe without end, and the folder in which they go from those who make them to a training.

Scene k is of round k // n of a recipe with n scenes (of one split): in each round the recipe has another seed, and the
scenes another order. So scene k depends on recipe, seed and k alone.

The folder holds `PLAN`, what is made; `WANTED`, the numbers that the training wants by now, first and end; and a folder
for each scene that is made, laid out like a data set of one scene, with its `SceneEntry` in `ENTRY`. It comes to be in
`WORK` and is moved to its place whole. `FAILURE` says why there are no more of them.
"""

import json
import shutil
from pathlib import Path

from pydantic import Field

from ..base.errors import InputError
from ..base.random_streams import stream
from ..base.schema import ClosedModel, canonical_json, quantity, read_json
from .layouts import layout_descriptions
from .manifest import SceneEntry, faults, write_atomically
from .recipe import LARGEST_SEED, Recipe, SceneJob, scene_job, scene_places

PLAN, WANTED, FAILURE, ENTRY, WORK = "stream.json", "wanted.json", "failure.json", "scene.json", ".work"
LOCK = ".lock"
"""File that the producer at work holds locked."""
_REMOVED = ".removed-"


class StreamPlan(ClosedModel):
    """Plan of a stream: all that its scenes are made from."""

    recipe: Recipe = Field(description="Recipe.")
    split: str = Field(description="Split of the recipe whose scenes are made.")
    seed: int = quantity(..., "1", "Seed of the stream.", (0, LARGEST_SEED - 1))
    generator: str = Field(description="Program and version that makes them.")

    def job(self, number: int) -> SceneJob:
        """Return the scene of a number from 0: which one of the recipe it is follows from its round and place in that.

        Raises:
            InputError: the recipe has no scene of the split, or a scenario is wrong.
        """
        places = [place for place, (_, _, split) in enumerate(scene_places(self.recipe)) if split == self.split]
        if not places:
            raise InputError("split", self.split, f"the recipe {self.recipe.title} has no scene of it")
        round_number, place = divmod(number, len(places))
        seed = int(stream(self.seed, "streamed scenes", self.recipe.seed, round_number).integers(LARGEST_SEED))
        order = stream(seed, "order of scenes").permutation(len(places))
        return scene_job(self.recipe.model_copy(update={"seed": seed}), places[int(order[place])])


class Failure(ClosedModel):
    """Why a scene couldn't be made."""

    number: int = quantity(..., "1", "Number of the scene.", (0, None))
    name: str = Field("", description="Name of the scene in its recipe.")
    error: str = Field(description="What went wrong, in one line.")


def read_plan(folder: Path) -> StreamPlan:
    """Return what a stream's folder says is made there; raise `InputError` if it is damaged."""
    return StreamPlan.from_dict(read_json(folder / PLAN), str(folder / PLAN))


def scene_folder(folder: Path, number: int) -> Path:
    """Return the place of a scene in a stream's folder."""
    return folder / f"{number:06d}"


def is_made(folder: Path, number: int) -> bool:
    """Return whether a scene is there, as a whole."""
    return (scene_folder(folder, number) / ENTRY).is_file()


def read_entry(folder: Path, number: int) -> SceneEntry:
    """Return the description of a scene that is there; one of the status "failed" has no files."""
    path = scene_folder(folder, number) / ENTRY
    return SceneEntry.from_dict(read_json(path), str(path))


def publish(folder: Path, number: int, files: Path, entry: SceneEntry, plan: StreamPlan) -> None:
    """Move a scene's files to their place in the stream, with its entry and descriptions of its layouts.

    Args:
        folder: of the stream.
        number: of the scene.
        files: folder on the same disk, laid out like a data set; it is gone afterwards.
        entry: of the scene.
        plan: of the stream.
    """
    for name, text in layout_descriptions(plan.recipe, [plan.job(number)]).items():
        if (files / name).parent.is_dir():
            write_atomically(files / name, text)
    write_atomically(files / ENTRY, canonical_json(entry.to_dict()))
    files.replace(scene_folder(folder, number))


def remove_scene(folder: Path, number: int) -> None:
    """Remove a scene from a stream, in one step as far as others see."""
    folder_to_delete = folder / f"{_REMOVED}{number:06d}"
    shutil.rmtree(folder_to_delete, ignore_errors=True)
    scene_folder(folder, number).replace(folder_to_delete)
    shutil.rmtree(folder_to_delete, ignore_errors=True)


def scene_numbers(folder: Path) -> list[int]:
    """Return the numbers of the scenes that are in a stream's folder, ascending."""
    return sorted(int(path.parent.name) for path in folder.glob(f"*/{ENTRY}") if path.parent.name.isdigit())


def remove_remains(folder: Path) -> None:
    """Remove scenes whose files are missing or have another size than their entries say, and what was being removed."""
    for path in folder.glob(f"{_REMOVED}*"):
        shutil.rmtree(path, ignore_errors=True)
    for number in scene_numbers(folder):
        try:
            is_intact = not faults(scene_folder(folder, number), [read_entry(folder, number)], checksums=False)
        except InputError:
            is_intact = False
        if not is_intact:
            remove_scene(folder, number)


def write_wanted(folder: Path, scenes: range) -> None:
    """Say which scenes are wanted by now: in their order those of them are made that aren't there."""
    write_atomically(folder / WANTED, json.dumps([scenes.start, scenes.stop]))


def read_wanted(folder: Path) -> range:
    """Return the numbers of the scenes that are wanted by now; none if nothing was said yet."""
    if not (folder / WANTED).is_file():
        return range(0)
    first, end = read_json(folder / WANTED)
    return range(int(first), int(end))


def write_failure(folder: Path, failure: Failure) -> None:
    """Say why there are no more scenes."""
    write_atomically(folder / FAILURE, canonical_json(failure.to_dict()))


def read_failure(folder: Path) -> Failure | None:
    """Return why there are no more scenes, None if nothing has failed."""
    if not (folder / FAILURE).is_file():
        return None
    return Failure.from_dict(read_json(folder / FAILURE), str(folder / FAILURE))
