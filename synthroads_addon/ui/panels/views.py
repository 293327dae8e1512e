"""The panel "Light and Cameras": sun, sky, haze and cameras of the road, for the user's own pictures.

Annotations are not postponed here: Blender reads the properties from them.
"""

import math

import bpy
from mathutils import Matrix

from ...blender.model.older_files import PARAMETERS
from ...blender.model.store import SCENARIO, find_road, recall
from ...blender.views.daylight import DRIVER, VIEW, add_views, cameras_of
from ...sampling.surroundings import sample_environment
from ...scenario.scenario import Scenario
from ..fields.room import buttons_row, draw_text
from ..translations.blender import said
from ..work.common import Sidebar, column, has_road, refusing
from ..work.view import view_of
from .rules import edited_parameters

_SUN_LIMITS = ("sun_place", "sun_azimuth_deg", "sun_elevation_deg", "time_of_day", "day_of_year", "latitude_deg")
"""Fields of a scenario's environment that the sun's direction follows from."""


NIGHT_SUN = -20.0
"""Elevation of the sun (deg) of the button for the night: below -18 deg the sky has no twilight left."""
NIGHT_SAMPLES = 128
"""Samples a pixel of pictures by night where the scene has Blender's own number. Chosen: with denoising, lamps and what
signs send back are clean."""
_BLENDERS = {"samples": 4096, "adaptive_threshold": 0.01, "max_bounces": 12}
"""Settings of Blender's Cycles in a new file."""
_NIGHTS = {"samples": NIGHT_SAMPLES, "adaptive_threshold": 0.03, "max_bounces": 4}
"""Its settings for pictures by night: light that is reflected more than four times adds nothing to be seen."""


def move_sun(root: bpy.types.Object, chosen: Scenario) -> None:
    """Give a road the sun of other limits, drawn with its seed, where they differ from those that it was built with.

    Neither the model nor its edits depend on the sun: the road needn't be built again.

    Args:
        root: of the road.
        chosen: the limits.

    Raises:
        InputError: what is kept of the road is damaged.
    """
    parameters, scenario = recall(root)
    limits = {name: getattr(chosen.road.environment, name) for name in _SUN_LIMITS}
    if limits == {name: getattr(scenario.road.environment, name) for name in _SUN_LIMITS}:
        return
    environment_limits = scenario.road.environment.model_copy(update=limits)
    road = scenario.road.model_copy(update={"environment": environment_limits})
    drawn = sample_environment(road, scenario.seed)
    sun = {"sun_azimuth_deg": drawn.sun_azimuth_deg, "sun_elevation_deg": drawn.sun_elevation_deg}
    environment = parameters.environment.model_copy(update=sun)
    root[PARAMETERS] = parameters.model_copy(update={"environment": environment}).to_json()
    root[SCENARIO] = scenario.model_copy(update={"road": road}).to_json()


def light_road(context: bpy.types.Context) -> None:
    """Add sun, sky, haze and cameras for the current road with its edits, with the panel's sun, replacing earlier ones.

    Raises:
        InputError: a setting is wrong, or what is kept of the road is damaged.
    """
    root = find_road(context.scene)
    assert root  # the operators' poll() has seen the road
    move_sun(root, context.scene.synthroads.scenario())
    parameters = edited_parameters(context.scene)
    assert parameters
    add_views(context.scene, parameters, Matrix(root.matrix_world))


class SYNTHROADS_OT_add_views(bpy.types.Operator):
    """Add sun, sky and haze for the road, a driver's and an aerial camera, replacing earlier ones. The sun is that of Sun and Weather. Scans ignore lights and cameras"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.add_views"
    bl_label = "Add Sun, Sky, Cameras"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return has_road(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Add sun, sky, haze and cameras for the road with its edits, replacing earlier ones."""
        light_road(context)


class SYNTHROADS_OT_add_night(bpy.types.Operator):
    """Light the road by night: the sun at -20° in Sun and Weather, headlights and street lights, and cameras. Pictures are made by Cycles, which alone shows what signs send back, with fewer samples and bounces where the scene has Blender's own numbers"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.add_night"
    bl_label = "Light by Night"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    resolution_percentage: bpy.props.IntProperty(
        name="Picture Size",
        description="Size of pictures in percent of Blender's Resolution. Half of it takes a quarter of the time",
        default=100,
        min=1,
        soft_max=100,
        max=1000,
        subtype="PERCENTAGE",
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin with the scene's own size of pictures."""
        if not self.properties.is_property_set("resolution_percentage"):
            self.resolution_percentage = context.scene.render.resolution_percentage
        return self.execute(context)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return has_road(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Set the sun below the horizon, add lights and cameras as `add_views` does, and choose Cycles."""
        environment, render = context.scene.synthroads.road.environment, context.scene.render
        environment.sun_place = "angles"
        environment.sun_elevation_deg_minimum = environment.sun_elevation_deg_maximum = NIGHT_SUN
        light_road(context)
        if context.scene.camera is None or VIEW not in context.scene.camera:  # that of Blender's new file sees no road
            context.scene.camera = dict(cameras_of(context.scene))[DRIVER]
        render.engine = "CYCLES"
        if self.properties.is_property_set("resolution_percentage"):
            render.resolution_percentage = self.resolution_percentage
        cycles = context.scene.cycles
        for name, value in _BLENDERS.items():
            if math.isclose(getattr(cycles, name), value, rel_tol=1e-5):  # the user's own number stays
                setattr(cycles, name, _NIGHTS[name])
        size = round(render.resolution_x * render.resolution_percentage / 100.0)
        self.report(
            {"INFO"}, said(f"F12 makes the driver's picture, {size} pixels wide, with {cycles.samples} samples")
        )


class SYNTHROADS_OT_look_through(bpy.types.Operator):
    """Look through this camera, and use it for renders"""

    bl_idname = "synthroads.look_through"
    bl_label = "Look Through Camera"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    camera: bpy.props.StringProperty(name="Camera", description="Name of the camera", options={"SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make `camera` the scene's camera and show its view."""
        camera = dict(cameras_of(context.scene)).get(self.camera)
        if camera is None:
            self.report({"ERROR"}, said("Add the cameras first"))
            return {"CANCELLED"}
        context.scene.camera = camera
        space = view_of(context)
        if space:
            space.region_3d.view_perspective = "CAMERA"
        return {"FINISHED"}


class SYNTHROADS_PT_views(Sidebar, bpy.types.Panel):
    """Panel of sun, sky, haze and cameras for the user's own pictures."""

    bl_label = "Light and Cameras"
    bl_parent_id = "SYNTHROADS_PT_environment"
    bl_order = 10
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the button that adds lights and cameras, and a button for each camera."""
        layout = column(self)
        if find_road(context.scene) is None:
            draw_text(layout, "Build a road first", "INFO")
        cameras = list(cameras_of(context.scene))
        text = said("Renew Sun, Sky") if cameras else said("Sun, Sky, Cameras")
        layout.operator(SYNTHROADS_OT_add_views.bl_idname, text=text, icon="LIGHT_SUN")
        layout.operator(SYNTHROADS_OT_add_night.bl_idname, icon="LIGHT_SPOT")
        row = buttons_row(layout, [name.title() for name, _ in cameras] or [""], align=True)
        for name, camera in cameras:
            pressed = context.scene.camera == camera
            icon = "OUTLINER_OB_CAMERA" if pressed else "CAMERA_DATA"
            row.operator(SYNTHROADS_OT_look_through.bl_idname, text=camera[VIEW].title(), icon=icon).camera = name
