"""The fastest caster: Embree 4 with its packets of rays, see `scanning.kernels.packets`."""

from __future__ import annotations

from ...scanning.kernels.packets import USUAL, Packets, PacketScene, Packing
from ...scanning.scene.mesh import SceneMesh


class PacketCaster(PacketScene):
    """Ray caster on Embree 4 that casts rays that run side by side in packets, and the others one by one.

    It releases Python's lock while it is built and while it casts.

    Args:
        packets: what casts them.
        mesh: what rays are cast at.
        robust: no ray slips through an edge that two faces share; a little slower.
        packing: of the rays.
    """

    name = "embree"
    main_thread_only = False

    def __init__(self, packets: Packets, mesh: SceneMesh, robust: bool = True, packing: Packing = USUAL) -> None:
        super().__init__(packets, mesh.vertices, mesh.triangles, robust, packing)
        self.kernels = f"packets of {packing.width or packets.width} rays"
