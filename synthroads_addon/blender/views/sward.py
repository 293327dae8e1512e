"""The sward in pictures: blades of grass, dense around a camera, on ground, verges and median; scans leave it out."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from ...base.arrays import Bool, Float
from ...base.random_streams import stream
from ...materials.table import entry_of
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.surroundings import Vegetation
from ...road.vegetation.plants import ROADSIDE_HEIGHT, WILD_GRASSES
from ..materials import RoadMaterials
from ..nodes import operations as op
from ..nodes.builder import Tree, node_group
from ..nodes.solids import paint_faces, picked_material
from ..scene.evaluated import scene_mesh
from ..things.meshes import attribute, fill
from ..things.model_builder import ROLE, SUPPORT
from ..things.vegetation.grass import tuft_group

SWARD = "synthroads_sward"
"""Custom property of the sward's object, and of its material."""
_PARTS = ("Road", "Terrain")
"""Parts of a road's model on which grass grows."""
_COVER = {"grass_ground": 1.0, "median": 0.9, "verge": 0.3}
"""Ground that grass grows on -> how much of it, as a share of a meadow's."""
_RINGS = ((0.0, 12.0, 14.0, 0.42), (12.0, 35.0, 4.0, 0.8), (35.0, 120.0, 0.8, 1.7))
"""Rings around the camera: from, to (m), tufts per m2, and a tuft's breadth (m): farther ones are fewer and broader."""
_TUFTS = 4
"""Different tufts."""
_SHAPE = {
    "blades": 110,
    "blade_width": 0.022,
    "spread": 0.5,
    "lean": 0.95,
    "stalks": 4,
    "ear_width": 0.02,
    "blade_height": 0.8,
}
"""Inputs of a tuft's node group, for one that is 1 m high and 1 m broad."""


@dataclass(frozen=True)
class Lawn:
    """The ground on which a road's grass grows, as triangles.

    Attributes:
        corners: (T, 3, 3) local coordinates, m.
        cover: (T,) how much grass grows there, as a share of a meadow's.
    """

    corners: Float
    cover: Float

    @classmethod
    def of(cls, scene: bpy.types.Scene, matrix: Matrix) -> Lawn:
        """Return the lawn of a scene's roads and terrain; `matrix` is from local coordinates to the scene's."""
        mesh = scene_mesh(scene, [item for item in scene.objects if item.get(ROLE) in _PARTS])
        by_material = np.array([_COVER.get(entry_of(name), 0.0) for name in mesh.materials])
        cover = by_material[mesh.material]
        grown = cover > 0.0
        back = np.array(matrix.inverted())
        vertices = mesh.vertices.astype(np.float64) @ back[:3, :3].T + back[:3, 3]
        return cls(vertices[mesh.triangles[grown]], cover[grown])

    def scatter(self, place: Float, ring: tuple[float, float, float, float], random: np.random.Generator) -> Float:
        """Return random places (N, 3) in a ring around a place (3,): inner and outer radius (m), number per m2."""
        inner, outer, density, _ = ring
        middle = self.corners.mean(axis=1)
        size = np.linalg.norm(self.corners - middle[:, None], axis=2).max(axis=1)
        near = np.flatnonzero(np.linalg.norm(middle - place, axis=1) < outer + size)
        first, *others = np.moveaxis(self.corners[near], 1, 0)
        sides = [corner - first for corner in others]
        area = 0.5 * np.linalg.norm(np.cross(*sides), axis=1)
        number = random.poisson(area * density * self.cover[near])
        rows = np.repeat(np.arange(len(near)), number)
        share = random.random((2, len(rows)))
        share = np.where(share.sum(axis=0) > 1.0, 1.0 - share, share)
        places = first[rows] + share[0, :, None] * sides[0][rows] + share[1, :, None] * sides[1][rows]
        distance = np.linalg.norm(places - place, axis=1)
        return np.asarray(places[(distance >= inner) & (distance < outer)])


