"""New scenes while a training goes on: producers make them into a bounded folder, from which each epoch reads its own.

Which scenes an epoch draws from hangs on its number alone, and a scene on its own. So a training waits for the scenes
of the epoch that begins where they aren't there yet, and learns the same whoever makes them and how fast.
"""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pydantic import Field, model_validator

from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.base.named_paths import path_inside
from synthroads_addon.base.process.modules import module_command, module_environment
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import canonical_json, quantity
from synthroads_addon.base.version import generator
from synthroads_addon.dataset.manifest import write_atomically
from synthroads_addon.dataset.recipe import Layout, load_recipe
from synthroads_addon.dataset.scene_stream import (
    FAILURE,
    LOCK,
    PLAN,
    WANTED,
    WORK,
    StreamPlan,
    is_made,
    read_entry,
    read_failure,
    remove_remains,
    remove_scene,
    scene_folder,
    scene_numbers,
    write_wanted,
)

from ..configuration import Part
from ..processes import process_number, wait_for_all

SCENES = "scenes"
"""Name of the scenes' folder within a run's, unless the options name another one."""
LOG = "producer.log"
PRODUCER: Sequence[str] = module_command("jobs.dataset.scene_producer")
"""Command that makes scenes, run as a program of its own, so that learning doesn't import the generator."""
_TICK = 0.05
"""Seconds between two looks for a scene."""
_END = 30.0
"""Seconds after which producers that don't end are killed."""


class StreamOptions(Part):
    """New synthetic scenes in each epoch, made while the training goes on."""

    recipe: str = Field(min_length=1, description="Recipe of the scenes: a built-in one or a file.")
    split: str = Field("train", min_length=1, description="Split of the recipe whose scenes are made.")
    scenes_per_epoch: int = quantity(4, ge=1, le=10_000, unit="1", description="Number of new scenes in each epoch.")
    keep: int = quantity(
        16,
        ge=2,
        le=100_000,
        unit="1",
        description="Largest number of scenes in the folder: those of an epoch, and the new ones of the next.",
    )
    producers: int = quantity(1, ge=1, le=256, unit="1", description="Number of scenes that are made at the same time.")
    folder: str = Field(
        "", description="Folder for the scenes, which is removed at the end; if empty, a folder inside that of the run."
    )

    @model_validator(mode="after")
    def _check_keep(self) -> Self:
        """Refuse a folder too small for the scenes of an epoch and the next one."""
        if self.keep < 2 * self.scenes_per_epoch:
            raise ValueError(
                f"keep is {self.keep}: must be at least twice scenes_per_epoch, {2 * self.scenes_per_epoch}: for this "
                "epoch and the next one"
            )
        return self

    def window(self, epoch: int) -> range:
        """Return the numbers of the scenes that an epoch from 0 draws from: its new ones and the newest before them."""
        end = (epoch + 1) * self.scenes_per_epoch
        return range(max(0, end - (self.keep - self.scenes_per_epoch)), end)


