"""Publishing the scenes of a data set, each as a whole, so that a run can be stopped and taken up again.

Whoever runs this is the only one that publishes. A scene is made in a folder of its own below ``.work``, by a process
of its own; when that has ended well, its folders are moved to their places and it is recorded, in one line beside the
manifest, which is written at the end. What neither names isn't there: after a crash it is removed and made again, with
the same bytes.
"""

from __future__ import annotations

import json
import logging
import shutil
import tempfile
from collections.abc import Set
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from ...base.errors import InputError, OutputError
from ...base.files import folder_at_work
from ...base.named_paths import path_inside
from ...base.progress import Progress, silent
from ...base.schema import read_json
from ...base.version import generator
from ...dataset.data_card import data_card
from ...dataset.layouts import layout_descriptions
from ...dataset.manifest import (
    MANIFEST,
    PUBLISHED,
    Manifest,
    SceneEntry,
    append_record,
    begin_removal,
    check_same_recipe,
    faults,
    finish_removal,
    fold_records,
    make_manifest,
    paths_of_set,
    published_name,
    read_manifest,
    remove,
    write_atomically,
    write_manifest,
)
from ...dataset.recipe import Recipe, SceneJob, scene_jobs
from .processes import Outcome, Submit, scene_task
from .scene_files import DONE, FILES, TASK

WORK = ".work"
LOCK = ".lock"
_logger = logging.getLogger("synthroads")


