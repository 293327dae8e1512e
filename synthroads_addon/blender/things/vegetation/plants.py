"""Placement of grass and trees: points where plants grow, and plants on these points.

A plant's place, size and turn follow from the seed and its number, and its number from the metre of road beside it, so
that a stretch of a road has the whole road's plants. `road.vegetation.plants` computes the same without Blender.
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
"""Attribute of the plants while they are made: instance number."""
_RAY_HEIGHT = 1000.0
"""Height above the axis from which rays look for the ground, m; chosen."""

_EDGE_TOLERANCE = 1.0
"""Distance (m) beyond the band up to which places decided beforehand stay if a user moves the road's edge; chosen."""
_PLACE_ATTRIBUTES = ("distance", "station", "offset", "edge", "share", "id", "strip", "found")
"""Attributes of the places that are removed, as the plants' many points don't need them."""


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
"""Inputs of a stand on which the decisions of `decided_places` depend: the points carry their values, and the seed."""


def decided_places(tree: Tree) -> Value:
    """Declare the input "Places", candidate places of a stand that are decided beforehand; return its value."""
    description = (
        "Places decided already: points with id, stands (0 or 1) and the inputs that this holds for; may be empty"
    )
    return tree.input("Places", "Geometry", description=description)


def points_in_band(
    tree: Tree, stand: Stand, density: Operand, places: Value | None = None, surface_field: Value | None = None
) -> Value:
    """Add nodes for random points on the terrain within the stand's band, see `points_on`."""
    surface = op.object_geometry(stand.terrain)
    band = _Band(stand.band_start, stand.band_end, places)
    return points_on(tree, stand, surface, density, stand.reach, stand.seed, band, surface_field)


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
    surface_field: Value | None = None,
) -> Value:
    """Add nodes for random points on a surface at a uniform density per area, identified by metre of road.

    Args:
        tree: tree to add the nodes to.
        stand: inputs of the stand.
        surface: mesh of the surface; its points carry their ``distance`` if there is a band.
        density: points per area, 1/m2.
        reach: largest distance from the axis at which places are tried, m.
        seed: seed of the places.
        band: band in which plants grow; everywhere if None.
        surface_field: field of the surface that the points carry as ``found``; none if None.
    """
    axis = op.object_geometry(stand.backbone)
    ribbon = station_ribbon(axis)
    first_metre = stand.first_metre - stand.zero
    rows = _integer(op.round_up(last_station(axis)) - first_metre, 0)
    per_metre = reach * 2.0 * density
    places_per_metre = _integer(op.round_up(per_metre * SPARE), 1)
    points = tree.node("GeometryNodePoints", count=rows * places_per_metre).value
    place_index = op.index(tree)
    metre = place_index // places_per_metre
    # A unique number for every place of the whole road, whatever stretch of it is built.
    points = op.store(points, "id", (stand.first_metre + metre) * places_per_metre + place_index % places_per_metre)
    identity = op.named_attribute(tree, "id", "INT")
    points = op.store(points, "station", (metre + first_metre) + op.random(tree, 0.0, 1.0, seed + STATION, identity))
    points = op.store(points, "offset", op.random(tree, -1.0, 1.0, seed + OFFSET, identity) * reach)
    station, offset = op.named_attribute(tree, "station"), op.named_attribute(tree, "offset")
    points = op.delete_points(points, (station < first_station(axis)) | (station > last_station(axis)))
    ray_start = look_up(ribbon, "axis", station) + look_up(ribbon, "left", station) * offset + (0.0, 0.0, _RAY_HEIGHT)
    points = op.set_position(points, ray_start)
    hit_field = op.named_attribute(tree, "distance") if surface_field is None else surface_field
    ray = tree.node(
        "GeometryNodeRaycast",
        data_type="INT" if hit_field.kind == "INT" else "FLOAT",
        target_geometry=surface,
        attribute=hit_field,
        source_position=op.position(tree),
        ray_length=2.0 * _RAY_HEIGHT,
    )
    # Area of ground per metre of station and metre of offset: larger on the outside of a curve, and on a slope. Of the
    # places tried, the share that the density requires is kept.
    ground = 1.0 - look_up(ribbon, "curvature", station) * offset
    plants_per_metre = per_metre * ground / op.maximum(op.component(ray["Hit Normal"], "Z"), 0.1)
    is_removed = ~ray["Is Hit"] | (
        op.random(tree, 0.0, 1.0, seed + CHANCE, identity) * places_per_metre > plants_per_metre
    )
    if band is not None:
        is_removed = is_removed | (ray["Attribute"] < band.start) | (ray["Attribute"] > band.end)
        if band.places is not None:
            assert isinstance(stand, PlantStand)
            is_removed = is_removed | (station < stand.start_station) | (station > stand.end_station)
            is_removed = is_removed | (offset * stand.on_side < 0.0)
            is_outside = (ray["Attribute"] < band.start - _EDGE_TOLERANCE) | (
                ray["Attribute"] > band.end + _EDGE_TOLERANCE
            )
            # Where places were decided beforehand, by exact geometry, their decision counts.
            is_decided, has_plant = _decisions(stand, band.places, identity)
            is_removed = op.switch(is_decided, is_removed, ~ray["Is Hit"] | ~has_plant | is_outside)
    # Captured together, so that the rays, which are slow, are cast once.
    points, captured = op.capture(points, gone=is_removed, hit=ray["Hit Position"], found=ray["Attribute"])
    points = op.set_position(op.delete_points(points, captured["gone"]), captured["hit"])
    return points if surface_field is None else op.store(points, "found", captured["found"])


