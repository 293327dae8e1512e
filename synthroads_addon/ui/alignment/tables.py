"""Contents of the tables: the current road's elements, points and widths, the rules that rows break, and edits of them.

It is read anew when something of the road has changed, at the next look.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Literal

import bpy

from ...base.errors import InputError
from ...blender.model.roads import ROAD
from ...blender.model.stated import restate, shown_base, stated_road
from ...blender.model.store import find_road
from ...blender.things.model_builder import ROLE
from ...checking.marks import RowMarks, row_marks
from ...checking.rules.rule import Violation
from ...jobs.tables.fixes import Fix, crossfall_fix, element_fix, vertical_fix, width_fix
from ...road.parameters import RoadParameters
from ...road.section import Carriageway
from ...road.tables.elements import ElementRow, element_rows
from ...road.tables.points import strip_names, width_rows
from ...road.tables.stated import StatedRoad
from ..work.common import panel_message, redraw_sidebars

Table = Literal["elements", "vertical", "crossfall", "widths"]
_NEAR = 0.1
"""Difference of stations, m, below which a rule is broken at the same place; chosen: Blender holds them in 32 bits."""
TABLES: tuple[Table, ...] = ("elements", "vertical", "crossfall", "widths")


class RoadTables:
    """Tables of the current road, as they were read last.

    Attributes:
        road: what they state; None without a road.
        parameters: the road's parameter set with that, enough to check and draw it; None without a road.
        marks: broken rules by row.
        elements: rows of the elements.
        problem: why there are no tables, in words; empty if there are.
        refused: message of the last edit that was refused.
        stale: whether the road may have changed since.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Drop all; the road is read at the next look."""
        self.road: StatedRoad | None = None
        self.parameters: RoadParameters | None = None
        self.marks = RowMarks()
        self.elements: list[ElementRow] = []
        self.problem = self.refused = ""
        self.stale = True
        self._root = ""

    def read(self, scene: bpy.types.Scene) -> StatedRoad | None:
        """Return what the current road's tables state, read anew after possible changes; None without a road."""
        root = find_road(scene)
        name = "" if root is None else str(root[ROAD])
        if name != self._root:
            self.forget()
            self._root = name
        if self.stale:
            self._read(root, scene)
            self.stale = False
        return self.road

    def _read(self, root: bpy.types.Object | None, scene: bpy.types.Scene) -> None:
        self.road, self.parameters, self.problem = None, None, ""
        self.marks, self.elements = RowMarks(), []
        if root is None:
            return
        try:
            road = stated_road(root, scene)
            self.parameters = with_tables(shown_base(root)[0], road)
            self.marks = row_marks(self.parameters)
        except InputError as error:
            self.problem = panel_message(error)
            return
        self.road, self.elements = road, element_rows(road.alignment.horizontal)


tables = RoadTables()


def with_tables(parameters: RoadParameters, road: StatedRoad) -> RoadParameters:
    """Return a parameter set with the axis and carriageways of a stated road, all else as it is, not validated."""
    name = next(name for name, item in parameters.objects.items() if item is parameters.alignment)
    return parameters.model_copy(update={"objects": parameters.objects | road.carriageways | {name: road.alignment}})


def carriageway_of(scene: bpy.types.Scene) -> tuple[str, Carriageway] | None:
    """Return id and carriageway of the side whose crossfall and widths are shown; the only one if there is one."""
    road = tables.read(scene)
    if road is None:
        return None
    items = list(road.carriageways.items())
    chosen = scene.synthroads_alignment.side
    return next((pair for pair in items if pair[1].side == chosen), items[0])


def strip_of(scene: bpy.types.Scene, carriageway: Carriageway) -> str:
    """Return the name of the strip whose widths are shown."""
    names = strip_names(carriageway)
    return names[min(scene.synthroads_alignment.strip_number, len(names) - 1)]


def row_count(scene: bpy.types.Scene, table: Table) -> int:
    """Return the number of rows that a table has now; 0 without a road."""
    road, pair = tables.read(scene), carriageway_of(scene)
    if road is None or pair is None:
        return 0
    if table == "widths":
        return len(width_rows(pair[1], strip_of(scene, pair[1])))
    rows = {"elements": road.alignment.horizontal, "vertical": road.alignment.vertical, "crossfall": pair[1].crossfall}
    return len(rows[table])


def marks_of(scene: bpy.types.Scene, table: Table, number: int) -> list[Violation]:
    """Return the broken rules of a row of a table, by its number from 0."""
    pair = carriageway_of(scene)
    if pair is None:
        return []
    if table == "elements":
        return tables.marks.elements.get(number, [])
    if table == "vertical":
        return tables.marks.vertical.get(number, [])
    if table == "crossfall":
        return tables.marks.crossfall.get((pair[0], number), [])
    return tables.marks.widths.get((pair[0], strip_of(scene, pair[1]), number), [])


