"""A hand-made road with everything for the checker's tests: RQ 36, lanes from 2.75 m to 13.5 m, pavement to 16.5 m."""

from typing import Any

import numpy as np

from synthroads_addon.road.other_roads.axis import HorizontalElement
from tests.helpers.roads.checker_roads import Data, numbered, rail, swapped

LENGTH = 2000.0
EXIT, ENTRY, BAY = 1100.0, 1500.0, 300.0
DROP = [{"station": 1350.0, "width": 0.0}, {"station": 1500.0, "width": 3.5}]


def full() -> Data:
    """Return a straight road with every kind of object.

    On the right an emergency bay from 300 m, an exit from 1100 m and an entry from 1500 m; on the left, where traffic
    runs against the stations, the inner lane ends from 1500 m to 1350 m and a lane is closed from 1300 m to 900 m.
    """
    objects: Data = {"axis": {"type": "Alignment", "start_x": 0.0, "start_y": 0.0, "start_heading_deg": 0.0}}
    objects["axis"]["horizontal"] = [HorizontalElement.between(LENGTH, 0.0, 0.0).to_dict()]
    objects["axis"]["vertical"] = [{"station": 0.0, "elevation": 0.0}]
    objects["median"] = {"type": "Median"}
    objects["terrain"] = {"type": "Terrain", "half_width": 80.0, "embankment_height": 1.0, "undulation": 0.2}
    objects["terrain"] |= {"wavelength": 40.0, "seed": 1}
    for kind, species, start in (("tree", "birch", 12.0), ("shrub", "hazel", 3.0), ("grass", "meadow", 0.0)):
        objects[kind] = {"type": "Vegetation", "kind": kind, "species": species, "density": 5e-4, "band_start": start}
        objects[kind] |= {"band_end": 60.0, "height_min": 0.2, "height_max": 0.5, "seed": 2}
    for side, inner, crossfall_percent in (("left", DROP, -2.5), ("right", 3.5, 2.5)):
        objects[side] = {"type": "Carriageway", "side": side, "inner_offset": 2.0, "hard_shoulder_width": 2.5}
        objects[side] |= {"outer_edge_strip_width": 0.5, "inner_edge_strip_width": 0.75, "verge_width": 1.5}
        objects[side]["lanes"] = [{"width": 3.75}, {"width": 3.5}, {"width": inner}]
        objects[side]["crossfall"] = [{"station": 0.0, "crossfall_percent": crossfall_percent}]
    objects["right"]["pavement"] = {
        "ruts": [{"lane": 0, "start_station": 500.0, "end_station": 600.0, "depth": 0.01}],
        "potholes": [{"station": 450.0, "offset": -8.0, "length": 0.4, "width": 0.4, "depth": 0.03}],
    }
    for part in (_turnouts(), _lines(), _barriers(), _signs(), _structures(), _posts(), _zone(), _vehicles()):
        objects |= part
    return numbered(objects, "EKA1A")


def right_edge(station: float) -> float:
    """Return the distance of the right carriageway's outer paved edge from the centreline, m."""
    nose = (6.0 * 90.0**2 * 3.5) ** (1.0 / 3.0)

    def beside(w: float, taper: float) -> float:
        x = max(w - taper - 250.0, 0.0)
        lane = 4.0 * min(w / taper, 1.0) + 2.0 * min(x / nose, 1.0)
        return 16.5 - 2.5 * min(w / taper, 1.0) + lane + x**3 / (6.0 * 90.0**2)

    if EXIT <= station <= EXIT + 365.0:
        return beside(station - EXIT, 30.0)
    if ENTRY <= station <= ENTRY + 395.0:
        return beside(ENTRY + 395.0 - station, 60.0)
    return 16.5 + 3.0 * max(min((station - BAY) / 20.0, (BAY + 80.0 - station) / 20.0, 1.0), 0.0)


def _turnouts() -> Data:
    ramp = {"length": 85.0, "clothoid_parameter": 90.0, "lane_width": 4.5, "edge_strip_width": 0.75}
    lane = {"type": "Turnout", "carriageway": "right", "lane_length": 250.0, "lane_width": 3.5}
    bay = {"type": "Turnout", "carriageway": "right", "lane_length": 40.0, "lane_width": 3.0}
    return {
        "exit": lane | {"kind": "exit", "start_station": EXIT, "taper_in_length": 30.0, "ramp": dict(ramp)},
        "entry": lane | {"kind": "entry", "start_station": ENTRY, "taper_out_length": 60.0, "ramp": dict(ramp)},
        "bay": bay | {"kind": "emergency_bay", "start_station": BAY, "taper_in_length": 20.0, "taper_out_length": 20.0},
    }


