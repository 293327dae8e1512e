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
    """A scan's services of Blender (ray casters, materials, layers) on the open file; main thread only."""

    def caster(self, name: str, mesh: SceneMesh) -> Caster:
        """Return a ray caster over a mesh, see `make_caster`."""
        return make_caster(name, mesh)

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the mean optical properties of the open file's materials of these names."""
        return list(constants(names).values())

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return whether a layer that the intensity depends on varies over some of these materials."""
        return bool(scene_constants(names).varying_layers(OF_INTENSITY))

    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> AbstractContextManager[LayerSource]:
        """Return the context of a source of the points' colours and layers, rendering as the request asks."""
        return layer_source(request, progress=progress)


class SnapshotServices:
    """A scan's services with a snapshot of the open file's materials: usable in any thread, nothing is rendered.

    Args:
        names: materials of the scene that is scanned.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._means, self._constants = list(constants(names).values()), scene_constants(names)

    def caster(self, name: str, mesh: SceneMesh) -> Caster:
        """Return a ray caster over a mesh, see `make_caster`."""
        return make_caster(name, mesh)

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the mean optical properties of all materials of the snapshot; `names` is ignored."""
        return list(self._means)

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return False: without rendering, materials count as constant."""
        return False

    @contextmanager
    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> Iterator[LayerSource]:
        """Context of a source of layers that are the materials' constants."""
        yield material_layers(request, self._constants)