def fix_of(scene: bpy.types.Scene, table: Table, number: int, violation: Violation) -> Fix | None:
    """Return what mends a broken rule of a row; None if there is nothing so simple."""
    road, pair, parameters = tables.read(scene), carriageway_of(scene), tables.parameters
    if road is None or pair is None or parameters is None:
        return None
    if table == "elements":
        return element_fix(road, parameters.design_class, number, violation)
    if table == "vertical":
        return vertical_fix(road, parameters.design_class, number, violation)
    if table == "crossfall":
        return crossfall_fix(road, parameters.design_class, pair[0], violation)
    return width_fix(pair[0], strip_of(scene, pair[1]), number, violation)


def fix_of_rule(scene: bpy.types.Scene, rule: str, name: str, station: float) -> Fix | None:
    """Return what mends a broken rule of the current road's tables; None if there is nothing so simple.

    Args:
        scene: with the road.
        rule: its id.
        name: id of the object that breaks it.
        station: where, m, within `_NEAR`.
    """
    road, parameters = tables.read(scene), tables.parameters
    if road is None or parameters is None:
        return None
    design_class, marks = parameters.design_class, tables.marks

    def fixes() -> Iterator[tuple[Violation, Callable[[], Fix | None]]]:
        for number, row in marks.elements.items():
            yield from ((one, partial(element_fix, road, design_class, number, one)) for one in row)
        for number, row in marks.vertical.items():
            yield from ((one, partial(vertical_fix, road, design_class, number, one)) for one in row)
        for (owner, _), row in marks.crossfall.items():
            yield from ((one, partial(crossfall_fix, road, design_class, owner, one)) for one in row)
        for (owner, strip, number), row in marks.widths.items():
            yield from ((one, partial(width_fix, owner, strip, number, one)) for one in row)

    for violation, fix in fixes():
        is_same = (violation.rule, violation.object) == (rule, name)
        if is_same and abs(violation.station - station) < _NEAR:
            return fix()
    return None


def edit(scene: bpy.types.Scene, change: Callable[[StatedRoad], StatedRoad]) -> None:
    """Edit the current road's tables; the scene and the rows follow.

    Raises:
        InputError: the edit isn't allowed, or there is no road; nothing has changed.
    """
    root = find_road(scene)
    if root is None:
        raise InputError("Alignment", None, "there is no road: build one first")
    restate(root, scene, change)
    tables.refused, tables.stale = "", True
    sync(scene)


def try_edit(scene: bpy.types.Scene, change: Callable[[StatedRoad], StatedRoad]) -> None:
    """Edit the current road's tables as a field does: what isn't allowed stays as it was, with a message."""
    try:
        edit(scene, change)
    except InputError as error:
        tables.refused = panel_message(error)


def sync(scene: bpy.types.Scene) -> None:
    """Give the lists as many rows as the tables have, and keep the active row within them."""
    group: Any = getattr(scene, "synthroads_alignment", None)
    if group is None:
        return
    for table in TABLES:
        rows, count = getattr(group, table), row_count(scene, table)
        while len(rows) > count:
            rows.remove(len(rows) - 1)
        while len(rows) < count:
            number = len(rows)
            rows.add().number = number
        active = f"active_{table}"
        if count and getattr(group, active) >= count:
            setattr(group, active, count - 1)


def sync_later(scene: bpy.types.Scene) -> None:
    """Give the lists their rows a moment later where they have others: a panel that is being drawn can't."""
    group: Any = scene.synthroads_alignment
    is_short = any(len(getattr(group, table)) != row_count(scene, table) for table in TABLES)
    if is_short and not bpy.app.background and not bpy.app.timers.is_registered(_sync_now):
        bpy.app.timers.register(_sync_now, first_interval=0.0)


def _sync_now() -> None:
    """Timer that gives the lists their rows and redraws the panels."""
    sync(bpy.context.scene)
    redraw_sidebars(bpy.context)


def unregister() -> None:
    """Forget the tables, and cancel the timer."""
    tables.forget()
    if bpy.app.timers.is_registered(_sync_now):
        bpy.app.timers.unregister(_sync_now)


def note_changes(graph: bpy.types.Depsgraph | None = None) -> None:
    """Mark the tables as stale after a change of a road's objects: they are read again when they are next drawn."""
    changes = [update.id for update in graph.updates] if graph else []
    tables.stale |= graph is None or any(
        isinstance(item, bpy.types.Object) and (ROLE in item or ROAD in item) for item in changes
    )
