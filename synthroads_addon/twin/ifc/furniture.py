"""Furniture at one place in IFC 4.3: signs, posts, poles, lights, cabinets, beacons, assets.

Each stands on a placement at its station, offset and height. Objects of the same size and rotation share one
body.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ...road.objects import PointObject
from ...road.things import beacon as beacon_sizes
from ...road.things import delineator as sizes
from ...road.things import kilometre_board as kilometre_board_sizes
from ...road.things import sign as sign_sizes
from ...road.things import traffic_light as traffic_light_sizes
from ...road.things.asset import Asset
from ...road.things.beacon import ConstructionBeacon
from ...road.things.cabinet import Cabinet
from ...road.things.delineator import Delineator
from ...road.things.kilometre_board import KilometreBoard
from ...road.things.pole import Pole
from ...road.things.sign import TrafficSign
from ...road.things.traffic_light import TrafficLight
from .entities import Entity
from .scene import Scene
from .solids import Solids

BURIED = 0.3
"""Depth to which posts are modelled below the surface, m."""
_FACE = 0.003
"""Thickness of a sign's face, m."""
_POST_TOP = {"round": 0.9, "triangle": 0.6, "rectangle": 0.97, "octagon": 0.93, "arrow": 0.9}
"""Shape of a sign -> height of its posts' top as a share of the face's."""
_LIGHT_BOARD, _CHAMBER_HEIGHT, _LIGHT_MARGIN = 1.9, 1.25, 0.05
"""Width of a traffic light's board and height of a light's housing in its diameters; the board's margin, m."""
_LUMINAIRE = (0.26, 0.6, 0.09)
"""Size of a street light along the road, across it, and in height, m."""
_CAMERA = (0.4, 0.13, 0.12)
_ARM = 0.06
"""Thickness of a pole's arm, m."""
_ARM_RISE = 0.12
_CABINETS = {
    "emergency_phone": ("IfcCommunicationsAppliance", "USERDEFINED", "plastic_orange"),
    "utility": ("IfcDistributionBoard", "DISTRIBUTIONBOARD", "cabinet_grey"),
}
"""Kind of cabinet -> its entity, predefined type and material."""
_POLE_HEADS = {
    "lighting": ("IfcLightFixture", "light", "POINTSOURCE"),
    "surveillance": ("IfcAudioVisualAppliance", "camera", "CAMERA"),
}
"""Kind of pole -> entity, name and predefined type of what it carries."""


def write_furniture(scene: Scene) -> None:
    """Add everything that stands at one place but gantries and bridges."""
    for name, item in scene.geometry.parameters.objects.items():
        write = _WRITERS.get(type(item))
        if write is not None:
            write(scene, name, item)


def _turn(item: PointObject) -> float:
    """Return an object's rotation, rad."""
    return math.radians(math.remainder(item.rotation_deg, 360.0))


def _key(item: PointObject) -> object:
    """Return what makes the body of one object that of another: all but its place and its number."""
    hidden = {"instance", "station", "offset", "elevation", "text", "code"}
    values = {name: value for name, value in item.to_dict().items() if name not in hidden}
    values["rotation_deg"] = math.remainder(item.rotation_deg, 360.0)
    return tuple(sorted((name, str(value)) for name, value in values.items()))


def _stand(
    scene: Scene,
    entity: str,
    name: str,
    item: PointObject,
    body: Callable[[Solids], list[Entity]],
    kind: str,
    about: str = "",
) -> Entity:
    """Add an element with its body at its place."""
    ifc, key = scene.ifc, _key(item)
    items = [] if ifc.has_shape(key) else body(Solids(ifc, _turn(item)))
    placement, shape = scene.place_of(item).placement, ifc.shape(items, "SweptSolid", key)
    made = ifc.product(entity, name, kind, about or type(item).__name__, placement, Representation=shape)
    scene.describe(made, item)
    scene.stand(made, scene.container(item.station, item.offset))
    return made


