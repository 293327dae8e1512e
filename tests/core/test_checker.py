"""The checker: a road that keeps every rule, one planted violation per rule, the command, speed, and odd input."""

import ast
import copy
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from headless.cli import command
from synthroads_addon.core.errors import InputError
from synthroads_addon.core.parameters import checker_alignment, checker_furniture, checker_section
from synthroads_addon.core.parameters.checker import RULES, check
from synthroads_addon.core.parameters.limits import LIMITS
from synthroads_addon.core.parameters.model import HorizontalElement, RoadParameters
from synthroads_addon.core.parameters.sampler import sample_road
from synthroads_addon.core.scenario import load_scenario

Data = dict[str, Any]
Elements = list[tuple[float, float, float]]
DOCS = Path(__file__).parents[2] / "docs" / "rules.md"

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
    objects["trees"] = {"type": "Vegetation", "kind": "tree", "density": 0.01, "band_start": 12.0, "band_end": 60.0}
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
    for number, item in enumerate(objects.values()):
        item["instance"] = number + 1
    metadata = {"identifier": "hand-made", "seed": 0, "generator": "a hand"}
    metadata["referenceSystem"] = "https://www.opengis.net/def/crs/EPSG/0/25832"
    head = {"type": "RoadParameters", "version": "1.0", "metadata": metadata, "design_class": design_class}
    return head | {"transform": {"translate": [294000.0, 5628000.0, 180.0]}, "objects": objects}


def rail(start: float, end: float, offset: float, faces: str) -> Data:
    return {"type": "Guardrail", "start_station": start, "end_station": end, "offset": offset, "faces": faces}


def good() -> Data:
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


