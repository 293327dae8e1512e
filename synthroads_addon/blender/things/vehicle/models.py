"""SR Car, SR Estate, ... SR Motorcycle: one vehicle each, its wheels on z = 0, facing along +y."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import bpy

from ...nodes import operations as op
from ...nodes.builder import Tree, Value, node_group
from . import shapes
from .details import boxes, declare_materials, pair, rod, smooth, wheels
from .hull import hull
from .motorcycle import motorcycle

Materials = Mapping[str, Value]


def model_group(model: str) -> bpy.types.NodeTree:
    """Return the group of a model of vehicle, e.g. SR Car."""
    description = f"A {model}, its wheels on the ground, facing along +y"
    return node_group(f"SR {model.title()}", _build, model, description=description)


def _build(tree: Tree, model: str) -> None:
    materials = declare_materials(tree)
    vehicle = _MODELS[model](tree, materials)
    with tree.frame("Shading"):
        vehicle = smooth(vehicle)
    tree.output("Mesh", vehicle, description="The vehicle")


def _car(tree: Tree, materials: Materials) -> Value:
    with tree.frame("Body over cross-sections"):
        body = hull(tree, shapes.CAR, materials)
    with tree.frame("Wheels"):
        rolling = wheels(tree, 0.32, 0.21, pair(0.78, 1.29) + pair(0.78, -1.34), materials)
    with tree.frame("Lights, mirrors and plates"):
        both = boxes(tree, [
            ("white_light", (0.60, 2.02, 0.64), (0.32, 0.12, 0.11)),
            ("red_light", (0.66, -2.03, 0.80), (0.28, 0.12, 0.14)),
            ("paint", (0.97, 0.62, 1.00), (0.19, 0.10, 0.13)),
        ], materials, mirrored=True)  # fmt: skip
        single = boxes(tree, [
            ("plate", (0.0, 2.135, 0.40), (0.52, 0.03, 0.11)),
            ("plate", (0.0, -2.135, 0.55), (0.52, 0.03, 0.11)),
            ("black", (0.0, 2.105, 0.51), (0.90, 0.09, 0.06)),
        ], materials)  # fmt: skip
    return op.join(body, rolling, both, single)


def _estate(tree: Tree, materials: Materials) -> Value:
    with tree.frame("Body over cross-sections"):
        body = hull(tree, shapes.ESTATE, materials)
    with tree.frame("Wheels"):
        rolling = wheels(tree, 0.33, 0.22, pair(0.79, 1.505) + pair(0.79, -1.285), materials)
    with tree.frame("Lights, mirrors, roof rails and plates"):
        both = boxes(tree, [
            ("white_light", (0.62, 2.26, 0.64), (0.34, 0.12, 0.11)),
            ("red_light", (0.68, -2.27, 0.80), (0.28, 0.12, 0.14)),
            ("paint", (0.985, 0.70, 1.00), (0.19, 0.10, 0.13)),
            ("chrome", (0.60, -0.75, 1.47), (0.04, 2.1, 0.06)),
        ], materials, mirrored=True)  # fmt: skip
        single = boxes(tree, [
            ("plate", (0.0, 2.37, 0.40), (0.52, 0.03, 0.11)),
            ("plate", (0.0, -2.37, 0.55), (0.52, 0.03, 0.11)),
            ("black", (0.0, 2.34, 0.51), (0.90, 0.09, 0.06)),
        ], materials)  # fmt: skip
    return op.join(body, rolling, both, single)


def _van(tree: Tree, materials: Materials) -> Value:
    with tree.frame("Body over cross-sections"):
        body = hull(tree, shapes.VAN, materials)
    with tree.frame("Wheels"):
        rolling = wheels(tree, 0.345, 0.23, pair(0.86, 1.955) + pair(0.86, -1.71), materials)
    with tree.frame("Lights, mirrors, bumpers and plates"):
        both = boxes(tree, [
            ("white_light", (0.70, 2.84, 0.86), (0.26, 0.14, 0.20)),
            ("red_light", (0.93, -2.94, 1.05), (0.13, 0.05, 0.42)),
            ("black", (1.10, 2.00, 1.38), (0.20, 0.12, 0.34)),
        ], materials, mirrored=True)  # fmt: skip
        single = boxes(tree, [
            ("plate", (0.0, 2.95, 0.46), (0.52, 0.03, 0.11)),
            ("plate", (0.0, -2.95, 0.75), (0.52, 0.03, 0.11)),
            ("black", (0.0, 2.91, 0.62), (1.1, 0.11, 0.16)),
            ("black", (0.0, -2.925, 0.50), (1.9, 0.08, 0.16)),
        ], materials)  # fmt: skip
    return op.join(body, rolling, both, single)


def _bus(tree: Tree, materials: Materials) -> Value:
    with tree.frame("Body over cross-sections"):
        body = hull(tree, shapes.BUS, materials)
    with tree.frame("Wheels"):
        places = pair(1.10, 3.80) + pair(1.00, -2.30) + pair(1.10, -3.65)
        rolling = wheels(tree, 0.50, 0.30, places, materials)
    with tree.frame("Lights, mirrors and plates"):
        both = boxes(tree, [
            ("white_light", (0.92, 6.36, 0.72), (0.36, 0.14, 0.18)),
            ("red_light", (1.0, -6.44, 1.10), (0.16, 0.08, 0.55)),
            ("black", (1.36, 6.38, 2.55), (0.18, 0.20, 0.50)),
            ("black", (1.27, 6.36, 2.82), (0.30, 0.06, 0.06)),
        ], materials, mirrored=True)  # fmt: skip
        single = boxes(tree, [
            ("plate", (0.0, 6.485, 0.48), (0.52, 0.03, 0.11)),
            ("plate", (0.0, -6.485, 0.95), (0.52, 0.03, 0.11)),
            ("black", (0.0, 6.44, 0.78), (1.3, 0.11, 0.14)),
        ], materials)  # fmt: skip
    return op.join(body, rolling, both, single)


def _truck(tree: Tree, materials: Materials) -> Value:
    with tree.frame("Cab over cross-sections"):
        cab = hull(tree, shapes.TRUCK_CAB, materials)
    with tree.frame("Box and frame"):
        load = boxes(tree, [
            ("cover", (0.0, -1.05, 2.35), (2.55, 7.40, 2.50)),
            ("black", (0.0, -0.30, 0.85), (0.86, 8.60, 0.30)),
            ("black", (0.0, -4.60, 0.55), (2.40, 0.12, 0.14)),
            ("black", (0.0, -1.05, 1.06), (2.50, 7.30, 0.12)),
            ("plate", (0.0, -4.67, 0.72), (0.52, 0.03, 0.11)),
            ("plate", (0.0, 4.735, 0.55), (0.52, 0.03, 0.11)),
        ], materials)  # fmt: skip
    with tree.frame("Guards, lights, mirrors and tank"):
        both = boxes(tree, [
            ("black", (1.20, 0.60, 0.72), (0.05, 3.2, 0.36)),
            ("white_light", (0.88, 4.68, 0.68), (0.36, 0.10, 0.16)),
            ("red_light", (1.00, -4.66, 0.80), (0.40, 0.05, 0.14)),
            ("black", (1.34, 4.42, 2.05), (0.16, 0.14, 0.46)),
            ("black", (1.05, -1.65, 1.02), (0.40, 1.10, 0.04)),
        ], materials, mirrored=True)  # fmt: skip
        tank = rod(tree, (0.85, 1.2, 0.72), (0.85, 2.3, 0.72), (0.30, 0.30), materials["chrome"])
    with tree.frame("Wheels"):
        rolling = wheels(tree, 0.46, 0.28, pair(1.03, 3.40), materials)
        rolling = op.join(rolling, wheels(tree, 0.46, 0.52, pair(0.98, -1.65), materials))
    return op.join(cab, load, both, tank, rolling)


def _semitrailer(tree: Tree, materials: Materials) -> Value:
    with tree.frame("Cab over cross-sections"):
        cab = hull(tree, shapes.TRACTOR_CAB, materials)
    with tree.frame("Tractor's frame, tanks, guards and lights"):
        tractor = boxes(tree, [
            ("black", (0.0, 5.10, 0.85), (0.90, 5.9, 0.28)),
            ("black", (0.0, 3.70, 1.10), (1.0, 0.9, 0.16)),
            ("plate", (0.0, 8.235, 0.50), (0.52, 0.03, 0.11)),
        ], materials)  # fmt: skip
        beside = boxes(tree, [
            ("white_light", (0.95, 8.17, 0.66), (0.36, 0.12, 0.18)),
            ("black", (1.38, 7.85, 2.25), (0.16, 0.16, 0.62)),
            ("black", (1.05, 3.15, 1.06), (0.40, 1.15, 0.04)),
            ("paint", (1.20, 5.05, 0.62), (0.06, 1.7, 0.55)),
        ], materials, mirrored=True)  # fmt: skip
        tanks = rod(tree, (0.85, 4.4, 0.66), (0.85, 5.7, 0.66), (0.31, 0.31), materials["chrome"], mirrored=True)
    with tree.frame("Trailer"):
        trailer = _trailer(tree, materials)
    with tree.frame("Wheels"):
        single = pair(1.05, 6.85) + pair(1.06, -2.64) + pair(1.06, -3.95) + pair(1.06, -5.26)
        rolling = wheels(tree, 0.50, 0.36, single, materials)
        rolling = op.join(rolling, wheels(tree, 0.50, 0.58, pair(0.97, 3.15), materials))
    return op.join(cab, tractor, beside, tanks, trailer, rolling)


def _trailer(tree: Tree, materials: Materials) -> Value:
    trailer = boxes(tree, [
        ("cover", (0.0, -1.45, 2.64), (2.55, 13.60, 2.72)),
        ("black", (0.0, -1.45, 1.24), (2.53, 13.58, 0.12)),
        ("black", (0.0, -2.20, 1.02), (1.00, 11.8, 0.34)),
        ("black", (0.0, -8.10, 0.55), (2.40, 0.12, 0.14)),
        ("chrome", (0.0, -8.24, 2.64), (0.03, 0.02, 2.60)),
        ("plate", (0.0, -8.17, 0.78), (0.52, 0.03, 0.11)),
    ], materials)  # fmt: skip
    guards = boxes(tree, [
        ("black", (1.22, 0.50, 0.78), (0.04, 4.3, 0.10)),
        ("black", (1.22, 0.50, 0.50), (0.04, 4.3, 0.10)),
        ("red_light", (1.00, -8.17, 0.76), (0.42, 0.05, 0.14)),
        ("black", (0.75, 2.90, 0.55), (0.12, 0.12, 1.00)),
        ("black", (1.05, -3.95, 1.06), (0.40, 3.80, 0.04)),
    ], materials, mirrored=True)  # fmt: skip
    return op.join(trailer, guards)


_MODELS: dict[str, Callable[[Tree, Materials], Value]] = {
    "car": _car,
    "estate": _estate,
    "van": _van,
    "truck": _truck,
    "semitrailer": _semitrailer,
    "bus": _bus,
    "motorcycle": motorcycle,
}
