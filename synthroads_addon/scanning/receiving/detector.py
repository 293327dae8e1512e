"""Which echoes of a block the receiver detects: speckle, its noise, the threshold, and returns that are lost."""

from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import ArrayRows, Bool, Float, Index, UInt8
from ..devices.device import ScannerSetting
from ..pulses import Errors
from ..receiver import number_echoes, values_of_echoes
from ..returns import Echoes
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
        """Return a mask (N,) of the points that are detected.

        Args:
            intensity: (N,) received power without the receiver's noise.
            threshold: of detection.
        """
        return np.asarray(intensity >= (threshold if self.noise is None else threshold - self.noise))


def detect_echoes(
    echoes: Echoes,
    errors: Errors,
    number: Index,
    channel: UInt8,
    setting: ScannerSetting,
    *,
    dropout: float = 0.0,
    provisional: bool,
) -> tuple[Echoes, Readout, int]:
    """Return the echoes that are detected and not lost at random, their readout, and the number of weak ones.

    Args:
        echoes: of a block.
        errors: of the block.
        number: (P,) of the echoes' pulses in the block.
        channel: (P,) lasers of these.
        setting: the scanner's.
        dropout: share of the echoes that is lost at random.
        provisional: whether intensities are still to change: then all are kept that may be detected in the end.
    """
    if (share := overlap_share(setting, echoes.range)) is not None:
        echoes = replace(echoes, intensity=echoes.intensity * share)
    speckle, noise, unread_shares, lost_shares = _values_of_errors(echoes, errors, number)
    if speckle is not None:
        echoes = replace(echoes, intensity=echoes.intensity * speckle)
    if noise is not None:
        noise *= setting.receiver.noise_sigma(setting.threshold)
    unread = None if unread_shares is None else unread_shares < (setting.receiver.lost_numbers or 0.0)
    readout = Readout(noise, channel[echoes.pulse] if setting.receiver.gain_sigma_db else None, speckle, unread)
    brightest = echoes.intensity / PROVISIONAL_THRESHOLD if provisional else echoes.intensity
    is_recorded = readout.detected(brightest, setting.threshold)
    weak_count = len(echoes.pulse) - int(np.count_nonzero(is_recorded))
    if lost_shares is not None:
        is_recorded &= lost_shares >= dropout
    if not is_recorded.all():
        rows = np.flatnonzero(is_recorded)
        echoes, readout = echoes.select(rows), readout.select(rows)
    return echoes, readout, weak_count


def _values_of_errors(echoes: Echoes, errors: Errors, number: Index) -> tuple[Float | None, ...]:
    """Return the echoes' random numbers (N,): speckle, noise, and shares for lost numbers and lost echoes.

    Each is None where there is no such error.

    Args:
        echoes: of a block.
        errors: of the block.
        number: (P,) of the echoes' pulses in the block.
    """
    block_values = (errors.speckle, errors.receiver, errors.number, errors.lost)
    if all(values is None for values in block_values):
        return None, None, None, None
    pulse, echo_number = np.take(number, echoes.pulse), number_echoes(echoes.pulse)
    return tuple(None if values is None else values_of_echoes(values, pulse, echo_number) for values in block_values)
