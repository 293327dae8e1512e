"""Parameter sets: bytes, schema, faults; the sampler's roads; the analytic surface and where it is sampled."""

import json
from itertools import pairwise

import jsonschema
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import PRESETS
from synthroads_addon.base.schema import read_json
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import (
    DUAL_CLASSES,
    DUAL_CROSS_SECTIONS,
    LIMITS,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    curve_crossfall_percent,
    design_class_of,
)
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters, parameters_schema, read_parameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.tessellation import sample_stations
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.sampling.road import sample_alignment, sample_road
from synthroads_addon.scenario.scenario import RoadScenario, load_scenario
from tests.helpers.files.mutations import cases

CURVE = AlignmentObject(
    instance=1,
    start_x=-250.0,
    start_y=60.0,
    start_heading_deg=-10.0,
    horizontal=(
        HorizontalElement.between(100.0, 0.0, 0.0),
        HorizontalElement.between(150.0, 0.0, 1 / 1000),
        HorizontalElement.between(150.0, 1 / 1000, 1 / 1000),
        HorizontalElement.between(150.0, 1 / 1000, 0.0),
        HorizontalElement.between(50.0, 0.0, 0.0),
    ),
    vertical=(
        VerticalPoint(station=0.0, elevation=0.0),
        VerticalPoint(station=300.0, elevation=6.0, radius=13_000.0),
        VerticalPoint(station=600.0, elevation=3.0),
    ),
)
"""Line, clothoid, arc, clothoid, line over a crest."""

CLASS_OF = {"RQ43.5": "EKA1A", "RQ36": "EKA1A", "RQ31": "EKA1A", "RQ28": "EKA2", "RQ38.5": "EKA3", "RQ31.5": "EKA3"}


def road(seed: int = 1, *changes: str) -> RoadParameters:
    return sample_road(load_scenario("rq31-600m", list(changes)).road, seed)


@pytest.fixture(scope="module")
def data() -> dict:
    return road().to_dict()


def broken(data: dict, path: str, value: object) -> dict:
    copy = json.loads(json.dumps(data))
    *parents, last = path.split("/")
    target = copy
    for part in parents:
        target = target[int(part)] if isinstance(target, list) else target[part]
    target[int(last) if isinstance(target, list) else last] = value
    return copy


def test_the_published_schema_is_that_of_the_code() -> None:
    """`python tools/make_schema.py` writes it."""
    assert read_json(PRESETS / "parameters.schema.json") == parameters_schema()


