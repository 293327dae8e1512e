"""Places of an interchange's ramps: at which carriageway, on which side of the crossing road, and of which form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ...road.objects import Side
from ...road.section import Carriageway
from ...scenario.interchange import InterchangeLimits


@dataclass(frozen=True)
class Quadrant:
    """A place of a ramp.

    Attributes:
        name: of its exit or entry.
        side: carriageway that it belongs to.
        kind: what traffic does there.
        ahead: 1 where the ramp's axis leaves the main road with its stations, -1 against them.
        sign: 1 at the left carriageway, -1 at the right one.
        is_loop: whether the ramp turns back by about 180 degrees, away from the main road.
    """

    name: str
    side: Side
    kind: Literal["exit", "entry"]
    ahead: float
    sign: float
    is_loop: bool = False

    @property
    def beside(self) -> float:
        """Return 1 where the ramp lies at higher stations than the crossing road, -1 at lower ones."""
        return self.ahead if self.is_loop else -self.ahead


def ramp_places(limits: InterchangeLimits, carriageways: Mapping[Side, Carriageway]) -> list[Quadrant]:
    """Return the places of an interchange's four ramps; loops come before the ramps that run around them.

    A diamond has a ramp in each quadrant. A half clover has both ramps of a carriageway in one: behind the crossing
    road, as traffic comes to it, the exit is a loop; before it the entry is.
    """
    result = []
    for side, carriageway in carriageways.items():
        traffic, sign = float(carriageway.traffic), float(carriageway.sign)
        is_behind = limits.loops == "exits" or (limits.loops == "one_side" and traffic > 0.0)
        kinds: tuple[Literal["exit", "entry"], ...] = ("exit", "entry")
        if limits.kind == "half_clover" and not is_behind:
            kinds = ("entry", "exit")
        for number, kind in enumerate(kinds):
            ahead = traffic if kind == "exit" else -traffic
            is_loop = limits.kind == "half_clover" and number == 0
            result.append(Quadrant(f"{kind}-{side}", side, kind, ahead, sign, is_loop))
    return result
