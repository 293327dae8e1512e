"""The backbone: a polyline along the axis with a point, and its attributes, for each row of the road's mesh.

Attributes of its points: ``station`` (m), ``left`` (unit vector, horizontal), ``curvature`` (1/m, positive to
the left), ``crossfall_left`` and ``crossfall_right`` (m/m, positive where the surface falls to the right), and
those of `things.road.layout.varying_widths`.
"""

from __future__ import annotations

from . import operations as op
from .builder import Operand, Tree, Value, makes_group
from .inputs import Inputs, socket

_BESIDE = ((0.0, 5.8e-4), (5e-4, -2.9e-4), (-5e-4, -2.9e-4))
"""Shifts in plan (m) of the rays that find the terrain at its very border: in three directions, of which one leads
inwards whatever the border's. Chosen: above the rounding of 32 bits at some kilometres, and on slopes still below 1 mm
of height."""
FOLD_SHARE = 0.98
"""Share of the radius at which an offset curve is cut, as in `road.alignment.clip_offset`."""


def row(backbone: Value, row_index: Value) -> tuple[Value, Value, Value]:
    """Add nodes for the axis point (m), left vector and curvature (1/m) of the backbone's row `row_index`."""
    tree = backbone.tree
    axis = op.sample_index(backbone, op.position(tree), row_index)
    left = op.sample_index(backbone, op.named_attribute(tree, "left", "FLOAT_VECTOR"), row_index)
    return axis, left, op.sample_index(backbone, op.named_attribute(tree, "curvature"), row_index)


def limit_offset(offset: Value, curvature: Value) -> Value:
    """Add nodes that limit an offset (m) to 0.98 of the curve's radius, where its parallel curve would fold."""
    return op.switch(offset * curvature > FOLD_SHARE, offset, FOLD_SHARE / curvature)


def station_ribbon(backbone: Value, numbers: tuple[str, ...] = ()) -> Value:
    """Add nodes for a flat ribbon mesh along x = station, in which `look_up` finds attributes at any station.

    Its attributes are the backbone's position (``axis``), ``left``, ``station``, ``curvature``, and those named in
    `numbers`.
    """
    tree = backbone.tree
    with tree.frame("Ribbon to look up stations"):
        mesh, column, number = op.grid(tree, 2, op.point_count(backbone))
        axis, left, _ = row(backbone, number)
        names = ("station", "curvature", *numbers)
        values = {name: op.sample_index(backbone, op.named_attribute(tree, name), number) for name in names}
        for name, value in {"axis": axis, "left": left, **values}.items():
            mesh = op.store(mesh, name, value)
        place = op.vector(tree, op.named_attribute(tree, "station"), 0.5 - column)
        return op.set_position(mesh, place)


def look_up(ribbon: Value, name: str, station: Value) -> Value:
    """Add nodes for an attribute of the backbone (``axis``: its position) at a station (m), interpolated linearly."""
    tree = ribbon.tree
    kind = "FLOAT_VECTOR" if name in ("axis", "left") else "FLOAT"
    return op.sample_surface(ribbon, op.named_attribute(tree, name, kind), op.vector(tree, station))


def height_on(road: Value, terrain: Value | None, place: Value) -> Value:
    """Add nodes for the z (m) of the road above or below `place`, else of the terrain there, else of the place.

    Args:
        road, terrain: the objects; without a terrain the road's nearest point counts beside it.
        place: a place in the space of the modified object; it may be a field.
    """
    surfaces = {"road": road} if terrain is None else {"road": road, "terrain": terrain}
    return place.tree.call(surface_height_group(), **surfaces, place=place).value


class _Surfaces(Inputs):
    road = socket("Object", "Surface of the road")
    terrain = socket("Object", "Surface beside the road")
    place = socket("Vector", "Place above or below it, which may be a field")


@makes_group("SR Surface Height")
def surface_height_group(tree: Tree) -> None:
    """The z of the surface above or below a place: the road's, beside it the terrain's, the place's where is neither.

    On the very border of the road a vertical ray may pass by: there the nearest point of the road counts. On that of
    the terrain, as where the road begins, rays 0.5 mm beside it find it.
    """
    surfaces = _Surfaces(tree)
    place = surfaces.place
    with tree.frame("Rays from above"):
        road, terrain = op.TargetFrame(surfaces.road), op.TargetFrame(surfaces.terrain)

        def ray_hit(target: op.TargetFrame, shift: tuple[float, float] = (0.0, 0.0)) -> tuple[Value, Value]:
            """Return whether the ray hits a mesh, and the height (m) there."""
            ray_start = place + (*shift, 500.0)  # chosen: higher than any surface above a place
            ray = tree.node(
                "GeometryNodeRaycast",
                target_geometry=target.geometry,
                source_position=target.point_in(ray_start),
                ray_direction=target.direction_in((0.0, 0.0, -1.0)),
                ray_length=1000.0,
            )
            return ray["Is Hit"], op.component(target.point_out(ray["Hit Position"]), "Z")

        on_road, road_z = ray_hit(road)
        on_terrain, terrain_z = ray_hit(terrain)
        for shift in _BESIDE:
            is_hit, height = ray_hit(terrain, shift)
            terrain_z = op.switch(on_terrain, height, terrain_z)
            on_terrain = on_terrain | is_hit
    with tree.frame("Nearest point of the road, if there is one"):
        nearest = op.sample_surface(road.geometry, op.position(tree), road.point_in(place))
        nearest_z = op.component(road.point_out(nearest), "Z")
        nearest_z = op.switch(op.face_count(road.geometry) > 0, op.component(place, "Z"), nearest_z)
    with tree.frame("The first of them that there is"):
        height = op.switch(on_road, op.switch(on_terrain, nearest_z, terrain_z), road_z)
    tree.output("Height", height, description="z of the surface (m)")


def first_station(backbone: Value) -> Value:
    """Add nodes for the station (m) of the backbone's first point."""
    return op.sample_index(backbone, op.named_attribute(backbone.tree, "station"), 0)


def last_station(backbone: Value) -> Value:
    """Add nodes for the station (m) of the backbone's last point."""
    return op.sample_index(backbone, op.named_attribute(backbone.tree, "station"), op.point_count(backbone) - 1)


def raise_place(place: Value, height: Operand) -> Value:
    """Add nodes for `place` moved up by `height` (m)."""
    return place + op.vector(place.tree, 0.0, 0.0, height)