# --- signs ----------------------------------------------------------------------------------------------------------


def _sign(scene: Scene, name: str, item: TrafficSign) -> None:
    def body(solids: Solids) -> list[Entity]:
        height = item.lower_edge + item.height * _POST_TOP[item.shape] + BURIED
        beside = [((number + 0.5) / item.posts - 0.5) * item.width for number in range(item.posts)]
        posts = [solids.cylinder(item.post_diameter, (0.0, y, -BURIED), height) for y in beside]
        middle = (-item.post_diameter / 2.0 - sign_sizes.RAIL, 0.0, item.lower_edge + item.height / 2.0)
        return [solids.plate(item.shape, item.width, item.height, middle, _FACE), *posts]

    sign = _stand(scene, "IfcSign", name, item, body, "PICTORAL")
    _about_sign(scene, sign, item, "galvanised_steel", item.code)


def _board(scene: Scene, name: str, item: KilometreBoard) -> None:
    def body(solids: Solids) -> list[Entity]:
        middle = (_FACE, 0.0, item.lower_edge + item.height / 2.0)
        post = solids.cylinder(
            kilometre_board_sizes.POST, (0.0, 0.0, -BURIED), item.lower_edge + item.height / 2.0 + BURIED
        )
        return [solids.plate("rectangle", item.width, item.height, middle, 2.0 * _FACE), post]

    sign = _stand(scene, "IfcSign", name, item, body, "MARKER")
    _about_sign(scene, sign, item, "sheeting_blue", item.text)


def _delineator(scene: Scene, name: str, item: Delineator) -> None:
    def body(solids: Solids) -> list[Entity]:
        outline = [(along, -away) for away, along in sizes.OUTLINE]
        return [solids.prism(outline, (0.0, 0.0, -BURIED), item.height + BURIED)]

    sign = _stand(scene, "IfcSign", name, item, body, "MARKER")
    _about_sign(scene, sign, item, "plastic_white")


def _beacon(scene: Scene, name: str, item: ConstructionBeacon) -> None:
    def body(solids: Solids) -> list[Entity]:
        middle = (beacon_sizes.BLADE / 2.0, 0.0, beacon_sizes.BLADE_BOTTOM + item.height / 2.0)
        blade = solids.plate("rectangle", item.width, item.height, middle, beacon_sizes.BLADE)
        wide, long, high = beacon_sizes.FOOT
        tenon = solids.box((0.05, 0.07, 0.1), (0.0, 0.0, 0.07))
        return [blade, tenon, solids.box((long, wide, high), (0.0, 0.0, 0.0))]

    sign = _stand(scene, "IfcSign", name, item, body, "MARKER")
    _about_sign(scene, sign, item, "sheeting_red")


def _about_sign(scene: Scene, sign: Entity, item: PointObject, material: str, reference: str = "") -> None:
    ifc = scene.ifc
    values = {"IsExternal": ifc.value(True), "Category": ifc.add("IfcLabel", type(item).__name__)}
    if reference:
        values["Reference"] = ifc.add("IfcIdentifier", reference)
    ifc.properties(sign, "Pset_SignCommon", values)
    ifc.made_of(sign, material)


# --- equipment ------------------------------------------------------------------------------------------------------


def _light(scene: Scene, name: str, item: TrafficLight) -> None:
    def body(solids: Solids) -> list[Entity]:
        tall = item.lights * item.light_diameter * _CHAMBER_HEIGHT + 2.0 * _LIGHT_MARGIN
        post = solids.cylinder(traffic_light_sizes.POST, (0.0, 0.0, -BURIED), item.height + BURIED - 0.03)
        middle = (-traffic_light_sizes.POST / 2.0, 0.0, item.height - tall / 2.0)
        board = solids.plate("rectangle", _LIGHT_BOARD * item.light_diameter, tall, middle, 0.01)
        lamps = []
        for number in range(item.lights):
            level = item.height - _LIGHT_MARGIN - (number + 0.5) * item.light_diameter * _CHAMBER_HEIGHT
            place = (-traffic_light_sizes.POST / 2.0 - 0.01, 0.0, level)
            lamps.append(solids.plate("round", item.light_diameter, item.light_diameter, place, 0.14))
        return [post, board, *lamps]

    signal = _stand(scene, "IfcSignal", name, item, body, "VISUAL")
    scene.ifc.made_of(signal, "plastic_black")


