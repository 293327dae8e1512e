"""Errors of the platform's measured position and attitude, correlated in time.

Each of position x, y, z, roll, pitch and heading is a stationary first-order Gauss-Markov process: Gaussian, with the
standard deviation sigma at every time and the correlation exp(-dt / T) between times dt apart (T the correlation time).

At knots T / 128 apart the process is exact: x[i+1] = a x[i] + sqrt(1 - a^2) w[i+1] with a = exp(-1 / 128) and white w.
Between two knots it is their weighted mean, with the weights of the conditional expectation (hyperbolic sines) divided
by its own standard deviation: the standard deviation is sigma there too, and the correlation differs from the
exponential by less than 0.004.

Innovations are drawn in blocks of 4096 knots, each from its own stream. What happened more than a block ago has lost
exp(-32) of its influence, so a block is computed from its own and the previous one's innovations alone: any time can
be asked for in any order, at the same cost.
"""

from functools import lru_cache

import numpy as np

from ..base.arrays import Float, Float32
from ..base.random_streams import stream
from ..base.rotations import rotation_matrix
from ..base.schema import ClosedModel, quantity
from .platforms.path import Strip

KNOTS_PER_CORRELATION_TIME = 128
BLOCK = 4096
"""Knots of a block."""

_AXES = 6
_FAINTEST = 0.05
"""Least factor on an intensity: its noise doesn't take all of an echo's light."""
_DRAWN = 400_000
"""Factors of which the mean logarithm is taken: it is known to a few thousandths of their standard deviation."""


class Noise(ClosedModel):
    """Random errors of the measurement, one sigma each; 0 is none."""

    range_bias: float = quantity(0.0, "m", "Systematic error of the range.", (-1, 1))
    range_sigma: float | None = quantity(
        None,
        "m",
        "Standard deviation of the range; the device's if not given.",
        (0, 1),
        title="Range",
        inherits="device.range_sigma",
    )
    angle_sigma_mrad: float = quantity(0.0, "mrad", "Pointing error, each axis.", (0, 20), title="Angle (mrad)")
    position_sigma: float = quantity(0.0, "m", "Platform's position, each axis.", (0, 10), title="Position")
    attitude_sigma_deg: float = quantity(0.0, "deg", "Platform's roll and pitch.", (0, 5), title="Roll, Pitch (°)")
    heading_sigma_deg: float = quantity(0.0, "deg", "Platform's heading.", (0, 5), title="Heading (°)")
    correlation_time: float = quantity(
        30.0,
        "s",
        "Time after which the correlation of a platform's errors is 1/e.",
        gt=0,
        le=10_000,
        title="Correlated over",
    )
    speckle: float = quantity(
        0.0,
        "1",
        "Relative standard deviation of the intensity: speckle and the detector's noise.",
        (0, 1),
        title="Intensity",
    )
    speckle_normal: float = quantity(
        0.0,
        "1",
        "Share of the intensity's variance that is normally distributed, as the mean over many grains and the "
        "detector's noise are; the rest is speckle, which is gamma distributed.",
        (0, 1),
        title="Normal Part of It",
    )
    dropout: float = quantity(0.0, "1", "Share of the returns that is lost at random.", (0, 1), title="Lost Returns")


def trajectory_errors(noise: Noise, seed: int, strip: Strip, time: Float) -> tuple[Float, Float]:
    """Return position (m) and attitude (rad) errors, (K, 3) each, of a strip's measured trajectory at times (K,), s.

    Args:
        noise: standard deviations and correlation time.
        seed: of the scan.
        strip: what the errors are for; each has its own.
        time: (K,) s.

    Returns:
        position (K, 3), m, along the local axes; roll, pitch and heading (K, 3), rad.
    """
    time = np.asarray(time, dtype=np.float64)
    attitude, heading = np.deg2rad([noise.attitude_sigma_deg, noise.heading_sigma_deg])
    sigma = np.array([noise.position_sigma] * 3 + [attitude, attitude, heading])
    if not sigma.any():
        return np.zeros((len(time), 3)), np.zeros((len(time), 3))
    knot_spacing = noise.correlation_time / KNOTS_PER_CORRELATION_TIME
    knot_position = np.maximum(time - strip.start_time, 0.0) / knot_spacing
    knot = np.floor(knot_position)
    block_numbers, knots_within = np.divmod(knot.astype(np.int64), BLOCK)
    weights_before, weights_after = _weights(knot_position - knot)
    unit_errors = np.empty((len(time), _AXES))
    for block in np.unique(block_numbers):
        rows = np.flatnonzero(block_numbers == block)
        process, knot_in_block = _process_block(seed, strip.index, int(block)), knots_within[rows]
        value_before = weights_before[rows, None] * process[knot_in_block]
        unit_errors[rows] = value_before + weights_after[rows, None] * process[knot_in_block + 1]
    unit_errors *= sigma
    return unit_errors[:, :3], unit_errors[:, 3:]


