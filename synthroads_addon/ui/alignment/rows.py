"""Rows of the tables as Blender's properties: they show the road as it is now, and change it at once.

Annotations are not postponed here: Blender reads the properties from them.
"""

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...road.other_roads.axis import LONGEST_ROAD
from ...road.tables.elements import (
    KIND_NAMES,
    LARGEST_RADIUS,
    with_end_radius,
    with_kind,
    with_length,
    with_parameter,
    with_radius,
)
from ...road.tables.points import strip_names, width_rows, with_crossfall_point, with_vertical_point, with_width
from ...road.tables.stated import StatedRoad
from ..fields.numbers import LENGTH_DIGITS, exact
from ..fields.wording import title_case
from .profile_view import redraw_profiles
from .tables import carriageway_of, note_changes, strip_of, sync, tables, try_edit, unregister

__all__ = ["unregister"]

KINDS = ("line", "clothoid", "arc")
_ABOUT_KIND = {
    "line": "No curvature; at most 2,000 m long (RAA)",
    "clothoid": "Curvature that changes with the length; it takes the radii beside it. R/3 <= A <= R (RAA)",
    "arc": "One radius; it lasts two seconds of travel at least (RAA)",
}
KIND_ITEMS = [(kind, KIND_NAMES[kind], _ABOUT_KIND[kind]) for kind in KINDS]


def _value(value: float, before: float) -> float | None:
    """Return a typed number as its shortest decimal; None if it is the one before, as Blender holds it."""
    typed = exact(value, None)
    return None if typed == before or float(np.float32(before)) == value else float(typed)


def _field(read: Callable[[Any], float], write: Callable[[StatedRoad, int, float], StatedRoad], **about: Any) -> Any:
    """Return a property of a row that shows a number and changes the road.

    Args:
        read: function from the row's group to the number; LookupError where the row is gone.
        write: function from the stated road, the row's number and the new value to the changed road.
        about: name, description and limits.
    """

    def get(group: Any) -> float:
        try:
            return read(group)
        except LookupError:
            return 0.0

    def put(group: Any, value: float) -> None:
        try:
            changed = _value(value, read(group))
        except LookupError:  # the row is gone, and the list not drawn since
            return
        if changed is not None:
            try_edit(group.id_data, lambda road: write(road, group.number, changed))

    return bpy.props.FloatProperty(get=get, set=put, **about)


def _element(name: str) -> Callable[[Any], float]:
    def read(group: Any) -> float:
        if tables.read(group.id_data) is None:
            raise LookupError
        return float(getattr(tables.elements[group.number], name))

    return read


def _vertical(name: str) -> Callable[[Any], float]:
    def read(group: Any) -> float:
        road = tables.read(group.id_data)
        if road is None:
            raise LookupError
        return float(getattr(road.alignment.vertical[group.number], name))

    return read


def _write_vertical(name: str) -> Callable[[StatedRoad, int, float], StatedRoad]:
    return lambda road, number, value: road.with_alignment(with_vertical_point(road.alignment, number, **{name: value}))


def _crossfall(name: str) -> Callable[[Any], float]:
    def read(group: Any) -> float:
        pair = carriageway_of(group.id_data)
        if pair is None:
            raise LookupError
        return float(getattr(pair[1].crossfall[group.number], name))

    return read


def _write_crossfall(name: str) -> Callable[[StatedRoad, int, float], StatedRoad]:
    def write(road: StatedRoad, number: int, value: float) -> StatedRoad:
        pair = carriageway_of(bpy.context.scene)
        assert pair
        changed = with_crossfall_point(road.carriageways[pair[0]], number, **{name: value})
        return road.with_carriageway(pair[0], changed)

    return write


def _width(column: int) -> Callable[[Any], float]:
    def read(group: Any) -> float:
        pair = carriageway_of(group.id_data)
        if pair is None:
            raise LookupError
        return float(width_rows(pair[1], strip_of(group.id_data, pair[1]))[group.number][column])

    return read


