"""SR Grass: tufts of bent blades on the ground, the verges and the median."""

from __future__ import annotations

import bpy

from ...core.cloud.labels import class_id
from . import operations as op
from .builder import Tree, node_group
from .plants import declare_stand, planted, points_in_band

_VARIANTS = 4
_BLADES = 5
# A blade is one face, creased between its widest points: out from the tuft, across the blade, up.
_BLADE = [(0.0, 0.0, 0.0), (0.12, -0.5, 0.5), (0.12, 0.5, 0.5), (0.42, 0.0, 1.0)]


def grass_group() -> bpy.types.NodeTree:
    """Return the group SR Grass."""
    return node_group("SR Grass", _build)


def _build(tree: Tree) -> None:
    """Tufts of grass in a band beside the road, and shorter ones on its verges and median."""
    stand = declare_stand(tree, 1.0, (0.1, 0.45), (0.0, 60.0))
    beside = tree.number(
        "Roadside Density", 1.0, (0.0, 50.0), description="Tufts per area of verge and median (1/m2)"
    )
    short = tree.number(
        "Roadside Height",
        0.5,
        (0.0, 1.0),
        unit="share",
        description="Height there, as a share of the height elsewhere",
    )
    width = tree.number("Blade Width", 0.035, (0.002, 0.2), unit="m", description="Widest place of a blade")
    material = tree.input("Material", "Material", description="Material of the blades")

    with tree.frame("Places on the terrain"):
        points = points_in_band(tree, stand, op.object_geometry(stand.terrain), stand.density * stand.detail)
        points = op.store(points, "share", 1.0)
    with tree.frame("Places on verges and median"):
        roadside = op.named(tree, "class_id", "INT").equals(class_id("roadside"))
        faces = op.separate(op.object_geometry(stand.road), roadside, "FACE")
        mown = tree.node(
            "GeometryNodeDistributePointsOnFaces",
            faces,
            distribute_method="RANDOM",
            density=beside * stand.detail,
            seed=stand.seed + 7,
        )["Points"]
        points = op.join(points, op.store(mown, "share", short))
    with tree.frame("Kinds of tufts"):
        variants = [tree.call(tuft_group(), seed=100 * n, blade_width=width).value for n in range(_VARIANTS)]
    with tree.frame("Tufts"):
        height = op.random(tree, 0.0, 1.0, stand.seed + 3)
        height = stand.lowest + (stand.tallest - stand.lowest) * height * height
        height = height * op.named(tree, "share")
        # Fewer tufts are broader, so that they cover as much of the ground.
        broad = 1.0 / op.unary("SQRT", op.maximum(stand.detail, 0.05))
        scale = op.vector(tree, height * broad, height * broad, height)
        mesh = planted(tree, stand, points, variants, scale, 0.25)
        mesh = op.label(mesh, class_id("vegetation"), stand.instance, material)
    tree.output("Mesh", mesh, description="Grass; only faces that scanner and camera can see")


def tuft_group() -> bpy.types.NodeTree:
    """Return the group SR Grass Tuft."""
    return node_group("SR Grass Tuft", _build_tuft)


def _build_tuft(tree: Tree) -> None:
    """One tuft of height 1, for a typical height of 0.3 m."""
    seed = tree.integer("Seed", 0, (0, 2**30), description="Seed of the blades")
    width = tree.number("Blade Width", 0.035, (0.002, 0.2), unit="m", description="Widest place of a blade")
    with tree.frame("A bent blade"):
        blade = tree.node("GeometryNodeMeshGrid", vertices_x=2, vertices_y=2).value
        shape = op.choose(op.index(tree), _BLADE)
        across = op.component(shape, "Y") * (width / 0.3)
        blade = op.set_position(
            blade, op.vector(tree, op.component(shape, "X"), across, op.component(shape, "Z"))
        )
    with tree.frame("Blades around the middle"):
        points = tree.node("GeometryNodeMeshLine", count=_BLADES, offset=(0.0, 0.0, 0.0)).value
        around = op.index(tree) * (6.2832 / _BLADES) + op.random(tree, 0.0, 1.0, seed)
        out = op.random(tree, 0.05, 0.45, seed + 1)
        place = op.vector(tree, op.unary("COSINE", around) * out, op.unary("SINE", around) * out)
        blades = tree.node(
            "GeometryNodeInstanceOnPoints",
            op.set_position(points, place),
            instance=blade,
            rotation=op.turn(tree, z=around + op.random(tree, -0.6, 0.6, seed + 2)),
            scale=op.random(tree, 0.55, 1.0, seed + 3),
        ).value
    tree.output("Mesh", op.realize(blades), description="The tuft's blades")
