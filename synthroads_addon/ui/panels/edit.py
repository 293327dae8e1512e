"""The sub-panel Edit: inputs of the built model's modifiers. The mesh follows at once, nothing is built again.

Only those are shown that are carried back into the parameter set: what is saved or scanned agrees with what is seen.
Annotations are not postponed here: Blender reads the properties from them.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...base.errors import InputError
from ...blender.compat import shown_input
from ...blender.model.added import with_kept_things
from ...blender.model.older_files import PARAMETERS, adopt_older_roads, rename_inputs
from ...blender.model.read_back import carried_inputs
from ...blender.model.roads import renew_ids
from ...blender.model.store import find_road, objects_of, recall_parameters, roads
from ...blender.things.model_builder import ROLE, SUPPORT
from ...blender.things.road.road import MARKINGS
from ...road.parameters import RoadParameters
from ...road.surroundings import Vegetation
from ...road.things.thing import Thing
from ..fields.room import buttons_row, value_row
from ..fields.wording import title_case
from ..translations.blender import said
from ..work.common import Sidebar, column
from .placing import SYNTHROADS_OT_delete_thing, SYNTHROADS_OT_repeat_thing
from .things import draw_thing, thing_of

_NOTHING = "NOTHING"
Section = tuple[str, list[tuple[str, str]]]
"""A part's inputs under one heading: their names as shown, and identifiers."""


def editable_parts(scene: bpy.types.Scene) -> dict[str, bpy.types.Object]:
    """Return the objects of the scene's road that have editable inputs, by role; empty without a road."""
    road, parameters = find_road(scene), open_parameters(scene)
    if road is None or parameters is None:
        return {}
    parts = objects_of(road)
    known = with_kept_things(parameters, parts)
    return {role: item for role, item in parts.items() if _editable(known, item)}


def _editable(parameters: RoadParameters, item: bpy.types.Object) -> bool:
    modifier, role = _modifier(item), str(item[ROLE])
    if SUPPORT in item:
        return False
    if isinstance(parameters.objects.get(role), Thing):
        return True
    return modifier is not None and bool(carried_inputs(parameters, role, modifier))


def open_parameters(scene: bpy.types.Scene) -> RoadParameters | None:
    """Return the parameters that the scene's road was built from; None without a road or if they are damaged."""
    road = find_road(scene)
    return _parameters(str(road[PARAMETERS])) if road else None


@lru_cache(maxsize=2)
def _parameters(text: str) -> RoadParameters | None:
    try:
        return recall_parameters({PARAMETERS: text})  # it reads this key only
    except InputError:
        return None


def input_sections(parameters: RoadParameters, item: bpy.types.Object, within: str = "") -> Iterator[Section]:
    """Yield (heading, inputs) of a part's editable inputs, of all headings or of those below the heading `within`."""
    modifier = _modifier(item)
    if modifier is None:
        return
    carried = carried_inputs(parameters, str(item[ROLE]), modifier)
    by_heading: dict[str, list[tuple[str, str]]] = {}
    for socket in modifier.node_group.interface.items_tree:
        if socket.item_type == "SOCKET" and socket.in_out == "INPUT" and socket.name in carried:
            heading = socket.parent.name
            if not within or (heading and socket.parent.parent.name == within):
                by_heading.setdefault(heading, []).append((_without_heading(socket.name, heading), socket.identifier))
    yield from by_heading.items()


def _without_heading(name: str, heading: str) -> str:
    """Return an input's name without a prefix that repeats its heading, or the heading's first word."""
    for known in (heading, heading.partition(" ")[0]):
        if known and name.startswith(f"{known} "):
            return name.removeprefix(f"{known} ")
    return name


def _modifier(item: bpy.types.Object) -> bpy.types.NodesModifier | None:
    return next((m for m in item.modifiers if m.type == "NODES" and m.node_group), None)


def part_name(role: str) -> str:
    """Return a part's role as a title: ``guardrail-left-1`` becomes Guardrail Left 1."""
    return title_case(role.replace("/", " / ").replace("-", " "))


_items: list[tuple[str, str, str, str, int]] = []
"""Texts that Blender shows at present: it doesn't keep them itself."""


def _part_items(state: Any, context: Any) -> list[tuple[str, str, str, str, int]]:
    by_role = editable_parts(context.scene)
    _items[:] = [
        (
            _NOTHING,
            said("Choose a Part"),
            said("Choose a part here, or click it in the view"),
            "RESTRICT_SELECT_OFF",
            0,
        ),
        *((role, part_name(role), "", "NONE", i) for i, role in enumerate(by_role, 1)),
    ]
    return _items


def _shown_part(state: Any) -> int:
    context = bpy.context
    active = context.view_layer.objects.active
    roles = list(editable_parts(context.scene))
    role = active.get(ROLE) if active else None
    return roles.index(role) + 1 if role in roles else 0


