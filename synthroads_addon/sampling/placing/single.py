"""One thing more beside a road that is there: where the rules of the placement put it, and what is usual for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...base.schema import round_value
from ...road.geometry import RoadGeometry
from ...road.guidelines import BARRIER_DISTANCE, GUIDELINE_OF_CLASS, LIMITS, SHORTEST_BARRIER
from ...road.objects import LineObject, RoadObject, Side, nominal_width
from ...road.section_geometry import CarriagewaySection
from ...road.things.bus_shelter import OVERHANG
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.gantry import Gantry
from ...road.things.guardrail import Guardrail
from ...road.things.registry import THINGS
from ...road.things.sign_catalogue import fastest_limit_sign, sign_catalogue, signs_of_country
from ...road.things.thing import Thing
from ...scenario.assets import library_names, read_asset_library
from .construction import BARRIER_DISTANCE as FROM_CLOSED_LANE
from .construction import BEACON_DISTANCE
from .country.entrances import culvert, edge_bend, ground_profile
from .delineators import DELINEATOR_BEHIND_BARRIER, DELINEATOR_DISTANCE
from .drainage import GUTTER
from .edge import EdgeProfile
from .layout import BARRIER_AXIS, FAR_ZONE, SMALL_ZONE
from .roadside import BUILDING_DISTANCE, FENCE_ZONE, HEDGE_DISTANCE
from .structures import ABUTMENT_DISTANCE, LANES_OF_CANTILEVER

_REACH = 1.0
"""Distance along the road, m, within which the pavement's edge and barriers count for a thing's offset."""
_SMALL_THINGS = 2.0
"""Room across the road, m, between a barrier's line and a bridge's abutment, as for overpasses that are sampled."""
_PARKED = 3.0
"""From the nearest place of buildings to the middle of a parked vehicle, m. Chosen: half a vehicle, and a wall."""
_WIDTHS = {"Cabinet": "width", "KilometreBoard": "width", "TrafficSign": "width", "Pole": "diameter", "Shaft": "size"}
"""Things of the small zone, and the field that says what they take across the road."""
TREE_BEHIND = 0.5
"""From the zone of barriers to a tree's trunk, m. Chosen."""
_BEYOND_OBSTACLES = 0.01
"""Distance that a tree is farther from the pavement than obstacles without a barrier must be, m: it is rounded."""
_BESIDE_TRUNK = 1.0
"""Ground, m, that is left between a tree's trunk and the border of the terrain. Chosen."""
_LIGHT = 0.4
"""Room that a traffic light takes across the road, m."""


