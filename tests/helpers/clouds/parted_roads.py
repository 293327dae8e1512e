"""Rural roads whose middle line parts for a turn lane or around a traffic island: thrown at random, sides cut off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthroads_addon.base.arrays import Float
from tests.helpers.clouds.foreign_clouds import paved

LENGTH, BEGIN, CUT = 300.0, 120.0, 50.0  # m; sides are cut off anew each 50 m
_LINE = 0.07  # m: half the width of a line
_SOLID = 20.0  # m before and behind the parting in which its line is solid


@dataclass(frozen=True)
class PartedRoad:
    """A road of 7 m whose middle line parts at 120 m.

    Attributes:
        island: its branches come together again behind 20 m; else one is a turn lane's, dashed, to the road's end.
        apart: m between the branches.
        taper: m along which they come apart.
        edges: it has edge lines.
        dashed: its middle line, where it doesn't part.
        seed: of where its sides are cut off.
    """

    island: bool
    apart: float
    taper: float
    edges: bool
    dashed: bool
    seed: int

    @property
    def __name__(self) -> str:
        """Return a name of its own: what is thrown depends on it."""
        return f"{'island' if self.island else 'turn'}{self.apart}{self.taper}{self.edges}"

    def __call__(self, offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
        """Return heights (N,), m, NaN where the cloud is cut off, and intensities (N,) from 0 to 1."""
        stations = np.array([BEGIN, BEGIN + self.taper, BEGIN + self.taper + 20.0, BEGIN + 2.0 * self.taper + 20.0])
        width = np.interp(station, stations, [0.0, self.apart, self.apart, 0.0 if self.island else self.apart])
        right, left = (np.abs(offset + sign * 0.5 * width) < _LINE for sign in (1.0, -1.0))
        dashed, short = ~np.full(len(station), self.dashed) | (station % 12.0 < 4.0), station % 6.0 < 3.0
        before = station < BEGIN - _SOLID
        if self.island:
            paint = (right | left) & (~before & (station < stations[3] + _SOLID) | dashed)
        else:
            paint = right & (~before | dashed) | left & (station > BEGIN) & ((station < stations[1]) | short)
        away = np.abs(offset) - 0.5 * width
        if self.edges:
            paint |= np.abs(away - 3.2) < _LINE
        height, bright = paved(away < 3.5, paint, rng)
        cuts = np.random.default_rng([self.seed, round(10.0 * self.apart), round(self.taper)])
        reach = cuts.uniform(3.0, 6.5, (2, round(LENGTH / CUT)))[:, np.minimum(station / CUT, 5).astype(int)]
        inside = (offset < reach[0] + 0.5 * width) & (offset > -reach[1] - 0.5 * width)
        return np.where(inside, height, np.nan), bright


PARTED = [
    PartedRoad(island, apart, taper, edges, seed != 2, seed)
    for island, apart, taper in (
        (False, 3.25, 40.0),
        (False, 3.25, 70.0),
        (False, 2.75, 25.0),
        (True, 2.5, 25.0),
        (True, 2.0, 15.0),
        (True, 3.5, 40.0),
    )
    for edges in (True, False)
    for seed in (1, 2, 3)
]
"""Turn lanes and islands, long and short, with and without edge lines."""
