"""The rules that the road breaks, as a list; a click on one looks at its place.

Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...base.errors import InputError
from ...blender.model.roads import ROAD, road_of_id
from ...blender.model.store import find_road
from ...blender.model.truth import read_road
from ...blender.things.model_builder import ROLE
from ...checking.checker import RULES, Violation, check
from ...jobs.tables.fixes import Fix
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.section import Carriageway, LineMarking
from ..alignment.tables import edit, fix_of_rule
from ..fields.room import draw_text, fits, is_narrow, text_lines
from ..fields.wording import title_case
from ..translations.blender import said
from ..work.common import Sidebar, has_road, redraw_sidebars, refusing
from ..work.view import Marker, look_at_place, redraw_views, view_of
from .road_choice import draw_road_name

_LIST_SHARE = 0.85
"""Share of a row that is within the list, beside its scroll bar."""
_BOX_SHARE, _TITLE_SHARE = 0.92, 0.36
"""Share of a row that is within a box, and that of a title in there."""
_SURENESS = {
    "confirmed": "stated in secondary sources",
    "derived": "computed from values in secondary sources",
    "unconfirmed": "common knowledge, no printed source found",
    "definition": "a parameter set that breaks it is faulty",
}


class CheckedRoad:
    """The road that was checked last, and whether the scene's road has changed since.

    Attributes:
        parameters: what was checked; None before.
        road: id of the road that was checked.
        marker: shows where a rule is broken.
        asked: whether the scene may have changed since it was last compared.
        stale: whether it had, when it was compared.
    """

    def __init__(self) -> None:
        self.marker = Marker()
        self.keep(None)

    def keep(self, parameters: RoadParameters | None, road: str = "") -> None:
        """Keep the parameters that were checked and their road's id, as up to date; None for no road."""
        self.parameters, self.road, self.asked, self.stale = parameters, road, False, False

    def forget(self) -> None:
        """Drop the checked road and hide the marker."""
        self.keep(None)
        self.marker.hide()

    def is_outdated(self, scene: bpy.types.Scene) -> bool:
        """Return whether the road differs from the checked one, compared only after possible changes."""
        if self.asked and self.parameters is not None:
            try:
                self.stale = edited_parameters(scene, self.road) != self.parameters
            except InputError:
                self.stale = True
            self.asked = False
        return self.stale


checked = CheckedRoad()


def edited_parameters(scene: bpy.types.Scene, road: str = "") -> RoadParameters | None:
    """Return a road's parameter set with edits read back from the scene; None without a road.

    Args:
        scene: that it is in.
        road: its id; the road that the panels show if empty.

    Raises:
        InputError: the set kept in the file is damaged, an edited value is out of its limits, or the road's surface
            was edited by hand.
    """
    root = road_of_id(scene, road) if road else find_road(scene)
    return read_road(root, scene).known() if root else None


def shown_id(scene: bpy.types.Scene) -> str:
    """Return the id of the road that the panels are about; empty without a road."""
    root = find_road(scene)
    return "" if root is None else str(root[ROAD])


def violation_offset(geometry: RoadGeometry, violation: Violation) -> float:
    """Return the offset of a broken rule's place, m: its object's, else the middle of its carriageway, else 0."""
    item = geometry.parameters.objects.get(violation.object)
    station = float(np.clip(violation.station, 0.0, geometry.length))
    if isinstance(item, LineMarking):
        left, right = geometry.marking_edges(item, station)
        return float(left[0] + right[0]) / 2.0
    offset = getattr(item, "offset", None)
    if isinstance(offset, float):
        return offset
    owner = geometry.parameters.objects.get(getattr(item, "carriageway", violation.object))
    if isinstance(owner, Carriageway):
        across = geometry.sections[owner.side].distances(station)[0] * owner.sign
        return float(across[0] + across[-1]) / 2.0
    return 0.0


def _look_at_entry(rules: "SYNTHROADS_PG_rules", context: bpy.types.Context) -> None:
    """Show the marker and turn the view to the place of the selected list entry."""
    if not 0 <= rules.index < len(rules.violations) or checked.parameters is None:
        return
    row = rules.violations[rules.index]
    geometry = RoadGeometry(checked.parameters)
    checked.marker.show(geometry, row.station, row.offset)
    space = view_of(context)
    if space:
        look_at_place(space, geometry, row.station, row.offset)
    redraw_views(context)


