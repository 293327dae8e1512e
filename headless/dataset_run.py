"""Making the scenes of a data set side by side, and publishing each as a whole: on this machine or on a Dask cluster.

Whoever runs this is the only one that publishes. A scene is made in a folder of its own below ``.work``, by a process
of its own; when that has ended well, its folders are moved to their places and it is recorded, in one line beside the
manifest, which is written at the end. What neither names isn't there: after a crash it is removed and made again, with
the same bytes.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Set
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from threading import Event
from typing import Any, Protocol, cast

from headless.dataset_scene import DONE, FAILED, FILES
from headless.messages import logger
from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.base.files import folder_at_work
from synthroads_addon.base.machine import available_cores
from synthroads_addon.base.named_paths import path_inside
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import read_json
from synthroads_addon.base.version import generator
from synthroads_addon.dataset.data_card import data_card
from synthroads_addon.dataset.layouts import layout_descriptions
from synthroads_addon.dataset.manifest import (
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
from synthroads_addon.dataset.recipe import Recipe, SceneJob, scene_jobs

WORK = ".work"
TASK = "task.json"
LOCK = ".lock"
ATTEMPTS = 3
"""A scene whose process is killed (too little memory, a lost node) is tried this often."""
MOST_WORKERS = 8
"""Workers of a cluster that may end before a scene does, as their time is over, until it is given up."""
_ATTEMPT = "attempt-"
INTERRUPTED = 130
"""Exit code of a process that was told to end, as where a node is given back."""
_ANSWER = 10.0
"""Seconds that a scheduler has for its answer."""
_TICK = 0.1
"""Seconds between two looks at a process."""
_LOOK = 2.0
"""Seconds between two looks at who works on a cluster."""
_SOON = 60.0
"""Seconds without any worker after which it is said."""
_MODULE = Path(__file__).with_name("dataset_scene.py")


@dataclass(frozen=True)
class Outcome:
    """Result of one scene's process: the folder it worked in, and an error if it failed.

    Attributes:
        folder: where it worked.
        error: what went wrong, in one line; None if nothing.
    """

    folder: Path
    error: str | None = None


class Stop(Protocol):
    """Protocol of a stop flag, as of `threading.Event`."""

    def is_set(self) -> bool:
        """Return whether work has to stop."""
        ...

    def wait(self, timeout: float) -> bool:
        """Wait for at most so many seconds until work has to stop; return whether it has to."""
        ...


class WorkerClosing:
    """Stop flag that is set when this thread's Dask worker is about to close, as at the end of its wall time."""

    def __init__(self) -> None:
        from distributed import get_worker  # an optional package

        self.worker = get_worker()

    def is_set(self) -> bool:
        """Return whether the worker is closing or closed."""
        return self.worker.status.name not in ("running", "paused")

    def wait(self, timeout: float) -> bool:
        """Sleep for so many seconds; return whether the worker is closing."""
        time.sleep(timeout)
        return self.is_set()


def scene_task(job: SceneJob, recipe: Recipe) -> dict[str, Any]:
    """Return what a scene's process has to be told, as JSON data."""
    return {
        "name": job.name,
        "number": job.number,
        "split": job.split,
        "scenario": job.scenario.to_dict(),
        "recipe": recipe.to_dict(),
    }


