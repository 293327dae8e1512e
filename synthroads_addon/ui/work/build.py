"""Operators that build the road, and the work that they do.

Annotations are not postponed here: Blender reads the properties from them.
"""

from contextlib import suppress

import bpy
from mathutils import Vector

from ...base.errors import InputError
from ...base.random_streams import stream
from ...blender.model.beside import move_beside
from ...blender.model.build import MEANT, BuildTarget, RoadModel, build_steps
from ...blender.model.roads import ROAD, choose_road
from ...blender.model.settle import settle_steps
from ...blender.model.store import find_road, recall, remember, roads
from ...blender.model.truth import EditedRoad, read_road
from ...blender.things.model_builder import BuildRequest
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...sampling.road import sample_road
from ...scenario.scenario import Scenario
from ..fields.numbers import LARGEST_INTEGER, LENGTH_DIGITS
from .common import column, has_road, is_free
from .job import Aside, PanelJob, Step, Work, part_of_work
from .long_operator import LongOperator
from .unseen import build_unseen
from .view import look_along


class SYNTHROADS_OT_build(LongOperator, bpy.types.Operator):
    """Build a road from these settings. It replaces the shown road; everything else stays as it is"""

    bl_idname = "synthroads.build"
    bl_label = "Build Road"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    beside: bpy.props.BoolProperty(
        name="One More",
        description="Add a road to the scene instead of rebuilding the shown one; if a road has the same seed, "
        "the next road gets another",
        options={"SKIP_SAVE"},
    )

    at_cursor: bpy.props.BoolProperty(
        name="At the Cursor",
        description="Put the middle of one more road at the 3D cursor; else the road is beside all visible objects",
        options={"SKIP_SAVE"},
    )

    length: bpy.props.FloatProperty(
        name="Length",
        description="Length of the road along its axis in m, e.g. 600; 0: that of the panel",
        min=0.0,
        soft_max=10_000.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )

    seed: bpy.props.IntProperty(
        name="Seed",
        description="Number that the road is drawn from, within the panel's limits: another one, another road; "
        "-1: that of the panel",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )

    _first = False
    _differs = False
    """Whether the road has another seed or length than the panel when its work began."""

    def job(self, context: bpy.types.Context) -> PanelJob[RoadModel]:
        """Return the job that builds a road from the panel's settings, with the redo panel's length and seed."""
        settings = context.scene.synthroads
        self._first = find_road(context.scene) is None
        place = shown_place(context.scene)
        if self.beside:
            place = BuildTarget(beside=True, moves_aside=not self.at_cursor)
        before = settings.seed, settings.road.length
        try:  # the panel's settings change once the road is there
            if self.length > 0.0 and self.length != settings.road.length:
                settings.road.length = self.length
            if self.seed >= 0 and self.seed != settings.seed:
                settings.seed = self.seed
            elif self.beside and (unused := unused_seed(settings.exact_seed(), context.scene)) != settings.exact_seed():
                settings.seed = unused
            self.seed, self.length = settings.seed, settings.road.length
            self._differs = (self.seed, self.length) != before
            return PanelJob("Build", build_work(settings.scenario(), settings.road_values(), place))
        finally:
            if settings.seed != before[0]:
                settings.seed = before[0]
            if settings.road.length != before[1]:
                settings.road.length = before[1]

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what another road is built from, and where one more road is."""
        layout = column(self)
        layout.prop(self, "length")
        layout.prop(self, "seed")
        if self.beside:
            layout.prop(self, "at_cursor")

    def succeed(self, context: bpy.types.Context, job: PanelJob[RoadModel]) -> str:
        """Make the new road the current one, look along it if it is the scene's first, and return the message."""
        assert job.result
        parameters = recall(job.result.root)[0]
        choose_road(context.scene, job.result.root)
        if self.beside:
            if self.at_cursor:
                move_middle_to(job.result.root, parameters, context.scene.cursor.location)
            context.view_layer.objects.active = job.result.root
        if self._differs:
            context.scene.synthroads.seed, context.scene.synthroads.road.length = self.seed, self.length
        space = context.space_data
        if self._first and not bpy.app.background and isinstance(space, bpy.types.SpaceView3D):
            look_along(space, parameters)
        return f"Built {parameters.alignment.length:,.0f} m of road"


def move_middle_to(root: bpy.types.Object, parameters: RoadParameters, place: Vector) -> None:
    """Move a road's root so that the middle of the road's axis is at a place of the scene."""
    geometry = RoadGeometry(parameters)
    middle = geometry.length / 2.0
    local = Vector((*geometry.alignment.position(middle).tolist(), float(geometry.profile.elevation(middle))))
    root.location = root.location + place - root.matrix_basis @ local


class SYNTHROADS_OT_build_edited(LongOperator, bpy.types.Operator):
    """Build the road again as it was edited, along its moved backbone, with copies as parts. Scans do it too"""

    bl_idname = "synthroads.build_edited"
    bl_label = "Build as Edited"
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no other work is running."""
        return is_free(cls, context) and has_road(cls, context)

    def job(self, context: bpy.types.Context) -> PanelJob[RoadModel]:
        """Return the job that rebuilds the current road with its edits."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        return PanelJob("Build", edited_work(str(root[ROAD]), read_road(root, context.scene)))

    def succeed(self, context: bpy.types.Context, job: PanelJob[RoadModel]) -> str:
        """Return the message, with the road's length."""
        assert job.result
        return f"Built {recall(job.result.root)[0].alignment.length:,.0f} m of road as it was edited"


def next_seed(seed: int) -> int:
    """Return the seed that Random Road uses after this one, deterministically."""
    return int(stream(seed, "random road").integers(1, LARGEST_INTEGER))


def unused_seed(seed: int, scene: bpy.types.Scene) -> int:
    """Return a seed that none of a scene's roads was drawn from: this one if it can be, else one after it."""
    seeds = set()
    for root in roads(scene):
        with suppress(InputError):  # what is kept of the road is damaged
            seeds.add(recall(root)[1].seed)
    while seed in seeds:
        seed = next_seed(seed)
    return seed


def edited_work(road: str, edited: EditedRoad) -> Work[RoadModel]:
    """Generator that rebuilds an edited road in its place, as a job's work; see `settle_steps`."""
    yield Step(0.0, "Building")
    return (yield from settle_steps(road, edited))


def shown_place(scene: bpy.types.Scene) -> BuildTarget:
    """Return the build target that replaces the current road, by its id: clicks during the work don't change it."""
    root = find_road(scene)
    return MEANT if root is None else BuildTarget(str(root[ROAD]))


def build_work(scenario: Scenario, built_from: str, place: BuildTarget = MEANT) -> Work[RoadModel]:
    """Generator that samples a road and builds it in the open scene, as a job's work.

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
    parameters: RoadParameters,
    scenario: Scenario,
    built_from: str,
    place: BuildTarget = MEANT,
    reconstruction: str = "",
) -> Work[RoadModel]:
    """Generator that builds a road from given parameters, as a job's work; see `build_work` and `remember`."""
    fidelity = scenario.settings()
    yield Step(0.02, "Building")
    steps = build_steps(BuildRequest(parameters, fidelity.tolerance, fidelity.vegetation_detail), place)
    model = yield from part_of_work(build_unseen(steps), 0.02, 1.0)
    remember(model.root, parameters, scenario, built_from, reconstruction)
    if place.beside and place.moves_aside:
        move_beside(model.root, bpy.context.view_layer)
    return model