def _choose_part(state: Any, number: int) -> None:
    context = bpy.context
    items = list(editable_parts(context.scene).values())
    for other in context.view_layer.objects.selected:
        other.select_set(False)
    chosen = items[number - 1] if number else None
    context.view_layer.objects.active = chosen
    if chosen and chosen.visible_get():
        chosen.select_set(True)


class SYNTHROADS_PG_edit(bpy.types.PropertyGroup):
    """Choice of the part to edit, kept as Blender's active object."""

    part: bpy.props.EnumProperty(
        name="Part",
        items=_part_items,
        get=_shown_part,
        set=_choose_part,
        description="Part of the road to edit; it becomes the active object",
    )


class SYNTHROADS_OT_show_plants(bpy.types.Operator):
    """Leave the plants out of the view and of scans, or show them again. Without plants, edits show faster"""

    bl_idname = "synthroads.show_plants"
    bl_label = "Hide Plants"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Hide all plants of the road, in view and evaluation, or show them if all are hidden."""
        plants = plants_of(context.scene)
        hide = any(not item.hide_viewport for item in plants)
        for item in plants:
            item.hide_viewport = item.hide_render = hide  # what is only hidden by `hide_set` is still evaluated
        return {"FINISHED"}


def plants_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the vegetation objects of the scene's road; empty without a road."""
    road, parameters = find_road(scene), open_parameters(scene)
    if road is None or parameters is None:
        return []
    ids = parameters.of_type(Vegetation)
    return [item for role, item in objects_of(road).items() if role in ids]


class SYNTHROADS_PT_edit(Sidebar, bpy.types.Panel):
    """Panel to edit inputs of the built model's modifiers."""

    bl_label = "Edit"
    bl_parent_id = "SYNTHROADS_PT_road"
    bl_order = 20
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return find_road(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the choice of a part, the plants' button, and the inputs of the active part."""
        layout = column(self)
        row = layout.row(align=True)
        row.use_property_split = False
        row.prop(context.scene.synthroads_edit, "part", text="")
        row.operator("view3d.view_selected", text="", icon="VIEWZOOM")
        plants = plants_of(context.scene)
        if plants:
            hidden = all(item.hide_viewport for item in plants)
            text, icon = ("Show Plants", "RESTRICT_VIEW_ON") if hidden else ("Hide Plants", "RESTRICT_VIEW_OFF")
            layout.operator(SYNTHROADS_OT_show_plants.bl_idname, text=text, icon=icon)
        parameters, item = open_parameters(context.scene), context.view_layer.objects.active
        if parameters is None or item is None or ROLE not in item:
            return
        if (thing := thing_of(item, context.scene)) is None:
            _draw_part(layout, parameters, item)
            return
        row = buttons_row(layout, ("Repeat Along Road", "Delete"), align=True)
        row.operator(SYNTHROADS_OT_repeat_thing.bl_idname, icon="MOD_ARRAY")
        row.operator(SYNTHROADS_OT_delete_thing.bl_idname, text="Delete", icon="TRASH")
        draw_thing(layout, context.scene, item, thing)


def _draw_part(layout: bpy.types.UILayout, parameters: RoadParameters, item: bpy.types.Object) -> None:
    """Draw a part's inputs in a collapsible section per heading, those of markings in a common one."""
    lines = list(input_sections(parameters, item, MARKINGS))
    for heading, inputs in input_sections(parameters, item):
        if not heading:
            _draw_inputs(layout, item, inputs)
        elif (heading, inputs) not in lines:
            _draw_section(layout, item, heading, inputs)
    if lines:
        header, body = layout.panel("synthroads_edit_markings", default_closed=True)
        header.label(text=MARKINGS)
        for heading, inputs in lines if body else ():
            _draw_section(body, item, heading, inputs)


def _draw_section(
    layout: bpy.types.UILayout, item: bpy.types.Object, heading: str, inputs: list[tuple[str, str]]
) -> None:
    header, body = layout.panel(f"synthroads_edit_{heading}", default_closed=True)
    header.label(text=heading)
    if body:
        _draw_inputs(body, item, inputs)


def _draw_inputs(layout: bpy.types.UILayout, item: bpy.types.Object, inputs: list[tuple[str, str]]) -> None:
    modifier = _modifier(item)
    assert modifier
    for name, identifier in inputs:
        data, prop = shown_input(modifier, identifier)
        value_row(layout, name).prop(data, prop, text="")


@persistent
def _update_older_roads(*_: Any) -> None:
    """Handler: update roads of an opened or appended file to today's roots, ids and input names."""
    adopt_older_roads()
    renew_ids()
    for scene in bpy.data.scenes:
        for road in roads(scene):
            if parameters := _parameters(str(road[PARAMETERS])):
                rename_inputs(parameters, objects_of(road, scene))


HANDLERS = dict.fromkeys(("load_post", "blend_import_post"), _update_older_roads)
ATTACHED = (bpy.types.Scene, "synthroads_edit", SYNTHROADS_PG_edit)
