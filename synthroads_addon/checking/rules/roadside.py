"""Rules for what grows and joins beside the road: hedges, trees, entrances to fields; and signs before curves."""

from collections.abc import Iterator

import numpy as np

from ...road.things.field_entrance import FieldEntrance
from ...road.things.hedge import Hedge
from ...road.things.sign import TrafficSign
from ...road.things.tree import Tree
from .rule import Finding, Road, Rule, above, at_least, below

#: Codes of danger signs before curves.
CURVE_SIGNS = ("103", "105")
#: An entrance may end this far (m) from the paved edge: offsets are rounded.
JOINT_ROOM = 0.01


def _plant_distance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each hedge and tree that reaches into the space beside and above the pavement."""
    if not road.binds("plant_distance"):
        return
    limit, height = road.limits.plant_distance, road.limits.plant_clearance
    source, nearest = road.cite("plant_distance"), road.positions.nearest
    for i in (*road.bodies.of(Hedge, part="barrier"), *road.bodies.of(Tree, part="foot")):
        text = f"The plant grows {nearest[i]:.2f} m from the paved edge; {limit} m are needed ({source})."
        yield from at_least(road.bodies.names[i], road.bodies.station[i], nearest[i], limit, text)
    for i in road.bodies.of(Tree, part="foot"):
        name = road.bodies.names[i]
        tree = road.of(Tree)[name]
        beside = nearest[i] + (tree.trunk_diameter - tree.crown_diameter) / 2.0
        if below(beside, limit) and below(tree.crown_bottom, height):
            text = (
                f"The tree's crown begins {tree.crown_bottom:.2f} m high and reaches to {beside:.2f} m from the paved "
                f"edge; nearer than {limit} m it must be {height} m high ({road.cite('plant_clearance')})."
            )
            yield Finding(name, tree.station, tree.crown_bottom, height, text)


def _entrance_gap(road: Road) -> Iterator[Finding]:
    """Yield a finding for each entrance that doesn't begin at the pavement's edge."""
    reported = set()
    for i in road.bodies.of(FieldEntrance, part="foot"):
        name, gap = road.bodies.names[i], float(road.positions.nearest[i])
        if above(gap, JOINT_ROOM) and name not in reported:
            reported.add(name)
            text = f"The entrance begins {gap:.2f} m beside the paved edge; its track must join the pavement."
            yield Finding(name, float(road.bodies.station[i]), gap, JOINT_ROOM, text)


def _entrance_class(road: Road) -> Iterator[Finding]:
    """Yield a finding for each entrance to a field from a road for motor vehicles alone."""
    if road.limits.field_access:
        return
    for name, item in road.of(FieldEntrance).items():
        source = road.cite("field_access", True) if road.binds("field_access") else road.guideline
        yield Finding(name, item.station, 1.0, 0.0, f"A road of this class has no entrances to fields ({source}).")


def _danger_sign_distance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each danger sign that is nearer to a curve, or farther from it, than the law allows."""
    if not road.binds("danger_sign_nearest"):
        return
    nearest, farthest = road.limits.danger_sign_nearest, road.limits.danger_sign_farthest
    curves = [run for run in road.runs if not run.straight]
    for name, sign in road.of(TrafficSign).items():
        if not sign.code.startswith(CURVE_SIGNS):
            continue
        traffic = 1.0 if abs((sign.rotation_deg + 180.0) % 360.0 - 180.0) < 90.0 else -1.0  # degrees: it faces them
        begins = np.array([run.start if traffic > 0 else run.end for run in curves])
        ahead = traffic * (begins - sign.station)
        ahead = ahead[ahead > 0.0]
        misses = np.maximum(np.maximum(nearest - ahead, ahead - farthest), 0.0)
        if not len(ahead) or float(misses.min()) > 0.0:
            distance = float(ahead[np.argmin(misses)]) if len(ahead) else road.length
            limit = nearest if distance < nearest else farthest
            if below(distance, nearest) or above(distance, farthest):
                text = (
                    f"The danger sign stands {distance:.0f} m before a curve; {nearest:.0f} to {farthest:.0f} m are "
                    f"usual ({road.cite('danger_sign_nearest')})."
                )
                yield Finding(name, sign.station, distance, limit, text)


RULES = (
    Rule("plant-distance", "Plants leave the pavement's space free", "m", "", "confirmed", _plant_distance),
    Rule("entrance-gap", "Entrances join the pavement", "m", "", "definition", _entrance_gap),
    Rule("entrance-class", "Roads for motor vehicles have no entrances", "1", "RAL", "confirmed", _entrance_class),
    Rule("danger-sign-distance", "Danger signs before curves", "m", "StVO", "confirmed", _danger_sign_distance),
)
