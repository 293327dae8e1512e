"""`Layers`: which layers the points get, and where from; `SceneServices`: interface to the program that has them."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

from ...materials.surfaces import Surfaces
from ...materials.table import Material
from ..colour.colour import LayerSource
from ..colour.request import LayerRequest
from ..colour.transparency import Transparency
from ..relief.normal_images import NormalImage
from ..scene.caster import Caster
from ..scene.mesh import SceneMesh


class SceneServices(Protocol):
    """Interface to the program that shows the scene, Blender or a stand-in: casters, materials, rendered layers."""

    def caster(self, name: str, mesh: SceneMesh, kernels: str) -> Caster:
        """Return a ray caster over a mesh by `ScanScenario.caster` and `ScanScenario.kernels`."""
        ...

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the mean properties of the scene's materials, in the order of the names."""
        ...

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return whether any of these materials has a reflectance that varies from place to place."""
        ...

    def normal_images(self, names: Sequence[str]) -> dict[int, NormalImage]:
        """Return the normal images of these materials, by their index in the names."""
        ...

    def transparencies(self, names: Sequence[str]) -> dict[int, Transparency]:
        """Return the light that these materials let through at each place, by their index in the names."""
        ...

    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> AbstractContextManager[LayerSource]:
        """Return a context that renders images first (progress 0 to 1) and gives the request's layer source."""
        ...


@dataclass(frozen=True)
class Layers:
    """Optional arrays of the points, those that the scan measures and those that follow from the scene.

    Attributes:
        measured: names of the optional per-point layers that the scan itself fills.
        coloured: ``rgb`` and material layers that the points get.
        kept: optional per-point layers that the sink gets; the others are needed on the way only.
        seen_points: whether blocks tell where each point was seen (`BlockResult.seen`), for colours and relief.
        means: means of the scene's materials, around which the layers of single points vary.
        request: colours and layers that are asked of the scene.
        services: of the program that shows the scene, for these; None where points stay as they are measured.
    """

    measured: frozenset[str] = frozenset()
    coloured: frozenset[str] = frozenset()
    kept: frozenset[str] = frozenset()
    seen_points: bool = False
    means: Surfaces | None = None
    request: LayerRequest | None = None
    services: SceneServices | None = None