class SceneStream:
    """The scenes of a training, as a context in which producers make them.

    Of several processes that train together the first one runs the producers; all wait and read.

    Args:
        options: options of the stream.
        seed: seed of the training, on which the scenes depend too.
        run_folder: folder of the run.
        epochs: number of the training's epochs; no scenes are made for more.
        layouts: layouts of the scenes, instead of the recipe's.
        progress: called while the training waits.

    Raises:
        InputError: there is no such recipe, or something in it is wrong.
    """

    def __init__(
        self,
        options: StreamOptions,
        seed: int,
        run_folder: Path,
        epochs: int,
        layouts: tuple[Layout, ...] = (),
        progress: Progress = silent,
    ) -> None:
        self.options, self.epochs, self.progress = options, epochs, progress
        self.folder = Path(options.folder or path_inside(run_folder, SCENES, run_folder, follow=True)).absolute()
        recipe = load_recipe(options.recipe).model_copy(update={"layouts": layouts})
        self._plan = StreamPlan(recipe=recipe, split=options.split, seed=seed, generator=generator())
        self._plan.job(0)  # before anything is begun
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        """Take over the folder and begin to make scenes, as the first of several processes.

        Raises:
            OutputError: the folder holds something else, or can't be written.
        """
        if process_number() == 0:
            try:
                self._open_folder()
                self._begin()
            except OSError as error:
                raise OutputError("data.stream", str(self.folder), f"cannot be written ({error.strerror})") from None
        wait_for_all()  # nobody takes scenes of another plan, which are removed until here, for this one's
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the producers; the scenes stay, for a training that goes on."""
        if self._process is None:
            return
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None

    def begin_epoch(self, epoch: int) -> dict[int, Path]:
        """Return the folders of the scenes that an epoch draws from by number, when all are there.

        Scenes that no later epoch draws from are removed, and those of the next epoch are requested.

        Raises:
            InputError: a scene can't be made.
        """
        window = self.options.window(epoch)
        if process_number() == 0:
            write_wanted(self.folder, window)  # so that nobody makes those anew that are removed now
            for number in scene_numbers(self.folder):
                if number < window.start:
                    remove_scene(self.folder, number)
            last_epoch = min(epoch + 1, self.epochs - 1)
            write_wanted(self.folder, range(window.start, self.options.window(last_epoch).stop))
        while missing_numbers := [number for number in window if not is_made(self.folder, number)]:
            self.progress("waiting for scenes", 1.0 - len(missing_numbers) / len(window))
            self._check_producers(missing_numbers)
            time.sleep(_TICK)
        entries = [read_entry(self.folder, number) for number in window]
        if all(entry.status == "failed" for entry in entries):
            fault = f"can't be made ({entries[0].error}), and neither can the other scenes of the epoch"
            raise InputError("data.stream", entries[0].name, fault)
        return {number: scene_folder(self.folder, number) for number in window}

    def remove(self) -> None:
        """Remove the stream's files, and the folder if it is empty then, after training and producers have ended."""
        if process_number():
            return
        for number in scene_numbers(self.folder):
            remove_scene(self.folder, number)
        shutil.rmtree(self.folder / WORK, ignore_errors=True)
        for name in (PLAN, WANTED, FAILURE, LOG, LOCK):
            (self.folder / name).unlink(missing_ok=True)
        if not any(self.folder.iterdir()):
            self.folder.rmdir()

    def _open_folder(self) -> None:
        """Make the folder, or take over its scenes if they are of the same plan; those of another plan are removed."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError("data.stream", str(self.folder), f"cannot be written ({error.strerror})") from None
        plan, text = self.folder / PLAN, canonical_json(self._plan.to_dict())
        if plan.is_file():
            remove_remains(self.folder)
            if plan.read_text(encoding="utf-8") != text:
                for number in scene_numbers(self.folder):
                    remove_scene(self.folder, number)
        elif any(self.folder.iterdir()):
            raise OutputError(
                "data.stream", str(self.folder), "must be an empty folder, or one of scenes: this one holds other files"
            )
        (self.folder / FAILURE).unlink(missing_ok=True)
        (self.folder / WANTED).unlink(missing_ok=True)
        write_atomically(plan, text)

    def _begin(self) -> None:
        """Start the producers in a session of their own: Ctrl-C reaches the training alone, which then ends them."""
        with path_inside(self.folder, LOG, self.folder, follow=True).open("wb") as log:
            self._process = subprocess.Popen(
                [*PRODUCER, str(self.folder), str(self.options.producers)],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                start_new_session=True,
                env=module_environment(),
            )

    def _check_producers(self, missing_numbers: Sequence[int]) -> None:
        """Raise `InputError` if a scene failed, or if the producers ended before the missing scenes were made."""
        code = None if self._process is None else self._process.poll()
        if (failure := read_failure(self.folder)) is not None:
            scene_name = f"scene {failure.number}" + (f", {failure.name}" if failure.name else "")
            fault = f"couldn't be made: {failure.error}; --resume tries again"
        elif code is not None:
            lines = (self.folder / LOG).read_text(encoding="utf-8", errors="replace").strip().splitlines()
            scene_name = f"scene {missing_numbers[0]}"
            last_line = lines[-1] if lines else "no message"
            fault = f"can't be made: the process that makes scenes has ended with code {code} ({last_line}); "
            fault += "--resume tries again"
        else:
            return
        raise InputError("data.stream", scene_name, fault)


class EpochScenes:
    """Reader of an epoch's scenes with a cache of those from which the epoch draws.

    Args:
        stream: stream of scenes.
        read: reads a scene that was made, of a number and a folder.
    """

    def __init__(self, stream: SceneStream, read_scene: Callable[[int, Path], list[Any]]) -> None:
        self._stream, self._read = stream, read_scene
        self._kept: dict[int, list[Any]] = {}

    def __call__(self, epoch: int) -> list[Any]:
        """Return the items read from all scenes that an epoch draws from, in their order."""
        folders = self._stream.begin_epoch(epoch)
        for number, folder in folders.items():
            if number not in self._kept:
                has_failed = read_entry(self._stream.folder, number).status == "failed"
                self._kept[number] = [] if has_failed else self._read(number, folder)
        self._kept = {number: self._kept[number] for number in folders}
        return [item for crops in self._kept.values() for item in crops]