class PlaceByRule:
    """Places beside a road that the rules of the placement give, for one thing more.

    Args:
        geometry: of the road, with all that stands on it.
        side: of the road.
        station: m.
    """

    def __init__(self, geometry: RoadGeometry, side: Side, station: float) -> None:
        self._geometry, self._station = geometry, station
        self.design_class = geometry.parameters.design_class
        known = geometry.sections
        self.side: Side = side if side in known else next(iter(known))
        self._section: CarriagewaySection = known[self.side]
        carriageway = self._section.carriageway
        self.sign, self.facing = carriageway.sign, 0.0 if carriageway.traffic > 0 else 180.0
        edge = EdgeProfile(self._section, geometry.length)
        self._paved = edge.largest_paved(station - _REACH, station + _REACH)
        self._verge = self._paved + nominal_width(carriageway.verge_width)
        self._front = max([self._paved, *self._barrier_lines()])

    def _barrier_lines(self) -> list[float]:
        """Return the distances (m) from the centreline from which the side's barriers at the station were placed."""
        lines = []
        for item in self._geometry.parameters.objects.values():
            if not isinstance(item, Guardrail | ConcreteBarrier) or self.sign * item.offset < self._paved:
                continue
            if item.start_station - _REACH < self._station < item.end_station + _REACH:
                half = item.base_width / 2.0 + BARRIER_DISTANCE if isinstance(item, ConcreteBarrier) else BARRIER_AXIS
                lines.append(self.sign * item.offset - half)
        return lines

    @property
    def _lane_edge(self) -> float:
        """Return the distance (m) of the outer edge of the outermost lane from the centreline."""
        return float(self._section.lane_boundaries(self._station)[0][0])

    def distance(self, kind: str, fields: Mapping[str, Any]) -> float:
        """Return the distance (m) of a thing's axis from the centreline, by its type and its fields."""
        first_building = max(self._paved + BUILDING_DISTANCE, self._verge + FENCE_ZONE[1])
        width = float(fields.get(_WIDTHS.get(kind, ""), _LIGHT))
        behind_barriers = self._front + DELINEATOR_BEHIND_BARRIER
        distances = {
            "Delineator": behind_barriers if self._barrier_lines() else self._paved + DELINEATOR_DISTANCE,
            "ConstructionBeacon": self._lane_edge + BEACON_DISTANCE,
            "TemporaryBarrier": self._lane_edge + FROM_CLOSED_LANE,
            "Guardrail": self._paved + BARRIER_AXIS,
            "ConcreteBarrier": self._paved + BARRIER_DISTANCE + float(fields.get("base_width", 0.0)) / 2.0,
            "NoiseBarrier": self._front + FAR_ZONE + float(fields.get("post_width", 0.0)) / 2.0,
            "Hedge": self._verge + HEDGE_DISTANCE + float(fields.get("width", 0.0)) / 2.0,
            "Fence": self._verge + FENCE_ZONE[0],
            "Tree": self._tree_trunk(fields) + float(fields.get("trunk_diameter", 0.0)) / 2.0,
            "FieldEntrance": self._paved,
            "Wall": first_building,
            "ParkedVehicle": first_building + _PARKED,
            "Building": first_building + float(np.hypot(fields.get("width", 0.0), fields.get("depth", 0.0))) / 2.0,
            "BusShelter": self._verge + float(fields.get("depth", 0.0)) / 2.0 + OVERHANG,
            "Gutter": nominal_width(self._section.carriageway.inner_offset) - GUTTER / 2.0,
            "Asset": self._verge + (self._behind_verge(fields) if kind == "Asset" else 0.0),
        }
        distances |= dict.fromkeys(("Overpass", "PowerLine", "TrafficIsland"), 0.0)
        return distances.get(kind, self._front + SMALL_ZONE + width / 2.0)

    def _tree_trunk(self, fields: Mapping[str, Any]) -> float:
        """Return the distance (m) of a tree's trunk: behind the barriers, or as far away as it needs none.

        It stands nearer where the ground ends before, or where it is older than the rules (``stock``).
        """
        parameters = self._geometry.parameters
        behind_barriers = self._front + SMALL_ZONE + TREE_BEHIND
        if self._barrier_lines() or fields.get("stock"):
            return behind_barriers
        far = max(self._paved + LIMITS[parameters.design_class].obstacle_distance + _BEYOND_OBSTACLES, behind_barriers)
        trunk = float(fields.get("trunk_diameter", 0.0))
        terrain = parameters.terrain
        has_ground = terrain is None or far + trunk + _BESIDE_TRUNK <= terrain.half_width
        return far if has_ground else behind_barriers

    def entrance_fields(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of an entrance that its place gives: the edge's bend, and the pipe in the ditch."""
        depth, reach = float(fields["depth"]), float(fields["width"]) / 2.0 + float(fields["radius"])
        offset = self.sign * self._paved
        bend = edge_bend(self._geometry.alignment, self.sign, self._station, offset, reach)
        terrain = self._geometry.parameters.terrain
        if terrain is None or terrain.elevation_model is not None:
            return bend | {"pipe_diameter": 0.0}
        profile = ground_profile(self._geometry, self.sign, self._station, self._paved, depth)
        return bend | culvert(profile, float(fields["pipe_diameter"]), depth, bool(fields["head_walls"]))

    @staticmethod
    def _behind_verge(fields: Mapping[str, Any]) -> float:
        """Return how far (m) behind the verge's edge an asset's library puts it at least."""
        return read_asset_library(fields["library"]).assets[fields["name"]].placement.distance.minimum

    def gantry_kind(self) -> Literal["one_sided", "cantilever"]:
        """Return which gantry has room: one with a post in the median, or on one post where a barrier stands there."""
        half = float(Gantry.model_fields["post_width"].default) / 2.0
        items = self._geometry.parameters.objects.values()
        barriers = (item for item in items if isinstance(item, Guardrail | ConcreteBarrier))
        is_taken = any(
            block.start - half < self._station < block.end + half and block.low < half and block.high > -half
            for item in barriers
            for block in item.footprint()
        )
        return "cantilever" if is_taken else "one_sided"

    @property
    def _cantilever_end(self) -> float:
        """Return the distance (m) from the centreline to which a cantilever over the outer lanes reaches."""
        boundaries = self._section.lane_boundaries(self._station)[0]
        return float(boundaries[min(LANES_OF_CANTILEVER, len(boundaries) - 1)])

    def spans(self, kind: str) -> dict[str, float]:
        """Return the offsets of a structure's ends by their fields, m; empty for other things."""
        outer = self._front + SMALL_ZONE
        if kind == "Gantry":
            inner = self._cantilever_end if self.gantry_kind() == "cantilever" else 0.0
            ends = sorted((self.sign * inner, self.sign * outer))
            return {"right_offset": round_value(ends[0]), "left_offset": round_value(ends[1])}
        if kind == "Overpass":
            nearest = max(self._verge + ABUTMENT_DISTANCE, outer + _SMALL_THINGS)
            return {"left_abutment": round_value(nearest), "right_abutment": round_value(-nearest)}
        return {}


def usual_sign(design_class: str) -> str:
    """Return the code of the sign that is placed by hand if none is named.

    Chosen: of the speed limits of the guideline's country the fastest that the class is designed for; without one the
    country's first sign, and without any sign the catalogue's first.
    """
    country = GUIDELINE_OF_CLASS[design_class].country
    limit = fastest_limit_sign(country, LIMITS[design_class].speed)
    return limit or next(iter([*signs_of_country(country, rural=True), *sign_catalogue().signs]))


def usual_fields(kind: str, place: PlaceByRule, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a new thing that its model requires beside its place, as usual, and those that are given.

    Args:
        kind: its type in the parameter set.
        place: where it stands.
        fields: what is given.
    """
    usual: dict[str, Any] = {}
    towards_road = "right" if place.side == "left" else "left"
    if kind == "TrafficSign":
        usual_code = usual_sign(place.design_class)
        code = str(fields.get("code") or usual_code)
        known = sign_catalogue().signs.get(code) or sign_catalogue().signs[usual_code]
        usual = known.fields() | {"code": code, "text": known.text}
    elif kind == "Gantry":
        usual = {"kind": place.gantry_kind(), "post_side": place.side}
    elif kind == "Cabinet":
        usual = {"kind": "emergency_phone"}
    elif kind == "KilometreBoard":
        usual = {"text": "0,0"}
    elif kind == "Guardrail":
        usual = {"faces": towards_road}
    elif kind == "Gutter":
        usual = {"kerb_side": towards_road}
    elif kind == "ConstructionBeacon":
        usual = {"pass_side": towards_road}
    elif kind == "Overpass":
        usual = {"pier_offsets": ()}
    elif kind == "Asset":
        library = str(fields.get("library") or library_names()[0])
        known_assets = read_asset_library(library).assets
        name = str(fields.get("name") or next(iter(known_assets)))
        asset = known_assets[name]
        usual = {"library": library, "name": name, "class_name": asset.class_name, "scale": asset.scale}
        usual["twin_types"] = asset.twin_types
    return usual | {name: value for name, value in fields.items() if value not in (None, "")}


def thing_by_rule(
    geometry: RoadGeometry, kind: str, side: Side, station: float, fields: Mapping[str, Any]
) -> RoadObject:
    """Return one thing more for a road, at a station, where the rules put it, with the instance number 1.

    Args:
        geometry: of the road, with all that stands on it.
        kind: type of the thing in the parameter set.
        side: of the road; the other one if the road has no carriageway there.
        station: m; of its beginning, if it runs along the road.
        fields: of the thing where they are to differ from the usual ones and from the rule, such as ``offset``.

    Raises:
        InputError: a field is out of its limits.
    """
    model: type[Thing] = THINGS[kind]
    station = round_value(min(max(station, 0.0), geometry.length))
    place = PlaceByRule(geometry, side, station)
    values = {name: info.default for name, info in model.model_fields.items() if not info.is_required()}
    known = usual_fields(kind, place, fields)
    if kind == "FieldEntrance":
        known = place.entrance_fields(values | known) | known
    offset = known.pop("offset", None)
    known |= {name: value for name, value in place.spans(kind).items() if name not in known}
    if offset is None and kind == "Gantry":
        offset = round_value((known["left_offset"] + known["right_offset"]) / 2.0)
    elif offset is None:
        offset = round_value(place.sign * place.distance(kind, values | known))
    data: dict[str, Any] = {"type": kind, "instance": 1, "offset": offset}
    if issubclass(model, LineObject):
        end = min(station + SHORTEST_BARRIER, geometry.length)
        data |= {"start_station": station, "end_station": round_value(end)}
        if "end_offset" in model.model_fields:
            data["end_offset"] = offset
    else:
        data["station"] = station
        turned = dict.fromkeys(("Building", "BusShelter"), 90.0 * place.sign)
        turned |= dict.fromkeys(("Overpass", "PowerLine", "Gantry", "TrafficIsland"), 0.0)
        # An entrance lies to the right of its direction, on whatever side traffic keeps to.
        turned["FieldEntrance"] = 0.0 if place.sign < 0 else 180.0
        data["rotation_deg"] = turned.get(kind, place.facing)
    return model.from_dict(data | known, kind)