class SYNTHROADS_PG_violation(bpy.types.PropertyGroup):
    """A list entry for a broken rule: its `Violation` with an offset; `name` is the rule's title."""

    rule: bpy.props.StringProperty(name="Rule")
    object: bpy.props.StringProperty(name="Object")
    station: bpy.props.FloatProperty(name="Station")
    offset: bpy.props.FloatProperty(name="Offset")
    value: bpy.props.StringProperty(name="Value")
    limit: bpy.props.StringProperty(name="Limit")
    comparison: bpy.props.StringProperty(name="Value and Limit")
    text: bpy.props.StringProperty(name="Sentence")


class SYNTHROADS_PG_rules(bpy.types.PropertyGroup):
    """List of the rules that the last checked road breaks."""

    violations: bpy.props.CollectionProperty(type=SYNTHROADS_PG_violation, name="Broken Rules")
    index: bpy.props.IntProperty(
        name="Active Broken Rule", update=_look_at_entry, description="Click to look at the place"
    )


def check_shown_road(context: bpy.types.Context) -> int:
    """Fill the list with the rules that the shown road, with its edits, breaks; return their number.

    Raises:
        InputError: see `edited_parameters`.
    """
    parameters = edited_parameters(context.scene)
    assert parameters  # the operators' poll() has seen the road
    violations = check(parameters)
    _clear(context.window_manager)
    checked.keep(parameters, shown_id(context.scene))
    _fill(context.window_manager.synthroads_rules, parameters, violations)
    redraw_views(context)
    return len(violations)


class SYNTHROADS_OT_check_rules(bpy.types.Operator):
    """List every rule of the guidelines that the road, as it is edited now, breaks"""

    bl_idname = "synthroads.check_rules"
    bl_label = "Check Rules"
    bl_options = {"REGISTER"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road."""
        return has_road(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Check the road with its edits and fill the list of broken rules."""
        self.report({"INFO"}, said(_count(check_shown_road(context))))


def _has_entries(cls: Any, context: bpy.types.Context) -> bool:
    """Return whether the list of broken rules has entries; else tell an operator's button so."""
    broken = len(context.window_manager.synthroads_rules.violations)
    if not broken:
        cls.poll_message_set(said("Check the rules first; the list of broken rules is empty"))
    return broken > 0


class SYNTHROADS_OT_show_violation(bpy.types.Operator):
    """Look along the road at the place where this rule is broken"""

    bl_idname = "synthroads.show_violation"
    bl_label = "Look at the Place"
    bl_options = {"INTERNAL"}  # noqa: RUF012

    index: bpy.props.IntProperty(name="Line", min=0, description="Row of the list, from 0")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the list of broken rules has entries."""
        return _has_entries(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Select the list entry `index`, which turns the view to its place."""
        rules = context.window_manager.synthroads_rules
        if self.index >= len(rules.violations):
            raise InputError("index", self.index, f"must be 0 to {len(rules.violations) - 1}")
        rules.index = self.index


class SYNTHROADS_OT_mend_violation(bpy.types.Operator):
    """Change the road's axis, profile, crossfall or width as little as keeps this rule, and check the rules again"""

    bl_idname = "synthroads.mend_violation"
    bl_label = "Mend"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}  # noqa: RUF012

    index: bpy.props.IntProperty(name="Line", min=0, description="Row of the list, from 0", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the list of broken rules has entries."""
        return _has_entries(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Apply the fix of the list entry `index`, and fill the list anew."""
        count = len(context.window_manager.synthroads_rules.violations)
        if self.index >= count:
            raise InputError("index", self.index, f"must be 0 to {count - 1}")
        fix = _fix_of_entry(context.scene, self.index)
        if fix is None:
            raise InputError("Line", self.index, "no single change keeps this rule: edit what stands in the sentence")
        edit(context.scene, fix.change)
        check_shown_road(context)
        self.report({"INFO"}, said(fix.text))


class SYNTHROADS_OT_clear_rules(bpy.types.Operator):
    """Empty the list, and remove the marker from the 3D view"""

    bl_idname = "synthroads.clear_rules"
    bl_label = "Clear List"
    bl_options = {"INTERNAL"}  # noqa: RUF012

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Clear the list of broken rules and hide the marker."""
        _clear(context.window_manager)
        redraw_views(context)
        return {"FINISHED"}


class SYNTHROADS_UL_violations(bpy.types.UIList):
    """List of broken rules: rule, object with its station, value with its limit, below each other."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: SYNTHROADS_PG_rules,
        item: SYNTHROADS_PG_violation,
        icon: int,
        active_data: SYNTHROADS_PG_rules,
        active_property: str,
    ) -> None:
        """Draw one row of the list."""
        lines = layout.column(align=True)
        for line in row_lines(item):
            lines.label(text=line)

    def filter_items(
        self, context: bpy.types.Context, data: SYNTHROADS_PG_rules, field: str
    ) -> tuple[list[int], list[int]]:
        """Return filter flags by title, and the order of rows by station, or by title if asked for."""
        rows = getattr(data, field)
        helper = bpy.types.UI_UL_list
        shown = helper.filter_items_by_name(self.filter_name, self.bitflag_filter_item, rows, "name")
        if self.use_filter_sort_alpha:
            return shown, helper.sort_items_by_name(rows, "name")
        return shown, helper.sort_items_helper([(i, row.station) for i, row in enumerate(rows)], lambda pair: pair[1])


