"""Placement of grass and trees: where plants grow, and how they are put there.

A plant's place, size and turn follow from its seed and its number, and its number from the metre of road that it stands
beside: a stretch of a road has the whole road's plants. `road.vegetation.plants` works out the same without Blender.
"""

from __future__ import annotations

from typing import NamedTuple

from ....road.instances import SPARE
from ....road.vegetation.plants import BREADTH, BREADTHS, CHANCE, HEIGHT, KIND, OFFSET, PICK, STATION
from ...nodes import operations as op
from ...nodes.backbone import first_station, last_station, look_up, station_ribbon
from ...nodes.builder import Operand, Tree, Value
from ...nodes.inputs import INSTANCES, Inputs, backbone_socket, integer, metres, number, share, socket

_NUMBER = "plant_instance"
_ABOVE = 1000.0
"""Height from which the ground is looked for, m."""

_ASIDE = 1.0
"""Distance (m) that the road's edge may have moved by hand before decided places beyond the band are left out."""
_NEEDED_NO_MORE = ("distance", "station", "offset", "edge", "share", "id", "strip", "found")
"""Attributes of the places that the plants' many points would only carry along."""


class Stand(Inputs):
    """Inputs of a stand of plants that all kinds share: surfaces, density, band, heights, seed, detail."""

    backbone = backbone_socket("Object")
    terrain = socket("Object", "Terrain whose points carry their distance")
    road = socket("Object", "Road, for its verges and median")
    density = number(1.0, (0.0, 50.0), "Plants per area (1/m2)")
    band_start = metres(0.0, (-5.0, 1000.0), "From the outer edge of the verge")
    band_end = metres(60.0, (-5.0, 1000.0), "From the outer edge of the verge")
    smallest_height = metres(0.1, (0.01, 60.0), "Height of the smallest")
    largest_height = metres(0.45, (0.01, 60.0), "Height of the tallest")
    reach = metres(60.0, (1.0, 1000.0), "Farthest ground from the axis")
    first_metre = integer(0, (0, 2**20), "Whole metre of the road that it begins with")
    zero = integer(0, (0, 2**20), "Whole metre of the road that the stations count from")
    seed = integer(0, (0, 2**31 - 1), "Seed of places, sizes and turns")
    detail = share(1.0, (0.0, 1.0), "Share of the triangles")
    instance = integer(0, INSTANCES, "Instance number of the first; the others have those after it")


class PlantStand(Stand):
    """Inputs of a stand of shrubs or trees, which may grow on one side and along a part of the road alone."""

    start_station = metres(0.0, (-1e6, 1e6), "Station from which on they grow")
    end_station = metres(1e6, (-1e6, 1e6), "Station up to which they grow")
    on_side = integer(0, (-1, 1), "1: on the left of the axis, -1: on its right, 0: on both sides")


DECIDED = ("density", "band_start", "band_end", "reach", "start_station", "end_station", "on_side")
"""Inputs of a stand that the places of `decided_places` were decided for: their points carry them, and the seed."""


def decided_places(tree: Tree) -> Value:
    """Declare the input "Places", candidate places of a stand that are decided beforehand; return its value."""
    about = "Places decided already: points with id, stands (0 or 1) and the inputs that this holds for; may be empty"
    return tree.input("Places", "Geometry", description=about)


def points_in_band(
    tree: Tree, stand: Stand, density: Operand, places: Value | None = None, found: Value | None = None
) -> Value:
    """Add nodes for random points on the terrain within the stand's band, see `points_on`."""
    surface = op.object_geometry(stand.terrain)
    band = _Band(stand.band_start, stand.band_end, places)
    return points_on(tree, stand, surface, density, stand.reach, stand.seed, band, found)


class _Band(NamedTuple):
    """Limits of a distance from the verge, m, and the places decided beforehand, see `decided_places`, or None."""

    start: Value
    end: Value
    places: Value | None


