"""`record`: a scan from its plan to the points, block by block, into whatever takes them."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from itertools import islice
from typing import Any, Protocol

from ..base.machine import available_cores
from ..base.progress import StageTimer
from .blocks import Block
from .colour.colour import LayerSource
from .finish import Finish
from .plan import ScanPlan
from .scan import BlockResult, BlockScan, join_results

RETURNS_AT_ONCE = 400_000
"""Points that are rendered together: each rendering takes a tenth of a second whatever their number."""


_AHEAD = 12
"""Blocks that are computed ahead while others are rendered: about as many points as are rendered together."""


class Sink(Protocol):
    """Takes the blocks of a scan in their order: files, a view, a measurement."""

    def write(self, result: BlockResult) -> None:
        """Take a block, or several joined."""
        ...


class CollectedBlocks:
    """Sink that keeps the blocks in memory.

    Attributes:
        results: in the order of the plan's blocks.
    """

    def __init__(self) -> None:
        self.results: list[BlockResult] = []

    def write(self, result: BlockResult) -> None:
        """Keep a block."""
        self.results.append(result)


def record(plan: ScanPlan, sink: Sink, timer: StageTimer | None = None) -> dict[str, Any]:
    """Scan a plan into a sink: directions, rays, hits, returns, layers, intensities, noise, block by block.

    Where something is rendered, it must run in the main thread.

    Args:
        plan: the scan.
        sink: gets the blocks in their order.
        timer: of the stages ``images`` and ``scan``; its progress may raise `Cancelled`.

    Returns:
        what was rendered, as JSON data.
    """
    timer, (begin, end) = timer or StageTimer(), plan.progress
    total, done = plan.block_count(), 0
    with ExitStack() as stack:
        source = _open_layers(plan, stack, timer)
        with timer.stage("scan"):
            for result in scan_blocks(plan, source):
                sink.write(result)
                done += result.blocks
                timer.progress("scan", begin + (end - begin) * done / total)
        return {} if source is None else source.report


def record_as_measured(plan: ScanPlan) -> list[BlockResult]:
    """Return the blocks of a plan without layers or relief, with normals, materials and the places that were seen."""
    blocks = CollectedBlocks()
    record(
        replace(
            plan, services=None, records_seen_points=True, measured_layers=plan.measured_layers | {"normal", "material"}
        ),
        blocks,
    )
    return blocks.results


def _open_layers(plan: ScanPlan, stack: ExitStack, timer: StageTimer) -> LayerSource | None:
    """Return the source of the points' layers, which the stack closes; None where they stay as they are measured."""
    if plan.services is None or plan.request is None:
        return None
    with timer.stage("images"):
        return stack.enter_context(plan.services.layers(plan.request, lambda share: timer.progress("images", share)))


def scan_blocks(plan: ScanPlan, source: LayerSource | None = None) -> Iterator[BlockResult]:
    """Yield the blocks of a scan in their order, computed side by side; only a few are held at a time.

    Where colours are rendered return by return, several blocks come as one.

    Args:
        plan: the scan.
        source: of colours and layers; where it renders, that happens in the calling thread. Without it the blocks are
            as they were measured.
    """
    scan, finish = BlockScan(plan), None if source is None else Finish(plan, source)
    renders = source is not None and source.main_thread_only

    def work(block: Block) -> BlockResult:
        result = scan.block(*block)
        return result if finish is None or renders else finish.block(result)

    blocks = plan.blocks()
    if plan.target.caster.main_thread_only:
        results: Iterator[BlockResult] = map(work, blocks)
    else:
        results = _map_side_by_side(work, blocks, plan.threads or available_cores(), _AHEAD if renders else 1)
    if finish is None or not renders:
        yield from results
    else:
        yield from map(finish.block, _join_into_batches(results))


def _join_into_batches(results: Iterator[BlockResult]) -> Iterator[BlockResult]:
    """Yield blocks joined until they have `RETURNS_AT_ONCE`."""
    batch: list[BlockResult] = []
    for result in results:
        batch.append(result)
        if sum(len(one.points) for one in batch) >= RETURNS_AT_ONCE:
            yield join_results(batch)
            batch = []
    if batch:
        yield join_results(batch)


def _map_side_by_side(
    work: Callable[[Block], BlockResult], blocks: Iterator[Block], workers: int, ahead: int
) -> Iterator[BlockResult]:
    """Yield the results of blocks in their order, of which as many as there are workers are computed at once.

    Args:
        work: computes a block.
        blocks: the blocks.
        workers: threads.
        ahead: blocks beyond these that may wait until they are taken.
    """
    pool = ThreadPoolExecutor(workers)
    try:
        pending: list[Future[BlockResult]] = [pool.submit(work, block) for block in islice(blocks, workers + ahead)]
        while pending:
            yield pending.pop(0).result()
            pending += [pool.submit(work, block) for block in islice(blocks, 1)]
    finally:
        # Where the work is stopped, what has not begun is dropped.
        pool.shutdown(wait=True, cancel_futures=True)
