"""A motorcycle with its rider, of rods and ellipsoids."""

from __future__ import annotations

from collections.abc import Mapping

from ...nodes import operations as op
from ...nodes.builder import Tree, Value
from .details import ball, boxes, rod, wheels

_FRONT, _REAR = 0.79, -0.73


def motorcycle(tree: Tree, materials: Mapping[str, Value]) -> Value:
    """Return the motorcycle and its rider."""
    with tree.frame("Wheels"):
        rolling = wheels(tree, 0.31, 0.16, [(0.0, _FRONT), (0.0, _REAR)], materials)
    with tree.frame("Frame, fork, engine and exhaust"):
        machine = _machine(tree, materials)
    with tree.frame("Tank, fairing and seat"):
        body = op.join(
            ball(tree, (0.0, 0.12, 0.83), (0.17, 0.32, 0.15), materials["paint"]),
            ball(tree, (0.0, 0.52, 0.84), (0.17, 0.24, 0.20), materials["paint"]),
            ball(tree, (0.0, 0.52, 1.00), (0.14, 0.12, 0.16), materials["glass"]),
            ball(tree, (0.0, -0.62, 0.80), (0.12, 0.36, 0.09), materials["paint"]),
            ball(tree, (0.0, -0.30, 0.76), (0.15, 0.30, 0.07), materials["black"]),
        )
    with tree.frame("Rider"):
        rider = _rider(tree, materials)
    return op.join(rolling, machine, body, rider)


def _machine(tree: Tree, materials: Mapping[str, Value]) -> Value:
    chrome, black = materials["chrome"], materials["black"]
    parts = [
        rod(tree, (0.1, _FRONT, 0.31), (0.1, 0.52, 0.95), (0.03, 0.03), chrome, mirrored=True),
        rod(tree, (0.1, _REAR, 0.31), (0.1, -0.10, 0.42), (0.035, 0.05), black, mirrored=True),
        rod(tree, (-0.45, 0.38, 1.0), (0.45, 0.38, 1.0), (0.02, 0.02), black),
        rod(tree, (0.17, -0.05, 0.30), (0.19, -0.85, 0.45), (0.05, 0.06), chrome),
        ball(tree, (0.0, 0.10, 0.50), (0.18, 0.26, 0.20), black),
        rod(tree, (-0.17, 0.02, 0.38), (0.17, 0.02, 0.38), (0.15, 0.15), chrome),
        rod(tree, (0.0, 0.30, 0.50), (0.0, 0.34, 0.80), (0.14, 0.12), black),
        rod(tree, (-0.082, _FRONT, 0.31), (0.082, _FRONT, 0.31), (0.18, 0.18), chrome),
        rod(tree, (-0.082, _REAR, 0.31), (0.082, _REAR, 0.31), (0.18, 0.18), chrome),
    ]
    ends = boxes(tree, [
        ("white_light", (0.0, 0.74, 0.85), (0.20, 0.06, 0.14)),
        ("red_light", (0.0, -0.98, 0.80), (0.16, 0.05, 0.07)),
        ("plate", (0.0, -1.085, 0.60), (0.18, 0.03, 0.20)),
        ("black", (0.0, -1.02, 0.68), (0.12, 0.12, 0.08)),
    ], materials)  # fmt: skip
    return op.join(*parts, ends)


def _rider(tree: Tree, materials: Mapping[str, Value]) -> Value:
    leather = materials["black"]
    shoulder, elbow, hand = (0.2, -0.05, 1.16), (0.34, 0.14, 1.0), (0.38, 0.38, 1.0)
    hip, knee, foot, toe = (0.12, -0.30, 0.82), (0.23, 0.10, 0.70), (0.19, -0.22, 0.36), (0.19, 0.02, 0.30)
    limbs = [
        (shoulder, elbow, (0.075, 0.06)),
        (elbow, hand, (0.06, 0.045)),
        (hip, knee, (0.11, 0.08)),
        (knee, foot, (0.08, 0.055)),
        (foot, toe, (0.05, 0.04)),
    ]
    return op.join(
        ball(tree, (0.0, 0.06, 1.315), (0.125, 0.145, 0.135), materials["paint"]),
        ball(tree, (0.0, 0.13, 1.32), (0.10, 0.09, 0.05), materials["glass"]),
        ball(tree, (0.0, -0.14, 1.02), (0.21, 0.17, 0.27), leather),
        rod(tree, (0.0, -0.30, 0.82), (0.0, -0.05, 1.16), (0.17, 0.15), leather),
        *(rod(tree, start, end, radii, leather, mirrored=True) for start, end, radii in limbs),
    )
