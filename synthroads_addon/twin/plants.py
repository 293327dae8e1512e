"""Plants of a road one by one, and the strips that grass grows on, as the model has them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..base.arrays import Float
from ..road.geometry import RoadGeometry
from ..road.instances import GRASS_STRIPS
from ..road.surroundings import Vegetation
from ..road.vegetation.plants import ROADSIDE_HEIGHT, WILD_GRASSES, grown_plants
from ..road.vegetation.species import PlantShape, plant_shape
from .faces import Faces, grid_corners, join_faces, split_quads, upward_triangles
from .ground import GroundMesh
from .surfaces import surface_points


class PlacedPlant(NamedTuple):
    """One tree or shrub of a stand: its place, measures and shape.

    Attributes:
        name, instance: its id and its number in the cloud.
        stand: id of the stand that it belongs to.
        about: that stand.
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
    about: Vegetation
    variant: int
    station: float
    offset: float
    foot: Float
    height: float
    breadth: float
    shape: PlantShape

    def attributes(self) -> dict[str, str | int | float]:
        """Return the plant's attributes for a file: instance number, class, species and measures (m)."""
        told: dict[str, str | int | float] = {"instance": self.instance, "class": self.about.points_class}
        told |= {"function": self.about.kind, "species": self.about.species, "stand": self.stand}
        told |= {
            "height": round(self.height, 4),
            "crownDiameter": round(2.0 * self.breadth * self.shape.crown_radius, 4),
        }
        told["crownBottom"] = round(self.height * self.shape.crown_bottom, 4)
        if self.shape.trunk_radius:
            told["trunkDiameter"] = round(2.0 * self.breadth * self.shape.trunk_radius, 4)
        return told

    @property
    def scale(self) -> tuple[float, float, float]:
        """Return the scale factors (x, y, z) from its shape, a plant of height 1, to its size."""
        return self.breadth, self.breadth, self.height


class GrassStrip(NamedTuple):
    """A strip of ground on which grass of one species grows, as a surface at the grass's mean height.

    Attributes:
        name, instance: its id and its number in the cloud.
        stand: id of the stand that it belongs to.
        about: that stand.
        mean_height: m.
        faces: its surface, as high above the ground as the grass is on average.
    """

    name: str
    instance: int
    stand: str
    about: Vegetation
    mean_height: float
    faces: Faces

    def attributes(self) -> dict[str, str | int | float]:
        """Return the strip's attributes for a file: instance number, class, species and mean height (m)."""
        told: dict[str, str | int | float] = {"instance": self.instance, "class": self.about.points_class}
        told |= {"function": self.about.kind, "species": self.about.species, "stand": self.stand}
        return told | {"strip": self.name.rpartition("/")[2], "averageHeight": round(self.mean_height, 4)}


def placed_plants(geometry: RoadGeometry) -> Iterator[PlacedPlant]:
    """Yield all trees and shrubs of a road, stand by stand in the parameter set's order; none without terrain."""
    terrain = geometry.parameters.terrain
    for stand, about in geometry.parameters.of_type(Vegetation).items():
        if about.kind == "grass" or terrain is None:
            continue
        grown = grown_plants(geometry, about, terrain)
        for number, station, offset, foot, height, breadth, variant in zip(*vars(grown).values(), strict=True):
            name, instance = geometry.numbers.part(stand, int(number))
            shape = plant_shape(about.kind, about.species, int(variant))
            place = int(variant), float(station), float(offset), foot, float(height), float(breadth)
            yield PlacedPlant(name, instance, stand, about, *place, shape)


def grass_strips(geometry: RoadGeometry, ground: GroundMesh) -> Iterator[GrassStrip]:
    """Yield the strips of all stands of grass that have an area, stand by stand in the parameter set's order."""
    for stand, about in geometry.parameters.of_type(Vegetation).items():
        if about.kind != "grass":
            continue
        mean = (about.height_min + about.height_max) / 2.0
        for number, strip in enumerate(GRASS_STRIPS):
            band = strip.endswith("band")
            if not band and about.species in WILD_GRASSES:
                continue
            height = mean if band else mean * ROADSIDE_HEIGHT
            faces = _band(ground, number, about, height) if band else _verges(geometry, ground, strip, height)
            if len(faces):
                name, instance = geometry.numbers.part(stand, number)
                yield GrassStrip(name, instance, stand, about, height, faces)


def _band(ground: GroundMesh, number: int, about: Vegetation, height: float) -> Faces:
    """Return the triangles of a stand's band of grass on one side of the road (number 0 left, 1 right)."""
    side = ground.sides[number]
    distance = side.clip_to_band(about.band_start, about.band_end)
    return _raised(side.points(distance), (len(distance), distance.shape[1]), height, side.sign < 0.0)


def _verges(geometry: RoadGeometry, ground: GroundMesh, strip: str, height: float) -> Faces:
    """Return the triangles of a grass strip beside the pavement (`left-verge`, `right-verge` or `median`)."""
    station = ground.sides[0].station
    offsets = geometry.offsets(station)
    parts = []
    for number, one in enumerate(geometry.strips):
        if one.class_name == "roadside" and strip == ("median" if one.side is None else f"{one.side}-verge"):
            # From left to right.
            points = surface_points(geometry, np.repeat(station, 2), offsets[:, number : number + 2].ravel())
            parts.append(_raised(points, (len(station), 2), height, True))
    return join_faces(parts)


def _raised(points: Float, shape: tuple[int, int], height: float, rightwards: bool) -> Faces:
    """Triangulate a grid of points (rows, columns), raised by a height (m); triangles without area are left out."""
    corners = split_quads(grid_corners(*shape))
    raised = points + np.array([0.0, 0.0, height])
    return upward_triangles(raised, corners if rightwards else corners[:, ::-1])
