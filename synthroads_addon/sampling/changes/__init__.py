"""Changes of a road between two epochs, drawn from a seed within a scenario's limits."""

from .changes import next_epoch, sample_changes

__all__ = ["next_epoch", "sample_changes"]
