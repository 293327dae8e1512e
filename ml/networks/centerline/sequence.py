"""`Sequence`: fixed kernel points, and an LSTM that runs along the slices at every kernel point, both ways."""

from typing import Literal

from pydantic import Field
from torch import Tensor, nn

from ...registry import network
from .layers import GridConvolution, Tokens
from .models import Encoding, ModelOptions, SequenceModel


@network("centerline")
class SequenceOptions(ModelOptions):
    """Options of the network `sequence`, with an LSTM along the slices of a sequence."""

    name: Literal["sequence"] = Field("sequence", description="Name of the network.")

    def build(self, half_width: float, slices: int) -> SequenceModel:
        """Return the network for slices of +-`half_width`, m, with random weights of PyTorch's global generator."""
        return Sequence(self, half_width, slices)


class Sequence(SequenceModel):
    """Fixed kernel points, convolutions across each slice, and an LSTM along the slices at every kernel point."""

    def __init__(self, options: ModelOptions, half_width: float, slices: int) -> None:
        super().__init__(options, half_width, slices)
        width = options.width
        self.across = nn.ModuleList(GridConvolution(width, 1, 5) for _ in range(options.layers))
        self.along = nn.LSTM(width, width // 2, batch_first=True, bidirectional=True)
        self.after = nn.ModuleList(GridConvolution(width, 1, 5) for _ in range(min(1, options.layers)))
        self.summary = nn.LSTM(options.context, options.context // 2, batch_first=True, bidirectional=True)

    def encode(self, tokens: Tokens, coord: Tensor, mask: Tensor, features: Tensor, slices: int) -> Encoding:
        """Return tokens after convolutions and an LSTM along the slices, and the context (N, D) of the N slices."""
        grid = tokens.features.unflatten(0, (-1, slices))
        for layer in self.across:
            grid = layer(grid)
        sequences, _, count, width = grid.shape
        memory, _ = self.along(grid.transpose(1, 2).reshape(-1, slices, width))
        grid = grid + memory.view(sequences, count, slices, width).transpose(1, 2)
        for layer in self.after:
            grid = layer(grid)
        slice_tokens = grid.flatten(0, 1)
        context = self.pool(slice_tokens)
        context = context + self.summary(context.unflatten(0, (-1, slices)))[0].flatten(0, 1)
        return Tokens(slice_tokens, tokens.places, tokens.heights), context
