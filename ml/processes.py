"""Several processes that train one model together, each on batches of its own, joined by torch.distributed.

The first one is the command's own. It starts the others, which read the same run, do as it does, and write nothing.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, distributed, multiprocessing
from torch._C._distributed_c10d import FileStore

from synthroads_addon.base.errors import InputError, SynthRoadsError
from synthroads_addon.base.scratch.folders import remove_scratch_folders

if TYPE_CHECKING:
    from .runs import Run

_MEETING = timedelta(minutes=10)
"""Time that a process waits for the others to begin."""
_GRACE = 60.0
"""Seconds in which this process has to notice by itself that another one was lost; over NCCL it waits on instead."""
_LOST = "one of the processes ended unexpectedly, perhaps because memory is short; --resume continues"
_PATIENCE = timedelta(days=2)
"""Time that a process waits for another one in later steps: the first process scores the validation data alone."""


def process_number() -> int:
    """Return this training process's rank from 0; 0 outside distributed training."""
    return distributed.get_rank() if distributed.is_initialized() else 0


def process_count() -> int:
    """Return the number of processes that train together; 1 outside distributed training."""
    return distributed.get_world_size() if distributed.is_initialized() else 1


def wait_for_all() -> None:
    """Wait until all processes that train together have reached this call."""
    if distributed.is_initialized():
        distributed.barrier()


def average(tensors: Sequence[Tensor]) -> None:
    """Replace tensors of one device and type, in place, by their means over all processes."""
    if process_count() == 1 or not tensors:
        return
    values = torch.cat([tensor.reshape(-1) for tensor in tensors])
    distributed.all_reduce(values)
    values /= process_count()
    for tensor, mean in zip(tensors, values.split([tensor.numel() for tensor in tensors]), strict=True):
        tensor.copy_(mean.view_as(tensor))


@contextmanager
def helper_processes(run: Run[Any], learn: Callable[[Run[Any]], object], device: torch.device) -> Iterator[None]:
    """Context in which the configuration's further processes run ``learn(run)``, joined by torch.distributed.

    Args:
        run: run whose configuration's ``processes`` is the number of processes, this one included.
        learn: function of a module that trains a run.
        device: device that this process trains on.

    Raises:
        InputError: one of them was lost, there are fewer CUDA devices than processes, or one device is named.
    """
    count = run.configuration.processes
    if count == 1:
        yield
        return
    if device.type == "cuda":
        _check_devices(count, run.configuration.device)
    # The processes find each other by a file in a temporary folder.
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        meeting = Path(folder) / "meeting"
        helpers = [
            context.Process(target=_run_helper, args=(learn, run, meeting, number, device.type))
            for number in range(1, count)
        ]
        for helper in helpers:
            helper.start()
        finish_event = Event()
        Thread(target=_exit_if_lost, args=(helpers, finish_event), daemon=True).start()
        try:
            _join_group(meeting, 0, count, device.type)
            yield
            for helper in helpers:
                helper.join()
        except RuntimeError as error:
            for helper in helpers:
                helper.join(1.0)
            if all(helper.is_alive() for helper in helpers):
                raise
            raise InputError("processes", count, _LOST) from error
        finally:
            finish_event.set()
            for helper in helpers:
                helper.kill()
            if distributed.is_initialized():
                distributed.destroy_process_group()


def _exit_if_lost(helpers: Sequence[Any], finish_event: Event) -> None:
    """Watch the other processes (in a thread); 60 s after one has failed, exit this one with code 2 if it hangs.

    NCCL waits for a lost process up to `_PATIENCE`, and nothing that is raised meanwhile reaches it.

    Args:
        helpers: processes that train with this one.
        finish_event: event that is set once this process waits for none of them any more.
    """
    while not finish_event.wait(1.0):
        if any(helper.exitcode for helper in helpers):
            break
    if not finish_event.wait(_GRACE):
        sys.stderr.write(f"error: {InputError('processes', len(helpers) + 1, _LOST)}\n")
        sys.stderr.flush()
        for helper in helpers:
            helper.kill()
        remove_scratch_folders()
        os._exit(2)


def _check_devices(count: int, device: str) -> None:
    """Raise `InputError` if there are more processes than CUDA devices, or one device is named for all."""
    if count > torch.cuda.device_count():
        raise InputError("processes", count, f"must not exceed the CUDA devices, {torch.cuda.device_count()}")
    if device not in ("auto", "cuda"):
        raise InputError("device", device, "must be cuda or auto if there are several processes, as each needs a GPU")


def _join_group(meeting: Path, number: int, count: int, device: str) -> None:
    """Join the process group of the training: NCCL on GPUs, Gloo on CPUs, met through a file."""
    store = FileStore(str(meeting), count)
    store.set_timeout(_MEETING)
    backend = "nccl" if device == "cuda" else "gloo"
    distributed.init_process_group(backend, store=store, rank=number, world_size=count, timeout=_PATIENCE)


def _run_helper(learn: Callable[[Run[Any]], object], run: Run[Any], meeting: Path, number: int, device: str) -> None:
    """Join the training and call ``learn(run)`` in a helper process; the first process reports the project's errors."""
    with suppress(SynthRoadsError, KeyboardInterrupt):
        _join_group(meeting, number, run.configuration.processes, device)
        learn(run)
        distributed.destroy_process_group()