class SYNTHROADS_PT_rules(Sidebar, bpy.types.Panel):
    """Panel of the guidelines' rules that the road breaks."""

    bl_label = "Rules"
    bl_parent_id = "SYNTHROADS_PT_road"
    bl_order = 10
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, the list, and details of the selected entry."""
        layout, rules = self.layout, context.window_manager.synthroads_rules
        draw_road_name(layout, context)
        row = layout.row(align=True)
        row.operator(SYNTHROADS_OT_check_rules.bl_idname, icon="CHECKMARK")
        if checked.parameters is None:
            return
        row.operator(SYNTHROADS_OT_clear_rules.bl_idname, text="", icon="X")
        if checked.is_outdated(context.scene):
            draw_text(layout, "The road has changed since", "INFO")
        count = len(rules.violations)
        draw_text(layout, _count(count), "ERROR" if count else "CHECKMARK")
        if not count:
            return
        layout.template_list("SYNTHROADS_UL_violations", "", rules, "violations", rules, "index", rows=4)
        if 0 <= rules.index < count:
            _draw_details(layout, context.scene, rules)


def row_lines(item: SYNTHROADS_PG_violation) -> list[str]:
    """Return the lines of a row of the list: rule; object and station; value and limit, wrapped to its width.

    Object and value are in one line where all of it fits.
    """
    place, comparison = said(f"{title_case(item.object)}, station {item.station:,.0f} m"), said(item.comparison)
    together = f"{place}: {comparison}"
    texts = [said(item.name), *([together] if fits(together, _LIST_SHARE) else [place, comparison])]
    return [line for text in texts for line in text_lines(text, _LIST_SHARE)]


def _draw_details(layout: bpy.types.UILayout, scene: bpy.types.Scene, rules: SYNTHROADS_PG_rules) -> None:
    """Draw the selected broken rule in full: its sentence, its numbers by name, its source, and what mends it."""
    item = rules.violations[rules.index]
    rule = RULES[item.rule]
    box = layout.box().column(align=True)
    draw_text(box, item.text, share=_BOX_SHARE)
    box.separator()
    for title, value in (
        (said("Found"), item.value),
        (said("Limit"), item.limit),
        (said("Station"), f"{item.station:,.2f} m"),
        (said("Object"), title_case(item.object)),
        (said("Rule"), RULES[item.rule].title),
    ):
        if is_narrow():
            draw_text(box, f"{title}: {said(value)}", share=_BOX_SHARE)
            continue
        split = box.split(factor=_TITLE_SHARE)
        split.label(text=title)
        draw_text(split, value, share=_BOX_SHARE * (1.0 - _TITLE_SHARE))
    source = f"{rule.source}: " if rule.source else ""
    draw_text(box, source + said(_SURENESS[rule.sure]), share=_BOX_SHARE)
    box.operator(SYNTHROADS_OT_show_violation.bl_idname, icon="VIEWZOOM").index = rules.index
    _draw_fix(box, scene, rules.index)


def _draw_fix(box: bpy.types.UILayout, scene: bpy.types.Scene, index: int) -> None:
    """Draw what mends a broken rule, as a button; nothing if nothing simple does, or another road is shown."""
    fix = _fix_of_entry(scene, index)
    if fix is None:
        return
    button = fix.text
    if not fits(said(button), _BOX_SHARE, 1):
        box.separator()
        draw_text(box, button, share=_BOX_SHARE)
        button = "Mend"
    box.operator(SYNTHROADS_OT_mend_violation.bl_idname, text=button, icon="MODIFIER").index = index


def _fix_of_entry(scene: bpy.types.Scene, index: int) -> Fix | None:
    """Return what mends the broken rule of a list entry; None if nothing simple does, or the road isn't as checked."""
    if checked.road != shown_id(scene) or checked.is_outdated(scene):
        return None
    item = bpy.context.window_manager.synthroads_rules.violations[index]
    return fix_of_rule(scene, item.rule, item.object, item.station)


