"""Signs at the mouths of side roads: for giving way or stopping on the side road, for priority on the main road."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....base.schema import round_value
from ....road.geometry import alignment_of
from ....road.guidelines import SIGN_DISTANCE, SignRole, is_single
from ....road.side_roads.mouth import Mouth
from ....road.things.sign import TrafficSign
from ..layout import Layout, Roadside
from ..signs import country_sign_fields
from .signs import put_country_sign

_ON_CORNER = 0.75
"""Where the sign stands along the corner, as a share of its turn from the main road on. Chosen."""
_MARGIN = 0.1
"""How much farther than it must be the sign stands from the pavement, m. Chosen."""
_BEHIND = 15.0
"""From a mouth's end to the sign of the priority road behind it, m. Chosen."""
_ROOM = 30.0
"""How far that sign may be moved, m. Chosen."""
_APART = 60.0
"""Mouths nearer to each other along the road (m) share such a sign. Chosen."""
_ROLES: dict[str, SignRole] = {"give_way": "give_way", "stop": "stop"}
"""A side road's priority and the purpose of the sign at its mouth."""


def has_mouth_signs(layout: Layout) -> bool:
    """Return whether signs stand at the mouths of the road's side roads."""
    scenario = layout.site.scenario
    return is_single(layout.site.design_class) and scenario.furniture.signs and scenario.placement == "rules"


def plan_priority_signs(layout: Layout) -> None:
    """Place the signs of the priority road behind its mouths, for the traffic of either direction.

    Outside of towns they stand behind the junction (VwV-StVO on sign 306).
    """
    code = layout.site.guideline.sign_roles.get("priority_road")
    if code is None or not has_mouth_signs(layout):
        return
    mouths = [mouth for mouth in layout.site.mouths.values() if mouth.side_road.priority in _ROLES]
    for roadside in layout.sides.values():
        _priority_signs_of(roadside, code, mouths)


def _priority_signs_of(roadside: Roadside, code: str, mouths: list[Mouth]) -> None:
    """Place the signs of the priority road along one side."""
    ends = [mouth.high.start_station if roadside.traffic > 0 else mouth.low.start_station for mouth in mouths]
    last: float | None = None
    for end in sorted(ends, key=lambda station: roadside.traffic * station):
        if last is not None and abs(end - last) < _APART:
            continue
        last = end
        put_country_sign(roadside, code, roadside.ahead(end, _BEHIND), _ROOM)


def mouth_signs(layout: Layout) -> Iterator[tuple[str, TrafficSign]]:
    """Yield (id, sign) of the signs that face the traffic of side roads; farm roads, which always give way, have none.

    Each stands beside the corner that those who come pass, as near to the road as its arc allows.
    """
    if not has_mouth_signs(layout):
        return
    alignment = alignment_of(layout.site.alignment)
    for name, mouth in layout.site.mouths.items():
        role = _ROLES.get(mouth.side_road.priority)
        code = None if role is None else layout.site.guideline.sign_roles.get(role)
        if code is None:
            continue
        fields = country_sign_fields(code, {})
        corner = mouth.corner(mouth.incoming)
        beside = SIGN_DISTANCE + _MARGIN + fields["width"] / 2.0
        place = corner.arc(np.array([_ON_CORNER]), corner.radius - beside)
        station, depth = mouth.main_coordinates(place)
        heading = np.arctan2(-mouth.ahead[1], -mouth.ahead[0]) - alignment.heading(station)[0]
        yield (
            f"{name}-sign",
            TrafficSign(
                instance=1,
                station=round_value(float(station[0])),
                offset=round_value(float(mouth.offset(station, depth)[0])),
                rotation_deg=round_value(float(np.rad2deg(np.angle(np.exp(1j * heading))))),
                **fields,
            ),
        )
