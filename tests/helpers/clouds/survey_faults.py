"""Faults of surveys and wear on thrown roads: gain steps between strips, patches, worn paint, rails cut out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from synthroads_addon.base.arrays import Bool, Float


@dataclass(frozen=True)
class SurveyFaults:
    """Faults of a survey, and wear, of one road.

    Attributes:
        gain_step: difference of two strips' intensities, dB.
        strip_border: offset of the strips' border in the middle of the road, m, and its slope, m/m.
        height_step: difference of their heights, m.
        patches: repairs, each with start, end (m along), right and left end (m across) and brightness (dB).
        waves: slow changes of the pavement's brightness along the road: amplitude (dB), wavelength (m), phase.
        tracks: brightness of wheel tracks beside the rest of a lane, dB.
        worn: mean share of a line's contrast that is lost.
        rails: offsets of guardrails that were cut out of the cloud, m, and half the width of each gap, m.
        footprint: diameter of a pulse's footprint, m, over which a point's intensity is a mean.
        speckle: standard deviation of the intensities' logarithm.
        seed: of the wear of each line.
    """

    gain_step: float = 0.0
    strip_border: tuple[float, float] = (0.0, 0.0)
    height_step: float = 0.0
    patches: tuple[tuple[float, float, float, float, float], ...] = ()
    waves: tuple[tuple[float, float, float], ...] = ()
    tracks: float = 0.0
    worn: float = 0.0
    rails: tuple[tuple[float, float], ...] = ()
    footprint: float = 0.0
    speckle: float = 0.15
    seed: int = 0

    @classmethod
    def draw(cls, seed: int, length: float, reach: float, rails: tuple[float, ...] = ()) -> Self:
        """Return faults drawn by a seed for a road.

        Args:
            seed: of the draw.
            length: of the road, m.
            reach: distance to either side that the cloud holds, m.
            rails: offsets at which guardrails may stand, m.
        """
        rng = np.random.default_rng([seed, 9])
        patches = []
        for _ in range(rng.integers(0, 5)):
            start, low = rng.uniform(0.0, length), rng.uniform(-0.8 * reach, 0.8 * reach)
            patches.append(
                (
                    start,
                    start + rng.uniform(4.0, 30.0),
                    low,
                    low + rng.uniform(1.5, 4.5),
                    rng.uniform(0.8, 2.2) * rng.choice([-1, 1]),
                )
            )
        waves = [(rng.uniform(0.0, 0.4), rng.uniform(30.0, 200.0), rng.uniform(0.0, 2.0 * np.pi)) for _ in range(3)]
        return cls(
            gain_step=float(rng.uniform(0.6, 1.4) * rng.choice([-1, 0, 1])),
            strip_border=(float(rng.uniform(-0.6, 0.6) * reach), float(rng.uniform(-0.08, 0.08))),
            height_step=float(rng.normal(0.0, 0.015)),
            patches=tuple(patches),
            waves=tuple(waves),
            tracks=float(rng.uniform(-0.5, 0.5)),
            worn=float(rng.uniform(0.0, 0.6)),
            rails=tuple((rail, float(rng.uniform(0.2, 0.4))) for rail in rails if rng.random() < 0.7),
            footprint=float(rng.uniform(0.1, 0.5)),
            speckle=float(rng.uniform(0.12, 0.25)),
            seed=seed,
        )

    def paint_share(self, distance: Float, width: float) -> Float:
        """Return the share (N,) of a footprint that a line (m) fills at distances (N,), m, from its middle."""
        if self.footprint == 0.0:
            return (distance < 0.5 * width).astype(np.float64)
        # Two boxes of these widths that lie over each other.
        overlap = np.clip(0.5 * (self.footprint + width) - distance, 0.0, min(self.footprint, width))
        return np.asarray(overlap / self.footprint)

    def paint_level(self, index: int, station: Float, ground: Float, paint: float) -> Float:
        """Return the intensity (N,) of a line's paint at stations (N,), m, worn by stretches down to its ground (N,).

        Args:
            index: of the line among the road's.
            station: (N,) m.
            ground: (N,) intensity of what the line is painted on.
            paint: intensity of fresh paint.
        """
        rng = np.random.default_rng([self.seed, 10, index])
        knots = np.clip(self.worn + rng.normal(0.0, 0.15, 40), 0.0, 0.9)
        lost = np.interp(station, 15.0 * np.arange(40), knots)
        return np.asarray(paint + lost * (ground - paint))

    def pavement_gain(self, station: Float, offset: Float) -> Float:
        """Return the factor (N,) of a pavement's intensity at stations and offsets (N,), m."""
        decibel = sum(
            (size * np.sin(2.0 * np.pi * station / wavelength + phase) for size, wavelength, phase in self.waves),
            np.zeros(len(station)),
        )
        decibel = decibel + self.tracks * np.cos(2.0 * np.pi * offset / 1.8)
        for start, end, low, high, level in self.patches:
            decibel = decibel + level * ((station > start) & (station < end) & (offset > low) & (offset < high))
        return 10.0 ** (decibel / 10.0)

    def second_strip(self, station: Float, offset: Float, length: float) -> Bool:
        """Return a mask (N,) of the points that the second strip holds, at stations and offsets (N,), m."""
        place, slope = self.strip_border
        return np.asarray(offset > place + slope * (station - 0.5 * length))

    def cut_out(self, offset: Float) -> Bool:
        """Return a mask (N,) of the points at offsets (N,), m, that are missing where a guardrail was cut out."""
        return np.any([np.abs(offset - rail) < half for rail, half in self.rails], axis=0) & (len(self.rails) > 0)
