"""The button that builds the road.

Annotations are not postponed here: Blender reads the properties from them.
"""

import bpy

from ...blender.model.build import MEANT, BuildTarget, RoadModel, build_steps
from ...blender.model.roads import ROAD, choose_road
from ...blender.model.settle import settle_steps
from ...blender.model.store import find_road, recall, remember
from ...blender.model.truth import EditedRoad, read_road
from ...road.parameters import RoadParameters
from ...sampling.road import sample_road
from ...scenario.scenario import Scenario
from .common import has_road, is_free
from .job import Aside, PanelJob, Step, Work
from .long_operator import LongOperator
from .unseen import build_unseen
from .view import look_along


class SYNTHROADS_OT_build(LongOperator, bpy.types.Operator):
    """Make a road from these settings. It takes the place of the shown road; all else stays as it is"""

    bl_idname = "synthroads.build"
    bl_label = "Build Road"
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    beside: bpy.props.BoolProperty(
        name="One More",
        description="Build one more road instead of building the shown one anew",
        options={"SKIP_SAVE"},
    )

    _first = False

    def job(self, context: bpy.types.Context) -> PanelJob[RoadModel]:
        """Return the building of the road that the panel asks for."""
        settings = context.scene.synthroads
        self._first = find_road(context.scene) is None
        place = BuildTarget(beside=True) if self.beside else shown_place(context.scene)
        return PanelJob("Build", build_work(settings.scenario(), settings.road_values(), place))

    def succeed(self, context: bpy.types.Context, job: PanelJob[RoadModel]) -> str:
        """Show the first road that is built."""
        assert job.result
        parameters = recall(job.result.root)[0]
        choose_road(context.scene, job.result.root)
        if self.beside:
            context.view_layer.objects.active = job.result.root
        space = context.space_data
        if self._first and not bpy.app.background and isinstance(space, bpy.types.SpaceView3D):
            look_along(space, parameters)
        return f"Built {parameters.alignment.length:,.0f} m of road"


class SYNTHROADS_OT_build_edited(LongOperator, bpy.types.Operator):
    """Build the road again as it was edited, along its moved backbone, with copies as parts. Scans do it too"""

    bl_idname = "synthroads.build_edited"
    bl_label = "Build as Edited"
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """There must be a road."""
        return is_free(cls, context) and has_road(cls, context)

    def job(self, context: bpy.types.Context) -> PanelJob[RoadModel]:
        """Return the building of the shown road as it is edited now."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        return PanelJob("Build", edited_work(str(root[ROAD]), read_road(root, context.scene)))

    def succeed(self, context: bpy.types.Context, job: PanelJob[RoadModel]) -> str:
        """Return how long the road is."""
        assert job.result
        return f"Built {recall(job.result.root)[0].alignment.length:,.0f} m of road as it was edited"


def edited_work(road: str, edited: EditedRoad) -> Work[RoadModel]:
    """Build a road again as it was edited; see `settle_steps`."""
    yield Step(0.0, "Building")
    return (yield from settle_steps(road, edited))


def shown_place(scene: bpy.types.Scene) -> BuildTarget:
    """Return the place of the road that the panel shows: it stays that one, whatever is clicked during the work."""
    root = find_road(scene)
    return MEANT if root is None else BuildTarget(str(root[ROAD]))


def build_work(scenario: Scenario, built_from: str, place: BuildTarget = MEANT) -> Work[RoadModel]:
    """Sample a road and build it in the open scene.

    Args:
        scenario: the road's limits, and the model's fidelity.
        built_from: kept with the road, to tell whether the panel's settings have changed since.
        place: which road it takes the place of.

    Raises:
        InputError: a setting is wrong; the scene is as before.
    """
    parameters = yield Aside(lambda _: sample_road(scenario.road, scenario.seed, scenario.title), "Sampling", 0.0, 0.02)
    return (yield from road_work(parameters, scenario, built_from, place))


def road_work(
    parameters: RoadParameters, scenario: Scenario, built_from: str, place: BuildTarget = MEANT
) -> Work[RoadModel]:
    """Build a road that is given in the open scene; see `build_work`."""
    fidelity = scenario.settings()
    yield Step(0.02, "Building")
    steps = build_steps(parameters, fidelity.tolerance, fidelity.vegetation_detail, place=place)
    model = yield from build_unseen(steps)
    remember(model.root, parameters, scenario, built_from)
    return model
