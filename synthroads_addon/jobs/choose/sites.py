"""What settings are chosen for: a road that is built for it, or a scene that is there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...blender.materials import vary
from ...blender.model.build import RoadModel, build_road
from ...blender.scene.evaluated import scanned_scene
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import Scenario
from ..scan.files import road_path
from .knobs import ModelKnobs, model_knobs
from .pilot import Air


class RoadSite:
    """A road that is built in the open file, one model in place of the other; see `jobs.choose.search.Site`.

    Attributes:
        model: that was built last.
    """

    def __init__(self, scenario: Scenario, parameters: RoadParameters) -> None:
        self._scenario, self._parameters = scenario, parameters
        self._geometry = RoadGeometry(parameters)
        self.path: ScanPath = road_path(scenario, self._geometry)
        self.air = Air(parameters.environment, parameters.materials)
        half_width = parameters.terrain.half_width if parameters.terrain else scenario.road.half_width
        self.area = 2.0 * half_width * self._geometry.length
        self.model: RoadModel | None = None

    def models(self, limits: Mapping[str, float]) -> Sequence[ModelKnobs]:
        """Return the models to choose from, the cheapest first."""
        return model_knobs(self._scenario, limits)

    def scene(self, model: ModelKnobs | None) -> ScannedScene:
        """Return the scene of a model, built in place of that before."""
        assert model is not None
        self.model = build_road(self._parameters, model.tolerance, model.detail)
        if self._scenario.materials_table:
            vary(self._parameters.materials, self._parameters.environment, self._scenario.own_materials())
        return scanned_scene(geometry=self._geometry, speed_factor=self._scenario.scan.traffic_speed_factor)


class SceneSite:
    """A scene that is there already, of which nothing can be built otherwise; see `jobs.choose.search.Site`."""

    area = 0.0

    def __init__(self, scene: ScannedScene, path: ScanPath, air: Air) -> None:
        self._scene, self.path, self.air = scene, path, air

    def models(self, limits: Mapping[str, float]) -> Sequence[None]:
        """Return the one model that there is."""
        return (None,)

    def scene(self, model: ModelKnobs | None) -> ScannedScene:
        """Return the scene."""
        return self._scene
