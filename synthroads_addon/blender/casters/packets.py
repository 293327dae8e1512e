"""The fastest caster: Embree 4 with its packets of rays, see `scanning.kernels.packets`."""

from __future__ import annotations

from ...scanning.kernels.packets import USUAL, Packets, PacketScene, Packing
from ...scanning.scene.mesh import SceneMesh


class PacketCaster(PacketScene):
    """Ray caster on Embree 4 that casts nearly parallel rays in packets, and the other rays one by one.

    It releases Python's lock while it is built and while it casts.

    Args:
        packets: compiled library that casts packets.
        mesh: triangles that rays hit.
        robust: whether no ray may slip through an edge that two faces share; a little slower.
        packing: how rays are gathered into packets.
    """

    name = "embree"
    main_thread_only = False

    def __init__(self, packets: Packets, mesh: SceneMesh, robust: bool = True, packing: Packing = USUAL) -> None:
        super().__init__(packets, mesh.vertices, mesh.triangles, robust, packing)
        self.kernels = f"packets of {packing.width or packets.width} rays"