def test_vendor_keys_are_kept(data: dict) -> None:
    with_keys = broken(data, "objects/alignment/+acme", {"a": [1, None]})
    again = RoadParameters.from_dict(with_keys).to_dict()
    assert again["objects"]["alignment"]["+acme"] == {"a": [1, None]}
    jsonschema.validate(with_keys, parameters_schema())


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        ("objects/alignment/start_x", float("nan"), "objects.alignment.start_x is nan"),
        ("objects/alignment/start_x", float("inf"), "objects.alignment.start_x is inf"),
        ("objects/alignment/horizontal/1/length", -3.0, "horizontal.1.length is -3.0"),
        ("objects/alignment/horizontal/1/length", "3", "horizontal.1.length is '3'"),
        ("objects/alignment/horizontal/0/kind", "clothoid", "contradicts its curvatures"),
        ("objects/carriageway-left/lanes/0/width", -3.75, "carriageway-left.lanes.0.width is -3.75"),
        ("objects/carriageway-left/lanes/0/widht", 3.75, "did you mean 'width'"),
        ("objects/carriageway-left/side", "right", "one Carriageway per side"),
        ("objects/carriageway-left/side", "middle", "side is 'middle'"),
        ("objects/carriageway-left/instance", 1, "same instance number"),
        ("objects/carriageway-left/instance", True, "instance is True"),
        ("objects/guardrail-median/type", "Gardrail", "'Gardrail'"),
        ("objects/carriageway-left-line-0/carriageway", "nowhere", "must name a Carriageway"),
        ("objects/carriageway-left-line-0/boundary", 3, "must name a lane boundary that exists"),
        ("metadata/referenceSystem", "EPSG:25832", "metadata.referenceSystem"),
        ("transform/translate", [1.0, 2.0], "transform.translate"),
        ("objects", [], "objects is []"),
        ("version", "0.9", "version"),
    ],
)
def test_faults_are_named(data: dict, path: str, value: object, named: str) -> None:
    with pytest.raises(InputError) as caught:
        RoadParameters.from_dict(broken(data, path, value))
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unreadable_files_are_named(tmp_path) -> None:
    with pytest.raises(MissingFileError, match=r"none\.json: no such file"):
        read_parameters(tmp_path / "none.json")
    (tmp_path / "cut.json").write_text('{"type": "RoadParameters", ')
    with pytest.raises(InputError, match=r"cut\.json: must be valid JSON"):
        read_parameters(tmp_path / "cut.json")
    (tmp_path / "old.json").write_text('{"type": "RoadParameters", "version": "0.1"}')
    with pytest.raises(InputError, match="this program reads version"):
        read_parameters(tmp_path / "old.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read_parameters(tmp_path / "binary.json")


def test_standard_cross_sections_add_up() -> None:
    for name, section in DUAL_CROSS_SECTIONS.items():
        paved = sum(section.lanes) + section.hard_shoulder + section.outer_edge_strip + section.inner_edge_strip
        assert 2 * (paved + section.verge) + section.median == pytest.approx(float(name[2:]))


@pytest.mark.parametrize("section", list(DUAL_CROSS_SECTIONS))
@pytest.mark.parametrize("length", [600, 5000])
@cases(2, 20)
def test_roads_keep_the_limits_of_their_class(section: str, length: int, count: int) -> None:
    limits = LIMITS[CLASS_OF.get(section, "EKA3")]
    scenario = RoadScenario(design_class=CLASS_OF.get(section, "EKA3"), cross_section=section, length=length)
    for seed in range(count):
        parameters = sample_road(scenario, seed)
        elements = parameters.alignment.horizontal
        assert parameters.alignment.length == pytest.approx(length, abs=1e-6)
        assert all(abs(e.curvature_start) <= 1.0001 / limits.radius for e in elements)
        for element in elements:
            if element.kind == "clothoid":
                tight = 1 / max(abs(element.curvature_start), abs(element.curvature_end))
                a = np.sqrt(element.length / abs(element.curvature_end - element.curvature_start))
                assert a >= max(limits.clothoid, tight / 3) - 1e-3
        for a, b in pairwise(elements):
            assert a.curvature_end == b.curvature_start  # no jump in curvature
        points = parameters.alignment.vertical
        grades = [100 * (b.elevation - a.elevation) / (b.station - a.station) for a, b in pairwise(points)]
        assert max(map(abs, grades)) <= limits.grade_percent + 1e-6
        for (before, after), point in zip(pairwise(grades), points[1:-1], strict=True):
            if abs(after - before) > 1e-6:
                assert point.radius >= (limits.crest if after < before else limits.sag)
        RoadGeometry(parameters)  # refuses roundings that overlap
        for side in ("left", "right"):
            values = [abs(c.crossfall_percent) for c in parameters.carriageway(side).crossfall]
            assert 2.5 <= min(values) <= max(values) <= 6.0


@cases(60, 300)
def test_every_kind_of_joint_occurs_and_both_directions_alike(count: int) -> None:
    chains, turns = set(), []
    for seed in range(count):
        elements = sample_alignment(RoadScenario(length=3000), seed).horizontal
        signs = [np.sign(e.curvature_start + e.curvature_end) for e in elements]
        turns += [sign for sign, e in zip(signs, elements, strict=True) if e.kind == "arc"]
        kinds = "".join(e.kind[0] for e in elements)
        chains |= {kinds[i : i + n] for i in range(len(kinds)) for n in (3, 4)}
    assert {"aca", "acca", "acl", "lca"} <= chains  # egg, S-curve, straights
    assert abs(np.mean(np.array(turns) > 0) - 0.5) <= 0.05 * np.sqrt(300 / count)


def test_the_demo_always_has_a_clothoid() -> None:
    for seed in range(25):
        assert any(e.kind == "clothoid" for e in road(seed).alignment.horizontal)


@cases(10, 100)
def test_long_roads_do_not_spiral(count: int) -> None:
    for design_class, section in (("EKA1A", "RQ31"), ("EKA3", "RQ25")):
        for seed in range(count):
            scenario = RoadScenario(design_class=design_class, cross_section=section, length=5000)
            elements = sample_alignment(scenario, seed).horizontal
            heading = np.cumsum([e.length * (e.curvature_start + e.curvature_end) / 2 for e in elements])
            assert np.ptp(np.append(heading, 0.0)) < np.pi * 1.5


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("road.radius.minimum=100", "road.radius.minimum is 100"),
        ("road.grade_percent.maximum=9", "road.grade_percent"),
    ],
)
def test_limits_that_contradict_each_other_are_named(change: str, named: str) -> None:
    with pytest.raises(InputError, match=named.replace(".", r"\.")):
        road(1, change)


@pytest.mark.parametrize("length", [1, 5, 50, 120, 3000])
def test_short_and_long_roads(length: int) -> None:
    parameters = road(3, f"road.length={length}")
    geometry = RoadGeometry(parameters)
    stations = sample_stations(geometry, 0.005)
    assert stations[0] == 0.0
    assert stations[-1] == pytest.approx(length)
    assert np.all(np.diff(stations) > 0)


def test_curve_crossfall() -> None:
    for name, limits in LIMITS.items():
        largest = 6.0 if name in DUAL_CLASSES else 7.0
        assert curve_crossfall_percent(name, 1 / limits.drawn_radius_least) == largest
        assert curve_crossfall_percent(name, 1 / limits.radius_least_crossfall) == 2.5
        assert curve_crossfall_percent(name, 0.0) == 2.5


# --- the analytic surface -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def geometry() -> RoadGeometry:
    return RoadGeometry(sample_road(load_scenario("rq31-600m").road, 1, axis=CURVE))