def _write_width(name: str) -> Callable[[StatedRoad, int, float], StatedRoad]:
    def write(road: StatedRoad, number: int, value: float) -> StatedRoad:
        pair = carriageway_of(bpy.context.scene)
        assert pair
        strip = strip_of(bpy.context.scene, pair[1])
        return road.with_carriageway(pair[0], with_width(road.carriageways[pair[0]], strip, number, **{name: value}))

    return write


def _kind(group: Any) -> int:
    road = tables.read(group.id_data)
    rows = tables.elements if road is not None else []
    return KINDS.index(rows[group.number].kind) if group.number < len(rows) else 0


def _set_kind(group: Any, index: int) -> None:
    def change(road: StatedRoad) -> StatedRoad:
        assert tables.parameters
        kind: Any = KINDS[index]
        return road.with_elements(
            with_kind(road.alignment.horizontal, group.number, kind, tables.parameters.design_class)
        )

    try_edit(group.id_data, change)


class SYNTHROADS_PG_element(bpy.types.PropertyGroup):
    """Row of an element: straight, clothoid or arc."""

    number: bpy.props.IntProperty(name="Row", options={"HIDDEN"})
    kind: bpy.props.EnumProperty(
        name="Kind", description="What the element is", items=KIND_ITEMS, get=_kind, set=_set_kind
    )
    length: _field(
        _element("length"),
        lambda road, number, value: road.with_elements(with_length(road.alignment.horizontal, number, value)),
        name="Length",
        description="Length along the axis in m, e.g. 150; what follows moves along. An arc lasts two seconds of "
        "travel at least, a straight has at most 2,000 m (RAA)",
        min=0.0,
        max=LONGEST_ROAD,
        step=100,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    radius: _field(
        _element("radius"),
        lambda road, number, value: road.with_elements(with_radius(road.alignment.horizontal, number, value)),
        name="Radius",
        description="Radius of the arc in m, positive in a left curve, negative in a right one, e.g. 1,200. Clothoids "
        "beside it keep their A. At least 900 m in EKA 1 A, 720 m in 1 B, 470 m in 2, 280 m in 3 (RAA)",
        min=-LARGEST_RADIUS,
        max=LARGEST_RADIUS,
        step=1000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    parameter: _field(
        _element("parameter"),
        lambda road, number, value: road.with_elements(with_parameter(road.alignment.horizontal, number, value)),
        name="A",
        description="Parameter of the clothoid in m, e.g. 400; its length follows, L = A² / R. From R/3 to R, and at "
        "least 300 m in EKA 1 A, 240 m in 1 B, 160 m in 2, 90 m in 3 (RAA)",
        min=0.0,
        max=LARGEST_RADIUS,
        step=1000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    start_radius: _field(
        _element("radius_start"),
        lambda road, number, value: road.with_elements(
            with_end_radius(road.alignment.horizontal, number, value, at_end=False)
        ),
        name="Radius at Beginning",
        description="Radius at the clothoid's beginning in m, positive in a left curve, e.g. 1,200; 0 where it is "
        "straight. A straight or an arc before it decides it",
        min=-LARGEST_RADIUS,
        max=LARGEST_RADIUS,
        step=1000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    end_radius: _field(
        _element("radius_end"),
        lambda road, number, value: road.with_elements(
            with_end_radius(road.alignment.horizontal, number, value, at_end=True)
        ),
        name="Radius at End",
        description="Radius at the clothoid's end in m, positive in a left curve, e.g. 1,200; 0 where it is straight. "
        "A straight or an arc behind it decides it",
        min=-LARGEST_RADIUS,
        max=LARGEST_RADIUS,
        step=1000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )


class SYNTHROADS_PG_vertical_point(bpy.types.PropertyGroup):
    """Row of a point of vertical intersection."""

    number: bpy.props.IntProperty(name="Row", options={"HIDDEN"})
    station: _field(
        _vertical("station"),
        _write_vertical("station"),
        name="Station",
        description="Distance along the road in m at which the two grades meet, e.g. 350; between its neighbours'",
        step=1000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    elevation: _field(
        _vertical("elevation"),
        _write_vertical("elevation"),
        name="Height",
        description="Height of the point in m above the road's origin, -500 to 9,000 m, e.g. 2.5. Grades of at most "
        "4 % in EKA 1 A, 4.5 % in 1 B and 2, 6 % in 3 (RAA)",
        min=-500.0,
        max=9000.0,
        step=10,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    radius: _field(
        _vertical("radius"),
        _write_vertical("radius"),
        name="Radius",
        description="Radius of the rounding in m, e.g. 15,000; 0 leaves a kink. Crests of at least 13,000 m and sags "
        "of 8,800 m in EKA 1 A, 10,000 and 5,700 m in 1 B, 5,000 and 4,000 m in 2, 3,000 and 2,600 m in 3 (RAA)",
        min=0.0,
        max=LARGEST_RADIUS,
        step=10000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )


class SYNTHROADS_PG_crossfall_point(bpy.types.PropertyGroup):
    """Row of a carriageway's crossfall."""

    number: bpy.props.IntProperty(name="Row", options={"HIDDEN"})
    station: _field(
        _crossfall("station"),
        _write_crossfall("station"),
        name="Station",
        description="Distance along the road in m, e.g. 350; between its neighbours'. In between the crossfall is "
        "linear. It changes along clothoids only (RAA)",
        step=1000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    percent: _field(
        _crossfall("crossfall_percent"),
        _write_crossfall("crossfall_percent"),
        name="Crossfall (%)",
        description="Crossfall in %, positive where the surface falls to the right, -12 to 12, e.g. 2.5. From 2.5 to "
        "6 % outside of run-offs, in curves towards the inside (RAA)",
        min=-12.0,
        max=12.0,
        step=10,
        precision=2,
    )


class SYNTHROADS_PG_width_row(bpy.types.PropertyGroup):
    """Row of a strip's width."""

    number: bpy.props.IntProperty(name="Row", options={"HIDDEN"})
    station: _field(
        _width(0),
        _write_width("station"),
        name="Station",
        description="Distance along the road in m, e.g. 350; between its neighbours'. In between the width is linear",
        step=1000,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    width: _field(
        _width(1),
        _write_width("width"),
        name="Width",
        description="Width in m, e.g. 3.75. Lanes have 2 to 6 m, or 0 along a stretch where they aren't there, edge "
        "strips up to 2 m, shoulders and verges up to 6 m; the rules follow the standard cross-sections (RAA)",
        min=-50.0,
        max=50.0,
        step=10,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )


def _strip_items(group: Any, context: Any) -> list[tuple[str, str, str, int]]:
    pair = carriageway_of(group.id_data)
    names = strip_names(pair[1]) if pair else ["Lane 1"]
    _ITEMS[:] = [(name, name, "Strip of the carriageway, from the inside out", i) for i, name in enumerate(names)]
    return _ITEMS


_ITEMS: list[tuple[str, str, str, int]] = []
"""The strips last listed: Blender needs the texts to stay."""


def _strip_number(group: Any) -> int:
    pair = carriageway_of(group.id_data)
    return min(int(group.strip_number), len(strip_names(pair[1])) - 1) if pair else 0


def _choose_strip(group: Any, number: int) -> None:
    group.strip_number = number


def _sync(group: Any, context: Any) -> None:
    sync(group.id_data)


def _redraw(group: Any, context: Any) -> None:
    redraw_profiles()


def _look_at(table: str) -> Callable[[Any, Any], None]:
    """Return an update hook of a table's active row: the cross-section is that at the row."""

    def look(group: Any, context: Any) -> None:
        rows, number = getattr(group, table), getattr(group, f"active_{table}")
        if tables.read(group.id_data) is None or not 0 <= number < len(rows):
            return
        if table == "elements":
            group.station = tables.elements[number].station
        else:
            group.station = max(rows[number].station, 0.0)

    return look


def _active(table: str, words: str) -> Any:
    """Return the property of a table's active row."""
    return bpy.props.IntProperty(
        name=f"Active {title_case(words)}",
        description=f"{words} that is edited below the list",
        update=_look_at(table),
    )


def _start(field: str, about: str, **kind: Any) -> Any:
    """Return a property that shows where the axis begins, or its direction there, and changes it."""

    def get(group: Any) -> float:
        road = tables.read(group.id_data)
        return 0.0 if road is None else float(getattr(road.alignment, field))

    def put(group: Any, value: float) -> None:
        update = {field: _value(value, get(group))}
        if update[field] is not None:
            try_edit(group.id_data, lambda road: road.with_alignment(road.alignment.model_copy(update=update)))

    return bpy.props.FloatProperty(get=get, set=put, description=about, **kind)


class SYNTHROADS_PG_alignment(bpy.types.PropertyGroup):
    """The tables: their rows and active rows, and which carriageway and strip are shown."""

    elements: bpy.props.CollectionProperty(type=SYNTHROADS_PG_element, name="Elements")
    vertical: bpy.props.CollectionProperty(type=SYNTHROADS_PG_vertical_point, name="Vertical Points")
    crossfall: bpy.props.CollectionProperty(type=SYNTHROADS_PG_crossfall_point, name="Crossfall")
    widths: bpy.props.CollectionProperty(type=SYNTHROADS_PG_width_row, name="Widths")
    active_elements: _active("elements", "Element")
    active_vertical: _active("vertical", "Vertical point")
    active_crossfall: _active("crossfall", "Crossfall point")
    active_widths: _active("widths", "Width")
    start_x: _start(
        "start_x",
        "X of the axis' beginning in m, in the road's own coordinates, e.g. -120. All of the road moves",
        name="Start X",
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    start_y: _start(
        "start_y",
        "Y of the axis' beginning in m, in the road's own coordinates, e.g. 35. All of the road moves",
        name="Start Y",
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    start_heading: _start(
        "start_heading_deg",
        "Direction of the axis at its beginning in degrees, counter-clockwise from x, e.g. 90; -360 to 360. "
        "All of the road turns",
        name="Start Heading",
        precision=4,
        min=-360.0,
        max=360.0,
    )
    station: bpy.props.FloatProperty(
        name="Cross-section at",
        description="Station in m of the cross-section that is drawn below the profile, e.g. 120; that of the active "
        "row after a click on one",
        min=0.0,
        step=500,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        update=_redraw,
    )
    side: bpy.props.EnumProperty(
        name="Carriageway",
        description="Side of the road, seen along the stations, whose crossfall and widths are shown",
        items=[("right", "Right", "Its traffic runs with the stations"), ("left", "Left", "Against the stations")],
        update=_sync,
    )
    strip_number: bpy.props.IntProperty(name="Number of the Strip", default=3, min=0, update=_sync, options={"HIDDEN"})
    strip: bpy.props.EnumProperty(
        name="Strip",
        description="Strip of the carriageway whose widths are shown; lanes are counted from outside",
        items=_strip_items,
        get=_strip_number,
        set=_choose_strip,
    )


ATTACHED = (bpy.types.Scene, "synthroads_alignment", SYNTHROADS_PG_alignment)
"""Attached to the scene, so that Blender notes each change of a value as a step to undo."""


@persistent
def _note_changes(scene: bpy.types.Scene, graph: bpy.types.Depsgraph | None = None) -> None:
    """Handler: the road may have changed, by an edit, a build or undo."""
    note_changes(graph)


@persistent
def _other_file(*_: Any) -> None:
    """Handler: another file was opened."""
    tables.forget()


HANDLERS = dict.fromkeys(("depsgraph_update_post", "undo_post", "redo_post"), _note_changes)
HANDLERS["load_post"] = _other_file
