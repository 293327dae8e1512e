"""`Single`: deformable kernel points and self-attention; each slice by itself."""

from typing import Literal

from pydantic import Field
from torch import Tensor, nn

from ...data.corridor import CORRIDOR
from ...registry import network
from .layers import DeformableKernelPoints, RelativeAttention, Tokens
from .models import CenterlineModel, Encoding, ModelOptions, Output


@network("centerline")
class SingleOptions(ModelOptions):
    """Options of the network `single`, which sees each slice by itself."""

    name: Literal["single"] = Field("single", description="Name of the network.")

    def build(self, half_width: float, slices: int) -> CenterlineModel:
        """Return the network for slices of +-`half_width`, m, with random weights; `slices` doesn't matter."""
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

    def encode(self, tokens: Tokens, coord: Tensor, mask: Tensor, features: Tensor, slices: int) -> Encoding:
        """Return tokens of moved kernel points after self-attention, and the context (N, D) of the N slices."""
        moved_tokens = self.deformable(coord, mask, features, tokens.features)
        features_after = tokens.features + moved_tokens.features
        for layer in self.attention:
            features_after = layer(features_after)
        return Tokens(features_after, moved_tokens.places, moved_tokens.heights), self.pool(features_after)

    def line(self, center: Tensor, outputs: Output, context: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        """Return each slice's own centre y (m) and regressed heading (rad), both (B, S): no line joins slices."""
        return center, outputs["corridor"][..., CORRIDOR.index("heading")]
