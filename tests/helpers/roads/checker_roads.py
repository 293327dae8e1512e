"""Hand-made roads for the checker's tests: good ones, and what changes, mirrors and turns them."""

import copy
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from synthroads_addon.checking.checker import RULES, Violation, check
from synthroads_addon.road.other_roads.axis import HorizontalElement
from synthroads_addon.road.parameters import RoadParameters

Data = dict[str, Any]
Elements = list[tuple[float, float, float]]

# RQ 31: the median is 4 m wide, the pavement reaches from 2 m to 14 m, so that its edge is 6 m from its axis.
CURVE = [(300, 0, 0), (250, 0, 1 / 1000), (300, 1 / 1000, 1 / 1000), (250, 1 / 1000, 0), (300, 0, 0)]
LEFT_OF_CURVE = [(300, -2.5), (550, -6.0), (850, -6.0), (1100, -2.5)]
RIGHT_OF_CURVE = [(300, 2.5), (340, -2.5), (550, -6.0), (850, -6.0), (1060, -2.5), (1100, 2.5)]


def road(elements: Elements, design_class: str = "EKA1A", left: Any = ((0, -2.5),), right: Any = ((0, 2.5),)) -> Data:
    """Return the data of a level RQ 31 on an embankment with all its furniture."""
    length = float(sum(e[0] for e in elements))
    objects: Data = {"axis": {"type": "Alignment", "start_x": 0.0, "start_y": 0.0, "start_heading_deg": 30.0}}
    objects["axis"]["horizontal"] = [HorizontalElement.between(*map(float, e)).to_dict() for e in elements]
    objects["axis"]["vertical"] = [{"station": 0.0, "elevation": 0.0}]
    objects["median"] = {"type": "Median"}
    objects["terrain"] = {"type": "Terrain", "half_width": 80.0, "embankment_height": 4.0, "undulation": 0.2}
    objects["terrain"] |= {"wavelength": 40.0, "seed": 1}
    objects["trees"] = {
        "type": "Vegetation",
        "kind": "tree",
        "species": "birch",
        "density": 0.01,
        "band_start": 12.0,
        "band_end": 60.0,
    }
    objects["trees"] |= {"height_min": 5.0, "height_max": 9.0, "seed": 2}
    objects["rail-median"] = rail(0.0, length, 0.0, "both")
    for side, sign, faces, crossfall in (("left", 1, "right", left), ("right", -1, "left", right)):
        carriageway = {"type": "Carriageway", "side": side, "inner_offset": 2.0, "hard_shoulder_width": 3.0}
        carriageway |= {"outer_edge_strip_width": 0.75, "inner_edge_strip_width": 0.75, "verge_width": 1.5}
        carriageway["lanes"] = [{"width": 3.75}, {"width": 3.75}]
        carriageway["crossfall"] = [{"station": float(s), "crossfall_percent": q} for s, q in crossfall]
        objects[side] = carriageway
        for i, (kind, width, dash) in enumerate((("outer_edge", 0.3, 0), ("lane", 0.15, 6), ("inner_edge", 0.15, 0))):
            line = {"type": "LineMarking", "carriageway": side, "kind": kind, "boundary": i, "width": width}
            line |= {"dash_length": float(dash), "gap_length": 2.0 * dash}
            objects[f"{side}-line-{i}"] = line | {"start_station": 0.0, "end_station": length}
        objects[f"rail-{side}"] = rail(0.0, length, sign * 14.7, faces)
        for i, station in enumerate(np.arange(25.0, length, 50.0).tolist()):
            objects[f"{side}-post-{i}"] = {"type": "Delineator", "station": station, "offset": sign * 15.15}
    return numbered(objects, design_class)


def numbered(objects: Data, design_class: str) -> Data:
    """Return the set of some objects, which get their instance numbers."""
    for number, item in enumerate(objects.values()):
        item["instance"] = number + 1
    metadata = {"identifier": "hand-made", "seed": 0, "generator": "a hand"}
    metadata["referenceSystem"] = "https://www.opengis.net/def/crs/EPSG/0/25832"
    head = {"type": "RoadParameters", "version": "1.0", "metadata": metadata, "design_class": design_class}
    return head | {"transform": {"translate": [294000.0, 5628000.0, 180.0]}, "objects": objects}


def rail(start: float, end: float, offset: float, faces: str) -> Data:
    return {"type": "Guardrail", "start_station": start, "end_station": end, "offset": offset, "faces": faces}


def good() -> Data:
    """Return a road with a curve, a crest and no more than barriers and delineators."""
    data = road(CURVE, left=LEFT_OF_CURVE, right=RIGHT_OF_CURVE)
    points = [{"station": s, "elevation": z, "radius": h} for s, z, h in ((0.0, 0.0, 0.0), (700.0, 7.0, 15000.0))]
    data["objects"]["axis"]["vertical"] = [*points, {"station": 1400.0, "elevation": 0.0}]
    return data


