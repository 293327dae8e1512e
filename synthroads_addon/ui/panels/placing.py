"""Operators that put things onto the road, repeat them along it and delete them.

Annotations are not postponed here: Blender reads the properties from them.
"""

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import bpy
import numpy as np

from ...base.errors import InputError
from ...base.schema import round_value
from ...blender.model.added import add_thing
from ...blender.model.roads import parts_and_copies, root_of, world_matrix
from ...blender.model.store import find_road, recall
from ...blender.model.truth import read_road
from ...blender.things.model_builder import ROLE
from ...road.geometry import RoadGeometry
from ...road.guidelines import GUIDELINE_OF_CLASS, SHORTEST_BARRIER
from ...road.objects import LineObject
from ...road.parameters import RoadParameters
from ...road.things.registry import THINGS
from ...road.things.sign_catalogue import sign_type
from ...road.things.thing import LengthwiseThing, StandingThing, Thing
from ...sampling.placing.free_place import FARTHEST_MOVE, thing_at_free_place
from ...sampling.placing.single import usual_sign
from ...scenario.assets import library_names, read_asset_library
from ..fields.numbers import LENGTH_DIGITS, exact
from ..fields.wording import thing_name
from ..translations.blender import said
from ..work.common import column, has_road, is_free, refusing
from ..work.view import view_of
from .things import sign_numbers, thing_of

FARTHEST = 100.0
"""So far beside the axis, m, the cursor still means a place on the road."""
AT_CURSOR = -1.0
"""Station that stands for the cursor's."""
_GROUPS = (
    ("TrafficSign", "KilometreBoard", "TrafficLight", "Gantry"),
    ("Guardrail", "ConcreteBarrier", "TemporaryBarrier", "NoiseBarrier", "ConstructionBeacon", "Delineator"),
    ("Pole", "Cabinet", "Shaft", "Gutter", "PowerLine", "Overpass"),
    ("Fence", "Hedge", "Tree", "FieldEntrance", "TrafficIsland"),
    ("Wall", "Building", "BusShelter", "ParkedVehicle", "Asset"),
)
"""Things in the order of the menu, a block each; those of later versions come behind them."""
ICONS = {
    "TrafficSign": "FILE_TEXT",
    "Guardrail": "MOD_ARRAY",
    "Pole": "LIGHT_POINT",
    "Building": "HOME",
    "Asset": "ASSET_MANAGER",
    "ParkedVehicle": "AUTO",
    "Hedge": "OUTLINER_OB_CURVES",
    "Tree": "OUTLINER_OB_FORCE_FIELD",
}


def menu_groups() -> Iterator[tuple[str, ...]]:
    """Yield the types of things as blocks of the menu, every type of the registry once."""
    known = {kind for group in _GROUPS for kind in group}
    yield from _GROUPS
    if further := tuple(kind for kind in THINGS if kind not in known):
        yield further


def _about(kind: str) -> str:
    return (THINGS[kind].__doc__ or "").partition("\n")[0].removesuffix(".")


def _asset_items() -> list[tuple[str, str, str]]:
    items = []
    for library in library_names():
        for name in read_asset_library(library).assets:
            items.append((f"{library}/{name}", name.replace("_", " ").replace("-", " ").title(), f"Of {library}"))
    return items or [("", "None", "There is no asset")]


class RoadPlace(NamedTuple):
    """A place beside a road: its station and side, m."""

    station: float
    side: Literal["left", "right"]


def place_at_cursor(context: bpy.types.Context, root: bpy.types.Object, geometry: RoadGeometry) -> RoadPlace:
    """Return the station and side of the 3D cursor; of the middle of the view if the cursor is far from the road."""
    points = [np.array(context.scene.cursor.location, dtype=np.float64)]
    space = view_of(context)
    if space is not None and space.region_3d is not None:
        points.append(np.array(space.region_3d.view_location, dtype=np.float64))
    into = np.linalg.inv(world_matrix(root))
    for point in points:
        local = into[:3, :3] @ point + into[:3, 3]
        station, offset = (float(value[0]) for value in geometry.alignment.project(local[None, :2]))
        if -1e-6 <= station <= geometry.length + 1e-6 and abs(offset) <= FARTHEST:
            return RoadPlace(min(max(station, 0.0), geometry.length), "left" if offset > 0.0 else "right")
    return RoadPlace(geometry.length / 2.0, "right")


def _free_name(kind: str, taken: set[str]) -> str:
    words = thing_name(kind).lower().replace(" ", "-")
    number = 1
    while f"{words}-{number}" in taken:
        number += 1
    return f"{words}-{number}"


def _next_number(parameters: RoadParameters) -> int:
    return max(item.instance for item in parameters.objects.values()) + 1


def _select(context: bpy.types.Context, items: list[bpy.types.Object]) -> None:
    """Make objects the only selected ones, the last one active."""
    for other in context.view_layer.objects.selected:
        other.select_set(False)
    for item in items:
        item.select_set(True)
        context.view_layer.objects.active = item


