"""Parts of a road that another program's file says, as objects of a parameter set; the rest is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .objects import RoadObject, Side
from .section import Carriageway, CrossfallPoint, LineMarking, Turnout
from .things.thing import Thing


@dataclass(frozen=True)
class GivenRoad:
    """The parts of a road that aren't drawn. All have the instance number 1, and ids as in a parameter set.

    Attributes:
        carriageways: by side, empty where they are drawn; their ids are ``carriageway-left`` and
            ``carriageway-right``. Their pavement is drawn.
        turnouts: by id.
        markings: by id; None where they are drawn.
        things: by id; None where they are drawn.
        crossfall: by side, of carriageways that are drawn; used where ``carriageways`` is empty.
    """

    carriageways: Mapping[Side, Carriageway] = field(default_factory=dict)
    turnouts: Mapping[str, Turnout] = field(default_factory=dict)
    markings: Mapping[str, LineMarking | RoadObject] | None = None
    things: Mapping[str, Thing] | None = None
    crossfall: Mapping[Side, tuple[CrossfallPoint, ...]] = field(default_factory=dict)