def changed(*changes: tuple[str, Any], of: Data | None = None) -> Data:
    """Return a road (the good one) with values replaced by path below ``objects``; None removes."""
    data = copy.deepcopy(of) if of else good()
    for path, value in changes:
        *parents, last = path.split("/")
        target = data["objects"]
        for part in parents:
            target = target[int(part)] if isinstance(target, list) else target[part]
        if value is None:
            del target[last]
        else:
            target[int(last) if isinstance(target, list) else last] = value
    return data


def profile(*points: tuple[float, float, float]) -> Data:
    return changed(("axis/vertical", [{"station": s, "elevation": z, "radius": h} for s, z, h in points]))


def crossfall(*points: tuple[float, float], of: Data | None = None) -> Data:
    data = [{"station": float(s), "crossfall_percent": q} for s, q in points]
    return changed(("right/crossfall", data), of=of)


def curve(radius: float, parameter: float, arc: float = 300.0) -> Elements:
    """Return straight, clothoid, arc, clothoid, straight."""
    transition, k = parameter**2 / abs(radius), 1.0 / radius
    return [(300, 0, 0), (transition, 0, k), (arc, k, k), (transition, k, 0), (300, 0, 0)]


def without_length() -> RoadParameters:
    """Return a road with an element of length 0, which no file can hold but Python can make."""
    parameters = RoadParameters.from_dict(good())
    axis = parameters.alignment
    zero = axis.horizontal[0].model_copy(update={"length": 0.0})
    axis = axis.model_copy(update={"horizontal": (*axis.horizontal, zero)})
    return parameters.model_copy(update={"objects": {**parameters.objects, "axis": axis}})


STRAIGHT = [(600, 0, 0)]
S_CURVE = [*curve(1000, 500)[:4], *curve(-1600, 700)[1:]]
SAME_WAY = [*curve(1000, 500)[:4], (200, 0, 0), *curve(1000, 500)[1:]]
EGG = [*curve(900, 450)[:3], (125, 1 / 900, 1 / 1800), (300, 1 / 1800, 1 / 1800)]
INSIDE = frozenset({"crossfall-inside"})  # roads made by `road` keep the straight's crossfall in curves
TIGHT = INSIDE | {"delineator-spacing"}  # and its delineators stand every 50 m


# --- other roads of these --------------------------------------------------------------------------------------------


def mirrored(data: Data) -> Data:
    """Return the road with left and right swapped; traffic then drives on the left, which few rules look at."""
    result = swapped(data)
    for item in result["objects"].values():
        if "offset" in item:
            item["offset"] = -item["offset"]
        for point in item.get("crossfall", ()):
            point["crossfall_percent"] *= -1.0
        for element in item.get("horizontal", ()):
            element["curvature_start"] *= -1.0
            element["curvature_end"] *= -1.0
    return result


def swapped(data: Data) -> Data:
    """Return the data with the words left and right swapped wherever they stand."""
    text = json.dumps(data, sort_keys=True)
    for word, other in (("left", "RIGHT"), ("right", "left"), ("RIGHT", "right")):
        text = text.replace(word, other)
    result: Data = json.loads(text)
    return result


# --- planted violations ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Planted:
    """A road with one planted violation, and the rules that it cannot but break as well."""

    rule: str
    make: Callable[[], Any]
    object: str
    station: float
    value: float
    limit: float
    also: frozenset[str] = field(default=frozenset())
    times: int = 1


def checked(made: Data | RoadParameters) -> list[Violation]:
    """Return the violations of a road, or of its data."""
    return check(made if isinstance(made, RoadParameters) else RoadParameters.from_dict(made))


def assert_found(case: Planted) -> None:
    """Check that a planted violation is found where it is, with value and limit, and nothing else."""
    violations = checked(case.make())
    found = [v for v in violations if v.rule == case.rule]
    assert len(found) == case.times, violations
    first = found[0]
    assert (first.object, first.unit) == (case.object, RULES[case.rule].unit)
    assert first.station == pytest.approx(case.station, abs=1.0)
    assert first.value == pytest.approx(case.value, abs=1e-4)
    assert first.limit == pytest.approx(case.limit, abs=1e-4)
    assert {v.rule for v in violations} - {case.rule} <= case.also, violations
    assert first.text.endswith(".")
    assert RULES[case.rule].source in first.text


def rules_of(*modules: ModuleType) -> set[str]:
    """Return the ids of the rules of some modules of the checker."""
    return {rule.id for module in modules for rule in module.RULES}
