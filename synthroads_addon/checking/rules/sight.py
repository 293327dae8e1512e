"""Rule for the sight that drivers need to stop (RAL), worked out from curvatures and grades alone."""

from collections.abc import Iterator

import numpy as np

from .edges import Float
from .rule import TOLERANCE, Finding, Road, Rule, stretches

#: Heights of a driver's eye and of what is seen first of an obstacle, m (chosen: a car's).
EYE_HEIGHT, TARGET_HEIGHT = 1.0, 0.5
#: Distance of the places at which a driver looks, and of those looked at, m.
STEP = 10.0
#: Sight may be shorter by this much (m): it is found in steps.
STEP_ROOM = STEP


def _track(road: Road) -> tuple[Float, Float, Float, Float]:
    """Return stations (K,), m, with complex positions, headings (rad) and heights (m) of the axis there."""
    count = max(2, int(np.ceil(road.length / (STEP / 10.0))) + 1)
    fine = np.linspace(0.0, road.length, count)
    borders = np.repeat(road.starts, 2)[1:-1]
    curvature = np.interp(
        fine, borders + np.tile([0.0, -1e-9], len(road.lengths)), np.column_stack((road.k0, road.k1)).ravel()
    )
    width = fine[1] - fine[0]
    heading = np.concatenate(([0.0], np.cumsum((curvature[1:] + curvature[:-1]) * width / 2.0)))
    direction = np.exp(0.5j * (heading[1:] + heading[:-1]))
    position = np.concatenate(([0.0j], np.cumsum(direction * width)))
    profile = road.vertical
    grade_borders = np.stack((profile.station - profile.tangents, profile.station + profile.tangents), axis=1).ravel()
    grade = np.interp(fine, grade_borders, np.column_stack((profile.grades[:-1], profile.grades[1:])).ravel())
    height = np.concatenate(([0.0], np.cumsum((grade[1:] + grade[:-1]) * width / 2.0)))
    every = slice(None, None, max(1, round(STEP / width)))
    return fine[every], position[every], heading[every], height[every]


def _sights(road: Road, clear_width: float, needed: float) -> tuple[Float, Float]:
    """Return stations (K,) and how far (K,) drivers see there, both m, with the stations; infinite past the end."""
    station, position, heading, height = _track(road)
    count, reach = len(station), int(np.ceil(needed / STEP)) + 1
    sight = np.full(count, np.inf)
    for steps in range(reach, 1, -1):
        if steps >= count:
            continue
        eyes = np.arange(count - steps)
        share = np.arange(1, steps) / steps
        between = eyes[:, None] + np.arange(1, steps)
        line = position[eyes, None] + share * (position[eyes + steps] - position[eyes])[:, None]
        beside = np.imag((line - position[between]) * np.exp(-1j * heading[between]))
        eye_height = height[eyes] + EYE_HEIGHT
        line_height = eye_height[:, None] + share * (height[eyes + steps] + TARGET_HEIGHT - eye_height)[:, None]
        is_hidden = ((np.abs(beside) > clear_width) | (line_height < height[between])).any(axis=1)
        sight[eyes[is_hidden]] = (steps - 1) * (station[1] - station[0])
    return station, sight


def _stopping_sight(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch on which drivers see less far than they need to stop."""
    if not road.binds("stopping_deceleration") or road.length < 2.0 * STEP:
        return
    needed = road.limits.stopping_sight
    paved_half = min(float(edges.at_marks.main.max()) for edges in road.sides.values())
    station, sight = _sights(road, paved_half + road.limits.obstacle_distance, needed)
    for first, last in stretches(sight < (needed - STEP_ROOM) * (1.0 - TOLERANCE)):
        worst = first + int(np.argmin(sight[first : last + 1]))
        text = (
            f"Drivers see {sight[worst]:.0f} m; {needed:.0f} m are needed to stop "
            f"({road.cite('stopping_deceleration', True)})."
        )
        yield Finding(road.axis, station[first], sight[worst], needed, text)


RULES = (Rule("stopping-sight", "Sight for stopping", "m", "RAL", "derived", _stopping_sight),)