@lru_cache(maxsize=16)
def _process_block(seed: int, strip: int, block: int) -> Float:
    """Return the unit-variance process (`BLOCK` + 1, 6) at the knots of a block and the first knot of the next one.

    The result is cached, as many blocks of pulses share it.

    Args:
        seed: of the scan.
        strip: index of the strip.
        block: number of the block of knots within the strip.
    """
    # (Block, its innovations): the block before, whose influence lasts, this one, and the first one of the next.
    block_sizes = [(block - 1, BLOCK)] if block > 0 else []
    block_sizes += [(block, BLOCK), (block + 1, 1)]
    streams = ((stream(seed, "trajectory noise", strip, number), count) for number, count in block_sizes)
    innovations = np.concatenate([random.standard_normal((count, _AXES)) for random, count in streams])
    return _autoregression(innovations)[-BLOCK - 1 :]


def standard_normal(random: np.random.Generator, count: int) -> Float32:
    """Draw numbers (N,) of the standard normal distribution."""
    return random.standard_normal(count, dtype=np.float32)


def standard_exponential(random: np.random.Generator, count: int) -> Float32:
    """Draw numbers (N,) of the exponential distribution with the mean 1."""
    return random.standard_exponential(count, dtype=np.float32)


def shares(random: np.random.Generator, count: int) -> Float32:
    """Draw shares (N,), evenly from 0 to 1."""
    return random.random(count, dtype=np.float32)


def speckle_factors(random: np.random.Generator, count: int, sigma: float, normal: float = 0.0) -> Float32:
    """Draw factors (N,) on intensities with mean 1 and standard deviation sigma: a gamma and a normal part together.

    The light of a rough surface within one pulse is the sum of m = 1 / s^2 independent speckles, s being their relative
    standard deviation (Goodman 2007, Speckle Phenomena in Optics, chapter 4). What a footprint's many grains reflect
    together, and the detector's noise, are sums of many small parts: normal, by the central limit theorem. In decibels
    the gamma part has the skewness -s, the normal part three times that.

    Args:
        random: the stream.
        count: of factors.
        sigma: of both together.
        normal: share of the variance that is normal.
    """
    speckle = sigma * np.sqrt(1.0 - normal)
    if speckle:
        looks = 1.0 / (speckle * speckle)
        factors = random.standard_gamma(looks, count, dtype=np.float32) / np.float32(looks)
    else:
        factors = np.ones(count, dtype=np.float32)
    if normal:
        factors += np.float32(sigma * np.sqrt(normal)) * random.standard_normal(count, dtype=np.float32)
        np.maximum(factors, np.float32(_FAINTEST), out=factors)
    return np.asarray(factors)


@lru_cache(maxsize=16)
def mean_log_factor(sigma: float, normal: float = 0.0) -> float:
    """Return the mean natural logarithm of `speckle_factors`: for gamma factors by formula, else of many drawn ones."""
    if not normal:
        looks = 1.0 / sigma**2
        # digamma(m) - ln m, by its asymptotic series.
        return -0.5 / looks - 1.0 / (12.0 * looks**2) + 1.0 / (120.0 * looks**4)
    factors = speckle_factors(np.random.default_rng(0), _DRAWN, sigma, normal)
    return float(np.mean(np.log(factors, dtype=np.float64)))


def measured_pose(position: Float, rotation: Float, errors: tuple[Float, Float]) -> tuple[Float, Float]:
    """Return positions (K, 3), m, and rotations (K, 3, 3) as measured: the true ones with errors added.

    Roll and pitch have one standard deviation, so their errors tilt the platform about the local x axis and the local
    -y axis whatever its heading; a scanner that turns on a tripod is tilted with the tripod and not with its own turn.

    Args:
        position: (K, 3), m.
        rotation: (K, 3, 3).
        errors: position (K, 3), m, and roll, pitch and heading (K, 3), rad.
    """
    shift, (roll, pitch, heading) = errors[0], errors[1].T
    return position + shift, rotation_matrix(heading, pitch, roll) @ rotation


def _weights(share: Float) -> tuple[Float, Float]:
    """Return the weights (K,) of the knots before and after times at shares (K,), 0 to 1, of the way between them.

    They are those of the conditional expectation of the Gauss-Markov process, sinh((1 - s) h) and sinh(s h), divided
    by the standard deviation of that mean, so that interpolated values have unit variance as well.
    """
    step = 1.0 / KNOTS_PER_CORRELATION_TIME  # h: between two knots, in correlation times
    before_weight, after_weight = np.sinh((1.0 - share) * step), np.sinh(share * step)
    # The correlation of two neighbouring knots is exp(-h).
    deviation = np.sqrt(before_weight**2 + after_weight**2 + 2.0 * before_weight * after_weight * np.exp(-step))
    return before_weight / deviation, after_weight / deviation


def _autoregression(innovations: Float) -> Float:
    """Return the first-order process (N, 6) of unit variance that white innovations (N, 6) drive.

    x[i] is the sum of a^j w[i - j] over all j. It is built by doubling: sums over ``reach`` innovations, and a^reach
    times the sums that lie ``reach`` before them, are the sums over twice as many. That takes log2(N) passes.
    """
    correlation = np.exp(-1.0 / KNOTS_PER_CORRELATION_TIME)
    values = innovations.copy()
    values[1:] *= np.sqrt(1.0 - correlation * correlation)
    reach = 1
    while reach < len(values):
        values[reach:] += correlation**reach * values[:-reach].copy()
        reach *= 2
    return values