def sign_again(code: str, design_class: str) -> str:
    """Return the sign number of the last time for a road of a class; empty if the sign is of another country."""
    sign = sign_type(code)
    return code if sign is None or sign.country == GUIDELINE_OF_CLASS[design_class].country else ""


class _OnRoad:
    """Base of operators that need a road and no running work."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no other work is running."""
        return is_free(cls, context) and has_road(cls, context)


class SYNTHROADS_OT_add_thing(_OnRoad, bpy.types.Operator):
    """Put a thing onto the road at the 3D cursor's station, where the rules have it. Scans and models have it"""

    bl_idname = "synthroads.add_thing"
    bl_label = "Add to Road"

    kind: bpy.props.EnumProperty(
        name="Thing", description="What is put onto the road", items=[(k, thing_name(k), _about(k)) for k in THINGS]
    )
    station: bpy.props.FloatProperty(
        name="Station",
        description="Distance along the road in m, e.g. 120; where it begins if it runs along. Negative: the cursor's",
        default=AT_CURSOR,
        min=AT_CURSOR,
        soft_min=0.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )
    side: bpy.props.EnumProperty(
        name="Side",
        description="Side of the road, seen along the stations",
        items=[("cursor", "Cursor's", "Side that the cursor is on"), ("left", "Left", ""), ("right", "Right", "")],
        options={"SKIP_SAVE"},
    )
    by_rule: bpy.props.BoolProperty(
        name="Offset by Rule",
        description="Behind barriers and clear of the pavement, as roads are furnished (RPS, HLB); else as given below",
        default=True,
    )
    free_place: bpy.props.BoolProperty(
        name="Next Free Place",
        description="Move it along the road, with the stations, to where nothing stands, if something does at its "
        f"station: at most {FARTHEST_MOVE:.0f} m. What runs along the road stays",
        default=True,
    )
    offset: bpy.props.FloatProperty(
        name="Offset",
        description="Distance from the axis in m, positive to the left, e.g. -16.5; -100 to 100 m are allowed",
        min=-100.0,
        max=100.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    turned: bpy.props.FloatProperty(
        name="Turned By (°)",
        description="Turn about the vertical in degrees from facing its side's traffic, e.g. 10",
        min=-180.0,
        max=180.0,
        precision=1,
    )
    length: bpy.props.FloatProperty(
        name="Length",
        description="Length along the road in m, terminals included. Barriers have at least 60 m by the rules",
        default=SHORTEST_BARRIER,
        min=1.0,
        soft_max=1000.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )
    code: bpy.props.StringProperty(
        name="Sign Number",
        description="Number in the catalogue of signs (VzKat), e.g. 274-120, of another country GB.512-L; those that "
        "are known are listed as you type. Empty: a usual one of the road's country",
        search=sign_numbers,
    )
    text: bpy.props.StringProperty(name="Text", description="What is written on it; lines are divided by /")
    asset: bpy.props.EnumProperty(name="Asset", description="Asset of a built-in library", items=_asset_items())

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take station and side of the cursor into the redo panel, and add the thing.

        The sign is that of the last time, unless the road is of another country.
        """
        root = find_road(context.scene)
        assert root  # poll() has seen it
        self.code = sign_again(self.code, recall(root)[0].design_class)
        return self.execute(context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Build the thing and make it the active object."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        parameters = read_road(root, context.scene).known()
        geometry = RoadGeometry(parameters)
        cursor = place_at_cursor(context, root, geometry)
        if self.station < 0.0:
            self.station = round(cursor.station, 2)
        if self.side == "cursor":
            self.side = cursor.side
        if self.kind == "TrafficSign" and not self.code:
            self.code = usual_sign(parameters.design_class)
        station = min(exact(self.station, None), geometry.length)
        fields = self._fields(station, geometry.length)
        place = thing_at_free_place(
            *(geometry, self.kind, self.side, station, fields), farthest_move=FARTHEST_MOVE if self.free_place else 0.0
        )
        thing = place.thing
        assert isinstance(thing, StandingThing | LengthwiseThing)
        if isinstance(thing, StandingThing) and thing.station != station:
            self.station = thing.station
            if self.kind == "KilometreBoard" and not self.text:
                thing = thing.model_copy(update={"text": _kilometre(thing.station)})
        if self.by_rule:
            self.offset = thing.offset
        update: dict[str, Any] = {"instance": _next_number(parameters)}
        if self.turned and isinstance(thing, StandingThing):
            update["rotation_deg"] = round_value(
                (thing.rotation_deg + exact(self.turned, None) + 180.0) % 360.0 - 180.0
            )
        thing = thing.model_copy(update=update)
        taken = {*parameters.objects, *parts_and_copies(root, context.scene)[0]}
        name = _free_name(self.kind, taken)
        item = add_thing(root, context.scene, thing, name)
        _select(context, [item])
        if not place.is_free:
            self.report(
                {"WARNING"},
                said(f"{name} and {place.obstacle} stand at one place: choose another station, side or offset"),
            )
        elif place.obstacle:
            self.report({"INFO"}, said(f"{name} is at station {self.station:,.2f} m, behind {place.obstacle}"))

    def _fields(self, station: float, length: float) -> dict[str, Any]:
        """Return the fields that the redo panel gives, by the kind of thing."""
        fields: dict[str, Any] = {}
        model = THINGS[self.kind]
        if not self.by_rule:
            fields["offset"] = exact(self.offset, None)
        if issubclass(model, LineObject):
            fields["end_station"] = round_value(min(station + exact(self.length, None), length))
        if self.kind == "TrafficSign":
            fields["code"] = self.code
            if self.text:
                fields["text"] = tuple(line.strip() for line in self.text.split("/"))
        elif self.kind == "KilometreBoard":
            fields["text"] = self.text or _kilometre(station)
        elif self.kind == "Asset" and self.asset:
            fields["library"], fields["name"] = self.asset.split("/", 1)
        return fields

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the properties that the thing has."""
        layout = column(self)
        model = THINGS[self.kind]
        for name in ("kind", "station", "side", "by_rule"):
            layout.prop(self, name)
        if issubclass(model, StandingThing):
            layout.prop(self, "free_place")
        if not self.by_rule:
            layout.prop(self, "offset")
        layout.prop(self, "length" if issubclass(model, LineObject) else "turned")
        extra = {"TrafficSign": ("code", "text"), "KilometreBoard": ("text",), "Asset": ("asset",)}
        for name in extra.get(self.kind, ()):
            layout.prop(self, name)


def _kilometre(station: float) -> str:
    """Return what a kilometre board says at a station (m), to a tenth of a kilometre."""
    return f"{station / 1000.0:.1f}".replace(".", ",")


class SYNTHROADS_OT_repeat_thing(_OnRoad, bpy.types.Operator):
    """Repeat the selected things along the road at a spacing, each at its offset. Scans and models have the copies"""

    bl_idname = "synthroads.repeat_thing"
    bl_label = "Repeat Along Road"

    count: bpy.props.IntProperty(
        name="Copies", description="Number of copies of each selected thing, e.g. 5", default=1, min=1, max=500
    )
    spacing: bpy.props.FloatProperty(
        name="Spacing",
        description="Distance from one to the next along the road in m, e.g. 50; negative: against the stations",
        default=50.0,
        soft_min=-1000.0,
        soft_max=1000.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a thing of the road is selected."""
        if not super().poll(context):
            return False
        if not any(thing_of(item, context.scene) for item in context.selected_objects):
            cls.poll_message_set(said("Select a thing of the road first"))
            return False
        return True

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Build the copies that lie on the road, and select them."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        parameters = read_road(root, context.scene).known()
        length = parameters.alignment.length
        number, spacing = _next_number(parameters), exact(self.spacing, None)
        taken = {*parameters.objects, *parts_and_copies(root, context.scene)[0]}
        made = []
        for item in sorted(context.selected_objects, key=lambda item: item.name):
            thing = thing_of(item, context.scene)
            if thing is None or root_of(item, context.scene) != root:
                continue
            for step in range(1, self.count + 1):
                update = _moved_along(thing, step * spacing, length)
                if update is None:
                    break
                name = _free_name(type(thing).__name__, taken)
                taken.add(name)
                copy = thing.model_copy(update=update | {"instance": number})
                number += 1
                made.append(add_thing(root, context.scene, copy, name))
        if not made:
            raise InputError("Spacing", spacing, f"no copy would lie on the road of {length:,.0f} m: choose another")
        _select(context, made)


def _moved_along(thing: Thing, by: float, length: float) -> dict[str, float] | None:
    """Return a thing's stations moved by a distance (m); None if they don't lie on a road of a length (m)."""
    names = [name for name in ("station", "start_station", "end_station") if hasattr(thing, name)]
    moved = {name: round_value(getattr(thing, name) + by) for name in names}
    return moved if all(0.0 <= value <= length for value in moved.values()) else None


class SYNTHROADS_OT_delete_thing(_OnRoad, bpy.types.Operator):
    """Delete the selected things of the road, also from its parameter set, and so from scans and models"""

    bl_idname = "synthroads.delete_thing"
    bl_label = "Delete from Road"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a thing of the road is selected."""
        if not super().poll(context):
            return False
        if not any(thing_of(item, context.scene) for item in context.selected_objects):
            cls.poll_message_set(said("Select a thing of the road first"))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove the objects, a gantry's with the faces of its signs."""
        chosen = [item for item in context.selected_objects if thing_of(item, context.scene)]
        for item in chosen:
            root, role = root_of(item, context.scene), str(item[ROLE])
            parts = parts_and_copies(root, context.scene)[0] if root is not None else {}
            faces = [part for name, part in parts.items() if name.startswith(f"{role}/")]
            for part in (*(faces if parts.get(role) == item else ()), item):
                bpy.data.objects.remove(part)
        return {"FINISHED"}
