"""Base of the networks that give every point a class."""

from __future__ import annotations

from torch import Tensor, nn

from ..configuration import Part

Batch = dict[str, Tensor]


class SegmentationNetwork(Part):
    """Base of a segmentation network's options: its name, its sizes, and how it is built."""

    name: str

    def build(self, features: int, classes: int) -> nn.Module:
        """Return the network with random weights.

        It is called with ``feat`` (N, features) and the whole batch, and returns the classes' scores (N, classes).
        """
        raise NotImplementedError

    def prepare(self, batch: Batch) -> Batch:
        """Return a batch with all that the network needs beside its points; called on the CPU, in workers."""
        return batch
