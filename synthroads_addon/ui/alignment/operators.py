"""Operators that insert, delete and split rows of a road's tables, and mend the rules that they break.

Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import Any

import bpy

from ...base.errors import InputError
from ...jobs.tables.fixes import with_crossfall_by_rule
from ...road.tables.elements import with_inserted, with_split, without
from ...road.tables.points import (
    with_crossfall_point_inserted,
    with_vertical_point_inserted,
    with_width_inserted,
    without_crossfall_point,
    without_vertical_point,
    without_width,
)
from ...road.tables.stated import StatedRoad
from ..fields.numbers import LENGTH_DIGITS, exact
from ..translations.blender import said
from ..work.common import has_road, is_free, redraw_sidebars, refusing
from .rows import KIND_ITEMS
from .tables import carriageway_of, edit, fix_of, marks_of, row_count, strip_of, sync, tables

_ACTIVE = -1
"""Number that stands for the active row."""
_POINTS = [
    ("vertical", "Vertical Point", "Where two grades meet"),
    ("crossfall", "Crossfall Point", "Crossfall of the shown carriageway at a station"),
    ("widths", "Width", "Width of the shown strip at a station"),
]


def _number_property(words: str) -> Any:
    return bpy.props.IntProperty(
        name="Row",
        description=f"Row of the table, from 0, {words}; -1 for the active one",
        default=_ACTIVE,
        min=_ACTIVE,
        options={"SKIP_SAVE", "HIDDEN"},
    )


class TableOperator:
    """Base of operators on the tables of the current road."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no other work is running."""
        operator: Any = cls
        return is_free(operator, context) and has_road(operator, context)


def _row(scene: bpy.types.Scene, table: Any, number: int) -> int:
    """Return the number of a row of a table, of the active one for -1; `InputError` if there is no such row."""
    sync(scene)
    count = row_count(scene, table)
    chosen = getattr(scene.synthroads_alignment, f"active_{table}") if number == _ACTIVE else number
    if not 0 <= chosen < count:
        problem = tables.problem or f"must be 0 to {count - 1}, or -1 for the active row"
        raise InputError("Row", chosen, problem)
    return int(chosen)


def _activate(scene: bpy.types.Scene, table: str, number: int) -> None:
    """Make a row the active one."""
    setattr(scene.synthroads_alignment, f"active_{table}", max(number, 0))
    redraw_sidebars(bpy.context)


def _design_class() -> str:
    assert tables.parameters
    return tables.parameters.design_class


class SYNTHROADS_OT_insert_element(TableOperator, bpy.types.Operator):
    """Insert an element behind the active one; what follows moves along. Straights and arcs last two seconds of travel, a clothoid joins its neighbours with the smallest A (RAA)"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.insert_element"
    bl_label = "Insert Element"

    kind: bpy.props.EnumProperty(name="Kind", description="What is inserted", items=KIND_ITEMS)
    number: _number_property("that the new one follows")

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Insert the element and make it the active one."""
        number = _row(context.scene, "elements", self.number) + 1

        def change(road: StatedRoad) -> StatedRoad:
            return road.with_elements(with_inserted(road.alignment.horizontal, number, self.kind, _design_class()))

        edit(context.scene, change)
        _activate(context.scene, "elements", number)


class SYNTHROADS_OT_delete_element(TableOperator, bpy.types.Operator):
    """Delete the active element of the alignment, with what stands on it. What follows moves up"""

    bl_idname = "synthroads.delete_element"
    bl_label = "Delete Element"

    number: _number_property("that is deleted")

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Delete the element; the one before it becomes the active one."""
        number = _row(context.scene, "elements", self.number)
        edit(context.scene, lambda road: road.with_elements(without(road.alignment.horizontal, number)))
        _activate(context.scene, "elements", number - 1)


class SYNTHROADS_OT_split_element(TableOperator, bpy.types.Operator):
    """Divide the active element into two of the same curvature; the road stays the same"""

    bl_idname = "synthroads.split_element"
    bl_label = "Split Element"

    number: _number_property("that is divided")
    distance: bpy.props.FloatProperty(
        name="Distance",
        description="Distance in m from the element's beginning at which it is divided, within its length, e.g. 40; "
        "0 divides it in the middle",
        min=0.0,
        step=100,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Divide the element."""
        number = _row(context.scene, "elements", self.number)

        def change(road: StatedRoad) -> StatedRoad:
            elements = road.alignment.horizontal
            distance = float(exact(self.distance, None)) or elements[number].length / 2.0
            return road.with_elements(with_split(elements, number, distance))

        edit(context.scene, change)
        redraw_sidebars(context)