def line(side: str, kind: str, start: float, end: float, boundary: int = 0, **more: Any) -> Data:
    """Return a line marking of the RMS' width and pattern."""
    width, dash, gap = {"outer_edge": (0.3, 0, 0), "block": (0.3, 6, 6), "lane": (0.15, 6, 12)}.get(kind, (0.15, 0, 0))
    data = {"type": "LineMarking", "carriageway": side, "kind": kind, "boundary": boundary, "width": width}
    data |= {"dash_length": float(dash), "gap_length": float(gap), "start_station": start, "end_station": end}
    return data | more


def _lines() -> Data:
    exit_tip, entry_tip = EXIT + 280.0, ENTRY + 85.0
    lines = {
        "right-0a": line("right", "outer_edge", 0.0, EXIT),
        "right-0b": line("right", "block", EXIT, exit_tip),
        "right-0c": line("right", "outer_edge", exit_tip, entry_tip),
        "right-0d": line("right", "block", entry_tip, ENTRY + 395.0),
        "right-0e": line("right", "outer_edge", ENTRY + 395.0, LENGTH),
        "right-1": line("right", "lane", 0.0, LENGTH, 1),
        "right-2": line("right", "lane", 0.0, LENGTH, 2),
        "right-3": line("right", "inner_edge", 0.0, LENGTH, 3),
        "left-0": line("left", "outer_edge", 0.0, LENGTH),
        "left-1": line("left", "lane", 0.0, LENGTH, 1),
        "left-2": line("left", "lane", 1500.0, LENGTH, 2),
        "left-3": line("left", "inner_edge", 0.0, LENGTH, 3),
        "left-yellow": line("left", "free", 950.0, 1250.0, offset=5.5, color="yellow", width=0.2),
    }
    for name, end, tip in (("exit", EXIT + 365.0, exit_tip), ("entry", ENTRY, entry_tip)):
        whole = (EXIT, end) if name == "exit" else (end, ENTRY + 395.0)
        lines[f"{name}-outside"] = line("right", "turnout_edge", *whole, turnout=name)
        lines[f"{name}-gore"] = line("right", "gore_edge", min(end, tip), max(end, tip), turnout=name)
        lines[f"{name}-hatching"] = {"type": "Hatching", "turnout": name}
    arrow = {"type": "Arrow", "carriageway": "right", "kind": "right", "station": 1300.0, "offset": -15.75}
    return lines | {"arrow": arrow}


def wall(start: float, end: float, offset: float) -> Data:
    """Return a concrete barrier."""
    return {"type": "ConcreteBarrier", "start_station": start, "end_station": end, "offset": offset}


def _barriers() -> Data:
    noise = {"type": "NoiseBarrier", "start_station": 100.0, "end_station": 400.0, "offset": 16.0}
    return {
        "rail-median": rail(0.0, 1000.0, 0.0, "both"),
        "wall-median": wall(1000.0, 1880.0, 0.0),
        "rail-pier-left": rail(1880.0, LENGTH, 0.75, "left"),
        "rail-pier-right": rail(1880.0, LENGTH, -0.75, "right"),
        "rail-gantry": rail(630.0, 720.0, -1.3, "right"),
        "rail-right": rail(400.0, 1090.0, -17.2, "left"),
        "rail-left": rail(80.0, 470.0, 13.7, "right"),
        "noise": noise,
    }


def sign(code: str, station: float, offset: float, width: float = 0.4, **more: Any) -> Data:
    """Return a sign that faces traffic with the stations."""
    data = {"type": "TrafficSign", "code": code, "shape": "rectangle", "station": station, "offset": offset}
    return data | {"width": width, "height": 1.0} | more


def _signs() -> Data:
    low = {"lower_edge": 0.5}
    return {
        "sign-448": sign("448", 100.0, -19.0, 2.5, posts=2),
        "sign-449": sign("449", 600.0, -19.5, 3.0, posts=2),
        "sign-52": sign("450-52", 800.0, -18.5, **low),
        "sign-51": sign("450-51", 900.0, -18.5, **low),
        "sign-50": sign("450-50", 1000.0, -18.5, **low),
        "sign-333": sign("333", 1455.0, -19.6, 2.0, shape="arrow"),
        "sign-274": sign("274-120", 700.0, 14.5, 0.75, shape="round", rotation_deg=180.0),
    }


def _structures() -> Data:
    hung = [{"offset": -5.0, "width": 3.0, "height": 2.0}]
    gantry = {"type": "Gantry", "kind": "one_sided", "station": 700.0, "offset": -9.4, "left_offset": -0.8}
    overpass = {"type": "Overpass", "station": 1950.0, "offset": 0.0, "left_abutment": 30.0, "right_abutment": -30.0}
    return {
        "gantry": gantry | {"right_offset": -18.0, "signs": hung},
        "overpass": overpass,
        "pole": {"type": "Pole", "station": 500.0, "offset": -18.5},
        "light": {"type": "TrafficLight", "station": 1560.0, "offset": -21.0},
        "asset": {"type": "Asset", "station": 1200.0, "offset": -40.0, "library": "a.json", "name": "hut"}
        | {"class_name": "utility"},
        "phone-right": cabinet("emergency_phone", 1050.0, -18.0),
        "phone-left": cabinet("emergency_phone", 610.0, 14.5, rotation_deg=180.0),
        "cabinet": cabinet("utility", 720.0, 16.0),
    }


