"""`Emission`: how pulses leave the scanner, by which rays each is sampled, and which of these needn't be cast."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from ..beam import BeamPattern, beam_pattern
from ..devices.device import ScannerSetting
from ..platforms.path import Path
from ..scene.bare_ground import BareGround
from ..scene.outline import Outline


@dataclass(frozen=True)
class Emission:
    """Pulses of a scan as the scanner fires them, and their footprints.

    Attributes:
        setting: the scanner's.
        path: the scanner's.
        rings: rays on each ring around the beam's axis.
        beam: whether the rays of a pulse diverge from the aperture or run parallel.
        on_vehicle: whether a vehicle carries the scanner.
        ground: where footprints that meet one plane alone are spared; None: every footprint is cast in full.
        outline: of the static scene, with room for a pulse's rays, by which pulses that meet nothing aren't cast; None:
            all are that the scene's bounds don't rule out.
    """

    setting: ScannerSetting
    path: Path
    rings: tuple[int, ...]
    beam: Literal["conical", "cylindrical"] = "conical"
    on_vehicle: bool = False
    ground: BareGround | None = None
    outline: Outline | None = None

    @cached_property
    def pattern(self) -> BeamPattern:
        """Return the rays of a pulse."""
        return beam_pattern(self.rings)
