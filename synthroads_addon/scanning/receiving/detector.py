"""Which echoes of a block the receiver detects: speckle, its noise, the threshold, and returns that are lost."""

from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import ArrayRows, Bool, Float, Float32, Index, UInt8
from ..devices.device import ScannerSetting
from ..pulses import Errors
from ..receiver import number_echoes, values_of_echoes
from ..returns import Echoes, number_returns
from .response import overlap_share, read_power

PROVISIONAL_THRESHOLD = 0.25
"""Share of the detector's threshold that keeps an echo while its intensity is still to change: no echo is expected to
become four times as bright as its material's mean makes it."""


@dataclass(frozen=True)
class Readout(ArrayRows):
    """Receiver's part in the intensities of N points, which it reads once nothing else changes them.

    Attributes:
        noise: (N,) that adds to the intensity; None without.
        channel: (N,) number of the laser; None where all have one gain.
        speckle: (N,) factors by which speckle has changed the power; None without.
        unread: (N,) whether the number is lost; None where none is.
    """

    noise: Float | None = None
    channel: UInt8 | None = None
    speckle: Float | None = None
    unread: Bool | None = None

    def read(self, intensity: Float, distance: Float, setting: ScannerSetting, gains: Float) -> tuple[Float, int]:
        """Return the numbers (N,) that the receiver gives, see `response.read_power`, and how many of them saturated.

        Args:
            intensity: (N,) received power without the receiver's noise.
            distance: (N,) measured ranges, m.
            setting: the scanner's.
            gains: (256,) of the lasers.
        """
        power = intensity if self.noise is None else intensity + self.noise
        number, clipped = read_power(power, distance, self.channel, gains, setting)
        return (number if self.unread is None else np.where(self.unread, 0.0, number)), clipped

    def detected(self, intensity: Float, threshold: float) -> Bool:
        """Return which of the points (N,) are detected."""
        return np.asarray(intensity >= (threshold if self.noise is None else threshold - self.noise))


def detect_echoes(
    echoes: Echoes, errors: Errors, number: Index, channel: UInt8, setting: ScannerSetting, *, provisional: bool
) -> tuple[Echoes, Readout, int]:
    """Return the echoes that are detected and not lost at random, what is still to be read of them, and the weak ones.

    Args:
        echoes: of a block.
        errors: of the block.
        number: (P,) of the echoes' pulses in the block.
        channel: (P,) lasers of these.
        setting: the scanner's.
        provisional: whether intensities are still to change: then all are kept that may be detected in the end.
    """
    if (share := overlap_share(setting, echoes.range)) is not None:
        echoes = replace(echoes, intensity=echoes.intensity * share)
    noise = speckle = None
    if errors.speckle is not None:
        speckle = _speckle_of_echoes(echoes, errors.speckle[number])
        echoes = replace(echoes, intensity=echoes.intensity * speckle)
    if errors.receiver is not None:
        noise = values_of_echoes(errors.receiver, number[echoes.pulse], number_echoes(echoes.pulse))
        noise *= setting.receiver.noise_sigma(setting.threshold)
    unread = None
    if errors.number is not None:
        shares = values_of_echoes(errors.number, number[echoes.pulse], number_echoes(echoes.pulse))
        unread = shares < (setting.receiver.lost_numbers or 0.0)
    readout = Readout(noise, channel[echoes.pulse] if setting.receiver.gain_sigma_db else None, speckle, unread)
    brightest = echoes.intensity / PROVISIONAL_THRESHOLD if provisional else echoes.intensity
    strong = np.flatnonzero(readout.detected(brightest, setting.threshold))
    weak = len(echoes.pulse) - len(strong)
    if weak:
        echoes, readout = echoes.select(strong), readout.select(strong)
    if errors.lost is not None:
        kept = _kept_echoes(echoes, errors.lost[number])
        echoes, readout = echoes.select(kept), readout.select(kept)
    return echoes, readout, weak


def _speckle_of_echoes(echoes: Echoes, factors: Float32) -> Float:
    """Return the factors (N,) by which speckle changes echoes, from those of pulses (P, returns), by their numbers.

    They are 1 beyond the last number that is recorded.
    """
    keep, number, _ = number_returns(echoes.pulse, factors.shape[1])
    chosen = np.flatnonzero(keep)
    result = np.ones(len(echoes.pulse))
    result[chosen] = factors[echoes.pulse[chosen], number - 1]
    return result


def _kept_echoes(echoes: Echoes, lost: Bool) -> Index:
    """Return the echoes that are not lost at random, by their number within the pulse."""
    keep, number, _ = number_returns(echoes.pulse, lost.shape[1])
    chosen = np.flatnonzero(keep)
    return np.asarray(chosen[~lost[echoes.pulse[chosen], number - 1]])