def _cabinet(scene: Scene, name: str, item: Cabinet) -> None:
    def body(solids: Solids) -> list[Entity]:
        return [solids.box((item.depth, item.width, item.height + BURIED), (0.0, 0.0, -BURIED))]

    entity, kind, material = _CABINETS[item.kind]
    scene.ifc.made_of(_stand(scene, entity, name, item, body, kind, item.kind), material)


def _asset(scene: Scene, name: str, item: Asset) -> None:
    """Add a free asset: its shape is in its library's file."""
    _stand(scene, "IfcBuildingElementProxy", name, item, lambda _: [], "ELEMENT", item.name)


def _pole(scene: Scene, name: str, item: Pole) -> None:
    """Add a mast with what it carries: an assembly of the column and a street light, or a camera."""
    ifc, place = scene.ifc, scene.place_of(item)
    assembly = ifc.product("IfcElementAssembly", name, "MAST", item.kind, place.placement, AssemblyPlace="FACTORY")
    scene.describe(assembly, item)
    scene.stand(assembly, scene.container(item.station, item.offset))
    column = scene.add_part(assembly, place, "IfcColumn", f"{name}/column", "COLUMN")
    entity, part, kind = _POLE_HEADS[item.kind]
    head = scene.add_part(assembly, place, entity, f"{name}/{part}", kind)
    key = _key(item)
    solids = Solids(ifc, _turn(item))
    known = ifc.has_shape((key, "column"))
    column.Representation = ifc.shape([] if known else _mast(solids, item), "SweptSolid", (key, "column"))
    head.Representation = ifc.shape([] if known else [_head(solids, item)], "SweptSolid", (key, "head"))
    ifc.made_of(column, "galvanised_steel")
    ifc.made_of(head, "cabinet_grey")
    for made in (column, head):
        ifc.label(made, item.instance, item.points_class)


def _mast(solids: Solids, item: Pole) -> list[Entity]:
    """Return a pole's mast and its arm, which points to the left."""
    top = item.height - (_LUMINAIRE[2] + _ARM_RISE * item.arm_length if item.kind == "lighting" else 0.0)
    parts = [solids.cylinder(item.diameter, (0.0, 0.0, -BURIED), top + BURIED)]
    if item.arm_length > _ARM:
        parts.append(solids.box((_ARM, item.arm_length, _ARM), (0.0, item.arm_length / 2.0, _mount(item) - _ARM)))
    return parts


def _head(solids: Solids, item: Pole) -> Entity:
    """Return a street light under its top, or a camera; at the end of the arm."""
    if item.kind == "lighting":
        return solids.box(_LUMINAIRE, (0.0, item.arm_length + _LUMINAIRE[1] / 2.0, item.height - _LUMINAIRE[2]))
    return solids.box(_CAMERA, (0.0, item.arm_length, _mount(item) - _ARM - _CAMERA[2]))


def _mount(item: Pole) -> float:
    """Return the height of a pole's arm, m."""
    return item.height - (0.0 if item.kind == "lighting" else 0.35)


_WRITERS: dict[type, Callable[[Scene, str, Any], None]] = {
    Asset: _asset,
    Cabinet: _cabinet,
    ConstructionBeacon: _beacon,
    Delineator: _delineator,
    KilometreBoard: _board,
    Pole: _pole,
    TrafficLight: _light,
    TrafficSign: _sign,
}