def add_sward(
    scene: bpy.types.Scene, parameters: RoadParameters, lawn: Lawn, place: ArrayLike, matrix: Matrix
) -> bpy.types.Object | None:
    """Add the sward around a place to a scene, replacing an earlier one; return it, or None where no grass is sown.

    It has the colour and the heights of the road's first grass: in the mown strip, on verges and median those of mown
    grass. The same road and place give the same blades.

    Args:
        scene: that shows the road.
        parameters: the road.
        lawn: where grass grows, see `Lawn.of`.
        place: local coordinates (3,) of the camera, m.
        matrix: from the road's local coordinates to the scene's.
    """
    remove_sward(scene)
    grasses = [item for item in parameters.of_type(Vegetation).values() if item.kind == "grass"]
    grass = next((item for item in grasses if item.species not in WILD_GRASSES), None)
    if grass is None:
        return None
    eye, random = np.asarray(place, dtype=np.float64), stream(grass.seed, "sward")
    rings = [lawn.scatter(eye, ring, random) for ring in _RINGS]
    places = np.concatenate(rings)
    breadth = np.repeat([ring[3] for ring in _RINGS], [len(ring) for ring in rings])
    mesh = bpy.data.meshes.new("SR Sward")
    fill(mesh, places)
    breadth = breadth * random.uniform(0.8, 1.2, len(places))
    tall = grass.height_min + (grass.height_max - grass.height_min) * 0.5 * random.random(len(places))
    tall = np.where(mown(RoadGeometry(parameters), grass, places), ROADSIDE_HEIGHT, 1.0) * tall
    attribute(mesh, "size", np.column_stack([breadth, breadth, tall]))
    attribute(mesh, "turn", random.uniform(0.0, 2.0 * np.pi, len(places)))
    attribute(mesh, "tuft", random.integers(0, _TUFTS, len(places)))
    item = bpy.data.objects.new("SR Sward", mesh)
    item[SWARD], item[SUPPORT] = True, True
    item.matrix_world = matrix
    scene.collection.objects.link(item)
    blades = _translucent(RoadMaterials.of(parameters).material(grass.species))
    modifier = item.modifiers.new("SynthRoads", "NODES")
    modifier.node_group = node_group("SR Sward", _build, blades.name, description="Tufts of grass on points")
    return item


def remove_sward(scene: bpy.types.Scene) -> None:
    """Remove the sward from a scene, with its mesh, node group and material."""
    items = [item for item in scene.objects if SWARD in item]
    data = [item.data for item in items]
    groups = [item.modifiers[0].node_group for item in items if item.modifiers]
    bpy.data.batch_remove(items)
    bpy.data.batch_remove([block for block in (*data, *groups) if block is not None and not block.users])
    bpy.data.batch_remove([material for material in bpy.data.materials if SWARD in material and not material.users])


def mown(geometry: RoadGeometry, grass: Vegetation, places: Float) -> Bool:
    """Return whether grass is mown at local places (N, 3): on verges, in the median and in the strip behind a verge."""
    station, offset = geometry.alignment.project(places[:, :2])
    edges = geometry.offsets(np.clip(station, 0.0, geometry.length))
    beyond = np.maximum(offset - edges[:, 0], edges[:, -1] - offset)
    return np.asarray(beyond < grass.mown_width)


def _translucent(blades: bpy.types.Material) -> bpy.types.Material:
    """Return a copy of a material whose faces also let light through, as much as they reflect; scans know it not."""
    made = blades.copy()
    made.name, made[SWARD] = f"{blades.name} (sward)", True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    surface = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    through, both = nodes.new("ShaderNodeBsdfTranslucent"), nodes.new("ShaderNodeAddShader")
    through.inputs["Color"].default_value = surface.inputs["Base Color"].default_value
    for link in surface.inputs["Base Color"].links:
        links.new(link.from_socket, through.inputs["Color"])
    for link in list(surface.outputs[0].links):
        links.new(both.outputs[0], link.to_socket)
    for number, shader in enumerate((surface, through)):
        links.new(shader.outputs[0], both.inputs[number])
    return made


def _build(tree: Tree, material: str) -> None:
    points = tree.input("Points", "Geometry", description="A point per tuft: size (m), turn (rad), tuft")
    with tree.frame("Tufts"):
        tufts = [tree.call(tuft_group(), **_SHAPE, seed=100 * number).value for number in range(_TUFTS)]
        painted = [paint_faces(tuft, picked_material(tree, material)) for tuft in tufts]
        bodies = op.join(*(tree.node("GeometryNodeGeometryToInstance", tuft).value for tuft in painted))
    with tree.frame("On the points"):
        sward = op.one_on_each(points, bodies, "tuft")
    tree.output("Instances", sward, description="Grass")
