"""The sward in pictures: dense blades of grass around a camera on ground, verges and median; scans leave it out."""

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
"""Density of grass on each material of the ground, as a share of a meadow's; chosen."""
_RINGS = ((0.0, 12.0, 14.0, 0.42), (12.0, 35.0, 4.0, 0.8), (35.0, 120.0, 0.8, 1.7))
"""Rings around the camera: inner and outer radius (m), tufts per m2, breadth of a tuft (m); all chosen."""
_TUFTS = 4
"""Number of different tufts; chosen."""
_SHAPE = {
    "blades": 110,
    "blade_width": 0.022,
    "spread": 0.5,
    "lean": 0.95,
    "stalks": 4,
    "ear_width": 0.02,
    "blade_height": 0.8,
}
"""Inputs of a tuft's node group, for a tuft 1 m high and 1 m broad; chosen."""


@dataclass(frozen=True)
class Lawn:
    """The ground on which a road's grass grows, as triangles.

    Attributes:
        corners: (T, 3, 3) local coordinates, m.
        cover: (T,) density of grass on each triangle, as a share of a meadow's.
    """

    corners: Float
    cover: Float

    @classmethod
    def of(cls, scene: bpy.types.Scene, matrix: Matrix) -> Lawn:
        """Return the lawn of a scene's roads and terrain; `matrix` transforms local coordinates into the scene's."""
        mesh = scene_mesh(scene, [item for item in scene.objects if item.get(ROLE) in _PARTS])
        by_material = np.array([_COVER.get(entry_of(name), 0.0) for name in mesh.materials])
        cover = by_material[mesh.material]
        has_grass = cover > 0.0
        inverse_matrix = np.array(matrix.inverted())
        vertices = mesh.vertices.astype(np.float64) @ inverse_matrix[:3, :3].T + inverse_matrix[:3, 3]
        return cls(vertices[mesh.triangles[has_grass]], cover[has_grass])

    def scatter(self, place: Float, ring: tuple[float, float, float, float], random: np.random.Generator) -> Float:
        """Return random places (N, 3) on the lawn in a ring of `_RINGS` around a place (3,), m."""
        inner_radius, outer_radius, density, _ = ring
        centres = self.corners.mean(axis=1)
        radii = np.linalg.norm(self.corners - centres[:, None], axis=2).max(axis=1)
        near_triangles = np.flatnonzero(np.linalg.norm(centres - place, axis=1) < outer_radius + radii)
        origin, *other_corners = np.moveaxis(self.corners[near_triangles], 1, 0)
        sides = [corner - origin for corner in other_corners]
        area = 0.5 * np.linalg.norm(np.cross(*sides), axis=1)
        counts = random.poisson(area * density * self.cover[near_triangles])
        rows = np.repeat(np.arange(len(near_triangles)), counts)
        shares = random.random((2, len(rows)))
        # Uniform points in a triangle: random points of the parallelogram of two sides, mirrored into its half.
        shares = np.where(shares.sum(axis=0) > 1.0, 1.0 - shares, shares)
        places = origin[rows] + shares[0, :, None] * sides[0][rows] + shares[1, :, None] * sides[1][rows]
        distance = np.linalg.norm(places - place, axis=1)
        return np.asarray(places[(distance >= inner_radius) & (distance < outer_radius)])


def add_sward(
    scene: bpy.types.Scene, parameters: RoadParameters, lawn: Lawn, place: ArrayLike, matrix: Matrix
) -> bpy.types.Object | None:
    """Add the sward around a place to a scene, replacing an earlier one; return it, None if the road has no sown grass.

    It has the colour and heights of the road's first sown grass, but the height of mown grass on verges, the median
    and mown strips. The same road and place give the same blades.

    Args:
        scene: scene that shows the road.
        parameters: the road.
        lawn: ground on which grass grows, see `Lawn.of`.
        place: local coordinates (3,) of the camera, m.
        matrix: matrix from the road's local coordinates to the scene's.
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
    # Breadths vary by 20 %, and heights over the lower half of the grass's range (chosen).
    breadth = breadth * random.uniform(0.8, 1.2, len(places))
    height = grass.height_min + (grass.height_max - grass.height_min) * 0.5 * random.random(len(places))
    height = np.where(mown(RoadGeometry(parameters), grass, places), ROADSIDE_HEIGHT, 1.0) * height
    attribute(mesh, "size", np.column_stack([breadth, breadth, height]))
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
    """Return a mask (N,) of the local places (N, 3) whose grass is mown: on and behind verges, in the median."""
    station, offset = geometry.alignment.project(places[:, :2])
    edges = geometry.offsets(np.clip(station, 0.0, geometry.length))
    edge_distance = np.maximum(offset - edges[:, 0], edges[:, -1] - offset)
    return np.asarray(edge_distance < grass.mown_width)


def _translucent(blades: bpy.types.Material) -> bpy.types.Material:
    """Return a copy of a material that transmits as much light diffusely as it reflects; only for pictures."""
    copy = blades.copy()
    copy.name, copy[SWARD] = f"{blades.name} (sward)", True
    nodes, links = copy.node_tree.nodes, copy.node_tree.links
    surface = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    translucent, sum_shader = nodes.new("ShaderNodeBsdfTranslucent"), nodes.new("ShaderNodeAddShader")
    translucent.inputs["Color"].default_value = surface.inputs["Base Color"].default_value
    for link in surface.inputs["Base Color"].links:
        links.new(link.from_socket, translucent.inputs["Color"])
    for link in list(surface.outputs[0].links):
        links.new(sum_shader.outputs[0], link.to_socket)
    for number, shader in enumerate((surface, translucent)):
        links.new(shader.outputs[0], sum_shader.inputs[number])
    return copy


def _build(tree: Tree, material: str) -> None:
    """Build the node group of the sward: one of several tufts on each point."""
    points = tree.input("Points", "Geometry", description="A point per tuft: size (m), turn (rad), tuft")
    with tree.frame("Tufts"):
        tufts = [tree.call(tuft_group(), **_SHAPE, seed=100 * number).value for number in range(_TUFTS)]
        painted_tufts = [paint_faces(tuft, picked_material(tree, material)) for tuft in tufts]
        bodies = op.join(*(tree.node("GeometryNodeGeometryToInstance", tuft).value for tuft in painted_tufts))
    with tree.frame("On the points"):
        sward = op.one_on_each(points, bodies, "tuft")
    tree.output("Instances", sward, description="Grass")
