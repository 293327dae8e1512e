"""`Single`: deformable kernel points and self-attention; each slice by itself."""

from typing import Literal

from pydantic import Field
from torch import Tensor, nn

from ...data.corridor import CORRIDOR
from ...registry import network
from .layers import DeformableKernelPoints, RelativeAttention, Tokens
from .models import CenterlineModel, ModelOptions, Output


@network("centerline")
class SingleOptions(ModelOptions):
    """Each slice by itself."""

    name: Literal["single"] = Field("single", description="Network.")

    def build(self, half_width: float, slices: int) -> CenterlineModel:
        """See `ModelOptions.build`."""
        return Single(self, half_width)


class Single(CenterlineModel):
    """Deformable kernel points and self-attention over them, one slice at a time."""

    def __init__(self, options: ModelOptions, half_width: float) -> None:
        super().__init__(options, half_width, slices=1)
        width, count = options.width, options.kernel_points
        self.deformable = DeformableKernelPoints(count, half_width, options.point_width, width)
        self.attention = nn.ModuleList(
            RelativeAttention(count, width, options.heads, options.dropout) for _ in range(options.layers)
        )

    def look(self, tokens: Tokens, coord: Tensor, mask: Tensor, features: Tensor, slices: int) -> tuple[Tokens, Tensor]:
        """See `CenterlineModel.look`."""
        moved = self.deformable(coord, mask, features, tokens.features)
        mixed = tokens.features + moved.features
        for layer in self.attention:
            mixed = layer(mixed)
        return Tokens(mixed, moved.places, moved.heights), self.pool(mixed)

    def line(self, center: Tensor, found: Output, context: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        """See `CenterlineModel.line`: one slice knows no more than its own centre and direction."""
        return center, found["corridor"][..., CORRIDOR.index("heading")]
