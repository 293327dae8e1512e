"""Ray casters behind one interface (`scanning.scene.caster.Caster`)."""

from __future__ import annotations

import bpy

from ...base.errors import InputError
from ...scanning.scene.caster import Caster
from ...scanning.scene.mesh import SceneMesh

NAMES = ("embree", "bvhtree")


def make_caster(name: str, mesh: SceneMesh) -> Caster:
    """Build the ray caster ``embree`` or ``bvhtree`` for a mesh; ``auto`` takes the fastest that is installed.

    Raises:
        InputError: there is no such caster, or its package isn't installed.
    """
    if name in ("auto", "embree"):
        try:
            from .embree import EmbreeCaster

            return EmbreeCaster(mesh, in_pieces=not bpy.app.background)
        except ImportError:
            if name == "embree":
                raise InputError("scan.caster", name, "needs the package embreex; bvhtree is always there") from None
    if name in ("auto", "bvhtree"):
        from .bvhtree import BVHTreeCaster  # only where it is needed

        return BVHTreeCaster(mesh)
    raise InputError("scan.caster", name, f"must be auto or one of {', '.join(NAMES)}")