def _fill(rules: SYNTHROADS_PG_rules, parameters: RoadParameters, violations: list[Violation]) -> None:
    geometry = RoadGeometry(parameters)
    for violation in violations:
        row = rules.violations.add()
        row.name = RULES[violation.rule].title
        row.rule, row.object, row.text = violation.rule, violation.object, violation.text
        row.station, row.offset = violation.station, violation_offset(geometry, violation)
        row.value, row.limit = (_write_number(number, violation.unit) for number in (violation.value, violation.limit))
        row.comparison = _compare(violation)
    rules["index"] = -1  # past its update: nothing was clicked yet


def _clear(manager: bpy.types.WindowManager) -> None:
    checked.forget()
    manager.synthroads_rules.violations.clear()


def _count(number: int) -> str:
    if not number:
        return "No rule is broken"
    return "1 rule is broken" if number == 1 else f"Rules are broken at {number} places"


def _write_number(value: float, unit: str) -> str:
    return f"{value:,.6g}" + (f" {unit}" if unit != "1" else "")


def _compare(violation: Violation) -> str:
    """Return the value that was found and its limit, short, with the unit: ``2.6 m (limit 3.5 m)``."""
    unit = "" if violation.unit == "1" else f" {violation.unit}"
    return f"{_digits(violation.value)}{unit} (limit {_digits(violation.limit)}{unit})"


def _digits(value: float) -> str:
    """Return a number as short text, with fewer decimals the larger it is."""
    size = abs(value)
    if size >= 1e6:
        return f"{value:.3g}"
    text = f"{value:,.{1 if size >= 100 else 2 if size >= 0.1 or not size else 4}f}"
    return text.rstrip("0").rstrip(".")


@persistent
def _note_changes(scene: bpy.types.Scene, graph: bpy.types.Depsgraph | None = None) -> None:
    """Handler: note that the road may have changed, by an edit, rebuild or undo, to be compared when drawn."""
    updates = graph.updates if graph else []
    changes = [update.id for update in updates if update.is_updated_geometry or update.is_updated_transform]
    if graph is None or any(isinstance(item, bpy.types.Object) and (ROLE in item or ROAD in item) for item in changes):
        checked.asked = True
        if checked.parameters is not None:
            redraw_sidebars(bpy.context)


@persistent
def _other_file(path: str) -> None:
    """Handler: clear the list of broken rules when another file is loaded."""
    _clear(bpy.data.window_managers[0])


HANDLERS = dict.fromkeys(("depsgraph_update_post", "undo_post", "redo_post"), _note_changes)
HANDLERS["load_post"] = _other_file

ATTACHED = (bpy.types.WindowManager, "synthroads_rules", SYNTHROADS_PG_rules)
"""The list is attached to the window manager, which is never undone."""
unregister = checked.forget
