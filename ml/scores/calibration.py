"""Standard deviations that mean what they say: one factor per target, found on validation roads.

A model's deviation s of an error e is calibrated if 68 % of all ``|e| / s`` lie below 0.994 and 95 % below 1.960, as
a Gaussian's would. One factor on s can bring one of both shares about; both only if the tails are Gaussian. The factor
here is the one that misses both by as little as possible, measured in `TOLERANCES`. Beside it stand the factors that
each share would need by itself (split conformal prediction: quantiles of ``|e| / s``): intervals made with them cover
what they say on roads like the validation's whatever the tails are.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from synthroads_addon.base.arrays import Float

LEVELS = (0.68, 0.95)
DEVIATIONS = (0.9944578832097532, 1.959963984540054)
"""Half-widths, in standard deviations, of the intervals in which a Gaussian error lies with probabilities `LEVELS`."""
TOLERANCES = (0.05, 0.03)
"""How far the covered shares may be from `LEVELS`."""


@dataclass(frozen=True)
class IntervalCalibration:
    """Correction of one target's standard deviations: a factor, and interval widths for 68 % and 95 %.

    Attributes:
        factor: factor on the model's standard deviation.
        widths: half-widths of the 68 % and the 95 % interval in units of the model's (uncorrected) standard deviation.
        before, after: shares that the Gaussian intervals cover on the validation roads, without and with the factor.
        count: number of errors that the calibration was found on.
    """

    factor: float = 1.0
    widths: tuple[float, float] = DEVIATIONS
    before: tuple[float, float] = (float("nan"), float("nan"))
    after: tuple[float, float] = (float("nan"), float("nan"))
    count: int = 0

    @property
    def holds(self) -> bool:
        """Return whether the one factor brings both shares within their tolerances."""
        return all(
            abs(share - level) <= tolerance
            for share, level, tolerance in zip(self.after, LEVELS, TOLERANCES, strict=True)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the calibration as JSON data, with `holds`."""
        return asdict(self) | {"holds": self.holds}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Return the calibration from `to_dict`'s data; None in pairs becomes NaN."""
        widths, share_before, share_after = (_pair(data[name]) for name in ("widths", "before", "after"))
        return cls(float(data["factor"]), widths, share_before, share_after, int(data["count"]))


def calibrate_target(error: Float, std: Float) -> IntervalCalibration:
    """Return the calibration that makes one target's deviations fit its errors; the identity without any known error.

    Args:
        error: (N,) errors; those that aren't finite don't count.
        std: (N,) the model's standard deviations in the same unit, > 0.
    """
    is_known = np.isfinite(error) & np.isfinite(std)
    ratio = np.sort(np.abs(error[is_known]) / std[is_known])
    if not len(ratio):
        return IntervalCalibration()
    widths = tuple(_conformal(ratio, level) for level in LEVELS)
    # The share that is covered changes only where the interval's end passes an error.
    candidate_factors = np.unique(np.concatenate([ratio / deviation for deviation in DEVIATIONS]))
    candidate_factors = candidate_factors[candidate_factors > 0.0]
    factor = (
        float(candidate_factors[np.argmin(_share_error(ratio, candidate_factors))]) if len(candidate_factors) else 1.0
    )
    return IntervalCalibration(
        factor, (widths[0], widths[1]), _covered_share(ratio, 1.0), _covered_share(ratio, factor), len(ratio)
    )


def _pair(values: Sequence[float | None]) -> tuple[float, float]:
    """Return two numbers as floats, NaN for None."""
    first_value, second_value = (float("nan") if value is None else float(value) for value in values)
    return first_value, second_value


def _conformal(ratio: Float, level: float) -> float:
    """Return the split conformal quantile of ascending ratios: a new one is below it with probability >= `level`."""
    rank = int(np.ceil(level * (len(ratio) + 1)))
    return float(ratio[min(rank, len(ratio)) - 1])


def _covered_share(ratio: Float, factor: float) -> tuple[float, float]:
    """Return the shares of errors within the 68 % and 95 % intervals of deviations times a factor."""
    shares = [float(np.searchsorted(ratio, factor * d, side="right") / len(ratio)) for d in DEVIATIONS]
    return shares[0], shares[1]


def _share_error(ratio: Float, factors: Float) -> Float:
    """Return for each factor (F,) the larger of the two levels' coverage errors, in units of `TOLERANCES`."""
    errors = [
        np.abs(np.searchsorted(ratio, factors * deviation, side="right") / len(ratio) - level) / tolerance
        for deviation, level, tolerance in zip(DEVIATIONS, LEVELS, TOLERANCES, strict=True)
    ]
    return np.maximum(*errors)
