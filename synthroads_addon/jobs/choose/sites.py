"""Sites that settings are chosen for: a road that is built for it, or a scene that is there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from ...blender.model.build import RoadModel
from ...road.geometry import RoadGeometry
from ...scanning.plan import ScanConditions
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import Scenario
from ..road_scene import build_model, read_scene
from ..scan.plan import road_path
from .knobs import ModelKnobs, model_knobs


class Site(Protocol):
    """A scene that may be built in several ways.

    Attributes:
        path: the scanner's.
        conditions: of the scene's road.
        area: of the model, m2; 0 if nothing is built.
    """

    path: ScanPath
    conditions: ScanConditions
    area: float

    def models(self, limits: Mapping[str, float]) -> Sequence[ModelKnobs | None]:
        """Return the models to choose from, the cheapest first; None for a scene that is there."""
        ...

    def scene(self, model: ModelKnobs | None) -> ScannedScene:
        """Return the scene of a model, built in place of that before."""
        ...


class RoadSite:
    """A road that is built in the open file, one model in place of the other; see `Site`.

    Attributes:
        model: that was built last.
    """

    def __init__(self, scenario: Scenario, road: RoadGeometry) -> None:
        self._scenario, self._road = scenario, road
        self.path: ScanPath = road_path(scenario, road)
        self.conditions = ScanConditions.of(road.parameters)
        terrain = road.parameters.terrain
        self.area = 2.0 * (terrain.half_width if terrain else scenario.road.half_width) * road.length
        self.model: RoadModel | None = None

    def models(self, limits: Mapping[str, float]) -> Sequence[ModelKnobs]:
        """Return the models to choose from, the cheapest first."""
        return model_knobs(self._scenario, limits)

    def scene(self, model: ModelKnobs | None) -> ScannedScene:
        """Return the scene of a model, built in place of that before."""
        assert model is not None
        changes = {"geometric_tolerance": model.tolerance, "vegetation_detail": model.detail}
        self.model = build_model(self._scenario.model_copy(update=changes), self._road)
        return read_scene(self._scenario, self._road)


class SceneSite:
    """A scene that is there already, of which nothing can be built otherwise; see `Site`."""

    area = 0.0

    def __init__(self, scene: ScannedScene, path: ScanPath, conditions: ScanConditions) -> None:
        self._scene, self.path, self.conditions = scene, path, conditions

    def models(self, limits: Mapping[str, float]) -> Sequence[None]:
        """Return the one model that there is."""
        return (None,)

    def scene(self, model: ModelKnobs | None) -> ScannedScene:
        """Return the scene."""
        return self._scene