@dataclass
class DatasetRun:
    """Production of a data set's scenes from a recipe in a folder, resumable after an interruption.

    Args:
        recipe: what is made.
        folder: where it goes.
        resume: continue what was begun there.
        progress: told how many scenes are done.
        splits: whose scenes are made; None: those of all.
        overwrite: replace the data set that is there.

    Attributes:
        jobs: all scenes.
        entries: scenes done or failed, by name.
    """

    recipe: Recipe
    folder: Path
    resume: bool = False
    progress: Progress = silent
    splits: frozenset[str] | None = None
    overwrite: bool = False
    jobs: list[SceneJob] = field(init=False)
    entries: dict[str, SceneEntry] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.jobs = scene_jobs(self.recipe)
        split_names = sorted({job.split for job in self.jobs})
        for split in sorted((self.splits or frozenset()) - set(split_names)):
            raise InputError("--splits", split, f"must be splits of the recipe: {', '.join(split_names)}")
        self._names = {job.name for job in self.jobs}
        self._sequences = {f"{job.number:02d}" for job in self.jobs}
        self._recipe_text = self.recipe.to_json()
        self._generator = generator()
        self._description_names: set[str] = set()

    def run(self, submit: Submit) -> Manifest:
        """Make all scenes that are missing, write the data set's descriptions, and return the manifest.

        Args:
            submit: see `local_processes` and `dask_workers`.

        Raises:
            OutputError: the folder holds something else, or can't be written, or another run is at work in it.
            InputError: what is there was made from another recipe.
        """
        try:
            with folder_at_work(self.folder, LOCK):
                self._open_folder()
                try:
                    self._prepare()
                    self._make(submit)
                    self._write_descriptions()
                except BaseException:
                    self._abandon()
                    raise
        except OSError as error:
            resume_text = "; what is done stays, --resume continues" if self.entries else ""
            raise OutputError(
                "--output", str(self.folder), f"cannot be written ({error.strerror}){resume_text}"
            ) from None
        return self._manifest()

    def _make(self, submit: Submit) -> None:
        """Make the missing scenes of the chosen splits, and publish each when it is complete."""
        chosen_jobs = [job for job in self.jobs if self.splits is None or job.split in self.splits]
        jobs = [job for job in chosen_jobs if not self._is_done(job)]
        done_before = len(chosen_jobs) - len(jobs)
        self.progress("scenes", done_before / len(chosen_jobs))
        for number, outcome in enumerate(submit([self._write_task(job) for job in jobs]), start=1):
            self._publish(outcome)
            self.progress("scenes", (done_before + number) / len(chosen_jobs))

    def _open_folder(self) -> None:
        """Check that the folder is empty, or take over or remove the data set in it as requested."""
        for name in ("logs", *dict.fromkeys(pattern.partition("/")[0] for pattern in PUBLISHED)):
            path_inside(self.folder, name, self.folder, follow=True)  # before hours of work
        if (self.folder / MANIFEST).exists():
            self._reopen()
        elif {path.name for path in self.folder.iterdir()} - {LOCK, f".{MANIFEST}.part"}:
            raise OutputError("--output", str(self.folder), "holds other files; choose an empty folder")

    def _prepare(self) -> None:
        """Remove unfinished remains of an earlier run, and create manifest, recipe and folders of this one."""
        write_manifest(self.folder, self._manifest())  # first: a folder without one could never be resumed
        shutil.rmtree(self.folder / WORK, ignore_errors=True)
        self._remove_unrecorded()
        (self.folder / WORK).mkdir()
        (self.folder / "logs").mkdir(exist_ok=True)
        write_atomically(self.folder / "recipe.json", self._recipe_text)

    def _reopen(self) -> None:
        """Take over the finished scenes of the data set in the folder, or remove it if it is to be overwritten."""
        if self.overwrite or self.resume:
            fold_records(self.folder)
        if self.overwrite:
            finish_removal(self.folder)
            paths = [*paths_of_set(self.folder, read_manifest(self.folder)), *self._published_folders()]
            for path in self._unrecorded_folders(set(paths)):
                name = path.relative_to(self.folder).as_posix()
                raise OutputError("--output", str(self.folder), f"holds {name}, not a part of a scene; move it away")
            begin_removal(self.folder, paths)
            write_manifest(self.folder, self._manifest())
        elif self.resume:
            manifest = check_same_recipe(self.folder, self._recipe_text, self._generator)
            scenes = [scene for scene in manifest.scenes if scene.status == "done"]
            self.entries = {scene.name: scene for scene in scenes if not faults(self.folder, [scene], checksums=False)}
        else:
            allowed = "already holds a data set; --resume continues it, --overwrite replaces it"
            raise OutputError("--output", str(self.folder), allowed)
        finish_removal(self.folder)

    def _published_folders(self) -> list[str]:
        """Return the folders of scenes that a killed run had published, or was about to, unrecorded.

        Raises:
            InputError: a file that it left names something else.
        """
        names: list[str] = []
        for path in (self.folder / WORK).glob(f"*/*/{DONE}"):
            try:
                names += map(published_name, read_json(path)["folders"])
            except (KeyError, TypeError, ValueError) as error:
                raise InputError(str(path), None, f"is damaged ({error}); remove {WORK}") from None
        return names

    def _unrecorded_folders(self, known_names: Set[str] = frozenset()) -> list[Path]:
        """Return existing folders named as scenes of the recipe that are neither recorded nor in ``known_names``."""
        recorded_names = {name for entry in self.entries.values() for name in entry.folders or ()} | known_names
        paths = [path for pattern in PUBLISHED for path in sorted(self.folder.glob(pattern)) if self._is_scenes(path)]
        return [path for path in paths if path.relative_to(self.folder).as_posix() not in recorded_names]

    def _remove_unrecorded(self) -> None:
        """Remove what an interrupted run has published and not recorded."""
        for path in self._unrecorded_folders():
            remove(self.folder, path.relative_to(self.folder), self.folder)

    def _place(self, name: str) -> Path:
        """Return a place in the folder that something is moved to; InputError if a link leads out of it."""
        return path_inside(self.folder, name, self.folder)

    def _is_scenes(self, path: Path) -> bool:
        """Return whether a folder's name is that of a scene of the recipe."""
        top_folder = path.relative_to(self.folder).parts[0]
        if top_folder == "semantickitti":
            return path.name in self._sequences
        return (path.name if top_folder == "scenes" else path.name.rpartition("-")[0]) in self._names

    def _is_done(self, job: SceneJob) -> bool:
        """Return whether a scene is among those done or failed."""
        return job.name in self.entries

    def _write_task(self, job: SceneJob) -> str:
        """Write a scene's task file into a new work folder, and return that folder."""
        folder = Path(tempfile.mkdtemp(prefix=f"{job.name}-", dir=self.folder / WORK))
        (folder / TASK).write_text(json.dumps(scene_task(job, self.recipe)), encoding="utf-8")
        return str(folder)

    def _publish(self, outcome: Outcome) -> None:
        """Publish the files of a complete scene, or log its failure, and record it in the manifest."""
        task = json.loads((outcome.folder / TASK).read_text(encoding="utf-8"))
        job = self.jobs[task["number"]]
        scene_fields: dict[str, Any] = {"name": job.name, "split": job.split, "seed": job.scenario.seed}
        if outcome.error is None:
            result = json.loads((outcome.folder / DONE).read_text(encoding="utf-8"))
            for name in result["folders"]:
                target = self._place(published_name(name))
                target.parent.mkdir(parents=True, exist_ok=True)
                (outcome.folder / FILES / name).replace(target)
            self._describe_layouts()  # before it is recorded: a set that is stopped now can be learned from
            entry = SceneEntry.from_dict({**scene_fields, "status": "done", **result}, "scene")
            (outcome.folder / "report.json").replace(self._place(f"logs/{job.name}.json"))
            if not entry.points:
                _logger.warning("warning: %s: no pulse came back", job.name)
            _logger.debug("%s is done: %s points", job.name, f"{entry.points:,}")
        else:
            entry = SceneEntry.from_dict({**scene_fields, "status": "failed", "error": outcome.error}, "scene")
            with suppress(FileNotFoundError):  # of a lost worker there is none
                (outcome.folder / "log.txt").replace(self._place(f"logs/{job.name}.txt"))
            _logger.error("failed: %s: %s", job.name, outcome.error)
        self.entries[job.name] = entry  # first: where the run is stopped before the next line, `_abandon` keeps it
        try:
            append_record(self.folder, entry)
        except OSError:
            del self.entries[job.name]
            raise
        # Until now `_published_folders` knows what is where.
        work = self.folder / WORK
        shutil.rmtree(work / outcome.folder.relative_to(work).parts[0], ignore_errors=True)

    def _manifest(self) -> Manifest:
        """Return the manifest of the scenes done or failed so far, in the recipe's order."""
        entries = [self.entries[job.name] for job in self.jobs if job.name in self.entries]
        return make_manifest(self.recipe.title, self._generator, self._recipe_text, entries, len(self.jobs))

    def _abandon(self) -> None:
        """Remove everything unfinished and write the manifest, after a failure; ignores errors of the disk."""
        with suppress(OSError, InputError):  # InputError: a link leads out of the folder, which is told already
            self._remove_unrecorded()
            shutil.rmtree(self.folder / WORK, ignore_errors=True)
            write_manifest(self.folder, self._manifest())

    def _write_descriptions(self) -> None:
        """Write the manifest, layout descriptions and data card of the data set, and remove the work folder."""
        manifest = self._manifest()
        write_manifest(self.folder, manifest)
        self._description_names.clear()
        self._describe_layouts()
        write_atomically(self.folder / "DATA_CARD.md", data_card(self.recipe, manifest, self.jobs))
        shutil.rmtree(self.folder / WORK, ignore_errors=True)

    def _describe_layouts(self) -> None:
        """Write the description of each layout that has a scene by now, unless this run has written it already."""
        for name, text in self._layout_texts.items():
            if name not in self._description_names and (self.folder / name).parent.is_dir():
                write_atomically(self._place(name), text)
                self._description_names.add(name)

    @cached_property
    def _layout_texts(self) -> dict[str, str]:
        """Return the descriptions of the recipe's layouts by file name; cached."""
        return layout_descriptions(self.recipe, self.jobs)
