"""Effects between tracing and returns, such as drops in the air, that change a pulse's echoes; and how they act."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from ..base.arrays import Float, Index
from .devices.device import ScannerSetting
from .pulses import Pulses
from .receiving.radiometry import received_intensity
from .returns import LEAST_REFLECTANCE, BothSignals, HitSignals
from .trace import Hits, TracedRays


@dataclass(frozen=True)
class PulseHits:
    """Hits of the K rays of each of P pulses, before returns are formed of them.

    Brightness is the share of the pulse's energy that a surface sends back: 1 for an ideal white target that all of
    the beam strikes at a right angle. What it makes of the intensity, by range and weather, isn't in it.

    Attributes:
        time: (P,) s since the first strip's start.
        origin: (3, P) where each pulse leaves the scanner, local, m.
        direction: (3, P) unit vectors of the beam's axis.
        share: (K,) of the pulse's energy that each ray stands for; they add up to 1.
        behind_pulse, behind_ray: (B,) pulse and ray of what lies behind leaves and the like, and of echoes that
            effects before this one have added.
        setting: the scanner's.
        attenuation: of the beam, 1/m of range.
        signals: received of what each ray meets first, and of what lies behind.
    """

    time: Float
    origin: Float
    direction: Float
    share: Float
    behind_pulse: Index
    behind_ray: Index
    setting: ScannerSetting
    attenuation: float
    signals: BothSignals

    @property
    def distance(self) -> Float:
        """Return the range (K, P) of what each ray meets first, m; inf where there is nothing within reach."""
        return self.signals[0].distance

    @property
    def behind_distance(self) -> Float:
        """Return the range (B,) of what lies behind, m."""
        return self.signals[1].distance

    # Few effects ask how bright things are.
    @cached_property
    def brightness(self) -> Float:
        """Return the brightness (K, P) of what each ray meets first; 0 where there is nothing."""
        return _brightness(self.signals[0], self.attenuation)

    @cached_property
    def behind_brightness(self) -> Float:
        """Return the brightness (B,) of what lies behind."""
        return _brightness(self.signals[1], self.attenuation)


@dataclass(frozen=True)
class EchoChanges:
    """Echoes that an effect adds to a block's pulses, and factors on the brightness of what their rays meet.

    Attributes:
        pulse, ray: (N,) pulse and ray of each echo that is added, as indices into `PulseHits.distance`.
        distance: (N,) range of these, m; those that the scanner doesn't record are left out.
        brightness: (N,) of these, see `PulseHits`.
        transmission: (K, P) factor on the brightness of all that a ray meets, 0 to 1; what is left with 0 isn't met
            at all. None leaves everything as bright as it is. It doesn't apply to the echoes that are added here.
    """

    pulse: Index = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    ray: Index = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    distance: Float = field(default_factory=lambda: np.empty(0))
    brightness: Float = field(default_factory=lambda: np.empty(0))
    transmission: Float | None = None


class EchoEffect(Protocol):
    """Interface of effects that add echoes to pulses or weaken what they meet.

    It is called from several threads, for blocks in any order, so it must keep nothing from one call to the next.
    """

    @property
    def name(self) -> str:
        """Return the effect's name, which keys its random numbers: another name gives others."""
        ...

    def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
        """Return the echoes to be added to a block of pulses, and the factors that weaken what its rays meet.

        Args:
            hits: what the pulses meet; of one block, pulses that meet nothing included.
            random: random numbers of this effect and this block, the same in whatever order blocks are scanned.
        """
        ...


def apply_effect(
    effect: EchoEffect,
    random: np.random.Generator,
    setting: ScannerSetting,
    attenuation: float,
    pulses: Pulses,
    traced_rays: TracedRays,
    signals: BothSignals,
) -> tuple[TracedRays, BothSignals]:
    """Return a block's traced rays and signals after an effect has added echoes and weakened what they meet.

    Echoes that are added join what lies behind permeable surfaces, with the face -1.

    Args:
        effect: sees what those before it have left.
        random: random numbers of this effect and this block.
        setting: the scanner's.
        attenuation: 1/m of range.
        pulses: the block's.
        traced_rays: what their rays meet.
        signals: what that adds to returns.

    Raises:
        ValueError: the effect's echoes are of no ray, or not finite numbers.
    """
    hits = _pulse_hits(setting, attenuation, pulses, traced_rays, signals)
    changes = effect.change_echoes(hits, random)
    _check(effect.name, changes, hits.distance.shape)
    if changes.transmission is not None:
        traced_rays, signals = _weaken(traced_rays, signals, np.broadcast_to(changes.transmission, hits.distance.shape))
    return _add_echoes(setting, attenuation, traced_rays, signals, changes)


