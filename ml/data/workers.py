"""Data workers: processes that prepare batches, ended cleanly whatever ends the training."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.util import Finalize, get_temp_dir
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, TypeVar

from torch.utils.data import DataLoader

from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.base.scratch.folders import scratch_folder

B = TypeVar("B")


class Indexed(Protocol):
    """Data that give an item for each number, the same in every process."""

    def __getitem__(self, number: int, /) -> Any:
        """Return the item of a number."""


def load_batches(
    items: Indexed,
    numbers: Sequence[Sequence[int]],
    collate: Callable[[list[Any]], B],
    workers: int,
    *,
    pin_memory: bool = False,
) -> Iterator[B]:
    """Yield the batches that `collate` makes of items, in order, prepared by worker processes (0: by this one).

    Args:
        items: items of the batches, by number.
        numbers: numbers of each batch's items.
        collate: function that makes a batch of its items, called in the worker.
        workers: number of processes.
        pin_memory: whether tensors are put in pinned memory, from which a GPU copies faster.
    """
    loader: DataLoader[Any] = DataLoader(
        items,  # type: ignore[arg-type]
        batch_sampler=[[*batch] for batch in numbers],
        num_workers=workers,
        collate_fn=collate,
        pin_memory=pin_memory,
        worker_init_fn=silence_lost_pipes,
    )
    batches: Iterator[B] = iter(())
    if workers:
        shorten_sockets()
    try:
        with defer_interrupt():
            batches = iter(loader)
        yield from batches
    finally:
        # PyTorch calls it an error if a worker was ended by a signal, as all are that are interrupted: where only the
        # garbage collector hears of it, that is a traceback on standard error.
        with suppress(RuntimeError):
            if end_workers := getattr(batches, "_shutdown_workers", None):  # there only where workers are
                end_workers()


def shorten_sockets() -> None:
    """Place the sockets by which workers pass tensors in a folder whose name is short enough for the system.

    With too long a name no batch would ever arrive, and PyTorch would wait for it.

    Raises:
        OutputError: there is no folder with a short enough name.
    """
    default_folder = tempfile.gettempdir()
    if sys.platform == "win32" or _fits(default_folder) or _socket_folders:
        return
    for short_place in _SHORT_PLACES:
        with suppress(OSError):
            stack = ExitStack()
            folder = str(stack.enter_context(scratch_folder(Path(short_place))))
            _socket_folders.append(stack)
            Finalize(None, stack.close, exitpriority=_AFTER_SOCKETS)
            previous_folder, tempfile.tempdir = tempfile.tempdir, folder
            try:
                get_temp_dir()  # once for this process and its workers
            finally:
                tempfile.tempdir = previous_folder
            return
    raise OutputError(
        "temporary folder",
        default_folder,
        "must have a shorter name, as data workers use it; set TMPDIR to another folder",
    )


def _fits(folder: str) -> bool:
    """Return whether a socket's path in a folder is short enough for every system."""
    return len(os.fsencode(folder)) + len(_SOCKET) <= _LONGEST_SOCKET


_SHORT_PLACES = ("/tmp", "/var/tmp", "/dev/shm")  # nosec B108 # a folder of this user alone is made within
_SOCKET = "/pymp-12345678/listener-12345678"
"""Name of a socket of multiprocessing in the folder for temporary files."""
_LONGEST_SOCKET = 100
"""Longest name that each system takes."""
_AFTER_SOCKETS = -200
"""When the process ends, multiprocessing removes its sockets at -100."""
_socket_folders: list[ExitStack] = []
"""The folder for sockets, if it isn't the one for temporary files; removed when the process ends."""


@contextmanager
def report_lost_workers(workers: int) -> Iterator[None]:
    """Context that turns PyTorch's error about a killed data worker into an `InputError` of one line.

    Args:
        workers: number of workers.

    Raises:
        InputError: a worker was lost.
    """
    try:
        yield
    except RuntimeError as error:
        if not str(error).startswith("DataLoader worker (pid"):
            raise
        message = " ".join(str(error).partition(". ")[0].split())
        fault = (
            f"one of these processes ended unexpectedly ({message}), perhaps because memory is short; "
            "--resume continues, also with fewer workers"
        )
        raise InputError("workers", workers, fault) from None


def silence_lost_pipes(_worker: int) -> None:
    """Initialise a data worker so that it prints no broken-pipe traceback after its trainer ended."""
    previous_hook = sys.excepthook
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})  # its end by PyTorch, put off by `defer_interrupt`

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        """Print an error's traceback unless it is that of a lost connection."""
        if not issubclass(kind, (EOFError, ConnectionError)):
            previous_hook(kind, error, trace)

    sys.excepthook = hook


@contextmanager
def defer_interrupt() -> Iterator[None]:
    """Context that blocks SIGINT, SIGTERM and SIGHUP while processes are forked, which would lose them.

    The processes go on putting off Ctrl-C and a lost connection, until the one that started them ends; PyTorch has them
    end at once where they are told to by SIGTERM.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)
