"""The button that builds the road."""

from __future__ import annotations

import bpy

from ...blender.model.build import RoadModel, build_steps
from ...blender.model.store import find_road, recall, remember
from ...road.parameters import RoadParameters
from ...sampling.road import sample_road
from ...scenario.scenario import Scenario
from .job import Aside, PanelJob, Step, Work
from .long_operator import LongOperator
from .view import look_along


class SYNTHROADS_OT_build(LongOperator, bpy.types.Operator):
    """Make a road from these settings. It takes the place of the road built before; other objects stay as they are"""

    bl_idname = "synthroads.build"
    bl_label = "Build Road"
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    _first = False

    def job(self, context: bpy.types.Context) -> PanelJob[RoadModel]:
        """Return the building of the road that the panel asks for."""
        settings = context.scene.synthroads
        self._first = find_road(context.scene) is None
        return PanelJob("Build", build_work(settings.scenario(), settings.road_values()))

    def succeed(self, context: bpy.types.Context, job: PanelJob[RoadModel]) -> str:
        """Show the first road that is built."""
        assert job.result
        parameters = recall(job.result.collection)[0]
        space = context.space_data
        if self._first and not bpy.app.background and isinstance(space, bpy.types.SpaceView3D):
            look_along(space, parameters)
        return f"Built {parameters.alignment.length:,.0f} m of road"


def build_work(scenario: Scenario, built_from: str) -> Work[RoadModel]:
    """Sample a road and build it in the open scene.

    Args:
        scenario: the road's limits, and the model's fidelity.
        built_from: kept with the road, to tell whether the panel's settings have changed since.

    Raises:
        InputError: a setting is wrong; the scene is as before.
    """
    parameters = yield Aside(lambda _: sample_road(scenario.road, scenario.seed, scenario.title), "Sampling", 0.0, 0.02)
    return (yield from road_work(parameters, scenario, built_from))


def road_work(parameters: RoadParameters, scenario: Scenario, built_from: str) -> Work[RoadModel]:
    """Build a road that is given in the open scene; see `build_work`."""
    fidelity = scenario.settings()
    yield Step(0.02, "Building")
    model = yield from build_steps(parameters, fidelity.tolerance, fidelity.vegetation_detail)
    remember(model.collection, parameters, scenario, built_from)
    return model
