"""Blender's services for a scan: see `scanning.plan.SceneServices`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Literal

from ..base.turns.main_thread import MainThreadCalls
from ..materials.table import Material
from ..scanning.colour.colour import LayerSource, takes_nodes
from ..scanning.colour.request import LayerRequest, material_layers
from ..scanning.colour.transparency import Transparency
from ..scanning.finish import OF_INTENSITY
from ..scanning.relief.normal_images import NormalImage
from ..scanning.scene.caster import Caster
from ..scanning.scene.mesh import SceneMesh
from .cameras import HAS_RETURN_CAMERA, MaterialSnapshot, layer_source, snapshot_layers, varying_materials
from .cameras.surfaces import normal_images, scene_constants, transparencies, varying_materials_by_layer
from .casters import make_caster
from .materials import constants


class BlenderServices:
    """A scan's services of Blender (ray casters, materials, layers) on the open file; main thread only."""

    def caster(self, name: str, mesh: SceneMesh, kernels: str) -> Caster:
        """Return a ray caster over a mesh, see `make_caster`."""
        return make_caster(name, mesh, kernels)

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the mean optical properties of the open file's materials of these names."""
        return list(constants(names).values())

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return whether a layer that the intensity depends on varies over some of these materials."""
        varying = varying_materials_by_layer(names)
        return any(varying[layer].any() for layer in OF_INTENSITY)

    def normal_images(self, names: Sequence[str]) -> dict[int, NormalImage]:
        """Return the normal images of the open file's materials of these names, by their index."""
        return normal_images(names)

    def transparencies(self, names: Sequence[str]) -> dict[int, Transparency]:
        """Return the share of light that materials of these names let through by place, by the material's index."""
        return transparencies(names)

    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> AbstractContextManager[LayerSource]:
        """Return the context of a source of the points' colours and layers, rendering as the request asks."""
        return layer_source(request, progress=progress)


class SnapshotServices:
    """A scan's services with a snapshot of the open file's materials: usable in any thread, whatever the file becomes.

    Args:
        names: names of the materials of the scanned scene.
        calls: queue of calls that the main thread makes as materials' nodes are evaluated; None not to evaluate them.
        folder: folder for files, which must exist as long as the services are used; required with `calls`.
        kernels: ``off`` to have Cycles evaluate all materials.
    """

    def __init__(
        self,
        names: Sequence[str],
        calls: MainThreadCalls | None = None,
        folder: Path | None = None,
        kernels: Literal["auto", "off"] = "auto",
    ) -> None:
        self._means, self._constants = list(constants(names).values()), scene_constants(names)
        self._normal_images, self._transparencies = normal_images(names), transparencies(names)
        self._calls, self._snapshot = calls, None
        if calls is not None and folder is not None:
            self._snapshot = MaterialSnapshot(names, varying_materials(self._constants), folder, kernels)

    @property
    def needs_renderer(self) -> bool:
        """Return whether this Blender would render a pixel per return for materials whose nodes can't be evaluated."""
        return self._snapshot is not None and bool(self._snapshot.obstacles) and HAS_RETURN_CAMERA

    def caster(self, name: str, mesh: SceneMesh, kernels: str) -> Caster:
        """Return a ray caster over a mesh, see `make_caster`."""
        return make_caster(name, mesh, kernels)

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the mean optical properties of all materials of the snapshot; `names` is ignored."""
        return list(self._means)

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return whether a layer that the intensity depends on varies over some material; `names` is ignored."""
        return bool(self._constants.varying_layers(OF_INTENSITY))

    def normal_images(self, names: Sequence[str]) -> dict[int, NormalImage]:
        """Return the normal images of all materials of the snapshot, by their index; `names` is ignored."""
        return self._normal_images

    def transparencies(self, names: Sequence[str]) -> dict[int, Transparency]:
        """Return the light that all materials of the snapshot let through, by their index; `names` is ignored."""
        return self._transparencies

    @contextmanager
    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> Iterator[LayerSource]:
        """Context of a source of layers: from the snapshot's nodes if requested, else from materials' means."""
        if self._snapshot is None or self._calls is None or not takes_nodes(request.settings):
            yield material_layers(request, self._constants)
            return
        with snapshot_layers(request, self._constants, self._snapshot, self._calls) as source:
            yield source