def points_on(
    tree: Tree,
    stand: Stand,
    surface: Value,
    density: Operand,
    reach: Value,
    seed: Value,
    band: _Band | None = None,
    found: Value | None = None,
) -> Value:
    """Add nodes for random points on a surface at a uniform density per area, identified by metre of road.

    Args:
        surface: its points carry their ``distance``, if there is a band.
        density: points per area, 1/m2.
        reach: how far from the axis they are looked for, m.
        seed: of their places.
        band: that they grow in; none if None.
        found: field of the surface that the points carry as ``found``; none if None.
    """
    axis = op.object_geometry(stand.backbone)
    ribbon = station_ribbon(axis)
    first = stand.first_metre - stand.zero
    rows = _integer(op.round_up(last_station(axis)) - first, 0)
    per_metre = reach * 2.0 * density
    each = _integer(op.round_up(per_metre * SPARE), 1)
    points = tree.node("GeometryNodePoints", count=rows * each).value
    number = op.index(tree)
    metre = number // each
    # A number of its own for every place on the road, however much of the road is here.
    points = op.store(points, "id", (stand.first_metre + metre) * each + number % each)
    identity = op.named_attribute(tree, "id", "INT")
    points = op.store(points, "station", (metre + first) + op.random(tree, 0.0, 1.0, seed + STATION, identity))
    points = op.store(points, "offset", op.random(tree, -1.0, 1.0, seed + OFFSET, identity) * reach)
    station, offset = op.named_attribute(tree, "station"), op.named_attribute(tree, "offset")
    points = op.delete_points(points, (station < first_station(axis)) | (station > last_station(axis)))
    above = look_up(ribbon, "axis", station) + look_up(ribbon, "left", station) * offset + (0.0, 0.0, _ABOVE)
    points = op.set_position(points, above)
    looked_for = op.named_attribute(tree, "distance") if found is None else found
    ray = tree.node(
        "GeometryNodeRaycast",
        data_type="INT" if looked_for.kind == "INT" else "FLOAT",
        target_geometry=surface,
        attribute=looked_for,
        source_position=op.position(tree),
        ray_length=2.0 * _ABOVE,
    )
    # Ground per metre of road and metre across it: longer outside of a curve, and on a slope.
    ground = 1.0 - look_up(ribbon, "curvature", station) * offset
    needed = per_metre * ground / op.maximum(op.component(ray["Hit Normal"], "Z"), 0.1)
    gone = ~ray["Is Hit"] | (op.random(tree, 0.0, 1.0, seed + CHANCE, identity) * each > needed)
    if band is not None:
        gone = gone | (ray["Attribute"] < band.start) | (ray["Attribute"] > band.end)
        if band.places is not None:
            assert isinstance(stand, PlantStand)
            gone = gone | (station < stand.start_station) | (station > stand.end_station)
            gone = gone | (offset * stand.on_side < 0.0)
            aside = (ray["Attribute"] < band.start - _ASIDE) | (ray["Attribute"] > band.end + _ASIDE)
            decided, stands = _decisions(stand, band.places, identity)
            gone = op.switch(decided, gone, ~ray["Is Hit"] | ~stands | aside)
    # Together, as rays are dear.
    points, at = op.capture(points, gone=gone, hit=ray["Hit Position"], found=ray["Attribute"])
    points = op.set_position(op.delete_points(points, at["gone"]), at["hit"])
    return points if found is None else op.store(points, "found", at["found"])


def _decisions(stand: Stand, places: Value, identity: Value) -> tuple[Value, Value]:
    """Add nodes for whether the places were decided for these very inputs, and whether a plant grows at each."""
    tree = places.tree
    decided = op.sample_index(places, op.named_attribute(tree, "seed", "INT"), 0).equals(stand.seed)
    decided = decided & (op.point_count(places) > 0)
    for name in DECIDED:
        at_first = op.sample_index(places, op.named_attribute(tree, name), 0)
        decided = decided & (op.unary("ABSOLUTE", at_first - stand.values[name]) < 1e-9)
    first = op.sample_index(places, op.named_attribute(tree, "id", "INT"), 0)
    stands = op.sample_index(places, op.named_attribute(tree, "stands", "INT"), identity - first)
    return decided, stands > 0


def _integer(value: Value, least: int) -> Value:
    """Add a node for an integer that is at least `least`."""
    return value.tree.node("FunctionNodeIntegerMath", value, least, operation="MAXIMUM").value


def own_numbers(tree: Tree, stand: Stand) -> Value:
    """Add nodes for each plant's instance number: the stand's first plus the place's number; a field."""
    return stand.instance + op.named_attribute(tree, "id", "INT")


def sizes(tree: Tree, stand: Stand, kind: str) -> Value:
    """Add nodes for each plant's random scale (vector): its height, m, and a breadth relative to it; a field."""
    tall = op.random(tree, stand.smallest_height, stand.largest_height, stand.seed + HEIGHT)
    across = tall * op.random(tree, *BREADTHS[kind], stand.seed + BREADTH)
    return op.vector(tree, across, across, tall)


def plant_points(
    tree: Tree, points: Value, variants: list[Value], scale: Value, lean: float, seed: Value, number: Value
) -> Value:
    """Add nodes that put a random variant on each point, turned, leant and scaled; return the realized mesh.

    Args:
        tree: the group.
        points: where they stand.
        variants: plants of height 1.
        scale: of each, m.
        lean: largest, rad.
        seed: of the choice and the turns.
        number: instance number of each.
    """
    bodies = op.join(*(tree.node("GeometryNodeGeometryToInstance", variant).value for variant in variants))
    # A whole random number would be another one in Blender 5.
    share = op.random(tree, 0.0, len(variants) - PICK, seed + KIND)
    pick = tree.node("FunctionNodeFloatToInt", share, rounding_mode="FLOOR").value
    plants = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=bodies,
        pick_instance=True,
        instance_index=pick,
        rotation=op.random_turn(tree, (-lean, -lean, 0.0), (lean, lean, 6.2832), seed + 1),
        scale=scale,
    ).value
    plants = op.store(plants, _NUMBER, number, "INSTANCE")
    for name in _NEEDED_NO_MORE:
        plants = tree.node("GeometryNodeRemoveAttribute", plants, name=name).value
    mesh = op.realize(plants)
    mesh = op.store(mesh, "instance_id", op.named_attribute(tree, _NUMBER, "INT"), "FACE")
    return tree.node("GeometryNodeRemoveAttribute", mesh, name=_NUMBER).value


def one_high(plant: Value) -> Value:
    """Add nodes that scale a plant along z so that its top is at 1; return the plant."""
    tree = plant.tree
    top = op.component(tree.node("GeometryNodeBoundBox", plant)["Max"], "Z")
    size = op.vector(tree, 1.0, 1.0, 1.0 / top)
    place = op.position(tree) * size
    return op.set_position(plant, place)