def _pulse_hits(
    setting: ScannerSetting, attenuation: float, pulses: Pulses, traced_rays: TracedRays, signals: BothSignals
) -> PulseHits:
    """Return the hits of a block's rays as effects get them: with pulse and ray of what lies behind as two indices."""
    ray, pulse = np.divmod(traced_rays.ray, len(pulses.time))
    return PulseHits(
        time=pulses.time,
        origin=pulses.origin,
        direction=pulses.direction,
        share=traced_rays.rays.share[:, 0],
        behind_pulse=pulse,
        behind_ray=ray,
        setting=setting,
        attenuation=attenuation,
        signals=signals,
    )


def _add_echoes(
    setting: ScannerSetting, attenuation: float, traced_rays: TracedRays, signals: BothSignals, changes: EchoChanges
) -> tuple[TracedRays, BothSignals]:
    """Return traced rays and signals with an effect's echoes added, less those out of the scanner's range."""
    distance = np.asarray(changes.distance, dtype=np.float64)
    in_range = np.flatnonzero((distance >= setting.minimum_range) & (distance <= setting.maximum_range))
    distance, brightness = distance[in_range], np.asarray(changes.brightness, dtype=np.float64)[in_range]
    zeros = np.zeros(len(in_range), dtype=np.intp)
    # In the air there is no face; it counts as one that lies across the beam.
    hits = Hits(zeros - 1, zeros, distance, zeros - 1.0, brightness)
    added_signals = HitSignals(
        distance, np.maximum(brightness, LEAST_REFLECTANCE), received_intensity(brightness, distance, attenuation)
    )
    first_signals, behind_signals = signals
    ray = changes.ray[in_range] * len(traced_rays.rays.time) + changes.pulse[in_range]
    traced_rays = replace(
        traced_rays, behind=Hits.join([traced_rays.behind, hits]), ray=np.concatenate([traced_rays.ray, ray])
    )
    return traced_rays, (first_signals, HitSignals.join([behind_signals, added_signals]))


def _brightness(signals: HitSignals, attenuation: float) -> Float:
    """Return the brightness of surfaces (1: ideal white target) from received intensities; 0 where nothing is hit."""
    white = received_intensity(1.0, signals.distance, attenuation)
    return np.divide(signals.intensity, white, out=np.zeros_like(white), where=white > 0.0)


def _check(name: str, changes: EchoChanges, shape: tuple[int, ...]) -> None:
    """Raise `ValueError` if the echoes that an effect adds don't fit a block of ``shape`` = (K rays, P pulses)."""
    lengths = [len(array) for array in (changes.pulse, changes.ray, changes.distance, changes.brightness)]
    if len(set(lengths)) > 1:
        raise ValueError(
            f"effect {name}: pulse, ray, distance and brightness must have one value for each added echo, but have "
            f"{', '.join(map(str, lengths))} values"
        )
    for field_name, index, count in (("ray", changes.ray, shape[0]), ("pulse", changes.pulse, shape[1])):
        if len(index) and not 0 <= index.min() <= index.max() < count:
            raise ValueError(
                f"effect {name}: {field_name} of the added echoes must be 0 to {count - 1} (the block has {shape[0]} "
                f"rays for each of {shape[1]} pulses), but is {index.min()} to {index.max()}"
            )
    for field_name, values in (("distance", changes.distance), ("brightness", changes.brightness)):
        if not np.isfinite(values).all():
            raise ValueError(f"effect {name}: {field_name} of the added echoes must be finite numbers")


def _weaken(traced_rays: TracedRays, signals: BothSignals, transmission: Float) -> tuple[TracedRays, BothSignals]:
    """Return traced rays and signals whose brightness is multiplied by a ray's transmission (K, P).

    Where a ray's transmission is 0, its first hit is set to no hit (range inf) and its hits behind are dropped.
    """
    first_signals, behind_signals = signals
    hit_transmission = transmission.ravel()[traced_rays.ray]
    visible_hits = np.flatnonzero(hit_transmission > 0.0)
    first_signals = HitSignals(
        distance=np.where(transmission > 0.0, first_signals.distance, np.inf),
        weight=np.where(transmission > 0.0, first_signals.weight * transmission, first_signals.weight),
        intensity=first_signals.intensity * transmission,
    )
    behind_signals = HitSignals(
        behind_signals.distance[visible_hits],
        behind_signals.weight[visible_hits] * hit_transmission[visible_hits],
        behind_signals.intensity[visible_hits] * hit_transmission[visible_hits],
    )
    return replace(traced_rays, behind=traced_rays.behind.select(visible_hits), ray=traced_rays.ray[visible_hits]), (
        first_signals,
        behind_signals,
    )