PLANTED = [
    Planted("element-length", without_length, "axis", 1400, 0, 0),
    Planted("radius-minimum", lambda: road(curve(800, 400)), "axis", 500, 800, 900, INSIDE),
    Planted(
        "radius-minimum", lambda: road([(300, 0, 0), (200, 0, 1 / 800)]), "axis", 500, 800, 900, frozenset()
    ),  # a clothoid that the road's end cuts
    Planted("clothoid-minimum", lambda: road(curve(470, 158), "EKA2"), "axis", 300, 158, 160, TIGHT, 2),
    Planted("clothoid-short", lambda: road(curve(1500, 400)), "axis", 300, 400, 500, INSIDE, 2),
    Planted("clothoid-long", lambda: road(curve(1000, 1100)), "axis", 300, 1100, 1000, INSIDE, 2),
    Planted(
        "clothoid-long",
        lambda: road(EGG[:3] + [(500, 1 / 900, 1 / 1800), EGG[4]]),
        "axis",
        825,
        math.sqrt(900000),
        900,
        INSIDE | {"radius-ratio"},
    ),
    Planted("curvature-jump", lambda: road([CURVE[0], CURVE[2]]), "axis", 300, 0.001, 0, INSIDE),
    Planted("straight-longest", lambda: road([(1200, 0, 0), (1000, 0, 0)]), "axis", 0, 2200, 2000),
    Planted("straight-between", lambda: road(SAME_WAY), "axis", 1100, 200, 400, INSIDE),
    Planted("radius-ratio", lambda: road(S_CURVE), "axis", 1406.25, 1.6, 1.5, INSIDE),
    Planted("radius-ratio", lambda: road(EGG), "axis", 950, 2.0, 1.5, INSIDE | {"clothoid-short"}),
    Planted("arc-length", lambda: road(curve(1000, 500, arc=50)), "axis", 550, 50, 72.2222, INSIDE),
    Planted("arc-length", lambda: road([CURVE[1], CURVE[3]]), "axis", 250, 0, 72.2222),
    Planted("vertical-order", lambda: profile((0, 0, 0), (900, 9, 0), (800, 9, 0)), "axis", 800, 800, 900),
    Planted("grade-maximum", lambda: profile((0, 0, 0), (700, 14, 9000), (1400, 49, 0)), "axis", 835, 5, 4),
    Planted("crest-radius", lambda: profile((0, 0, 0), (700, 7, 12000), (1400, 0, 0)), "axis", 700, 12000, 13000),
    Planted("sag-radius", lambda: profile((0, 0, 0), (700, -7, 0), (1400, 0, 0)), "axis", 700, 0, 8800),
    Planted(
        "rounding-overlap",
        lambda: profile((0, 0, 0), (600, 6, 15000), (800, 4, 15000), (1400, 10, 0)),
        "axis",
        650,
        300,
        200,
    ),
    Planted("crossfall-order", lambda: crossfall(*RIGHT_OF_CURVE, (700, -6.0)), "right", 700, 700, 1100),
    Planted("crossfall-least", lambda: crossfall((0, 2.0), of=road(STRAIGHT)), "right", 0, 2.0, 2.5),
    Planted("crossfall-largest", lambda: crossfall((0, 6.5), of=road(STRAIGHT)), "right", 0, 6.5, 6),
    Planted("crossfall-inside", lambda: crossfall(*((s, max(q, -4.0)) for s, q in RIGHT_OF_CURVE)), "right", 550, 4, 6),
    Planted(
        "run-off-steepest", lambda: crossfall((300, 2.5), (330, -2.5), *RIGHT_OF_CURVE[2:]), "right", 300, 1.0, 0.9
    ),
    Planted("run-off-least", lambda: crossfall((300, 2.5), (360, -2.5), *RIGHT_OF_CURVE[2:]), "right", 300, 0.5, 0.6),
    Planted("run-off-place", lambda: crossfall((280, 2.5), (320, -2.5), *RIGHT_OF_CURVE[2:]), "right", 280, 20, 1),
    Planted("lane-width", lambda: changed(("left/lanes/1/width", 3.25)), "left", 0, 3.25, 3.5),
    Planted(
        "median-width", lambda: changed(("left/inner_offset", 1.0), ("right/inner_offset", 1.0)), "median", 0, 2.0, 2.5
    ),
    Planted("marking-missing", lambda: changed(("left-line-1", None)), "left", 0, 0, 1),
    Planted("marking-coverage", lambda: changed(("left-line-1/end_station", 1200.0)), "left-line-1", 1200, 200, 0),
    Planted("marking-width", lambda: changed(("left-line-0/width", 0.15)), "left-line-0", 0, 0.15, 0.3),
    Planted("marking-pattern", lambda: changed(("left-line-1/gap_length", 9.0)), "left-line-1", 0, 9, 12),
    Planted("median-guardrail", lambda: changed(("rail-median/faces", "left")), "right", 0, 1400, 0),
    Planted("median-guardrail", lambda: changed(("rail-median/end_station", 1000.0)), "left", 1000, 400, 0, times=2),
    Planted("embankment-guardrail", lambda: changed(("rail-left/start_station", 90.0)), "left", 0, 90, 0),
    Planted("embankment-guardrail", lambda: changed(("rail-right/faces", "right")), "right", 0, 1400, 0),
    Planted("guardrail-distance", lambda: changed(("rail-left/offset", 14.5)), "rail-left", 0, 0.3, 0.5),
    Planted(
        "guardrail-length",
        lambda: changed(("extra", rail(100.0, 150.0, 16.0, "right") | {"instance": 999})),
        "extra",
        100,
        50,
        60,
    ),
    Planted("delineator-missing", lambda: changed(("left-post-0", None)), "left", 0, 75, 25),
    Planted("delineator-spacing", lambda: changed(("left-post-5", None)), "left", 225, 100, 50),
    Planted("delineator-spacing", lambda: changed(("left-post-27", None)), "left", 1325, 75, 50),
    Planted(
        "delineator-spacing",
        lambda: changed(of=road([(600, 1 / 450, 1 / 450)], "EKA3")),
        "left",
        25,
        50,
        35,
        INSIDE | {"delineator-missing"},
        22,
    ),
    Planted("delineator-distance", lambda: changed(("left-post-5/offset", 14.3)), "left-post-5", 275, 0.3, 0.5),
    Planted("object-range", lambda: changed(("left-line-0/end_station", 1500.0)), "left-line-0", 1500, 1500, 1400),
    Planted("object-on-pavement", lambda: changed(("left-post-5/offset", 13.0)), "left-post-5", 275, -1.0, 0),
    Planted("object-on-pavement", lambda: changed(("trees/band_start", -3.0)), "trees", 0, -1.5, 0),
    Planted(
        "tree-distance",
        lambda: changed(
            ("trees/band_start", 9.0), ("rail-left/start_station", 100.0), ("terrain/embankment_height", 1.0)
        ),
        "trees",
        0,
        10.5,
        12,
    ),
]


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_a_planted_violation_is_found(case: Planted) -> None:
    made = case.make()
    violations = check(made if isinstance(made, RoadParameters) else RoadParameters.from_dict(made))
    found = [v for v in violations if v.rule == case.rule]
    assert len(found) == case.times
    first = found[0]
    assert (first.object, first.unit) == (case.object, RULES[case.rule].unit)
    assert first.station == pytest.approx(case.station, abs=1.0)
    assert first.value == pytest.approx(case.value, abs=1e-4)
    assert first.limit == pytest.approx(case.limit, abs=1e-4)
    assert {v.rule for v in violations} - {case.rule} <= case.also
    assert first.text.endswith(".")
    assert RULES[case.rule].source in first.text


def test_every_rule_has_a_planted_violation() -> None:
    assert {case.rule for case in PLANTED} == set(RULES)
    modules = (checker_alignment, checker_section, checker_furniture)
    assert len(RULES) == sum(len(module.RULES) for module in modules)


