"""Ray casters behind one interface (`scanning.scene.caster.Caster`)."""

from __future__ import annotations

import bpy

from ...base.errors import InputError
from ...scanning.kernels.library import NoKernelError
from ...scanning.kernels.packets import usable_packets
from ...scanning.scene.caster import Caster
from ...scanning.scene.mesh import SceneMesh
from .packets import PacketCaster

NAMES = ("embree", "bvhtree")


def make_caster(name: str, mesh: SceneMesh, kernels: str = "auto") -> Caster:
    """Build the ray caster ``embree`` or ``bvhtree`` for a mesh; ``auto`` takes the fastest that is installed.

    Args:
        name: name of the caster.
        mesh: triangles that rays hit.
        kernels: ``auto`` to let Embree cast rays in packets if this machine can, ``off`` to cast them one by one.

    Raises:
        InputError: there is no such caster, or its package isn't installed.
    """
    if name in ("auto", "embree"):
        try:
            return _embree_caster(mesh, kernels)
        except ImportError:
            if name == "embree":
                raise InputError(
                    "scan.caster",
                    name,
                    "needs the package embreex, which isn't installed; take auto or bvhtree, which every Blender has",
                ) from None
    if name in ("auto", "bvhtree"):
        from .bvhtree import BVHTreeCaster  # only where it is needed

        return BVHTreeCaster(mesh)
    raise InputError("scan.caster", name, f"must be auto or one of {', '.join(NAMES)}")


def _embree_caster(mesh: SceneMesh, kernels: str) -> Caster:
    """Return a caster of packets unless `kernels` is ``off`` or this machine can't, else a caster of single rays."""
    from .embree import EmbreeCaster  # embreex may be missing

    in_pieces = not bpy.app.background
    if kernels == "off":
        return EmbreeCaster(mesh, in_pieces=in_pieces)
    packets = usable_packets()
    if isinstance(packets, NoKernelError):
        return EmbreeCaster(mesh, in_pieces=in_pieces, kernels=f"none: rays are cast one by one, as {packets}")
    return PacketCaster(packets, mesh)
