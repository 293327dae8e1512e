"""`LayerRequest`: which colours and layers are wanted, of which scene."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from ...road.parameters import RoadParameters
from ...road.surroundings import Environment
from ..platforms.path import Path
from ..scene.mesh import SceneMesh
from ..scene.motion import MovingMesh
from .colour import ColourSettings, MaterialLayers, SurfaceConstants
from .light import CloudShadows, SunAndSky
from .tunnel_light import TunnelLight
from .views import View


@dataclass(frozen=True)
class LayerRequest:
    """Request for a scan's colours and material layers: which ones, of what scene, along which path, in what light.

    Attributes:
        settings: how they are rendered.
        names: of the layers: ``rgb``, ``base_color``, ``roughness``, ``metallic``, ``specular``.
        mesh: what is scanned, without what moves.
        moving: what moves.
        kernels: ``auto`` to have a kernel work materials out where this machine and their nodes let it, else ``off``.
        environment: light and weather.
        path: the scanner's.
        field_of_view: the scanner's, rad.
        seed: of the clouds.
        frame: where (3,) the scene's local frame begins in that of the clouds, m.
        road: the road, in whose tunnels there is another light; None without one.
        pick: which of the images along the path are rendered, and what of them; None for all.
    """

    settings: ColourSettings
    names: frozenset[str]
    mesh: SceneMesh
    environment: Environment
    path: Path
    field_of_view: float
    seed: int = 0
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pick: Callable[[list[View]], list[View]] | None = None
    moving: tuple[MovingMesh, ...] = ()
    kernels: Literal["auto", "off"] = "auto"
    road: RoadParameters | None = None

    @property
    def lit(self) -> bool:
        """Return whether RGB colours lit by sun and sky are wanted."""
        return "rgb" in self.names and self.settings.mode == "lit"


def material_layers(
    request: LayerRequest, constants: SurfaceConstants, light: SunAndSky | None = None
) -> MaterialLayers:
    """Return the layer source of the materials' mean values, with drifting cloud shadows if lit and cloudy.

    Args:
        request: which colours and layers.
        constants: means of the scene's materials.
        light: that of the images; the usual one if None.
    """
    clouds = None
    if request.lit and request.environment.cloud_cover > 0.0:
        clouds = CloudShadows(request.environment, request.seed, request.frame)
    tunnels = TunnelLight.of(request.road, request.frame) if request.lit else None
    return MaterialLayers(constants, request.settings.mode, light or SunAndSky(), clouds, tunnels)
