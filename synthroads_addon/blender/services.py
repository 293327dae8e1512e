"""Blender's services for a scan: see `scanning.plan.SceneServices`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

from ..materials.table import Material
from ..scanning.colour.colour import LayerSource
from ..scanning.colour.request import LayerRequest, material_layers
from ..scanning.finish import OF_INTENSITY
from ..scanning.scene.caster import Caster
from ..scanning.scene.mesh import SceneMesh
from .cameras import layer_source
from .cameras.surfaces import scene_constants
from .casters import make_caster
from .materials import constants


class BlenderServices:
    """Services of the open file; in Blender's main thread only."""

    def caster(self, name: str, mesh: SceneMesh) -> Caster:
        """Return a ray caster over a mesh, see `make_caster`."""
        return make_caster(name, mesh)

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the means of materials of the open file."""
        return list(constants(names).values())

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return whether some of these materials of the open file reflect otherwise at other places."""
        return bool(scene_constants(names).varying_layers(OF_INTENSITY))

    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> AbstractContextManager[LayerSource]:
        """Open a source of colours and layers, see `layer_source`."""
        return layer_source(request, progress=progress)


class SnapshotServices:
    """Services that read the open file's materials once; then any thread may use them, and nothing is rendered.

    Args:
        names: materials of the scene that is scanned.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._means, self._constants = list(constants(names).values()), scene_constants(names)

    def caster(self, name: str, mesh: SceneMesh) -> Caster:
        """Return a ray caster over a mesh, see `make_caster`."""
        return make_caster(name, mesh)

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the means that were read."""
        return list(self._means)

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return that nothing varies: nothing is rendered here."""
        return False

    @contextmanager
    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> Iterator[LayerSource]:
        """Yield the materials' own values."""
        yield material_layers(request, self._constants)
