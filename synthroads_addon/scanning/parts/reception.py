"""`Reception`: what is measured of the echoes: errors, times, and when the detector decides."""

from dataclasses import dataclass

from ..noise import Noise
from ..strip_errors import Outage, StripErrors


@dataclass(frozen=True)
class Reception:
    """Measurement of the echoes that come back, beyond what the scanner's setting says of its receiver.

    Attributes:
        noise: random errors of the measurement.
        strip_errors: systematic errors of its strips.
        outages: stretches of the strips in tunnels, without GNSS.
        epoch: what the times of points count from, s.
        after_layers: whether intensities still change by the points' own layers, see `finish`: until then every echo
            that may pass the detector is kept, and nothing saturates.
        range_corrected: intensities are multiplied by the squared range, after the detector.
    """

    noise: Noise = Noise()  # noqa: RUF009 (frozen)
    strip_errors: StripErrors = StripErrors()  # noqa: RUF009 (frozen)
    epoch: float = 0.0
    after_layers: bool = False
    range_corrected: bool = False
    outages: tuple[Outage, ...] = ()
