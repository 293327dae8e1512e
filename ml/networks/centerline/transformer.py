"""`Transformer`: convolutions over slices x kernel points, and a transformer over the slices.

The latter runs at every kernel point and for all of them together; lines are found by soft-argmax, and the heading is
that of a parabola through the centres, in the frames' geometry.
"""

from typing import Literal

from pydantic import Field
from torch import Tensor, nn

from ...registry import network
from .layers import GridConvolution, RelativeAttention, Tokens
from .models import Encoding, ModelOptions, SequenceModel


@network("centerline")
class TransformerOptions(ModelOptions):
    """Options of the network `transformer`, with attention along the slices of a sequence."""

    name: Literal["transformer"] = Field("transformer", description="Name of the network.")

    def build(self, half_width: float, slices: int) -> SequenceModel:
        """Return the network for slices of +-`half_width`, m, with random weights of PyTorch's global generator."""
        return Transformer(self, half_width, slices)


class Transformer(SequenceModel):
    """Convolutions over slices x kernel points in turn with attention along the slices at every kernel point.

    What a slice knows as a whole goes through attention along the slices as well. Where paint is missing, other slices
    say where the line would be.
    """

    def __init__(self, options: ModelOptions, half_width: float, slices: int) -> None:
        super().__init__(options, half_width, slices)
        width, heads, dropout = options.width, options.heads, options.dropout
        self.grid = nn.ModuleList(GridConvolution(width, 3, 5) for _ in range(options.layers))
        self.along = nn.ModuleList(
            RelativeAttention(slices, width, heads, dropout) for _ in range(max(0, options.layers - 1))
        )
        self.summary = nn.ModuleList(RelativeAttention(slices, options.context, heads, dropout) for _ in range(2))

    def encode(self, tokens: Tokens, coord: Tensor, mask: Tensor, features: Tensor, slices: int) -> Encoding:
        """Return tokens after convolutions and attention along the slices, and the context (N, D) of the N slices."""
        grid = tokens.features.unflatten(0, (-1, slices))
        for number, layer in enumerate(self.grid):
            grid = layer(grid)
            if number < len(self.along):
                columns = grid.transpose(1, 2)
                grid = self.along[number](columns.flatten(0, 1)).view(columns.shape).transpose(1, 2)
        slice_tokens = grid.flatten(0, 1)
        context = self.pool(slice_tokens).unflatten(0, (-1, slices))
        for layer in self.summary:
            context = layer(context)
        return Tokens(slice_tokens, tokens.places, tokens.heights), context.flatten(0, 1)
