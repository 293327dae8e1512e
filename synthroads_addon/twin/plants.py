"""Plants of a road one by one, and the strips that grass grows on, as the model has them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..base.arrays import Float
from ..road.geometry import RoadGeometry
from ..road.instances import GRASS_STRIPS
from ..road.streets.street_geometry import STREET_STRIPS
from ..road.surroundings import Vegetation
from ..road.things.plant_shape import PlantShape
from ..road.vegetation.plants import ROADSIDE_HEIGHT, WILD_GRASSES, grown_plants
from ..road.vegetation.species import plant_shape
from .faces import Faces, grid_corners, join_faces, split_quads, upward_triangles
from .ground import GroundMesh
from .surfaces import surface_points


class PlacedPlant(NamedTuple):
    """One tree or shrub of a stand: its place, measures and shape.

    Attributes:
        name, instance: its id and its number in the cloud.
        stand: id of the stand that it belongs to.
        vegetation: that stand.
        variant: which of the kinds of its species it is.
        station, offset: m.
        foot: (3,) local, m.
        height: m.
        breadth: by which the shape of a plant of height 1 is scaled across, m.
        shape: that shape.
    """

    name: str
    instance: int
    stand: str
    vegetation: Vegetation
    variant: int
    station: float
    offset: float
    foot: Float
    height: float
    breadth: float
    shape: PlantShape

    def attributes(self) -> dict[str, str | int | float]:
        """Return the plant's attributes for a file: instance number, class, species and measures (m)."""
        values: dict[str, str | int | float] = {"instance": self.instance, "class": self.vegetation.points_class}
        values |= {"function": self.vegetation.kind, "species": self.vegetation.species, "stand": self.stand}
        values |= {
            "height": round(self.height, 4),
            "crownDiameter": round(2.0 * self.breadth * self.shape.crown_radius, 4),
        }
        values["crownBottom"] = round(self.height * self.shape.crown_bottom, 4)
        if self.shape.trunk_radius:
            values["trunkDiameter"] = round(2.0 * self.breadth * self.shape.trunk_radius, 4)
        return values

    @property
    def scale(self) -> tuple[float, float, float]:
        """Return the scale factors (x, y, z) from its shape, a plant of height 1, to its size."""
        return self.breadth, self.breadth, self.height


class GrassStrip(NamedTuple):
    """A strip of ground on which grass of one species grows, as a surface at the grass's mean height.

    Attributes:
        name, instance: its id and its number in the cloud.
        stand: id of the stand that it belongs to.
        vegetation: that stand.
        mean_height: m.
        faces: its surface, as high above the ground as the grass is on average.
    """

    name: str
    instance: int
    stand: str
    vegetation: Vegetation
    mean_height: float
    faces: Faces

    def attributes(self) -> dict[str, str | int | float]:
        """Return the strip's attributes for a file: instance number, class, species and mean height (m)."""
        values: dict[str, str | int | float] = {"instance": self.instance, "class": self.vegetation.points_class}
        values |= {"function": self.vegetation.kind, "species": self.vegetation.species, "stand": self.stand}
        return values | {"strip": self.name.rpartition("/")[2], "averageHeight": round(self.mean_height, 4)}


def placed_plants(geometry: RoadGeometry) -> Iterator[PlacedPlant]:
    """Yield all trees and shrubs of a road, stand by stand in the parameter set's order; none without terrain."""
    terrain = geometry.parameters.terrain
    for stand, vegetation in geometry.parameters.of_type(Vegetation).items():
        if vegetation.kind == "grass" or terrain is None:
            continue
        # The fields of `GrownPlants` in the order of their definition, plant by plant.
        grown = grown_plants(geometry, vegetation, terrain)
        for number, station, offset, foot, height, breadth, variant in zip(*vars(grown).values(), strict=True):
            name, instance = geometry.numbers.part(stand, int(number))
            shape = plant_shape(vegetation.kind, vegetation.species, int(variant))
            measures = int(variant), float(station), float(offset), foot, float(height), float(breadth)
            yield PlacedPlant(name, instance, stand, vegetation, *measures, shape)


def grass_strips(geometry: RoadGeometry, ground: GroundMesh) -> Iterator[GrassStrip]:
    """Yield the strips of all stands of grass that have an area, stand by stand in the parameter set's order."""
    for stand, vegetation in geometry.parameters.of_type(Vegetation).items():
        if vegetation.kind != "grass":
            continue
        mean_height = (vegetation.height_min + vegetation.height_max) / 2.0
        for number, strip in enumerate(GRASS_STRIPS):
            is_band = strip.endswith("band")
            if not is_band and vegetation.species in WILD_GRASSES:
                continue
            height = mean_height if is_band else mean_height * ROADSIDE_HEIGHT
            faces = _band(ground, number, vegetation, height) if is_band else _verges(geometry, ground, strip, height)
            if len(faces):
                name, instance = geometry.numbers.part(stand, number)
                yield GrassStrip(name, instance, stand, vegetation, height, faces)


def _band(ground: GroundMesh, number: int, vegetation: Vegetation, height: float) -> Faces:
    """Return the triangles of a stand's band of grass on one side of the road (number 0 left, 1 right)."""
    side = ground.sides[number]
    distance = side.clip_to_band(vegetation.band_start, vegetation.band_end)
    return _raised(side.points(distance), (len(distance), distance.shape[1]), height, side.sign < 0.0)


def _verges(geometry: RoadGeometry, ground: GroundMesh, strip: str, height: float) -> Faces:
    """Return the triangles of a grass strip beside the pavement (`left-verge`, `right-verge` or `median`)."""
    station = ground.sides[0].station
    offsets = geometry.offsets(station)
    parts = []
    for number, surface_strip in enumerate(geometry.strips):
        if surface_strip.kind in STREET_STRIPS:  # kerbs and footways
            continue
        if surface_strip.class_name == "roadside" and strip == (
            "median" if surface_strip.side is None else f"{surface_strip.side}-verge"
        ):
            # From left to right.
            points = surface_points(geometry, np.repeat(station, 2), offsets[:, number : number + 2].ravel())
            parts.append(_raised(points, (len(station), 2), height, True))
    return join_faces(parts)


def _raised(points: Float, shape: tuple[int, int], height: float, columns_rightwards: bool) -> Faces:
    """Triangulate a grid of points (rows, columns), raised by a height (m); triangles without area are left out.

    Args:
        points: (N, 3), row by row.
        shape: number of rows and of columns.
        height: m.
        columns_rightwards: whether columns run from left to right, seen along the road; else from right to left.
    """
    corners = split_quads(grid_corners(*shape))
    raised_points = points + np.array([0.0, 0.0, height])
    return upward_triangles(raised_points, corners if columns_rightwards else corners[:, ::-1])
