"""The scenes of a data set on a Dask cluster, whose workers begin a process for each."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from ...base.errors import InputError, MissingPackageError
from ...base.machine import available_cores
from .processes import ATTEMPT, ATTEMPTS, Outcome, Submit, run_task

MOST_WORKERS = 8
"""Workers of a cluster that may end before a scene does, as their time is over, until it is given up."""
_ANSWER = 10.0
"""Seconds that a scheduler has for its answer."""
_TICK = 0.1
"""Seconds between two looks for tasks that have ended."""
_LOOK = 2.0
"""Seconds between two looks at who works on a cluster."""
_SOON = 60.0
"""Seconds without any worker after which it is said."""
TIMEOUT = "must be 1 s or more, and needs --scheduler"
_logger = logging.getLogger("synthroads")


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
    if (attempts := len(list(Path(folder).glob(f"{ATTEMPT}*")))) < MOST_WORKERS:
        raise Reschedule()
    return Outcome(
        outcome.folder, f"its workers ended before the scene was done, {attempts} times: give them more time"
    )


@dataclass(frozen=True)
class Cluster:
    """A Dask cluster, whose workers must see the data set's folder under the same path.

    Attributes:
        scheduler: address of the scheduler, tcp://HOST:PORT.
        worker_timeout: seconds without a single worker, 1 or more, after which the work is given up; within them new
            ones may come.

    Raises:
        InputError: the time is too short.
    """

    scheduler: str
    worker_timeout: float = 1800.0

    def __post_init__(self) -> None:
        if not 1.0 <= self.worker_timeout < 1e9:
            raise InputError("--worker-timeout", self.worker_timeout, TIMEOUT)


def dask_workers(cluster: Cluster) -> Submit:
    """Return a function that runs tasks on a Dask cluster.

    The scheduler is called at once, before anything in the folder is touched.

    Raises:
        InputError: nobody answers at the address, the packages are missing, the scheduler is lost meanwhile, or no
            worker is there for too long.
    """
    address = cluster.scheduler
    try:
        import distributed
    except ImportError:
        raise MissingPackageError("--scheduler", address, "distributed", "cluster") from None
    try:
        client = distributed.Client(address, timeout=_ANSWER, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError("--scheduler", address, f"no scheduler answers there ({error})") from None

    def submit(folders: list[str]) -> Iterator[Outcome]:
        """Have the tasks in folders done by the cluster's workers, and yield how each ended."""
        with client:
            futures = client.map(run_on_worker, folders, key=folders, retries=ATTEMPTS, pure=False)
            for future in _ended_futures(client, futures, WorkerAbsence(address, cluster.worker_timeout)):
                yield _outcome(future, address)

    return submit


def _ended_futures(client: Any, futures: list[Any], absence: WorkerAbsence) -> Iterator[Any]:
    """Yield Dask futures as they end; raises an InputError if the cluster has no worker for too long."""
    from distributed import as_completed as completed  # an optional package

    iterator, last_look = completed(futures, loop=client.loop, raise_errors=False), 0.0
    while not iterator.is_empty():
        if iterator.has_ready():
            yield from iterator.next_batch(block=False)
            continue
        time.sleep(_TICK)
        if client.status == "running" and time.monotonic() - last_look >= _LOOK:
            last_look = time.monotonic()
            absence.update(len(client.scheduler_info(n_workers=-1)["workers"]), last_look)


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
        self._is_told = False

    def update(self, workers: int, now: float) -> None:
        """Update the timer with the number of workers at a time, s.

        Raises:
            InputError: there has been none for too long.
        """
        if workers:
            if self._is_told:
                _logger.warning("%s has workers again: %d", self._address, workers)
            self._since, self._is_told = None, False
            return
        self._since = now if self._since is None else self._since
        if now - self._since >= self._patience:
            allowed = f"had no worker for {self._patience:g} s (--worker-timeout); --resume continues with what is done"
            raise InputError("--scheduler", self._address, allowed)
        if now - self._since >= min(_SOON, 0.5 * self._patience) and not self._is_told:
            self._is_told = True
            _logger.warning(
                "warning: %s has no worker; waiting for one, up to %g s in all", self._address, self._patience
            )
