"""`Run`: how a scan is carried out: its random numbers, which blocks, by how many threads."""

from dataclasses import dataclass

from ..blocks import Block


@dataclass(frozen=True)
class Run:
    """One carrying out of a scan.

    Attributes:
        seed: of everything random but the surfaces' own fields (`Reflection.surface_seed`).
        threads: blocks that are worked on at once; 0 for every core.
        chosen_blocks: blocks that are scanned, in their order; all if None.
        progress: shares of a larger scan that are done before this one, and after it.
    """

    seed: int
    threads: int = 0
    chosen_blocks: tuple[Block, ...] | None = None
    progress: tuple[float, float] = (0.0, 1.0)