def run_on_worker(folder: str) -> Outcome:
    """Run the task in a folder on a Dask worker with its share of the cores; return how it ended.

    Raises:
        distributed.Reschedule: the worker closes; Dask has another one do it.
    """
    from distributed import Reschedule  # an optional package

    closing = WorkerClosing()
    outcome = run_task(folder, max(1, available_cores() // int(closing.worker.state.nthreads)), closing)
    if not closing.is_set():
        return outcome
    if (begun := len(list(Path(folder).glob(f"{_ATTEMPT}*")))) < MOST_WORKERS:
        raise Reschedule()
    return Outcome(outcome.folder, f"its workers ended before it did, {begun} times: they need more time")


def run_task(folder: str, threads: int, stopping: Stop) -> Outcome:
    """Run the process of a task in a folder, again if it is killed; return how it ended; stops if ``stopping`` is set.

    Each attempt has a folder of its own: one on a lost node may still be writing while the next is at work.
    """
    outcome = Outcome(Path(folder), "was not tried")
    for _ in range(ATTEMPTS):
        attempt = Path(tempfile.mkdtemp(prefix=_ATTEMPT, dir=folder))
        shutil.copy(Path(folder) / TASK, attempt)
        code = _run_process(attempt, threads, stopping)
        if stopping.is_set():
            return Outcome(attempt, "was stopped")
        if code == 0 and (attempt / DONE).is_file():
            return Outcome(attempt)
        if (attempt / FAILED).is_file():
            return Outcome(attempt, str(json.loads((attempt / FAILED).read_text(encoding="utf-8"))["error"]))
        outcome = Outcome(attempt, _reason(code, attempt / "log.txt"))
        if code > 0 and code != INTERRUPTED:  # a fault of its own: it would come again
            return outcome
    return outcome


def _run_process(path: Path, threads: int, stopping: Stop) -> int:
    """Run a scene's process in a folder until it ends or all is stopping; return its exit code, 0 if not begun."""
    if stopping.is_set():
        return 0
    command = [sys.executable, str(_MODULE), str(path / TASK), str(threads)]
    with (
        (path / "log.txt").open("wb") as log,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log) as process,
    ):  # at the end of this block its standard input is closed, which ends it
        while process.poll() is None and not stopping.wait(_TICK):
            pass
    return process.returncode


def _reason(code: int, log: Path) -> str:
    if code == INTERRUPTED:
        return f"its process was told to end, {ATTEMPTS} times"
    if code < 0:
        return f"its process was killed by signal {-code}, {ATTEMPTS} times (too little memory?)"
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return f"exit code {code}: {lines[-1] if lines else 'no message'}"


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
        known = sorted({job.split for job in self.jobs})
        for split in sorted((self.splits or frozenset()) - set(known)):
            raise InputError("--splits", split, f"must be of the recipe's: {', '.join(known)}")
        self._names = {job.name for job in self.jobs}
        self._sequences = {f"{job.number:02d}" for job in self.jobs}
        self._recipe_text = self.recipe.to_json()
        self._generator = generator()
        self._described: set[str] = set()

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
            again = "; what is done stays, --resume continues" if self.entries else ""
            raise OutputError("--output", str(self.folder), f"cannot be written ({error.strerror}){again}") from None
        return self._manifest()

    def _make(self, submit: Submit) -> None:
        """Make the missing scenes of the chosen splits, and publish each when it is complete."""
        chosen = [job for job in self.jobs if self.splits is None or job.split in self.splits]
        missing = [job for job in chosen if not self._is_done(job)]
        done = len(chosen) - len(missing)
        self.progress("scenes", done / len(chosen))
        for number, outcome in enumerate(submit([self._write_task(job) for job in missing]), start=1):
            self._publish(outcome)
            self.progress("scenes", (done + number) / len(chosen))

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
                raise OutputError("--output", str(self.folder), f"holds {name}, which is no scene's; move it away")
            begin_removal(self.folder, paths)
            write_manifest(self.folder, self._manifest())
        elif self.resume:
            manifest = check_same_recipe(self.folder, self._recipe_text, self._generator)
            done = [scene for scene in manifest.scenes if scene.status == "done"]
            self.entries = {scene.name: scene for scene in done if not faults(self.folder, [scene], checksums=False)}
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
                raise InputError(str(path), None, f"isn't as a run leaves it ({error}); remove {WORK}") from None
        return names

    def _unrecorded_folders(self, known: Set[str] = frozenset()) -> list[Path]:
        """Return existing folders named as scenes of the recipe that are neither recorded nor in ``known``."""
        there = {name for entry in self.entries.values() for name in entry.folders or ()} | known
        paths = [path for pattern in PUBLISHED for path in sorted(self.folder.glob(pattern)) if self._is_scenes(path)]
        return [path for path in paths if path.relative_to(self.folder).as_posix() not in there]

    def _remove_unrecorded(self) -> None:
        """Remove what an interrupted run has published and not recorded."""
        for path in self._unrecorded_folders():
            remove(self.folder, path.relative_to(self.folder), self.folder)

    def _place(self, name: str) -> Path:
        """Return a place in the folder that something is moved to; InputError if a link leads out of it."""
        return path_inside(self.folder, name, self.folder)

    def _is_scenes(self, path: Path) -> bool:
        """Return whether a folder's name is that of a scene of the recipe."""
        top = path.relative_to(self.folder).parts[0]
        if top == "semantickitti":
            return path.name in self._sequences
        return (path.name if top == "scenes" else path.name.rpartition("-")[0]) in self._names

    def _is_done(self, job: SceneJob) -> bool:
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
        about: dict[str, Any] = {"name": job.name, "split": job.split, "seed": job.scenario.seed}
        if outcome.error is None:
            done = json.loads((outcome.folder / DONE).read_text(encoding="utf-8"))
            for name in done["folders"]:
                target = self._place(published_name(name))
                target.parent.mkdir(parents=True, exist_ok=True)
                (outcome.folder / FILES / name).rename(target)
            self._describe_layouts()  # before it is recorded: a set that is stopped now can be learned from
            entry = SceneEntry.from_dict({**about, "status": "done", **done}, "scene")
            (outcome.folder / "report.json").replace(self._place(f"logs/{job.name}.json"))
            if not entry.points:
                logger.warning("warning: %s: not one pulse came back", job.name)
            logger.debug("%s is done: %s points", job.name, f"{entry.points:,}")
        else:
            entry = SceneEntry.from_dict({**about, "status": "failed", "error": outcome.error}, "scene")
            with suppress(FileNotFoundError):  # of a lost worker there is none
                (outcome.folder / "log.txt").replace(self._place(f"logs/{job.name}.txt"))
            logger.error("failed: %s: %s", job.name, outcome.error)
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
        self._described.clear()
        self._describe_layouts()
        write_atomically(self.folder / "DATA_CARD.md", data_card(self.recipe, manifest, self.jobs))
        shutil.rmtree(self.folder / WORK, ignore_errors=True)

    def _describe_layouts(self) -> None:
        """Write the description of each layout that has a scene by now, unless this run has written it already."""
        for name, text in self._layout_texts.items():
            if name not in self._described and (self.folder / name).parent.is_dir():
                write_atomically(self._place(name), text)
                self._described.add(name)

    @cached_property
    def _layout_texts(self) -> dict[str, str]:
        return layout_descriptions(self.recipe, self.jobs)


Submit = Callable[[list[str]], Iterator[Outcome]]
"""Has the tasks in these folders done, and yields how each ended, in any order."""


def local_processes(jobs: int) -> Submit:
    """Return a function that runs tasks in so many processes at once on this machine."""

    threads = max(1, available_cores() // jobs)

    def submit(folders: list[str]) -> Iterator[Outcome]:
        stopping = Event()
        pool = ThreadPoolExecutor(jobs)
        begun: list[str] = []
        ended: list[str] = []

        def task(folder: str) -> Outcome:
            begun.append(folder)
            try:
                return run_task(folder, threads, stopping)
            finally:
                ended.append(folder)

        try:
            for future in as_completed([pool.submit(task, folder) for folder in folders]):
                yield future.result()
        finally:
            stopping.set()
            pool.shutdown(wait=True, cancel_futures=True)
            # The pool doesn't know, and doesn't wait for, a thread that was just starting when the user interrupted.
            while len(ended) < len(begun):
                time.sleep(_TICK)

    return submit


def dask_workers(address: str, patience: float = 1800.0) -> Submit:
    """Return a function that runs tasks on a Dask cluster, whose workers must see the folder under the same path.

    The scheduler is called at once, before anything in the folder is touched.

    Args:
        address: the scheduler's.
        patience: seconds without a single worker after which the work is given up; within them new ones may come.

    Raises:
        InputError: nobody answers at the address, the packages are missing, the scheduler is lost meanwhile, or no
            worker is there for too long.
    """
    try:
        import distributed
    except ImportError:
        raise InputError("--scheduler", address, "needs Dask: pip install 'synthroads[cluster]'") from None
    try:
        client = distributed.Client(address, timeout=_ANSWER, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError("--scheduler", address, f"nobody answers there ({error})") from None

    def submit(folders: list[str]) -> Iterator[Outcome]:
        with client:
            futures = client.map(run_on_worker, folders, key=folders, retries=ATTEMPTS, pure=False)
            for future in _ended_futures(client, futures, WorkerAbsence(address, patience)):
                yield _outcome(future, address)

    return submit


def _ended_futures(client: Any, futures: list[Any], absence: WorkerAbsence) -> Iterator[Any]:
    """Yield Dask futures as they end; raises an InputError if the cluster has no worker for too long."""
    from distributed import as_completed as completed  # an optional package

    ending, looked = completed(futures, loop=client.loop, raise_errors=False), 0.0
    while not ending.is_empty():
        if ending.has_ready():
            yield from ending.next_batch(block=False)
            continue
        time.sleep(_TICK)
        if client.status == "running" and time.monotonic() - looked >= _LOOK:
            looked = time.monotonic()
            absence.update(len(client.scheduler_info(n_workers=-1)["workers"]), looked)


def _outcome(future: Any, address: str) -> Outcome:
    """Return how the task of an ended Dask future ended; raises an InputError if the scheduler was lost."""
    if future.status == "finished":
        return cast(Outcome, future.result())
    if future.status == "error":
        return Outcome(Path(future.key), f"its worker was lost ({future.exception()})")
    raise InputError("--scheduler", address, "was lost; --resume continues with what is done")


class WorkerAbsence:
    """Timer of how long a cluster has had no worker: warns after a minute, raises after too long.

    Args:
        address: the scheduler's.
        patience: seconds after which it is an error.
    """

    def __init__(self, address: str, patience: float) -> None:
        self._address, self._patience = address, patience
        self._since: float | None = None
        self._said = False

    def update(self, workers: int, now: float) -> None:
        """Update the timer with the number of workers at a time, s.

        Raises:
            InputError: there has been none for too long.
        """
        if workers:
            if self._said:
                logger.warning("%s has workers again: %d", self._address, workers)
            self._since, self._said = None, False
            return
        self._since = now if self._since is None else self._since
        if now - self._since >= self._patience:
            allowed = f"had no worker for {self._patience:g} s (--worker-timeout); --resume continues with what is done"
            raise InputError("--scheduler", self._address, allowed)
        if now - self._since >= min(_SOON, 0.5 * self._patience) and not self._said:
            self._said = True
            logger.warning(
                "warning: %s has no worker; waiting for one, up to %g s in all", self._address, self._patience
            )
