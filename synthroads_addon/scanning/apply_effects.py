"""Effects applied to a block of traced pulses: echoes added, what is met weakened."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.random_streams import stream
from .devices.device import ScannerSetting
from .effects import EchoChanges, EchoEffect, Float, PulseHits
from .platforms.path import Strip
from .pulses import Pulses
from .radiometry import received_intensity
from .returns import UNCOUNTED, Marks
from .trace import Hits, Traced

BothMarks = tuple[Marks, Marks]
"""Marks of what rays meet first, and of what they meet behind it."""


@dataclass(frozen=True)
class EffectChain:
    """Effects of a scan, applied one after the other: each sees what those before it have left.

    Attributes:
        effects, seed, attenuation, setting: see `scanning.plan.ScanPlan`.
    """

    effects: tuple[EchoEffect, ...]
    seed: int
    attenuation: float
    setting: ScannerSetting

    def apply(
        self, strip: Strip, key: int, pulses: Pulses, traced: Traced, marks: BothMarks
    ) -> tuple[Traced, BothMarks]:
        """Return what the rays of a block meet, and its marks, after the effects.

        Echoes that are added join what lies behind permeable surfaces, with the face -1.

        Args:
            strip, key: of the block, for its random numbers.
            pulses: the block's.
            traced: what their rays meet.
            marks: what that adds to returns.

        Raises:
            ValueError: an effect's echoes are of no ray, or not finite numbers.
        """
        for effect in self.effects:
            hits = self._pulse_hits(pulses, traced, marks)
            changes = effect.change_echoes(hits, stream(self.seed, f"effect {effect.name}", strip.index, key))
            _check(effect.name, changes, hits.distance.shape)
            if changes.transmission is not None:
                traced, marks = _weaken(traced, marks, np.broadcast_to(changes.transmission, hits.distance.shape))
            traced, marks = self._add(traced, marks, changes)
        return traced, marks

    def _pulse_hits(self, pulses: Pulses, traced: Traced, marks: BothMarks) -> PulseHits:
        first, behind = marks
        ray, pulse = np.divmod(traced.ray, len(pulses.time))
        return PulseHits(
            time=pulses.time,
            origin=pulses.origin,
            direction=pulses.direction,
            share=traced.rays.share[:, 0],
            distance=first.distance,
            brightness=_brightness(first, self.attenuation),
            behind_pulse=pulse,
            behind_ray=ray,
            behind_distance=behind.distance,
            behind_brightness=_brightness(behind, self.attenuation),
            setting=self.setting,
        )

    def _add(self, traced: Traced, marks: BothMarks, changes: EchoChanges) -> tuple[Traced, BothMarks]:
        """Return hits and marks with those echoes of an effect that the scanner records."""
        distance = np.asarray(changes.distance, dtype=np.float64)
        here = np.flatnonzero((distance >= self.setting.minimum_range) & (distance <= self.setting.maximum_range))
        distance, brightness = distance[here], np.asarray(changes.brightness, dtype=np.float64)[here]
        none = np.zeros(len(here), dtype=np.intp)
        # In the air there is no face; it counts as one that lies across the beam.
        hits = Hits(none - 1, none, distance, none - 1.0, brightness)
        added = Marks(
            distance, np.maximum(brightness, UNCOUNTED), received_intensity(brightness, distance, self.attenuation)
        )
        first, behind = marks
        ray = changes.ray[here] * len(traced.rays.time) + changes.pulse[here]
        traced = replace(traced, behind=Hits.join([traced.behind, hits]), ray=np.concatenate([traced.ray, ray]))
        return traced, (first, Marks.join([behind, added]))


def _brightness(marks: Marks, attenuation: float) -> Float:
    """Return what a surface sends back, from the intensity that is received of it; 0 where nothing is."""
    white = received_intensity(1.0, marks.distance, attenuation)
    return np.divide(marks.intensity, white, out=np.zeros_like(white), where=white > 0.0)


def _check(name: str, changes: EchoChanges, shape: tuple[int, ...]) -> None:
    if not len(changes.pulse) == len(changes.ray) == len(changes.distance) == len(changes.brightness):
        raise ValueError(f"effect {name}: pulse, ray, distance and brightness must be as many")
    for index, count in ((changes.ray, shape[0]), (changes.pulse, shape[1])):
        if len(index) and not 0 <= index.min() <= index.max() < count:
            raise ValueError(f"effect {name}: echoes must be of one of {shape[0]} rays of {shape[1]} pulses")
    if not (np.isfinite(changes.distance).all() and np.isfinite(changes.brightness).all()):
        raise ValueError(f"effect {name}: distances and brightnesses must be finite numbers")


def _weaken(traced: Traced, marks: BothMarks, transmission: Float) -> tuple[Traced, BothMarks]:
    """Return hits and marks with factors (K, P) on the brightness; hits that send no light back are left out."""
    first, behind = marks
    left = transmission.ravel()[traced.ray]
    seen = np.flatnonzero(left > 0.0)
    first = Marks(
        distance=np.where(transmission > 0.0, first.distance, np.inf),
        weight=np.where(transmission > 0.0, first.weight * transmission, first.weight),
        intensity=first.intensity * transmission,
    )
    behind = Marks(behind.distance[seen], behind.weight[seen] * left[seen], behind.intensity[seen] * left[seen])
    return replace(traced, behind=traced.behind.select(seen), ray=traced.ray[seen]), (first, behind)