def test_the_docs_list_every_rule() -> None:
    text = DOCS.read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `")}
    assert set(rows) == set(RULES)
    for name, rule in RULES.items():
        assert rule.sure in rows[name], name


def test_a_good_road_passes() -> None:
    assert check(RoadParameters.from_dict(good())) == []


def test_what_is_exactly_at_a_limit_passes() -> None:
    assert {v.rule for v in check(RoadParameters.from_dict(road(curve(900, 300))))} == INSIDE
    assert check(RoadParameters.from_dict(road([(2000, 0, 0)]))) == []
    assert check(RoadParameters.from_dict(profile((0, 0, 0), (700, 7, 13000), (1400, 0, 0)))) == []
    assert check(RoadParameters.from_dict(profile((0, 0, 0), (1400, 56, 0)))) == []
    steepest = crossfall((300, 2.5), (300 + 5 * 6 / 0.9, -2.5), *RIGHT_OF_CURVE[2:])
    assert check(RoadParameters.from_dict(steepest)) == []
    least = crossfall((300, 2.5), (350, -2.5), *RIGHT_OF_CURVE[2:])
    assert check(RoadParameters.from_dict(least)) == []


@pytest.mark.parametrize(("run_off", "rule"), [(45, "run-off-steepest"), (50, None), (55, "run-off-least")])
def test_where_least_and_largest_run_off_conflict_the_least_wins(run_off: float, rule: str | None) -> None:
    """About its inner edge the carriageway reaches 12 m: at least 1.2 % below 2.5 % crossfall, at most 0.9 % beyond."""
    data = crossfall((300, 2.5), (300 + run_off, -2.5), *RIGHT_OF_CURVE[2:4], (850, -6.0), (1050, -2.5), (1100, 2.5))
    data["objects"]["right"]["rotation_axis"] = "inner_edge"
    found = check(RoadParameters.from_dict(data))
    assert [(v.rule, v.limit) for v in found] == ([(rule, pytest.approx(1.2))] if rule else [])
    data["objects"]["right"]["crossfall"][-2]["station"] = 870.0  # from -6 to -2.5 % in 20 m: 2.1 %
    beyond = [v for v in check(RoadParameters.from_dict(data)) if v.station == 850.0]
    assert [(v.rule, v.limit) for v in beyond] == [("run-off-steepest", pytest.approx(0.9))]


def test_a_narrow_carriageway_runs_off_by_its_width() -> None:
    """3 m from the axis to the edge: 0.675 % at most."""
    data = changed(("right/lanes", [{"width": 3.5}]), ("right/hard_shoulder_width", 1.0))
    data = changed(*((f"right-line-{i}", None) for i in (1, 2)), of=data)
    limits = {v.rule: v.limit for v in check(RoadParameters.from_dict(crossfall((300, 2.5), (320, -2.5), of=data)))}
    assert limits["run-off-steepest"] == pytest.approx(0.675)


def mirrored(data: Data) -> Data:
    """Return the road with left and right swapped."""
    text = json.dumps(data, sort_keys=True)
    for word, other in (("left", "RIGHT"), ("right", "left"), ("RIGHT", "right")):
        text = text.replace(word, other)
    result = json.loads(text)
    for item in result["objects"].values():
        if "offset" in item:
            item["offset"] = -item["offset"]
        for point in item.get("crossfall", ()):
            point["crossfall_percent"] *= -1.0
        for element in item.get("horizontal", ()):
            element["curvature_start"] *= -1.0
            element["curvature_end"] *= -1.0
    return result


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_the_mirrored_road_breaks_the_same_rules(case: Planted) -> None:
    made = case.make()
    if not isinstance(made, RoadParameters):
        found, other = (check(RoadParameters.from_dict(data)) for data in (made, mirrored(made)))
        assert sorted((v.rule, v.station, v.limit) for v in found) == sorted(
            (v.rule, v.station, v.limit) for v in other
        )


def test_curves_so_wide_that_the_crossfall_may_fall_outwards() -> None:
    for design_class, limits in LIMITS.items():
        elements = [(600, 1 / limits.radius_outwards, 1 / limits.radius_outwards)]
        assert check(RoadParameters.from_dict(road(elements, design_class))) == []
        elements = [(600, 1.01 / limits.radius_outwards, 1.01 / limits.radius_outwards)]
        assert {v.rule for v in check(RoadParameters.from_dict(road(elements, design_class)))} == INSIDE


def test_a_vertex_of_two_clothoids_and_a_hidden_jump_are_found() -> None:
    """A clothoid of a millimetre is no transition; a line cut in two is one straight, an arc cut in two one arc."""
    sliver = [(300, 0, 0), (0.001, 0, 0.001), (300, 0.001, 0.001)]
    assert "clothoid-minimum" in {v.rule for v in check(RoadParameters.from_dict(road(sliver)))}
    halves = [*curve(1000, 500, arc=40)[:3], *curve(1000, 500, arc=40)[2:]]
    assert {v.rule for v in check(RoadParameters.from_dict(road(halves)))} == INSIDE


def test_roads_without_furniture_and_with_one_carriageway() -> None:
    data = good()
    kinds = {"Guardrail", "Delineator", "Terrain", "Vegetation", "Median"}
    data["objects"] = {name: item for name, item in data["objects"].items() if item["type"] not in kinds}
    assert {v.rule for v in check(RoadParameters.from_dict(data))} == {"median-guardrail", "delineator-missing"}
    data["objects"] = {name: item for name, item in data["objects"].items() if not name.startswith("left")}
    assert [v.rule for v in check(RoadParameters.from_dict(data))] == ["delineator-missing"]


def test_the_checker_knows_nothing_of_the_sampler() -> None:
    """It shares the table of limits (and the model of the set) with the sampler, nothing else."""
    folder = Path(checker_section.__file__).parent
    own = {path.stem for path in folder.glob("checker*.py")} | {"limits", "model"}
    for path in folder.glob("checker*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level:
                assert {node.module or name.name for name in node.names} <= own


NUMBERS = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from(
    [0.0, -0.0, 5e-324, 1e-300, 1e-9, 0.001, -0.1, 0.1, 1.0, 2.5, -2.5, 600.0, 1e8, 1.7e308, -1.7e308]
)


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of all numbers with a point."""
    if isinstance(data, dict | list):
        pairs = data.items() if isinstance(data, dict) else enumerate(data)
        return [found for key, value in pairs for found in places(value, (*path, key))]
    return [path] if isinstance(data, float) else []


@given(st.integers(0, 2), st.lists(st.tuples(st.integers(0, 10**6), NUMBERS), min_size=1, max_size=12))
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
def test_no_valid_set_makes_it_fail(which: int, changes: list[tuple[int, float]]) -> None:
    data = copy.deepcopy((good(), road(EGG), road(S_CURVE, "EKA3"))[which])
    spots = places(data["objects"])
    valid = 0
    for pick, value in changes:
        path = spots[pick % len(spots)]
        target = data["objects"]
        for part in path[:-1]:
            target = target[part]
        before, target[path[-1]] = target[path[-1]], value
        try:
            parameters = RoadParameters.from_dict(data)
            valid += 1
        except InputError:
            target[path[-1]] = before
    assume(valid)
    parameters = RoadParameters.from_dict(data)
    for violation in check(parameters):
        assert all(map(math.isfinite, (violation.station, violation.value, violation.limit)))
        assert violation.object in parameters.objects


def test_two_hundred_roads_a_second() -> None:
    parameters = sample_road(load_scenario("rq31-600m").road, 1)
    seconds = []
    for _ in range(5):
        start = time.process_time()
        for _ in range(20):
            check(parameters)
        seconds.append((time.process_time() - start) / 20)
    print(f"{1 / min(seconds):.0f} checks per second")
    assert min(seconds) < 1 / 200


# --- the command --------------------------------------------------------------------------------------------------


def run(path: Path, *flags: str) -> int:
    return command("check", [str(path), *flags])


def test_command_on_a_good_road(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "good.json"
    path.write_text(RoadParameters.from_dict(good()).to_json(), encoding="utf-8")
    assert run(path) == 0
    assert capsys.readouterr().out == "no violations\n"
    assert run(path, "--json") == 0
    assert json.loads(capsys.readouterr().out) == {"violations": []}


def test_command_lists_violations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(changed(("left-post-5", None), ("left/lanes/1/width", 3.25))), encoding="utf-8")
    assert run(path) == 3
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["rule", "object", "station", "value", "limit"]
    assert lines[1].split()[:8] == ["lane-width", "left", "0.0", "m", "3.25", "m", "3.5", "m"]
    assert lines[2].split()[:8] == ["delineator-spacing", "left", "225.0", "m", "100", "m", "50", "m"]
    assert lines[-1] == "2 violations"
    assert run(path, "--json") == 3
    violations = json.loads(capsys.readouterr().out)["violations"]
    assert [v["rule"] for v in violations] == ["lane-width", "delineator-spacing"]
    assert set(violations[0]) == {"rule", "object", "station", "value", "limit", "unit", "text"}
    assert run(path, "--quiet") == 3
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("text", [None, "{", "[]", '{"type": "Scenario"}', '{"type": "RoadParameters"}'])
def test_command_on_a_bad_file(text: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "file.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    assert run(path, "--json") == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: ")
    assert shown.err.count("\n") == 1
