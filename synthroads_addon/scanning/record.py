"""`record`: a scan from its plan to the points, block by block, into whatever takes them."""

from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import islice
from threading import current_thread, main_thread
from typing import Any, Protocol, TypeAlias, TypeVar

from ..base.arithmetic.loops import loops_by
from ..base.arithmetic.noise import noise_by
from ..base.machine import available_cores, freed_memory_kept, linear_algebra_on_one_thread
from ..base.progress import StageTimer
from .blocks import Block
from .colour.colour import LayerSource
from .finish import Finish
from .plan import ScanPlan
from .scan import BlockResult, BlockScan, join_results

RETURNS_AT_ONCE = 250_000
"""Points that are rendered together: each rendering takes a tenth of a second whatever their number."""
_AHEAD = 8
"""Blocks that are computed ahead while others are rendered: about as many points as are rendered together."""
_FINISHED_AT_ONCE = 2
"""So many of these lots of points are finished side by side: one while another is rendered."""
T = TypeVar("T")
Wait: TypeAlias = Callable[[Future[BlockResult]], BlockResult]


class Sink(Protocol):
    """Interface of what takes a scan's blocks in their order: files, a view, a measurement."""

    def write(self, result: BlockResult) -> None:
        """Take the result of a block, or of several joined."""
        ...


class CollectedBlocks:
    """Sink that keeps the blocks in memory.

    Attributes:
        results: in the order of the plan's blocks.
    """

    def __init__(self) -> None:
        self.results: list[BlockResult] = []

    def write(self, result: BlockResult) -> None:
        """Append a block's result to `results`."""
        self.results.append(result)


def record(plan: ScanPlan, sink: Sink, timer: StageTimer | None = None) -> dict[str, Any]:
    """Scan a plan block by block into a sink, with layers and noise; return a summary of the renderings as JSON data.

    Where anything is rendered, it must be called in the main thread.

    Args:
        plan: the scan.
        sink: gets the blocks in their order.
        timer: of the stages ``images`` and ``scan``; its progress may raise `Cancelled`.
    """
    timer, (begin, end) = timer or StageTimer(), plan.run.progress
    block_count, finished_blocks = plan.block_count(), 0
    with ExitStack() as stack:
        source = _open_layers(plan, stack, timer)
        # Closed at once after an error, and not when the last of its traceback is gone: its threads use the source.
        with timer.stage("scan"), closing(scan_blocks(plan, source)) as results:
            for result in results:
                sink.write(result)
                finished_blocks += result.blocks
                timer.progress("scan", begin + (end - begin) * finished_blocks / block_count)
        return {} if source is None else source.report


def record_as_measured(plan: ScanPlan) -> list[BlockResult]:
    """Return the blocks of a plan scanned without layers or relief, with normals, materials and seen points."""
    blocks = CollectedBlocks()
    measured = plan.layers.measured | {"normal", "material"}
    record(replace(plan, layers=replace(plan.layers, services=None, seen_points=True, measured=measured)), blocks)
    return blocks.results


def _open_layers(plan: ScanPlan, stack: ExitStack, timer: StageTimer) -> LayerSource | None:
    """Return the source of the points' layers, which the stack closes; None where they stay as they are measured."""
    if plan.layers.services is None or plan.layers.request is None:
        return None
    with timer.stage("images"):
        return stack.enter_context(
            plan.layers.services.layers(plan.layers.request, lambda share: timer.progress("images", share))
        )


def scan_blocks(plan: ScanPlan, source: LayerSource | None = None) -> Generator[BlockResult, None, None]:
    """Scan a plan's blocks in parallel and yield their results in order; only a few are held at a time.

    Where materials are worked out or rendered return by return, several blocks come as one.

    Args:
        plan: the scan.
        source: of colours and layers; what it renders, the main thread renders. Without it the blocks are as they were
            measured.
    """
    with (
        linear_algebra_on_one_thread(),
        freed_memory_kept(),
        noise_by(plan.noise_kernel),
        loops_by(plan.point_loops),
    ):
        yield from _results(plan, source)


def _results(plan: ScanPlan, source: LayerSource | None) -> Iterator[BlockResult]:
    """Yield the results of a plan's blocks in order, finished if there is a source of layers: see `scan_blocks`."""
    workers, block_scan = plan.run.threads or available_cores(), BlockScan(plan)

    def scan(block: Block) -> BlockResult:
        """Return the result of a block."""
        return block_scan.scan_block(*block)

    if source is None:
        yield from _computed(scan, plan, workers, 1, Future.result)
        return
    if source.calls is None:
        finish = Finish(plan, source)
        yield from _computed(lambda block: finish.finish_block(scan(block)), plan, workers, 1, Future.result)
        return
    calls = source.calls
    blocks = _computed(scan, plan, workers, _AHEAD, calls.result_of)
    stop: Callable[[], None] = _nothing
    if current_thread() is main_thread():  # else, in the panel, the window's thread makes the calls to the end
        calls.open()
        stop = calls.close
    finishers = min(workers, _FINISHED_AT_ONCE)
    yield from _map_side_by_side(
        Finish(plan, source).finish_block, _join_into_batches(blocks), finishers, 0, calls.result_of, stop
    )


def _nothing() -> None:
    """Do nothing: the default of `_map_side_by_side` for what it calls before it waits for its threads."""


def _computed(
    work: Callable[[Block], BlockResult], plan: ScanPlan, workers: int, items_ahead: int, wait: Wait
) -> Iterator[BlockResult]:
    """Return an iterator over the results of a plan's blocks, in their order.

    Args:
        work: computes the result of a block.
        plan: the scan.
        workers: threads that compute side by side; where the caster needs the main thread, that one computes all.
        items_ahead: see `_map_side_by_side`.
        wait: waits for a result.
    """
    blocks = plan.blocks()
    if plan.target.caster.main_thread_only:
        return map(work, blocks)
    return _map_side_by_side(work, blocks, workers, items_ahead, wait)


def _join_into_batches(results: Iterator[BlockResult]) -> Iterator[BlockResult]:
    """Yield results joined, in order, into batches of `RETURNS_AT_ONCE` points or more; the last may have fewer."""
    batch: list[BlockResult] = []
    for result in results:
        batch.append(result)
        if sum(len(block.points) for block in batch) >= RETURNS_AT_ONCE:
            yield join_results(batch)
            batch = []
    if batch:
        yield join_results(batch)


def _map_side_by_side(
    work: Callable[[T], BlockResult],
    items: Iterator[T],
    workers: int,
    items_ahead: int,
    wait: Wait,
    stop: Callable[[], None] = _nothing,
) -> Iterator[BlockResult]:
    """Yield the results of ``work`` on items, in their order, from a pool of threads, a few items ahead.

    Args:
        work: computes an item.
        items: blocks, or results of several.
        workers: threads.
        items_ahead: items beyond these that may wait until they are taken.
        wait: waits for a result.
        stop: called before the threads are waited for in the end: they may wait for this one.
    """
    pool = ThreadPoolExecutor(workers)
    try:
        pending: list[Future[BlockResult]] = [pool.submit(work, item) for item in islice(items, workers + items_ahead)]
        while pending:
            yield wait(pending.pop(0))
            pending += [pool.submit(work, item) for item in islice(items, 1)]
    finally:
        stop()
        # Where the work is stopped, what has not begun is dropped.
        pool.shutdown(wait=True, cancel_futures=True)
