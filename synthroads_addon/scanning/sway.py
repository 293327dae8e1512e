"""How a platform really sways about its planned path: turbulence, steering, bumps.

Each of position x, y, z, roll, pitch and heading is a sum of sines whose periods are drawn evenly on a logarithmic
scale and whose phases are drawn as well: by the central limit theorem nearly Gaussian, with a known standard deviation,
smooth, and worked out for any time by itself. It is the truth, not an error: the scanner knows where it is.
"""

import math
from dataclasses import dataclass

import numpy as np
from pydantic import model_validator

from ..base.arrays import Float
from ..base.random_streams import stream
from ..base.schema import ClosedModel, quantity
from .knots import NODE_ERROR, NODES
from .noise import measured_pose
from .platforms.path import KNOT_ERROR, KNOT_RANGE, Path, Strip, epoch_of, knot_spacing_for

_SINES = 24
_AXES = 6
_CREST = 4.0
"""Standard deviations that a Gaussian process hardly ever exceeds."""


class Motion(ClosedModel):
    """Random sway of the platform about its path: standard deviations (0 is none) and range of periods."""

    position_sigma: float = quantity(0.0, "m", "Lateral and vertical position, each axis.", (0, 10), title="Position")
    attitude_sigma_deg: float = quantity(0.0, "deg", "Roll and pitch.", (0, 10), title="Roll, Pitch (°)")
    heading_sigma_deg: float = quantity(0.0, "deg", "Heading.", (0, 10), title="Heading (°)")
    shortest_period: float = quantity(
        1.0, "s", "Shortest period of the swaying.", (0.02, 1000), title="Shortest Period"
    )
    longest_period: float = quantity(20.0, "s", "Longest period of the swaying.", (0.02, 1000), title="Longest Period")
    period_exponent: float = quantity(
        0.0, "1", "Exponent of the period in its amplitude; 0: the same for all.", (0, 3), title="Slow Sway"
    )

    @model_validator(mode="after")
    def _periods_in_order(self) -> "Motion":
        """Raise ValueError if the shortest period exceeds the longest one."""
        if self.shortest_period > self.longest_period:
            raise ValueError(
                f"shortest_period {self.shortest_period:g} must be at most longest_period, {self.longest_period:g}"
            )
        return self

    @property
    def sigma(self) -> Float:
        """Return the standard deviations (6,) of x, y, z, m, and of roll, pitch and heading, rad."""
        attitude, heading = np.deg2rad([self.attitude_sigma_deg, self.heading_sigma_deg])
        return np.array([self.position_sigma] * 3 + [attitude, attitude, heading])


@dataclass(frozen=True)
class SwayingPath:
    """A path with random sway about a planned one; see `platforms.path.Path`.

    Attributes:
        planned: the path.
        motion: how it sways.
        seed: of the periods and phases; each strip has its own.
    """

    planned: Path
    motion: Motion
    seed: int

    @property
    def epoch(self) -> float:
        """Return what the planned path's times count from, s."""
        return epoch_of(self.planned)

    @property
    def strips(self) -> tuple[Strip, ...]:
        """Return the planned path's strips."""
        return self.planned.strips

    @property
    def typical_range(self) -> float:
        """Return the planned path's usual range, m."""
        return self.planned.typical_range

    @property
    def knot_spacing(self) -> float:
        """Return the largest time between two knots, s, by the bends of path and sway together."""
        of_path, of_sway = self.planned.knot_spacing, knot_spacing_for(self._bend(2))
        # A spacing goes with the bend to the power of -1/2, and bends add up.
        return float((of_path**-2 + of_sway**-2) ** -0.5)

    @property
    def knots_per_node(self) -> int:
        """Return the number of knots from one node, at which the pose is worked out, to the next.

        The poses at knots between nodes follow from polynomials, within a quarter of `KNOT_ERROR`.
        """
        largest_spacing = (KNOT_ERROR / 4.0 / (NODE_ERROR * self._bend(NODES))) ** (1.0 / NODES)
        # Where the planned path bends at once, polynomials err about as much as straight lines do.
        return max(1, int(min(largest_spacing, self.planned.knot_spacing / 2.0) / self.knot_spacing))

    def _bend(self, order: int) -> float:
        """Return a derivative by time of a place at `KNOT_RANGE`, in m/s^order, that its sway hardly ever exceeds.

        It is the `_CREST`-fold standard deviation of that place, times (2 pi / shortest period)^order and `_calmness`.
        """
        # Where all sines are at their crests it would be sqrt(2 N) sigma.
        reach = np.array([1.0] * 3 + [KNOT_RANGE] * 3)
        size = _CREST * float(np.linalg.norm(self.motion.sigma * reach))
        return size * (2.0 * np.pi / self.motion.shortest_period) ** order * _calmness(self.motion, order)

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return the planned path's positions (K, 3), m, and rotations (K, 3, 3), with sway, at times (K,), s."""
        return measured_pose(*self.planned.pose(strip, time), sway_offsets(self.motion, self.seed, strip.index, time))


def _calmness(motion: Motion, order: int) -> float:
    """Return the rms of a derivative of sway as a share, 0 to 1, of that of sway whose sines all have one amplitude.

    The periods T are even on a logarithmic scale; amplitudes go with T^exponent, a derivative multiplies by T^-order.
    """
    shortest, longest, exponent = motion.shortest_period, motion.longest_period, motion.period_exponent

    def mean_power(power: float) -> float:
        """Return the mean power of periods that are even on a logarithmic scale, times their span."""
        return (longest**power - shortest**power) / power if power else math.log(longest / shortest)

    if exponent == 0.0 or shortest == longest:
        return 1.0
    power_ratio = mean_power(2.0 * (exponent - order)) / mean_power(2.0 * exponent)
    return min(1.0, math.sqrt(power_ratio * mean_power(0.0) / mean_power(-2.0 * order)))


def sway_offsets(motion: Motion, seed: int, strip: int, time: Float) -> tuple[Float, Float]:
    """Return a platform's random deviations from its path at times (K,), s since the first strip's start.

    Returns:
        position (K, 3), m, along the local axes; roll, pitch and heading (K, 3), rad.
    """
    random = stream(seed, "platform motion", strip)
    shortest_log, longest_log = math.log(motion.shortest_period), math.log(motion.longest_period)
    periods = np.exp(random.uniform(shortest_log, longest_log, (_AXES, _SINES)))
    phases = random.uniform(0.0, 2.0 * np.pi, (_AXES, _SINES))
    weights = (periods / motion.longest_period) ** motion.period_exponent
    weights /= np.sqrt(np.mean(weights**2, axis=1, keepdims=True))
    angle = np.asarray(time, dtype=np.float64)[:, None, None] * (2.0 * np.pi / periods)
    angle += phases
    np.sin(angle, out=angle)
    angle *= weights
    values = angle.sum(axis=2) * (np.sqrt(2.0 / _SINES) * motion.sigma)
    return values[:, :3], values[:, 3:]


def with_motion(path: Path, motion: Motion, seed: int) -> Path:
    """Return a path with a platform's random sway added; the path itself if there is none."""
    return SwayingPath(path, motion, seed) if motion.sigma.any() else path
