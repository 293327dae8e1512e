"""The second look: all slices of a sequence moved so that the road found at first runs straight through their middle.

What was found at first is known to a tenth of a kernel point's spacing. Seen from there, every road looks alike: lines
run straight along the slices, dashes of one slice complete those of another, and what is left to find is small.
"""

import torch
from torch import Tensor, nn

from ..base import full_precision
from .layers import GridConvolution, RelativeAttention, cell_features, cell_sums

_APART = (1, 3, 6)
"""How far the cells lie apart that each convolution looks at; five of them. Chosen: together they see the whole
grid."""
_PARABOLA_UNIT = 5.0
"""m: in this unit the places along a sequence are numbers of about one, of which parabolas are fitted well."""
_FIRST_LOG_STD = -1.5
"""Logarithm of the deviation, m, that an untrained network says. Chosen: 0.22 m, about what the first look leaves."""


class Refinement(nn.Module):
    """Layers that regress a centre's offset from its first estimate, by soft-argmax over fine cells around that.

    All cells have the same weights and see twice the sum of `_APART` cells to either side: a line between two lanes is
    found in the same way wherever the first look left it, or, where none is painted, by the lines on either side.

    Args:
        inputs: features of a point.
        width: features of a cell.
        context: features of a slice.
        slices: number of slices of a sequence, which see each other; with 1 each is alone.
        reach: distance to either side of the first estimate that the cells divide, m.
        cells: number of cells.
        heads: number of heads of the attention.
    """

    places: Tensor

    def __init__(
        self, inputs: int, width: int, context: int, slices: int, reach: float, cells: int, heads: int
    ) -> None:
        super().__init__()
        self.reach, self.cells, self.spacing = reach, cells, 2.0 * reach / cells
        self.register_buffer("places", self.spacing * (torch.arange(cells) + 0.5) - reach, persistent=False)
        self.first = nn.Linear(inputs + 2, width)
        slice_span = 5 if slices > 1 else 1
        self.grid = nn.ModuleList(GridConvolution(width, slice_span, 5, dilation) for dilation in _APART)
        self.local = nn.Linear(width, width)
        self.context = nn.Linear(context, width)
        self.where = nn.Sequential(nn.GELU(), nn.Linear(width, 2))
        self.seen = nn.Linear(width, context)
        self.along = RelativeAttention(slices, context, heads, 0.0) if slices > 1 else None
        self.spread = nn.Sequential(nn.LayerNorm(context), nn.Linear(context, 1))

    def forward(
        self, coord: Tensor, mask: Tensor, features: Tensor, guess: Tensor, heading: Tensor, context: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return the centre's offset (m) from the first estimate, its log deviation and the soft-argmax' logits.

        Args:
            coord: (B, S, P, 3) points, m.
            mask: (B, S, P) mask of the points that exist.
            features: (B, S, P, C).
            guess: (B, S) first estimate of the centre's y, m.
            heading: (B, S) first estimate of the direction in the slices' frames, rad.
            context: (B, S, D) of the slices.

        Returns:
            (B, S) offset of the centre to the left of the estimate, m, the logarithm of its deviation, and (B, S,
            cells) logits of the soft-argmax.
        """
        line_y = guess[..., None] + coord[..., 0] * torch.tan(heading)[..., None]
        straightened = coord - torch.stack([torch.zeros_like(line_y), line_y, torch.zeros_like(line_y)], dim=-1)
        sums = cell_sums(straightened.flatten(0, 1), mask.flatten(0, 1), features.flatten(0, 1), self.reach, self.cells)
        grid = self.first(cell_features(sums)).unflatten(0, guess.shape)
        for layer in self.grid:
            grid = layer(grid)
        logits, residual = self.where(self.local(grid) + self.context(context)[..., None, :]).unbind(-1)
        share = logits.softmax(-1)
        step = (share * (self.places + self.spacing * residual)).sum(-1)
        summary = self.seen((share[..., None] * grid).sum(-2)) + context
        if self.along is not None:
            summary = self.along(nn.functional.gelu(summary))
        return step, self.spread(nn.functional.gelu(summary))[..., 0] + _FIRST_LOG_STD, logits


@full_precision
def parabola(frame: Tensor, center: Tensor, weight: Tensor, stiffness: Tensor) -> tuple[Tensor, Tensor]:
    """Return y and direction, (B, S) in the slices' frames, of a weighted least-squares parabola per sequence.

    Args:
        frame: (B, S, 4) float64: x, y and direction of the slices' frames.
        center: (B, S) y of the centres in them, m.
        weight: (B, S) of the centres, > 0.
        stiffness: (3,) > 0, what offset, slope and curvature cost: this keeps the fit defined if places coincide.

    Returns:
        y (B, S) at which the parabola crosses the slices' orthogonals, m, and its direction (B, S) in them, rad.
    """
    origins, turn = _in_the_middle(frame, center.dtype)
    left_normals = torch.stack([-torch.sin(turn), torch.cos(turn)], dim=-1)
    points = origins + center[..., None] * left_normals
    # The middle's own offset costs nothing: a road far from the path is as good as one near it.
    middle = points.mean(1, keepdim=True)[..., 1]
    distance = points[..., 0] / _PARABOLA_UNIT
    powers = torch.stack([torch.ones_like(distance), distance, distance * distance], dim=-1)
    weighted_powers = powers * weight[..., None]
    # Ridge regression: (X'WX + diag(stiffness)) beta = X'Wy.
    normal = weighted_powers.transpose(1, 2) @ powers + torch.diag(stiffness)
    factors = _solve(normal, (weighted_powers * (points[..., 1] - middle)[..., None]).sum(1))
    value = (powers @ factors[..., None])[..., 0] + middle
    slope = (factors[:, 1:2] + 2.0 * factors[:, 2:] * distance) / _PARABOLA_UNIT
    # One step of Newton's method along the orthogonal: the parabola is nearly straight from here to there.
    step = (points[..., 1] - value) / (left_normals[..., 1] - slope * left_normals[..., 0])
    return center - step, torch.atan(slope) - turn


def _solve(matrix: Tensor, rhs: Tensor) -> Tensor:
    """Return x (B, 3) of symmetric positive definite systems matrix (B, 3, 3) x = rhs (B, 3), by Gaussian elimination.

    Written out, as neither ONNX nor batches of small systems on a GPU have a fast solver.
    """
    # The upper triangle of the matrix: rows (a, b, c), (d, e) and (f,).
    (a, b, c), (d, e), f = matrix[:, 0].unbind(-1), matrix[:, 1, 1:].unbind(-1), matrix[:, 2, 2]
    y0, y1, y2 = rhs.unbind(-1)
    # Forward elimination of the first column, then of the second.
    factor_1, factor_2 = b / a, c / a
    d, e = d - factor_1 * b, e - factor_1 * c
    factor_21 = e / d
    f = f - factor_2 * c - factor_21 * e
    y1 = y1 - factor_1 * y0
    y2 = y2 - factor_2 * y0 - factor_21 * y1
    # Back substitution.
    x2 = y2 / f
    x1 = y1 / d - factor_21 * x2
    return torch.stack([y0 / a - factor_1 * x1 - factor_2 * x2, x1, x2], dim=-1)


def _in_the_middle(frame: Tensor, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Return frames' origins (B, S, 2) and directions (B, S), -pi to pi, in their sequence's middle frame."""
    middle = frame[:, frame.shape[1] // 2, :]
    delta = frame[..., :2] - middle[:, None, :2]
    cos, sin = torch.cos(middle[:, 2:3]), torch.sin(middle[:, 2:3])
    x, y = delta.unbind(-1)
    origins = torch.stack([cos * x + sin * y, cos * y - sin * x], dim=-1)
    # Directions of a path towards the west jump by a whole turn.
    turn = torch.remainder(frame[..., 2] - middle[:, 2:3] + torch.pi, 2.0 * torch.pi) - torch.pi
    return origins.to(dtype), turn.to(dtype)