class SYNTHROADS_OT_insert_point(TableOperator, bpy.types.Operator):
    """Insert a row behind the active one, halfway to the next: the road stays the same until the row is changed"""

    bl_idname = "synthroads.insert_point"
    bl_label = "Insert Point"

    table: bpy.props.EnumProperty(name="Table", description="Table that gets a row", items=_POINTS)
    number: _number_property("that the new one follows")

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Insert the row and make it the active one."""
        scene = context.scene
        number = _row(scene, self.table, self.number) + 1
        edit(scene, lambda road: _with_row(scene, road, self.table, number))
        _activate(scene, self.table, number)


class SYNTHROADS_OT_delete_point(TableOperator, bpy.types.Operator):
    """Delete the active row; between its neighbours the road is then as they have it. The last row stays"""

    bl_idname = "synthroads.delete_point"
    bl_label = "Delete Point"

    table: bpy.props.EnumProperty(name="Table", description="Table that loses a row", items=_POINTS)
    number: _number_property("that is deleted")

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Delete the row; the one before it becomes the active one."""
        scene = context.scene
        number = _row(scene, self.table, self.number)
        edit(scene, lambda road: _without_row(scene, road, self.table, number))
        _activate(scene, self.table, number - 1)


def _with_row(scene: bpy.types.Scene, road: StatedRoad, table: str, number: int) -> StatedRoad:
    """Return a road with one more row of a table of points, as that of a number."""
    if table == "vertical":
        return road.with_alignment(with_vertical_point_inserted(road.alignment, number))
    pair = carriageway_of(scene)
    assert pair
    name, carriageway = pair[0], road.carriageways[pair[0]]
    if table == "crossfall":
        return road.with_carriageway(name, with_crossfall_point_inserted(carriageway, number))
    return road.with_carriageway(name, with_width_inserted(carriageway, strip_of(scene, carriageway), number))


def _without_row(scene: bpy.types.Scene, road: StatedRoad, table: str, number: int) -> StatedRoad:
    """Return a road without a row of a table of points."""
    if table == "vertical":
        return road.with_alignment(without_vertical_point(road.alignment, number))
    pair = carriageway_of(scene)
    assert pair
    name, carriageway = pair[0], road.carriageways[pair[0]]
    if table == "crossfall":
        return road.with_carriageway(name, without_crossfall_point(carriageway, number))
    return road.with_carriageway(name, without_width(carriageway, strip_of(scene, carriageway), number))


class SYNTHROADS_OT_crossfall_by_rule(TableOperator, bpy.types.Operator):
    """State the crossfall of both carriageways as the RAA have it for the elements: 2.5 to 6 %, run-offs along clothoids"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.crossfall_by_rule"
    bl_label = "Crossfall by Rule"

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Replace the crossfall points of all carriageways."""

        def change(road: StatedRoad) -> StatedRoad:
            for name in road.carriageways:
                road = with_crossfall_by_rule(road, _design_class(), name)
            return road

        row_count(context.scene, "crossfall")  # reads the road
        edit(context.scene, change)
        redraw_sidebars(context)


class SYNTHROADS_OT_mend_rule(TableOperator, bpy.types.Operator):
    """Change this row as little as keeps the rule"""

    bl_idname = "synthroads.mend_rule"
    bl_label = "Mend Broken Rule"

    table: bpy.props.EnumProperty(
        name="Table",
        description="Table with the row",
        items=[("elements", "Elements", "Straights, clothoids, arcs"), *_POINTS],
    )
    number: _number_property("that breaks the rule")
    index: bpy.props.IntProperty(
        name="Rule", description="Which of the row's broken rules, from 0", min=0, options={"SKIP_SAVE", "HIDDEN"}
    )

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Apply the fix of the row's broken rule."""
        scene = context.scene
        number = _row(scene, self.table, self.number)
        broken = marks_of(scene, self.table, number)
        if self.index >= len(broken):
            raise InputError("Row", number, "breaks no rule: nothing needs to be mended")
        fix = fix_of(scene, self.table, number, broken[self.index])
        if fix is None:
            raise InputError("Row", number, "no single change keeps this rule: change the row, or those beside it")
        edit(scene, fix.change)
        self.report({"INFO"}, said(fix.text))
        redraw_sidebars(context)
