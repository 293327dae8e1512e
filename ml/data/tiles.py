"""`CloudTile`: the labelled points of a piece of a scene, as training and scoring hold them in memory."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.arrays import AnyArray, Float, Float32, Int, UInt8
from synthroads_addon.cloud.colours import EIGHT_BITS, SIXTEEN_BITS

from .classes import IGNORED
from .points import voxel_sample


@dataclass(frozen=True)
class CloudTile:
    """N labelled points of a tile of one scene.

    Attributes:
        scene: name of the scene; intensities are scaled scene by scene.
        origin: (3,) float64 map coordinates of the origin of ``coord``, m.
        coord: (N, 3) float32, m.
        color: (N, 3) uint8 sRGB, or None where the scene has none.
        strength: (N,) float32 intensity as a share of 16 bits, or None where the scene has none.
        segment: (N,) int16 place of the class in the scheme, or `IGNORED`.
        offset: (N,) float32 distance to the left of the road's axis, m; None where
            there is no axis, or nobody asks for it.
    """

    scene: str
    origin: Float
    coord: Float32
    color: UInt8 | None
    strength: Float32 | None
    segment: NDArray[np.int16]
    offset: Float32 | None = None

    def __len__(self) -> int:
        return len(self.coord)

    def select(self, keep: AnyArray | slice) -> Self:
        """Return the points chosen by a mask, indices or a slice."""
        return replace(
            self,
            coord=self.coord[keep],
            color=None if self.color is None else self.color[keep],
            strength=None if self.strength is None else self.strength[keep],
            segment=self.segment[keep],
            offset=None if self.offset is None else self.offset[keep],
        )

    def class_counts(self, classes: int) -> Int:
        """Return the number of labelled points of each class (C,)."""
        return np.bincount(self.segment[self.segment != IGNORED], minlength=classes)


def eight_bits(rgb: AnyArray) -> UInt8:
    """Return 16-bit colours (N, 3) as 8 bits each."""
    return np.rint(rgb * (EIGHT_BITS / SIXTEEN_BITS)).astype(np.uint8)


@dataclass(frozen=True)
class Scaling:
    """Linear scaling of a scene's intensities to a feature: ``(intensity - shift) / span``."""

    shift: float = 0.0
    span: float = 1.0

    def apply(self, strength: Float32) -> Float32:
        """Return scaled intensities (N,) float32, clipped to -5 to 5."""
        return np.clip((strength - self.shift) / self.span, -5.0, 5.0).astype(np.float32)


def robust_scaling(strengths: Sequence[Float32]) -> Scaling:
    """Return the scaling to median 0 and 10th-to-90th-percentile span 1 of a scene's intensities.

    Args:
        strengths: intensities of the scene's tiles; without any, or where all are alike, the scaling changes nothing
            but the shift.
    """
    values = np.concatenate(strengths) if strengths else np.zeros(0, dtype=np.float32)
    if len(values) == 0:
        return Scaling()
    lower_decile, median, upper_decile = np.percentile(values, [10.0, 50.0, 90.0])
    return Scaling(float(median), float(upper_decile - lower_decile) if upper_decile > lower_decile else 1.0)


def scalings(tiles: Sequence[CloudTile], kind: str, voxel: float | None = None) -> dict[str, Scaling]:
    """Return the intensity scaling of each scene, by the scene's name.

    Args:
        tiles: tiles of all scenes.
        kind: ``robust``, or ``share``: the share of 16 bits as it stands.
        voxel: edge of the cells of which one point counts, m; None if all points count, as of thinned tiles.
    """
    if kind == "share":
        return dict.fromkeys((tile.scene for tile in tiles), Scaling())
    parts: dict[str, list[Float32]] = {}
    for tile in tiles:
        strengths = parts.setdefault(tile.scene, [])
        if tile.strength is not None:
            strengths.append(tile.strength if voxel is None else tile.strength[voxel_sample(tile.coord, voxel)])
    return {scene: robust_scaling(strengths) for scene, strengths in parts.items()}