def cabinet(kind: str, station: float, offset: float, **more: Any) -> Data:
    """Return a cabinet or an emergency phone."""
    return {"type": "Cabinet", "kind": kind, "station": station, "offset": offset} | more


def _posts() -> Data:
    posts = {}
    for i, station in enumerate(np.arange(25.0, LENGTH, 50.0).tolist()):
        right = right_edge(station) + (1.15 if 400.0 < station < 1090.0 else 0.5)
        left = 17.0 if station > 1350.0 else 14.15 if 80.0 < station < 470.0 else 13.5
        posts[f"right-post-{i}"] = {"type": "Delineator", "station": station, "offset": -right}
        posts[f"left-post-{i}"] = {"type": "Delineator", "station": station, "offset": left, "rotation_deg": 180.0}
    for i, station in enumerate((250.0, 750.0, 1250.0, 1750.0)):
        board = {"type": "KilometreBoard", "station": station, "text": f"{12.0 + i / 2}"}
        behind_rail = 1.5 if station == 750.0 else 1.0
        posts[f"right-km-{i}"] = board | {"offset": -(right_edge(station) + behind_rail)}
        posts[f"left-km-{i}"] = board | {"offset": 18.0 if station > 1350.0 else 14.5, "rotation_deg": 180.0}
    return posts


def _zone() -> Data:
    """Return a construction zone on the left: beacons from the outer lane's outer edge to its inner one and back."""
    tapers = (
        [(1300.0 - 9.0 * i, 9.8 - 0.45 * i) for i in range(8)],
        [(900.0 + 9.0 * i, 9.8 - 0.45 * i) for i in range(8)],
    )
    along = [(1237.0 - 18.0 * i + 18.0, 6.65) for i in range(2, 17)]
    places = [*tapers[0], *along, *reversed(tapers[1])]
    beacon = {"type": "ConstructionBeacon", "pass_side": "right"}
    objects = {f"beacon-{i}": beacon | {"station": s, "offset": d} for i, (s, d) in enumerate(places)}
    barrier = {
        "type": "TemporaryBarrier",
        "start_station": 1000.0,
        "end_station": 1200.0,
        "offset": 7.2,
        "end_offset": 7.0,
    }
    return objects | {"closure": barrier}


def vehicle(side: str, model: str, lane: int, station: float) -> Data:
    """Return a vehicle at the time 0."""
    return {"type": "Vehicle", "carriageway": side, "model": model, "lane": lane, "station": station, "speed": 25.0}


def _vehicles() -> Data:
    return {
        "car": vehicle("right", "car", 0, 200.0),
        "truck": vehicle("right", "semitrailer", 0, 240.0),
        "bus": vehicle("left", "bus", 1, 700.0),
        "last": vehicle("left", "car", 2, 1700.0),
    }


def turned(data: Data) -> Data:
    """Return a straight road seen from its other end: stations, sides and directions change, nothing else."""
    result = swapped(data)
    for item in result["objects"].values():
        _turn(item)
        if item["type"] == "Turnout":
            own = item.get("taper_in_length", 0.0) + item["lane_length"] + item.get("taper_out_length", 0.0)
            item["start_station"] -= own + item.get("ramp", {"length": 0.0})["length"]
        elif "start_station" in item:
            item["start_station"], item["end_station"] = item["end_station"], item["start_station"]
        if "end_offset" in item:
            item["offset"], item["end_offset"] = item["end_offset"], item["offset"]
        if "rotation_deg" in item or item["type"] in ("TrafficSign", "KilometreBoard", "TrafficLight", "Arrow"):
            item["rotation_deg"] = item.get("rotation_deg", 0.0) - 180.0
        for rut in item.get("pavement", {}).get("ruts", ()):
            rut["start_station"], rut["end_station"] = rut["end_station"], rut["start_station"]
    return result


def _turn(data: Any) -> None:
    """Turn the numbers of an object in place."""
    if isinstance(data, list):
        if data and isinstance(data[0], dict) and "width" in data[0] and "station" in data[0] and len(data[0]) == 2:
            data.reverse()
        for item in data:
            _turn(item)
    elif isinstance(data, dict):
        free = data.get("kind") == "free"  # whose offset is a distance from the centreline
        for key, value in data.items():
            if key.endswith("station"):
                data[key] = LENGTH - value
            elif isinstance(value, float) and key in (
                "offset",
                "end_offset",
                "left_offset",
                "right_offset",
                "left_abutment",
                "right_abutment",
            ):
                data[key] = value if free else -value
            elif key == "pier_offsets":
                data[key] = [-offset for offset in value]
            elif key == "crossfall_percent":
                data[key] = -value
            else:
                _turn(value)