def _decisions(stand: Stand, places: Value, identity: Value) -> tuple[Value, Value]:
    """Add nodes that tell whether the places were decided for these inputs, and whether a plant grows at each place."""
    tree = places.tree
    is_decided = op.sample_index(places, op.named_attribute(tree, "seed", "INT"), 0).equals(stand.seed)
    is_decided = is_decided & (op.point_count(places) > 0)
    for name in DECIDED:
        decided_value = op.sample_index(places, op.named_attribute(tree, name), 0)
        is_decided = is_decided & (op.unary("ABSOLUTE", decided_value - stand.values[name]) < 1e-9)
    first_number = op.sample_index(places, op.named_attribute(tree, "id", "INT"), 0)
    has_plant = op.sample_index(places, op.named_attribute(tree, "stands", "INT"), identity - first_number)
    return is_decided, has_plant > 0


def _integer(value: Value, minimum: int) -> Value:
    """Add a node for the larger of an integer and a minimum."""
    return value.tree.node("FunctionNodeIntegerMath", value, minimum, operation="MAXIMUM").value


def own_numbers(tree: Tree, stand: Stand) -> Value:
    """Add nodes for each plant's instance number: the stand's first plus the place's number; a field."""
    return stand.instance + op.named_attribute(tree, "id", "INT")


def sizes(tree: Tree, stand: Stand, kind: str) -> Value:
    """Add nodes for each plant's random scale (vector): its height, m, and a breadth relative to it; a field."""
    height = op.random(tree, stand.smallest_height, stand.largest_height, stand.seed + HEIGHT)
    breadth = height * op.random(tree, *BREADTHS[kind], stand.seed + BREADTH)
    return op.vector(tree, breadth, breadth, height)


def plant_points(
    tree: Tree, points: Value, variants: list[Value], scale: Value, lean: float, seed: Value, number: Value
) -> Value:
    """Add nodes that put a random variant on each point, turned, leant and scaled; return the realized mesh.

    Args:
        tree: the group.
        points: places of the plants.
        variants: different plants of height 1.
        scale: size of each plant, m.
        lean: largest lean, rad.
        seed: seed of the choice and of the turns.
        number: instance number of each plant.
    """
    bodies = op.join(*(tree.node("GeometryNodeGeometryToInstance", variant).value for variant in variants))
    # A random float rounded down: random integers differ between Blender 4.5 and 5.
    share = op.random(tree, 0.0, len(variants) - PICK, seed + KIND)
    variant_index = tree.node("FunctionNodeFloatToInt", share, rounding_mode="FLOOR").value
    plants = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=bodies,
        pick_instance=True,
        instance_index=variant_index,
        rotation=op.random_turn(tree, (-lean, -lean, 0.0), (lean, lean, 6.2832), seed + 1),
        scale=scale,
    ).value
    plants = op.store(plants, _NUMBER, number, "INSTANCE")
    for name in _PLACE_ATTRIBUTES:
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