def test_strips_follow_the_cross_section(geometry: RoadGeometry) -> None:
    kinds = [strip.kind for strip in geometry.strips]
    half = ["verge", "hard_shoulder", "outer_edge_strip", "lane", "lane", "inner_edge_strip"]
    assert kinds == [*half, "median", *half[::-1]]
    expected = np.cumsum([1.5, 3.0, 0.75, 3.75, 3.75, 0.75, 4.0, 0.75, 3.75, 3.75, 0.75, 3.0, 1.5])
    np.testing.assert_allclose(geometry.offsets(0.0)[0], 15.5 - np.concatenate([[0], expected]))
    assert [geometry.strips[i].kind for i in geometry.strip_index(0.0, [15.5, 0.0, -13.9, -15.5])] == [
        "verge",
        "median",
        "hard_shoulder",
        "verge",
    ]
    assert geometry.strip_index(0.0, [15.6, -15.6]).tolist() == [-1, -1]


def test_heights_on_the_straight_fall_outwards(geometry: RoadGeometry) -> None:
    """2.5 % outwards about the carriageway's axis at 8 m: 0.15 m at the inner edge, -0.15 m at the outer one."""
    station = np.zeros(5)
    relative = geometry.elevation(station, [2.0, 8.0, 14.0, -14.0, 0.0]) - geometry.profile.elevation(0.0)
    np.testing.assert_allclose(relative, [0.15, 0.0, -0.15, -0.15, 0.15], atol=1e-12)
    verge = geometry.elevation([0.0], [15.5])[0] - geometry.elevation([0.0], [14.0])[0]
    assert verge == pytest.approx(-1.5 * 0.08)


def test_the_curve_falls_to_its_inside(geometry: RoadGeometry) -> None:
    arc = geometry.alignment.element_starts[2] + 10.0
    turn = np.sign(geometry.alignment.curvature(arc))
    for inner, outer in ((3.0, 13.0), (-13.0, -3.0)):
        low, high = (outer, inner) if turn > 0 else (inner, outer)
        assert geometry.elevation([arc], [low])[0] < geometry.elevation([arc], [high])[0]


def test_markings_and_dashes(geometry: RoadGeometry) -> None:
    lines = geometry.parameters.of_type(LineMarking)
    edges = sorted(tuple(edge[0] for edge in geometry.marking_edges(line, 0.0)) for line in lines.values())
    assert edges[-1] == pytest.approx((10.55, 10.25))  # broad, on the edge strip: the lane keeps its width
    assert edges[-2] == pytest.approx((6.575, 6.425))
    assert edges[-3] == pytest.approx((2.75, 2.60))
    lane = next(line for line in lines.values() if line.kind == "lane")
    dashes = geometry.dashes(lane)
    np.testing.assert_allclose(dashes[:, 0], 18.0 * np.arange(len(dashes)))
    assert dashes[-1, 1] <= 600


def test_furniture_stands_clear_of_the_pavement(geometry: RoadGeometry) -> None:
    parameters = geometry.parameters
    paved = geometry.sections["right"].paved_edge(0.0)[0]
    for name, rail in parameters.of_type(Guardrail).items():
        assert rail.offset == 0.0 if "median" in name else abs(rail.offset) > paved + 0.3
    posts = list(parameters.of_type(Delineator).values())
    assert all(abs(post.offset) >= paved + 0.5 - 1e-9 for post in posts)
    stations = [post.station for post in posts if post.offset > 0]
    np.testing.assert_allclose(np.diff(stations), 50.0)


@pytest.mark.parametrize("tolerance", [0.02, 0.005, 0.001])
def test_chords_stay_within_the_tolerance(geometry: RoadGeometry, tolerance: float) -> None:
    """The straight line between two sampled stations stays near the analytic point between them, at every boundary."""
    stations = sample_stations(geometry, tolerance)
    for share in (0.25, 0.5, 0.75):
        between = stations[:-1] + share * np.diff(stations)
        for offset in geometry.offsets(0.0)[0]:
            ends = geometry.point(stations, np.full(len(stations), offset))
            chord = ends[:-1] + share * np.diff(ends, axis=0)
            truth = geometry.point(between, np.full(len(between), offset))
            assert np.linalg.norm(chord - truth, axis=1).max() <= tolerance * 1.05


def test_every_kink_is_a_station(geometry: RoadGeometry) -> None:
    stations = sample_stations(geometry, 0.02)
    line = next(m for m in geometry.parameters.of_type(LineMarking).values() if m.kind == "lane")
    for kink in [*geometry.alignment.element_starts, *geometry.profile.breakpoints, *geometry.dashes(line).ravel()]:
        if 0 <= kink <= 600:
            assert np.abs(stations - kink).min() < 2e-4


def test_a_cross_section_must_suit_its_design_class() -> None:
    with pytest.raises(InputError, match=r"'RQ25': EKA1A allows RQ43\.5, RQ36, RQ31"):
        road(1, "road.cross_section=RQ25", "road.design_class=EKA1A")
    for section in STANDARD_CROSS_SECTIONS:
        design_class = design_class_of(section, "EKA1A")
        assert section in SECTIONS_OF_CLASS[design_class]
